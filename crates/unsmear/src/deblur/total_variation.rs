//! The default restoration: total variation from half size to full size, as strong as noise and residual ask for.
//!
//! 1. At half size, where blur is half as long, some turns from the blurred data; the result, doubled, is the start.
//! 2. At full size the first turns, with the prior of power 1/2 and lambda from the noise alone:
//!
//! ```text
//! lambda = max(0.085 s^(5/4), 0.4 s^(3/2) L^(-3/4)),      s^2 = sigma^2 + 0.15^2
//! ```
//!
//!    L the mean blur, at least 3 px; where that is beyond 7 px the second rule fades into the first, which is alone
//!    from 9 px on. A blur averages over L samples: the shorter it is and the stronger the noise, the more of the noise is
//!    left to the prior.
//!
//! 3. What the model cannot explain is treated as further noise, and single samples that it cannot explain at all weigh
//!    little (Cauchy, c = 3 max(sigma, 0.7)):
//!
//! ```text
//! s^2 <- s^2 + 60 max(0, rms(A x - b)^2 - s^2),      mismatch = rms(A x - b) / s
//! ```
//!
//! A right model overfits a little: mismatch is .6 to 1.03 and nothing changes. Above 1.06 after two turns, or above 2 after
//! the first, the motion is wrong somewhere: then the convex prior takes over, with lambda = 0.06 s^1.5. Units: grey
//! levels of a picture of ordinary contrast (`grey_levels.rs`).

use super::half_size::{Doubling, halve};
use super::look::{Look, data, operators};
use super::structure::{Power, Prior};
use super::variational::{Solution, Variational};
use crate::control::Control;
use crate::error::{Error, Result};
use crate::linear_operator::LinearOperator;
use crate::motion_operator::{MotionOperator, Taps};

/// lambda of unit noise, and the exponent of the noise: the best of grids over photographs at noise .3 to 5.
const STRENGTH: (f64, f64) = (0.085, 1.25);

/// The same where blur is short: lambda of unit noise at a blur of 1 px, and the exponent of the noise.
const SHORT_STRENGTH: (f64, f64) = (0.4, 1.5);

/// The exponent of the blur there.
const SHORTNESS: f64 = -0.75;

/// Mean blur, px, at which it begins to fade into the other, and at which it has: at 11 px and noise of 5 it gained four
/// photographs 0.07 dB, and took 0.6 dB from one other picture.
const FADING: (f64, f64) = (7.0, 9.0);

/// Mean blur, px, below which that rises no more: it leaves texture where the noise is measured, which reads too high.
const SHORTEST: f64 = 3.0;

/// Blur, px, below which a pixel counts as still.
const STILL: f32 = 0.5;

/// The same for the convex prior.
const CAUTIOUS_STRENGTH: (f64, f64) = (0.06, 1.5);

/// What the operator itself errs by, grey levels.
const MODEL_NOISE: f64 = 0.15;

/// Share of the unexplained residual's variance that counts as noise: residuals show only the part of an error that no
/// picture could explain.
const UNEXPLAINED: f64 = 60.0;

/// Cauchy's scale in deviations of the noise, and the least noise it supposes, grey levels.
const ROBUST: (f64, f64) = (3.0, 0.7);

/// Square of the mismatch above which the motion is clearly wrong before the solve has converged.
const CLEARLY_WRONG: f64 = 4.0;

/// Square of the mismatch above which it is wrong after two turns: long curved paths (rotation by 25 degrees) reach 1.03
/// with the right motion, lengths wrong by 15 % 1.04 to 1.3.
const WRONG: f64 = 1.12;

/// The prior of a right model.
const PRIOR: Prior = Prior { rounding: 1.0, power: Power::Half };

/// The prior of a wrong one.
const CAUTIOUS_PRIOR: Prior = Prior { rounding: 0.5, power: Power::One };

/// How long to work.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Effort {
    /// Turns and steps per turn at half size.
    pub half: (usize, usize),
    /// Turns, >= 1, and steps per turn at full size; a single turn adapts neither prior nor weights.
    pub full: (usize, usize),
    /// Taps of the operator at full size: splines cost more where blur is short, and gain more.
    pub taps: Taps,
}

impl Effort {
    /// Within 0.1 dB of convergence at noise of a grey level, 0.6 dB at none.
    pub const QUALITY: Self = Self { half: (5, 12), full: (4, 15), taps: Taps::ThriftySpline };
    /// About 1 dB below, 2 to 4 where blur is short, in half the time or less.
    pub const FAST: Self = Self { half: (5, 12), full: (2, 10), taps: Taps::Cubic };

    /// Conjugate-gradient steps for all channels.
    #[must_use]
    pub fn steps(&self, channels: usize) -> usize {
        [self.half, self.full].iter().map(|(turns, steps)| turns * steps * channels).sum()
    }
}

/// A restoration by total variation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TotalVariation {
    /// Standard deviation of the noise, grey levels, >= 0.
    pub noise: f64,
    /// lambda, grey levels; None: by the rules at the head of `total_variation.rs`.
    pub lambda: Option<f64>,
    /// How long to work.
    pub effort: Effort,
}

/// A restored picture and what was found on the way.
#[derive(Debug, Clone, PartialEq)]
pub struct Restored {
    /// The solution on the padded grid.
    pub solution: Solution,
    /// Pixels of padding on each side.
    pub pad: usize,
    /// lambda at the end, grey levels.
    pub lambda: f64,
    /// Residual of the first turns over what is allowed: 1.06 times the noise, the operator's own error included, or twice the
    /// noise after a single turn. Above 1 the motion is wrong somewhere.
    pub mismatch: f64,
}

