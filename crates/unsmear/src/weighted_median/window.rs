//! Samples and weights of the window around a pixel.
//!
//! The rows of a window are copied one behind the other. Each copy moves a fixed number of samples, the spare ones at
//! its end to be overwritten by the next row's: a whole register is cheaper than a few samples. A window that leaves
//! the picture, or whose copies would, is gathered sample by sample.

use multiversion::multiversion;

use super::middle::{RUN, weighted_middles};
use super::parameters::WeightedMedian;

/// Samples of a vector register of 512 bits, in f32.
const LANES: usize = 16;

/// Exponent beyond which a weight is dropped: exp(-7) < 0.001 of the centre's.
const LARGEST_EXPONENT: f32 = 7.0;

/// Weights are whole numbers of units of one over this.
const UNITS: f32 = 16384.0;

/// The planes and the parts of the exponent that do not change from pixel to pixel.
pub(super) struct Window<'a> {
    flow: [&'a [f32]; 2],
    guide: &'a [&'a [f32]],
    height: usize,
    width: usize,
    radius: usize,
    /// |p - q|^2 / (2 spatial_sigma^2), row by row, with spare samples as in a [`Workspace`].
    spatial: Vec<f32>,
    /// 1 / (2 guide_sigma^2).
    ranged: f32,
}

/// Copies of the samples in a window; a multiple of [`RUN`], long enough for the spare samples of the last copy.
pub(super) struct Workspace {
    flow: [Vec<f32>; 2],
    /// Squared differences of the guide.
    squares: Vec<f32>,
    weights: Vec<i32>,
    keys: Vec<i32>,
}

impl Workspace {
    pub(super) fn new(radius: usize) -> Self {
        let n = samples(radius);
        let zeros = || vec![0.0; n];
        let flow = [zeros(), zeros()];
        Self { flow, squares: zeros(), weights: vec![0; n], keys: vec![0; n] }
    }
}

/// Samples copied per row of the window.
fn copied(radius: usize) -> usize {
    (2 * radius + 1).next_multiple_of(LANES)
}

/// Samples of a copied window.
fn samples(radius: usize) -> usize {
    let side = 2 * radius + 1;
    ((side - 1) * side + copied(radius)).next_multiple_of(RUN)
}

impl<'a> Window<'a> {
    pub(super) fn new(
        parameters: &WeightedMedian,
        flow: [&'a [f32]; 2],
        guide: &'a [&'a [f32]],
        height: usize,
        width: usize,
    ) -> Self {
        let radius = parameters.radius;
        let side = 2 * radius + 1;
        let scale = 0.5 / (parameters.spatial_sigma * parameters.spatial_sigma);
        let mut spatial = vec![f32::INFINITY; samples(radius)];
        for (i, exponent) in spatial.iter_mut().enumerate().take(side * side) {
            let (y, x) = ((i / side).abs_diff(radius), (i % side).abs_diff(radius));
            *exponent = (y * y + x * x) as f32 * scale;
        }
        let ranged = 0.5 / (parameters.guide_sigma * parameters.guide_sigma);
        Self { flow, guide, height, width, radius, spatial, ranged }
    }

    /// Replaces the masked pixels of row `y`.
    pub(super) fn filter_row(
        &self,
        mask: &[bool],
        y: usize,
        workspace: &mut Workspace,
        out_u: &mut [f32],
        out_v: &mut [f32],
    ) {
        let Workspace { flow: [u, v], squares, weights, keys } = workspace;
        for x in (0..self.width).filter(|x| mask[*x]) {
            if self.is_inner(y, x) {
                let corner = (y - self.radius) * self.width + x - self.radius;
                let centre = y * self.width + x;
                gather_inner(self, corner, centre, u, v, squares, weights);
            } else {
                gather_outer(self, y, x, u, v, squares, weights);
            }
            (out_u[x], out_v[x]) = weighted_middles(u, v, weights, keys);
        }
    }

    /// Whether every copy of the window around (y, x) stays in the picture's memory and every sample in the picture.
    fn is_inner(&self, y: usize, x: usize) -> bool {
        let (radius, last) = (self.radius, y + self.radius);
        radius <= y
            && last < self.height
            && radius <= x
            && x + radius < self.width
            && last * self.width + x - radius + copied(radius) <= self.height * self.width
    }
}

