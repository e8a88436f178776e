//! Fields of a body by name, in the order of the user's points.

use crate::structure::Structure;
use physics::tensor::Matrix;

/// A field that can be asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FieldName {
    /// u \[m\]
    Displacement,
    /// u̇ \[m/s\]
    Velocity,
    /// Nonlocal F as the material sees it: with its influence function; of corrected correspondence with its weights, of sub-horizons the mean
    /// over those that carry energy.
    DeformationGradient,
    /// Green–Lagrange strain of the nonlocal F.
    Strain,
    /// Nonlocal strain of extended correspondence, in the measure of its exponent; NaN in other materials.
    ExtendedStrain,
    /// Cauchy stress σ = P Fᵀ/J, with J of the dimensions of the body (in plane stress and in a bar per reference thickness or
    /// section: their change is not known to every model) \[Pa\], P = ∫ T ⊗ ξ dV′.
    Stress,
    /// Von Mises stress \[Pa\].
    VonMises,
    /// det F − 1
    Dilatation,
    /// −tr σ/3 \[Pa\]
    Pressure,
    /// W \[J/m³\]
    EnergyDensity,
    /// φ, 0 whole, 1 free
    Damage,
    /// Intact bonds.
    FamilySize,
    /// Internal and external force per volume \[N/m³\]
    ForceDensity,
    /// Smallest |Y|/|ξ| of the intact bonds.
    MinBondRatio,
    /// Number of the material.
    Material,
    /// The user's point id.
    Id,
    /// Curvature of beams and plates \[1/m\].
    Curvature,
    /// Moment of beams \[N m\], and of plates per width \[N\].
    Moment,
    /// Largest plastic angle of the bond pairs of beams and plates.
    PlasticAngle,
}

impl FieldName {
    /// All fields.
    pub const ALL: [FieldName; 19] = [
        FieldName::Displacement,
        FieldName::Velocity,
        FieldName::DeformationGradient,
        FieldName::Strain,
        FieldName::ExtendedStrain,
        FieldName::Stress,
        FieldName::VonMises,
        FieldName::Dilatation,
        FieldName::Pressure,
        FieldName::EnergyDensity,
        FieldName::Damage,
        FieldName::FamilySize,
        FieldName::ForceDensity,
        FieldName::MinBondRatio,
        FieldName::Material,
        FieldName::Id,
        FieldName::Curvature,
        FieldName::Moment,
        FieldName::PlasticAngle,
    ];
    /// The name in decks and files.
    pub fn name(self) -> &'static str {
        match self {
            FieldName::Displacement => "displacement",
            FieldName::Velocity => "velocity",
            FieldName::DeformationGradient => "deformation_gradient",
            FieldName::Strain => "strain",
            FieldName::ExtendedStrain => "extended_strain",
            FieldName::Stress => "stress",
            FieldName::VonMises => "von_mises",
            FieldName::Dilatation => "dilatation",
            FieldName::Pressure => "pressure",
            FieldName::EnergyDensity => "energy_density",
            FieldName::Damage => "damage",
            FieldName::FamilySize => "family_size",
            FieldName::ForceDensity => "force_density",
            FieldName::MinBondRatio => "min_bond_ratio",
            FieldName::Material => "material",
            FieldName::Id => "id",
            FieldName::Curvature => "curvature",
            FieldName::Moment => "moment",
            FieldName::PlasticAngle => "plastic_angle",
        }
    }
    /// Words per point: 1, 3 (vector) or 9 (tensor, rows first).
    pub fn words(self) -> usize {
        match self {
            FieldName::Displacement | FieldName::Velocity | FieldName::ForceDensity => 3,
            FieldName::DeformationGradient
            | FieldName::Strain
            | FieldName::ExtendedStrain
            | FieldName::Stress
            | FieldName::Curvature
            | FieldName::Moment => 9,
            _ => 1,
        }
    }
    /// Finds a field by name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|f| f.name() == name)
    }
}

/// A tensor of the section in three dimensions: what lies across is given.
fn spatial<const D: usize>(m: &Matrix<f64, D>, across: f64) -> [f64; 9] {
    let mut t = [0.0; 9];
    for a in 0..D {
        for b in 0..D {
            t[a * 3 + b] = m.0[a][b];
        }
    }
    for k in D..3 {
        t[k * 3 + k] = if k == 2 { across } else { 0.0 };
    }
    t
}

