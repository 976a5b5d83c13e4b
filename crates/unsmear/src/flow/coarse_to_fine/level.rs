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

use ndarray::{Array2, Zip};

use super::choice::{Explanation, Mismatch, mismatch};
use super::evidence::add_coherence;
use super::guide::{EdgeRule, edge_weights, median_guide};
use super::phase_constraint::{TERMS, Weighting, constrain};
use super::still::{Rest, look_for_rest};
use crate::border::Border;
use crate::control::Control;
use crate::error::Result;
use crate::flow_field::{FlowField, FlowView};
use crate::gabor::{GaborBank, Responses};
use crate::interpolate::{SplineDegree, SplineImage};

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

    /// What rests between the reference and the frame nearest to it; see [`super::still`].
    pub(super) fn look_for_rest(&self, control: &Control) -> Result<Option<Rest>> {
        if !self.settings.still {
            return Ok(None);
        }
        let zero = Array2::zeros((self.height, self.width));
        let at_rest = FlowField { u: zero.clone(), v: zero };
        let near = self.others.iter().find(|target| target.frame.offset == 1.0);
        let Some(target) = near else { return Ok(None) };
        let (responses, visible) = self.look(target, &at_rest, control)?;
        let (pair, bank) = ([&self.reference, &responses], &self.settings.bank);
        let mut constraints = self.no_constraints();
        constrain(bank, pair, &visible, 1.0, self.weighting, &mut constraints, control)?;
        let (floor, k0) = (self.weighting.floor, wavenumber(bank));
        look_for_rest(pair, &constraints, floor, k0, self.zoom, control).map(Some)
    }

    /// How badly `flow` explains the only other frame; see [`super::choice`].
    pub(super) fn mismatch(&self, flow: &FlowField<f32>, control: &Control) -> Result<Mismatch> {
        let mut constraints = self.no_constraints();
        let (responses, visible) = self.look(&self.others[0], flow, control)?;
        let (pair, bank) = ([&self.reference, &responses], &self.settings.bank);
        let (out, offset) = (&mut constraints, self.others[0].frame.offset);
        constrain(bank, pair, &visible, offset, self.weighting, out, control)?;
        let seen = Explanation {
            responses: pair,
            visible: &visible,
            constraints: out,
            floor: self.weighting.floor,
            scale: self.scale(),
            residual: self.settings.residual,
        };
        mismatch(&seen, control)
    }

    /// Room for the constraints of one frame, (H, N, 4, W).
    pub(super) fn no_constraints(&self) -> Vec<f32> {
        vec![0.0; self.settings.bank.wavevectors().len() * TERMS * self.height * self.width]
    }

    /// Factor of the sums over constraints: a trace of about 1 where all count fully.
    pub(super) fn scale(&self) -> f32 {
        let terms = self.settings.bank.wavevectors().len() * self.others.len();
        (1.0 / (wavenumber(&self.settings.bank).powi(2) * terms as f64)) as f32
    }

    /// Responses to a frame warped by `flow`, and the weights of its pixels.
    pub(super) fn look(
        &self,
        target: &Target<'_>,
        flow: &FlowField<f32>,
        control: &Control,
    ) -> Result<(Responses<f32>, Vec<f32>)> {
        let Frame { offset, picture, ref coverage } = *target.frame;
        let along = FlowField { u: &flow.u * offset, v: &flow.v * offset };
        let mut warped = target.image.warp(along.view(), control)?;
        // The spline passes through the samples but for rounding, which would show as motion of frames at rest.
        Zip::from(&mut warped).and(picture).and(&along.u).and(&along.v).for_each(
            |w, &p, &u, &v| {
                if u == 0.0 && v == 0.0 {
                    *w = p;
                }
            },
        );
        let mut visible = visible(along.view(), coverage.as_ref());
        if let Some(coverage) = self.coverage {
            visible.iter_mut().zip(coverage).for_each(|(seen, c)| *seen *= c);
        }
        let responses = self.settings.bank.respond(warped.view(), Border::Reflect, control)?;
        Ok((responses, visible))
    }

    /// Mean coherence of the frames at `flow`; see [`super::evidence`].
    pub(super) fn coherence(
        &self,
        flow: &FlowField<f32>,
        control: &Control,
    ) -> Result<Array2<f32>> {
        let mut sum = Array2::zeros(flow.dim());
        let share = 1.0 / self.others.len() as f32;
        for target in &self.others {
            let (responses, visible) = self.look(target, flow, control)?;
            let floor = self.weighting.floor;
            add_coherence(&self.reference, &responses, &visible, floor, share, &mut sum);
        }
        Ok(sum)
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
    let mut sum = 0.0;
    for (y, filter) in (0..height).flat_map(|y| (0..filters).map(move |j| (y, j))) {
        let (re, im) = responses.row(filter, y);
        let row: f32 = re.iter().zip(im).map(|(re, im)| re * re + im * im).sum();
        sum += f64::from(row);
    }
    sum / (filters * height * width) as f64
}

/// 0 where the flow ends outside the picture, else the frame's coverage there (1 without).
fn visible(flow: FlowView<'_, f32>, coverage: Option<&Array2<f32>>) -> Vec<f32> {
    let (height, width) = flow.dim();
    let (right, bottom) = ((width - 1) as f32, (height - 1) as f32);
    let mut out = Vec::with_capacity(height * width);
    for (y, (row_u, row_v)) in flow.u.rows().into_iter().zip(flow.v.rows()).enumerate() {
        for (x, (u, v)) in row_u.iter().zip(row_v).enumerate() {
            let (to_x, to_y) = (x as f32 + u, y as f32 + v);
            let inside = (0.0..=right).contains(&to_x) && (0.0..=bottom).contains(&to_y);
            out.push(match coverage {
                _ if !inside => 0.0,
                Some(weights) => weights[(to_y.round() as usize, to_x.round() as usize)],
                None => 1.0,
            });
        }
    }
    out
}
