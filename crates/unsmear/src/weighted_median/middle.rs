//! Weighted middles of the samples of a window, without sorting.
//!
//! A bracket of two samples closes in on the middle. For a pivot within it, one pass yields the weight S of the samples
//! at or below the pivot, the greatest of these and the least above. If S is half of all weight or more, the former
//! becomes the upper end, else the latter the lower end; so every pass drops a sample at least, and in a cluster of
//! samples nearly half or more. The pivot is where the weight would be half if it were spread evenly over the bracket,
//! or, every second time, the middle of the bracket, which bounds the passes for skewed clusters.
//!
//! Samples are compared by *keys*: the bits of an f32 as an integer, the negative ones mirrored, are in the order of the
//! numbers (-0 before 0). Sums and extremes of integers need no order, so that the compiler makes vectors of them.

use multiversion::multiversion;

/// Windows hold a multiple of this number of samples: four vector registers of 512 bits.
pub(super) const RUN: usize = 64;

/// Two samples, as keys, between which the middle lies, themselves included.
#[derive(Clone, Copy)]
struct Bracket {
    low: i32,
    high: i32,
    /// Weight below `low`.
    below: i32,
    /// Weight at or below `high`.
    within: i32,
}

/// Least samples of `u` and of `v` at or below which lies half of the weight.
///
/// `keys` is scratch. All slices have the same multiple of [`RUN`] samples; weights are not negative, not all 0, and
/// twice their sum is an i32.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn weighted_middles(
    u: &[f32],
    v: &[f32],
    weights: &[i32],
    keys: &mut [i32],
) -> (f32, f32) {
    write_keys(u, keys);
    let middle_u = weighted_middle(keys, weights);
    write_keys(v, keys);
    (middle_u, weighted_middle(keys, weights))
}

#[inline(always)]
fn weighted_middle(keys: &[i32], weights: &[i32]) -> f32 {
    let mut bracket = extremes(keys, weights);
    let total = bracket.within;
    let mut even = false;
    while bracket.low < bracket.high {
        even = !even;
        let (weight, low, high) = part(keys, weights, pivot(bracket, total, even));
        if 2 * weight >= total {
            (bracket.high, bracket.within) = (low, weight);
        } else {
            (bracket.low, bracket.below) = (high, weight);
        }
    }
    sample_of(bracket.low)
}

/// A key with `low` <= pivot < `high`.
#[inline(always)]
fn pivot(bracket: Bracket, total: i32, even: bool) -> i32 {
    let Bracket { low, high, below, within } = bracket;
    let spread = (0.5 * total as f32 - below as f32) / (within - below) as f32;
    let share = if even { spread } else { 0.5 };
    let (first, last) = (sample_of(low), sample_of(high));
    let pivot = key_of(first + (last - first) * share);
    if low <= pivot && pivot < high { pivot } else { low }
}

/// The weight at or below the pivot, the greatest key there, and the least above.
#[inline(always)]
fn part(keys: &[i32], weights: &[i32], pivot: i32) -> (i32, i32, i32) {
    let n = weights.len() / RUN * RUN;
    let (keys, weights) = (&keys[..n], &weights[..n]);
    let (mut weight, mut low, mut high) = (0, i32::MIN, i32::MAX);
    for i in 0..n {
        let below = keys[i] <= pivot;
        weight += if below { weights[i] } else { 0 };
        low = low.max(if below { keys[i] } else { i32::MIN });
        high = high.min(if below { i32::MAX } else { keys[i] });
    }
    (weight, low, high)
}

/// The bracket of all samples that weigh anything.
#[inline(always)]
fn extremes(keys: &[i32], weights: &[i32]) -> Bracket {
    let n = weights.len() / RUN * RUN;
    let (keys, weights) = (&keys[..n], &weights[..n]);
    let (mut low, mut high, mut within) = (i32::MAX, i32::MIN, 0);
    for i in 0..n {
        let counts = weights[i] > 0;
        within += weights[i];
        low = low.min(if counts { keys[i] } else { i32::MAX });
        high = high.max(if counts { keys[i] } else { i32::MIN });
    }
    Bracket { low, high, below: 0, within }
}

#[inline(always)]
fn write_keys(samples: &[f32], keys: &mut [i32]) {
    let n = keys.len() / RUN * RUN;
    let (samples, keys) = (&samples[..n], &mut keys[..n]);
    for i in 0..n {
        keys[i] = key_of(samples[i]);
    }
}

#[inline(always)]
fn key_of(sample: f32) -> i32 {
    mirrored(sample.to_bits().cast_signed())
}

#[inline(always)]
fn sample_of(key: i32) -> f32 {
    f32::from_bits(mirrored(key).cast_unsigned())
}

/// Inverts all bits but the sign of a negative integer.
#[inline(always)]
fn mirrored(bits: i32) -> i32 {
    bits ^ ((bits >> 31) & i32::MAX)
}
