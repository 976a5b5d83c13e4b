//! Pixels that are not known: filled, so that filters can run over them, and without a say.
//!
//! Unknown pixels take the average of the known ones around them, from the finest of ever coarser
//! averages that knows anything. At each level a pixel's constraints count by
//!
//! ```text
//! C^8,   C = share of the known in the filter's Gaussian window
//! ```
//!
//! as at the picture's edge in [`crate::flow::constraint`]: a window half unknown counts 0.4 %. An
//! unknown pixel itself counts nothing; its flow comes from its surroundings.

use ndarray::{Array2, ArrayView2, Zip};

use crate::control::Control;
use crate::error::Result;
use crate::pyramid::{Resampling, resample, smooth};

/// Power of the coverage.
const COVERAGE_POWER: i32 = 8;
/// Share of the known below which a reduced pixel is unknown.
const LEAST_SHARE: f32 = 0.999;
/// Deviation of the averaging between the steps of filling, px.
const FILL_SIGMA: f64 = 1.0;

/// Replaces NaN in `picture` and returns the map of the known (1) and unknown (0), or nothing when all is known.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn fill(picture: &mut Array2<f32>, control: &Control) -> Result<Option<Array2<f32>>> {
    if picture.iter().all(|s| !s.is_nan()) {
        return Ok(None);
    }
    let known = picture.mapv(|s| if s.is_nan() { 0.0 } else { 1.0 });
    let weighted = picture.mapv(|s| if s.is_nan() { 0.0 } else { s });
    let filled = filled(weighted.view(), known.view(), control)?;
    picture.zip_mut_with(&filled, |s, &f| *s = if s.is_nan() { f } else { *s });
    Ok(Some(known))
}

/// `weighted/known` where anything is known, elsewhere the same of half the size, enlarged; 0 if nothing is known.
fn filled(
    weighted: ArrayView2<'_, f32>,
    known: ArrayView2<'_, f32>,
    control: &Control,
) -> Result<Array2<f32>> {
    let (height, width) = known.dim();
    let mean = |w: f32, k: f32| if k > 0.0 { w / k } else { 0.0 };
    let mut out = Zip::from(weighted).and(known).map_collect(|&w, &k| mean(w, k));
    if known.iter().all(|&k| k > 0.0) || height.max(width) == 1 {
        return Ok(out);
    }
    let size = (height.div_ceil(2), width.div_ceil(2));
    let half = |picture: ArrayView2<'_, f32>| {
        let smoothed = smooth(picture, FILL_SIGMA, control)?;
        resample(smoothed.view(), size, Resampling::Linear, control)
    };
    let coarse = filled(half(weighted)?.view(), half(known)?.view(), control)?;
    let coarse = resample(coarse.view(), (height, width), Resampling::Linear, control)?;
    Zip::from(&mut out).and(known).and(&coarse).for_each(|out, &k, &c| {
        if !(k > 0.0) {
            *out = c;
        }
    });
    Ok(out)
}

/// Weights `C^8` of a level from its share of the known, for a filter window of deviation `sigma`.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn coverage(
    share: ArrayView2<'_, f32>,
    sigma: f64,
    control: &Control,
) -> Result<Array2<f32>> {
    let certain = share.mapv(|k| if k >= LEAST_SHARE { 1.0 } else { 0.0 });
    let covered = smooth(certain.view(), sigma, control)?;
    Ok(Zip::from(&certain)
        .and(&covered)
        .map_collect(|&k: &f32, &c: &f32| k * c.powi(COVERAGE_POWER)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_pixels_take_their_surroundings() {
        let control = Control::new();
        let mut picture = Array2::from_shape_fn((32, 40), |(_, x)| if x < 20 { 3.0 } else { 9.0 });
        picture.slice_mut(ndarray::s![10..16, 2..9]).fill(f32::NAN);
        picture[(30, 35)] = f32::NAN;
        let known = fill(&mut picture, &control).unwrap().unwrap();
        assert_eq!(known.sum(), (32 * 40 - 43) as f32);
        assert!((picture[(13, 5)] - 3.0).abs() < 0.1 && (picture[(30, 35)] - 9.0).abs() < 1e-4);
        assert!(fill(&mut picture, &control).unwrap().is_none());
        let mut nothing = Array2::from_elem((5, 3), f32::NAN);
        assert!(fill(&mut nothing, &control).unwrap().unwrap().sum() == 0.0);
        assert!(nothing.iter().all(|&s| s == 0.0));
    }

    #[test]
    fn windows_over_the_unknown_hardly_count() {
        let share = Array2::from_shape_fn((9, 30), |(_, x)| f32::from(u8::from(x != 15)));
        let weights = coverage(share.view(), 1.26, &Control::new()).unwrap();
        assert_eq!(weights[(4, 15)], 0.0);
        // Next to it 23 % of the window are unknown: 0.77^8 = 0.12.
        assert!((0.05..0.25).contains(&weights[(4, 14)]) && weights[(4, 8)] > 0.999);
    }
}
