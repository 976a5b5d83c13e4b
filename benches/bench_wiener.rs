//! Per-pixel Wiener deblurring of 1280 x 720 with a smooth field of up to 15 px, one thread, and
//! the forward blur beside it. Single precision.
#![allow(missing_docs, reason = "criterion's macros make a public function")]
#![allow(clippy::unwrap_used, reason = "a failure ends the bench, as it should")]

use criterion::{Criterion, criterion_group, criterion_main};
use ndarray::{Array2, Axis};
use unsmear::blur::blur;
use unsmear::deblur::WienerDeblur;
use unsmear::{Control, FlowView};
use unsmear_benches::{moving_texture, pool};

fn wiener(criterion: &mut Criterion) {
    let (control, one) = (Control::new(), pool(1));
    let shape = (720, 1280);
    let sharp = moving_texture(1, shape.0, shape.1).mapv(|sample| sample as f32);
    let sharp = sharp.index_axis(Axis(0), 0);
    // A slow zoom on top of a translation: between 6 and 15 px long, in all but one direction.
    let u = Array2::from_shape_fn(shape, |(_, x)| 10.0 + 4.0 * (x as f32 / 640.0 - 1.0));
    let v = Array2::from_shape_fn(shape, |(y, _)| 4.0 * (y as f32 / 360.0 - 1.0));
    let flow = FlowView::new(u.view(), v.view()).unwrap();
    let blurred = one.install(|| blur(&sharp, &flow, 1.0, &control)).unwrap();
    let mut group = criterion.benchmark_group("deblur 720x1280, f32");
    group.bench_function("blur", |bencher| {
        one.install(|| bencher.iter(|| blur(&sharp, &flow, 1.0, &control).unwrap()));
    });
    let method = WienerDeblur { noise: Some(1.0), ..Default::default() };
    group.bench_function("wiener", |bencher| {
        one.install(|| {
            bencher.iter(|| method.apply(&[blurred.view()], &flow, &control).unwrap());
        });
    });
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = wiener
}
criterion_main!(benches);
