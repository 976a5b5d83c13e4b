//! From the coarsest level to the finest: who refines what, how often.
//!
//! ```text
//! U <- 0;  for each level, coarsest first:  U <- enlarge(U);  U <- refine(U)
//! ```
//!
//! `enlarge` interpolates linearly and multiplies the motion by the ratio of sizes. The evidence of
//! the levels is gathered on the way, confidence measured at the end.

use ndarray::Array2;

use super::confidence::{Clues, confidence};
use super::evidence::gather;
use super::frames::FramePyramid;
use super::level::{Level, Settings};
use super::refine::Workspace;
use super::still::spring;
use crate::awake::awake;
use crate::control::Control;
use crate::error::Result;
use crate::flow_field::FlowField;
use crate::pyramid::{Resampling, resample};

/// Ratio of sizes up to which a level is evidence of motion at a pixel; coarser ones tell of its surroundings.
const FARTHEST_EVIDENCE: usize = 8;

/// Sums side by side.
const LANES: usize = 16;

/// Everything that a climb needs.
pub(super) struct Climb<'a> {
    pub(super) settings: &'a Settings,
    pub(super) sizes: &'a [(usize, usize)],
    /// Warps at each level that is solved, finest first; their number ends the climb.
    pub(super) warps: &'a [usize],
    pub(super) finest: usize,
    pub(super) reference: &'a FramePyramid,
    /// Channels of the guide at each level.
    pub(super) channels: &'a [Vec<Array2<f32>>],
}

/// What happened at one level, to see where a flow went wrong.
#[derive(Debug, Clone, PartialEq)]
pub struct LevelTrace {
    /// Frames used besides the reference.
    pub frames: usize,
    /// Size of the level, px.
    pub size: (usize, usize),
    /// Mean change of `|u| + |v|` by each warp, px of the level: falling, where warping converges.
    pub changes: Vec<f64>,
    /// Mean trace of the data term: 1 where every filter has its say, 0 where none has.
    pub evidence: f64,
    /// Mean pull towards rest.
    pub rest: f64,
}

/// The result at the finest level that was solved.
pub(super) struct Summit {
    pub(super) flow: FlowField<f32>,
    pub(super) confidence: Array2<f32>,
    pub(super) evidence: Array2<f32>,
    /// Coarsest level first.
    pub(super) levels: Vec<LevelTrace>,
}

impl Climb<'_> {
    /// The flow between the reference and `others`.
    ///
    /// # Errors
    /// [`Error::Cancelled`](crate::Error::Cancelled).
    pub(super) fn run(&self, others: &[&FramePyramid], control: &Control) -> Result<Summit> {
        let mut flow = FlowField { u: Array2::zeros((0, 0)), v: Array2::zeros((0, 0)) };
        let (mut evidence, mut trust) = (None, None);
        let (mut resting, mut levels) = (Vec::new(), Vec::new());
        let filters = self.settings.bank.wavevectors().len();
        let mut workspace = Workspace::new(others.len(), filters, self.sizes[self.finest]);
        for (level, &size) in self.sizes.iter().enumerate().skip(self.finest).rev() {
            // Not the enlarged flow but the small one is kept for the comparison at the end.
            let coarser = flow;
            let start = enlarge(&coarser, size, control)?;
            workspace.finest = level == self.finest;
            flow = self.at(level, others, control, |prepared| {
                let mut pull = 0.0;
                let mut springs = None;
                if let Some(rest) = prepared.look_for_rest(control)? {
                    let spring = spring(&rest, prepared.zoom, &resting, control)?;
                    pull = mean(&spring);
                    springs = Some(spring);
                    if level > self.finest {
                        resting.push((prepared.zoom, rest.rest));
                    }
                }
                let refined =
                    prepared.refine(start, self.warps[level], springs, &mut workspace, control)?;
                levels.push(LevelTrace {
                    frames: others.len(),
                    size,
                    changes: refined.changes,
                    evidence: mean(&refined.trace),
                    rest: pull,
                });
                if level == self.finest || self.sizes[0].0 <= FARTHEST_EVIDENCE * size.0 {
                    evidence = Some(gather(evidence.take(), &refined.trace, control)?);
                }
                if level == self.finest {
                    let coherence = prepared.coherence(&refined.flow, control)?;
                    let coarser = if level + 1 < self.sizes.len() {
                        Some(enlarge(&coarser, size, control)?)
                    } else {
                        None
                    };
                    let clues = Clues {
                        coherence: &coherence,
                        flow: &refined.flow,
                        coarser: coarser.as_ref(),
                        zoom: prepared.zoom,
                        matrix: refined.matrix.each_ref().map(|plane| &plane[..]),
                    };
                    trust = Some(confidence(&clues, control)?);
                }
                Ok(refined.flow)
            })?;
        }
        let nothing = || Array2::zeros(flow.dim());
        let (confidence, evidence) =
            (trust.unwrap_or_else(nothing), evidence.unwrap_or_else(nothing));
        Ok(Summit { flow, confidence, evidence, levels })
    }

    /// Prepares a level and hands it to `work`, all threads awake.
    pub(super) fn at<R>(
        &self,
        level: usize,
        others: &[&FramePyramid],
        control: &Control,
        work: impl FnOnce(&Level<'_>) -> Result<R>,
    ) -> Result<R> {
        awake(|| {
            let sigma = self.settings.bank.sigma();
            let here = self.reference.at(level, sigma, control)?;
            let others = others
                .iter()
                .map(|frame| frame.at(level, sigma, control))
                .collect::<Result<Vec<_>>>()?;
            let zoom = self.sizes[0].1 as f32 / self.sizes[level].1 as f32;
            work(&Level::new(self.settings, zoom, &here, &self.channels[level], &others, control)?)
        })
    }
}

fn mean(plane: &Array2<f32>) -> f64 {
    let (blocks, rest) = plane.as_slice().unwrap_or_default().as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for block in blocks {
        sums.iter_mut().zip(block).for_each(|(sum, &s)| *sum += f64::from(s));
    }
    let rest: f64 = rest.iter().map(|&s| f64::from(s)).sum();
    (sums.iter().sum::<f64>() + rest) / plane.len() as f64
}

/// The flow at another size, motions with it; of no flow, no motion.
pub(super) fn enlarge(
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
        // Before they are many.
        let scaled = component * (to as f32 / from as f32);
        resample(scaled.view(), size, Resampling::Linear, control)
    };
    Ok(FlowField { u: larger(&flow.u, size.1, width)?, v: larger(&flow.v, size.0, height)? })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motion_grows_with_the_picture() {
        let control = Control::new();
        let [u, v] = [1.0, -2.0].map(|motion| Array2::from_elem((4, 6), motion));
        let large = enlarge(&FlowField { u, v }, (8, 18), &control).unwrap();
        assert!(large.u.iter().all(|&u| u == 3.0) && large.v.iter().all(|&v| v == -4.0));
        let nothing = FlowField { u: Array2::zeros((0, 0)), v: Array2::zeros((0, 0)) };
        assert_eq!(enlarge(&nothing, (2, 3), &control).unwrap().u, Array2::<f32>::zeros((2, 3)));
    }
}
