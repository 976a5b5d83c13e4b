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
//! Where phase proves precise the data count more (see [`super::precision`]).
//!
//! Reference: T. Brox, A. Bruhn, N. Papenberg, J. Weickert 2004 (doi 10.1007/978-3-540-24673-2_3)
//! for warping with lagged weights; D. Sun, S. Roth, M. J. Black 2014 (doi
//! 10.1007/s11263-013-0644-x) for the medians.

use multiversion::multiversion;
use ndarray::Array2;

use super::boundary::boundaries;
use super::data_term::{NormalEquations, Reweighting, accumulate};
use super::diffusivity::diffusivities;
use super::level::{Level, Settings, Sight};
use super::precision::precision;
use super::rows::for_each_rows;
use crate::control::Control;
use crate::error::Result;
use crate::flow_field::FlowField;
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

/// Sums side by side within a row.
const LANES: usize = 16;

/// What a level adds: the flow, and the data terms of its last warp.
pub(super) struct Refined {
    pub(super) flow: FlowField<f32>,
    /// The data terms, raised by precision.
    pub(super) equations: NormalEquations,
    /// Their trace before it was raised, without the pull to rest.
    pub(super) trace: Array2<f32>,
    /// Mean change of the flow by each warp, px of the level.
    pub(super) changes: Vec<f64>,
}

impl Level<'_> {
    /// The flow after `warps` warps from `flow`, pulled towards rest by `springs`.
    ///
    /// `sights` are memory, one for each other frame.
    pub(super) fn refine(
        &self,
        mut flow: FlowField<f32>,
        warps: usize,
        springs: Option<Array2<f32>>,
        sights: &mut [Sight],
        control: &Control,
    ) -> Result<Refined> {
        let mut work = Work::new(self);
        if let Some(springs) = springs {
            work.springs = springs.into_raw_vec_and_offset().0;
        }
        let mut changes = Vec::with_capacity(warps);
        for _ in 0..warps {
            for (target, sight) in self.others.iter().zip(&mut *sights) {
                self.constrain(target, &flow, sight, control)?;
            }
            changes.push(self.minimise(&mut flow, sights, &mut work, control)?);
            control.advance()?;
        }
        let Work { equations, springs, gain, .. } = work;
        let mut trace = Array2::zeros((self.height, self.width));
        let plane = trace.as_slice_mut().unwrap_or_default();
        for_each_rows([plane], [self.width], control, |y, [trace]| {
            let row = y * self.width..(y + 1) * self.width;
            let [a11, a22, gain, springs] =
                [&equations.a11, &equations.a22, &gain, &springs].map(|p| &p[row.clone()]);
            for (x, trace) in trace.iter_mut().enumerate() {
                *trace = (a11[x] + a22[x]) / gain[x] - 2.0 * springs[x];
            }
        })?;
        Ok(Refined { flow: self.sharpen(flow, control)?, equations, trace, changes })
    }

    /// Moves `flow` to the minimum of the energy within reach of one warp; returns the mean change, px.
    fn minimise(
        &self,
        flow: &mut FlowField<f32>,
        sights: &[Sight],
        work: &mut Work,
        control: &Control,
    ) -> Result<f64> {
        let Settings { residual, alpha, passes, sweeps, .. } = *self.settings;
        let scale = self.scale();
        let [start_u, start_v] =
            [&mut flow.u, &mut flow.v].map(|c| c.as_slice_mut().unwrap_or_default());
        let (mut u, mut v) = (start_u.to_vec(), start_v.to_vec());
        let constraints: Vec<&[f32]> = sights.iter().map(|sight| &sight.constraints[..]).collect();
        let edges = [&self.edges[0][..], &self.edges[1][..]];
        if self.settings.precision > 0.0 {
            let gain = &mut work.gain;
            precision(&constraints, self.width, self.settings.precision, scale, gain, control)?;
        }
        for _ in 0..passes {
            accumulate(
                &constraints,
                [&u, &v],
                [start_u, start_v],
                self.width,
                Reweighting { residual, scale },
                &mut work.equations,
                control,
            )?;
            weigh(work, self.width, control)?;
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
        let mut sums = vec![0.0; self.height];
        let planes = [&mut u[..], &mut v[..], &mut sums[..]];
        for_each_rows(planes, [self.width, self.width, 1], control, |y, [u, v, sum]| {
            let row = y * self.width..(y + 1) * self.width;
            sum[0] = limit(u, &start_u[row.clone()]) + limit(v, &start_v[row]);
        })?;
        median_5x5(&u, self.height, self.width, start_u, control)?;
        median_5x5(&v, self.height, self.width, start_v, control)?;
        let change: f64 = sums.iter().map(|&sum| f64::from(sum)).sum();
        Ok(change / (self.height * self.width) as f64)
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
    equations: NormalEquations,
    /// Pull towards rest, added to the diagonal; see [`super::still`].
    springs: Vec<f32>,
    /// Factor of the data; see [`super::precision`].
    gain: Vec<f32>,
    gx: Vec<f32>,
    gy: Vec<f32>,
    sor: SorScratch,
}

impl Work {
    fn new(level: &Level<'_>) -> Self {
        let samples = level.height * level.width;
        Self {
            equations: NormalEquations::zeros(samples),
            springs: vec![0.0; samples],
            gain: vec![1.0; samples],
            gx: vec![0.0; samples],
            gy: vec![0.0; samples],
            sor: SorScratch::default(),
        }
    }
}

/// Limits the increments of a row from `old` to `new`; returns the sum of their sizes, px.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn limit(new: &mut [f32], old: &[f32]) -> f32 {
    let mut sums = [0.0; LANES];
    for (new, old) in new.chunks_mut(LANES).zip(old.chunks(LANES)) {
        for lane in 0..new.len() {
            let increment = (new[lane] - old[lane]).clamp(-LARGEST_INCREMENT, LARGEST_INCREMENT);
            sums[lane] += increment.abs();
            new[lane] = old[lane] + increment;
        }
    }
    sums.iter().sum()
}

/// Adds the springs, which act on the matrix alone as their rest is 0, and multiplies all by the gain.
fn weigh(work: &mut Work, width: usize, control: &Control) -> Result<()> {
    let Work { equations: NormalEquations { a11, a12, a22, c1, c2 }, springs, gain, .. } = work;
    let planes = [&mut a11[..], &mut a12[..], &mut a22[..], &mut c1[..], &mut c2[..]];
    for_each_rows(planes, [width; 5], control, |y, rows| {
        let row = y * width..(y + 1) * width;
        let (springs, gain) = (&springs[row.clone()], &gain[row]);
        let [a11, a12, a22, c1, c2] = rows;
        for diagonal in [a11, a22] {
            let terms = diagonal.iter_mut().zip(springs).zip(gain);
            terms.for_each(|((a, spring), g)| *a = (*a + spring) * g);
        }
        for plane in [a12, c1, c2] {
            plane.iter_mut().zip(gain).for_each(|(term, g)| *term *= g);
        }
    })
}
