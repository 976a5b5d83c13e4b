//! Power of what a motion of constant acceleration lets through, as a table of two numbers.
//!
//! During an exposure the light of a pixel comes from D(t) = -t V + t^2/2 q, t in [-1/2, 1/2] (V, q in px). Of a wave of
//! frequency w (rad/px) this passes the factor K = integral exp(i w . D) dt, and |K|^2 depends on two phases only:
//!
//! ```text
//! |K|^2(a, b) = |integral_{-1/2}^{1/2} exp(i (a t + b t^2 / 2)) dt|^2,      a = w . V,  b = w . q     (rad)
//! ```
//!
//! even in a and in b; sinc^2(a/2) for b = 0, a Fresnel integral otherwise (M. Born, E. Wolf, Principles of Optics,
//! section 8.7, doi:10.1017/CBO9781139644181). For each b the integral over a grid of a is one Fourier transform of
//! M samples by the midpoint rule, whose droop sin(a/2M)/(a/2M) is put right. Read off linearly in both arguments:
//! within 1e-3 of the height of the lobe at hand. Beyond the last a, the mean of the lobes, 2 / a^2; beyond the last b
//! that b.

use std::f64::consts::TAU;

use multiversion::multiversion;

use crate::fourier::{Complex64, LinePlan};

/// Samples of the path.
const SAMPLES: usize = 256;

/// Length of the transform: the table's step in a is 2 pi M / N = 0.098 rad.
const LENGTH: usize = 1 << 14;

/// Step of the table in a, rad.
const STEP_A: f64 = TAU * SAMPLES as f64 / LENGTH as f64;

/// Step of the table in b, rad: the spectrum's curvature in b is at most 1/180.
const STEP_B: f64 = 1.0;

/// Greatest a in the table, rad: blur of 70 px at the highest frequency used.
const MOST_A: f64 = 190.0;

/// Greatest b in the table, rad: a speed that changes by 24 px during the exposure at the highest frequency used.
const MOST_B: f64 = 64.0;

/// Waves worked on together.
const LANES: usize = 16;

/// |K|^2 over (b, a); see the [module](self).
pub(super) struct PathSpectrum {
    columns: usize,
    rows: usize,
    /// Of each cell of the table, `[z, d_a, d_b, d_ab]` of `z + f_a d_a + f_b (d_b + f_a d_ab)`, `f` in 0..1 across it.
    cells: Vec<[f32; 4]>,
}

impl PathSpectrum {
    /// The table for |b| up to `most_b` (rad), or as far as it goes.
    pub(super) fn new(most_b: f64) -> Self {
        let columns = (MOST_A / STEP_A) as usize + 1;
        let rows = (most_b.clamp(0.0, MOST_B) / STEP_B).ceil() as usize + 1;
        let plan = LinePlan::new(LENGTH);
        let (mut line, mut scratch) = (Vec::new(), Vec::new());
        let mut corners = |row: usize| -> Vec<f32> {
            let b = row as f64 * STEP_B;
            line.clear();
            line.extend((0..SAMPLES).map(|m| {
                let t = (m as f64 + 0.5) / SAMPLES as f64 - 0.5;
                Complex64::from_polar(1.0 / SAMPLES as f64, b * t * t / 2.0)
            }));
            line.resize(LENGTH, Complex64::default());
            plan.forward(&mut line, &mut scratch);
            let corner = |(k, value): (usize, &Complex64)| {
                let half = k as f64 * STEP_A / (2.0 * SAMPLES as f64);
                let droop = if k == 0 { 1.0 } else { half.sin() / half };
                (value.norm_sqr() * droop * droop) as f32
            };
            line[..=columns].iter().enumerate().map(corner).collect()
        };
        let mut cells = Vec::with_capacity(rows * columns);
        let mut low = corners(0);
        for row in 0..rows {
            let high = corners(row + 1);
            cells.extend(low.windows(2).zip(high.windows(2)).map(|(low, high)| {
                let [along_low, along_high] = [low[1] - low[0], high[1] - high[0]];
                [low[0], along_low, high[0] - low[0], along_high - along_low]
            }));
            low = high;
        }
        Self { columns, rows, cells }
    }

    /// Adds `weight own |K|^2(a, b)` for the waves (x, y, own weight) shifted by `shift`, blurred along `velocity` and
    /// `curvature`.
    pub(super) fn add(
        &self,
        weight: f32,
        waves: [&[f32]; 3],
        shift: [f32; 2],
        velocity: [f32; 2],
        curvature: [f32; 2],
        out: &mut [f32],
    ) {
        let motion = Motion { shift, velocity, curvature, weight };
        let (whole, rest) = out.as_chunks_mut::<LANES>();
        let [(x, rest_x), (y, rest_y), (own, rest_own)] = waves.map(<[f32]>::as_chunks::<LANES>);
        add_blocks(&self.cells, [self.columns, self.rows], &motion, [x, y, own], whole);
        let [x, y, own] = [rest_x, rest_y, rest_own].map(filled_up);
        let mut sums = [filled_up(rest)];
        add_blocks(
            &self.cells,
            [self.columns, self.rows],
            &motion,
            [&[x], &[y], &[own]],
            &mut sums,
        );
        rest.copy_from_slice(&sums[0][..rest.len()]);
    }
}

