use super::FLAT_FAMILY;
use crate::constitutive::{Deformation, Law};
use crate::family::{Bond, Family, Place, Reference};
use crate::influence::Influence;
use crate::material::{Material, SingularFamily};
use crate::scalar::{Scalar, array};
use crate::sub_horizon::WELL_SHAPED;
use crate::tensor::{Linear, Matrix, Vector};

/// What becomes of a sub-horizon whose bonds have no regular shape tensor: near a surface, or behind a crack.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EmptySubHorizon {
    /// It is dropped, and the others share the whole energy. Right in two and three dimensions.
    Renormalise,
    /// It carries no energy, and the others keep the share that they have among this many sub-horizons: a family cut in half stores
    /// half. The end edges of a bar of cells then have the mean modulus of their points.
    ZeroEnergy {
        /// N_SH
        of: u32,
    },
}

/// Correspondence on sub-horizons: a deformation gradient for each part of the family, whose energies are averaged. No deformation
/// but a rigid one is free of energy on a lattice, and nothing is added to the law.
///
/// # Equations
/// $$ K_\alpha = \int_{H_\alpha}\omega\,\xi\otimes\xi\,dV', \qquad
///    F_\alpha = 1 + \Big(\int_{H_\alpha}\omega\,\eta\otimes\xi\,dV'\Big)K_\alpha^{-1} $$
/// $$ W = \frac{1}{N}\sum_\alpha\psi(F_\alpha), \qquad
///    T\langle\xi\rangle = \frac{1}{N}\sum_{\alpha:\,\xi\in H_\alpha}\omega\,P(F_\alpha) K_\alpha^{-1}\xi $$
///
/// # Source
/// Roy Chowdhury, Roy, Roy and Reddy (2019), eqs. 20, 25 and 31.
///
/// # Units
/// K \[m⁵\], P \[Pa\], T \[N/m⁶\], W \[J/m³\], in 3D.
///
/// # Holds when
/// every sub-horizon lies in an open half-space, and its bonds have rank d and generate the lattice. Sub-horizons may overlap. Affine
/// maps are exact; each F_α is first order in δ, their mean second order.
///
/// # Fails when
/// ligaments are two or three points wide: one-sided families are first-order accurate only, and show it.
///
/// # Differs from the source
/// 1/N stands in T, as in eq. 31; eq. 43 lost it, and displacements with it shrink by N. Sub-horizons are closed: the open quadrants
/// of the source are singular with eight neighbours. A sub-horizon without a regular shape tensor is dropped or carries no energy
/// ([`EmptySubHorizon`]); where none is left the whole family serves as in conventional correspondence.
///
/// # Verified by
/// `physics/tests/contract.rs`, `physics/tests/symbol.rs`, `decks/papers/chowdhury2019`.
#[derive(Clone, Copy, Debug)]
pub struct SubHorizonCorrespondence<L, I, const N: usize> {
    /// The constitutive law.
    pub law: L,
    /// The influence function.
    pub omega: I,
    /// What becomes of sub-horizons that are not regular.
    pub empty: EmptySubHorizon,
}

/// What the reference family decides.
#[derive(Clone, Copy, Debug)]
pub struct SubHorizonShape<const D: usize, const N: usize> {
    /// K_α⁻¹, or zero; of the whole family in the first place where `whole`.
    inverse: [Matrix<f64, D>; N],
    /// Bit α: sub-horizon α is regular.
    regular: u8,
    /// No sub-horizon is: conventional correspondence.
    whole: bool,
    /// 1/N
    share: f64,
}

