//! Gabor filters in space and time, and their responses at one frame.
//!
//! A Gaussian window `g(n)` in time, unit sum, of the deviation of the window in space, carries
//! `exp(i omega n)`, `omega = -k . v` for a pattern of velocity `v`. It is cut symmetrically to the
//! frames there are on *both* sides of the reference frame: a lopsided one would measure the motion
//! of another instant. With `z(n) = S(t + n) exp(-i omega n)`, `S` the spatial response:
//!
//! ```text
//! response  R = sum_n g(n) z(n)
//! slope     D = sum_q d(q) sum_n g(n) z(n + q)      d: central difference, five-point from 11 frames
//! phi_t       = omega + Im(conj(R) D) / |R|^2                                rad/frame
//! ```
//!
//! Differences of the moved window are as cheap as the derivative of the window, and exact to the
//! order of the stencil wherever the window is cut,
//! so that every frame serves the reference frame. Two banks:
//!
//! * [`SpatiotemporalBank::gaussian`]: `omega = 0`, the orientations of [`crate::gabor`];
//! * [`SpatiotemporalBank::velocity_tuned`]: 22 filters on the sphere of radius `k0` in
//!   `(k_x, k_y, omega)`, at elevations 0, 30, 60 degrees (speeds 0, 1/sqrt 3, sqrt 3 px/frame),
//!   with 6 directions over 180 degrees for speed 0, and 10 and 6 over 360 for the others.
//!
//! Time comes first, on real frames: with `P + iQ` the carrier's answer and `B` the spatial filter,
//! `R = B(P) + i B(Q)`, and the opposite direction is `conj B(P) + i conj B(Q)` for nothing.
//!
//! Source: Fleet & Jepson 1990 (doi 10.1007/BF00056772), section 3.

use ndarray::{Array2, ArrayView3};

use crate::array::require_frames;
use crate::border::Border;
use crate::control::Control;
use crate::convolve::gaussian_taps;
use crate::error::{Error, Result};
use crate::even_odd::even_odd_sums;
use crate::gabor::{GaborBank, GaborParameters, Responses};
use crate::real::Real;

/// Elevation on the sphere in degrees, directions over 180 degrees, whether opposite ones differ.
const RINGS: [(f64, usize, bool); 3] = [(0.0, 6, false), (30.0, 5, true), (60.0, 3, true)];

/// Frames on each side from which the slope can afford the five-point difference.
const FIVE_POINT_REACH: usize = 5;

/// Filters in space and time; see the [module](self).
#[derive(Debug, Clone)]
pub struct SpatiotemporalBank<T> {
    rings: Vec<Ring<T>>,
    sigma: f64,
    support: f64,
}

/// Filters that share a temporal frequency.
#[derive(Debug, Clone)]
struct Ring<T> {
    spatial: GaborBank<T>,
    omega: f64,
    opposite: bool,
}

/// Responses and slopes of filters that share a temporal frequency.
#[derive(Debug, Clone)]
pub struct Channel<T> {
    /// `(k_x, k_y)` of each filter, rad/px.
    pub wavevectors: Vec<[f64; 2]>,
    /// Temporal frequency, rad/frame.
    pub omega: f64,
    /// `R` at the reference frame.
    pub response: Responses<T>,
    /// `D` at the reference frame, per frame.
    pub slope: Responses<T>,
}

impl<T: Real> SpatiotemporalBank<T> {
    /// The orientations of `parameters`, without a temporal carrier.
    ///
    /// # Errors
    /// [`Error::Value`] when a parameter is outside its documented range.
    pub fn gaussian(parameters: &GaborParameters) -> Result<Self> {
        let spatial = GaborBank::new(parameters)?;
        let rings = vec![Ring { spatial, omega: 0.0, opposite: false }];
        Ok(Self { rings, sigma: parameters.sigma(), support: parameters.support })
    }

    /// The 22 velocity-tuned filters; `parameters.orientations` is not used.
    ///
    /// # Errors
    /// [`Error::Value`] when a parameter is outside its documented range.
    pub fn velocity_tuned(parameters: &GaborParameters) -> Result<Self> {
        parameters.check()?;
        let (k0, sigma, support) =
            (parameters.wavenumber(), parameters.sigma(), parameters.support);
        let rings = RINGS.map(|(elevation, directions, opposite)| {
            let (sin, cos) = elevation.to_radians().sin_cos();
            let spatial = GaborBank::tuned(k0 * cos, sigma, directions, support);
            // Negative: motion along +k.
            Ring { spatial, omega: if opposite { -k0 * sin } else { 0.0 }, opposite }
        });
        Ok(Self { rings: rings.into(), sigma, support })
    }

