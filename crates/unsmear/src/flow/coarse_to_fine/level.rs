//! One level of the pyramid: what is computed once from the reference frame, and the looks it takes at other frames.
//!
//! A *look* warps a frame by a flow, filters it, and weighs its pixels: 0 where the flow ends outside
//! the picture, less than 1 near unknown pixels of either frame (see [`super::known`]). The amplitude
//! floor of the level's constraints is
//!
//! ```text
//! r = fraction rms(a_0) + floor      grey levels, over pixels and filters of the reference
//! ```
//!
//! The warped picture is filtered, not the responses warped: the phase of a response turns with the
//! flow's gradient, and only so do both frames see the same neighbourhood.

use multiversion::multiversion;
use ndarray::Array2;
use rayon::prelude::*;

use super::choice::{Explanation, Mismatch, mismatch};
use super::confidence::add_coherence;
use super::guide::{EdgeRule, edge_weights, median_guide};
use super::phase_constraint::{TERMS, Weighting, constrain};
use super::still::{Rest, look_for_rest};
use super::visible::{keep_what_rests, see};
use crate::border::Border;
use crate::control::Control;
use crate::error::Result;
use crate::flow_field::FlowField;
use crate::gabor::{GaborBank, Responses};
use crate::interpolate::{SplineDegree, SplineImage};

/// Sums side by side within a line.
const LANES: usize = 16;

/// What the refinement depends on, the same at every level.
#[derive(Debug, Clone)]
pub(super) struct Settings {
    pub(super) bank: GaborBank<f32>,
    /// Whether to look for what rests.
    pub(super) still: bool,
    pub(super) tau: f64,
    pub(super) amplitude_fraction: f64,
    pub(super) amplitude_floor: f64,
    pub(super) residual: f32,
    pub(super) precision: f32,
    pub(super) alpha: f32,
    pub(super) edges: EdgeRule,
    pub(super) passes: usize,
    pub(super) sweeps: usize,
    pub(super) median_radius: usize,
    pub(super) guide_sigma: f32,
}

/// A frame at one level.
pub(super) struct Frame<'a> {
    /// Frames after the reference.
    pub(super) offset: f32,
    pub(super) picture: &'a Array2<f32>,
    /// Weights of its pixels; none when all of them are known.
    pub(super) coverage: Option<Array2<f32>>,
}

/// A frame ready to be warped.
pub(super) struct Target<'a> {
    pub(super) frame: &'a Frame<'a>,
    image: SplineImage<f32>,
}

/// One level: the reference frame with what is computed from it once.
pub(super) struct Level<'a> {
    pub(super) settings: &'a Settings,
    /// Ratio of the frames' size to the level's.
    pub(super) zoom: f32,
    pub(super) height: usize,
    pub(super) width: usize,
    pub(super) reference: Responses<f32>,
    pub(super) weighting: Weighting,
    pub(super) edges: [Vec<f32>; 2],
    pub(super) guide: Vec<Array2<f32>>,
    coverage: Option<&'a Array2<f32>>,
    pub(super) others: Vec<Target<'a>>,
}

/// What a look sees, and the memory it needs; reused from look to look.
pub(super) struct Sight {
    /// Responses to the warped frame.
    pub(super) responses: Responses<f32>,
    /// Weights of its pixels, (H, W).
    pub(super) visible: Vec<f32>,
    /// Constraints, (H, N, 4, W), where they were asked for.
    pub(super) constraints: Vec<f32>,
    scratch: Vec<f32>,
}

