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

/// One row of products in a strand: its number, and s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Tap {
    pub(super) row: u32,
    pub(super) shift: u32,
}

/// Some taps, and where they begin in the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Strand {
    /// dy and least dx.
    pub(super) place: [i32; 2],
    /// Largest shift.
    pub(super) range: u32,
    /// First tap, and the one after the last.
    pub(super) taps: [u32; 2],
}

/// The strands of a group of blocks, and memory to find them.
#[derive(Debug, Default)]
pub(super) struct Strands {
    pub(super) strands: Vec<Strand>,
    pub(super) taps: Vec<Tap>,
    starts: Vec<u32>,
    order: Vec<u32>,
}

impl Strands {
    /// Finds the strands of rows at `places` (dx, dy), whose dx ascend within equal dy.
    pub(super) fn find(&mut self, places: &[[i32; 2]]) {
        self.sort(places);
        self.strands.clear();
        self.taps.clear();
        for &row in &self.order {
            let [dx, dy] = places[row as usize];
            let last = self.strands.last_mut().filter(|strand| {
                strand.place[1] == dy && ((dx - strand.place[0]) as usize) < LANES
            });
            let (shift, end) = (last.as_ref().map_or(0, |s| (dx - s.place[0]) as u32), self.taps.len() as u32 + 1);
            match last {
                Some(strand) => (strand.range, strand.taps[1]) = (shift, end),
                None => self.strands.push(Strand { place: [dx, dy], range: 0, taps: [end - 1, end] }),
            }
            self.taps.push(Tap { row, shift });
        }
    }

    /// Sets `order` to the rows by ascending dy, those of one dy as they came.
    fn sort(&mut self, places: &[[i32; 2]]) {
        let least = places.iter().map(|place| place[1]).min().unwrap_or(0);
        let most = places.iter().map(|place| place[1]).max().unwrap_or(0);
        self.starts.clear();
        self.starts.resize((most - least) as usize + 2, 0);
        for [_, dy] in places {
            self.starts[(dy - least) as usize + 1] += 1;
        }
        for i in 1..self.starts.len() {
            self.starts[i] += self.starts[i - 1];
        }
        self.order.clear();
        self.order.resize(places.len(), 0);
        for (row, [_, dy]) in places.iter().enumerate() {
            let next = &mut self.starts[(dy - least) as usize];
            self.order[*next as usize] = row as u32;
            *next += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_meet_where_they_write() {
        let places = [[-1, 3], [-1, 4], [0, 3], [0, 4], [14, 3], [15, 3], [15, 4]];
        let mut found = Strands::default();
        // Found twice: nothing of the first search may be left.
        found.find(&[[5, 5]]);
        found.find(&places);
        let strands: Vec<_> = found
            .strands
            .iter()
            .map(|s| {
                let taps = &found.taps[s.taps[0] as usize..s.taps[1] as usize];
                (s.place, s.range, taps.iter().map(|t| (t.row, t.shift)).collect::<Vec<_>>())
            })
            .collect();
        let expected = [
            ([-1, 3], 15, vec![(0, 0), (2, 1), (4, 15)]),
            ([15, 3], 0, vec![(5, 0)]),
            ([-1, 4], 1, vec![(1, 0), (3, 1)]),
            ([15, 4], 0, vec![(6, 0)]),
        ];
        assert_eq!(strands, expected);
    }
}
