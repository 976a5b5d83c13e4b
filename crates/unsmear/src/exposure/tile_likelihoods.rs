//! The likelihood of every tile over one grid of scales.

use std::borrow::Borrow;

use rayon::prelude::*;

use super::likelihood::curves;
use super::path_spectrum::PathSpectrum;
use super::scene::{SceneSpectra, least_of_kinds};
use super::tile::Tile;
use super::waves::Waves;
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
    /// For `tiles` and scales up to `most_scale`, and scenes of decays `alpha`.
    pub(super) fn new(
        tiles: &[Tile],
        waves: &'a Waves,
        alpha: [f64; 2],
        most_scale: f64,
        noise: f64,
        control: &'a Control,
    ) -> Result<Self> {
        control.check()?;
        let points = tiles.iter().flat_map(|tile| &tile.points);
        let greatest =
            points.map(|p| f64::from(p.curvature[0].hypot(p.curvature[1]))).fold(0.0, f64::max);
        let table = PathSpectrum::new(greatest * most_scale.powi(2) * GREATEST_FREQUENCY);
        let scenes = SceneSpectra::new(waves, alpha);
        Ok(Self { waves, scenes, table, noise, control })
    }

    /// -log L of each tile for every kind of scene and at last for any (outer) and scale (inner).
    pub(super) fn curves<T: Borrow<Tile> + Sync>(
        &self,
        tiles: &[T],
        log_scales: &[f64],
    ) -> Result<Vec<Vec<f64>>> {
        let of_shapes = self.of_shapes(tiles, log_scales)?;
        Ok(of_shapes.iter().map(|curves| least_of_kinds(curves, log_scales.len())).collect())
    }

    /// -log L of each tile for every shape of the scene's spectrum (outer) and scale (inner).
    pub(super) fn of_shapes<T: Borrow<Tile> + Sync>(
        &self,
        tiles: &[T],
        log_scales: &[f64],
    ) -> Result<Vec<Vec<f64>>> {
        let scales: Vec<f64> = log_scales.iter().map(|s| s.exp()).collect();
        self.control.expect(tiles.len());
        let of_tile = |tile: &T| {
            self.control.advance()?;
            Ok(curves(tile.borrow(), self.waves, &self.scenes, &self.table, &scales, self.noise))
        };
        tiles.par_iter().map(of_tile).collect()
    }
}
