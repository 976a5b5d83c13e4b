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
//! The low quantile passes over textured blocks; 1.08 makes up for its bias (a mean over 256 correlated samples spreads
//! by about 5 %). Where the motion is known, `noise::estimate_noise` measures along it instead and is exact even in
//! blurred texture. Units of the picture. Validity: reads low where the picture is clipped, high where every block is
//! textured; NaN pixels make their block unknown, and a picture without a known block has the answer 0.
//! Reference: J. Immerkaer, "Fast noise variance estimation", Comput. Vis. Image Underst. 64 (1996) 300-302,
//! [10.1006/cviu.1996.0060](https://doi.org/10.1006/cviu.1996.0060), equation for the mean absolute response.

use std::f64::consts::FRAC_PI_2;

use rayon::prelude::*;

use crate::control::Control;
use crate::error::{Error, Result};

/// Side of a block, px.
const BLOCK: usize = 16;

/// Share of the blocks supposed to be free of texture.
const QUANTILE: f64 = 0.05;

/// Makes up for the low quantile of a spread estimate.
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
        let mut sums = vec![0.0f64; columns];
        for y in 0..BLOCK {
            let at = |dy: usize| &plane[(band * BLOCK + y + dy) * width..][..width];
            add_row(at(0), at(1), at(2), &mut sums);
        }
        Ok(sums)
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

/// Adds the absolute responses of one row to the sum of each block.
fn add_row(above: &[f32], here: &[f32], below: &[f32], sums: &mut [f64]) {
    for (block, sum) in sums.iter_mut().enumerate() {
        let [above, here, below] =
            [above, here, below].map(|row| &row[block * BLOCK..][..BLOCK + 2]);
        let mut total = 0.0f32;
        for x in 0..BLOCK {
            let outer = above[x] + above[x + 2] + below[x] + below[x + 2];
            let cross = above[x + 1] + below[x + 1] + here[x] + here[x + 2];
            total += (outer - 2.0 * cross + 4.0 * here[x + 1]).abs();
        }
        *sum += f64::from(total);
    }
}
