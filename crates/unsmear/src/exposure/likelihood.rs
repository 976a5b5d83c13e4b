//! Whittle's likelihood of a tile's spectrum, given how long the blur is.
//!
//! The periodogram P of a stationary texture is exponentially distributed about its spectrum S at every wave, so that
//!
//! ```text
//! -log L = sum_w [ log S + P / S ],        S(w) = c g(w) (K2(w) + 1e-6) + m^2 sigma^2
//! K2(w)  = sum over points of the tile and over three neighbouring waves of  weight |K(w; s V, s^2 q)|^2
//! ```
//!
//! (P. Whittle, J. R. Stat. Soc. B 15 (1953) 125-139, doi:10.1111/j.2517-6161.1953.tb00131.x), with g and m one of the
//! shapes of `scene.rs`. The strength c is a tile's own in each of twelve sectors of directions, found by Fisher's scoring
//! in log c: buildings have most of their power near two directions, and with one c for all, the blur found is one that
//! explains this. What tells is how the power rises and falls along each direction; only blur too short for zeros leaves
//! nothing to go by but how it differs between directions.
//!
//! The three waves stand for the leakage of the window, which fills up zeros. At a blur of L px, K2 is a sum of cosines of
//! lags up to L, and leakage multiplies that of lag l by the window's autocorrelation,
//!
//! ```text
//! rho(x) = (1 - x) (2 + cos 2 pi x) / 3 + sin(2 pi x) / (2 pi),      x = l / T      (Hann)
//! ```
//!
//! for which the weights and offsets below stand to .01 up to x = 1/2: 10 % too much leakage make
//! long blur 2 % too long. Each wave counts with the scene's power there, for the lower, being stronger, moves the zeros up
//! (by 1 % of s).
#![allow(
    clippy::inline_always,
    reason = "a helper gets its caller's vector instructions only when inlined"
)]

use std::f64::consts::TAU;

use multiversion::multiversion;

use super::path_spectrum::PathSpectrum;
use super::scene::{SHAPES, SceneSpectra};
use super::tile::Tile;
use super::waves::{SECTORS, Waves};

/// Least share of the texture's power that passes any zero: no model of a path is exact.
const LEAST_PASS: f64 = 1e-6;

/// Weight and offset, in bins of the transform, of the waves that leak into one.
const LEAKAGE: [(f64, f64); 3] = [(0.216, -0.86), (0.568, 0.0), (0.216, 0.86)];

/// Decay of the scene's power spectrum supposed for the leakage.
const LEAKAGE_ALPHA: f64 = 2.5;

/// Steps of Fisher's scoring from a guess and from the strength for the length before: then right to 1e-3.
const STEPS: [usize; 2] = [5, 2];

/// Longest step in log c.
const LONGEST_STEP: f64 = 1.5;

/// Samples whose spectra are multiplied before one logarithm is taken: (1e12)^24 is still a double.
const LOG_BLOCK: usize = 24;

/// -log L of a tile for every shape (outer) and scale (inner).
pub(super) fn curves(
    tile: &Tile,
    waves: &Waves,
    scenes: &SceneSpectra,
    table: &PathSpectrum,
    scales: &[f64],
    noise: f64,
) -> Vec<f64> {
    let mut values = vec![0.0; SHAPES * scales.len()];
    let mut strengths = vec![None; SHAPES * SECTORS];
    let leakage = Leakage::new(tile, waves);
    let mut pass = vec![0f32; waves.len()];
    let mut texture = vec![0.0; waves.len()];
    for (index, &scale) in scales.iter().enumerate() {
        power_passed(tile, waves, &leakage, table, scale, &mut pass);
        for shape in 0..SHAPES {
            let (scene, noise_factor) = scenes.shape(shape);
            for ((value, &g), &k2) in texture.iter_mut().zip(scene).zip(&pass) {
                *value = g * (f64::from(k2) + LEAST_PASS);
            }
            let floor = (noise_factor * noise).powi(2);
            let strengths = &mut strengths[shape * SECTORS..][..SECTORS];
            values[shape * scales.len() + index] =
                over_sectors(&tile.power, &texture, &waves.sectors, floor, strengths);
        }
    }
    values
}

