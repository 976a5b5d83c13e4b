//! Convolution with large kernels by zero-padded transforms.
//!
//! For pictures and kernels of one shape (H, W), the full convolution
//!
//! ```text
//! f(y, x) = sum_{j, i} g(j, i) I(y - j, x - i),   0 <= y < 2H - 1,  0 <= x < 2W - 1
//! ```
//!
//! with zeros outside both (an explicit [`Border::Zero`]); kept are the (H, W)
//! samples from `crop` on. A padded size of (2H, 2W) holds it without wrap-around. Transforms run
//! axis by axis, so that empty rows are never transformed and unused ones never computed.
//!
//! A spectrum is kept transposed, (2W, 2H): its long axis is the one transformed last.

use multiversion::multiversion;
use ndarray::{Array2, ArrayView2};

use crate::border::Border;
use crate::control::Control;
use crate::error::{Error, Result};
use crate::fourier::{Complex64, LinePlan, transpose_into};

/// Lines transformed between two looks at the control: below 20 ms for lines of 8192 samples.
const LINES_PER_STEP: usize = 64;
/// Lines carried from one axis to the other together: eight samples are two cache lines wide, and
/// eight streams a power of two apart still fit the ways of a first-level cache.
const LINES_PER_TURN: usize = 8;

/// Plan for one picture shape; see the [module](self).
pub struct FftConvolver {
    height: usize,
    width: usize,
    crop: [usize; 2],
    along_x: LinePlan,
    along_y: LinePlan,
}

/// Some lines of a spectrum, the others being 0.
#[derive(Debug, Clone)]
pub struct LineSpectrum {
    /// Which lines of the (2W, 2H) spectrum.
    pub lines: Vec<usize>,
    /// Their values, line after line.
    pub values: Vec<Complex64>,
}

/// Buffers of an [`FftConvolver`], reusable over calls. Their contents are never read.
#[derive(Default)]
pub struct FftScratch {
    lines: Vec<Complex64>,
    turned: Vec<Complex64>,
    pub(crate) transform: Vec<Complex64>,
}

impl FftConvolver {
    /// Plans convolutions of (height, width) pictures, keeping samples from row `crop[0]`, column
    /// `crop[1]` of the full convolution.
    ///
    /// # Errors
    /// [`Error::Value`] when the crop would leave the full convolution.
    pub fn new(height: usize, width: usize, crop: [usize; 2]) -> Result<Self> {
        if height == 0 || width == 0 || crop[0] > height || crop[1] > width {
            let limits = format!("at most ({height}, {width}), both at least 1");
            return Err(Error::value("crop", limits, format!("{crop:?}")));
        }
        let (along_x, along_y) = (LinePlan::new(2 * width), LinePlan::new(2 * height));
        Ok(Self { height, width, crop, along_x, along_y })
    }

