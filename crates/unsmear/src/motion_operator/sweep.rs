//! Gather and scatter of one row of data through the rows of weights of its groups of records.
//!
//! ```text
//! b[c + i] = sum_k w_k[i] x[s + delta_k + i],      x[s + delta_k + i] += w_k[i] r[c + i]
//! ```
//!
//! with s the place of pixel c in x; of straight records also at s - delta_k. The gather keeps the sums of a group in
//! registers; the scatter writes the products w_k r down side by side and adds them up by strands.

use multiversion::multiversion;

use super::expand::Expanded;
use super::group::{Group, TOGETHER};
use super::lanes::{LANES, Lanes, Taps};
use super::plan::RowPlan;
use super::record::{Kind, Record};
use super::scatter::{Products, add_strand, product, write_products};

/// Memory of the functions below.
#[derive(Debug)]
pub(super) struct Scratch {
    joint: Expanded<TOGETHER>,
    single: Expanded<1>,
    products: Vec<Products>,
}

impl Scratch {
    pub(super) fn new() -> Self {
        Self { joint: Expanded::new(), single: Expanded::new(), products: Vec::new() }
    }

    fn forget(&mut self) {
        self.joint.forget();
        self.single.forget();
    }
}

/// Part of a picture with rows of `stride` samples; a row's first pixel is at `start`.
pub(super) struct Window<P> {
    pub(super) samples: P,
    pub(super) stride: usize,
    pub(super) start: usize,
}

impl<P> Window<P> {
    /// Where the first pixel of a record lies.
    fn place(&self, record: &Record) -> usize {
        self.start + record.column as usize
    }
}

/// Writes a row of A x.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn gather_row(
    plan: &RowPlan,
    taps: Taps,
    x: &Window<&[f32]>,
    out: &mut [f32],
    scratch: &mut Scratch,
) {
    out.fill(0.0);
    scratch.forget();
    let mut rest = &plan.records[..];
    for group in &plan.groups {
        let (records, after) = rest.split_at(group.size.into());
        rest = after;
        if let Some(records) = records.first_chunk::<TOGETHER>() {
            renew(taps, plan, group, records, &mut scratch.joint);
            take_own(plan, records, &gather(records, &scratch.joint, x), out);
        } else if let Some(records) = records.first_chunk::<1>() {
            renew(taps, plan, group, records, &mut scratch.single);
            take_own(plan, records, &gather(records, &scratch.single, x), out);
        }
    }
}

/// Adds a row of data `r` through A^T to `x`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn scatter_row(
    plan: &RowPlan,
    taps: Taps,
    r: &[f32],
    x: &mut Window<&mut [f32]>,
    scratch: &mut Scratch,
) {
    scratch.forget();
    let mut rest = &plan.records[..];
    for group in &plan.groups {
        let (records, after) = rest.split_at(group.size.into());
        rest = after;
        if let Some(records) = records.first_chunk::<TOGETHER>() {
            renew(taps, plan, group, records, &mut scratch.joint);
            let data = records.each_ref().map(|record| lanes_at(r, record));
            scatter(plan, group, records, &mut scratch.joint, &data, &mut scratch.products, x);
        } else if let Some(records) = records.first_chunk::<1>() {
            renew(taps, plan, group, records, &mut scratch.single);
            let data = records.each_ref().map(|record| lanes_at(r, record));
            scatter(plan, group, records, &mut scratch.single, &data, &mut scratch.products, x);
        }
    }
}

/// Writes a row of b = A x and adds A^T (weights b) of it to `out`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn normal_row(
    plan: &RowPlan,
    taps: Taps,
    x: &Window<&[f32]>,
    weights: &[f32],
    b: &mut [f32],
    out: &mut Window<&mut [f32]>,
    scratch: &mut Scratch,
) {
    b.fill(0.0);
    scratch.forget();
    let mut rest = &plan.records[..];
    for group in &plan.groups {
        let (records, after) = rest.split_at(group.size.into());
        rest = after;
        if let Some(records) = records.first_chunk::<TOGETHER>() {
            renew(taps, plan, group, records, &mut scratch.joint);
            let data = there_and_back(plan, records, &scratch.joint, x, weights, b);
            scatter(plan, group, records, &mut scratch.joint, &data, &mut scratch.products, out);
        } else if let Some(records) = records.first_chunk::<1>() {
            renew(taps, plan, group, records, &mut scratch.single);
            let data = there_and_back(plan, records, &scratch.single, x, weights, b);
            scatter(plan, group, records, &mut scratch.single, &data, &mut scratch.products, out);
        }
    }
}

