//! Elastic constants: from what an engineer types to the stiffness of a section.

use crate::scalar::{Scalar, array};
use crate::tensor::Matrix;

/// What lies across the dimensions that are not discretised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Section {
    /// A bar of the given cross-section, free to contract: uniaxial stress.
    Bar {
        /// Cross-section \[m²\].
        area: f64,
    },
    /// Plane strain, per the given thickness.
    PlaneStrain {
        /// Thickness \[m\].
        thickness: f64,
    },
    /// Plane stress.
    PlaneStress {
        /// Thickness \[m\].
        thickness: f64,
    },
    /// Three dimensions.
    Solid,
}

impl Section {
    /// Dimension of space.
    pub fn dimension(self) -> usize {
        match self {
            Section::Bar { .. } => 1,
            Section::PlaneStrain { .. } | Section::PlaneStress { .. } => 2,
            Section::Solid => 3,
        }
    }
    /// Area, thickness, or 1 in three dimensions: volume = measure × length, area or volume of a cell.
    pub fn measure(self) -> f64 {
        match self {
            Section::Bar { area } => area,
            Section::PlaneStrain { thickness } | Section::PlaneStress { thickness } => thickness,
            Section::Solid => 1.0,
        }
    }
    /// Number of transverse directions that are free of stress.
    pub fn free_directions(self) -> usize {
        match self {
            Section::Bar { .. } => 2,
            Section::PlaneStress { .. } => 1,
            Section::PlaneStrain { .. } | Section::Solid => 0,
        }
    }
}

/// Isotropic elastic constants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Isotropic {
    /// Young's modulus E \[Pa\].
    pub young: f64,
    /// Poisson's ratio ν.
    pub poisson: f64,
}

impl Isotropic {
    /// From bulk modulus k and shear modulus G.
    pub fn from_bulk_shear(bulk: f64, shear: f64) -> Self {
        Isotropic { young: 9.0 * bulk * shear / (3.0 * bulk + shear), poisson: (3.0 * bulk - 2.0 * shear) / (2.0 * (3.0 * bulk + shear)) }
    }
    /// Shear modulus G = μ.
    pub fn shear(self) -> f64 {
        self.young / (2.0 * (1.0 + self.poisson))
    }
    /// Bulk modulus k (three-dimensional).
    pub fn bulk(self) -> f64 {
        self.young / (3.0 * (1.0 - 2.0 * self.poisson))
    }
    /// Lamé's λ.
    pub fn lambda(self) -> f64 {
        self.young * self.poisson / ((1.0 + self.poisson) * (1.0 - 2.0 * self.poisson))
    }
    /// λ of the section: λ in plane strain and 3D, 2λμ/(λ + 2μ) in plane stress, 0 in a bar (whose modulus is E).
    pub fn lambda_of(self, section: Section) -> f64 {
        match section {
            Section::PlaneStress { .. } => self.young * self.poisson / (1.0 - self.poisson * self.poisson),
            _ => self.lambda(),
        }
    }
    /// The bulk modulus of the section: k in 3D, the area modulus λ + μ (plane strain) or E/(2(1 − ν)) (plane stress),
    /// E in a bar.
    pub fn bulk_of(self, section: Section) -> f64 {
        match section {
            Section::Bar { .. } => self.young,
            Section::PlaneStrain { .. } => self.lambda() + self.shear(),
            Section::PlaneStress { .. } => self.young / (2.0 * (1.0 - self.poisson)),
            Section::Solid => self.bulk(),
        }
    }
    /// The 6×6 stiffness (Voigt order 11, 22, 33, 23, 13, 12; engineering shear strains).
    pub fn voigt(self) -> [[f64; 6]; 6] {
        let (l, m) = (self.lambda(), self.shear());
        let mut c = [[0.0; 6]; 6];
        for a in 0..3 {
            for b in 0..3 {
                c[a][b] = l;
            }
            c[a][a] += 2.0 * m;
            c[a + 3][a + 3] = m;
        }
        c
    }
}

/// Engineering constants of an orthotropic material in its own axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orthotropic {
    /// E₁, E₂, E₃ \[Pa\].
    pub young: [f64; 3],
    /// G₂₃, G₁₃, G₁₂ \[Pa\].
    pub shear: [f64; 3],
    /// ν₂₃, ν₁₃, ν₁₂: strain in the second direction over the one in the first, under tension in the first.
    pub poisson: [f64; 3],
}