    /// Spectrum of a real picture, zero-padded.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub fn spectrum(
        &self,
        picture: ArrayView2<'_, f64>,
        scratch: &mut FftScratch,
        control: &Control,
    ) -> Result<Vec<Complex64>> {
        self.padded_spectrum(|y, x| Complex64::new(picture[(y, x)], 0.0), scratch, control)
    }

    /// Spectrum of a kernel, row-major in the shape of the pictures, zero-padded.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub fn kernel_spectrum(
        &self,
        kernel: impl Fn(usize, usize) -> Complex64,
        scratch: &mut FftScratch,
        control: &Control,
    ) -> Result<LineSpectrum> {
        let values = self.padded_spectrum(kernel, scratch, control)?;
        Ok(LineSpectrum { lines: (0..2 * self.width).collect(), values })
    }

    fn padded_spectrum(
        &self,
        sample: impl Fn(usize, usize) -> Complex64,
        scratch: &mut FftScratch,
        control: &Control,
    ) -> Result<Vec<Complex64>> {
        let (h, w) = (self.height, self.width);
        refill(&mut scratch.lines, h * 2 * w);
        for (y, line) in scratch.lines.chunks_mut(2 * w).enumerate() {
            line[..w].iter_mut().enumerate().for_each(|(x, s)| *s = sample(y, x));
        }
        for lines in scratch.lines.chunks_mut(LINES_PER_STEP * 2 * w) {
            control.check()?;
            self.along_x.forward(lines, &mut scratch.transform);
        }
        refill(&mut scratch.turned, h * 2 * w);
        transpose_into(&scratch.lines, h, 2 * w, &mut scratch.turned);
        let mut spectrum = vec![Complex64::default(); 4 * h * w];
        for (line, short) in spectrum.chunks_mut(2 * h).zip(scratch.turned.chunks(h)) {
            line[..h].copy_from_slice(short);
        }
        for lines in spectrum.chunks_mut(LINES_PER_STEP * 2 * h) {
            control.check()?;
            self.along_y.forward(lines, &mut scratch.transform);
        }
        Ok(spectrum)
    }

    /// Real and imaginary part of the kept part of the convolution of a picture and a kernel with
    /// these spectra, each row-major (H, W). Lines that the kernel lacks cost nothing.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub fn convolve(
        &self,
        picture: &[Complex64],
        kernel: &LineSpectrum,
        [re, im]: [&mut [f64]; 2],
        scratch: &mut FftScratch,
        control: &Control,
    ) -> Result<()> {
        let (h, w) = (self.height, self.width);
        let [top, left] = self.crop;
        let FftScratch { lines, turned, transform } = scratch;
        refill(turned, h * 2 * w);
        refill(lines, LINES_PER_TURN * 2 * h.max(w));
        let values = kernel.values.chunks(LINES_PER_TURN * 2 * h);
        for (columns, values) in kernel.lines.chunks(LINES_PER_TURN).zip(values) {
            control.check()?;
            let lines = &mut lines[..values.len()];
            for (i, &column) in columns.iter().enumerate() {
                let at = i * 2 * h..(i + 1) * 2 * h;
                multiply(&picture[column * 2 * h..][..2 * h], &values[at.clone()], &mut lines[at]);
            }
            self.along_y.inverse(lines, transform);
            for (y, row) in turned.chunks_mut(2 * w).enumerate() {
                for (i, &column) in columns.iter().enumerate() {
                    row[column] = lines[i * 2 * h + top + y];
                }
            }
        }
        let scale = 1.0 / (4 * h * w) as f64;
        let parts = re.chunks_mut(LINES_PER_TURN * w).zip(im.chunks_mut(LINES_PER_TURN * w));
        for (rows, (re, im)) in turned.chunks_mut(LINES_PER_TURN * 2 * w).zip(parts) {
            control.check()?;
            self.along_x.inverse(rows, transform);
            let parts = re.chunks_mut(w).zip(im.chunks_mut(w));
            for (row, (re, im)) in rows.chunks(2 * w).zip(parts) {
                for ((sample, re), im) in row[left..left + w].iter().zip(re).zip(im) {
                    (*re, *im) = (sample.re * scale, sample.im * scale);
                }
            }
        }
        Ok(())
    }
}

/// 'Same' convolution of a picture (H, W) with a smaller or larger real kernel, `border` continuing
/// the picture: `f(y, x) = sum_{j, i} g(j, i) I(y + c - j, x + d - i)` with the kernel's middle
/// `(c, d) = (floor(h/2), floor(w/2))` for a kernel (h, w).
///
/// Cheaper than the direct sum from about 15 x 15 taps on; separable kernels are better served by
/// [`crate::convolve`].
///
/// # Errors
/// [`Error::Shape`] when either is empty, [`Error::Cancelled`].
pub fn fft_convolve(
    picture: ArrayView2<'_, f64>,
    kernel: ArrayView2<'_, f64>,
    border: Border,
    control: &Control,
) -> Result<Array2<f64>> {
    for (argument, array) in [("picture", &picture), ("kernel", &kernel)] {
        if array.is_empty() {
            return Err(Error::shape(argument, "(H >= 1, W >= 1)", array.shape()));
        }
    }
    let ((height, width), (h, w)) = (picture.dim(), kernel.dim());
    // Room for what the kernel sees beyond the edges; then one shape for both.
    let shape = (height + h - 1, width + w - 1);
    let [top, left] = [h - 1 - h / 2, w - 1 - w / 2];
    let at = |y: usize, before: usize, n: usize| border.index(y as isize - before as isize, n);
    let continued =
        Array2::from_shape_fn(shape, |(y, x)| match (at(y, top, height), at(x, left, width)) {
            (Some(y), Some(x)) => picture[(y, x)],
            _ => 0.0,
        });
    let padded = Array2::from_shape_fn(shape, |at| kernel.get(at).copied().unwrap_or(0.0));
    let plan = FftConvolver::new(shape.0, shape.1, [h - 1, w - 1])?;
    let mut scratch = FftScratch::default();
    let picture = plan.spectrum(continued.view(), &mut scratch, control)?;
    let kernel =
        plan.kernel_spectrum(|j, i| Complex64::new(padded[(j, i)], 0.0), &mut scratch, control)?;
    let mut parts = [(); 2].map(|()| vec![0.0; shape.0 * shape.1]);
    let [re, im] = &mut parts;
    plan.convolve(&picture, &kernel, [re, im], &mut scratch, control)?;
    Ok(Array2::from_shape_fn((height, width), |(y, x)| parts[0][y * shape.1 + x]))
}

