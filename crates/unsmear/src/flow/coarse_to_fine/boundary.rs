//! Where the flow changes quickly: the neighbourhoods of motion boundaries.
//!
//! ```text
//! M = { max(|grad u|, |grad v|) > limit }  grown by a square of 5 x 5 px
//! ```
//!
//! with the gradient by Sobel's masks over 8, px/frame per px, reflected at the edge. Only there is
//! the weighted median worth its price: elsewhere it returns what it is given.

use multiversion::multiversion;

use crate::array::for_each_row;
use crate::border::Border;
use crate::control::Control;
use crate::error::Result;

use super::rows::Planes;

/// Growth of the mask, px to each side.
const GROWTH: usize = 2;

/// The mask `M`, (H, W).
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn boundaries(
    flow: Planes<'_>,
    width: usize,
    limit: f32,
    control: &Control,
) -> Result<Vec<bool>> {
    let height = flow[0].len() / width;
    let mirror = |i: isize, n: usize| Border::Reflect.index(i, n).unwrap_or_default();
    let mut steep = vec![false; height * width];
    for_each_row(&mut steep, width, control, |y, out| {
        let rows = [-1, 0, 1].map(|j| mirror(y as isize + j, height) * width);
        let [u, v] = flow.map(|plane| rows.map(|start| &plane[start..start + width]));
        steep_inside(u, v, limit * limit, out);
        for x in [0, width - 1] {
            let at = [-1, 0, 1].map(|i| mirror(x as isize + i, width));
            out[x] = [u, v].iter().any(|rows| sobel(*rows, at) > limit * limit);
        }
    })?;
    let mut across = vec![false; height * width];
    for_each_row(&mut across, width, control, |y, out| {
        let row = &steep[y * width..(y + 1) * width];
        for (x, out) in out.iter_mut().enumerate() {
            *out = row[x.saturating_sub(GROWTH)..(x + GROWTH + 1).min(width)].contains(&true);
        }
    })?;
    for_each_row(&mut steep, width, control, |y, out| {
        out.fill(false);
        for row in y.saturating_sub(GROWTH)..(y + GROWTH + 1).min(height) {
            let row = &across[row * width..(row + 1) * width];
            out.iter_mut().zip(row).for_each(|(out, &near)| *out |= near);
        }
    })?;
    Ok(steep)
}

/// Where the square of a gradient is beyond `limit`, but for the first and the last column.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn steep_inside(u: [&[f32]; 3], v: [&[f32]; 3], limit: f32, out: &mut [bool]) {
    for x in 1..out.len().saturating_sub(1) {
        let at = [x - 1, x, x + 1];
        out[x] = (sobel(u, at) > limit) | (sobel(v, at) > limit);
    }
}

/// Squared gradient from the rows above, here and below at columns `at`.
#[inline(always)]
fn sobel(rows: [&[f32]; 3], at: [usize; 3]) -> f32 {
    let [above, here, below] = rows.map(|row| at.map(|x| row[x]));
    let gx = above[2] - above[0] + 2.0 * (here[2] - here[0]) + below[2] - below[0];
    let gy = below[0] - above[0] + 2.0 * (below[1] - above[1]) + below[2] - above[2];
    (gx * gx + gy * gy) * (1.0 / 64.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_are_measured_per_pixel_and_steps_are_grown() {
        let width = 20;
        let ramp: Vec<f32> = (0..20 * 12).map(|i| 0.2 * (i % width) as f32).collect();
        let still = vec![0.0; 20 * 12];
        let above = boundaries([&ramp, &still], width, 0.19, &Control::new()).unwrap();
        assert!(above.iter().all(|&m| m));
        let below = boundaries([&ramp, &still], width, 0.21, &Control::new()).unwrap();
        assert!(below.iter().all(|&m| !m));
        let step: Vec<f32> = (0..20 * 12).map(|i| f32::from(u8::from(i % width >= 10))).collect();
        let mask = boundaries([&still, &step], width, 0.1, &Control::new()).unwrap();
        // Columns 9 and 10 see the step.
        assert!((0..width).all(|x| mask[60 + x] == (7..=12).contains(&x)));
    }
}
