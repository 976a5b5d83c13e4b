//! Phase gradients of a filter's response by its neighbours, demodulated.
//!
//! ```text
//! grad phi - k = Im(conj(R) R')/(|R|^2 + e),   R' = (R(+1) e^{-ik} - R(-1) e^{ik})/2
//! ```
//!
//! along each axis, rad/px, with the tuned frequency `k`: exact on the filter's own wave. At the edge
//! of the picture the sample itself stands for a neighbour, and the difference is one-sided; without a neighbour along
//! an axis nothing is left of it, which reads as the tuned frequency.
//! Source: Fleet & Jepson 1990 (doi 10.1007/BF00056772), section 3.

use super::response_pair::Band;

/// Complex factors of the samples before and after in a derivative along one axis.
#[derive(Clone, Copy)]
pub(super) struct Stencil {
    before: [f32; 2],
    after: [f32; 2],
}

impl Stencil {
    /// On a line whose neighbours lie beyond an edge: such a neighbour is the sample itself.
    fn new(k: f64, first: bool, last: bool) -> Self {
        let scale = if first || last { 1.0 } else { 0.5 };
        let turn = |angle: f64, by: f64| [by * angle.cos(), by * angle.sin()].map(|f| f as f32);
        Self {
            before: turn(if first { 0.0 } else { k }, -scale),
            after: turn(if last { 0.0 } else { -k }, scale),
        }
    }

    /// Between two neighbours, at the first sample, at the last, and at the only one.
    pub(super) fn all(k: f64) -> [Self; 4] {
        [(false, false), (true, false), (false, true), (true, true)]
            .map(|(first, last)| Self::new(k, first, last))
    }
}

/// Which of [`Stencil::all`] holds at position `i` of `n`.
pub(super) fn place(i: usize, n: usize) -> usize {
    usize::from(i == 0) + 2 * usize::from(i + 1 == n)
}

/// A response and its four neighbours.
#[derive(Clone, Copy)]
pub(super) struct Cross {
    pub(super) here: [f32; 2],
    pub(super) across: [[f32; 2]; 2],
    pub(super) along: [[f32; 2]; 2],
}

impl Cross {
    #[inline(always)]
    pub(super) fn new([above, here, below]: &Band<'_>, [left, x, right]: [usize; 3]) -> Self {
        Self {
            here: [here.0[x], here.1[x]],
            across: [[here.0[left], here.1[left]], [here.0[right], here.1[right]]],
            along: [[above.0[x], above.1[x]], [below.0[x], below.1[x]]],
        }
    }
}

/// Deviation of the phase gradient along one axis from the tuned one, rad/px.
#[inline(always)]
pub(super) fn deviation(
    [re, im]: [f32; 2],
    [a, b]: [[f32; 2]; 2],
    s: Stencil,
    inverse: f32,
) -> f32 {
    let slope_re =
        s.before[0] * a[0] - s.before[1] * a[1] + (s.after[0] * b[0] - s.after[1] * b[1]);
    let slope_im =
        s.before[0] * a[1] + s.before[1] * a[0] + (s.after[0] * b[1] + s.after[1] * b[0]);
    (re * slope_im - im * slope_re) * inverse
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wave of frequency `f`, seen by a filter tuned to `k`: sin(f - k) between two neighbours, and beside one
    /// neighbour too.
    #[test]
    fn slopes_of_a_wave_are_those_of_its_beat_with_the_filter() {
        let (k, f) = (1.1f64, 1.3f64);
        let at = |x: f64| [(f * x).cos() as f32, (f * x).sin() as f32];
        let all = Stencil::all(k);
        for (i, n) in [(4, 9), (0, 9), (8, 9), (0, 1)] {
            let near = [if i == 0 { 0.0 } else { -1.0 }, if i + 1 == n { 0.0 } else { 1.0 }];
            let found = deviation(at(0.0), near.map(at), all[place(i, n)], 1.0);
            let expected = if n == 1 { 0.0 } else { (f - k).sin() };
            assert!((f64::from(found) - expected).abs() < 1e-6, "{i} of {n}");
        }
    }
}