/// What a wave passes through, and how much of it counts.
struct Motion {
    shift: [f32; 2],
    velocity: [f32; 2],
    curvature: [f32; 2],
    weight: f32,
}

/// Samples and zeros after them.
fn filled_up(samples: &[f32]) -> [f32; LANES] {
    let mut lanes = [0.0; LANES];
    lanes[..samples.len()].copy_from_slice(samples);
    lanes
}

/// Blocks of waves: where each is read, what stands there, what lies between.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn add_blocks(
    table: &[[f32; 4]],
    [columns, rows]: [usize; 2],
    motion: &Motion,
    [x, y, own]: [&[[f32; LANES]]; 3],
    out: &mut [[f32; LANES]],
) {
    let &Motion { shift, velocity, curvature, weight } = motion;
    let (per_a, per_b) = ((1.0 / STEP_A) as f32, (1.0 / STEP_B) as f32);
    let (last_a, last_b) = ((columns - 1) as f32, (rows - 1) as f32);
    let mut place = [0u32; LANES];
    let [mut along_a, mut along_b, mut share, mut beyond] = [[0.0f32; LANES]; 4];
    let mut cells = [[0.0f32; LANES]; 4];
    for (((sums, x), y), own) in out.iter_mut().zip(x).zip(y).zip(own) {
        for lane in 0..LANES {
            let (x, y) = (x[lane] + shift[0], y[lane] + shift[1]);
            let a = (x * velocity[0] + y * velocity[1]).abs() * per_a;
            let b = (x * curvature[0] + y * curvature[1]).abs() * per_b;
            let b = if b > last_b + 1.0 { last_b + 1.0 } else { b };
            let within = a <= last_a;
            let near = if within { a } else { 0.0 };
            let row = if b > last_b { last_b } else { b } as i32;
            let column = near as i32;
            place[lane] = (row * columns as i32 + column) as u32;
            along_a[lane] = near - column as f32;
            along_b[lane] = b - row as f32;
            let weight = weight * own[lane];
            let far = a * STEP_A as f32;
            share[lane] = if within { weight } else { 0.0 };
            beyond[lane] = if within { 0.0 } else { weight * 2.0 / (far * far) };
        }
        for lane in 0..LANES {
            let cell = table[place[lane] as usize];
            for part in 0..4 {
                cells[part][lane] = cell[part];
            }
        }
        for lane in 0..LANES {
            let low = cells[0][lane] + along_a[lane] * cells[1][lane];
            let rise = cells[2][lane] + along_a[lane] * cells[3][lane];
            sums[lane] += share[lane] * (low + along_b[lane] * rise) + beyond[lane];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(table: &PathSpectrum, a: f64, b: f64) -> f64 {
        let mut out = [0.0];
        // w = (1, 0) reads V and q off directly.
        table.add(
            1.0,
            [&[1.0], &[0.0], &[1.0]],
            [0.0; 2],
            [a as f32, 0.0],
            [b as f32, 0.0],
            &mut out,
        );
        f64::from(out[0])
    }

    #[test]
    fn is_the_integral() {
        let table = PathSpectrum::new(30.0);
        for (a, b) in [(0.0, 0.0), (2.0, 0.0), (-9.5, 0.0), (33.3, 4.7), (7.0, -21.4), (150.0, 2.2)]
        {
            let n = 20_000;
            let sum: Complex64 = (0..n)
                .map(|i| (f64::from(i) + 0.5) / f64::from(n) - 0.5)
                .map(|t| Complex64::from_polar(1.0 / f64::from(n), a * t + b * t * t / 2.0))
                .sum();
            // Linear interpolation: a second derivative of at most 1/6 in a, 1/180 in b, times step^2 / 8.
            let bound = STEP_A * STEP_A / 48.0 + STEP_B * STEP_B / 1440.0 + 1e-6;
            let got = at(&table, a, b);
            assert!((got - sum.norm_sqr()).abs() < bound, "{a} {b}: {got} {}", sum.norm_sqr());
        }
    }

    /// A wave reads the same in a block, after the last block and alone.
    #[test]
    fn many_waves_at_once_are_as_one_by_one() {
        let table = PathSpectrum::new(6.0);
        let n = 2 * LANES + 5;
        let line = |step: f32| (0..n).map(|i| (step * i as f32).sin() * 2.7).collect::<Vec<f32>>();
        let (x, y, own) = (line(0.7), line(1.3), line(0.2));
        // Beyond the last a for some of the waves.
        let motion = ([0.1, -0.05], [90.0, 40.0], [1.5, -0.5]);
        let mut together = vec![0.5f32; n];
        table.add(0.3, [&x, &y, &own], motion.0, motion.1, motion.2, &mut together);
        for i in 0..n {
            let one = [&x[i..=i], &y[i..=i], &own[i..=i]];
            let mut alone = [0.5];
            table.add(0.3, one, motion.0, motion.1, motion.2, &mut alone);
            // The same operations on the same numbers.
            assert_eq!(alone[0], together[i], "wave {i}");
        }
    }

    #[test]
    fn continues_beyond_its_end() {
        let table = PathSpectrum::new(0.0);
        let far = at(&table, 400.0, 0.0);
        assert!((far - 2.0 / 160_000.0).abs() < 1e-9, "{far}");
        // A greater b than there are rows is read at the last row, not beyond the table.
        assert!(at(&table, 3.0, 1e6).is_finite());
    }
}
