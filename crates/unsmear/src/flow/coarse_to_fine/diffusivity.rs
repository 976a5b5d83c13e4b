//! Diffusivities of the edge-weighted total variation of the flow, half-way between pixels.
//!
//! The smoothness energy `alpha sum e |grad (u, v)|` has, with lagged weights, the flux
//! `g (U_q - U_p)` between neighbours `p, q`,
//!
//! ```text
//! g = alpha e / sqrt(|grad u|^2 + |grad v|^2 + eps^2)
//! ```
//!
//! at the point between them: the derivative along the pair is their difference, the one across the
//! mean of both pixels' central differences (one-sided spans at the edge, where the difference keeps
//! its divisor and is halved). `eps`, px, is the difference of flow below which smoothing is
//! quadratic. Nothing flows across the edge of the picture.
//!
//! `e` in (0, 1.05] comes from the guide (see [`super::guide`]); `alpha` is in units of the data
//! term. Reference: L. Rudin, S. Osher, E. Fatemi 1992 (doi 10.1016/0167-2789(92)90242-F).

use multiversion::multiversion;

use super::rows::Planes;

/// Difference of flow below which smoothing is quadratic, px.
const EPSILON: f32 = 0.02;

/// Fills row `y` of `gx` (between x and x + 1) and `gy` (between y and y + 1), from planes (H, W).
pub(super) fn diffusivities(
    y: usize,
    [u, v]: Planes<'_>,
    [edge_x, edge_y]: Planes<'_>,
    alpha: f32,
    [gx, gy]: [&mut [f32]; 2],
) {
    let width = gx.len();
    let height = u.len() / width;
    let row = |y: usize| y * width..(y + 1) * width;
    let rows = [y.saturating_sub(1), y, (y + 1).min(height - 1), (y + 2).min(height - 1)];
    let (u, v) = (rows.map(|y| &u[row(y)]), rows.map(|y| &v[row(y)]));
    between_columns(&u, &v, &edge_x[row(y)], alpha, gx);
    gx[width - 1] = 0.0;
    if y + 1 == height {
        gy.fill(0.0);
        return;
    }
    between_rows(&u, &v, &edge_y[row(y)], alpha, gy);
    for x in [0, width - 1] {
        let at = [x.saturating_sub(1), x, (x + 1).min(width - 1)];
        let steep = steepness_down(&u, at) + steepness_down(&v, at);
        gy[x] = alpha * edge_y[y * width + x] / (steep + EPSILON * EPSILON).sqrt();
    }
}

/// Rows y - 1, y, y + 1 and y + 2 of a component.
type Rows<'a> = [&'a [f32]; 4];

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn between_columns(u: &Rows<'_>, v: &Rows<'_>, edge: &[f32], alpha: f32, out: &mut [f32]) {
    let n = out.len();
    let (u, v, edge) = (u.map(|row| &row[..n]), v.map(|row| &row[..n]), &edge[..n]);
    for x in 0..n - 1 {
        let steep = steepness_across(&u, x) + steepness_across(&v, x);
        out[x] = alpha * edge[x] / (steep + EPSILON * EPSILON).sqrt();
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn between_rows(u: &Rows<'_>, v: &Rows<'_>, edge: &[f32], alpha: f32, out: &mut [f32]) {
    let n = out.len();
    let (u, v, edge) = (u.map(|row| &row[..n]), v.map(|row| &row[..n]), &edge[..n]);
    for x in 1..n.max(2) - 1 {
        let at = [x - 1, x, x + 1];
        let steep = steepness_down(&u, at) + steepness_down(&v, at);
        out[x] = alpha * edge[x] / (steep + EPSILON * EPSILON).sqrt();
    }
}

/// `|grad|^2` of a component between x and x + 1.
#[inline(always)]
fn steepness_across([above, here, below, _]: &Rows<'_>, x: usize) -> f32 {
    let along = here[x + 1] - here[x];
    let across = 0.25 * (below[x] - above[x] + below[x + 1] - above[x + 1]);
    along * along + across * across
}

/// `|grad|^2` of a component between rows y and y + 1.
#[inline(always)]
fn steepness_down([_, here, below, _]: &Rows<'_>, [left, x, right]: [usize; 3]) -> f32 {
    let along = below[x] - here[x];
    let across = 0.25 * (here[right] - here[left] + below[right] - below[left]);
    along * along + across * across
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On a plane `u = a x + b y` the gradient is the same everywhere but across the edge.
    #[test]
    fn a_plane_has_one_diffusivity() {
        let (height, width) = (6, 9);
        let field = |a: f32, b: f32| -> Vec<f32> {
            (0..height * width).map(|i| a * (i % width) as f32 + b * (i / width) as f32).collect()
        };
        let (u, v, ones) = (field(0.3, -0.1), field(0.2, 0.5), vec![1.0; height * width]);
        let (mut gx, mut gy) = (vec![9.0; height * width], vec![9.0; height * width]);
        for (y, (gx, gy)) in gx.chunks_mut(width).zip(gy.chunks_mut(width)).enumerate() {
            diffusivities(y, [&u, &v], [&ones, &ones], 2.0, [gx, gy]);
        }
        let expected = 2.0 / (0.09f32 + 0.01 + 0.04 + 0.25 + EPSILON * EPSILON).sqrt();
        for y in 1..height - 1 {
            for x in 1..width - 1 {
                let i = y * width + x;
                assert!((gx[i] - expected).abs() < 1e-4 || x + 1 == width, "{y} {x}");
                assert!((gy[i] - expected).abs() < 1e-4, "{y} {x}");
            }
            assert_eq!(gx[y * width + width - 1], 0.0);
        }
        assert!(gy[(height - 1) * width..].iter().all(|&g| g == 0.0));
    }

    #[test]
    fn a_constant_flow_diffuses_most() {
        let (u, e) = (vec![1.5; 12], vec![0.5; 12]);
        let (mut gx, mut gy) = (vec![0.0; 4], vec![0.0; 4]);
        diffusivities(0, [&u, &u], [&e, &e], 1.0, [&mut gx, &mut gy]);
        assert!((gx[0] - 0.5 / EPSILON).abs() < 1e-4 && (gy[3] - 0.5 / EPSILON).abs() < 1e-4);
    }
}
