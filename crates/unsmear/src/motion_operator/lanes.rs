//! The arithmetic of one grid line for pixels side by side: when the path is under its kernel, and where.
//!
//! With tau = -t and the axes swapped and mirrored so that the major motion a > 0, a path is
//!
//! ```text
//! z(tau) = tau a + tau^2/2 q_a,   m(tau) = tau b + tau^2/2 q_b,   tau in [-1/2, 1/2]
//! S(z) = dz/dtau = sqrt(a^2 + 2 q_a z),   tau(z) = 2 z / (a + S)
//! W(z) = gain [C(z - z_0) - C(z - z_1)] / S,   C(z) = integral_0^z kappa
//! ```
//!
//! Keys' kernel and its integral, with n = min(|z|, 1), r = clamp(|z| - 1, 0, 1):
//!
//! ```text
//! kappa = 1 + n^2 (3/2 n - 5/2) - r/2 (1 - r)^2,   |C| = n + n^3 (3/8 n - 5/6) + r^2 (-1/4 + r (1/3 - r/8))
//! ```
//!
//! and of the triangle: kappa = 1 - n, |C| = n - n^2/2. Without branches, so that 16 pixels go at once.

/// Pixels that go together: one register of the widest kind, a line of cache.
pub(super) const LANES: usize = 16;

/// One number for each of the pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(64))]
pub(super) struct Lanes(pub(super) [f32; LANES]);

impl Lanes {
    pub(super) const ZERO: Self = Self([0.0; LANES]);
}

/// One path, major axis first, mirrored so that a >= 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Parabola {
    /// a, b: V.
    pub(super) velocity: [f32; 2],
    /// q_a, q_b.
    pub(super) curvature: [f32; 2],
    /// d.
    pub(super) offset: [f32; 2],
}

impl Parabola {
    /// z_0 and z_1, the major offsets of the ends from the centre d.
    #[inline(always)]
    pub(super) fn ends(&self) -> [f32; 2] {
        let (half, bend) = (0.5 * self.velocity[0], 0.125 * self.curvature[0]);
        [bend - half, bend + half]
    }
}

/// W / gain and m of straight paths through their pixels, from the lanes gain, b / a, a / 2. Line 0, which the mirrored
/// paths share, weighs half.
#[inline(always)]
pub(super) fn straight_line<const CUBIC: bool>(
    lanes: &[Lanes],
    line: f32,
    inner: bool,
    weight: &mut Lanes,
    minor: &mut Lanes,
) {
    let [gain, slope, half] = [&lanes[0].0, &lanes[1].0, &lanes[2].0];
    let share = if line == 0.0 { 0.5 } else { 1.0 };
    for i in 0..LANES {
        minor.0[i] = line * slope[i];
        weight.0[i] = share * gain[i];
    }
    if !inner {
        for i in 0..LANES {
            weight.0[i] *= integral::<CUBIC>(half[i] + line) + integral::<CUBIC>(half[i] - line);
        }
    }
}

/// W and m, from the lanes gain, a, b, q_a, q_b and, when `MOVED`, d_a, d_b. When the line is `INNER`, the whole kernel
/// lies between the ends of all paths.
#[inline(always)]
pub(super) fn curved_line<const CUBIC: bool, const INNER: bool, const MOVED: bool>(
    lanes: &[Lanes],
    line: f32,
    weight: &mut Lanes,
    minor: &mut Lanes,
) {
    let [gain, a, b] = [&lanes[0].0, &lanes[1].0, &lanes[2].0];
    let [qa, qb] = [&lanes[3].0, &lanes[4].0];
    // Without an offset these two are not read.
    let [da, db] = if MOVED { [&lanes[5].0, &lanes[6].0] } else { [gain, gain] };
    for i in 0..LANES {
        let z = if MOVED { line - da[i] } else { line };
        let (half, bend) = (0.5 * a[i], 0.125 * qa[i]);
        let (z0, z1) = (bend - half, bend + half);
        let e = if INNER { z } else { least(most(z, z0), z1) };
        let speed = (a[i] * a[i] + 2.0 * qa[i] * e).sqrt();
        let sum = a[i] + speed;
        let inverse = 1.0 / (speed * sum);
        let tau = 2.0 * e * speed * inverse;
        let along = tau * (b[i] + tau * (0.5 * qb[i]));
        weight.0[i] = gain[i] * sum * inverse;
        minor.0[i] = if MOVED { along + db[i] } else { along };
        if !INNER {
            // Farther out it weighs nothing, and need not be in the picture.
            let beyond = least(most(z - e, -2.0), 2.0);
            minor.0[i] += beyond * b[i] / a[i];
            weight.0[i] *= integral::<CUBIC>(z - z0) - integral::<CUBIC>(z - z1);
        }
    }
}

/// The smaller; unlike `f32::min` without a rule for NaN.
#[inline(always)]
fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The larger; unlike `f32::max` without a rule for NaN.
#[inline(always)]
fn most(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// C(z).
#[inline(always)]
pub(super) fn integral<const CUBIC: bool>(z: f32) -> f32 {
    let n = least(z.abs(), 1.0);
    let size = if CUBIC {
        let r = least(most(z.abs() - 1.0, 0.0), 1.0);
        n + n * n * n * (0.375 * n - 5.0 / 6.0) + r * r * (r * (1.0 / 3.0 - 0.125 * r) - 0.25)
    } else {
        n - 0.5 * n * n
    };
    size.copysign(z)
}

/// kappa at the four samples around a position f in [0, 1) beyond the second of them; the
/// triangle uses the two in the middle.
#[inline(always)]
pub(super) fn four_taps<const CUBIC: bool>(f: f32) -> [f32; 4] {
    let g = 1.0 - f;
    if !CUBIC {
        return [0.0, g, f, 0.0];
    }
    let c = -0.5 * f * g;
    let (before, after) = (c * g, c * f);
    [before, g + after - 2.0 * before, f + before - 2.0 * after, after]
}
