//! One picture restored by a variational or a likelihood method: what happens before and after the solve.
//!
//! Grey levels of the picture's own contrast; noise measured where it is not given; weights of zero for unknown samples,
//! unknown motion and paths across a jump of the flow; and at the end
//!
//! ```text
//! out(p) = b(p) + f(L(p)) (x(p) - b(p)),      f = 0 for L <= 1/2 px,  1 for L >= 1 px,  linear between
//! ```
//!
//! with L = e |v| the length of the blur: what did not move is the input bit for bit, and so is what moved in a way that
//! is not known or beyond [`LONGEST_BLUR`]. A pixel is unknown (NaN) when less than [`LEAST_SEEN`] of its light fell on
//! known samples.

use ndarray::{Array2, ArrayView2};

use super::grey_levels::GreyLevels;
use super::inverse_kernel::{COPIED_BLUR, LONGEST_BLUR};
use super::look::Look;
use super::preparation::{Weights, blur_lengths, known_flow, measured_noise, single};
use super::richardson_lucy::RichardsonLucy;
use super::tikhonov::Tikhonov;
use super::total_variation::{Effort, Restored, TotalVariation};
use crate::array::require_same;
use crate::awake::awake;
use crate::control::Control;
use crate::error::{Error, Result, require};
use crate::flow_field::FlowView;
use crate::linear_operator::LinearOperator;
use crate::motion_operator::{MotionOperator, Taps};
use crate::motion_path::MotionPaths;
use crate::real::Real;

/// Blur from which a pixel is restored in full, px.
const RESTORED_BLUR: f64 = 1.0;

/// See the [module](self).
const LEAST_SEEN: f32 = 0.25;

/// How the picture is restored.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MotionMethod {
    /// Total variation; see [`TotalVariation`].
    TotalVariation(Effort),
    /// Half the square of the gradient as prior, by conjugate gradients; see [`Tikhonov`].
    Tikhonov,
    /// See [`RichardsonLucy`].
    RichardsonLucy,
}

/// Restoration of one picture from its flow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionDeblur {
    /// The method.
    pub method: MotionMethod,
    /// Fraction of the frame interval during which the shutter was open, > 0.
    pub exposure: f64,
    /// Standard deviation of the noise in the picture's units, >= 0; None: measured in the picture.
    pub noise: Option<f64>,
    /// Weight lambda of the prior, > 0, in the picture's units (Tikhonov: without unit); None: from noise and residual.
    pub regularization: Option<f64>,
    /// Least value of a clipped sample, in the picture's units; None: none is clipped.
    pub ceiling: Option<f64>,
}

/// What came, of the shape (H, W) all.
#[derive(Debug, Clone, Copy)]
pub struct Blurred<'a, T> {
    /// Channels of the picture; NaN = unknown.
    pub channels: &'a [ArrayView2<'a, T>],
    /// Velocity at mid-exposure, px/frame; NaN = unknown.
    pub flow: FlowView<'a, T>,
    /// Change of the velocity at a fixed pixel, px/frame^2; None: steady.
    pub acceleration: Option<FlowView<'a, T>>,
    /// How far each pixel is believed, in [0, 1].
    pub weights: Option<ArrayView2<'a, f32>>,
}

/// What came out, and how.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionResult<T> {
    /// The restored channels.
    pub images: Vec<Array2<T>>,
    /// Noise used, in the picture's units; NaN when nothing was restored.
    pub noise: f64,
    /// lambda used, in the picture's units; NaN when there was none.
    pub regularization: f64,
    /// Conjugate-gradient steps or turns.
    pub iterations: usize,
    /// Root mean square of A x - b, in the picture's units.
    pub residual: f64,
    /// Residual over noise of the first stage.
    pub mismatch: f64,
    /// Pixels of unknown motion, still, and blurred too long: all copied.
    pub copied: [usize; 3],
    /// Pixels not believed because their path crosses a jump of the flow.
    pub occluded: usize,
}

impl MotionDeblur {
    /// Restores a picture.
    ///
    /// # Errors
    /// [`Error::Value`] for no channel or parameters out of range; [`Error::Shape`] when shapes differ or are empty;
    /// [`Error::Cancelled`].
    pub fn apply<T: Real>(
        &self,
        blurred: &Blurred<'_, T>,
        control: &Control,
    ) -> Result<MotionResult<T>> {
        let shape = self.validate(blurred)?;
        let lengths = blur_lengths(&blurred.flow, self.exposure);
        let count = |is: fn(f32) -> bool| lengths.iter().filter(|&&length| is(length)).count();
        let copied = [
            count(f32::is_nan),
            count(|length| f64::from(length) <= COPIED_BLUR),
            count(|length| f64::from(length) > LONGEST_BLUR),
        ];
        let mut result = MotionResult {
            images: Vec::new(),
            noise: f64::NAN,
            regularization: f64::NAN,
            iterations: 0,
            residual: f64::NAN,
            mismatch: f64::NAN,
            copied,
            occluded: 0,
        };
        let inputs = || blurred.channels.iter().map(ArrayView2::to_owned).collect();
        if copied.iter().sum::<usize>() == shape.0 * shape.1 {
            result.images = inputs();
            return Ok(result);
        }
        let levels = GreyLevels::of(blurred.channels);
        let planes: Vec<Array2<f32>> = blurred.channels.iter().map(|c| levels.plane(c)).collect();
        let flow = known_flow(&blurred.flow, &lengths)?;
        drop(lengths);
        let noise = match self.noise {
            Some(noise) => noise * levels.scale(),
            None => measured_noise(&planes, &flow, self.exposure, control)?,
        };
        let given = blurred.weights.as_ref();
        let weights = Weights::new(given, &planes, &flow, self.exposure, control)?;
        result.occluded = weights.occluded;
        let acceleration = blurred.acceleration.as_ref().map(single).transpose()?;
        let paths = MotionPaths::new(&flow, self.exposure, acceleration.as_ref())?;
        // The solve needs the memory more than these, which are quickly made again.
        drop((flow, acceleration));
        let planes = planes.iter().map(|plane| plane.view()).collect();
        let ceiling = self.ceiling.map(|value| levels.grey(value) as f32);
        let look = Look { paths, planes, weights: weights.used, ceiling };
        let seen = if weights.unknown { Some(seen(&look)?) } else { None };
        let restored = awake(|| self.solve(look, noise, levels.scale(), control))?;
        result.images = inputs();
        let lengths = blur_lengths(&blurred.flow, self.exposure);
        compose(&mut result.images, &restored, &lengths, &levels, seen.as_ref());
        let scale = levels.scale();
        result.noise = noise / scale;
        result.regularization = match self.method {
            MotionMethod::TotalVariation(_) => restored.lambda / scale,
            MotionMethod::Tikhonov | MotionMethod::RichardsonLucy => restored.lambda,
        };
        result.iterations = restored.solution.steps;
        result.residual = restored.solution.residual / scale;
        result.mismatch = restored.mismatch;
        Ok(result)
    }

