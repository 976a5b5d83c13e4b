//! The weights of a record, written out: for each row of samples it reads, 16 weights and where they begin.
//!
//! On a line whose minor positions share their floor the samples of all pixels stand side by side: four rows for
//! the cubic, two for the triangle. Where the floors differ by one, each pixel's weights are moved up
//! a row or not; where they differ by more, each row picks of each pixel's weights the one that falls on it.

use multiversion::multiversion;

use super::group::Group;
use super::lanes::{LANES, Lanes, Prepared, four_taps};
use super::plan::{RowPlan, line_of};
use super::record::{Kind, Record};
use super::strands::Strands;

/// Added and subtracted, rounds to a whole number whatever is far smaller: 3/2 2^23.
const WHOLE: f32 = 12_582_912.0;

/// The rows of weights of `N` records that are swept as one.
#[derive(Debug)]
pub(super) struct Expanded<const N: usize> {
    /// 16 weights of each record.
    pub(super) weights: Vec<[Lanes; N]>,
    /// What they weigh begins so many samples to the right of a record's first pixel and so many below.
    pub(super) places: Vec<[i32; 2]>,
    /// Where what is scattered goes, if it was found for these places.
    strands: Strands,
    found: Option<[u32; 2]>,
    /// The records' lanes that the weights are made from.
    lanes: Option<[u32; N]>,
    /// First line, lines and axis that the places are made from.
    shape: Option<(i16, u32, bool)>,
}

impl<const N: usize> Expanded<N> {
    pub(super) fn new() -> Self {
        let (weights, places) = (Vec::new(), Vec::new());
        Self { weights, places, strands: Strands::default(), found: None, lanes: None, shape: None }
    }

    /// Forgets what is written out: another row's plan follows.
    pub(super) fn forget(&mut self) {
        (self.lanes, self.shape, self.found) = (None, None, None);
    }

    /// Writes out the `records` of a `group` of `plan`, unless that is what was written out last.
    pub(super) fn renew<const CUBIC: bool>(
        &mut self,
        plan: &RowPlan,
        group: &Group,
        records: &[Record; N],
    ) {
        let lead = &records[0];
        if lead.kind == Kind::Still {
            self.forget();
            self.weights.resize(1, [Lanes::ZERO; N]);
            self.weights[0] = records.map(|record| record.lanes_of(&plan.lanes)[0]);
            self.places.splice(.., [[0, 0]]);
            return;
        }
        let shape = Some((group.first, group.lines, lead.down));
        let lanes = Some(records.map(|record| record.lanes));
        if self.shape == shape && self.lanes == lanes {
            return;
        }
        if self.shape != shape {
            self.weights.resize(group.rows as usize, [Lanes::ZERO; N]);
            let reach = if CUBIC { 2 } else { 1 };
            group.places(&plan.lines, reach, lead.down, &mut self.places);
            self.found = None;
        }
        for (i, record) in records.iter().enumerate() {
            if i > 0 && record.lanes == records[i - 1].lanes {
                self.weights.iter_mut().for_each(|row| row[i] = row[i - 1]);
            } else {
                expand::<CUBIC, N>(plan, group, record, i, &mut self.weights);
            }
        }
        (self.shape, self.lanes) = (shape, lanes);
    }

    /// Where what is scattered goes: as the plan keeps it, or found for these places.
    pub(super) fn strands<'a>(
        &'a mut self,
        plan: &'a RowPlan,
        group: &Group,
    ) -> (&'a Strands, [u32; 2]) {
        if let Some(kept) = &plan.strands {
            return (kept, group.strands);
        }
        let own = self.found.unwrap_or_else(|| {
            self.strands.clear();
            self.strands.find(&self.places)
        });
        self.found = Some(own);
        (&self.strands, own)
    }
}

