//! Restoration as the least of a data term and a prior, by iteratively reweighted least squares.
//!
//! ```text
//! min_x  1/2 sum_d sum_i w_di rho((A_d x - b_d)_i)  +  lambda R(x)
//! rho'(r) = r,  or with a scale c:  r / (1 + r^2 / c^2)   (Cauchy)
//! ```
//!
//! R is the prior of `structure.rs`. Each turn replaces both terms by quadratic forms that touch them at the present x
//! and takes some conjugate-gradient steps on their sum. All looks share x; channels share the weights of the data
//! (r^2 is their mean square) and of the prior. A clipped sample counts only while A x is below it. Padding pixels are unknowns like all others. Units: grey levels.
//!
//! P. W. Holland & R. E. Welsch, Commun. Stat. A 6 (1977) 813-827,
//! [10.1080/03610927708827533](https://doi.org/10.1080/03610927708827533), for the reweighting.

use super::conjugate_gradient::{NormalEquations, Scratch};
use super::datum::{Datum, check_looks, first_guess, residual_rms};
use super::smoothness::Smoothness;
use super::structure::Prior;
use crate::control::Control;
use crate::error::{Error, Result, require};

/// Weight of smoothness while nothing is known of the picture: an edge of 8 grey levels per px.
const FIRST_WEIGHT: f32 = 0.125;

/// Strength, prior and effort of a restoration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Variational {
    /// Weight lambda of the prior, grey levels, > 0.
    pub lambda: f64,
    /// The prior; None: half the square of the gradient (Tikhonov).
    pub prior: Option<Prior>,
    /// Cauchy scale c, grey levels, > 0, in force from the second turn on (from the first on a warm start); None: least squares.
    pub robust: Option<f64>,
    /// Renewals of the weights, >= 1.
    pub turns: usize,
    /// Conjugate-gradient steps per turn, >= 1.
    pub steps: usize,
}

/// A restored picture on the padded grid.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// Channels, packed rows of the unknown's shape, grey levels.
    pub channels: Vec<Vec<f32>>,
    /// Conjugate-gradient steps taken, all channels together.
    pub steps: usize,
    /// Root mean square of A x - b over the believed samples (given weights) inside a margin, grey levels; NaN if none.
    pub residual: f64,
}

