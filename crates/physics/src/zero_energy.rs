//! Zero-energy control: what resists the part of a deformation that the nonlocal deformation gradient does not see,
//! `z⟨ξ⟩ = Y⟨ξ⟩ − F ξ`.
//!
//! Every control here has the energy density `½ ∫ ω z·A z dV′` with a symmetric tensor A \[N/m⁷ in 3D\],
//! and the force state `T = ω A z`: its exact derivative, because `∫ ω z ⊗ ξ dV′ = 0`.

use crate::elasticity::{Section, Stiffness};
use crate::family::Reference;
use crate::influence::Influence;
use crate::scalar::{Record, Scalar};
use crate::tensor::{Matrix, Vector};
use std::f64::consts::PI;

/// A zero-energy control. With `z = η − H ξ`, H = F − 1, the force state is `ω (A η − A H ξ)`; the second part joins the
/// correspondence force `ω P K⁻¹ ξ`, so a bond pays for the first only.
pub trait Control<const D: usize>: Clone + Send + Sync + 'static {
    /// What the reference family decides: A.
    type Shape: Copy + Send + Sync + 'static;
    /// What the force needs: A, over any number type.
    type State<R: Scalar>: Record<R>;
    /// A of a family, given its K⁻¹.
    fn shape<I: Influence>(&self, c: &Stiffness<D>, inverse: &Matrix<f64, D>, omega: I, h: Reference<D>) -> Self::Shape;
    /// `Q − A H` and A.
    fn state<R: Scalar>(&self, shape: &Self::Shape, q: Matrix<R, D>, gradient: &Matrix<R, D>) -> (Matrix<R, D>, Self::State<R>);
    /// A η
    fn force<S: Scalar>(&self, state: &Self::State<S>, eta: impl FnOnce() -> Vector<S, D>) -> Vector<S, D>;
    /// z·A z/2
    fn energy<S: Scalar>(&self, shape: &Self::Shape, z: Vector<S, D>) -> S;
}

/// No control: zero-energy modes are free.
#[derive(Clone, Copy, Debug)]
pub struct NoControl;

impl<const D: usize> Control<D> for NoControl {
    type Shape = ();
    type State<R: Scalar> = ();
    fn shape<I: Influence>(&self, _: &Stiffness<D>, _: &Matrix<f64, D>, _: I, _: Reference<D>) {}
    #[inline(always)]
    fn state<R: Scalar>(&self, _: &(), q: Matrix<R, D>, _: &Matrix<R, D>) -> (Matrix<R, D>, ()) {
        (q, ())
    }
    #[inline(always)]
    fn force<S: Scalar>(&self, _: &(), _: impl FnOnce() -> Vector<S, D>) -> Vector<S, D> {
        Vector::zero()
    }
    #[inline(always)]
    fn energy<S: Scalar>(&self, _: &(), _: Vector<S, D>) -> S {
        S::of(0.0)
    }
}

/// A = s 1: frame indifferent.
#[derive(Clone, Copy, Debug)]
pub enum Isotropic {
    /// s = 0: no control, in a type that can also have one.
    None,
    /// Silling, Comput. Methods Appl. Mech. Engrg. 322 (2017) 42–57, in the dimensionally right form
    /// s = G (c/δ)/ω̄ with ω̄ = ∫ω dV′/∫dV′ and the micromodulus c of the bond-based solid with ω = 1.
    Silling2017 {
        /// G, of order 1.
        strength: f64,
    },
    /// Wan et al. (2019) made frame indifferent: s = tr(C:K⁻¹)/d.
    Wan2019,
}

/// Micromodulus c of the bond-based solid with constant influence (continuum), used as a strength only.
pub fn micromodulus<const D: usize>(c: &Stiffness<D>, delta: f64) -> f64 {
    let m = c.average;
    match c.section {
        Section::Bar { area } => 2.0 * c.voigt[0][0] / (area * delta.powi(2)),
        Section::PlaneStrain { thickness } => 48.0 * m.young / (5.0 * PI * thickness * delta.powi(3)),
        Section::PlaneStress { thickness } => 9.0 * m.young / (PI * thickness * delta.powi(3)),
        Section::Solid => 18.0 * m.bulk() / (PI * delta.powi(4)),
    }
}

