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

use super::choice::{Mismatch, Yardstick, mismatch};
use super::confidence::add_coherence;
use super::constraints::Constraints;
use super::guide::{EdgeRule, edge_weights};
use super::look::Look;
use super::phase_constraint::{Filters, Weighting};
use super::rows::for_each_band;
use super::still::{Rest, look_for_rest};
use super::visible::{keep_what_rests, see};
use crate::border::Border;
use crate::control::Control;
use crate::error::Result;
use crate::flow_field::FlowField;
use crate::gabor::GaborBank;
use crate::gabor::stream::{FEWEST_ROWS, ResponseRows};
use crate::interpolate::{SplineDegree, SplineImage};
use crate::tasks::{copied, filled, filled_picture};

/// Sums side by side: as many as a register of 512 bits holds.
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
    reference: &'a [f32],
    pub(super) weighting: Weighting,
    pub(super) edges: [Vec<f32>; 2],
    /// Channels of the guide.
    pub(super) channels: &'a [Array2<f32>],
    coverage: Option<&'a Array2<f32>>,
    pub(super) others: Vec<Target<'a>>,
}

impl<'a> Level<'a> {
    /// Prepares a level from the reference frame, its guide channels and the other frames.
    pub(super) fn new(
        settings: &'a Settings,
        zoom: f32,
        reference: &'a Frame<'a>,
        channels: &'a [Array2<f32>],
        others: &'a [Frame<'a>],
        control: &Control,
    ) -> Result<Self> {
        let (height, width) = reference.picture.dim();
        let picture = reference.picture.as_slice().unwrap_or_default();
        let power = mean_power(&settings.bank, picture, width, control)?;
        let floor = settings.amplitude_fraction * power.sqrt() + settings.amplitude_floor;
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
            reference: picture,
            weighting: Weighting {
                floor: (floor * floor) as f32,
                narrowness: (settings.bank.sigma() / settings.tau).powi(2) as f32,
            },
            edges: edge_weights(channels, settings.edges, control)?,
            channels,
            coverage: reference.coverage.as_ref(),
            others: others.iter().map(spline).collect::<Result<_>>()?,
        })
    }

    /// Warps a frame by `flow` and weighs its pixels.
    fn look(
        &self,
        target: &Target<'_>,
        flow: &FlowField<f32>,
        control: &Control,
    ) -> Result<Look<'_>> {
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
        let mut visible = filled(0.0, self.height * self.width);
        see(along, coverage.as_ref(), &mut visible, control)?;
        Ok(self.beside_the_reference(warped.into_raw_vec_and_offset().0, visible))
    }

    /// Looks at a frame as it is: what no flow would show.
    fn look_unmoved(&self, target: &Target<'_>) -> Look<'_> {
        let Frame { picture, ref coverage, .. } = *target.frame;
        let visible = coverage.as_ref().map_or_else(
            || filled(1.0, self.height * self.width),
            |coverage| copied(coverage.as_slice().unwrap_or_default()),
        );
        self.beside_the_reference(copied(picture.as_slice().unwrap_or_default()), visible)
    }

    /// A frame and the weights of its pixels, which count as far as the reference's own are known.
    fn beside_the_reference(&self, warped: Vec<f32>, mut visible: Vec<f32>) -> Look<'_> {
        if let Some(coverage) = self.coverage {
            visible.iter_mut().zip(coverage).for_each(|(seen, c)| *seen *= c);
        }
        Look {
            bank: &self.settings.bank,
            reference: self.reference,
            warped,
            visible,
            height: self.height,
            width: self.width,
        }
    }

    /// What the filters need for the frame at `offset`.
    fn filters(&self, offset: f32) -> Filters {
        Filters::new(&self.settings.bank, offset, self.weighting, self.height)
    }

    /// Looks at a frame and constrains the increment of `flow`.
    pub(super) fn constrain(
        &self,
        target: &Target<'_>,
        flow: &FlowField<f32>,
        constraints: &mut Constraints,
        control: &Control,
    ) -> Result<()> {
        let look = self.look(target, flow, control)?;
        constraints.fill(&look, &self.filters(target.frame.offset), control)
    }

    /// What rests between the reference and the next frame; see [`super::still`].
    pub(super) fn look_for_rest(&self, control: &Control) -> Result<Option<Rest>> {
        let next = self.others.iter().find(|target| target.frame.offset == 1.0);
        let Some(target) = next.filter(|_| self.settings.still) else { return Ok(None) };
        let look = self.look_unmoved(target);
        let (floor, k0) = (self.weighting.floor, wavenumber(&self.settings.bank));
        look_for_rest(&look, &self.filters(1.0), floor, k0, self.zoom, control).map(Some)
    }

    /// How badly `flow` explains the only other frame; see [`super::choice`].
    pub(super) fn mismatch(&self, flow: &FlowField<f32>, control: &Control) -> Result<Mismatch> {
        let target = &self.others[0];
        let look = self.look(target, flow, control)?;
        let yardstick = Yardstick {
            floor: self.weighting.floor,
            scale: self.scale(),
            residual: self.settings.residual,
        };
        mismatch(&look, &self.filters(target.frame.offset), yardstick, control)
    }

    /// Mean coherence of the frames at `flow`; see [`super::confidence`].
    pub(super) fn coherence(
        &self,
        flow: &FlowField<f32>,
        control: &Control,
    ) -> Result<Array2<f32>> {
        let mut sum = filled_picture(0.0, flow.dim());
        let share = 1.0 / self.others.len() as f32;
        for target in &self.others {
            let look = self.look(target, flow, control)?;
            add_coherence(&look, self.weighting.floor, share, &mut sum, control)?;
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
fn mean_power(
    bank: &GaborBank<f32>,
    picture: &[f32],
    width: usize,
    control: &Control,
) -> Result<f64> {
    let row = 2 * bank.wavevectors().len() * width;
    let mut sums = vec![0.0f32; picture.len() / width];
    for_each_band([&mut sums], [1], FEWEST_ROWS..=usize::MAX, control, |first, [sums]| {
        let mut rows = ResponseRows::new(bank, picture, width, Border::Reflect, first);
        let mut responses = vec![0.0; row];
        for (i, sum) in sums.iter_mut().enumerate() {
            control.check()?;
            rows.respond(first + i, &mut responses);
            *sum = sum_of_squares(&responses);
        }
        Ok(())
    })?;
    let total: f64 = sums.iter().map(|&sum| f64::from(sum)).sum();
    Ok(2.0 * total / (row * sums.len()) as f64)
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn sum_of_squares(samples: &[f32]) -> f32 {
    let (blocks, rest) = samples.as_chunks::<LANES>();
    let mut sums = [0.0f32; LANES];
    for block in blocks {
        for lane in 0..LANES {
            sums[lane] += block[lane] * block[lane];
        }
    }
    sums.iter().sum::<f32>() + rest.iter().map(|s| s * s).sum::<f32>()
}
