//! The search on pictures whose blur is known exactly.

use std::f64::consts::TAU;

use ndarray::Array2;

use super::*;
use crate::flow_field::FlowField;

const SHAPE: (usize, usize) = (160, 160);

/// Waves of all directions with the amplitudes of natural pictures, each passed by its blur: exact, without sampling.
fn blurred(length: f64, angle: f64, noise: f64) -> Array2<f64> {
    let mut random = Random::new(5);
    let mut unit = || random.below(1 << 40) as f64 / (1u64 << 40) as f64;
    let (vx, vy) = (length * angle.cos(), length * angle.sin());
    let mut picture = Array2::<f64>::zeros(SHAPE);
    for _ in 0..1200 {
        let radius = 0.05 * (unit() * 4.1).exp();
        let (direction, phase) = (TAU * unit(), TAU * unit());
        let (wx, wy) = (radius * direction.cos(), radius * direction.sin());
        let half = (wx * vx + wy * vy) / 2.0;
        // Equal power per octave: the spectrum 1 / radius^2 of the plane.
        let amplitude = 3.0 * if half == 0.0 { 1.0 } else { half.sin() / half };
        picture.indexed_iter_mut().for_each(|((y, x), sample)| {
            *sample += amplitude * (wx * x as f64 + wy * y as f64 + phase).cos();
        });
    }
    picture.mapv_inplace(|sample| sample + noise * 12f64.sqrt() * (unit() - 0.5));
    picture
}

fn constant(u: f64, v: f64) -> FlowField<f64> {
    FlowField::new(Array2::from_elem(SHAPE, u), Array2::from_elem(SHAPE, v)).unwrap()
}

fn found(image: &Array2<f64>, flow: &FlowField<f64>, range: (f64, f64)) -> ExposureEstimate {
    let still = constant(0.0, 0.0);
    let frame =
        ExposureFrame { image: image.view(), velocity: flow.view(), curvature: still.view() };
    ExposureSearch { range, noise: None, seed: 1, turn: false }
        .estimate(&[frame], &Control::new())
        .unwrap()
}

#[test]
fn finds_the_length_of_blur_whatever_the_flow_says() {
    let image = blurred(9.0, 0.6, 0.5);
    for scale in [0.5, 1.0, 1.5] {
        let flow = constant(scale * 9.0 * 0.6f64.cos(), scale * 9.0 * 0.6f64.sin());
        let estimate = found(&image, &flow, (0.4, 2.5));
        assert_eq!(estimate.status, ExposureStatus::Ok);
        // A few tiles of a texture of lines, not of a dense spectrum: 2 %; a wrong half of a pixel would be 6 %.
        assert!((estimate.value * scale - 1.0).abs() < 0.02, "{scale}: {}", estimate.value);
    }
}

#[test]
fn finds_a_turn_of_the_flow_together_with_its_length() {
    let image = blurred(9.0, 0.6, 0.5);
    let still = constant(0.0, 0.0);
    for (scale, degrees) in [(1.0, 10.0), (0.7, -12.0), (1.3, 8.0), (1.0, 0.0), (1.0, 2.0)] {
        let turned = 0.6 + f64::to_radians(degrees);
        let flow = constant(scale * 9.0 * turned.cos(), scale * 9.0 * turned.sin());
        let frame =
            ExposureFrame { image: image.view(), velocity: flow.view(), curvature: still.view() };
        let search = ExposureSearch { range: (0.4, 2.5), noise: None, seed: 1, turn: true };
        let estimate = search.estimate(&[frame], &Control::new()).unwrap();
        let expected = if degrees.abs() < 5.0 { 0.0 } else { -degrees };
        // A quarter of the fine grid's step; what is not clear is left as it came, exactly.
        let tolerance = if expected == 0.0 { 0.0 } else { 0.5 };
        let error = estimate.turn.to_degrees() - expected;
        assert!(error.abs() <= tolerance, "{scale} {degrees}: {estimate:?}");
        if expected != 0.0 {
            assert_eq!(estimate.status, ExposureStatus::Ok);
            assert!((estimate.value * scale - 1.0).abs() < 0.02, "{scale}: {estimate:?}");
        }
        // The length told within a sixth, the direction is the same.
        let told = ExposureSearch { range: (0.83 / scale, 1.2 / scale), ..search };
        let frame =
            ExposureFrame { image: image.view(), velocity: flow.view(), curvature: still.view() };
        let turn = told.turn(&[frame], &Control::new()).unwrap().to_degrees();
        assert!((turn - expected).abs() <= tolerance, "{scale} {degrees}: {turn}");
    }
}

