use super::*;
use crate::flow_field::FlowField;
use crate::linear_operator::trials::{asymmetry, dot, noise};
use ndarray::Array2;

fn field(shape: (usize, usize), motion: impl Fn(f32, f32) -> [f32; 2]) -> FlowField<f32> {
    let part =
        |axis: usize| Array2::from_shape_fn(shape, |(y, x)| motion(x as f32, y as f32)[axis]);
    FlowField::new(part(0), part(1)).unwrap()
}

/// Motions of every kind on a picture of `shape`.
fn motions(shape: (usize, usize)) -> Vec<FlowField<f32>> {
    let centre = [0.4 * shape.1 as f32, 0.6 * shape.0 as f32];
    let (jitter, width) = (noise(2 * shape.0 * shape.1, 9), shape.1);
    vec![
        field(shape, |_, _| [0.0, 0.0]),
        field(shape, |_, _| [7.3, 3.1]),
        field(shape, |_, _| [-2.0, 11.6]),
        field(shape, |_, _| [0.3, -0.4]),
        field(shape, |_, _| [0.01, 0.0]),
        field(shape, |x, y| [0.4 * (y - centre[1]), -0.4 * (x - centre[0])]),
        field(shape, |x, y| [0.3 * (x - centre[0]), 0.3 * (y - centre[1])]),
        field(shape, |x, y| {
            let i = y as usize * width + x as usize;
            if i.is_multiple_of(7) {
                [f32::NAN, 1.0]
            } else {
                [9.0 * jitter[2 * i], 9.0 * jitter[2 * i + 1]]
            }
        }),
    ]
}

/// Paths of every kind: steady, accelerated, offset.
fn all_paths(shape: (usize, usize)) -> Vec<MotionPaths> {
    let mut all = Vec::new();
    for motion in motions(shape) {
        let acceleration = field(shape, |x, y| [2.0 + 0.1 * x, 0.3 * y - 4.0]);
        let offset = field(shape, |x, y| [3.3 - 0.05 * x, 0.07 * y - 6.1]);
        let paths = MotionPaths::new(&motion, 0.9, None).unwrap();
        all.push(paths.clone().with_offset(offset).unwrap());
        all.push(paths);
        all.push(MotionPaths::new(&motion, 0.9, Some(&acceleration)).unwrap());
    }
    all
}

#[test]
fn the_adjoint_is_the_transpose() {
    for shape in [(13, 19), (5, 37), (1, 3), (4, 150)] {
        for (i, paths) in all_paths(shape).iter().enumerate() {
            for (taps, pad) in [
                (Taps::Cubic, paths.reach()),
                (Taps::Spline, paths.reach() + 1),
                (Taps::Linear, 3),
                (Taps::Cubic, 0),
            ] {
                let error = asymmetry(&MotionOperator::new(paths, taps, pad).unwrap());
                assert!(error < 1e-6, "{i} {taps:?} {error}");
            }
        }
    }
}

#[test]
fn constants_stay_and_stillness_copies() {
    for (paths, taps) in [Taps::Cubic, Taps::Spline]
        .into_iter()
        .flat_map(|taps| all_paths((11, 21)).into_iter().map(move |paths| (paths, taps)))
    {
        let operator = MotionOperator::new(&paths, taps, paths.reach()).unwrap();
        let (rows, columns) = operator.unknown_shape();
        let mut b = vec![0.0; 11 * 21];
        operator.apply(&vec![1.0; rows * columns], &mut b);
        // Some 100 weights of 6e-8 relative error each.
        assert!(b.iter().all(|sample| (sample - 1.0).abs() < 2e-6));
    }
    for motion in [0.0, f32::NAN] {
        let still = field((11, 21), |_, _| [motion; 2]);
        let paths = MotionPaths::new(&still, 1.0, None).unwrap();
        let operator = MotionOperator::new(&paths, Taps::Spline, 5).unwrap();
        let x = noise(21 * 31, 4);
        let (mut b, mut back) = (vec![0.0; 11 * 21], vec![0.0; x.len()]);
        operator.apply(&x, &mut b);
        for (y, row) in b.chunks(21).enumerate() {
            assert_eq!(row, &x[(y + 5) * 31 + 5..][..21]);
        }
        operator.adjoint(&b, &mut back);
        assert!(back.iter().zip(&x).all(|(&back, &x)| back == x || back == 0.0));
        assert_eq!(dot(&back, &back), dot(&b, &b));
    }
}

