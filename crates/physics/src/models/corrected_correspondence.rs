use super::FLAT_FAMILY;
use crate::constitutive::{Deformation, Law};
use crate::family::{Bond, Family, Place, Reference};
use crate::influence::Influence;
use crate::material::{Material, SingularFamily};
use crate::scalar::{Scalar, array, lift};
use crate::tensor::{Linear, Matrix, Vector};
use crate::zero_energy::Control;

/// Correspondence with a corrected influence function: the deformation gradient is exact for polynomials of degree `order`, not for
/// affine maps alone.
///
/// # Equations
/// With the monomials p of ξ/δ of degree 1 to N, and the vector weight g,
/// $$ M = \int\omega\,p\,p^T dV', \qquad g = \omega\,[M^{-1}p]_{1..d}/\delta, \qquad
///    F = 1 + \int\eta\otimes g\,dV', \qquad T\langle\xi\rangle = P\,g $$
/// and the zero-energy control with tensor A on z = η − (F − 1) ξ, whose force state is
/// $$ \omega A z - R\,g, \qquad R = A\int\omega\,z\otimes\xi\,dV' $$
/// (R vanishes in conventional correspondence).
///
/// # Source
/// Roy Chowdhury, Roy, Roy and Reddy (2019), eqs. 8–18, in one dimension; in more dimensions a scalar correction has too few
/// coefficients (seven conditions for three of them with d = 2, N = 2), and the weight is a vector, as in the peridynamic
/// differential operator. In one dimension both are the same.
///
/// # Units
/// g \[1/m⁴\], P \[Pa\], T \[N/m⁶\], W \[J/m³\], in 3D.
///
/// # Holds when
/// the family has as many independent bonds as there are monomials. F is of order N in δ for even N, N + 1 for odd N in symmetric
/// families.
///
/// # Fails when
/// no control is used: the correction is even where the family is symmetric, so the modes with components of k in {0, π/Δx} keep zero
/// energy whatever N.
///
/// # Differs from the source
/// the influence function stands in the moments (eq. 11 lost it); moments are those of ξ over the power of two next to δ; the order is lowered in families with too
/// few bonds, without which orders above the number of neighbours have no solution at the ends of a bar.
///
/// # Computed
/// as g of each bond, the same in F and in T. The integrals of η with every monomial, of which F and T are sums, would take two thirds of the
/// operations, but monomials of high order cancel, and of the eight digits of a nearly singular bar (order 6, Fig. 3 of the paper) two would be lost.
///
/// # Verified by
/// `physics/tests/contract.rs`, `physics/tests/symbol.rs`, `catalog/tests/lattice.rs`, `decks/papers/chowdhury2019`.
#[derive(Clone, Copy, Debug)]
pub struct CorrectedCorrespondence<L, Z, I, const M: usize> {
    /// The constitutive law.
    pub law: L,
    /// The zero-energy control.
    pub control: Z,
    /// The influence function.
    pub omega: I,
    /// N: the degree of the polynomials whose gradient is exact. `M` must not be less than their number.
    pub order: usize,
}

/// Number of monomials of degree 1 to `order` in `d` variables.
pub const fn monomial_count(d: usize, order: usize) -> usize {
    // (order + d) over d, without the constant
    let (mut count, mut k) = (1, 1);
    while k <= d {
        count = count * (order + k) / k;
        k += 1;
    }
    count - 1
}

/// Number of monomials of whole degrees that `m` entries hold.
const fn whole_degrees(d: usize, m: usize) -> usize {
    let mut order = 0;
    while monomial_count(d, order + 1) <= m {
        order += 1;
    }
    monomial_count(d, order)
}

/// Largest order of a dimension.
pub const LARGEST_ORDER: [usize; 3] = [10, 4, 3];

/// Part of a monomial that the ones before it do not explain, below which a family cannot tell it from them.
const DEPENDENT: f64 = 1e-8;

/// The monomials of degree 1 to N in `D` variables, by degree, as products: each is a variable times an earlier one.
struct Monomials<const D: usize, const M: usize>;

