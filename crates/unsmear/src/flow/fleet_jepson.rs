//! Flow of Fleet and Jepson: velocity-tuned filters, local affine least squares.
//!
//! Each of the 22 filters of [`SpatiotemporalBank::velocity_tuned`] gives at the reference frame a
//! phase gradient and, where the tests of [`crate::component_tests`] hold, one constraint on the
//! flow: with the unit normal `n = grad phi / |grad phi|` and the normal speed `s = v_n . n`,
//!
//! ```text
//! n . w(x + d) = s(x + d),   w(x + d) = (u + u_x dx + u_y dy, v + v_x dx + v_y dy)   px/frame
//! ```
//!
//! Over the `(2 r + 1)^2` window, with weights `W = A^2 / (A^2 + (3 a_0)^2)` of amplitude `A` and
//! amplitude threshold `a_0`, the six unknowns `p` solve `M p = b`; `dx, dy` are divided by their
//! rms over the window, so that `M` has no units. All sums are window moments of the maps
//! `W n_x n_x, W n_x n_y, W n_y n_y, W s n_x, W s n_y, W s^2, W` and the count. A result stands where
//!
//! ```text
//! count      >= least_constraints
//! condition  tr(M) tr(M^-1) / 36 <= condition_limit
//! residual   sqrt((sum W s^2 - p . b) / sum W) <= residual_limit            px/frame
//! ```
//!
//! else NaN. `tr(M) tr(M^-1) / 36` is the arithmetic over the harmonic mean of `M`'s eigenvalues: 1
//! when all directions are held alike; unlike their extreme ratio it comes from a Cholesky factor.
//! Confidence is `(1 - residual/limit) (1 - (condition - 1)/(limit - 1))`.
//!
//! Speeds up to about 5 px/frame at 4.25 px wavelength, steady over the window in time (15 frames).
//! Sources: Fleet & Jepson 1990 (doi 10.1007/BF00056772); parameters of the program in Barron, Fleet
//! & Beauchemin 1994 (doi 10.1007/BF01420984). The weights and the trace form are ours.

use ndarray::{Array2, Array3, ArrayView3};

use crate::array::{for_each_row, require_frames};
use crate::border::Border;
use crate::component_tests::{ComponentTests, largest_amplitude};
use crate::component_velocity::component_velocity;
use crate::control::Control;
use crate::convolve::correlate_axis;
use crate::error::{Result, require};
use crate::flow::Estimate;
use crate::flow::affine::{AffineFit, solve};
use crate::flow::standardize::standardize;
use crate::flow_field::FlowField;
use crate::gabor::GaborParameters;
use crate::phase_gradient::PhaseGradient;
use crate::phase_rate::rate_of_phase;
use crate::real::Real;
use crate::spatiotemporal::{Channel, SpatiotemporalBank};

/// Amplitude of half weight, in units of the threshold.
const WEIGHT_HALF: f64 = 3.0;
/// The maps whose window moments make the normal equations.
const MAPS: usize = 8;

/// Parameters; see the [module](self).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FleetJepson {
    /// The bank. Default 4.25 px wavelength, 0.8 octaves; `orientations` is not used.
    pub gabor: GaborParameters,
    /// Tests of the components.
    pub tests: ComponentTests,
    /// `r`, px. Default 2: the 5 x 5 window of the source.
    pub window_radius: usize,
    /// Least number of constraints in a window. Default 12, two per unknown.
    pub least_constraints: usize,
    /// Largest condition number. Default 8.
    pub condition_limit: f64,
    /// Largest residual, px/frame. Default 0.05.
    pub residual_limit: f64,
    /// Border rule of the filters. Default replicate.
    pub border: Border,
}

impl Default for FleetJepson {
    fn default() -> Self {
        Self {
            gabor: GaborParameters { tuning_frequency: 1.0 / 4.25, ..Default::default() },
            tests: ComponentTests::default(),
            window_radius: 2,
            least_constraints: 12,
            condition_limit: 8.0,
            residual_limit: 0.05,
            border: Border::Replicate,
        }
    }
}

