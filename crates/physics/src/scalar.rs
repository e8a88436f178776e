//! Number types a model is evaluated over: `f64`, [`Jet`] (value and derivatives) and
//! lanes ([`crate::lanes`], eight bonds of a point or one bond of eight points at a time).
//!
//! A model is written once, over any [`Scalar`]. Evaluated with `f64` it gives forces, with jets exact tangents and the
//! oracle of its own force state, with lanes the vector kernel of the hot loop.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// Words of a point's row in the flat arrays of coordinates and displacements: up to three components, then the
/// volume (coordinates) or nothing. One 32-byte row loads with one instruction whatever the dimension.
pub const ROW: usize = 4;

/// The word of a coordinate row that holds the point's volume.
pub const VOLUME_WORD: usize = 3;

/// The word of a displacement row that holds no displacement.
pub const SPARE_WORD: usize = 3;

/// The first cells of the groups of eight points that a number of points abreast holds: two, or one and nothing.
pub type Cells = [usize; 2];

/// Builds an array from a function of the index; unlike `std::array::from_fn` certain to be inlined.
#[inline(always)]
pub fn array<T: Copy, const N: usize>(mut f: impl FnMut(usize) -> T) -> [T; N] {
    let mut r = [f(0); N];
    let mut k = 1;
    while k < N {
        r[k] = f(k);
        k += 1;
    }
    r
}

/// A number of the equations: ring operations, a few functions, and the loads of one or several bonds.
pub trait Scalar:
    Copy
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Mul<f64, Output = Self>
    + AddAssign
    + SubAssign
{
    /// What a sum over bonds gives: `f64` for lanes of bonds, the type itself for a single number and for lanes of points.
    type Sum: Scalar<Sum = Self::Sum, Index = u32>;
    /// The far point of a bond, or of [`WIDTH`](Self::WIDTH) bonds.
    type Index: Copy;
    /// Bonds of one point per number.
    const WIDTH: usize;
    /// Whether the number holds the same bond of several points of a lattice, one beside the other. Families of such numbers are backed by
    /// a [`Lattice`](crate::family::Lattice) instead of lists.
    const ABREAST: bool = false;
    /// Groups of eight points that a number of points abreast holds: one or two.
    const GROUPS: usize = 1;
    /// Whether the number carries derivatives.
    const DIFFERENTIATES: bool = false;

    /// A constant.
    fn of(x: f64) -> Self;
    /// A sum, seen by every bond.
    fn lift(x: Self::Sum) -> Self;
    /// The sum over the bonds of the number.
    fn sum(self) -> Self::Sum;
    /// The value without derivatives (of the first lane): for choosing start values, never for results.
    fn value(self) -> f64;
    /// √x
    fn sqrt(self) -> Self;
    /// `self · a + b`
    fn fma(self, a: Self, b: Self) -> Self;
    /// `a` where `self ≥ 0`, else `b`.
    fn select(self, a: Self, b: Self) -> Self;
    /// A smooth function given by value and derivative.
    fn map(self, f: impl Fn(f64) -> (f64, f64)) -> Self;

    /// 1/√x
    #[inline(always)]
    fn rsqrt(self) -> Self {
        Self::of(1.0) / self.sqrt()
    }
    /// 1/x
    #[inline(always)]
    fn recip(self) -> Self {
        Self::of(1.0) / self
    }
    /// Natural logarithm.
    #[inline(always)]
    fn ln(self) -> Self {
        self.map(|x| (x.ln(), 1.0 / x))
    }
    /// ln(1 + x), with all digits of a small x.
    #[inline(always)]
    fn ln_1p(self) -> Self {
        self.map(|x| (x.ln_1p(), 1.0 / (1.0 + x)))
    }
    /// ln c of a c = 1 + x ≥ 0 that is known too: with all digits of a small x, and of a small c.
    #[inline(always)]
    fn ln_grown(self, c: Self) -> Self {
        if c.value() < 0.5 { c.ln() } else { self.ln_1p() }
    }
    /// Exponential.
    #[inline(always)]
    fn exp(self) -> Self {
        self.map(|x| (x.exp(), x.exp()))
    }
    /// eˣ − 1, with all digits of a small x.
    #[inline(always)]
    fn exp_m1(self) -> Self {
        self.map(|x| (x.exp_m1(), x.exp()))
    }
    /// Real power.
    #[inline(always)]
    fn powf(self, p: f64) -> Self {
        self.map(|x| (x.powf(p), p * x.powf(p - 1.0)))
    }
    /// The larger of two numbers.
    #[inline(always)]
    fn max(self, o: Self) -> Self {
        (self - o).select(self, o)
    }
    /// The smaller of two numbers.
    #[inline(always)]
    fn min(self, o: Self) -> Self {
        (o - self).select(self, o)
    }
    /// Magnitude.
    #[inline(always)]
    fn abs(self) -> Self {
        self.select(self, -self)
    }

    /// The far point(s) of the bond slot `at`.
    fn index(list: &[u16], at: usize) -> Self::Index;
    /// One point for every bond of the number.
    fn splat_index(i: usize) -> Self::Index;
    /// A number per bond slot.
    fn load(data: &[f64], at: usize) -> Self;
    /// A number per point.
    fn load_point(data: &[f64], idx: Self::Index) -> Self;
    /// A row of four constants per point (coordinates and volume).
    fn row_f64(data: &[f64], idx: Self::Index) -> [Self; ROW];
    /// A row of four numbers per point (displacements).
    fn row(data: &[Self::Sum], idx: Self::Index) -> [Self; ROW];
    /// Zero where the bond of the slot is broken or padding.
    fn masked(self, intact: &[u8], at: usize) -> Self;
    /// Zero in the lanes whose bit is not set; a single number has one lane.
    fn keep(self, lanes: u16) -> Self;
    /// A number per point, for points abreast: `cells` begin its groups of eight.
    fn load_cells(plane: &[f64], cells: Cells) -> Self;
    /// Subtracts `v` from the rows of the far points, one bond after the other.
    fn subtract_rows<const D: usize>(rows: &mut [Self::Sum], idx: Self::Index, v: [Self; D]);
}