impl<const D: usize, const M: usize> Monomials<D, M> {
    /// For each monomial the variable and the number of the earlier one, its own where there is none.
    const FACTORS: [(usize, usize); M] = {
        let mut factors = [(0, 0); M];
        // the first variable of each: one that comes before it would make a monomial again that is there
        let mut first = [0; M];
        let (mut at, mut before, mut end) = (0, 0, 0);
        while at < whole_degrees(D, M) {
            let mut variable = 0;
            while variable < D {
                if end == 0 {
                    (factors[at], first[at]) = ((variable, at), variable);
                    at += 1;
                }
                let mut k = before;
                while k < end {
                    if first[k] >= variable {
                        (factors[at], first[at]) = ((variable, k), variable);
                        at += 1;
                    }
                    k += 1;
                }
                variable += 1;
            }
            (before, end) = (end, at);
        }
        factors
    };

    /// The values of the `N` first ones, or of all.
    #[inline(always)]
    fn first<S: Scalar, const N: usize>(s: Vector<S, D>) -> [S; N] {
        let mut p = [S::of(0.0); N];
        for k in 0..const { if N < M { N } else { M } } {
            let (variable, before) = Self::FACTORS[k];
            p[k] = if before == k { s.0[variable] } else { s.0[variable] * p[before] };
        }
        p
    }

    /// The values of the `used` first ones, zeros beyond.
    fn of(s: Vector<f64, D>, used: usize) -> [f64; M] {
        let mut p = Self::first(s);
        p[used..].fill(0.0);
        p
    }

    /// Their degrees.
    fn degrees() -> [i32; M] {
        let mut degrees = [1; M];
        for (k, (_, before)) in Self::FACTORS.into_iter().enumerate() {
            degrees[k] = if before == k { 1 } else { degrees[before] + 1 };
        }
        degrees
    }
}

/// Monomials of order 3 in space: [`for_whole_degrees`] knows no more.
const MOST_MONOMIALS: usize = 19;

/// Evaluates an expression with `$n` a number of monomials, known when the program is compiled, that holds the `$used` of whole degrees in `$d`
/// variables: loops over them can then be written out.
macro_rules! for_whole_degrees {
    ($d:expr, $used:expr, $n:ident => $e:expr) => {
        if $used <= 3 {
            const $n: usize = 3;
            $e
        } else if $d < 3 && $used <= 5 {
            const $n: usize = 5;
            $e
        } else if $used <= 9 {
            const $n: usize = 9;
            $e
        } else if $d < 3 && $used <= 14 {
            const $n: usize = 14;
            $e
        } else {
            const $n: usize = MOST_MONOMIALS;
            $e
        }
    };
}

/// Largest ∫ |g||ξ| dV′, by which a correction of order N multiplies what bonds do at random, over the 2ᴺ of N points on one side.
/// Families that would need more have a lower order.
pub const LARGEST_AMPLIFICATION: f64 = 2.0;

/// What the reference family decides.
#[derive(Clone, Copy, Debug)]
pub struct CorrectedShape<A, const D: usize, const M: usize> {
    /// g = ω · coefficients · p(ξ); zeros for monomials that are not in use.
    coefficients: [[f64; M]; D],
    /// Whether the order was lowered.
    lowered: bool,
    /// K = ∫ ω ξ ⊗ ξ dV′
    tensor: Matrix<f64, D>,
    control: A,
}

/// What a force needs: P − R, A (F − 1), A, and the coefficients of g.
pub type CorrectedState<R, A, const D: usize, const M: usize> = ((Matrix<R, D>, Matrix<R, D>), (A, [[R; M]; D]));

