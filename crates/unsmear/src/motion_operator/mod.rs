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
//! The adjoint is the same sum as a scatter.
//!
//! Units: px. Validity: finite pictures; the major curvature is cut at 0.8 of the major motion, and
//! paths of up to 1 px are taken as straight. A constant stays constant; a still pixel is
//! copied, and so is one of unknown motion (its datum should have no weight). Taps beyond the
//! padded picture read its edge.
//!
//! References: J. Bardsley et al., "Blind iterative restoration of images with spatially-varying blur",
//! Opt. Express 14 (2006) 1767-1782, [10.1364/OE.14.001767](https://doi.org/10.1364/OE.14.001767), section 2; R. G. Keys,
//! "Cubic convolution interpolation for digital image processing", IEEE Trans. ASSP 29 (1981) 1153-1160,
//! [10.1109/TASSP.1981.1163711](https://doi.org/10.1109/TASSP.1981.1163711).

mod scalar;

use crate::error::{Error, Result};
use crate::linear_operator::LinearOperator;
use crate::motion_path::MotionPaths;
use scalar::{ScalarPath, for_each_tap};

/// How x is interpolated between its pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Taps {
    /// Keys' cubic: accurate, some weights negative.
    Cubic,
    /// The triangle: faster and less accurate, no weight negative, as Richardson-Lucy needs it.
    Linear,
}

/// The blur of [`MotionPaths`]; see the [module](self).
#[derive(Debug, Clone)]
pub struct MotionOperator {
    paths: MotionPaths,
    taps: Taps,
    pad: usize,
}

impl MotionOperator {
    /// The operator on a picture padded by `pad` pixels; [`MotionPaths::reach`] is enough for all paths.
    ///
    /// # Errors
    /// [`Error::Shape`] for an empty picture or planes whose shapes differ.
    pub fn new(paths: &MotionPaths, taps: Taps, pad: usize) -> Result<Self> {
        if paths.velocity.u.is_empty() {
            return Err(Error::shape("paths", "(H >= 1, W >= 1)", paths.velocity.u.shape()));
        }
        Ok(Self { paths: paths.clone(), taps, pad })
    }

    /// Calls `tap(index of x, weight)` for every sample that data pixel (y, x) reads.
    fn for_each_tap(&self, y: usize, x: usize, mut tap: impl FnMut(usize, f64)) {
        let (rows, columns) = self.unknown_shape();
        let place = |row: i64, column: i64| {
            let row = (y as i64 + self.pad as i64 + row).clamp(0, rows as i64 - 1);
            let column = (x as i64 + self.pad as i64 + column).clamp(0, columns as i64 - 1);
            row as usize * columns + column as usize
        };
        let at = |field: &crate::FlowField<f32>| field.view().at(y, x).map(f64::from);
        let velocity = at(&self.paths.velocity);
        if velocity.iter().any(|z| z.is_nan()) {
            return tap(place(0, 0), 1.0);
        }
        let (curvature, offset) =
            (at(&self.paths.curvature), self.paths.offset.as_ref().map_or([0.0; 2], at));
        let down = velocity[1].abs() > velocity[0].abs();
        let order = |[u, v]: [f64; 2]| if down { [v, u] } else { [u, v] };
        let path = ScalarPath {
            velocity: order(velocity),
            curvature: order(curvature),
            offset: order(offset),
        };
        for_each_tap(&path, self.taps, |major, minor, weight| {
            tap(if down { place(major, minor) } else { place(minor, major) }, weight);
        });
    }
}

impl LinearOperator for MotionOperator {
    fn unknown_shape(&self) -> (usize, usize) {
        let (height, width) = self.paths.dim();
        (height + 2 * self.pad, width + 2 * self.pad)
    }

    fn data_shape(&self) -> (usize, usize) {
        self.paths.dim()
    }

    fn pad(&self) -> usize {
        self.pad
    }

    fn apply(&self, x: &[f32], b: &mut [f32]) {
        let (height, width) = self.data_shape();
        for row in 0..height {
            for column in 0..width {
                let mut sum = 0.0;
                self.for_each_tap(row, column, |i, weight| sum += weight * f64::from(x[i]));
                b[row * width + column] = sum as f32;
            }
        }
    }

    fn adjoint(&self, r: &[f32], x: &mut [f32]) {
        let (height, width) = self.data_shape();
        x.fill(0.0);
        for row in 0..height {
            for column in 0..width {
                let datum = f64::from(r[row * width + column]);
                self.for_each_tap(row, column, |i, weight| x[i] += (weight * datum) as f32);
            }
        }
    }
}

#[cfg(test)]
mod tests;