#[test]
fn the_normal_map_is_both_maps_in_turn() {
    let shape = (33, 85);
    for paths in all_paths(shape) {
        for (taps, pad) in
            [(Taps::Cubic, 2), (Taps::Cubic, paths.reach()), (Taps::Spline, paths.reach())]
        {
            let operator = MotionOperator::new(&paths, taps, pad).unwrap();
            let (rows, columns) = operator.unknown_shape();
            let x = noise(rows * columns, 5);
            let weights: Vec<f32> = noise(33 * 85, 6).iter().map(|w| w.abs()).collect();
            let (mut b, mut out) = (vec![f32::NAN; weights.len()], vec![f32::NAN; x.len()]);
            operator.normal(&x, &weights, &mut b, &mut out);
            let (mut alone, mut back) = (b.clone(), out.clone());
            operator.apply(&x, &mut alone);
            let weighted: Vec<f32> = alone.iter().zip(&weights).map(|(b, w)| b * w).collect();
            operator.adjoint(&weighted, &mut back);
            assert_eq!((alone, back), (b, out));
        }
    }
}

/// Interpolation kernel and its integral from 0, as their formulas stand.
fn kernel(taps: Taps, z: f64) -> f64 {
    let y = z.abs();
    match taps {
        Taps::Linear => (1.0 - y).max(0.0),
        Taps::Cubic if y < 1.0 => (1.5 * y - 2.5) * y * y + 1.0,
        Taps::Cubic if y < 2.0 => ((-0.5 * y + 2.5) * y - 4.0) * y + 2.0,
        Taps::Cubic | Taps::Spline | Taps::ThriftySpline => 0.0,
    }
}

fn integral(taps: Taps, z: f64) -> f64 {
    let y = z.abs().min(taps.reach() as f64);
    // Simpson's rule on each half px is exact for cubics.
    let parts = (2.0 * y).ceil().max(1.0);
    let h = y / parts;
    let simpson = |i: f64| {
        let at = |s: f64| kernel(taps, (i + s) * h);
        h / 6.0 * (at(0.0) + 4.0 * at(0.5) + at(1.0))
    };
    // A piece that holds the knot at 1 px is not one cubic.
    if y > 1.0 {
        let far = y - 1.0;
        let at = |s: f64| kernel(taps, 1.0 + s * far);
        let near: f64 = integral(taps, 1.0);
        return (near + far / 6.0 * (at(0.0) + 4.0 * at(0.5) + at(1.0))).copysign(z);
    }
    (0..parts as usize).map(|i| simpson(i as f64)).sum::<f64>().copysign(z)
}

/// A x at one pixel by the formulas of the module's head, in double precision; x is asked for by row and column.
fn scalar(
    paths: &MotionPaths,
    taps: Taps,
    y: usize,
    x: usize,
    picture: &dyn Fn(i64, i64) -> f64,
) -> f64 {
    let at = |field: &FlowField<f32>| field.view().at(y, x).map(f64::from);
    let (velocity, mut curvature) = (at(&paths.velocity), at(&paths.curvature));
    let offset = paths.offset.as_ref().map_or([0.0; 2], at);
    let down = velocity[1].abs() > velocity[0].abs();
    let order = |[u, v]: [f64; 2]| if down { [v, u] } else { [u, v] };
    let read = |major: i64, minor: i64| {
        let [right, below] = if down { [minor, major] } else { [major, minor] };
        picture(y as i64 + below, x as i64 + right)
    };
    let ([mut a, mut b], [da, db]) = (order(velocity), order(offset));
    if a.is_nan() || b.is_nan() || (a.abs() < 0.02 && offset == [0.0; 2]) {
        return picture(y as i64, x as i64);
    }
    if a.abs() < 0.02 {
        [a, b] = [0.02, 0.0];
    }
    if a.abs() <= 1.0 || curvature.iter().all(|q| q.abs() <= 0.1) {
        curvature = [0.0; 2];
    }
    let [qa, qb] = order(curvature);
    let share = (1.8 * a.abs() / qa.abs()).min(1.0);
    let [qa, qb] = [share * qa, share * qb];
    let ends = [-a / 2.0 + qa / 8.0, a / 2.0 + qa / 8.0];
    let (z0, z1) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
    let (mut sum, mut total) = (0.0, 0.0);
    for k in (da + z0).floor() as i64 - 2..=(da + z1).ceil() as i64 + 2 {
        let z = k as f64 - da;
        let e = z.clamp(z0, z1);
        let speed = (a * a + 2.0 * qa * e).sqrt();
        let t = -2.0 * e / (a + a.signum() * speed);
        let weight = (integral(taps, z - z0) - integral(taps, z - z1)) / speed;
        let minor = db - t * b + 0.5 * t * t * qb + (z - e).clamp(-2.0, 2.0) * b / a;
        total += weight;
        for j in minor.floor() as i64 - 1..=minor.floor() as i64 + 2 {
            sum += weight * kernel(taps, j as f64 - minor) * read(k, j);
        }
    }
    sum / total
}

