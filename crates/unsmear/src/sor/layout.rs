//! Pixels split by colour: the memory order of the red-black solver.
//!
//! Row y of parity p = y mod 2 holds its red pixels x = 2 k + p at index k of one half-row and its black pixels
//! x = 2 k + 1 - p at index k of another. Then the northern and southern neighbours of index k have index k, the western
//! and eastern ones are next to each other at k - 1, k (where p plus the colour is even) or k, k + 1 (odd), and a
//! half-sweep is a loop over contiguous samples. Field rows are `[u red, v red, u black, v black]`; coefficient rows
//! hold the 14 half-rows named below. Each edge is stored once, with its red pixel. One row of zeros above and below
//! and zeros around each half-row stand for what lies beyond the picture: their diffusivities vanish, so no loop has to
//! ask.

use multiversion::multiversion;

use super::system::SystemRows;
use crate::control::Control;
use crate::error::Result;
use crate::tasks::{cut, for_each_task, runs};

/// Samples of a vector register of 512 bits, in f32: half-rows start and end at its multiples.
pub(super) const LANES: usize = 16;

/// Relative determinant at or below which a pixel without neighbours counts as singular: rounding of `a11 a22 - a12^2`.
const SINGULAR: f32 = 1e-6;

/// First of the 5 half-rows of red pixels in a coefficient row: inverse 11, 12, 22, right-hand sides 1, 2.
pub(super) const RED: usize = 0;
/// Half-row of the diffusivities of red pixels towards west.
pub(super) const WEST: usize = 5;
/// Towards east.
pub(super) const EAST: usize = 6;
/// Towards north.
pub(super) const NORTH: usize = 7;
/// Towards south.
pub(super) const SOUTH: usize = 8;
/// First of the 5 half-rows of black pixels, as [`RED`].
pub(super) const BLACK: usize = 9;
/// Half-rows of a coefficient row.
const HALF_ROWS: usize = 14;

/// Fewest rows that one task sorts: the diffusivities of the row before are made once more for each.
const FEWEST_ROWS: usize = 8;

/// Half-rows of a field row.
const FIELD_ROWS: usize = 4;

/// Extents in memory of one size of picture.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) height: usize,
    pub(super) width: usize,
    /// Samples from one half-row to the next: the pixels, with zeros around.
    pub(super) stride: usize,
}

impl Layout {
    pub(super) fn new(height: usize, width: usize) -> Self {
        Self { height, width, stride: width.div_ceil(2).next_multiple_of(LANES) + 2 * LANES }
    }

    /// Samples of a half-row that the loops cover: its pixels, filled up with zeros.
    pub(super) fn covered(&self) -> usize {
        self.stride - 2 * LANES
    }

    /// Samples of a coefficient row.
    pub(super) fn block(&self) -> usize {
        HALF_ROWS * self.stride
    }

    /// Samples of a field row.
    pub(super) fn rows(&self) -> usize {
        FIELD_ROWS * self.stride
    }

    /// Inverts the equations and sorts them and (u, v) by colour.
    pub(super) fn pack(
        &self,
        system: &impl SystemRows,
        u: &[f32],
        v: &[f32],
        coefficients: &mut [f32],
        field: &mut [f32],
        control: &Control,
    ) -> Result<()> {
        let inner = |row: usize| row..row * (self.height + 1);
        let runs = runs(self.height, FEWEST_ROWS..=usize::MAX);
        let blocks = cut(&mut coefficients[inner(self.block())], self.block(), &runs);
        let rows = cut(&mut field[inner(self.rows())], self.rows(), &runs);
        for_each_task(blocks.zip(rows), runs.len(), |((first, blocks), (_, rows))| {
            let mut made = MadeRows::new(self.width);
            if first > 0 {
                made.before(system, [u, v], first);
            }
            let blocks = blocks.chunks_exact_mut(self.block());
            for (i, (block, rows)) in blocks.zip(rows.chunks_exact_mut(self.rows())).enumerate() {
                control.check()?;
                let y = first + i;
                made.next(system, [u, v], y, y + 1 == self.height);
                let row = y * self.width..(y + 1) * self.width;
                self.pack_row(&mut made, [&u[row.clone()], &v[row]], y % 2, block, rows);
            }
            Ok(())
        })
    }

    fn pack_row(
        &self,
        made: &mut MadeRows,
        [u, v]: [&[f32]; 2],
        parity: usize,
        block: &mut [f32],
        rows: &mut [f32],
    ) {
        let width = self.width;
        let MadeRows { data, edges, north, south, inverse } = made;
        let [a11, a12, a22, b1, b2] = data.each_ref().map(|row| &row[..]);
        let planes = [a11, a12, a22, b1, b2, u, v, north, south, edges];
        let [i11, i12, i22, c1, c2] = inverse.each_mut().map(|row| &mut row[..]);
        invert_row(planes, i11, i12, i22, c1, c2);
        for (i, plane) in inverse.iter().enumerate() {
            self.split(plane, parity, block, RED + i, BLACK + i);
        }
        self.split(u, parity, rows, 0, 2);
        self.split(v, parity, rows, 1, 3);
        for (half_row, plane) in
            [(WEST, &edges[..width]), (EAST, &edges[1..]), (NORTH, north), (SOUTH, south)]
        {
            every_second(&plane[parity.min(width)..], self.half_row(block, half_row));
        }
    }

