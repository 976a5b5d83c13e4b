//! Against the equations themselves, and against a plain loop.

use proptest::prelude::*;

use super::*;

/// A system of random equations and a start.
#[derive(Debug, Clone)]
struct Example {
    height: usize,
    width: usize,
    planes: Vec<Vec<f32>>,
}

impl Example {
    /// A is the sum of two random dyads, one of which is missing in a quarter of the pixels, both in another.
    fn new(height: usize, width: usize, seed: u32) -> Self {
        let mut state = seed.wrapping_mul(747_796_405).wrapping_add(1);
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 23) as f32 - 1.0
        };
        let mut planes = vec![Vec::new(); 9];
        for _ in 0..height * width {
            let (x1, y1, x2, y2) = (random(), random(), random(), random());
            let (s1, s2) =
                if random() > 0.0 { (1.0, 1.0) } else { (0.0, f32::from(random() > 0.0)) };
            let a11 = s1 * x1 * x1 + s2 * x2 * x2;
            let a12 = s1 * x1 * y1 + s2 * x2 * y2;
            let a22 = s1 * y1 * y1 + s2 * y2 * y2;
            let [g1, g2] = [random(), random()].map(|g| 2.0 * g.max(0.0));
            let sample =
                [a11, a12, a22, random(), random(), g1, g2, 5.0 * random(), 5.0 * random()];
            planes.iter_mut().zip(sample).for_each(|(plane, s)| plane.push(s));
        }
        Self { height, width, planes }
    }

    fn system(&self) -> SorSystem<'_> {
        let [a11, a12, a22, c1, c2, gx, gy] = [0, 1, 2, 3, 4, 5, 6].map(|i| &*self.planes[i]);
        SorSystem { a11, a12, a22, c1, c2, gx, gy, height: self.height, width: self.width }
    }

    fn start(&self) -> [Vec<f32>; 2] {
        [self.planes[7].clone(), self.planes[8].clone()]
    }

    fn solved(&self, sweeps: usize, scratch: &mut SorScratch) -> [Vec<f32>; 2] {
        let [mut u, mut v] = self.start();
        solve(&self.system(), &mut u, &mut v, 1.9, sweeps, scratch, &Control::new()).unwrap();
        [u, v]
    }

    /// Diffusivities and indices of the neighbours of (y, x): west, east, north, south.
    fn neighbours(&self, y: usize, x: usize) -> [(f32, usize); 4] {
        let (i, w, s) = (y * self.width + x, self.width, self.system());
        [
            if x > 0 { (s.gx[i - 1], i - 1) } else { (0.0, i) },
            if x + 1 < w { (s.gx[i], i + 1) } else { (0.0, i) },
            if y > 0 { (s.gy[i - w], i - w) } else { (0.0, i) },
            if y + 1 < self.height { (s.gy[i], i + w) } else { (0.0, i) },
        ]
    }

    /// The slow twin: the update of the module's head, pixel by pixel in place.
    fn slow(&self, sweeps: usize) -> [Vec<f32>; 2] {
        let s = self.system();
        let [mut u, mut v] = self.start();
        for half in 0..2 * sweeps {
            for (y, x) in (0..self.height).flat_map(|y| (0..self.width).map(move |x| (y, x))) {
                if (x + y + half) % 2 == 1 {
                    continue;
                }
                let i = y * self.width + x;
                let near = self.neighbours(y, x);
                let sum = (near[0].0 + near[1].0) + (near[2].0 + near[3].0);
                let (a11, a12, a22) = (s.a11[i], s.a12[i], s.a22[i]);
                let own = a11 * a22 - a12 * a12;
                let own = if own > 1e-6 * (a11 * a22) { own } else { 0.0 };
                let determinant = own + sum * (a11 + a22 + sum);
                if determinant < f32::MIN_POSITIVE {
                    continue;
                }
                let scale = 1.0 / determinant;
                let (i11, i12, i22) = ((a22 + sum) * scale, -a12 * scale, (a11 + sum) * scale);
                let (mut r1, mut r2) = (s.c1[i], s.c2[i]);
                for (g, q) in near {
                    r1 += g * u[q];
                    r2 += g * v[q];
                }
                u[i] += 1.9 * ((i11 * r1 + i12 * r2) - u[i]);
                v[i] += 1.9 * ((i12 * r1 + i22 * r2) - v[i]);
            }
        }
        [u, v]
    }
}

