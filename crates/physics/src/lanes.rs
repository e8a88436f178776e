//! Eight at a time: the vector forms of a [`Scalar`]. A number holds eight bonds of one point, or, on lattices, the same bond of eight
//! points ([`Abreast`]): then sums over bonds stay in the lanes, and what is the same for all points is read once.
//!
//! [`widest`] and [`widest_abreast`] run a kernel with the widest lanes the machine has. The types themselves stay private, so that code
//! with vector instructions cannot run on a machine without them; all unsafe code of the program is in
//! `lanes/avx512.rs` and `lanes/avx2.rs`. The portable lanes are the fallback (of lattices only on
//! x86-64, where bonds of lists then go one by one) and, in tests, the oracle.

use crate::scalar::{Cells, ROW, Scalar, array};
use std::marker::PhantomData;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};
use std::sync::atomic::{AtomicU8, Ordering};

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;

/// Lanes of a number.
pub const WIDTH: usize = 8;

/// Eight numbers of one instruction set.
type Eight = [f64; WIDTH];
/// Eight far points.
type Indices = [u32; WIDTH];

/// The operations on eight numbers; the default bodies are the portable ones.
pub(crate) trait InstructionSet: Copy + Send + Sync + 'static {
    #[inline(always)]
    fn splat(x: f64) -> Eight {
        [x; WIDTH]
    }
    #[inline(always)]
    fn add(a: Eight, b: Eight) -> Eight {
        array(|l| a[l] + b[l])
    }
    #[inline(always)]
    fn sub(a: Eight, b: Eight) -> Eight {
        array(|l| a[l] - b[l])
    }
    #[inline(always)]
    fn mul(a: Eight, b: Eight) -> Eight {
        array(|l| a[l] * b[l])
    }
    #[inline(always)]
    fn div(a: Eight, b: Eight) -> Eight {
        array(|l| a[l] / b[l])
    }
    /// a b + c
    #[inline(always)]
    fn fma(a: Eight, b: Eight, c: Eight) -> Eight {
        array(|l| a[l] * b[l] + c[l])
    }
    #[inline(always)]
    fn sqrt(a: Eight) -> Eight {
        array(|l| a[l].sqrt())
    }
    #[inline(always)]
    fn rsqrt(a: Eight) -> Eight {
        array(|l| 1.0 / a[l].sqrt())
    }
    #[inline(always)]
    fn recip(a: Eight) -> Eight {
        array(|l| 1.0 / a[l])
    }
    /// `a` where `x ≥ 0`, else `b`
    #[inline(always)]
    fn select(x: Eight, a: Eight, b: Eight) -> Eight {
        array(|l| if x[l] >= 0.0 { a[l] } else { b[l] })
    }
    #[inline(always)]
    fn sum(a: Eight) -> f64 {
        ((a[0] + a[4]) + (a[2] + a[6])) + ((a[1] + a[5]) + (a[3] + a[7]))
    }
    /// eight numbers from memory
    #[inline(always)]
    fn load(a: &Eight) -> Eight {
        *a
    }
    /// eight numbers to memory
    #[inline(always)]
    fn store(to: &mut Eight, a: Eight) {
        *to = a;
    }
    /// a bit for each lane that is above zero
    #[inline(always)]
    fn positive(a: Eight) -> u8 {
        (0..WIDTH).fold(0, |bits, l| bits | u8::from(a[l] > 0.0) << l)
    }
    /// zero in the lanes whose bit is not set
    #[inline(always)]
    fn mask(a: Eight, bits: u8) -> Eight {
        array(|l| if bits >> l & 1 == 1 { a[l] } else { 0.0 })
    }
    /// A long computation: a function of its own where the instructions are the machine's common ones, in place where only the caller has
    /// the right ones.
    #[inline(never)]
    fn long(f: impl FnOnce() -> Eight) -> Eight {
        f()
    }
    /// Mantissa in [1, 2) and exponent; (1, −∞) for 0, (1, ∞) for ∞, not a number where negative.
    #[inline(always)]
    fn split(a: Eight) -> (Eight, Eight) {
        let (mut m, mut e) = ([0.0; WIDTH], [0.0; WIDTH]);
        for l in 0..WIDTH {
            (m[l], e[l]) = split(a[l]);
        }
        (m, e)
    }
    /// a 2ⁿ for whole n of magnitude at most 1200
    #[inline(always)]
    fn scale(a: Eight, n: Eight) -> Eight {
        array(|l| {
            let half = (0.5 * n[l]) as i64;
            a[l] * power_of_two(half) * power_of_two(n[l] as i64 - half)
        })
    }
    /// eight rows of four words, transposed
    #[inline(always)]
    fn rows(data: &[f64], j: Indices) -> [Eight; ROW] {
        let mut r = [[0.0; WIDTH]; ROW];
        for l in 0..WIDTH {
            let row = &data[j[l] as usize * ROW..][..ROW];
            for k in 0..ROW {
                r[k][l] = row[k];
            }
        }
        r
    }
    /// subtracts `v`, transposed, from eight rows, one after the other
    #[inline(always)]
    fn subtract_rows(data: &mut [f64], j: Indices, v: [Eight; 3]) {
        for l in 0..WIDTH {
            let row = &mut data[j[l] as usize * ROW..][..ROW];
            for k in 0..3 {
                row[k] -= v[k][l];
            }
        }
    }
}

