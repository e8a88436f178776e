use crate::constitutive::{Strain, StrainLaw};
use crate::family::{Bond, Family, Place, Reference};
use crate::influence::Influence;
use crate::material::{Material, SingularFamily};
use crate::scalar::{Scalar, array};
use crate::tensor::{Matrix, Symmetric, Vector, symmetric_eigen};
use std::f64::consts::SQRT_2;

/// Extended correspondence: a law of classical mechanics, given in a strain and its conjugate stress, evaluated on a nonlocal strain
/// tensor that is made of nonlinear strains of the bonds. Ordinary: forces lie along the deformed bonds.
///
/// # Equations
/// With $c = |Y|^2/|\xi|^2$ and $n = \xi/|\xi|$:
///
/// $$ \varepsilon_{(m)} = \frac{c^m - 1}{2m} \;\Big(m = 0: \tfrac12\ln c\Big), \qquad
///    \bar E = \int\omega\,\varepsilon\,H\,dV', \qquad
///    T\langle\xi\rangle = (\sigma : H)\,\omega\,c^{m-1}\,\frac{Y}{|\xi|^2}, \qquad \sigma = \partial\psi/\partial\bar E $$
///
/// By default $H = G^{-1} : (n \otimes n)$ with the moment tensor $G = \int\omega\,n\otimes n\otimes n\otimes n\,dV'$ of the family, which
/// makes every uniform infinitesimal strain exact in every family with d(d + 1)/2 independent directions, and every dilatation with
/// rotation for every m. As published $H = A\,n\otimes n - B\,1$ with A = (d + 2)/2, B = 1/2 and $\int\omega\,dV' = d$ (in one dimension
/// both are the same).
///
/// The optional zero-energy control acts on the non-uniform part of the bond strain, $r = \varepsilon - n\cdot\bar E n$:
///
/// $$ W = \psi(\bar E) + \frac s2\int\omega\,r^2\,dV', \qquad
///    T\langle\xi\rangle = \big[\sigma:H + s\,(r - R:H)\big]\,\omega\,c^{m-1}\frac{Y}{|\xi|^2}, \qquad R = \int\omega\,r\,n\otimes n\,dV' $$
///
/// with $s = g\,d(d+2)G/\int\omega\,dV'$ (a bar: $g E/\int\omega\,dV'$), the stiffness of the deviatoric bonds of the linear peridynamic
/// solid where the strength g is 1. R vanishes where H is the corrected one and no bond broke.
///
/// # Source
/// Tupek & Radovitzky, J. Mech. Phys. Solids 65 (2014) 82–92, eqs. (8)–(13).
///
/// # Units
/// G and ∫ω dV′ \[m³ × that of ω\], σ \[Pa\], T \[N/m⁶\], W \[J/m³\], in 3D. The scale of ω does not matter.
///
/// # Holds when
/// strains are small, or the deformation is a dilatation, or m = 1: then $\varepsilon_{(1)} = n\cdot E n$ with the Green–Lagrange strain,
/// and every finite uniform F is exact. For other m a uniform F of finite deviatoric strain gives a mean of the bond strains, not
/// E₍ₘ₎: at a uniaxial stretch of 1/2 in 3D the logarithmic strain is −0.572 and not −0.693.
///
/// # Fails when
/// - no control is used: to first order the strain is a linear nonlocal operator, and on a lattice every wave vector with components
///   in {0, π/Δx} deforms without energy. Under a mean stress the trace of the stiffness of these modes has the sign of tr σ (2m + d − 2),
///   and in the checkerboard of all axes each of them: there the neutral exponent is **m = (2 − d)/2** (1/2 in a bar, 0 in the plane, −1/2 in
///   space), a larger one buckles in compression, a smaller one in tension. For waves along rows no exponent is neutral.
/// - a bond collapses while m > −d/2: a single coincident pair then has finite energy. For m ≤ 0 its strain has no bound, and an explicit
///   step must resolve it.
/// - the law needs F: only laws of a strain can be used.
///
/// # Differs from the source
/// The moment tensor, the constants for d = 1 and 2, and the control are not in the paper. The correction is frozen in the reference
/// state: when bonds break H is kept. In two dimensions plane strain and plane stress are matters of the law.
///
/// # Verified by
/// `physics/tests/contract.rs`, `physics/tests/extended.rs`, `physics/tests/symbol.rs`.
#[derive(Clone, Copy, Debug)]
pub struct ExtendedCorrespondence<L, I> {
    /// The law of the strain.
    pub law: L,
    /// The exponent m.
    pub exponent: SethHill,
    /// How the nonlocal strain is made of bond strains.
    pub calibration: BondStrainCalibration,
    /// Strength g of the zero-energy control, dimensionless; 0: none.
    pub control: f64,
    /// The influence function.
    pub omega: I,
}

