//! Phase constraints between a reference frame and a frame warped onto it.
//!
//! Filter `j` of the bank, frame at offset `k`, gives at each pixel one constraint on the increment
//! `d = (du, dv)` px/frame of the flow that the frame was warped with:
//!
//! ```text
//! G.d + D = 0,   G = k (grad phi_0 + grad phi_1)/2   rad/px,   D = arg(conj(R_0) R_1)   rad
//! grad phi = Im(conj(R) R')/(|R|^2 + e) + k_j,   R' = (R(+1) e^{-i k_j} - R(-1) e^{i k_j})/2
//! W = w A/(A + r^2) q^2/(1 + t^4),   A = a_0 a_1,   q = 2A/(a_0^2 + a_1^2)
//! t = max |grad phi - k_j|^2/(tau sigma_k)^2 over the two frames
//! ```
//!
//! with the frame's weight `w` (0 where it cannot be seen), the amplitude floor `r` and the
//! deviation `sigma_k = 1/sigma` of the filters' spectrum. The demodulated three-point derivative is
//! exact on the filter's own wave, one-sided at the edge; what it errs elsewhere, the next warp
//! sees again. A constraint that is not finite, or farther off its frequency than `t = 16`, weighs 0.
//!
//! Differs from [`crate::flow::constraint`], the form for one scale without warping, in the shorter
//! derivative and in `w`. Source: Fleet & Jepson 1990 (doi 10.1007/BF00056772), sections 3 and 4.

use multiversion::multiversion;

use super::arctangent::arctangent;
use super::response_pair::{Band, ResponsePair};
use super::slope::{Cross, Stencil, deviation, place};
use crate::gabor::GaborBank;

/// Terms of a constraint, one row each: `G_x`, `G_y`, `D`, `W`.
pub(super) const TERMS: usize = 4;
/// Added to squared amplitudes, grey levels^2: silence has no phase, and its quotient stays finite.
const POWER_FLOOR: f32 = 1e-6;
/// Added to the sum of the squared amplitudes, grey levels^2.
const SUM_FLOOR: f32 = 1e-9;
/// Squared deviation of frequency beyond which a constraint is dropped.
const FARTHEST: f32 = 16.0;
/// Deviation of frequency that is told apart, rad/px, however far `tau` reaches.
const STEEPEST: f32 = 16.0;

/// What weights depend on, besides the responses.
#[derive(Debug, Clone, Copy)]
pub(super) struct Weighting {
    /// Squared amplitude floor `r^2`, grey levels^2.
    pub(super) floor: f32,
    /// `(tau sigma_k)^-2`, px^2/rad^2.
    pub(super) narrowness: f32,
}

/// The constants of one filter on one row.
#[derive(Clone, Copy)]
struct Filter {
    tuned: [f32; 2],
    along_x: Stencil,
    along_y: Stencil,
    offset: f32,
    weighting: Weighting,
}

/// What all filters of a bank need to constrain the motion to the frame at `offset`.
pub(super) struct Filters {
    /// Wavevector, and the stencils along x and y.
    tuned: Vec<([f32; 2], [[Stencil; 4]; 2])>,
    offset: f32,
    weighting: Weighting,
    height: usize,
}

impl Filters {
    /// For pictures of `height` rows; `offset` is `k`.
    pub(super) fn new(
        bank: &GaborBank<f32>,
        offset: f32,
        weighting: Weighting,
        height: usize,
    ) -> Self {
        let tuned = bank.wavevectors().iter().map(|k| (k.map(|k| k as f32), k.map(Stencil::all)));
        Self { tuned: tuned.collect(), offset, weighting, height }
    }

    /// Bound of `|G_x|` and `|G_y|`, rad/px: the tuned frequency and the farthest from it that is kept. Where `tau` is
    /// so large that it exceeds [`STEEPEST`], steeper slopes, those of phase that jumps, count as that.
    pub(super) fn largest_slope(&self) -> f32 {
        let tuned = self.tuned.iter().map(|([kx, ky], _)| kx.hypot(*ky)).fold(0.0, f32::max);
        self.offset.abs() * (tuned + (FARTHEST / self.weighting.narrowness).sqrt().min(STEEPEST))
    }