impl FleetJepson {
    /// Flow and confidence at frame `index` of frames (T, H, W); 15 frames fill the windows, fewer
    /// (at least 3) widen the filters in temporal frequency.
    ///
    /// # Errors
    /// [`Error::Shape`](crate::Error::Shape) below (3, 1, 1) samples,
    /// [`Error::Value`](crate::Error::Value) for a parameter out of range, an `index` without a
    /// frame on both sides or a sample that is not finite,
    /// [`Error::Cancelled`](crate::Error::Cancelled).
    pub fn estimate<T: Real>(
        &self,
        frames: ArrayView3<'_, f64>,
        index: usize,
        control: &Control,
    ) -> Result<Estimate<T>> {
        self.check()?;
        require_frames("frames", &frames, [3, 1, 1])?;
        let bank = SpatiotemporalBank::<T>::velocity_tuned(&self.gabor)?;
        let frames = standardize::<T>(frames)?;
        let channels = bank.respond(frames.view(), index, self.border, control)?;
        control.expect(channels.len() + 2);
        let largest = channels.iter().map(|c| largest_amplitude(&c.response)).fold(0.0, f64::max);
        let threshold = self.tests.threshold(largest, 1.0);
        let (_, height, width) = frames.dim();
        let mut maps = vec![T::zero(); MAPS * height * width];
        for channel in &channels {
            self.gather(channel, bank.sigma(), threshold, width, &mut maps, control)?;
            control.advance()?;
        }
        let maps = Array3::from_shape_vec((height, MAPS, width), maps).unwrap_or_default();
        let maps = maps.permuted_axes([1, 0, 2]).as_standard_layout().into_owned();
        let moments = window_moments(&maps, self.window_radius, control)?;
        control.advance()?;
        self.finish(&moments, (height, width), control)
    }

    fn check(&self) -> Result<()> {
        self.tests.check()?;
        require("window_radius", self.window_radius as f64, "in 1..=50 px", |r| {
            (1.0..=50.0).contains(&r)
        })?;
        require("condition_limit", self.condition_limit, "> 1", |c| c > 1.0)?;
        require("residual_limit", self.residual_limit, "> 0 px/frame", |r| r > 0.0)
    }

    /// Adds the constraints of one channel to the maps, (H, MAPS, W).
    fn gather<T: Real>(
        &self,
        channel: &Channel<T>,
        sigma: f64,
        threshold: f64,
        width: usize,
        maps: &mut [T],
        control: &Control,
    ) -> Result<()> {
        let gradient = PhaseGradient::new(&channel.response, &channel.wavevectors, control)?;
        let least = T::of(threshold * threshold);
        let half = T::of((WEIGHT_HALF * threshold).powi(2));
        let farthest = T::of((self.tests.tau / sigma).powi(2));
        let omega = T::of(channel.omega);
        for_each_row(maps, MAPS * width, control, |y, out| {
            let mut phi_t = vec![T::zero(); width];
            for (filter, k) in channel.wavevectors.iter().enumerate() {
                let [kx, ky] = k.map(T::of);
                let row = gradient.row(filter, y);
                let (response, slope) =
                    (channel.response.row(filter, y), channel.slope.row(filter, y));
                let [response, slope] = [response, slope].map(|(re, im)| [re, im]);
                rate_of_phase(response, slope, row.power, omega, &mut phi_t);
                for x in 0..width {
                    let phi = [row.phi_x[x], row.phi_y[x], phi_t[x]];
                    let off = [phi[0] - kx, phi[1] - ky, phi[2] - omega];
                    let distance = off[0] * off[0] + off[1] * off[1] + off[2] * off[2];
                    let power = row.power[x];
                    // Without power there is no phase: the distance is NaN and fails.
                    if power >= least && distance <= farthest {
                        add(phi, power / (power + half), x, width, out);
                    }
                }
            }
        })
    }

    fn finish<T: Real>(
        &self,
        moments: &[Array3<T>; 6],
        shape: (usize, usize),
        control: &Control,
    ) -> Result<Estimate<T>> {
        let (height, width) = shape;
        let mut rows = vec![T::nan(); 3 * height * width];
        for_each_row(&mut rows, 3 * width, control, |y, out| {
            for x in 0..width {
                let sums = [0, 1, 2, 3, 4, 5]
                    .map(|m| [0, 1, 2, 3, 4, 5, 6, 7].map(|i| moments[m][(i, y, x)].as_f64()));
                if let Some((fit, confidence)) = self.accept(&sums) {
                    out[x] = T::of(fit.flow[0]);
                    out[width + x] = T::of(fit.flow[1]);
                    out[2 * width + x] = T::of(confidence);
                }
            }
        })?;
        control.advance()?;
        let rows = Array3::from_shape_vec((height, 3, width), rows).unwrap_or_default();
        let part = |i: usize| rows.index_axis(ndarray::Axis(1), i).to_owned();
        let confidence: Array2<T> = part(2).mapv(|c| if c.is_nan() { T::zero() } else { c });
        Ok(Estimate { flow: FlowField::new(part(0), part(1))?, confidence })
    }

