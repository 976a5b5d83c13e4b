//! Refinement of a flow at one scale: warp, constrain, solve, repeat.
//!
//! Each warp takes the frames to the reference by the present flow `U_0`, filters them again and
//! minimises, over the flow `U` (px/frame) at this scale,
//!
//! ```text
//! E(U) = s sum W r_s^2 log(1 + (G.(U - U_0) + D)^2/r_s^2)/2 + alpha sum e sqrt(|grad U|^2 + eps^2)
//! ```
//!
//! by `passes` rounds of lagged weights, each a linear system relaxed by `sweeps` sweeps (see
//! [`super::data_term`], [`super::diffusivity`], [`crate::sor`]). An increment is clipped to
//! [`LARGEST_INCREMENT`], within which phase does not wrap; a 5 x 5 median follows. After the last
//! warp a weighted median, guided by the picture, sharpens the motion boundaries.
//!
//! The warped picture is filtered, not the responses warped: the phase of a response turns with the
//! flow's gradient, and only so do both frames see the same neighbourhood.
//! Reference: T. Brox, A. Bruhn, N. Papenberg, J. Weickert 2004 (doi 10.1007/978-3-540-24673-2_3)
//! for warping with lagged weights; D. Sun, S. Roth, M. J. Black 2014 (doi
//! 10.1007/s11263-013-0644-x) for the medians.

use ndarray::Array2;

use super::boundary::boundaries;
use super::data_term::{NormalEquations, Reweighting, accumulate};
use super::diffusivity::diffusivities;
use super::guide::{EdgeRule, edge_weights, median_guide};
use super::phase_constraint::{TERMS, Weighting, constrain};
use crate::border::Border;
use crate::control::Control;
use crate::error::Result;
use crate::flow_field::{FlowField, FlowView};
use crate::gabor::{GaborBank, Responses};
use crate::interpolate::{SplineDegree, SplineImage};
use crate::median::median_5x5;
use crate::sor::{SorScratch, SorSystem, solve};
use crate::weighted_median::{WeightedMedian, weighted_median};

/// Largest change of a flow component by one warp, px: below half the wavelength of 4 px.
const LARGEST_INCREMENT: f32 = 1.5;
/// Over-relaxation: 10 sweeps at 1.9 come as near as 40 at 1.6.
const RELAXATION: f32 = 1.9;
/// Change of flow per px beyond which the weighted median is at work.
const BOUNDARY: f32 = 0.1;
/// Spatial deviation of the weighted median, in radii.
const MEDIAN_SPREAD: f32 = 0.8;

/// What the refinement depends on, the same at every level.
#[derive(Debug, Clone)]
pub(super) struct Settings {
    pub(super) bank: GaborBank<f32>,
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

/// A frame at one level, `offset` frames after the reference.
pub(super) struct OtherFrame<'a> {
    pub(super) offset: f32,
    pub(super) picture: &'a Array2<f32>,
}

/// One level: the reference frame with what is computed from it once.
pub(super) struct Level<'a> {
    settings: &'a Settings,
    height: usize,
    width: usize,
    reference: Responses<f32>,
    weighting: Weighting,
    edges: [Vec<f32>; 2],
    guide: Vec<Array2<f32>>,
    others: Vec<(f32, SplineImage<f32>)>,
}

impl<'a> Level<'a> {
    /// Prepares a level from the reference frame, its guide channels and the other frames.
    pub(super) fn new(
        settings: &'a Settings,
        reference: &Array2<f32>,
        channels: &[Array2<f32>],
        others: &[OtherFrame<'_>],
        control: &Control,
    ) -> Result<Self> {
        let (height, width) = reference.dim();
        let responses = settings.bank.respond(reference.view(), Border::Reflect, control)?;
        let floor = settings.amplitude_fraction * mean_power(&responses).sqrt()
            + settings.amplitude_floor;
        let sigma = settings.bank.sigma();
        let spline = |other: &OtherFrame<'_>| {
            let view = other.picture.view();
            let image = SplineImage::new(&view, SplineDegree::Cubic, Border::Reflect, control)?;
            Ok((other.offset, image))
        };
        Ok(Self {
            settings,
            height,
            width,
            reference: responses,
            weighting: Weighting {
                floor: (floor * floor) as f32,
                narrowness: (sigma / settings.tau).powi(2) as f32,
            },
            edges: edge_weights(channels, settings.edges, control)?,
            guide: median_guide(channels, control)?,
            others: others.iter().map(spline).collect::<Result<_>>()?,
        })
    }

    /// The flow after `warps` warps from `flow`.
    pub(super) fn refine(
        &self,
        mut flow: FlowField<f32>,
        warps: usize,
        control: &Control,
    ) -> Result<FlowField<f32>> {
        let mut work = Work::new(self);
        for _ in 0..warps {
            self.constrain(&flow, &mut work, control)?;
            self.minimise(&mut flow, &mut work, control)?;
            control.advance()?;
        }
        self.sharpen(flow, control)
    }