    /// Deviation of the window, px and frames; its inverse is that of the spectrum, rad/px.
    #[must_use]
    pub fn sigma(&self) -> f64 {
        self.sigma
    }

    /// Farthest sample in space that takes part in a response, px.
    #[must_use]
    pub fn radius(&self) -> usize {
        self.rings.iter().map(|ring| ring.spatial.radius()).max().unwrap_or(0)
    }

    /// Responses and slopes at frame `index` of frames (T, H, W).
    ///
    /// # Errors
    /// [`Error::Shape`] below (3, 1, 1) samples, [`Error::Value`] when `index` has no frame on one
    /// side, [`Error::Cancelled`].
    pub fn respond(
        &self,
        frames: ArrayView3<'_, T>,
        index: usize,
        border: Border,
        control: &Control,
    ) -> Result<Vec<Channel<T>>> {
        require_frames("frames", &frames, [3, 1, 1])?;
        let count = frames.dim().0;
        if index == 0 || index + 1 >= count {
            let expected = format!("in 1..={} (a frame on each side)", count - 2);
            return Err(Error::value("index", expected, index));
        }
        let reach = index.min(count - 1 - index).min((self.support * self.sigma).ceil() as usize);
        let frames = frames.as_standard_layout();
        let mut channels = Vec::new();
        for ring in &self.rings {
            let [p, q, p_slope, q_slope] = self.in_time(frames.view(), index, reach, ring.omega);
            let respond = |plane: &Array2<T>| ring.spatial.respond(plane.view(), border, control);
            let k = ring.spatial.wavevectors();
            if !ring.opposite {
                let (response, slope) = (respond(&p)?, respond(&p_slope)?);
                channels.push(Channel { wavevectors: k.to_vec(), omega: 0.0, response, slope });
                continue;
            }
            let (p, q) = (respond(&p)?, respond(&q)?);
            let (p_slope, q_slope) = (respond(&p_slope)?, respond(&q_slope)?);
            for sign in [1.0, -1.0] {
                channels.push(Channel {
                    wavevectors: k.iter().map(|k| k.map(|c| sign * c)).collect(),
                    omega: ring.omega,
                    response: carried(&p, &q, T::of(sign)),
                    slope: carried(&p_slope, &q_slope, T::of(sign)),
                });
            }
        }
        Ok(channels)
    }

    /// `[P, Q, P of the slope, Q of the slope]` at frame `index`.
    fn in_time(
        &self,
        frames: ArrayView3<'_, T>,
        index: usize,
        reach: usize,
        omega: f64,
    ) -> [Array2<T>; 4] {
        let (_, height, width) = frames.dim();
        let (window, slope) = temporal_taps(self.sigma, reach);
        let taps = |half: &[f64], carrier: &dyn Fn(f64) -> f64| -> Vec<T> {
            half.iter().enumerate().map(|(n, g)| T::of(g * carrier(omega * n as f64))).collect()
        };
        // exp(-i omega n) = cos - i sin: the cosine keeps the parity of a window, the sine turns it.
        let sine = |angle: f64| -angle.sin();
        let (p_taps, q_taps) = (taps(&window, &f64::cos), taps(&window, &sine));
        let (p_slope_taps, q_slope_taps) = (taps(&slope, &f64::cos), taps(&slope, &sine));
        let mut planes = [(); 4].map(|()| vec![T::zero(); height * width]);
        let plane = |t: usize| {
            &frames.to_slice().unwrap_or_default()[t * height * width..][..height * width]
        };
        let shifted: Vec<&[T]> = (0..=2 * reach).map(|n| plane(index + n - reach)).collect();
        let [p, q, p_slope, q_slope] = &mut planes;
        even_odd_sums(&shifted, &p_taps, &q_taps, p, q);
        even_odd_sums(&shifted, &q_slope_taps, &p_slope_taps, q_slope, p_slope);
        planes.map(|p| Array2::from_shape_vec((height, width), p).unwrap_or_default())
    }
}

