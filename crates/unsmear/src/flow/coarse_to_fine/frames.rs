//! The frames of a sequence as the method wants them: standardised, filled, at all levels.

use ndarray::{Array2, ArrayView2, ArrayView4, Axis};

use super::contrast::Contrast;
use super::known::{coverage, fill};
use super::level::Frame;
use super::lighting::Light;
use super::recorded::{Reading, Sample};
use super::relight::{luma, relight};
use crate::array::require_same;
use crate::control::Control;
use crate::error::{Error, Result};
use crate::pyramid::pyramid;

/// What a flow is measured from.
#[derive(Debug, Clone, Copy)]
pub struct Sequence<'a, T> {
    /// Frames (T, H, W, C), grey (C = 1) or red, green and blue (C = 3), any scale; not finite = unknown.
    pub frames: ArrayView4<'a, T>,
    /// The reference frame.
    pub index: usize,
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

impl<T> Sequence<'_, T> {
    /// (T, H, W).
    pub(super) fn check(&self) -> Result<(usize, usize, usize)> {
        let (count, height, width, channels) = self.frames.dim();
        if count < 2 || height == 0 || width == 0 || !matches!(channels, 1 | 3) {
            let least = "(T >= 2, H >= 1, W >= 1, C = 1 or 3)";
            return Err(Error::shape("frames", least, self.frames.shape()));
        }
        if self.index + 1 >= count {
            return Err(Error::value("index", format!("in 0..={}", count - 2), self.index));
        }
        if let Some(mask) = self.mask {
            require_same("mask", &mask, (height, width))?;
        }
        Ok((count, height, width))
    }
}

/// How frames become pyramids.
pub(super) struct Plan<'a, 's, T> {
    pub(super) sequence: &'a Sequence<'s, T>,
    pub(super) contrast: Contrast,
    pub(super) sizes: &'a [(usize, usize)],
    pub(super) factor: f64,
}

impl<T: Sample> Plan<'_, '_, T> {
    /// The reference frame.
    pub(super) fn reference(&self, control: &Control) -> Result<FramePyramid> {
        let (picture, known) = self.read(self.sequence.index, Reading::Grey, control)?;
        self.levels(0.0, picture, known, control)
    }

    /// The frames at these offsets and indices, in the light of the reference, which loses what they cannot show.
    pub(super) fn others(
        &self,
        reference: &mut FramePyramid,
        offsets: Vec<(f32, usize)>,
        control: &Control,
    ) -> Result<Vec<FramePyramid>> {
        let light = Light::measure(&reference.pictures[0], control)?;
        let mut seen = None;
        let mut others = Vec::with_capacity(offsets.len());
        for (offset, t) in offsets {
            let (mut picture, known) = self.read(t, Reading::Grey, control)?;
            let change = light.change(&Light::measure(&picture, control)?);
            if change > 0.0 {
                let seen = match &mut seen {
                    Some(planes) => planes,
                    none => none.insert(self.planes(self.sequence.index, control)?),
                };
                let mut given = self.planes(t, control)?;
                picture = relight(seen, &mut given, change, control)?;
            }
            others.push(self.levels(offset, picture, known, control)?);
        }
        if let Some(planes) = seen {
            let picture = luma(&planes, control)?;
            reference.pictures = pyramid(picture, self.sizes, self.factor, control)?;
        }
        Ok(others)
    }

    /// The channels of a frame, each as [`Plan::read`].
    fn planes(&self, t: usize, control: &Control) -> Result<Vec<Array2<f32>>> {
        let channels = 0..self.sequence.frames.len_of(Axis(3));
        channels.map(|c| Ok(self.read(t, Reading::Channel(c), control)?.0)).collect()
    }

    /// A frame standardised and filled, and the map of the known unless all is known.
    fn read(
        &self,
        t: usize,
        reading: Reading,
        control: &Control,
    ) -> Result<(Array2<f32>, Option<Array2<f32>>)> {
        let frame = self.sequence.frames.index_axis(Axis(0), t);
        let (mut picture, mut unknown) = self.contrast.apply(frame, reading, control)?;
        if let Some(mask) = self.sequence.mask {
            picture.zip_mut_with(&mask, |s, &keep| *s = if keep { *s } else { f32::NAN });
            unknown = true;
        }
        let known = if unknown { fill(&mut picture, control)? } else { None };
        Ok((picture, known))
    }

    fn levels(
        &self,
        offset: f32,
        picture: Array2<f32>,
        known: Option<Array2<f32>>,
        control: &Control,
    ) -> Result<FramePyramid> {
        let levels = |picture| pyramid(picture, self.sizes, self.factor, control);
        Ok(FramePyramid {
            offset,
            pictures: levels(picture)?,
            known: known.map(levels).transpose()?,
        })
    }

    /// The channels of the guide at each level: those of a colour frame, of a grey one itself.
    pub(super) fn channels(
        &self,
        reference: &FramePyramid,
        colour: bool,
        control: &Control,
    ) -> Result<Vec<Vec<Array2<f32>>>> {
        let frame = self.sequence.frames.index_axis(Axis(0), self.sequence.index);
        let channels = frame.len_of(Axis(2));
        if channels == 1 || !colour {
            return Ok(reference.pictures.iter().map(|p| vec![p.clone()]).collect());
        }
        let mut levels = vec![Vec::new(); self.sizes.len()];
        for channel in 0..channels {
            let (mut picture, unknown) =
                self.contrast.apply(frame, Reading::Channel(channel), control)?;
            if unknown {
                fill(&mut picture, control)?;
            }
            for (level, picture) in
                levels.iter_mut().zip(pyramid(picture, self.sizes, self.factor, control)?)
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
