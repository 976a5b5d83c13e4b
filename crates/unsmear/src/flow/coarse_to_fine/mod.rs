//! Coarse-to-fine phase-based flow: the default method.
//!
//! From the coarsest level of a pyramid to the finest, the flow found so far is enlarged and refined
//! by warping (`refine`). At every level one bank of four Gabor filters of wavelength 4 px and 1.6
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

use multiversion::multiversion;
use ndarray::{Array2, s};

use crate::awake::awake;
use crate::control::Control;
use crate::error::Result;
use crate::flow::Estimate;
use crate::flow_field::FlowField;
use crate::gabor::{GaborBank, GaborParameters};
use crate::pyramid::{Resampling, level_sizes, resample};

mod arctangent;
mod boundary;
mod choice;
mod confidence;
mod constraints;
mod contrast;
mod data_term;
mod diffusivity;
mod evidence;
mod exponential;
mod frames;
mod guide;
mod known;
mod level;
mod lighting;
mod look;
mod noise_rule;
mod parameters;
mod phase_constraint;
mod precision;
mod recorded;
mod refine;
mod relight;
mod response_pair;
mod round_trip;
mod rows;
mod schedule;
mod slope;
mod still;
mod visible;

pub use frames::Sequence;
pub use parameters::CoarseToFine;
pub use recorded::Sample;
pub use schedule::LevelTrace;

use choice::{merge, several_hold};
use contrast::Contrast;
use evidence::LEAST_EVIDENCE;
use frames::{FramePyramid, Plan};
use guide::EdgeRule;
use level::Settings;
use noise_rule::adapt;
use parameters::FOR_TWO_FRAMES;
use round_trip::check_round_trip;
use rows::for_each_rows;
use schedule::{Climb, Summit, enlarge};

/// Confidence of a flow that is known and deserves none.
const LEAST_CONFIDENCE: f32 = 1e-6;

impl CoarseToFine {
    /// Flow and confidence at the reference frame.
    ///
    /// # Errors
    /// [`Error::Shape`](crate::Error::Shape) below (2, 1, 1, 1) samples or for other than 1 or 3 channels,
    /// [`Error::Value`](crate::Error::Value) for a parameter out of range or an index without a next frame,
    /// [`Error::Cancelled`](crate::Error::Cancelled).
    pub fn estimate<T: Sample>(
        &self,
        sequence: &Sequence<'_, T>,
        control: &Control,
    ) -> Result<Estimate<f32>> {
        self.trace(sequence, control).map(|(estimate, _)| estimate)
    }

    /// Like [`CoarseToFine::estimate`], with what happened at each level, coarsest first.
    ///
    /// # Errors
    /// As [`CoarseToFine::estimate`].
    pub fn trace<T: Sample>(
        &self,
        sequence: &Sequence<'_, T>,
        control: &Control,
    ) -> Result<(Estimate<f32>, Vec<LevelTrace>)> {
        let (count, height, width) = sequence.check()?;
        self.check()?;
        let reversed = Sequence {
            frames: sequence.frames.slice_move(s![..;-1, .., .., ..]),
            index: count - 2 - sequence.index,
            ..*sequence
        };
        let ways = [*sequence, reversed];
        let ways = &ways[..=usize::from(self.forward_backward)];
        control.expect(ways.iter().map(|way| self.steps(way, (height, width))).sum());
        // From the first row read on; each level calls those who have fallen asleep.
        awake(|| {
            let (mut estimate, levels) = self.one_way(sequence, true, control)?;
            for way in &ways[1..] {
                let (back, _) = self.one_way(way, false, control)?;
                check_round_trip(&mut estimate, &back.flow, control)?;
            }
            Ok((estimate, levels))
        })
    }

    /// Number of warps, the unit of progress.
    fn steps<T: Sample>(&self, sequence: &Sequence<'_, T>, size: (usize, usize)) -> usize {
        let sizes = level_sizes(size, self.pyramid_factor, self.coarsest_side);
        let finest = self.finest_level.min(sizes.len() - 1);
        let others = self.offsets(sequence.index, sequence.frames.dim().0).len();
        let climbs = 1 + usize::from(self.choose_frames && others > 1);
        climbs * (finest..sizes.len()).map(|level| self.warps_at(level, finest)).sum::<usize>()
    }