/// Least -log L over the strengths of the sectors, from those for the length before: they hardly change.
fn over_sectors(
    power: &[f64],
    texture: &[f64],
    ends: &[usize],
    floor: f64,
    strengths: &mut [Option<f64>],
) -> f64 {
    let (mut sum, mut first) = (0.0, 0);
    for (&end, known) in ends.iter().zip(strengths) {
        let (power, texture) = (&power[first..end], &texture[first..end]);
        let (start, steps) = match *known {
            Some(strength) => (strength, STEPS[1]),
            None => (first_guess(power, texture), STEPS[0]),
        };
        let (value, strength) = deviance(power, texture, floor, start, steps);
        (sum, first, *known) = (sum + value, end, Some(strength));
    }
    sum
}

/// Waves that leak into each wave of a tile: their shift, and their weight times the scene's power relative to the
/// wave's own.
struct Leakage([([f32; 2], Vec<f32>); LEAKAGE.len()]);

impl Leakage {
    fn new(tile: &Tile, waves: &Waves) -> Self {
        let bin = TAU / waves.side as f64;
        Self(LEAKAGE.map(|(weight, bins)| {
            let shift = tile.velocity.map(|part| bins * bin * part / tile.speed);
            let relative = |(&x, &y): (&f32, &f32)| {
                let (x, y) = (f64::from(x), f64::from(y));
                let shifted = (x + shift[0]).powi(2) + (y + shift[1]).powi(2);
                (weight * ((x * x + y * y) / shifted).powf(LEAKAGE_ALPHA / 2.0)) as f32
            };
            (shift.map(|part| part as f32), waves.x.iter().zip(&waves.y).map(relative).collect())
        }))
    }
}

/// K2 at every wave.
fn power_passed(
    tile: &Tile,
    waves: &Waves,
    leakage: &Leakage,
    table: &PathSpectrum,
    scale: f64,
    out: &mut [f32],
) {
    out.fill(0.0);
    for point in &tile.points {
        let scaled = |vector: [f32; 2], by: f64| vector.map(|part| (f64::from(part) * by) as f32);
        let velocity = scaled(point.velocity, scale);
        let curvature = scaled(point.curvature, scale * scale);
        for (shift, weights) in &leakage.0 {
            let waves = [waves.x.as_slice(), &waves.y, weights];
            table.add(point.weight, waves, *shift, velocity, curvature, out);
        }
    }
}

/// Strength that gives the tile its power.
fn first_guess(power: &[f64], texture: &[f64]) -> f64 {
    power.iter().sum::<f64>() / texture.iter().sum::<f64>().max(f64::MIN_POSITIVE)
}

/// Least -log L over the strength, and that strength.
fn deviance(power: &[f64], texture: &[f64], floor: f64, start: f64, steps: usize) -> (f64, f64) {
    let mut strength = start;
    for _ in 0..steps {
        let (slope, curvature) = scores(power, texture, floor, strength);
        let step = (slope / curvature.max(f64::MIN_POSITIVE)).clamp(-LONGEST_STEP, LONGEST_STEP);
        strength *= step.exp();
    }
    (minus_log_likelihood(power, texture, floor, strength), strength)
}

/// Slope and expected curvature of log L in log c.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn scores(power: &[f64], texture: &[f64], floor: f64, strength: f64) -> (f64, f64) {
    let (mut slopes, mut curvatures) = ([0.0; LANES], [0.0; LANES]);
    for (powers, textures) in blocks(power).zip(blocks(texture)) {
        for lane in 0..LANES {
            let part = strength * textures[lane];
            let inverse = 1.0 / (part + floor);
            let share = part * inverse;
            slopes[lane] += share * (powers[lane] * inverse - 1.0);
            curvatures[lane] += share * share;
        }
    }
    let done = power.len() / LANES * LANES;
    for (power, texture) in power[done..].iter().zip(&texture[done..]) {
        let part = strength * texture;
        let share = part / (part + floor);
        slopes[0] += share * (power / (part + floor) - 1.0);
        curvatures[0] += share * share;
    }
    (slopes.iter().sum(), curvatures.iter().sum())
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn minus_log_likelihood(power: &[f64], texture: &[f64], floor: f64, strength: f64) -> f64 {
    let mut ratios = [0.0; LANES];
    let mut logs = 0.0;
    let mut products = [1.0f64; LANES];
    for (block, (powers, textures)) in blocks(power).zip(blocks(texture)).enumerate() {
        for lane in 0..LANES {
            let spectrum = strength * textures[lane] + floor;
            ratios[lane] += powers[lane] / spectrum;
            products[lane] *= spectrum;
        }
        if block % LOG_BLOCK == LOG_BLOCK - 1 {
            logs += products.iter().map(|product| product.ln()).sum::<f64>();
            products = [1.0; LANES];
        }
    }
    let done = power.len() / LANES * LANES;
    for (power, texture) in power[done..].iter().zip(&texture[done..]) {
        let spectrum = strength * texture + floor;
        ratios[0] += power / spectrum;
        logs += spectrum.ln();
    }
    logs + products.iter().map(|product| product.ln()).sum::<f64>() + ratios.iter().sum::<f64>()
}

