//! Optical flow of the founding method, number by number: the yardstick, not a recommendation.
//!
//! ```text
//! frames (T, H, W) -> [bank, pruned] R of N filters -> [components] (un, vn) (N, T, H, W)
//!                  -> [gated_mean] over filters (T, H, W) -> over frames (H, W) = (u, v)
//! ```
//!
//! Its speeds are a tenth to a fifth of the truth, for reasons named in each part; it is kept so
//! that published figures can be repeated. Work and memory grow with the whole picture: each
//! filter is as large as the frame.
//!
//! Source: C. Texin, "Optical Flow Using Phase Information for Deblurring", MIT 2007, chapter 4.

use ndarray::{Array2, Array3, ArrayView3, s};
use rayon::prelude::*;

use crate::array::{for_each_row_with, require_frames};
use crate::control::Control;
use crate::error::Result;
use crate::fft_convolve::{FftConvolver, FftScratch};
use crate::flow_field::FlowField;

pub mod bank;
pub mod components;
pub mod gated_mean;
pub mod pruned;

use bank::Bank;
use components::{Response, component_velocities, filter_in_time};
use gated_mean::GatedMean;
use pruned::PrunedSpectrum;

/// What happens to static pixels, those whose central time difference is exactly 0 in every frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ZeroStatic {
    /// Nothing. Fits the published table best.
    #[default]
    None,
    /// Their component velocities become 0.
    Velocity,
    /// Their intensity becomes 0 too, as printed; this makes false edges.
    ImageAndVelocity,
}

/// Parameters of the founding method; see the [module](self).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThesisFlow {
    /// Cycles/px. Default 0.06.
    pub tuning_frequency: f64,
    /// Octaves. Default 0.8.
    pub bandwidth_octaves: f64,
    /// Treatment of static pixels.
    pub zero_static: ZeroStatic,
    /// Double the picture first. The velocities stay in half pixels, as the listing leaves them.
    pub interpolate: bool,
    /// Gates of both means.
    pub gate: GatedMean,
}

impl Default for ThesisFlow {
    fn default() -> Self {
        Self {
            tuning_frequency: 0.06,
            bandwidth_octaves: 0.8,
            zero_static: ZeroStatic::None,
            interpolate: false,
            gate: GatedMean::default(),
        }
    }
}

impl ThesisFlow {
    /// Flow (H, W) of at least 2 frames (T, H, W) of finite intensities on any scale; NaN = unknown.
    ///
    /// # Errors
    /// [`Error::Shape`](crate::Error::Shape) below (2, 1, 1) samples,
    /// [`Error::Value`](crate::Error::Value) for a parameter out of range,
    /// [`Error::Cancelled`](crate::Error::Cancelled).
    pub fn estimate(
        &self,
        frames: ArrayView3<'_, f64>,
        control: &Control,
    ) -> Result<FlowField<f64>> {
        let (count, height, width) = frames.dim();
        let components = self.components(frames, control)?;
        let [u, v] = [0, 1].map(|part| {
            let mut out = vec![0.0; height * width];
            for_each_row_with(
                &mut out,
                width,
                control,
                || vec![0.0; count * width],
                |y, out, over_filters| {
                    for (t, mean) in over_filters.chunks_mut(width).enumerate() {
                        let at = (t * height + y) * width;
                        let rows: Vec<&[f64]> = components
                            .iter()
                            .map(|c| &c[part].as_slice().unwrap_or_default()[at..at + width])
                            .collect();
                        self.gate.of_rows(&rows, mean);
                    }
                    let frames: Vec<&[f64]> = over_filters.chunks(width).collect();
                    self.gate.of_rows(&frames, out);
                },
            )?;
            Ok(Array2::from_shape_vec((height, width), out).unwrap_or_default())
        });
        FlowField::new(u?, v?)
    }

    /// Component velocities `[un, vn]`, each (T, H, W) px/frame, of every filter.
    ///
    /// # Errors
    /// As [`ThesisFlow::estimate`].
    pub fn components(
        &self,
        frames: ArrayView3<'_, f64>,
        control: &Control,
    ) -> Result<Vec<[Array3<f64>; 2]>> {
        require_frames("frames", &frames, [2, 1, 1])?;
        self.gate.check()?;
        let moving = moving_pixels(frames);
        self.for_each_filter(frames, &moving, control, |response| {
            Ok(component_velocities(response, control)?.map(|part| self.finish(part, &moving)))
        })
    }

