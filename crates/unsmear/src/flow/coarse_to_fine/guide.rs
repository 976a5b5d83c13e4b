//! What the reference picture says about where motion may change.
//!
//! Motion boundaries lie on edges of the picture. From the channels `I_c` of the reference frame,
//! smoothed by a Gaussian of deviation `sigma` px, the smoothness between neighbours is weighted
//!
//! ```text
//! e_x = exp(-k d_x/s) + 0.05,   d_x = rms or greatest over channels of |I_c(x + 1) - I_c(x)|
//! s = sqrt(mean (d_x^2 + d_y^2)) + floor
//! ```
//!
//! alike along y. Only the reference frame is asked, so that a change of lighting between the frames
//! cannot move the weights. The same channels, hardly smoothed and divided by the square root of
//! their number, guide the weighted median.
//!
//! Units: grey levels; `k` (`sensitivity`) and `e` dimensionless, e in (0.05, 1.05].
//! Reference: L. Alvarez, J. Esclarin, M. Lefebure, J. Sanchez 1999, image-driven smoothness.

use multiversion::multiversion;
use ndarray::Array2;

use super::exponential::falling;
use super::rows::for_each_rows;
use crate::control::Control;
use crate::error::Result;
use crate::pyramid::smooth;

/// Least weight of smoothness on the sharpest edge: keeps the two sides in touch.
const LEAST: f32 = 0.05;
/// Added to the scale of the differences, grey levels: where the picture is flat nothing is an edge.
const FLOOR: f64 = 0.3;
/// Deviation of the smoothing before the weighted median, px.
const MEDIAN_SIGMA: f64 = 0.5;
/// Sums side by side within a line.
const LANES: usize = 16;

/// How edges of the guide are read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct EdgeRule {
    /// `k`.
    pub(super) sensitivity: f64,
    /// `sigma`, px.
    pub(super) sigma: f64,
    /// The channel with the strongest edge instead of the rms of all.
    pub(super) strongest_channel: bool,
}

/// Weights `[e_x, e_y]` of the smoothness between each pixel and its right and lower neighbour.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn edge_weights(
    channels: &[Array2<f32>],
    rule: EdgeRule,
    control: &Control,
) -> Result<[Vec<f32>; 2]> {
    let (height, width) = channels[0].dim();
    let smoothed = channels
        .iter()
        .map(|channel| smooth(channel.view(), rule.sigma, control))
        .collect::<Result<Vec<_>>>()?;
    let planes: Vec<&[f32]> = smoothed.iter().filter_map(|plane| plane.as_slice()).collect();
    let share = if rule.strongest_channel { 1.0 } else { 1.0 / channels.len() as f32 };
    let combine = if rule.strongest_channel { greatest } else { added };
    let [mut across, mut down] = [(); 2].map(|()| vec![0.0f32; height * width]);
    let mut sums = vec![0.0f32; height];
    let outputs = [&mut across[..], &mut down[..], &mut sums[..]];
    for_each_rows(outputs, [width, width, 1], control, |y, [across, down, sum]| {
        for plane in &planes {
            let here = &plane[y * width..(y + 1) * width];
            combine(&here[..width - 1], &here[1..], share, &mut across[..width - 1]);
            if y + 1 < height {
                combine(here, &plane[(y + 1) * width..(y + 2) * width], share, down);
            }
        }
        sum[0] = total(across) + total(down);
    })?;
    let total: f64 = sums.iter().map(|&s| f64::from(s)).sum();
    let scale = (total / (height * width) as f64).sqrt() + FLOOR;
    let factor = (rule.sensitivity / scale) as f32;
    for_each_rows([&mut across, &mut down], [width; 2], control, |_, rows| {
        rows.into_iter().for_each(|row| weigh(row, factor));
    })?;
    Ok([across, down])
}

/// Adds the squared differences of two lines, times `share`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn added(one: &[f32], other: &[f32], share: f32, out: &mut [f32]) {
    let n = out.len();
    let (one, other) = (&one[..n], &other[..n]);
    for x in 0..n {
        let difference = other[x] - one[x];
        out[x] += difference * difference * share;
    }
}

/// Likewise the greatest of them and of what is there.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn greatest(one: &[f32], other: &[f32], share: f32, out: &mut [f32]) {
    let n = out.len();
    let (one, other) = (&one[..n], &other[..n]);
    for x in 0..n {
        let square = (other[x] - one[x]) * (other[x] - one[x]) * share;
        out[x] = if square > out[x] { square } else { out[x] };
    }
}

/// Sum of a line, in lanes.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn total(line: &[f32]) -> f32 {
    let (blocks, rest) = line.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for block in blocks {
        for lane in 0..LANES {
            sums[lane] += block[lane];
        }
    }
    rest.iter().zip(&mut sums).for_each(|(s, sum)| *sum += s);
    sums.iter().sum()
}

/// Squared differences to weights.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn weigh(line: &mut [f32], factor: f32) {
    for s in line {
        *s = falling(factor * s.sqrt()) + LEAST;
    }
}

/// The channels as the weighted median wants them: one squared distance over all of them.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn median_guide(
    channels: &[Array2<f32>],
    control: &Control,
) -> Result<Vec<Array2<f32>>> {
    let scale = 1.0 / (channels.len() as f32).sqrt();
    let scaled = |channel: &Array2<f32>| {
        let mut smoothed = smooth(channel.view(), MEDIAN_SIGMA, control)?;
        // Of a grey picture it is 1.
        if channels.len() > 1 {
            smoothed *= scale;
        }
        Ok(smoothed)
    };
    channels.iter().map(scaled).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smoothness_breaks_at_a_step_and_nowhere_else() {
        let step = Array2::from_shape_fn((8, 10), |(_, x)| if x < 5 { 20.0 } else { 90.0 });
        let rule = EdgeRule { sensitivity: 2.0, sigma: 0.7, strongest_channel: false };
        let [along_x, along_y] = edge_weights(&[step], rule, &Control::new()).unwrap();
        assert!(along_x[44] < 0.1 && along_x[40] > 1.0 && along_x[48] > 1.0);
        assert!(along_y.iter().all(|&e| (e - 1.05).abs() < 1e-6));
    }

    #[test]
    fn the_strongest_channel_decides_if_asked() {
        let flat = Array2::from_elem((4, 6), 7.0f32);
        let step = Array2::from_shape_fn((4, 6), |(_, x)| if x < 3 { 0.0 } else { 50.0 });
        let rule = |strongest_channel| EdgeRule { sensitivity: 1.0, sigma: 0.7, strongest_channel };
        let alone = edge_weights(std::slice::from_ref(&step), rule(true), &Control::new()).unwrap();
        let both = edge_weights(&[step, flat], rule(true), &Control::new()).unwrap();
        assert_eq!(alone, both);
    }
}
