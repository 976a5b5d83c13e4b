//! The flow methods end to end on 480 x 640, single precision, with one thread and with two.
#![allow(missing_docs, reason = "criterion's macros make a public function")]
#![allow(clippy::unwrap_used, reason = "a failure ends the bench, as it should")]

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use unsmear::Control;
use unsmear::flow::fleet_jepson::FleetJepson;
use unsmear::flow::least_squares::LeastSquares;
use unsmear_benches::{moving_texture, pool};

fn flow(criterion: &mut Criterion) {
    let control = Control::new();
    let (seven, fifteen) = (moving_texture(7, 480, 640), moving_texture(15, 480, 640));
    let (least_squares, fleet_jepson) = (LeastSquares::default(), FleetJepson::default());
    let mut group = criterion.benchmark_group("flow 480x640, f32");
    for threads in [1, 2] {
        let name = format!("{threads} threads");
        group.bench_function(BenchmarkId::new("least squares, 7 frames", &name), |bencher| {
            pool(threads).install(|| {
                bencher.iter(|| least_squares.estimate::<f32>(seven.view(), 3, &control).unwrap());
            });
        });
        group.bench_function(BenchmarkId::new("Fleet-Jepson, 15 frames", &name), |bencher| {
            pool(threads).install(|| {
                bencher.iter(|| fleet_jepson.estimate::<f32>(fifteen.view(), 7, &control).unwrap());
            });
        });
    }
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = flow
}
criterion_main!(benches);
