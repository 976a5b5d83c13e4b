//! Velocity and acceleration at the middle of a frame's exposure, from the flows to its two neighbours.
//!
//! What is at p moves by f until the next frame and by g back to the one before. To second order in time
//!
//! ```text
//! f = v + A / 2,   g = -v + A / 2:      v = (f - g) / 2,      A = f + g
//! ```
//!
//! with A the acceleration that the moving content feels (at a fixed pixel the velocity changes by A - (v.grad) v).
//! A is a small difference of large measured numbers and so is smoothed by a Gaussian of 3 px over the pixels where it
//! is known. Where one of the flows is not known (and at the ends of a clip, where the acceleration may be given by the frame
//! next to it) v = f - A/2 or A/2 - g, A = 0 if nothing tells. Units: px/frame, px/frame^2; NaN = unknown.

use ndarray::{Array2, Axis, Zip};

use crate::border::Border;
use crate::control::Control;
use crate::convolve::{correlate_separable, gaussian_taps};
use crate::error::{Error, Result};
use crate::flow_field::FlowField;

/// Deviation of the Gaussian that smooths the acceleration, px.
const SMOOTHING: f64 = 3.0;

/// Share of known pixels under the Gaussian below which nothing is told of the acceleration.
const LEAST_KNOWN: f32 = 0.05;

/// How the content of a frame moves.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameMotion {
    /// v, px/frame; NaN = unknown.
    pub velocity: FlowField<f32>,
    /// A, px/frame^2; 0 where nothing tells.
    pub acceleration: FlowField<f32>,
}

/// Motion from the flow `forward` to the next frame and `backward` to the one before; `acceleration` stands in where
/// one is missing.
///
/// # Errors
/// [`Error::Value`] without any flow; [`Error::Shape`] when shapes differ; [`Error::Cancelled`].
pub fn frame_motion(
    forward: Option<&FlowField<f32>>,
    backward: Option<&FlowField<f32>>,
    acceleration: Option<&FlowField<f32>>,
    control: &Control,
) -> Result<FrameMotion> {
    let Some(shape) = forward.or(backward).map(FlowField::dim) else {
        return Err(Error::value("flow", "known to one neighbour at least", "none"));
    };
    for field in [forward, backward, acceleration].into_iter().flatten() {
        if field.dim() != shape {
            let (height, width) = shape;
            return Err(Error::shape("flow", format!("({height}, {width}, 2)"), field.u.shape()));
        }
    }
    let unknown = FlowField::unknown(shape);
    let (f, g) = (forward.unwrap_or(&unknown), backward.unwrap_or(&unknown));
    let given = acceleration.unwrap_or(&unknown);
    let a = [(&f.u, &g.u, &given.u), (&f.v, &g.v, &given.v)]
        .map(|(f, g, given)| smoothed(&(f + g), given, control));
    let [au, av] = a;
    let acceleration = FlowField::new(au?, av?)?;
    let velocity = FlowField::new(
        velocity(&f.u, &g.u, &acceleration.u),
        velocity(&f.v, &g.v, &acceleration.v),
    )?;
    Ok(FrameMotion { velocity, acceleration })
}

fn velocity(f: &Array2<f32>, g: &Array2<f32>, a: &Array2<f32>) -> Array2<f32> {
    Zip::from(f).and(g).and(a).map_collect(|&f, &g, &a| match (f.is_nan(), g.is_nan()) {
        (false, false) => (f - g) / 2.0,
        (false, true) => f - a / 2.0,
        _ => a / 2.0 - g,
    })
}

/// Mean of the known samples under the Gaussian; else `given`; else 0.
fn smoothed(plane: &Array2<f32>, given: &Array2<f32>, control: &Control) -> Result<Array2<f32>> {
    let radius = (3.0 * SMOOTHING).ceil() as usize;
    let taps: Vec<f32> = gaussian_taps(SMOOTHING, radius).iter().map(|&tap| tap as f32).collect();
    let smooth = |plane: Array2<f32>| -> Result<Array2<f32>> {
        let volume = plane.insert_axis(Axis(0));
        let axes = [&[1.0][..], &taps, &taps];
        let volume = correlate_separable(volume.view(), axes, Border::Replicate, control)?;
        Ok(volume.remove_axis(Axis(0)))
    };
    let known = smooth(plane.mapv(|a| f32::from(u8::from(!a.is_nan()))))?;
    let sum = smooth(plane.mapv(|a| if a.is_nan() { 0.0 } else { a }))?;
    Ok(Zip::from(&sum).and(&known).and(given).map_collect(|&sum, &known, &given| {
        if known > LEAST_KNOWN {
            sum / known
        } else if given.is_finite() {
            given
        } else {
            0.0
        }
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field(u: f32, v: f32) -> FlowField<f32> {
        FlowField::new(Array2::from_elem((20, 24), u), Array2::from_elem((20, 24), v)).unwrap()
    }

    #[test]
    fn a_parabola_gives_its_velocity_and_acceleration() {
        let (f, g) = (field(5.0 + 1.0, -2.0 - 0.5), field(-5.0 + 1.0, 2.0 - 0.5));
        let motion = frame_motion(Some(&f), Some(&g), None, &Control::new()).unwrap();
        let close =
            |plane: &Array2<f32>, value: f32| plane.iter().all(|z| (z - value).abs() < 1e-5);
        assert!(close(&motion.velocity.u, 5.0) && close(&motion.velocity.v, -2.0));
        assert!(close(&motion.acceleration.u, 2.0) && close(&motion.acceleration.v, -1.0));
        // One flow and the acceleration say as much as two flows.
        let a = motion.acceleration;
        let first = frame_motion(Some(&f), None, Some(&a), &Control::new()).unwrap();
        let last = frame_motion(None, Some(&g), Some(&a), &Control::new()).unwrap();
        assert!(close(&first.velocity.u, 5.0) && close(&last.velocity.v, -2.0));
    }

    #[test]
    fn holes_take_what_is_known() {
        let (mut f, g) = (field(3.0, 0.0), field(-3.0, 0.0));
        f.u[(4, 5)] = f32::NAN;
        f.v[(4, 5)] = f32::NAN;
        let motion = frame_motion(Some(&f), Some(&g), None, &Control::new()).unwrap();
        assert!((motion.velocity.u[(4, 5)] - 3.0).abs() < 1e-6);
        assert!(motion.acceleration.u.iter().all(|a| a.abs() < 1e-6));
        assert!(frame_motion(None, None, None, &Control::new()).is_err());
    }
}
