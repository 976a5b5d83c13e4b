//! Component (normal) velocities from the phase gradient, and when to believe them.
//!
//! A surface of constant phase moves along `grad phi = (phi_x, phi_y)` with
//!
//! ```text
//! v_n = -phi_t grad phi / |grad phi|^2                                      px/frame
//! ```
//!
//! the only part of the motion that one filter can see, believed where the amplitude and frequency
//! tests of [`crate::component_tests`] hold. For filters without a temporal carrier the frequency
//! test runs over `(phi_x, phi_y)` only; where steps between frames are taken a third test asks that
//! the amplitude be steady,
//!
//! ```text
//! q = 2 a_0 a_1/(a_0^2 + a_1^2) >= least steadiness           for each neighbouring frame
//! ```
//!
//! Two motions in one filter beat, as two tones do: between them the amplitude rises and falls and
//! the phase turns at the rate of neither.
//!
//! Source: Fleet & Jepson 1990 (doi 10.1007/BF00056772), section 4.

use ndarray::{Array4, ArrayView3, Axis};

use crate::array::{for_each_row_with, require_frames};
use crate::border::Border;
use crate::component_tests::{ComponentTests, largest_amplitude};
use crate::control::Control;
use crate::error::{Error, Result, require};
use crate::gabor::{GaborBank, GaborParameters};
use crate::phase_gradient::PhaseGradient;
use crate::phase_rate::{phase_step, rate_of_phase};
use crate::real::Real;
use crate::spatiotemporal::{Channel, SpatiotemporalBank};

/// Normal velocity of one phase gradient, px/frame; NaN where it does not define one.
#[inline]
#[must_use]
pub fn component_velocity<T: Real>([phi_x, phi_y, phi_t]: [T; 3]) -> [T; 2] {
    let squared = phi_x * phi_x + phi_y * phi_y;
    if squared > T::zero() {
        // Adding 0 turns the -0 of a still picture into 0.
        let scale = -phi_t / squared;
        [scale * phi_x + T::zero(), scale * phi_y + T::zero()]
    } else {
        [T::nan(); 2]
    }
}

/// Where the time derivative of the phase comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Temporal {
    /// Mean phase difference to the neighbouring frames, from 2 frames on: exact for any uniform
    /// shift below half a wavelength.
    #[default]
    Steps,
    /// A Gaussian window over at least 3 frames, no carrier.
    Gaussian,
    /// The 22 velocity-tuned filters over at least 3 frames.
    VelocityTuned,
}

/// What [`ComponentVelocities::estimate`] needs.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ComponentVelocities {
    /// The bank; orientations are those of the velocity-tuned bank if that is chosen.
    pub gabor: GaborParameters,
    /// The tests.
    pub tests: ComponentTests,
    /// The time derivative.
    pub temporal: Temporal,
    /// `q` at least, in [0, 1]; 0 tests nothing. Of [`Temporal::Steps`] only.
    pub least_steadiness: f64,
    /// Border rule of the filters.
    pub border: Border,
}

/// Component velocities of one picture.
#[derive(Debug, Clone)]
pub struct ComponentField<T> {
    /// `phi_x`, `phi_y`, `phi_t`, `v_x`, `v_y`, `|R|`: shape (6, N, H, W). Phase gradients in rad/px
    /// and rad/frame, NaN where there is no phase; velocities in px/frame, NaN where a test fails.
    pub planes: Array4<T>,
    /// `(k_x, k_y)` of each filter, rad/px.
    pub wavevectors: Vec<[f64; 2]>,
}

impl ComponentVelocities {
    /// Component velocities at frame `index` of frames (T, H, W).
    ///
    /// # Errors
    /// [`Error::Shape`] for too few frames, [`Error::Value`] for a parameter out of range,
    /// [`Error::Cancelled`].
    pub fn estimate<T: Real>(
        &self,
        frames: ArrayView3<'_, T>,
        index: usize,
        control: &Control,
    ) -> Result<ComponentField<T>> {
        self.tests.check()?;
        require("least_steadiness", self.least_steadiness, "in [0, 1]", |q| {
            (0.0..=1.0).contains(&q)
        })?;
        require_frames("frames", &frames, [2, 1, 1])?;
        if index >= frames.dim().0 {
            let expected = format!("in 0..={}", frames.dim().0 - 1);
            return Err(Error::value("index", expected, index));
        }
        let channels = match self.temporal {
            Temporal::Steps => return self.by_steps(frames, index, control),
            Temporal::Gaussian => SpatiotemporalBank::gaussian(&self.gabor)?,
            Temporal::VelocityTuned => SpatiotemporalBank::velocity_tuned(&self.gabor)?,
        }
        .respond(frames, index, self.border, control)?;
        let tuned = self.temporal == Temporal::VelocityTuned;
        self.collect(frames, &channels, control, |channel, filter, y, power, phi_t, _| {
            let (re, im) = channel.response.row(filter, y);
            let (d_re, d_im) = channel.slope.row(filter, y);
            rate_of_phase([re, im], [d_re, d_im], power, T::of(channel.omega), phi_t);
            tuned
        })
    }

