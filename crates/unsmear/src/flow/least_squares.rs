//! Flow at one scale by weighted least squares over phase constraints.
//!
//! Every filter `j` of the bank and every pair of frames `(t, t+1)` gives at each pixel one
//! constraint on the flow `w = (u, v)` px/frame,
//!
//! ```text
//! G.w + D = 0,   G = (grad phi(t) + grad phi(t+1)) / 2   rad/px
//!                D = arg(conj(R(t)) R(t+1))              rad
//! ```
//!
//! and `w` minimises `sum g(n) W (G.w + D)^2` over the constraints at `x + n`, `g` a Gaussian
//! neighbourhood. With amplitudes `a, a'` of the pair, the largest amplitude `a_max` of all
//! responses and the frequency deviation `d` in units of `tau sigma_k` (the greater of the two):
//!
//! ```text
//! W = p(t) C^8 A/(A + r^2) q^2/(1 + d^4),   A = a a',  q = 2 a a'/(a^2 + a'^2)
//! r = max(fraction a_max, floor),   p(t) = exp(-(t + 1/2 - index)^2 / (2 time_sigma^2))
//! C = share of the filter's window that lies inside the picture
//! ```
//!
//! `A/(A + r^2)` saturates: where there is contrast, more of it says no more about the motion.
//! `C^8` silences the margin, where the border rule and not the scene is filtered. `passes` times
//! the system is solved again with `W` times `1/(1 + (residual/robust)^2)^2`, which drops wrapped
//! phases and the lesser of two motions.
//!
//! With `M = sum g W G G'` and `b = sum g W D G` the flow is `-M^-1 b`. `lambda`, the least
//! eigenvalue of `M / (k0^2 sum p)`, says how well the worse direction is held: below
//! `least_eigenvalue` (flat picture, stripes of one direction) the flow is NaN. Confidence is
//! `lambda/(lambda + .1) / (1 + rms^2/.3^2)`, `rms` the residual in rad.
//!
//! Valid for `|w| < 1/(2 f0)` px/frame, half a wavelength, beyond which phase wraps. Differs from
//! the founding mean, which halves the speed, by solving for the flow.
//!
//! Sources: Fleet & Jepson 1990 (doi 10.1007/BF00056772) for the constraint; Lucas & Kanade, IJCAI
//! 1981, for local least squares; Geman & `McClure` 1987 for the reweighting.

use ndarray::{Array2, Array3, ArrayView3, Axis};

use crate::array::{for_each_row_with, require_frames};
use crate::border::Border;
use crate::component_tests::{ComponentTests, largest_amplitude};
use crate::control::Control;
use crate::convolve::{correlate_axis, gaussian_taps};
use crate::error::{Error, Result, require};
use crate::flow::constraint::{Pair, constrain};
use crate::flow::normal_equations::{SUMS, TERMS, accumulate, solve};
use crate::flow::standardize::standardize;
use crate::flow::{Estimate, RESULT_FLOOR};
use crate::flow_field::FlowField;
use crate::gabor::{GaborBank, GaborParameters};
use crate::real::Real;

/// Where the neighbourhood's Gaussian ends, in deviations.
const NEIGHBOURHOOD_SUPPORT: f64 = 2.5;
/// Where the weights of frame pairs end, in `time_sigma`.
const TIME_SUPPORT: f64 = 3.0;
/// Least eigenvalue at which confidence is one half.
const CONFIDENCE_EIGENVALUE: f64 = 0.1;
/// Residual at which confidence is halved, rad.
const CONFIDENCE_RESIDUAL: f64 = 0.3;

/// Parameters; see the [module](self).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeastSquares {
    /// The bank. Default 0.12 cycles/px: sees up to 4.2 px/frame.
    pub gabor: GaborParameters,
    /// Amplitude share (`fraction`, default 0.02) and `tau` (default 1.25).
    pub tests: ComponentTests,
    /// Deviation of the neighbourhood, px; 0 solves each pixel alone. Default 4.
    pub neighbourhood: f64,
    /// Deviation of the weights of frame pairs, frames. Default 1.5.
    pub time_sigma: f64,
    /// Residual at which a constraint has a quarter of its weight, rad. Default 0.5.
    pub robust: f64,
    /// Reweighted solutions after the first. Default 2.
    pub passes: usize,
    /// Least eigenvalue of a known flow. Default 1e-3.
    pub least_eigenvalue: f64,
    /// Border rule of the filters. Default replicate.
    pub border: Border,
}

