//! The frames of a sequence as the method wants them: standardised, filled, at all levels.

use ndarray::{Array2, ArrayView2, ArrayView3, Axis};

use super::contrast::Contrast;
use super::known::{coverage, fill};
use super::refine::Frame;
use crate::array::{require_frames, require_same};
use crate::control::Control;
use crate::error::{Error, Result};
use crate::pyramid::pyramid;

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
pub(super) struct FramePyramid {
    /// Frames after the reference.
    pub(super) offset: f32,
    pub(super) pictures: Vec<Array2<f32>>,
    /// Share of the known; none when all is known.
    known: Option<Vec<Array2<f32>>>,
}

impl Sequence<'_> {
    /// (T, H, W).
    pub(super) fn check(&self) -> Result<(usize, usize, usize)> {
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
pub(super) struct Plan<'a, 's> {
    pub(super) sequence: &'a Sequence<'s>,
    pub(super) contrast: Contrast,
    pub(super) sizes: &'a [(usize, usize)],
    pub(super) factor: f64,
}

impl Plan<'_, '_> {
    pub(super) fn frame(&self, offset: f32, t: usize, control: &Control) -> Result<FramePyramid> {
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
    pub(super) fn channels(
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
    pub(super) fn at(&self, level: usize, sigma: f64, control: &Control) -> Result<Frame<'_>> {
        let weights = |known: &Vec<Array2<f32>>| coverage(known[level].view(), sigma, control);
        Ok(Frame {
            offset: self.offset,
            picture: &self.pictures[level],
            coverage: self.known.as_ref().map(weights).transpose()?,
        })
    }
}
