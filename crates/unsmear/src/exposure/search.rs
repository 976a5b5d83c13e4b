//! The search over the scale of the blur: a coarse grid, the tiles long enough at its optimum, a fine grid.

use super::likelihood::SHAPES;
use super::random::Random;
use super::tile::{Tile, Waves};
use super::tile_likelihoods::TileLikelihoods;
use super::vote::{Optimum, optimum, spread, vote};
use crate::control::Control;
use crate::error::Result;

/// Shortest blur with a zero in the band, px.
pub(super) const LEAST_BLUR: f64 = 2.4;

/// Longest blur that a tile shows, as a share of its side.
pub(super) const LONGEST_BLUR: f64 = 0.75;

/// Step of the first grid in log s, and of the finer one.
const STEPS: [f64; 2] = [0.095, 0.02];

/// Steps of the finer grid to either side.
const FINE: i32 = 6;

/// Rounds of leaving out tiles too short at the s found.
const GATES: usize = 4;

/// What the tiles say.
pub(super) struct Found {
    /// Log of the likeliest scale.
    pub(super) log_scale: f64,
    /// Whether it lies within the range searched, not at its end.
    pub(super) inside: bool,
    /// Own optimum of each shape of the scene's spectrum.
    pub(super) of_shapes: [f64; SHAPES],
    /// Share of the plausible shapes that agree.
    pub(super) vote: f64,
    /// Deviation over resamplings of the tiles.
    pub(super) spread: f64,
    /// Tiles used.
    pub(super) tiles: usize,
}

/// What there is to learn from tiles.
pub(super) enum Evidence {
    /// Zeros of the blur's spectrum in the band.
    Zeros(Found),
    /// Blur too short for them: optima of the shapes over all tiles.
    Dimming([f64; SHAPES]),
}

/// Searches `range`.
pub(super) fn search(
    tiles: &[Tile],
    waves: &Waves,
    range: (f64, f64),
    noise: f64,
    random: &mut Random,
    control: &Control,
) -> Result<Evidence> {
    let grid = first_grid(range);
    let first = long_enough(tiles, waves.side, grid[grid.len() - 1].min(0.0));
    if first.is_empty() {
        // Only how much less is seen along the motion than across it tells.
        let waves = waves.isotropic();
        let likelihoods = TileLikelihoods::new(tiles, &waves, range.1, noise, control)?;
        let all = likelihoods.curves(tiles, &grid)?;
        let whole = optimum(all.iter().map(Vec::as_slice), &grid);
        return Ok(Evidence::Dimming(whole.of_shapes));
    }
    let likelihoods = TileLikelihoods::new(tiles, waves, range.1, noise, control)?;
    let all = likelihoods.curves(tiles, &grid)?;
    let (coarse, used) = gated(&all, tiles, waves.side, &grid, first);
    let log_scale = if coarse.inside {
        let fine: Vec<f64> =
            (-FINE..=FINE).map(|i| coarse.log_scale + f64::from(i) * STEPS[1]).collect();
        let refined = likelihoods.curves(tiles, &fine)?;
        optimum(used.iter().map(|&i| refined[i].as_slice()), &fine).log_scale
    } else {
        coarse.log_scale
    };
    let chosen: Vec<&[f64]> = used.iter().map(|&i| all[i].as_slice()).collect();
    let spread = spread(&chosen, &grid, random);
    let (tiles, vote) = (chosen.len(), vote(&coarse, log_scale, chosen.len() * waves.len()));
    let Optimum { inside, of_shapes, .. } = coarse;
    Ok(Evidence::Zeros(Found { log_scale, inside, of_shapes, vote, spread, tiles }))
}

/// Logarithms of scales over all of `range`.
pub(super) fn first_grid(range: (f64, f64)) -> Vec<f64> {
    let (first, length) = (range.0.ln(), (range.1 / range.0).ln());
    let steps = (length / STEPS[0]).ceil();
    (0..=steps as usize).map(|i| first + i as f64 / steps * length).collect()
}

/// Numbers of the tiles whose blur at a scale leaves a zero in the band and fits the tile.
fn long_enough(tiles: &[Tile], side: usize, log_scale: f64) -> Vec<usize> {
    let fits = |tile: &Tile| {
        let blur = tile.speed * log_scale.exp();
        blur > LEAST_BLUR && blur < LONGEST_BLUR * side as f64
    };
    (0..tiles.len()).filter(|&i| fits(&tiles[i])).collect()
}

/// The optimum of the tiles long enough at it, and which these are, beginning with `used`.
fn gated(
    curves: &[Vec<f64>],
    tiles: &[Tile],
    side: usize,
    grid: &[f64],
    mut used: Vec<usize>,
) -> (Optimum, Vec<usize>) {
    let best = |used: &[usize]| optimum(used.iter().map(|&i| curves[i].as_slice()), grid);
    let mut found = best(&used);
    for _ in 1..GATES {
        let next = long_enough(tiles, side, found.log_scale);
        if next == used || next.is_empty() {
            break;
        }
        used = next;
        found = best(&used);
    }
    (found, used)
}
