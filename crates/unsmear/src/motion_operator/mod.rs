//! Blur along the path of every pixel, without a matrix, and its exact transpose.
//!
//! ```text
//! b(p) = integral_{-1/2}^{1/2} x(p + D(t)) dt,    D(t) = d - t V + t^2/2 q
//! ```
//!
//! with the paths of [`MotionPaths`]. The integral runs along the axis on which the pixel moves faster,
//! the major one: on each grid line k of that axis the path is at some minor position m_k, and x there
//! is interpolated by the kernel kappa; the line counts with the time that the path spends under the
//! kernel's reach of it:
//!
//! ```text
//! b(p) = sum_k W_k sum_j kappa(j - m_k) x[k, j],    W_k ~ [C(z_k - z_0) - C(z_k - z_1)] / S(z_k),    sum_k W_k = 1
//! ```
//!
//! z_k the major offset of line k from the pixel, z_0 < z_1 the path's ends, C the integral of kappa,
//! S the speed; beyond its ends the path goes on straight. kappa is Keys' cubic (slope -1/2) or the triangle.
//! The adjoint is the same sum as a scatter, in bands of rows: first every other band, then those between, so that
//! none writes where another does, in an order that does not depend on the number of threads.
//!
//! Units: px. Validity: finite pictures; the major curvature is cut at 1.8 of the major motion, and
//! paths of up to 1 px are taken as straight. A constant stays constant; a still pixel is
//! copied, and so is one of unknown motion (its datum should have no weight). Taps beyond the
//! padded picture read its edge.
//!
//! References: J. Bardsley et al., "Blind iterative restoration of images with spatially-varying blur",
//! Opt. Express 14 (2006) 1767-1782, [10.1364/OE.14.001767](https://doi.org/10.1364/OE.14.001767), section 2; R. G. Keys,
//! "Cubic convolution interpolation for digital image processing", IEEE Trans. ASSP 29 (1981) 1153-1160,
//! [10.1109/TASSP.1981.1163711](https://doi.org/10.1109/TASSP.1981.1163711).

mod expand;
mod group;
mod lanes;
mod plan;
mod record;
mod scatter;
mod strands;
mod sweep;

use std::sync::Arc;

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::linear_operator::LinearOperator;
use crate::motion_path::MotionPaths;
use crate::tasks::{cut, for_each_task, runs};
use lanes::LANES;
use plan::RowPlan;
use sweep::{Scratch, Window, gather_row, normal_row, scatter_row};

pub use lanes::Taps;

/// Fewest rows gathered per task.
const FEWEST_ROWS: usize = 8;
/// Rows of data scattered per task, at least: half a millisecond of work on a wide picture, and several tasks per thread
/// on a low one.
const LEAST_BAND: usize = 32;

/// The blur of [`MotionPaths`]; see the [module](self).
///
/// Holds 12 (straight paths) to 30 bytes per pixel.
#[derive(Debug, Clone)]
pub struct MotionOperator {
    /// Of every row; rows of equal paths share theirs.
    plans: Vec<Arc<RowPlan>>,
    width: usize,
    taps: Taps,
    pad: usize,
    /// Padding for which nothing is clamped.
    reach: usize,
}

impl MotionOperator {
    /// The operator on a picture padded by `pad` pixels; [`MotionPaths::reach`] is enough for all paths.
    ///
    /// # Errors
    /// [`Error::Shape`] for an empty picture or planes whose shapes differ.
    pub fn new(paths: &MotionPaths, taps: Taps, pad: usize) -> Result<Self> {
        let (height, width) = paths.dim();
        if paths.velocity.u.is_empty() {
            return Err(Error::shape("paths", "(H >= 1, W >= 1)", paths.velocity.u.shape()));
        }
        for field in [&paths.curvature].into_iter().chain(&paths.offset) {
            if field.u.dim() != (height, width) || field.v.dim() != (height, width) {
                let expected = format!("({height}, {width}) in all planes");
                return Err(Error::shape("paths", expected, field.u.shape()));
            }
        }
        let row = |y| {
            if y > 0 && rows_agree(paths, y) { None } else { Some(RowPlan::new(paths, y, taps)) }
        };
        let own: Vec<Option<RowPlan>> = (0..height).into_par_iter().map(row).collect();
        let mut plans: Vec<Arc<RowPlan>> = Vec::with_capacity(height);
        for plan in own {
            plans.extend(plan.map(Arc::new).or_else(|| plans.last().cloned()));
        }
        // A block wider than the picture writes zeros beyond it.
        let beyond = LANES.saturating_sub(width);
        let reach = plans.iter().map(|plan| plan.reach).max().unwrap_or(0) + beyond;
        Ok(Self { plans, width, taps, pad, reach })
    }