/// Whether the bond slot `at` is intact.
#[inline(always)]
pub fn is_intact(intact: &[u8], at: usize) -> bool {
    (intact[at / 8] >> (at % 8)) & 1 == 1
}

/// The parts of `Scalar` that a number of width one shares.
macro_rules! one_bond {
    ($t:ty) => {
        type Sum = $t;
        type Index = u32;
        const WIDTH: usize = 1;
        #[inline(always)]
        fn lift(x: $t) -> $t {
            x
        }
        #[inline(always)]
        fn sum(self) -> $t {
            self
        }
        #[inline(always)]
        fn fma(self, a: Self, b: Self) -> Self {
            self * a + b
        }
        #[inline(always)]
        fn index(list: &[u16], at: usize) -> u32 {
            list[at].into()
        }
        #[inline(always)]
        fn splat_index(i: usize) -> u32 {
            i as u32
        }
        #[inline(always)]
        fn load(data: &[f64], at: usize) -> $t {
            <$t>::of(data[at])
        }
        #[inline(always)]
        fn load_point(data: &[f64], idx: u32) -> $t {
            <$t>::of(data[idx as usize])
        }
        #[inline(always)]
        fn row_f64(data: &[f64], idx: u32) -> [$t; ROW] {
            let row = &data[idx as usize * ROW..][..ROW];
            array(|k| <$t>::of(row[k]))
        }
        #[inline(always)]
        fn row(data: &[$t], idx: u32) -> [$t; ROW] {
            let row = &data[idx as usize * ROW..][..ROW];
            array(|k| row[k])
        }
        #[inline(always)]
        fn masked(self, intact: &[u8], at: usize) -> $t {
            if is_intact(intact, at) { self } else { <$t>::of(0.0) }
        }
        #[inline(always)]
        fn keep(self, lanes: u16) -> $t {
            if lanes & 1 == 1 { self } else { <$t>::of(0.0) }
        }
        #[inline(always)]
        fn load_cells(plane: &[f64], cells: Cells) -> $t {
            <$t>::of(plane[cells[0]])
        }
        #[inline(always)]
        fn subtract_rows<const D: usize>(rows: &mut [$t], idx: u32, v: [$t; D]) {
            let row = &mut rows[idx as usize * ROW..][..ROW];
            for k in 0..D {
                row[k] -= v[k];
            }
        }
    };
}

impl Scalar for f64 {
    one_bond!(f64);
    #[inline(always)]
    fn of(x: f64) -> f64 {
        x
    }
    #[inline(always)]
    fn value(self) -> f64 {
        self
    }
    #[inline(always)]
    fn sqrt(self) -> f64 {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn select(self, a: f64, b: f64) -> f64 {
        if self >= 0.0 { a } else { b }
    }
    #[inline(always)]
    fn map(self, f: impl Fn(f64) -> (f64, f64)) -> f64 {
        f(self).0
    }
}

/// A value and its derivatives in `N` directions (forward differentiation, exact to round-off).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jet<const N: usize> {
    /// The value.
    pub value: f64,
    /// The directional derivatives.
    pub slope: [f64; N],
}

/// A value and one directional derivative: a tangent product in one evaluation.
pub type Dual = Jet<1>;

