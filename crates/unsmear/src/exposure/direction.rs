//! How far the flow points beside the blur.
//!
//! A motion turned by t moves the dark lines of the spectrum with it, so that Whittle's likelihood (`likelihood.rs`)
//! tells directions as it tells lengths; t is one for the whole picture, as of a compass that was read wrongly. Some tiles
//! are asked over a coarse grid of t and all scales, and only when another t than 0 wins, more of them over a fine grid
//! around it. On photographs blurred by 3 to 22 px the fine grid finds t within half a degree to two, less where blur is
//! short and noise strong.
//!
//! A turn is believed if it is clear of 0 by [`CLEAR`] deviations over resamplings of the tiles and by [`LEAST_TURN`],
//! within the range looked at and told by enough tiles. Texture that has a direction of its own moves the optimum by a
//! few degrees, not more: dark lines do not follow it.

use std::f64::consts::PI;

use super::likelihood::SHAPES;
use super::random::Random;
use super::search::LONGEST_BLUR;
use super::tile::{Tile, Waves};
use super::tile_likelihoods::TileLikelihoods;
use crate::control::Control;
use crate::error::Result;

/// One degree, rad.
const DEGREE: f64 = PI / 180.0;

/// Turns first tried, degrees: the optimum is some 12 wide to either side at a blur of 22 px.
const COARSE: [f64; 5] = [0.0, -6.0, 6.0, -12.0, 12.0];

/// Step of the fine grid, degrees, and the steps to either side.
const FINE: (f64, i32) = (2.0, 4);

/// Scales to either side of the best of the first grid that the fine one looks at.
const NEAR_SCALES: usize = 2;

/// Tiles of the coarse grid and of the fine one.
const TILES: (usize, usize) = (16, 40);

/// Fewest tiles that are believed.
const LEAST_TILES: usize = 8;

/// Least turn that is believed, degrees.
const LEAST_TURN: f64 = 4.0;

/// Deviations that it must be away from 0.
const CLEAR: f64 = 3.0;

/// Resamplings of the tiles.
const RESAMPLINGS: usize = 30;

/// Deviations of a normal distribution that its middle 80 % span.
const MIDDLE_DEVIATIONS: f64 = 2.563;

/// The turn, rad from right to down, that puts the motion of `tiles` along their blur; 0 unless there is one for sure.
pub(super) fn turn(
    tiles: &[Tile],
    waves: &Waves,
    log_scales: &[f64],
    noise: f64,
    random: &mut Random,
    control: &Control,
) -> Result<f64> {
    let most = log_scales[log_scales.len() - 1].exp();
    let ask = |tiles: &[&Tile], turns: &[f64], grid: &[f64]| -> Result<Vec<Vec<Vec<f64>>>> {
        let of_turn = |&turn: &f64| {
            let turned: Vec<Tile> = tiles.iter().map(|t| t.turned(turn * DEGREE)).collect();
            TileLikelihoods::new(&turned, waves, most, noise, control)?.curves(grid)
        };
        turns.iter().map(of_turn).collect()
    };
    let fits = |tile: &&Tile| tile.speed * most.min(1.0) < LONGEST_BLUR * waves.side as f64;
    let mut chosen: Vec<&Tile> = tiles.iter().filter(fits).take(TILES.1).collect();
    let first = &chosen[..chosen.len().min(TILES.0)];
    if first.len() < LEAST_TILES {
        return Ok(0.0);
    }
    let all = ask(first, &COARSE, log_scales)?;
    let every: Vec<usize> = (0..first.len()).collect();
    let least: Vec<(f64, usize)> = all.iter().map(|t| least(t, &every, log_scales.len())).collect();
    let best = (0..COARSE.len()).fold(0, |b, i| if least[i].0 < least[b].0 { i } else { b });
    if best == 0 {
        return Ok(0.0);
    }
    let at = least[best].1;
    let near =
        &log_scales[at.saturating_sub(NEAR_SCALES)..log_scales.len().min(at + NEAR_SCALES + 1)];
    let turns: Vec<f64> =
        (-FINE.1..=FINE.1).map(|i| COARSE[best] + FINE.0 * f64::from(i)).collect();
    chosen.retain(|tile| tile.speed * near[near.len() / 2].exp() > super::search::LEAST_BLUR);
    if chosen.len() < LEAST_TILES {
        return Ok(0.0);
    }
    let all = ask(&chosen, &turns, near)?;
    let optimum = |drawn: &[usize]| {
        let values: Vec<f64> =
            all.iter().map(|turn| self::least(turn, drawn, near.len()).0).collect();
        parabola(&values, &turns)
    };
    let every: Vec<usize> = (0..chosen.len()).collect();
    let Some(found) = optimum(&every) else { return Ok(0.0) };
    let mut redrawn: Vec<f64> = (0..RESAMPLINGS)
        .map(|_| {
            let drawn: Vec<usize> = every.iter().map(|_| random.below(every.len())).collect();
            optimum(&drawn).unwrap_or(0.0)
        })
        .collect();
    redrawn.sort_unstable_by(f64::total_cmp);
    let tenth = RESAMPLINGS / 10;
    let spread = (redrawn[RESAMPLINGS - 1 - tenth] - redrawn[tenth]) / MIDDLE_DEVIATIONS;
    let clear = found.abs() >= LEAST_TURN.max(CLEAR * spread);
    Ok(if clear { found * DEGREE } else { 0.0 })
}

/// Least -log L of the tiles `drawn` over shapes and scales, and the scale it is at.
fn least(tiles: &[Vec<f64>], drawn: &[usize], scales: usize) -> (f64, usize) {
    let mut sum = vec![0.0; SHAPES * scales];
    for &tile in drawn {
        sum.iter_mut().zip(&tiles[tile]).for_each(|(sum, value)| *sum += value);
    }
    let at = (0..sum.len()).fold(0, |at, i| if sum[i] < sum[at] { i } else { at });
    (sum[at], at % scales)
}

/// Place of the least of the parabola through the least value and its neighbours, equally spaced; None at an end.
fn parabola(values: &[f64], places: &[f64]) -> Option<f64> {
    let at = (0..values.len()).fold(0, |at, i| if values[i] < values[at] { i } else { at });
    if at == 0 || at + 1 == values.len() {
        return None;
    }
    let (before, after) = (values[at - 1] - values[at], values[at + 1] - values[at]);
    let offset = if before + after > 0.0 { 0.5 * (before - after) / (before + after) } else { 0.0 };
    Some(places[at] + offset * (places[at + 1] - places[at]))
}
