//! How far the flow points beside the blur.
//!
//! A motion turned by t turns the dark lines of the spectrum with it, so that Whittle's likelihood (`likelihood.rs`) tells
//! directions as it tells lengths; t is one for the whole picture, as of a flow from another camera or a compass. Some
//! tiles are asked over a coarse grid of t and all scales, and only where another t than 0 wins, more of them over a fine
//! grid around it. On photographs blurred by 7 to 22 px t comes out within half a degree, within 1.5 where noise is
//! strong.
//!
//! A turn is believed if it is clear of 0 by [`LEAST_TURN`] and by [`CLEAR`] deviations over resamplings of the tiles, if
//! kinds of scene agree, if neither it nor the scale with it lies at an end of its range, and if it
//! explains the tiles better than no blur at all.

use super::random::Random;
use super::scene::{ALPHA, KINDS};
use super::search::{LEAST_BLUR, LONGEST_BLUR};
use super::tile::Tile;
use super::tile_likelihoods::TileLikelihoods;
use super::waves::Waves;
use crate::control::Control;
use crate::error::Result;

/// Turns first tried, degrees: at a blur of 22 px the optimum is some 12 wide, at shorter ones wider.
const COARSE: [f64; 5] = [0.0, -6.0, 6.0, -12.0, 12.0];

/// Step of the fine grid, degrees, and the steps to either side.
const FINE: (f64, i32) = (2.0, 3);

/// Scales that the fine grid looks at, to either side of the best.
const NEAR: usize = 2;

/// A scale at which nothing is blurred: a picture that fits it better has no direction.
const SHARP: f64 = 1e-3;

/// Tiles of 64 px asked first and then; of larger ones, which tell more each, fewer.
const TILES: (usize, usize) = (12, 28);

/// Fewest tiles that are believed.
const LEAST_TILES: usize = 8;

/// Least turn that is believed, degrees: lines that many things in the picture have in common feign up to 4.
const LEAST_TURN: f64 = 5.0;

/// Deviations that a turn must be away from 0.
const CLEAR: f64 = 3.0;

/// Distance from the winner within which a kind of scene agrees, degrees, and the share that must.
const AGREEMENT: (f64, f64) = (3.0, 0.6);

/// Resamplings of the tiles.
const RESAMPLINGS: usize = 30;

/// Deviations of a normal distribution that its middle 80 % span.
const MIDDLE_DEVIATIONS: f64 = 2.563;

/// Who is asked about turns, and how.
pub(super) struct TurnSearch<'a> {
    pub(super) tiles: &'a [Tile],
    pub(super) waves: &'a Waves,
    /// Logarithms of the scales, ascending.
    pub(super) log_scales: &'a [f64],
    /// Deviation of the noise.
    pub(super) noise: f64,
}

impl TurnSearch<'_> {
    /// The turn, rad from right to down, that puts the motion of the tiles along their blur; 0 unless one is clear.
    pub(super) fn find(&self, random: &mut Random, control: &Control) -> Result<f64> {
        let longest = self.log_scales[self.log_scales.len() - 1].exp().min(1.0);
        let fits = |tile: &&Tile| tile.speed * longest < LONGEST_BLUR * self.waves.side as f64;
        let few =
            |tiles: usize| (tiles * 64 * 64 / self.waves.side.pow(2)).clamp(LEAST_TILES, tiles);
        let mut tiles: Vec<&Tile> = self.tiles.iter().filter(fits).take(few(TILES.1)).collect();
        if tiles.len() < LEAST_TILES {
            return Ok(0.0);
        }
        let some = &tiles[..tiles.len().min(few(TILES.0))];
        let most = self.log_scales[self.log_scales.len() - 1].exp();
        let (waves, noise) = (self.waves, self.noise);
        let likelihoods = TileLikelihoods::new(self.tiles, waves, ALPHA, most, noise, control)?;
        let coarse = Turned::new(some, &COARSE, self.log_scales, &likelihoods)?;
        let every: Vec<usize> = (0..some.len()).collect();
        let (value, turn, scale) = coarse.best(&every);
        if COARSE[turn] == 0.0 {
            return Ok(0.0);
        }
        let (sharp, _, _) = Turned::new(some, &[0.0], &[SHARP.ln()], &likelihoods)?.best(&every);
        if sharp <= value {
            return Ok(0.0);
        }
        let near = scale.saturating_sub(NEAR)..(scale + NEAR + 1).min(self.log_scales.len());
        tiles.retain(|tile| tile.speed * self.log_scales[scale].exp() > LEAST_BLUR);
        let around = |i: i32| COARSE[turn] + FINE.0 * f64::from(i);
        let turns: Vec<f64> = (-FINE.1..=FINE.1).map(around).collect();
        let fine = Turned::new(&tiles, &turns, &self.log_scales[near.clone()], &likelihoods)?;
        let every: Vec<usize> = (0..tiles.len()).collect();
        let scale = near.start + fine.best(&every).2;
        if scale == 0 || scale + 1 == self.log_scales.len() {
            return Ok(0.0);
        }
        Ok(fine.believed(&turns, random).to_radians())
    }
}

