use crate::elasticity::{Isotropic, Section};
use crate::family::{Bond, Family, Place, Reference, Undeformed};
use crate::influence::Influence;
use crate::material::{Material, SingularFamily};
use crate::scalar::Scalar;
use crate::tensor::{Matrix, Vector};

/// Linear peridynamic solid: ordinary, state-based, any Poisson's ratio.
///
/// # Equations
/// With the weighted volume $m = \int\omega|\xi|^2dV'$, the dilatation $\theta = \frac{d}{m}\int\omega|\xi|e\,dV'$ and
/// the deviatoric extension $e^d = e - \theta|\xi|/d$:
///
/// $$ T\langle\xi\rangle = \left[\frac{d\,\kappa\,\theta}{m}\,\omega|\xi| + \alpha\,\omega\,e^d\right] y, \qquad
///    W = \frac{\kappa\theta^2}{2} + \frac{\alpha}{2}\int\omega\,(e^d)^2dV', \qquad \alpha = \frac{d(d+2)G}{m} $$
///
/// In 3D (d = 3) κ = k and α = 15G/m. In 2D θ is the trace in the plane, α = 8G/m and κ the area modulus: λ + μ in plane
/// strain, E/(2(1 − ν)) in plane stress.
///
/// # Source
/// Silling et al., J. Elasticity 88 (2007) 151–184, section 15; O'Grady (2014), eq. (3.7)–(3.8), 4.3.2 and 4.4 (2D).
///
/// # Units
/// m \[m⁵\], T \[N/m⁶\], W \[J/m³\], in 3D.
///
/// # Holds when
/// −1 < ν < 1/2.
///
/// # Fails when
/// a 1D body is asked for: a bar has one constant only and is bond-based.
///
/// # Differs from the source
/// Without the fourth-moment weights ([`isotropy`](crate::isotropy)) a lattice family is not isotropic: at a horizon ratio of
/// 3 (ω = 1) the energy of a shear along its axes is 4 % low in the plane and 11 % high in 3D. m is kept when bonds break (or rebuilt from those that
/// are left, by option: a damaged family then keeps the moduli of the whole one), and the energy is then
/// $W = \tfrac12(\kappa - \alpha m/d^2)\theta^2 + \tfrac{\alpha}{2}\int\omega e^2dV'$ over the intact bonds: equal to the one
/// above in a whole family, and still the one whose derivative T is.
///
/// # Verified by
/// `physics/tests/contract.rs`, `decks/patch-tests`, `decks/block`.
#[derive(Clone, Copy, Debug)]
pub struct LinearPeridynamicSolid<I> {
    /// The influence function.
    pub omega: I,
}

/// Constants of [`LinearPeridynamicSolid`].
#[derive(Clone, Copy, Debug)]
pub struct LinearPeridynamicSolidConstants {
    /// Bulk modulus k (3D) or area modulus of the section \[Pa\].
    pub bulk: f64,
    /// Shear modulus G \[Pa\].
    pub shear: f64,
    /// σ₃₃/(σ₁₁ + σ₂₂): ν in plane strain, else 0.
    pub out_of_plane: f64,
    /// Whether m is rebuilt from the intact bonds when bonds break.
    pub rebuild: bool,
}

impl LinearPeridynamicSolidConstants {
    /// From isotropic constants.
    pub fn new(m: Isotropic, section: Section) -> Self {
        let out_of_plane = if matches!(section, Section::PlaneStrain { .. }) { m.poisson } else { 0.0 };
        LinearPeridynamicSolidConstants { bulk: m.bulk_of(section), shear: m.shear(), out_of_plane, rebuild: false }
    }
    /// The same with m rebuilt from the intact bonds when bonds break.
    pub fn rebuilt(self) -> Self {
        LinearPeridynamicSolidConstants { rebuild: true, ..self }
    }
}

impl<I: Influence> LinearPeridynamicSolid<I> {
    /// α = d (d + 2) G/m
    #[inline(always)]
    fn alpha<const D: usize>(c: &LinearPeridynamicSolidConstants, m: f64) -> f64 {
        (D * (D + 2)) as f64 * c.shear / m
    }
}

impl<I: Influence, const D: usize> Material<D> for LinearPeridynamicSolid<I> {
    const STORED_INFLUENCE: bool = I::STORED;
    type Constants = LinearPeridynamicSolidConstants;
    /// m
    type Shape = f64;
    type Weights<R: Scalar> = ();
    /// m θ/d = ∫ ω |ξ| e dV′
    type Moments<R: Scalar> = R;
    /// a = d κ θ/m − α θ/d, and α: T = ω (a |ξ| + α e) y
    type State<R: Scalar> = [R; 2];

    fn shape(&self, _: &Self::Constants, h: Reference<D>) -> Result<f64, SingularFamily> {
        let m: f64 = h.integrate(|b| self.omega.at(b) * b.length() * b.length());
        if m > 0.0 { Ok(m) } else { Err(SingularFamily) }
    }
    fn rebuilds(&self, c: &Self::Constants) -> bool {
        c.rebuild
    }
    fn reshape(&self, c: &Self::Constants, m: &f64, h: Reference<D>) -> Result<f64, SingularFamily> {
        if c.rebuild { self.shape(c, h) } else { Ok(*m) }
    }
    #[inline(always)]
    fn weights<R: Scalar>(&self, _: &f64) {}
    #[inline(always)]
    fn moments<S: Scalar>(&self, (): &(), h: Family<S, D>) -> S::Sum {
        h.integrate(
            #[inline(always)]
            |b| self.omega.at(b) * b.length() * b.extension().0,
        )
    }
    #[inline(always)]
    fn state_of<R: Scalar>(&self, c: &Self::Constants, m: &f64, moment: &R, _: Place) -> [R; 2] {
        let (d, alpha) = (D as f64, Self::alpha::<D>(c, *m));
        let theta = *moment * (d / m);
        [theta * (d * c.bulk / m - alpha / d), R::of(alpha)]
    }
    #[inline(always)]
    fn force<S: Scalar>(&self, &[spherical, alpha]: &[S; 2], b: Bond<S, D>) -> Vector<S, D> {
        let (e, y) = b.extension();
        y * (self.omega.at(b) * alpha.fma(e, spherical * b.length()))
    }
    #[inline(always)]
    fn energy_density<S: Scalar>(&self, c: &Self::Constants, m: &f64, h: Family<S, D>) -> S::Sum {
        // κθ²/2 + α/2 ∫ω(eᵈ)² with the square expanded and ∫ωe|ξ| = mθ/d put in. For a whole family the two are the same;
        // where bonds broke and m is kept, this is the one whose derivative the force state is, and it is never negative
        let d = D as f64;
        let alpha = Self::alpha::<D>(c, *m);
        let (first, square) = h.integrate(
            #[inline(always)]
            |b| {
                let (e, omega) = (b.extension().0, self.omega.at(b));
                (omega * b.length() * e, omega * e * e)
            },
        );
        let theta = first * (d / m);
        theta * theta * (0.5 * (c.bulk - alpha * m / (d * d))) + square * (0.5 * alpha)
    }
    fn out_of_plane_stress(&self, c: &Self::Constants, _: &f64, _: Family<f64, D>, s: &Matrix<f64, D>) -> f64 {
        c.out_of_plane * s.trace()
    }
}
