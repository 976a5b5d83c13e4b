//! Phase gradients and phase steps of the responses of six orientations. One thread.
#![allow(missing_docs, reason = "criterion's macros make a public function")]
#![allow(clippy::unwrap_used, reason = "a failure ends the bench, as it should")]

use criterion::{Criterion, criterion_group, criterion_main};
use ndarray::Axis;
use unsmear::gabor::{GaborBank, GaborParameters};
use unsmear::phase_gradient::PhaseGradient;
use unsmear::phase_rate::phase_step;
use unsmear::{Border, Control};
use unsmear_benches::{moving_texture, pool};

fn phase_gradient(criterion: &mut Criterion) {
    let (control, one) = (Control::new(), pool(1));
    let frames = moving_texture(2, 480, 640).mapv(|sample| sample as f32);
    let bank = GaborBank::<f32>::new(&GaborParameters::default()).unwrap();
    let [first, second] = [0, 1]
        .map(|t| bank.respond(frames.index_axis(Axis(0), t), Border::Replicate, &control).unwrap());
    criterion.bench_function("phase gradient 480x640, 6 orientations, f32", |bencher| {
        one.install(|| {
            bencher.iter(|| PhaseGradient::new(&first, bank.wavevectors(), &control).unwrap());
        });
    });
    criterion.bench_function("phase step 480x640, 6 orientations, f32", |bencher| {
        let mut steps = vec![0.0f32; 640];
        bencher.iter(|| {
            for (y, filter) in (0..480).flat_map(|y| (0..6).map(move |filter| (y, filter))) {
                phase_step(first.row(filter, y), second.row(filter, y), &mut steps);
            }
            steps[0]
        });
    });
}

criterion_group!(benches, phase_gradient);
criterion_main!(benches);
