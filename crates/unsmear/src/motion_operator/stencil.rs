//! The coefficients of a spline that 16 neighbouring paths see, and how much of each.
//!
//! ```text
//! S[k, j] = sum_n w_n beta(j - x_n) beta(k - y_n),     (x_n, y_n) = d - t_n V + t_n^2/2 q
//! ```
//!
//! with beta the cubic B-spline, of support 4, and t_n, w_n Gauss and Legendre's nodes and weights on [-1/2, 1/2].
//! A path of length L turns a wave's phase by w L: the nodes of [`nodes_for`] integrate that to 0.02 of the wave for
//! w <= 2.6 rad/px along paths of up to 8 px.
//!
//! Units: px. Pixels whose nodes fall into different cells of the grid share a stencil that holds the taps of all.
//! References: M. Unser, A. Aldroubi, M. Eden, IEEE Trans. Signal Processing 41 (1993) 821-833,
//! [10.1109/78.193220](https://doi.org/10.1109/78.193220); G. H. Golub, J. H. Welsch, Math. Comp. 23 (1969) 221-230,
//! [10.1090/S0025-5718-69-99647-1](https://doi.org/10.1090/S0025-5718-69-99647-1), on the rule.

use std::f64::consts::PI;

use multiversion::multiversion;

use super::lanes::{LANES, Lanes};

/// u, v, q and d of 16 pixels.
pub(super) type Paths = [Lanes; 6];

/// A node of 16 paths: its cells, and what each of 4 x 4 coefficients weighs.
#[derive(Debug, Clone, Copy)]
struct Node {
    /// Left and upper cell of each pixel, from the pixel.
    cell: [Lanes; 2],
    across: [Lanes; 4],
    down: [Lanes; 4],
    /// Least and largest cells.
    from: [i32; 2],
    to: [i32; 2],
}

/// What each of some coefficients weighs for each of 16 pixels.
#[derive(Debug, Default)]
pub(super) struct Stencil {
    /// Whose it is; None: nobody's yet.
    paths: Option<Paths>,
    nodes: Vec<Node>,
    /// Column and row of the first coefficient, from the pixel.
    first: [i32; 2],
    rows: usize,
    /// Column by column.
    taps: Vec<Lanes>,
}

/// A stencil that is ready to use.
#[derive(Debug, Clone, Copy)]
pub(super) struct Taken<'a> {
    /// Column and row of the first coefficient, from the pixel.
    pub(super) first: [i32; 2],
    pub(super) rows: usize,
    /// Column by column.
    pub(super) taps: &'a [Lanes],
}

/// Nodes for a path of `length` px.
pub(super) fn nodes_for(length: f32) -> usize {
    (0.7 * length + 2.5).ceil() as usize
}

impl Stencil {
    /// Makes it that of `paths`; returns whether it was not already. `rules` are Gauss' by their number of nodes.
    pub(super) fn renew(&mut self, paths: &Paths, rules: &[Vec<[f32; 2]>]) -> bool {
        if self.paths.as_ref().is_some_and(|before| alike(before, paths)) {
            return false;
        }
        let [u, v, qu, qv, ..] = paths;
        let squares =
            |i: usize| [u.0[i] * u.0[i] + v.0[i] * v.0[i], qu.0[i] * qu.0[i] + qv.0[i] * qv.0[i]];
        let larger = |a: [f32; 2], b: [f32; 2]| [a[0].max(b[0]), a[1].max(b[1])];
        let [motion, bend] = (0..LANES).map(squares).fold([0.0; 2], larger);
        let count = nodes_for(motion.sqrt() + 0.25 * bend.sqrt()).min(rules.len() - 1);
        self.nodes.clear();
        self.nodes.extend(rules[count].iter().map(|&rule| node(paths, rule)));
        self.paths = Some(*paths);
        build(self);
        true
    }

