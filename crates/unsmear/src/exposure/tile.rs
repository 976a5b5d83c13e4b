//! Tiles of a picture in which the length of blur can be read: spectrum, motion and its spread.
//!
//! A tile of T x T px under a Hann window of mean square 1 has the periodogram P(w) = |DFT|^2 / T^2, whose mean for
//! white noise of deviation sigma is sigma^2. Its motion is sampled at nine points, weighted as the window does, as
//! means over squares of T/5: blur that varies over the tile smears the zeros of its spectrum. Dropped are tiles with
//! unknown pixels, with more than a tenth unknown motion, whose motion varies by more than 0.35 of itself, and those
//! without contrast.

use std::f64::consts::PI;

use ndarray::{ArrayView2, s};

use super::frame::ExposureFrame;
use super::waves::{GREATEST, Waves};
use crate::fourier::{Complex64, Fft2};
use crate::real::Real;

/// Greatest spread of a tile's motion, as a share of its length.
const GREATEST_SPREAD: f64 = 0.35;

/// Greatest share of a tile's pixels whose motion may be unknown.
const GREATEST_UNKNOWN: f64 = 0.1;

/// Least mean power of a tile in units of the noise's: below it the spectrum shows the noise.
const LEAST_POWER: f64 = 5.0;

/// Points per axis: the three-point Gauss rule for a bell of the window's variance, (0.141 T)^2.
const NODES: [(f64, f64); 3] = [(-0.245, 1.0 / 6.0), (0.0, 2.0 / 3.0), (0.245, 1.0 / 6.0)];

/// Greatest difference between points in the phase w . D of the path's ends at the highest frequency, rad, that does not
/// matter: |K|^2 then differs by .003 where it bends most.
const GREATEST_PHASE: f64 = 0.2;

/// Number of points.
pub(super) const POINTS: usize = NODES.len() * NODES.len();

/// Motion at one point of a tile.
#[derive(Debug, Clone, Copy)]
pub(super) struct Point {
    pub(super) weight: f32,
    /// px/frame.
    pub(super) velocity: [f32; 2],
    /// px/frame^2.
    pub(super) curvature: [f32; 2],
}

/// What one tile contributes.
pub(super) struct Tile {
    /// Mean motion, px/frame.
    pub(super) velocity: [f64; 2],
    /// Its length, px/frame.
    pub(super) speed: f64,
    pub(super) points: Vec<Point>,
    /// How much the motion differs between places 1 px apart, px/frame.
    pub(super) strain: f64,
    /// Periodogram at the waves, in squares of the picture's units.
    pub(super) power: Vec<f64>,
    /// Its mean in units of the noise's power.
    pub(super) contrast: f64,
}

impl Tile {
    /// The tile with its corner at (top, left), unless it tells nothing.
    pub(super) fn new<T: Real>(
        frame: &ExposureFrame<'_, T>,
        [top, left]: [usize; 2],
        waves: &Waves,
        noise: f64,
        plan: &Fft2,
    ) -> Option<Self> {
        let side = waves.side;
        let part = s![top..top + side, left..left + side];
        let fields = [&frame.velocity.u, &frame.velocity.v].map(|field| field.slice(part));
        let [(u, spread_u), (v, spread_v)] = [moments(&fields[0])?, moments(&fields[1])?];
        let speed = u.hypot(v);
        if !(spread_u.hypot(spread_v) < GREATEST_SPREAD * speed) {
            return None;
        }
        let power = periodogram(&frame.image.slice(part), waves, plan)?;
        let contrast = power.iter().sum::<f64>() / power.len() as f64 / (noise * noise);
        if !(contrast > LEAST_POWER) {
            return None;
        }
        let curves = [&frame.curvature.u, &frame.curvature.v].map(|field| field.slice(part));
        let (radius, last) = ((side / 10) as f64, side - 1);
        let around = |node: f64| {
            let centre = (0.5 + node) * last as f64;
            (centre - radius).round() as usize..=(centre + radius).round() as usize
        };
        let mut points = Vec::with_capacity(POINTS);
        for (y, weight_y) in NODES {
            for (x, weight_x) in NODES {
                let square = s![around(y), around(x)];
                let mean = |field: &ArrayView2<'_, T>| {
                    moments(&field.slice(square)).map(|(mean, _)| mean as f32)
                };
                points.push(Point {
                    weight: (weight_y * weight_x) as f32,
                    velocity: [mean(&fields[0])?, mean(&fields[1])?],
                    curvature: [mean(&curves[0])?, mean(&curves[1])?],
                });
            }
        }
        let strain = strain(&points, side);
        if same(&points) {
            points = vec![Point { weight: 1.0, ..points[POINTS / 2] }];
        }
        Some(Self { velocity: [u, v], speed, points, strain, power, contrast })
    }

    /// The same picture under a motion turned from right to down by `angle`, rad.
    pub(super) fn turned(&self, angle: f64) -> Self {
        let (sin, cos) = angle.sin_cos();
        let turn = |[u, v]: [f64; 2]| [cos * u - sin * v, sin * u + cos * v];
        let single = |part: [f32; 2]| turn(part.map(f64::from)).map(|part| part as f32);
        let points = self.points.iter().map(|point| Point {
            weight: point.weight,
            velocity: single(point.velocity),
            curvature: single(point.curvature),
        });
        Self {
            velocity: turn(self.velocity),
            points: points.collect(),
            power: self.power.clone(),
            ..*self
        }
    }
}