    fn by_steps<T: Real>(
        &self,
        frames: ArrayView3<'_, T>,
        index: usize,
        control: &Control,
    ) -> Result<ComponentField<T>> {
        let bank = GaborBank::new(&self.gabor)?;
        let around = index.saturating_sub(1)..(index + 2).min(frames.dim().0);
        let here = index - around.start;
        let mut responses = around
            .map(|t| bank.respond(frames.index_axis(Axis(0), t), self.border, control))
            .collect::<Result<Vec<_>>>()?;
        let response = responses[here].clone();
        let wavevectors = bank.wavevectors().to_vec();
        // The slope is not used: the steps take its place.
        let channel =
            Channel { wavevectors, omega: 0.0, slope: responses.swap_remove(here), response };
        let neighbours = responses;
        self.collect(frames, &[channel], control, |channel, filter, y, power, phi_t, steady| {
            phi_t.fill(T::zero());
            let mut step = vec![T::zero(); phi_t.len()];
            let share = T::one() / T::of(neighbours.len() as f64);
            for (n, neighbour) in neighbours.iter().enumerate() {
                let (mut first, mut second) =
                    (channel.response.row(filter, y), neighbour.row(filter, y));
                add_beat(power, second, steady);
                let earlier = here == 1 && n == 0;
                if earlier {
                    (first, second) = (second, first);
                }
                phase_step(first, second, &mut step);
                phi_t.iter_mut().zip(&step).for_each(|(sum, &s)| *sum += share * s);
            }
            false
        })
    }

    /// Tests and velocities of all channels; `phi_t` fills in its row, lowers the steadiness, which
    /// starts at 1, and tells whether the frequency test takes it in.
    fn collect<T: Real>(
        &self,
        frames: ArrayView3<'_, T>,
        channels: &[Channel<T>],
        control: &Control,
        phi_t: impl Fn(&Channel<T>, usize, usize, &[T], &mut [T], &mut [T]) -> bool + Sync,
    ) -> Result<ComponentField<T>> {
        let (_, height, width) = frames.dim();
        let filters: usize = channels.iter().map(|c| c.wavevectors.len()).sum();
        let brightness = frames.fold(0.0f64, |m, i| m.max(i.as_f64().abs()));
        let largest = channels.iter().map(|c| largest_amplitude(&c.response)).fold(0.0, f64::max);
        let least = T::of(self.tests.threshold(largest, brightness).powi(2));
        let farthest = T::of((self.tests.tau / self.gabor.sigma()).powi(2));
        let gradients = channels
            .iter()
            .map(|c| PhaseGradient::new(&c.response, &c.wavevectors, control))
            .collect::<Result<Vec<_>>>()?;
        let least_steadiness = T::of(self.least_steadiness);
        let mut planes = vec![T::zero(); 6 * filters * height * width];
        let scratch = || vec![T::one(); width];
        for_each_row_with(&mut planes, 6 * filters * width, control, scratch, |y, out, steady| {
            let mut rows = out.chunks_mut(6 * width);
            for (channel, gradient) in channels.iter().zip(&gradients) {
                for (filter, k) in channel.wavevectors.iter().enumerate() {
                    let Some(out) = rows.next() else { return };
                    let row = gradient.row(filter, y);
                    let (phi, rest) = out.split_at_mut(3 * width);
                    steady.fill(T::one());
                    let timed = phi_t(channel, filter, y, row.power, &mut phi[2 * width..], steady);
                    for x in 0..width {
                        let (px, py, pt) = (row.phi_x[x], row.phi_y[x], phi[2 * width + x]);
                        (phi[x], phi[width + x]) = (px, py);
                        let [dx, dy] = [px - T::of(k[0]), py - T::of(k[1])];
                        let dt = if timed { pt - T::of(channel.omega) } else { T::zero() };
                        let power = row.power[x];
                        let near = dx * dx + dy * dy + dt * dt <= farthest;
                        let velocity = if near && power >= least && steady[x] >= least_steadiness {
                            component_velocity([px, py, pt])
                        } else {
                            [T::nan(); 2]
                        };
                        [rest[x], rest[width + x]] = velocity;
                        rest[2 * width + x] = power.sqrt();
                    }
                }
            }
        })?;
        let planes = Array4::from_shape_vec((height, filters, 6, width), planes)
            .unwrap_or_default()
            .permuted_axes([2, 1, 0, 3]);
        let wavevectors = channels.iter().flat_map(|c| c.wavevectors.clone()).collect();
        Ok(ComponentField { planes, wavevectors })
    }
}

