//! Blur along short paths: an interpolating spline, sampled along the path itself.
//!
//! ```text
//! b(p) = sum_n w_n X(p + D(t_n)),     X(x, y) = sum_jk beta(x - j) beta(y - k) c[k, j],     X = x on the grid
//! ```
//!
//! with the stencils of `stencil.rs` and the coefficients of `spline_inverse.rs`. Integrating line by line, as for long
//! paths, folds waves whose frequencies along x and y add up to more than pi, and Keys' cubic damps those near pi. A
//! long blur wipes both out; one of a few pixels does not, and what the operator errs by becomes texture of the restored
//! picture: with the noise of 8 bits alone it took 5.5 dB from photographs blurred by 3 px, and 1.6 dB at 7 px.
//!
//! Units: px. Validity: paths of up to [`LONGEST`]; a padding that holds all that is read. A stencil costs two to three
//! times what lines cost where neighbours move alike, and some eight times where each has a stencil of its own. So paths
//! are short only where at least [`LEAST_SHARE`] of all that move are, and the thrifty call short only those up to
//! [`LONGEST_OF_ITS_OWN`] where they differ.

use super::bands::{Bands, each};
use super::kept_stencils::KeptStencils;
use super::lanes::{LANES, Lanes};
use super::spline_inverse::spline_inverse;
use super::stencil::{Paths, Stencil, Taken, gather, gauss, nodes_for, scatter};
use crate::flow_field::FlowField;
use crate::motion_path::MotionPaths;
use crate::tasks::{cut, runs};

/// Longest path, px, that counts as short: at 7 px the gain is 1.6 dB without noise, 0.4 dB at noise of a grey level.
const LONGEST: f32 = 8.0;

/// The same to the thrifty where pixels move otherwise than their neighbours, so that each needs a stencil of its own.
const LONGEST_OF_ITS_OWN: f32 = 4.0;

/// Least share of the moving pixels.
const LEAST_SHARE: f64 = 0.75;

/// Motion, px, below which a pixel without an offset is still.
const LEAST_MOTION: f32 = 0.02;

/// Pixels beyond a sample's cell that the spline reads, and one for rounding.
const SPLINE_REACH: usize = 3;

/// Fewest rows gathered per task.
const FEWEST_ROWS: usize = 8;

/// The short paths of a picture.
#[derive(Debug, Clone)]
pub(super) struct ShortPaths {
    width: usize,
    /// u, v, q, d of every pixel; d is absent where it is 0 everywhere.
    planes: Vec<Vec<f32>>,
    /// 1 for the pixels whose path is short.
    own: Vec<f32>,
    /// Gauss' rules, by their number of nodes.
    rules: Vec<Vec<[f32; 2]>>,
    /// Pixels beyond the picture that are read.
    pub(super) reach: usize,
    /// Whether all pixels are short.
    pub(super) everywhere: bool,
    kept: KeptStencils,
}