/// Mantissa and exponent of one number; see [`InstructionSet::split`].
#[inline(always)]
fn split(x: f64) -> (f64, f64) {
    if x.is_nan() || x < 0.0 {
        return (f64::NAN, 0.0);
    }
    if x == 0.0 || x == f64::INFINITY {
        return (1.0, if x == 0.0 { f64::NEG_INFINITY } else { x });
    }
    let (x, shift) = if x < f64::MIN_POSITIVE { (x * power_of_two(54), 54) } else { (x, 0) };
    let bits = x.to_bits();
    let mantissa = f64::from_bits(bits & ((1 << 52) - 1) | 1023 << 52);
    (mantissa, ((bits >> 52) as i64 - 1023 - shift) as f64)
}

/// 2ⁿ for −1023 < n < 1024
#[inline(always)]
fn power_of_two(n: i64) -> f64 {
    f64::from_bits(((n + 1023) as u64) << 52)
}

/// Lanes for any machine.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Portable;
impl InstructionSet for Portable {}

/// Lanes are bonds of one point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bonds;
/// Lanes are points of a lattice.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Points;

/// What the lanes of a number are.
pub(crate) trait Kind: Copy + Send + Sync + 'static {}
impl Kind for Bonds {}
impl Kind for Points {}

/// Eight numbers of an instruction set, of what `K` says.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Lanes<I, K>(Eight, PhantomData<(I, K)>);

impl<I, K> Lanes<I, K> {
    #[inline(always)]
    fn new(x: Eight) -> Self {
        Lanes(x, PhantomData)
    }
}

macro_rules! operator {
    ($trait:ident, $f:ident) => {
        impl<I: InstructionSet, K: Kind> $trait for Lanes<I, K> {
            type Output = Self;
            #[inline(always)]
            fn $f(self, o: Self) -> Self {
                Self::new(I::$f(self.0, o.0))
            }
        }
    };
}
operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);
impl<I: InstructionSet, K: Kind> Mul<f64> for Lanes<I, K> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: f64) -> Self {
        Self::new(I::mul(self.0, I::splat(o)))
    }
}
impl<I: InstructionSet, K: Kind> Neg for Lanes<I, K> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self::new(I::sub(I::splat(-0.0), self.0))
    }
}
impl<I: InstructionSet, K: Kind> AddAssign for Lanes<I, K> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}
impl<I: InstructionSet, K: Kind> SubAssign for Lanes<I, K> {
    #[inline(always)]
    fn sub_assign(&mut self, o: Self) {
        *self = *self - o;
    }
}

/// ln 2 in two parts, the first with 32 bits: its product with an exponent is exact.
const LN_2: [f64; 2] = [6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10];
/// (2 artanh s − 2 s)/s³ as a polynomial of s², highest power first, for e^|2 artanh s| ≤ √2: Chebyshev interpolation, error 1e-17.
const LOG: [f64; 7] = [
    0.146_164_496_850_434_06,
    0.153_317_216_005_560_41,
    0.181_828_891_252_617_22,
    0.222_222_111_347_950_8,
    0.285_714_286_259_754_85,
    0.399_999_999_998_995,
    0.666_666_666_666_667,
];
/// (eʳ − 1 − r − r²/2)/r³, highest power first, for |r| ≤ ln(2)/2: Chebyshev interpolation, error 4e-19.
const EXP: [f64; 10] = [
    2.091_129_876_994_02e-9,
    2.510_047_250_569_499_6e-8,
    2.755_728_283_880_048_3e-7,
    2.755_726_827_690_57e-6,
    2.480_158_731_722_872e-5,
    1.984_126_986_317_155_6e-4,
    1.388_888_888_888_653_6e-3,
    8.333_333_333_330_038e-3,
    4.166_666_666_666_666_7e-2,
    0.166_666_666_666_666_67,
];