/// Lowers `steady` to `q` between responses of squared amplitude `power` and others of the same row.
fn add_beat<T: Real>(power: &[T], (re, im): (&[T], &[T]), steady: &mut [T]) {
    for (((q, &p), &re), &im) in steady.iter_mut().zip(power).zip(re).zip(im) {
        let other = re * re + im * im;
        let ratio = T::of(2.0) * (p * other).sqrt() / (p + other);
        // Silence in both is steady, and no other test lets it pass.
        if ratio < *q {
            *q = ratio;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drifting_wave_moves_along_its_normal() {
        // phi = 3 x + 4 y - 10 t: speed 10 / 5 along (3, 4) / 5.
        let v: [f64; 2] = component_velocity([3.0, 4.0, -10.0]);
        assert!((v[0] - 1.2).abs() < 1e-15 && (v[1] - 1.6).abs() < 1e-15);
        assert!(component_velocity([0.0, 0.0, 1.0f64])[0].is_nan());
        assert!(component_velocity([f64::NAN, 1.0, 1.0])[1].is_nan());
        assert!(component_velocity([1.0f64, 0.0, 0.0]).iter().all(|c| c.to_bits() == 0));
    }

    #[test]
    fn components_of_a_translation_are_its_projections() {
        // Without a carrier the window in time sees slow motion only: |k . v| below sigma_k.
        for (temporal, velocity) in [
            (Temporal::Steps, [1.1, -0.7]),
            (Temporal::Gaussian, [0.12, -0.1]),
            (Temporal::VelocityTuned, [0.55, -0.4]),
        ] {
            let frames = ndarray::Array3::from_shape_fn((25, 48, 50), |(t, y, x)| {
                let x = x as f64 - velocity[0] * t as f64;
                let y = y as f64 - velocity[1] * t as f64;
                (0.8 * x + 0.2 * y).sin() + (0.3 * x - 0.75 * y).cos()
            });
            let method = ComponentVelocities { temporal, ..Default::default() };
            let field = method.estimate::<f64>(frames.view(), 12, &Control::new()).unwrap();
            let mut known = 0;
            for filter in 0..field.wavevectors.len() {
                let at = |plane: usize| field.planes[(plane, filter, 24, 25)];
                if at(3).is_nan() {
                    continue;
                }
                known += 1;
                let along =
                    (at(0) * velocity[0] + at(1) * velocity[1]) / (at(0) * at(0) + at(1) * at(1));
                // Two waves leak into each other's filters; 3 % of a pixel is left of that.
                assert!((at(3) - along * at(0)).abs() < 0.03, "{temporal:?} {filter}");
                assert!((at(4) - along * at(1)).abs() < 0.03, "{temporal:?} {filter}");
            }
            assert!(known >= 2, "{temporal:?} keeps {known}");
        }
    }

    /// Amplitudes 3 and 4, then 3 and 1: q = 24/25, then 6/10.
    #[test]
    fn steadiness_is_that_of_the_worst_neighbour() {
        let mut steady = [1.0f64, 1.0];
        add_beat(&[9.0, 0.0], (&[4.0, 0.0], &[0.0, 0.0]), &mut steady);
        assert!((steady[0] - 0.96).abs() < 1e-15 && steady[1] == 1.0);
        add_beat(&[9.0, 0.0], (&[0.0, 0.0], &[1.0, 0.0]), &mut steady);
        assert!((steady[0] - 0.6).abs() < 1e-15);
    }
}
