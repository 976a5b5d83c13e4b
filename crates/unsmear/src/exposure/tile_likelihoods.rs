//! The likelihood of every tile over one grid of scales.

use rayon::prelude::*;

use super::likelihood::{SceneSpectra, curves};
use super::path_spectrum::PathSpectrum;
use super::tile::{Tile, Waves};
use crate::control::Control;
use crate::error::Result;

/// Greatest frequency of the likelihood, rad/px, for the extent of the table.
const GREATEST_FREQUENCY: f64 = 2.8;

/// What the likelihoods of tiles, as they are or turned, have in common.
pub(super) struct TileLikelihoods<'a> {
    waves: &'a Waves,
    scenes: SceneSpectra,
    table: PathSpectrum,
    noise: f64,
    control: &'a Control,
}

impl<'a> TileLikelihoods<'a> {
    /// For `tiles` and scales up to `most_scale`.
    pub(super) fn new(
        tiles: &[Tile],
        waves: &'a Waves,
        most_scale: f64,
        noise: f64,
        control: &'a Control,
    ) -> Result<Self> {
        control.check()?;
        let points = tiles.iter().flat_map(|tile| &tile.points);
        let greatest =
            points.map(|p| f64::from(p.curvature[0].hypot(p.curvature[1]))).fold(0.0, f64::max);
        let table = PathSpectrum::new(greatest * most_scale.powi(2) * GREATEST_FREQUENCY);
        let scenes = SceneSpectra::new(waves);
        Ok(Self { waves, scenes, table, noise, control })
    }

    /// -log L of each tile for every shape (outer) and scale (inner).
    pub(super) fn curves(&self, tiles: &[Tile], log_scales: &[f64]) -> Result<Vec<Vec<f64>>> {
        let scales: Vec<f64> = log_scales.iter().map(|s| s.exp()).collect();
        self.control.expect(tiles.len());
        let of_tile = |tile: &Tile| {
            self.control.advance()?;
            Ok(curves(tile, self.waves, &self.scenes, &self.table, &scales, self.noise))
        };
        tiles.par_iter().map(of_tile).collect()
    }
}
