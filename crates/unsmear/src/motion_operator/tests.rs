use super::*;
use crate::flow_field::FlowField;
use ndarray::Array2;

/// Numbers in [-1, 1).
fn noise(count: usize, seed: u64) -> Vec<f32> {
    let mut state = seed;
    let step = |_| {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    };
    (0..count).map(step).collect()
}

fn dot(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum()
}

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
    for shape in [(13, 19), (5, 37), (1, 3)] {
        for (i, paths) in all_paths(shape).iter().enumerate() {
            for (taps, pad) in [(Taps::Cubic, paths.reach()), (Taps::Linear, 3), (Taps::Cubic, 0)] {
                let operator = MotionOperator::new(paths, taps, pad).unwrap();
                let (rows, columns) = operator.unknown_shape();
                let (x, r) = (noise(rows * columns, 2), noise(shape.0 * shape.1, 3));
                let (mut b, mut back) = (vec![f32::NAN; r.len()], vec![f32::NAN; x.len()]);
                operator.apply(&x, &mut b);
                operator.adjoint(&r, &mut back);
                let (left, right) = (dot(&b, &r), dot(&x, &back));
                // Of the scale of what is summed, as the sums may cancel.
                let scale = (dot(&b, &b) * dot(&r, &r)).sqrt();
                assert!((left - right).abs() < 1e-6 * scale, "{i} {taps:?} {left} {right}");
            }
        }
    }
}

#[test]
fn constants_stay_and_stillness_copies() {
    for paths in all_paths((11, 21)) {
        let operator = MotionOperator::new(&paths, Taps::Cubic, paths.reach()).unwrap();
        let (rows, columns) = operator.unknown_shape();
        let mut b = vec![0.0; 11 * 21];
        operator.apply(&vec![1.0; rows * columns], &mut b);
        // Some 100 weights of 6e-8 relative error each.
        assert!(b.iter().all(|sample| (sample - 1.0).abs() < 2e-6));
    }
    for motion in [0.0, f32::NAN] {
        let still = field((11, 21), |_, _| [motion; 2]);
        let paths = MotionPaths::new(&still, 1.0, None).unwrap();
        let operator = MotionOperator::new(&paths, Taps::Cubic, 5).unwrap();
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
    let shape = (33, 45);
    for paths in all_paths(shape) {
        for pad in [2, paths.reach()] {
            let operator = MotionOperator::new(&paths, Taps::Cubic, pad).unwrap();
            let (rows, columns) = operator.unknown_shape();
            let x = noise(rows * columns, 5);
            let weights: Vec<f32> = noise(33 * 45, 6).iter().map(|w| w.abs()).collect();
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
