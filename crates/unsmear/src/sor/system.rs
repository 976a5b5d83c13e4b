//! The equations that [`super`] relaxes: made row by row when they are wanted, or kept as packed planes.

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

/// Equations made row by row, linear around the planes `[u, v]` that the solution starts from. Rows are asked for in
/// any order, from several threads, and more than once.
pub trait SystemRows: Sync {
    /// Fills rows `[a11, a12, a22, c1, c2]` of row `y`.
    fn data(&self, y: usize, start: [&[f32]; 2], out: [&mut [f32]; 5]);

    /// Fills rows `[gx, gy]` of row `y`; see [`SorSystem`].
    fn diffusivities(&self, y: usize, start: [&[f32]; 2], out: [&mut [f32]; 2]);
}

impl SorSystem<'_> {
    fn copy<const N: usize>(&self, planes: [&[f32]; N], y: usize, out: [&mut [f32]; N]) {
        for (plane, out) in planes.into_iter().zip(out) {
            out.copy_from_slice(&plane[y * self.width..(y + 1) * self.width]);
        }
    }
}

impl SystemRows for SorSystem<'_> {
    fn data(&self, y: usize, _: [&[f32]; 2], out: [&mut [f32]; 5]) {
        self.copy([self.a11, self.a12, self.a22, self.c1, self.c2], y, out);
    }

    fn diffusivities(&self, y: usize, _: [&[f32]; 2], out: [&mut [f32]; 2]) {
        self.copy([self.gx, self.gy], y, out);
    }
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
