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

use ndarray::{Array2, ArrayView2, ArrayView3, Axis, Zip};

use crate::array::{require_frames, require_same};
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
mod evidence;
mod guide;
mod known;
mod parameters;
mod phase_constraint;
mod refine;
mod rows;

pub use parameters::CoarseToFine;

use contrast::Contrast;
use evidence::{LEAST_EVIDENCE, confidence, gather};
use guide::EdgeRule;
use known::{coverage, fill};
use refine::{Frame, Level, Settings};

/// Ratio of sizes up to which a level is evidence of motion at a pixel; coarser ones tell of its surroundings.
const FARTHEST_EVIDENCE: usize = 8;
/// Confidence of a flow that is known and deserves none.
const LEAST_CONFIDENCE: f32 = 1e-6;

/// What a flow is measured from.
#[derive(Debug, Clone, Copy)]
pub struct Sequence<'a> {
    /// Grey frames (T, H, W), any scale; not finite = unknown.
    pub frames: ArrayView3<'a, f64>,
    /// The reference frame.
    pub index: usize,
    /// Channels (C, H, W) of the reference frame, in the scale of the frames; without them the frame guides itself.
    pub guide: Option<ArrayView3<'a, f64>>,
    /// Pixels of every frame that may be used (H, W); without it, all.
    pub mask: Option<ArrayView2<'a, bool>>,
}

/// A frame at all levels, finest first.
struct FramePyramid {
    offset: f32,
    pictures: Vec<Array2<f32>>,
    /// Share of the known; none when all is known.
    known: Option<Vec<Array2<f32>>>,
}

impl CoarseToFine {
    /// Flow and confidence at the reference frame.
    ///
    /// # Errors
    /// [`Error::Shape`] below (2, 1, 1) samples or for a guide of another size, [`Error::Value`] for a parameter out
    /// of range or an index without a next frame, [`Error::Cancelled`].
    pub fn estimate(&self, sequence: &Sequence<'_>, control: &Control) -> Result<Estimate<f32>> {
        let settings = self.settings()?;
        let (count, height, width) = sequence.check()?;
        let sizes = level_sizes((height, width), self.pyramid_factor, self.coarsest_side);
        let contrast = Contrast::measure(sequence.frames);
        let plan = Plan { sequence, contrast, sizes: &sizes, factor: self.pyramid_factor };
        if contrast.is_blank() {
            let confidence = Array2::zeros((height, width));
            return Ok(Estimate { flow: FlowField::unknown((height, width)), confidence });
        }
        let reference = plan.frame(0.0, sequence.index, control)?;
        let others = self
            .offsets(sequence.index, count)
            .into_iter()
            .map(|(offset, t)| plan.frame(offset, t, control))
            .collect::<Result<Vec<_>>>()?;
        let channels = plan.channels(&reference, control)?;
        let finest = self.finest_level.min(sizes.len() - 1);
        control.expect((finest..sizes.len()).map(|level| self.warps_at(level)).sum());
        let mut flow = FlowField { u: Array2::zeros((0, 0)), v: Array2::zeros((0, 0)) };
        let (mut evidence, mut trust) = (None, Array2::zeros((0, 0)));
        for level in (finest..sizes.len()).rev() {
            flow = enlarge(&flow, sizes[level], control)?;
            let sigma = settings.bank.sigma();
            let at_level = |frame| FramePyramid::at(frame, level, sigma, control);
            let here = at_level(&reference)?;
            let others = others.iter().map(at_level).collect::<Result<Vec<_>>>()?;
            let prepared = Level::new(&settings, &here, &channels[level], &others, control)?;
            let refined = prepared.refine(flow, self.warps_at(level), control)?;
            flow = refined.flow;
            if sizes[0].0 <= FARTHEST_EVIDENCE * sizes[level].0 {
                evidence = Some(gather(evidence, &refined.trace, control)?);
            }
            if level == finest {
                let coherence = prepared.coherence(&flow, control)?;
                trust = confidence(&coherence, &flow, control)?;
            }
        }
        let mut flow = enlarge(&flow, sizes[0], control)?;
        let mut trust = resample(trust.view(), sizes[0], Resampling::Linear, control)?;
        let evidence = match evidence {
            Some(evidence) => resample(evidence.view(), sizes[0], Resampling::Linear, control)?,
            None => Array2::ones(sizes[0]),
        };
        silence(&evidence, &mut flow, &mut trust);
        Ok(Estimate { flow, confidence: trust })
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

impl Sequence<'_> {
    /// (T, H, W).
    fn check(&self) -> Result<(usize, usize, usize)> {
        require_frames("frames", &self.frames, [2, 1, 1])?;
        let (count, height, width) = self.frames.dim();
        if self.index + 1 >= count {
            return Err(Error::value("index", format!("in 0..={}", count - 2), self.index));
        }
        if let Some(guide) = self.guide
            && (guide.is_empty() || guide.shape()[1..] != [height, width])
        {
            return Err(Error::shape("guide", format!("(C, {height}, {width})"), guide.shape()));
        }
        if let Some(mask) = self.mask {
            require_same("mask", &mask, (height, width))?;
        }
        Ok((count, height, width))
    }
}

/// How frames become pyramids.
struct Plan<'a, 's> {
    sequence: &'a Sequence<'s>,
    contrast: Contrast,
    sizes: &'a [(usize, usize)],
    factor: f64,
}

impl Plan<'_, '_> {
    fn frame(&self, offset: f32, t: usize, control: &Control) -> Result<FramePyramid> {
        let mut picture = self.contrast.apply(self.sequence.frames.index_axis(Axis(0), t));
        if let Some(mask) = self.sequence.mask {
            picture.zip_mut_with(&mask, |s, &keep| *s = if keep { *s } else { f32::NAN });
        }
        let known = fill(&mut picture, control)?;
        let levels = |picture| pyramid(picture, self.sizes, self.factor, control);
        Ok(FramePyramid {
            offset,
            pictures: levels(picture)?,
            known: known.map(levels).transpose()?,
        })
    }