impl<const D: usize> Control<D> for Isotropic {
    type Shape = f64;
    type State<R: Scalar> = R;
    fn shape<I: Influence>(&self, c: &Stiffness<D>, inverse: &Matrix<f64, D>, omega: I, h: Reference<D>) -> f64 {
        match *self {
            Isotropic::None => 0.0,
            Isotropic::Silling2017 { strength } => {
                let (weighted, volume) = h.integrate(|b| (omega.at(b), 1.0));
                strength * micromodulus(c, h.horizon()) / h.horizon() * volume / weighted
            }
            Isotropic::Wan2019 => c.stress(inverse).trace() / D as f64,
        }
    }
    #[inline(always)]
    fn state<R: Scalar>(&self, s: &f64, q: Matrix<R, D>, gradient: &Matrix<R, D>) -> (Matrix<R, D>, R) {
        (q - *gradient * R::of(*s), R::of(*s))
    }
    #[inline(always)]
    fn force<S: Scalar>(&self, s: &S, eta: impl FnOnce() -> Vector<S, D>) -> Vector<S, D> {
        eta() * *s
    }
    #[inline(always)]
    fn energy<S: Scalar>(&self, s: &f64, z: Vector<S, D>) -> S {
        z.dot(z) * (0.5 * s)
    }
}

/// Any of the controls, A as a tensor: one type for laws that cost more than the control.
#[derive(Clone, Copy, Debug)]
pub enum AnyControl {
    /// [`Wan2019`].
    Wan2019,
    /// [`Isotropic`].
    Isotropic(Isotropic),
}

impl<const D: usize> Control<D> for AnyControl {
    type Shape = Matrix<f64, D>;
    type State<R: Scalar> = Matrix<R, D>;
    fn shape<I: Influence>(&self, c: &Stiffness<D>, inverse: &Matrix<f64, D>, omega: I, h: Reference<D>) -> Matrix<f64, D> {
        match self {
            AnyControl::Wan2019 => Wan2019.shape(c, inverse, omega, h),
            AnyControl::Isotropic(control) => Matrix::identity() * control.shape(c, inverse, omega, h),
        }
    }
    #[inline(always)]
    fn state<R: Scalar>(&self, a: &Matrix<f64, D>, q: Matrix<R, D>, gradient: &Matrix<R, D>) -> (Matrix<R, D>, Matrix<R, D>) {
        Control::<D>::state(&Wan2019, a, q, gradient)
    }
    #[inline(always)]
    fn force<S: Scalar>(&self, a: &Matrix<S, D>, eta: impl FnOnce() -> Vector<S, D>) -> Vector<S, D> {
        Wan2019.force(a, eta)
    }
    #[inline(always)]
    fn energy<S: Scalar>(&self, a: &Matrix<f64, D>, z: Vector<S, D>) -> S {
        Wan2019.energy(a, z)
    }
}

/// Wan et al. (2019) as published: A = C₁ = C:K⁻¹, (C₁)ᵢⱼ = Cᵢⱼₖₗ (K⁻¹)ₖₗ.
///
/// # Fails when
/// rotations are large: C₁ is a fixed tensor, so where it is no multiple of 1 (surfaces, clouds, anisotropy) a rigid
/// rotation stores energy.
#[derive(Clone, Copy, Debug)]
pub struct Wan2019;

impl<const D: usize> Control<D> for Wan2019 {
    type Shape = Matrix<f64, D>;
    type State<R: Scalar> = Matrix<R, D>;
    fn shape<I: Influence>(&self, c: &Stiffness<D>, inverse: &Matrix<f64, D>, _: I, _: Reference<D>) -> Matrix<f64, D> {
        c.stress(inverse)
    }
    #[inline(always)]
    fn state<R: Scalar>(&self, c1: &Matrix<f64, D>, q: Matrix<R, D>, gradient: &Matrix<R, D>) -> (Matrix<R, D>, Matrix<R, D>) {
        (q - c1.to() * *gradient, c1.to())
    }
    #[inline(always)]
    fn force<S: Scalar>(&self, c1: &Matrix<S, D>, eta: impl FnOnce() -> Vector<S, D>) -> Vector<S, D> {
        *c1 * eta()
    }
    #[inline(always)]
    fn energy<S: Scalar>(&self, c1: &Matrix<f64, D>, z: Vector<S, D>) -> S {
        (c1.to() * z).dot(z) * 0.5
    }
}