#[test]
fn turns_need_blur_and_texture() {
    let still = constant(0.0, 0.0);
    let none = |image: &Array2<f64>, flow: &FlowField<f64>| {
        let frame =
            ExposureFrame { image: image.view(), velocity: flow.view(), curvature: still.view() };
        let search = ExposureSearch { range: (0.83, 1.2), noise: None, seed: 1, turn: true };
        search.turn(&[frame], &Control::new()).unwrap()
    };
    assert_eq!(none(&Array2::zeros(SHAPE), &constant(9.0, 0.0)), 0.0);
    assert_eq!(none(&blurred(9.0, 0.6, 0.5), &constant(0.5, 0.0)), 0.0);
    assert_eq!(none(&blurred(9.0, 0.6, 0.5), &constant(f64::NAN, 0.0)), 0.0);
    // Sharp: no direction explains it.
    assert_eq!(none(&blurred(0.0, 0.6, 0.5), &constant(9.0, 4.0)), 0.0);
}

/// A scene of lines in two directions, as of a town, does not pass for a blur.
#[test]
fn a_scene_with_directions_of_its_own_is_not_taken_for_blur() {
    let mut random = Random::new(9);
    let mut unit = || random.below(1 << 40) as f64 / (1u64 << 40) as f64;
    let (vx, vy) = (7.0 * 0.785f64.cos(), 7.0 * 0.785f64.sin());
    let mut picture = Array2::<f64>::zeros(SHAPE);
    for i in 0..1200 {
        let radius = 0.05 * (unit() * 4.1).exp();
        // Within 4 degrees of either axis, and a tenth anywhere.
        let spread = if i % 10 == 0 { TAU } else { 0.14 };
        let direction = TAU / 4.0 * f64::from(i % 2) + spread * (unit() - 0.5);
        let (wx, wy) = (radius * direction.cos(), radius * direction.sin());
        let (half, phase) = ((wx * vx + wy * vy) / 2.0, TAU * unit());
        let amplitude = 3.0 * if half == 0.0 { 1.0 } else { half.sin() / half };
        picture.indexed_iter_mut().for_each(|((y, x), sample)| {
            *sample += amplitude * (wx * x as f64 + wy * y as f64 + phase).cos();
        });
    }
    picture.mapv_inplace(|sample| sample + (unit() - 0.5));
    let estimate = found(&picture, &constant(vx, vy), (0.06, 2.5));
    assert!((estimate.likeliest - 1.0).abs() < 0.04, "{estimate:?}");
}

/// Flow of a square of `side` px in the middle of a scene at rest.
fn moving_square(side: usize, length: f64) -> FlowField<f64> {
    let (top, left) = ((SHAPE.0 - side) / 2 + 3, (SHAPE.1 - side) / 2 - 5);
    let inside =
        |(y, x): (usize, usize)| (top..top + side).contains(&y) && (left..left + side).contains(&x);
    let u = Array2::from_shape_fn(SHAPE, |at| if inside(at) { length } else { 0.0 });
    FlowField::new(u, Array2::zeros(SHAPE)).unwrap()
}

#[test]
fn a_small_mover_is_read_from_tiles_close_together_and_a_few_are_not_relied_on() {
    // The picture is blurred all over, so that any tile would tell; only those where the flow says so are asked.
    let image = blurred(7.0, 0.0, 0.5);
    // The smaller, the fewer waves a tile holds.
    for (side, error) in [(60, 0.04), (42, 0.08)] {
        let estimate = found(&image, &moving_square(side, 7.0), (0.06, 1.25));
        assert_eq!(estimate.status, ExposureStatus::Ok, "{side}");
        assert!((estimate.value - 1.0).abs() < error, "{side}: {}", estimate.value);
    }
    let estimate = found(&image, &moving_square(28, 7.0), (0.06, 1.25));
    assert!(estimate.tiles < LEAST_TILES);
    assert_ne!(estimate.status, ExposureStatus::Ok);
}

