//! The light that two frames were taken in, and the line from the one to the other.
//!
//! Phase does not change with brightness and contrast, but what is made of it does: a gain that varies
//! over the picture draws a pattern of its own on coarse levels, amplitudes that differ are taken for
//! occlusion, and a tone curve mixes the colours to another grey. With the mean `m` and the deviation
//! `s` around a pixel of a plane `J`, in the reference (0) and in another frame (1),
//!
//! ```text
//! J_0 = g J_1 + o,   g = (s_0/s_1)^w in [1/4, 4],   o = m_1 + w (m_0 - m_1) - g m_1
//! m = G_15 * J,   s^2 = G_15 * J^2 - m^2 + 3^2     grey levels of the standardised sequence
//! w = (d - 0.2)/0.2 in [0, 1],   d = median max(|m_0 - m_1|/s, 4 |log(s_0/s_1)|),   s = (s_0 + s_1)/2
//! ```
//!
//! Light changes everywhere, motion changes means and deviations only where something comes or goes:
//! the median over the picture tells one from the other, and `w = 0` says that the light has not
//! changed. `G_15 *` is a Gaussian average of deviation 15 px of the frames, taken over cells of 8 px and
//! interpolated between their centres. The line of a whole plane, one gain and one offset, takes its
//! mean and deviation over all of it.
//!
//! Valid for light that changes smoothly over some 30 px; the edge of a moving shadow is a motion.
//! Reference: E. H. Land, J. J. McCann 1971 (doi 10.1364/JOSA.61.000001): light varies slowly, things do not.

use ndarray::{Array2, Zip};

use crate::array::for_each_row;
use crate::control::Control;
use crate::error::Result;
use crate::pyramid::smooth;

/// Side of the cells, px, and the deviation of the averages in cells.
const CELL: usize = 8;
const SIGMA: f64 = 15.0 / CELL as f64;
/// Squared deviation of a place without pattern, grey levels^2.
const PLAIN: f32 = 9.0;
/// Difference up to which the light is the same, and the span over which it becomes another.
const SAME: f32 = 0.2;
const SPAN: f32 = 0.2;
/// Weight of contrast against brightness in the difference.
const CONTRAST: f32 = 4.0;
/// Largest gain.
const MOST: f32 = 4.0;

/// Mean and deviation around the cells of a plane, grey levels.
pub(super) struct Light {
    mean: Array2<f32>,
    deviation: Array2<f32>,
}

impl Light {
    /// Of a plane without unknown samples.
    ///
    /// # Errors
    /// [`Error::Cancelled`](crate::Error::Cancelled).
    pub(super) fn measure(plane: &Array2<f32>, control: &Control) -> Result<Self> {
        let (height, width) = plane.dim();
        let (down, across) = (cells(height), cells(width));
        let samples = plane.as_slice().unwrap_or_default();
        let mut sums = vec![[0.0f32; 2]; down * across];
        for_each_row(&mut sums, across, control, |cell, sums| {
            let rows = edge(cell, height, down)..edge(cell + 1, height, down);
            for row in rows.clone().map(|y| &samples[y * width..(y + 1) * width]) {
                for (x, sums) in sums.iter_mut().enumerate() {
                    for s in &row[edge(x, width, across)..edge(x + 1, width, across)] {
                        sums[0] += s;
                        sums[1] += s * s;
                    }
                }
            }
            for (x, sums) in sums.iter_mut().enumerate() {
                let columns = edge(x + 1, width, across) - edge(x, width, across);
                let count = (rows.len() * columns) as f32;
                *sums = sums.map(|sum| sum / count);
            }
        })?;
        let averaged = |which: usize| {
            let plane = Array2::from_shape_fn((down, across), |(y, x)| sums[y * across + x][which]);
            smooth(plane.view(), SIGMA, control)
        };
        let (mean, mut deviation) = (averaged(0)?, averaged(1)?);
        Zip::from(&mut deviation).and(&mean).for_each(|s, m| {
            *s = ((*s - m * m).max(0.0) + PLAIN).sqrt();
        });
        Ok(Self { mean, deviation })
    }

    /// Of a plane as a whole, in one cell.
    pub(super) fn uniform(plane: &Array2<f32>) -> Self {
        let mean_of = |term: fn(f64) -> f64| {
            plane.iter().map(|&s| term(f64::from(s))).sum::<f64>() / plane.len() as f64
        };
        let mean = mean_of(|s| s);
        let variance = (mean_of(|s| s * s) - mean * mean).max(0.0) as f32;
        let cell = |value| Array2::from_elem((1, 1), value);
        Self { mean: cell(mean as f32), deviation: cell((variance + PLAIN).sqrt()) }
    }

    /// `w`: how far the light of `other` is another.
    pub(super) fn change(&self, other: &Self) -> f32 {
        let mut differences: Vec<f32> = Vec::with_capacity(self.mean.len());
        Zip::from(&self.mean).and(&self.deviation).and(&other.mean).and(&other.deviation).for_each(
            |m0, s0, m1, s1| {
                let brightness = 2.0 * (m0 - m1).abs() / (s0 + s1);
                differences.push(brightness.max(CONTRAST * (s0 / s1).ln().abs()));
            },
        );
        let middle = differences.len() / 2;
        let (_, median, _) = differences.select_nth_unstable_by(middle, f32::total_cmp);
        ((*median - SAME) / SPAN).clamp(0.0, 1.0)
    }