/// How the nonlocal strain tensor is made of bond strains.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BondStrainCalibration {
    /// H = A n⊗n − B 1 with ω normalised on the family, eqs. (10)–(11): off by 5–8 % of the strain in lattice families of horizon
    /// ratio 3, by 30–170 % at faces and corners.
    AsPublished,
    /// H = G⁻¹ : n⊗n. A family whose G is singular (condition number beyond 10⁶, or fewer than d(d + 1)/2 independent directions) is an error.
    #[default]
    MomentTensor,
    /// The same, with the strains that a singular family does not see left at zero.
    TruncatedMomentTensor,
}

/// Smallest eigenvalue of G over its largest below which a strain counts as not seen.
const UNSEEN: f64 = 1e-6;

/// Largest magnitude of the exponent: c^(|m| + 1) of every stretch between 1/1000 and 1000 is then a number.
pub const MAX_EXPONENT: f64 = 50.0;

/// The exponent m of the Seth–Hill strains: 1 Green–Lagrange, 1/2 Biot, 0 logarithmic, −1 Almansi.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SethHill {
    m: f64,
    kind: Kind,
}

/// The exponents that need no power.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Two,
    One,
    Half,
    Zero,
    MinusHalf,
    MinusOne,
    MinusTwo,
    Real,
}

/// An exponent whose powers overflow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExponentError(
    /// The exponent.
    pub f64,
);

impl std::fmt::Display for ExponentError {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(
            f,
            "the Seth-Hill exponent {} is not usable: powers of ordinary stretches overflow; expected a number between -{MAX_EXPONENT} and {MAX_EXPONENT}",
            self.0
        )
    }
}
impl std::error::Error for ExponentError {}

impl SethHill {
    /// m
    pub fn value(self) -> f64 {
        self.m
    }
    /// The exponent m, any number between −[`MAX_EXPONENT`] and [`MAX_EXPONENT`].
    pub fn new(m: f64) -> Result<Self, ExponentError> {
        if m.is_nan() || m.abs() > MAX_EXPONENT {
            return Err(ExponentError(m));
        }
        let kind = match m {
            2.0 => Kind::Two,
            1.0 => Kind::One,
            0.5 => Kind::Half,
            -0.5 => Kind::MinusHalf,
            -1.0 => Kind::MinusOne,
            -2.0 => Kind::MinusTwo,
            // the logarithm to the last digit
            m if m.abs() < 1e-17 => Kind::Zero,
            _ => Kind::Real,
        };
        Ok(SethHill { m, kind })
    }
    /// m
    pub fn exponent(self) -> f64 {
        self.m
    }
    /// The exponent at which a mean stress neither stiffens nor softens the zero-energy modes of dimension `d`: (2 − d)/2.
    pub fn neutral(d: usize) -> Self {
        SethHill::new(1.0 - d as f64 / 2.0).expect("a small number")
    }
    /// ε₍ₘ₎ of a bond with c = 1 + x: keeps the digits of a small x, and is exactly 0 where x is.
    #[inline(always)]
    pub fn strain<S: Scalar>(self, x: S) -> S {
        self.strain_of(x, x + S::of(1.0))
    }
    /// The same where c is known too, with digits of its own near 0.
    #[inline(always)]
    fn strain_of<S: Scalar>(self, x: S, c: S) -> S {
        match self.kind {
            Kind::Two => x * (x + S::of(2.0)) * 0.25,
            Kind::One => x * 0.5,
            Kind::Half => stretch(x, c),
            Kind::Zero => x.ln_grown(c) * 0.5,
            // 1 − 1/√c = x/(c + √c)
            Kind::MinusHalf => x * (c + c.sqrt()).recip(),
            Kind::MinusOne => x * c.recip() * 0.5,
            Kind::MinusTwo => {
                let r = c.recip();
                x * (x + S::of(2.0)) * 0.25 * (r * r)
            }
            Kind::Real => (x.ln_grown(c) * self.m).exp_m1() * (0.5 / self.m),
        }
    }
    /// c^(m − 1) = 2 dε/dc
    #[inline(always)]
    fn slope<S: Scalar>(self, x: S, c: S) -> S {
        match self.kind {
            Kind::Two => c,
            Kind::One => S::of(1.0),
            Kind::Half => c.rsqrt(),
            Kind::Zero => c.recip(),
            Kind::MinusHalf => c.rsqrt() * c.recip(),
            Kind::MinusOne => {
                let r = c.recip();
                r * r
            }
            Kind::MinusTwo => {
                let r = c.recip();
                r * r * r
            }
            Kind::Real => (x.ln_grown(c) * (self.m - 1.0)).exp(),
        }
    }
}

