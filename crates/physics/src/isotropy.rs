//! Fourth-moment weights: factors on the influence of a family that make the energy of every uniform infinitesimal strain
//! isotropic, and so equal to that of the classical solid.
//!
//! # Equations
//! A uniform strain ε extends a bond of direction n by |ξ| n·εn. With `A = ω V′ |ξ|ᵖ` (p = 1 for the bond-based solid, whose
//! energy goes with ω |ξ| s²; p = 2 for the linear peridynamic solid, with ω e²) the energy depends on the family through
//! the moments `Σ A n⊗n⊗n⊗n` alone. In a ball of a continuum they are isotropic; in a lattice family or a cloud they are not:
//! that is the lattice anisotropy of these models. The factors solve
//!
//! $$ \sum_j A_j s_j\, q(n_j) = \Big(\sum_j A_j\Big) \langle q \rangle, \qquad s_j = 1 + q(n_j)\cdot\lambda $$
//!
//! with the quartic monomials q of n (5 in the plane, 15 in space; 1 on a line, where nothing is left to correct) and
//! their averages ⟨q⟩ over directions: 3/(d(d+2)) for n₁⁴, 1/(d(d+2)) for n₁²n₂², 0 for odd ones. Of all solutions these
//! have the least `Σ A (s − 1)²`. Because `|n|⁴ = |n|² = 1`, `Σ A` and `Σ A n⊗n = (Σ A) 1/d` come along: weighted volume and
//! micromodulus stay, the dilatation becomes exact in every strain.
//!
//! # Source
//! The condition is the isotropy of fourth-order tensors; the bond-multiple plate of O'Grady (2014), eq. (4.12), needs the
//! same moments.
//!
//! # Fails when
//! the bonds have too few directions (the nearest neighbours of a square lattice: no shear stiffness to scale), or a
//! family is so lopsided, as at a corner, that a factor would come close to zero or below.

use crate::scalar::array;
use crate::tensor::{Vector, symmetric_eigen};

/// Smallest factor that is accepted: below, a bond hardly acts, and a negative one would destabilise.
pub const SMALLEST_FACTOR: f64 = 0.1;
/// Largest residual of the moment conditions, relative to Σ A.
pub const LARGEST_RESIDUAL: f64 = 1e-9;
/// Eigenvalue of the Gram matrix, relative to the largest, below which its direction is not resolved by the bonds.
const UNRESOLVED: f64 = 1e-12;

/// Exponents of the quartic monomials in `D` variables.
fn quartics<const D: usize>() -> Vec<[u32; 3]> {
    let mut list = vec![];
    for a in 0..=4u32 {
        for b in 0..=4 - a {
            let e = [a, b, 4 - a - b];
            // absent directions have exponent 0
            if e[D.min(3)..].iter().all(|&x| x == 0) {
                list.push(e);
            }
        }
    }
    list
}

