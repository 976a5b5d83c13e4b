//! The stencils of all blocks of a picture, made once for an operator that is applied often.
//!
//! A stencil costs more to make than to use: where every pixel has a path of its own, two thirds of what a step of a
//! solver takes. Kept, it is 4 bytes per tap and pixel, 200 for a path of 5 px. So a row keeps what fits into [`MOST`] and
//! [`MOST_OF_ALL`]; the blocks after that are made anew each time. What comes out is the same, bit for bit.

use rayon::prelude::*;

use super::lanes::Lanes;
use super::stencil::{Paths, Stencil, Taken};

/// Bytes kept per pixel, at most: enough for paths of 5 px whatever their direction, and of 8 px along an axis.
const MOST: usize = 256;
/// Bytes kept in all, at most: pictures of more than a megapixel keep the stencils of a part of every row.
const MOST_OF_ALL: usize = 1 << 28;
/// Rows made side by side before they are put to the others: all taps lie in one piece of memory, which goes back to the
/// system as a whole.
const BAND: usize = 32;

/// The stencils of the first blocks of every row.
#[derive(Debug, Clone, Default)]
pub(super) struct KeptStencils {
    /// Row by row.
    blocks: Vec<Block>,
    /// Where the blocks of a row begin, and the end of the last.
    rows: Vec<usize>,
    taps: Vec<Lanes>,
}

/// Where the taps of a block stand; equal neighbours share theirs.
#[derive(Debug, Clone)]
struct Block {
    first: [i32; 2],
    rows: usize,
    from: usize,
    count: usize,
}

impl KeptStencils {
    /// Of `height` rows of `width` pixels, whose blocks have the paths that `paths_of` gives. `rules` are Gauss' by their
    /// number of nodes.
    pub(super) fn new<I: Iterator<Item = Paths>>(
        (height, width): (usize, usize),
        paths_of: impl Fn(usize) -> I + Sync,
        rules: &[Vec<[f32; 2]>],
    ) -> Self {
        let most = (MOST * width).min(MOST_OF_ALL / height.max(1)) / size_of::<Lanes>();
        let mut kept = Self { rows: vec![0], ..Self::default() };
        // Memory that is not written is not taken.
        kept.taps.reserve_exact(most * height);
        for first in (0..height).step_by(BAND) {
            let rows = first..height.min(first + BAND);
            let made: Vec<_> =
                rows.into_par_iter().map(|y| first_of(paths_of(y), most, rules)).collect();
            for (blocks, taps) in made {
                let before = kept.taps.len();
                kept.taps.extend(taps);
                kept.blocks.extend(
                    blocks.into_iter().map(|block| Block { from: before + block.from, ..block }),
                );
                kept.rows.push(kept.blocks.len());
            }
        }
        kept.taps.shrink_to_fit();
        kept
    }

    /// The stencil of block number `i` of row `y`, if it is kept.
    pub(super) fn get(&self, y: usize, i: usize) -> Option<Taken<'_>> {
        let row = self.blocks.get(*self.rows.get(y)?..*self.rows.get(y + 1)?)?;
        let block = row.get(i)?;
        let taps = self.taps.get(block.from..block.from + block.count)?;
        Some(Taken { first: block.first, rows: block.rows, taps })
    }
}

/// The blocks of one row until their taps are `most`.
fn first_of(
    paths: impl Iterator<Item = Paths>,
    most: usize,
    rules: &[Vec<[f32; 2]>],
) -> (Vec<Block>, Vec<Lanes>) {
    let (mut blocks, mut kept) = (Vec::<Block>::new(), Vec::with_capacity(most));
    let mut stencil = Stencil::default();
    for paths in paths {
        let made = stencil.renew(&paths, rules);
        let Taken { first, rows, taps } = stencil.taken();
        let from = match blocks.last() {
            Some(last) if !made => last.from,
            _ if kept.len() + taps.len() > most => break,
            _ => {
                kept.extend_from_slice(taps);
                kept.len() - taps.len()
            }
        };
        blocks.push(Block { first, rows, from, count: taps.len() });
    }
    (blocks, kept)
}

#[cfg(test)]
mod tests {
    use super::super::lanes::LANES;
    use super::super::stencil::{gauss, nodes_for};
    use super::*;

    #[test]
    fn keeps_what_fits_and_equal_neighbours_once() {
        let rules: Vec<_> = (0..=nodes_for(8.0)).map(gauss).collect();
        let path = |u: f32| {
            let mut paths = [Lanes::ZERO; 6];
            paths[0] = Lanes([u; LANES]);
            paths
        };
        let differ: fn(usize) -> f32 = |i| 1.0 + 6.0 * i as f32 / 40.0;
        let row = |motion: fn(usize) -> f32| {
            KeptStencils::new((1, 40 * LANES), |_| (0..40).map(move |i| path(motion(i))), &rules)
        };
        let (alike, different) = (row(|_| 7.5), row(differ));
        assert_eq!(alike.blocks.len(), 40);
        assert_eq!(alike.taps.len(), alike.blocks[0].count);
        assert_eq!(different.blocks.len(), 40);
        let mut stencil = Stencil::default();
        for i in 0..40 {
            stencil.renew(&path(differ(i)), &rules);
            let (kept, made) = (different.get(0, i).unwrap(), stencil.taken());
            assert_eq!((kept.first, kept.rows, kept.taps), (made.first, made.rows, made.taps));
        }
        let diagonal = |i: usize| {
            let mut paths = path(5.5 + 0.01 * i as f32);
            paths[1] = paths[0];
            paths
        };
        let long = KeptStencils::new((1, 40 * LANES), |_| (0..40).map(diagonal), &rules);
        assert!(long.blocks.len() < 40 && long.get(0, 39).is_none());
        assert!(size_of_val(&long.taps[..]) <= MOST * 40 * LANES);
    }
}
