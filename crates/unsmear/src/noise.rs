//! Standard deviation of white noise in a picture blurred by known motion.
//!
//! Motion attenuates what varies along it: of a blurred picture's spectrum, the part at high frequency along the
//! motion is nearly noise alone. Per tile of 32 x 32 px, with the Hann window normalised to mean square 1,
//!
//! ```text
//! n_tile = mean |DFT(window * tile)|^2 / 32^2      over  |w . d| > 1.8 rad/px and |w| < 3.6 rad/px
//! sigma  = square root of the 20 % quantile of n_tile over the picture
//! ```
//!
//! with d the direction of the tile's mean motion. Tiles that move less than 1 px use |w| > 2.2 instead, and the low
//! quantile passes over those whose texture still fills the band. The result is in the units of the picture; noise
//! that is not white (compression, demosaicking) is measured in this band only. Validity: at least one tile without
//! unknown (NaN) samples, else the answer is 0; a picture textured everywhere and hardly moving is overrated.

use std::f64::consts::{PI, TAU};

use ndarray::{ArrayView2, s};
use rayon::prelude::*;

use crate::array::require_same;
use crate::control::Control;
use crate::error::Result;
use crate::flow_field::FlowView;
use crate::fourier::{Complex64, Fft2};
use crate::real::Real;

/// Side of a tile, px: resolves the band in 32 steps and still finds places without texture.
const TILE: usize = 32;

/// Most tiles measured; the quantile of a thousand is within 2 % of all.
const MOST_TILES: usize = 1024;

/// Lowest frequency along the motion that counts as noise, rad/px: past the main lobe of any blur above 3.5 px.
const ALONG: f64 = 1.8;

/// Lowest radial frequency that counts as noise where nothing moves, rad/px.
const STILL: f64 = 2.2;

/// Greatest radial frequency used, rad/px: beyond it lie the corners that cameras and codecs suppress.
const GREATEST: f64 = 3.6;

/// Motion below which a tile is taken for still, px.
const LEAST_MOTION: f64 = 1.0;

/// Share of the tiles supposed to be free of texture in the band.
const QUANTILE: f64 = 0.2;

/// Noise of `image` blurred by `flow` times `exposure`; see the [module](self).
///
/// # Errors
/// [`Error::Shape`](crate::Error::Shape) when the shapes differ; [`Error::Cancelled`](crate::Error::Cancelled).
pub fn estimate_noise<T: Real>(
    image: &ArrayView2<'_, T>,
    flow: &FlowView<'_, T>,
    exposure: f64,
    control: &Control,
) -> Result<f64> {
    require_same("flow", &flow.u, image.dim())?;
    let (height, width) = image.dim();
    if height < TILE || width < TILE {
        return Ok(0.0);
    }
    let starts = |n: usize, stride: usize| (0..=n - TILE).step_by(stride);
    let mut stride = TILE / 2;
    while starts(height, stride).count() * starts(width, stride).count() > MOST_TILES {
        stride += TILE / 2;
    }
    let corners: Vec<[usize; 2]> = starts(height, stride)
        .flat_map(|top| starts(width, stride).map(move |left| [top, left]))
        .collect();
    let plan = Fft2::new(TILE, TILE);
    let powers: Vec<Option<f64>> = corners
        .par_iter()
        .map(|&[top, left]| {
            control.check()?;
            let part = s![top..top + TILE, left..left + TILE];
            let motion = [mean_known(&flow.u.slice(part)), mean_known(&flow.v.slice(part))];
            let motion = motion.map(|component| component * exposure);
            Ok(noise_power(&image.slice(part), motion, &plan))
        })
        .collect::<Result<_>>()?;
    let mut powers: Vec<f64> = powers.into_iter().flatten().collect();
    if powers.is_empty() {
        return Ok(0.0);
    }
    let rank = (QUANTILE * (powers.len() - 1) as f64).round() as usize;
    let (_, power, _) = powers.select_nth_unstable_by(rank, f64::total_cmp);
    Ok(power.sqrt())
}

