//! The founding flow: a friendly size and one whose padded transforms have a large prime factor,
//! with one thread and with two.
#![allow(missing_docs, reason = "criterion's macros make a public function")]
#![allow(clippy::unwrap_used, reason = "a failure ends the bench, as it should")]

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use unsmear::Control;
use unsmear::flow::thesis::ThesisFlow;
use unsmear_benches::{moving_texture, pool};

fn thesis_flow(criterion: &mut Criterion) {
    let (control, method) = (Control::new(), ThesisFlow::default());
    let mut group = criterion.benchmark_group("thesis flow");
    for (height, width) in [(256, 256), (252, 316)] {
        let frames = moving_texture(3, height, width);
        for threads in [1, 2] {
            let id = BenchmarkId::new(format!("3x{height}x{width}"), format!("{threads} threads"));
            group.bench_function(id, |bencher| {
                pool(threads).install(|| {
                    bencher.iter(|| method.estimate(frames.view(), &control).unwrap());
                });
            });
        }
    }
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20);
    targets = thesis_flow
}
criterion_main!(benches);