    /// Fills `out` with the rows `[G_x, G_y, D, W]` of each filter at row `y`, (N, 4, W).
    ///
    /// `seen` is `w`.
    pub(super) fn constrain(
        &self,
        y: usize,
        pair: &ResponsePair<'_>,
        seen: &[f32],
        out: &mut [f32],
    ) {
        let width = seen.len();
        for (j, out) in out.chunks_mut(TERMS * width).enumerate() {
            let (tuned, [along_x, along_y]) = self.tuned[j];
            let bands = pair.bands(j);
            let mut filter = Filter {
                tuned,
                along_x: along_x[0],
                along_y: along_y[place(y, self.height)],
                offset: self.offset,
                weighting: self.weighting,
            };
            let (slopes, rest) = out.split_at_mut(2 * width);
            let (gx, gy) = slopes.split_at_mut(width);
            let (step, weight) = rest.split_at_mut(width);
            if width > 2 {
                inner_pixels(filter, bands[0], bands[1], seen, gx, gy, step, weight);
            }
            for x in [0, width - 1] {
                filter.along_x = along_x[place(x, width)];
                let at = [x.saturating_sub(1), x, (x + 1).min(width - 1)];
                let [one, other] = bands.map(|band| Cross::new(&band, at));
                let terms = constraint(&filter, &one, &other);
                (gx[x], gy[x], step[x]) = (terms[0], terms[1], terms[2]);
                weight[x] = terms[3] * seen[x];
            }
        }
    }
}

/// All samples of a row but the first and the last.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn inner_pixels(
    filter: Filter,
    one: Band<'_>,
    other: Band<'_>,
    seen: &[f32],
    gx: &mut [f32],
    gy: &mut [f32],
    step: &mut [f32],
    weight: &mut [f32],
) {
    let n = seen.len();
    let (gx, gy, step, weight) = (&mut gx[..n], &mut gy[..n], &mut step[..n], &mut weight[..n]);
    let [one, other] = [one, other].map(|band| band.map(|(re, im)| (&re[..n], &im[..n])));
    for x in 1..n - 1 {
        let at = [x - 1, x, x + 1];
        let terms = constraint(&filter, &Cross::new(&one, at), &Cross::new(&other, at));
        gx[x] = terms[0];
        gy[x] = terms[1];
        step[x] = terms[2];
        weight[x] = terms[3] * seen[x];
    }
}