impl<const N: usize> Jet<N> {
    /// f(self) for a function of value `value` and derivative `derivative` there.
    #[inline(always)]
    fn chain(self, value: f64, derivative: f64) -> Self {
        Jet { value, slope: array(|k| self.slope[k] * derivative) }
    }
    #[inline(always)]
    fn combine(self, o: Self, value: f64, a: f64, b: f64) -> Self {
        Jet { value, slope: array(|k| a * self.slope[k] + b * o.slope[k]) }
    }
}

impl<const N: usize> Add for Jet<N> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Jet { value: self.value + o.value, slope: array(|k| self.slope[k] + o.slope[k]) }
    }
}
impl<const N: usize> Sub for Jet<N> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Jet { value: self.value - o.value, slope: array(|k| self.slope[k] - o.slope[k]) }
    }
}
impl<const N: usize> Mul for Jet<N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        self.combine(o, self.value * o.value, o.value, self.value)
    }
}
impl<const N: usize> Div for Jet<N> {
    type Output = Self;
    #[inline(always)]
    fn div(self, o: Self) -> Self {
        let q = self.value / o.value;
        self.combine(o, q, 1.0 / o.value, -q / o.value)
    }
}
impl<const N: usize> Mul<f64> for Jet<N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: f64) -> Self {
        self.chain(self.value * o, o)
    }
}
impl<const N: usize> Neg for Jet<N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.chain(-self.value, -1.0)
    }
}
impl<const N: usize> AddAssign for Jet<N> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}
impl<const N: usize> SubAssign for Jet<N> {
    #[inline(always)]
    fn sub_assign(&mut self, o: Self) {
        *self = *self - o;
    }
}

impl<const N: usize> Scalar for Jet<N> {
    one_bond!(Jet<N>);
    const DIFFERENTIATES: bool = true;
    #[inline(always)]
    fn of(x: f64) -> Self {
        Jet { value: x, slope: [0.0; N] }
    }
    #[inline(always)]
    fn value(self) -> f64 {
        self.value
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let r = self.value.sqrt();
        self.chain(r, 0.5 / r)
    }
    #[inline(always)]
    fn select(self, a: Self, b: Self) -> Self {
        if self.value >= 0.0 { a } else { b }
    }
    #[inline(always)]
    fn map(self, f: impl Fn(f64) -> (f64, f64)) -> Self {
        let (v, d) = f(self.value);
        self.chain(v, d)
    }
}

/// A fixed number of words: what can be stored flat, lifted to lanes and exchanged between chunks.
pub trait Record<R: Scalar>: Copy {
    /// Number of words.
    const WORDS: usize;
    /// Word `k`.
    fn word(&self, k: usize) -> R;
    /// Builds the record from its words, the first being `f(at)`.
    fn read(f: impl Fn(usize) -> R + Copy, at: usize) -> Self;
}

/// A record of sums, seen by every bond of `S`.
#[inline(always)]
pub fn lift<S: Scalar, A: Record<S::Sum>, B: Record<S>>(a: &A) -> B {
    B::read(
        #[inline(always)]
        |k| S::lift(a.word(k)),
        0,
    )
}

impl<R: Scalar> Record<R> for () {
    const WORDS: usize = 0;
    #[inline(always)]
    fn word(&self, _: usize) -> R {
        R::of(0.0)
    }
    #[inline(always)]
    fn read(_: impl Fn(usize) -> R + Copy, _: usize) {}
}
impl<R: Scalar> Record<R> for R {
    const WORDS: usize = 1;
    #[inline(always)]
    fn word(&self, _: usize) -> R {
        *self
    }
    #[inline(always)]
    fn read(f: impl Fn(usize) -> R + Copy, at: usize) -> R {
        f(at)
    }
}
impl<R: Scalar, T: Record<R>, const N: usize> Record<R> for [T; N] {
    const WORDS: usize = N * T::WORDS;
    #[inline(always)]
    fn word(&self, k: usize) -> R {
        self[k / T::WORDS].word(k % T::WORDS)
    }
    #[inline(always)]
    fn read(f: impl Fn(usize) -> R + Copy, at: usize) -> Self {
        array(
            #[inline(always)]
            |n| T::read(f, at + n * T::WORDS),
        )
    }
}
impl<R: Scalar, A: Record<R>, B: Record<R>> Record<R> for (A, B) {
    const WORDS: usize = A::WORDS + B::WORDS;
    #[inline(always)]
    fn word(&self, k: usize) -> R {
        if k < A::WORDS { self.0.word(k) } else { self.1.word(k - A::WORDS) }
    }
    #[inline(always)]
    fn read(f: impl Fn(usize) -> R + Copy, at: usize) -> Self {
        (A::read(f, at), B::read(f, at + A::WORDS))
    }
}
