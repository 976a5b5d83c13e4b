//! How long the shutter was open, read from the blur itself.
//!
//! Flow v says how far things move in a frame interval; the share s of it during which light was gathered leaves
//! zeros in the spectrum of each part of a blurred picture, at waves with w . (s v) = 2 pi n. One s is sought for a
//! whole picture or clip:
//!
//! 1. tiles of 64 px (48 or 32 in small pictures, 32 or 24 for small movers, 128 for large motion) with one motion and enough
//!    contrast (`tile.rs`, `tile_choice.rs`);
//! 2. for each, Whittle's likelihood over a grid of s (`likelihood.rs`), least over twelve shapes of the scene's spectrum
//!    (`scene.rs`), with paths of constant acceleration (`path_spectrum.rs`); tiles whose blur at s is shorter than 2.4 px
//!    have no zero in the band and are left out, and those whose motion varies much (`search.rs`);
//! 3. the sum decides, on a finer grid around what the first leaves open; kinds of scene vote and tiles are resampled
//!    (`vote.rs`).
//!
//! s also takes up a common error of scale of the flow: what is found is the blur, s v; if asked, also how far the flow
//! points beside it (`direction.rs`). Trust: "ok" when 70 % of the plausible kinds agree, the spread is at most 0.06,
//! there are eight tiles at least and the optimum lies inside the range. Otherwise "unsure", s the median of the kinds'
//! optima, 1 at most, for blur assumed too short does little harm and blur assumed too long does much.
//! The range should reach down to shutters that hardly blur: among long blurs only, a sharp picture finds one that
//! fits it by chance. Blur too short for zeros, or for enough tiles to show them for sure where nearly nothing moves by
//! 3 px, is told roughly by how much it dims (`short_blur.rs`), which "small" says; without any tile s is 0.8.
//!
//! On photographs of known blur s comes out within 1 % at noise of 0 and 1 grey levels, within 5 % at 5.
//!
//! Validity: noise of known deviation, in the picture's units, white in the band; blur of 2.4 to 70 px, to 35 px in
//! pictures under 288 px, 26 px under 256; turns of up to some 15 degrees during the exposure; no strong sharpening (it
//! fills the zeros). Units: px, frames, rad/px.

mod direction;
mod frame;
mod likelihood;
mod path_spectrum;
mod random;
mod scene;
mod search;
mod short_blur;
mod tile;
mod tile_choice;
mod tile_likelihoods;
mod vote;
mod waves;

use self::direction::TurnSearch;
pub use self::frame::ExposureFrame;
use self::random::Random;
use self::search::{Evidence, Found, LEAST_BLUR, first_grid, search};
use self::short_blur::{ENOUGH_TILES, PRIOR, by_dimming};
use self::tile_choice::choose_tiles;
use crate::array::require_same;
use crate::control::Control;
use crate::error::{Error, Result, require};
use crate::noise::estimate_noise;
use crate::real::Real;

/// Searched beyond either end of the range, so that an optimum outside is seen to be outside.
const MARGIN: f64 = 1.17;

/// Steps of the grey scale of 8 bits, whose rounding is the least noise supposed.
const GREY_LEVELS: f64 = 255.0;

/// Least vote and greatest spread of an estimate to be relied on.
const TRUST: (f64, f64) = (0.7, 0.06);

/// Tiles below which an estimate is not relied on: a few, which show one thing, agree on the gaps of its own spectrum.
const LEAST_TILES: usize = 8;

/// Greatest s while unsure.
const MOST_UNSURE: f64 = 1.0;

/// Speed whose 95 % quantile below it explains that no tile tells anything, px/frame.
const SMALL: f64 = 3.0;

/// Mean speed of tiles below which a few of them tell zeros by chance, px/frame: not a fast thing before a still scene.
const SMALL_TILES: f64 = 4.0;

/// Parameters of the search; see the [module](self).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExposureSearch {
    /// Least and greatest share sought.
    pub range: (f64, f64),
    /// Deviation of the noise, >= 0, in the units of the pictures; None: measured. Never taken as less than what
    /// storing in 8 bits adds.
    pub noise: Option<f64>,
    /// Seed of the choice of tiles and of their resampling.
    pub seed: u64,
    /// Whether the flow may point beside the blur, by up to some 15 degrees: see `direction.rs`.
    pub turn: bool,
}

