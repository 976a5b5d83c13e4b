//! Parameters of the coarse-to-fine method and its four presets.
//!
//! Chosen on Middlebury's training pairs and Yosemite; differences of the mean endpoint error below
//! 0.003 px are within the scatter of the choice.

use crate::error::{Result, require};

/// What two frames want of the smoothness, the edges and the residual scale that seven frames want.
pub(super) const FOR_TWO_FRAMES: [f64; 3] = [1.25, 2.0, 2.0];

/// Parameters of [`super`]; lengths in px of the respective level.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(clippy::struct_excessive_bools, reason = "independent switches, each on its own")]
pub struct CoarseToFine {
    /// Ratio of the sizes of neighbouring levels, in [0.4, 0.95].
    pub pyramid_factor: f64,
    /// Levels are added while the shorter side keeps this many px, at least 4.
    pub coarsest_side: f64,
    /// Levels left out at the fine end; the flow is enlarged from there.
    pub finest_level: usize,
    /// Warps on every level but the finest, at least 1.
    pub warps: usize,
    /// Warps on the finest level, at least 1.
    pub finest_warps: usize,
    /// Rounds of reweighting per warp, at least 1.
    pub passes: usize,
    /// Sweeps of the solver per round, at least 1.
    pub sweeps: usize,
    /// `alpha`: weight of smoothness against the data, > 0.
    pub smoothness: f64,
    /// `k`: how much edges of the picture let the flow break, >= 0.
    pub edge_sensitivity: f64,
    /// Edges by the channel that shows them best instead of the rms of all.
    pub strongest_channel: bool,
    /// Residual at which a constraint has half its weight, rad, > 0.
    pub residual_scale: f64,
    /// Residual below which data count more by the inverse of its square, rad; 0 leaves this out.
    pub precision_scale: f64,
    /// Deviation from the tuned frequency at which weights halve, in deviations of the filter, > 0.
    pub tau: f64,
    /// Amplitude at which weights halve, as a share of the rms amplitude of the level, >= 0...
    pub amplitude_fraction: f64,
    /// ... plus this, grey levels, > 0.
    pub amplitude_floor: f64,
    /// Half side of the weighted median, px; 0 leaves it out.
    pub median_radius: usize,
    /// Difference of the guide that the weighted median tolerates, grey levels, > 0.
    pub guide_sigma: f64,
    /// Frames used on each side of the reference; 0: the reference and the next.
    pub frames_each_side: usize,
    /// Fall back to two frames where motion is not constant over all.
    pub choose_frames: bool,
    /// Smooth more, and trust edges less, in a noisy picture.
    pub adapt_to_noise: bool,
    /// Hold still what the frames show to rest.
    pub static_evidence: bool,
    /// Check the flow by that of the reversed frames: confidence alone, at twice the time.
    pub forward_backward: bool,
}

impl CoarseToFine {
    /// Two frames, half-size steps: the default.
    #[must_use]
    pub fn balanced() -> Self {
        Self {
            pyramid_factor: 0.5,
            coarsest_side: 16.0,
            finest_level: 0,
            warps: 6,
            finest_warps: 2,
            passes: 2,
            sweeps: 10,
            smoothness: 0.11,
            edge_sensitivity: 2.0,
            strongest_channel: false,
            residual_scale: 1.0,
            precision_scale: 0.3,
            tau: 1.25,
            amplitude_fraction: 0.05,
            amplitude_floor: 0.2,
            median_radius: 5,
            guide_sigma: 10.0,
            frames_each_side: 0,
            choose_frames: false,
            adapt_to_noise: true,
            static_evidence: true,
            forward_backward: false,
        }
    }

    /// Solved at half the resolution: a third of the time.
    #[must_use]
    pub fn fast() -> Self {
        Self { finest_level: 1, smoothness: 0.1, warps: 4, finest_warps: 3, ..Self::balanced() }
    }

    /// Finer steps between the levels: twice the time.
    #[must_use]
    pub fn accurate() -> Self {
        Self {
            pyramid_factor: 0.75,
            warps: 3,
            passes: 3,
            sweeps: 15,
            smoothness: 0.13,
            edge_sensitivity: 2.5,
            strongest_channel: true,
            residual_scale: 0.7,
            precision_scale: 0.25,
            ..Self::balanced()
        }
    }

    /// Up to seven frames, for motion that is constant over them.
    #[must_use]
    pub fn steady() -> Self {
        Self::several(Self::balanced())
    }

    /// Up to seven frames and finer steps between the levels: four times the time of [`Self::steady`].
    #[must_use]
    pub fn steady_accurate() -> Self {
        Self::several(Self::accurate())
    }

    /// Several frames by the settings of two.
    fn several(two: Self) -> Self {
        let [smoothness, edge_sensitivity, residual_scale] = FOR_TWO_FRAMES;
        Self {
            smoothness: two.smoothness / smoothness,
            edge_sensitivity: two.edge_sensitivity / edge_sensitivity,
            residual_scale: two.residual_scale / residual_scale,
            frames_each_side: 3,
            choose_frames: true,
            ..two
        }
    }

    pub(super) fn check(&self) -> Result<()> {
        let positive = |argument, value| require(argument, value, "> 0", |x| x > 0.0);
        let least_one = |argument, n: usize| require(argument, n as f64, ">= 1", |n| n >= 1.0);
        require("pyramid_factor", self.pyramid_factor, "in [0.4, 0.95]", |f| {
            (0.4..=0.95).contains(&f)
        })?;
        require("coarsest_side", self.coarsest_side, ">= 4 px", |s| s >= 4.0)?;
        for (argument, n) in [
            ("warps", self.warps),
            ("finest_warps", self.finest_warps),
            ("passes", self.passes),
            ("sweeps", self.sweeps),
        ] {
            least_one(argument, n)?;
        }
        for (argument, value) in [
            ("smoothness", self.smoothness),
            ("residual_scale", self.residual_scale),
            ("tau", self.tau),
            ("amplitude_floor", self.amplitude_floor),
            ("guide_sigma", self.guide_sigma),
        ] {
            positive(argument, value)?;
        }
        for (argument, value) in [
            ("edge_sensitivity", self.edge_sensitivity),
            ("precision_scale", self.precision_scale),
            ("amplitude_fraction", self.amplitude_fraction),
        ] {
            require(argument, value, ">= 0", |x| x >= 0.0)?;
        }
        require("median_radius", self.median_radius as f64, "in 0..=15", |r| r <= 15.0)
    }
}
