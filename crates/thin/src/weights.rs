//! Weights of the pairs and bonds of plates.

/// Influence function ω(|ξ|), in any unit: only ratios count.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum Influence {
    /// ω = 1.
    #[default]
    Constant,
    /// ω = |ξ|.
    Linear,
    /// ω = 1/|ξ|.
    Inverse,
    /// ω = 1 − |ξ|/δ.
    Conical,
}

impl Influence {
    /// ω at a length, for a horizon.
    pub fn at(&self, length: f64, horizon: f64) -> f64 {
        match self {
            Influence::Constant => 1.0,
            Influence::Linear => length / horizon,
            Influence::Inverse => horizon / length,
            Influence::Conical => (1.0 - length / horizon).max(0.0),
        }
    }
}

/// Result of the fourth-moment correction of a family.
#[derive(Clone, Debug, PartialEq)]
pub struct Correction {
    /// Factor of each weight.
    pub factors: Vec<f64>,
    /// Smallest factor.
    pub least: f64,
    /// Whether the fourth moments are those of an isotropic family now.
    pub feasible: bool,
}

/// The fourth-moment correction: factors `s_j = 1 + q_j·λ` that make `Σ A_j s_j n n n n` isotropic, `A_j = ω_j V_j ξ_j²`, `q = (c⁴, c³s, c²s²,
/// cs³, s⁴)`. The energy of every uniform curvature, and of every uniform strain, is then exact.
pub fn fourth_moment_correction(directions: &[[f64; 2]], a: &[f64]) -> Correction {
    let q: Vec<[f64; 5]> = directions.iter().map(|[c, s]| [c.powi(4), c.powi(3) * s, c * c * s * s, c * s.powi(3), s.powi(4)]).collect();
    let total: f64 = a.iter().sum();
    let mut matrix = vec![0.0; 25];
    let mut target = [3.0 / 8.0, 0.0, 1.0 / 8.0, 0.0, 3.0 / 8.0].map(|x| x * total);
    let wanted = target;
    for (q, a) in q.iter().zip(a) {
        for i in 0..5 {
            target[i] -= a * q[i];
            for j in 0..5 {
                matrix[i * 5 + j] += a * q[i] * q[j];
            }
        }
    }
    let (values, vectors) = symmetric_eigen(&mut matrix, 5);
    let top = values.iter().fold(0.0f64, |m, v| m.max(*v));
    let mut lambda = [0.0; 5];
    for k in 0..5 {
        // pseudo-inverse: directions that the family does not see stay as they are
        if values[k] > 1e-10 * top {
            let share: f64 = (0..5).map(|i| vectors[i * 5 + k] * target[i]).sum::<f64>() / values[k];
            (0..5).for_each(|i| lambda[i] += vectors[i * 5 + k] * share);
        }
    }
    let factors: Vec<f64> = q.iter().map(|q| 1.0 + (0..5).map(|i| q[i] * lambda[i]).sum::<f64>()).collect();
    let mut reached = [0.0; 5];
    for ((q, a), s) in q.iter().zip(a).zip(&factors) {
        (0..5).for_each(|i| reached[i] += a * s * q[i]);
    }
    let feasible = (0..5).all(|i| (reached[i] - wanted[i]).abs() <= 1e-9 * total);
    let least = factors.iter().fold(f64::INFINITY, |m, s| m.min(*s));
    Correction { factors, least, feasible }
}

/// Eigenvalues and eigenvectors (columns) of a small symmetric matrix, row-major, by Jacobi's rotations. The matrix is used up.
pub fn symmetric_eigen(a: &mut [f64], n: usize) -> (Vec<f64>, Vec<f64>) {
    let mut v = vec![0.0; n * n];
    (0..n).for_each(|k| v[k * n + k] = 1.0);
    for _ in 0..60 {
        let off: f64 = (0..n).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| a[i * n + j] * a[i * n + j]).sum();
        let diagonal: f64 = (0..n).map(|i| a[i * n + i] * a[i * n + i]).sum();
        if off <= 1e-32 * diagonal || off == 0.0 {
            break;
        }
        for p in 0..n {
            for q in p + 1..n {
                let apq = a[p * n + q];
                if apq == 0.0 {
                    continue;
                }
                let theta = (a[q * n + q] - a[p * n + p]) / (2.0 * apq);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let t = if theta == 0.0 { 1.0 } else { t };
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for k in 0..n {
                    let (x, y) = (a[k * n + p], a[k * n + q]);
                    (a[k * n + p], a[k * n + q]) = (c * x - s * y, s * x + c * y);
                }
                for k in 0..n {
                    let (x, y) = (a[p * n + k], a[q * n + k]);
                    (a[p * n + k], a[q * n + k]) = (c * x - s * y, s * x + c * y);
                }
                for k in 0..n {
                    let (x, y) = (v[k * n + p], v[k * n + q]);
                    (v[k * n + p], v[k * n + q]) = (c * x - s * y, s * x + c * y);
                }
            }
        }
    }
    ((0..n).map(|k| a[k * n + k]).collect(), v)
}