    /// Constraints of all frames, warped by `flow`.
    fn constrain(&self, flow: &FlowField<f32>, work: &mut Work, control: &Control) -> Result<()> {
        for ((offset, image), out) in self.others.iter().zip(&mut work.constraints) {
            let along = FlowField { u: &flow.u * *offset, v: &flow.v * *offset };
            let warped = image.warp(along.view(), control)?;
            let visible = visible(along.view());
            let responses = self.settings.bank.respond(warped.view(), Border::Reflect, control)?;
            let pair = [&self.reference, &responses];
            let bank = &self.settings.bank;
            constrain(bank, pair, &visible, *offset, self.weighting, out, control)?;
        }
        Ok(())
    }

    /// The minimum of the energy near `flow`, within reach of one warp.
    fn minimise(&self, flow: &mut FlowField<f32>, work: &mut Work, control: &Control) -> Result<()> {
        let Settings { residual, alpha, passes, sweeps, .. } = *self.settings;
        let k0_squared = self.settings.bank.wavevectors()[0].map(|k| k * k).iter().sum::<f64>();
        let terms = self.settings.bank.wavevectors().len() * self.others.len();
        let scale = (1.0 / (k0_squared * terms as f64)) as f32;
        let [start_u, start_v] = [&mut flow.u, &mut flow.v].map(|c| c.as_slice_mut().unwrap_or_default());
        let (mut u, mut v) = (start_u.to_vec(), start_v.to_vec());
        let edges = [&self.edges[0][..], &self.edges[1][..]];
        for _ in 0..passes {
            accumulate(
                &work.constraints,
                [&u, &v],
                [start_u, start_v],
                self.width,
                Reweighting { residual, scale },
                &mut work.equations,
                control,
            )?;
            let between = [&mut work.gx[..], &mut work.gy[..]];
            diffusivities([&u, &v], edges, alpha, between, self.width, control)?;
            let system = SorSystem {
                a11: &work.equations.a11,
                a12: &work.equations.a12,
                a22: &work.equations.a22,
                c1: &work.equations.c1,
                c2: &work.equations.c2,
                gx: &work.gx,
                gy: &work.gy,
                height: self.height,
                width: self.width,
            };
            solve(&system, &mut u, &mut v, RELAXATION, sweeps, &mut work.sor, control)?;
        }
        for (component, start) in [(&mut u, start_u), (&mut v, start_v)] {
            for (new, &old) in component.iter_mut().zip(&*start) {
                *new = old + (*new - old).clamp(-LARGEST_INCREMENT, LARGEST_INCREMENT);
            }
            median_5x5(component, self.height, self.width, start, control)?;
        }
        Ok(())
    }

    /// The weighted median at motion boundaries.
    fn sharpen(&self, flow: FlowField<f32>, control: &Control) -> Result<FlowField<f32>> {
        let radius = self.settings.median_radius;
        if radius == 0 {
            return Ok(flow);
        }
        let parameters = WeightedMedian {
            radius,
            spatial_sigma: MEDIAN_SPREAD * radius as f32,
            guide_sigma: self.settings.guide_sigma,
        };
        let [u, v] = [&flow.u, &flow.v].map(|c| c.as_slice().unwrap_or_default());
        let mask = boundaries([u, v], self.width, BOUNDARY, control)?;
        let guide: Vec<&[f32]> =
            self.guide.iter().map(|c| c.as_slice().unwrap_or_default()).collect();
        let mut out = FlowField { u: flow.u.clone(), v: flow.v.clone() };
        let (out_u, out_v) = (&mut out.u, &mut out.v);
        weighted_median(
            u,
            v,
            &guide,
            &mask,
            self.height,
            self.width,
            &parameters,
            out_u.as_slice_mut().unwrap_or_default(),
            out_v.as_slice_mut().unwrap_or_default(),
            control,
        )?;
        Ok(out)
    }
}

/// Memory of the refinement of one level.
struct Work {
    /// Constraints of each frame, (H, N, 4, W).
    constraints: Vec<Vec<f32>>,
    equations: NormalEquations,
    gx: Vec<f32>,
    gy: Vec<f32>,
    sor: SorScratch,
}

impl Work {
    fn new(level: &Level<'_>) -> Self {
        let samples = level.height * level.width;
        let per_frame = level.settings.bank.wavevectors().len() * TERMS * samples;
        Self {
            constraints: level.others.iter().map(|_| vec![0.0; per_frame]).collect(),
            equations: NormalEquations::zeros(samples),
            gx: vec![0.0; samples],
            gy: vec![0.0; samples],
            sor: SorScratch::default(),
        }
    }
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

/// 1 where the flow ends inside the picture, else 0.
fn visible(flow: FlowView<'_, f32>) -> Vec<f32> {
    let (height, width) = flow.dim();
    let (right, bottom) = ((width - 1) as f32, (height - 1) as f32);
    let mut out = Vec::with_capacity(height * width);
    for ((y, x), (&u, &v)) in ndarray::indices((height, width)).into_iter().zip(flow.u.iter().zip(flow.v)) {
        let inside = (0.0..=right).contains(&(x as f32 + u)) && (0.0..=bottom).contains(&(y as f32 + v));
        out.push(f32::from(u8::from(inside)));
    }
    out
}