/// Writes the records' share of b = A x; returns weights b.
#[inline(always)]
fn there_and_back<const N: usize>(
    plan: &RowPlan,
    records: &[Record; N],
    rows: &Expanded<N>,
    x: &Window<&[f32]>,
    weights: &[f32],
    b: &mut [f32],
) -> [Lanes; N] {
    let mut data = gather(records, rows, x);
    take_own(plan, records, &data, b);
    for (data, record) in data.iter_mut().zip(records) {
        *data = product(data, &lanes_at(weights, record));
    }
    data
}

/// Writes out records.
#[inline(always)]
fn renew<const N: usize>(
    taps: Taps,
    plan: &RowPlan,
    group: &Group,
    records: &[Record; N],
    rows: &mut Expanded<N>,
) {
    match taps {
        Taps::Linear => rows.renew::<false>(plan, group, records),
        Taps::Cubic | Taps::Spline | Taps::ThriftySpline => {
            rows.renew::<true>(plan, group, records);
        }
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

/// Puts the sums of the records' own pixels into their row.
#[inline(always)]
fn take_own<const N: usize>(
    plan: &RowPlan,
    records: &[Record; N],
    sums: &[Lanes; N],
    row: &mut [f32],
) {
    for (record, sum) in records.iter().zip(sums) {
        let gain = &plan.lanes[record.lanes as usize].0;
        let own = &mut row[record.column as usize..];
        if let Some(own) = own.first_chunk_mut::<LANES>() {
            for i in 0..LANES {
                own[i] = if gain[i] > 0.0 { sum.0[i] } else { own[i] };
            }
        } else {
            for ((own, &sum), &gain) in own.iter_mut().zip(&sum.0).zip(gain) {
                *own = if gain > 0.0 { sum } else { *own };
            }
        }
    }
}

/// The sums of the records' pixels.
#[inline(always)]
fn gather<const N: usize>(
    records: &[Record; N],
    rows: &Expanded<N>,
    x: &Window<&[f32]>,
) -> [Lanes; N] {
    match records[0].kind {
        Kind::Still => records.each_ref().map(|record| lanes_at(&x.samples[x.start..], record)),
        Kind::Straight => gather_rows::<true, N>(rows, x, x.place(&records[0])),
        Kind::Gentle | Kind::Curved => gather_rows::<false, N>(rows, x, x.place(&records[0])),
    }
}

/// Sums of weights times samples, the latter together with their mirror images when `MIRRORED`.
#[inline(always)]
fn gather_rows<const MIRRORED: bool, const N: usize>(
    rows: &Expanded<N>,
    x: &Window<&[f32]>,
    place: usize,
) -> [Lanes; N] {
    let mut sums = [Lanes::ZERO; N];
    for (weights, &[dx, dy]) in rows.weights.iter().zip(&rows.places) {
        let delta = dy as isize * x.stride as isize + dx as isize;
        let there = blocks::<N>(x.samples, place.wrapping_add_signed(delta));
        let back = if MIRRORED {
            blocks::<N>(x.samples, place.wrapping_add_signed(-delta))
        } else {
            there
        };
        for n in 0..N {
            sums[n] = add_product::<MIRRORED>(&sums[n], &weights[n], &there[n], &back[n]);
        }
    }
    sums
}

/// The `N` blocks of samples from `place` on.
#[inline(always)]
fn blocks<const N: usize>(x: &[f32], place: usize) -> &[[f32; LANES]] {
    &x[place..][..N * LANES].as_chunks().0[..N]
}

/// `sum` + `weight` (`there` + `back`), or without `back`.
#[inline(always)]
fn add_product<const MIRRORED: bool>(
    sum: &Lanes,
    weight: &Lanes,
    there: &[f32; LANES],
    back: &[f32; LANES],
) -> Lanes {
    let mut out = Lanes::ZERO;
    for i in 0..LANES {
        let both = if MIRRORED { there[i] + back[i] } else { there[i] };
        out.0[i] = sum.0[i] + weight.0[i] * both;
    }
    out
}

/// Adds the weights of the records times their data to `x`.
#[inline(always)]
fn scatter<const N: usize>(
    plan: &RowPlan,
    group: &Group,
    records: &[Record; N],
    rows: &mut Expanded<N>,
    data: &[Lanes; N],
    products: &mut Vec<Products>,
    x: &mut Window<&mut [f32]>,
) {
    write_products(&rows.weights, data, products);
    let place = x.place(&records[0]);
    let (strands, own) = rows.strands(plan, group);
    for strand in strands.of(own) {
        let taps = strands.taps(strand);
        let products = strand.rows_of(products);
        let [dx, dy] = strand.place();
        let delta = dy * x.stride as isize + dx;
        add_strand::<false, N>(products, strand, taps, x.samples, place.wrapping_add_signed(delta));
        if records[0].kind == Kind::Straight {
            let place = place.wrapping_add_signed(-delta - strand.range() as isize);
            add_strand::<true, N>(products, strand, taps, x.samples, place);
        }
    }
}
