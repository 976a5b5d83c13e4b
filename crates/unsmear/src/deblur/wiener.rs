//! The founding idea, mended: a regularised inverse of its own blur for every pixel, in the space domain.
//!
//! In the time of the streamline through a pixel p, a steady motion v blurs exactly by a box of L = e |v(p)| steps of
//! 1 px each (see `streamline.rs`), however the field turns or spreads. So the inverse is one-dimensional everywhere:
//!
//! ```text
//! out(p) = b(p) h_0 + sum_{k=1}^{n} h_k [ b(X_p(k tau)) + b(X_p(-k tau)) ],      tau = 1 / |v(p)| frames
//! ```
//!
//! with h the best finite inverse for L, the noise and the strength of the picture's detail (`inverse_kernel.rs`), and
//! b interpolated by the cubic spline of `local_spline.rs`. Colour channels share the walk and the kernel.
//!
//! Differs from the founding method: kernels exact, centred, of unit sum, solved for at their finite length; lengths
//! in steps of 1/4 px; curved paths; regularisation from the noise; no border left out, no upsampling.
//!
//! Validity: steady motion during the exposure; noise white. Pixels whose blur is below 1/2 px, longer than
//! [`LONGEST_BLUR`], or unknown (NaN) are copied bit for bit. Beyond the picture its edge pixels continue. An unknown
//! pixel makes unknown all that its streamlines reach, and nothing else changes.

use multiversion::multiversion;
use ndarray::{Array2, ArrayView2};

use super::inverse_kernel::{COPIED_BLUR, KernelBank, LONGEST_BLUR, Regularization};
use super::prior::spectrum_constant;
use crate::array::{for_each_row, require_same};
use crate::control::Control;
use crate::error::{Error, Result, require};
use crate::flow_field::FlowView;
use crate::local_spline::{LocalSpline, Position, VALUE_REACH};
use crate::noise::estimate_noise;
use crate::real::Real;
use crate::streamline::Streamlines;

/// Least ratio of noise to detail: what interpolation and the model err by even where the picture has no noise.
const LEAST_RATIO: f64 = 1e-4;

/// Parameters of the per-pixel Wiener deblurring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WienerDeblur {
    /// Fraction of the frame interval during which the shutter was open, > 0.
    pub exposure: f64,
    /// Standard deviation of the noise in the picture's units, >= 0; None: measured in the picture.
    pub noise: Option<f64>,
    /// Constant r > 0 against the power |K|^2 <= 1 of the blur; None: from the noise and the picture's detail.
    pub regularization: Option<f64>,
}

impl Default for WienerDeblur {
    fn default() -> Self {
        Self { exposure: 1.0, noise: None, regularization: None }
    }
}

/// What the method gives, and what it used.
#[derive(Debug, Clone, PartialEq)]
pub struct WienerResult<T> {
    /// The restored channels, each of shape (H, W).
    pub images: Vec<Array2<T>>,
    /// Noise used, in the picture's units; NaN when a constant regularisation made it needless.
    pub noise: f64,
    /// Regularisation used: the constant r, or the ratio of noise to detail, in (rad/px)^2.
    pub regularization: f64,
    /// Steps walked to either side at most, plus what interpolation reaches, px at the pixel's own speed.
    pub reach: usize,
    /// Pixels copied because their motion is unknown.
    pub unknown: usize,
    /// Pixels copied because their blur is too short to matter.
    pub still: usize,
    /// Pixels copied because their blur exceeds [`LONGEST_BLUR`].
    pub too_long: usize,
}