impl<L, I: Influence, const N: usize> SubHorizonCorrespondence<L, I, N> {
    /// `∫ ω a ⊗ ξ dV′` over every sub-horizon, or over the whole family in the first place.
    #[inline(always)]
    fn sums<S: Scalar, const D: usize>(
        &self,
        whole: bool,
        h: Family<S, D>,
        a: impl Fn(Bond<S, D>) -> Vector<S, D>,
    ) -> [Matrix<S::Sum, D>; N] {
        let mut sums = [<Matrix<S, D> as Linear<S>>::nothing(); N];
        h.each(
            #[inline(always)]
            |b| {
                let product = a(b).outer(b.xi());
                let weight = b.volume() * self.omega.at(b);
                if whole {
                    sums[0].add_times(weight, product);
                    return;
                }
                for k in 0..N {
                    if let Some(part) = b.share_of(k, weight) {
                        sums[k].add_times(part, product);
                    }
                }
            },
        );
        array(
            #[inline(always)]
            |k| sums[k].total(),
        )
    }
    /// `∫ ω η ⊗ ξ dV′`, and with the rate of η.
    #[inline(always)]
    fn integrals<S: Scalar, const D: usize>(&self, rate: bool, whole: bool, h: Family<S, D>) -> Integrals<S::Sum, D, N> {
        let gradients = self.sums(
            whole,
            h,
            #[inline(always)]
            |b| b.eta(),
        );
        let rates = if rate && h.has_velocity() {
            self.sums(
                whole,
                h,
                #[inline(always)]
                |b| b.eta_rate(),
            )
        } else {
            [Matrix::zero(); N]
        };
        (gradients, rates)
    }
}

/// `∫ ω η ⊗ ξ dV′` over every sub-horizon, and with the rate of η.
type Integrals<R, const D: usize, const N: usize> = ([Matrix<R, D>; N], [Matrix<R, D>; N]);

/// What the law sees in every sub-horizon.
#[inline(always)]
fn deformations<'a, R: Scalar, const D: usize, const N: usize>(
    words: usize,
    shape: &SubHorizonShape<D, N>,
    (gradients, rates): &Integrals<R, D, N>,
    place: Place<'a>,
) -> [Deformation<'a, R, D>; N] {
    let history = place.history(N * words);
    array(
        #[inline(always)]
        |k| {
            let inverse = shape.inverse[k].to();
            Deformation {
                gradient: gradients[k] * inverse,
                rate: rates[k] * inverse,
                temperature: place.temperature,
                time: place.time,
                memory: &history[k * words..(k + 1) * words],
            }
        },
    )
}

impl<L: Law<D>, I: Influence, const D: usize, const N: usize> Material<D> for SubHorizonCorrespondence<L, I, N> {
    /// Each sub-horizon keeps a history of its own.
    const MEMORY: usize = N * L::MEMORY;
    const RATE: bool = L::RATE;
    const CONSERVATIVE: bool = L::HYPERELASTIC;
    const STORED_INFLUENCE: bool = I::STORED;
    const SUB_HORIZONS: usize = N;
    type Constants = L::Constants;
    type Shape = SubHorizonShape<D, N>;
    type Weights<R: Scalar> = ();
    /// ∫ ω η ⊗ ξ dV′ over every sub-horizon, and with the rate of η
    type Moments<R: Scalar> = Integrals<R, D, N>;
    /// 1 where the whole family serves, and P_α K_α⁻¹/N
    type State<R: Scalar> = (R, [Matrix<R, D>; N]);

