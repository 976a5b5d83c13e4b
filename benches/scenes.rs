//! What the benches run on: a moving texture without a file, and a pool of known size.

use ndarray::Array3;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// Frames (T, H, W) on a 0..255 scale of a texture that moves by (1.2, -0.7) px/frame. Waves of all
/// directions between 5 and 30 px, so that every filter of every bank has something to answer.
#[must_use]
pub fn moving_texture(frames: usize, height: usize, width: usize) -> Array3<f64> {
    const VELOCITY: [f64; 2] = [1.2, -0.7];
    const WAVES: u32 = 13;
    let waves: Vec<[f64; 3]> = (0..WAVES)
        .map(|i| {
            // The golden angle spreads any number of directions evenly.
            let (sin, cos) = (2.399_963 * f64::from(i)).sin_cos();
            let k = 0.2 + f64::from(i) / f64::from(WAVES);
            [k * cos, k * sin, f64::from(i * i)]
        })
        .collect();
    Array3::from_shape_fn((frames, height, width), |(t, y, x)| {
        let (x, y) = (x as f64 - VELOCITY[0] * t as f64, y as f64 - VELOCITY[1] * t as f64);
        let sum: f64 = waves.iter().map(|[kx, ky, phase]| (kx * x + ky * y + phase).cos()).sum();
        127.5 + 127.5 * sum / f64::from(WAVES)
    })
}

/// A pool of `threads` threads.
///
/// # Panics
/// When the system cannot start them.
#[must_use]
pub fn pool(threads: usize) -> ThreadPool {
    match ThreadPoolBuilder::new().num_threads(threads).build() {
        Ok(pool) => pool,
        Err(error) => panic!("cannot start {threads} threads: {error}"),
    }
}