    /// The line that brings `other` to this light.
    pub(super) fn line(&self, other: &Self, change: f32) -> Line {
        let gain = Zip::from(&self.deviation)
            .and(&other.deviation)
            .map_collect(|s0, s1| (s0 / s1).powf(change).clamp(1.0 / MOST, MOST));
        let offset = Zip::from(&self.mean)
            .and(&other.mean)
            .and(&gain)
            .map_collect(|m0, m1, g| m1 + change * (m0 - m1) - g * m1);
        Line { gain, offset }
    }
}

/// `g` and `o` at the cells.
pub(super) struct Line {
    gain: Array2<f32>,
    offset: Array2<f32>,
}

/// The cells and shares that a pixel of a row lies between.
pub(super) struct Columns(Vec<(usize, f32)>);

impl Line {
    /// What becomes of the value `sample` in the first cell: everywhere, by the line of [`Light::uniform`].
    pub(super) fn first(&self, sample: f32) -> f32 {
        self.gain[(0, 0)] * sample + self.offset[(0, 0)]
    }

    /// Where the pixels of a row of `width` samples lie.
    pub(super) fn columns(&self, width: usize) -> Columns {
        Columns((0..width).map(|x| between(x, width, self.gain.ncols())).collect())
    }

    /// Writes `g` and `o` at the pixels of row `y` of `height`.
    pub(super) fn at_row(
        &self,
        y: usize,
        height: usize,
        columns: &Columns,
        gain: &mut [f32],
        offset: &mut [f32],
    ) {
        let (down, across) = self.gain.dim();
        let (above, share) = between(y, height, down);
        let below = (above + 1).min(down - 1);
        for (cells, out) in [(&self.gain, gain), (&self.offset, offset)] {
            let mix = |x: usize| {
                let (a, b) = (cells[(above, x)], cells[(below, x)]);
                a + share * (b - a)
            };
            let mixed: Vec<f32> = (0..=across).map(|x| mix(x.min(across - 1))).collect();
            for (out, &(left, share)) in out.iter_mut().zip(&columns.0) {
                *out = mixed[left] + share * (mixed[left + 1] - mixed[left]);
            }
        }
    }
}

/// Cells along an axis: an odd number, so that their edges, rounded, mirror each other.
fn cells(length: usize) -> usize {
    2 * (length / (2 * CELL)) + 1
}

/// First sample of cell `i` of `count`.
fn edge(i: usize, length: usize, count: usize) -> usize {
    (2 * i * length + count) / (2 * count)
}

/// The cell whose centre is at or before sample `x`, and the way to the next, in [0, 1].
fn between(x: usize, length: usize, count: usize) -> (usize, f32) {
    let at = (x as f32 + 0.5) * count as f32 / length as f32 - 0.5;
    let at = at.clamp(0.0, (count - 1) as f32);
    (at as usize, at.fract())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pattern of deviation 40 about 10, moved by `shift` px.
    fn pattern(shift: f32) -> Array2<f32> {
        Array2::from_shape_fn((90, 130), |(y, x)| {
            let (x, y) = (x as f32 - shift, y as f32);
            10.0 + 40.0 * ((0.9 * x + 0.3 * y).sin() + (0.5 * y - 0.7 * x + 1.0).sin())
        })
    }

    #[test]
    fn motion_is_no_change_of_light() {
        let light = |plane: &Array2<f32>| Light::measure(plane, &Control::new()).unwrap();
        let here = light(&pattern(0.0));
        assert_eq!(here.change(&light(&pattern(9.0))), 0.0);
        // Nor is other light on a quarter of the picture: the average makes it one of 40 %.
        let mut part = pattern(0.0);
        part.slice_mut(ndarray::s![.., ..32]).mapv_inplace(|s| 0.5 * s);
        assert_eq!(here.change(&light(&part)), 0.0);
        assert_eq!(here.change(&light(&pattern(0.0).mapv(|s| s + 30.0))), 1.0);
        assert_eq!(here.change(&light(&pattern(0.0).mapv(|s| 0.8 * s))), 1.0);
    }

    #[test]
    fn the_line_takes_gain_and_offset_back() {
        let control = Control::new();
        let (plane, other) = (pattern(0.0), pattern(0.0).mapv(|s| 0.8 * s - 30.0));
        let [here, there] = [&plane, &other].map(|p| Light::measure(p, &control).unwrap());
        let line = here.line(&there, 1.0);
        let columns = line.columns(130);
        let (mut gain, mut offset) = ([0.0; 130], [0.0; 130]);
        for y in [0, 44, 89] {
            line.at_row(y, 90, &columns, &mut gain, &mut offset);
            // The floor of the deviation, 3 of 40 grey levels, changes the gain by 0.2 %.
            assert!(gain.iter().all(|g| (g - 1.25).abs() < 0.005));
            assert!(offset.iter().all(|o| (o - 37.5).abs() < 0.2));
        }
        let uniform = Light::uniform(&plane).line(&Light::uniform(&other), 1.0);
        assert!((uniform.first(10.0) - 50.0).abs() < 0.1);
        let same = here.line(&there, 0.0);
        assert!(same.gain.iter().all(|&g| g == 1.0) && same.offset.iter().all(|&o| o == 0.0));
    }

    #[test]
    fn cells_mirror_and_cover_any_length() {
        for length in 1..200 {
            let count = cells(length);
            assert_eq!((edge(0, length, count), edge(count, length, count)), (0, length));
            for i in 0..count {
                assert!(edge(i, length, count) < edge(i + 1, length, count));
                assert_eq!(edge(i, length, count), length - edge(count - i, length, count));
            }
            let (last, share) = between(length - 1, length, count);
            assert!(last < count && (0.0..1.0).contains(&share));
        }
    }
}