impl<I: InstructionSet, K: Kind> Lanes<I, K>
where
    Self: Scalar,
{
    /// A polynomial, highest power first.
    #[inline(always)]
    fn polynomial<const N: usize>(self, c: [f64; N]) -> Self {
        let mut p = Self::of(c[0]);
        let mut k = 1;
        while k < N {
            p = p.fma(self, Self::of(c[k]));
            k += 1;
        }
        p
    }
    /// ln u + c for a small c: u = 2ᵏ (1 + f), f within [√½ − 1, √2 − 1), and ln(1 + f) = f − (f²/2 − s (f²/2 + R)) with
    /// s = f/(2 + f), R = 2 artanh(s)/s − 2.
    #[inline(always)]
    fn log(self, c: Self) -> Self {
        let (m, k) = self.parts();
        (m - Self::of(1.0)).log_of_parts(k, c)
    }
    /// (u, k) with this = 2ᵏ u, u within [√½, √2).
    #[inline(always)]
    fn parts(self) -> (Self, Self) {
        let (m, k) = I::split(self.0);
        let (m, k) = (Self::new(m), Self::new(k));
        let above = m - Self::of(std::f64::consts::SQRT_2);
        (above.select(m * 0.5, m), above.select(k + Self::of(1.0), k))
    }
    /// ln 2ᵏ + ln(1 + f) + c
    #[inline(always)]
    fn log_of_parts(self, k: Self, c: Self) -> Self {
        let f = self;
        let s = f * (f + Self::of(2.0)).recip();
        let z = s * s;
        let half = f * f * 0.5;
        let tail = s.fma(half + z * z.polynomial(LOG), k.fma(Self::of(LN_2[1]), c));
        k * LN_2[0] - ((half - tail) - f)
    }
    /// ln c with c = 1 + x: near 1 from x, elsewhere from c.
    #[inline(always)]
    fn log_grown(self, c: Self) -> Self {
        let (m, k) = c.parts();
        let f = (Self::of(0.5) - k * k).select(self, m - Self::of(1.0));
        f.log_of_parts(k, Self::of(0.0))
    }
    /// ln(1 + x)
    #[inline(always)]
    fn log_1p(self) -> Self {
        let u = self + Self::of(1.0);
        // what the sum lost, whichever of the two is larger
        let lost = (self - Self::of(1.0)).select(Self::of(1.0) - (u - self), self - (u - Self::of(1.0)));
        // ln 0 and ln ∞ need no correction, and 0/0 would be none
        let usual = (u - Self::of(f64::MIN_POSITIVE)).min(Self::of(f64::MAX) - u);
        let c = usual.select(lost, Self::of(0.0)) * usual.select(u, Self::of(1.0)).recip();
        u.log(c)
    }
    /// (eʳ − 1, n) with x = r + n ln 2, |r| ≤ ln(2)/2; x is held between −800 and 710, where e^x has left the range of numbers.
    #[inline(always)]
    fn reduced_exponential(self) -> (Self, Self) {
        let (low, high) = (Self::of(-800.0), Self::of(710.0));
        let x = (self - high).select(high, self);
        let x = (low - x).select(low, x);
        // adding and subtracting 1.5 · 2⁵² rounds to whole numbers
        let shift = Self::of(6_755_399_441_055_744.0);
        let n = (x * std::f64::consts::LOG2_E + shift) - shift;
        let (high, low) = (x - n * LN_2[0], n * LN_2[1]);
        let r = high - low;
        let lost = (high - r) - low;
        let square = r * r;
        (r + (lost + square.fma(Self::of(0.5), square * r * r.polynomial(EXP))), n)
    }
}

