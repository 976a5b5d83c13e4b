//! The founding idea, mended: a regularised inverse of its own blur for every pixel, in the space domain.
//!
//! In the time of the streamline through a pixel p, a steady motion v blurs exactly by a box of L = e |v(p)| steps of
//! 1 px each (see `streamline.rs`), however the field turns or spreads. So the inverse is one-dimensional everywhere:
//!
//! ```text
//! out(p) = b(p) h_0 + sum_{k=1}^{n} h_k [ b(X_p(k tau)) + b(X_p(-k tau)) ],      tau = 1 / |v(p)| frames
//! ```
//!
//! with h the best finite inverse for L, the noise and the strength of the detail around p (`detail.rs`, `inverse_kernel.rs`), and
//! b interpolated by the cubic spline of `local_spline.rs`. Colour channels share the walk and the kernel.
//!
//! Differs from the founding method: kernels exact, centred, of unit sum, solved for at their finite length; lengths
//! in steps of 1/4 px; curved paths; regularisation from the noise; no border left out, no upsampling.
//!
//! Validity: steady motion during the exposure; noise white. Pixels whose blur is below 1/2 px, longer than
//! [`LONGEST_BLUR`], or unknown (NaN) are copied bit for bit. Beyond the picture its edge pixels continue. An unknown
//! pixel makes unknown all that its streamlines reach, and nothing else changes.
#![allow(
    clippy::inline_always,
    reason = "a helper gets its caller's vector instructions only when inlined"
)]

use multiversion::multiversion;
use ndarray::{Array2, ArrayView2};

use super::detail::{DETAIL_REACH, local_detail};
use super::inverse_kernel::{COPIED_BLUR, KernelBank, LONGEST_BLUR, level_of};
use crate::array::{for_each_row, require_same};
use crate::control::Control;
use crate::error::{Error, Result, require};
use crate::flow_field::FlowView;
use crate::local_spline::{LocalSpline, Path, VALUE_REACH};
use crate::noise::estimate_noise;
use crate::real::Real;
use crate::streamline::Streamlines;

/// Level of pixels whose surroundings are not known.
const UNKNOWN_LEVEL: u8 = u8::MAX;

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
    /// Steps walked to either side at most, px at the pixel's own speed, plus what is read around each point.
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
        let noise = self.noise_used(images, flow, control)?;
        let levels = self.levels(images, noise, control)?;
        let known = levels.iter().map(|&level| if level == UNKNOWN_LEVEL { 0 } else { level });
        let bank = KernelBank::new(lengths().zip(known), self.regularization, control)?;
        let splines =
            images.iter().map(|i| LocalSpline::new(i, control)).collect::<Result<Vec<_>>>()?;
        let lines = Streamlines::new(flow);
        let (height, width) = flow.dim();
        let channels = images.len();
        let mut out: Vec<T> = Vec::with_capacity(height * width * channels);
        for y in 0..height {
            for image in images {
                out.extend(image.row(y));
            }
        }
        control.expect(height);
        for_each_row(&mut out, width * channels, control, |y, rows| {
            let levels = &levels[y * width..][..width];
            restore_row(self, &bank, &lines, &splines, levels, y, rows);
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
            reach: bank.reach() + VALUE_REACH.max(DETAIL_REACH),
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

    /// The noise given or measured, root mean square over the channels; NaN when a constant regularisation makes it
    /// needless.
    fn noise_used<T: Real>(
        &self,
        images: &[ArrayView2<'_, T>],
        flow: &FlowView<'_, T>,
        control: &Control,
    ) -> Result<f64> {
        match (self.regularization, self.noise) {
            (Some(_), _) => Ok(f64::NAN),
            (None, Some(noise)) => Ok(noise),
            (None, None) => {
                let mut power = 0.0;
                for image in images {
                    power += estimate_noise(image, flow, self.exposure, control)?.powi(2);
                }
                Ok((power / images.len() as f64).sqrt())
            }
        }
    }

    /// Level of regularisation of each pixel, from the mean detail of the channels; all 0 when it is constant.
    fn levels<T: Real>(
        &self,
        images: &[ArrayView2<'_, T>],
        noise: f64,
        control: &Control,
    ) -> Result<Vec<u8>> {
        let mut detail = Array2::<T>::zeros(images[0].dim());
        if self.regularization.is_some() {
            return Ok(vec![0; detail.len()]);
        }
        for image in images {
            detail += &local_detail(image, noise, control)?;
        }
        let power = noise * noise * images.len() as f64;
        let level = |c: &T| {
            let c = c.as_f64();
            // Neither noise nor detail: the division is 0 / 0, and any level leaves a constant what it is.
            if c.is_nan() { UNKNOWN_LEVEL } else { level_of((power / c).max(0.0)) }
        };
        Ok(detail.iter().map(level).collect())
    }
}

/// Replaces the pixels of row `y` that are restored; `rows` holds one row per channel.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn restore_row<T: Real>(
    method: &WienerDeblur,
    bank: &KernelBank<T>,
    lines: &Streamlines<T>,
    splines: &[LocalSpline<T>],
    levels: &[u8],
    y: usize,
    rows: &mut [T],
) {
    let width = rows.len() / splines.len();
    let mut path = Path::new(2 * bank.reach());
    for x in 0..width {
        let motion = lines.motion(y, x);
        let level = levels[x];
        let known = if level == UNKNOWN_LEVEL { 0 } else { level };
        let Some(kernel) = bank.kernel(method.blur_length(motion), known) else { continue };
        let speed = (motion[0] * motion[0] + motion[1] * motion[1]).sqrt();
        walk(lines, [y, x], motion, speed, kernel.len() - 1, &mut path);
        for (channel, spline) in splines.iter().enumerate() {
            let sample = &mut rows[channel * width + x];
            *sample = if level == UNKNOWN_LEVEL {
                T::nan()
            } else {
                *sample * kernel[0] + spline.weighted_sum(y, x, &path, &kernel[1..])
            };
        }
    }
}

/// Writes the points ahead and behind, in turn, at 1, 2 .. `steps` px (even) from the pixel on its streamline.
#[inline(always)]
fn walk<T: Real>(
    lines: &Streamlines<T>,
    [y, x]: [usize; 2],
    motion: [T; 2],
    speed: T,
    steps: usize,
    path: &mut Path<T>,
) {
    // Two steps a stride.
    let time = T::of(2.0) / speed;
    let mut ahead = lines.start(y, x, motion, speed);
    let mut behind = ahead;
    path.clear();
    for _ in 0..steps / 2 {
        lines.stride(&mut ahead, time);
        lines.stride(&mut behind, -time);
        for point in [ahead.halfway, behind.halfway, ahead.offset, behind.offset] {
            path.push(point);
        }
    }
    path.prepare();
}