impl Orthotropic {
    /// Transversely isotropic about axis 1 (the fibre).
    pub fn transverse(parallel: f64, transverse: f64, nu_parallel: f64, nu_transverse: f64, shear_parallel: f64) -> Self {
        Orthotropic {
            young: [parallel, transverse, transverse],
            shear: [transverse / (2.0 * (1.0 + nu_transverse)), shear_parallel, shear_parallel],
            poisson: [nu_transverse, nu_parallel, nu_parallel],
        }
    }
    /// The 6×6 stiffness, `None` where the constants are not those of a stable material.
    pub fn voigt(self) -> Option<[[f64; 6]; 6]> {
        let [e1, e2, e3] = self.young;
        let [n23, n13, n12] = self.poisson;
        let compliance = [[1.0 / e1, -n12 / e1, -n13 / e1], [-n12 / e1, 1.0 / e2, -n23 / e2], [-n13 / e1, -n23 / e2, 1.0 / e3]];
        let c = Matrix(compliance).inverse_if_regular(0.0)?.0;
        let mut v = [[0.0; 6]; 6];
        for a in 0..3 {
            for b in 0..3 {
                v[a][b] = c[a][b];
            }
            if self.shear[a].is_nan() || self.shear[a] <= 0.0 {
                return None;
            }
            v[a + 3][a + 3] = self.shear[a];
        }
        Some(v)
    }
}

/// Index pairs of the Voigt order.
const PAIRS: [[(usize, usize); 6]; 3] =
    [[(0, 0); 6], [(0, 0), (1, 1), (0, 1), (0, 0), (0, 0), (0, 0)], [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]];

/// Stiffness, given in the axes of the material, in the axes of space. `axes[k]` is the unit vector of material axis `k` in
/// space.
pub fn rotate(c: &[[f64; 6]; 6], axes: &[[f64; 3]; 3]) -> [[f64; 6]; 6] {
    // bond matrix M of stress: σ′ = M σ; C′ = M C Mᵀ
    let r = |i: usize, k: usize| axes[k][i];
    let m: [[f64; 6]; 6] = array(|a| {
        let (i, j) = PAIRS[2][a];
        array(|b| {
            let (k, l) = PAIRS[2][b];
            if k == l { r(i, k) * r(j, k) } else { r(i, k) * r(j, l) + r(i, l) * r(j, k) }
        })
    });
    let mc: [[f64; 6]; 6] = array(|a| array(|b| (0..6).map(|k| m[a][k] * c[k][b]).sum()));
    array(|a| array(|b| (0..6).map(|k| mc[a][k] * m[b][k]).sum()))
}

/// The linear elastic stiffness of a section, thermal stress included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stiffness<const D: usize> {
    /// C in Voigt order (1D: 11; 2D: 11, 22, 12; 3D: 11, 22, 33, 23, 13, 12), engineering shear strains \[Pa\].
    pub voigt: [[f64; 6]; 6],
    /// Stress per unit temperature change at no strain, with opposite sign: β = C:α \[Pa/K\].
    pub thermal: [f64; 6],
    /// α:C:α of the section: the energy that free expansion needs to be free \[Pa/K²\].
    pub thermal_energy: f64,
    /// σ₃₃ as a combination of (σ₁₁, σ₂₂, σ₁₂): plane strain only.
    pub out_of_plane: [f64; 3],
    /// Fall of σ₃₃ per unit temperature change at no stress within the plane: plane strain only \[Pa/K\].
    pub out_of_plane_thermal: f64,
    /// Isotropic constants of the same Voigt average: strength of zero-energy control.
    pub average: Isotropic,
    /// The section.
    pub section: Section,
}