#[test]
fn the_sum_is_that_of_the_formulas() {
    // The widest has blocks that are swept together.
    for shape in [(13, 19), (6, 40), (1, 3), (5, 150)] {
        for (i, paths) in all_paths(shape).iter().enumerate() {
            for (taps, pad) in [(Taps::Cubic, paths.reach()), (Taps::Linear, 2)] {
                let operator = MotionOperator::new(paths, taps, pad).unwrap();
                let (rows, columns) = operator.unknown_shape();
                let x = noise(rows * columns, 7);
                let mut b = vec![f32::NAN; shape.0 * shape.1];
                operator.apply(&x, &mut b);
                let picture = |row: i64, column: i64| {
                    let row = (row + pad as i64).clamp(0, rows as i64 - 1) as usize;
                    let column = (column + pad as i64).clamp(0, columns as i64 - 1) as usize;
                    f64::from(x[row * columns + column])
                };
                for (n, &value) in b.iter().enumerate() {
                    let (row, column) = (n / shape.1, n % shape.1);
                    let wanted = scalar(paths, taps, row, column, &picture);
                    // Positions off by 1e-6 px and weights by 1e-6 on white noise in [-1, 1]; of gently bent paths
                    // weights are off by 1.2e-3 at most (6e-4 at both ends of the row's sum).
                    let error = (f64::from(value) - wanted).abs();
                    assert!(error < 2e-3, "{i} {taps:?} {n}: {value} {wanted}");
                    let bent = paths.curvature.view().at(row, column).iter().any(|q| q.abs() > 0.1);
                    assert!(bent || error < 3e-5, "{i} {taps:?} {n}: {value} {wanted}");
                }
            }
        }
    }
}

#[test]
fn bytes_do_not_depend_on_the_number_of_threads() {
    let shape = (301, 83);
    let bytes = |threads: usize, paths: &MotionPaths| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let operator = MotionOperator::new(paths, Taps::Spline, paths.reach()).unwrap();
            let (rows, columns) = operator.unknown_shape();
            let x = noise(rows * columns, 2);
            let (mut b, mut back) = (vec![f32::NAN; 301 * 83], vec![f32::NAN; x.len()]);
            operator.apply(&x, &mut b);
            operator.adjoint(&b, &mut back);
            let (mut out, ones) = (vec![f32::NAN; x.len()], vec![1.0; b.len()]);
            operator.normal(&x, &ones, &mut b, &mut out);
            back.extend(out);
            let bits = |values: Vec<f32>| values.into_iter().map(f32::to_bits).collect::<Vec<_>>();
            (bits(b), bits(back))
        })
    };
    for paths in all_paths(shape).into_iter().skip(12).step_by(4) {
        let one = bytes(1, &paths);
        assert!((2..=5).all(|threads| bytes(threads, &paths) == one));
    }
}

#[test]
fn a_wave_is_damped_by_the_transform_of_the_box() {
    let (u, v) = (9.0f32, -5.0f32);
    let [wx, wy] = [0.35f64, 0.2];
    let motion = field((40, 50), |_, _| [u, v]);
    let paths = MotionPaths::new(&motion, 0.8, None).unwrap();
    let pad = paths.reach();
    let operator = MotionOperator::new(&paths, Taps::Cubic, pad).unwrap();
    let (rows, columns) = operator.unknown_shape();
    let wave = |row: usize, column: usize| {
        (wx * (column as f64 - pad as f64) + wy * (row as f64 - pad as f64)).cos()
    };
    let x: Vec<f32> = (0..rows * columns).map(|i| wave(i / columns, i % columns) as f32).collect();
    let mut b = vec![0.0; 40 * 50];
    operator.apply(&x, &mut b);
    let half = 0.4 * (wx * f64::from(u) + wy * f64::from(v));
    for (i, &value) in b.iter().enumerate() {
        // Keys' kernel errs by some w^3 / 20 on either axis.
        let wanted = half.sin() / half * wave(i / 50 + pad, i % 50 + pad);
        assert!((f64::from(value) - wanted).abs() < 2e-3, "{i} {value} {wanted}");
    }
}