/// `[G_x, G_y, D, W]` of one pixel, for a frame that is seen there.
#[inline(always)]
fn constraint(filter: &Filter, one: &Cross, other: &Cross) -> [f32; TERMS] {
    let power = |c: &Cross| c.here[0] * c.here[0] + c.here[1] * c.here[1];
    let (p, q) = (power(one), power(other));
    let slopes = |c: &Cross, power: f32| {
        let inverse = 1.0 / (power + POWER_FLOOR);
        [
            deviation(c.here, c.across, filter.along_x, inverse),
            deviation(c.here, c.along, filter.along_y, inverse),
        ]
    };
    let (a, b) = (slopes(one, p), slopes(other, q));
    let square = |d: [f32; 2]| d[0] * d[0] + d[1] * d[1];
    let (e, f) = (square(a), square(b));
    let off = if e > f { e } else { f } * filter.weighting.narrowness;
    let ([re, im], [re_1, im_1]) = (one.here, other.here);
    let step = arctangent(re * im_1 - im * re_1, re * re_1 + im * im_1);
    let both = (p * q).sqrt();
    let sum = p + q + SUM_FLOOR;
    let steady = off * off;
    let weight = 4.0 * both * both * both
        / ((both + filter.weighting.floor) * sum * sum * (1.0 + steady * steady));
    // Not only weightless: what is not finite must not reach the sums.
    let kept = off < FARTHEST && weight > 0.0;
    let select = |value: f32| if kept { value } else { 0.0 };
    [
        select(filter.offset * (0.5 * (a[0] + b[0]) + filter.tuned[0])),
        select(filter.offset * (0.5 * (a[1] + b[1]) + filter.tuned[1])),
        select(step),
        select(weight),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gabor::GaborParameters;

    fn bank() -> GaborBank<f32> {
        GaborBank::new(&GaborParameters {
            tuning_frequency: 0.25,
            bandwidth_octaves: 1.6,
            orientations: 4,
            support: 2.2,
        })
        .unwrap()
    }

    /// Each filter's own wave, ahead by `phase`, rows (N, 2, W).
    fn waves(
        bank: &GaborBank<f32>,
        (height, width): (usize, usize),
        amplitude: f64,
        phase: f64,
    ) -> Vec<Vec<f32>> {
        let row = |y: usize| {
            let mut row = Vec::new();
            for &[kx, ky] in bank.wavevectors() {
                let angle = |x: usize| kx * x as f64 + ky * y as f64 + phase;
                row.extend((0..width).map(|x| (amplitude * angle(x).cos()) as f32));
                row.extend((0..width).map(|x| (amplitude * angle(x).sin()) as f32));
            }
            row
        };
        (0..height).map(row).collect()
    }

    /// Terms of all rows.
    fn constrain(
        bank: &GaborBank<f32>,
        pair: [&Vec<Vec<f32>>; 2],
        seen: f32,
        offset: f32,
        floor: f32,
    ) -> Vec<f32> {
        let (height, width) = (pair[0].len(), pair[0][0].len() / 8);
        let filters = Filters::new(bank, offset, Weighting { floor, narrowness: 1.0 }, height);
        let mut out = vec![f32::NAN; height * 4 * TERMS * width];
        for (y, out) in out.chunks_mut(4 * TERMS * width).enumerate() {
            let near = [y.saturating_sub(1), y, (y + 1).min(height - 1)];
            let rows = pair.map(|frame| near.map(|y| &frame[y][..]));
            filters.constrain(y, &ResponsePair::new(rows, width), &vec![seen; width], out);
        }
        let bound = filters.largest_slope();
        let slopes = |row: &[f32]| row[..2 * width].iter().all(|g| g.abs() <= bound);
        assert!(out.chunks(TERMS * width).all(slopes));
        out
    }

    /// `G = k_j`, `D` the phase and `W = w A/(A + r^2) q^2`, at the edges too; without a neighbour along an axis the
    /// derivative reads the tuned frequency, which here is the truth.
    #[test]
    fn terms_of_plane_waves_are_exact_up_to_the_edge() {
        let bank = bank();
        for shape in [(5, 7), (4, 40), (1, 9), (9, 1), (1, 1), (2, 2)] {
            let pair = [waves(&bank, shape, 3.0, 0.2), waves(&bank, shape, 6.0, 0.9)];
            let out = constrain(&bank, [&pair[0], &pair[1]], 0.5, 2.0, 4.5);
            // A = 18, q = 36/45.
            let weight = 0.5 * 18.0 / (18.0 + 4.5) * 0.64;
            for (row, terms) in out.chunks(TERMS * shape.1).enumerate() {
                let [kx, ky] = bank.wavevectors()[row % 4];
                for x in 0..shape.1 {
                    let at = |term: usize| f64::from(terms[term * shape.1 + x]);
                    assert!((at(0) - 2.0 * kx).abs() < 1e-5 && (at(1) - 2.0 * ky).abs() < 1e-5);
                    assert!((at(2) - 0.7).abs() < 1e-5 && (at(3) - weight).abs() < 1e-5);
                }
            }
        }
    }

    #[test]
    fn what_is_not_a_number_has_no_say() {
        let bank = bank();
        let (good, mut bad) = (waves(&bank, (6, 6), 1.0, 0.0), waves(&bank, (6, 6), 1.0, 0.0));
        bad[3][2 * 6 + 2] = f32::NAN;
        let out = constrain(&bank, [&good, &bad], 1.0, 1.0, 1.0);
        assert!(out.iter().all(|term| term.is_finite()));
        assert_eq!(out[((3 * 4 + 1) * TERMS + 3) * 6 + 2], 0.0);
        let silent = vec![vec![0.0; 8 * 6]; 6];
        let out = constrain(&bank, [&good, &silent], 1.0, 1.0, 1.0);
        assert!(out.iter().all(|&term| term == 0.0));
    }

    /// A frequency far off the tuned one is dropped before its slope leaves the bound.
    #[test]
    fn slopes_stay_within_their_bound() {
        let bank = bank();
        let mut noise = waves(&bank, (9, 50), 1.0, 0.0);
        let mut state = 7u32;
        for sample in noise.iter_mut().flatten() {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            *sample = (state >> 8) as f32 / 8_388_608.0 - 1.0;
        }
        let out = constrain(&bank, [&noise, &noise], 1.0, -3.0, 1.0);
        assert!(out.iter().any(|term| term.abs() > 4.0));
    }
}
