//! Weighted middles of the samples of a window, without sorting.
//!
//! A bracket of two samples closes in on the middle. For a pivot within it, one pass yields the weight S of the samples
//! at or below the pivot, the greatest of these and the least above. If S is half of all weight or more, the former
//! becomes the upper end, else the latter the lower end; so every pass drops a sample at least, and in a cluster of
//! samples nearly half or more. The pivot is where the weight would be half if it were spread evenly over the bracket,
//! or, every second time, the middle of the bracket, which bounds the passes for skewed clusters.

use multiversion::multiversion;

use super::window::LANES;

/// One component's bracket.
#[derive(Clone, Copy)]
struct Bracket {
    low: f32,
    high: f32,
    /// Weight below `low`, and at or below `high`.
    below: f32,
    within: f32,
}

/// What a pass over the samples finds: the weight at or below the pivot, the greatest sample there, the least above.
#[derive(Clone, Copy)]
struct Found {
    weight: [f32; LANES],
    low: [f32; LANES],
    high: [f32; LANES],
}

/// Least samples of `u` and of `v` at or below which lies half of the weight; whole non-negative weights, not all 0,
/// with sums below 2^24.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn weighted_middles(u: &[f32], v: &[f32], weights: &[f32]) -> (f32, f32) {
    let (u, v, weights) =
        (u.as_chunks::<LANES>().0, v.as_chunks::<LANES>().0, weights.as_chunks::<LANES>().0);
    let n = weights.len();
    let (u, v) = (&u[..n], &v[..n]);
    let (mut of_u, mut of_v) = (extremes(u, weights), extremes(v, weights));
    let total = of_u.within;
    let mut even = false;
    while of_u.low < of_u.high || of_v.low < of_v.high {
        even = !even;
        let (pivot_u, pivot_v) = (of_u.pivot(total, even), of_v.pivot(total, even));
        let mut found_u = Found {
            weight: [0.0; LANES],
            low: [f32::NEG_INFINITY; LANES],
            high: [f32::INFINITY; LANES],
        };
        let mut found_v = found_u;
        for i in 0..n {
            found_u.add(&u[i], &weights[i], pivot_u);
            found_v.add(&v[i], &weights[i], pivot_v);
        }
        of_u.close(&found_u, total);
        of_v.close(&found_v, total);
    }
    (of_u.low, of_v.low)
}

impl Bracket {
    /// A value with `low` <= pivot < `high`, or any when these are the same.
    #[inline(always)]
    fn pivot(&self, total: f32, even: bool) -> f32 {
        let share = (0.5 * total - self.below) / (self.within - self.below);
        let pivot = self.low + (self.high - self.low) * if even { share } else { 0.5 };
        if self.low <= pivot && pivot < self.high { pivot } else { self.low }
    }

    #[inline(always)]
    fn close(&mut self, found: &Found, total: f32) {
        if self.low < self.high {
            let weight = sum(found.weight);
            if 2.0 * weight >= total {
                self.high = greatest(found.low);
                self.within = weight;
            } else {
                self.low = least(found.high);
                self.below = weight;
            }
        }
    }
}

impl Found {
    #[inline(always)]
    fn add(&mut self, samples: &[f32; LANES], weights: &[f32; LANES], pivot: f32) {
        for l in 0..LANES {
            let below = samples[l] <= pivot;
            self.weight[l] += if below { weights[l] } else { 0.0 };
            let low = if below { samples[l] } else { f32::NEG_INFINITY };
            self.low[l] = if low > self.low[l] { low } else { self.low[l] };
            let high = if below { f32::INFINITY } else { samples[l] };
            self.high[l] = if high < self.high[l] { high } else { self.high[l] };
        }
    }
}

/// The bracket of all samples that weigh anything.
#[inline(always)]
fn extremes(samples: &[[f32; LANES]], weights: &[[f32; LANES]]) -> Bracket {
    let mut low = [f32::INFINITY; LANES];
    let mut high = [f32::NEG_INFINITY; LANES];
    let mut total = [0.0; LANES];
    for (samples, weights) in samples.iter().zip(weights) {
        for l in 0..LANES {
            let counts = weights[l] > 0.0;
            total[l] += weights[l];
            let s = if counts { samples[l] } else { f32::INFINITY };
            low[l] = if s < low[l] { s } else { low[l] };
            let s = if counts { samples[l] } else { f32::NEG_INFINITY };
            high[l] = if s > high[l] { s } else { high[l] };
        }
    }
    Bracket { low: least(low), high: greatest(high), below: 0.0, within: sum(total) }
}

#[inline(always)]
fn sum(mut lanes: [f32; LANES]) -> f32 {
    let mut n = LANES / 2;
    while n > 0 {
        for l in 0..n {
            lanes[l] += lanes[l + n];
        }
        n /= 2;
    }
    lanes[0]
}

#[inline(always)]
fn least(mut lanes: [f32; LANES]) -> f32 {
    let mut n = LANES / 2;
    while n > 0 {
        for l in 0..n {
            lanes[l] = if lanes[l + n] < lanes[l] { lanes[l + n] } else { lanes[l] };
        }
        n /= 2;
    }
    lanes[0]
}

#[inline(always)]
fn greatest(mut lanes: [f32; LANES]) -> f32 {
    let mut n = LANES / 2;
    while n > 0 {
        for l in 0..n {
            lanes[l] = if lanes[l + n] > lanes[l] { lanes[l + n] } else { lanes[l] };
        }
        n /= 2;
    }
    lanes[0]
}
