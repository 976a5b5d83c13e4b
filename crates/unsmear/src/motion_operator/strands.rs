//! Where rows of products are written: strands, the places of one row of the picture that up to 16 of them reach.
//!
//! A row of products P_k of a group of blocks belongs dx_k px to the right of them in the picture's row dy_k. Rows of
//! one dy differ by a few px, so that adding them to the picture one by one means writing the same places again
//! and again, across lines of the cache and while the former write is still under way. A strand instead sums them
//! first, over registers,
//!
//! ```text
//! S[t] = sum_k P_k[t - s_k],      s_k = dx_k - min dx in [0, 15]
//! ```
//!
//! and is added to the picture once: only reads are off the grid of registers. Mirrored, dx and dy change sign and s_k
//! becomes max dx - dx_k.

use super::lanes::LANES;

/// One row of products in a strand: its number and s, packed so that a strand fills two lines of the cache at most.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Tap(u32);

impl Tap {
    fn new(row: usize, shift: usize) -> Self {
        Self((row * LANES + shift) as u32)
    }

    pub(super) fn row(self) -> usize {
        self.0 as usize / LANES
    }

    pub(super) fn shift(self) -> usize {
        self.0 as usize % LANES
    }
}

/// Some taps, and where they begin in the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Strand {
    /// Least dx, and dy.
    pub(super) place: [i32; 2],
    /// Largest shift.
    pub(super) range: usize,
    count: usize,
    taps: [Tap; LANES],
}

impl Strand {
    pub(super) fn taps(&self) -> &[Tap] {
        &self.taps[..self.count]
    }
}

/// No strand of a dy yet.
const NONE: u32 = u32::MAX;

/// The strands of a group of blocks, and memory to find them.
#[derive(Debug, Default)]
pub(super) struct Strands {
    pub(super) all: Vec<Strand>,
    /// The last strand of each dy.
    last: Vec<u32>,
}

impl Strands {
    /// Finds the strands of rows at `places` (dx, dy), whose dx ascend within equal dy.
    pub(super) fn find(&mut self, places: &[[i32; 2]]) {
        let (mut least, mut most) = (i32::MAX, i32::MIN);
        for &[_, dy] in places {
            (least, most) = (least.min(dy), most.max(dy));
        }
        self.all.clear();
        self.last.clear();
        self.last.resize((most - least + 1) as usize, NONE);
        for (row, &[dx, dy]) in places.iter().enumerate() {
            let last = &mut self.last[(dy - least) as usize];
            if let Some(strand) = self.all.get_mut(*last as usize) {
                let shift = (dx - strand.place[0]) as usize;
                if let Some(tap) = strand.taps.get_mut(strand.count)
                    && shift < LANES
                {
                    *tap = Tap::new(row, shift);
                    strand.range = shift;
                    strand.count += 1;
                    continue;
                }
            }
            *last = self.all.len() as u32;
            let taps = [Tap::new(row, 0); LANES];
            self.all.push(Strand { place: [dx, dy], range: 0, count: 1, taps });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// dx, dy; range; rows and shifts.
    type Found = ([i32; 2], usize, Vec<(usize, usize)>);

    #[test]
    fn rows_meet_where_they_write() {
        let places = [[-1, 3], [-1, 4], [0, 3], [0, 4], [14, 3], [15, 3], [15, 4]];
        let mut found = Strands::default();
        // Found twice: nothing of the first search may be left.
        found.find(&[[5, 5]]);
        found.find(&places);
        let strands: Vec<Found> = found
            .all
            .iter()
            .map(|s| (s.place, s.range, s.taps().iter().map(|t| (t.row(), t.shift())).collect()))
            .collect();
        let expected = [
            ([-1, 3], 15, vec![(0, 0), (2, 1), (4, 15)]),
            ([-1, 4], 1, vec![(1, 0), (3, 1)]),
            ([15, 3], 0, vec![(5, 0)]),
            ([15, 4], 0, vec![(6, 0)]),
        ];
        assert_eq!(strands, expected);
    }
}