    /// The samples of half-row `i`, without the zeros in front.
    fn half_row<'a>(&self, block: &'a mut [f32], i: usize) -> &'a mut [f32] {
        &mut block[i * self.stride + LANES..(i + 1) * self.stride]
    }

    /// Writes the pixels of a row to their half-rows by colour.
    fn split(&self, plane: &[f32], parity: usize, block: &mut [f32], red: usize, black: usize) {
        every_second(&plane[parity.min(plane.len())..], self.half_row(block, red));
        every_second(&plane[(1 - parity).min(plane.len())..], self.half_row(block, black));
    }

    /// Writes the solution back in the order of the picture.
    pub(super) fn unpack(&self, field: &[f32], u: &mut [f32], v: &mut [f32]) -> Result<()> {
        let field = &field[self.rows()..];
        let runs = runs(self.height, FEWEST_ROWS..=usize::MAX);
        let tasks = cut(u, self.width, &runs).zip(cut(v, self.width, &runs));
        for_each_task(tasks, runs.len(), |((first, u), (_, v))| {
            let rows = field[first * self.rows()..].chunks_exact(self.rows());
            let lines = u.chunks_exact_mut(self.width).zip(v.chunks_exact_mut(self.width));
            for (i, ((u, v), row)) in lines.zip(rows).enumerate() {
                let half = |i: usize| &row[i * self.stride + LANES..(i + 1) * self.stride];
                let order = if (first + i) % 2 == 0 { [0, 2] } else { [2, 0] };
                interleave(half(order[0]), half(order[1]), u);
                interleave(half(order[0] + 1), half(order[1] + 1), v);
            }
            Ok(())
        })
    }
}

/// One row of the equations as it is asked for, and its inverse.
struct MadeRows {
    data: [Vec<f32>; 5],
    /// Diffusivities from the western border to the eastern, both 0.
    edges: Vec<f32>,
    north: Vec<f32>,
    south: Vec<f32>,
    inverse: [Vec<f32>; 5],
}

impl MadeRows {
    fn new(width: usize) -> Self {
        let row = || vec![0.0; width];
        Self {
            data: [(); 5].map(|()| row()),
            edges: vec![0.0; width + 1],
            north: row(),
            south: row(),
            inverse: [(); 5].map(|()| row()),
        }
    }

    /// Makes what row `y` needs of the row before.
    fn before(&mut self, system: &impl SystemRows, start: [&[f32]; 2], y: usize) {
        let width = self.south.len();
        system.diffusivities(y - 1, start, [&mut self.edges[1..=width], &mut self.south]);
    }

    /// Makes row `y`, the one after the last made.
    fn next(&mut self, system: &impl SystemRows, start: [&[f32]; 2], y: usize, last: bool) {
        let width = self.south.len();
        std::mem::swap(&mut self.north, &mut self.south);
        system.data(y, start, self.data.each_mut().map(|row| &mut row[..]));
        system.diffusivities(y, start, [&mut self.edges[1..=width], &mut self.south]);
        (self.edges[0], self.edges[width]) = (0.0, 0.0);
        if last {
            self.south.fill(0.0);
        }
    }
}

/// Copies samples 0, 2, 4 ... of `source`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn every_second(source: &[f32], out: &mut [f32]) {
    let (pairs, last) = source.as_chunks::<2>();
    for (out, pair) in out.iter_mut().zip(pairs) {
        *out = pair[0];
    }
    if let [last] = last {
        out[pairs.len()] = *last;
    }
}

/// The inverse of [`every_second`] on two half-rows.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn interleave(even: &[f32], odd: &[f32], out: &mut [f32]) {
    let (pairs, last) = out.as_chunks_mut::<2>();
    for ((pair, even), odd) in pairs.iter_mut().zip(even).zip(odd) {
        *pair = [*even, *odd];
    }
    if let [last] = last {
        *last = even[pairs.len()];
    }
}

/// Inverse of `A + sum of g I` of a row; a singular pixel's equation becomes U = (u, v).
///
/// `planes` are a11, a12, a22, c1, c2, u, v, g to the north and south, and the edges from the western border to the
/// eastern.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn invert_row(
    planes: [&[f32]; 10],
    i11: &mut [f32],
    i12: &mut [f32],
    i22: &mut [f32],
    c1: &mut [f32],
    c2: &mut [f32],
) {
    let n = i11.len();
    let [a11, a12, a22, b1, b2, u, v, north, south, edges] = planes;
    let (west, east) = (&edges[..n], &edges[1..=n]);
    let (a11, a12, a22, b1, b2) = (&a11[..n], &a12[..n], &a22[..n], &b1[..n], &b2[..n]);
    let (u, v, north, south) = (&u[..n], &v[..n], &north[..n], &south[..n]);
    let (i12, i22, c1, c2) = (&mut i12[..n], &mut i22[..n], &mut c1[..n], &mut c2[..n]);
    for x in 0..n {
        let sum = (west[x] + east[x]) + (north[x] + south[x]);
        let own = a11[x] * a22[x] - a12[x] * a12[x];
        // Rounding must not make A indefinite, nor a singular pixel regular.
        let own = if own > SINGULAR * (a11[x] * a22[x]) { own } else { 0.0 };
        let determinant = own + sum * (a11[x] + a22[x] + sum);
        let regular = determinant >= f32::MIN_POSITIVE;
        let scale = 1.0 / if regular { determinant } else { 1.0 };
        i11[x] = if regular { (a22[x] + sum) * scale } else { 1.0 };
        i12[x] = if regular { -a12[x] * scale } else { 0.0 };
        i22[x] = if regular { (a11[x] + sum) * scale } else { 1.0 };
        c1[x] = if regular { b1[x] } else { u[x] };
        c2[x] = if regular { b2[x] } else { v[x] };
    }
}
