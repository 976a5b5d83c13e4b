//! One blur kernel for the whole picture, of any shape, and its exact transpose.
//!
//! ```text
//! b(p) = sum_o w(o) x(p - o),        x'(p) = sum_o w(o) r(p + o)
//! ```
//!
//! a convolution: o runs over the offsets (rows, columns) of the kernel's samples from its centre, which
//! for n samples on an axis is sample floor(n / 2). [`path_kernel`] makes such a kernel from the samples of any
//! path, spread bilinearly. w is used as it is; a blur has the sum 1.
//!
//! Validity: finite weights. Beyond the padded picture x continues by its edge pixels.
//! Cost: a multiplication per pixel and nonzero weight.

use multiversion::multiversion;
use ndarray::{Array2, ArrayView2};
use rayon::prelude::*;

use crate::error::{Error, Result, require};
use crate::linear_operator::LinearOperator;
use crate::psf::LONGEST_MOTION;

/// A convolution; see the [module](self).
#[derive(Debug, Clone)]
pub struct KernelOperator {
    /// Rows and columns from a data pixel to the sample it reads, and its weight; in order of rows.
    taps: Vec<([isize; 2], f32)>,
    shape: (usize, usize),
    pad: usize,
}

impl KernelOperator {
    /// The blur of data of `shape` by `kernel`, on a picture padded by `pad` pixels.
    ///
    /// # Errors
    /// [`Error::Shape`] for an empty kernel or picture; [`Error::Value`] for a weight that is not finite.
    pub fn new(kernel: &ArrayView2<'_, f32>, shape: (usize, usize), pad: usize) -> Result<Self> {
        if kernel.is_empty() {
            return Err(Error::shape("kernel", "(h >= 1, w >= 1)", kernel.shape()));
        }
        if shape.0 == 0 || shape.1 == 0 {
            return Err(Error::shape("shape", "(H >= 1, W >= 1)", &[shape.0, shape.1]));
        }
        let centre = [kernel.nrows() / 2, kernel.ncols() / 2];
        let mut taps = Vec::new();
        for ((row, column), &weight) in kernel.indexed_iter() {
            require("kernel", f64::from(weight), "finite", |_| true)?;
            if weight != 0.0 {
                let to = [centre[0] as isize - row as isize, centre[1] as isize - column as isize];
                taps.push((to, weight));
            }
        }
        Ok(Self { taps, shape, pad })
    }

    /// Padding for which nothing is clamped.
    #[must_use]
    pub fn reach(&self) -> usize {
        self.taps.iter().flat_map(|(to, _)| to).map(|z| z.unsigned_abs()).max().unwrap_or(0)
    }

    /// Part of a line of `count` samples that lies `to` samples further within `length`: first
    /// sample, first place, number.
    fn overlap(count: usize, to: isize, length: usize) -> (usize, usize, usize) {
        let first = (-to).clamp(0, count as isize) as usize;
        let end = (length as isize - to).clamp(first as isize, count as isize) as usize;
        (first, (first as isize + to).clamp(0, length as isize) as usize, end - first)
    }
}

impl LinearOperator for KernelOperator {
    fn unknown_shape(&self) -> (usize, usize) {
        (self.shape.0 + 2 * self.pad, self.shape.1 + 2 * self.pad)
    }

    fn data_shape(&self) -> (usize, usize) {
        self.shape
    }

    fn pad(&self) -> usize {
        self.pad
    }

    fn apply(&self, x: &[f32], b: &mut [f32]) {
        let (rows, columns) = self.unknown_shape();
        let (width, pad) = (self.shape.1, self.pad as isize);
        assert_eq!(x.len(), rows * columns, "x has the shape of the unknown");
        b.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
            out.fill(0.0);
            for &([down, right], weight) in &self.taps {
                let row = (y as isize + pad + down).clamp(0, rows as isize - 1) as usize;
                let line = &x[row * columns..][..columns];
                let (first, from, n) = Self::overlap(width, pad + right, columns);
                add_scaled(&mut out[first..first + n], &line[from..from + n], weight);
                out[..first].iter_mut().for_each(|sample| *sample += weight * line[0]);
                out[first + n..]
                    .iter_mut()
                    .for_each(|sample| *sample += weight * line[columns - 1]);
            }
        });
    }

    fn adjoint(&self, r: &[f32], x: &mut [f32]) {
        let (rows, columns) = self.unknown_shape();
        let (height, width) = self.shape;
        let pad = self.pad as isize;
        assert_eq!(r.len(), height * width, "r has the shape of the data");
        x.par_chunks_mut(columns).enumerate().for_each(|(row, out)| {
            out.fill(0.0);
            for &([down, right], weight) in &self.taps {
                // Rows of the data whose tap falls, or is clamped, on this row.
                let y = row as isize - pad - down;
                let from = if row == 0 { 0 } else { y.clamp(0, height as isize) };
                let to = if row == rows - 1 {
                    height as isize
                } else {
                    (y + 1).clamp(0, height as isize)
                };
                for y in from..to {
                    let line = &r[y as usize * width..][..width];
                    let (first, place, n) = Self::overlap(width, pad + right, columns);
                    add_scaled(&mut out[place..place + n], &line[first..first + n], weight);
                    out[0] += weight * line[..first].iter().sum::<f32>();
                    out[columns - 1] += weight * line[first + n..].iter().sum::<f32>();
                }
            }
        });
    }
}

