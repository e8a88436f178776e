//! Eight bonds at a time: the vector form of a [`Scalar`].
//!
//! [`widest`] runs a [`Kernel`] with the widest lanes the machine has. The types themselves stay private, so that code
//! with vector instructions cannot run on a machine without them; all unsafe code of the program is in
//! `lanes/avx512.rs`. The portable lanes are the fallback and, in tests, the oracle.

use crate::scalar::{ROW, Scalar, array};
use std::marker::PhantomData;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

#[cfg(target_arch = "x86_64")]
mod avx512;

/// Bonds in one number.
pub const WIDTH: usize = 8;

/// Eight numbers of one instruction set.
type Eight = [f64; WIDTH];
/// Eight far points.
type Points = [u32; WIDTH];

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
    /// zero in the lanes whose bit is not set
    #[inline(always)]
    fn mask(a: Eight, bits: u8) -> Eight {
        array(|l| if bits >> l & 1 == 1 { a[l] } else { 0.0 })
    }
    /// eight rows of four words, transposed
    #[inline(always)]
    fn rows(data: &[f64], j: Points) -> [Eight; ROW] {
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
    fn subtract_rows(data: &mut [f64], j: Points, v: [Eight; 3]) {
        for l in 0..WIDTH {
            let row = &mut data[j[l] as usize * ROW..][..ROW];
            for k in 0..3 {
                row[k] -= v[k][l];
            }
        }
    }
}

/// Lanes for any machine.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Portable;
impl InstructionSet for Portable {}

/// Eight bonds at a time.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Lanes<I>(Eight, PhantomData<I>);

impl<I> Lanes<I> {
    #[inline(always)]
    fn new(x: Eight) -> Self {
        Lanes(x, PhantomData)
    }
}

macro_rules! operator {
    ($trait:ident, $f:ident) => {
        impl<I: InstructionSet> $trait for Lanes<I> {
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
impl<I: InstructionSet> Mul<f64> for Lanes<I> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: f64) -> Self {
        Self::new(I::mul(self.0, I::splat(o)))
    }
}
impl<I: InstructionSet> Neg for Lanes<I> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self::new(I::sub(I::splat(-0.0), self.0))
    }
}
impl<I: InstructionSet> AddAssign for Lanes<I> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}
impl<I: InstructionSet> SubAssign for Lanes<I> {
    #[inline(always)]
    fn sub_assign(&mut self, o: Self) {
        *self = *self - o;
    }
}

impl<I: InstructionSet> Scalar for Lanes<I> {
    type Sum = f64;
    type Index = Points;
    const WIDTH: usize = WIDTH;
    #[inline(always)]
    fn of(x: f64) -> Self {
        Self::new(I::splat(x))
    }
    #[inline(always)]
    fn lift(x: f64) -> Self {
        Self::of(x)
    }
    #[inline(always)]
    fn sum(self) -> f64 {
        I::sum(self.0)
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
    fn index(list: &[u32], at: usize) -> Points {
        let block = &list[at..at + WIDTH];
        [block[0], block[1], block[2], block[3], block[4], block[5], block[6], block[7]]
    }
    #[inline(always)]
    fn splat_index(i: usize) -> Points {
        [i as u32; WIDTH]
    }
    #[inline(always)]
    fn load(data: &[f64], at: usize) -> Self {
        let b = &data[at..at + WIDTH];
        Self::new([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]])
    }
    #[inline(always)]
    fn load_point(data: &[f64], j: Points) -> Self {
        Self::new(array(
            #[inline(always)]
            |l| data[j[l] as usize],
        ))
    }
    #[inline(always)]
    fn row_f64(data: &[f64], j: Points) -> [Self; ROW] {
        let r = I::rows(data, j);
        [Self::new(r[0]), Self::new(r[1]), Self::new(r[2]), Self::new(r[3])]
    }
    #[inline(always)]
    fn row(data: &[f64], j: Points) -> [Self; ROW] {
        Self::row_f64(data, j)
    }
    #[inline(always)]
    fn masked(self, intact: &[u8], at: usize) -> Self {
        Self::new(I::mask(self.0, intact[at / WIDTH]))
    }
    #[inline(always)]
    fn subtract_rows<const D: usize>(rows: &mut [f64], j: Points, v: [Self; D]) {
        let mut w = [I::splat(0.0); 3];
        for k in 0..D {
            w[k] = v[k].0;
        }
        I::subtract_rows(rows, j, w);
    }
}

/// A computation over bonds that does not care how many it takes at a time.
pub trait Kernel {
    /// What it gives.
    type Output;
    /// The computation; must be `#[inline(always)]`, with everything it calls.
    fn run<S: Scalar<Sum = f64>>(self) -> Self::Output;
}

/// Runs a kernel with the widest lanes of this machine.
#[inline]
pub fn widest<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    if let Some(run) = avx512::available::<K>() {
        return run(kernel);
    }
    kernel.run::<Lanes<Portable>>()
}

/// Runs a kernel with the portable lanes (for comparison).
pub fn portable<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Lanes<Portable>>()
}

/// The name of the lanes that [`widest`] chooses on this machine.
pub fn name() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    if avx512::detected() {
        return "AVX-512, 8 bonds at a time";
    }
    "portable, 8 bonds at a time"
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every operation, folded into numbers that two instruction sets must agree on.
    struct Everything<'a>(&'a [f64], &'a [u32]);
    impl Kernel for Everything<'_> {
        type Output = Vec<f64>;
        #[inline(always)]
        fn run<S: Scalar<Sum = f64>>(self) -> Vec<f64> {
            let (mut out, mut rows) = (vec![], self.0.to_vec());
            for at in (0..self.1.len()).step_by(S::WIDTH) {
                let j = S::index(self.1, at);
                let [a, b, c, d] = S::row_f64(self.0, j);
                let x = S::load(self.0, at);
                let r =
                    (a + b) * c - d / (x + S::of(2.0)) + (a * a + S::of(1.0)).rsqrt() + (b - S::of(30.0)).recip() + b.abs().sqrt() - (-c);
                let s = a.select(b, c).max(d).min(x).fma(a, r) + S::load_point(self.0, j) * 0.5;
                out.push(s.masked(&[0b1011_0101; 64], at).sum());
                S::subtract_rows::<3>(&mut rows, j, [a, s, r]);
                S::subtract_rows::<1>(&mut rows, j, [s]);
            }
            out.extend(rows);
            out
        }
    }

    #[test]
    fn instruction_sets_agree() {
        let data: Vec<f64> = (0..256).map(|k| ((k * 7919 % 1009) as f64 - 504.0) / 100.0).collect();
        // repeated far points: the subtraction must see its own writes
        let index: Vec<u32> = (0..64).map(|k| (k * k % 37) as u32 % 13).collect();
        let (a, b) = (widest(Everything(&data, &index)), portable(Everything(&data, &index)));
        assert_eq!(a.len(), b.len());
        for (x, y) in a.iter().zip(&b) {
            assert!(x.is_finite() && (x - y).abs() <= 1e-12 * (1.0 + y.abs()), "{x} {y}");
        }
    }

    #[test]
    #[should_panic(expected = "out of")]
    fn a_far_point_outside_the_rows_is_caught() {
        widest(Everything(&[0.0; 64], &[0, 1, 2, 3, 4, 5, 6, 16]));
    }
}
