//! The share assumed for blur too short to leave a zero in the band.
//!
//! Blur of 1 or 2 px only dims: waves along the motion more than waves across. So does a scene that is softer one way
//! than the other, and each shape of its spectrum explains the same tiles by another length. None is right for sure, and
//! each has its say, within what shutters do:
//!
//! ```text
//! log s = mean over shapes of log clamp(s_k, 0.4, 1.2),      s <= 0.8
//! ```
//!
//! s_k the optimum of shape k over all tiles. Shutters open all the time and half of it give .65 to .8 and .45 to .8 on
//! photographs that move by 1.5 px. Where no tile tells anything either, s is 0.8. The bound and the least share hold
//! the harm of a mistake down: blur assumed too long costs several times what blur assumed too short does.

use super::scene::SHAPES;
use super::tile::Tile;
use super::tile_likelihoods::TileLikelihoods;
use super::vote::parabola;
use super::waves::Waves;
use crate::control::Control;
use crate::error::Result;

/// Decays of the scene's power spectrum, on either side of the usual.
const ALPHA: [f64; 2] = [2.0, 3.0];

/// s when nothing tells, and the most assumed of short blur.
pub(super) const PRIOR: f64 = 0.8;

/// Least and greatest optimum of a shape that counts as it is.
const CREDIBLE: (f64, f64) = (0.4, 1.2);

/// Slowest tile that blur dims at all, px/frame.
pub(super) const SLOWEST: f64 = 0.7;

/// Tiles from which slower ones, which tell less each, are not asked.
pub(super) const ENOUGH_TILES: usize = 12;

/// s of `tiles` by how much less is seen along the motion than across it; `log_scales` are those tried.
pub(super) fn by_dimming(
    tiles: &[Tile],
    waves: &Waves,
    log_scales: &[f64],
    noise: f64,
    control: &Control,
) -> Result<f64> {
    let (n, most) = (log_scales.len(), log_scales[log_scales.len() - 1].exp());
    let waves = waves.isotropic();
    let likelihoods = TileLikelihoods::new(tiles, &waves, ALPHA, most, noise, control)?;
    let mut sum = vec![0.0; SHAPES * n];
    for curves in likelihoods.of_shapes(tiles, log_scales)? {
        sum.iter_mut().zip(curves).for_each(|(sum, value)| *sum += value);
    }
    let of_shapes: Vec<f64> = sum.chunks(n).map(|curve| parabola(curve, log_scales).0).collect();
    Ok(cautious(&of_shapes))
}

/// s, see the [module](self), of the logarithms of the optima.
fn cautious(of_shapes: &[f64]) -> f64 {
    let say = |log: &f64| log.clamp(CREDIBLE.0.ln(), CREDIBLE.1.ln());
    let mean = of_shapes.iter().map(say).sum::<f64>() / of_shapes.len() as f64;
    mean.exp().min(PRIOR)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shape_has_a_say_and_none_more_than_that() {
        let found = |s: [f64; 4]| cautious(&s.map(f64::ln));
        assert!((found([0.5; 4]) - 0.5).abs() < 1e-12);
        assert!((found([0.4, 0.9, 0.4, 0.9]) - 0.6).abs() < 1e-12);
        // An absurd optimum counts like the least credible.
        assert!((found([0.01, 0.5, 0.5, 0.5]) - found([0.4, 0.5, 0.5, 0.5])).abs() < 1e-12);
        assert!((found([1.1; 4]) - PRIOR).abs() < 1e-12);
    }
}
