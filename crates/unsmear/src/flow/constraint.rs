//! Constraints on the flow from the phase difference of two frames.
//!
//! For every filter and pixel `G.w + D = 0` with the mean phase gradient `G` (rad/px) and the phase
//! difference `D` (rad) of the two frames, and the weight
//!
//! ```text
//! W = p C^8 A/(A + r^2) q^2/(1 + d^4),   A = a a',  q = 2 a a'/(a^2 + a'^2)
//! ```
//!
//! of amplitudes `a, a'`, reference amplitude `r`, frequency deviation `d` (the greater of the two,
//! in units of `tau sigma_k`) and `C`, the share of the filter's window inside the picture. A
//! constraint that is not finite weighs nothing.
//!
//! Source: Fleet & Jepson 1990 (doi 10.1007/BF00056772), section 4, with soft tests.

use multiversion::multiversion;

use crate::array::for_each_row;
use crate::control::Control;
use crate::convolve::gaussian_taps;
use crate::error::Result;
use crate::gabor::{GaborBank, Responses};
use crate::phase_gradient::{PhaseGradient, PhaseRow};
use crate::phase_rate::phase_step;
use crate::real::Real;

/// Power of the coverage: half a window counts 0.4 %.
const COVERAGE_POWER: i32 = 8;

/// Responses of a bank to two frames.
pub(crate) struct Pair<'a, T> {
    pub(crate) bank: &'a GaborBank<T>,
    pub(crate) responses: [&'a Responses<T>; 2],
}

/// Rows `[G_x, G_y, D, W]` of each filter, (H, N, 4, W), weights times `p`.
pub(crate) fn constrain<T: Real>(
    pair: &Pair<'_, T>,
    reference: f64,
    tau: f64,
    p: f64,
    control: &Control,
) -> Result<Vec<T>> {
    let (filters, height, width) = pair.responses[0].dim();
    let wavevectors = pair.bank.wavevectors();
    let gradients = [0, 1].map(|i| PhaseGradient::new(pair.responses[i], wavevectors, control));
    let [first, second] = gradients;
    let (first, second) = (first?, second?);
    let [rows, columns] = [height, width].map(|n| coverage(n, pair.bank));
    let columns: Vec<T> = columns.into_iter().map(T::of).collect();
    // d^2 in units of (tau sigma_k)^2.
    let narrowness = T::of((pair.bank.sigma() / tau).powi(2));
    let floor = T::of(reference * reference);
    let mut out = vec![T::zero(); height * filters * 4 * width];
    for_each_row(&mut out, filters * 4 * width, control, |y, out| {
        let row_weight = T::of(p * rows[y]);
        for (filter, out) in out.chunks_mut(4 * width).enumerate() {
            let (a, b) = (first.row(filter, y), second.row(filter, y));
            let (slopes, rest) = out.split_at_mut(2 * width);
            let (steps, weights) = rest.split_at_mut(width);
            let [one, other] = pair.responses.map(|r| r.row(filter, y));
            phase_step(one, other, steps);
            let tuned = wavevectors[filter].map(T::of);
            let (gx, gy) = slopes.split_at_mut(width);
            weigh(&a, &b, tuned, [narrowness, floor], gx, gy, weights);
            cover(weights, &columns, row_weight, gx, gy);
        }
    })?;
    Ok(out)
}

