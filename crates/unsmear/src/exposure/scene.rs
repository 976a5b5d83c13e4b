//! What the spectrum of a scene may look like.
//!
//! ```text
//! g(w) = |w|^-alpha exp(-tau |w|^2),      alpha in {2.5, 3.5},   tau in {0, .2, .5} px^2
//! ```
//!
//! Amplitudes of photographs fall about as 1/|w| (D. J. Field, J. Opt. Soc. Am. A 4 (1987) 2379-2394,
//! doi:10.1364/JOSAA.4.002379), edges faster, and lens and sampling soften both (tau). With noise as measured or half as
//! much again, for it is not white in every picture, these are [`SHAPES`] shapes. A tile shows a roof or a hedge: each has
//! the shape that suits it best at every length of blur. How far the answer hangs on this freedom is asked of the
//! [`KINDS`]: all tiles with one alpha, or with one tau, under either noise.

use super::waves::Waves;

/// Decays of the scene's power spectrum.
pub(super) const ALPHA: [f64; 2] = [2.5, 3.5];

/// Softness of lens and sampling, px^2.
const SOFTNESS: [f64; 3] = [0.0, 0.2, 0.5];

/// Noise in the band, in units of the measured one.
const NOISE_FACTORS: [f64; 2] = [1.0, 1.5];

/// Number of shapes tried.
pub(super) const SHAPES: usize = ALPHA.len() * SOFTNESS.len() * NOISE_FACTORS.len();

/// Number of restrictions of the shapes that vote.
pub(super) const KINDS: usize = NOISE_FACTORS.len() * (ALPHA.len() + SOFTNESS.len());

/// Spectra of the scene at the waves, one per pair of alpha and tau.
pub(super) struct SceneSpectra(Vec<Vec<f64>>);

impl SceneSpectra {
    /// For two decays, of which the shapes are made.
    pub(super) fn new(waves: &Waves, alpha: [f64; 2]) -> Self {
        let spectrum = |alpha: f64, tau: f64| {
            let at = |(&x, &y): (&f32, &f32)| {
                let square = f64::from(x).powi(2) + f64::from(y).powi(2);
                square.powf(-alpha / 2.0) * (-tau * square).exp()
            };
            waves.x.iter().zip(&waves.y).map(at).collect()
        };
        let pairs = alpha.iter().flat_map(|&alpha| SOFTNESS.map(move |tau| (alpha, tau)));
        Self(pairs.map(|(alpha, tau)| spectrum(alpha, tau)).collect())
    }

    /// Power of the scene at the waves, and the factor of the noise's deviation, of the shape with this number.
    pub(super) fn shape(&self, number: usize) -> (&[f64], f64) {
        let noises = NOISE_FACTORS.len();
        (&self.0[number / noises], NOISE_FACTORS[number % noises])
    }
}

/// Least of the curves of [`SHAPES`] shapes, each of `n` values, within each kind, and last within all.
pub(super) fn least_of_kinds(of_shapes: &[f64], n: usize) -> Vec<f64> {
    let mut least = vec![f64::INFINITY; (KINDS + 1) * n];
    for (number, curve) in of_shapes.chunks(n).enumerate() {
        for kind in kinds_of(number) {
            let least = &mut least[kind * n..][..n];
            least.iter_mut().zip(curve).for_each(|(least, &value)| *least = least.min(value));
        }
    }
    least
}

/// The kinds that a shape belongs to: by alpha, by tau, and all.
fn kinds_of(shape: usize) -> [usize; 3] {
    let (pair, noise) = (shape / NOISE_FACTORS.len(), shape % NOISE_FACTORS.len());
    let (alpha, tau) = (pair / SOFTNESS.len(), pair % SOFTNESS.len());
    let first = noise * (ALPHA.len() + SOFTNESS.len());
    [first + alpha, first + ALPHA.len() + tau, KINDS]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_is_the_least_of_its_shapes() {
        // Shape k has the curve (k, -k).
        let curves: Vec<f64> = (0..SHAPES).flat_map(|k| [k as f64, -(k as f64)]).collect();
        let least = least_of_kinds(&curves, 2);
        let kind = |number: usize| (least[2 * number], -least[2 * number + 1]);
        // The first decay under the first noise: shapes 0, 2, 4; the last softness under the second: 5 and 11.
        assert_eq!(kind(0), (0.0, 4.0));
        assert_eq!(kind(KINDS - 1), (5.0, 11.0));
        assert_eq!(kind(KINDS), (0.0, 11.0));
        let members: usize = (0..SHAPES).map(|shape| kinds_of(shape).len() - 1).sum();
        assert_eq!(members, 2 * SHAPES);
        assert!(least.iter().all(|value| value.is_finite()), "no kind is empty");
    }
}