fn bits(field: &[Vec<f32>; 2]) -> Vec<u32> {
    // Adding 0 makes -0 the 0 it equals: a missing neighbour's 0 * U may carry either sign.
    field.iter().flatten().map(|s| (s + 0.0).to_bits()).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn same_bits_as_the_plain_loop_with_a_used_scratch(
        sizes in prop::collection::vec((1usize..40, 1usize..70), 3),
        sweeps in 0usize..13,
        seed: u32,
    ) {
        let mut scratch = SorScratch::default();
        for (height, width) in sizes {
            let example = Example::new(height, width, seed);
            prop_assert_eq!(bits(&example.solved(sweeps, &mut scratch)), bits(&example.slow(sweeps)));
        }
    }
}

#[test]
fn same_bits_for_any_number_of_threads() {
    // Odd, and large enough for three bands.
    let example = Example::new(211, 403, 5);
    let slow = bits(&example.slow(7));
    for threads in [1, 2, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let fast = pool.install(|| example.solved(7, &mut SorScratch::default()));
        assert!(bits(&fast) == slow, "{threads} threads");
    }
}

#[test]
fn many_sweeps_satisfy_the_equations() {
    let mut example = Example::new(9, 12, 3);
    // Every pixel tied to all its neighbours, none of them singular.
    example.planes[5].iter_mut().chain([]).for_each(|g| *g += 0.5);
    example.planes[6].iter_mut().for_each(|g| *g += 0.5);
    let [u, v] = example.solved(2000, &mut SorScratch::default());
    let s = example.system();
    for (y, x) in (0..9).flat_map(|y| (0..12).map(move |x| (y, x))) {
        let i = y * 12 + x;
        let mut residual = [
            s.a11[i] * u[i] + s.a12[i] * v[i] - s.c1[i],
            s.a12[i] * u[i] + s.a22[i] * v[i] - s.c2[i],
        ];
        for (g, q) in example.neighbours(y, x) {
            residual[0] += g * (u[i] - u[q]);
            residual[1] += g * (v[i] - v[q]);
        }
        // Some 10 terms of up to 10, each rounded to 6e-8 of itself.
        assert!(residual[0].abs().max(residual[1].abs()) < 2e-5, "({y}, {x}): {residual:?}");
    }
}

#[test]
fn a_pixel_with_nothing_to_go_on_keeps_its_value() {
    for a in [[0.0, 0.0, 0.0], [0.04, 0.06, 0.09]] {
        let [a11, a12, a22] = a.map(|a| [a]);
        let one = [1.0f32];
        let system = SorSystem {
            a11: &a11,
            a12: &a12,
            a22: &a22,
            c1: &one,
            c2: &one,
            gx: &one,
            gy: &one,
            height: 1,
            width: 1,
        };
        let (mut u, mut v) = ([2.7f32], [-1.3f32]);
        solve(&system, &mut u, &mut v, 1.9, 5, &mut SorScratch::default(), &Control::new())
            .unwrap();
        assert_eq!((u, v), ([2.7], [-1.3]));
    }
}

#[test]
fn refuses_what_does_not_fit_and_stops_on_request() {
    let example = Example::new(4, 5, 1);
    let [mut u, mut v] = example.start();
    let control = Control::new();
    let scratch = &mut SorScratch::default();
    let error = solve(&example.system(), &mut u[1..], &mut v, 1.9, 1, scratch, &control);
    assert_eq!(error, Err(Error::shape("u", "(4 x 5,)", &[19])));
    let error = solve(&example.system(), &mut u, &mut v, 2.0, 1, scratch, &control);
    assert_eq!(error, Err(Error::value("omega", "in (0, 2)", 2)));
    control.cancel();
    let error = solve(&example.system(), &mut u, &mut v, 1.9, 1, scratch, &control);
    assert_eq!(error, Err(Error::Cancelled));
}