impl WienerDeblur {
    /// Restores the channels `images` of one picture blurred by `flow` (px/frame).
    ///
    /// # Errors
    /// [`Error::Value`] for no channel, or parameters out of range; [`Error::Shape`] when shapes differ or are empty;
    /// [`Error::Cancelled`].
    pub fn apply<T: Real>(
        &self,
        images: &[ArrayView2<'_, T>],
        flow: &FlowView<'_, T>,
        control: &Control,
    ) -> Result<WienerResult<T>> {
        self.validate(images, flow)?;
        let lengths = || flow.u.iter().zip(flow.v.iter()).map(|(&u, &v)| self.blur_length([u, v]));
        let (noise, regularization) = self.regularization(images, flow, control)?;
        let bank = KernelBank::new(lengths(), regularization, control)?;
        let (Regularization::NoiseToDetail(used) | Regularization::Constant(used)) = regularization;
        let splines =
            images.iter().map(|i| LocalSpline::new(i, control)).collect::<Result<Vec<_>>>()?;
        let lines = Streamlines::new(flow);
        let (height, width) = flow.dim();
        let channels = images.len();
        let mut out: Vec<T> = Vec::with_capacity(height * width * channels);
        for y in 0..height {
            images.iter().for_each(|image| out.extend(image.row(y)));
        }
        control.expect(height);
        for_each_row(&mut out, width * channels, control, |y, rows| {
            restore_row(self, &bank, &lines, &splines, y, rows);
            // A cancelled run is noticed by the helper before its next row.
            let _ = control.advance();
        })?;
        let channel = |c: usize| {
            Array2::from_shape_fn((height, width), |(y, x)| out[(y * channels + c) * width + x])
        };
        let count = |is: fn(f64) -> bool| lengths().filter(|&length| is(length)).count();
        Ok(WienerResult {
            images: (0..channels).map(channel).collect(),
            noise,
            regularization: used,
            reach: bank.reach() + VALUE_REACH,
            unknown: count(f64::is_nan),
            still: count(|length| length <= COPIED_BLUR),
            too_long: count(|length| length > LONGEST_BLUR),
        })
    }

    fn validate<T: Real>(
        &self,
        images: &[ArrayView2<'_, T>],
        flow: &FlowView<'_, T>,
    ) -> Result<()> {
        require("exposure", self.exposure, "finite and positive", |e| e > 0.0)?;
        if let Some(noise) = self.noise {
            require("noise", noise, "finite and not negative", |n| n >= 0.0)?;
        }
        if let Some(r) = self.regularization {
            require("regularization", r, "finite and positive", |r| r > 0.0)?;
        }
        let Some(first) = images.first() else {
            return Err(Error::value("image", "at least one channel", 0));
        };
        if first.is_empty() {
            return Err(Error::shape("image", "(H >= 1, W >= 1)", first.shape()));
        }
        images.iter().try_for_each(|image| require_same("image", image, first.dim()))?;
        require_same("flow", &flow.u, first.dim())
    }

    /// Blur of a pixel, px.
    #[inline]
    fn blur_length<T: Real>(&self, [u, v]: [T; 2]) -> f64 {
        let (u, v) = (u.as_f64(), v.as_f64());
        self.exposure * (u * u + v * v).sqrt()
    }

    /// The noise used (NaN when needless) and the regularisation that follows.
    fn regularization<T: Real>(
        &self,
        images: &[ArrayView2<'_, T>],
        flow: &FlowView<'_, T>,
        control: &Control,
    ) -> Result<(f64, Regularization)> {
        if let Some(r) = self.regularization {
            return Ok((f64::NAN, Regularization::Constant(r)));
        }
        // Mean powers over the channels, each of which is restored by itself.
        let (mut noise_power, mut detail) = (0.0, 0.0);
        for image in images {
            let noise = match self.noise {
                Some(noise) => noise,
                None => estimate_noise(image, flow, self.exposure, control)?,
            };
            noise_power += noise * noise / images.len() as f64;
            detail += spectrum_constant(image, noise, control)? / images.len() as f64;
        }
        // No detail at all: any kernel of unit sum leaves the constant picture what it is.
        let ratio = if detail > 0.0 { noise_power / detail } else { 1.0 };
        Ok((noise_power.sqrt(), Regularization::NoiseToDetail(ratio.max(LEAST_RATIO))))
    }
}

/// Replaces the pixels of row `y` that are restored; `rows` holds one row per channel.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn restore_row<T: Real>(
    method: &WienerDeblur,
    bank: &KernelBank<T>,
    lines: &Streamlines<T>,
    splines: &[LocalSpline<T>],
    y: usize,
    rows: &mut [T],
) {
    let width = rows.len() / splines.len();
    for x in 0..width {
        let motion = lines.motion(y, x);
        let Some(kernel) = bank.kernel(method.blur_length(motion)) else { continue };
        let speed = (motion[0] * motion[0] + motion[1] * motion[1]).sqrt();
        let time = T::one() / speed;
        for channel in 0..splines.len() {
            rows[channel * width + x] *= kernel[0];
        }
        let mut ahead = lines.start(y, x, motion, speed);
        let mut behind = ahead;
        for &tap in &kernel[1..] {
            lines.step(&mut ahead, time);
            lines.step(&mut behind, -time);
            let ([dx, dy], [bx, by]) = (ahead.offset, behind.offset);
            let (there, back) = (Position::new(dy, dx), Position::new(by, bx));
            for (channel, spline) in splines.iter().enumerate() {
                rows[channel * width + x] +=
                    tap * (spline.near(y, x, &there) + spline.near(y, x, &back));
            }
        }
    }
}