    /// A x for a padding that clamps nothing.
    fn gather(&self, x: &[f32], pad: usize, b: &mut [f32]) {
        let stride = self.width + 2 * pad;
        let runs = runs(self.plans.len(), FEWEST_ROWS..=usize::MAX);
        each(cut(b, self.width, &runs), runs.len(), |(first, rows)| {
            let mut scratch = Scratch::new();
            for (y, out) in (first..).zip(rows.chunks_mut(self.width)) {
                let x = Window { samples: x, stride, start: (y + pad) * stride + pad };
                gather_row(&self.plans[y], self.taps, &x, out, &mut scratch);
            }
        });
    }

    /// A^T r for a padding that clamps nothing.
    fn scatter(&self, r: &[f32], pad: usize, x: &mut [f32]) {
        let stride = self.width + 2 * pad;
        let rows = r.chunks(self.width * self.band());
        self.for_each_band(x, pad, rows, |y, place, rows| {
            let mut scratch = Scratch::new();
            let mut x = Window { samples: place, stride, start: self.reach * stride + pad };
            for (i, row) in rows.chunks(self.width).enumerate() {
                scatter_row(&self.plans[y + i], self.taps, row, &mut x, &mut scratch);
                x.start += stride;
            }
        });
    }

    /// Rows of data scattered by one task: twice what it writes beyond them, so that every other one may run.
    fn band(&self) -> usize {
        LEAST_BAND.max(2 * self.reach)
    }

    /// Calls `task(first row, rows of x within reach, data)` for every band of rows, two phases of them in parallel; x starts
    /// as 0. The places of the first phase are all of x, so that it clears them where it is about to write.
    fn for_each_band<D: Send>(
        &self,
        x: &mut [f32],
        pad: usize,
        data: impl Iterator<Item = D>,
        task: impl Fn(usize, &mut [f32], D) + Sync,
    ) {
        let (stride, band) = (self.width + 2 * pad, self.band());
        let (mut even, mut odd) = (Vec::new(), Vec::new());
        for (i, data) in data.enumerate() {
            if i % 2 == 0 { even.push(Some(data)) } else { odd.push(Some(data)) }
        }
        // Band number i writes from `reach` rows above its first to as many below its last.
        let above = (pad - self.reach) * stride;
        x[..above].fill(0.0);
        for (phase, mut data) in [even, odd].into_iter().enumerate() {
            let from = (above + phase * band * stride).min(x.len());
            let places = x[from..].chunks_mut(2 * band * stride);
            let count = places.len();
            data.resize_with(count, || None);
            each(places.zip(data).enumerate(), count, |(i, (place, data))| {
                if phase == 0 {
                    place.fill(0.0);
                }
                if let Some(data) = data {
                    task((2 * i + phase) * band, place, data);
                }
            });
        }
    }

    /// Where a row of the picture padded by `self.reach` continues in that padded by `self.pad` (both as rows or both as
    /// columns, of `count` in the latter).
    fn clamped(&self, i: usize, count: usize) -> usize {
        (i + self.pad).saturating_sub(self.reach).min(count - 1)
    }
}

impl LinearOperator for MotionOperator {
    fn unknown_shape(&self) -> (usize, usize) {
        (self.plans.len() + 2 * self.pad, self.width + 2 * self.pad)
    }

    fn data_shape(&self) -> (usize, usize) {
        (self.plans.len(), self.width)
    }