    /// The fit of one window and its confidence, if it passes the tests.
    fn accept(&self, sums: &[[f64; MAPS]; 6]) -> Option<(AffineFit, f64)> {
        let count = sums[0][7];
        // Counts are sums of ones, rounded nowhere.
        if count + 0.5 < self.least_constraints as f64 {
            return None;
        }
        let fit = solve(sums)?;
        if fit.condition > self.condition_limit || fit.residual > self.residual_limit {
            return None;
        }
        let sure = 1.0 - fit.residual / self.residual_limit;
        let held = 1.0 - (fit.condition - 1.0) / (self.condition_limit - 1.0);
        Some((fit, (sure * held).clamp(0.0, 1.0)))
    }
}

/// Adds one valid constraint to the maps of its row.
#[inline]
fn add<T: Real>(phi: [T; 3], weight: T, x: usize, width: usize, out: &mut [T]) {
    let length = (phi[0] * phi[0] + phi[1] * phi[1]).sqrt();
    let (nx, ny) = (phi[0] / length, phi[1] / length);
    let [vx, vy] = component_velocity(phi);
    let speed = vx * nx + vy * ny;
    let (wx, wy, ws) = (weight * nx, weight * ny, weight * speed);
    let terms = [wx * nx, wx * ny, wy * ny, wx * speed, wy * speed, ws * speed, weight, T::one()];
    for (i, term) in terms.into_iter().enumerate() {
        // A vanishing gradient has no normal velocity, but the frequency test excludes it.
        out[i * width + x] += term;
    }
}

/// Sums of the maps (MAPS, H, W) over the window times `1, dx, dy, dx^2, dx dy, dy^2`, offsets
/// divided by their rms.
fn window_moments<T: Real>(
    maps: &Array3<T>,
    radius: usize,
    control: &Control,
) -> Result<[Array3<T>; 6]> {
    let offsets: Vec<f64> = (0..=2 * radius).map(|i| i as f64 - radius as f64).collect();
    let mean_square = offsets.iter().map(|o| o * o).sum::<f64>() / offsets.len() as f64;
    let taps = |power: i32| -> Vec<T> {
        offsets.iter().map(|o| T::of((o / mean_square.sqrt()).powi(power))).collect()
    };
    let along_x = |power| correlate_axis(maps.view(), &taps(power), 2, Border::Zero, control);
    let along_y =
        |map: &Array3<T>, power| correlate_axis(map.view(), &taps(power), 1, Border::Zero, control);
    let (x0, x1, x2) = (along_x(0)?, along_x(1)?, along_x(2)?);
    Ok([
        along_y(&x0, 0)?,
        along_y(&x1, 0)?,
        along_y(&x0, 1)?,
        along_y(&x2, 0)?,
        along_y(&x1, 1)?,
        along_y(&x0, 2)?,
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texture(motion: impl Fn(f64, f64, f64) -> [f64; 2]) -> Array3<f64> {
        Array3::from_shape_fn((15, 44, 46), |(t, y, x)| {
            let [x, y] = motion(x as f64, y as f64, t as f64 - 7.0);
            (1.3 * x + 0.5 * y).sin() + (0.4 * x - 1.4 * y).cos() + (1.0 * x - 1.1 * y).sin()
        })
    }

    #[test]
    fn an_affine_motion_is_measured_inside() {
        // Dilation by 1 % per frame about (20, 20) on top of a translation.
        let frames = texture(|x, y, t| {
            let scale = (-0.01 * t).exp();
            [20.0 + (x - 20.0) * scale - 0.6 * t, 20.0 + (y - 20.0) * scale]
        });
        let estimate =
            FleetJepson::default().estimate::<f64>(frames.view(), 7, &Control::new()).unwrap();
        for (y, x) in [(20, 20), (26, 22), (18, 28)] {
            let [u, v] = estimate.flow.view().at(y, x);
            let truth = [0.6 + 0.01 * (x as f64 - 20.0), 0.01 * (y as f64 - 20.0)];
            assert!((u - truth[0]).abs() < 0.03 && (v - truth[1]).abs() < 0.03, "{u}, {v}");
        }
    }

    #[test]
    fn stillness_is_exactly_zero_and_blankness_unknown() {
        let still = texture(|x, y, _| [x, y]);
        let method = FleetJepson::default();
        let estimate = method.estimate::<f32>(still.view(), 7, &Control::new()).unwrap();
        let known = estimate.flow.u.iter().filter(|u| !u.is_nan()).count();
        assert!(known > 44 * 46 / 2);
        assert!(estimate.flow.u.iter().chain(&estimate.flow.v).all(|&c| c == 0.0 || c.is_nan()));
        let blank = Array3::from_elem((15, 20, 20), 0.3);
        let estimate = method.estimate::<f32>(blank.view(), 7, &Control::new()).unwrap();
        assert!(estimate.flow.v.iter().all(|v| v.is_nan()));
    }
}
