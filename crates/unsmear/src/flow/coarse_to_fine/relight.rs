//! Frames in other light shown as the reference would show them, and both as either could.
//!
//! Where the light has changed (see [`super::lighting`]) each channel `J_1` of the other frame becomes
//! `g J_1 + o`: first by one line for the whole plane, which motion hardly touches, and where the light
//! is another still, as the local means and deviations then tell, by a line that follows the
//! place. A sensor that was saturated cannot be brought back: the border of the white region
//! follows the light instead of the thing. What one frame could not record is therefore taken
//! from the other as well,
//!
//! ```text
//! J_0 <- clamp(J_0, g b_1 + o, g t_1 + o),   J_1 <- clamp(J_1, (b_0 - o)/g, (t_0 - o)/g)
//! ```
//!
//! with the least and the greatest sample `b`, `t` of each plane, as far as they come in runs: four that
//! form a square; lone extremes are the content of a picture that is not saturated. The same
//! brightness is then cut off in both, and the border belongs to the thing again. Means and
//! deviations of what is left give a better line: [`ROUNDS`] rounds. What the method sees is the
//! Rec. 601 luma of the channels, or the only one. Grey levels of the standardised sequence, whatever
//! the type of the samples was.
//!
//! Where light changes from place to place, a smooth thing wider than some 30 px is itself taken for
//! light, and its motion is found too small.

use ndarray::Array2;

use super::lighting::{Light, Line};
use super::recorded::LUMA;
use super::rows::for_each_rows;
use crate::array::for_each_row_with;
use crate::control::Control;
use crate::error::Result;

/// Rounds of line and common range where a plane is saturated.
const ROUNDS: usize = 4;

/// The least and greatest samples at which a plane is saturated; infinite where it is not.
type Range = [f32; 2];

/// The luma of the planes `other` in the light of the planes `reference`, which lose what `other` cannot show.
///
/// `change` is `w` of [`super::lighting`].
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn relight(
    reference: &mut [Array2<f32>],
    other: &mut [Array2<f32>],
    change: f32,
    control: &Control,
) -> Result<Array2<f32>> {
    for (seen, plane) in reference.iter_mut().zip(&mut *other) {
        match_plane(seen, plane, change, control)?;
    }
    luma(other, control)
}

/// The Rec. 601 luma of three planes, or the only one.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn luma(planes: &[Array2<f32>], control: &Control) -> Result<Array2<f32>> {
    let mut out = planes[0].clone();
    if let [_, _, _] = planes {
        let width = out.ncols();
        let [red, green, blue] =
            [0, 1, 2].map(|channel| planes[channel].as_slice().unwrap_or_default());
        let [r, g, b] = LUMA.map(|weight| weight as f32);
        let samples = [out.as_slice_mut().unwrap_or_default()];
        for_each_rows(samples, [width], control, |y, [out]| {
            let row = y * width..(y + 1) * width;
            let (red, green, blue) = (&red[row.clone()], &green[row.clone()], &blue[row]);
            for (x, out) in out.iter_mut().enumerate() {
                *out = r * red[x] + g * green[x] + b * blue[x];
            }
        })?;
    }
    Ok(out)
}

/// Brings one plane to the light of the other, and both to what either can show.
fn match_plane(
    seen: &mut Array2<f32>,
    plane: &mut Array2<f32>,
    change: f32,
    control: &Control,
) -> Result<()> {
    let mut whole = [seen.clone(), plane.clone()];
    let mut ranges = [saturation(seen), saturation(plane)];
    let uniform = |plane: &Array2<f32>| Ok(Light::uniform(plane));
    let line = settle([&mut *seen, &mut *plane], &whole, ranges, change, uniform, control)?;
    follow(plane, &line, control)?;
    let place = |plane: &Array2<f32>| Light::measure(plane, control);
    let change = change * place(seen)?.change(&place(plane)?);
    if change > 0.0 {
        follow(&mut whole[1], &line, control)?;
        ranges[1] = ranges[1].map(|bound| line.first(bound));
        let line = settle([&mut *seen, &mut *plane], &whole, ranges, change, place, control)?;
        follow(plane, &line, control)?;
    }
    Ok(())
}

/// The line between the planes `whole`, which are left in `planes` without what one of them cannot show.
fn settle(
    [seen, plane]: [&mut Array2<f32>; 2],
    whole: &[Array2<f32>; 2],
    ranges: [Range; 2],
    change: f32,
    measure: impl Fn(&Array2<f32>) -> Result<Light>,
    control: &Control,
) -> Result<Line> {
    let line =
        |seen: &_, plane: &_| -> Result<Line> { Ok(measure(seen)?.line(&measure(plane)?, change)) };
    let mut found = line(&whole[0], &whole[1])?;
    let saturated = ranges.iter().flatten().any(|bound| bound.is_finite());
    for round in 0..if saturated { ROUNDS } else { 1 } {
        if round > 0 {
            found = line(seen, plane)?;
        }
        seen.assign(&whole[0]);
        plane.assign(&whole[1]);
        if saturated {
            keep_common(seen, plane, &found, ranges, control)?;
        }
    }
    Ok(found)
}

/// The extremes of a plane that four samples in a square have.
fn saturation(plane: &Array2<f32>) -> Range {
    let width = plane.ncols();
    let samples = plane.as_slice().unwrap_or_default();
    let least = samples.iter().copied().fold(f32::INFINITY, f32::min);
    let most = samples.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let runs = |bound: f32| {
        samples.chunks_exact(width).zip(samples.chunks_exact(width).skip(1)).any(|(row, next)| {
            let pairs = row.windows(2).zip(next.windows(2));
            pairs.into_iter().any(|(a, b)| a == [bound; 2] && b == [bound; 2])
        })
    };
    [
        if runs(least) { least } else { f32::NEG_INFINITY },
        if runs(most) { most } else { f32::INFINITY },
    ]
}