/// `G` and the position-independent part of `W` of a row.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn weigh<T: Real>(
    a: &PhaseRow<'_, T>,
    b: &PhaseRow<'_, T>,
    [kx, ky]: [T; 2],
    [narrowness, floor]: [T; 2],
    gx: &mut [T],
    gy: &mut [T],
    weights: &mut [T],
) {
    let n = weights.len();
    let half = T::of(0.5);
    let (gx, gy) = (&mut gx[..n], &mut gy[..n]);
    let (a_x, a_y, a_power) = (&a.phi_x[..n], &a.phi_y[..n], &a.power[..n]);
    let (b_x, b_y, b_power) = (&b.phi_x[..n], &b.phi_y[..n], &b.power[..n]);
    for x in 0..n {
        gx[x] = half * (a_x[x] + b_x[x]);
        gy[x] = half * (a_y[x] + b_y[x]);
        let one = (a_x[x] - kx) * (a_x[x] - kx) + (a_y[x] - ky) * (a_y[x] - ky);
        let other = (b_x[x] - kx) * (b_x[x] - kx) + (b_y[x] - ky) * (b_y[x] - ky);
        // A NaN on either side must stay: `max` would lose it.
        let deviation = if one > other || one.is_nan() { one } else { other } * narrowness;
        let product = (a_power[x] * b_power[x]).sqrt();
        let alike = (product + product) / (a_power[x] + b_power[x]);
        weights[x] =
            alike * alike / (T::one() + deviation * deviation) * (product / (product + floor));
    }
}

/// Weights times the coverage; what is not above 0 after that is silenced.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn cover<T: Real>(weights: &mut [T], columns: &[T], row_weight: T, gx: &mut [T], gy: &mut [T]) {
    let n = weights.len();
    let (columns, gx, gy) = (&columns[..n], &mut gx[..n], &mut gy[..n]);
    for x in 0..n {
        let weight = weights[x] * (row_weight * columns[x]);
        let counts = weight > T::zero();
        // Not only weightless: a NaN must not reach the sums.
        weights[x] = if counts { weight } else { T::zero() };
        gx[x] = if counts { gx[x] } else { T::zero() };
        gy[x] = if counts { gy[x] } else { T::zero() };
    }
}

/// `C^8` along one axis: the share of the Gaussian window that lies inside `n` samples.
fn coverage<T: Real>(n: usize, bank: &GaborBank<T>) -> Vec<f64> {
    let radius = bank.radius();
    let taps = gaussian_taps(bank.sigma(), radius);
    (0..n)
        .map(|i| {
            let inside = |j: usize| (radius..n + radius).contains(&(i + j));
            let share: f64 = (0..taps.len()).filter(|&j| inside(j)).map(|j| taps[j]).sum();
            share.powi(COVERAGE_POWER)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::border::Border;
    use crate::gabor::GaborParameters;
    use ndarray::Array2;

    #[test]
    fn a_shift_fulfils_its_own_constraints() {
        let bank = GaborBank::<f64>::new(&GaborParameters::default()).unwrap();
        let wave = |shift: f64| {
            Array2::from_shape_fn((40, 40), |(y, x)| {
                let (x, y) = (x as f64 - 1.5 * shift, y as f64 + 0.5 * shift);
                (0.8 * x + 0.45 * y).cos()
            })
        };
        let respond = |picture: &Array2<f64>| {
            bank.respond(picture.view(), Border::Replicate, &Control::new()).unwrap()
        };
        let (first, second) = (respond(&wave(0.0)), respond(&wave(1.0)));
        let pair = Pair { bank: &bank, responses: [&first, &second] };
        let rows = constrain(&pair, 1e-6, 1.25, 1.0, &Control::new()).unwrap();
        let width = 40;
        for filter in 0..6 {
            let at = |term: usize| rows[((20 * 6 + filter) * 4 + term) * width + 20];
            if at(3) > 0.5 {
                let residual = at(0) * 1.5 - at(1) * 0.5 + at(2);
                // The wave is 0.05 rad/px off its nearest filter; leaks stay below 1 %.
                assert!(residual.abs() < 0.01, "filter {filter}: {residual}");
            }
        }
    }

    #[test]
    fn windows_half_outside_hardly_count() {
        let bank = GaborBank::<f32>::new(&GaborParameters::default()).unwrap();
        let covered = coverage(60, &bank);
        assert!(covered[0] < 0.01 && (covered[30] - 1.0).abs() < 1e-12);
        assert!((covered[0] - covered[59]).abs() < 1e-12);
    }
}
