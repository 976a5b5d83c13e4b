//! Neighbouring blocks of a row taken as one, and what they share kept once.
//!
//! Blocks whose paths have nearly the same minor positions on every line read and write the same places, each
//! 16 px further: [`TOGETHER`] of them are swept as one block of 64 px. On each line their positions are
//! those between the least floor and the greatest of any; a pixel weighs nothing on lines beyond its own path. That is
//! worth while as long as there are not many rows of weights more than before, and it never is for still pixels.

use super::lanes::LANES;
use super::plan::{Kind, Line, Record};

/// Blocks taken as one: the sums of all stay in registers of 32 bytes, their weights (10 kB for 15 px) and what they write
/// in the first-level cache.
pub(super) const TOGETHER: usize = 4;

/// Rows of weights of the joint block over the mean of its parts, at most.
const MOST_WASTE: f32 = 1.3;

/// Sorts `records` by axis and column, joins those that agree, and stores their lines, once where neighbours' are the
/// same. Returns the sizes of the groups, 1 or [`TOGETHER`], and the lines.
pub(super) fn group(records: &mut [Record], lines: &[Line], taps: u32) -> (Vec<u8>, Vec<Line>) {
    records.sort_by_key(|record| (record.kind == Kind::Still, record.down, record.column));
    let (mut sizes, mut kept) = (Vec::new(), Vec::<Line>::new());
    let (mut at, mut last) = (0, 0);
    while at < records.len() {
        let joint = records[at..].first_chunk().and_then(|four| join(four, lines));
        let size = if joint.is_some() { TOGETHER } else { 1 };
        let own = &mut records[at..at + size];
        let lead = own[0];
        let old = &lines[lead.lines as usize..][..usize::from(lead.count)];
        let (first, lines) = joint.unwrap_or_else(|| (lead.first, old.to_vec()));
        if kept[last..] != lines {
            last = kept.len();
            kept.extend(&lines);
        }
        for record in own {
            (record.first, record.count, record.lines) = (first, lines.len() as u16, last as u32);
            if record.kind != Kind::Still {
                record.rows = rows_of(&lines, taps);
            }
        }
        sizes.push(size as u8);
        at += size;
    }
    kept.shrink_to_fit();
    (sizes, kept)
}

/// Rows of weights that `lines` make.
pub(super) fn rows_of(lines: &[Line], taps: u32) -> u32 {
    lines.iter().map(|line| u32::from(line.span) + taps).sum()
}

/// First line and lines of all `records`; None if they are to stay apart.
fn join(records: &[Record; TOGETHER], lines: &[Line]) -> Option<(i16, Vec<Line>)> {
    let lead = records[0];
    let alike = |(i, r): (usize, &Record)| {
        r.kind == lead.kind
            && (r.down, r.planes) == (lead.down, lead.planes)
            && r.column as usize == lead.column as usize + i * LANES
    };
    if lead.kind == Kind::Still || !records.iter().enumerate().all(alike) {
        return None;
    }
    let first = records.iter().map(|r| r.first).min()?;
    let end = records.iter().map(|r| r.first + r.count as i16).max()?;
    let line = |number: i16| {
        let of = |r: &Record| {
            let i = usize::try_from(number - r.first).ok().filter(|&i| i < r.count.into())?;
            lines.get(r.lines as usize + i)
        };
        let own = || records.iter().filter_map(of);
        let floor = own().map(|line| line.floor).min()?;
        let top = own().map(|line| line.floor + line.span as i16).max()?;
        Some(Line { floor, span: (top - floor) as u16 })
    };
    let joint: Vec<Line> = (first..end).map(line).collect::<Option<_>>()?;
    let taps = 4;
    let before: u32 = records.iter().map(|r| rows_of(&lines[r.lines as usize..][..r.count.into()], taps)).sum();
    let after = TOGETHER as u32 * rows_of(&joint, taps);
    (after as f32 <= MOST_WASTE * before as f32).then_some((first, joint))
}
