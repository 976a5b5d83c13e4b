//! The corrected bank: six orientations of a picture, and the 22 filters in space and time of 15
//! frames. One thread, single precision.
#![allow(missing_docs, reason = "criterion's macros make a public function")]
#![allow(clippy::unwrap_used, reason = "a failure ends the bench, as it should")]

use criterion::{Criterion, criterion_group, criterion_main};
use ndarray::Axis;
use unsmear::gabor::{GaborBank, GaborParameters};
use unsmear::spatiotemporal::SpatiotemporalBank;
use unsmear::{Border, Control};
use unsmear_benches::{moving_texture, pool};

fn gabor(criterion: &mut Criterion) {
    let (control, one) = (Control::new(), pool(1));
    let frames = moving_texture(15, 480, 640).mapv(|sample| sample as f32);
    let bank = GaborBank::<f32>::new(&GaborParameters::default()).unwrap();
    criterion.bench_function("gabor bank 480x640, 6 orientations, f32", |bencher| {
        one.install(|| {
            let picture = frames.index_axis(Axis(0), 0);
            bencher.iter(|| bank.respond(picture, Border::Replicate, &control).unwrap());
        });
    });

    let tuned = GaborParameters { tuning_frequency: 1.0 / 4.25, ..Default::default() };
    let bank = SpatiotemporalBank::<f32>::velocity_tuned(&tuned).unwrap();
    criterion.bench_function("velocity-tuned bank 15x480x640, 22 filters, f32", |bencher| {
        one.install(|| {
            bencher.iter(|| bank.respond(frames.view(), 7, Border::Replicate, &control).unwrap());
        });
    });
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20);
    targets = gabor
}
criterion_main!(benches);