    /// The channels of the guide at each level: the reference itself where there is no guide.
    fn channels(
        &self,
        reference: &FramePyramid,
        control: &Control,
    ) -> Result<Vec<Vec<Array2<f32>>>> {
        let Some(guide) = self.sequence.guide else {
            return Ok(reference.pictures.iter().map(|p| vec![p.clone()]).collect());
        };
        let mut levels = vec![Vec::new(); self.sizes.len()];
        for mut channel in self.contrast.channels(guide) {
            fill(&mut channel, control)?;
            for (level, picture) in
                levels.iter_mut().zip(pyramid(channel, self.sizes, self.factor, control)?)
            {
                level.push(picture);
            }
        }
        Ok(levels)
    }
}

impl FramePyramid {
    /// The frame at one level, `sigma` px the deviation of the filters' window.
    fn at(&self, level: usize, sigma: f64, control: &Control) -> Result<Frame<'_>> {
        let weights = |known: &Vec<Array2<f32>>| coverage(known[level].view(), sigma, control);
        Ok(Frame {
            offset: self.offset,
            picture: &self.pictures[level],
            coverage: self.known.as_ref().map(weights).transpose()?,
        })
    }
}

/// Makes the flow unknown, and its confidence 0, where there is no evidence; else confidence is positive.
fn silence(evidence: &Array2<f32>, flow: &mut FlowField<f32>, trust: &mut Array2<f32>) {
    Zip::from(evidence).and(&mut flow.u).and(&mut flow.v).and(trust).for_each(|&e, u, v, c| {
        if e >= LEAST_EVIDENCE {
            *c = c.clamp(LEAST_CONFIDENCE, 1.0);
        } else {
            (*u, *v, *c) = (f32::NAN, f32::NAN, 0.0);
        }
    });
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
