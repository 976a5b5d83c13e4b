//! The weights of a record, written out: for each row of samples it reads, 16 weights and where they begin.
//!
//! On a line whose minor positions share their floor the samples of all pixels stand side by side: four rows for
//! the cubic, two for the triangle. Where the floors differ by one, each pixel's weights are moved up
//! a row or not; where they differ by more, each row picks of each pixel's weights the one that falls on it.

use multiversion::multiversion;

use super::lanes::{LANES, Lanes, Prepared, four_taps};
use super::plan::{Kind, Record, RowPlan, line_of};

/// Added and subtracted, rounds to a whole number whatever is far smaller: 3/2 2^23.
const WHOLE: f32 = 12_582_912.0;

/// The rows of weights of one record.
#[derive(Debug, Default)]
pub(super) struct Expanded {
    /// 16 weights each.
    pub(super) weights: Vec<Lanes>,
    /// What they weigh begins so many samples after the record's first pixel.
    pub(super) deltas: Vec<i32>,
    /// Rows in use.
    pub(super) count: usize,
}

impl Expanded {
    /// Makes room for `rows` rows.
    fn reserve(&mut self, rows: usize) {
        if self.weights.len() < rows {
            self.weights.resize(rows, Lanes::ZERO);
            self.deltas.resize(rows, 0);
        }
        self.count = rows;
    }
}

/// Writes out `record` of `plan` for a picture of rows of `stride` samples.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn expand<const CUBIC: bool>(
    plan: &RowPlan,
    record: &Record,
    stride: i32,
    out: &mut Expanded,
) {
    out.reserve(record.rows as usize);
    let lanes = record.lanes_of(&plan.lanes);
    if record.kind == Kind::Still {
        (out.weights[0], out.deltas[0]) = (lanes[0], 0);
        return;
    }
    let (along, across) = if record.down { (stride, 1) } else { (1, stride) };
    let lines = &plan.lines[record.lines as usize..][..usize::from(record.count)];
    let prepared = Prepared::new::<CUBIC>(lanes);
    let mut row = 0;
    for (i, line) in lines.iter().enumerate() {
        let [weight, minor] = line_of::<CUBIC>(record, &prepared, i as i16);
        let (taps, before) = if CUBIC { (4, 1) } else { (2, 0) };
        let count = taps + usize::from(line.span);
        let rows = &mut out.weights[row..];
        let floor = f32::from(line.floor);
        match line.span {
            0 => level::<CUBIC>(&weight, &minor, floor, rows),
            1 => one_step::<CUBIC>(&weight, &minor, floor, rows),
            _ => steep::<CUBIC>(&weight, &minor, floor, count, rows),
        }
        let first = (i32::from(record.first) + i as i32) * along;
        for (k, delta) in out.deltas[row..row + count].iter_mut().enumerate() {
            *delta = first + (i32::from(line.floor) - before + k as i32) * across;
        }
        row += count;
    }
}

/// All floors are `floor`.
#[inline(always)]
fn level<const CUBIC: bool>(weight: &Lanes, minor: &Lanes, floor: f32, rows: &mut [Lanes]) {
    if CUBIC {
        let [r0, r1, r2, r3, ..] = rows else { return };
        for i in 0..LANES {
            let taps = four_taps::<CUBIC>(minor.0[i] - floor);
            r0.0[i] = weight.0[i] * taps[0];
            r1.0[i] = weight.0[i] * taps[1];
            r2.0[i] = weight.0[i] * taps[2];
            r3.0[i] = weight.0[i] * taps[3];
        }
    } else {
        let [r0, r1, ..] = rows else { return };
        for i in 0..LANES {
            let taps = four_taps::<CUBIC>(minor.0[i] - floor);
            r0.0[i] = weight.0[i] * taps[1];
            r1.0[i] = weight.0[i] * taps[2];
        }
    }
}

/// Floors are `floor` or the next.
#[inline(always)]
fn one_step<const CUBIC: bool>(weight: &Lanes, minor: &Lanes, floor: f32, rows: &mut [Lanes]) {
    if CUBIC {
        let [r0, r1, r2, r3, r4, ..] = rows else { return };
        for i in 0..LANES {
            let f = minor.0[i] - floor;
            let up = f >= 1.0;
            let [t0, t1, t2, t3] = four_taps::<CUBIC>(if up { f - 1.0 } else { f });
            let w = weight.0[i];
            r0.0[i] = w * if up { 0.0 } else { t0 };
            r1.0[i] = w * if up { t0 } else { t1 };
            r2.0[i] = w * if up { t1 } else { t2 };
            r3.0[i] = w * if up { t2 } else { t3 };
            r4.0[i] = w * if up { t3 } else { 0.0 };
        }
    } else {
        let [r0, r1, r2, ..] = rows else { return };
        for i in 0..LANES {
            let f = minor.0[i] - floor;
            let up = f >= 1.0;
            let [_, t1, t2, _] = four_taps::<CUBIC>(if up { f - 1.0 } else { f });
            let w = weight.0[i];
            r0.0[i] = w * if up { 0.0 } else { t1 };
            r1.0[i] = w * if up { t1 } else { t2 };
            r2.0[i] = w * if up { t2 } else { 0.0 };
        }
    }
}

/// Floors differ by any number; writes the first `count` rows.
#[inline(always)]
fn steep<const CUBIC: bool>(
    weight: &Lanes,
    minor: &Lanes,
    floor: f32,
    count: usize,
    rows: &mut [Lanes],
) {
    let (mut taps, mut up) = ([Lanes::ZERO; 4], Lanes::ZERO);
    for i in 0..LANES {
        let f = minor.0[i] - floor;
        // Positive, so that rounding down is cutting off.
        let whole = (f + WHOLE) - WHOLE;
        let whole = if whole > f { whole - 1.0 } else { whole };
        let four = four_taps::<CUBIC>(f - whole);
        up.0[i] = whole;
        taps[0].0[i] = weight.0[i] * four[0];
        taps[1].0[i] = weight.0[i] * four[1];
        taps[2].0[i] = weight.0[i] * four[2];
        taps[3].0[i] = weight.0[i] * four[3];
    }
    let first = if CUBIC { 0.0 } else { 1.0 };
    for k in 0..count {
        // The way out, never taken, keeps the loop over rows a loop over rows: the one within is to be vectorised.
        let Some(row) = rows.get_mut(k) else { return };
        for i in 0..LANES {
            let tap = k as f32 + first - up.0[i];
            let low = if tap == 0.0 { taps[0].0[i] } else { 0.0 };
            let second = if tap == 1.0 { taps[1].0[i] } else { low };
            let third = if tap == 2.0 { taps[2].0[i] } else { second };
            row.0[i] = if tap == 3.0 { taps[3].0[i] } else { third };
        }
    }
}
