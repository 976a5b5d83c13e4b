//! Standard deviation of white noise in one picture of unknown motion.
//!
//! The difference of two Laplacians cancels planes, edges along the axes and most texture, and passes white noise:
//!
//! ```text
//! L     = [[1, -2, 1], [-2, 4, -2], [1, -2, 1]] * picture            (standard deviation 6 sigma)
//! s_b   = sqrt(pi / 2) / 6  mean over block b of |L|                 blocks of 16 x 16 px
//! sigma = 1.08 x the 5 % quantile of s_b over the blocks
//! ```
//!
//! The low quantile passes over textured blocks. The means over 256 correlated samples spread by 8.6 %, so that their
//! quantile lies 14 % low; 1.08 makes up for about half and leaves the rest to the texture that even the quietest blocks
//! of a photograph have. Where the motion is known, `noise::estimate_noise` measures along it instead, blurred texture
//! included. Units of the picture. Validity: 6 % low where blocks are free of all texture; low where the picture is
//! clipped; high where every block is textured. NaN pixels make their block unknown; a picture without a known block,
//! or smaller than 18 x 18 px, has the answer 0.
//! Reference: J. Immerkaer, "Fast noise variance estimation", Comput. Vis. Image Underst. 64 (1996) 300-302,
//! [10.1006/cviu.1996.0060](https://doi.org/10.1006/cviu.1996.0060), equation for the mean absolute response.

use std::f64::consts::FRAC_PI_2;

use multiversion::multiversion;
use rayon::prelude::*;

use crate::control::Control;
use crate::error::{Error, Result};

/// Side of a block, px.
const BLOCK: usize = 16;

/// Share of the blocks supposed to be free of texture.
const QUANTILE: f64 = 0.05;

/// Makes up for half of what the low quantile loses.
const BIAS: f64 = 1.08;

/// Noise of `plane` (packed rows of `width` samples, `height` of them); see the [module](self).
///
/// # Errors
/// [`Error::Shape`] when the plane has not height x width samples; [`Error::Cancelled`].
pub fn immerkaer_noise(
    plane: &[f32],
    height: usize,
    width: usize,
    control: &Control,
) -> Result<f64> {
    if plane.len() != height * width {
        return Err(Error::shape("plane", format!("({height} x {width},)"), &[plane.len()]));
    }
    if height < BLOCK + 2 || width < BLOCK + 2 {
        return Ok(0.0);
    }
    let (rows, columns) = ((height - 2) / BLOCK, (width - 2) / BLOCK);
    let bands = (0..rows).into_par_iter().map(|band| {
        control.check()?;
        let mut sums = vec![[0.0f32; BLOCK]; columns];
        for y in 0..BLOCK {
            let at = |dy: usize| &plane[(band * BLOCK + y + dy) * width..][..width];
            add_row(at(0), at(1), at(2), &mut sums);
        }
        let total = |sums: &[f32; BLOCK]| sums.iter().map(|&sum| f64::from(sum)).sum();
        Ok(sums.iter().map(total).collect::<Vec<f64>>())
    });
    let mut means: Vec<f64> = bands.collect::<Result<Vec<_>>>()?.concat();
    means.retain(|mean| !mean.is_nan());
    if means.is_empty() {
        return Ok(0.0);
    }
    let rank = (QUANTILE * (means.len() - 1) as f64).round() as usize;
    let (_, sum, _) = means.select_nth_unstable_by(rank, f64::total_cmp);
    Ok(BIAS * FRAC_PI_2.sqrt() / 6.0 * *sum / (BLOCK * BLOCK) as f64)
}

/// Adds the absolute responses of one row to the sums of each block, one for each of its columns.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn add_row(above: &[f32], here: &[f32], below: &[f32], sums: &mut [[f32; BLOCK]]) {
    for (block, sums) in sums.iter_mut().enumerate() {
        let [above, here, below] =
            [above, here, below].map(|row| &row[block * BLOCK..][..BLOCK + 2]);
        for x in 0..BLOCK {
            let outer = above[x] + above[x + 2] + below[x] + below[x + 2];
            let cross = above[x + 1] + below[x + 1] + here[x] + here[x + 2];
            sums[x] += (outer - 2.0 * cross + 4.0 * here[x + 1]).abs();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ramp with waves along the axes, all of which the mask cancels, and noise of deviation `sigma`: the sum of twelve uniform numbers, nearly Gaussian as the factor sqrt(pi / 2) supposes.
    fn picture(height: usize, width: usize, sigma: f32) -> Vec<f32> {
        let mut state = 7u32;
        let mut uniform = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32 - 0.5
        };
        let at = |i: usize, noise: f32| {
            let (y, x) = ((i / width) as f32, (i % width) as f32);
            100.0 + 0.3 * y - 0.2 * x + 20.0 * (0.4 * x).sin() + 20.0 * (0.4 * y).cos() + noise
        };
        (0..height * width)
            .map(|i| at(i, sigma * (0..12).map(|_| uniform()).sum::<f32>()))
            .collect()
    }

    fn measured(plane: &[f32], height: usize, width: usize) -> f64 {
        immerkaer_noise(plane, height, width, &Control::new()).unwrap()
    }

    #[test]
    fn measures_white_noise_on_structure_along_the_axes() {
        for sigma in [0.0, 2.0, 10.0] {
            let estimate = measured(&picture(200, 240, sigma), 200, 240);
            // 6 % low in the mean; with some 170 blocks the quantile itself spreads by 2 %. Rounding of values around
            // 130 gives 1e-5.
            let error = estimate - 0.94 * f64::from(sigma);
            assert!(error.abs() <= 1e-4 + 0.06 * f64::from(sigma), "{estimate} for {sigma}");
        }
    }

    #[test]
    fn passes_over_texture_in_most_of_the_picture() {
        let (height, width) = (160, 160);
        let mut plane = picture(height, width, 3.0);
        let clean = measured(&plane, height, width);
        for (i, sample) in plane.iter_mut().enumerate() {
            let (y, x) = (i / width, i % width);
            // A checkerboard, the mask's strongest response, in three quarters of the picture.
            if y >= 80 || x >= 80 {
                *sample += if (x + y) % 2 == 0 { 50.0 } else { -50.0 };
            }
        }
        // The quantile moves from 5 % of all blocks to 20 % of the quiet ones, 7 % higher for this spread; either has
        // an error of a few per cent with so few blocks. The checkerboard alone would read 180.
        let textured = measured(&plane, height, width);
        assert!((1.0..1.2).contains(&(textured / clean)), "{textured} after {clean}");
    }

    #[test]
    fn unknown_or_small_pictures_have_no_measurable_noise() {
        assert_eq!(measured(&[f32::NAN; 40 * 40], 40, 40), 0.0);
        assert_eq!(measured(&[1.0; 17 * 40], 17, 40), 0.0);
        let error = immerkaer_noise(&[0.0; 5], 2, 3, &Control::new());
        assert_eq!(error, Err(Error::shape("plane", "(2 x 3,)", &[5])));
        let control = Control::new();
        control.cancel();
        assert_eq!(immerkaer_noise(&[0.0; 400], 20, 20, &control), Err(Error::Cancelled));
    }
}