    fn pad(&self) -> usize {
        self.pad
    }

    fn apply(&self, x: &[f32], b: &mut [f32]) {
        let (rows, columns) = self.unknown_shape();
        assert_eq!(x.len(), rows * columns, "x has the shape of the unknown");
        assert_eq!(b.len(), self.plans.len() * self.width, "b has the shape of the data");
        if self.reach <= self.pad {
            return self.gather(x, self.pad, b);
        }
        let (height, width) = (self.plans.len() + 2 * self.reach, self.width + 2 * self.reach);
        let mut wide = Vec::with_capacity(height * width);
        for y in 0..height {
            let row = &x[self.clamped(y, rows) * columns..][..columns];
            wide.extend((0..width).map(|x| row[self.clamped(x, columns)]));
        }
        self.gather(&wide, self.reach, b);
    }

    fn adjoint(&self, r: &[f32], x: &mut [f32]) {
        let (rows, columns) = self.unknown_shape();
        assert_eq!(x.len(), rows * columns, "x has the shape of the unknown");
        assert_eq!(r.len(), self.plans.len() * self.width, "r has the shape of the data");
        if self.reach <= self.pad {
            return self.scatter(r, self.pad, x);
        }
        let (height, width) = (self.plans.len() + 2 * self.reach, self.width + 2 * self.reach);
        let mut wide = vec![0.0; height * width];
        self.scatter(r, self.reach, &mut wide);
        x.fill(0.0);
        for (y, from) in wide.chunks(width).enumerate() {
            let row = &mut x[self.clamped(y, rows) * columns..][..columns];
            for (x, sample) in from.iter().enumerate() {
                row[self.clamped(x, columns)] += sample;
            }
        }
    }

    fn normal(&self, x: &[f32], weights: &[f32], b: &mut [f32], out: &mut [f32]) {
        let (rows, columns) = self.unknown_shape();
        assert_eq!(
            [x.len(), out.len()],
            [rows * columns; 2],
            "x, out have the shape of the unknown"
        );
        let count = self.plans.len() * self.width;
        assert_eq!([weights.len(), b.len()], [count; 2], "weights, b have the shape of the data");
        if self.reach > self.pad {
            self.apply(x, b);
            let weighted: Vec<f32> = b.iter().zip(weights).map(|(b, w)| b * w).collect();
            return self.adjoint(&weighted, out);
        }
        let (pad, chunk) = (self.pad, self.width * self.band());
        let data = b.chunks_mut(chunk).zip(weights.chunks(chunk));
        self.for_each_band(out, pad, data, |y, place, (b, weights)| {
            let mut scratch = Scratch::new();
            let mut x = Window { samples: x, stride: columns, start: (y + pad) * columns + pad };
            let start = self.reach * columns + pad;
            let mut out = Window { samples: place, stride: columns, start };
            let pairs = b.chunks_mut(self.width).zip(weights.chunks(self.width));
            for (i, (b, weights)) in pairs.enumerate() {
                normal_row(&self.plans[y + i], self.taps, &x, weights, b, &mut out, &mut scratch);
                x.start += columns;
                out.start += columns;
            }
        });
    }
}

/// Runs `task` on everything that `tasks` yields, about `count` of them, on all threads.
fn each<T: Send>(tasks: impl Iterator<Item = T> + Send, count: usize, task: impl Fn(T) + Sync) {
    let outcome = for_each_task(tasks, count, |item| {
        task(item);
        Ok(())
    });
    debug_assert!(outcome.is_ok(), "no task fails");
}

/// Whether row `y` has the paths of the row above, bit for bit.
fn rows_agree(paths: &MotionPaths, y: usize) -> bool {
    let fields = [&paths.velocity, &paths.curvature].into_iter().chain(&paths.offset);
    fields.flat_map(|field| [&field.u, &field.v]).all(|plane| {
        plane.row(y).iter().zip(plane.row(y - 1)).all(|(a, b)| a.to_bits() == b.to_bits())
    })
}

#[cfg(test)]
mod tests;