    /// It, ready to use.
    pub(super) fn taken(&self) -> Taken<'_> {
        Taken { first: self.first, rows: self.rows, taps: &self.taps }
    }
}

/// Whether paths are the same, bit for bit.
fn alike(a: &Paths, b: &Paths) -> bool {
    let mut differ = 0;
    for (a, b) in a.iter().zip(b) {
        for i in 0..LANES {
            differ |= a.0[i].to_bits() ^ b.0[i].to_bits();
        }
    }
    differ == 0
}

/// Gauss and Legendre's `count` nodes on [-1/2, 1/2] and their weights, of sum 1.
pub(super) fn gauss(count: usize) -> Vec<[f32; 2]> {
    let n = count as f64;
    let rule = |i: usize| {
        let mut z = (PI * (i as f64 + 0.75) / (n + 0.5)).cos();
        let mut slope = 0.0;
        // Newton's steps double the digits of a start that has two.
        for _ in 0..6 {
            let (mut before, mut value) = (0.0, 1.0);
            for k in 1..=count {
                let k = k as f64;
                (before, value) = (value, ((2.0 * k - 1.0) * z * value - (k - 1.0) * before) / k);
            }
            slope = n * (z * value - before) / (z * z - 1.0);
            z -= value / slope;
        }
        [(0.5 * z) as f32, (1.0 / ((1.0 - z * z) * slope * slope)) as f32]
    };
    (0..count).map(rule).collect()
}

/// The node at `time` of 16 paths.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn node(paths: &Paths, [time, weight]: [f32; 2]) -> Node {
    let [u, v, qu, qv, du, dv] = paths;
    let (bend, zero) = (0.5 * time * time, [Lanes::ZERO; 4]);
    let mut node =
        Node { cell: [Lanes::ZERO; 2], across: zero, down: zero, from: [0; 2], to: [0; 2] };
    for (axis, (motion, (curvature, offset))) in
        [(u, (qu, du)), (v, (qv, dv))].into_iter().enumerate()
    {
        let share = if axis == 0 { 1.0 } else { weight };
        let (mut place, mut cell, mut taps) = ([0.0; LANES], [0.0; LANES], zero);
        for i in 0..LANES {
            place[i] = offset.0[i] - time * motion.0[i] + bend * curvature.0[i];
        }
        for i in 0..LANES {
            cell[i] = place[i].floor();
        }
        for i in 0..LANES {
            let f = place[i] - cell[i];
            let g = 1.0 - f;
            let (f3, g3) = (share / 6.0 * f * f * f, share / 6.0 * g * g * g);
            taps[0].0[i] = g3;
            taps[1].0[i] = share * (2.0 / 3.0 - f * f) + 3.0 * f3;
            taps[2].0[i] = share * (2.0 / 3.0 - g * g) + 3.0 * g3;
            taps[3].0[i] = f3;
        }
        // By halves: a chain of comparisons would be one lane after the other.
        let (mut low, mut high) = (cell, cell);
        let mut half = LANES / 2;
        while half > 0 {
            for i in 0..half {
                low[i] = if low[i + half] < low[i] { low[i + half] } else { low[i] };
                high[i] = if high[i + half] > high[i] { high[i + half] } else { high[i] };
            }
            half /= 2;
        }
        let (least, most) = (low[0], high[0]);
        node.cell[axis].0 = cell;
        (node.from[axis], node.to[axis]) = (least as i32, most as i32);
        if axis == 0 { node.across = taps } else { node.down = taps }
    }
    node
}