/// Gathers any window; what lies outside the picture is infinitely far.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn gather_outer(
    window: &Window<'_>,
    y: usize,
    x: usize,
    u: &mut [f32],
    v: &mut [f32],
    squares: &mut [f32],
    weights: &mut [i32],
) {
    let (radius, side, width) = (window.radius, 2 * window.radius + 1, window.width);
    let [plane_u, plane_v] = window.flow;
    let (left, right) = (x.saturating_sub(radius), (x + radius + 1).min(width));
    squares.fill(f32::INFINITY);
    for row in y.saturating_sub(radius)..(y + radius + 1).min(window.height) {
        let start = (row + radius - y) * side + left + radius - x;
        let (to, from) = (start..start + right - left, row * width + left..row * width + right);
        u[to.clone()].copy_from_slice(&plane_u[from.clone()]);
        v[to.clone()].copy_from_slice(&plane_v[from.clone()]);
        let squares = &mut squares[to];
        squares.fill(0.0);
        for plane in window.guide {
            let centre = plane[y * width + x];
            for (square, sample) in squares.iter_mut().zip(&plane[from.clone()]) {
                *square += (sample - centre) * (sample - centre);
            }
        }
    }
    weigh(window, squares, weights);
}

/// Gathers a window whose copies stay in the picture's memory; `corner` and `centre` index the planes.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn gather_inner(
    window: &Window<'_>,
    corner: usize,
    centre: usize,
    u: &mut [f32],
    v: &mut [f32],
    squares: &mut [f32],
    weights: &mut [i32],
) {
    let side = 2 * window.radius + 1;
    let [plane_u, plane_v] = window.flow;
    for row in 0..side {
        let (from, to) = (corner + row * window.width, row * side);
        for part in (0..side).step_by(LANES) {
            copy_lanes(&plane_u[from + part..], &mut u[to + part..]);
            copy_lanes(&plane_v[from + part..], &mut v[to + part..]);
            let mut sums = [0.0; LANES];
            for plane in window.guide {
                add_squares(&plane[from + part..], plane[centre], &mut sums);
            }
            copy_lanes(&sums, &mut squares[to + part..]);
        }
    }
    weigh(window, squares, weights);
}

/// Weights of gathered samples; spare ones have an infinite spatial exponent, hence none.
#[inline(always)]
fn weigh(window: &Window<'_>, squares: &[f32], weights: &mut [i32]) {
    let n = weights.len() / RUN * RUN;
    let (spatial, squares, weights) = (&window.spatial[..n], &squares[..n], &mut weights[..n]);
    let ranged = window.ranged;
    for i in 0..n {
        weights[i] = weight(spatial[i] + squares[i] * ranged);
    }
}

#[inline(always)]
fn copy_lanes(from: &[f32], to: &mut [f32]) {
    if let (Some(from), Some(to)) = (from.first_chunk::<LANES>(), to.first_chunk_mut::<LANES>()) {
        *to = *from;
    }
}

#[inline(always)]
fn add_squares(samples: &[f32], centre: f32, squares: &mut [f32; LANES]) {
    if let Some(samples) = samples.first_chunk::<LANES>() {
        for lane in 0..LANES {
            let difference = samples[lane] - centre;
            squares[lane] += difference * difference;
        }
    }
}

/// exp(-e) in units of 1 / `UNITS`, rounded; 0 beyond the largest exponent.
///
/// The eighth power of a Taylor polynomial of degree 6 around the middle of [0, 7/8], within 1e-5 of itself; the same
/// bits on every machine, unlike the library's.
#[inline(always)]
pub(super) fn weight(e: f32) -> i32 {
    /// Middle of the range of e / 8, and exp(-8 x) of it in units.
    const MIDDLE: f32 = LARGEST_EXPONENT / 16.0;
    const SCALE: f32 = 0.030_197_383 * UNITS;
    /// Added to a number it leaves the nearest whole one in the lowest bits.
    const WHOLE: f32 = 8_388_608.0;
    let z = MIDDLE - e * 0.125;
    let p = 1.0 / 120.0 + z * (1.0 / 720.0);
    let p = 1.0 + z * (1.0 + z * (0.5 + z * (1.0 / 6.0 + z * (1.0 / 24.0 + z * p))));
    let (p2, kept) = (p * p, e <= LARGEST_EXPONENT);
    let p4 = p2 * p2;
    let units = (p4 * p4 * SCALE + WHOLE).to_bits() - WHOLE.to_bits();
    if kept { units.cast_signed() } else { 0 }
}
