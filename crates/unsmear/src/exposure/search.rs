//! The search over the scale of the blur: a coarse grid, the tiles long enough at its optimum, a fine grid.

use super::random::Random;
use super::scene::{ALPHA, KINDS};
use super::short_blur::by_dimming;
use super::tile::Tile;
use super::tile_likelihoods::TileLikelihoods;
use super::vote::{Optimum, optimum, parabola, spread, sum, vote};
use super::waves::Waves;
use crate::control::Control;
use crate::error::Result;

/// Shortest blur with a zero in the band, px.
pub(super) const LEAST_BLUR: f64 = 2.4;

/// Longest blur that a tile shows, as a share of its side.
pub(super) const LONGEST_BLUR: f64 = 0.6;

/// Longest mean blur that is read right, as a share of the tiles' side: of longer ones about this is found.
const LONGEST_READ: f64 = 0.56;

/// Step of the first grid in log s.
const STEP: f64 = 0.095;

/// Steps of the finer grid in one of the first: the likelihood of a blur of 40 px is some 0.1 wide.
const FINER: usize = 3;

/// -log L per sample above the least of the first grid that the finer one still covers, and the least steps of the
/// first to either side.
const NEAR: (f64, usize) = (0.03, 2);

/// Most that the blur may differ between places 1 px apart, px: waves
/// turned or stretched during it fill the zeros. A turn by 12 degrees is read to 5 %, one by 25 degrees not at all.
const MOST_STRAIN: f64 = 0.35;

/// Tiles asked over the whole range, of those at hand.
const FIRST_TILES: usize = 48;

/// Rounds of leaving out tiles too short at the s found.
const GATES: usize = 4;

/// What the tiles say.
pub(super) struct Found {
    /// Log of the likeliest scale.
    pub(super) log_scale: f64,
    /// Whether it lies within the range searched, not at its end.
    pub(super) inside: bool,
    /// Own optimum of each kind of scene.
    pub(super) of_kinds: [f64; KINDS],
    /// Share of the plausible kinds that agree.
    pub(super) vote: f64,
    /// Deviation over resamplings of the tiles.
    pub(super) spread: f64,
    /// Tiles used.
    pub(super) tiles: usize,
    /// Their mean speed, px/frame.
    pub(super) speed: f64,
}

/// What there is to learn from tiles.
pub(super) enum Evidence {
    /// Zeros of the blur's spectrum in the band.
    Zeros(Found),
    /// Blur too short for them: the scale by how much it dims.
    Dimming(f64),
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
    let side = waves.side;
    let grid = first_grid(readable(tiles, side, range));
    let first_scale = grid[grid.len() - 1].min(0.0);
    if telling(tiles, side, first_scale).is_empty() {
        return by_dimming(tiles, waves, &grid, noise, control).map(Evidence::Dimming);
    }
    let likelihoods = TileLikelihoods::new(tiles, waves, ALPHA, range.1, noise, control)?;
    let some = &tiles[..tiles.len().min(FIRST_TILES)];
    let some = if telling(some, side, first_scale).is_empty() { tiles } else { some };
    let curves = likelihoods.curves(some, &grid)?;
    let (scale, means) = gated(&curves, some, side, &grid, first_scale);
    let grid = finer(&means, &grid);
    let tiles: Vec<&Tile> = tiles.iter().filter(|tile| tells(tile, side, scale)).collect();
    let curves = likelihoods.curves(&tiles, &grid)?;
    let curves: Vec<&[f64]> = curves.iter().map(Vec::as_slice).collect();
    let found = optimum(curves.iter().copied(), &grid);
    let spread = spread(&curves, &grid, random);
    let vote = vote(&found, tiles.len() * waves.len());
    let Optimum { log_scale, mut inside, of_kinds, .. } = found;
    let speed = tiles.iter().map(|tile| tile.speed).sum::<f64>() / tiles.len() as f64;
    inside &= speed * log_scale.exp() < LONGEST_READ * side as f64;
    Ok(Evidence::Zeros(Found {
        log_scale,
        inside,
        of_kinds,
        vote,
        spread,
        tiles: tiles.len(),
        speed,
    }))
}

/// The part of `range` at which the blur of some tile fits it.
fn readable(tiles: &[Tile], side: usize, range: (f64, f64)) -> (f64, f64) {
    let slowest = tiles.iter().map(|tile| tile.speed).fold(f64::INFINITY, f64::min);
    let longest = LONGEST_BLUR * side as f64 / slowest;
    (range.0, range.1.min(longest).max(range.0 * STEP.exp()))
}

/// A finer grid over what means of -log L per sample on the first one leave open.
fn finer(means: &[f64], grid: &[f64]) -> Vec<f64> {
    let limit = means.iter().copied().fold(f64::INFINITY, f64::min) + NEAR.0;
    let open: Vec<usize> = (0..grid.len()).filter(|&i| means[i] <= limit).collect();
    let (first, last) = (open[0].saturating_sub(NEAR.1), open[open.len() - 1] + NEAR.1);
    let last = last.min(grid.len() - 1);
    let step = (grid[last] - grid[first]) / (FINER * (last - first)) as f64;
    (0..=FINER * (last - first)).map(|i| grid[first] + i as f64 * step).collect()
}

/// Logarithms of scales over all of `range`.
pub(super) fn first_grid(range: (f64, f64)) -> Vec<f64> {
    let (first, length) = (range.0.ln(), (range.1 / range.0).ln());
    let steps = (length / STEP).ceil().max(1.0);
    (0..=steps as usize).map(|i| first + i as f64 / steps * length).collect()
}

/// Whether the blur at a scale leaves a zero in the band, fits the tile, and is the same nearly all over it.
fn tells(tile: &Tile, side: usize, log_scale: f64) -> bool {
    let scale = log_scale.exp();
    let blur = tile.speed * scale;
    blur > LEAST_BLUR && blur < LONGEST_BLUR * side as f64 && tile.strain * scale < MOST_STRAIN
}

/// Numbers of the tiles that tell something at a scale.
fn telling(tiles: &[Tile], side: usize, log_scale: f64) -> Vec<usize> {
    (0..tiles.len()).filter(|&i| tells(&tiles[i], side, log_scale)).collect()
}

/// The scale at which the tiles that tell something have their optimum, beginning with `log_scale`, as it was when they
/// were chosen, and means of their -log L per sample.
fn gated(
    curves: &[Vec<f64>],
    tiles: &[Tile],
    side: usize,
    grid: &[f64],
    mut log_scale: f64,
) -> (f64, Vec<f64>) {
    let mut used = telling(tiles, side, log_scale);
    let together = |used: &[usize]| sum(used.iter().map(|&i| curves[i].as_slice()), grid.len());
    for _ in 1..GATES {
        let found = parabola(&together(&used), grid).0;
        let next = telling(tiles, side, found);
        if next == used || next.is_empty() {
            break;
        }
        (used, log_scale) = (next, found);
    }
    let samples = (used.len() * tiles[0].power.len()) as f64;
    (log_scale, together(&used).iter().map(|sum| sum / samples).collect())
}
