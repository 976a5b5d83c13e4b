//! From likelihoods of tiles to one length and the trust in it.
//!
//! The tiles' curves are summed for each shape of the scene's spectrum; the shape and scale of the least sum win, a
//! parabola through three points on a logarithmic axis puts the scale between its samples. Two numbers tell how far
//! to trust it:
//!
//! ```text
//! vote    share of the shapes whose own optimum is within 12 % of the winner's, of those that explain the tiles nearly as
//!         well: -log L at most .02 per sample above the winner's
//! spread  deviation of log s over resamplings of the tiles with replacement (bootstrap, fixed seed)
//! ```
//!
//! (B. Efron, Ann. Statist. 7 (1979) 1-26, doi:10.1214/aos/1176344552).

use super::likelihood::SHAPES;
use super::random::Random;

/// Distance from the winner within which a shape agrees, in log s.
const AGREEMENT: f64 = 0.12;

/// How much worse than the winner, in -log L per sample, a shape may be that has a vote: half as much noise again as
/// there is costs .04 where blur leaves little else.
const PLAUSIBLE: f64 = 0.02;

/// Deviations of a normal distribution that its middle 80 % span.
const MIDDLE_DEVIATIONS: f64 = 2.563;

/// Resamplings of the tiles.
const RESAMPLINGS: usize = 30;

/// A winner among shapes and scales.
pub(super) struct Optimum {
    /// Log of the scale.
    pub(super) log_scale: f64,
    /// Whether the optimum lies within the range, not at its end.
    pub(super) inside: bool,
    /// Own optimum of each shape, log of the scale.
    pub(super) of_shapes: [f64; SHAPES],
    /// -log L there.
    pub(super) leasts: [f64; SHAPES],
}

/// The optimum of curves (shapes, scales) summed over `tiles`.
pub(super) fn optimum<'a>(tiles: impl Iterator<Item = &'a [f64]>, log_scales: &[f64]) -> Optimum {
    let n = log_scales.len();
    let mut sum = vec![0.0; SHAPES * n];
    for curve in tiles {
        sum.iter_mut().zip(curve).for_each(|(sum, value)| *sum += value);
    }
    let (mut of_shapes, mut leasts) = ([0.0; SHAPES], [0.0; SHAPES]);
    let (mut best, mut shape, mut inside) = (f64::INFINITY, 0, false);
    for (number, curve) in sum.chunks(n).enumerate() {
        let least = (0..n).fold(0, |least, i| if curve[i] < curve[least] { i } else { least });
        of_shapes[number] = parabola(curve, log_scales, least);
        leasts[number] = curve[least];
        if curve[least] < best {
            (best, shape, inside) = (curve[least], number, least > 0 && least + 1 < n);
        }
    }
    Optimum { log_scale: of_shapes[shape], inside, of_shapes, leasts }
}

/// Least of the parabola through the sample `least` and its neighbours, equally spaced.
fn parabola(curve: &[f64], log_scales: &[f64], least: usize) -> f64 {
    if least == 0 || least + 1 == curve.len() {
        return log_scales[least];
    }
    let (before, at, after) = (curve[least - 1], curve[least], curve[least + 1]);
    let bend = before - 2.0 * at + after;
    let offset = if bend > 0.0 { 0.5 * (before - after) / bend } else { 0.0 };
    log_scales[least] + offset.clamp(-0.5, 0.5) * (log_scales[least + 1] - log_scales[least])
}

/// Share of the plausible shapes that agree with `log_scale`, of `samples` waves of tiles.
pub(super) fn vote(found: &Optimum, log_scale: f64, samples: usize) -> f64 {
    let best = found.leasts.iter().copied().fold(f64::INFINITY, f64::min);
    let limit = best + PLAUSIBLE * samples as f64;
    let plausible = found.of_shapes.iter().zip(&found.leasts).filter(|(_, least)| **least <= limit);
    let agree = plausible.clone().filter(|(own, _)| (**own - log_scale).abs() <= AGREEMENT);
    agree.count() as f64 / plausible.count() as f64
}

/// Deviation of log s over resamplings of the tiles: the middle 80 % of them, which span 2.56 deviations of a normal
/// distribution; a tenth may stray to either side.
pub(super) fn spread(tiles: &[&[f64]], log_scales: &[f64], random: &mut Random) -> f64 {
    let mut found: Vec<f64> = (0..RESAMPLINGS)
        .map(|_| {
            let drawn = (0..tiles.len()).map(|_| tiles[random.below(tiles.len())]);
            optimum(drawn, log_scales).log_scale
        })
        .collect();
    found.sort_unstable_by(f64::total_cmp);
    let tenth = RESAMPLINGS / 10;
    (found[RESAMPLINGS - 1 - tenth] - found[tenth]) / MIDDLE_DEVIATIONS
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Curves of tiles whose optima lie at `at`, the same for all shapes.
    fn tile(at: f64, log_scales: &[f64]) -> Vec<f64> {
        (0..SHAPES).flat_map(|_| log_scales.iter().map(move |s| (s - at).powi(2))).collect()
    }

    #[test]
    fn finds_the_mean_of_agreeing_tiles_between_the_samples() {
        let log_scales: Vec<f64> = (-5..=5).map(|i| f64::from(i) * 0.1).collect();
        let tiles = [tile(0.1, &log_scales), tile(0.17, &log_scales)];
        let found = optimum(tiles.iter().map(Vec::as_slice), &log_scales);
        assert!((found.log_scale - 0.135).abs() < 1e-12 && found.inside);
        assert_eq!(vote(&found, found.log_scale, 100), 1.0);
        // Half of the shapes say something else, at first as well as the others, then worse than .02 per sample.
        let mut divided = Optimum { leasts: [0.0; SHAPES], ..found };
        divided.of_shapes[..SHAPES / 2].fill(1.0);
        assert_eq!(vote(&divided, divided.log_scale, 100), 0.5);
        divided.leasts[..SHAPES / 2].fill(2.1);
        assert_eq!(vote(&divided, divided.log_scale, 100), 1.0);
        let views: Vec<&[f64]> = tiles.iter().map(Vec::as_slice).collect();
        let spread = spread(&views, &log_scales, &mut Random::new(1));
        // Two draws of two values 0.07 apart: the same one twice in half of the cases, so the middle 80 % span 0.07.
        assert!((spread - 0.07 / MIDDLE_DEVIATIONS).abs() < 1e-12, "{spread}");
        let far = [tile(2.0, &log_scales)];
        assert!(!optimum(far.iter().map(Vec::as_slice), &log_scales).inside);
    }
}
