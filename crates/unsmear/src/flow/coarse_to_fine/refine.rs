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
use super::constraints::Constraints;
use super::data_term::{DataTerm, Reweighting};
use super::diffusivity::diffusivities;
use super::guide::median_guide;
use super::level::{Level, Settings};
use super::precision::precision;
use super::rows::{Planes, for_each_band, for_each_rows, row_of};
use crate::array::FEWEST_ROWS;
use crate::control::Control;
use crate::error::Result;
use crate::flow_field::FlowField;
use crate::median::median_5x5;
use crate::sor::{SorScratch, SystemRows, solve_rows};
use crate::tasks::{copied, filled, filled_picture};
use crate::weighted_median::{WeightedMedian, weighted_median};

/// Largest change of a flow component by one warp, px: below half the wavelength of 4 px.
const LARGEST_INCREMENT: f32 = 1.5;
/// Over-relaxation: 10 sweeps at 1.9 come as near as 40 at 1.6.
const RELAXATION: f32 = 1.9;
/// Change of flow per px beyond which the weighted median is at work.
const BOUNDARY: f32 = 0.1;
/// Spatial deviation of the weighted median, in radii.
const MEDIAN_SPREAD: f32 = 0.8;
/// Samples handled together: a register of 512 bits.
const LANES: usize = 16;

/// What a level adds: the flow, and the data terms of its last warp at the solution of the equations.
pub(super) struct Refined {
    pub(super) flow: FlowField<f32>,
    /// `a11, a12, a22` of the data terms, raised by precision, (H, W) each.
    pub(super) matrix: [Vec<f32>; 3],
    /// Their trace before it was raised, without the pull to rest.
    pub(super) trace: Array2<f32>,
    /// Mean change of the flow by each warp, px of the level.
    pub(super) changes: Vec<f64>,
}

/// Data and smoothness, linear around a flow, row by row.
struct Linearised<'a> {
    data: &'a DataTerm<'a>,
    edges: Planes<'a>,
    alpha: f32,
}

impl SystemRows for Linearised<'_> {
    fn data(&self, y: usize, flow: Planes<'_>, out: [&mut [f32]; 5]) {
        self.data.equations(y, flow, out);
    }

    fn diffusivities(&self, y: usize, flow: Planes<'_>, out: [&mut [f32]; 2]) {
        diffusivities(y, flow, self.edges, self.alpha, out);
    }
}

/// The largest pieces of memory of a refinement, kept from level to level: the finest needs them in full, and what the
/// coarser ones take is part of that.
pub(super) struct Workspace {
    /// Of each other frame.
    constraints: Vec<Constraints>,
    sor: SorScratch,
    /// Whether no level follows: then each piece is given back as soon as it has served.
    pub(super) finest: bool,
}

impl Workspace {
    /// For a number of other frames, by a number of filters, of up to `size` (H, W).
    pub(super) fn new(frames: usize, filters: usize, size: (usize, usize)) -> Self {
        let constraints = || Constraints::with_room(filters, size.0 * size.1);
        Self {
            constraints: (0..frames).map(|_| constraints()).collect(),
            sor: SorScratch::with_room(size.0, size.1),
            finest: false,
        }
    }
}

/// What acts on the data of one level besides the constraints.
struct Weights {
    /// Pull towards rest; see [`super::still`].
    springs: Vec<f32>,
    /// Factor of the data; see [`super::precision`].
    gain: Vec<f32>,
}

