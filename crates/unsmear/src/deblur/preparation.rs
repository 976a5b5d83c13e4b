//! What a restoration needs to know before it starts: lengths of blur, the flow that is used, noise, and weights.

use ndarray::{Array2, ArrayView2, Zip};

use super::inverse_kernel::LONGEST_BLUR;
use super::occlusion::occlusion_weights;
use crate::control::Control;
use crate::error::Result;
use crate::flow_field::{FlowField, FlowView};
use crate::noise::estimate_noise;
use crate::real::Real;

/// Blur of each pixel, px; NaN where the motion is unknown.
pub(super) fn blur_lengths<T: Real>(flow: &FlowView<'_, T>, exposure: f64) -> Array2<f32> {
    Zip::from(&flow.u).and(&flow.v).map_collect(|u, v| {
        let (u, v) = (u.as_f64(), v.as_f64());
        (exposure * (u * u + v * v).sqrt()) as f32
    })
}

/// The flow in single precision; unknown where the blur is beyond [`LONGEST_BLUR`].
pub(super) fn known_flow<T: Real>(
    flow: &FlowView<'_, T>,
    lengths: &Array2<f32>,
) -> Result<FlowField<f32>> {
    let part = |plane: &ArrayView2<'_, T>| {
        Zip::from(plane).and(lengths).map_collect(|z, &length| {
            // Also false for NaN.
            if f64::from(length) <= LONGEST_BLUR { z.as_f64() as f32 } else { f32::NAN }
        })
    };
    FlowField::new(part(&flow.u), part(&flow.v))
}

/// A field in single precision.
pub(super) fn single<T: Real>(field: &FlowView<'_, T>) -> Result<FlowField<f32>> {
    let part = |plane: &ArrayView2<'_, T>| plane.map(|z| z.as_f64() as f32);
    FlowField::new(part(&field.u), part(&field.v))
}

/// Root mean square over the channels of the noise measured in each, in the units of `planes`.
pub(super) fn measured_noise(
    planes: &[Array2<f32>],
    flow: &FlowField<f32>,
    exposure: f64,
    control: &Control,
) -> Result<f64> {
    let mut power = 0.0;
    for plane in planes {
        power += estimate_noise(&plane.view(), &flow.view(), exposure, control)?.powi(2);
    }
    Ok((power / planes.len() as f64).sqrt())
}

/// How far each datum is believed.
pub(super) struct Weights {
    /// In [0, 1]; 0 for unknown samples, unknown motion and paths across a jump of the flow.
    pub(super) used: Array2<f32>,
    /// Samples of known motion whose path crosses a jump of the flow.
    pub(super) occluded: usize,
    /// Whether any sample of the picture is unknown.
    pub(super) unknown: bool,
}

impl Weights {
    /// From the weights that were `given`, the samples, and the flow.
    pub(super) fn new(
        given: Option<&ArrayView2<'_, f32>>,
        planes: &[Array2<f32>],
        flow: &FlowField<f32>,
        exposure: f64,
        control: &Control,
    ) -> Result<Self> {
        let mut used = occlusion_weights(flow, exposure, control)?;
        let moving = |u: f32, v: f32| !(u + v).is_nan();
        let mut occluded = 0;
        Zip::from(&used).and(&flow.u).and(&flow.v).for_each(|&w, &u, &v| {
            occluded += usize::from(w == 0.0 && moving(u, v));
        });
        if let Some(given) = given {
            used *= given;
        }
        let mut unknown = false;
        for plane in planes {
            Zip::from(&mut used).and(plane).for_each(|weight, sample| {
                if !sample.is_finite() {
                    *weight = 0.0;
                    unknown = true;
                }
            });
        }
        Ok(Self { used, occluded, unknown })
    }
}