    fn validate<T: Real>(&self, blurred: &Blurred<'_, T>) -> Result<(usize, usize)> {
        require("exposure", self.exposure, "finite and positive", |e| e > 0.0)?;
        if let Some(noise) = self.noise {
            require("noise", noise, "finite and not negative", |n| n >= 0.0)?;
        }
        if let Some(lambda) = self.regularization {
            require("regularization", lambda, "finite and positive", |l| l > 0.0)?;
        }
        let Some(first) = blurred.channels.first() else {
            return Err(Error::value("image", "at least one channel", 0));
        };
        if first.is_empty() {
            return Err(Error::shape("image", "(H >= 1, W >= 1)", first.shape()));
        }
        let shape = first.dim();
        blurred.channels.iter().try_for_each(|image| require_same("image", image, shape))?;
        require_same("flow", &blurred.flow.u, shape)?;
        if let Some(acceleration) = &blurred.acceleration {
            require_same("acceleration", &acceleration.u, shape)?;
        }
        if let Some(weights) = &blurred.weights {
            require_same("weights", weights, shape)?;
            if let Some(bad) = weights.iter().find(|w| !(0.0..=1.0).contains(*w)) {
                return Err(Error::value("weights", "in [0, 1]", bad));
            }
        }
        Ok(shape)
    }

    fn solve(&self, look: Look<'_>, noise: f64, scale: f64, control: &Control) -> Result<Restored> {
        match self.method {
            MotionMethod::TotalVariation(effort) => {
                let lambda = self.regularization.map(|lambda| lambda * scale);
                TotalVariation { noise, lambda, effort }.restore(vec![look], control)
            }
            MotionMethod::Tikhonov => {
                let lambda = self.regularization;
                Tikhonov { noise, lambda }.restore(&look, control)
            }
            MotionMethod::RichardsonLucy => {
                RichardsonLucy { noise, ..RichardsonLucy::default() }.restore(&look, control)
            }
        }
    }
}

/// Share of the light of each pixel that fell on known samples, of the picture's shape.
fn seen(look: &Look<'_>) -> Result<Array2<f32>> {
    let pad = look.paths.reach();
    let operator = MotionOperator::new(&look.paths, Taps::Linear, pad)?;
    let known = |at: (usize, usize)| look.planes.iter().all(|plane| plane[at].is_finite());
    let (height, width) = operator.data_shape();
    let data: Vec<f32> =
        (0..height * width).map(|i| f32::from(u8::from(known((i / width, i % width))))).collect();
    let columns = operator.unknown_shape().1;
    let mut light = vec![0.0; operator.unknown_shape().0 * columns];
    operator.adjoint(&data, &mut light);
    let at = |(y, x)| light[(y + pad) * columns + x + pad];
    Ok(Array2::from_shape_fn((height, width), at))
}

/// Puts the solution into `images`, which hold the blurred picture; see the [module](self).
fn compose<T: Real>(
    images: &mut [Array2<T>],
    restored: &Restored,
    lengths: &Array2<f32>,
    levels: &GreyLevels,
    seen: Option<&Array2<f32>>,
) {
    let pad = restored.pad;
    let columns = lengths.dim().1 + 2 * pad;
    for (image, plane) in images.iter_mut().zip(&restored.solution.channels) {
        for ((y, x), &length) in lengths.indexed_iter() {
            let length = f64::from(length);
            // Copied also when unknown: comparisons with NaN are false.
            if !(length > COPIED_BLUR && length <= LONGEST_BLUR) {
                continue;
            }
            let sample = &mut image[(y, x)];
            if seen.is_some_and(|seen| seen[(y, x)] < LEAST_SEEN) {
                *sample = T::nan();
                continue;
            }
            let value = levels.value(f64::from(plane[(y + pad) * columns + x + pad]));
            let share = ((length - COPIED_BLUR) / (RESTORED_BLUR - COPIED_BLUR)).min(1.0);
            let old = sample.as_f64();
            // An unknown sample has nothing to fade from.
            *sample = T::of(if share < 1.0 && old.is_finite() {
                old + share * (value - old)
            } else {
                value
            });
        }
    }
}