    /// The flow of the frames in the order given; `colour` lets edges of single channels break it.
    fn one_way<T: Sample>(
        &self,
        sequence: &Sequence<'_, T>,
        colour: bool,
        control: &Control,
    ) -> Result<(Estimate<f32>, Vec<LevelTrace>)> {
        let mut settings = self.settings()?;
        let (count, height, width, _) = sequence.frames.dim();
        let sizes = level_sizes((height, width), self.pyramid_factor, self.coarsest_side);
        let contrast = Contrast::measure(sequence.frames, control)?;
        if contrast.is_blank() {
            let confidence = Array2::zeros((height, width));
            let flow = FlowField::unknown((height, width));
            return Ok((Estimate { flow, confidence }, Vec::new()));
        }
        let plan = Plan { sequence, contrast, sizes: &sizes, factor: self.pyramid_factor };
        let mut reference = plan.reference(control)?;
        let offsets = self.offsets(sequence.index, count);
        let others = plan.others(&mut reference, offsets, control)?;
        let channels = plan.channels(&reference, colour, control)?;
        if self.adapt_to_noise {
            let picture = reference.pictures[0].as_slice().unwrap_or_default();
            adapt(&mut settings, picture, (height, width), control)?;
        }
        let finest = self.finest_level.min(sizes.len() - 1);
        let warps: Vec<usize> =
            (0..sizes.len()).map(|level| self.warps_at(level, finest)).collect();
        let climb = Climb {
            settings: &settings,
            sizes: &sizes,
            warps: &warps,
            finest,
            reference: &reference,
            channels: &channels,
        };
        let others: Vec<&FramePyramid> = others.iter().collect();
        let summit = if self.choose_frames {
            choose(&climb, &others, control)?
        } else {
            climb.run(&others, control)?
        };
        Ok((descend(&summit, (height, width), control)?, summit.levels))
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

    /// Warps at a level of which `finest` is the last that is solved.
    fn warps_at(&self, level: usize, finest: usize) -> usize {
        if level == finest { self.finest_warps } else { self.warps }
    }

    fn settings(&self) -> Result<Settings> {
        let gabor = GaborParameters {
            tuning_frequency: 0.25,
            bandwidth_octaves: 1.6,
            orientations: 4,
            support: 2.2,
        };
        Ok(Settings {
            bank: GaborBank::new(&gabor)?,
            still: self.static_evidence,
            tau: self.tau,
            amplitude_fraction: self.amplitude_fraction,
            amplitude_floor: self.amplitude_floor,
            residual: self.residual_scale as f32,
            precision: self.precision_scale as f32,
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

/// The flow of all frames where motion is constant over them, else that of the reference and the next.
fn choose(climb: &Climb<'_>, others: &[&FramePyramid], control: &Control) -> Result<Summit> {
    let next: Vec<&FramePyramid> =
        others.iter().copied().filter(|frame| frame.offset == 1.0).collect();
    let [smoothness, edges, residual] = FOR_TWO_FRAMES;
    let mut settings = climb.settings.clone();
    settings.alpha *= smoothness as f32;
    settings.edges.sensitivity *= edges;
    settings.residual *= residual as f32;
    let of_two = Climb { settings: &settings, ..*climb };
    if others.len() == next.len() {
        return of_two.run(&next, control);
    }
    let two = of_two.run(&next, control)?;
    let several = climb.run(others, control)?;
    let hold = climb.at(climb.finest, &next, control, |level| {
        let [two, several] = [&two, &several].map(|s| level.mismatch(&s.flow, control));
        Ok(several_hold(&two?, &several?))
    })?;
    let (flow, confidence) =
        merge(&hold, (two.flow, two.confidence), (several.flow, several.confidence));
    let levels = [two.levels, several.levels].concat();
    Ok(Summit { flow, confidence, evidence: several.evidence, levels })
}

/// The result at the size of the frames: unknown, with confidence 0, where there is no evidence.
fn descend(summit: &Summit, size: (usize, usize), control: &Control) -> Result<Estimate<f32>> {
    let larger = |plane: &Array2<f32>| resample(plane.view(), size, Resampling::Linear, control);
    let mut flow = enlarge(&summit.flow, size, control)?;
    let mut confidence = larger(&summit.confidence)?;
    let evidence = larger(&summit.evidence)?;
    let planes = [&mut flow.u, &mut flow.v, &mut confidence]
        .map(|plane| plane.as_slice_mut().unwrap_or_default());
    let evidence = evidence.as_slice().unwrap_or_default();
    for_each_rows(planes, [size.1; 3], control, |y, [u, v, c]| {
        keep_known(&evidence[y * size.1..(y + 1) * size.1], u, v, c);
    })?;
    Ok(Estimate { flow, confidence })
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn keep_known(evidence: &[f32], u: &mut [f32], v: &mut [f32], confidence: &mut [f32]) {
    let n = evidence.len();
    let (u, v, confidence) = (&mut u[..n], &mut v[..n], &mut confidence[..n]);
    for x in 0..n {
        let known = evidence[x] >= LEAST_EVIDENCE;
        u[x] = if known { u[x] } else { f32::NAN };
        v[x] = if known { v[x] } else { f32::NAN };
        confidence[x] = if known { confidence[x].clamp(LEAST_CONFIDENCE, 1.0) } else { 0.0 };
    }
}