    fn shape(&self, _: &L::Constants, h: Reference<D>) -> Result<Self::Shape, SingularFamily> {
        let mut shape = SubHorizonShape { inverse: [Matrix::zero(); N], regular: 0, whole: false, share: 1.0 };
        for k in 0..N {
            let tensor: Matrix<f64, D> =
                h.integrate(|b| if b.belongs_to(k) { b.xi().outer(b.xi()) * self.omega.at(b) } else { Matrix::zero() });
            if let Some(inverse) = tensor.inverse_if_regular(WELL_SHAPED) {
                shape.inverse[k] = inverse;
                shape.regular |= 1 << k;
            }
        }
        if shape.regular == 0 {
            let tensor: Matrix<f64, D> = h.integrate(|b| b.xi().outer(b.xi()) * self.omega.at(b));
            shape.inverse[0] = tensor.inverse_if_regular(FLAT_FAMILY).ok_or(SingularFamily)?;
            (shape.regular, shape.whole) = (1, true);
            return Ok(shape);
        }
        shape.share = match self.empty {
            EmptySubHorizon::Renormalise => 1.0 / f64::from(shape.regular.count_ones()),
            EmptySubHorizon::ZeroEnergy { of } => 1.0 / f64::from(of),
        };
        Ok(shape)
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
        self.integrals(L::RATE, false, h)
    }
    fn is_regular(&self, shape: &Self::Shape) -> bool {
        !shape.whole
    }
    #[inline(always)]
    fn state<S: Scalar>(&self, c: &L::Constants, shape: &Self::Shape, h: Family<S, D>) -> Self::State<S::Sum> {
        self.state_of(c, shape, &self.integrals(L::RATE, shape.whole, h), h.place())
    }
    #[inline(always)]
    fn state_of<R: Scalar>(&self, c: &L::Constants, shape: &Self::Shape, moments: &Self::Moments<R>, place: Place) -> Self::State<R> {
        let f = deformations(L::MEMORY, shape, moments, place);
        let q = array(
            #[inline(always)]
            |k| {
                if shape.regular >> k & 1 == 0 {
                    return Matrix::zero();
                }
                self.law.first_piola(c, &f[k]) * (shape.inverse[k] * shape.share).to()
            },
        );
        (R::of(f64::from(u8::from(shape.whole))), q)
    }
    #[inline(always)]
    fn force<S: Scalar>(&self, (whole, q): &Self::State<S>, b: Bond<S, D>) -> Vector<S, D> {
        let xi = b.xi() * self.omega.at(b);
        // the same for all bonds of a family
        if whole.value() > 0.5 {
            return q[0] * xi;
        }
        let mut t = Vector::zero();
        for k in 0..N {
            if let Some(part) = b.share_of(k, xi) {
                t = q[k].times_plus(part, t);
            }
        }
        t
    }
    #[inline(always)]
    fn energy_density<S: Scalar>(&self, c: &L::Constants, shape: &Self::Shape, h: Family<S, D>) -> S::Sum {
        let f = deformations(L::MEMORY, shape, &self.integrals(L::RATE, shape.whole, h), h.place());
        let mut w = S::Sum::of(0.0);
        for k in 0..N {
            if shape.regular >> k & 1 == 1 {
                w += self.law.energy(c, &f[k]) * shape.share;
            }
        }
        w
    }
    fn commit(&self, c: &L::Constants, shape: &Self::Shape, h: Family<f64, D>, point: &mut [f64], _: &mut [&mut [f64]]) {
        if L::MEMORY == 0 {
            return;
        }
        for (k, f) in deformations(L::MEMORY, shape, &self.integrals(L::RATE, shape.whole, h), h.place()).iter().enumerate() {
            if shape.regular >> k & 1 == 1 {
                self.law.commit(c, f, &mut point[k * L::MEMORY..(k + 1) * L::MEMORY]);
            }
        }
    }
    /// The mean of the F_α of the sub-horizons that carry energy, which all weigh the same: each alone is of first order in δ, the mean in the
    /// interior of second.
    fn displacement_gradient(&self, _: &L::Constants, shape: &Self::Shape, h: Family<f64, D>) -> Matrix<f64, D> {
        let mut sum = Matrix::zero();
        for (k, f) in deformations(0, shape, &self.integrals(false, shape.whole, h), h.place()).iter().enumerate() {
            if shape.regular >> k & 1 == 1 {
                sum = sum + f.gradient;
            }
        }
        sum * (1.0 / f64::from(shape.regular.count_ones()))
    }
    fn out_of_plane_stress(&self, c: &L::Constants, shape: &Self::Shape, h: Family<f64, D>, _: &Matrix<f64, D>) -> f64 {
        let each = deformations(L::MEMORY, shape, &self.integrals(L::RATE, shape.whole, h), h.place());
        (0..N).filter(|k| shape.regular >> k & 1 == 1).map(|k| self.law.out_of_plane_stress(c, &each[k]) * shape.share).sum()
    }
    fn shortfall(&self, shape: &Self::Shape) -> Option<&'static str> {
        shape.whole.then_some("families without a regular sub-horizon, which serve as a whole")
    }
}
