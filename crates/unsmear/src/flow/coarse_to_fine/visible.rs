//! What a warped frame shows: which pixels are seen in it, and which have not moved at all.
//!
//! ```text
//! w = 0 where (x + u, y + v) is outside the picture, else the frame's coverage there (1 without)
//! ```
//!
//! u, v in px of the level. See [`super::known`] for the coverage.

use multiversion::multiversion;
use ndarray::Array2;

use crate::array::for_each_row;
use crate::control::Control;
use crate::error::Result;
use crate::flow_field::FlowField;

/// Puts the sample itself where nothing moves: the spline passes through it but for rounding, which
/// would show as motion of frames at rest.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn keep_what_rests(
    warped: &mut Array2<f32>,
    picture: &Array2<f32>,
    flow: &FlowField<f32>,
    control: &Control,
) -> Result<()> {
    let width = picture.ncols();
    let [picture, u, v] = [picture, &flow.u, &flow.v].map(|p| p.as_slice().unwrap_or_default());
    for_each_row(warped.as_slice_mut().unwrap_or_default(), width, control, |y, out| {
        let row = y * width..(y + 1) * width;
        keep(&picture[row.clone()], &u[row.clone()], &v[row], out);
    })
}

/// Weights of the pixels, (H, W), into `visible`.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn see(
    flow: &FlowField<f32>,
    coverage: Option<&Array2<f32>>,
    visible: &mut [f32],
    control: &Control,
) -> Result<()> {
    let (height, width) = flow.dim();
    let last = [(width - 1) as f32, (height - 1) as f32];
    let [u, v] = [&flow.u, &flow.v].map(|p| p.as_slice().unwrap_or_default());
    for_each_row(visible, width, control, |y, out| {
        let row = y * width..(y + 1) * width;
        let (u, v) = (&u[row.clone()], &v[row]);
        inside(y as f32, last, u, v, out);
        if let Some(weights) = coverage {
            for (x, out) in out.iter_mut().enumerate().filter(|(_, seen)| **seen > 0.0) {
                let (to_x, to_y) = (x as f32 + u[x], y as f32 + v[x]);
                *out = weights[(to_y.round() as usize, to_x.round() as usize)];
            }
        }
    })
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn keep(picture: &[f32], u: &[f32], v: &[f32], warped: &mut [f32]) {
    let n = warped.len();
    let (picture, u, v) = (&picture[..n], &u[..n], &v[..n]);
    for x in 0..n {
        let rests = u[x].abs() + v[x].abs() == 0.0;
        warped[x] = if rests { picture[x] } else { warped[x] };
    }
}

/// 1 where a pixel of row `y` ends inside, else 0, NaN too.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
#[allow(clippy::needless_bitwise_bool, reason = "without branches the loop becomes vectors")]
fn inside(y: f32, [right, bottom]: [f32; 2], u: &[f32], v: &[f32], out: &mut [f32]) {
    let n = out.len();
    let (u, v) = (&u[..n], &v[..n]);
    for x in 0..n {
        // A column is exact in i32 and f32 alike, and i32 has a vector form.
        let (to_x, to_y) = (x as i32 as f32 + u[x], y + v[x]);
        let within = (to_x >= 0.0) & (to_x <= right) & (to_y >= 0.0) & (to_y <= bottom);
        out[x] = if within { 1.0 } else { 0.0 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn constant(u: f32, v: f32) -> FlowField<f32> {
        FlowField { u: Array2::from_elem((3, 4), u), v: Array2::from_elem((3, 4), v) }
    }

    #[test]
    fn what_leaves_the_picture_is_not_seen() {
        let control = Control::new();
        let mut seen = vec![7.0; 12];
        see(&constant(2.0, -1.0), None, &mut seen, &control).unwrap();
        let row = [1.0, 1.0, 0.0, 0.0];
        assert_eq!(seen, [[0.0; 4], row, row].concat());
        see(&constant(f32::NAN, 0.0), None, &mut seen, &control).unwrap();
        assert_eq!(seen, [0.0; 12]);
        let coverage = Array2::from_shape_fn((3, 4), |(y, x)| 0.1 * (4 * y + x) as f32);
        see(&constant(1.2, 0.6), Some(&coverage), &mut seen, &control).unwrap();
        // (0, 0) ends nearest to pixel (1, 1), number 5; column 3 and row 2 end outside.
        assert_eq!(seen[0], coverage[(1, 1)]);
        assert!((seen[3], seen[8]) == (0.0, 0.0));
    }

    #[test]
    fn only_what_rests_keeps_its_sample() {
        let picture = Array2::from_elem((3, 4), 5.0);
        let mut flow = constant(0.0, 0.0);
        (flow.u[(1, 2)], flow.v[(2, 0)]) = (1e-6, -3.0);
        let mut warped = Array2::from_elem((3, 4), 4.0);
        keep_what_rests(&mut warped, &picture, &flow, &Control::new()).unwrap();
        let moved = |at| at == (1, 2) || at == (2, 0);
        assert!(warped.indexed_iter().all(|(at, &s)| s == if moved(at) { 4.0 } else { 5.0 }));
    }
}
