//! Which tiles of the frames are used: a random hundred of those that tell something, as large as can be.
//!
//! Corners lie half a tile apart. A fixed seed puts them in an order, in which they are looked at until enough have
//! been found; so a long clip costs no more than a picture, and the same call finds the same tiles.

use rayon::prelude::*;

use super::frame::ExposureFrame;
use super::random::Random;
use super::tile::{Tile, Waves};
use crate::control::Control;
use crate::error::Result;
use crate::fourier::Fft2;
use crate::real::Real;

/// Most tiles used: beyond it the model, not the number of tiles, limits what is found.
const MOST_TILES: usize = 100;

/// Tiles looked at together; a fixed number, so that the result does not depend on threads.
const BATCH: usize = 128;

/// Sides of tiles, px, and the shorter side of the smallest picture for each.
const SIDES: [(usize, usize); 3] = [(64, 256), (48, 96), (32, 32)];

/// Tiles from which smaller ones, which tell less each, are not tried.
const ENOUGH_TILES: usize = 12;

/// Mean power of a tile, in units of the noise's, from which it tells enough by itself.
const STRONG: f64 = 20.0;

/// Tiles, if fewer are strong: the strongest. A few can agree on a length by chance.
const STRONGEST: usize = 24;

/// Tiles of the greatest side of which there are enough, or else of that with most; None when there are none.
pub(super) fn choose_tiles<T: Real>(
    frames: &[ExposureFrame<'_, T>],
    noise: f64,
    least_speed: f64,
    random: &mut Random,
    control: &Control,
) -> Result<Option<(Waves, Vec<Tile>)>> {
    let (height, width) = frames[0].image.dim();
    let mut best: Option<(Waves, Vec<Tile>)> = None;
    for (side, shortest) in SIDES {
        if height.min(width) < shortest {
            continue;
        }
        let waves = Waves::new(side);
        let tiles = tiles_of(frames, &waves, noise, least_speed, random, control)?;
        if tiles.len() > best.as_ref().map_or(0, |(_, most)| most.len()) {
            best = Some((waves, tiles));
        }
        if best.as_ref().is_some_and(|(_, most)| most.len() >= ENOUGH_TILES) {
            break;
        }
    }
    Ok(best)
}

/// At most [`MOST_TILES`] tiles faster than `least_speed` (px/frame) that tell something.
fn tiles_of<T: Real>(
    frames: &[ExposureFrame<'_, T>],
    waves: &Waves,
    noise: f64,
    least_speed: f64,
    random: &mut Random,
    control: &Control,
) -> Result<Vec<Tile>> {
    let side = waves.side;
    let (height, width) = frames[0].image.dim();
    let starts = |n: usize| (0..=n - side).step_by(side / 2);
    let mut corners: Vec<(usize, [usize; 2])> = (0..frames.len())
        .flat_map(|n| starts(height).map(move |top| (n, top)))
        .flat_map(|(n, top)| starts(width).map(move |left| (n, [top, left])))
        .collect();
    random.shuffle(&mut corners);
    let plan = Fft2::new(side, side);
    let mut tiles = Vec::new();
    for batch in corners.chunks(BATCH) {
        let found: Vec<Option<Tile>> = batch
            .par_iter()
            .map(|&(n, corner)| {
                control.check()?;
                let tile = Tile::new(&frames[n], corner, waves, noise, &plan);
                Ok(tile.filter(|tile| tile.speed > least_speed))
            })
            .collect::<Result<_>>()?;
        tiles.extend(found.into_iter().flatten());
        if tiles.iter().filter(|tile| tile.contrast > STRONG).count() >= MOST_TILES {
            break;
        }
    }
    keep_strong(&mut tiles);
    tiles.truncate(MOST_TILES);
    Ok(tiles)
}

/// Leaves the strong tiles in their order, or the strongest.
fn keep_strong(tiles: &mut Vec<Tile>) {
    let mut contrasts: Vec<f64> = tiles.iter().map(|tile| tile.contrast).collect();
    contrasts.sort_unstable_by(|a, b| b.total_cmp(a));
    let Some(&last) = contrasts.get(STRONGEST) else { return };
    tiles.retain(|tile| tile.contrast > STRONG.min(last));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tiles(contrasts: impl Iterator<Item = f64>) -> Vec<Tile> {
        let tile = |contrast| Tile {
            velocity: [9.0, 0.0],
            speed: 9.0,
            points: Vec::new(),
            power: Vec::new(),
            contrast,
        };
        contrasts.map(tile).collect()
    }

    #[test]
    fn keeps_what_is_strong_or_the_strongest() {
        // All of few, however weak.
        let mut few = tiles((0..STRONGEST).map(|_| 6.0));
        keep_strong(&mut few);
        assert_eq!(few.len(), STRONGEST);
        // Two are strong: the best of the others fill up, in their order.
        let mut weak = tiles((0..60).map(|i| if i < 2 { 90.0 } else { 6.0 + 0.1 * f64::from(i) }));
        keep_strong(&mut weak);
        assert_eq!(weak.len(), STRONGEST);
        assert!(weak[1].contrast > STRONG && weak[2].contrast < weak[3].contrast);
        // Enough are strong: only they.
        let mut strong = tiles((0..60).map(|i| if i % 2 == 0 { 25.0 } else { 19.0 }));
        keep_strong(&mut strong);
        assert_eq!(strong.len(), 30);
    }
}