/// Factors s of the influences of a family's bonds, given as (ξ, ωV′), for the power p of |ξ| in A = ωV′|ξ|ᵖ. They depend on
/// the directions of the bonds and on A only. `None` where the family cannot be corrected: the moment conditions cannot be
/// met to [`LARGEST_RESIDUAL`], or a factor falls below [`SMALLEST_FACTOR`].
pub fn fourth_moment_factors<const D: usize>(bonds: &[(Vector<f64, D>, f64)], power: i32) -> Option<Vec<f64>> {
    let exponents = quartics::<D>();
    let size = exponents.len();
    // √(multinomial) makes the scalar product of two monomial vectors (n·m)⁴: the numbers do not depend on the axes
    let factorial = |k: u32| (1..=k).product::<u32>() as f64;
    let scale: Vec<f64> = exponents.iter().map(|e| (24.0 / e.iter().map(|&k| factorial(k)).product::<f64>()).sqrt()).collect();
    let average = |e: &[u32; 3]| {
        if e.iter().any(|k| k % 2 == 1) {
            return 0.0;
        }
        e.iter().map(|&k| if k == 4 { 3.0 } else { 1.0 }).product::<f64>() / (D * (D + 2)) as f64
    };
    let target: Vec<f64> = exponents.iter().zip(&scale).map(|(e, c)| c * average(e)).collect();

    let mut monomials = Vec::with_capacity(bonds.len() * size);
    let mut share = Vec::with_capacity(bonds.len());
    for (xi, weight) in bonds {
        let length = xi.norm();
        share.push(weight * length.powi(power));
        let n: [f64; D] = array(|k| xi.0[k] / length);
        for (e, c) in exponents.iter().zip(&scale) {
            monomials.push(c * (0..D).map(|k| n[k].powi(e[k] as i32)).product::<f64>());
        }
    }
    let total: f64 = share.iter().sum();
    // written so that a NaN is refused
    if !(total > 0.0 && total.is_finite()) {
        return None;
    }
    share.iter_mut().for_each(|a| *a /= total);

    let mut gram = vec![0.0; size * size];
    for (a, q) in share.iter().zip(monomials.chunks(size)) {
        for i in 0..size {
            for j in 0..size {
                gram[i * size + j] += a * q[i] * q[j];
            }
        }
    }
    let (values, vectors) = symmetric_eigen(&gram, size);
    let mut factors = vec![1.0; bonds.len()];
    let missing = |factors: &[f64]| {
        let mut r = target.clone();
        for ((a, s), q) in share.iter().zip(factors).zip(monomials.chunks(size)) {
            for k in 0..size {
                r[k] -= a * s * q[k];
            }
        }
        r
    };
    // the second round removes the round-off of the first
    for _ in 0..2 {
        let residual = missing(&factors);
        for (value, vector) in values.iter().zip(vectors.chunks(size)) {
            if *value <= UNRESOLVED * values[size - 1] {
                continue;
            }
            let along = vector.iter().zip(&residual).map(|(v, r)| v * r).sum::<f64>() / value;
            for (s, q) in factors.iter_mut().zip(monomials.chunks(size)) {
                *s += along * vector.iter().zip(q).map(|(v, q)| v * q).sum::<f64>();
            }
        }
    }
    let met = missing(&factors).iter().all(|r| r.abs() <= LARGEST_RESIDUAL);
    (met && factors.iter().all(|s| *s >= SMALLEST_FACTOR)).then_some(factors)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lattice<const D: usize>(ratio: f64) -> Vec<(Vector<f64, D>, f64)> {
        let n = ratio as i64;
        let side = (2 * n + 1) as usize;
        (0..side.pow(D as u32))
            .map(|q| Vector::<f64, D>(array(|k| (q / side.pow(k as u32) % side) as f64 - n as f64)))
            .filter(|x| x.norm() > 0.0 && x.norm() <= ratio)
            .map(|x| (x, 0.25))
            .collect()
    }
    fn range(s: &[f64]) -> (f64, f64) {
        s.iter().fold((f64::INFINITY, 0.0), |(a, b), &x| (a.min(x), b.max(x)))
    }

    #[test]
    fn known_factors_of_lattices() {
        // horizon ratio √2, p = 2: four axes of A = 1 and four diagonals of A = 2 (per V′). Their shares of n₁⁴ and n₁²n₂²,
        // 2s and 4t·½·… : Σ A s n₁⁴ = 2s + 2t = 12·3/8 and Σ A s n₁²n₂² = 2t = 12/8, so t = 3/4 and s = 3/2
        let s = fourth_moment_factors(&lattice::<2>(1.5), 2).unwrap();
        for ((xi, _), s) in lattice::<2>(1.5).iter().zip(&s) {
            let want = if xi.0[0] * xi.0[1] == 0.0 { 1.5 } else { 0.75 };
            assert!((s - want).abs() < 1e-13, "{xi:?} {s}");
        }
        // horizon ratio 3: between 0.95 and 1.05
        let (low, high) = range(&fourth_moment_factors(&lattice::<2>(3.0), 2).unwrap());
        assert!(low > 0.945 && low < 0.97 && high > 1.03 && high < 1.055, "{low} {high}");
    }

    #[test]
    fn fourth_moments_become_those_of_a_ball() {
        for power in [1, 2] {
            let bonds: Vec<_> =
                lattice::<3>(3.0).into_iter().map(|(x, w)| (Vector([x.0[0] + 0.1 * x.0[1], x.0[1], 1.1 * x.0[2]]), w)).collect();
            let s = fourth_moment_factors(&bonds, power).unwrap();
            let moment = |f: &dyn Fn([f64; 3]) -> f64| -> f64 {
                let part = |(x, w): &(Vector<f64, 3>, f64)| {
                    let r = x.norm();
                    (w * r.powi(power), f(x.0.map(|c| c / r)))
                };
                let total: f64 = bonds.iter().map(|b| part(b).0).sum();
                bonds.iter().zip(&s).map(|(b, s)| part(b).0 * s * part(b).1).sum::<f64>() / total
            };
            for (value, want) in [
                (moment(&|_| 1.0), 1.0),
                (moment(&|n| n[2] * n[2]), 1.0 / 3.0),
                (moment(&|n| n[0] * n[1]), 0.0),
                (moment(&|n| n[0].powi(4)), 0.2),
                (moment(&|n| (n[1] * n[2]).powi(2)), 1.0 / 15.0),
                (moment(&|n| n[0].powi(3) * n[2]), 0.0),
                (moment(&|n| n[0] * n[1] * n[2] * n[2]), 0.0),
            ] {
                assert!((value - want).abs() < 1e-14, "{power} {value} {want}");
            }
        }
    }

    #[test]
    fn units_do_not_matter_and_a_line_needs_nothing() {
        let scaled: Vec<_> = lattice::<2>(3.0).into_iter().map(|(x, w)| (x * 1e-9, w * 1e21)).collect();
        let (a, b) = (fourth_moment_factors(&lattice::<2>(3.0), 1).unwrap(), fourth_moment_factors(&scaled, 1).unwrap());
        assert!(a.iter().zip(&b).all(|(x, y)| (x - y).abs() < 1e-13));
        let line: Vec<_> = [-2.0, -1.0, 1.0].map(|x| (Vector([x]), 0.3)).to_vec();
        assert_eq!(fourth_moment_factors(&line, 2).unwrap(), [1.0; 3]);
    }

    #[test]
    fn families_that_cannot_be_corrected() {
        // nearest neighbours only: no bond feels the shear
        assert!(fourth_moment_factors(&lattice::<2>(1.0), 2).is_none());
        assert!(fourth_moment_factors(&lattice::<3>(1.0), 2).is_none());
        // a corner: the quadrant's diagonal would have to vanish against the mean of n₁n₂ = 0
        let corner: Vec<_> = lattice::<2>(3.0).into_iter().filter(|(x, _)| x.0[0] >= 0.0 && x.0[1] >= 0.0).collect();
        assert!(fourth_moment_factors(&corner, 2).is_none());
        assert!(fourth_moment_factors::<2>(&[], 2).is_none());
        assert!(fourth_moment_factors(&[(Vector([0.0, 0.0]), 1.0)], 2).is_none());
        assert!(fourth_moment_factors(&[(Vector([1.0, f64::NAN]), 1.0)], 2).is_none());
    }
}
