//! Half-sweeps over a band of rows in the order of [`layout`](super::layout).

use std::ops::Range;

use multiversion::multiversion;

use super::layout::{BLACK, EAST, LANES, Layout, NORTH, RED, SOUTH, WEST};
use crate::control::Control;
use crate::error::Result;

/// Consecutive rows of the field, counted with the row of zeros above the picture.
pub(super) struct Band<'a> {
    pub(super) first: usize,
    pub(super) rows: &'a mut [f32],
}

impl Band<'_> {
    /// The row after the last.
    pub(super) fn end(&self, layout: &Layout) -> usize {
        self.first + self.rows.len() / layout.rows()
    }
}

/// Runs `halves` on a band as a wave; half-sweep number k of them covers the rows `extent(band, k)`, whose neighbours
/// must lie in the band.
pub(super) fn relax_band(
    layout: &Layout,
    coefficients: &[f32],
    band: &mut Band<'_>,
    extent: impl Fn(&Band<'_>, usize) -> Range<usize>,
    omega: f32,
    halves: Range<usize>,
    control: &Control,
) -> Result<()> {
    let extents: Vec<Range<usize>> = (0..halves.len()).map(|k| extent(band, k)).collect();
    let step = |(k, extent): (usize, &Range<usize>)| extent.start + k..extent.end + k;
    let start = extents.iter().enumerate().map(step).map(|steps| steps.start).min();
    let end = extents.iter().enumerate().map(step).map(|steps| steps.end).max();
    for step in start.unwrap_or(0)..end.unwrap_or(0) {
        control.check()?;
        for (k, half) in halves.clone().enumerate() {
            // Before row k the wave has not begun.
            if let Some(row) = step.checked_sub(k).filter(|row| extents[k].contains(row)) {
                relax_half_row(layout, coefficients, band, row, half % 2, omega);
            }
        }
    }
    Ok(())
}

/// Relaxes the red (`colour` 0) or black (1) pixels of a row.
fn relax_half_row(
    layout: &Layout,
    coefficients: &[f32],
    band: &mut Band<'_>,
    row: usize,
    colour: usize,
    omega: f32,
) {
    let (stride, rows) = (layout.stride, layout.rows());
    let (before, rest) = band.rows.split_at_mut((row - band.first) * rows);
    let (here, after) = rest.split_at_mut(rows);
    let (red, black) = here.split_at_mut(2 * stride);
    let (own, beside) = if colour == 0 { (red, &*black) } else { (black, &*red) };
    let (u, v) = own.split_at_mut(stride);
    let n = layout.covered();
    // Rows of the picture count from 1 here.
    let west = LANES - usize::from((row - 1 + colour).is_multiple_of(2));
    let block = |row: usize| &coefficients[row * layout.block()..][..layout.block()];
    let half_row = |row: usize, i: usize, start: usize| &block(row)[i * stride + start..][..n];
    let edges = if colour == 0 {
        [WEST, EAST, NORTH, SOUTH].map(|i| half_row(row, i, LANES))
    } else {
        [
            half_row(row, EAST, west),
            half_row(row, WEST, west + 1),
            half_row(row - 1, SOUTH, LANES),
            half_row(row + 1, NORTH, LANES),
        ]
    };
    let other = 2 * stride * (1 - colour);
    relax(
        &mut u[LANES..LANES + n],
        &mut v[LANES..LANES + n],
        [&beside[west..=west + n], &beside[stride + west..=stride + west + n]],
        &before[before.len() - rows + other + LANES..][..stride + n],
        &after[other + LANES..][..stride + n],
        edges,
        &block(row)[(if colour == 0 { RED } else { BLACK }) * stride + LANES..],
        stride,
        omega,
    );
}

/// The update of `n` pixels of one colour; `north`, `south` and `own` hold half-rows `stride` apart.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn relax(
    u: &mut [f32],
    v: &mut [f32],
    beside: [&[f32]; 2],
    north: &[f32],
    south: &[f32],
    edges: [&[f32]; 4],
    own: &[f32],
    stride: usize,
    omega: f32,
) {
    let n = u.len();
    let v = &mut v[..n];
    let (u_west, u_east) = (&beside[0][..n], &beside[0][1..=n]);
    let (v_west, v_east) = (&beside[1][..n], &beside[1][1..=n]);
    let (u_north, v_north) = (&north[..n], &north[stride..][..n]);
    let (u_south, v_south) = (&south[..n], &south[stride..][..n]);
    let [west, east, north, south] = edges;
    let (west, east, north, south) = (&west[..n], &east[..n], &north[..n], &south[..n]);
    let (i11, i12) = (&own[..n], &own[stride..][..n]);
    let (i22, c1, c2) = (&own[2 * stride..][..n], &own[3 * stride..][..n], &own[4 * stride..][..n]);
    for k in 0..n {
        let r1 = c1[k]
            + west[k] * u_west[k]
            + east[k] * u_east[k]
            + north[k] * u_north[k]
            + south[k] * u_south[k];
        let r2 = c2[k]
            + west[k] * v_west[k]
            + east[k] * v_east[k]
            + north[k] * v_north[k]
            + south[k] * v_south[k];
        u[k] += omega * ((i11[k] * r1 + i12[k] * r2) - u[k]);
        v[k] += omega * ((i12[k] * r1 + i22[k] * r2) - v[k]);
    }
}