/// √c − 1 = x/(√c + 1) with x = c − 1: the stretch of a bond, that of a small strain and of a bond close to collapse alike.
#[inline(always)]
fn stretch<S: Scalar>(x: S, c: S) -> S {
    x * (c.sqrt() + S::of(1.0)).recip()
}

/// A symmetric linear map of strains, in the components of Mandel, rows of its upper triangle one after the other.
#[derive(Clone, Copy, Debug)]
pub struct StrainMap([f64; 21]);

impl StrainMap {
    /// Word of entry (i, j), i ≤ j, for `n` components.
    #[inline(always)]
    const fn at(n: usize, i: usize, j: usize) -> usize {
        i * n - i * (i + 1) / 2 + j
    }
    fn new(n: usize, f: impl Fn(usize, usize) -> f64) -> Self {
        let mut words = [0.0; 21];
        for i in 0..n {
            for j in i..n {
                words[Self::at(n, i, j)] = f(i, j);
            }
        }
        StrainMap(words)
    }
    #[inline(always)]
    fn apply<R: Scalar, const D: usize>(&self, x: Symmetric<R, D>) -> Symmetric<R, D> {
        let n = D * (D + 1) / 2;
        let mut y = [R::of(0.0); 6];
        for i in 0..n {
            for j in 0..n {
                y[i] += x.0[j] * self.0[if i < j { Self::at(n, i, j) } else { Self::at(n, j, i) }];
            }
        }
        Symmetric(y)
    }
}

/// What the reference family decides.
#[derive(Clone, Copy, Debug)]
pub struct BondStrainShape {
    /// ∫ ω ε n⊗n dV′ → Ē, and σ → the Q of σ : H = n·Q n.
    map: StrainMap,
    /// G of the intact bonds.
    moment: StrainMap,
    /// s
    control: f64,
    /// Whether some strain is not seen.
    truncated: bool,
}

/// 1/|ξ|², c − 1 = (2ξ·η + η·η)/|ξ|² and c of a bond.
#[inline(always)]
fn growth<S: Scalar, const D: usize>(xi: Vector<S, D>, eta: Vector<S, D>) -> (S, S, S) {
    let (inverse, y) = (xi.dot(xi).recip(), xi + eta);
    (inverse, eta.dot(xi + y) * inverse, y.dot(y) * inverse)
}