/// The parts of `Scalar` that lanes of all kinds share.
macro_rules! eight_lanes {
    () => {
        #[inline(always)]
        fn of(x: f64) -> Self {
            Self::new(I::splat(x))
        }
        #[inline(always)]
        fn value(self) -> f64 {
            self.0[0]
        }
        #[inline(always)]
        fn sqrt(self) -> Self {
            Self::new(I::sqrt(self.0))
        }
        #[inline(always)]
        fn rsqrt(self) -> Self {
            Self::new(I::rsqrt(self.0))
        }
        #[inline(always)]
        fn recip(self) -> Self {
            Self::new(I::recip(self.0))
        }
        #[inline(always)]
        fn fma(self, a: Self, b: Self) -> Self {
            Self::new(I::fma(self.0, a.0, b.0))
        }
        #[inline(always)]
        fn select(self, a: Self, b: Self) -> Self {
            Self::new(I::select(self.0, a.0, b.0))
        }
        #[inline(always)]
        fn map(self, f: impl Fn(f64) -> (f64, f64)) -> Self {
            Self::new(array(
                #[inline(always)]
                |l| f(self.0[l]).0,
            ))
        }
        #[inline(always)]
        fn ln(self) -> Self {
            Self::new(I::long(
                #[inline(always)]
                || self.log(Self::of(0.0)).0,
            ))
        }
        #[inline(always)]
        fn ln_1p(self) -> Self {
            Self::new(I::long(
                #[inline(always)]
                || self.log_1p().0,
            ))
        }
        #[inline(always)]
        fn ln_grown(self, c: Self) -> Self {
            Self::new(I::long(
                #[inline(always)]
                || self.log_grown(c).0,
            ))
        }
        #[inline(always)]
        fn exp(self) -> Self {
            Self::new(I::long(
                #[inline(always)]
                || {
                    let (q, n) = self.reduced_exponential();
                    I::scale((q + Self::of(1.0)).0, n.0)
                },
            ))
        }
        #[inline(always)]
        fn exp_m1(self) -> Self {
            Self::new(I::long(
                #[inline(always)]
                || {
                    let (q, n) = self.reduced_exponential();
                    // 2ⁿ q + (2ⁿ − 1), by halves: 2¹⁰²⁴ is no number
                    let n = n - Self::of(1.0);
                    ((Self::new(I::scale(q.0, n.0)) + (Self::new(I::scale(I::splat(1.0), n.0)) - Self::of(0.5))) * 2.0).0
                },
            ))
        }
        #[inline(always)]
        fn powf(self, p: f64) -> Self {
            (self.ln() * p).exp()
        }
        #[inline(always)]
        fn load(data: &[f64], at: usize) -> Self {
            let block: &Eight = data[at..at + WIDTH].try_into().expect("as many as lanes");
            Self::new(I::load(block))
        }
        #[inline(always)]
        fn keep(self, lanes: u16) -> Self {
            Self::new(I::mask(self.0, lanes as u8))
        }
        #[inline(always)]
        fn load_cells(plane: &[f64], cells: Cells) -> Self {
            Self::load(plane, cells[0])
        }
    };
}

impl<I: InstructionSet> Scalar for Lanes<I, Bonds> {
    type Sum = f64;
    type Index = Indices;
    const WIDTH: usize = WIDTH;
    eight_lanes!();
    #[inline(always)]
    fn lift(x: f64) -> Self {
        Self::of(x)
    }
    #[inline(always)]
    fn sum(self) -> f64 {
        I::sum(self.0)
    }
    #[inline(always)]
    fn index(list: &[u16], at: usize) -> Indices {
        let block: &[u16; WIDTH] = list[at..at + WIDTH].try_into().expect("as many as lanes");
        array(
            #[inline(always)]
            |l| u32::from(block[l]),
        )
    }
    #[inline(always)]
    fn splat_index(i: usize) -> Indices {
        [i as u32; WIDTH]
    }
    #[inline(always)]
    fn load_point(data: &[f64], j: Indices) -> Self {
        Self::new(array(
            #[inline(always)]
            |l| data[j[l] as usize],
        ))
    }
    #[inline(always)]
    fn row_f64(data: &[f64], j: Indices) -> [Self; ROW] {
        let r = I::rows(data, j);
        [Self::new(r[0]), Self::new(r[1]), Self::new(r[2]), Self::new(r[3])]
    }
    #[inline(always)]
    fn row(data: &[f64], j: Indices) -> [Self; ROW] {
        Self::row_f64(data, j)
    }
    #[inline(always)]
    fn masked(self, intact: &[u8], at: usize) -> Self {
        Self::new(I::mask(self.0, intact[at / WIDTH]))
    }
    #[inline(always)]
    fn subtract_rows<const D: usize>(rows: &mut [f64], j: Indices, v: [Self; D]) {
        let mut w = [I::splat(0.0); 3];
        for k in 0..D {
            w[k] = v[k].0;
        }
        I::subtract_rows(rows, j, w);
    }
}

