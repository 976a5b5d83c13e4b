//! Interpolation against its mathematics: polynomials, samples, constants, symmetry, borders, threads, bad input.
#![allow(clippy::unwrap_used, reason = "a test that unwraps fails with the error's message")]

use ndarray::{Array2, array};
use unsmear::{Border, Control, Error, FlowField, Real, SplineDegree, SplineImage};

const DEGREES: [(usize, SplineDegree); 3] =
    [(1, SplineDegree::Linear), (3, SplineDegree::Cubic), (5, SplineDegree::Quintic)];

fn spline<T: Real>(image: &Array2<T>, degree: SplineDegree, border: Border) -> SplineImage<T> {
    SplineImage::new(&image.view(), degree, border, &Control::new()).unwrap()
}

/// Repeatable, structureless samples in [0, 1).
fn noise<T: Real>(shape: (usize, usize)) -> Array2<T> {
    let mut state = 1u64;
    Array2::from_shape_simple_fn(shape, || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        T::of((state >> 40) as f64 / f64::from(1 << 24))
    })
}

#[test]
fn reproduces_polynomials_of_its_degree_away_from_the_ends() {
    for (n, degree) in DEGREES {
        // Powers of a coordinate scaled to about [-1, 1]; y and x differ so that a swap shows.
        let polynomial = |y: f64, x: f64| {
            let (p, q) = ((y - 40.0) / 40.0, (x - 45.0) / 45.0);
            p.powi(n as i32) - 2.0 * q.powi(n as i32) + 0.5 * p * q + 0.25 * q - 1.0
        };
        let image = Array2::from_shape_fn((81, 91), |(y, x)| polynomial(y as f64, x as f64));
        let spline = spline(&image, degree, Border::Replicate);
        for i in 0..100 {
            // 34 px from every end the mirror's effect has decayed below .4306^34 = 4e-13.
            let (y, x) = (34.0 + 0.13 * f64::from(i), 57.0 - 0.23 * f64::from(i));
            let error = (spline.sample(y, x) - polynomial(y, x)).abs();
            assert!(error < 2e-12, "degree {n} at ({y}, {x}): {error:e}");
        }
    }
}

fn passes_through_samples<T: Real>(tolerance: f64) {
    for (n, degree) in DEGREES {
        for shape in [(1, 1), (1, 9), (2, 3), (33, 50)] {
            let image = noise::<T>(shape);
            let spline = spline(&image, degree, Border::Reflect);
            for ((y, x), &s) in image.indexed_iter() {
                let error = (spline.sample(y as f64, x as f64) - s).as_f64().abs();
                assert!(error < tolerance, "degree {n}, {shape:?}, ({y}, {x}): {error:e}");
            }
        }
    }
}

#[test]
fn passes_through_every_sample() {
    // Samples reach 1. White noise, as here, meets the filter's full gain, 7.5 per axis for degree 5: 56 roundings if
    // each coefficient were off by one of its own; a second one for the sum that samples it.
    passes_through_samples::<f32>(56.0 * f64::from(f32::EPSILON));
    passes_through_samples::<f64>(56.0 * f64::EPSILON);
}

#[test]
fn a_constant_stays_and_borders_hold() {
    for (_, degree) in DEGREES {
        let constant = spline(&Array2::from_elem((7, 5), 3.25), degree, Border::Replicate);
        assert!((constant.sample(2.3, 1.9) - 3.25f64).abs() < 1e-14);
        let image = noise::<f64>((12, 17));
        let replicated = spline(&image, degree, Border::Replicate);
        assert_eq!(replicated.sample(-3.7, 4.2), replicated.sample(0.0, 4.2));
        assert_eq!(replicated.sample(5.5, 99.0), replicated.sample(5.5, 16.0));
        let reflected = spline(&image, degree, Border::Reflect);
        assert!((reflected.sample(-3.75, 4.25) - reflected.sample(3.75, 4.25)).abs() < 1e-14);
        assert!((reflected.sample(5.5, 17.5) - reflected.sample(5.5, 14.5)).abs() < 1e-14);
        assert!(
            (reflected.sample(5.5, 16.0 + 320.25) - reflected.sample(5.5, 15.75)).abs() < 1e-12
        );
        assert!(replicated.sample(f64::NAN, 1.0).is_nan());
        assert!(reflected.sample(1.0, f64::INFINITY).is_nan());
    }
}

#[test]
fn warp_by_whole_pixels_shifts_and_unknown_stays_unknown() {
    let image = noise::<f64>((10, 14));
    let mut flow =
        FlowField::new(Array2::from_elem((10, 14), 3.0), Array2::from_elem((10, 14), -2.0))
            .unwrap();
    flow.v[(6, 6)] = f64::NAN;
    let warped = spline(&image, SplineDegree::Cubic, Border::Replicate)
        .warp(flow.view(), &Control::new())
        .unwrap();
    for y in 2..10 {
        for x in 0..11 {
            // u moves right, v moves down.
            let same = (warped[(y, x)] - image[(y - 2, x + 3)]).abs() < 1e-14;
            assert!(same || ((y, x) == (6, 6) && warped[(y, x)].is_nan()));
        }
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let image = noise::<f32>((123, 211));
    let y = Array2::from_shape_fn((123, 211), |(y, x)| y as f64 + (x as f64 * 0.37).sin() * 9.0);
    let x = Array2::from_shape_fn((123, 211), |(y, x)| x as f64 + (y as f64 * 0.11).cos() * 9.0);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            spline(&image, SplineDegree::Quintic, Border::Reflect)
                .sample_at(&y.view(), &x.view(), &Control::new())
                .unwrap()
        })
    };
    assert_eq!(run(1), run(8));
}

#[test]
fn linear_keeps_unknown_samples_local_and_higher_degrees_refuse_them() {
    let mut image = noise::<f32>((6, 6));
    image[(2, 2)] = f32::NAN;
    let linear = spline(&image, SplineDegree::Linear, Border::Replicate);
    assert!(linear.sample(2.5, 1.5).is_nan());
    assert!(linear.sample(3.5, 3.5).is_finite());
    let message = |degree, border| {
        SplineImage::new(&image.view(), degree, border, &Control::new()).unwrap_err().to_string()
    };
    assert_eq!(
        message(SplineDegree::Cubic, Border::Reflect),
        "image must be finite for spline degrees above 1, got NaN"
    );
    assert!(message(SplineDegree::Linear, Border::Zero).starts_with("border must be"));
    assert_eq!(
        SplineDegree::try_from(2).unwrap_err().to_string(),
        "degree must be 1, 3 or 5, got 2"
    );
}

#[test]
fn shapes_and_cancellation_are_errors() {
    let control = Control::new();
    let empty = Array2::<f64>::zeros((0, 3));
    assert!(
        SplineImage::new(&empty.view(), SplineDegree::Cubic, Border::Reflect, &control).is_err()
    );
    let plan = spline(&array![[1.0f64, 2.0], [3.0, 4.0]], SplineDegree::Cubic, Border::Reflect);
    let (y, x) = (Array2::zeros((2, 2)), Array2::zeros((2, 3)));
    let error = plan.sample_at(&y.view(), &x.view(), &control).unwrap_err();
    assert_eq!(error.to_string(), "x must have shape (2, 2), got [2, 3]");
    assert!(plan.warp(FlowField::unknown((3, 2)).view(), &control).is_err());
    control.cancel();
    assert_eq!(plan.warp(FlowField::unknown((2, 2)).view(), &control), Err(Error::Cancelled));
}
