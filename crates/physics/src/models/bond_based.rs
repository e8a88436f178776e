use crate::elasticity::{Isotropic, Section};
use crate::family::{Bond, Family, Place, Reference, Undeformed};
use crate::influence::Influence;
use crate::material::{Material, SingularFamily};
use crate::scalar::Scalar;
use crate::stretch_law::StretchLaw;
use crate::tensor::{Matrix, Vector};
use std::f64::consts::PI;

/// Bond-based solid: every bond is a spring of its own, whose force is a law g of its stretch.
///
/// # Equations
/// With s = e/|ξ| and the unit vector y along Y:
///
/// $$ T\langle\xi\rangle = \tfrac{c}{2}\,\omega\,g(s)\,y, \qquad W = \tfrac12 \int_H c\,\omega\,|\xi|\,\Gamma(s)\,dV', \quad \Gamma' = g $$
///
/// and for the elastic law (g = s) $W = \tfrac14\int c\,\omega\,s^2|\xi|\,dV'$. The micromodulus c comes from the family
/// itself (or, by option, from a full continuum family): 1D $2E/\int\omega|\xi|dV'$; plane stress $6E/\int\omega|\xi|dV'$;
/// plane strain $6.4E/\int\omega|\xi|dV'$; 3D $18k/\int\omega|\xi|dV'$. A pair of different points uses the mean of
/// their c, by adding both force states.
///
/// # Source
/// Silling, J. Mech. Phys. Solids 48 (2000) 175–209; Silling & Askari, Comput. Struct. 83 (2005) 1526–1535.
///
/// # Units
/// c \[N/m⁶\], T \[N/m⁶\], W \[J/m³\], in 3D.
///
/// # Holds when
/// Poisson's ratio is 1/4 (3D and plane strain) or 1/3 (plane stress).
///
/// # Fails when
/// any other Poisson's ratio is asked for: use the linear peridynamic solid.
///
/// # Differs from the source
/// c is calibrated on each point's own reference family, which makes the energy of a dilatation exact at surfaces too.
/// It is kept when bonds break.
///
/// # Verified by
/// `physics/tests/contract.rs`, `decks/patch-tests`, `decks/block`.
#[derive(Clone, Copy, Debug)]
pub struct BondBased<G, I> {
    /// The law of the stretch.
    pub law: G,
    /// The influence function.
    pub omega: I,
}

/// Constants of [`BondBased`].
#[derive(Clone, Copy, Debug)]
pub struct BondBasedConstants {
    /// Young's modulus E \[Pa\].
    pub young: f64,
    /// The section, which fixes Poisson's ratio.
    pub section: Section,
    /// Continuum micromodulus (ω = 1) instead of the family's own.
    pub continuum: bool,
}

impl BondBasedConstants {
    /// The Poisson's ratio of the model in a section; `None` in a bar, where it does not matter.
    pub fn poisson(section: Section) -> Option<f64> {
        match section {
            Section::Bar { .. } => None,
            Section::PlaneStress { .. } => Some(1.0 / 3.0),
            Section::PlaneStrain { .. } | Section::Solid => Some(0.25),
        }
    }
    /// c ∫ω|ξ|dV′ (Pa): the micromodulus is this over the first moment of the family.
    pub fn modulus(&self) -> f64 {
        match self.section {
            Section::Bar { .. } => 2.0 * self.young,
            Section::PlaneStress { .. } => 6.0 * self.young,
            Section::PlaneStrain { .. } => 6.4 * self.young,
            Section::Solid => 18.0 * Isotropic { young: self.young, poisson: 0.25 }.bulk(),
        }
    }
    /// ∫_H |ξ| dV′ of a full continuum family.
    pub fn continuum_moment(&self, delta: f64) -> f64 {
        match self.section {
            Section::Bar { area } => area * delta.powi(2),
            Section::PlaneStress { thickness } | Section::PlaneStrain { thickness } => 2.0 * PI * thickness * delta.powi(3) / 3.0,
            Section::Solid => PI * delta.powi(4),
        }
    }
}

impl<G: StretchLaw, I: Influence, const D: usize> Material<D> for BondBased<G, I> {
    const BOND_MEMORY: usize = G::BOND_MEMORY;
    const PAIRWISE: bool = true;
    const STORED_INFLUENCE: bool = I::STORED;
    type Constants = BondBasedConstants;
    /// c
    type Shape = f64;
    type Weights<R: Scalar> = ();
    type Moments<R: Scalar> = ();
    /// c/2
    type State<R: Scalar> = R;

    fn shape(&self, constants: &BondBasedConstants, h: Reference<D>) -> Result<f64, SingularFamily> {
        let first_moment: f64 = h.integrate(|b| self.omega.at(b) * b.length());
        if first_moment.is_nan() || first_moment <= 0.0 {
            return Err(SingularFamily);
        }
        Ok(constants.modulus() / if constants.continuum { constants.continuum_moment(h.horizon()) } else { first_moment })
    }
    #[inline(always)]
    fn weights<R: Scalar>(&self, _: &f64) {}
    #[inline(always)]
    fn moments<S: Scalar>(&self, (): &(), _: Family<S, D>) {}
    #[inline(always)]
    fn state_of<R: Scalar>(&self, _: &BondBasedConstants, c: &f64, (): &(), _: Place) -> R {
        R::of(0.5 * c)
    }
    #[inline(always)]
    fn force<S: Scalar>(&self, half_c: &S, b: Bond<S, D>) -> Vector<S, D> {
        let (stretch, y) = b.stretch();
        let g = self.law.force(
            stretch,
            #[inline(always)]
            |k| b.memory(k),
        );
        y * (self.omega.at(b) * *half_c * g)
    }
    #[inline(always)]
    fn energy_density<S: Scalar>(&self, _: &BondBasedConstants, c: &f64, h: Family<S, D>) -> S::Sum {
        h.integrate(
            #[inline(always)]
            |b| {
                let potential = self.law.potential(b.stretch().0, |k| b.memory(k));
                self.omega.at(b) * b.length() * potential * (0.5 * c)
            },
        )
    }
    fn commit(&self, _: &BondBasedConstants, _: &f64, h: Family<f64, D>, _: &mut [f64], bonds: &mut [&mut [f64]]) {
        if G::BOND_MEMORY == 0 {
            return;
        }
        let first = h.first_slot();
        h.each(|b| {
            let mut words = [0.0; 4];
            for (k, word) in bonds.iter().enumerate() {
                words[k] = word[b.slot() - first];
            }
            self.law.commit(b.stretch().0, &mut words[..G::BOND_MEMORY]);
            for (k, word) in bonds.iter_mut().enumerate() {
                word[b.slot() - first] = words[k];
            }
        });
    }
    fn out_of_plane_stress(&self, constants: &BondBasedConstants, _: &f64, _: Family<f64, D>, s: &Matrix<f64, D>) -> f64 {
        match constants.section {
            Section::PlaneStrain { .. } => 0.25 * s.trace(),
            _ => 0.0,
        }
    }
}
