//! Tikhonov: least squares with half the square of the gradient as prior, by conjugate gradients.
//!
//! ```text
//! min_x  1/2 sum_i w_i (A x - b)_i^2  +  lambda/2 sum |grad x|^2,      lambda = 0.002 (sigma^2 + 0.15^2)
//! ```
//!
//! The Wiener filter of pictures with spectrum 1 / |w|^2, for any motion and with unknown borders; linear, so that edges
//! ring where the prior of total variation keeps them. lambda has no unit: grey levels squared of the noise over those
//! of the picture's gradient. A. N. Tikhonov, Soviet Math. Dokl. 4 (1963) 1035-1038.

use super::look::{Look, data, operators};
use super::total_variation::Restored;
use super::variational::Variational;
use crate::control::Control;
use crate::error::Result;
use crate::motion_operator::Taps;

/// lambda of unit noise: best on photographs.
const STRENGTH: f64 = 0.002;

/// What the operator itself errs by, grey levels.
const MODEL_NOISE: f64 = 0.15;

/// Steps: the gain has settled to 0.1 dB.
const STEPS: usize = 60;

/// A restoration with a quadratic prior.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tikhonov {
    /// Standard deviation of the noise, grey levels, >= 0.
    pub noise: f64,
    /// lambda, without unit; None: from the noise.
    pub lambda: Option<f64>,
}

impl Tikhonov {
    /// Restores one picture.
    ///
    /// # Errors
    /// [`Error::Value`](crate::Error::Value) for parameters out of range; [`Error::Shape`](crate::Error::Shape) for
    /// shapes that differ; [`Error::Cancelled`](crate::Error::Cancelled).
    pub fn restore(&self, look: &Look<'_>, control: &Control) -> Result<Restored> {
        control.expect(STEPS * look.planes.len());
        let looks = std::slice::from_ref(look);
        let floor = self.noise.powi(2) + MODEL_NOISE.powi(2);
        let lambda = self.lambda.unwrap_or(STRENGTH * floor);
        let (operators, pad) = operators(looks, Taps::Cubic)?;
        let method = Variational { lambda, prior: None, robust: None, turns: 1, steps: STEPS };
        let solution = method.solve(&data(looks, &operators)?, None, control)?;
        let mismatch = solution.residual / floor.sqrt();
        Ok(Restored { solution, pad, lambda, mismatch })
    }
}
