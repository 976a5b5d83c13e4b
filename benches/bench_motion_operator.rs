//! The motion operator on 1280 x 720, one thread: A, A^T and A^T W A, for straight, bent and turning paths. Single
//! precision; divide by 0.92 million for the time per pixel.
#![allow(missing_docs, reason = "criterion's macros make a public function")]
#![allow(clippy::unwrap_used, reason = "a failure ends the bench, as it should")]

use criterion::{Criterion, criterion_group, criterion_main};
use ndarray::{Array2, Axis};
use unsmear::motion_operator::{MotionOperator, Taps};
use unsmear::motion_path::MotionPaths;
use unsmear::{FlowField, LinearOperator};
use unsmear_benches::{moving_texture, pool};

const SHAPE: (usize, usize) = (720, 1280);

fn field(motion: impl Fn(f32, f32) -> [f32; 2]) -> FlowField<f32> {
    let part =
        |axis: usize| Array2::from_shape_fn(SHAPE, |(y, x)| motion(x as f32, y as f32)[axis]);
    FlowField::new(part(0), part(1)).unwrap()
}

fn operator(criterion: &mut Criterion) {
    let one = pool(1);
    let flows = [
        ("15 px at 30 degrees", field(|_, _| [13.0, 7.5])),
        ("15 px, smooth", field(|x, y| [13.0 + 2.0 * (x / 40.0).sin(), 7.0 + (y / 35.0).cos()])),
        ("rotation up to 22 px", field(|x, y| [0.03 * (y - 360.0), 0.03 * (640.0 - x)])),
    ];
    for (name, flow) in flows {
        let paths = MotionPaths::new(&flow, 1.0, None).unwrap();
        let mut group = criterion.benchmark_group(format!("operator 720x1280, {name}"));
        for (kind, taps) in [("cubic", Taps::Cubic), ("linear", Taps::Linear)] {
            let operator = MotionOperator::new(&paths, taps, paths.reach()).unwrap();
            let (rows, columns) = operator.unknown_shape();
            let sharp = moving_texture(1, rows, columns).mapv(|sample| sample as f32);
            let x: Vec<f32> = sharp.index_axis(Axis(0), 0).iter().copied().collect();
            let weights = vec![1.0; SHAPE.0 * SHAPE.1];
            let (mut b, mut back) = (weights.clone(), x.clone());
            group.bench_function(format!("A, {kind}"), |bencher| {
                one.install(|| bencher.iter(|| operator.apply(&x, &mut b)));
            });
            group.bench_function(format!("A^T, {kind}"), |bencher| {
                one.install(|| bencher.iter(|| operator.adjoint(&b, &mut back)));
            });
            group.bench_function(format!("A^T W A, {kind}"), |bencher| {
                one.install(|| {
                    bencher.iter(|| operator.normal(&x, &weights, &mut b, &mut back));
                });
            });
        }
        group.finish();
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = operator
}
criterion_main!(benches);