/// Writes out `record` of `plan` as number `at` of its `group`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn expand<const CUBIC: bool, const N: usize>(
    plan: &RowPlan,
    group: &Group,
    record: &Record,
    at: usize,
    mut out: &mut [[Lanes; N]],
) {
    let prepared = Prepared::new::<CUBIC>(record.lanes_of(&plan.lanes));
    let taps = if CUBIC { 4 } else { 2 };
    for (number, shared) in (group.first..).zip(group.lines_of(&plan.lines)) {
        let (rows, rest) = out.split_at_mut(taps + usize::from(shared.span));
        out = rest;
        let Some(line) = record.line(number, &plan.lines) else {
            rows.iter_mut().for_each(|row| row[at] = Lanes::ZERO);
            continue;
        };
        let [weight, minor] = line_of::<CUBIC>(record, &prepared, number);
        let (before, rows) = rows.split_at_mut((line.floor - shared.floor) as usize);
        let (rows, after) = rows.split_at_mut(taps + usize::from(line.span));
        before.iter_mut().chain(after).for_each(|row| row[at] = Lanes::ZERO);
        let floor = f32::from(line.floor);
        match line.span {
            0 => level::<CUBIC, N>(&weight, &minor, floor, at, rows),
            1 => one_step::<CUBIC, N>(&weight, &minor, floor, at, rows),
            _ => steep::<CUBIC, N>(&weight, &minor, floor, at, rows),
        }
    }
}

/// All floors are `floor`.
#[inline(always)]
fn level<const CUBIC: bool, const N: usize>(
    weight: &Lanes,
    minor: &Lanes,
    floor: f32,
    at: usize,
    rows: &mut [[Lanes; N]],
) {
    if CUBIC {
        let [r0, r1, r2, r3, ..] = rows else { return };
        let [r0, r1, r2, r3] = [r0, r1, r2, r3].map(|row| &mut row[at]);
        for i in 0..LANES {
            let taps = four_taps::<CUBIC>(minor.0[i] - floor);
            r0.0[i] = weight.0[i] * taps[0];
            r1.0[i] = weight.0[i] * taps[1];
            r2.0[i] = weight.0[i] * taps[2];
            r3.0[i] = weight.0[i] * taps[3];
        }
    } else {
        let [r0, r1, ..] = rows else { return };
        let [r0, r1] = [r0, r1].map(|row| &mut row[at]);
        for i in 0..LANES {
            let taps = four_taps::<CUBIC>(minor.0[i] - floor);
            r0.0[i] = weight.0[i] * taps[1];
            r1.0[i] = weight.0[i] * taps[2];
        }
    }
}

/// Floors are `floor` or the next.
#[inline(always)]
fn one_step<const CUBIC: bool, const N: usize>(
    weight: &Lanes,
    minor: &Lanes,
    floor: f32,
    at: usize,
    rows: &mut [[Lanes; N]],
) {
    if CUBIC {
        let [r0, r1, r2, r3, r4, ..] = rows else { return };
        let [r0, r1, r2, r3, r4] = [r0, r1, r2, r3, r4].map(|row| &mut row[at]);
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
        let [r0, r1, r2] = [r0, r1, r2].map(|row| &mut row[at]);
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

/// Floors differ by any number.
#[inline(always)]
fn steep<const CUBIC: bool, const N: usize>(
    weight: &Lanes,
    minor: &Lanes,
    floor: f32,
    at: usize,
    rows: &mut [[Lanes; N]],
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
    for k in 0..rows.len() {
        // The way out, never taken, keeps the loop over rows a loop over rows: the one within is to be vectorised.
        let Some(row) = rows.get_mut(k).map(|row| &mut row[at]) else { return };
        for i in 0..LANES {
            let tap = k as f32 + first - up.0[i];
            let low = if tap == 0.0 { taps[0].0[i] } else { 0.0 };
            let second = if tap == 1.0 { taps[1].0[i] } else { low };
            let third = if tap == 2.0 { taps[2].0[i] } else { second };
            row.0[i] = if tap == 3.0 { taps[3].0[i] } else { third };
        }
    }
}