/// Mean of the known samples; 0 when there are none.
fn mean_known<T: Real>(samples: &ArrayView2<'_, T>) -> f64 {
    let known = || samples.iter().map(|s| s.as_f64()).filter(|s| s.is_finite());
    known().sum::<f64>() / known().count().max(1) as f64
}

/// Mean power of the band of one tile; None when a sample is unknown.
fn noise_power<T: Real>(tile: &ArrayView2<'_, T>, motion: [f64; 2], plan: &Fft2) -> Option<f64> {
    // Without the mean, whose leakage through the window would otherwise exceed faint noise.
    let mean = tile.iter().map(|s| s.as_f64()).sum::<f64>() / (TILE * TILE) as f64;
    if !mean.is_finite() {
        return None;
    }
    // Mean square of sin^2 over whole samples is 3/8, per axis.
    let hann = |i: usize| (PI * (i as f64 + 0.5) / TILE as f64).sin().powi(2) / 0.375f64.sqrt();
    let mut spectrum: Vec<Complex64> = tile
        .indexed_iter()
        .map(|((y, x), s)| ((s.as_f64() - mean) * hann(y) * hann(x)).into())
        .collect();
    plan.forward(&mut spectrum, &mut Vec::new());
    let frequency = |k: usize| {
        let signed = if k > TILE / 2 { k as f64 - TILE as f64 } else { k as f64 };
        TAU * signed / TILE as f64
    };
    let speed = motion[0].hypot(motion[1]);
    let (mut sum, mut count) = (0.0, 0usize);
    for (i, value) in spectrum.iter().enumerate() {
        let (wy, wx) = (frequency(i / TILE), frequency(i % TILE));
        let radius = wx.hypot(wy);
        let counts = if speed < LEAST_MOTION {
            radius > STILL
        } else {
            (wx * motion[0] + wy * motion[1]).abs() > ALONG * speed
        };
        if counts && radius < GREATEST {
            sum += value.norm_sqr();
            count += 1;
        }
    }
    Some(sum / (count * TILE * TILE) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flow_field::FlowField;
    use ndarray::Array2;

    /// Uniform noise of unit deviation from a linear congruential sequence.
    fn noise(shape: (usize, usize)) -> Array2<f64> {
        let mut state = 1u64;
        Array2::from_shape_simple_fn(shape, || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            ((state >> 11) as f64 / (1u64 << 53) as f64 - 0.5) * 12f64.sqrt()
        })
    }

    #[test]
    fn measures_noise_and_passes_over_what_motion_leaves() {
        let shape = (160, 192);
        let flow =
            FlowField::new(Array2::from_elem(shape, 9.0), Array2::from_elem(shape, 4.0)).unwrap();
        // Strong texture across the motion only, which no blur along it would touch.
        let image = Array2::from_shape_fn(shape, |(y, x)| {
            60.0 * (1.2 * (9.0 * y as f64 - 4.0 * x as f64) / 97f64.sqrt()).sin()
        });
        for sigma in [0.3, 2.0] {
            let noisy = &image + &(sigma * &noise(shape));
            let measured =
                estimate_noise(&noisy.view(), &flow.view(), 1.0, &Control::new()).unwrap();
            // 20 % quantile of means of some 300 exponential powers: a few per cent low.
            assert!((0.85..1.1).contains(&(measured / sigma)), "{sigma}: {measured}");
        }
    }

    #[test]
    fn small_or_unknown_pictures_have_no_measurable_noise() {
        for shape in [(8, 8), (40, 40)] {
            let image = Array2::from_elem(shape, f64::NAN);
            let flow = FlowField::unknown(shape);
            let none = estimate_noise(&image.view(), &flow.view(), 1.0, &Control::new());
            assert_eq!(none, Ok(0.0));
        }
    }
}