    /// What `stage` makes of the response `R` (T, H, W) of every filter, in parallel over filters.
    ///
    /// # Errors
    /// As [`ThesisFlow::estimate`], and those of `stage`.
    pub fn for_each_filter<S: Send>(
        &self,
        frames: ArrayView3<'_, f64>,
        moving: &Array2<f64>,
        control: &Control,
        stage: impl Fn(&Response) -> Result<S> + Sync,
    ) -> Result<Vec<S>> {
        let mut pictures = frames.to_owned();
        if self.zero_static == ZeroStatic::ImageAndVelocity {
            pictures *= moving;
        }
        let mut frequency = self.tuning_frequency;
        if self.interpolate {
            pictures = upsample_frames(&pictures);
            frequency /= 2.0;
        }
        let (count, height, width) = pictures.dim();
        let bank = Bank::new(height, width, frequency, self.bandwidth_octaves)?;
        let pruned = PrunedSpectrum::new(height, width);
        let convolver = FftConvolver::new(height, width, [height / 2, width / 2])?;
        // The filter in time commutes with those in space: once here instead of once per filter.
        let pictures = filter_in_time(&pictures, &bank.temporal_taps(count), control)?;
        let spectra = (0..count)
            .into_par_iter()
            .map_init(FftScratch::default, |scratch, t| {
                convolver.spectrum(pictures.slice(s![t, .., ..]), scratch, control)
            })
            .collect::<Result<Vec<_>>>()?;
        let angles = bank.angles();
        control.expect(angles.len());
        angles
            .into_par_iter()
            .map_init(
                || (FftScratch::default(), Response::zeros((count, height, width))),
                |(scratch, response), angle| {
                    let kernel = pruned.of(&bank, angle, &mut scratch.transform);
                    for (spectrum, out) in spectra.iter().zip(response.frames_mut()) {
                        convolver.convolve(spectrum, &kernel, out, scratch, control)?;
                    }
                    let result = stage(response)?;
                    control.advance()?;
                    Ok(result)
                },
            )
            .collect()
    }

    /// Undoes the doubling and silences static pixels.
    fn finish(&self, mut component: Array3<f64>, moving: &Array2<f64>) -> Array3<f64> {
        if self.interpolate {
            component = component.slice(s![.., ..;2, ..;2]).to_owned();
        }
        if self.zero_static != ZeroStatic::None {
            component *= moving;
        }
        component
    }
}

/// 1 where the central time difference (one-sided at the ends) is not 0 in every frame, else 0.
#[must_use]
pub fn moving_pixels(frames: ArrayView3<'_, f64>) -> Array2<f64> {
    let (count, height, width) = frames.dim();
    Array2::from_shape_fn((height, width), |(y, x)| {
        let at = |t: usize| frames[(t.min(count - 1), y, x)];
        let moves = (0..count).any(|t| at(t + 1) != at(t.saturating_sub(1)));
        f64::from(u8::from(moves))
    })
}

/// Linear interpolation half way between the samples; the last row and column stay 0.
fn upsample_frames(frames: &Array3<f64>) -> Array3<f64> {
    let (count, height, width) = frames.dim();
    let mut doubled = Array3::zeros((count, 2 * height, 2 * width));
    for ((t, y, x), out) in doubled.slice_mut(s![.., ..-1, ..-1]).indexed_iter_mut() {
        let between =
            |row: usize| (frames[(t, row, x / 2)] + frames[(t, row, x.div_ceil(2))]) / 2.0;
        *out = f64::midpoint(between(y / 2), between(y.div_ceil(2)));
    }
    doubled
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moving_texture(frames: usize, height: usize, width: usize, velocity: f64) -> Array3<f64> {
        Array3::from_shape_fn((frames, height, width), |(t, y, x)| {
            let x = x as f64 - velocity * t as f64;
            (0.9 * x + 0.3 * y as f64).sin() + (0.5 * x - 0.8 * y as f64).cos()
        })
    }

    #[test]
    fn sees_the_direction_of_a_translation_and_underestimates_its_speed() {
        let frames = moving_texture(3, 32, 36, 0.8);
        let method = ThesisFlow { tuning_frequency: 0.15, ..Default::default() };
        let flow = method.estimate(frames.view(), &Control::new()).unwrap();
        let (u, v) = (flow.u[(16, 18)], flow.v[(16, 18)]);
        assert!(u > 0.05 && u < 0.6 && v.abs() < u, "({u}, {v})");
    }

    #[test]
    fn still_frames_do_not_move() {
        let frames = moving_texture(3, 12, 14, 0.0);
        let run = |zero_static| {
            let method = ThesisFlow { zero_static, ..Default::default() };
            method.estimate(frames.view(), &Control::new()).unwrap()
        };
        let flow = run(ZeroStatic::None);
        // What is left is the rounding of Im(conj(R) R), 1e-16 of |R|^2 per sample.
        assert!(flow.u.iter().chain(&flow.v).all(|c| c.abs() < 1e-9));
        let flow = run(ZeroStatic::Velocity);
        assert!(flow.u.iter().chain(&flow.v).all(|&c| c == 0.0));
    }

    #[test]
    fn too_few_frames_are_refused() {
        let frames = Array3::zeros((1, 8, 8));
        let error = ThesisFlow::default().estimate(frames.view(), &Control::new()).unwrap_err();
        assert!(error.to_string().starts_with("frames must have shape (T >= 2"));
    }
}
