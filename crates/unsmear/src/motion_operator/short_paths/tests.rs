use crate::flow_field::FlowField;
use crate::linear_operator::LinearOperator;
use crate::linear_operator::trials::noise;
use crate::motion_operator::{MotionOperator, Taps};
use crate::motion_path::MotionPaths;
use ndarray::Array2;

fn field(shape: (usize, usize), motion: impl Fn(f32, f32) -> [f32; 2]) -> FlowField<f32> {
    let part =
        |axis: usize| Array2::from_shape_fn(shape, |(y, x)| motion(x as f32, y as f32)[axis]);
    FlowField::new(part(0), part(1)).unwrap()
}

/// Largest error against the transform of the box on a wave of (wx, wy) rad/px blurred by (u, v).
fn error_on_a_wave(taps: Taps, [wx, wy]: [f64; 2], [u, v]: [f32; 2]) -> f64 {
    let paths = MotionPaths::new(&field((40, 50), |_, _| [u, v]), 1.0, None).unwrap();
    // Beyond what the mirror at the edge changes of the spline's coefficients.
    let pad = paths.reach() + 7;
    let operator = MotionOperator::new(&paths, taps, pad).unwrap();
    let (rows, columns) = operator.unknown_shape();
    let wave = |i: usize, width: usize, pad: f64| {
        (wx * ((i % width) as f64 - pad) + wy * ((i / width) as f64 - pad)).cos()
    };
    let x: Vec<f32> = (0..rows * columns).map(|i| wave(i, columns, pad as f64) as f32).collect();
    let mut b = vec![0.0; 40 * 50];
    operator.apply(&x, &mut b);
    let half = 0.5 * (wx * f64::from(u) + wy * f64::from(v));
    let share = if half == 0.0 { 1.0 } else { half.sin() / half };
    let error = |(i, &value): (usize, &f32)| (f64::from(value) - share * wave(i, 50, 0.0)).abs();
    b.iter().enumerate().map(error).fold(0.0, f64::max)
}

#[test]
fn short_paths_keep_waves_that_lines_fold() {
    // Up and down the diagonal, where lines fold; a cubic spline errs by (w / (2 pi - w))^4 of a wave.
    for (wave, motion) in [
        ([1.9, 1.9], [2.2, 2.1]),
        ([1.9, -1.6], [2.6, -1.5]),
        ([0.4, 2.0], [-1.8, 2.4]),
        ([2.0, 0.1], [0.6, 0.9]),
        ([1.8, 1.8], [4.9, 4.9]),
    ] {
        let errors = [Taps::Spline, Taps::Cubic].map(|taps| error_on_a_wave(taps, wave, motion));
        assert!(errors[0] < 0.04, "{wave:?} {motion:?} {errors:?}");
    }
    // The sum of the frequencies is beyond pi, and the blur leaves a fifth of the wave.
    let errors =
        [Taps::Spline, Taps::Cubic].map(|taps| error_on_a_wave(taps, [2.0, 2.0], [2.2, 2.1]));
    assert!(errors[0] < 0.06 && errors[1] > 0.2, "{errors:?}");
    // Slow waves: the taps that `spline_inverse.rs` cuts off, 2 x 1.7e-4 (1 - cos 7 w) and less on either axis.
    assert!(error_on_a_wave(Taps::Spline, [0.3, 0.2], [5.0, 3.0]) < 1e-3);
}