/// The taps of a stencil from its nodes.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn build(stencil: &mut Stencil) {
    let Stencil { nodes, first, rows, taps, .. } = stencil;
    let (mut from, mut to) = ([i32::MAX; 2], [i32::MIN; 2]);
    for node in nodes.iter() {
        for axis in 0..2 {
            from[axis] = from[axis].min(node.from[axis]);
            to[axis] = to[axis].max(node.to[axis]);
        }
    }
    let size = [0, 1].map(|axis| (to[axis] - from[axis]) as usize + 4);
    (*first, *rows) = (from.map(|cell| cell - 1), size[1]);
    taps.clear();
    taps.resize(size[0] * size[1], Lanes::ZERO);
    for node in nodes.iter() {
        let ([left, top], [right, bottom]) = (node.from, node.to);
        let many = left < right || top < bottom;
        for row in top..=bottom {
            for column in left..=right {
                let mut down = node.down;
                if many {
                    let here = [column as f32, row as f32];
                    for i in 0..LANES {
                        let inside = node.cell[0].0[i] == here[0] && node.cell[1].0[i] == here[1];
                        let share = if inside { 1.0 } else { 0.0 };
                        down.iter_mut().for_each(|taps| taps.0[i] *= share);
                    }
                }
                let corner = (column - from[0]) as usize * *rows + (row - from[1]) as usize;
                for (i, across) in node.across.iter().enumerate() {
                    let column = &mut taps[corner + i * *rows..][..4];
                    for (tap, down) in column.iter_mut().zip(&down) {
                        for lane in 0..LANES {
                            tap.0[lane] += across.0[lane] * down.0[lane];
                        }
                    }
                }
            }
        }
    }
}

/// Where the first tap lies for the pixel at `place`.
fn corner(stencil: &Taken<'_>, place: usize, stride: usize) -> usize {
    let [column, row] = stencil.first.map(|z| z as isize);
    (place as isize + row * stride as isize + column) as usize
}

/// The stencil's sums for 16 pixels, the first of which is at `place`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn gather(
    stencil: &Taken<'_>,
    coefficients: &[f32],
    place: usize,
    stride: usize,
) -> Lanes {
    let mut sum = Lanes::ZERO;
    let corner = corner(stencil, place, stride);
    for (i, column) in stencil.taps.chunks_exact(stencil.rows).enumerate() {
        for (j, tap) in column.iter().enumerate() {
            let from = &coefficients[corner + i + j * stride..][..LANES];
            for lane in 0..LANES {
                sum.0[lane] += tap.0[lane] * from[lane];
            }
        }
    }
    sum
}

/// The transpose of [`gather`]: adds `values` of 16 pixels. Down the columns, because a processor waits when it reads
/// again, one sample beside, what it just wrote.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn scatter(
    stencil: &Taken<'_>,
    values: &Lanes,
    coefficients: &mut [f32],
    place: usize,
    stride: usize,
) {
    let corner = corner(stencil, place, stride);
    for (i, column) in stencil.taps.chunks_exact(stencil.rows).enumerate() {
        for (j, tap) in column.iter().enumerate() {
            let to = &mut coefficients[corner + i + j * stride..][..LANES];
            for lane in 0..LANES {
                to[lane] += tap.0[lane] * values.0[lane];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rule_integrates_polynomials_and_waves() {
        for count in 1..=10 {
            let rule = gauss(count);
            let sum = |f: &dyn Fn(f64) -> f64| -> f64 {
                rule.iter().map(|&[t, w]| f64::from(w) * f(f64::from(t))).sum()
            };
            assert!((sum(&|_| 1.0) - 1.0).abs() < 1e-6, "{count}");
            // integral of t^2 over [-1/2, 1/2].
            assert!(count < 2 || (sum(&|t| t * t) - 1.0 / 12.0).abs() < 1e-6, "{count}");
        }
        for length in [0.5f32, 1.0, 2.0, 3.0, 5.0, 8.0] {
            let phase = 2.6 * f64::from(length);
            let rule = gauss(nodes_for(length));
            let sum: f64 =
                rule.iter().map(|&[t, w]| f64::from(w) * (phase * f64::from(t)).cos()).sum();
            let wanted = (phase / 2.0).sin() / (phase / 2.0);
            assert!((sum - wanted).abs() < 0.02, "{length}: {sum} {wanted}");
        }
    }
}
