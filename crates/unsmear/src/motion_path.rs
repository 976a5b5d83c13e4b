//! Where the light of a pixel came from during the exposure: a parabola through the pixel.
//!
//! With v(p) the velocity (px/frame) at mid-exposure, s the exposure (fraction of the frame interval)
//! and a the change of velocity at a fixed pixel (px/frame^2), what is at p at the time t s from
//! mid-exposure was, at mid-exposure, at
//!
//! ```text
//! p + D(t),   D(t) = d - t V + t^2/2 q,   V = s v,   q = s^2 [(v.grad) v - a],   t in [-1/2, 1/2]
//! ```
//!
//! to second order in t: from X(t) = p, X' = v(X, t) and X'' = a + (v.grad) v follows
//! D = -t [V + (D.grad) V] - t^2/2 X''. d is an offset of the whole path, such as the registration to
//! another frame. In terms of the acceleration that the moving content itself feels, A = a + (v.grad) v
//! (the sum of the flows to the next and to the former frame), q = s^2 [2 (v.grad) v - A].
//!
//! s^2 (v.grad) v is the difference of V between the ends of the pixel's own straight path, half by
//! half: a half that leaves the picture is shortened (where both leave it at once, in a corner, pixels beside are
//! compared), and one on which the field is unknown or jumps (by more than 1 px and
//! 0.4 of |V|) counts for nothing, because the motion of another thing does not bend this one's path.
//!
//! Units: px; NaN = unknown motion. Validity: paths whose direction turns by less than a right angle.

use ndarray::Array2;
use rayon::prelude::*;

use crate::array::require_same;
use crate::error::{Error, Result, require};
use crate::flow_field::{FlowField, FlowView};
use crate::psf::LONGEST_MOTION;

/// Change of V along half a path, px, that is never taken for a jump.
const SMALLEST_JUMP: f32 = 1.0;
/// Change of V along half a path, as a share of |V|, that is never taken for a jump: a rotation by
/// 45 degrees within the exposure.
const RELATIVE_JUMP: f32 = 0.4;
/// Shortest part of half a path, as a share of it, from which a change is extrapolated.
const LEAST_SPAN: f32 = 0.25;
/// Pixels beyond the ends of a path that cubic interpolation reads, and one for rounding up and down.
const TAPS_REACH: usize = 4;

/// The paths of all pixels of a picture; see the [module](self).
#[derive(Debug, Clone, PartialEq)]
pub struct MotionPaths {
    /// V, displacement during the exposure, px; NaN = unknown.
    pub velocity: FlowField<f32>,
    /// q, second derivative of the path, px per exposure^2; finite where V is known.
    pub curvature: FlowField<f32>,
    /// d, offset of the whole path, px; None: zero.
    pub offset: Option<FlowField<f32>>,
}

impl MotionPaths {
    /// Paths from the `velocity` (px/frame) at mid-exposure, the `exposure` (fraction of the frame
    /// interval, > 0) and the `acceleration` at a fixed pixel (px/frame^2; None: a steady field).
    ///
    /// Where the acceleration is unknown the field counts as steady.
    ///
    /// # Errors
    /// [`Error::Shape`] for an empty picture or shapes that differ; [`Error::Value`] for an exposure
    /// out of range, an infinite vector, or motion longer than [`LONGEST_MOTION`].
    pub fn new(
        velocity: &FlowField<f32>,
        exposure: f64,
        acceleration: Option<&FlowField<f32>>,
    ) -> Result<Self> {
        let mut paths = Self::steady(velocity, exposure)?;
        if let Some(acceleration) = acceleration {
            paths.bend(1.0, acceleration, exposure, "acceleration")?;
        }
        Ok(paths)
    }

    /// Like [`MotionPaths::new`] from the acceleration of the moving content, A, px/frame^2.
    ///
    /// # Errors
    /// As [`MotionPaths::new`].
    pub fn from_content_acceleration(
        velocity: &FlowField<f32>,
        exposure: f64,
        acceleration: &FlowField<f32>,
    ) -> Result<Self> {
        let mut paths = Self::steady(velocity, exposure)?;
        paths.bend(2.0, acceleration, exposure, "acceleration")?;
        Ok(paths)
    }

    /// The same paths, each moved by `offset` (px, finite).
    ///
    /// # Errors
    /// [`Error::Shape`] when the shapes differ; [`Error::Value`] for an offset that is not finite or
    /// longer than [`LONGEST_MOTION`].
    pub fn with_offset(self, offset: FlowField<f32>) -> Result<Self> {
        require_same("offset", &offset.u.view(), self.velocity.dim())?;
        require_same("offset", &offset.v.view(), self.velocity.dim())?;
        for &part in offset.u.iter().chain(&offset.v) {
            require("offset", f64::from(part), "finite and at most 4096 px", in_range)?;
        }
        Ok(Self { offset: Some(offset), ..self })
    }