/// Coefficients of g for the highest order that the bonds (ξ over a length near δ, ωV′) support, at most `order`: and that order, 0 where there is none.
///
/// With the rows √(ωV′) pᵀ = Q R the coefficients are the first columns of R⁻¹R⁻ᵀ: half the digits of M would be lost by forming it.
fn solve<const D: usize, const M: usize>(bonds: &[(Vector<f64, D>, f64)], order: usize) -> ([[f64; M]; D], usize) {
    const { assert!(M <= MOST_MONOMIALS, "monomials beyond these would be left out without a word") };
    let used_at = |n: usize| monomial_count(D, n);
    let used = used_at(order);
    let rows: Vec<[f64; M]> = bonds.iter().map(|(s, w)| Monomials::<D, M>::of(*s, used).map(|p| p * w.max(0.0).sqrt())).collect();
    // Gram and Schmidt, twice, column by column
    let mut q = rows.clone();
    let mut r = [[0.0; M]; M];
    let mut independent = 0;
    for k in 0..used {
        let norm = |q: &[[f64; M]]| q.iter().map(|row| row[k] * row[k]).sum::<f64>().sqrt();
        let before = norm(&q);
        for _ in 0..2 {
            for l in 0..k {
                let along: f64 = q.iter().map(|row| row[l] * row[k]).sum();
                r[l][k] += along;
                q.iter_mut().for_each(|row| row[k] -= along * row[l]);
            }
        }
        let left = norm(&q);
        if left.is_nan() || left <= DEPENDENT * before {
            break;
        }
        r[k][k] = left;
        q.iter_mut().for_each(|row| row[k] /= left);
        independent = k + 1;
    }
    // in one dimension n neighbours support order n; in more a degree counts when all its monomials are there
    for order in (1..=order).rev().filter(|&n| used_at(n) <= independent) {
        let n = used_at(order);
        let mut coefficients = [[0.0; M]; D];
        for (d, c) in coefficients.iter_mut().enumerate() {
            let unit = |k: usize| f64::from(u8::from(k == d));
            // the later rounds remove the round-off of the first from the moments
            for round in 0..3 {
                let mut missing: [f64; M] = array(unit);
                if round > 0 {
                    for row in &rows {
                        let along: f64 = (0..n).map(|k| row[k] * c[k]).sum();
                        (0..n).for_each(|k| missing[k] -= row[k] * along);
                    }
                }
                // Rᵀ y = e_d, then R c = y
                let mut y = [0.0; M];
                for k in 0..n {
                    let known: f64 = (0..k).map(|l| r[l][k] * y[l]).sum();
                    y[k] = (missing[k] - known) / r[k][k];
                }
                let mut more = [0.0; M];
                for k in (0..n).rev() {
                    let known: f64 = (k + 1..n).map(|l| r[k][l] * more[l]).sum();
                    more[k] = (y[k] - known) / r[k][k];
                    c[k] += more[k];
                }
            }
        }
        let amplification: f64 = bonds.iter().map(|(s, w)| w * weight::<f64, D, M, M>(&coefficients, *s).norm() * s.norm()).sum();
        if order == 1 || amplification <= LARGEST_AMPLIFICATION * f64::powi(2.0, order as i32) {
            return (coefficients, order);
        }
    }
    ([[0.0; M]; D], 0)
}

/// The weight g/ω of a bond, with the coefficients of the `N` first monomials.
#[inline(always)]
fn weight<S: Scalar, const D: usize, const M: usize, const N: usize>(coefficients: &[[S; M]; D], xi: Vector<S, D>) -> Vector<S, D> {
    let p = Monomials::<D, M>::first::<S, N>(xi);
    Vector(array(
        #[inline(always)]
        |d| {
            let mut g = S::of(0.0);
            for (c, p) in coefficients[d].iter().zip(&p) {
                g = c.fma(*p, g);
            }
            g
        },
    ))
}

impl<L, Z, I: Influence, const M: usize> CorrectedCorrespondence<L, Z, I, M> {
    /// Monomials in use; in families of a lower order some of their coefficients are zero.
    #[inline(always)]
    fn used<const D: usize>(&self) -> usize {
        monomial_count(D, self.order)
    }
    /// ∫ a ⊗ g dV′ and ∫ ω a ⊗ ξ dV′
    #[inline(always)]
    fn gradient<S: Scalar, const D: usize, const N: usize>(
        &self,
        coefficients: &[[S; M]; D],
        h: Family<S, D>,
        a: impl Fn(Bond<S, D>) -> Vector<S, D>,
    ) -> (Matrix<S::Sum, D>, Matrix<S::Sum, D>) {
        let mut sums = [<Matrix<S, D> as Linear<S>>::nothing(); 2];
        h.each(
            #[inline(always)]
            |b| {
                let a = a(b) * (self.omega.at(b) * b.volume());
                let xi = b.xi();
                for (sum, weight) in sums.iter_mut().zip([weight::<S, D, M, N>(coefficients, xi), xi]) {
                    sum.add_outer(a, weight);
                }
            },
        );
        (sums[0].total(), sums[1].total())
    }
    /// The integrals of [`gradient`](Self::gradient), and the first with the rate of η.
    #[inline(always)]
    fn integrals<S: Scalar, const D: usize>(&self, rate: bool, coefficients: &[[S; M]; D], h: Family<S, D>) -> Integrals<S::Sum, D> {
        for_whole_degrees!(D, self.used::<D>(), N => {
            let (gradient, moment) = self.gradient::<S, D, N>(
                coefficients,
                h,
                #[inline(always)]
                |b| b.eta(),
            );
            let rate = if rate && h.has_velocity() {
                self.gradient::<S, D, N>(
                    coefficients,
                    h,
                    #[inline(always)]
                    |b| b.eta_rate(),
                )
                .0
            } else {
                Matrix::zero()
            };
            ((gradient, rate), moment)
        })
    }
}

