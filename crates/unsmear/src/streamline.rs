//! The way of a point through a steady field of motion, followed both ways from a pixel.
//!
//! ```text
//! dX/dt = v(X),  X(0) = p
//! m_k = v(X_k + h/2 m_{k-1}),   X_{k+1} = X_k + h m_k,   X_{k+1/2} = X_k + h (m_{k-1} + 3 m_k) / 8,   m_{-1} = v(p)
//! ```
//!
//! the midpoint rule with the motion carried over from the stride before, and the parabola through its results for the
//! point halfway. v is interpolated bilinearly; outside the picture both it and the position are those of the nearest
//! edge point. Positions are kept relative to p, so that `f32` loses nothing on large pictures. Where the field jumps
//! between two strides by more than `max(1 px, 0.2 |v(p)|)` in a component, or is unknown (NaN), the last motion is
//! held: a streamline does not cross from one moving thing to another.
//!
//! In the time of the walk a steady motion blurs *exactly* by a box, whatever the field's curvature or divergence:
//! `b(X(t)) = 1/e integral_{-e/2}^{e/2} x(X(t + s)) ds`.
#![allow(
    clippy::inline_always,
    reason = "a helper gets its caller's vector instructions only when inlined"
)]

use crate::flow_field::FlowView;
use crate::real::Real;

/// Change of motion between two strides, px/frame, that is never taken for a jump.
const SMALLEST_JUMP: f64 = 1.0;

/// Change of motion between two strides, as a share of the pixel's speed, that is never taken for a jump. At
/// strides of 2 px a rotation reaches it only within 10 px of its centre.
const RELATIVE_JUMP: f64 = 0.2;

/// A field packed for interpolation: one row and column repeated at the far ends.
pub(crate) struct Streamlines<T> {
    field: Vec<[T; 2]>,
    stride: usize,
    last: [T; 2],
}

/// A point on its way: offset from the pixel and the motion last used, both (x, y).
#[derive(Clone, Copy)]
pub(crate) struct Walker<T> {
    /// Column and row of the pixel.
    origin: [usize; 2],
    /// Least and greatest offset that stays in the picture.
    bounds: [[T; 2]; 2],
    /// Greatest change of motion, px/frame, that is followed.
    jump: T,
    motion: [T; 2],
    /// Offset from the pixel halfway through the last stride, px, within the picture.
    pub(crate) halfway: [T; 2],
    /// Offset from the pixel after the last stride, px, within the picture.
    pub(crate) offset: [T; 2],
}

impl<T: Real> Streamlines<T> {
    /// Packs a field of at least one pixel.
    pub(crate) fn new(flow: &FlowView<'_, T>) -> Self {
        let (height, width) = flow.dim();
        let field = (0..=height)
            .flat_map(|y| (0..=width).map(move |x| (y.min(height - 1), x.min(width - 1))))
            .map(|(y, x)| flow.at(y, x))
            .collect();
        let last = [width - 1, height - 1].map(|n| T::of(n as f64));
        Self { field, stride: width + 1, last }
    }

    /// Motion at a pixel.
    #[inline(always)]
    pub(crate) fn motion(&self, y: usize, x: usize) -> [T; 2] {
        self.field[y * self.stride + x]
    }

    /// A walker at the pixel (y, x), whose motion is `motion` with speed `speed`.
    #[inline(always)]
    pub(crate) fn start(&self, y: usize, x: usize, motion: [T; 2], speed: T) -> Walker<T> {
        let origin = [x, y];
        let least = [-T::of(x as f64), -T::of(y as f64)];
        let bounds = [least, [self.last[0] + least[0], self.last[1] + least[1]]];
        let jump = T::of(SMALLEST_JUMP).max(T::of(RELATIVE_JUMP) * speed);
        let still = [T::zero(); 2];
        Walker { origin, bounds, jump, motion, halfway: still, offset: still }
    }

