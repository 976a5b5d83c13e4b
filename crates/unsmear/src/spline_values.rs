//! Values of a spline at a line of positions, from its coefficients; see [`interpolate`](crate::interpolate).
//!
//! ```text
//! s(y, x) = sum_l B_n(x - l) (sum_k B_n(y - k) c[k, l])        N = n + 1 samples per axis
//! ```
//!
//! Positions are taken 16 at a time. Where a flow is smooth all 16 read windows side by side, the same row
//! and columns one apart: then each of the N x N terms is a load of 16 coefficients in a row, the form that fills
//! vector registers. Otherwise each position reads its own window. The terms are added in the same order either
//! way, hence the same bits.
//!
//! Units and validity: those of [`interpolate`](crate::interpolate).

use multiversion::multiversion;

use crate::border::Border;
use crate::real::Real;

/// Positions handled together: a vector register of 512 bits of `f32`.
const LANES: usize = 16;

/// Positions (px) of the samples of row `row` that a flow moved: `y = row + v`, `x = column + u`.
///
/// Added in f64: in f32 a flow of 0.1 px at column 2000 would keep three digits only.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
pub(crate) fn moved<T: Real>(row: usize, u: &[T], v: &[T], y: &mut [f64], x: &mut [f64]) {
    let n = x.len();
    let (u, v, y) = (&u[..n], &v[..n], &mut y[..n]);
    for i in 0..n {
        x[i] = i as f64 + u[i].as_f64();
        y[i] = row as f64 + v[i].as_f64();
    }
}

/// Samples the spline with N = degree + 1 taps per axis at a line of positions.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
pub(crate) fn evaluate<T: Real, const N: usize>(
    c: &[T],
    size: [usize; 2],
    reflect: bool,
    y: &[f64],
    x: &[f64],
    out: &mut [T],
) {
    let (y_blocks, y_rest) = y.as_chunks::<LANES>();
    let (x_blocks, x_rest) = x.as_chunks::<LANES>();
    let (blocks, rest) = out.as_chunks_mut::<LANES>();
    for ((y, x), out) in y_blocks.iter().zip(x_blocks).zip(blocks) {
        if !side_by_side::<T, N>(c, size, y, x, out) {
            one_by_one::<T, N>(c, size, reflect, y, x, out);
        }
    }
    one_by_one::<T, N>(c, size, reflect, y_rest, x_rest, rest);
}

/// Samples 16 positions whose windows lie side by side; false, and nothing done, where they do not or leave the
/// picture.
#[inline(always)]
#[allow(clippy::needless_bitwise_bool, reason = "without branches the loop becomes vectors")]
fn side_by_side<T: Real, const N: usize>(
    c: &[T],
    [height, width]: [usize; 2],
    y: &[f64; LANES],
    x: &[f64; LANES],
    out: &mut [T; LANES],
) -> bool {
    // A position that is not in the picture, NaN too, is no row and column of it.
    let (first_y, first_x) = (y[0] as usize, x[0] as usize);
    let reach = N / 2 - 1;
    if first_y < reach
        || first_x < reach
        || first_y - reach + N > height
        || first_x - reach + N + LANES - 1 > width
    {
        return false;
    }
    let (row, column) = (first_y as f64, first_x as f64);
    let (mut down, mut along) = ([0.0; LANES], [0.0; LANES]);
    let mut same = true;
    for i in 0..LANES {
        down[i] = y[i] - row;
        along[i] = x[i] - (column + i as f64);
        same &= (down[i] >= 0.0) & (down[i] < 1.0) & (along[i] >= 0.0) & (along[i] < 1.0);
    }
    if !same {
        return false;
    }
    let (mut wy, mut wx) = ([[T::zero(); LANES]; N], [[T::zero(); LANES]; N]);
    for i in 0..LANES {
        let (y, x) = (weights::<T, N>(T::of(down[i])), weights::<T, N>(T::of(along[i])));
        for k in 0..N {
            (wy[k][i], wx[k][i]) = (y[k], x[k]);
        }
    }
    let corner = (first_y - reach) * width + first_x - reach;
    *out = [T::zero(); LANES];
    for l in 0..N {
        let mut sum = [T::zero(); LANES];
        for k in 0..N {
            let line = &c[corner + k * width + l..][..LANES];
            for i in 0..LANES {
                sum[i] += wy[k][i] * line[i];
            }
        }
        for i in 0..LANES {
            out[i] += wx[l][i] * sum[i];
        }
    }
    true
}