impl Level<'_> {
    /// The flow after `warps` warps from `flow`, pulled towards rest by `springs`.
    pub(super) fn refine(
        &self,
        mut flow: FlowField<f32>,
        warps: usize,
        springs: Option<Array2<f32>>,
        workspace: &mut Workspace,
        control: &Control,
    ) -> Result<Refined> {
        let samples = self.height * self.width;
        let mut weights = Weights {
            springs: springs
                .map_or_else(|| filled(0.0, samples), |s| s.into_raw_vec_and_offset().0),
            gain: filled(1.0, samples),
        };
        let mut changes = Vec::with_capacity(warps);
        let mut matrix = [(); 3].map(|()| Vec::new());
        for warp in 0..warps {
            for (target, constraints) in self.others.iter().zip(&mut workspace.constraints) {
                self.constrain(target, &flow, constraints, control)?;
            }
            let last = (warp + 1 == warps).then_some(&mut matrix);
            changes.push(self.minimise(&mut flow, workspace, &mut weights, last, control)?);
            control.advance()?;
        }
        if workspace.finest {
            workspace.constraints.clear();
        }
        let [a11, _, a22] = &matrix;
        let mut trace = filled_picture(0.0, (self.height, self.width));
        let plane = trace.as_slice_mut().unwrap_or_default();
        for_each_rows([plane], [self.width], control, |y, [trace]| {
            for (x, trace) in trace.iter_mut().enumerate() {
                let i = y * self.width + x;
                *trace = (a11[i] + a22[i]) / weights.gain[i] - 2.0 * weights.springs[i];
            }
        })?;
        drop(weights);
        Ok(Refined { flow: self.sharpen(flow, control)?, matrix, trace, changes })
    }

    /// Moves `flow` to the minimum of the energy within reach of one warp; returns the mean change, px.
    ///
    /// Where `matrix` is wanted it becomes that of the data terms.
    fn minimise(
        &self,
        flow: &mut FlowField<f32>,
        workspace: &mut Workspace,
        weights: &mut Weights,
        matrix: Option<&mut [Vec<f32>; 3]>,
        control: &Control,
    ) -> Result<f64> {
        let Settings { residual, alpha, passes, sweeps, .. } = *self.settings;
        let (scale, width) = (self.scale(), self.width);
        let [start_u, start_v] =
            [&mut flow.u, &mut flow.v].map(|c| c.as_slice_mut().unwrap_or_default());
        let Workspace { constraints, sor, finest } = workspace;
        let Weights { springs, gain } = weights;
        let frames: Vec<&Constraints> = constraints.iter().collect();
        if self.settings.precision > 0.0 {
            precision(&frames, width, self.settings.precision, scale, gain, control)?;
        }
        let (mut u, mut v) = (copied(start_u), copied(start_v));
        let data = DataTerm {
            frames,
            warped_with: [start_u, start_v],
            reweighting: Reweighting { residual, scale },
            springs,
            gain,
            width,
        };
        let edges = [&self.edges[0][..], &self.edges[1][..]];
        let (system, size) = (Linearised { data: &data, edges, alpha }, [self.height, width]);
        for _ in 0..passes {
            solve_rows(&system, size, &mut u, &mut v, RELAXATION, sweeps, sor, control)?;
        }
        if let Some(matrix) = matrix {
            if *finest {
                *sor = SorScratch::default();
            }
            *matrix = matrix_of(&data, [&u, &v], control)?;
        }
        let mut change = 0.0;
        for (component, start) in [(&mut u, start_u), (&mut v, start_v)] {
            change += clip(component, start, width, control)?;
            median_5x5(component, self.height, width, start, control)?;
        }
        Ok(change / (self.height * width) as f64)
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
        let guide = median_guide(self.channels, control)?;
        let guide: Vec<&[f32]> = guide.iter().map(|c| c.as_slice().unwrap_or_default()).collect();
        let [u_out, v_out] = [(); 2].map(|()| filled_picture(0.0, flow.dim()));
        let mut out = FlowField { u: u_out, v: v_out };
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

/// `a11, a12, a22` of the data terms at `flow`.
fn matrix_of(data: &DataTerm<'_>, flow: Planes<'_>, control: &Control) -> Result<[Vec<f32>; 3]> {
    let width = data.width;
    let mut matrix = [(); 3].map(|()| filled(0.0, flow[0].len()));
    let planes = matrix.each_mut().map(|plane| &mut plane[..]);
    for_each_band(planes, [width; 3], FEWEST_ROWS..=usize::MAX, control, |first, mut band| {
        let (mut c1, mut c2) = (vec![0.0; width], vec![0.0; width]);
        for i in 0..band[0].len() / width {
            control.check()?;
            let [a11, a12, a22] = row_of(&mut band, [width; 3], i);
            data.equations(first + i, flow, [a11, a12, a22, &mut c1, &mut c2]);
        }
        Ok(())
    })?;
    Ok(matrix)
}

/// Clips the change from `start` to [`LARGEST_INCREMENT`]; returns the sum of its size.
fn clip(component: &mut [f32], start: &[f32], width: usize, control: &Control) -> Result<f64> {
    let mut sums = vec![0.0f32; component.len() / width];
    for_each_rows([component, &mut sums], [width, 1], control, |y, [row, sum]| {
        sum[0] = clip_row(row, &start[y * width..(y + 1) * width]);
    })?;
    Ok(sums.iter().map(|&sum| f64::from(sum)).sum())
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn clip_row(row: &mut [f32], start: &[f32]) -> f32 {
    let mut sums = [0.0f32; LANES];
    let (blocks, rest) = row.as_chunks_mut::<LANES>();
    let (starts, start_rest) = start.as_chunks::<LANES>();
    for (block, start) in blocks.iter_mut().zip(starts) {
        for lane in 0..LANES {
            let increment = clipped(block[lane] - start[lane]);
            sums[lane] += increment.abs();
            block[lane] = start[lane] + increment;
        }
    }
    let mut sum = sums.iter().sum();
    for (new, old) in rest.iter_mut().zip(start_rest) {
        let increment = clipped(*new - old);
        sum += increment.abs();
        *new = old + increment;
    }
    sum
}

#[inline(always)]
fn clipped(increment: f32) -> f32 {
    let above = if increment < -LARGEST_INCREMENT { -LARGEST_INCREMENT } else { increment };
    if above > LARGEST_INCREMENT { LARGEST_INCREMENT } else { above }
}
