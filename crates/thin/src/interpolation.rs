//! Virtual points: displacements between points, as weights on the points around.
//!
//! # Equations
//! Quadratic moving least squares: the weights of least `Σ w²/g` that reproduce 1, x, y, x², xy, y², with `g = exp(−r²/h²)`: at least nine
//! points. The curvature of a pair with such an end is exact for every quadratic field. Barycentric weights reproduce linear fields;
//! their error h² κ is of the order of the deflection ξ² κ that a pair measures, so energies of bending are 10 to 50 % wrong whatever the
//! spacing. They serve for comparison, and for membrane data.
//!
//! # Source
//! O'Grady 2014, 5.2.2, (5.2)–(5.3), for barycentric weights and the nearest point.

use crate::frame::{V3, cross, dot, norm, sub};
use crate::weights::symmetric_eigen;
use std::f64::consts::PI;

/// How a virtual point follows the points around.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Interpolation {
    /// Quadratic moving least squares. The default.
    #[default]
    Quadratic,
    /// Barycentric weights of the three nearest points that are not nearly on a line; inconsistent for bending.
    Barycentric,
    /// The nearest point; inconsistent for bending.
    Nearest,
}

/// Barycentric weights of a place X, or of its projection onto the plane of A, B and C (thesis (5.2)–(5.3)):
/// `W′_A = ½ (B − X)·[BC × (BC × BA)/|BC × BA|]`, normalised.
///
/// `None` where the area is less than a twentieth of the square of the longest side: weights of nearly collinear points are useless.
pub fn barycentric(a: &[f64; 3], b: &[f64; 3], c: &[f64; 3], x: &[f64; 3]) -> Option<[f64; 3]> {
    let part = |a: &V3, b: &V3, c: &V3| {
        let (bc, ba) = (sub(c, b), sub(a, b));
        let across = cross(&bc, &ba);
        let size = norm(&across);
        let inward = cross(&bc, &across.map(|v| v / size));
        0.5 * dot(&sub(b, x), &inward)
    };
    let longest = [sub(b, a), sub(c, b), sub(a, c)].iter().map(norm).fold(0.0f64, f64::max);
    let area = 0.5 * norm(&cross(&sub(b, a), &sub(c, a)));
    if (0.05 * longest * longest).total_cmp(&area).is_ge() {
        return None;
    }
    let w = [part(a, b, c), part(b, c, a), part(c, a, b)];
    let sum: f64 = w.iter().sum();
    Some(w.map(|w| w / sum))
}

/// A point near a place: its number and its coordinates in the tangent plane.
pub(crate) type Near = (u32, [f64; 2]);

/// Whether a place in the tangent plane lies among the points: in no direction are there none within two spacings over more than a
/// half-turn, but for what a curved edge takes from straight pairs.
pub(crate) fn inside(dimension: usize, at: &[f64; 2], near: &[Near], spacing: f64) -> bool {
    let slack = 0.3;
    if dimension == 1 {
        let (mut below, mut above) = (false, false);
        for (_, x) in near {
            below |= x[0] <= at[0] + 1e-9 * spacing;
            above |= x[0] >= at[0] - 1e-9 * spacing;
        }
        return below && above;
    }
    let mut angles: Vec<f64> = vec![];
    for (_, x) in near {
        let d = [x[0] - at[0], x[1] - at[1]];
        let r = d[0].hypot(d[1]);
        if r <= 1e-6 * spacing {
            return true;
        }
        if r <= 2.0 * spacing {
            angles.push(d[1].atan2(d[0]));
        }
    }
    if angles.len() < 3 {
        return false;
    }
    angles.sort_unstable_by(f64::total_cmp);
    let last = angles[0] + 2.0 * PI - angles[angles.len() - 1];
    angles.windows(2).fold(last, |m, w| m.max(w[1] - w[0])) <= PI + slack
}