impl<I: InstructionSet> Scalar for Lanes<I, Points> {
    type Sum = Self;
    type Index = u32;
    const WIDTH: usize = 1;
    const ABREAST: bool = true;
    eight_lanes!();
    #[inline(always)]
    fn lift(x: Self) -> Self {
        x
    }
    #[inline(always)]
    fn sum(self) -> Self {
        self
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
    fn load_point(data: &[f64], first: u32) -> Self {
        Self::load(data, first as usize)
    }
    fn row_f64(_: &[f64], _: u32) -> [Self; ROW] {
        unreachable!("{PLANES}")
    }
    fn row(_: &[Self], _: u32) -> [Self; ROW] {
        unreachable!("{PLANES}")
    }
    #[inline(always)]
    fn masked(self, intact: &[u8], at: usize) -> Self {
        self.keep(intact[at].into())
    }
    fn subtract_rows<const D: usize>(_: &mut [Self], _: u32, _: [Self; D]) {
        unreachable!("{PLANES}")
    }
}

const PLANES: &str = "points of a lattice are stored in planes, not in rows";

/// A number for each of several points of a lattice: groups of eight that lie side by side.
pub trait Abreast: Scalar<Sum = Self, Index = u32> {
    /// The number of lane `l`.
    fn lane(&self, l: usize) -> f64;
    /// A number of each lane.
    fn of_lanes(lane: impl Fn(usize) -> f64 + Copy) -> Self;
    /// Adds to the numbers of the points.
    fn add_to(self, plane: &mut [f64], cells: Cells);
    /// Subtracts from the numbers of the points.
    fn subtract_from(self, plane: &mut [f64], cells: Cells);
    /// A bit for each lane that is above zero.
    fn positive(self) -> u16;
}

impl<I: InstructionSet> Abreast for Lanes<I, Points> {
    #[inline(always)]
    fn lane(&self, l: usize) -> f64 {
        self.0[l]
    }
    #[inline(always)]
    fn of_lanes(lane: impl Fn(usize) -> f64 + Copy) -> Self {
        Self::new(I::load(&array(lane)))
    }
    #[inline(always)]
    fn add_to(self, plane: &mut [f64], cells: Cells) {
        let block: &mut Eight = (&mut plane[cells[0]..cells[0] + WIDTH]).try_into().expect("as many as lanes");
        let sum = I::add(I::load(block), self.0);
        I::store(block, sum);
    }
    #[inline(always)]
    fn subtract_from(self, plane: &mut [f64], cells: Cells) {
        let block: &mut Eight = (&mut plane[cells[0]..cells[0] + WIDTH]).try_into().expect("as many as lanes");
        let difference = I::sub(I::load(block), self.0);
        I::store(block, difference);
    }
    #[inline(always)]
    fn positive(self) -> u16 {
        I::positive(self.0).into()
    }
}

/// Two groups of points. What one waits for (the equations of a bond are long chains of operations) the other fills.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pair<A>(A, A);

macro_rules! of_halves {
    ($($trait:ident $f:ident),*) => {$(
        impl<A: Abreast> $trait for Pair<A> {
            type Output = Self;
            #[inline(always)]
            fn $f(self, o: Self) -> Self {
                Pair(self.0.$f(o.0), self.1.$f(o.1))
            }
        }
    )*};
}
of_halves!(Add add, Sub sub, Mul mul, Div div);
impl<A: Abreast> Mul<f64> for Pair<A> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: f64) -> Self {
        Pair(self.0 * o, self.1 * o)
    }
}
impl<A: Abreast> Neg for Pair<A> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Pair(-self.0, -self.1)
    }
}
impl<A: Abreast> AddAssign for Pair<A> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}
impl<A: Abreast> SubAssign for Pair<A> {
    #[inline(always)]
    fn sub_assign(&mut self, o: Self) {
        *self = *self - o;
    }
}

