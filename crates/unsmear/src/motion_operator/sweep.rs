//! Gather and scatter of one row of data through the rows of weights of its records.
//!
//! ```text
//! b[c + i] = sum_k w_k[i] x[s + delta_k + i],      x[s + delta_k + i] += w_k[i] r[c + i]
//! ```
//!
//! with s the place of pixel c in x; of straight records also at s - delta_k. The scatter takes several records at a
//! time, one row of each in turn: writes to overlapping places follow each other only after all of those.

use multiversion::multiversion;

use super::expand::{Expanded, expand};
use super::lanes::{LANES, Lanes};
use super::plan::{Kind, RowPlan};

/// Records scattered together: a write that a later read overlaps has by then left the processor's queue
/// of writes, and the weights (5 kB each for 15 px) stay in the first-level cache.
pub(super) const TOGETHER: usize = 4;

/// Memory of [`gather_row`] and [`scatter_row`].
pub(super) type Scratch = [Expanded; TOGETHER];

/// Writes a row of A x: `x` has rows of `stride` samples, and the row's first pixel is at `start`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn gather_row<const CUBIC: bool>(
    plan: &RowPlan,
    x: &[f32],
    stride: usize,
    start: usize,
    out: &mut [f32],
    scratch: &mut Scratch,
) {
    let rows = &mut scratch[0];
    out.fill(0.0);
    for record in &plan.records {
        let column = record.column as usize;
        let n = LANES.min(out.len() - column);
        let place = start + column;
        let own = &mut out[column..column + n];
        if record.kind == Kind::Still {
            let meant = &plan.lanes[record.lanes as usize];
            for ((own, &x), meant) in own.iter_mut().zip(&x[place..place + n]).zip(meant.0) {
                *own = if meant > 0.0 { x } else { *own };
            }
            continue;
        }
        expand::<CUBIC>(plan, record, stride as i32, rows);
        let mut sum = Lanes::ZERO;
        let (weights, deltas) = (&rows.weights[..rows.count], &rows.deltas[..rows.count]);
        for (weight, &delta) in weights.iter().zip(deltas) {
            let there = &x[place.wrapping_add_signed(delta as isize)..][..LANES];
            if record.kind == Kind::Straight {
                let back = &x[place.wrapping_add_signed(-delta as isize)..][..LANES];
                for i in 0..LANES {
                    sum.0[i] += weight.0[i] * (there[i] + back[i]);
                }
            } else {
                for i in 0..LANES {
                    sum.0[i] += weight.0[i] * there[i];
                }
            }
        }
        for (own, sum) in own.iter_mut().zip(sum.0) {
            *own += sum;
        }
    }
}

/// Adds a row of data `r` through A^T to `x`; see [`gather_row`].
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn scatter_row<const CUBIC: bool>(
    plan: &RowPlan,
    r: &[f32],
    stride: usize,
    start: usize,
    x: &mut [f32],
    scratch: &mut Scratch,
) {
    for records in plan.records.chunks(TOGETHER) {
        let mut data = [Lanes::ZERO; TOGETHER];
        let mut most = 0;
        for ((record, rows), data) in records.iter().zip(scratch.iter_mut()).zip(&mut data) {
            expand::<CUBIC>(plan, record, stride as i32, rows);
            most = most.max(rows.count);
            let own = &r[record.column as usize..];
            let n = LANES.min(own.len());
            data.0[..n].copy_from_slice(&own[..n]);
        }
        for k in 0..most {
            for ((record, rows), data) in records.iter().zip(scratch.iter()).zip(&data) {
                if k >= rows.count {
                    continue;
                }
                let (weight, delta) = (&rows.weights[k], rows.deltas[k] as isize);
                let place = start + record.column as usize;
                let there = &mut x[place.wrapping_add_signed(delta)..][..LANES];
                for i in 0..LANES {
                    there[i] += weight.0[i] * data.0[i];
                }
                if record.kind == Kind::Straight {
                    let back = &mut x[place.wrapping_add_signed(-delta)..][..LANES];
                    for i in 0..LANES {
                        back[i] += weight.0[i] * data.0[i];
                    }
                }
            }
        }
    }
}
