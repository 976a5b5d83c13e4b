//! Connected regions of a mask, and its dilation by a square.
//!
//! Regions are maximal sets of pixels joined by their eight neighbours, numbered from 1 in the order in which their
//! first pixels come in reading order; 0 is outside. Two passes with a forest of equal labels (A. Rosenfeld,
//! J. L. Pfaltz, J. ACM 13 (1966) 471-494, doi:10.1145/321356.321357).

use ndarray::{Array2, ArrayView2};

/// Number of the region of every pixel, and how many regions there are.
#[must_use]
pub fn regions(mask: &ArrayView2<'_, bool>) -> (Array2<u32>, u32) {
    let (height, width) = mask.dim();
    let mut labels = Array2::<u32>::zeros((height, width));
    let mut parents = vec![0u32];
    for y in 0..height {
        for x in 0..width {
            if !mask[(y, x)] {
                continue;
            }
            let mut own = 0;
            let above = (y > 0).then(|| x.saturating_sub(1)..(x + 2).min(width));
            let before = (x > 0).then(|| labels[(y, x - 1)]);
            let above = above.into_iter().flatten().map(|column| labels[(y - 1, column)]);
            for label in above.chain(before).filter(|&label| label > 0) {
                let root = root_of(&mut parents, label);
                if own == 0 {
                    own = root;
                } else if root != own {
                    let (low, high) = (own.min(root), own.max(root));
                    parents[high as usize] = low;
                    own = low;
                }
            }
            if own == 0 {
                own = parents.len() as u32;
                parents.push(own);
            }
            labels[(y, x)] = own;
        }
    }
    // Roots, which are the least of their trees, are renumbered in the order of their first pixels.
    let (mut numbers, mut count) = (vec![0u32; parents.len()], 0);
    for label in 1..parents.len() as u32 {
        let root = root_of(&mut parents, label);
        if numbers[root as usize] == 0 {
            count += 1;
            numbers[root as usize] = count;
        }
        numbers[label as usize] = numbers[root as usize];
    }
    labels.mapv_inplace(|label| numbers[label as usize]);
    (labels, count)
}

fn root_of(parents: &mut [u32], label: u32) -> u32 {
    let mut root = label;
    while parents[root as usize] != root {
        // Halves the way for the next one who asks.
        parents[root as usize] = parents[parents[root as usize] as usize];
        root = parents[root as usize];
    }
    root
}

/// Pixels within `radius` px, in both axes, of a pixel of the mask.
#[must_use]
pub fn dilated(mask: &ArrayView2<'_, bool>, radius: usize) -> Array2<bool> {
    let along = |n: usize, at: &dyn Fn(usize) -> bool, set: &mut dyn FnMut(usize)| {
        let mut reached = 0;
        for i in 0..n {
            if at(i) {
                (reached.max(i.saturating_sub(radius))..(i + radius + 1).min(n))
                    .for_each(&mut *set);
                reached = i + radius + 1;
            }
        }
    };
    let (height, width) = mask.dim();
    let mut rows = Array2::from_elem((height, width), false);
    for y in 0..height {
        along(width, &|x| mask[(y, x)], &mut |x| rows[(y, x)] = true);
    }
    let mut out = Array2::from_elem((height, width), false);
    for x in 0..width {
        along(height, &|y| rows[(y, x)], &mut |y| out[(y, x)] = true);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn joins_by_corners_and_across_a_bridge() {
        let mask = array![
            [true, false, true, false, false],
            [true, false, true, false, true],
            [false, true, false, false, true],
            [false, false, false, false, false],
        ];
        let (labels, count) = regions(&mask.view());
        assert_eq!(count, 2);
        let expected = array![[1, 0, 1, 0, 0], [1, 0, 1, 0, 2], [0, 1, 0, 0, 2], [0, 0, 0, 0, 0]];
        assert_eq!(labels, expected);
        assert_eq!(regions(&Array2::from_elem((3, 3), false).view()).1, 0);
    }

    #[test]
    fn dilates_to_a_square() {
        let mut mask = Array2::from_elem((7, 9), false);
        mask[(3, 4)] = true;
        mask[(3, 7)] = true;
        let wide = dilated(&mask.view(), 2);
        for ((y, x), &set) in wide.indexed_iter() {
            let near = |column: usize| x.abs_diff(column) <= 2 && y.abs_diff(3) <= 2;
            assert_eq!(set, near(4) || near(7), "({y}, {x})");
        }
    }
}
