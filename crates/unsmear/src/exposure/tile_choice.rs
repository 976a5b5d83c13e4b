//! Which tiles of the frames are used: a random hundred of those that tell something, large ones where motion is large.
//!
//! Corners lie half a tile apart, those of the smallest tiles a quarter if that is not enough: a small mover has few
//! places for a tile that holds nothing else. A fixed seed puts them in an order, in which they are looked at until
//! enough have been found; so a long clip costs no more than a picture, and the same call finds the same tiles.

use ndarray::s;
use rayon::prelude::*;

use super::frame::ExposureFrame;
use super::random::Random;
use super::tile::Tile;
use super::waves::Waves;
use crate::control::Control;
use crate::error::Result;
use crate::fourier::Fft2;
use crate::real::Real;

/// Tiles looked at together; a fixed number, so that the result does not depend on threads.
const BATCH: usize = 128;

/// A size of tiles.
struct Size {
    /// px.
    side: usize,
    /// Between corners, px.
    step: usize,
    /// Shorter side of the smallest picture that is cut up so, px.
    shortest: usize,
    /// Slowest and fastest picture, by the median of its speeds, px/frame.
    speeds: (f64, f64),
    /// Not tried if larger ones gave so many.
    unless: usize,
    /// Most tiles used: beyond them the model, not the number of tiles, limits what is found.
    most: usize,
}

/// No limit to a speed.
const ANY: f64 = f64::INFINITY;

/// Median speed of a scene that is mostly at rest, px/frame.
const AT_REST: f64 = 1.0;

/// Tiles of 32 px from which those of 24 are not tried: seven read a blur of 15 px, of which the smaller, though more,
/// know nothing.
const FEW_TILES: usize = 5;

/// Sizes, the greatest first: zeros of a blur of over half a tile run into each other. The least are for small movers
/// before a scene at rest.
const SIZES: [Size; 6] = [
    Size {
        side: 128,
        step: 64,
        shortest: 288,
        speeds: (20.0, ANY),
        unless: ENOUGH_TILES,
        most: 28,
    },
    Size { side: 64, step: 32, shortest: 256, speeds: (0.0, ANY), unless: ENOUGH_TILES, most: 100 },
    Size { side: 48, step: 24, shortest: 96, speeds: (0.0, ANY), unless: ENOUGH_TILES, most: 100 },
    Size { side: 32, step: 16, shortest: 32, speeds: (0.0, ANY), unless: ENOUGH_TILES, most: 100 },
    Size { side: 32, step: 8, shortest: 32, speeds: (0.0, ANY), unless: ENOUGH_TILES, most: 100 },
    Size { side: 24, step: 6, shortest: 32, speeds: (0.0, AT_REST), unless: FEW_TILES, most: 100 },
];

/// Every so many px in both directions the speed is looked at for the median.
const STRIDE: usize = 8;

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
    let speed = median_speed(frames);
    for size in SIZES {
        if best.as_ref().is_some_and(|(_, most)| most.len() >= size.unless) {
            break;
        }
        if height.min(width) < size.shortest || !(size.speeds.0..=size.speeds.1).contains(&speed) {
            continue;
        }
        let waves = Waves::new(size.side);
        let tiles = tiles_of(frames, &waves, &size, (noise, least_speed), random, control)?;
        if tiles.len() > best.as_ref().map_or(0, |(_, most)| most.len()) {
            best = Some((waves, tiles));
        }
    }
    Ok(best)
}

/// Median of the known speeds, px/frame; 0 if none is known.
fn median_speed<T: Real>(frames: &[ExposureFrame<'_, T>]) -> f64 {
    let mut speeds: Vec<f64> = Vec::new();
    for frame in frames {
        let [u, v] = [&frame.velocity.u, &frame.velocity.v]
            .map(|field| field.slice(s![..;STRIDE, ..;STRIDE]));
        let known = u.iter().zip(&v).map(|(u, v)| u.as_f64().hypot(v.as_f64()));
        speeds.extend(known.filter(|speed| speed.is_finite()));
    }
    speeds.sort_unstable_by(f64::total_cmp);
    speeds.get(speeds.len() / 2).copied().unwrap_or(0.0)
}

/// Tiles of a size, at most as many as it says, faster than `least_speed` (px/frame) that tell something.
fn tiles_of<T: Real>(
    frames: &[ExposureFrame<'_, T>],
    waves: &Waves,
    size: &Size,
    (noise, least_speed): (f64, f64),
    random: &mut Random,
    control: &Control,
) -> Result<Vec<Tile>> {
    let (side, most) = (size.side, size.most);
    let (height, width) = frames[0].image.dim();
    let starts = |n: usize| (0..=n - side).step_by(size.step);
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
        if tiles.iter().filter(|tile| tile.contrast > STRONG).count() >= most {
            break;
        }
    }
    keep_strong(&mut tiles);
    tiles.truncate(most);
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
            strain: 0.0,
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
