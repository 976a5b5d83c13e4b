//! Least squares for an affine flow over one window, from its moments.
//!
//! Six unknowns `p = (u, u_x, u_y, v, v_x, v_y)` solve `M p = b` with
//! `M = sum W [n_i n_j] (x) [z z']`, `b = sum W s [n_i] (x) z`, `z = (1, dx, dy)`. With the Cholesky
//! factor `M = L L'`,
//!
//! ```text
//! tr(M^-1) = |L^-1|^2  (Frobenius),    condition = tr(M) tr(M^-1) / 36
//! ```

/// Number of unknowns.
const N: usize = 6;
/// Which moment (of 1, dx, dy, dx^2, dx dy, dy^2) is the product of `z_i` and `z_j`.
const PRODUCT: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];
/// A pivot below this share of the trace is rounding; any sensible condition limit is stricter.
const LEAST_PIVOT: f64 = 1e-9;

/// An affine fit at the middle of its window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct AffineFit {
    /// `(u, v)`, px/frame.
    pub(crate) flow: [f64; 2],
    /// Arithmetic over harmonic mean of the eigenvalues, at least 1.
    pub(crate) condition: f64,
    /// Weighted rms residual, px/frame.
    pub(crate) residual: f64,
}

/// Fits `sums[moment][map]`, maps `W nx nx, W nx ny, W ny ny, W s nx, W s ny, W s^2, W, count`;
/// `None` when the window does not hold all six unknowns.
pub(crate) fn solve(sums: &[[f64; 8]; 6]) -> Option<AffineFit> {
    let mut matrix = [[0.0; N]; N];
    let mut vector = [0.0; N];
    for i in 0..3 {
        for j in 0..3 {
            let [xx, xy, yy, ..] = sums[PRODUCT[i][j]];
            matrix[i][j] = xx;
            matrix[i][j + 3] = xy;
            matrix[i + 3][j] = xy;
            matrix[i + 3][j + 3] = yy;
        }
        (vector[i], vector[i + 3]) = (sums[i][3], sums[i][4]);
    }
    let trace: f64 = (0..N).map(|i| matrix[i][i]).sum();
    let factor = cholesky(&matrix, LEAST_PIVOT * trace)?;
    let inverse = inverse_of_lower(&factor);
    let inverse_trace: f64 = inverse.iter().flatten().map(|l| l * l).sum();
    // p = L'^-1 (L^-1 b), and p.b = |L^-1 b|^2.
    let half: [f64; N] = std::array::from_fn(|i| (0..=i).map(|j| inverse[i][j] * vector[j]).sum());
    let unknown = |j: usize| (j..N).map(|i| inverse[i][j] * half[i]).sum::<f64>();
    let explained: f64 = half.iter().map(|h| h * h).sum();
    let [.., squares, mass, _] = sums[0];
    Some(AffineFit {
        // Adding 0 turns the -0 of a still picture into 0.
        flow: [unknown(0) + 0.0, unknown(3) + 0.0],
        condition: trace * inverse_trace / (N * N) as f64,
        residual: ((squares - explained).max(0.0) / mass).sqrt(),
    })
}

/// Lower factor of a symmetric matrix; `None` when a pivot is not above `least`.
fn cholesky(matrix: &[[f64; N]; N], least: f64) -> Option<[[f64; N]; N]> {
    let mut factor = [[0.0; N]; N];
    for i in 0..N {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| factor[i][k] * factor[j][k]).sum();
            let rest = matrix[i][j] - sum;
            if i == j {
                if !(rest > least) {
                    return None;
                }
                factor[i][i] = rest.sqrt();
            } else {
                factor[i][j] = rest / factor[j][j];
            }
        }
    }
    Some(factor)
}

/// Inverse of a lower triangular matrix.
fn inverse_of_lower(factor: &[[f64; N]; N]) -> [[f64; N]; N] {
    let mut inverse = [[0.0; N]; N];
    for j in 0..N {
        inverse[j][j] = 1.0 / factor[j][j];
        for i in j + 1..N {
            let sum: f64 = (j..i).map(|k| factor[i][k] * inverse[k][j]).sum();
            inverse[i][j] = -sum / factor[i][i];
        }
    }
    inverse
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums over a 5 x 5 window of constraints with normals in three directions that fulfil an
    /// affine flow exactly.
    fn window(affine: [f64; 6], directions: &[f64]) -> [[f64; 8]; 6] {
        let mut sums = [[0.0; 8]; 6];
        for (dy, dx) in (-2..=2).flat_map(|y| (-2..=2).map(move |x| (f64::from(y), f64::from(x)))) {
            for angle in directions {
                let (ny, nx) = angle.sin_cos();
                let [u, ux, uy, v, vx, vy] = affine;
                let s = nx * (u + ux * dx + uy * dy) + ny * (v + vx * dx + vy * dy);
                let maps = [nx * nx, nx * ny, ny * ny, s * nx, s * ny, s * s, 1.0, 1.0];
                for (sum, z) in sums.iter_mut().zip([1.0, dx, dy, dx * dx, dx * dy, dy * dy]) {
                    sum.iter_mut().zip(maps).for_each(|(sum, map)| *sum += z * map);
                }
            }
        }
        sums
    }

    #[test]
    fn exact_constraints_are_solved_exactly() {
        let fit = solve(&window([1.5, 0.1, -0.2, -0.7, 0.05, 0.3], &[0.0, 1.0, 2.1])).unwrap();
        assert!((fit.flow[0] - 1.5).abs() < 1e-12 && (fit.flow[1] + 0.7).abs() < 1e-12);
        assert!(fit.residual < 1e-6, "rounding of a difference of squares");
        // Offsets of rms sqrt 2 px beside 1: eigenvalues 1, 2, 2 in ratio, hardly tilted.
        assert!(fit.condition > 1.0 && fit.condition < 1.3);
    }

    #[test]
    fn one_direction_holds_no_flow() {
        assert!(solve(&window([1.0, 0.0, 0.0, 0.0, 0.0, 0.0], &[0.4])).is_none());
        assert!(solve(&[[0.0; 8]; 6]).is_none());
    }
}
