//! What is known of one block of one row in advance: its axis, its lines, and where its numbers are kept.

use super::lanes::Lanes;

/// How the pixels of a record move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// Not at all. Lanes: whether the pixel is meant, 1 or 0.
    Still,
    /// Straight through themselves. Lanes: gain, a, b.
    Straight,
    /// On parabolas of little change of speed. Lanes: gain, a, b, q_a, q_b and, if there are offsets, d_a, d_b.
    Gentle,
    /// On any parabolas. Lanes: the same.
    Curved,
}

/// One block of one row on one axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct Record {
    /// First column.
    pub(super) column: u32,
    pub(super) kind: Kind,
    /// Whether the major axis is the vertical one.
    pub(super) down: bool,
    /// First line and number of lines; a straight record has those from 0 on and is also meant mirrored.
    pub(super) first: i16,
    pub(super) count: u16,
    /// Lines from the first to the second, exclusive, lie between the ends of all paths.
    pub(super) inner: [i16; 2],
    /// Where its lines and lanes begin in the row's.
    pub(super) lines: u32,
    pub(super) lanes: u32,
    pub(super) planes: u8,
}

impl Record {
    /// Its lanes out of those of its row.
    pub(super) fn lanes_of<'a>(&self, lanes: &'a [Lanes]) -> &'a [Lanes] {
        &lanes[self.lanes as usize..][..usize::from(self.planes)]
    }

    /// Its lines out of those of its row.
    pub(super) fn lines_of<'a>(&self, lines: &'a [Line]) -> &'a [Line] {
        &lines[self.lines as usize..][..usize::from(self.count)]
    }

    /// Line `number` if it has one.
    pub(super) fn line<'a>(&self, number: i16, lines: &'a [Line]) -> Option<&'a Line> {
        self.lines_of(lines).get(usize::try_from(number - self.first).ok()?)
    }
}

/// Minor positions of a block on one line: the floor of the least, and how much greater that of the greatest is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Line {
    pub(super) floor: i16,
    pub(super) span: u16,
}
