//! Slow twin of the operator: one pixel at a time, in double precision, by the formulas as they stand.

use super::Taps;

/// One pixel's path, major axis first: V, q, d as (major, minor).
pub(super) struct ScalarPath {
    pub(super) velocity: [f64; 2],
    pub(super) curvature: [f64; 2],
    pub(super) offset: [f64; 2],
}

/// Calls `tap(major, minor, weight)` for every sample that the pixel reads, offsets from it in px.
pub(super) fn for_each_tap(path: &ScalarPath, taps: Taps, mut tap: impl FnMut(i64, i64, f64)) {
    let [a, b] = path.velocity;
    let length = a.abs();
    let [qa, qb] = bounded(path.curvature, length);
    let [da, db] = path.offset;
    let ends = [-a / 2.0 + qa / 8.0, a / 2.0 + qa / 8.0];
    let (x0, x1) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
    let first = (da + x0).floor() as i64 - 2;
    let last = (da + x1).ceil() as i64 + 2;
    let mut line = Vec::new();
    for k in first..=last {
        let z = k as f64 - da;
        if length < 0.02 {
            line.push((k, kernel(taps, z), db));
            continue;
        }
        let e = z.clamp(x0, x1);
        let speed = (a * a + 2.0 * qa * e).max(1e-9).sqrt();
        let t = -2.0 * e / (a + a.signum() * speed);
        let weight = (integral(taps, z - x0) - integral(taps, z - x1)) / speed;
        line.push((k, weight, db - t * b + 0.5 * t * t * qb + (z - e) * b / a));
    }
    let sum: f64 = line.iter().map(|entry| entry.1).sum();
    for (k, weight, minor) in line {
        let floor = minor.floor();
        for j in -1..=2 {
            let share = kernel(taps, f64::from(j) - (minor - floor));
            tap(k, floor as i64 + i64::from(j), weight / sum * share);
        }
    }
}

/// What of the curvature is followed on a path of this length on the major axis.
fn bounded(curvature: [f64; 2], length: f64) -> [f64; 2] {
    if length <= 1.0 {
        return [0.0; 2];
    }
    let share = (0.8 * length / curvature[0].abs()).min(1.0);
    curvature.map(|q| share * q)
}

/// Interpolation kernel.
fn kernel(taps: Taps, z: f64) -> f64 {
    let y = z.abs();
    match taps {
        Taps::Linear => (1.0 - y).max(0.0),
        Taps::Cubic if y < 1.0 => (1.5 * y - 2.5) * y * y + 1.0,
        Taps::Cubic if y < 2.0 => ((-0.5 * y + 2.5) * y - 4.0) * y + 2.0,
        Taps::Cubic => 0.0,
    }
}

/// Integral of the kernel from 0.
fn integral(taps: Taps, z: f64) -> f64 {
    let y = z.abs();
    let near = y.min(1.0);
    let value = match taps {
        Taps::Linear => near - near * near / 2.0,
        Taps::Cubic => {
            let far = (y - 1.0).clamp(0.0, 1.0);
            near + near.powi(3) * (0.375 * near - 5.0 / 6.0)
                + far * far * (far / 3.0 - far * far / 8.0 - 0.25)
        }
    };
    value.copysign(z)
}
