//! What noise changes in the parameters.
//!
//! With the noise `n` of the reference frame (see [`crate::immerkaer_noise`]) in grey levels of the
//! standardised sequence and
//!
//! ```text
//! s = sqrt(max(0, n^2 - 2.25^2))/1.4
//! alpha <- alpha (1 + min(s, 5)/4 + 0.15 max(s - 5, 0))
//! k     <- k (1 - min(s, 5)/20),   sigma <- sigma + 0.08 min(s, 10)
//! ```
//!
//! smoothness grows, edges of the picture are trusted less and read from a smoother picture. What is
//! subtracted is the reading of clean photographs; 1.4 turns standardised grey levels into those of
//! the four photographs (standard deviation 32 to 54) whose best `alpha` the rule follows.

use super::refine::Settings;
use crate::control::Control;
use crate::error::Result;
use crate::immerkaer_noise::immerkaer_noise;

/// Reading of clean photographs, grey levels.
const CLEAN: f64 = 2.25;
/// Standardised grey levels per grey level of the photographs the rule was fitted on.
const UNIT: f64 = 1.4;
/// Noise at which the slow growth begins, and at which edges are trusted least.
const KNEE: f64 = 5.0;

/// Adapts `settings` to the noise of a packed picture of the given shape.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn adapt(
    settings: &mut Settings,
    picture: &[f32],
    (height, width): (usize, usize),
    control: &Control,
) -> Result<()> {
    let noise = immerkaer_noise(picture, height, width, control)?;
    let s = (noise * noise - CLEAN * CLEAN).max(0.0).sqrt() / UNIT;
    let growth = 1.0 + 0.25 * s.min(KNEE) + 0.15 * (s - KNEE).max(0.0);
    settings.alpha *= growth as f32;
    settings.edges.sensitivity *= 1.0 - 0.05 * s.min(KNEE);
    settings.edges.sigma += 0.08 * s.min(2.0 * KNEE);
    Ok(())
}