/// Whether an estimate can be relied on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ExposureStatus {
    /// Kinds of scene and tiles agree.
    Ok,
    /// They do not, or nothing could be measured.
    Unsure,
    /// Too little motion to tell for sure, and to matter much.
    Small,
}

/// What was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExposureEstimate {
    /// Share of the frame interval.
    pub value: f64,
    /// Angle by which the flow had to be turned, rad from right to down; 0 unless one is clear.
    pub turn: f64,
    /// Whether to rely on it.
    pub status: ExposureStatus,
    /// Share of the plausible kinds of scene that agree; NaN without tiles.
    pub vote: f64,
    /// Deviation of log s over resamplings; NaN without tiles.
    pub spread: f64,
    /// Tiles used.
    pub tiles: usize,
    /// What the likelihood alone says; NaN without tiles.
    pub likeliest: f64,
    /// Noise used, in the units of the pictures.
    pub noise: f64,
}

impl ExposureSearch {
    /// One share for all `frames`.
    ///
    /// # Errors
    /// [`Error::Value`] for no frames, a range or noise that is not positive; [`Error::Shape`] when shapes differ;
    /// [`Error::Cancelled`].
    pub fn estimate<T: Real>(
        &self,
        frames: &[ExposureFrame<'_, T>],
        control: &Control,
    ) -> Result<ExposureEstimate> {
        self.validate(frames)?;
        let mut random = Random::new(self.seed);
        let beyond = (self.range.0 / MARGIN, self.range.1 * MARGIN);
        let noise = self.noise_used(frames, control)?;
        let nothing = without_tiles(frames, noise);
        if noise == 0.0 {
            return Ok(nothing);
        }
        let small = nothing.status == ExposureStatus::Small;
        let mut turn = 0.0;
        let mut ask = |slowest: f64| -> Result<(usize, Option<Evidence>)> {
            let chosen = choose_tiles(frames, noise, slowest, &mut random, control)?;
            let Some((waves, mut tiles)) = chosen else { return Ok((0, None)) };
            if self.turn {
                let log_scales = &first_grid(beyond);
                let search = TurnSearch { tiles: &tiles, waves: &waves, log_scales, noise };
                turn = search.find(&mut random, control)?;
                if turn != 0.0 {
                    tiles = tiles.iter().map(|tile| tile.turned(turn)).collect();
                }
            }
            let mut found = search(&tiles, &waves, beyond, noise, &mut random, control)?;
            if let Evidence::Zeros(zeros) = &found
                && small
                && zeros.speed < SMALL_TILES
                && !(self.trusts(zeros) && zeros.tiles >= ENOUGH_TILES)
            {
                let share = by_dimming(&tiles, &waves, &first_grid(beyond), noise, control)?;
                found = Evidence::Dimming(share);
            }
            Ok((tiles.len(), Some(found)))
        };
        let mut answer = ask(LEAST_BLUR / beyond.1)?;
        if answer.0 < ENOUGH_TILES && !matches!(answer.1, Some(Evidence::Zeros(_))) {
            answer = ask(short_blur::SLOWEST)?;
        }
        let estimate = match answer {
            (_, Some(Evidence::Zeros(found))) => self.of_zeros(&found, noise),
            (tiles, Some(Evidence::Dimming(share))) if small => {
                let value = share.max(self.range.0);
                ExposureEstimate { value, tiles, ..nothing }
            }
            _ => return Ok(nothing),
        };
        Ok(ExposureEstimate { turn, ..estimate })
    }

    /// The angle by which `velocity` has to be turned, rad from right to down, to point along the blur whose length is
    /// within the range; 0 unless one is clear.
    ///
    /// # Errors
    /// As [`estimate`](Self::estimate).
    pub fn turn<T: Real>(&self, frames: &[ExposureFrame<'_, T>], control: &Control) -> Result<f64> {
        self.validate(frames)?;
        let mut random = Random::new(self.seed);
        let noise = self.noise_used(frames, control)?;
        if noise == 0.0 {
            return Ok(0.0);
        }
        let slowest = LEAST_BLUR / self.range.1;
        match choose_tiles(frames, noise, slowest, &mut random, control)? {
            Some((waves, tiles)) => {
                let log_scales = &first_grid(self.range);
                let search = TurnSearch { tiles: &tiles, waves: &waves, log_scales, noise };
                search.find(&mut random, control)
            }
            None => Ok(0.0),
        }
    }

    /// The likeliest share where it can be relied on, else a cautious one.
    fn of_zeros(&self, found: &Found, noise: f64) -> ExposureEstimate {
        let &Found { vote, spread, tiles, .. } = found;
        let likeliest = found.log_scale.exp();
        let (value, status) = if self.trusts(found) {
            (likeliest, ExposureStatus::Ok)
        } else {
            let cautious = median(found.of_kinds).exp().min(MOST_UNSURE).max(self.range.0);
            (cautious, ExposureStatus::Unsure)
        };
        ExposureEstimate { value, turn: 0.0, status, vote, spread, tiles, likeliest, noise }
    }

    /// Whether the likeliest share can be relied on.
    fn trusts(&self, found: &Found) -> bool {
        let credible = (self.range.0..=self.range.1).contains(&found.log_scale.exp());
        let agree = found.vote >= TRUST.0 && found.spread <= TRUST.1;
        found.inside && credible && agree && found.tiles >= LEAST_TILES
    }

    fn validate<T: Real>(&self, frames: &[ExposureFrame<'_, T>]) -> Result<()> {
        if let Some(noise) = self.noise {
            require("noise", noise, "finite and not negative", |n| n >= 0.0)?;
        }
        require("limits", self.range.0, "finite and positive", |s| s > 0.0)?;
        require("limits", self.range.1, "increasing", |s| s > self.range.0)?;
        let Some(first) = frames.first() else {
            return Err(Error::value("frames", "at least one", 0));
        };
        let shape = first.image.dim();
        frames.iter().try_for_each(|frame| {
            require_same("frames", &frame.image, shape)?;
            require_same("flow", &frame.velocity.u, shape)?;
            require_same("acceleration", &frame.curvature.u, shape)
        })
    }

    /// Noise given or measured (median over the frames), at least that of 8 bits.
    fn noise_used<T: Real>(
        &self,
        frames: &[ExposureFrame<'_, T>],
        control: &Control,
    ) -> Result<f64> {
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        let samples = frames.iter().flat_map(|frame| frame.image.into_iter());
        samples.map(|sample| sample.as_f64()).filter(|sample| sample.is_finite()).for_each(|s| {
            (least, most) = (least.min(s), most.max(s));
        });
        let rounding = ((most - least) / GREY_LEVELS / 12f64.sqrt()).max(0.0);
        let noise = if let Some(noise) = self.noise {
            noise
        } else {
            let of_frame = |frame: &ExposureFrame<'_, T>| {
                estimate_noise(&frame.image, &frame.velocity, 1.0, control)
            };
            median(frames.iter().map(of_frame).collect::<Result<Vec<_>>>()?)
        };
        Ok(noise.max(rounding))
    }
}

/// The estimate when no tile tells anything.
fn without_tiles<T: Real>(frames: &[ExposureFrame<'_, T>], noise: f64) -> ExposureEstimate {
    let speeds = frames.iter().flat_map(|frame| {
        let motion = frame.velocity.u.into_iter().zip(frame.velocity.v);
        motion.map(|(u, v)| u.as_f64().hypot(v.as_f64())).filter(|speed| speed.is_finite())
    });
    let (slow, all) = speeds
        .fold((0usize, 0usize), |(slow, all), speed| (slow + usize::from(speed < SMALL), all + 1));
    let small = slow * 20 >= all * 19;
    let status = if small { ExposureStatus::Small } else { ExposureStatus::Unsure };
    let (vote, spread, likeliest) = (f64::NAN, f64::NAN, f64::NAN);
    ExposureEstimate { value: PRIOR, turn: 0.0, status, vote, spread, tiles: 0, likeliest, noise }
}

fn median(values: impl Into<Vec<f64>>) -> f64 {
    let mut values = values.into();
    values.sort_unstable_by(f64::total_cmp);
    (values[(values.len() - 1) / 2] + values[values.len() / 2]) / 2.0
}

#[cfg(test)]
mod tests;
