//! A picture at a falling number of pixels, and the resampling between its sizes.
//!
//! Level `l + 1` has `ceil(f h)` rows and `ceil(f w)` columns of level `l`'s `h` and `w`, `f` the
//! factor, and samples it after a Gaussian that removes what the smaller picture cannot hold:
//!
//! ```text
//! s = 0.9 px for f = 1/2,  else  s = sqrt(1/f^2 - 1)/2 px,    reflected at the edge
//! small[i] = sum_k w(p - k) smooth[k],   p = (i + 1/2) n/m - 1/2,   n -> m samples
//! ```
//!
//! Areas are centred on areas, so that nothing shifts between levels. `w` is the triangle
//! `1 - |t|` ([`Resampling::Linear`]) or Keys' cubic with slope -1/2 ([`Resampling::Cubic`]);
//! positions beyond the edge read the edge sample. Both reproduce straight lines away from the edge.
//!
//! Units: those of the samples; px of the respective level. A NaN spreads over the reach of the
//! filters. Sources: P. J. Burt & E. H. Adelson 1983 (doi 10.1109/TCOM.1983.1095851) for the
//! pyramid; R. G. Keys 1981 (doi 10.1109/TASSP.1981.1163711) for the cubic.

use multiversion::multiversion;
use ndarray::{Array2, ArrayView2};

use crate::array::for_each_row_with;
use crate::border::Border;
use crate::control::Control;
use crate::error::Result;
use crate::halving::smooth_and_halve;
use crate::real::Real;
pub use crate::smoothing::smooth;
use crate::tasks::filled_picture;

/// Deviation before halving, px: a little alias against a little blur.
const HALVING_SIGMA: f64 = 0.9;
/// Slope of the cubic at distance 1: the one for which straight lines stay straight.
const CUBIC_SLOPE: f64 = -0.5;

/// Weights between samples; see the [module](self).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Resampling {
    /// Two samples per axis.
    Linear,
    /// Four samples per axis.
    Cubic,
}

/// `picture` at another size, areas centred on areas; see the [module](self). Not smoothed.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub fn resample<T: Real>(
    picture: ArrayView2<'_, T>,
    (height, width): (usize, usize),
    kind: Resampling,
    control: &Control,
) -> Result<Array2<T>> {
    let (rows, columns) = picture.dim();
    if (rows, columns) == (height, width) {
        return Ok(picture.to_owned());
    }
    let mut out = filled_picture(T::zero(), (height, width));
    if picture.is_empty() {
        return Ok(out);
    }
    let picture = picture.as_standard_layout();
    let source = picture.as_slice().unwrap_or_default();
    let (down, across) = (reads::<T>(rows, height, kind), reads::<T>(columns, width, kind));
    let target = out.as_slice_mut().unwrap_or_default();
    let scratch = || vec![T::zero(); columns];
    for_each_row_with(target, width, control, scratch, |y, out, line| {
        line.fill(T::zero());
        for (&k, &weight) in down.samples(y).zip(down.weights(y)) {
            add(&source[k * columns..(k + 1) * columns], weight, line);
        }
        match kind {
            Resampling::Linear if columns == 2 * width => halve(line, out),
            Resampling::Linear if width == 2 * columns => double(line, out),
            _ => {
                for (x, out) in out.iter_mut().enumerate() {
                    let taps = across.samples(x).zip(across.weights(x));
                    *out = taps.fold(T::zero(), |sum, (&k, &w)| sum + w * line[k]);
                }
            }
        }
    })?;
    Ok(out)
}

/// Adds a line times `weight`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn add<T: Real>(line: &[T], weight: T, sums: &mut [T]) {
    for (sum, &s) in sums.iter_mut().zip(line) {
        *sum += weight * s;
    }
}

/// [`Resampling::Linear`] to half the samples: with the same bits as the general form, in vectors.
fn halve<T: Real>(line: &[T], out: &mut [T]) {
    let half = T::of(0.5);
    for (pair, out) in line.chunks_exact(2).zip(out) {
        *out = T::zero() + half * pair[0] + half * pair[1];
    }
}

/// [`Resampling::Linear`] to twice the samples, likewise.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn double<T: Real>(line: &[T], out: &mut [T]) {
    let (near, far) = (T::of(0.75), T::of(0.25));
    let last = line.len() - 1;
    let pairs = out.as_chunks_mut::<2>().0;
    let inner = last.saturating_sub(1);
    if inner > 0 {
        let (before, here, after) = (&line[..inner], &line[1..=inner], &line[2..][..inner]);
        let pairs = &mut pairs[1..=inner];
        for x in 0..inner {
            pairs[x][0] = T::zero() + far * before[x] + near * here[x];
            pairs[x][1] = T::zero() + near * here[x] + far * after[x];
        }
    }
    for i in [0, last] {
        let (before, after) = (line[i.saturating_sub(1)], line[(i + 1).min(last)]);
        pairs[i][0] = T::zero() + far * before + near * line[i];
        pairs[i][1] = T::zero() + near * line[i] + far * after;
    }
}

/// The sizes (H, W) of the levels, finest first: as long as the shorter side keeps `least` samples.
#[must_use]
pub fn level_sizes((h, w): (usize, usize), factor: f64, least: f64) -> Vec<(usize, usize)> {
    let mut sizes = vec![(h, w)];
    let shorter = h.min(w) as f64;
    while shorter * factor.powi(sizes.len() as i32) >= least {
        let (h, w) = sizes[sizes.len() - 1];
        sizes.push(((h as f64 * factor).ceil() as usize, (w as f64 * factor).ceil() as usize));
    }
    sizes
}