impl<L, I: Influence> ExtendedCorrespondence<L, I> {
    /// ∫ ω ε n⊗n dV′ (Mandel).
    #[inline(always)]
    fn sum<S: Scalar, const D: usize>(&self, h: Family<S, D>) -> Symmetric<S::Sum, D> {
        h.integrate(
            #[inline(always)]
            |b| {
                let xi = b.xi();
                let (inverse, x, c) = growth(xi, b.eta());
                let weight = self.omega.at(b) * self.exponent.strain_of(x, c) * inverse;
                Symmetric::square(xi).zip(Symmetric([weight; 6]), |a, w| a * w)
            },
        )
        .scaled_off_diagonal(SQRT_2)
    }
    /// Ē of a family (Mandel).
    #[inline(always)]
    fn strain<S: Scalar, const D: usize>(&self, shape: &BondStrainShape, h: Family<S, D>) -> Symmetric<S::Sum, D> {
        shape.map.apply(self.sum(h))
    }
    fn moment<const D: usize>(&self, h: Reference<D>) -> StrainMap {
        let n = D * (D + 1) / 2;
        let mut g = [[0.0; 6]; 6];
        for (i, row) in g.iter_mut().enumerate().take(n) {
            // a row at a time: what an integral can add up are symmetric tensors
            row.copy_from_slice(
                &h.integrate(|b| direction(b.xi()).zip(Symmetric([direction(b.xi()).0[i] * self.omega.at(b); 6]), |a, w| a * w)).0,
            );
        }
        StrainMap::new(n, |i, j| g[i][j])
    }
}

/// n ⊗ n in the components of Mandel.
fn direction<const D: usize>(xi: Vector<f64, D>) -> Symmetric<f64, D> {
    Symmetric::square(xi * (1.0 / xi.norm())).scaled_off_diagonal(SQRT_2)
}

impl<L: StrainLaw<D>, I: Influence, const D: usize> Material<D> for ExtendedCorrespondence<L, I> {
    const MEMORY: usize = L::MEMORY;
    const STORED_INFLUENCE: bool = I::STORED;
    type Constants = L::Constants;
    type Shape = BondStrainShape;
    type Weights<R: Scalar> = ();
    /// ∫ ω ε n⊗n dV′ (Mandel)
    type Moments<R: Scalar> = Symmetric<R, D>;
    /// Q with unequal indices doubled, and s: T = ω (n·Q n + s ε) c^(m − 1) Y/|ξ|²
    type State<R: Scalar> = (Symmetric<R, D>, R);