impl ShortPaths {
    /// The short ones of `paths`; None when they are few, or the columns too few.
    pub(super) fn of(paths: &MotionPaths, thrifty: bool) -> Option<Self> {
        let (height, width) = paths.dim();
        if width < LANES {
            return None;
        }
        let plain = |plane: &ndarray::Array2<f32>| plane.iter().copied().collect::<Vec<f32>>();
        let both = |field: &FlowField<f32>| [plain(&field.u), plain(&field.v)];
        let mut planes: Vec<Vec<f32>> = both(&paths.velocity).into();
        planes.extend(both(&paths.curvature));
        planes.extend(paths.offset.iter().flat_map(both));
        let costly = thrifty && !neighbours_agree(&planes, width);
        let limit = if costly { LONGEST_OF_ITS_OWN } else { LONGEST };
        let mut own = vec![0.0; height * width];
        let (mut longest, mut farthest, mut count, mut moving) = (0.0f32, 0.0f32, 0, 0);
        for (i, own) in own.iter_mut().enumerate() {
            let at = |plane: usize| planes.get(plane).map_or(0.0, |plane| plane[i]);
            let length = at(0).hypot(at(1)) + 0.25 * at(2).hypot(at(3));
            // Unknown motion compares to nothing.
            let moves = length >= LEAST_MOTION || (length >= 0.0 && (at(4) != 0.0 || at(5) != 0.0));
            moving += usize::from(moves);
            if moves && length <= limit {
                *own = 1.0;
                count += 1;
                longest = longest.max(length);
                let far = |axis: usize| {
                    0.5 * at(axis).abs() + 0.125 * at(axis + 2).abs() + at(axis + 4).abs()
                };
                farthest = farthest.max(far(0)).max(far(1));
            }
        }
        if count == 0 || (count as f64) < LEAST_SHARE * moving as f64 {
            return None;
        }
        let rules = (0..=nodes_for(longest)).map(gauss).collect();
        let reach = farthest.ceil() as usize + SPLINE_REACH;
        let everywhere = count == height * width;
        Some(Self { width, planes, own, rules, reach, everywhere, kept: KeptStencils::default() })
    }

    /// Keeps stencils, for many applications.
    pub(super) fn keep(&mut self) {
        let shape = (self.own.len() / self.width, self.width);
        let short = &*self;
        let paths_of = |y| short.blocks(y).map(move |(x, own)| short.paths(y, x, &own));
        self.kept = KeptStencils::new(shape, paths_of, &self.rules);
    }

    /// The paths that are left, the short ones still.
    pub(super) fn others(&self, paths: &MotionPaths) -> MotionPaths {
        let mut others = paths.clone();
        let still = |field: &mut FlowField<f32>| {
            for plane in [&mut field.u, &mut field.v] {
                for (z, own) in plane.iter_mut().zip(&self.own) {
                    *z = if *own > 0.0 { 0.0 } else { *z };
                }
            }
        };
        still(&mut others.velocity);
        still(&mut others.curvature);
        others.offset.iter_mut().for_each(still);
        others
    }

    /// `r` where no path is short, 0 elsewhere.
    pub(super) fn left_of(&self, r: &[f32]) -> Vec<f32> {
        r.iter().zip(&self.own).map(|(r, own)| r * (1.0 - own)).collect()
    }

    /// Writes the blur of x to `b` where paths are short.
    pub(super) fn apply(&self, x: &[f32], b: &mut [f32], bands: &Bands) {
        let mut coefficients = vec![0.0; x.len()];
        spline_inverse(x, bands.stride(), &mut coefficients);
        let runs = runs(b.len() / self.width, FEWEST_ROWS..=usize::MAX);
        each(cut(b, self.width, &runs), runs.len(), |(first, rows)| {
            let mut stencil = Stencil::default();
            for (y, out) in (first..).zip(rows.chunks_mut(self.width)) {
                let start = bands.start(y);
                self.each_block(y, &mut stencil, |column, own, stencil| {
                    let sum = gather(stencil, &coefficients, start + column, bands.stride());
                    put(&sum, &own, &mut out[column..]);
                });
            }
        });
    }

    /// Writes the transpose of [`ShortPaths::apply`] to `x`.
    pub(super) fn adjoint(&self, r: &[f32], x: &mut [f32], bands: &Bands) {
        let mut coefficients = vec![0.0; x.len()];
        let rows = r.chunks(self.width * bands.rows());
        bands.for_each(&mut coefficients, rows, |first, place, rows| {
            let mut stencil = Stencil::default();
            for (i, row) in rows.chunks(self.width).enumerate() {
                self.each_block(first + i, &mut stencil, |column, mut own, stencil| {
                    own.0.iter_mut().zip(&row[column..]).for_each(|(own, r)| *own *= r);
                    scatter(stencil, &own, place, bands.place(i) + column, bands.stride());
                });
            }
        });
        spline_inverse(&coefficients, bands.stride(), x);
    }