macro_rules! functions_of_halves {
    ($($f:ident)*) => {$(
        #[inline(always)]
        fn $f(self) -> Self {
            Pair(self.0.$f(), self.1.$f())
        }
    )*};
}

impl<A: Abreast> Scalar for Pair<A> {
    type Sum = Self;
    type Index = u32;
    const WIDTH: usize = 1;
    const ABREAST: bool = true;
    const GROUPS: usize = 2;
    functions_of_halves!(sqrt rsqrt recip ln ln_1p exp exp_m1);
    #[inline(always)]
    fn of(x: f64) -> Self {
        let x = A::of(x);
        Pair(x, x)
    }
    #[inline(always)]
    fn lift(x: Self) -> Self {
        x
    }
    #[inline(always)]
    fn sum(self) -> Self {
        self
    }
    #[inline(always)]
    fn value(self) -> f64 {
        self.0.value()
    }
    #[inline(always)]
    fn fma(self, a: Self, b: Self) -> Self {
        Pair(self.0.fma(a.0, b.0), self.1.fma(a.1, b.1))
    }
    #[inline(always)]
    fn select(self, a: Self, b: Self) -> Self {
        Pair(self.0.select(a.0, b.0), self.1.select(a.1, b.1))
    }
    #[inline(always)]
    fn map(self, f: impl Fn(f64) -> (f64, f64)) -> Self {
        Pair(self.0.map(&f), self.1.map(&f))
    }
    #[inline(always)]
    fn ln_grown(self, c: Self) -> Self {
        Pair(self.0.ln_grown(c.0), self.1.ln_grown(c.1))
    }
    #[inline(always)]
    fn powf(self, p: f64) -> Self {
        Pair(self.0.powf(p), self.1.powf(p))
    }
    #[inline(always)]
    fn keep(self, lanes: u16) -> Self {
        Pair(self.0.keep(lanes & 0xff), self.1.keep(lanes >> WIDTH))
    }
    #[inline(always)]
    fn load_cells(plane: &[f64], cells: Cells) -> Self {
        Pair(A::load(plane, cells[0]), A::load(plane, cells[1]))
    }
    fn index(_: &[u16], _: usize) -> u32 {
        unreachable!("{PLANES}")
    }
    #[inline(always)]
    fn splat_index(i: usize) -> u32 {
        i as u32
    }
    fn load(_: &[f64], _: usize) -> Self {
        unreachable!("{PLANES}")
    }
    fn load_point(_: &[f64], _: u32) -> Self {
        unreachable!("{PLANES}")
    }
    fn row_f64(_: &[f64], _: u32) -> [Self; ROW] {
        unreachable!("{PLANES}")
    }
    fn row(_: &[Self], _: u32) -> [Self; ROW] {
        unreachable!("{PLANES}")
    }
    fn masked(self, _: &[u8], _: usize) -> Self {
        unreachable!("{PLANES}")
    }
    fn subtract_rows<const D: usize>(_: &mut [Self], _: u32, _: [Self; D]) {
        unreachable!("{PLANES}")
    }
}

impl<A: Abreast> Abreast for Pair<A> {
    #[inline(always)]
    fn lane(&self, l: usize) -> f64 {
        if l < WIDTH { self.0.lane(l) } else { self.1.lane(l - WIDTH) }
    }
    #[inline(always)]
    fn of_lanes(lane: impl Fn(usize) -> f64 + Copy) -> Self {
        Pair(
            A::of_lanes(lane),
            A::of_lanes(
                #[inline(always)]
                |l| lane(l + WIDTH),
            ),
        )
    }
    #[inline(always)]
    fn add_to(self, plane: &mut [f64], cells: Cells) {
        self.0.add_to(plane, cells);
        self.1.add_to(plane, [cells[1]; 2]);
    }
    #[inline(always)]
    fn subtract_from(self, plane: &mut [f64], cells: Cells) {
        self.0.subtract_from(plane, cells);
        self.1.subtract_from(plane, [cells[1]; 2]);
    }
    #[inline(always)]
    fn positive(self) -> u16 {
        self.0.positive() | self.1.positive() << WIDTH
    }
}