/// -log L by turn, tile, kind of scene and at last any (outer) and scale (inner).
struct Turned {
    curves: Vec<Vec<Vec<f64>>>,
    scales: usize,
}

impl Turned {
    fn new(
        tiles: &[&Tile],
        turns: &[f64],
        log_scales: &[f64],
        likelihoods: &TileLikelihoods<'_>,
    ) -> Result<Self> {
        let curves = turns.iter().map(|turn| {
            let turned: Vec<Tile> = tiles.iter().map(|t| t.turned(turn.to_radians())).collect();
            likelihoods.curves(&turned, log_scales)
        });
        Ok(Self { curves: curves.collect::<Result<_>>()?, scales: log_scales.len() })
    }

    /// Least -log L of the tiles `drawn`, and the numbers of the turn and scale it is at.
    fn best(&self, drawn: &[usize]) -> (f64, usize, usize) {
        let of_turn = |turn| {
            let sum = self.sum(turn, drawn);
            let at = least(&sum);
            (sum[at], turn, at % self.scales)
        };
        let first = of_turn(0);
        let lower = |best: (f64, usize, usize), turn| {
            let other = of_turn(turn);
            if other.0 < best.0 { other } else { best }
        };
        (1..self.curves.len()).fold(first, lower)
    }

    /// The turn in degrees, or 0 if it is not to be believed.
    fn believed(&self, turns: &[f64], random: &mut Random) -> f64 {
        let tiles = self.curves[0].len();
        if tiles < LEAST_TILES {
            return 0.0;
        }
        let every: Vec<usize> = (0..tiles).collect();
        let of_kinds = self.profiles(&every);
        let Some(found) = parabola(&of_kinds[KINDS], turns) else { return 0.0 };
        let agree = |profile: &&Vec<f64>| {
            parabola(profile, turns).is_some_and(|own| (own - found).abs() <= AGREEMENT.0)
        };
        let vote = of_kinds[..KINDS].iter().filter(agree).count() as f64 / KINDS as f64;
        let mut redrawn: Vec<f64> = (0..RESAMPLINGS)
            .map(|_| {
                let drawn: Vec<usize> = every.iter().map(|_| random.below(tiles)).collect();
                parabola(&self.profiles(&drawn)[KINDS], turns).unwrap_or(0.0)
            })
            .collect();
        redrawn.sort_unstable_by(f64::total_cmp);
        let tenth = RESAMPLINGS / 10;
        let spread = (redrawn[RESAMPLINGS - 1 - tenth] - redrawn[tenth]) / MIDDLE_DEVIATIONS;
        let clear = found.abs() >= LEAST_TURN.max(CLEAR * spread) && vote >= AGREEMENT.1;
        if clear { found } else { 0.0 }
    }

    /// Least -log L over the scales, by kind of scene and at last any, and turn.
    fn profiles(&self, drawn: &[usize]) -> Vec<Vec<f64>> {
        let mut profiles = vec![Vec::new(); KINDS + 1];
        for turn in 0..self.curves.len() {
            let sum = self.sum(turn, drawn);
            for (profile, curve) in profiles.iter_mut().zip(sum.chunks(self.scales)) {
                profile.push(curve[least(curve)]);
            }
        }
        profiles
    }

    fn sum(&self, turn: usize, drawn: &[usize]) -> Vec<f64> {
        let mut sum = vec![0.0; (KINDS + 1) * self.scales];
        for &tile in drawn {
            let curves = &self.curves[turn][tile];
            sum.iter_mut().zip(curves).for_each(|(sum, value)| *sum += value);
        }
        sum
    }
}

fn least(values: &[f64]) -> usize {
    (0..values.len()).fold(0, |at, i| if values[i] < values[at] { i } else { at })
}

/// Place of the least of the parabola through the least value and its neighbours, equally spaced; None at an end.
fn parabola(values: &[f64], places: &[f64]) -> Option<f64> {
    let at = least(values);
    if at == 0 || at + 1 == values.len() {
        return None;
    }
    let (before, after) = (values[at - 1] - values[at], values[at + 1] - values[at]);
    let offset = if before + after > 0.0 { 0.5 * (before - after) / (before + after) } else { 0.0 };
    Some(places[at] + offset * (places[at + 1] - places[at]))
}
