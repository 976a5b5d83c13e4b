//! The stages of the default flow on 480 x 640, single precision, one thread, as one warp of the finest level runs
//! them, and what the machine itself can do.
//!
//! Constraint and accumulation are no public stages: their share is what `bench_flow` finds beyond these.
#![allow(missing_docs, reason = "criterion's macros make a public function")]
#![allow(clippy::unwrap_used, reason = "a failure ends the bench, as it should")]

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ndarray::{Array2, Axis};
use unsmear::gabor::{GaborBank, GaborParameters};
use unsmear::median::median_5x5;
use unsmear::pyramid::{level_sizes, pyramid, smooth};
use unsmear::sor::{SorScratch, SorSystem, solve};
use unsmear::weighted_median::{WeightedMedian, weighted_median};
use unsmear::{Border, Control, FlowField, SplineDegree, SplineImage};
use unsmear_benches::{moving_texture, pool};

const HEIGHT: usize = 480;
const WIDTH: usize = 640;
const PIXELS: usize = HEIGHT * WIDTH;
/// f32 samples of each of the three arrays of the triad: 192 MB, beyond any cache.
const TRIAD: usize = 1 << 24;
/// Rounds of arithmetic per measurement.
const ROUNDS: usize = 1 << 14;
/// Independent sums of the arithmetic peak: enough to hide the latency of an addition.
const SUMS: usize = 128;

fn picture() -> Array2<f32> {
    moving_texture(1, HEIGHT, WIDTH).index_axis(Axis(0), 0).mapv(|s| s as f32)
}

/// A smooth flow of a few px with a step along a column.
fn flow() -> FlowField<f32> {
    let step = |x: usize| if x > WIDTH / 2 { 3.0 } else { -1.0 };
    let u = Array2::from_shape_fn((HEIGHT, WIDTH), |(y, x)| step(x) + (0.01 * y as f32).sin());
    FlowField { v: u.mapv(|u| 0.4 - 0.3 * u), u }
}

fn filters(criterion: &mut Criterion) {
    let (picture, flow, control) = (picture(), flow(), Control::new());
    let parameters = GaborParameters {
        tuning_frequency: 0.25,
        bandwidth_octaves: 1.6,
        orientations: 4,
        support: 2.2,
    };
    let bank = GaborBank::<f32>::new(&parameters).unwrap();
    let mut group = criterion.benchmark_group("stages 480x640");
    group.throughput(Throughput::Elements(PIXELS as u64));
    let pool = pool(1);
    group.bench_function("bank of 4", |bencher| {
        let respond = || bank.respond(picture.view(), Border::Reflect, &control).unwrap();
        pool.install(|| bencher.iter(respond));
    });
    let spline = || {
        SplineImage::new(&picture.view(), SplineDegree::Cubic, Border::Reflect, &control).unwrap()
    };
    group.bench_function("spline prefilter", |bencher| pool.install(|| bencher.iter(spline)));
    let image = spline();
    group.bench_function("warp", |bencher| {
        pool.install(|| bencher.iter(|| image.warp(flow.view(), &control).unwrap()));
    });
    group.bench_function("pyramid", |bencher| {
        let sizes = level_sizes((HEIGHT, WIDTH), 0.5, 16.0);
        pool.install(|| bencher.iter(|| pyramid(picture.clone(), &sizes, 0.5, &control).unwrap()));
    });
    group.bench_function("Gaussian, 2 px", |bencher| {
        pool.install(|| bencher.iter(|| smooth(picture.view(), 2.0, &control).unwrap()));
    });
    group.finish();
}

fn solver(criterion: &mut Criterion) {
    let (flow, control, pool) = (flow(), Control::new(), pool(1));
    let plane = |value: f32| vec![value; PIXELS];
    let (a11, a12, a22, c1, c2) = (plane(0.6), plane(0.1), plane(0.4), plane(0.3), plane(-0.2));
    let (gx, gy) = (plane(0.5), plane(0.5));
    let system = SorSystem {
        a11: &a11,
        a12: &a12,
        a22: &a22,
        c1: &c1,
        c2: &c2,
        gx: &gx,
        gy: &gy,
        height: HEIGHT,
        width: WIDTH,
    };
    let mut group = criterion.benchmark_group("stages 480x640");
    group.throughput(Throughput::Elements(PIXELS as u64));
    for sweeps in [1, 10] {
        group.bench_function(format!("packing and {sweeps} sweeps"), |bencher| {
            let (mut u, mut v, mut scratch) = (plane(0.0), plane(0.0), SorScratch::default());
            pool.install(|| {
                bencher.iter(|| {
                    solve(&system, &mut u, &mut v, 1.9, sweeps, &mut scratch, &control).unwrap();
                });
            });
        });
    }
    let u: Vec<f32> = flow.u.iter().copied().collect();
    let v: Vec<f32> = flow.v.iter().copied().collect();
    let (mut out_u, mut out_v) = (plane(0.0), plane(0.0));
    group.bench_function("median 5x5", |bencher| {
        pool.install(|| {
            bencher.iter(|| median_5x5(&u, HEIGHT, WIDTH, &mut out_u, &control).unwrap());
        });
    });
    // As much of the picture as is near motion boundaries in photographs: a sixth.
    let mask: Vec<bool> = (0..PIXELS).map(|i| (i % WIDTH) * 6 < WIDTH).collect();
    let guide: Vec<f32> = picture().into_raw_vec_and_offset().0;
    let parameters = WeightedMedian { radius: 5, spatial_sigma: 4.0, guide_sigma: 10.0 };
    group.bench_function("weighted median of a sixth", |bencher| {
        pool.install(|| {
            bencher.iter(|| {
                weighted_median(
                    &u,
                    &v,
                    &[&guide],
                    &mask,
                    HEIGHT,
                    WIDTH,
                    &parameters,
                    &mut out_u,
                    &mut out_v,
                    &control,
                )
                .unwrap();
            });
        });
    });
    group.finish();
}

fn machine(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("machine");
    let (mut a, b, c) = (vec![0f32; TRIAD], vec![1f32; TRIAD], vec![2f32; TRIAD]);
    group.throughput(Throughput::Bytes(3 * 4 * TRIAD as u64));
    group.bench_function("triad a = b + s c, main memory", |bencher| {
        bencher.iter(|| {
            let s = black_box(3.0);
            for ((a, &b), &c) in a.iter_mut().zip(&b).zip(&c) {
                *a = b + s * c;
            }
            black_box(&mut a);
        });
    });
    group.throughput(Throughput::Elements((2 * SUMS * ROUNDS) as u64));
    group.bench_function("multiply and add, base instructions", |bencher| {
        bencher.iter(|| {
            let (mut sums, factor) = ([1f32; SUMS], black_box(0.999f32));
            for _ in 0..ROUNDS {
                sums.iter_mut().for_each(|s| *s = *s * factor + 1.0);
            }
            black_box(sums)
        });
    });
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = machine, filters, solver
}
criterion_main!(benches);
