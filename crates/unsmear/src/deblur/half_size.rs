//! A recorded picture at half its size, and a restored one back at the full size: the start of the solve.
//!
//! A sample of the half size is the mean of the 2 x 2 samples below it, weighted by their weights, and its weight is
//! the mean of theirs; its noise is half of theirs where all four are known. Half-size sample i lies at 2 i + 1/2 of the
//! full size, so that full-size samples lie a quarter of a step beside: two fixed sets of Keys' cubic taps
//! (R. G. Keys 1981, [10.1109/TASSP.1981.1163711](https://doi.org/10.1109/TASSP.1981.1163711), slope -1/2).

use ndarray::{Array2, ArrayView2};

use crate::array::for_each_row_with;
use crate::control::Control;
use crate::error::Result;

/// Keys' cubic at a fraction of 1/4 after the second of four samples.
const QUARTER: [f32; 4] = [-9.0 / 128.0, 111.0 / 128.0, 29.0 / 128.0, -3.0 / 128.0];

/// The channels and weights of a picture at half the size, (ceil(H / 2), ceil(W / 2)). Unknown samples must weigh 0.
pub(super) fn halve(
    planes: &[ArrayView2<'_, f32>],
    weights: &ArrayView2<'_, f32>,
) -> (Vec<Array2<f32>>, Array2<f32>) {
    let (height, width) = weights.dim();
    let size = (height.div_ceil(2), width.div_ceil(2));
    let block = |y: usize, x: usize| {
        [(0, 0), (0, 1), (1, 0), (1, 1)]
            .map(|(dy, dx)| ((2 * y + dy).min(height - 1), (2 * x + dx).min(width - 1)))
    };
    let small = |plane: &ArrayView2<'_, f32>| {
        Array2::from_shape_fn(size, |(y, x)| {
            let (mut sum, mut weight) = (0.0, 0.0);
            for at in block(y, x) {
                if weights[at] > 0.0 {
                    sum += weights[at] * plane[at];
                    weight += weights[at];
                }
            }
            if weight > 0.0 { sum / weight } else { 0.0 }
        })
    };
    let mean = |(y, x)| 0.25 * block(y, x).map(|at| weights[at]).iter().sum::<f32>();
    (planes.iter().map(small).collect(), Array2::from_shape_fn(size, mean))
}

/// Where the full-size unknown lies on the half-size one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Doubling {
    /// Shape of the half-size unknown and its padding.
    pub(super) from: (usize, usize),
    pub(super) from_pad: usize,
    /// Shape of the full-size unknown and its padding.
    pub(super) to: (usize, usize),
    pub(super) to_pad: usize,
}

impl Doubling {
    /// The packed half-size `plane` at full size; beyond its edge it continues with its edge samples.
    pub(super) fn apply(&self, plane: &[f32], control: &Control) -> Result<Vec<f32>> {
        let (columns, width) = (self.from.1, self.to.1);
        let mut out = vec![0.0; self.to.0 * width];
        for_each_row_with(
            &mut out,
            width,
            control,
            || vec![0.0; columns],
            |y, out, line| {
                let (rows, flip) = self.taps(y, self.from.0);
                for (x, sum) in line.iter_mut().enumerate() {
                    *sum = (0..4).map(|k| weight(k, flip) * plane[rows[k] * columns + x]).sum();
                }
                for (x, out) in out.iter_mut().enumerate() {
                    let (at, flip) = self.taps(x, columns);
                    *out = (0..4).map(|k| weight(k, flip) * line[at[k]]).sum();
                }
            },
        )?;
        Ok(out)
    }

    /// The four half-size samples about full-size sample `i`, and whether it lies at 3/4 after the second.
    fn taps(&self, i: usize, count: usize) -> ([usize; 4], bool) {
        // At full-size sample j of the data, the half-size position is (j - 1/2) / 2: -1/4 or 1/4 from j / 2.
        let j = i as isize - self.to_pad as isize;
        let odd = j.rem_euclid(2) == 1;
        let second = j.div_euclid(2) - isize::from(!odd) + self.from_pad as isize;
        let at = |k: isize| (second + k).clamp(0, count as isize - 1) as usize;
        ([at(-1), at(0), at(1), at(2)], !odd)
    }
}

fn weight(k: usize, flip: bool) -> f32 {
    QUARTER[if flip { 3 - k } else { k }]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_means_and_weights() {
        let plane =
            Array2::from_shape_vec((3, 2), vec![1.0, 2.0, 3.0, f32::NAN, 5.0, 6.0]).unwrap();
        let weights = Array2::from_shape_vec((3, 2), vec![1.0, 1.0, 0.5, 0.0, 1.0, 0.0]).unwrap();
        let (small, weight) = halve(&[plane.view()], &weights.view());
        // (1 + 2 + 1.5) / 2.5; the last row is met twice, its second sample unknown.
        assert_eq!(small[0].as_slice().unwrap(), [1.8, 5.0]);
        assert_eq!(weight.as_slice().unwrap(), [0.625, 0.5]);
    }

    #[test]
    fn doubles_a_ramp_onto_itself() {
        let doubling = Doubling { from: (9, 10), from_pad: 2, to: (13, 14), to_pad: 3 };
        let plane: Vec<f32> = (0..90)
            .map(|i| {
                let (y, x) = (i / 10, i % 10);
                let at = |k: usize| 2.0 * (k as f32 - 2.0) + 0.5;
                at(x) + 10.0 * at(y)
            })
            .collect();
        let full = doubling.apply(&plane, &Control::new()).unwrap();
        // Keys' cubic keeps straight lines away from the edge.
        for y in 2..11 {
            for x in 2..11 {
                let expected = (x as f32 - 3.0) + 10.0 * (y as f32 - 3.0);
                assert!((full[y * 14 + x] - expected).abs() < 1e-4, "{y} {x}");
            }
        }
    }
}