    /// Both, with `weights` between them.
    pub(super) fn normal(
        &self,
        x: &[f32],
        weights: &[f32],
        b: &mut [f32],
        out: &mut [f32],
        bands: &Bands,
    ) {
        let stride = bands.stride();
        let mut coefficients = vec![0.0; x.len()];
        spline_inverse(x, stride, &mut coefficients);
        let chunk = self.width * bands.rows();
        let data = b.chunks_mut(chunk).zip(weights.chunks(chunk));
        let mut back = vec![0.0; x.len()];
        bands.for_each(&mut back, data, |first, place, (b, weights)| {
            let mut stencil = Stencil::default();
            let pairs = b.chunks_mut(self.width).zip(weights.chunks(self.width));
            for (i, (b, weights)) in pairs.enumerate() {
                let start = bands.start(first + i);
                self.each_block(first + i, &mut stencil, |column, mut own, stencil| {
                    let sum = gather(stencil, &coefficients, start + column, stride);
                    put(&sum, &own, &mut b[column..]);
                    for ((own, sum), weight) in own.0.iter_mut().zip(sum.0).zip(&weights[column..])
                    {
                        *own *= weight * sum;
                    }
                    scatter(stencil, &own, place, bands.place(i) + column, stride);
                });
            }
        });
        spline_inverse(&back, stride, out);
    }

    /// Visits the blocks of row `y` with short paths: first column, which of its pixels have one, stencil; `spare` is for
    /// those not kept.
    fn each_block(
        &self,
        y: usize,
        spare: &mut Stencil,
        mut visit: impl FnMut(usize, Lanes, &Taken<'_>),
    ) {
        for (i, (column, own)) in self.blocks(y).enumerate() {
            if let Some(kept) = self.kept.get(y, i) {
                visit(column, own, &kept);
            } else {
                spare.renew(&self.paths(y, column, &own), &self.rules);
                visit(column, own, &spare.taken());
            }
        }
    }

    /// First columns of the blocks of row `y` with short paths, and which of their pixels have one.
    fn blocks(&self, y: usize) -> impl Iterator<Item = (usize, Lanes)> + '_ {
        (0..self.width).step_by(LANES).filter_map(move |first| {
            // The last block is moved back onto the picture, without what the one before has.
            let column = first.min(self.width - LANES);
            let mut own = Lanes::ZERO;
            own.0.copy_from_slice(&self.own[y * self.width + column..][..LANES]);
            own.0[..first - column].fill(0.0);
            (own != Lanes::ZERO).then_some((column, own))
        })
    }

    /// The paths of a block. Its other pixels follow one that is short, so that they need no taps of their own.
    fn paths(&self, y: usize, column: usize, own: &Lanes) -> Paths {
        let first = own.0.iter().position(|&own| own > 0.0).unwrap_or(0);
        let mut paths = [Lanes::ZERO; 6];
        for (lanes, plane) in paths.iter_mut().zip(&self.planes) {
            let here = &plane[y * self.width + column..][..LANES];
            for i in 0..LANES {
                lanes.0[i] = if own.0[i] > 0.0 { here[i] } else { here[first] };
            }
        }
        paths
    }
}

/// Whether most pixels have the path of the one to their left, bit for bit.
fn neighbours_agree(planes: &[Vec<f32>], width: usize) -> bool {
    let count = planes[0].len();
    let agrees = |i: usize| planes.iter().all(|plane| plane[i].to_bits() == plane[i - 1].to_bits());
    let inner = (1..count).filter(|i| i % width > 0);
    2 * inner.filter(|&i| agrees(i)).count() >= count - count / width
}

/// Writes the sums of the pixels that are short.
fn put(sum: &Lanes, own: &Lanes, out: &mut [f32]) {
    for ((out, sum), own) in out.iter_mut().zip(sum.0).zip(own.0) {
        *out = if own > 0.0 { sum } else { *out };
    }
}

#[cfg(test)]
mod tests;