/// Samples worked on in step.
const LANES: usize = 8;

/// Full blocks of [`LANES`] samples.
#[inline(always)]
fn blocks(samples: &[f64]) -> impl Iterator<Item = &[f64; LANES]> {
    samples.as_chunks::<LANES>().0.iter()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exposure::scene::ALPHA;
    use crate::exposure::tile::Point;

    /// A tile whose periodogram is the model itself: the likelihood is then greatest at the truth.
    #[test]
    fn is_least_at_the_truth_whatever_the_shape() {
        let (waves, noise) = (Waves::new(48), 1.0);
        let table = PathSpectrum::new(8.0);
        let scenes = SceneSpectra::new(&waves, ALPHA);
        let point = Point { weight: 1.0, velocity: [9.0, 4.0], curvature: [1.0, 2.0] };
        let (velocity, power) = ([9.0, 4.0], vec![0.0; waves.len()]);
        let mut tile = Tile {
            velocity,
            speed: 97f64.sqrt(),
            points: vec![point],
            strain: 0.0,
            power,
            contrast: 1.0,
        };
        let leakage = Leakage::new(&tile, &waves);
        let mut pass = vec![0.0; waves.len()];
        power_passed(&tile, &waves, &leakage, &table, 0.8, &mut pass);
        let scales = [0.7, 0.75, 0.8, 0.85, 0.9];
        for (scene, strength) in [(0, 5e3), (8, 2e3)] {
            let (spectrum, _) = scenes.shape(scene);
            for ((power, g), k2) in tile.power.iter_mut().zip(spectrum).zip(&pass) {
                *power = strength * g * f64::from(*k2) + noise * noise;
            }
            let values = curves(&tile, &waves, &scenes, &table, &scales, noise);
            let curve = &values[scene * scales.len()..][..scales.len()];
            assert!(curve.iter().all(|&value| value >= curve[2]), "{curve:?}");
        }
    }

    #[test]
    fn leakage_is_the_autocorrelation_of_the_window() {
        for i in 0..=50 {
            let x = f64::from(i) / 100.0;
            let cosine = |(weight, bins): (f64, f64)| weight * (TAU * bins * x).cos();
            let stands: f64 = LEAKAGE.map(cosine).iter().sum();
            let rho = (1.0 - x) * (2.0 + (TAU * x).cos()) / 3.0 + (TAU * x).sin() / TAU;
            // As near as three waves come up to a lag of half a tile.
            assert!((stands - rho).abs() < 0.011, "{x}: {stands} {rho}");
        }
    }

    #[test]
    fn strength_and_likelihood_equal_their_definitions() {
        let texture: Vec<f64> = (0..101).map(|i| 1.0 / (1.0 + f64::from(i))).collect();
        let power: Vec<f64> = texture.iter().map(|t| 7.0 * t + 0.5).collect();
        let (value, strength) = deviance(&power, &texture, 0.5, 1.0, STEPS[0]);
        // Five steps from a seventh of the truth.
        assert!((strength - 7.0).abs() < 1e-3, "{strength}");
        let direct: f64 = texture
            .iter()
            .zip(&power)
            .map(|(t, p)| (strength * t + 0.5).ln() + p / (strength * t + 0.5))
            .sum();
        assert!((value - direct).abs() < 1e-10, "{value} {direct}");
    }
}