impl<const D: usize> Stiffness<D> {
    /// From a three-dimensional stiffness (already in the axes of space) and thermal expansion (Voigt, α₁₁ … 2α₁₂).
    pub fn new(c: &[[f64; 6]; 6], expansion: &[f64; 6], section: Section) -> Self {
        assert_eq!(D, section.dimension(), "section and dimension are chosen together");
        // which of the six strains stay, and which are condensed because their stress vanishes
        let (kept, condensed): (&[usize], &[usize]) = match section {
            Section::Bar { .. } => (&[0], &[1, 2, 3, 4, 5]),
            Section::PlaneStress { .. } => (&[0, 1, 5], &[2, 3, 4]),
            Section::PlaneStrain { .. } => (&[0, 1, 5], &[]),
            Section::Solid => (&[0, 1, 2, 3, 4, 5], &[]),
        };
        let mut a = *c;
        let mut beta: [f64; 6] = array(|i| (0..6).map(|k| c[i][k] * expansion[k]).sum());
        let mut energy: f64 = (0..6).map(|k| beta[k] * expansion[k]).sum();
        // Gauss elimination of the condensed strains: the Schur complement, of the thermal stress too
        for &p in condensed {
            let pivot = a[p][p];
            energy -= beta[p] * beta[p] / pivot;
            let row = a[p];
            let bp = beta[p];
            for i in 0..6 {
                let f = a[i][p] / pivot;
                if i != p {
                    for j in 0..6 {
                        a[i][j] -= f * row[j];
                    }
                    beta[i] -= f * bp;
                }
            }
        }
        let mut s = Stiffness {
            voigt: [[0.0; 6]; 6],
            thermal: [0.0; 6],
            thermal_energy: energy,
            out_of_plane: [0.0; 3],
            out_of_plane_thermal: 0.0,
            average: Self::voigt_average(c),
            section,
        };
        for (i, &p) in kept.iter().enumerate() {
            s.thermal[i] = beta[p];
            for (j, &q) in kept.iter().enumerate() {
                s.voigt[i][j] = a[p][q];
            }
        }
        if let Section::PlaneStrain { .. } = section {
            let block = Matrix::<f64, 3>(array(|i| array(|j| s.voigt[i][j])));
            let inverse = block.inverse();
            s.out_of_plane = array(|j| (0..3).map(|k| c[2][kept[k]] * inverse.0[k][j]).sum());
            s.out_of_plane_thermal = beta[2] - (0..3).map(|k| s.out_of_plane[k] * s.thermal[k]).sum::<f64>();
        }
        s
    }

    /// Isotropic material.
    pub fn isotropic(m: Isotropic, expansion: f64, section: Section) -> Self {
        Self::new(&m.voigt(), &[expansion, expansion, expansion, 0.0, 0.0, 0.0], section)
    }

    /// Bulk and shear modulus of the isotropic stiffness nearest to C (Voigt's average).
    fn voigt_average(c: &[[f64; 6]; 6]) -> Isotropic {
        let a = c[0][0] + c[1][1] + c[2][2];
        let b = c[0][1] + c[1][2] + c[0][2];
        let s = c[3][3] + c[4][4] + c[5][5];
        Isotropic::from_bulk_shear((a + 2.0 * b) / 9.0, (a - b + 3.0 * s) / 15.0)
    }

    /// Number of independent strains.
    pub const STRAINS: usize = D * (D + 1) / 2;

    /// C : ε of a symmetric tensor.
    #[inline(always)]
    pub fn stress<R: Scalar>(&self, strain: &Matrix<R, D>) -> Matrix<R, D> {
        let mut s = Matrix::zero();
        for i in 0..Self::STRAINS {
            let (a, b) = PAIRS[D - 1][i];
            let mut t = R::of(0.0);
            for j in 0..Self::STRAINS {
                let (p, q) = PAIRS[D - 1][j];
                let gamma = if p == q { strain.0[p][p] } else { strain.0[p][q] + strain.0[q][p] };
                t += gamma * self.voigt[i][j];
            }
            s.0[a][b] = t;
            s.0[b][a] = t;
        }
        s
    }

    /// The thermal stress β as a tensor.
    #[inline(always)]
    pub fn thermal_stress<R: Scalar>(&self, temperature: f64) -> Matrix<R, D> {
        let mut s = Matrix::zero();
        for i in 0..Self::STRAINS {
            let (a, b) = PAIRS[D - 1][i];
            s.0[a][b] = R::of(self.thermal[i] * temperature);
            s.0[b][a] = s.0[a][b];
        }
        s
    }

    /// Plane-strain stress across the plane, given the stress within and the temperature change.
    pub fn out_of_plane_stress(&self, s: &Matrix<f64, D>, temperature: f64) -> f64 {
        if D != 2 {
            return 0.0;
        }
        let in_plane = self.out_of_plane[0] * s.0[0][0] + self.out_of_plane[1] * s.0[1][1] + self.out_of_plane[2] * s.0[0][1];
        in_plane - self.out_of_plane_thermal * temperature
    }