#[test]
fn contrast_and_brightness_do_not_matter() {
    let image = blurred(9.0, 0.6, 0.5);
    let flow = constant(9.0 * 0.6f64.cos(), 9.0 * 0.6f64.sin());
    let estimate = found(&image, &flow, (0.4, 2.5));
    let other = found(&image.mapv(|sample| 0.004 * sample + 3.0), &flow, (0.4, 2.5));
    // Rounding alone differs.
    assert!((estimate.value / other.value - 1.0).abs() < 1e-6);
}

#[test]
fn says_when_it_cannot_know() {
    let image = blurred(9.0, 0.6, 0.5);
    let slow = found(&image, &constant(0.5, 0.0), (0.4, 1.25));
    assert_eq!((slow.status, slow.value, slow.tiles), (ExposureStatus::Small, PRIOR, 0));
    let flat = found(&Array2::zeros(SHAPE), &constant(9.0, 0.0), (0.4, 1.25));
    assert_eq!((flat.status, flat.value), (ExposureStatus::Unsure, PRIOR));
    // The blur is 1.7 of what the flow says: beyond what a shutter can do.
    let outside = found(&image, &constant(5.2 * 0.6f64.cos(), 5.2 * 0.6f64.sin()), (0.35, 1.25));
    assert_eq!(outside.status, ExposureStatus::Unsure);
    assert!((0.35..=MOST_UNSURE).contains(&outside.value));
}

#[test]
fn short_blur_is_told_from_shorter() {
    let flow = constant(1.6 * 0.6f64.cos(), 1.6 * 0.6f64.sin());
    let [open, half] = [1.0, 0.5].map(|share| {
        let still = constant(0.0, 0.0);
        let image = blurred(1.6 * share, 0.6, 0.5);
        let frame =
            ExposureFrame { image: image.view(), velocity: flow.view(), curvature: still.view() };
        // The picture is all texture: its noise has to be told.
        let search = ExposureSearch { range: (0.06, 1.25), noise: Some(0.5), seed: 1, turn: false };
        search.estimate(&[frame], &Control::new()).unwrap()
    });
    assert_eq!([open.status, half.status], [ExposureStatus::Small; 2]);
    assert!(open.tiles > 0 && open.likeliest.is_nan());
    // Neither is found exactly; the order is, and doubt shortens.
    assert!(half.value + 0.1 < open.value && open.value <= PRIOR, "{half:?} {open:?}");
    assert!(half.value >= 0.4, "{half:?}");
}

#[test]
fn a_sharp_picture_is_not_found_to_be_blurred() {
    // Blurred by 1 px where things move by 20.
    let image = blurred(1.0, 0.6, 0.5);
    let flow = constant(20.0 * 0.6f64.cos(), 20.0 * 0.6f64.sin());
    let still = constant(0.0, 0.0);
    let frame =
        ExposureFrame { image: image.view(), velocity: flow.view(), curvature: still.view() };
    // The picture is all texture: its noise has to be told.
    let search = ExposureSearch { range: (0.06, 1.25), noise: Some(0.5), seed: 1, turn: false };
    let estimate = search.estimate(&[frame], &Control::new()).unwrap();
    // 2.4 px, where the first zero leaves the band, is all that can be told.
    assert!(estimate.value * 20.0 < 2.4, "{estimate:?}");
}

#[test]
fn names_what_is_wrong() {
    let frames: [ExposureFrame<'_, f64>; 0] = [];
    let search = ExposureSearch { range: (0.4, 1.25), noise: None, seed: 0, turn: false };
    assert!(search.estimate(&frames, &Control::new()).is_err());
    let (image, flow) = (Array2::zeros(SHAPE), constant(1.0, 1.0));
    let frame =
        ExposureFrame { image: image.view(), velocity: flow.view(), curvature: flow.view() };
    let search = ExposureSearch { range: (1.0, 0.5), ..search };
    let error = search.estimate(&[frame], &Control::new()).unwrap_err();
    assert!(error.to_string().contains("limits"), "{error}");
}