impl Default for LeastSquares {
    fn default() -> Self {
        Self {
            gabor: GaborParameters { tuning_frequency: 0.12, ..Default::default() },
            tests: ComponentTests { amplitude_fraction: 0.02, ..Default::default() },
            neighbourhood: 4.0,
            time_sigma: 1.5,
            robust: 0.5,
            passes: 2,
            least_eigenvalue: 1e-3,
            border: Border::Replicate,
        }
    }
}

/// The constraints of all pixels: (K, H, TERMS, W), rows of one constraint side by side.
struct Constraints<T> {
    sets: Vec<Vec<T>>,
    /// `k0^2 sum p`: what the eigenvalues are measured in.
    scale: f64,
    height: usize,
    width: usize,
}

impl LeastSquares {
    /// Flow and confidence at frame `index` of at least 2 frames (T, H, W).
    ///
    /// # Errors
    /// [`Error::Shape`] below (2, 1, 1) samples, [`Error::Value`] for a parameter out of range or a
    /// sample that is not finite, [`Error::Cancelled`].
    pub fn estimate<T: Real>(
        &self,
        frames: ArrayView3<'_, f64>,
        index: usize,
        control: &Control,
    ) -> Result<Estimate<T>> {
        self.check()?;
        require_frames("frames", &frames, [2, 1, 1])?;
        let (count, height, width) = frames.dim();
        if index >= count {
            return Err(Error::value("index", format!("in 0..={}", count - 1), index));
        }
        let pairs = self.pairs(count, index);
        control.expect(pairs.len() + self.passes + 1);
        let frames = standardize::<T>(frames)?;
        let constraints = self.constraints(frames.view(), &pairs, control)?;
        let mut solution = Array3::from_elem((4, height, width), T::nan());
        for pass in 0..=self.passes {
            let sums = self.sums(&constraints, (pass > 0).then_some(&solution), control)?;
            solution = solve(&sums, control)?;
            control.advance()?;
        }
        Ok(self.finish(&solution, constraints.scale))
    }

    fn check(&self) -> Result<()> {
        self.tests.check()?;
        require("neighbourhood", self.neighbourhood, "in [0, 100] px", |s| {
            (0.0..=100.0).contains(&s)
        })?;
        require("time_sigma", self.time_sigma, "in (0, 100] frames", |s| s > 0.0 && s <= 100.0)?;
        require("robust", self.robust, "> 0 rad", |r| r > 0.0)?;
        require("passes", self.passes as f64, "at most 100", |p| p <= 100.0)?;
        require("least_eigenvalue", self.least_eigenvalue, ">= 0", |e| e >= 0.0)
    }

    /// First frame and weight of the pairs that count.
    fn pairs(&self, count: usize, index: usize) -> Vec<(usize, f64)> {
        let reach = (TIME_SUPPORT * self.time_sigma).max(0.5);
        (0..count - 1)
            .map(|t| (t, (t as f64 + 0.5 - index as f64).abs()))
            .filter(|&(_, distance)| distance <= reach)
            .map(|(t, distance)| (t, (-0.5 * (distance / self.time_sigma).powi(2)).exp()))
            .collect()
    }

    fn constraints<T: Real>(
        &self,
        frames: ArrayView3<'_, T>,
        pairs: &[(usize, f64)],
        control: &Control,
    ) -> Result<Constraints<T>> {
        let bank = GaborBank::new(&self.gabor)?;
        let (_, height, width) = frames.dim();
        let first = pairs.first().map_or(0, |pair| pair.0);
        let responses = (first..=first + pairs.len())
            .map(|t| bank.respond(frames.index_axis(Axis(0), t), self.border, control))
            .collect::<Result<Vec<_>>>()?;
        let largest = responses.iter().map(largest_amplitude).fold(0.0, f64::max);
        let reference = self.tests.threshold(largest, 1.0);
        let mut sets = Vec::with_capacity(pairs.len());
        for (two, &(_, p)) in responses.windows(2).zip(pairs) {
            let pair = Pair { bank: &bank, responses: [&two[0], &two[1]] };
            sets.push(constrain(&pair, reference, self.tests.tau, p, control)?);
            control.advance()?;
        }
        let total: f64 = pairs.iter().map(|pair| pair.1).sum();
        Ok(Constraints { sets, scale: self.gabor.wavenumber().powi(2) * total, height, width })
    }

