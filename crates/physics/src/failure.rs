//! Calibration of bond breaking: critical stretch and critical bond energy of a fracture energy G_c.
//!
//! A crack breaks every bond that crosses its plane. Per unit area of the plane that is
//! `G = ∫_{ξ·n>0} (ξ·n) w₀(ξ) dV′`, with w₀ the energy of a pair per volume squared at breaking (both halves, each pair
//! once). On a lattice the integral is the sum over the family; the average over orientations is the rule for clouds.

use crate::elasticity::Section;
use std::f64::consts::PI;

/// The orientation of the crack planes a calibration holds for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CrackPlane {
    /// Normal to the given unit vector.
    Normal([f64; 3]),
    /// Averaged over all orientations in the dimension of the body.
    Average,
}

/// `∫_{ξ·n>0} (ξ·n) w(ξ) dV′` over a family given by bonds (ξ, V′), w a function of the bond's index.
pub fn crossing_energy(bonds: &[([f64; 3], f64)], dimension: usize, plane: CrackPlane, w: impl Fn(usize) -> f64) -> f64 {
    bonds
        .iter()
        .enumerate()
        .map(|(k, (xi, volume))| {
            let depth = match plane {
                CrackPlane::Normal(n) => (xi[0] * n[0] + xi[1] * n[1] + xi[2] * n[2]).max(0.0),
                CrackPlane::Average => {
                    // mean of the positive part of ξ·n over the unit sphere of the dimension
                    let length = (xi[0] * xi[0] + xi[1] * xi[1] + xi[2] * xi[2]).sqrt();
                    length * [0.5, 1.0 / PI, 0.25][dimension - 1]
                }
            };
            depth * volume * w(k)
        })
        .sum()
}

/// Critical stretch s₀ of the bond-based solid in a continuum with ω = 1.
pub fn continuum_critical_stretch(fracture_energy: f64, young: f64, bulk: f64, delta: f64, section: Section) -> f64 {
    let g = fracture_energy;
    match section {
        Section::Bar { .. } => (3.0 * g / (young * delta)).sqrt(),
        Section::PlaneStress { .. } => (4.0 * PI * g / (9.0 * young * delta)).sqrt(),
        Section::PlaneStrain { .. } => (5.0 * PI * g / (12.0 * young * delta)).sqrt(),
        Section::Solid => (5.0 * g / (9.0 * bulk * delta)).sqrt(),
    }
}

/// Critical bond energy w_c \[J/m⁶\] in a continuum: the same for every bond.
pub fn continuum_critical_bond_energy(fracture_energy: f64, delta: f64, section: Section) -> f64 {
    let g = fracture_energy;
    match section {
        Section::Bar { area } => 2.0 * g / (area * delta.powi(2)),
        Section::PlaneStress { thickness } | Section::PlaneStrain { thickness } => 3.0 * g / (2.0 * thickness * delta.powi(3)),
        Section::Solid => 4.0 * g / (PI * delta.powi(4)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A family on a fine lattice approaches the continuum.
    fn fine_family(dimension: usize, n: i32) -> Vec<([f64; 3], f64)> {
        let dx = 1.0 / (n as f64 + 0.5);
        let range = |on: bool| if on { -n..=n } else { 0..=0 };
        let mut bonds = vec![];
        for a in range(true) {
            for b in range(dimension > 1) {
                for c in range(dimension > 2) {
                    let xi = [a, b, c].map(|k| k as f64 * dx);
                    let r2: f64 = xi.iter().map(|x| x * x).sum();
                    if r2 > 0.0 && r2 <= 1.0 {
                        bonds.push((xi, dx.powi(dimension as i32)));
                    }
                }
            }
        }
        bonds
    }

    #[test]
    fn sums_over_fine_families_are_the_continuum_relations() {
        let sections = [Section::Bar { area: 1.0 }, Section::PlaneStress { thickness: 1.0 }, Section::Solid];
        for (section, n) in sections.into_iter().zip([4000, 300, 40]) {
            let d = section.dimension();
            let bonds = fine_family(d, n);
            for plane in [CrackPlane::Normal([1.0, 0.0, 0.0]), CrackPlane::Average] {
                let per_energy = crossing_energy(&bonds, d, plane, |_| 1.0);
                let ratio = 1.0 / per_energy / continuum_critical_bond_energy(1.0, 1.0, section);
                assert!((ratio - 1.0).abs() < 0.02, "{section:?} {plane:?} {ratio}");
            }
        }
    }

    #[test]
    fn lattice_over_continuum_of_the_literature_ratios() {
        // axis-aligned crack in 3D: 1.119 at 3.015 Δx, 0.896 at 4.015 Δx (bond-based: w₀ ∝ |ξ|)
        for (m, want) in [(3.015f64, 1.119), (4.015, 0.896), (5.015, 0.951)] {
            let mut bonds = vec![];
            let n = m as i32;
            for a in -n..=n {
                for b in -n..=n {
                    for c in -n..=n {
                        let xi = [a as f64, b as f64, c as f64];
                        let r = (a * a + b * b + c * c) as f64;
                        if r > 0.0 && r.sqrt() <= m {
                            bonds.push((xi, 1.0));
                        }
                    }
                }
            }
            let length = |k: usize| bonds[k].0.iter().map(|x| x * x).sum::<f64>().sqrt();
            let sum = crossing_energy(&bonds, 3, CrackPlane::Normal([0.0, 0.0, 1.0]), length);
            let ratio = sum / (PI * m.powi(5) / 5.0);
            assert!((ratio - want).abs() < 6e-4, "{m} {ratio}");
        }
    }
}
