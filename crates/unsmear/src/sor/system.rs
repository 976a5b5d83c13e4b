//! The equations that [`super`] relaxes, as packed planes.

use crate::error::{Error, Result};

/// The equations of all pixels; packed rows of `width` samples, `height` of them.
#[derive(Debug, Clone, Copy)]
pub struct SorSystem<'a> {
    /// Upper left entry of A.
    pub a11: &'a [f32],
    /// Off-diagonal entry of A.
    pub a12: &'a [f32],
    /// Lower right entry of A.
    pub a22: &'a [f32],
    /// First component of the right-hand side c.
    pub c1: &'a [f32],
    /// Second component of the right-hand side c.
    pub c2: &'a [f32],
    /// Diffusivity between (y, x) and (y, x + 1); the last column is ignored.
    pub gx: &'a [f32],
    /// Diffusivity between (y, x) and (y + 1, x); the last row is ignored.
    pub gy: &'a [f32],
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
}

impl SorSystem<'_> {
    pub(super) fn check(&self, u: &[f32], v: &[f32]) -> Result<()> {
        let fields = [
            ("a11", self.a11),
            ("a12", self.a12),
            ("a22", self.a22),
            ("c1", self.c1),
            ("c2", self.c2),
            ("gx", self.gx),
            ("gy", self.gy),
            ("u", u),
            ("v", v),
        ];
        for (argument, samples) in fields {
            if samples.len() != self.height * self.width {
                let expected = format!("({} x {},)", self.height, self.width);
                return Err(Error::shape(argument, expected, &[samples.len()]));
            }
        }
        Ok(())
    }
}