/// The greater difference of the motion between opposite sides of the tile, per px of their distance.
fn strain(points: &[Point], side: usize) -> f64 {
    let (n, distance) = (NODES.len(), 2.0 * NODES[2].0 * side as f64);
    let difference = |a: usize, b: usize| {
        let [(au, av), (bu, bv)] = [a, b].map(|i| points[i].velocity.into());
        f64::from((au - bu).hypot(av - bv)) / distance
    };
    let middle = POINTS / 2;
    difference(middle - n, middle + n).max(difference(middle - 1, middle + 1))
}

/// Whether the motion differs so little between the points that they all let the same waves through.
fn same(points: &[Point]) -> bool {
    let middle = points[POINTS / 2];
    let far = |a: [f32; 2], b: [f32; 2]| f64::from((a[0] - b[0]).hypot(a[1] - b[1]));
    points.iter().all(|point| {
        let curve = far(point.curvature, middle.curvature) / 8.0;
        far(point.velocity, middle.velocity) + curve < GREATEST_PHASE / GREATEST
    })
}

/// Mean and deviation of the known samples; None when too many are unknown.
fn moments<T: Real>(samples: &ArrayView2<'_, T>) -> Option<(f64, f64)> {
    let known = || samples.iter().map(|s| s.as_f64()).filter(|s| s.is_finite());
    let count = known().count() as f64;
    if count < (1.0 - GREATEST_UNKNOWN) * samples.len() as f64 {
        return None;
    }
    let mean = known().sum::<f64>() / count;
    Some((mean, (known().map(|s| (s - mean).powi(2)).sum::<f64>() / count).sqrt()))
}

/// P(w) at the waves; None when a sample is unknown.
fn periodogram<T: Real>(tile: &ArrayView2<'_, T>, waves: &Waves, plan: &Fft2) -> Option<Vec<f64>> {
    let side = waves.side;
    let area = (side * side) as f64;
    let mean = tile.iter().map(|s| s.as_f64()).sum::<f64>() / area;
    if !mean.is_finite() {
        return None;
    }
    // Mean square of sin^2 over whole samples is 3/8, per axis.
    let hann: Vec<f64> = (0..side)
        .map(|i| (PI * (i as f64 + 0.5) / side as f64).sin().powi(2) / 0.375f64.sqrt())
        .collect();
    let mut spectrum: Vec<Complex64> = tile
        .indexed_iter()
        .map(|((y, x), s)| ((s.as_f64() - mean) * hann[y] * hann[x]).into())
        .collect();
    plan.forward(&mut spectrum, &mut Vec::new());
    Some(waves.bins.iter().map(|&bin| spectrum[bin].norm_sqr() / area).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flow_field::FlowField;
    use ndarray::Array2;

    fn field(u: f64, v: f64) -> FlowField<f64> {
        FlowField::new(Array2::from_elem((64, 64), u), Array2::from_elem((64, 64), v)).unwrap()
    }

    #[test]
    fn strain_is_how_the_motion_differs() {
        let image = Array2::from_shape_fn((64, 64), |(y, x)| ((y * 31 + x * 17) % 23) as f64);
        // A turn by 0.1 rad about a point to the left, and the same everywhere.
        let turning = FlowField::new(
            Array2::from_shape_fn((64, 64), |(y, _)| -0.1 * y as f64),
            Array2::from_shape_fn((64, 64), |(_, x)| 0.1 * (x as f64 + 100.0)),
        )
        .unwrap();
        let (waves, plan, still) = (Waves::new(64), Fft2::new(64, 64), field(0.0, 0.0));
        let tile = |velocity: &FlowField<f64>| {
            let (velocity, curvature) = (velocity.view(), still.view());
            let frame = ExposureFrame { image: image.view(), velocity, curvature };
            Tile::new(&frame, [0, 0], &waves, 0.3, &plan).unwrap()
        };
        let turned = tile(&turning);
        // The points are means over whole pixels.
        assert!((turned.strain - 0.1).abs() < 0.01, "{}", turned.strain);
        assert_eq!(turned.points.len(), POINTS);
        let even = tile(&field(3.0, 4.0));
        assert_eq!((even.strain, even.points.len()), (0.0, 1));
    }

    #[test]
    fn drops_what_tells_nothing() {
        let image = Array2::from_shape_fn((64, 64), |(y, x)| ((y * 31 + x * 17) % 23) as f64);
        let (waves, plan) = (Waves::new(64), Fft2::new(64, 64));
        let still = field(0.0, 0.0);
        let tile = |image: &Array2<f64>, velocity: &FlowField<f64>| {
            let frame = ExposureFrame {
                image: image.view(),
                velocity: velocity.view(),
                curvature: still.view(),
            };
            Tile::new(&frame, [0, 0], &waves, 0.3, &plan)
        };
        let found = tile(&image, &field(3.0, 4.0)).unwrap();
        assert!((found.speed - 5.0).abs() < 1e-12);
        assert!((found.points.iter().map(|p| p.weight).sum::<f32>() - 1.0).abs() < 1e-6);
        assert!(tile(&Array2::zeros((64, 64)), &field(3.0, 4.0)).is_none(), "no contrast");
        assert!(tile(&image, &field(f64::NAN, 4.0)).is_none(), "unknown motion");
        assert!(tile(&image, &still).is_none(), "no motion");
        let mut two = field(3.0, 4.0);
        two.u.slice_mut(s![.., ..32]).fill(-3.0);
        assert!(tile(&image, &two).is_none(), "two motions");
        let mut holed = image.clone();
        holed[(9, 9)] = f64::NAN;
        assert!(tile(&holed, &field(3.0, 4.0)).is_none(), "unknown pixel");
    }
}
