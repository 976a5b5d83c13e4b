//! Neighbouring blocks of a row taken as one, and what they share kept once.
//!
//! Blocks whose paths have nearly the same minor positions on every line read and write the same places, each
//! 16 px further: [`TOGETHER`] of them are swept as one block of 64 px. On each line their positions are
//! those between the least floor and the greatest of any; a pixel weighs nothing on lines beyond its own path. That is
//! worth while as long as there are not many rows of weights more than before, and it never is for still pixels.

use super::lanes::LANES;
use super::record::{Kind, Line, Record};

/// Blocks taken as one: the sums of all stay in registers of 32 bytes, their weights (10 kB for 15 px) and what they write
/// in the first-level cache.
pub(super) const TOGETHER: usize = 4;

/// Rows of weights of the joint block over the mean of its parts, at most.
const MOST_WASTE: f32 = 1.3;

/// Records that are swept as one, and the lines that they have together.
#[derive(Debug, Clone, Copy)]
pub(super) struct Group {
    /// Number of records, 1 or [`TOGETHER`].
    pub(super) size: u8,
    /// First line, number of lines, and where they begin in the row's.
    pub(super) first: i16,
    pub(super) count: u16,
    pub(super) lines: u32,
    /// Rows of weights.
    pub(super) rows: u32,
    /// Its strands in the row's, if they are kept.
    pub(super) strands: [u32; 2],
}

impl Group {
    /// Its lines out of those of its row.
    pub(super) fn lines_of<'a>(&self, lines: &'a [Line]) -> &'a [Line] {
        &lines[self.lines as usize..][..usize::from(self.count)]
    }

    /// Where its rows of samples begin, so many samples to the right of its first pixel and so many below; `reach` of the
    /// taps, along columns if `down`.
    pub(super) fn places(&self, lines: &[Line], reach: usize, down: bool, out: &mut Vec<[i32; 2]>) {
        let (taps, before) = (2 * reach as i32, reach as i32 - 1);
        out.clear();
        for (along, line) in (i32::from(self.first)..).zip(self.lines_of(lines)) {
            let across = i32::from(line.floor) - before;
            let across = across..across + taps + i32::from(line.span);
            out.extend(across.map(|a| if down { [a, along] } else { [along, a] }));
        }
    }
}

/// Sorts `records` by axis and column and joins those that agree; adds the lines of the groups to `lines`, once where
/// neighbours have the same. A line makes `taps` rows more than its span.
pub(super) fn group(records: &mut [Record], lines: &mut Vec<Line>, taps: u32) -> Vec<Group> {
    records.sort_by_key(|record| (record.kind == Kind::Still, record.down, record.column));
    let mut groups = Vec::new();
    let mut last = 0..0;
    let mut at = 0;
    while at < records.len() {
        let lead = &records[at];
        let mut group = Group {
            size: 1,
            first: lead.first,
            count: lead.count,
            lines: lead.lines,
            rows: rows_of(lead.lines_of(lines), taps),
            strands: [0; 2],
        };
        if let Some((first, joint)) = records[at..].first_chunk().and_then(|r| join(r, lines, taps))
        {
            if lines[last.clone()] != joint {
                last = lines.len()..lines.len() + joint.len();
                lines.extend(&joint);
            }
            (group.size, group.first, group.count) = (TOGETHER as u8, first, joint.len() as u16);
            (group.lines, group.rows) = (last.start as u32, rows_of(&joint, taps));
        }
        groups.push(group);
        at += usize::from(group.size);
    }
    groups
}

/// Rows of weights that `lines` make.
fn rows_of(lines: &[Line], taps: u32) -> u32 {
    lines.iter().map(|line| u32::from(line.span) + taps).sum()
}

/// First line and lines of all `records`; None if they are to stay apart.
fn join(records: &[Record; TOGETHER], lines: &[Line], taps: u32) -> Option<(i16, Vec<Line>)> {
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
        let own = || records.iter().filter_map(|r| r.line(number, lines));
        let floor = own().map(|line| line.floor).min()?;
        let top = own().map(|line| line.floor + line.span as i16).max()?;
        Some(Line { floor, span: (top - floor) as u16 })
    };
    let joint: Vec<Line> = (first..end).map(line).collect::<Option<_>>()?;
    let before: u32 = records.iter().map(|r| rows_of(r.lines_of(lines), taps)).sum();
    let after = TOGETHER as u32 * rows_of(&joint, taps);
    (after as f32 <= MOST_WASTE * before as f32).then_some((first, joint))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(column: u32, first: i16, lines: u32, down: bool) -> Record {
        let kind = Kind::Gentle;
        Record { column, kind, down, first, count: 8, inner: [0; 2], lines, lanes: 0, planes: 5 }
    }

    #[test]
    fn blocks_of_like_paths_go_together() {
        let line = |floor, span| Line { floor, span };
        let mut lines: Vec<Line> = (0..8).chain(1..9).chain(40..48).map(|z| line(z, 0)).collect();
        lines[8].floor = 0;
        // Five neighbours out of order, the second of them a line further on; one of the other axis.
        let mut records = vec![
            record(64, 3, 0, false),
            record(0, 3, 0, true),
            record(16, 4, 8, false),
            record(0, 3, 0, false),
            record(48, 3, 0, false),
            record(32, 3, 0, false),
        ];
        let groups = group(&mut records, &mut lines, 4);
        let columns: Vec<_> = records.iter().map(|r| (r.down, r.column)).collect();
        let right = [0, 16, 32, 48, 64].map(|column| (false, column));
        assert_eq!(columns, [&right[..], &[(true, 0)]].concat());
        assert_eq!(groups.iter().map(|g| g.size).collect::<Vec<_>>(), [4, 1, 1]);
        let joint = groups[0];
        // Line 4 spans the floors 0 and 1.
        let expected: Vec<Line> =
            (0..9).map(|z| if z == 1 { line(0, 1) } else { line(z, 0) }).collect();
        assert_eq!((joint.first, joint.lines_of(&lines)), (3, &expected[..]));
        assert_eq!(joint.rows, 9 * 4 + 1);
        // A path far off would make most rows idle.
        records[2].lines = 16;
        assert_eq!(group(&mut records, &mut lines, 4).len(), 6);
    }
}
