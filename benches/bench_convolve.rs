//! Separable correlation along each axis, and convolution by transforms. One thread, single
//! precision where both exist.
#![allow(missing_docs, reason = "criterion's macros make a public function")]
#![allow(clippy::unwrap_used, reason = "a failure ends the bench, as it should")]

use criterion::{Criterion, criterion_group, criterion_main};
use ndarray::{Array2, Axis};
use unsmear::fft_convolve::fft_convolve;
use unsmear::{Border, Control, correlate_axis, correlate_separable, gaussian_taps};
use unsmear_benches::{moving_texture, pool};

fn convolve(criterion: &mut Criterion) {
    let (control, one) = (Control::new(), pool(1));
    let volume = moving_texture(5, 480, 640);
    let single = volume.mapv(|sample| sample as f32);
    let taps: Vec<f32> = gaussian_taps(4.0, 12).into_iter().map(|tap| tap as f32).collect();
    let mut group = criterion.benchmark_group("convolve 5x480x640, 25 taps, f32");
    for (axis, name) in ["t", "y", "x"].into_iter().enumerate() {
        group.bench_function(name, |bencher| {
            one.install(|| {
                bencher.iter(|| {
                    correlate_axis(single.view(), &taps, axis, Border::Replicate, &control).unwrap()
                });
            });
        });
    }
    group.bench_function("t, y, x", |bencher| {
        one.install(|| {
            bencher.iter(|| {
                let taps = [&taps[..]; 3];
                correlate_separable(single.view(), taps, Border::Replicate, &control).unwrap()
            });
        });
    });
    group.finish();

    let picture = volume.index_axis(Axis(0), 0);
    let kernel = Array2::from_elem((31, 31), 1.0 / 961.0);
    criterion.bench_function("fft_convolve 480x640, 31x31 taps, f64", |bencher| {
        one.install(|| {
            bencher.iter(|| {
                fft_convolve(picture, kernel.view(), Border::Replicate, &control).unwrap()
            });
        });
    });
}

criterion_group!(benches, convolve);
criterion_main!(benches);
