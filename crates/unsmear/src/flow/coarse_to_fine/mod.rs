//! Coarse-to-fine phase-based flow: the default method.
//!
//! From the coarsest level of a pyramid to the finest, the flow found so far is enlarged and refined
//! by warping ([`refine`]). At every level one bank of four Gabor filters of wavelength 4 px and 1.6
//! octaves sees what the level adds: half an octave of detail, moving by less than half a wavelength
//! against what is known already. Phase differences do not change with brightness and contrast.
//!
//! ```text
//! U <- 0;  for each level: U <- enlarge(U) times the ratio of sizes;  U <- refine(U)
//! ```
//!
//! Valid for motions that some level shows as a few pixels, of things not lost at that level: small
//! things that move far are missed. Frames beyond two assume constant motion.
//! Sources: Fleet & Jepson 1990 (doi 10.1007/BF00056772) for the constraint; see the modules.

use ndarray::{Array2, ArrayView3, Axis};

use crate::array::require_frames;
use crate::control::Control;
use crate::error::{Error, Result};
use crate::flow::Estimate;
use crate::flow_field::FlowField;
use crate::gabor::{GaborBank, GaborParameters};
use crate::pyramid::{Resampling, level_sizes, pyramid, resample};

mod arctangent;
mod boundary;
mod contrast;
mod data_term;
mod diffusivity;
mod guide;
mod parameters;
mod phase_constraint;
mod refine;
mod rows;

pub use parameters::CoarseToFine;

use contrast::Contrast;
use guide::EdgeRule;
use refine::{Level, OtherFrame, Settings};

/// What a flow is measured from.
#[derive(Debug, Clone, Copy)]
pub struct Sequence<'a> {
    /// Grey frames (T, H, W), any scale; not finite = unknown.
    pub frames: ArrayView3<'a, f64>,
    /// The reference frame.
    pub index: usize,
    /// Channels (C, H, W) of the reference frame, in the scale of the frames; without them the frame guides itself.
    pub guide: Option<ArrayView3<'a, f64>>,
}

impl CoarseToFine {
    /// Flow and confidence at the reference frame.
    ///
    /// # Errors
    /// [`Error::Shape`] below (2, 1, 1) samples or for a guide of another size, [`Error::Value`] for a parameter out
    /// of range or an index without a next frame, [`Error::Cancelled`].
    pub fn estimate(&self, sequence: &Sequence<'_>, control: &Control) -> Result<Estimate<f32>> {
        let Sequence { frames, index, guide } = *sequence;
        require_frames("frames", &frames, [2, 1, 1])?;
        let (count, height, width) = frames.dim();
        if index + 1 >= count {
            return Err(Error::value("index", format!("in 0..={}", count - 2), index));
        }
        let settings = self.settings()?;
        let sizes = level_sizes((height, width), self.pyramid_factor, self.coarsest_side);
        let contrast = Contrast::of(frames);
        let levels = |picture| pyramid(picture, &sizes, self.pyramid_factor, control);
        let frame = |t: usize| levels(contrast.apply(frames.index_axis(Axis(0), t)));
        let reference = frame(index)?;
        let mut others = Vec::new();
        for (offset, t) in self.offsets(index, count) {
            others.push((offset, frame(t)?));
        }
        let channels = match guide {
            Some(guide) => {
                contrast.channels(guide).into_iter().map(levels).collect::<Result<Vec<_>>>()?
            }
            None => vec![reference.clone()],
        };
        let finest = self.finest_level.min(sizes.len() - 1);
        control.expect((finest..sizes.len()).map(|level| self.warps_at(level)).sum());
        let mut flow = FlowField { u: Array2::zeros((0, 0)), v: Array2::zeros((0, 0)) };
        for level in (finest..sizes.len()).rev() {
            flow = enlarge(&flow, sizes[level], control)?;
            let channels: Vec<_> = channels.iter().map(|c| c[level].clone()).collect();
            let others: Vec<_> = others
                .iter()
                .map(|(offset, levels)| OtherFrame { offset: *offset, picture: &levels[level] })
                .collect();
            flow = Level::new(&settings, &reference[level], &channels, &others, control)?
                .refine(flow, self.warps_at(level), control)?;
        }
        let flow = enlarge(&flow, sizes[0], control)?;
        let confidence = Array2::ones(flow.dim());
        Ok(Estimate { flow, confidence })
    }

    /// Offsets to the other frames, and their indices.
    fn offsets(&self, index: usize, count: usize) -> Vec<(f32, usize)> {
        let reach = self.frames_each_side;
        if reach == 0 {
            return vec![(1.0, index + 1)];
        }
        (index.saturating_sub(reach)..(index + reach + 1).min(count))
            .filter(|&t| t != index)
            .map(|t| (t as f32 - index as f32, t))
            .collect()
    }

    fn warps_at(&self, level: usize) -> usize {
        if level == 0 { self.finest_warps } else { self.warps }
    }

    fn settings(&self) -> Result<Settings> {
        self.check()?;
        let gabor = GaborParameters {
            tuning_frequency: 0.25,
            bandwidth_octaves: 1.6,
            orientations: 4,
            support: 2.2,
        };
        Ok(Settings {
            bank: GaborBank::new(&gabor)?,
            tau: self.tau,
            amplitude_fraction: self.amplitude_fraction,
            amplitude_floor: self.amplitude_floor,
            residual: self.residual_scale as f32,
            alpha: self.smoothness as f32,
            edges: EdgeRule {
                sensitivity: self.edge_sensitivity,
                sigma: 0.7,
                strongest_channel: self.strongest_channel,
            },
            passes: self.passes,
            sweeps: self.sweeps,
            median_radius: self.median_radius,
            guide_sigma: self.guide_sigma as f32,
        })
    }
}

/// The flow at another size, motions with it; of no flow, no motion.
fn enlarge(
    flow: &FlowField<f32>,
    size: (usize, usize),
    control: &Control,
) -> Result<FlowField<f32>> {
    let (height, width) = flow.dim();
    if (height, width) == size {
        return Ok(flow.clone());
    }
    if height * width == 0 {
        return Ok(FlowField { u: Array2::zeros(size), v: Array2::zeros(size) });
    }
    let larger = |component: &Array2<f32>, to: usize, from: usize| -> Result<Array2<f32>> {
        let resampled = resample(component.view(), size, Resampling::Linear, control)?;
        Ok(resampled * (to as f32 / from as f32))
    };
    Ok(FlowField { u: larger(&flow.u, size.1, width)?, v: larger(&flow.v, size.0, height)? })
}