    /// Whether C is positive definite.
    pub fn is_stable(&self) -> bool {
        // Cholesky factorisation of the block in use
        let n = Self::STRAINS;
        let mut l = self.voigt;
        for k in 0..n {
            let d = l[k][k] - (0..k).map(|p| l[k][p] * l[k][p]).sum::<f64>();
            if d.is_nan() || d <= 1e-14 * self.voigt[k][k].abs() {
                return false;
            }
            l[k][k] = d.sqrt();
            for i in k + 1..n {
                l[i][k] = (l[i][k] - (0..k).map(|p| l[i][p] * l[k][p]).sum::<f64>()) / l[k][k];
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEEL: Isotropic = Isotropic { young: 200e9, poisson: 0.25 };

    fn close(a: f64, b: f64) {
        assert!((a - b).abs() <= 1e-13 * b.abs().max(1e-3 * 200e9), "{a} {b}");
    }

    #[test]
    fn moduli_of_a_quarter() {
        // E = 200 GPa, ν = 1/4: λ = μ = 80 GPa
        close(STEEL.lambda(), 80e9);
        close(STEEL.shear(), 80e9);
        let again = Isotropic::from_bulk_shear(STEEL.bulk(), STEEL.shear());
        close(again.young, 200e9);
        assert!((again.poisson - 0.25).abs() < 1e-15);
    }

    #[test]
    fn sections_of_an_isotropic_solid() {
        let strain = Stiffness::<2>::isotropic(STEEL, 1e-5, Section::PlaneStrain { thickness: 1.0 });
        close(strain.voigt[0][0], 240e9);
        close(strain.voigt[0][1], 80e9);
        close(strain.voigt[2][2], 80e9);
        // σ33 = ν (σ11 + σ22)
        assert!((strain.out_of_plane[0] - 0.25).abs() < 1e-15 && strain.out_of_plane[2].abs() < 1e-15);
        close(strain.thermal[0], 3.0 * STEEL.bulk() * 1e-5);
        let stress = Stiffness::<2>::isotropic(STEEL, 1e-5, Section::PlaneStress { thickness: 1.0 });
        close(stress.voigt[0][0], 200e9 / (1.0 - 0.0625));
        close(stress.voigt[0][1], 50e9 / (1.0 - 0.0625));
        close(stress.thermal[0], 200e9 / 0.75 * 1e-5);
        let bar = Stiffness::<1>::isotropic(STEEL, 1e-5, Section::Bar { area: 2.0 });
        close(bar.voigt[0][0], 200e9);
        close(bar.thermal[0], 200e9 * 1e-5);
        close(bar.thermal_energy, 200e9 * 1e-10);
    }

    #[test]
    fn rotation_by_a_quarter_turn_exchanges_axes() {
        let m = Orthotropic { young: [100e9, 10e9, 20e9], shear: [3e9, 4e9, 5e9], poisson: [0.1, 0.2, 0.3] };
        let c = m.voigt().unwrap();
        let turned = rotate(&c, &[[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
        close(turned[1][1], c[0][0]);
        close(turned[0][0], c[1][1]);
        close(turned[0][2], c[1][2]);
        close(turned[3][3], c[4][4]);
        close(turned[5][5], c[5][5]);
        // isotropic stiffness does not see a rotation
        let (s, k) = 0.7f64.sin_cos();
        let axes = [[k, s, 0.0], [-s, k, 0.0], [0.0, 0.0, 1.0]];
        let iso = rotate(&STEEL.voigt(), &axes);
        for a in 0..6 {
            for b in 0..6 {
                close(iso[a][b], STEEL.voigt()[a][b]);
            }
        }
        assert!(Orthotropic { poisson: [0.1, 0.2, 9.0], ..m }.voigt().is_none());
    }

    #[test]
    fn a_transverse_bar_has_the_modulus_of_its_fibre() {
        let c = Orthotropic::transverse(150e9, 9e9, 0.3, 0.4, 5e9).voigt().unwrap();
        let s = Stiffness::<1>::new(&c, &[0.0; 6], Section::Bar { area: 1.0 });
        close(s.voigt[0][0], 150e9);
        assert!(s.is_stable());
    }
}
