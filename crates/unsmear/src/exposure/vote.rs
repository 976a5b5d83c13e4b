//! From likelihoods of tiles to one length and the trust in it.
//!
//! The tiles' curves, each the least over shapes of the scene's spectrum (`scene.rs`), are summed; the scale of the least
//! sum wins, a parabola through three points on a logarithmic axis puts it between its samples. Two numbers tell how far
//! to trust it:
//!
//! ```text
//! vote    share of the kinds of scene whose own optimum is within 12 % of it, of those that explain the tiles nearly as
//!         well as the best: -log L at most .02 per sample above
//! spread  deviation of log s over resamplings of the tiles with replacement (bootstrap, fixed seed)
//! ```
//!
//! (B. Efron, Ann. Statist. 7 (1979) 1-26, doi:10.1214/aos/1176344552).

use super::random::Random;
use super::scene::KINDS;

/// Distance from the winner within which a kind agrees, in log s.
const AGREEMENT: f64 = 0.12;

/// How much worse than the best, in -log L per sample, a kind may be that has a vote: half as much noise again as
/// there is costs .04 where blur leaves little else.
const PLAUSIBLE: f64 = 0.02;

/// Deviations of a normal distribution that its middle 80 % span.
const MIDDLE_DEVIATIONS: f64 = 2.563;

/// Resamplings of the tiles.
const RESAMPLINGS: usize = 30;

/// The scale that explains tiles best.
pub(super) struct Optimum {
    /// Its log.
    pub(super) log_scale: f64,
    /// Whether it lies within the range, not at its end.
    pub(super) inside: bool,
    /// Own optimum of each kind of scene, log of the scale.
    pub(super) of_kinds: [f64; KINDS],
    /// -log L there.
    pub(super) leasts: [f64; KINDS],
}

/// The optimum of curves (kinds and any, scales) summed over `tiles`.
pub(super) fn optimum<'a>(tiles: impl Iterator<Item = &'a [f64]>, log_scales: &[f64]) -> Optimum {
    let n = log_scales.len();
    let mut sum = vec![0.0; (KINDS + 1) * n];
    for curve in tiles {
        sum.iter_mut().zip(curve).for_each(|(sum, value)| *sum += value);
    }
    let (of_kinds, any) = sum.split_at(KINDS * n);
    let (log_scale, at) = parabola(any, log_scales);
    let kinds: Vec<(f64, usize)> =
        of_kinds.chunks(n).map(|curve| parabola(curve, log_scales)).collect();
    Optimum {
        log_scale,
        inside: at > 0 && at + 1 < n,
        of_kinds: std::array::from_fn(|kind| kinds[kind].0),
        leasts: std::array::from_fn(|kind| of_kinds[kind * n + kinds[kind].1]),
    }
}

/// The curves of `tiles` for any kind of scene, summed, at `n` scales.
pub(super) fn sum<'a>(tiles: impl Iterator<Item = &'a [f64]>, n: usize) -> Vec<f64> {
    let mut sum = vec![0.0; n];
    for curve in tiles {
        sum.iter_mut().zip(&curve[KINDS * n..]).for_each(|(sum, value)| *sum += value);
    }
    sum
}

/// Least of the parabola through the least sample and its neighbours, equally spaced, and the number of that sample.
pub(super) fn parabola(curve: &[f64], log_scales: &[f64]) -> (f64, usize) {
    let least = (0..curve.len()).fold(0, |at, i| if curve[i] < curve[at] { i } else { at });
    if least == 0 || least + 1 == curve.len() {
        return (log_scales[least], least);
    }
    let (before, at, after) = (curve[least - 1], curve[least], curve[least + 1]);
    let bend = before - 2.0 * at + after;
    let offset = if bend > 0.0 { 0.5 * (before - after) / bend } else { 0.0 };
    let step = log_scales[least + 1] - log_scales[least];
    (log_scales[least] + offset.clamp(-0.5, 0.5) * step, least)
}

/// Share of the plausible kinds that agree with the optimum of any, of `samples` waves of tiles.
pub(super) fn vote(found: &Optimum, samples: usize) -> f64 {
    let best = found.leasts.iter().copied().fold(f64::INFINITY, f64::min);
    let limit = best + PLAUSIBLE * samples as f64;
    let plausible = found.of_kinds.iter().zip(&found.leasts).filter(|(_, least)| **least <= limit);
    let agree = plausible.clone().filter(|(own, _)| (**own - found.log_scale).abs() <= AGREEMENT);
    agree.count() as f64 / plausible.count() as f64
}

/// Deviation of log s over resamplings of the tiles: the middle 80 % of them, which span 2.56 deviations of a normal
/// distribution; a tenth may stray to either side.
pub(super) fn spread(tiles: &[&[f64]], log_scales: &[f64], random: &mut Random) -> f64 {
    let mut found: Vec<f64> = (0..RESAMPLINGS)
        .map(|_| {
            let drawn = (0..tiles.len()).map(|_| tiles[random.below(tiles.len())]);
            parabola(&sum(drawn, log_scales.len()), log_scales).0
        })
        .collect();
    found.sort_unstable_by(f64::total_cmp);
    let tenth = RESAMPLINGS / 10;
    (found[RESAMPLINGS - 1 - tenth] - found[tenth]) / MIDDLE_DEVIATIONS
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Curves of tiles whose optima lie at `at`, the same for all kinds.
    fn tile(at: f64, log_scales: &[f64]) -> Vec<f64> {
        (0..=KINDS).flat_map(|_| log_scales.iter().map(move |s| (s - at).powi(2))).collect()
    }

    #[test]
    fn finds_the_mean_of_agreeing_tiles_between_the_samples() {
        let log_scales: Vec<f64> = (-5..=5).map(|i| f64::from(i) * 0.1).collect();
        let tiles = [tile(0.1, &log_scales), tile(0.17, &log_scales)];
        let found = optimum(tiles.iter().map(Vec::as_slice), &log_scales);
        assert!((found.log_scale - 0.135).abs() < 1e-12 && found.inside);
        assert_eq!(vote(&found, 100), 1.0);
        // Half of the kinds say something else, at first as well as the others, then worse than .02 per sample.
        let mut divided = Optimum { leasts: [0.0; KINDS], ..found };
        divided.of_kinds[..KINDS / 2].fill(1.0);
        assert_eq!(vote(&divided, 100), 0.5);
        divided.leasts[..KINDS / 2].fill(2.1);
        assert_eq!(vote(&divided, 100), 1.0);
        let views: Vec<&[f64]> = tiles.iter().map(Vec::as_slice).collect();
        let spread = spread(&views, &log_scales, &mut Random::new(1));
        // Two draws of two values 0.07 apart: the same one twice in half of the cases, so the middle 80 % span 0.07.
        assert!((spread - 0.07 / MIDDLE_DEVIATIONS).abs() < 1e-12, "{spread}");
        let far = [tile(2.0, &log_scales)];
        assert!(!optimum(far.iter().map(Vec::as_slice), &log_scales).inside);
    }
}
