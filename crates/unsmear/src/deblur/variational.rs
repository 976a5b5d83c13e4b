//! Restoration as the least of a data term and a prior, by iteratively reweighted least squares.
//!
//! ```text
//! min_x  1/2 sum_d sum_i w_di rho((A_d x - b_d)_i)  +  lambda R(x)
//! rho'(r) = r,  or with a scale c:  r / (1 + r^2 / c^2)   (Cauchy)
//! ```
//!
//! R is the prior of `structure.rs`. Each turn replaces both terms by quadratic forms that touch them at the present x
//! and takes some conjugate-gradient steps on their sum. All looks share x; channels share the weights of the data
//! (r^2 is their mean square) and of the prior. Padding pixels are unknowns like all others. Units: grey levels.
//!
//! P. W. Holland & R. E. Welsch, Commun. Stat. A 6 (1977) 813-827,
//! [10.1080/03610927708827533](https://doi.org/10.1080/03610927708827533), for the reweighting.

use super::conjugate_gradient::{NormalEquations, Scratch};
use super::datum::Datum;
use super::smoothness::Smoothness;
use super::structure::Prior;
use crate::control::Control;
use crate::error::{Error, Result, require};

/// Weight of smoothness while nothing is known of the picture: an edge of 8 grey levels per px.
const FIRST_WEIGHT: f32 = 0.125;

/// Pixels at the edge of the data that do not count in the residual: there the padding can explain anything.
const MARGIN: usize = 8;

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
        let mut smoothness = Smoothness::uniform(shape, if self.prior.is_some() { FIRST_WEIGHT } else { 1.0 });
        let mut weights: Vec<Vec<f32>> = data.iter().map(|d| d.weights().to_vec()).collect();
        let mut taken = 0;
        for turn in 0..self.turns {
            control.check()?;
            if warm || turn > 0 {
                if let Some(prior) = &self.prior {
                    let Scratch { residual, direction, product, .. } = &mut scratch;
                    prior.renew(&channels, &mut smoothness, [residual, direction, product]);
                }
                if let Some(scale) = self.robust {
                    reweight(data, &channels, scale, &mut weights, &mut scratch);
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

/// The shape of the unknown that all looks share.
///
/// # Errors
/// [`Error::Value`] when there is none, or they differ in it or in their number of channels.
pub(super) fn check_looks(data: &[Datum<'_>]) -> Result<(usize, usize)> {
    let Some(first) = data.first() else {
        return Err(Error::value("data", "at least one datum", 0));
    };
    let (shape, channels) = (first.operator().unknown_shape(), first.planes().len());
    if data.iter().any(|d| d.operator().unknown_shape() != shape) {
        return Err(Error::value("data", "operators with one unknown shape", "several"));
    }
    if data.iter().any(|d| d.planes().len() != channels) {
        return Err(Error::value("data", "looks of the same number of channels", "others"));
    }
    Ok(shape)
}

/// The data of a look continued over the padding by their edge samples; unknown samples take the last known of their row.
pub(super) fn first_guess(datum: &Datum<'_>) -> Vec<Vec<f32>> {
    let operator = datum.operator();
    let ((rows, columns), pad) = (operator.unknown_shape(), operator.pad());
    let (height, width) = operator.data_shape();
    let guess = |plane: &Vec<f32>| {
        let mut out = Vec::with_capacity(rows * columns);
        let mut line = vec![0.0; width];
        for y in 0..rows {
            let from = y.saturating_sub(pad).min(height - 1) * width;
            let weights = &datum.weights()[from..from + width];
            let mut last = weights.iter().position(|&w| w > 0.0).map_or(0.0, |i| plane[from + i]);
            for x in 0..width {
                if weights[x] > 0.0 {
                    last = plane[from + x];
                }
                line[x] = last;
            }
            out.extend((0..columns).map(|x| line[x.saturating_sub(pad).min(width - 1)]));
        }
        out
    };
    datum.planes().iter().map(guess).collect()
}

/// Given weights times Cauchy's, from the residuals of all channels.
fn reweight(
    data: &[Datum<'_>],
    channels: &[Vec<f32>],
    scale: f64,
    weights: &mut [Vec<f32>],
    scratch: &mut Scratch,
) {
    let share = (1.0 / (scale * scale * channels.len() as f64)) as f32;
    for (datum, weights) in data.iter().zip(weights) {
        // First the sum of squares, then the weight.
        weights.fill(0.0);
        let blurred = &mut scratch.blurred[..weights.len()];
        for (x, plane) in channels.iter().zip(datum.planes()) {
            datum.operator().apply(x, blurred);
            for (sum, (a, b)) in weights.iter_mut().zip(blurred.iter().zip(plane)) {
                *sum += (a - b) * (a - b);
            }
        }
        for (weight, given) in weights.iter_mut().zip(datum.weights()) {
            *weight = given / (1.0 + share * *weight);
        }
    }
}

/// See [`Solution::residual`].
pub(super) fn residual_rms(data: &[Datum<'_>], channels: &[Vec<f32>], blurred: &mut [f32]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for datum in data {
        let (height, width) = datum.operator().data_shape();
        let margin = MARGIN.min((height.min(width).saturating_sub(1)) / 2);
        let blurred = &mut blurred[..height * width];
        for (x, plane) in channels.iter().zip(datum.planes()) {
            datum.operator().apply(x, blurred);
            for y in margin..height - margin {
                let inside = y * width + margin..(y + 1) * width - margin;
                let weights = &datum.weights()[inside.clone()];
                for ((a, b), &w) in blurred[inside.clone()].iter().zip(&plane[inside]).zip(weights) {
                    sum += f64::from(w) * f64::from(a - b).powi(2);
                    count += f64::from(w);
                }
            }
        }
    }
    (sum / count).sqrt()
}
