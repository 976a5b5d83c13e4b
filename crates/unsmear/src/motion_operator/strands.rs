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

/// One row of products in a strand: its number, counted from the strand's first, and s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Tap(u16);

impl Tap {
    /// None where the row is too far from the strand's first one.
    fn new(row: usize, shift: usize) -> Option<Self> {
        u16::try_from(row * LANES + shift).ok().map(Self)
    }

    pub(super) fn row(self) -> usize {
        usize::from(self.0) / LANES
    }

    pub(super) fn shift(self) -> usize {
        usize::from(self.0) % LANES
    }
}

/// Up to [`LANES`] taps, and where they begin in the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Strand {
    /// Least dx, and dy.
    place: [i16; 2],
    /// Largest shift.
    range: u8,
    count: u8,
    /// Its first tap, and the row that this one is.
    first: u32,
    row: u32,
}

impl Strand {
    /// Least dx, and dy.
    pub(super) fn place(&self) -> [isize; 2] {
        self.place.map(isize::from)
    }

    /// Largest shift.
    pub(super) fn range(&self) -> usize {
        self.range.into()
    }

    /// Its rows out of those of the group.
    pub(super) fn rows_of<'a, P>(&self, products: &'a [P]) -> &'a [P] {
        &products[self.row as usize..]
    }
}

/// No strand of a dy yet.
const NONE: u32 = u32::MAX;

/// The strands of groups of blocks, one group after the other.
#[derive(Debug, Clone, Default)]
pub(super) struct Strands {
    all: Vec<Strand>,
    taps: Vec<Tap>,
    /// Memory of [`Strands::find`]: the last strand of each dy.
    last: Vec<u32>,
}

impl Strands {
    /// Strands of a group, from the first to the second, exclusive.
    pub(super) fn of(&self, [from, to]: [u32; 2]) -> &[Strand] {
        &self.all[from as usize..to as usize]
    }

    pub(super) fn taps(&self, strand: &Strand) -> &[Tap] {
        &self.taps[strand.first as usize..][..usize::from(strand.count)]
    }

    /// Adds those of rows at `places` (dx, dy), whose dx ascend within equal dy; returns which they are.
    pub(super) fn find(&mut self, places: &[[i32; 2]]) -> [u32; 2] {
        let before = self.all.len();
        let (mut least, mut most) = (i32::MAX, i32::MIN);
        for &[_, dy] in places {
            (least, most) = (least.min(dy), most.max(dy));
        }
        self.last.clear();
        self.last.resize((most - least + 1) as usize, NONE);
        for (row, &[dx, dy]) in places.iter().enumerate() {
            let last = &mut self.last[(dy - least) as usize];
            if let Some(strand) = self.all.get_mut(*last as usize) {
                let shift = (dx - i32::from(strand.place[0])) as usize;
                if shift < LANES
                    && usize::from(strand.count) < LANES
                    && let Some(tap) = Tap::new(row - strand.row as usize, shift)
                {
                    self.taps[strand.first as usize + usize::from(strand.count)] = tap;
                    (strand.range, strand.count) = (shift as u8, strand.count + 1);
                    continue;
                }
            }
            *last = self.all.len() as u32;
            let (place, first) = ([dx as i16, dy as i16], self.taps.len() as u32);
            self.all.push(Strand { place, range: 0, count: 1, first, row: row as u32 });
            self.taps.extend([Tap(0); LANES]);
        }
        [before as u32, self.all.len() as u32]
    }

    /// Forgets all of them.
    pub(super) fn clear(&mut self) {
        self.all.clear();
        self.taps.clear();
    }

    /// The same without room for more.
    pub(super) fn compact(&self) -> Self {
        let (mut all, mut taps) = (self.all.clone(), Vec::new());
        taps.reserve_exact(all.iter().map(|strand| usize::from(strand.count)).sum());
        for (strand, own) in all.iter_mut().zip(&self.all) {
            strand.first = taps.len() as u32;
            taps.extend_from_slice(self.taps(own));
        }
        Self { all, taps, last: Vec::new() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// dx, dy; range; rows and shifts.
    type Found = ([isize; 2], usize, Vec<(usize, usize)>);

    #[test]
    fn rows_meet_where_they_write() {
        let places = [[-1, 3], [-1, 4], [0, 3], [0, 4], [14, 3], [15, 3], [15, 4]];
        let mut found = Strands::default();
        let first = found.find(&[[5, 5]]);
        let own = found.find(&places);
        let taps = |s: &Strand| {
            found.taps(s).iter().map(|t| (s.row as usize + t.row(), t.shift())).collect()
        };
        let strands: Vec<Found> =
            found.of(own).iter().map(|s| (s.place(), s.range(), taps(s))).collect();
        let expected = [
            ([-1, 3], 15, vec![(0, 0), (2, 1), (4, 15)]),
            ([-1, 4], 1, vec![(1, 0), (3, 1)]),
            ([15, 3], 0, vec![(5, 0)]),
            ([15, 4], 0, vec![(6, 0)]),
        ];
        assert_eq!(strands, expected);
        let compact = found.compact();
        for (one, own) in found.of(own).iter().zip(compact.of(own)) {
            assert_eq!((one.place, found.taps(one)), (own.place, compact.taps(own)));
        }
        assert_eq!(compact.taps.len(), 8);
        // Rows too far apart to be told from the first.
        let places: Vec<_> = (0..5000).map(|i| [0, i % 4999]).collect();
        let own = found.find(&places);
        assert_eq!(found.of(own).len(), 5000);
        assert_eq!(found.of(first)[0].place(), [5, 5]);
    }
}
