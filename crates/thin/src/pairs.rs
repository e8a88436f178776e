//! The energy of a family of bond pairs as a function of their turning angles: the law, plasticity, and the isotropic term.
//!
//! A family has the energy
//!
//! ```text
//! E = Σ_k a_k ψ(e_k) + c κ̄²,    κ̄ = Σ_k b_k e_k,    e_k = φ_k − φ_p,k
//! ```
//!
//! with `a_k` the stiffness of pair k (volume of the centre included), ψ the potential, e the elastic part of the angle, and the second
//! term that of Poisson's ratio (plates; c has the sign of 3ν − 1). Elastic–perfectly plastic pairs minimise the incremental potential
//! `E + Σ a_k φ_c,k |φ_p,k − φ_p,k⁰|` over `φ_p`: the force of a pair, its share of the isotropic term included, stays below `a_k φ_c,k`.
//! Where c = 0 that is the return map of each pair by itself; else one scalar equation for κ̄, monotone for every ν > −1.

use crate::angle::Potential;

/// A bond pair: two opposite ends of a centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// End of the bond ξ.
    pub plus: u32,
    /// End of the bond −ξ.
    pub minus: u32,
    /// Number of the arm ξ.
    pub arm: u32,
    /// Stiffness a: energy per potential, volume of the centre included (energy).
    pub stiffness: f64,
    /// Weight b of the angle in the mean curvature (1/length).
    pub isotropic: f64,
    /// Angle φ_c at which the pair yields or breaks; infinite where it does neither.
    pub limit: f64,
}

/// What pairs do beyond their limit angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Law {
    /// Elastic with a potential.
    Elastic(Potential),
    /// Elastic to the limit angle, perfectly plastic beyond, without memory: nonlinear elasticity.
    NonlinearElastic,
    /// Elastic–perfectly plastic with the plastic angle as history.
    ElasticPlastic,
}

impl Law {
    /// Whether plastic angles are kept.
    pub fn has_history(self) -> bool {
        self == Law::ElasticPlastic
    }
}

/// A family of pairs at some plastic angles.
#[derive(Clone, Copy)]
pub struct PairFamily<'a> {
    /// The pairs.
    pub pairs: &'a [Pair],
    /// Which of them are intact.
    pub intact: &'a [bool],
    /// Plastic angles at the last accepted state.
    pub plastic: &'a [f64],
    /// Stiffness c of the isotropic term, volume included.
    pub isotropic: f64,
    /// The law.
    pub law: Law,
}

/// The tangent of a family in terms of its angles: `diag(t) + γ v vᵀ`, v the isotropic weights of pairs that do not yield.
pub struct Tangent<'a> {
    /// t_k, overwritten.
    pub diagonal: &'a mut [f64],
    /// v_k, overwritten.
    pub vector: &'a mut [f64],
}

impl PairFamily<'_> {
    /// Elastic parts of the angles, and κ̄. Broken pairs have none.
    pub fn elastic_parts(&self, angles: &[f64], elastic: &mut [f64]) -> f64 {
        let n = self.pairs.len();
        let plastic = |k: usize| if self.law.has_history() { self.plastic[k] } else { 0.0 };
        if let Law::Elastic(_) = self.law {
            let mut mean = 0.0;
            for k in 0..n {
                elastic[k] = if self.intact[k] { angles[k] } else { 0.0 };
                mean += self.pairs[k].isotropic * elastic[k];
            }
            return mean;
        }
        // e(κ̄) = clip(φ − φ_p, ±φ_c − s κ̄), s = 2 c b/a
        let set = |mean: f64, elastic: &mut [f64]| {
            let (mut sum, mut slope) = (0.0, 1.0);
            for k in 0..n {
                let p = &self.pairs[k];
                if !self.intact[k] {
                    elastic[k] = 0.0;
                    continue;
                }
                let shift = 2.0 * self.isotropic * p.isotropic / p.stiffness;
                let trial = angles[k] - plastic(k);
                let (low, high) = (-p.limit - shift * mean, p.limit - shift * mean);
                elastic[k] = trial.max(low).min(high);
                if trial < low || trial > high {
                    slope += p.isotropic * shift;
                }
                sum += p.isotropic * elastic[k];
            }
            (sum, slope)
        };
        if self.isotropic == 0.0 {
            return set(0.0, elastic).0;
        }
        let mut mean: f64 = (0..n).filter(|&k| self.intact[k]).map(|k| self.pairs[k].isotropic * (angles[k] - plastic(k))).sum();
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for _ in 0..100 {
            let (sum, slope) = set(mean, elastic);
            let excess = mean - sum;
            if excess.abs() <= 1e-15 * (mean.abs() + sum.abs()) {
                break;
            }
            if excess > 0.0 {
                high = mean
            } else {
                low = mean
            }
            let mut next = mean - excess / slope;
            if !(next > low && next < high) {
                next = 0.5 * (low + high);
            }
            if next == mean || !next.is_finite() {
                break;
            }
            mean = next;
        }
        mean
    }

    /// Energy, and the forces `g_k = ∂E/∂φ_k`. `elastic` is room for as many numbers.
    pub fn respond(&self, angles: &[f64], elastic: &mut [f64], forces: &mut [f64]) -> f64 {
        let mean = self.elastic_parts(angles, elastic);
        let mut energy = self.isotropic * mean * mean;
        for k in 0..self.pairs.len() {
            let p = &self.pairs[k];
            if !self.intact[k] {
                forces[k] = 0.0;
                continue;
            }
            let e = elastic[k];
            let (psi, slope) = match self.law {
                Law::Elastic(Potential::Cosine) => (2.0 * (0.5 * e).sin().powi(2), e.sin()),
                _ => (0.5 * e * e, e),
            };
            forces[k] = p.stiffness * slope + 2.0 * self.isotropic * mean * p.isotropic;
            energy += p.stiffness * psi;
            if !matches!(self.law, Law::Elastic(_)) {
                let before = if self.law.has_history() { self.plastic[k] } else { 0.0 };
                let slip = (angles[k] - e - before).abs();
                if slip > 0.0 {
                    energy += p.stiffness * p.limit * slip;
                }
            }
        }
        energy
    }

    /// The tangent at the angles whose elastic parts were found; returns γ.
    pub fn tangent(&self, angles: &[f64], elastic: &[f64], tangent: Tangent<'_>) -> f64 {
        let mut yielding = 0.0;
        for k in 0..self.pairs.len() {
            let p = &self.pairs[k];
            (tangent.diagonal[k], tangent.vector[k]) = (0.0, 0.0);
            if !self.intact[k] {
                continue;
            }
            match self.law {
                Law::Elastic(Potential::Cosine) => tangent.diagonal[k] = p.stiffness * elastic[k].cos(),
                Law::Elastic(Potential::Square) => tangent.diagonal[k] = p.stiffness,
                Law::NonlinearElastic | Law::ElasticPlastic => {
                    let before = if self.law.has_history() { self.plastic[k] } else { 0.0 };
                    if elastic[k] != angles[k] - before {
                        yielding += p.isotropic * p.isotropic / p.stiffness;
                        continue;
                    }
                    tangent.diagonal[k] = p.stiffness;
                }
            }
            tangent.vector[k] = p.isotropic;
        }
        2.0 * self.isotropic / (1.0 + 2.0 * self.isotropic * yielding)
    }
}