/// Weights of the points near a place; false where they do not suffice.
pub(crate) fn weights(
    kind: Interpolation,
    dimension: usize,
    at: &[f64; 2],
    near: &[Near],
    spacing: f64,
    order: &mut Vec<(f64, usize)>,
    out: &mut Vec<(u32, f64)>,
) -> bool {
    out.clear();
    order.clear();
    // rounded, so that the order of points at one distance is that of their numbers on every machine
    order.extend(near.iter().enumerate().map(|(k, (_, x))| {
        let r = ((x[0] - at[0]) / spacing).hypot((x[1] - at[1]) / spacing);
        ((r * 1e9).round() * 1e-9, k)
    }));
    order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(near[a.1].0.cmp(&near[b.1].0)));
    match kind {
        Interpolation::Nearest => order.first().is_some_and(|o| {
            out.push((near[o.1].0, 1.0));
            true
        }),
        Interpolation::Barycentric if dimension == 1 => {
            let Some(&(_, first)) = order.first() else { return false };
            let x = |k: usize| near[k].1[0];
            let Some(&(_, second)) = order.iter().find(|o| (x(o.1) - x(first)).abs() > 0.1 * spacing) else { return false };
            let share = (at[0] - x(first)) / (x(second) - x(first));
            out.extend([(near[first].0, 1.0 - share), (near[second].0, share)]);
            true
        }
        Interpolation::Barycentric => {
            let lift = |k: usize| [near[k].1[0], near[k].1[1], 0.0];
            let reach = order.len().min(8);
            // triples in the order of their farthest point
            for c in 2..reach {
                for b in 1..c {
                    for a in 0..b {
                        let [p, q, r] = [order[a].1, order[b].1, order[c].1];
                        if let Some(w) = barycentric(&lift(p), &lift(q), &lift(r), &[at[0], at[1], 0.0]) {
                            out.extend([(near[p].0, w[0]), (near[q].0, w[1]), (near[r].0, w[2])]);
                            return true;
                        }
                    }
                }
            }
            false
        }
        Interpolation::Quadratic if dimension == 1 => {
            [4, 5, 6, 8].into_iter().any(|count| least_norm::<3>(at, near, spacing, order, count, out, |x, _| [1.0, x, x * x]))
        }
        Interpolation::Quadratic => [9, 12, 16, 24, 32]
            .into_iter()
            .any(|count| least_norm::<6>(at, near, spacing, order, count, out, |x, y| [1.0, x, y, x * x, x * y, y * y])),
    }
}

/// Weights on the first `count` points that reproduce the basis, of least weighted norm.
fn least_norm<const N: usize>(
    at: &[f64; 2],
    near: &[Near],
    spacing: f64,
    order: &[(f64, usize)],
    count: usize,
    out: &mut Vec<(u32, f64)>,
    basis: impl Fn(f64, f64) -> [f64; N],
) -> bool {
    if order.len() < count {
        return false;
    }
    // those as far as the last come along, so that symmetric clouds have symmetric weights
    let mut count = count;
    while count < order.len() && order[count].0 <= order[count - 1].0 + 1e-6 {
        count += 1;
    }
    let rows: Vec<([f64; N], f64)> = order[..count]
        .iter()
        .map(|&(r, k)| {
            let x = near[k].1;
            (basis((x[0] - at[0]) / spacing, (x[1] - at[1]) / spacing), (-r * r).exp())
        })
        .collect();
    let mut matrix = vec![0.0; N * N];
    for (p, g) in &rows {
        for i in 0..N {
            (0..N).for_each(|j| matrix[i * N + j] += g * p[i] * p[j]);
        }
    }
    let (values, vectors) = symmetric_eigen(&mut matrix, N);
    let top = values.iter().fold(0.0f64, |m, v| m.max(*v));
    if values.iter().any(|v| *v <= 1e-5 * top) {
        return false;
    }
    let mut weights = vec![0.0; count];
    // the basis at the place is (1, 0, …); a second pass takes rounding away
    for _ in 0..2 {
        let mut rest = [0.0; N];
        rest[0] = 1.0;
        for ((p, _), w) in rows.iter().zip(&weights) {
            (0..N).for_each(|i| rest[i] -= w * p[i]);
        }
        let mut lambda = [0.0; N];
        for k in 0..N {
            let share: f64 = (0..N).map(|i| vectors[i * N + k] * rest[i]).sum::<f64>() / values[k];
            (0..N).for_each(|i| lambda[i] += vectors[i * N + k] * share);
        }
        for ((p, g), w) in rows.iter().zip(&mut weights) {
            *w += g * (0..N).map(|i| p[i] * lambda[i]).sum::<f64>();
        }
    }
    // far outside the points weights grow without bound
    if weights.iter().map(|w| w.abs()).sum::<f64>() > 12.0 {
        return false;
    }
    out.extend(order[..count].iter().zip(&weights).map(|(o, w)| (near[o.1].0, *w)));
    true
}

