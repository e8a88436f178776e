//! The core trait: a peridynamic material is an energy density of the deformed family and its Fréchet derivative.

use crate::family::{Bond, Family, Place, Reference, Undeformed};
use crate::models::FLAT_FAMILY;
use crate::scalar::{Record, Scalar};
use crate::tensor::{Matrix, Vector};

/// The family cannot carry the model: too few bonds, or all of them in a line or plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SingularFamily;

/// A peridynamic material: the energy density `W(Y)` of one family and its Fréchet derivative `T = ∇W(Y)`, so that
/// `dW = ∫_H T⟨ξ⟩·dη⟨ξ⟩ dV′`.
///
/// The force density of a body follows as `f(x) = ∫_H (T[x]⟨ξ⟩ − T[x′]⟨−ξ⟩) dV′`. A model writes what the deformed
/// family reduces to ([`State`](Self::State)) and the force state of a bond given that; it has no loop over points. The first is of two
/// steps: integrals over the deformed family ([`moments`](Self::moments)), for which of the shape only its [`Weights`](Self::Weights) are
/// known, and what shape, constants and law make of them ([`state_of`](Self::state_of)). So the integrals of several points of a lattice can
/// be taken side by side, and the law sees one at a time.
/// `state`, `force` and `energy_density` neither allocate nor fail.
pub trait Material<const D: usize>: Clone + Send + Sync + 'static {
    /// Words of history a point keeps.
    const MEMORY: usize = 0;
    /// Words of history a bond keeps.
    const BOND_MEMORY: usize = 0;
    /// Whether the force depends on the velocities.
    const RATE: bool = false;
    /// Whether the force state is the derivative of the energy density (at rest, at fixed history and temperature).
    const CONSERVATIVE: bool = true;
    /// Whether the force state lies along the bond, is linear in a state of one word that is fixed with the reference family, and equal and
    /// opposite at both ends but for that word. Then a point needs no more than its neighbours' words to sum both halves of each
    /// pair by itself: no force is written to a neighbour.
    const PAIRWISE: bool = false;
    /// Sub-horizons whose membership is stored with the bonds.
    const SUB_HORIZONS: usize = 0;
    /// Whether the influence is stored with the bonds.
    const STORED_INFLUENCE: bool;

    /// The material constants at a point.
    type Constants: Copy + Send + Sync + 'static;
    /// What the reference family alone decides.
    type Shape: Copy + Send + Sync + 'static;
    /// What the integrals must know of the shape.
    type Weights<R: Scalar>: Record<R>;
    /// Integrals over the deformed family.
    type Moments<R: Scalar>: Record<R>;
    /// All that a force needs to know of the deformed family.
    type State<R: Scalar>: Record<R>;

    /// The shape of a family. The only call that can fail.
    fn shape(&self, constants: &Self::Constants, h: Reference<D>) -> Result<Self::Shape, SingularFamily>;
    /// The shape after bonds of the family broke; by default the reference shape is kept.
    fn reshape(&self, _: &Self::Constants, shape: &Self::Shape, _: Reference<D>) -> Result<Self::Shape, SingularFamily> {
        Ok(*shape)
    }
    /// Whether [`reshape`](Self::reshape) makes the bonds that are left stiffer, so that the stable step must be watched when bonds break.
    fn rebuilds(&self, _: &Self::Constants) -> bool {
        false
    }
    /// What [`moments`](Self::moments) gets of a shape.
    fn weights<R: Scalar>(&self, shape: &Self::Shape) -> Self::Weights<R>;
    /// Integrals over the deformed family. Nothing of the family may be asked but its bonds.
    fn moments<S: Scalar>(&self, weights: &Self::Weights<S>, h: Family<S, D>) -> Self::Moments<S::Sum>;
    /// Whether `state` is `state_of` the `moments` for this shape too: a family that the model treats otherwise is none of several abreast.
    fn is_regular(&self, _: &Self::Shape) -> bool {
        true
    }
    /// What a family of these integrals reduces to.
    fn state_of<R: Scalar>(
        &self,
        constants: &Self::Constants,
        shape: &Self::Shape,
        moments: &Self::Moments<R>,
        place: Place,
    ) -> Self::State<R>;
    /// What the deformed family reduces to.
    #[inline(always)]
    fn state<S: Scalar>(&self, constants: &Self::Constants, shape: &Self::Shape, h: Family<S, D>) -> Self::State<S::Sum> {
        self.state_of(constants, shape, &self.moments(&self.weights(shape), h), h.place())
    }
    /// The force state `T⟨ξ⟩` \[N/m⁶ in 3D\].
    fn force<S: Scalar>(&self, state: &Self::State<S>, b: Bond<S, D>) -> Vector<S, D>;
    /// The energy density `W` \[J/m³\].
    fn energy_density<S: Scalar>(&self, constants: &Self::Constants, shape: &Self::Shape, h: Family<S, D>) -> S::Sum;
    /// Writes the history of an accepted increment: `point` holds [`MEMORY`](Self::MEMORY) words, `bonds[k]` word `k`
    /// of the family's slots, from its first one.
    fn commit(&self, _: &Self::Constants, _: &Self::Shape, _: Family<f64, D>, _point: &mut [f64], _bonds: &mut [&mut [f64]]) {}
    /// Whether a bond stiffens without bound as its ends meet: explicit steps must then resolve it.
    fn collapse(&self) -> bool {
        false
    }
    /// What the shape had to do without in a family that is too poor, for the log.
    fn shortfall(&self, _: &Self::Shape) -> Option<&'static str> {
        None
    }
    /// `F − 1` as the model sees it, for output: by default the mean over the intact family with the model's influence,
    /// `(∫ ω η ⊗ ξ dV′)(∫ ω ξ ⊗ ξ dV′)⁻¹`; zero where the family is flat.
    fn displacement_gradient(&self, _: &Self::Constants, _: &Self::Shape, h: Family<f64, D>) -> Matrix<f64, D> {
        let (k, a): (Matrix<f64, D>, Matrix<f64, D>) = h.integrate(|b| {
            let xi = b.xi() * if Self::STORED_INFLUENCE { b.weight() } else { 1.0 };
            (b.xi().outer(xi), b.eta().outer(xi))
        });
        k.inverse_if_regular(FLAT_FAMILY).map_or_else(Matrix::zero, |inverse| a * inverse)
    }
    /// The nonlocal strain of a model that is made of the strains of bonds, for output; `None` where it is made of F or of nothing.
    fn extended_strain(&self, _: &Self::Constants, _: &Self::Shape, _: Family<f64, D>) -> Option<Matrix<f64, D>> {
        None
    }
    /// First Piola stress across the plane in plane strain, zero else, given the one within; for output only.
    fn out_of_plane_stress(&self, _: &Self::Constants, _: &Self::Shape, _: Family<f64, D>, _in_plane: &Matrix<f64, D>) -> f64 {
        0.0
    }
}
