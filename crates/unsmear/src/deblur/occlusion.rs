//! Data whose light comes from two motions: they follow no single path and are not believed.
//!
//! Along its path a pixel collects light from p - t V, |t| <= 1/2. Where the flow there is not what a smooth field has,
//! a boundary between motions was crossed. A smooth field varies linearly over the path, so its second difference
//! vanishes; a jump stays:
//!
//! ```text
//! w(p) = 0  where, for some t in (0, 0.55],  |v(p - t V) + v(p + t V) - 2 v(p)| > max(1 px/frame, 0.2 |v(p)|)
//! ```
//!
//! with V = e v(p) the path in px, samples at the nearest pixels and 2 px apart; else w(p) = 1. A sample
//! of unknown motion or beyond the picture says nothing. Own unknown motion: w = 0. Validity: jumps of 1 px/frame and
//! above; a boundary smoothed over more than the path is not seen.

use ndarray::Array2;

use crate::array::for_each_row;
use crate::control::Control;
use crate::error::{Result, require};
use crate::flow_field::FlowField;

/// Half the path that is searched, as a share of it: a little beyond its ends, where the boundary's own blur begins.
const HALF_PATH: f32 = 0.55;

/// Least jump that counts, px/frame.
const LEAST_JUMP: f32 = 1.0;

/// Least jump that counts as a share of the speed: estimated flow errs by about that near its boundaries.
const RELATIVE_JUMP: f32 = 0.2;

/// Distance between samples, px: nothing wider is missed.
const SPACING: f32 = 2.0;

/// Most samples on half a path.
const MOST_SAMPLES: f32 = 64.0;

/// Weights (H, W), 0 or 1, of data blurred by `flow` times `exposure`; see the head of `occlusion.rs`.
///
/// # Errors
/// [`Error::Value`](crate::Error::Value) when `exposure` is not positive; [`Error::Cancelled`](crate::Error::Cancelled).
pub fn occlusion_weights(
    flow: &FlowField<f32>,
    exposure: f64,
    control: &Control,
) -> Result<Array2<f32>> {
    require("exposure", exposure, "finite and positive", |e| e > 0.0)?;
    let (height, width) = flow.dim();
    let packed: Vec<[f32; 2]> = flow.u.iter().zip(&flow.v).map(|(&u, &v)| [u, v]).collect();
    let mut weights = vec![1.0; height * width];
    let half = HALF_PATH * exposure as f32;
    for_each_row(&mut weights, width, control, |y, row| {
        for (x, weight) in row.iter_mut().enumerate() {
            if crosses_a_jump(&packed, width, half, y, x) {
                *weight = 0.0;
            }
        }
    })?;
    Ok(Array2::from_shape_fn((height, width), |(y, x)| weights[y * width + x]))
}

/// Whether the path of a pixel, `half` frames to either side, meets a jump, or its motion is unknown.
fn crosses_a_jump(flow: &[[f32; 2]], width: usize, half: f32, y: usize, x: usize) -> bool {
    let [u, v] = flow[y * width + x];
    let square = u * u + v * v;
    if !square.is_finite() {
        return true;
    }
    let (columns, rows) = (width as f32, (flow.len() / width) as f32);
    let (middle_x, middle_y) = (x as f32 + 0.5, y as f32 + 0.5);
    let speed = square.sqrt();
    let samples = (half * speed / SPACING + 1.0).min(MOST_SAMPLES) as usize;
    let allowed = LEAST_JUMP.max(RELATIVE_JUMP * speed);
    (1..=samples).any(|k| {
        let t = half * k as f32 / samples as f32;
        let at = |t: f32| {
            let (column, row) = (middle_x + t * u, middle_y + t * v);
            let inside = column >= 0.0 && row >= 0.0 && column < columns && row < rows;
            inside.then(|| flow[row as usize * width + column as usize])
        };
        let (Some(ahead), Some(behind)) = (at(-t), at(t)) else { return false };
        let (du, dv) = (ahead[0] + behind[0] - 2.0 * u, ahead[1] + behind[1] - 2.0 * v);
        du * du + dv * dv > allowed * allowed
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn weights(flow: impl Fn(usize, usize) -> [f32; 2]) -> Array2<f32> {
        let part = |i: usize| Array2::from_shape_fn((40, 60), |(y, x)| flow(y, x)[i]);
        let field = FlowField::new(part(0), part(1)).unwrap();
        occlusion_weights(&field, 1.0, &Control::new()).unwrap()
    }

    #[test]
    fn smooth_fields_are_believed() {
        // Rotation by 25 degrees, 11 px/frame at the corners: affine.
        let turn = weights(|y, x| [0.436 * (y as f32 - 20.0), -0.436 * (x as f32 - 30.0)]);
        assert!(turn.iter().all(|&w| w == 1.0));
    }

    #[test]
    fn paths_across_a_boundary_are_not() {
        let two = weights(|_, x| if x < 30 { [0.0, 0.0] } else { [8.0, 0.0] });
        // The right layer reaches 0.55 * 8 = 4.4 px back; the left one rests.
        for x in 0..60 {
            let expected = if (30..34).contains(&x) { 0.0 } else { 1.0 };
            assert_eq!(two[(20, x)], expected, "{x}");
        }
        let unknown = weights(|_, x| if x == 7 { [f32::NAN, 0.0] } else { [4.0, 0.0] });
        assert!((0..60).all(|x| unknown[(3, x)] == if x == 7 { 0.0 } else { 1.0 }));
    }
}
