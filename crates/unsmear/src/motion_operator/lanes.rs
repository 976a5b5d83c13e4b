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
//! Paths whose speed changes little, |q_a| <= [`GENTLE`] a, do without the root and the division: with x = q_a z / a^2,
//! tau a / z = 2 / (1 + sqrt(1 + 2 x)) and a / S = 1 / sqrt(1 + 2 x) are cubic polynomials in x, our own fits of least
//! largest error for |x| <= 0.162, off by 1.2e-4 and 6e-4: less than 1/100 px at 80 px from the centre.
//!
//! Keys' kernel and its integral, with n = min(|z|, 1), r = clamp(|z| - 1, 0, 1):
//!
//! ```text
//! kappa = 1 + n^2 (3/2 n - 5/2) - r/2 (1 - r)^2,   |C| = n + n^3 (3/8 n - 5/6) + r^2 (-1/4 + r (1/3 - r/8))
//! ```
//!
//! and of the triangle: kappa = 1 - n, |C| = n - n^2/2. Without branches, so that 16 pixels go at once.

/// How x is interpolated between its pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Taps {
    /// Keys' cubic: accurate, some weights negative.
    Cubic,
    /// As [`Taps::Cubic`], but an interpolating cubic spline sampled along the path itself where that is short; see
    /// `short_paths.rs`. Where the padding is too narrow for it, as the cubic.
    Spline,
    /// As [`Taps::Spline`] where neighbours move alike; where each pixel needs a stencil of its own, which costs most,
    /// only for the shortest paths.
    ThriftySpline,
    /// The triangle: faster and less accurate, no weight negative, as Richardson-Lucy needs it.
    Linear,
}

impl Taps {
    /// Where the kernel ends, px.
    pub(super) fn reach(self) -> usize {
        match self {
            Self::Cubic | Self::Spline | Self::ThriftySpline => 2,
            Self::Linear => 1,
        }
    }
}

/// Pixels that go together: one register of the widest kind, a line of cache.
pub(super) const LANES: usize = 16;

/// Largest |q_a| / a of the paths that take their times from polynomials: then |x| <= 0.3 / 2 + 0.3^2 / 8.
pub(super) const GENTLE: f32 = 0.3;

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

/// What the lines of a record need of its paths.
pub(super) struct Prepared {
    gain: Lanes,
    /// Major motion, and one over it.
    a: Lanes,
    inverse: Lanes,
    b: Lanes,
    qa: Lanes,
    /// q_a / a^2: x is this times z.
    bend: Lanes,
    half_qb: Lanes,
    da: Lanes,
    db: Lanes,
    /// No pixel is under both ends of its path at once.
    long: bool,
}

impl Prepared {
    /// From the lanes gain, a, b, then q_a, q_b unless the paths are straight, then d_a, d_b if they have an offset.
    #[inline(always)]
    pub(super) fn new<const CUBIC: bool>(lanes: &[Lanes]) -> Self {
        let at = |i: usize| lanes.get(i).copied().unwrap_or(Lanes::ZERO);
        let (a, mut inverse, mut bend, mut half_qb) = (at(1), at(1), at(3), at(4));
        let mut shortest = a.0[0];
        for i in 0..LANES {
            inverse.0[i] = 1.0 / a.0[i];
            bend.0[i] *= inverse.0[i] * inverse.0[i];
            half_qb.0[i] *= 0.5;
            shortest = least(shortest, a.0[i]);
        }
        let long = shortest >= if CUBIC { 4.0 } else { 2.0 };
        let [gain, b, qa, da, db] = [0, 2, 3, 5, 6].map(at);
        Self { gain, a, inverse, b, qa, bend, half_qb, da, db, long }
    }

    /// W and m of straight paths through their pixels. Line 0, which the mirrored paths share, weighs half.
    #[inline(always)]
    pub(super) fn straight<const CUBIC: bool>(&self, line: f32, inner: bool) -> [Lanes; 2] {
        let (mut weight, mut minor) = (Lanes::ZERO, Lanes::ZERO);
        let share = if line == 0.0 { 0.5 } else { 1.0 };
        for i in 0..LANES {
            minor.0[i] = line * (self.b.0[i] * self.inverse.0[i]);
            weight.0[i] = share * self.gain.0[i];
        }
        if !inner {
            for i in 0..LANES {
                let half = 0.5 * self.a.0[i];
                let far = if self.long { 0.5 } else { integral::<CUBIC>(half + line) };
                weight.0[i] *= far + integral::<CUBIC>(half - line);
            }
        }
        [weight, minor]
    }

    /// W and m of any paths. When the line is `INNER`, the whole kernel lies between the ends of all paths; `GENTLE` ones
    /// take tau and 1/S from the polynomials.
    #[inline(always)]
    pub(super) fn curved<const CUBIC: bool, const INNER: bool, const GENTLE: bool>(
        &self,
        line: f32,
    ) -> [Lanes; 2] {
        let (mut weight, mut minor) = (Lanes::ZERO, Lanes::ZERO);
        let (mut after, mut before) = (Lanes::ZERO, Lanes::ZERO);
        for i in 0..LANES {
            let (a, b, qa) = (self.a.0[i], self.b.0[i], self.qa.0[i]);
            let z = line - self.da.0[i];
            let mut e = z;
            let mut beyond = 0.0;
            if !INNER {
                let (half, bend) = (0.5 * a, 0.125 * qa);
                (after.0[i], before.0[i]) = (z - (bend - half), (bend + half) - z);
                e = least(most(z, bend - half), bend + half);
                // Farther out it weighs nothing, and need not be in the picture.
                beyond = least(most(z - e, -2.0), 2.0) * b * self.inverse.0[i];
            }
            let (tau, per_speed) = if GENTLE {
                let x = self.bend.0[i] * e;
                (e * self.inverse.0[i] * time(x), self.inverse.0[i] * slowness(x))
            } else {
                let speed = (a * a + 2.0 * qa * e).sqrt();
                let over = 1.0 / (speed * (a + speed));
                (2.0 * e * speed * over, (a + speed) * over)
            };
            weight.0[i] = self.gain.0[i] * per_speed;
            minor.0[i] = tau * (b + tau * self.half_qb.0[i]) + self.db.0[i] + beyond;
        }
        if !INNER && self.long {
            for i in 0..LANES {
                weight.0[i] *= 0.5 + integral::<CUBIC>(least(after.0[i], before.0[i]));
            }
        } else if !INNER {
            for i in 0..LANES {
                weight.0[i] *= integral::<CUBIC>(after.0[i]) + integral::<CUBIC>(before.0[i]);
            }
        }
        [weight, minor]
    }
}

/// 2 / (1 + sqrt(1 + 2 x)) for |x| <= 0.16.
#[inline(always)]
fn time(x: f32) -> f32 {
    1.0 + x * (-0.499_580_6 + x * (0.520_140_4 - 0.677_921_6 * x))
}

/// 1 / sqrt(1 + 2 x) for |x| <= 0.16.
#[inline(always)]
fn slowness(x: f32) -> f32 {
    1.0 + x * (-0.997_382_4 + x * (1.603_079_8 - 2.826_783_2 * x))
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