/// Samples any positions.
#[inline(always)]
fn one_by_one<T: Real, const N: usize>(
    c: &[T],
    [height, width]: [usize; 2],
    reflect: bool,
    y: &[f64],
    x: &[f64],
    out: &mut [T],
) {
    for ((&y, &x), value) in y.iter().zip(x).zip(out) {
        if !(y.is_finite() && x.is_finite()) {
            *value = T::nan();
            continue;
        }
        let (first_row, ty) = first_tap::<T, N>(y, height, reflect);
        let (first_column, tx) = first_tap::<T, N>(x, width, reflect);
        let (wy, wx) = (weights::<T, N>(ty), weights::<T, N>(tx));
        // Down the columns first: N independent sums side by side, added up once at the end.
        let mut down = [T::zero(); N];
        let inside = first_row >= 0
            && first_column >= 0
            && first_row as usize + N <= height
            && first_column as usize + N <= width;
        if inside {
            let corner = first_row as usize * width + first_column as usize;
            for k in 0..N {
                let line = &c[corner + k * width..][..N];
                for l in 0..N {
                    down[l] += wy[k] * line[l];
                }
            }
        } else {
            // The coefficients continue as the mirror does, whatever the rule for positions.
            let at = |i: isize, n| Border::Reflect.index(i, n).unwrap_or_default();
            for k in 0..N {
                let line = at(first_row + k as isize, height) * width;
                for l in 0..N {
                    down[l] += wy[k] * c[line + at(first_column + l as isize, width)];
                }
            }
        }
        let mut sum = T::zero();
        for l in 0..N {
            sum += wx[l] * down[l];
        }
        *value = sum;
    }
}

/// The first of the N samples around a finite position on a line of `n` samples, and the position's fraction.
#[inline(always)]
fn first_tap<T: Real, const N: usize>(position: f64, n: usize, reflect: bool) -> (isize, T) {
    let last = (n - 1) as f64;
    let mut p = position;
    if p < 0.0 || p > last {
        p = if reflect && n > 1 {
            let folded = p.rem_euclid(2.0 * last);
            folded.min(2.0 * last - folded)
        } else {
            p.clamp(0.0, last)
        };
    }
    let whole = p as isize; // p >= 0: truncation is the floor
    (whole - (N as isize / 2 - 1), T::of(p - whole as f64))
}

/// `B_n(t - k)` for the N = n + 1 samples k whose B-splines reach the position at fraction `t` in [0, 1).
///
/// Written in powers of t and of 1 - t on each piece, so that no large terms cancel in `f32`.
#[inline(always)]
fn weights<T: Real, const N: usize>(t: T) -> [T; N] {
    let mut w = [T::zero(); N];
    let ends = [T::one() - t, t];
    for (end, &s) in ends.iter().enumerate() {
        // From the outermost sample inwards; the two ends are mirror images.
        let at = |k: usize| if end == 0 { k } else { N - 1 - k };
        let s2 = s * s;
        let s3 = s2 * s;
        match N {
            2 => w[at(0)] = s,
            4 => {
                let scale = T::of(1.0 / 6.0);
                w[at(0)] = s3 * scale;
                w[at(1)] = (T::one() + T::of(3.0) * (s + s2 - s3)) * scale;
            }
            _ => {
                let scale = T::of(1.0 / 120.0);
                let five = T::of(5.0);
                let (s4, s5) = (s2 * s2, s3 * s2);
                w[at(0)] = s5 * scale;
                w[at(1)] = (T::one() + five * (s + s4 - s5) + T::of(10.0) * (s2 + s3)) * scale;
                w[at(2)] = (T::of(26.0)
                    + T::of(50.0) * s
                    + T::of(20.0) * (s2 - s3 - s4)
                    + T::of(10.0) * s5)
                    * scale;
            }
        }
    }
    w
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Blocks side by side, across a jump of the flow, over the edges and with unknown positions: the same bits as
    /// one position after the other.
    fn the_same_bits<const N: usize>() {
        let (height, width) = (23usize, 61usize);
        let c: Vec<f32> = (0..height * width).map(|i| ((i * i) % 97) as f32 - 40.0).collect();
        let mut blocks = 0;
        for shift in [0.0, 0.3, 2.999, -1.5, 7.25] {
            for row in -3..26 {
                let bend = |x: usize| if x > 37 { 1.6 } else { 0.004 * x as f64 };
                let x: Vec<f64> = (0..width).map(|x| x as f64 + shift + bend(x)).collect();
                let mut y: Vec<f64> = (0..width).map(|x| f64::from(row) + bend(x)).collect();
                y[50] = if row == 4 { f64::NAN } else { y[50] };
                for reflect in [false, true] {
                    let (mut fast, mut slow) = (vec![7.0f32; width], vec![9.0f32; width]);
                    evaluate::<f32, N>(&c, [height, width], reflect, &y, &x, &mut fast);
                    one_by_one::<f32, N>(&c, [height, width], reflect, &y, &x, &mut slow);
                    let bits = |v: &[f32]| v.iter().map(|s| s.to_bits()).collect::<Vec<_>>();
                    assert_eq!(bits(&fast), bits(&slow), "row {row}, shift {shift}");
                }
                let (y, x, mut out) = (y.first_chunk(), x.first_chunk(), [0.0f32; LANES]);
                if let (Some(y), Some(x)) = (y, x) {
                    let size = [height, width];
                    blocks += usize::from(side_by_side::<f32, N>(&c, size, y, x, &mut out));
                }
            }
        }
        assert!(blocks > 10, "{blocks} blocks took the fast way");
    }

    #[test]
    fn blocks_and_single_positions_agree() {
        the_same_bits::<2>();
        the_same_bits::<4>();
        the_same_bits::<6>();
    }
}
