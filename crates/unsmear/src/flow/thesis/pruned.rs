//! Padded spectrum of a trimmed founding kernel, straight from its few bins.
//!
//! The kernel is `g(y, x) = 1/(H W) sum_{p, q} K(p, q) exp(2 pi i (p y / H + q x / W))` with about
//! `pi ceil(W / sigma)^2` bins `K` not 0, some 70 in all. Zero-padded to (2H, 2W) its spectrum is
//!
//! ```text
//! S(P, Q) = 1/(H W) sum_{p, q} K(p, q) E_H(2p - P) E_W(2q - Q)
//! E_n(m)  = sum_{y < n} exp(i pi m y / n) = n              m = 0
//!                                           0              m even, |m| < 2n
//!                                           1 + i cot(pi m / 2n)   m odd
//! ```
//!
//! so that no transform of the padded size is needed, and of the even columns `Q` only those of
//! kept bins are not 0. This is a rearrangement, not an approximation: it agrees with the
//! transform of [`Bank::kernel`] to rounding.

use std::f64::consts::PI;

use multiversion::multiversion;

use super::bank::Bank;
use crate::fft_convolve::LineSpectrum;
use crate::fourier::{Complex64, LinePlan};

/// Plan for one picture shape; see the [module](self).
pub struct PrunedSpectrum {
    along_x: LinePlan,
    along_y: LinePlan,
    /// `cot(pi (2 j + 1) / 2n)` at `j` and `j + n`, for `n = H` and `n = W`.
    cotangents: [Vec<f64>; 2],
}

/// The bins of one filter: `values[column * rows.len() + row]`, 0 where one is not kept.
struct Bins {
    rows: Vec<usize>,
    columns: Vec<usize>,
    values: Vec<Complex64>,
}

impl PrunedSpectrum {
    /// Plans the spectra of kernels of (height, width), both at least 1.
    #[must_use]
    pub fn new(height: usize, width: usize) -> Self {
        let cotangents = [height, width].map(|n| {
            (0..2 * n)
                .map(|j| 1.0 / (PI * (2 * (j % n) + 1) as f64 / (2 * n) as f64).tan())
                .collect()
        });
        Self { along_x: LinePlan::new(width), along_y: LinePlan::new(height), cotangents }
    }

    /// The spectrum of the filter of `bank` at `angle` degrees, zero-padded, transposed.
    #[must_use]
    pub fn of(&self, bank: &Bank, angle: f64, scratch: &mut Vec<Complex64>) -> LineSpectrum {
        let (height, width) = bank.shape();
        let bins = self.bins(bank, angle, scratch);
        let mut lines: Vec<usize> = (0..width).map(|k| 2 * k + 1).collect();
        lines.extend(bins.columns.iter().map(|q| 2 * q));
        // In order of memory: the picture's spectrum is then read from one end to the other.
        lines.sort_unstable();
        let mut values = vec![Complex64::default(); lines.len() * 2 * height];
        let mut parts = [vec![0.0; height], vec![0.0; height]];
        for (&line, out) in lines.iter().zip(values.chunks_mut(2 * height)) {
            let weights = self.weights(&bins, line, width);
            self.spread(&bins.rows, &weights, &mut parts, out);
        }
        LineSpectrum { lines, values }
    }

    /// Kept bins of the window's transform: only rows inside the disc and columns of kept bins
    /// are transformed.
    fn bins(&self, bank: &Bank, angle: f64, scratch: &mut Vec<Complex64>) -> Bins {
        let (h, w) = bank.shape();
        let (rows, columns) = bank.kept_extent(angle);
        let mut window = bank.window(angle);
        let disc = bank.disc_rows();
        self.along_x.forward(&mut window[disc.start * w..disc.end * w], scratch);
        // Zero frequency moves from the middle to the first bin.
        let bin = |centred: usize, n: usize| (centred + n - n / 2) % n;
        let mut values = Vec::with_capacity(rows.len() * columns.len());
        let mut line = vec![Complex64::default(); h];
        for column in columns.clone() {
            let q = bin(column, w);
            line.iter_mut().zip(window.chunks(w)).for_each(|(sample, row)| *sample = row[q]);
            self.along_y.forward(&mut line, scratch);
            values.extend(rows.clone().map(|row| {
                if bank.keeps(angle, row, column) {
                    line[bin(row, h)]
                } else {
                    Complex64::default()
                }
            }));
        }
        let [rows, columns] =
            [(rows, h), (columns, w)].map(|(range, n)| range.map(|i| bin(i, n)).collect());
        Bins { rows, columns, values }
    }