    /// Rows and columns of the picture.
    #[must_use]
    pub fn dim(&self) -> (usize, usize) {
        self.velocity.dim()
    }

    /// Pixels beyond the picture that the longest path may read: the least padding for which nothing
    /// is clamped.
    #[must_use]
    pub fn reach(&self) -> usize {
        type Part = fn(&FlowField<f32>) -> &Array2<f32>;
        let parts: [Part; 2] = [|field| &field.u, |field| &field.v];
        let mut longest = 0.0f32;
        for part in parts {
            let mut offsets = self.offset.as_ref().map(|offset| part(offset).iter());
            for (&motion, &bend) in part(&self.velocity).iter().zip(part(&self.curvature)) {
                let offset = offsets.as_mut().and_then(Iterator::next).copied().unwrap_or(0.0);
                let most = 0.5 * motion.abs() + 0.125 * bend.abs() + offset.abs();
                // A NaN never compares greater.
                if most > longest {
                    longest = most;
                }
            }
        }
        longest.ceil() as usize + TAPS_REACH
    }

    /// The same paths on the grid of ceil(H/2) x ceil(W/2) pixels of [`resample`](crate::pyramid::resample):
    /// means of the known among 2 x 2 pixels, in pixels of the new grid.
    #[must_use]
    pub fn halved(&self) -> Self {
        Self {
            velocity: halved(&self.velocity),
            curvature: halved(&self.curvature),
            offset: self.offset.as_ref().map(halved),
        }
    }

    /// V and q of a steady field.
    fn steady(velocity: &FlowField<f32>, exposure: f64) -> Result<Self> {
        require("exposure", exposure, "finite and positive", |e| e > 0.0)?;
        if velocity.u.is_empty() {
            return Err(Error::shape("velocity", "(H >= 1, W >= 1)", velocity.u.shape()));
        }
        require_same("velocity", &velocity.v.view(), velocity.u.dim())?;
        let scaled = |plane: &Array2<f32>| plane.mapv(|z| (exposure * f64::from(z)) as f32);
        let velocity = FlowField::new(scaled(&velocity.u), scaled(&velocity.v))?;
        for (&u, &v) in velocity.u.iter().zip(&velocity.v) {
            let most = f64::from(u.abs() + v.abs());
            // No vector is longer than its parts together, and most are far from the limit.
            if most > LONGEST_MOTION {
                let length = f64::from(u).hypot(f64::from(v));
                require("velocity", length, "at most 4096 px within the exposure", in_range)?;
            }
        }
        let curvature = bends(&velocity.view())?;
        Ok(Self { velocity, curvature, offset: None })
    }

    /// q := `share` q - s^2 `acceleration`, where that is known.
    fn bend(
        &mut self,
        share: f32,
        acceleration: &FlowField<f32>,
        exposure: f64,
        argument: &'static str,
    ) -> Result<()> {
        require_same(argument, &acceleration.u.view(), self.velocity.dim())?;
        require_same(argument, &acceleration.v.view(), self.velocity.dim())?;
        let square = (exposure * exposure) as f32;
        let known = acceleration.u.iter().zip(&acceleration.v).map(|(u, v)| !(u + v).is_nan());
        let mut of_known = Array2::from_elem(self.velocity.dim(), true);
        of_known.iter_mut().zip(known).for_each(|(slot, known)| *slot = known);
        for (bend, given) in
            [(&mut self.curvature.u, &acceleration.u), (&mut self.curvature.v, &acceleration.v)]
        {
            for ((bend, &given), &known) in bend.iter_mut().zip(given).zip(&of_known) {
                if known {
                    *bend = share * *bend - square * given;
                    require(
                        argument,
                        f64::from(*bend),
                        "at most 4096 px per exposure^2",
                        in_range,
                    )?;
                }
            }
        }
        Ok(())
    }
}

fn in_range(z: f64) -> bool {
    z.abs() <= LONGEST_MOTION
}

/// s^2 (v.grad) v of all pixels.
fn bends(field: &FlowView<'_, f32>) -> Result<FlowField<f32>> {
    let (mut u, mut v) = (Array2::zeros(field.dim()), Array2::zeros(field.dim()));
    if let (Some(u), Some(v)) = (u.as_slice_mut(), v.as_slice_mut()) {
        let width = field.dim().1;
        let rows = u.par_chunks_mut(width).zip(v.par_chunks_mut(width)).enumerate();
        rows.for_each(|(y, (u, v))| (0..width).for_each(|x| [u[x], v[x]] = advection(field, y, x)));
    }
    FlowField::new(u, v)
}

