//! Conjugate gradients on the normal equations of weighted data and weighted smoothness.
//!
//! ```text
//! ( sum_d A_d' W_d A_d + lambda D' T D ) x = sum_d A_d' W_d b_d
//! ```
//!
//! started from a given x. Nothing is stored but five vectors, and one more of the data's size; every step costs one
//! A and one A' per datum. M. R. Hestenes & E. Stiefel, J. Res. NBS 49 (1952) 409-436,
//! [10.6028/jres.049.044](https://doi.org/10.6028/jres.049.044).

use super::datum::Datum;
use super::smoothness::Smoothness;
use super::vectors::{add, direction, dot, scale_by, step, weighted_difference};
use crate::control::Control;
use crate::error::Result;

/// Share of the first gradient's square at which the solution is exact to single precision.
const SETTLED: f64 = 1e-12;

/// Vectors of the size of the unknown, reused by every solve.
pub(super) struct Scratch {
    pub(super) residual: Vec<f32>,
    pub(super) direction: Vec<f32>,
    pub(super) product: Vec<f32>,
    /// A second look's share of the product; empty for one look.
    pub(super) share: Vec<f32>,
    /// Of the size of the largest data.
    pub(super) blurred: Vec<f32>,
}

impl Scratch {
    pub(super) fn new(data: &[Datum<'_>], unknowns: usize) -> Self {
        let plane = || vec![0.0; unknowns];
        let largest = data.iter().map(|datum| datum.weights().len()).max().unwrap_or_default();
        Self {
            residual: plane(),
            direction: plane(),
            product: plane(),
            share: if data.len() > 1 { plane() } else { Vec::new() },
            blurred: vec![0.0; largest],
        }
    }
}

/// The equations of one channel.
pub(super) struct NormalEquations<'a> {
    pub(super) data: &'a [Datum<'a>],
    /// Weight of every sample of each datum, robust share included.
    pub(super) weights: &'a [Vec<f32>],
    pub(super) smoothness: &'a Smoothness,
    pub(super) lambda: f32,
    pub(super) channel: usize,
}

impl NormalEquations<'_> {
    /// Up to `steps` steps from `x`; returns how many were taken.
    pub(super) fn solve(
        &self,
        x: &mut [f32],
        steps: usize,
        scratch: &mut Scratch,
        control: &Control,
    ) -> Result<usize> {
        control.check()?;
        self.residual(x, scratch);
        scratch.direction.copy_from_slice(&scratch.residual);
        let mut square = dot(&scratch.residual, &scratch.residual);
        let enough = SETTLED * square;
        for taken in 0..steps {
            if square <= enough {
                return Ok(taken);
            }
            control.check()?;
            let curvature = self.product(scratch);
            if !(curvature > 0.0) {
                return Ok(taken);
            }
            let alpha = (square / curvature) as f32;
            let Scratch { residual, direction: p, product, .. } = scratch;
            let left = step(x, p, residual, product, alpha);
            direction(p, residual, (left / square) as f32);
            square = left;
            control.advance()?;
        }
        Ok(steps)
    }

    /// The negative gradient at `x`, into `scratch.residual`.
    fn residual(&self, x: &[f32], scratch: &mut Scratch) {
        let Scratch { residual, product, blurred, .. } = scratch;
        residual.fill(0.0);
        self.smoothness.add_gradient(x, -self.lambda, residual);
        for (datum, weights) in self.data.iter().zip(self.weights) {
            let blurred = &mut blurred[..weights.len()];
            datum.operator().apply(x, blurred);
            weighted_difference(blurred, &datum.planes()[self.channel], weights);
            datum.operator().adjoint(blurred, product);
            add(residual, product);
        }
    }

    /// The matrix times `scratch.direction`, into `scratch.product`; returns their inner product.
    fn product(&self, scratch: &mut Scratch) -> f64 {
        let Scratch { direction, product, share, blurred, .. } = scratch;
        for (i, (datum, weights)) in self.data.iter().zip(self.weights).enumerate() {
            let blurred = &mut blurred[..weights.len()];
            datum.operator().apply(direction, blurred);
            scale_by(blurred, weights);
            if i == 0 {
                datum.operator().adjoint(blurred, product);
            } else {
                datum.operator().adjoint(blurred, share);
                add(product, share);
            }
        }
        self.smoothness.add_gradient(direction, self.lambda, product)
    }
}
