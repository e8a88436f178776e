//! Extension of thin bodies with displacements along them: bonds, each at its own point.
//!
//! `T = β ω e Y/|Y|`, e = |Y| − |ξ| (thesis (4.13), with the ω it lacks); β = EA/m in beams, 8 G h/m in plates, m = Σ ω ξ² over both
//! directions; for other Poisson's ratios than 1/3 also `W' = (G h/2)(3ν − 1)/(1 − ν) θ²`, θ = (2/m) Σ ω |ξ| e.

use crate::stencil::Ends;

/// A bond of a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExtensionBond {
    /// Its end.
    pub end: u32,
    /// Number of the arm, and its direction.
    pub arm: u32,
    /// −1 where the bond is the arm reversed.
    pub sign: f64,
    /// Stiffness k, energy k e²/2, volume of the point included.
    pub stiffness: f64,
    /// Weight of e in θ (1/length).
    pub dilatation: f64,
}

/// The bonds of all points, family by family.
#[derive(Clone, Debug, Default)]
pub struct Extension {
    /// Start of each family, and the end of the last.
    pub starts: Vec<usize>,
    /// The bonds.
    pub bonds: Vec<ExtensionBond>,
    /// Stiffness c of the energy c θ², volume included, per point.
    pub dilatational: Vec<f64>,
    /// Which bonds are intact; all where empty.
    pub intact: Vec<bool>,
    /// Stretch |e|/|ξ| at which the bonds of each point break; never where empty.
    pub critical: Vec<f64>,
}

impl Extension {
    /// The intact bonds of a point.
    #[inline(always)]
    pub fn family(&self, point: usize) -> impl Iterator<Item = &ExtensionBond> {
        let range = self.starts[point]..self.starts[point + 1];
        let first = range.start;
        self.bonds[range].iter().enumerate().filter(move |(k, _)| self.is_intact(first + k)).map(|b| b.1)
    }

    /// Numbers of the intact bonds of a point.
    #[inline(always)]
    pub fn intact_bonds(&self, point: usize) -> impl Iterator<Item = usize> + '_ {
        (self.starts[point]..self.starts[point + 1]).filter(|q| self.is_intact(*q))
    }

    /// Whether a bond is intact.
    #[inline(always)]
    pub fn is_intact(&self, bond: usize) -> bool {
        self.intact.is_empty() || self.intact[bond]
    }
}

/// One bond at a displacement.
#[derive(Clone, Copy, Debug)]
pub struct Stretched<const D: usize> {
    /// e = |Y| − |ξ|
    pub extension: f64,
    /// Y/|Y|
    pub direction: [f64; D],
    /// |Y|
    pub length: f64,
}

/// e, Y/|Y| and |Y| of a bond; e as (2 ξ·η + η·η)/(|Y| + |ξ|), so that small strains keep their digits.
#[inline(always)]
pub fn stretch<const D: usize>(arm: &[f64; 3], sign: f64, length: f64, eta: &[f64; D]) -> Stretched<D> {
    let mut y = [0.0; D];
    let (mut square, mut twice) = (0.0, 0.0);
    for k in 0..D {
        let xi = sign * arm[k];
        y[k] = xi + eta[k];
        square += y[k] * y[k];
        twice += (2.0 * xi + eta[k]) * eta[k];
    }
    let now = square.sqrt();
    Stretched { extension: twice / (now + length), direction: y.map(|c| c / now), length: now }
}

/// Bonds under a tension that does not change: springs across, from the linearisation about a stretched flat body.
#[derive(Clone, Debug, Default)]
pub struct Prestress {
    /// Start of each family, and the end of the last.
    pub starts: Vec<usize>,
    /// Ends, and the stiffness k of k (w_end − w)²/2.
    pub springs: Vec<(u32, f64)>,
}

impl Prestress {
    /// Energy of a family.
    pub fn energy(&self, ends: &Ends<1>, centre: u32, u: &[f64]) -> f64 {
        let w = ends.value(centre, u)[0];
        self.springs[self.starts[centre as usize]..self.starts[centre as usize + 1]]
            .iter()
            .map(|(end, k)| 0.5 * k * (ends.value(*end, u)[0] - w).powi(2))
            .sum()
    }
}