/// The picture at each of `sizes`, the first its own, reduced by `factor` from one to the next.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub fn pyramid<T: Real>(
    picture: Array2<T>,
    sizes: &[(usize, usize)],
    factor: f64,
    control: &Control,
) -> Result<Vec<Array2<T>>> {
    let halving = factor == 0.5;
    let sigma = if halving { HALVING_SIGMA } else { 0.5 * (factor.powi(-2) - 1.0).sqrt() };
    let kind = if halving { Resampling::Linear } else { Resampling::Cubic };
    let mut levels = vec![picture];
    for &size in sizes.iter().skip(1) {
        let last = levels[levels.len() - 1].view();
        let smaller = if halving && last.dim() == (2 * size.0, 2 * size.1) {
            smooth_and_halve(last, sigma, control)?
        } else {
            resample(smooth(last, sigma, control)?.view(), size, kind, control)?
        };
        levels.push(smaller);
    }
    Ok(levels)
}

/// What each sample of a line reads of another line: the same number of samples for all.
struct Reads<T> {
    count: usize,
    samples: Vec<usize>,
    weights: Vec<T>,
}

impl<T> Reads<T> {
    fn samples(&self, i: usize) -> std::slice::Iter<'_, usize> {
        self.samples[i * self.count..(i + 1) * self.count].iter()
    }

    fn weights(&self, i: usize) -> std::slice::Iter<'_, T> {
        self.weights[i * self.count..(i + 1) * self.count].iter()
    }
}

fn reads<T: Real>(from: usize, to: usize, kind: Resampling) -> Reads<T> {
    let step = from as f64 / to as f64;
    let offsets = match kind {
        Resampling::Linear => 0..2,
        Resampling::Cubic => -1..3,
    };
    let mut reads = Reads { count: offsets.len(), samples: Vec::new(), weights: Vec::new() };
    for i in 0..to {
        let position = (i as f64 + 0.5) * step - 0.5;
        let first = position.floor();
        for offset in offsets.clone() {
            let distance = position - first - offset as f64;
            let weight = match kind {
                Resampling::Linear => 1.0 - distance.abs(),
                Resampling::Cubic => keys(distance),
            };
            let sample = Border::Replicate.index(first as isize + offset, from);
            reads.samples.push(sample.unwrap_or_default());
            reads.weights.push(T::of(weight));
        }
    }
    reads
}

/// Keys' cubic at distance `t`.
fn keys(t: f64) -> f64 {
    let (a, t) = (CUBIC_SLOPE, t.abs());
    if t < 1.0 {
        ((a + 2.0) * t - (a + 3.0)) * t * t + 1.0
    } else if t < 2.0 {
        ((a * t - 5.0 * a) * t + 8.0 * a) * t - 4.0 * a
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp((h, w): (usize, usize)) -> Array2<f64> {
        Array2::from_shape_fn((h, w), |(y, x)| 3.0 + 2.0 * x as f64 - 0.5 * y as f64)
    }

    /// Pixel `i` of the small picture covers `step` pixels, whose centre is at (i + 1/2) step - 1/2.
    #[test]
    fn areas_stay_centred() {
        let control = Control::new();
        for kind in [Resampling::Linear, Resampling::Cubic] {
            for size in [(20, 16), (30, 37), (23, 24), (80, 64)] {
                let small = resample(ramp((40, 32)).view(), size, kind, &control).unwrap();
                let (y, x) = (size.0 / 2, size.1 / 3);
                let at = |i: usize, n: f64, m: usize| (i as f64 + 0.5) * n / m as f64 - 0.5;
                let expected = 3.0 + 2.0 * at(x, 32.0, size.1) - 0.5 * at(y, 40.0, size.0);
                assert!((small[(y, x)] - expected).abs() < 1e-12, "{kind:?} {size:?}");
            }
        }
    }

    /// The forms for half and twice the samples give the bits of the general one, which reads one line more.
    #[test]
    fn half_and_twice_are_the_general_form() {
        for n in [1, 2, 3, 4, 7, 16, 33] {
            let line: Vec<f32> = (0..2 * n).map(|i| ((i * i * 7) % 23) as f32 - 11.3).collect();
            let direct = |line: &[f32], to: usize| -> Vec<f32> {
                let reads = reads::<f32>(line.len(), to, Resampling::Linear);
                let value = |i| {
                    reads.samples(i).zip(reads.weights(i)).fold(0.0, |s, (&k, &w)| s + w * line[k])
                };
                (0..to).map(value).collect()
            };
            let (mut small, mut large) = (vec![0.0; n], vec![0.0; 4 * n]);
            halve(&line, &mut small);
            double(&line, &mut large);
            assert_eq!((small, large), (direct(&line, n), direct(&line, 4 * n)), "{n}");
            let (one, mut two) = (&line[..1], [0.0; 2]);
            double(one, &mut two);
            assert_eq!(two.to_vec(), direct(one, 2));
        }
    }

    #[test]
    fn constant_and_own_size_are_kept() {
        let control = Control::new();
        let flat = Array2::from_elem((9, 13), 7.0f64);
        let levels = pyramid(flat, &level_sizes((9, 13), 0.75, 3.0), 0.75, &control).unwrap();
        assert!(levels.len() > 3 && levels.iter().flatten().all(|s| (s - 7.0).abs() < 1e-13));
        let same = resample(ramp((9, 13)).view(), (9, 13), Resampling::Cubic, &control).unwrap();
        assert_eq!(same, ramp((9, 13)));
    }

    #[test]
    fn sizes_end_at_the_least() {
        assert_eq!(level_sizes((64, 100), 0.5, 16.0), [(64, 100), (32, 50), (16, 25)]);
        assert_eq!(level_sizes((5, 7), 0.5, 16.0), [(5, 7)]);
    }
}