impl Variational {
    /// Solves from `start` (channels of the unknown's shape), or from the first look when None.
    ///
    /// # Errors
    /// [`Error::Value`] for parameters out of range, no data, or data that differ in channels or unknown; [`Error::Cancelled`].
    pub fn solve(
        &self,
        data: &[Datum<'_>],
        start: Option<Vec<Vec<f32>>>,
        control: &Control,
    ) -> Result<Solution> {
        let shape = self.validate(data, start.as_deref())?;
        let warm = start.is_some();
        let mut channels = start.unwrap_or_else(|| first_guess(&data[0]));
        let mut scratch = Scratch::new(data, shape.0 * shape.1);
        let mut smoothness =
            Smoothness::uniform(shape, if self.prior.is_some() { FIRST_WEIGHT } else { 1.0 });
        let mut weights: Vec<Vec<f32>> = data.iter().map(|d| d.weights().to_vec()).collect();
        let mut taken = 0;
        for turn in 0..self.turns {
            control.check()?;
            if warm || turn > 0 {
                if let Some(prior) = &self.prior {
                    let Scratch { residual, direction, product, .. } = &mut scratch;
                    prior.renew(&channels, &mut smoothness, [residual, direction, product]);
                }
                let clipped = data.iter().any(|datum| datum.ceiling().is_finite());
                if self.robust.is_some() || clipped {
                    reweight(data, &channels, self.robust, &mut weights, &mut scratch);
                }
            }
            for (channel, x) in channels.iter_mut().enumerate() {
                let equations = NormalEquations {
                    data,
                    weights: &weights,
                    smoothness: &smoothness,
                    lambda: self.lambda as f32,
                    channel,
                };
                taken += equations.solve(x, self.steps, &mut scratch, control)?;
            }
        }
        let residual = residual_rms(data, &channels, &mut scratch.blurred);
        Ok(Solution { channels, steps: taken, residual })
    }

    fn validate(&self, data: &[Datum<'_>], start: Option<&[Vec<f32>]>) -> Result<(usize, usize)> {
        require("lambda", self.lambda, "finite and positive", |l| l > 0.0)?;
        if let Some(scale) = self.robust {
            require("robust", scale, "finite and positive", |c| c > 0.0)?;
        }
        if self.turns == 0 || self.steps == 0 {
            return Err(Error::value("turns and steps", "at least 1", 0));
        }
        let shape = check_looks(data)?;
        let channels = data[0].planes().len();
        if let Some(start) = start
            && (start.len() != channels || start.iter().any(|c| c.len() != shape.0 * shape.1))
        {
            return Err(Error::value("start", "channels of the unknown's shape", start.len()));
        }
        Ok(shape)
    }
}

/// Given weights times Cauchy's, from the residuals of all channels; 0 where a clipped sample is explained by any
/// picture as bright as this one.
fn reweight(
    data: &[Datum<'_>],
    channels: &[Vec<f32>],
    scale: Option<f64>,
    weights: &mut [Vec<f32>],
    scratch: &mut Scratch,
) {
    let share = scale.map_or(0.0, |c| (1.0 / (c * c * channels.len() as f64)) as f32);
    for (datum, weights) in data.iter().zip(weights) {
        // First the sum of squares, then the weight.
        weights.fill(0.0);
        let blurred = &mut scratch.blurred[..weights.len()];
        for (x, plane) in channels.iter().zip(datum.planes()) {
            datum.operator().apply(x, blurred);
            for (sum, (&a, &b)) in weights.iter_mut().zip(blurred.iter().zip(plane)) {
                let clipped = b >= datum.ceiling() && a >= b;
                *sum += if clipped { f32::INFINITY } else { share * (a - b) * (a - b) };
            }
        }
        for (weight, given) in weights.iter_mut().zip(datum.weights()) {
            *weight = given / (1.0 + *weight);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deblur::structure::Power;
    use crate::kernel_operator::KernelOperator;
    use crate::linear_operator::LinearOperator;
    use ndarray::{Array2, ArrayView2};

    const SHAPE: (usize, usize) = (24, 30);

    fn box_of(width: usize) -> KernelOperator {
        let kernel = Array2::from_elem((1, width), 1.0 / width as f32);
        KernelOperator::new(&kernel.view(), SHAPE, 6).unwrap()
    }

    /// Blocks of 50 grey levels on the padded grid.
    fn blocks(operator: &KernelOperator) -> Vec<f32> {
        let (rows, columns) = operator.unknown_shape();
        let block = |i: usize| {
            if (i / columns / 9 + i % columns / 8).is_multiple_of(2) { 50.0 } else { 0.0 }
        };
        (0..rows * columns).map(block).collect()
    }

    fn blurred(operator: &KernelOperator) -> Array2<f32> {
        let mut out = Array2::zeros(SHAPE);
        operator.apply(&blocks(operator), out.as_slice_mut().unwrap());
        out
    }

    fn method() -> Variational {
        let prior = Some(Prior { rounding: 0.5, power: Power::One });
        Variational { lambda: 0.1, prior, robust: None, turns: 8, steps: 15 }
    }

    /// Root mean square error over the data's own pixels, 4 px from their edge.
    fn error(operator: &KernelOperator, channel: &[f32]) -> f32 {
        let (sharp, columns) = (blocks(operator), operator.unknown_shape().1);
        let inside = (10..26).flat_map(|y| (10..32).map(move |x| y * columns + x));
        let sum: f32 = inside.map(|i| (sharp[i] - channel[i]).powi(2)).sum();
        (sum / (16.0 * 22.0)).sqrt()
    }

    #[test]
    fn blocks_come_back_from_a_box() {
        let operator = box_of(5);
        let planes = [blurred(&operator)];
        let data = [Datum::new(&operator, &planes.each_ref().map(|p| p.view()), None).unwrap()];
        let found = method().solve(&data, None, &Control::new()).unwrap();
        // Blur errs by 14; what is left is at corners, and in what 120 steps have not reached.
        let alone = error(&operator, &found.channels[0]);
        assert!(alone < 5.0, "{alone}");
        assert!(found.residual < 0.6 && found.steps == 120);
        let other = box_of(3);
        let both = [
            Datum::new(&operator, &[planes[0].view()], None).unwrap(),
            Datum::new(&other, &[blurred(&other).view()], None).unwrap(),
        ];
        let joint = method().solve(&both, None, &Control::new()).unwrap();
        assert!(error(&operator, &joint.channels[0]) < 0.8 * alone);
    }

    #[test]
    fn outliers_are_not_believed_and_unknown_or_clipped_samples_not_missed() {
        let operator = box_of(5);
        let clean = blurred(&operator);
        let mut plane = clean.clone();
        plane[(12, 15)] += 200.0;
        let solve = |plane: ArrayView2<'_, f32>, robust, ceiling| {
            let datum = Datum::new(&operator, &[plane], None).unwrap().with_ceiling(ceiling);
            let method = Variational { lambda: 1.0, robust, ..method() };
            let found = method.solve(&[datum], None, &Control::new()).unwrap();
            error(&operator, &found.channels[0])
        };
        let none = f32::INFINITY;
        let best = solve(clean.view(), None, none);
        let (fooled, robust) =
            (solve(plane.view(), None, none), solve(plane.view(), Some(3.0), none));
        assert!(robust < 0.8 * fooled && fooled > 2.0 * best, "{best} {robust} {fooled}");
        plane[(12, 15)] = f32::NAN;
        assert!(solve(plane.view(), None, none) < 1.5 * best);
        let clipped = clean.mapv(|s| s.min(35.0));
        let (fooled, known) =
            (solve(clipped.view(), None, none), solve(clipped.view(), None, 35.0));
        assert!(known < 0.95 * fooled, "{known} {fooled}");
    }

    #[test]
    fn equal_channels_are_solved_like_one_and_bytes_do_not_depend_on_threads() {
        let operator = box_of(5);
        let plane = blurred(&operator);
        let run = |channels: usize, threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let data = [Datum::new(&operator, &vec![plane.view(); channels], None).unwrap()];
            let method = Variational { robust: Some(2.0), ..method() };
            pool.install(|| method.solve(&data, None, &Control::new())).unwrap()
        };
        let grey = run(1, 1);
        assert_eq!(grey, run(1, 3));
        // The mean over channels of equal products rounds differently from the product, which a prior that is
        // not convex may amplify.
        for channel in run(3, 2).channels {
            assert!(channel.iter().zip(&grey.channels[0]).all(|(a, b)| (a - b).abs() < 0.5));
        }
    }

    #[test]
    fn refuses_what_it_cannot_solve() {
        let operator = box_of(3);
        let plane = blurred(&operator);
        let datum = || Datum::new(&operator, &[plane.view()], None).unwrap();
        let message = |method: Variational, data: &[Datum<'_>]| {
            method.solve(data, None, &Control::new()).unwrap_err().to_string()
        };
        assert_eq!(message(method(), &[]), "data must be at least one datum, got 0");
        let bad = Variational { lambda: -1.0, ..method() };
        assert_eq!(message(bad, &[datum()]), "lambda must be finite and positive, got -1");
        let start = Some(vec![vec![0.0; 3]]);
        assert!(method().solve(&[datum()], start, &Control::new()).is_err());
    }
}