impl<'a> Level<'a> {
    /// Prepares a level from the reference frame, its guide channels and the other frames.
    pub(super) fn new(
        settings: &'a Settings,
        zoom: f32,
        reference: &'a Frame<'a>,
        channels: &[Array2<f32>],
        others: &'a [Frame<'a>],
        control: &Control,
    ) -> Result<Self> {
        let picture = reference.picture.view();
        let (height, width) = picture.dim();
        let responses = settings.bank.respond(picture, Border::Reflect, control)?;
        let floor =
            settings.amplitude_fraction * mean_power(&responses).sqrt() + settings.amplitude_floor;
        let spline = |frame: &'a Frame<'a>| {
            let view = frame.picture.view();
            let image = SplineImage::new(&view, SplineDegree::Cubic, Border::Reflect, control)?;
            Ok(Target { frame, image })
        };
        Ok(Self {
            settings,
            zoom,
            height,
            width,
            reference: responses,
            weighting: Weighting {
                floor: (floor * floor) as f32,
                narrowness: (settings.bank.sigma() / settings.tau).powi(2) as f32,
            },
            edges: edge_weights(channels, settings.edges, control)?,
            guide: median_guide(channels, control)?,
            coverage: reference.coverage.as_ref(),
            others: others.iter().map(spline).collect::<Result<_>>()?,
        })
    }

    /// Memory for looks at this level.
    pub(super) fn sight(&self) -> Sight {
        let filters = self.settings.bank.wavevectors().len();
        Sight {
            responses: Responses::zeros(filters, self.height, self.width),
            visible: vec![0.0; self.height * self.width],
            constraints: vec![0.0; filters * TERMS * self.height * self.width],
            scratch: Vec::new(),
        }
    }

    /// Warps a frame by `flow`, filters it and weighs its pixels.
    pub(super) fn look(
        &self,
        target: &Target<'_>,
        flow: &FlowField<f32>,
        sight: &mut Sight,
        control: &Control,
    ) -> Result<()> {
        let Frame { offset, picture, ref coverage } = *target.frame;
        let scaled;
        let along = if offset == 1.0 {
            flow
        } else {
            scaled = FlowField { u: &flow.u * offset, v: &flow.v * offset };
            &scaled
        };
        let mut warped = target.image.warp(along.view(), control)?;
        keep_what_rests(&mut warped, picture, along, control)?;
        see(along, coverage.as_ref(), &mut sight.visible, control)?;
        if let Some(coverage) = self.coverage {
            sight.visible.iter_mut().zip(coverage).for_each(|(seen, c)| *seen *= c);
        }
        self.settings.bank.respond_into(
            warped.view(),
            Border::Reflect,
            &mut sight.responses,
            &mut sight.scratch,
            control,
        )
    }

    /// Looks at a frame and constrains the increment of `flow`.
    pub(super) fn constrain(
        &self,
        target: &Target<'_>,
        flow: &FlowField<f32>,
        sight: &mut Sight,
        control: &Control,
    ) -> Result<()> {
        self.look(target, flow, sight, control)?;
        let (bank, offset) = (&self.settings.bank, target.frame.offset);
        let Sight { responses, visible, constraints, .. } = sight;
        let pair = [&self.reference, &*responses];
        constrain(bank, pair, visible, offset, self.weighting, constraints, control)
    }

    /// What rests between the reference and the next frame; see [`super::still`].
    pub(super) fn look_for_rest(
        &self,
        sight: &mut Sight,
        control: &Control,
    ) -> Result<Option<Rest>> {
        let next = self.others.iter().find(|target| target.frame.offset == 1.0);
        let Some(target) = next.filter(|_| self.settings.still) else { return Ok(None) };
        let zero = Array2::zeros((self.height, self.width));
        self.constrain(target, &FlowField { u: zero.clone(), v: zero }, sight, control)?;
        let pair = [&self.reference, &sight.responses];
        let (floor, k0) = (self.weighting.floor, wavenumber(&self.settings.bank));
        look_for_rest(pair, &sight.constraints, floor, k0, self.zoom, control).map(Some)
    }

    /// How badly `flow` explains the only other frame; see [`super::choice`].
    pub(super) fn mismatch(&self, flow: &FlowField<f32>, control: &Control) -> Result<Mismatch> {
        let mut sight = self.sight();
        self.constrain(&self.others[0], flow, &mut sight, control)?;
        let seen = Explanation {
            responses: [&self.reference, &sight.responses],
            visible: &sight.visible,
            constraints: &sight.constraints,
            floor: self.weighting.floor,
            scale: self.scale(),
            residual: self.settings.residual,
        };
        mismatch(&seen, control)
    }

    /// Mean coherence of the frames at `flow`; see [`super::confidence`].
    pub(super) fn coherence(
        &self,
        flow: &FlowField<f32>,
        sight: &mut Sight,
        control: &Control,
    ) -> Result<Array2<f32>> {
        let mut sum = Array2::zeros(flow.dim());
        let share = 1.0 / self.others.len() as f32;
        for target in &self.others {
            self.look(target, flow, sight, control)?;
            let floor = self.weighting.floor;
            let pair = [&self.reference, &sight.responses];
            add_coherence(pair, &sight.visible, floor, share, &mut sum, control)?;
        }
        Ok(sum)
    }

    /// Factor of the sums over constraints: a trace of about 1 where all count fully.
    pub(super) fn scale(&self) -> f32 {
        let terms = self.settings.bank.wavevectors().len() * self.others.len();
        (1.0 / (wavenumber(&self.settings.bank).powi(2) * terms as f64)) as f32
    }
}

/// `k0`, rad/px.
fn wavenumber(bank: &GaborBank<f32>) -> f64 {
    let [kx, ky] = bank.wavevectors()[0];
    kx.hypot(ky)
}

/// Mean of the squared amplitude over pixels and filters.
fn mean_power(responses: &Responses<f32>) -> f64 {
    let (filters, height, width) = responses.dim();
    let row = |y: usize| -> f64 {
        let of_filter = |j: usize| {
            let (re, im) = responses.row(j, y);
            f64::from(power(re, im))
        };
        (0..filters).map(of_filter).sum()
    };
    let mut rows = vec![0.0; height];
    rows.par_iter_mut().with_min_len(64).enumerate().for_each(|(y, sum)| *sum = row(y));
    rows.iter().sum::<f64>() / (filters * height * width) as f64
}

/// Sum of squares of two lines, in lanes.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn power(re: &[f32], im: &[f32]) -> f32 {
    let mut sums = [0.0; LANES];
    for line in [re, im] {
        let (blocks, rest) = line.as_chunks::<LANES>();
        for block in blocks {
            for lane in 0..LANES {
                sums[lane] += block[lane] * block[lane];
            }
        }
        rest.iter().zip(&mut sums).for_each(|(s, sum)| *sum += s * s);
    }
    sums.iter().sum()
}