/// Weights of both components of the gradient at the origin, for bonds to points: exact for linear fields, and where `quadratic` for quadratic
/// ones; `None` where the bonds do not suffice. Units 1/length.
pub(crate) fn gradient(dimension: usize, near: &[Near], spacing: f64, quadratic: bool) -> Option<Vec<[f64; 2]>> {
    fn solve<const N: usize>(near: &[Near], spacing: f64, basis: impl Fn(f64, f64) -> [f64; N], two: bool) -> Option<Vec<[f64; 2]>> {
        if near.len() < N {
            return None;
        }
        let rows: Vec<([f64; N], f64)> = near
            .iter()
            .map(|(_, x)| {
                let (x, y) = (x[0] / spacing, x[1] / spacing);
                (basis(x, y), 1.0 / (1.0 + x * x + y * y))
            })
            .collect();
        let mut matrix = vec![0.0; N * N];
        for (p, g) in &rows {
            for i in 0..N {
                (0..N).for_each(|j| matrix[i * N + j] += g * p[i] * p[j]);
            }
        }
        let (values, vectors) = symmetric_eigen(&mut matrix, N);
        let top = values.iter().fold(0.0f64, |m, v| m.max(*v));
        if values.iter().any(|v| *v <= 1e-4 * top) {
            return None;
        }
        let lambda = |which: usize| {
            let mut l = [0.0; N];
            for k in 0..N {
                let share = vectors[which * N + k] / values[k];
                (0..N).for_each(|i| l[i] += vectors[i * N + k] * share);
            }
            l
        };
        let (a, b) = (lambda(0), if two { lambda(1) } else { [0.0; N] });
        let of = |p: &[f64; N], l: &[f64; N]| (0..N).map(|i| p[i] * l[i]).sum::<f64>() / spacing;
        Some(rows.iter().map(|(p, g)| [g * of(p, &a), g * of(p, &b)]).collect())
    }
    match (dimension, quadratic) {
        (1, true) => solve::<2>(near, spacing, |x, _| [x, x * x], false),
        (1, false) => solve::<1>(near, spacing, |x, _| [x], false),
        (_, true) => solve::<5>(near, spacing, |x, y| [x, y, x * x, x * y, y * y], true),
        (_, false) => solve::<2>(near, spacing, |x, y| [x, y], true),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cloud: a lattice of spacing 1 moved by fixed irregular amounts.
    fn cloud() -> Vec<Near> {
        (0..49u32)
            .map(|k| {
                let (i, j) = (f64::from(k % 7) - 3.0, f64::from(k / 7) - 3.0);
                (k, [i + 0.25 * (7.0 * i + 3.0 * j).sin(), j + 0.25 * (5.0 * j - 2.0 * i).cos()])
            })
            .collect()
    }

    #[test]
    fn reproduction() {
        let near = cloud();
        let (mut order, mut out) = (vec![], vec![]);
        let at = [0.37, -0.61];
        let moment = |out: &[(u32, f64)], i: i32, j: i32| -> f64 {
            out.iter().map(|(k, w)| w * near[*k as usize].1[0].powi(i) * near[*k as usize].1[1].powi(j)).sum()
        };
        for (kind, order_of) in [(Interpolation::Nearest, 0), (Interpolation::Barycentric, 1), (Interpolation::Quadratic, 2)] {
            assert!(weights(kind, 2, &at, &near, 1.0, &mut order, &mut out));
            for (i, j) in [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)] {
                let error = (moment(&out, i, j) - at[0].powi(i) * at[1].powi(j)).abs();
                if i + j <= order_of {
                    assert!(error < 1e-13, "{kind:?} {i} {j}: {error}");
                } else if i != j {
                    assert!(error > 1e-3, "{kind:?} {i} {j}: {error}");
                }
            }
        }
    }

    #[test]
    fn gradients() {
        let near: Vec<Near> = cloud().into_iter().filter(|(_, x)| x[0].hypot(x[1]) < 2.2).collect();
        for quadratic in [false, true] {
            let g = gradient(2, &near, 1.0, quadratic).unwrap();
            let sum = |f: &dyn Fn([f64; 2]) -> f64, c: usize| near.iter().zip(&g).map(|((_, x), g)| g[c] * f(*x)).sum::<f64>();
            assert!((sum(&|x| x[0], 0) - 1.0).abs() < 1e-13 && sum(&|x| x[1], 0).abs() < 1e-13);
            assert!((sum(&|x| x[1], 1) - 1.0).abs() < 1e-13 && sum(&|x| x[0], 1).abs() < 1e-13);
            assert!((sum(&|x| x[0] * x[1], 0).abs() < 1e-13) == quadratic);
        }
    }

    #[test]
    fn barycentric_weights() {
        // projection onto the plane of the points, and extrapolation
        let (a, b, c) = ([0.0, 0.0, 0.3], [1.0, 0.1, 0.3], [0.2, 0.9, 0.3]);
        let x = [1.5, -0.4, 0.9];
        let w = barycentric(&a, &b, &c, &x).unwrap();
        assert!((w.iter().sum::<f64>() - 1.0).abs() < 1e-15);
        for k in 0..2 {
            assert!((w[0] * a[k] + w[1] * b[k] + w[2] * c[k] - x[k]).abs() < 1e-14);
        }
        assert_eq!(barycentric(&a, &b, &[2.0, 0.21, 0.3], &x), None);
    }
}
