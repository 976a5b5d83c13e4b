//! Weighted median of a flow, guided by a picture.
//!
//! ```text
//! e(p, q) = |p - q|^2 / (2 spatial_sigma^2) + |guide(p) - guide(q)|^2 / (2 guide_sigma^2)
//! w(p, q) = exp(-e), rounded to a multiple of 2^-14;  0 when e > 7
//! out(p)  = the least value f(q) with  sum over f(q') <= f(q) of w(p, q')  >=  1/2 sum of all w(p, q')
//! ```
//!
//! over the window |x - x'|, |y - y'| <= radius inside the picture; u and v share their weights. Where the lower and
//! the upper half balance exactly, the lower of the two middle values is taken. The rounding makes sums of weights
//! exact in f32, hence the result independent of their order. Pixels outside the mask are copied.

use rayon::prelude::*;

use crate::control::Control;
use crate::error::{Error, Result, require};

/// Exponent beyond which a weight is dropped: exp(-7) < 0.001 of the centre's.
const LARGEST_EXPONENT: f32 = 7.0;

/// Unit of the weights; (2 x 15 + 1)^2 of them sum to less than 2^24 units.
const WEIGHT_STEPS: f32 = 16384.0;

/// Largest radius, px.
const LARGEST_RADIUS: usize = 15;

/// Window and weights of [`weighted_median`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WeightedMedian {
    /// Half side of the window, px, in 1..=15.
    pub radius: usize,
    /// Standard deviation of the spatial weight, px, > 0.
    pub spatial_sigma: f32,
    /// Standard deviation of the weight of guide differences, in units of the guide, > 0.
    pub guide_sigma: f32,
}

impl Default for WeightedMedian {
    fn default() -> Self {
        Self { radius: 5, spatial_sigma: 4.0, guide_sigma: 8.0 }
    }
}

/// Filters (`u`, `v`) where `mask` holds and copies the rest; see the [module](self).
///
/// Planes are packed rows of `width` samples, `height` of them; `guide` holds one plane per channel, already smoothed
/// and scaled so that the squared difference of two pixels is the sum over channels. Values must not be NaN.
///
/// # Errors
/// [`Error::Shape`] when a slice has not height x width samples; [`Error::Value`] for parameters out of range;
/// [`Error::Cancelled`], after which the outputs are undefined.
pub fn weighted_median(
    u: &[f32],
    v: &[f32],
    guide: &[&[f32]],
    mask: &[bool],
    height: usize,
    width: usize,
    parameters: &WeightedMedian,
    out_u: &mut [f32],
    out_v: &mut [f32],
    control: &Control,
) -> Result<()> {
    let lengths = [
        ("u", u.len()),
        ("v", v.len()),
        ("mask", mask.len()),
        ("out_u", out_u.len()),
        ("out_v", out_v.len()),
    ];
    for (argument, got) in lengths.into_iter().chain(guide.iter().map(|g| ("guide", g.len()))) {
        if got != height * width {
            return Err(Error::shape(argument, format!("({height} x {width},)"), &[got]));
        }
    }
    require("radius", parameters.radius as f64, "in 1..=15", |r| {
        (1.0..=LARGEST_RADIUS as f64).contains(&r)
    })?;
    for (name, sigma) in
        [("spatial_sigma", parameters.spatial_sigma), ("guide_sigma", parameters.guide_sigma)]
    {
        require(name, f64::from(sigma), "positive", |s| s > 0.0)?;
    }
    if width == 0 {
        return Ok(());
    }
    let spatial = 0.5 / (parameters.spatial_sigma * parameters.spatial_sigma);
    let ranged = 0.5 / (parameters.guide_sigma * parameters.guide_sigma);
    let radius = parameters.radius;
    out_u.par_chunks_mut(width).zip(out_v.par_chunks_mut(width)).enumerate().try_for_each(
        |(y, (out_u, out_v))| {
            control.check()?;
            let mut window = Vec::new();
            for x in 0..width {
                let p = y * width + x;
                (out_u[x], out_v[x]) = (u[p], v[p]);
                if !mask[p] {
                    continue;
                }
                window.clear();
                for yy in y.saturating_sub(radius)..(y + radius + 1).min(height) {
                    for xx in x.saturating_sub(radius)..(x + radius + 1).min(width) {
                        let q = yy * width + xx;
                        let d = yy.abs_diff(y).pow(2) + xx.abs_diff(x).pow(2);
                        let mut square = 0.0;
                        for plane in guide {
                            square += (plane[q] - plane[p]) * (plane[q] - plane[p]);
                        }
                        let w = weight(d as f32 * spatial + square * ranged);
                        window.push((u[q], v[q], w));
                    }
                }
                let half = 0.5 * window.iter().map(|q| q.2).sum::<f32>();
                let middle = |values: &mut [(f32, f32)]| {
                    values.sort_by(|a, b| a.0.total_cmp(&b.0));
                    let mut sum = 0.0;
                    for &mut (value, w) in values {
                        sum += w;
                        if sum >= half {
                            return value;
                        }
                    }
                    f32::NAN
                };
                out_u[x] = middle(&mut window.iter().map(|q| (q.0, q.2)).collect::<Vec<_>>());
                out_v[x] = middle(&mut window.iter().map(|q| (q.1, q.2)).collect::<Vec<_>>());
            }
            Ok(())
        },
    )
}

/// exp(-e) in units of 1 / `WEIGHT_STEPS`, rounded; 0 beyond the largest exponent.
#[inline(always)]
fn weight(e: f32) -> f32 {
    if e > LARGEST_EXPONENT { 0.0 } else { ((-e).exp() * WEIGHT_STEPS + 0.5).floor() }
}
