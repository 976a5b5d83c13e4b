//! The founding deblurring: one tiny regularised inverse per pixel, applied on an upsampled picture.
//!
//! **It makes pictures worse.** It is kept as the reference of the founding work, and reproduces it number by number;
//! use the Wiener method for pictures. With degree n >= 1, m = 2^(n-1), regularisation r:
//!
//! ```text
//! length = round(m |v|) px, angle = atan2(-v, u) degrees      of the pixel's motion (u, v) px/frame
//! k = fspecial_motion(length, angle);  K = DFT of k at its own size (p, q)
//! H = conj(K) / (|K|^2 + r);  h = inverse DFT of H
//! output = sum of h, flipped on both axes, laid over the picture upsampled m times (linear)
//! ```
//!
//! with element `floor((p + 1)/2), floor((q + 1)/2)` (counted from 1) of the flipped kernel on the pixel's node, the
//! overlay wrapping round. Rows and columns 10 .. s - 10 (from 1) are computed, the rest is 0. Pixels whose motion is
//! unknown (NaN) or rounds to nothing, and those whose k is a single sample, are copied.
//!
//! Causes of its losses: a DFT at the kernel's own size wraps the inverse round itself (for an axis-aligned line of
//! odd length H is a plain box blur again); the flipped inverse's peak lies one sample before the node, which shifts
//! the picture by 1/m px; the constant gain is 1/(1 + r), not 1; lengths are rounded. Cost: about (m |v|)^2 per pixel.
//!
//! Source: C. Texin, "Optical Flow Using Phase Information for Deblurring", M.Eng. thesis, MIT, 2007, section 4.2.

use std::collections::HashMap;

use ndarray::{Array2, ArrayView2};

use crate::array::{for_each_row_with, require_same};
use crate::control::Control;
use crate::error::{Error, Result, require};
use crate::flow_field::FlowView;
use crate::fourier::{Complex64, Fft2};
use crate::psf::{LONGEST_MOTION, fspecial_motion};

/// First row and column computed, counted from 1; also the distance of the last from the far edge.
const MARGIN: usize = 10;

/// Kernels a task keeps: enough for piecewise constant motion, a few megabytes at most for usual lengths.
const KEPT_KERNELS: usize = 32;

/// Parameters of the founding deblurring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThesisDeblur {
    /// Interpolation degree n in 1..=4: the picture is upsampled 2^(n-1) times. The founding work used 4.
    pub degree: usize,
    /// r > 0, against the power |K|^2 <= 1 of a unit-sum kernel. The founding work used 0.02.
    pub regularization: f64,
}

impl Default for ThesisDeblur {
    fn default() -> Self {
        Self { degree: 4, regularization: 0.02 }
    }
}

/// What the founding method gives.
#[derive(Debug, Clone, PartialEq)]
pub struct ThesisResult {
    /// The filtered picture, shape (H, W); 0 outside the computed rows and columns.
    pub image: Array2<f64>,
    /// Pixels copied because their motion is unknown.
    pub unknown: usize,
}

impl ThesisDeblur {
    /// Filters `image` by its motion `flow` (px per exposure).
    ///
    /// # Errors
    /// [`Error::Value`] for a degree outside 1..=4, r not positive, or motion longer than [`LONGEST_MOTION`] on the
    /// upsampled picture; [`Error::Shape`] when the shapes differ or are empty; [`Error::Cancelled`].
    pub fn apply(
        &self,
        image: &ArrayView2<'_, f64>,
        flow: &FlowView<'_, f64>,
        control: &Control,
    ) -> Result<ThesisResult> {
        if !(1..=4).contains(&self.degree) {
            return Err(Error::value("degree", "1, 2, 3 or 4", self.degree));
        }
        require("regularization", self.regularization, "finite and positive", |r| r > 0.0)?;
        if image.is_empty() {
            return Err(Error::shape("image", "(H >= 1, W >= 1)", image.shape()));
        }
        require_same("flow", &flow.u, image.dim())?;
        let scale = 1usize << (self.degree - 1);
        let longest = flow.u.iter().zip(flow.v.iter()).map(|(&u, &v)| u.hypot(v) * scale as f64);
        if let Some(length) = longest.filter(|length| *length > LONGEST_MOTION).reduce(f64::max) {
            let expected = "at most 4096 px long on the upsampled picture";
            return Err(Error::value("flow", expected, length));
        }
        let (height, width) = image.dim();
        let fine = upsample_linear(image, self.degree - 1);
        let mut out = Array2::zeros((height, width));
        let rows = MARGIN - 1..height.saturating_sub(MARGIN);
        let columns = MARGIN - 1..width.saturating_sub(MARGIN);
        let samples: &mut [f64] = out.as_slice_mut().unwrap_or_default();
        control.expect(height);
        for_each_row_with(samples, width, control, Inverses::default, |y, row, inverses| {
            // A cancelled run is noticed by the helper before its next row.
            let _ = control.advance();
            if !rows.contains(&y) {
                return;
            }
            for x in columns.clone() {
                let motion = flow.at(y, x).map(|c| c * scale as f64);
                let kernel = inverses.of(motion, self.regularization);
                row[x] = kernel.map_or(image[(y, x)], |k| k.overlay(&fine, y * scale, x * scale));
            }
        })?;
        let unknown = flow.u.iter().zip(flow.v.iter()).filter(|(u, v)| (**u + **v).is_nan());
        Ok(ThesisResult { image: out, unknown: unknown.count() })
    }
}