    /// `1/(H W) sum_q K(p, q) E_W(2q - Q)` of every row `p` of bins.
    fn weights(&self, bins: &Bins, line: usize, width: usize) -> Vec<Complex64> {
        let count = bins.rows.len();
        let mut weights = vec![Complex64::default(); count];
        let height = self.cotangents[0].len() / 2;
        let scale = 1.0 / (height * width) as f64;
        for (&q, values) in bins.columns.iter().zip(bins.values.chunks(count.max(1))) {
            let factor = if line % 2 == 1 {
                // 2q - Q = 2 j + 1 modulo 2W.
                Complex64::new(1.0, self.cotangents[1][(q + width - line.div_ceil(2)) % width])
            } else if line == 2 * q {
                Complex64::new(width as f64, 0.0)
            } else {
                continue;
            };
            let factor = factor * scale;
            weights.iter_mut().zip(values).for_each(|(sum, value)| *sum += value * factor);
        }
        weights
    }

    /// `sum_p weights(p) E_H(2p - P)` for every `P`.
    fn spread(
        &self,
        rows: &[usize],
        weights: &[Complex64],
        [re, im]: &mut [Vec<f64>; 2],
        out: &mut [Complex64],
    ) {
        let height = re.len();
        let sum: Complex64 = weights.iter().sum();
        re.fill(sum.re);
        im.fill(sum.im);
        for (&p, &weight) in rows.iter().zip(weights) {
            // cot(pi (2p - 2k - 1) / 2H) = -cot(pi (2 (k - p) + 1) / 2H), k = 0..H.
            add_turned(weight, &self.cotangents[0][height - p..2 * height - p], re, im);
            out[2 * p] = weight * height as f64;
        }
        for ((pair, &re), &im) in out.chunks_exact_mut(2).zip(&*re).zip(&*im) {
            pair[1] = Complex64::new(re, im);
        }
    }
}

/// Adds `-i weight table` to `re + i im`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn add_turned(weight: Complex64, table: &[f64], re: &mut [f64], im: &mut [f64]) {
    let n = table.len();
    let (re, im) = (&mut re[..n], &mut im[..n]);
    for k in 0..n {
        re[k] += weight.im * table[k];
        im[k] -= weight.re * table[k];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::Control;
    use crate::fft_convolve::{FftConvolver, FftScratch};
    use crate::fourier::Fft2;

    /// Against the kernel itself, transformed at the padded size: even and odd sizes, few bins and
    /// many, bins that leave the spectrum.
    #[test]
    fn equals_the_transform_of_the_trimmed_kernel() {
        let (mut scratch, go) = (FftScratch::default(), Control::new());
        for (height, width, frequency) in
            [(16, 20, 0.15), (15, 21, 0.06), (20, 9, 0.45), (1, 6, 0.2)]
        {
            let bank = Bank::new(height, width, frequency, 0.8).unwrap();
            let convolver = FftConvolver::new(height, width, [0, 0]).unwrap();
            let pruned = PrunedSpectrum::new(height, width);
            for angle in bank.angles() {
                let kernel = bank.kernel(angle, &Fft2::new(height, width), &mut Vec::new());
                let sample = |y: usize, x: usize| kernel[y * width + x];
                let whole = convolver.kernel_spectrum(sample, &mut scratch, &go).unwrap();
                let mut rest = whole.values;
                let largest = rest.iter().map(|value| value.norm()).fold(0.0, f64::max);
                let got = pruned.of(&bank, angle, &mut Vec::new());
                for (&line, values) in got.lines.iter().zip(got.values.chunks(2 * height)) {
                    let expected = &mut rest[line * 2 * height..][..2 * height];
                    expected.iter_mut().zip(values).for_each(|(e, v)| *e -= v);
                }
                let worst = rest.iter().map(|value| value.norm()).fold(0.0, f64::max);
                // Both round sums of up to 400 terms at 1e-16 of the largest.
                assert!(worst <= 1e-13 * largest, "{height}x{width}: {worst} of {largest}");
            }
        }
    }
}