/// `out = a b`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn multiply(a: &[Complex64], b: &[Complex64], out: &mut [Complex64]) {
    let n = out.len();
    let (a, b) = (&a[..n], &b[..n]);
    for x in 0..n {
        out[x].re = a[x].re * b[x].re - a[x].im * b[x].im;
        out[x].im = a[x].re * b[x].im + a[x].im * b[x].re;
    }
}

fn refill(buffer: &mut Vec<Complex64>, length: usize) {
    buffer.clear();
    buffer.resize(length, Complex64::default());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equals_the_direct_sum_for_every_crop() {
        let (h, w) = (5, 6);
        let picture = Array2::from_shape_fn((h, w), |(y, x)| ((3 * y + x) as f64 * 1.1).sin());
        let kernel: Vec<Complex64> =
            (0..h * w).map(|i| Complex64::new(i as f64 * 0.1, (i as f64).cos())).collect();
        let mut scratch =
            FftScratch { lines: vec![Complex64::new(7.0, 7.0); 9], ..Default::default() };
        let go = Control::new();
        for crop in [[0, 0], [2, 3], [h, w]] {
            let plan = FftConvolver::new(h, w, crop).unwrap();
            let spectrum = plan.spectrum(picture.view(), &mut scratch, &go).unwrap();
            let kernel_spectrum =
                plan.kernel_spectrum(|j, i| kernel[j * w + i], &mut scratch, &go).unwrap();
            let (mut re, mut im) = (vec![9.0; h * w], vec![9.0; h * w]);
            let out = [&mut re[..], &mut im[..]];
            plan.convolve(&spectrum, &kernel_spectrum, out, &mut scratch, &go).unwrap();
            for (y, x) in (0..h).flat_map(|y| (0..w).map(move |x| (y, x))) {
                let got = Complex64::new(re[y * w + x], im[y * w + x]);
                let mut sum = Complex64::default();
                for (j, i) in (0..h).flat_map(|j| (0..w).map(move |i| (j, i))) {
                    let (row, column) =
                        ((y + crop[0]).checked_sub(j), (x + crop[1]).checked_sub(i));
                    if let (Some(row), Some(column)) = (row, column)
                        && row < h
                        && column < w
                    {
                        sum += kernel[j * w + i] * picture[(row, column)];
                    }
                }
                assert!((got - sum).norm() < 1e-13);
            }
        }
        assert!(FftConvolver::new(4, 4, [5, 0]).is_err());
    }

    #[test]
    fn same_convolution_follows_every_border_rule() {
        let picture = Array2::from_shape_fn((7, 9), |(y, x)| ((5 * y + 3 * x) as f64 * 0.7).cos());
        for (h, w) in [(1, 1), (3, 5), (4, 2), (9, 11)] {
            let kernel = Array2::from_shape_fn((h, w), |(j, i)| 1.0 + j as f64 - 0.3 * i as f64);
            for border in [Border::Replicate, Border::Reflect, Border::Zero] {
                let got = fft_convolve(picture.view(), kernel.view(), border, &Control::new());
                let got = got.unwrap();
                for ((y, x), got) in got.indexed_iter() {
                    let mut sum = 0.0;
                    for ((j, i), tap) in kernel.indexed_iter() {
                        let row = border.index((y + h / 2) as isize - j as isize, 7);
                        let column = border.index((x + w / 2) as isize - i as isize, 9);
                        if let (Some(row), Some(column)) = (row, column) {
                            sum += tap * picture[(row, column)];
                        }
                    }
                    // Up to 99 taps of up to 10: transforms round at 1e-16 of their total.
                    assert!((got - sum).abs() < 1e-11, "{h}x{w} {border:?} at {y}, {x}");
                }
            }
        }
        let empty = Array2::zeros((0, 3));
        assert!(fft_convolve(picture.view(), empty.view(), Border::Zero, &Control::new()).is_err());
    }
}
