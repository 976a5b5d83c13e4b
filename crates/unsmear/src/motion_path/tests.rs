use super::*;

fn field(shape: (usize, usize), motion: impl Fn(f32, f32) -> [f32; 2]) -> FlowField<f32> {
    let part =
        |axis: usize| Array2::from_shape_fn(shape, |(y, x)| motion(x as f32, y as f32)[axis]);
    FlowField::new(part(0), part(1)).unwrap()
}

/// Rotation about the middle by `angle` per frame, to first order.
fn rotation(angle: f32) -> FlowField<f32> {
    field((41, 61), |x, y| [-angle * (y - 20.0), angle * (x - 30.0)])
}

#[test]
fn rotation_bends_paths_towards_its_centre() {
    let (angle, exposure) = (0.2f32, 0.5);
    let steady = MotionPaths::new(&rotation(angle), exposure, None).unwrap();
    // (v.grad) v of a rotation is -angle^2 (x, y) from its centre: a linear field, of which a difference is exact.
    let bend = (angle * exposure as f32).powi(2);
    for ((y, x), &q) in steady.curvature.u.indexed_iter() {
        let wanted = [-bend * (x as f32 - 30.0), -bend * (y as f32 - 20.0)];
        assert!((q - wanted[0]).abs() < 1e-5, "{x} {y} {q}");
        assert!((steady.curvature.v[(y, x)] - wanted[1]).abs() < 1e-5);
    }
    // A rotation is steady, so its content accelerates by (v.grad) v, and both ways give the same paths.
    let content = field((41, 61), |x, y| [-0.04 * (x - 30.0), -0.04 * (y - 20.0)]);
    let same =
        MotionPaths::from_content_acceleration(&rotation(angle), exposure, &content).unwrap();
    let far = |a: &Array2<f32>, b: &Array2<f32>| {
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0f32, f32::max)
    };
    assert!(far(&same.curvature.u, &steady.curvature.u) < 1e-5);
    assert!(far(&same.curvature.v, &steady.curvature.v) < 1e-5);
}

#[test]
fn another_thing_s_motion_does_not_bend_a_path() {
    let layers = field((20, 60), |x, _| if x < 30.0 { [12.0, 1.0] } else { [3.0, 0.5] });
    let paths = MotionPaths::new(&layers, 1.0, None).unwrap();
    assert!(paths.curvature.u.iter().chain(&paths.curvature.v).all(|q| q.abs() < 4.0));
    let half = field((20, 60), |x, _| if x < 30.0 { [12.0, 1.0] } else { [f32::NAN; 2] });
    let paths = MotionPaths::new(&half, 1.0, None).unwrap();
    assert!(paths.curvature.u.iter().chain(&paths.curvature.v).all(|&q| q == 0.0));
}

#[test]
fn the_reach_and_the_half_follow_the_paths() {
    let motion = field((9, 11), |x, _| [if x < 4.0 { f32::NAN } else { -8.0 }, 3.0]);
    let offset = field((9, 11), |_, _| [-1.5, 0.0]);
    let paths = MotionPaths::new(&motion, 0.5, None).unwrap().with_offset(offset).unwrap();
    // 2 px to either side, 1.5 px offset, and the taps.
    assert_eq!(paths.reach(), 4 + TAPS_REACH);
    let half = paths.halved();
    assert_eq!(half.dim(), (5, 6));
    assert!(half.velocity.u[(0, 1)].is_nan());
    let scale = 6.0 / 11.0;
    assert!((half.velocity.u[(0, 2)] + 4.0 * scale).abs() < 1e-6);
    assert!((half.velocity.v[(4, 5)] - 1.5 * 5.0 / 9.0).abs() < 1e-6);
    assert!((half.offset.unwrap().u[(2, 2)] + 1.5 * scale).abs() < 1e-6);
}

#[test]
fn impossible_motion_is_refused() {
    let refuse = |motion: FlowField<f32>, exposure| {
        MotionPaths::new(&motion, exposure, None).unwrap_err().to_string()
    };
    assert!(refuse(rotation(0.1), 0.0).starts_with("exposure must"));
    assert!(refuse(field((3, 3), |_, _| [f32::INFINITY, 0.0]), 1.0).starts_with("velocity"));
    assert!(refuse(field((0, 3), |_, _| [0.0; 2]), 1.0).starts_with("velocity must have shape"));
    let still = field((4, 4), |_, _| [0.0; 2]);
    let paths = MotionPaths::new(&still, 1.0, None).unwrap();
    assert!(paths.clone().with_offset(field((4, 5), |_, _| [0.0; 2])).is_err());
    assert!(paths.with_offset(field((4, 4), |_, _| [f32::NAN; 2])).is_err());
    assert!(MotionPaths::new(&still, 1.0, Some(&rotation(0.1))).is_err());
}