/// The spline by the library's other interpolation, and the mean over 200 moments instead of Gauss' rule.
#[test]
fn short_paths_agree_with_samples_of_the_spline_image() {
    let shape = (24, 40);
    let motion = field(shape, |x, y| [0.1 * (x - 18.0), 0.15 * (y - 9.0)]);
    let bend = field(shape, |x, _| [1.0 - 0.03 * x, 0.8]);
    let offset = field(shape, |x, y| [0.3 + 0.02 * y, 0.04 * x - 0.7]);
    let steady = MotionPaths::new(&motion, 1.0, Some(&bend)).unwrap();
    let paths = steady.with_offset(offset).unwrap();
    let pad = paths.reach() + 12;
    let operator = MotionOperator::new(&paths, Taps::Spline, pad).unwrap();
    let (rows, columns) = operator.unknown_shape();
    let x = noise(rows * columns, 3);
    let mut b = vec![0.0; shape.0 * shape.1];
    operator.apply(&x, &mut b);
    let picture = Array2::from_shape_vec((rows, columns), x).unwrap();
    let spline = crate::SplineImage::new(
        &picture.view(),
        crate::SplineDegree::Cubic,
        crate::Border::Reflect,
        &crate::Control::new(),
    )
    .unwrap();
    for (i, &value) in b.iter().enumerate() {
        let (y, x) = (i / shape.1, i % shape.1);
        let [v, q] = [&paths.velocity, &paths.curvature].map(|field| field.view().at(y, x));
        let d = paths.offset.as_ref().unwrap().view().at(y, x);
        let at = |t: f64, axis: usize| {
            f64::from(d[axis]) - t * f64::from(v[axis]) + 0.5 * t * t * f64::from(q[axis])
        };
        let sample = |k: usize| {
            let t = (k as f64 + 0.5) / 200.0 - 0.5;
            spline.sample((y + pad) as f64 + at(t, 1), (x + pad) as f64 + at(t, 0))
        };
        let wanted = (0..200).map(sample).map(f64::from).sum::<f64>() / 200.0;
        // White noise in [-1, 1], half of its power beyond what the rule is made for.
        assert!((f64::from(value) - wanted).abs() < 0.02, "{i} {value} {wanted}");
    }
}

#[test]
fn the_thrifty_leave_longer_paths_that_differ_to_lines() {
    let shape = (12, 20);
    let blur = |taps, varies: f32| {
        let motion = field(shape, |x, _| [6.0 + varies * x, 1.0]);
        let paths = MotionPaths::new(&motion, 1.0, None).unwrap();
        let operator = MotionOperator::new(&paths, taps, paths.reach() + 2).unwrap();
        let (rows, columns) = operator.unknown_shape();
        let mut b = vec![0.0; shape.0 * shape.1];
        operator.apply(&noise(rows * columns, 7), &mut b);
        b
    };
    let [spline, thrifty, lines] =
        [Taps::Spline, Taps::ThriftySpline, Taps::Cubic].map(|taps| blur(taps, 0.01));
    assert_eq!(thrifty, lines);
    assert_ne!(spline, lines);
    // Neighbours that move alike share a stencil.
    assert_eq!(blur(Taps::ThriftySpline, 0.0), blur(Taps::Spline, 0.0));
}

#[test]
fn what_is_kept_changes_no_byte() {
    // The paths of later columns are too long for what a row keeps; some are not short, some still.
    let shape = (20, 200);
    let motion = field(shape, |x, y| match (x as u32, y as u32) {
        (30..40, _) => [0.0, 0.0],
        (_, 3) => [9.0, 1.0],
        _ => [0.5 + 0.025 * x, 0.3 * y],
    });
    let paths = MotionPaths::new(&motion, 1.0, None).unwrap();
    for taps in [Taps::Spline, Taps::Cubic, Taps::Linear] {
        let made = MotionOperator::new(&paths, taps, paths.reach() + 2).unwrap();
        let kept = MotionOperator::for_many(&paths, taps, paths.reach() + 2).unwrap();
        let (rows, columns) = made.unknown_shape();
        let (x, r) = (noise(rows * columns, 1), noise(shape.0 * shape.1, 2));
        let all = |operator: &MotionOperator| {
            let (mut b, mut c) = (vec![0.0; r.len()], vec![0.0; r.len()]);
            let (mut back, mut out) = (vec![0.0; x.len()], vec![0.0; x.len()]);
            operator.apply(&x, &mut b);
            operator.adjoint(&r, &mut back);
            operator.normal(&x, &r, &mut c, &mut out);
            [b, back, c, out]
        };
        assert_eq!(all(&made), all(&kept));
    }
}