    fn shape(&self, c: &L::Constants, h: Reference<D>) -> Result<BondStrainShape, SingularFamily> {
        let n = D * (D + 1) / 2;
        let weight: f64 = h.integrate(|b| self.omega.at(b));
        if weight.is_nan() || weight <= 0.0 {
            return Err(SingularFamily);
        }
        let moment = self.moment(h);
        let mut truncated = false;
        let map = match self.calibration {
            BondStrainCalibration::AsPublished => {
                // A M − B tr(M) 1, times N/∫ω dV′
                let (a, b, scale) = (0.5 * (D + 2) as f64, 0.5, D as f64 / weight);
                StrainMap::new(n, |i, j| scale * (if i == j { a } else { 0.0 } - if i < D && j < D { b } else { 0.0 }))
            }
            BondStrainCalibration::MomentTensor | BondStrainCalibration::TruncatedMomentTensor => {
                let full: Vec<f64> =
                    (0..n * n).map(|k| moment.0[StrainMap::at(n, (k / n).min(k % n), (k / n).max(k % n))] / weight).collect();
                let (values, vectors) = symmetric_eigen(&full, n);
                let seen = |x: f64| x > UNSEEN * values[n - 1];
                truncated = !seen(values[0]);
                if truncated && self.calibration == BondStrainCalibration::MomentTensor {
                    return Err(SingularFamily);
                }
                StrainMap::new(n, |i, j| {
                    (0..n).filter(|&k| seen(values[k])).map(|k| vectors[k * n + i] * vectors[k * n + j] / (values[k] * weight)).sum()
                })
            }
        };
        let stiffness = self.law.stiffness(c);
        let modulus = if D == 1 { stiffness.voigt[0][0] } else { (D * (D + 2)) as f64 * stiffness.average.shear() };
        Ok(BondStrainShape { map, moment, control: self.control * modulus / weight, truncated })
    }
    fn reshape(&self, _: &L::Constants, shape: &BondStrainShape, h: Reference<D>) -> Result<BondStrainShape, SingularFamily> {
        Ok(BondStrainShape { moment: self.moment(h), ..*shape })
    }
    #[inline(always)]
    fn weights<R: Scalar>(&self, _: &BondStrainShape) {}
    #[inline(always)]
    fn moments<S: Scalar>(&self, (): &(), h: Family<S, D>) -> Symmetric<S::Sum, D> {
        self.sum(h)
    }
    #[inline(always)]
    fn state_of<R: Scalar>(&self, c: &L::Constants, shape: &BondStrainShape, sum: &Symmetric<R, D>, place: Place) -> Self::State<R> {
        let strain = shape.map.apply(*sum);
        let stress = self.law.stress(c, &seen_by_law(L::MEMORY, strain, place));
        let stress = Symmetric::of_matrix(&stress).scaled_off_diagonal(SQRT_2);
        let q = if self.control > 0.0 {
            // Q : n n + s ε with Q = L : (σ − s R) − s Ē, R = ∫ω ε nn − G : Ē
            let s = R::of(shape.control);
            let rest = sum.zip(shape.moment.apply(strain), |a, b| a - b);
            shape.map.apply(stress.zip(rest, |a, b| a - b * s)).zip(strain, |a, b| a - b * s)
        } else {
            shape.map.apply(stress)
        };
        (q.scaled_off_diagonal(SQRT_2), R::of(shape.control))
    }
    #[inline(always)]
    fn force<S: Scalar>(&self, (q, s): &Self::State<S>, b: Bond<S, D>) -> Vector<S, D> {
        let (xi, eta) = (b.xi(), b.eta());
        let (inverse, x, c) = growth(xi, eta);
        let mut along = q.dot(Symmetric::square(xi)) * inverse;
        if self.control > 0.0 {
            along = s.fma(self.exponent.strain_of(x, c), along);
        }
        (xi + eta) * (self.omega.at(b) * along * inverse * self.exponent.slope(x, c))
    }
    #[inline(always)]
    fn energy_density<S: Scalar>(&self, c: &L::Constants, shape: &BondStrainShape, h: Family<S, D>) -> S::Sum {
        let strain = self.strain(shape, h);
        let mut energy = self.law.energy(c, &seen_by_law(L::MEMORY, strain, h.place()));
        if self.control > 0.0 {
            let uniform: Symmetric<S, D> = Symmetric(array(
                #[inline(always)]
                |k| S::lift(strain.0[k]),
            ))
            .scaled_off_diagonal(SQRT_2);
            let square = h.integrate(
                #[inline(always)]
                |b| {
                    let xi = b.xi();
                    let (inverse, x, c) = growth(xi, b.eta());
                    let r = self.exponent.strain_of(x, c) - uniform.dot(Symmetric::square(xi)) * inverse;
                    self.omega.at(b) * r * r
                },
            );
            energy += square * (0.5 * shape.control);
        }
        energy
    }
    fn commit(&self, c: &L::Constants, shape: &BondStrainShape, h: Family<f64, D>, point: &mut [f64], _: &mut [&mut [f64]]) {
        if L::MEMORY > 0 {
            let strain = self.strain(shape, h);
            self.law.commit(c, &seen_by_law(L::MEMORY, strain, h.place()), point);
        }
    }
    fn collapse(&self) -> bool {
        // c^(m − 1) of eq. (13)
        self.exponent.value() < 1.0
    }
    fn extended_strain(&self, _: &L::Constants, shape: &BondStrainShape, h: Family<f64, D>) -> Option<Matrix<f64, D>> {
        Some(self.strain(shape, h).scaled_off_diagonal(1.0 / SQRT_2).matrix())
    }
    fn shortfall(&self, shape: &BondStrainShape) -> Option<&'static str> {
        shape.truncated.then_some("fewer than d(d + 1)/2 independent directions: strains that no bond sees are left at zero")
    }
    /// The law's, conjugate to Ē.
    fn out_of_plane_stress(&self, c: &L::Constants, shape: &BondStrainShape, h: Family<f64, D>, _: &Matrix<f64, D>) -> f64 {
        self.law.out_of_plane_stress(c, &seen_by_law(L::MEMORY, self.strain(shape, h), h.place()))
    }
}

/// What the law sees of Ē, given in the components of Mandel.
#[inline(always)]
fn seen_by_law<R: Scalar, const D: usize>(words: usize, strain: Symmetric<R, D>, place: Place) -> Strain<R, D> {
    Strain { tensor: strain.scaled_off_diagonal(1.0 / SQRT_2).matrix(), temperature: place.temperature, memory: place.history(words) }
}