    /// Weighted sums over constraints and neighbourhood, (SUMS, H, W); `solution` reweights.
    fn sums<T: Real>(
        &self,
        constraints: &Constraints<T>,
        solution: Option<&Array3<T>>,
        control: &Control,
    ) -> Result<Array3<T>> {
        let (height, width) = (constraints.height, constraints.width);
        let filters = self.gabor.orientations;
        let mut rows = vec![T::zero(); SUMS * height * width];
        let softness = T::of(1.0 / self.robust.powi(2));
        let plane = height * width;
        let known = solution.and_then(|s| s.as_slice());
        for_each_row_with(
            &mut rows,
            SUMS * width,
            control,
            || vec![T::zero(); 2 * width],
            |y, out, scratch| {
                let flow = known.map(|s| [0, 1].map(|c| &s[c * plane + y * width..][..width]));
                for set in &constraints.sets {
                    let row = &set[y * filters * TERMS * width..][..filters * TERMS * width];
                    for constraint in row.chunks(TERMS * width) {
                        accumulate(constraint, flow, softness, scratch, out);
                    }
                }
            },
        )?;
        let sums = Array3::from_shape_vec((height, SUMS, width), rows).unwrap_or_default();
        let sums = sums.permuted_axes([1, 0, 2]);
        if self.neighbourhood == 0.0 {
            return Ok(sums.as_standard_layout().into_owned());
        }
        let radius = (NEIGHBOURHOOD_SUPPORT * self.neighbourhood).ceil() as usize;
        let taps: Vec<T> =
            gaussian_taps(self.neighbourhood, radius).into_iter().map(T::of).collect();
        let along_x = correlate_axis(sums.view(), &taps, 2, Border::Reflect, control)?;
        correlate_axis(along_x.view(), &taps, 1, Border::Reflect, control)
    }

    fn finish<T: Real>(&self, solution: &Array3<T>, scale: f64) -> Estimate<T> {
        let (_, height, width) = solution.dim();
        let mut flow = FlowField::unknown((height, width));
        let mut confidence = Array2::zeros((height, width));
        for ((y, x), confidence) in confidence.indexed_iter_mut() {
            let at = |part: usize| solution[(part, y, x)].as_f64();
            let (held, residual) = (at(2) / scale, at(3));
            if at(0).is_finite() && held >= self.least_eigenvalue.max(RESULT_FLOOR) {
                flow.u[(y, x)] = solution[(0, y, x)];
                flow.v[(y, x)] = solution[(1, y, x)];
                let sure = held / (held + CONFIDENCE_EIGENVALUE);
                *confidence = T::of(sure / (1.0 + residual / CONFIDENCE_RESIDUAL.powi(2)));
            }
        }
        Estimate { flow, confidence }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texture(velocity: [f64; 2], frames: usize) -> Array3<f64> {
        Array3::from_shape_fn((frames, 48, 52), |(t, y, x)| {
            let (x, y) = (x as f64 - velocity[0] * t as f64, y as f64 - velocity[1] * t as f64);
            (0.7 * x + 0.3 * y).sin() + (0.2 * x - 0.75 * y).cos() + (0.6 * x - 0.5 * y).sin()
        })
    }

    #[test]
    fn a_translation_is_measured_inside() {
        for velocity in [[1.3, -0.6], [0.05, 0.0], [-2.4, 1.1]] {
            let frames = texture(velocity, 2);
            let estimate =
                LeastSquares::default().estimate::<f64>(frames.view(), 0, &Control::new()).unwrap();
            let [u, v] = estimate.flow.view().at(24, 26);
            // Three waves, one per filter at most: what is left is the leak between filters.
            assert!((u - velocity[0]).abs() < 0.02 && (v - velocity[1]).abs() < 0.02, "{u}, {v}");
        }
    }

    #[test]
    fn stillness_is_exactly_zero_and_blankness_unknown() {
        let still = texture([0.0, 0.0], 3);
        let run = |frames: &Array3<f64>| {
            LeastSquares::default().estimate::<f32>(frames.view(), 1, &Control::new()).unwrap()
        };
        let estimate = run(&still);
        assert!(estimate.flow.u.iter().chain(&estimate.flow.v).all(|&c| c == 0.0));
        let estimate = run(&Array3::from_elem((3, 20, 20), 7.0));
        assert!(estimate.flow.u.iter().all(|u| u.is_nan()));
        assert!(estimate.confidence.iter().all(|&c| c == 0.0));
    }

    #[test]
    fn stripes_of_one_direction_are_unknown() {
        let stripes = Array3::from_shape_fn((2, 40, 40), |(t, _, x)| (0.8 * (x + t) as f64).sin());
        let estimate =
            LeastSquares::default().estimate::<f64>(stripes.view(), 0, &Control::new()).unwrap();
        assert!(estimate.flow.u[(20, 20)].is_nan(), "the aperture problem has no answer");
    }
}
