//! The waves at which the spectra of tiles are compared: a band of half a plane, by direction.
//!
//! A scene has a strength of its own in each of [`SECTORS`] sectors of directions (`likelihood.rs`); waves of one lie one
//! after the other. Units: rad/px.

use std::f64::consts::{PI, TAU};

/// Least frequency used, in steps of the tile's transform: below it the window's main lobe brings in the mean.
const LEAST_STEPS: f64 = 2.5;

/// Greatest frequency used, rad/px: beyond it cameras, codecs and demosaicking shape the spectrum.
pub(super) const GREATEST: f64 = 2.7;

/// Sectors of directions, in each of which a scene has a strength of its own.
pub(super) const SECTORS: usize = 12;

/// The waves at which tiles of one size are compared, by direction: half a plane, for a picture's spectrum is symmetric.
#[derive(Clone)]
pub(super) struct Waves {
    /// Side T of the tiles, px.
    pub(super) side: usize,
    /// Frequency to the right, rad/px.
    pub(super) x: Vec<f32>,
    /// Frequency downwards, rad/px.
    pub(super) y: Vec<f32>,
    /// Ends of the sectors of directions, in which the waves lie one after the other.
    pub(super) sectors: Vec<usize>,
    /// Places in the transform.
    pub(super) bins: Vec<usize>,
}

impl Waves {
    pub(super) fn new(side: usize) -> Self {
        let frequency = |k: usize| {
            let signed = if k > side / 2 { k as f64 - side as f64 } else { k as f64 };
            TAU * signed / side as f64
        };
        let least = LEAST_STEPS * TAU / side as f64;
        let mut of_sectors = vec![Vec::new(); SECTORS];
        for bin in 0..side * side {
            let (y, x) = (frequency(bin / side), frequency(bin % side));
            let radius = x.hypot(y);
            if radius > least && radius < GREATEST && (y > 0.0 || (y == 0.0 && x > 0.0)) {
                // The first sector lies about the x axis: on both ends of the half plane.
                let sector = (y.atan2(x) / PI * SECTORS as f64 + 0.5) as usize % SECTORS;
                of_sectors[sector].push((bin, x as f32, y as f32));
            }
        }
        let mut end = 0;
        let ends = of_sectors.iter().map(|sector| {
            end += sector.len();
            end
        });
        let sectors = ends.collect();
        let waves = of_sectors.concat();
        Self {
            side,
            x: waves.iter().map(|w| w.1).collect(),
            y: waves.iter().map(|w| w.2).collect(),
            sectors,
            bins: waves.iter().map(|w| w.0).collect(),
        }
    }

    pub(super) fn len(&self) -> usize {
        self.bins.len()
    }

    /// The same with one sector of all directions.
    pub(super) fn isotropic(&self) -> Self {
        Self { sectors: vec![self.len()], ..self.clone() }
    }
}