/// F − 1 and its rate, and ∫ ω η ⊗ ξ dV′.
type Integrals<R, const D: usize> = ((Matrix<R, D>, Matrix<R, D>), Matrix<R, D>);

/// What the law sees.
#[inline(always)]
fn deformation<'a, R: Scalar, const D: usize>(
    words: usize,
    &((gradient, rate), _): &Integrals<R, D>,
    place: Place<'a>,
) -> Deformation<'a, R, D> {
    Deformation { gradient, rate, temperature: place.temperature, time: place.time, memory: place.history(words) }
}

impl<L: Law<D>, Z: Control<D>, I: Influence, const D: usize, const M: usize> Material<D> for CorrectedCorrespondence<L, Z, I, M> {
    const MEMORY: usize = L::MEMORY;
    const RATE: bool = L::RATE;
    const CONSERVATIVE: bool = L::HYPERELASTIC;
    const STORED_INFLUENCE: bool = I::STORED;
    type Constants = L::Constants;
    type Shape = CorrectedShape<Z::Shape, D, M>;
    type Weights<R: Scalar> = [[R; M]; D];
    type Moments<R: Scalar> = Integrals<R, D>;
    type State<R: Scalar> = CorrectedState<R, Z::State<R>, D, M>;

    fn shape(&self, c: &L::Constants, h: Reference<D>) -> Result<Self::Shape, SingularFamily> {
        let tensor: Matrix<f64, D> = h.integrate(|b| b.xi().outer(b.xi()) * self.omega.at(b));
        let inverse = tensor.inverse_if_regular(FLAT_FAMILY).ok_or(SingularFamily)?;
        // a power of two: between monomials of ξ over it and those of ξ no digit is lost, and high orders need them all
        let scale = (-h.horizon().log2().round()).exp2();
        let mut bonds = vec![];
        h.each(|b| bonds.push((b.xi() * scale, self.omega.at(b) * b.volume())));
        let (mut coefficients, order) = solve::<D, M>(&bonds, self.order);
        if order == 0 {
            return Err(SingularFamily);
        }
        // to monomials of ξ
        for (k, degree) in Monomials::<D, M>::degrees().into_iter().enumerate() {
            coefficients.iter_mut().for_each(|c| c[k] *= scale.powi(degree + 1));
        }
        let control = self.control.shape(&self.law.stiffness(c), &inverse, self.omega, h);
        Ok(CorrectedShape { coefficients, lowered: order < self.order, tensor, control })
    }
    fn rebuilds(&self, _: &L::Constants) -> bool {
        true
    }
    fn reshape(&self, c: &L::Constants, _: &Self::Shape, h: Reference<D>) -> Result<Self::Shape, SingularFamily> {
        self.shape(c, h)
    }
    #[inline(always)]
    fn weights<R: Scalar>(&self, shape: &Self::Shape) -> [[R; M]; D] {
        shape.coefficients.map(
            #[inline(always)]
            |row| row.map(R::of),
        )
    }
    #[inline(always)]
    fn moments<S: Scalar>(&self, coefficients: &[[S; M]; D], h: Family<S, D>) -> Self::Moments<S::Sum> {
        self.integrals(L::RATE, coefficients, h)
    }
    #[inline(always)]
    fn state_of<R: Scalar>(&self, c: &L::Constants, shape: &Self::Shape, moments: &Self::Moments<R>, place: Place) -> Self::State<R> {
        let f = deformation(L::MEMORY, moments, place);
        let p = self.law.first_piola(c, &f);
        // ∫ ω z ⊗ ξ dV′
        let rest = moments.1 - f.gradient * shape.tensor.to();
        let (less_r, a) = self.control.state(&shape.control, Matrix::zero(), &rest);
        let (less_ah, _) = self.control.state(&shape.control, Matrix::zero(), &f.gradient);
        ((p + less_r, less_ah), (a, self.weights(shape)))
    }
    #[inline(always)]
    fn force<S: Scalar>(&self, ((q, less_ah), (a, coefficients)): &Self::State<S>, b: Bond<S, D>) -> Vector<S, D> {
        let xi = b.xi();
        let control = self.control.force(
            a,
            #[inline(always)]
            || b.eta(),
        );
        let g = for_whole_degrees!(D, self.used::<D>(), N => weight::<S, D, M, N>(coefficients, xi));
        q.times_plus(g, less_ah.times_plus(xi, control)) * self.omega.at(b)
    }
    #[inline(always)]
    fn energy_density<S: Scalar>(&self, c: &L::Constants, shape: &Self::Shape, h: Family<S, D>) -> S::Sum {
        let f = deformation(L::MEMORY, &self.moments(&self.weights(shape), h), h.place());
        let gradient: Matrix<S, D> = lift::<S, _, _>(&f.gradient);
        let control = h.integrate(
            #[inline(always)]
            |b| self.control.energy::<S>(&shape.control, b.eta() - gradient * b.xi()) * self.omega.at(b),
        );
        self.law.energy(c, &f) + control
    }
    fn commit(&self, c: &L::Constants, shape: &Self::Shape, h: Family<f64, D>, point: &mut [f64], _: &mut [&mut [f64]]) {
        if L::MEMORY > 0 {
            self.law.commit(c, &deformation(L::MEMORY, &self.moments(&self.weights(shape), h), h.place()), point);
        }
    }
    fn displacement_gradient(&self, _: &L::Constants, shape: &Self::Shape, h: Family<f64, D>) -> Matrix<f64, D> {
        self.integrals(false, &self.weights(shape), h).0.0
    }
    fn out_of_plane_stress(&self, c: &L::Constants, shape: &Self::Shape, h: Family<f64, D>, _: &Matrix<f64, D>) -> f64 {
        self.law.out_of_plane_stress(c, &deformation(L::MEMORY, &self.moments(&self.weights(shape), h), h.place()))
    }
    fn shortfall(&self, shape: &Self::Shape) -> Option<&'static str> {
        shape.lowered.then_some("families with too few bonds for the order of the correction, which have a lower one")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn monomials_by_degree() {
        assert_eq!([1, 2, 3, 10].map(|n| monomial_count(1, n)), [1, 2, 3, 10]);
        assert_eq!([1, 2, 3, 4].map(|n| monomial_count(2, n)), [2, 5, 9, 14]);
        assert_eq!([1, 2, 3].map(|n| monomial_count(3, n)), [3, 9, 19]);
        let (x, y, z) = (2.0, 3.0, 5.0);
        assert_eq!(Monomials::<1, 4>::of(Vector([x]), 4), [2.0, 4.0, 8.0, 16.0]);
        assert_eq!(Monomials::<2, 9>::of(Vector([x, y]), 9), [2.0, 3.0, 4.0, 6.0, 9.0, 8.0, 12.0, 18.0, 27.0]);
        let p = Monomials::<3, 19>::of(Vector([x, y, z]), 19);
        assert_eq!(p[..9], [x, y, z, x * x, x * y, x * z, y * y, y * z, z * z]);
        let mut cubes: Vec<f64> = p[9..].to_vec();
        cubes.sort_by(f64::total_cmp);
        let mut want = [8.0, 27.0, 125.0, 12.0, 20.0, 18.0, 50.0, 45.0, 75.0, 30.0];
        want.sort_by(f64::total_cmp);
        assert_eq!(cubes, want);
    }

    #[test]
    fn weights_differentiate_polynomials() {
        // an irregular family: the gradient of every monomial of degree ≤ 3 at the origin is exact
        let bonds: Vec<_> = (0..40)
            .map(|k| {
                let t = k as f64;
                (Vector([(1.7 * t).sin() * 0.9, (2.3 * t + 1.0).cos() * 0.8, (0.9 * t + 2.0).sin() * 0.7]), 1.0 + 0.5 * (3.1 * t).sin())
            })
            .collect();
        let (c, order) = solve::<3, 19>(&bonds, 3);
        assert_eq!(order, 3);
        for m in 0..19 {
            for d in 0..3 {
                let sum: f64 =
                    bonds.iter().map(|(s, w)| w * Monomials::<3, 19>::of(*s, 19)[m] * weight::<f64, 3, 19, 19>(&c, *s).0[d]).sum();
                assert!((sum - f64::from(u8::from(m == d))).abs() < 1e-13, "{m} {d} {sum}");
            }
        }
        // five neighbours at the end of a bar: order 5
        let end: Vec<_> = (1..=5).map(|k| (Vector([k as f64 / 5.1]), 1.0)).collect();
        assert_eq!(solve::<1, 10>(&end, 8).1, 5);
    }
}
