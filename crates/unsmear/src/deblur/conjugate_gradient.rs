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
use super::vectors::{add, direction, dot, step, weighted_difference};
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
            control.check()?;
            let curvature = if square > enough { self.product(scratch) } else { 0.0 };
            if !(curvature > 0.0) {
                // The steps that were expected and are not needed.
                (taken..steps).try_for_each(|_| control.advance())?;
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
            if i == 0 {
                datum.operator().normal(direction, weights, blurred, product);
            } else {
                datum.operator().normal(direction, weights, blurred, share);
                add(product, share);
            }
        }
        self.smoothness.add_gradient(direction, self.lambda, product)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel_operator::KernelOperator;
    use crate::linear_operator::LinearOperator;
    use ndarray::Array2;

    #[test]
    fn the_gradient_vanishes_at_the_solution() {
        let shape = (9, 11);
        let kernel = Array2::from_shape_vec((1, 3), vec![0.2, 0.5, 0.3]).unwrap();
        let wave = |k: f32| Array2::from_shape_fn(shape, |(y, x)| (k * (3 * y + x) as f32).sin());
        let operator = KernelOperator::new(&kernel.view(), shape, 2).unwrap();
        let weights = wave(0.7).mapv(f32::abs);
        let datum = |k| Datum::new(&operator, &[wave(k).view()], Some(weights.view())).unwrap();
        let data = [datum(1.1), datum(0.4)];
        let weights: Vec<Vec<f32>> = data.iter().map(|d| d.weights().to_vec()).collect();
        let unknown = operator.unknown_shape();
        let smoothness = Smoothness::uniform(unknown, 1.0);
        let equations = NormalEquations {
            data: &data,
            weights: &weights,
            smoothness: &smoothness,
            lambda: 0.1,
            channel: 0,
        };
        let mut x = vec![0.0; unknown.0 * unknown.1];
        let mut scratch = Scratch::new(&data, x.len());
        // Dirty: nothing of an earlier solve may matter.
        scratch.share.fill(f32::NAN);
        scratch.direction.fill(f32::NAN);
        let control = Control::new();
        control.expect(200);
        equations.solve(&mut x, 200, &mut scratch, &control).unwrap();
        equations.residual(&x, &mut scratch);
        // Data of order 1 over some hundred single-precision steps.
        assert!(scratch.residual.iter().all(|r| r.abs() < 1e-5));
        assert_eq!(control.progress(), (200, 200));
        control.cancel();
        assert!(equations.solve(&mut x, 1, &mut scratch, &control).is_err());
    }
}
