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
//! exact, hence the result independent of their order. Pixels outside the mask are copied. Units: those of the
//! flow (px), of the guide, and px. Validity: no NaN in the flow or the guide (a NaN
//! counts as beyond infinity).
//! Reference: D. Sun, S. Roth, M. J. Black, "Secrets of optical flow estimation and their principles", CVPR 2010,
//! [10.1109/CVPR.2010.5539939](https://doi.org/10.1109/CVPR.2010.5539939), section 5 (without its occlusion term).

mod middle;
mod parameters;
mod window;

use std::ops::RangeInclusive;

use crate::control::Control;
use crate::error::{Error, Result, require};
use crate::tasks::{cut, for_each_task, runs};
use window::{Window, Workspace};

pub use parameters::WeightedMedian;

/// Largest radius, px: a window beyond it smears more than it decides, and the sums of its weights stay below 2^24.
const LARGEST_RADIUS: usize = 15;

/// Rows per task: most of the work may lie in few of them.
const ROWS: RangeInclusive<usize> = 1..=16;

/// Filters (`u`, `v`) where `mask` holds and copies the rest; see the [module](self).
///
/// Planes are packed rows of `width` samples, `height` of them; `guide` holds one plane per channel (none: spatial
/// weights only), already smoothed, and scaled so that the squared difference of two pixels is the sum over channels.
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
    parameters.check()?;
    if width == 0 {
        return Ok(());
    }
    let window = Window::new(parameters, [u, v], guide, height, width);
    let runs = runs(height, ROWS);
    let tasks = cut(out_u, width, &runs).zip(cut(out_v, width, &runs));
    for_each_task(tasks, runs.len(), |((first, out_u), (_, out_v))| {
        let mut workspace = Workspace::new(parameters.radius);
        let lines = out_u.chunks_exact_mut(width).zip(out_v.chunks_exact_mut(width));
        for (y, (out_u, out_v)) in (first..).zip(lines) {
            control.check()?;
            let row = y * width..(y + 1) * width;
            out_u.copy_from_slice(&u[row.clone()]);
            out_v.copy_from_slice(&v[row.clone()]);
            window.filter_row(&mask[row], y, &mut workspace, out_u, out_v);
        }
        Ok(())
    })
}

impl WeightedMedian {
    fn check(&self) -> Result<()> {
        require("radius", self.radius as f64, "in 1..=15", |r| {
            (1.0..=LARGEST_RADIUS as f64).contains(&r)
        })?;
        for (name, sigma) in
            [("spatial_sigma", self.spatial_sigma), ("guide_sigma", self.guide_sigma)]
        {
            require(name, f64::from(sigma), "finite and positive", |s| s > 0.0)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