/// Taps `n = 0..=reach` of the even window and of the odd slope; the other half mirrors them.
fn temporal_taps(sigma: f64, reach: usize) -> (Vec<f64>, Vec<f64>) {
    let five_points = reach >= FIVE_POINT_REACH;
    let moved = if five_points { 2 } else { 1 };
    let stencil: &[(isize, f64)] = if five_points {
        &[(-2, 1.0 / 12.0), (-1, -8.0 / 12.0), (1, 8.0 / 12.0), (2, -1.0 / 12.0)]
    } else {
        &[(-1, -0.5), (1, 0.5)]
    };
    let radius = (reach - moved) as isize;
    let gaussian = gaussian_taps(sigma, radius as usize);
    let at = |n: isize| if n.abs() <= radius { gaussian[(n + radius) as usize] } else { 0.0 };
    (0..=reach as isize)
        .map(|n| (at(n), stencil.iter().map(|&(q, d)| d * at(n - q)).sum::<f64>()))
        .unzip()
}

/// `B(P) + i B(Q)` for `sign = 1`, `conj B(P) + i conj B(Q)` for `sign = -1`.
fn carried<T: Real>(p: &Responses<T>, q: &Responses<T>, sign: T) -> Responses<T> {
    let (filters, height, width) = p.dim();
    let mut out = Responses::zeros(filters, height, width);
    for (y, filter) in (0..height).flat_map(|y| (0..filters).map(move |f| (y, f))) {
        let ((p_re, p_im), (q_re, q_im)) = (p.row(filter, y), q.row(filter, y));
        let (re, im) = out.row_mut(filter, y);
        for x in 0..width {
            re[x] = p_re[x] - sign * q_im[x];
            im[x] = sign * p_im[x] + q_re[x];
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phase_rate::{rate_of_phase, square};
    use ndarray::Array3;

    fn drifting_wave(k: [f64; 2], omega: f64) -> Array3<f64> {
        Array3::from_shape_fn((15, 25, 27), |(t, y, x)| {
            (k[0] * x as f64 + k[1] * y as f64 + omega * t as f64).cos()
        })
    }

    /// The filter tuned to a drifting wave answers half its amplitude and measures its frequency.
    #[test]
    fn every_filter_measures_the_wave_it_is_tuned_to() {
        let parameters = GaborParameters { tuning_frequency: 1.0 / 4.25, ..Default::default() };
        let bank = SpatiotemporalBank::<f64>::velocity_tuned(&parameters).unwrap();
        let blank = Array3::<f64>::zeros((15, 25, 27));
        let channels = bank.respond(blank.view(), 7, Border::Reflect, &Control::new()).unwrap();
        assert_eq!(channels.iter().map(|c| c.wavevectors.len()).sum::<usize>(), 22);
        for (c, channel) in channels.iter().enumerate() {
            for (filter, &k) in channel.wavevectors.iter().enumerate() {
                let frames = drifting_wave(k, channel.omega);
                let seen =
                    bank.respond(frames.view(), 7, Border::Reflect, &Control::new()).unwrap();
                let (re, im) = seen[c].response.row(filter, 12);
                let (d_re, d_im) = seen[c].slope.row(filter, 12);
                let (mut power, mut rate) = ([0.0; 27], [0.0; 27]);
                square(re, im, &mut power);
                rate_of_phase([re, im], [d_re, d_im], &power, channel.omega, &mut rate);
                // Freedom from the mean costs exp(-(k sigma)^2) of the amplitude, k the larger
                // component, 8 % at worst; the window ends at 2 deviations in time.
                let cost = (-(k[0].abs().max(k[1].abs()) * bank.sigma()).powi(2)).exp();
                let amplitude = 0.5 * (1.0 - cost);
                assert!((power[13].sqrt() - amplitude).abs() < 5e-3, "amplitude of {c}, {filter}");
                assert!((rate[13] - channel.omega).abs() < 5e-3, "rate of {c}, {filter}");
            }
        }
    }

    #[test]
    fn still_frames_have_no_slope() {
        let frames = drifting_wave([0.9, 0.1], 0.0);
        let bank = SpatiotemporalBank::<f64>::gaussian(&GaborParameters::default()).unwrap();
        let channels = bank.respond(frames.view(), 4, Border::Replicate, &Control::new()).unwrap();
        for (y, filter) in (0..25).flat_map(|y| (0..6).map(move |f| (y, f))) {
            let (re, im) = channels[0].slope.row(filter, y);
            assert!(re.iter().chain(im).all(|&d| d == 0.0), "equal frames cancel exactly");
        }
    }

    #[test]
    fn the_reference_frame_needs_neighbours() {
        let frames = Array3::<f32>::zeros((4, 8, 8));
        let bank = SpatiotemporalBank::gaussian(&GaborParameters::default()).unwrap();
        for index in [0, 3, 9] {
            let error =
                bank.respond(frames.view(), index, Border::Zero, &Control::new()).unwrap_err();
            assert!(error.to_string().starts_with("index must be in 1..=2"));
        }
    }
}
