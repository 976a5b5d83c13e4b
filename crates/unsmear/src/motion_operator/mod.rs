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
//! S the speed; beyond its ends the path goes on straight. kappa is Keys' cubic (slope -1/2) or the triangle. Lines are
//! too coarse for fine detail under a blur of a few pixels: with [`Taps::Spline`] short paths go by `short_paths.rs`.
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

mod bands;
mod expand;
mod group;
mod kept_stencils;
mod lanes;
mod plan;
mod record;
mod scatter;
mod short_paths;
mod spline_inverse;
mod stencil;
mod strands;
mod sweep;

use std::sync::Arc;

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::linear_operator::LinearOperator;
use crate::motion_path::MotionPaths;
use crate::tasks::{cut, runs};
use bands::{Bands, each};
use lanes::LANES;
use plan::RowPlan;
use short_paths::ShortPaths;
use sweep::{Scratch, Window, gather_row, normal_row, scatter_row};

pub use lanes::Taps;

/// Fewest rows gathered per task.
const FEWEST_ROWS: usize = 8;
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
    /// Paths that the plans leave out.
    short: Option<ShortPaths>,
}

impl MotionOperator {
    /// The operator on a picture padded by `pad` pixels; [`MotionPaths::reach`] is enough for all paths.
    ///
    /// # Errors
    /// [`Error::Shape`] for an empty picture or planes whose shapes differ.
    pub fn new(paths: &MotionPaths, taps: Taps, pad: usize) -> Result<Self> {
        Self::planned(paths, taps, pad, false)
    }

    /// The same for many applications: it keeps what every step of a solver would make anew, 10 to 40 bytes per pixel
    /// more, with splines up to 256 per pixel and 256 MiB in all. The results are the same, bit for bit.
    ///
    /// # Errors
    /// Those of [`MotionOperator::new`].
    pub fn for_many(paths: &MotionPaths, taps: Taps, pad: usize) -> Result<Self> {
        Self::planned(paths, taps, pad, true)
    }

    fn planned(paths: &MotionPaths, taps: Taps, pad: usize, many: bool) -> Result<Self> {
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
        let mut short = match taps {
            Taps::Spline | Taps::ThriftySpline if paths.reach() <= pad => {
                ShortPaths::of(paths, taps == Taps::ThriftySpline)
            }
            _ => None,
        };
        if many {
            short.iter_mut().for_each(ShortPaths::keep);
        }
        let others = short.as_ref().map(|short| short.others(paths));
        let paths = others.as_ref().unwrap_or(paths);
        let row = |y| {
            let own = y == 0 || !rows_agree(paths, y);
            let plan = own.then(|| RowPlan::new(paths, y, taps))?;
            // A plan that serves several rows is used often anyway.
            let shared = y + 1 < height && rows_agree(paths, y + 1);
            Some(if many || shared { plan.with_strands(taps) } else { plan })
        };
        let own: Vec<Option<RowPlan>> = (0..height).into_par_iter().map(row).collect();
        let mut plans: Vec<Arc<RowPlan>> = Vec::with_capacity(height);
        for plan in own {
            plans.extend(plan.map(Arc::new).or_else(|| plans.last().cloned()));
        }
        // A block wider than the picture writes zeros beyond it.
        let beyond = LANES.saturating_sub(width);
        let reach = plans.iter().map(|plan| plan.reach).max().unwrap_or(0) + beyond;
        let reach = reach.max(short.as_ref().map_or(0, |short| short.reach));
        Ok(Self { plans, width, taps, pad, reach, short })
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
        let bands = self.bands(pad);
        bands.for_each(x, r.chunks(self.width * bands.rows()), |y, place, rows| {
            let mut scratch = Scratch::new();
            let mut x = Window { samples: place, stride: bands.stride(), start: bands.place(0) };
            for (i, row) in rows.chunks(self.width).enumerate() {
                scatter_row(&self.plans[y + i], self.taps, row, &mut x, &mut scratch);
                x.start += bands.stride();
            }
        });
    }

    /// How data lie in a picture padded by `pad`.
    fn bands(&self, pad: usize) -> Bands {
        Bands { width: self.width, pad, reach: self.reach }
    }

    /// Adds the transpose of what the paths that are not short do, `short` ones being there.
    fn add_others(&self, short: &ShortPaths, r: &[f32], x: &mut [f32]) {
        if !short.everywhere {
            let mut more = vec![0.0; x.len()];
            self.scatter(&short.left_of(r), self.pad, &mut more);
            x.iter_mut().zip(&more).for_each(|(x, more)| *x += more);
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
        if let Some(short) = &self.short {
            if !short.everywhere {
                self.gather(x, self.pad, b);
            }
            return short.apply(x, b, &self.bands(self.pad));
        }
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
        if let Some(short) = &self.short {
            short.adjoint(r, x, &self.bands(self.pad));
            return self.add_others(short, r, x);
        }
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
        let bands = self.bands(self.pad);
        if let Some(short) = &self.short {
            if !short.everywhere {
                self.gather(x, self.pad, b);
            }
            short.normal(x, weights, b, out, &bands);
            let weighted: Vec<f32> = b.iter().zip(weights).map(|(b, w)| b * w).collect();
            return self.add_others(short, &weighted, out);
        }
        let chunk = self.width * bands.rows();
        let data = b.chunks_mut(chunk).zip(weights.chunks(chunk));
        bands.for_each(out, data, |y, place, (b, weights)| {
            let mut scratch = Scratch::new();
            let mut x = Window { samples: x, stride: columns, start: bands.start(y) };
            let mut out = Window { samples: place, stride: columns, start: bands.place(0) };
            let pairs = b.chunks_mut(self.width).zip(weights.chunks(self.width));
            for (i, (b, weights)) in pairs.enumerate() {
                normal_row(&self.plans[y + i], self.taps, &x, weights, b, &mut out, &mut scratch);
                x.start += columns;
                out.start += columns;
            }
        });
    }
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
