//! Against sorting, and for what the filter is for.

use proptest::prelude::*;

use super::window::weight;
use super::*;

/// Random planes: u, v, guide channels, mask.
struct Example {
    height: usize,
    width: usize,
    planes: Vec<Vec<f32>>,
    mask: Vec<bool>,
}

impl Example {
    /// Values on a coarse grid, so that ties are common; `channels` of guide.
    fn new(height: usize, width: usize, channels: usize, seed: u32) -> Self {
        let mut state = seed.wrapping_mul(747_796_405).wrapping_add(1);
        let mut random = |steps: f32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            ((state >> 8) as f32 / (1 << 24) as f32 * steps).floor()
        };
        let n = height * width;
        let mut plane = |steps: f32| (0..n).map(|_| random(steps)).collect::<Vec<_>>();
        let mut planes = vec![plane(9.0), plane(1e6)];
        planes.extend((0..channels).map(|_| plane(30.0)));
        let mask = plane(4.0).iter().map(|s| *s > 0.0).collect();
        Self { height, width, planes, mask }
    }

    fn fast(&self, parameters: &WeightedMedian) -> [Vec<f32>; 2] {
        let guide: Vec<&[f32]> = self.planes[2..].iter().map(Vec::as_slice).collect();
        let mut out = [vec![f32::NAN; self.mask.len()], vec![f32::NAN; self.mask.len()]];
        let [out_u, out_v] = &mut out;
        let (u, v) = (&self.planes[0], &self.planes[1]);
        let (h, w) = (self.height, self.width);
        let control = Control::new();
        weighted_median(u, v, &guide, &self.mask, h, w, parameters, out_u, out_v, &control)
            .unwrap();
        out
    }

    /// The slow twin: sorts the window.
    fn slow(&self, parameters: &WeightedMedian, component: usize) -> Vec<f32> {
        let values = &self.planes[component];
        let (w, radius) = (self.width, parameters.radius);
        let scale = |sigma: f32| 0.5 / (sigma * sigma);
        let at = |p: usize| {
            if !self.mask[p] {
                return values[p];
            }
            let (y, x) = (p / w, p % w);
            let near = |q: &usize| (q / w).abs_diff(y).max((q % w).abs_diff(x)) <= radius;
            let mut window: Vec<(f32, f64)> = (0..values.len())
                .filter(near)
                .map(|q| {
                    let distance = (q / w).abs_diff(y).pow(2) + (q % w).abs_diff(x).pow(2);
                    let guide = self.planes[2..].iter().map(|g| (g[q] - g[p]) * (g[q] - g[p]));
                    let e = distance as f32 * scale(parameters.spatial_sigma)
                        + guide.sum::<f32>() * scale(parameters.guide_sigma);
                    (values[q], f64::from(weight(e)))
                })
                .collect();
            window.sort_by(|a, b| a.0.total_cmp(&b.0));
            let half = 0.5 * window.iter().map(|(_, w)| w).sum::<f64>();
            let mut sum = 0.0;
            let reaches = |(_, w): &&(f32, f64)| {
                sum += w;
                sum >= half
            };
            window.iter().find(reaches).unwrap().0
        };
        (0..values.len()).map(at).collect()
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn equals_the_sort(
        (height, width, channels) in (1usize..26, 1usize..40, 0usize..4),
        radius in prop_oneof![1usize..8, Just(15)],
        sigmas in (0.5f32..6.0, 3.0f32..30.0),
        seed: u32,
    ) {
        let example = Example::new(height, width, channels, seed);
        let parameters =
            WeightedMedian { radius, spatial_sigma: sigmas.0, guide_sigma: sigmas.1 };
        let [u, v] = example.fast(&parameters);
        prop_assert_eq!(u, example.slow(&parameters, 0));
        prop_assert_eq!(v, example.slow(&parameters, 1));
    }

    #[test]
    fn weights_are_exponential(e in 0f32..7.0) {
        let exact = (-f64::from(e)).exp() * 16384.0;
        let units = f64::from(weight(e));
        // Half a unit of rounding, and 1e-5 of the polynomial's eighth power.
        prop_assert!((units - exact).abs() <= 0.5 + 1e-5 * exact, "{units} for {exact}");
    }
}

#[test]
fn weights_end_at_exponent_seven() {
    assert_eq!([weight(7.0), weight(7.000_001), weight(f32::INFINITY)], [15, 0, 0]);
    assert_eq!(weight(0.0), 16384);
}

/// A flow boundary that lies 2 px beside that of the guide moves onto it, the purpose of the filter.
#[test]
fn a_boundary_moves_onto_that_of_the_guide() {
    let (height, width) = (24, 32);
    let step = |at: usize, high: f32| {
        (0..height * width)
            .map(move |i| if i % width < at { 0.0 } else { high })
            .collect::<Vec<_>>()
    };
    let planes = vec![step(18, 3.0), step(18, -1.0), step(16, 90.0)];
    let example = Example { height, width, planes, mask: vec![true; height * width] };
    let [u, v] = example.fast(&WeightedMedian::default());
    assert_eq!((u, v), (step(16, 3.0), step(16, -1.0)));
}

#[test]
fn same_bits_for_any_number_of_threads() {
    let example = Example::new(37, 53, 3, 9);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| example.fast(&WeightedMedian::default()))
    };
    assert_eq!([run(2), run(3)], [run(1), run(1)]);
}

#[test]
fn refuses_what_does_not_fit_and_stops_on_request() {
    let (plane, mask, control) = ([0.0; 6], [true; 6], Control::new());
    let run = |guide: &[&[f32]], parameters: &WeightedMedian| {
        let (mut a, mut b) = ([0.0; 6], [0.0; 6]);
        weighted_median(&plane, &plane, guide, &mask, 2, 3, parameters, &mut a, &mut b, &control)
    };
    let default = WeightedMedian::default();
    assert_eq!(run(&[&plane[..5]], &default), Err(Error::shape("guide", "(2 x 3,)", &[5])));
    let wide = WeightedMedian { radius: 16, ..default };
    assert_eq!(run(&[], &wide), Err(Error::value("radius", "in 1..=15", 16)));
    let flat = WeightedMedian { guide_sigma: 0.0, ..default };
    assert_eq!(run(&[], &flat), Err(Error::value("guide_sigma", "finite and positive", 0)));
    control.cancel();
    assert_eq!(run(&[], &default), Err(Error::Cancelled));
}