/// `out` += `weight` `line`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn add_scaled(out: &mut [f32], line: &[f32], weight: f32) {
    let line = &line[..out.len()];
    for i in 0..line.len() {
        out[i] += weight * line[i];
    }
}

/// The kernel of a path sampled at `points` (dx to the right, dy downwards, weight): each sample spread over
/// the four pixels around it. Odd on both axes, centre at (0, 0).
///
/// # Errors
/// [`Error::Value`] for no point, or one that is not finite or beyond [`LONGEST_MOTION`].
///
/// ```
/// let kernel = unsmear::kernel_operator::path_kernel(&[[0.0, 0.0, 0.5], [0.5, 0.0, 0.5]])?;
/// assert_eq!(kernel.as_slice(), Some(&[0.0, 0.75, 0.25][..]));
/// # Ok::<(), unsmear::Error>(())
/// ```
pub fn path_kernel(points: &[[f64; 3]]) -> Result<Array2<f32>> {
    if points.is_empty() {
        return Err(Error::value("points", "at least one point", 0));
    }
    let mut half = [0usize; 2];
    for &[dx, dy, weight] in points {
        for (axis, z) in [dx, dy].into_iter().enumerate() {
            require("points", z, "finite and at most 4096 px", |z| z.abs() <= LONGEST_MOTION)?;
            half[axis] = half[axis].max(z.abs().ceil() as usize);
        }
        require("points", weight, "finite", |_| true)?;
    }
    let mut kernel = Array2::<f64>::zeros((2 * half[1] + 1, 2 * half[0] + 1));
    for &[dx, dy, weight] in points {
        let (x, y) = (dx + half[0] as f64, dy + half[1] as f64);
        let (column, row) = (x.floor(), y.floor());
        for (down, share) in [(0, 1.0 - (y - row)), (1, y - row)] {
            for (right, part) in [(0, 1.0 - (x - column)), (1, x - column)] {
                // Off the rim only where the share is exactly zero.
                if let Some(sample) = kernel.get_mut((row as usize + down, column as usize + right))
                {
                    *sample += weight * share * part;
                }
            }
        }
    }
    Ok(kernel.mapv(|weight| weight as f32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear_operator::trials::{asymmetry, noise};

    #[test]
    fn the_adjoint_is_the_transpose_clamped_or_not() {
        for (size, shape, pad) in [((5, 7), (9, 11), 4), ((4, 6), (8, 13), 1), ((9, 9), (3, 2), 0)]
        {
            let kernel = Array2::from_shape_vec(size, noise(size.0 * size.1, 1)).unwrap();
            let operator = KernelOperator::new(&kernel.view(), shape, pad).unwrap();
            let error = asymmetry(&operator);
            // Some 100 roundings of 6e-8, mostly cancelling.
            assert!(error < 1e-6, "{size:?} {error}");
        }
    }

    #[test]
    fn an_impulse_shows_the_kernel_and_a_constant_stays() {
        let kernel = Array2::from_shape_fn((3, 4), |(y, x)| (1 + y * 4 + x) as f32 / 78.0);
        let operator = KernelOperator::new(&kernel.view(), (7, 7), 2).unwrap();
        let mut x = vec![0.0; 11 * 11];
        x[5 * 11 + 5] = 1.0;
        let mut b = vec![0.0; 49];
        operator.apply(&x, &mut b);
        for ((row, column), &weight) in kernel.indexed_iter() {
            // Sample (1, 2) of the kernel is its centre, (3, 3) of the data that of the picture.
            assert_eq!(b[(3 + row - 1) * 7 + 3 + column - 2], weight);
        }
        operator.apply(&vec![3.0; 121], &mut b);
        assert!(b.iter().all(|&sample| (sample - 3.0).abs() < 1e-5));
    }

    #[test]
    fn bad_kernels_are_refused() {
        let refuse = |kernel: Array2<f32>, shape| {
            KernelOperator::new(&kernel.view(), shape, 0).unwrap_err().to_string()
        };
        assert!(refuse(Array2::zeros((0, 3)), (4, 4)).starts_with("kernel must"));
        assert!(refuse(Array2::from_elem((1, 1), f32::NAN), (4, 4)).starts_with("kernel must"));
        assert!(refuse(Array2::zeros((3, 3)), (0, 4)).starts_with("shape must"));
        assert!(path_kernel(&[]).is_err());
        assert!(path_kernel(&[[f64::INFINITY, 0.0, 1.0]]).is_err());
    }
}
