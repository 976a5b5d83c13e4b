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

use ndarray::{Array2, Zip};

use super::boundary::boundaries;
use super::choice::{Explanation, Mismatch, mismatch};
use super::data_term::{NormalEquations, Reweighting, accumulate};
use super::diffusivity::diffusivities;
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
struct Target<'a> {
    frame: &'a Frame<'a>,
    image: SplineImage<f32>,
}

/// One level: the reference frame with what is computed from it once.
pub(super) struct Level<'a> {
    settings: &'a Settings,
    /// Ratio of the frames' size to the level's.
    pub(super) zoom: f32,
    height: usize,
    width: usize,
    reference: Responses<f32>,
    weighting: Weighting,
    edges: [Vec<f32>; 2],
    guide: Vec<Array2<f32>>,
    coverage: Option<&'a Array2<f32>>,
    others: Vec<Target<'a>>,
}

/// What a level adds: the flow, and the trace of its data term.
pub(super) struct Refined {
    pub(super) flow: FlowField<f32>,
    pub(super) trace: Array2<f32>,
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

    /// The flow after `warps` warps from `flow`, pulled towards rest by `springs`.
    pub(super) fn refine(
        &self,
        mut flow: FlowField<f32>,
        warps: usize,
        springs: Option<Array2<f32>>,
        control: &Control,
    ) -> Result<Refined> {
        let mut work = Work::new(self);
        if let Some(springs) = springs {
            work.springs = springs.into_raw_vec_and_offset().0;
        }
        for _ in 0..warps {
            for (target, out) in self.others.iter().zip(&mut work.constraints) {
                let (responses, visible) = self.look(target, &flow, control)?;
                let pair = [&self.reference, &responses];
                let (bank, offset) = (&self.settings.bank, target.frame.offset);
                constrain(bank, pair, &visible, offset, self.weighting, out, control)?;
            }
            self.minimise(&mut flow, &mut work, control)?;
            control.advance()?;
        }
        let Work { equations: NormalEquations { a11, a22, .. }, .. } = work;
        let trace = Array2::from_shape_fn((self.height, self.width), |(y, x)| {
            let i = y * self.width + x;
            a11[i] + a22[i]
        });
        Ok(Refined { flow: self.sharpen(flow, control)?, trace })
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
        let mut constraints = Work::new(self).constraints.swap_remove(0);
        constrain(bank, pair, &visible, 1.0, self.weighting, &mut constraints, control)?;
        let (floor, k0) = (self.weighting.floor, wavenumber(bank));
        look_for_rest(pair, &constraints, floor, k0, self.zoom, control).map(Some)
    }

    /// How badly `flow` explains the only other frame; see [`super::choice`].
    pub(super) fn mismatch(&self, flow: &FlowField<f32>, control: &Control) -> Result<Mismatch> {
        let mut work = Work::new(self);
        let (responses, visible) = self.look(&self.others[0], flow, control)?;
        let (pair, bank) = ([&self.reference, &responses], &self.settings.bank);
        let (out, offset) = (&mut work.constraints[0], self.others[0].frame.offset);
        constrain(bank, pair, &visible, offset, self.weighting, out, control)?;
        let seen = Explanation {
            responses: pair,
            visible: &visible,
            constraints: out,
            floor: self.weighting.floor,
            scale: self.scale(),
        };
        mismatch(&seen, control)
    }

    /// Factor of the sums over constraints: a trace of about 1 where all count fully.
    fn scale(&self) -> f32 {
        let terms = self.settings.bank.wavevectors().len() * self.others.len();
        (1.0 / (wavenumber(&self.settings.bank).powi(2) * terms as f64)) as f32
    }

    /// Responses to a frame warped by `flow`, and the weights of its pixels.
    fn look(
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

    /// The minimum of the energy near `flow`, within reach of one warp.
    fn minimise(
        &self,
        flow: &mut FlowField<f32>,
        work: &mut Work,
        control: &Control,
    ) -> Result<()> {
        let Settings { residual, alpha, passes, sweeps, .. } = *self.settings;
        let scale = self.scale();
        let [start_u, start_v] =
            [&mut flow.u, &mut flow.v].map(|c| c.as_slice_mut().unwrap_or_default());
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
            add_springs(&work.springs, &mut work.equations);
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
    /// Pull towards rest, added to the diagonal; see [`super::still`].
    springs: Vec<f32>,
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
            springs: vec![0.0; samples],
            gx: vec![0.0; samples],
            gy: vec![0.0; samples],
            sor: SorScratch::default(),
        }
    }
}

/// `k0`, rad/px.
fn wavenumber(bank: &GaborBank<f32>) -> f64 {
    let [kx, ky] = bank.wavevectors()[0];
    kx.hypot(ky)
}

/// Springs to zero motion: they add to the matrix and, their rest being 0, nothing to the right-hand side.
fn add_springs(springs: &[f32], equations: &mut NormalEquations) {
    for diagonal in [&mut equations.a11, &mut equations.a22] {
        diagonal.iter_mut().zip(springs).for_each(|(a, s)| *a += s);
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