/// s^2 (v.grad) v at a pixel; 0 where nothing is known.
fn advection(field: &FlowView<'_, f32>, y: usize, x: usize) -> [f32; 2] {
    let motion = field.at(y, x);
    let length = motion[0].hypot(motion[1]);
    if !(length > 0.0) {
        return [0.0; 2];
    }
    let jump = SMALLEST_JUMP.max(RELATIVE_JUMP * length);
    let (mut change, mut span) = ([0.0f32; 2], 0.0f32);
    for sign in [-1.0, 1.0] {
        let step = motion.map(|z| 0.5 * sign * z);
        let share = share_inside([x, y], step, [field.dim().1, field.dim().0]);
        let end = bilinear(field, x as f32 + share * step[0], y as f32 + share * step[1]);
        let half = [0, 1].map(|axis| sign * (end[axis] - motion[axis]));
        // An unknown end compares to nothing.
        if share >= LEAST_SPAN && half.iter().all(|z| z.abs() <= jump) {
            change = [0, 1].map(|axis| change[axis] + half[axis]);
            span += 0.5 * share;
        }
    }
    if span > 0.0 { change.map(|z| z / span) } else { from_neighbours(field, y, x) }
}

/// s^2 (v.grad) v from the pixels beside, for corners that the path leaves both ways; 0 across jumps and unknown pixels.
fn from_neighbours(field: &FlowView<'_, f32>, y: usize, x: usize) -> [f32; 2] {
    let (height, width) = field.dim();
    let motion = field.at(y, x);
    let between = |[y0, x0]: [usize; 2], [y1, x1]: [usize; 2]| {
        let (from, to) = (field.at(y0, x0), field.at(y1, x1));
        let distance = ((y1 - y0) + (x1 - x0)).max(1) as f32;
        [0, 1].map(|axis| (to[axis] - from[axis]) / distance)
    };
    let across = between([y, x.saturating_sub(1)], [y, (x + 1).min(width - 1)]);
    let down = between([y.saturating_sub(1), x], [(y + 1).min(height - 1), x]);
    let change = [0, 1].map(|axis| motion[0] * across[axis] + motion[1] * down[axis]);
    let jump = 2.0 * SMALLEST_JUMP.max(RELATIVE_JUMP * motion[0].hypot(motion[1]));
    if change.iter().all(|z| z.abs() <= jump) { change } else { [0.0; 2] }
}

/// Share of `step` from the pixel that stays on the picture.
fn share_inside(pixel: [usize; 2], step: [f32; 2], size: [usize; 2]) -> f32 {
    [0, 1].into_iter().fold(1.0f32, |share, axis| {
        let room = if step[axis] > 0.0 { size[axis] - 1 - pixel[axis] } else { pixel[axis] } as f32;
        if step[axis].abs() > room { share.min(room / step[axis].abs()) } else { share }
    })
}

/// The field between its pixels, at a position on the picture; NaN beside unknown pixels.
fn bilinear(field: &FlowView<'_, f32>, x: f32, y: f32) -> [f32; 2] {
    let (height, width) = field.dim();
    let (row, column) = ((y as usize).min(height - 1), (x as usize).min(width - 1));
    let (below, right) = ((row + 1).min(height - 1), (column + 1).min(width - 1));
    let (fx, fy) = (x - column as f32, y - row as f32);
    let mix = |a: f32, b: f32, f: f32| if f > 0.0 { a + f * (b - a) } else { a };
    let corners = [
        field.at(row, column),
        field.at(row, right),
        field.at(below, column),
        field.at(below, right),
    ];
    [0, 1].map(|axis| {
        let [a, b, c, d] = corners.map(|corner| corner[axis]);
        mix(mix(a, b, fx), mix(c, d, fx), fy)
    })
}

/// Means of the known among 2 x 2 pixels, in units of the halved grid.
fn halved(field: &FlowField<f32>) -> FlowField<f32> {
    let (height, width) = field.dim();
    let half = (height.div_ceil(2), width.div_ceil(2));
    let shrink = |plane: &Array2<f32>, scale: f32| {
        Array2::from_shape_fn(half, |(y, x)| {
            let mut sum = (0.0, 0.0);
            for (r, c) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let at = ((2 * y + r).min(height - 1), (2 * x + c).min(width - 1));
                if !(field.u[at] + field.v[at]).is_nan() {
                    sum = (sum.0 + plane[at], sum.1 + 1.0);
                }
            }
            // 0 / 0 where none is known.
            scale * sum.0 / sum.1
        })
    };
    FlowField {
        u: shrink(&field.u, half.1 as f32 / width as f32),
        v: shrink(&field.v, half.0 as f32 / height as f32),
    }
}

#[cfg(test)]
mod tests;