/// A flipped inverse kernel; the element at `node` lies on the pixel.
struct Inverse {
    flipped: Array2<f64>,
    node: [usize; 2],
}

impl Inverse {
    /// None where the kernel is a single sample.
    fn new(psf: &Array2<f64>, plan: &Fft2, r: f64, scratch: &mut Vec<Complex64>) -> Option<Self> {
        if psf.len() == 1 {
            return None;
        }
        let (p, q) = psf.dim();
        let mut spectrum: Vec<Complex64> = psf.iter().map(|&w| w.into()).collect();
        plan.forward(&mut spectrum, scratch);
        for k in &mut spectrum {
            *k = k.conj() / (k.norm_sqr() + r);
        }
        plan.inverse(&mut spectrum, scratch);
        let flipped = Array2::from_shape_fn((p, q), |(i, j)| spectrum[p * q - 1 - i * q - j].re);
        Some(Self { flipped, node: [p.div_ceil(2) - 1, q.div_ceil(2) - 1] })
    }

    fn overlay(&self, fine: &Array2<f64>, y: usize, x: usize) -> f64 {
        let (height, width) = fine.dim();
        let wrap = |i: usize, node: usize, offset: usize, n: usize| {
            (i as isize + offset as isize - node as isize).rem_euclid(n as isize) as usize
        };
        let mut sum = 0.0;
        for (i, taps) in self.flipped.outer_iter().enumerate() {
            let row = fine.row(wrap(y, self.node[0], i, height));
            for (j, tap) in taps.iter().enumerate() {
                sum += tap * row[wrap(x, self.node[1], j, width)];
            }
        }
        sum
    }
}

/// Inverses of the motions met lately, and the plans of their sizes.
#[derive(Default)]
struct Inverses {
    kernels: HashMap<[u64; 2], Option<Inverse>>,
    plans: HashMap<(usize, usize), Fft2>,
    scratch: Vec<Complex64>,
}

impl Inverses {
    /// The inverse of a motion in px of the upsampled picture; None where the pixel is to be copied.
    fn of(&mut self, [u, v]: [f64; 2], r: f64) -> Option<&Inverse> {
        // `round` takes halves away from zero, as the founding work's does.
        let length = (u * u + v * v).sqrt().round();
        if length.is_nan() || length == 0.0 {
            return None;
        }
        let angle = (-v).atan2(u).to_degrees();
        let key = [length.to_bits(), angle.to_bits()];
        if !self.kernels.contains_key(&key) {
            if self.kernels.len() >= KEPT_KERNELS {
                self.kernels.clear();
            }
            // The length was checked against the longest motion before any work began.
            let psf = fspecial_motion(length, angle).ok()?;
            let (p, q) = psf.dim();
            let plan = self.plans.entry((p, q)).or_insert_with(|| Fft2::new(p, q));
            self.kernels.insert(key, Inverse::new(&psf, plan, r, &mut self.scratch));
        }
        self.kernels.get(&key).and_then(Option::as_ref)
    }
}

/// Halves the sample distance `times` times by linear interpolation: n -> 2 n - 1 samples on each axis.
fn upsample_linear(image: &ArrayView2<'_, f64>, times: usize) -> Array2<f64> {
    let mut picture = image.to_owned();
    for _ in 0..times {
        let (height, width) = picture.dim();
        let tall = Array2::from_shape_fn((2 * height - 1, width), |(y, x)| {
            0.5 * (picture[(y / 2, x)] + picture[(y.div_ceil(2), x)])
        });
        picture = Array2::from_shape_fn((2 * height - 1, 2 * width - 1), |(y, x)| {
            0.5 * (tall[(y, x / 2)] + tall[(y, x.div_ceil(2))])
        });
    }
    picture
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flow_field::FlowField;

    #[test]
    fn no_motion_and_unknown_motion_copy_the_computed_part_only() {
        let image = Array2::from_shape_fn((24, 26), |(y, x)| (y * 31 + x * 17 % 11) as f64);
        for value in [0.0, f64::NAN] {
            let still = Array2::from_elem(image.dim(), value);
            let flow = FlowField::new(still.clone(), still).unwrap();
            let result = ThesisDeblur::default()
                .apply(&image.view(), &flow.view(), &Control::new())
                .unwrap();
            for ((y, x), &sample) in result.image.indexed_iter() {
                let computed = (9..14).contains(&y) && (9..16).contains(&x);
                assert_eq!(sample, if computed { image[(y, x)] } else { 0.0 });
            }
            assert_eq!(result.unknown, if value.is_nan() { image.len() } else { 0 });
        }
    }

    #[test]
    fn upsampling_is_linear_between_the_samples() {
        let ramp = Array2::from_shape_fn((3, 4), |(y, x)| (8 * y + 4 * x) as f64);
        let fine = upsample_linear(&ramp.view(), 2);
        assert_eq!(fine.dim(), (9, 13));
        assert!(fine.indexed_iter().all(|((y, x), &s)| s == (2 * y + x) as f64));
    }
}