impl TotalVariation {
    /// Restores the one picture that all `looks` show. Looks that are given away (a `Vec`) are gone before the long
    /// solve: it has no use for paths.
    ///
    /// # Errors
    /// [`Error::Value`] without looks or for parameters out of range; [`Error::Shape`] for shapes that differ;
    /// [`Error::Cancelled`].
    pub fn restore<'a>(
        &self,
        given: impl AsRef<[Look<'a>]>,
        control: &Control,
    ) -> Result<Restored> {
        let looks = given.as_ref();
        let Some(channels) = looks.first().map(|look| look.planes.len()) else {
            return Err(Error::value("looks", "at least one", 0));
        };
        control.expect(self.effort.steps(channels));
        let floor = self.noise.powi(2) + MODEL_NOISE.powi(2);
        let lambda = self.lambda.unwrap_or_else(|| first_strength(floor, mean_blur(looks)));
        let (operators, pad) = operators(looks, self.effort.taps)?;
        let start = self.half_size(looks, &operators[0], lambda, control)?;
        let data = data(looks, &operators)?;
        drop(given);
        let (turns, steps) = self.effort.full;
        let first = stage(PRIOR, lambda, (1, steps));
        let mut solution = first.solve(&data, Some(start), control)?;
        let (mut left, mut limit) = (turns.saturating_sub(1), CLEARLY_WRONG);
        if left > 1 && solution.residual.powi(2) <= CLEARLY_WRONG * floor {
            let taken = solution.steps;
            solution = first.solve(&data, Some(solution.channels), control)?;
            solution.steps += taken;
            (left, limit) = (left - 1, WRONG);
        }
        let mut last = stage(PRIOR, lambda, (left, steps));
        let power = solution.residual.powi(2);
        if power > limit * floor {
            last.prior = Some(CAUTIOUS_PRIOR);
            let allowed = floor + UNEXPLAINED * (power - floor);
            last.lambda = self.lambda.unwrap_or(strength(CAUTIOUS_STRENGTH, allowed));
        }
        last.robust = Some(ROBUST.0 * self.noise.max(ROBUST.1));
        if left > 0 {
            let taken = solution.steps;
            solution = last.solve(&data, Some(solution.channels), control)?;
            solution.steps += taken;
        }
        let mismatch = (power / (limit * floor)).sqrt();
        Ok(Restored { solution, pad, lambda: last.lambda, mismatch })
    }

    /// The start at full size: restored at half size, doubled.
    fn half_size(
        &self,
        looks: &[Look<'_>],
        full: &MotionOperator,
        lambda: f64,
        control: &Control,
    ) -> Result<Vec<Vec<f32>>> {
        let halves: Vec<_> =
            looks.iter().map(|look| halve(&look.planes, &look.weights.view())).collect();
        let small: Vec<Look<'_>> = looks
            .iter()
            .zip(&halves)
            .map(|(look, (planes, weights))| Look {
                paths: look.paths.halved(),
                planes: planes.iter().map(|plane| plane.view()).collect(),
                weights: weights.clone(),
                ceiling: look.ceiling,
            })
            .collect();
        let (operators, pad) = operators(&small, Taps::Cubic)?;
        let data = data(&small, &operators)?;
        let solution = stage(PRIOR, lambda, self.effort.half).solve(&data, None, control)?;
        let doubling = Doubling {
            from: operators[0].unknown_shape(),
            from_pad: pad,
            to: full.unknown_shape(),
            to_pad: full.pad(),
        };
        solution.channels.iter().map(|plane| doubling.apply(plane, control)).collect()
    }
}

fn stage(prior: Prior, lambda: f64, (turns, steps): (usize, usize)) -> Variational {
    Variational { lambda, prior: Some(prior), robust: None, turns, steps }
}

/// Mean blur of the pixels that move, px; infinite if none does.
fn mean_blur(looks: &[Look<'_>]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for look in looks {
        let velocity = &look.paths.velocity;
        for (u, v) in velocity.u.iter().zip(&velocity.v) {
            let length = (u * u + v * v).sqrt();
            // Unknown motion compares to nothing.
            if length >= STILL {
                sum += f64::from(length);
                count += 1.0;
            }
        }
    }
    if count > 0.0 { sum / count } else { f64::INFINITY }
}

/// lambda for a right motion; see the head of this file.
fn first_strength(noise_power: f64, blur: f64) -> f64 {
    let long = strength(STRENGTH, noise_power);
    let short = strength(SHORT_STRENGTH, noise_power) * blur.max(SHORTEST).powf(SHORTNESS);
    let share = ((FADING.1 - blur) / (FADING.1 - FADING.0)).clamp(0.0, 1.0);
    long + share * (short - long).max(0.0)
}

fn strength((unit, exponent): (f64, f64), noise_power: f64) -> f64 {
    unit * noise_power.powf(0.5 * exponent)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strength_grows_with_noise_and_falls_with_blur() {
        let at = |noise: f64, blur| first_strength(noise * noise, blur);
        for noise in [0.3, 1.0, 5.0] {
            assert!(at(noise, 3.0) > at(noise, 5.0) && at(noise, 5.0) >= at(noise, 40.0));
            assert_eq!(at(noise, 1.0), at(noise, 3.0));
            assert_eq!(at(noise, f64::INFINITY), 0.085 * noise.powf(1.25));
        }
        // 0.4 / 3^(3/4) against 0.085.
        assert!((at(1.0, 3.0) / 0.085 - 2.064).abs() < 1e-2);
        let (short, half) = (0.4 * 5f64.powf(1.5), at(5.0, 8.0));
        assert!((at(5.0, 7.0) - short * 7f64.powf(-0.75)).abs() < 1e-9);
        let long = at(5.0, 9.0);
        assert!((half - 0.5 * (long + short * 8f64.powf(-0.75))).abs() < 1e-9);
    }
}
