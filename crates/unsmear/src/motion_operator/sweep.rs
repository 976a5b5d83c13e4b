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
use super::lanes::{LANES, Lanes, Taps};
use super::plan::{Kind, Record, RowPlan};

/// Records scattered together: a write that a later read overlaps has by then left the processor's queue
/// of writes, and the weights (5 kB each for 15 px) stay in the first-level cache.
pub(super) const TOGETHER: usize = 4;

/// Memory of [`gather_row`] and [`scatter_row`].
pub(super) type Scratch = [Expanded; TOGETHER];

/// Writes a row of A x: `x` has rows of `stride` samples, and the row's first pixel is at `start`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn gather_row(
    plan: &RowPlan,
    taps: Taps,
    x: &[f32],
    stride: usize,
    start: usize,
    out: &mut [f32],
    scratch: &mut Scratch,
) {
    out.fill(0.0);
    for record in &plan.records {
        expand_by(taps, plan, record, stride, &mut scratch[0]);
        let sum = gather(record, &scratch[0], x, start);
        take_own(plan, record, &sum, out);
    }
}

/// Adds a row of data `r` through A^T to `x`; see [`gather_row`].
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn scatter_row(
    plan: &RowPlan,
    taps: Taps,
    r: &[f32],
    stride: usize,
    start: usize,
    x: &mut [f32],
    scratch: &mut Scratch,
) {
    for records in plan.records.chunks(TOGETHER) {
        let mut data = [Lanes::ZERO; TOGETHER];
        for ((record, rows), data) in records.iter().zip(scratch.iter_mut()).zip(&mut data) {
            expand_by(taps, plan, record, stride, rows);
            *data = lanes_at(r, record);
        }
        scatter(records, scratch, &data, x, start);
    }
}

/// Writes a row of b = A x and adds A^T (weights b) of it to `out`, in which the row's first pixel is at `place`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn normal_row(
    plan: &RowPlan,
    taps: Taps,
    x: &[f32],
    weights: &[f32],
    stride: usize,
    start: usize,
    b: &mut [f32],
    out: &mut [f32],
    place: usize,
    scratch: &mut Scratch,
) {
    b.fill(0.0);
    for records in plan.records.chunks(TOGETHER) {
        let mut data = [Lanes::ZERO; TOGETHER];
        for ((record, rows), data) in records.iter().zip(scratch.iter_mut()).zip(&mut data) {
            expand_by(taps, plan, record, stride, rows);
            let sum = gather(record, rows, x, start);
            take_own(plan, record, &sum, b);
            *data = product(&lanes_at(weights, record), &sum);
        }
        scatter(records, scratch, &data, out, place);
    }
}

/// Writes out a record.
#[inline(always)]
fn expand_by(taps: Taps, plan: &RowPlan, record: &Record, stride: usize, rows: &mut Expanded) {
    match taps {
        Taps::Cubic => expand::<true>(plan, record, stride as i32, rows),
        Taps::Linear => expand::<false>(plan, record, stride as i32, rows),
    }
}

/// The samples of a row at a record's pixels; 0 beyond its end.
#[inline(always)]
fn lanes_at(row: &[f32], record: &Record) -> Lanes {
    let own = &row[record.column as usize..];
    if let Some(own) = own.first_chunk() {
        return Lanes(*own);
    }
    let mut lanes = Lanes::ZERO;
    lanes.0[..own.len()].copy_from_slice(own);
    lanes
}

/// Puts the sums of a record's own pixels into their row.
#[inline(always)]
fn take_own(plan: &RowPlan, record: &Record, sum: &Lanes, row: &mut [f32]) {
    let gain = &plan.lanes[record.lanes as usize].0;
    let own = row[record.column as usize..].iter_mut();
    for ((own, &sum), &gain) in own.zip(&sum.0).zip(gain) {
        *own = if gain > 0.0 { sum } else { *own };
    }
}

/// The sums of a record's pixels.
#[inline(always)]
fn gather(record: &Record, rows: &Expanded, x: &[f32], start: usize) -> Lanes {
    let place = start + record.column as usize;
    match record.kind {
        Kind::Still => lanes_at(&x[start..], record),
        Kind::Straight => gather_rows::<true>(rows, x, place),
        Kind::Gentle | Kind::Curved => gather_rows::<false>(rows, x, place),
    }
}

/// Sums of weights times samples, the latter together with their mirror images when `MIRRORED`.
#[inline(always)]
fn gather_rows<const MIRRORED: bool>(rows: &Expanded, x: &[f32], place: usize) -> Lanes {
    let (weights, rest) = rows.weights[..rows.count].as_chunks::<4>();
    let (deltas, rest_deltas) = rows.deltas[..rows.count].as_chunks::<4>();
    // Four sums, so that additions need not wait for each other.
    let [mut a, mut b, mut c, mut d] = [Lanes::ZERO; 4];
    for (weights, deltas) in weights.iter().zip(deltas) {
        a = add_product::<MIRRORED>(&a, &weights[0], x, place, deltas[0]);
        b = add_product::<MIRRORED>(&b, &weights[1], x, place, deltas[1]);
        c = add_product::<MIRRORED>(&c, &weights[2], x, place, deltas[2]);
        d = add_product::<MIRRORED>(&d, &weights[3], x, place, deltas[3]);
    }
    for (weight, &delta) in rest.iter().zip(rest_deltas) {
        a = add_product::<MIRRORED>(&a, weight, x, place, delta);
    }
    let mut sum = Lanes::ZERO;
    for i in 0..LANES {
        sum.0[i] = (a.0[i] + b.0[i]) + (c.0[i] + d.0[i]);
    }
    sum
}

/// `sum` + `weight` x.
#[inline(always)]
fn add_product<const MIRRORED: bool>(
    sum: &Lanes,
    weight: &Lanes,
    x: &[f32],
    place: usize,
    delta: i32,
) -> Lanes {
    let delta = delta as isize;
    let there = &x[place.wrapping_add_signed(delta)..][..LANES];
    let back = if MIRRORED { &x[place.wrapping_add_signed(-delta)..][..LANES] } else { there };
    let mut out = Lanes::ZERO;
    for i in 0..LANES {
        let both = if MIRRORED { there[i] + back[i] } else { there[i] };
        out.0[i] = sum.0[i] + weight.0[i] * both;
    }
    out
}

/// Adds the weights of some records times their data to `x`.
#[inline(always)]
fn scatter(
    records: &[Record],
    scratch: &Scratch,
    data: &[Lanes; TOGETHER],
    x: &mut [f32],
    start: usize,
) {
    let most = scratch.iter().take(records.len()).map(|rows| rows.count).max().unwrap_or(0);
    for k in 0..most {
        for ((record, rows), data) in records.iter().zip(scratch).zip(data) {
            if k >= rows.count {
                continue;
            }
            let (weight, delta) = (&rows.weights[k], rows.deltas[k] as isize);
            let place = start + record.column as usize;
            let product = product(weight, data);
            add(&mut x[place.wrapping_add_signed(delta)..][..LANES], &product);
            if record.kind == Kind::Straight {
                add(&mut x[place.wrapping_add_signed(-delta)..][..LANES], &product);
            }
        }
    }
}

#[inline(always)]
fn product(a: &Lanes, b: &Lanes) -> Lanes {
    let mut out = Lanes::ZERO;
    for i in 0..LANES {
        out.0[i] = a.0[i] * b.0[i];
    }
    out
}

#[inline(always)]
fn add(x: &mut [f32], lanes: &Lanes) {
    let x = &mut x[..LANES];
    for i in 0..LANES {
        x[i] += lanes.0[i];
    }
}
