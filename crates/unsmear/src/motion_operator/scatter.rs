//! The scatter of one group of blocks: products written down side by side, summed by strands, added to the picture.

use super::group::TOGETHER;
use super::lanes::{LANES, Lanes};
use super::strands::{Strand, Tap};

/// A row of products of a group, between blocks of zeros.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(super) struct Products([[f32; LANES]; TOGETHER + 2]);

/// Products lane by lane.
#[inline(always)]
pub(super) fn product(a: &Lanes, b: &Lanes) -> Lanes {
    let mut out = Lanes::ZERO;
    for i in 0..LANES {
        out.0[i] = a.0[i] * b.0[i];
    }
    out
}

/// `sum` + `block`.
#[inline(always)]
fn add(sum: &Lanes, block: &[f32; LANES]) -> Lanes {
    let mut out = Lanes::ZERO;
    for i in 0..LANES {
        out.0[i] = sum.0[i] + block[i];
    }
    out
}

/// Writes rows of `weights` times `data` down.
#[inline(always)]
pub(super) fn write_products<const N: usize>(
    weights: &[[Lanes; N]],
    data: &[Lanes; N],
    products: &mut Vec<Products>,
) {
    if products.len() < weights.len() {
        products.resize(weights.len(), Products([[0.0; LANES]; TOGETHER + 2]));
    }
    for (weights, products) in weights.iter().zip(products) {
        for n in 0..N {
            products.0[n + 1] = product(&weights[n], &data[n]).0;
        }
        products.0[N + 1] = [0.0; LANES];
    }
}

/// Adds a strand, or its mirror image, to the samples from `place` on.
#[inline(always)]
pub(super) fn add_strand<const MIRRORED: bool, const N: usize>(
    products: &[Products],
    strand: &Strand,
    taps: &[Tap],
    x: &mut [f32],
    place: usize,
) {
    let mut sums = [Lanes::ZERO; TOGETHER + 1];
    for tap in taps {
        let shift = if MIRRORED { strand.range() - tap.shift() } else { tap.shift() };
        let from = &products[tap.row()].0.as_flattened()[LANES - shift..];
        let from = &from[..(N + 1) * LANES].as_chunks().0[..=N];
        for n in 0..=N {
            sums[n] = add(&sums[n], &from[n]);
        }
    }
    let x = &mut x[place..];
    if let Some((to, _)) = x.split_at_mut_checked((N + 1) * LANES) {
        for (to, sum) in to.as_chunks_mut().0.iter_mut().zip(&sums) {
            *to = add(sum, to).0;
        }
    } else {
        // What lies beyond the picture are the zeros after the last product.
        for (to, sum) in x.iter_mut().zip(sums.iter().flat_map(|sum| sum.0)) {
            *to += sum;
        }
    }
}
