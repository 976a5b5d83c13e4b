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

use super::level::Settings;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flow::coarse_to_fine::CoarseToFine;

    /// Alpha after noise of deviation `sigma`: sums of 12 uniform numbers are nearly normal.
    fn alpha(sigma: f32) -> f32 {
        let mut state = 1u32;
        let mut uniform = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 16_777_216.0
        };
        let mut normal = || (0..12).map(|_| uniform()).sum::<f32>() - 6.0;
        let picture: Vec<f32> = (0..96 * 96).map(|_| sigma * normal()).collect();
        let mut settings = CoarseToFine::balanced().settings().unwrap();
        adapt(&mut settings, &picture, (96, 96), &Control::new()).unwrap();
        settings.alpha
    }

    #[test]
    fn noise_smooths_and_its_absence_does_not() {
        assert_eq!(alpha(0.0), 0.11);
        assert_eq!(alpha(1.8), 0.11, "photographs read as much");
        // n = 7 within 10 %: s = sqrt(49 - 5.1)/1.4 = 4.7, alpha = 0.11 (1 + 4.7/4).
        assert!((alpha(7.0) - 0.239).abs() < 0.025, "{}", alpha(7.0));
        assert!(alpha(20.0) > alpha(10.0));
    }
}