/// A computation over bonds that does not care how many it takes at a time.
pub trait Kernel {
    /// What it gives.
    type Output;
    /// Whether it runs so often that lanes of every instruction set are worth their compilation. Otherwise there are the widest, and bonds
    /// one by one.
    const OFTEN: bool;
    /// The computation; must be `#[inline(always)]`, with everything it calls.
    fn run<S: Scalar<Sum = f64>>(self) -> Self::Output;
}

/// A computation over groups of eight points of a lattice.
pub trait GroupKernel {
    /// What it gives.
    type Output;
    /// Whether two groups at a time are better than one: long chains of operations on few numbers.
    const PAIRED: bool;
    /// The computation; must be `#[inline(always)]`, with everything it calls.
    fn run<S: Abreast>(self) -> Self::Output;
}

/// Which instructions lanes are made of, from those that every machine has to the widest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Instructions {
    /// Those that the program was compiled for: two numbers at a time on 64-bit ARM (NEON); on old x86-64 bonds of lists go one by one, and
    /// points of lattices two at a time.
    Portable,
    /// Four numbers at a time, and fused multiplications.
    Avx2,
    /// Eight.
    Avx512,
}

impl Instructions {
    /// All of them.
    pub const ALL: [Instructions; 3] = [Self::Portable, Self::Avx2, Self::Avx512];

    /// What people call them.
    pub fn name(self) -> &'static str {
        match self {
            Self::Portable => "portable",
            Self::Avx2 => "AVX2, 8 lanes",
            Self::Avx512 => "AVX-512, 8 lanes",
        }
    }

    /// Whether this machine has them.
    pub fn available(self) -> bool {
        match self {
            Self::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => avx2::detected(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => avx512::detected(),
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        }
    }
}

/// The widest that may be used.
static WIDEST: AtomicU8 = AtomicU8::new(Instructions::Avx512 as u8);

/// From now on nothing wider than this is used: for comparisons. Results of different instructions differ by round-off.
pub fn limit(widest: Instructions) {
    WIDEST.store(widest as u8, Ordering::Relaxed);
}

#[cfg(target_arch = "x86_64")]
#[inline]
fn may_use(instructions: Instructions) -> bool {
    WIDEST.load(Ordering::Relaxed) >= instructions as u8
}

/// Runs a kernel over groups of points with the widest lanes of this machine.
#[inline]
pub fn widest_abreast<K: GroupKernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    {
        if may_use(Instructions::Avx512)
            && let Some(run) = avx512::available_abreast::<K>()
        {
            return run(kernel);
        }
        if may_use(Instructions::Avx2)
            && let Some(run) = avx2::available_abreast::<K>()
        {
            return run(kernel);
        }
    }
    portable_abreast(kernel)
}

/// Runs a kernel over groups of points with the portable lanes (for comparison).
pub fn portable_abreast<K: GroupKernel>(kernel: K) -> K::Output {
    kernel.run::<Lanes<Portable, Points>>()
}

/// Runs a kernel with the widest lanes of this machine.
#[inline]
pub fn widest<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    {
        if may_use(Instructions::Avx512)
            && let Some(run) = avx512::available::<K>()
        {
            return run(kernel);
        }
        // the first is known when the program is compiled
        if K::OFTEN
            && may_use(Instructions::Avx2)
            && let Some(run) = avx2::available::<K>()
        {
            return run(kernel);
        }
        // a processor of before 2013: not worth the time that eight lanes of its instructions take to compile
        kernel.run::<f64>()
    }
    #[cfg(not(target_arch = "x86_64"))]
    portable(kernel)
}

/// Runs a kernel with the portable lanes (for comparison).
pub fn portable<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Lanes<Portable, Bonds>>()
}

/// The lanes that [`widest`] chooses on this machine.
pub fn chosen() -> Instructions {
    let usable = |i: &Instructions| i.available() && WIDEST.load(Ordering::Relaxed) >= *i as u8;
    Instructions::ALL.into_iter().rev().find(usable).unwrap_or(Instructions::Portable)
}

/// The name of the lanes that [`widest`] chooses on this machine.
pub fn name() -> &'static str {
    chosen().name()
}

#[cfg(test)]
mod tests;