/// Cuts off in both planes what one of them cannot show.
fn keep_common(
    seen: &mut Array2<f32>,
    plane: &mut Array2<f32>,
    line: &Line,
    [here, there]: [Range; 2],
    control: &Control,
) -> Result<()> {
    let (height, width) = plane.dim();
    let columns = line.columns(width);
    let planes = [seen, plane].map(|plane| plane.as_slice_mut().unwrap_or_default());
    for_each_rows(planes, [width; 2], control, |y, [seen, plane]| {
        let (mut gain, mut offset) = (vec![0.0; width], vec![0.0; width]);
        line.at_row(y, height, &columns, &mut gain, &mut offset);
        for x in 0..width {
            let (g, o) = (gain[x], offset[x]);
            seen[x] = seen[x].max(g * there[0] + o).min(g * there[1] + o);
            plane[x] = plane[x].max((here[0] - o) / g).min((here[1] - o) / g);
        }
    })
}

/// `g J + o` in place of `J`.
fn follow(plane: &mut Array2<f32>, line: &Line, control: &Control) -> Result<()> {
    let (height, width) = plane.dim();
    let columns = line.columns(width);
    let scratch = || [vec![0.0f32; width], vec![0.0f32; width]];
    let samples = plane.as_slice_mut().unwrap_or_default();
    for_each_row_with(samples, width, control, scratch, |y, row, [gain, offset]| {
        line.at_row(y, height, &columns, gain, offset);
        row.iter_mut().zip(&*gain).zip(&*offset).for_each(|((s, g), o)| *s = g * *s + o);
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (90, 130);

    /// A pattern of deviation 40 about 10, moved by `shift` px.
    fn pattern(shift: f32) -> Array2<f32> {
        Array2::from_shape_fn(SIZE, |(y, x)| {
            let (x, y) = (x as f32 - shift, y as f32);
            10.0 + 40.0 * ((0.9 * x + 0.3 * y).sin() + (0.5 * y - 0.7 * x + 1.0).sin())
        })
    }

    fn rms(one: &Array2<f32>, other: &Array2<f32>) -> f32 {
        ((one - other).mapv(|d| d * d).mean().unwrap()).sqrt()
    }

    #[test]
    fn shading_gain_and_offset_are_taken_back() {
        let plane = pattern(0.0);
        let shaded = Array2::from_shape_fn(SIZE, |(y, x)| {
            let shade = 1.0 + 0.3 * (std::f32::consts::TAU * x as f32 / 130.0).sin();
            0.8 * shade * (plane[(y, x)] + 90.0) - 20.0
        });
        assert!(rms(&shaded, &plane) > 25.0);
        let (mut seen, mut other) = ([plane.clone()], [shaded]);
        let lit = relight(&mut seen, &mut other, 1.0, &Control::new()).unwrap();
        // Average and interpolation, 16 px, keep exp(-(16 2 pi/130)^2/2) = 74 % of the shade. What is left of 0.3, over
        // the shade kept (on average 1.07), of brightness 100 and contrast 40, is
        // 0.26 * 0.3 * 1.07 * (100^2 + 40^2)^0.5/sqrt(2) = 6.4 grey levels; more where the average is one-sided.
        let inner = ndarray::s![.., 30..100];
        let left = rms(&lit.slice(inner).to_owned(), &plane.slice(inner).to_owned());
        assert!(left < 6.5, "{left}");
        assert!(rms(&lit, &plane) < 9.0, "{}", rms(&lit, &plane));
        assert_eq!(seen[0], plane, "nothing was saturated");
    }

    #[test]
    fn colours_come_back_to_the_same_grey() {
        let mut planes = [0.0, 7.0, 15.0].map(pattern);
        let [red, green, blue] = &planes;
        let mut other = [red * 0.5, green * 1.5 + 30.0, blue * 0.9 - 80.0];
        let grey = red * 0.299 + green * 0.587 + blue * 0.114;
        let lit = relight(&mut planes, &mut other, 1.0, &Control::new()).unwrap();
        // The floor of the deviation: 3 of 40 grey levels change a gain by less than 1 %.
        assert!(rms(&lit, &grey) < 0.4, "{}", rms(&lit, &grey));
        assert!(rms(&luma(&planes, &Control::new()).unwrap(), &grey) < 1e-4);
    }

    /// Twice the light, cut off at 60: the reference is cut off at 30, within what the line errs.
    #[test]
    fn what_one_frame_cannot_show_is_taken_from_both() {
        let plane = pattern(0.0);
        let white = plane.mapv(|s| (2.0 * s).min(60.0));
        for swap in [false, true] {
            let (mut seen, mut other) = ([plane.clone()], [white.clone()]);
            if swap {
                (seen, other) = (other, seen);
            }
            let lit = relight(&mut seen, &mut other, 1.0, &Control::new()).unwrap();
            let cut = if swap { white.clone() } else { plane.mapv(|s| s.min(30.0)) };
            let [found, shown] = [rms(&seen[0], &cut), rms(&lit, &cut)];
            assert!(found < 3.0 && shown < 3.0, "{swap}: {found} {shown}");
        }
    }

    #[test]
    fn lone_extremes_are_content() {
        let mut plane = Array2::from_shape_fn((6, 7), |(y, x)| (y * x) as f32);
        assert_eq!(saturation(&plane), [f32::NEG_INFINITY, f32::INFINITY]);
        plane.slice_mut(ndarray::s![2..4, 3..5]).fill(99.0);
        assert_eq!(saturation(&plane), [f32::NEG_INFINITY, 99.0]);
    }
}
