use crate::constitutive::{Deformation, Law};
use crate::family::{Bond, Family, Place, Reference};
use crate::influence::Influence;
use crate::material::{Material, SingularFamily};
use crate::scalar::{Scalar, lift};
use crate::tensor::{Matrix, Vector};
use crate::zero_energy::Control;

/// Smallest eigenvalue of a shape tensor over its largest below which a family counts as flat.
pub const FLAT_FAMILY: f64 = 1e-6;

/// Correspondence: a law of classical mechanics, evaluated on the nonlocal deformation gradient of the family.
///
/// # Equations
/// $$ K = \int\omega\,\xi\otimes\xi\,dV', \qquad F = 1 + \Big(\int\omega\,\eta\otimes\xi\,dV'\Big)K^{-1}, \qquad
///    T\langle\xi\rangle = \omega\,P K^{-1}\xi + \omega A z, \quad z = \eta - (F-1)\xi $$
/// $$ W = \psi(F) + \tfrac12\int\omega\,z\cdot A z\,dV', \qquad P = \partial\psi/\partial F $$
///
/// with the tensor A of the zero-energy control.
///
/// # Source
/// Silling et al., J. Elasticity 88 (2007) 151–184, section 18; Roy Chowdhury et al. (2019), eqs. 1–4; Wan et al. (2019)
/// for the control.
///
/// # Units
/// K \[m⁵\], P \[Pa\], T \[N/m⁶\], W \[J/m³\], in 3D.
///
/// # Holds when
/// the family has d independent bonds. Affine maps are exact for every family; F is second order in δ in the interior
/// and first order near surfaces.
///
/// # Fails when
/// no control is used: on a lattice every wave vector with components in {0, π/Δx} deforms without energy.
///
/// # Differs from the source
/// P = J σ F⁻ᵀ for laws that give σ (the documentation page followed here once printed J σ F). The influence function
/// acts in the control too. K is rebuilt from the intact bonds when bonds break.
///
/// # Verified by
/// `physics/tests/contract.rs`, `physics/tests/symbol.rs`, `decks/patch-tests`, `decks/checkerboard`, `decks/plate-with-hole`.
#[derive(Clone, Copy, Debug)]
pub struct Correspondence<L, Z, I> {
    /// The constitutive law.
    pub law: L,
    /// The zero-energy control.
    pub control: Z,
    /// The influence function.
    pub omega: I,
}

/// What the law sees, given ∫ ω η ⊗ ξ dV′, ∫ ω η̇ ⊗ ξ dV′ and K⁻¹: F − 1 and its rate are theirs times K⁻¹.
#[inline(always)]
fn deformation<'a, R: Scalar, const D: usize>(
    words: usize,
    inverse: &Matrix<f64, D>,
    (gradient, rate): &(Matrix<R, D>, Matrix<R, D>),
    place: Place<'a>,
) -> Deformation<'a, R, D> {
    let inverse = inverse.to();
    Deformation {
        gradient: *gradient * inverse,
        rate: *rate * inverse,
        temperature: place.temperature,
        time: place.time,
        memory: place.history(words),
    }
}

impl<L: Law<D>, Z: Control<D>, I: Influence, const D: usize> Material<D> for Correspondence<L, Z, I> {
    const MEMORY: usize = L::MEMORY;
    const RATE: bool = L::RATE;
    const CONSERVATIVE: bool = L::HYPERELASTIC;
    const STORED_INFLUENCE: bool = I::STORED;
    type Constants = L::Constants;
    /// K⁻¹ and A
    type Shape = (Matrix<f64, D>, Z::Shape);
    type Weights<R: Scalar> = ();
    /// ∫ ω η ⊗ ξ dV′, and with the rate of η
    type Moments<R: Scalar> = (Matrix<R, D>, Matrix<R, D>);
    /// P K⁻¹ − A (F − 1), and A
    type State<R: Scalar> = (Matrix<R, D>, Z::State<R>);

    fn shape(&self, c: &L::Constants, h: Reference<D>) -> Result<Self::Shape, SingularFamily> {
        let k: Matrix<f64, D> = h.integrate(|b| b.xi().outer(b.xi()) * self.omega.at(b));
        let inverse = k.inverse_if_regular(FLAT_FAMILY).ok_or(SingularFamily)?;
        Ok((inverse, self.control.shape(&self.law.stiffness(c), &inverse, self.omega, h)))
    }
    fn rebuilds(&self, _: &L::Constants) -> bool {
        true
    }
    fn reshape(&self, c: &L::Constants, _: &Self::Shape, h: Reference<D>) -> Result<Self::Shape, SingularFamily> {
        self.shape(c, h)
    }
    #[inline(always)]
    fn weights<R: Scalar>(&self, _: &Self::Shape) {}
    #[inline(always)]
    fn moments<S: Scalar>(&self, (): &(), h: Family<S, D>) -> Self::Moments<S::Sum> {
        let gradient = h.integrate(
            #[inline(always)]
            |b| b.eta().outer(b.xi() * self.omega.at(b)),
        );
        let rate = if L::RATE && h.has_velocity() {
            h.integrate(
                #[inline(always)]
                |b| b.eta_rate().outer(b.xi() * self.omega.at(b)),
            )
        } else {
            Matrix::zero()
        };
        (gradient, rate)
    }
    #[inline(always)]
    fn state_of<R: Scalar>(
        &self,
        c: &L::Constants,
        (inverse, a): &Self::Shape,
        moments: &Self::Moments<R>,
        place: Place,
    ) -> Self::State<R> {
        let f = deformation(L::MEMORY, inverse, moments, place);
        let p = self.law.first_piola(c, &f);
        self.control.state(a, p * inverse.to(), &f.gradient)
    }
    #[inline(always)]
    fn force<S: Scalar>(&self, (q, a): &Self::State<S>, b: Bond<S, D>) -> Vector<S, D> {
        let control = self.control.force(
            a,
            #[inline(always)]
            || b.eta(),
        );
        (*q * b.xi() + control) * self.omega.at(b)
    }
    #[inline(always)]
    fn energy_density<S: Scalar>(&self, c: &L::Constants, (inverse, a): &Self::Shape, h: Family<S, D>) -> S::Sum {
        let f = deformation(L::MEMORY, inverse, &self.moments(&(), h), h.place());
        let gradient: Matrix<S, D> = lift::<S, _, _>(&f.gradient);
        let control = h.integrate(
            #[inline(always)]
            |b| self.control.energy::<S>(a, b.eta() - gradient * b.xi()) * self.omega.at(b),
        );
        self.law.energy(c, &f) + control
    }
    fn commit(&self, c: &L::Constants, (inverse, _): &Self::Shape, h: Family<f64, D>, point: &mut [f64], _: &mut [&mut [f64]]) {
        if L::MEMORY > 0 {
            self.law.commit(c, &deformation(L::MEMORY, inverse, &self.moments(&(), h), h.place()), point);
        }
    }
    fn out_of_plane_stress(&self, c: &L::Constants, (inverse, _): &Self::Shape, h: Family<f64, D>, _: &Matrix<f64, D>) -> f64 {
        self.law.out_of_plane_stress(c, &deformation(L::MEMORY, inverse, &self.moments(&(), h), h.place()))
    }
}