impl<const D: usize> Structure<D> {
    /// A field at displacements `u` and velocities `v`, [`FieldName::words`] numbers a point, in the user's order.
    pub fn field(&mut self, name: FieldName, t: f64, u: &[f64], v: &[f64]) -> Vec<f64> {
        let n = self.body.points();
        let words = name.words();
        let sorted: Vec<f64> = match name {
            FieldName::Displacement => pad::<D>(u),
            FieldName::Velocity => pad::<D>(v),
            FieldName::ForceDensity => {
                let mut f = vec![0.0; n * D];
                self.total_force(t, u, Some(v), &mut f);
                for p in 0..n {
                    for k in 0..D {
                        f[p * D + k] /= self.body.volume()[p];
                    }
                }
                pad::<D>(&f)
            }
            FieldName::DeformationGradient => self.gradients(u).iter().flat_map(|h| spatial(&(Matrix::identity() + *h), 1.0)).collect(),
            FieldName::Strain => {
                let green = |h: &Matrix<f64, D>| h.symmetric() + h.transpose() * *h * 0.5;
                self.gradients(u).iter().flat_map(|h| spatial(&green(h), 0.0)).collect()
            }
            FieldName::ExtendedStrain => self.body.extended_strain(u).iter().flat_map(|e| spatial(e, 0.0)).collect(),
            FieldName::Dilatation => self.gradients(u).iter().map(|h| (Matrix::identity() + *h).determinant() - 1.0).collect(),
            FieldName::Stress | FieldName::VonMises | FieldName::Pressure => {
                let stress = self.cauchy(u, v);
                match name {
                    FieldName::Stress => stress.into_iter().flatten().collect(),
                    FieldName::Pressure => stress.iter().map(|s| -(s[0] + s[4] + s[8]) / 3.0).collect(),
                    _ => stress.iter().map(von_mises).collect(),
                }
            }
            FieldName::EnergyDensity => self.body.energy_density(u),
            FieldName::Damage => self.body.damage(),
            FieldName::FamilySize => self.body.family_size().into_iter().map(f64::from).collect(),
            FieldName::MinBondRatio => self.body.min_bond_ratio(u),
            FieldName::Material => self.material.iter().map(|&m| f64::from(m)).collect(),
            FieldName::Id => self.id.iter().map(|&i| i as f64).collect(),
            // solids have none: these are of beams and plates
            FieldName::Curvature | FieldName::Moment | FieldName::PlasticAngle => vec![f64::NAN; n * words],
        };
        let mut out = vec![0.0; n * words];
        for (p, &user) in self.user.iter().enumerate() {
            out[user as usize * words..][..words].copy_from_slice(&sorted[p * words..][..words]);
        }
        out
    }

    fn gradients(&mut self, u: &[f64]) -> Vec<Matrix<f64, D>> {
        self.body.displacement_gradient(u)
    }

    /// σ = P Fᵀ/J
    fn cauchy(&mut self, u: &[f64], v: &[f64]) -> Vec<[f64; 9]> {
        let h = self.gradients(u);
        let (p, across) = self.body.stress(u, Some(v));
        h.iter()
            .zip(p.iter().zip(&across))
            .map(|(h, (p, &across))| {
                let f = Matrix::identity() + *h;
                let j = f.determinant();
                let sigma = *p * f.transpose() * (1.0 / j);
                spatial(&sigma, across / j)
            })
            .collect()
    }
}

fn pad<const D: usize>(x: &[f64]) -> Vec<f64> {
    x.chunks(D).flat_map(|c| (0..3).map(|k| c.get(k).copied().unwrap_or(0.0))).collect()
}

/// √(3/2 s:s) of the stress deviator.
fn von_mises(s: &[f64; 9]) -> f64 {
    let mean = (s[0] + s[4] + s[8]) / 3.0;
    let mut sum = 0.0;
    for a in 0..3 {
        for b in 0..3 {
            let symmetric = 0.5 * (s[a * 3 + b] + s[b * 3 + a]) - if a == b { mean } else { 0.0 };
            sum += symmetric * symmetric;
        }
    }
    (1.5 * sum).sqrt()
}