    /// Takes one stride of `time` frames (negative: back).
    #[inline(always)]
    pub(crate) fn stride(&self, walker: &mut Walker<T>, time: T) {
        let (half, eighth) = (T::of(0.5) * time, T::of(0.125) * time);
        let ([x, y], [u, v]) = (walker.offset, walker.motion);
        let middle = walker.inside([x + half * u, y + half * v]);
        let next = self.interpolate(walker.origin, middle);
        // An unknown neighbour makes a comparison false, too.
        if (next[0] - u).abs() <= walker.jump && (next[1] - v).abs() <= walker.jump {
            walker.motion = next;
        }
        let ([m, n], three) = (walker.motion, T::of(3.0));
        walker.halfway =
            walker.inside([x + eighth * (u + three * m), y + eighth * (v + three * n)]);
        walker.offset = walker.inside([x + time * m, y + time * n]);
    }

    #[inline(always)]
    fn interpolate(&self, origin: [usize; 2], offset: [T; 2]) -> [T; 2] {
        let whole = [offset[0].floor(), offset[1].floor()];
        let (fx, fy) = (offset[0] - whole[0], offset[1] - whole[1]);
        let x = (origin[0] as isize + whole[0].as_i32() as isize) as usize;
        let y = (origin[1] as isize + whole[1].as_i32() as isize) as usize;
        let top = &self.field[y * self.stride + x..][..2];
        let bottom = &self.field[(y + 1) * self.stride + x..][..2];
        let ([a, b], [c, d]) = ([top[0], top[1]], [bottom[0], bottom[1]]);
        let (u0, v0) = (a[0] + fx * (b[0] - a[0]), a[1] + fx * (b[1] - a[1]));
        let (u1, v1) = (c[0] + fx * (d[0] - c[0]), c[1] + fx * (d[1] - c[1]));
        [u0 + fy * (u1 - u0), v0 + fy * (v1 - v0)]
    }
}

impl<T: Real> Walker<T> {
    #[inline(always)]
    fn inside(&self, offset: [T; 2]) -> [T; 2] {
        let [least, most] = self.bounds;
        [offset[0].max(least[0]).min(most[0]), offset[1].max(least[1]).min(most[1])]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flow_field::FlowField;
    use ndarray::Array2;

    fn walk(flow: &FlowField<f64>, y: usize, x: usize, time: f64, steps: usize) -> [f64; 2] {
        let lines = Streamlines::new(&flow.view());
        let motion = lines.motion(y, x);
        let mut walker = lines.start(y, x, motion, motion[0].hypot(motion[1]));
        (0..steps).for_each(|_| lines.stride(&mut walker, time / steps as f64));
        walker.offset
    }

    #[test]
    fn follows_a_circle() {
        let centre = 50.0;
        let turn = 0.3;
        let u = Array2::from_shape_fn((101, 101), |(y, _)| -turn * (y as f64 - centre));
        let v = Array2::from_shape_fn((101, 101), |(_, x)| turn * (x as f64 - centre));
        let flow = FlowField::new(u, v).unwrap();
        let [dx, dy] = walk(&flow, 50, 90, 2.0, 24);
        // 40 px from the centre, turned by 0.6 rad in strides of 0.025 rad. The motion carried over lags by 0.04 rad,
        // which puts the point where v is read off by 0.02 px and v itself by 0.005 px/frame; times 2 frames.
        assert!((dx - 40.0 * (0.6f64.cos() - 1.0)).abs() < 0.012, "{dx}");
        assert!((dy - 40.0 * 0.6f64.sin()).abs() < 0.012, "{dy}");
    }

    #[test]
    fn stops_at_the_edge_and_holds_its_direction_at_a_jump() {
        let mut u = Array2::from_elem((9, 60), 5.0);
        let v = Array2::zeros((9, 60));
        let flow = FlowField::new(u.clone(), v.clone()).unwrap();
        assert_eq!(walk(&flow, 4, 10, -20.0, 100), [-10.0, 0.0]);
        u.slice_mut(ndarray::s![.., 30..]).fill(f64::NAN);
        let flow = FlowField::new(u, v).unwrap();
        assert_eq!(walk(&flow, 4, 20, 4.0, 20), [20.0, 0.0]);
    }
}
