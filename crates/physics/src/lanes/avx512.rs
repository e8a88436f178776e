//! Lanes of AVX-512. The only unsafe code of the program.
//!
//! Soundness: [`Avx512`] is private to the parent module and reaches a kernel only through [`available`], which has
//! asked the processor; every load and store by index compares the indices with the length of its slice first.

use super::{Bonds, Eight, GroupKernel, Indices, InstructionSet, Kernel, Lanes, Pair, Points};
use crate::scalar::ROW;
use std::arch::x86_64::*;

#[derive(Clone, Copy, Debug)]
pub(super) struct Avx512;

/// Whether the processor has what [`Avx512`] uses.
#[inline]
pub(super) fn detected() -> bool {
    is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("fma")
}

#[target_feature(enable = "avx512f,avx512dq,avx512vl,fma")]
#[inline(never)]
fn run<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Lanes<Avx512, Bonds>>()
}

#[target_feature(enable = "avx512f,avx512dq,avx512vl,fma")]
#[inline(never)]
fn run_abreast<K: GroupKernel>(kernel: K) -> K::Output {
    if K::PAIRED { kernel.run::<Pair<Lanes<Avx512, Points>>>() } else { kernel.run::<Lanes<Avx512, Points>>() }
}

/// The way to run a kernel with these lanes, where the processor has them.
#[inline]
pub(super) fn available<K: Kernel>() -> Option<fn(K) -> K::Output> {
    // SAFETY: the features were detected.
    detected().then_some(|kernel| unsafe { run(kernel) })
}

/// The same over groups of points.
#[inline]
pub(super) fn available_abreast<K: GroupKernel>() -> Option<fn(K) -> K::Output> {
    // SAFETY: the features were detected.
    detected().then_some(|kernel| unsafe { run_abreast(kernel) })
}

#[inline(always)]
fn m(a: Eight) -> __m512d {
    // SAFETY: same size, every bit pattern is valid.
    unsafe { std::mem::transmute(a) }
}
#[inline(always)]
fn w(a: __m512d) -> Eight {
    // SAFETY: same size, every bit pattern is valid.
    unsafe { std::mem::transmute(a) }
}

#[cold]
#[inline(never)]
fn out_of_range() -> ! {
    panic!("a neighbour index is out of the range of its rows");
}

/// All indices address whole rows of `data`.
#[inline(always)]
fn check(data: &[f64], j: Indices) {
    let rows = (data.len() / ROW).min(u32::MAX as usize) as u32;
    // SAFETY: registers only; the features are there (module documentation).
    let outside = unsafe { _mm256_cmpge_epu32_mask(std::mem::transmute::<Indices, __m256i>(j), _mm256_set1_epi32(rows as i32)) };
    if outside != 0 {
        out_of_range();
    }
}

/// Rows `a` and `b` side by side.
///
/// # Safety
/// Both rows are readable.
#[inline(always)]
unsafe fn two_rows(p: *const f64, a: u32, b: u32) -> __m512d {
    unsafe {
        let lo = _mm256_loadu_pd(p.add(a as usize * ROW));
        let hi = _mm256_loadu_pd(p.add(b as usize * ROW));
        _mm512_insertf64x4::<1>(_mm512_castpd256_pd512(lo), hi)
    }
}

/// Subtracts `r` from row `j`.
///
/// # Safety
/// The row is writable.
#[inline(always)]
unsafe fn subtract_row(p: *mut f64, j: u32, r: __m256d) {
    unsafe {
        let q = p.add(j as usize * ROW);
        _mm256_storeu_pd(q, _mm256_sub_pd(_mm256_loadu_pd(q), r));
    }
}

impl InstructionSet for Avx512 {
    #[inline(always)]
    fn splat(x: f64) -> Eight {
        // SAFETY: registers only, as everywhere below where nothing else is said.
        w(unsafe { _mm512_set1_pd(x) })
    }
    #[inline(always)]
    fn add(a: Eight, b: Eight) -> Eight {
        w(unsafe { _mm512_add_pd(m(a), m(b)) })
    }
    #[inline(always)]
    fn sub(a: Eight, b: Eight) -> Eight {
        w(unsafe { _mm512_sub_pd(m(a), m(b)) })
    }
    #[inline(always)]
    fn mul(a: Eight, b: Eight) -> Eight {
        w(unsafe { _mm512_mul_pd(m(a), m(b)) })
    }
    #[inline(always)]
    fn div(a: Eight, b: Eight) -> Eight {
        w(unsafe { _mm512_div_pd(m(a), m(b)) })
    }
    #[inline(always)]
    fn fma(a: Eight, b: Eight, c: Eight) -> Eight {
        w(unsafe { _mm512_fmadd_pd(m(a), m(b), m(c)) })
    }
    #[inline(always)]
    fn sqrt(a: Eight) -> Eight {
        w(unsafe { _mm512_sqrt_pd(m(a)) })
    }
    /// The 14-bit estimate r and what is left of 1/√x = r (1 − e)^(−1/2), e = 1 − x r², to the third power of e: full precision but for
    /// the last bit or two, and a shorter chain of operations than two Newton steps.
    #[inline(always)]
    fn rsqrt(a: Eight) -> Eight {
        unsafe {
            let x = m(a);
            let r = _mm512_rsqrt14_pd(x);
            let e = _mm512_fnmadd_pd(_mm512_mul_pd(x, r), r, _mm512_set1_pd(1.0));
            let p = _mm512_fmadd_pd(e, _mm512_set1_pd(0.3125), _mm512_set1_pd(0.375));
            let p = _mm512_fmadd_pd(p, e, _mm512_set1_pd(0.5));
            w(_mm512_fmadd_pd(_mm512_mul_pd(r, e), p, r))
        }
    }
    /// The 14-bit estimate r and what is left of 1/x = r (1 + e)(1 + e²)…, e = 1 − x r; a division takes the processor longer.
    #[inline(always)]
    fn recip(a: Eight) -> Eight {
        unsafe {
            let x = m(a);
            let r = _mm512_rcp14_pd(x);
            let e = _mm512_fnmadd_pd(x, r, _mm512_set1_pd(1.0));
            let better = _mm512_fmadd_pd(r, e, r);
            w(_mm512_fmadd_pd(better, _mm512_mul_pd(e, e), better))
        }
    }
    #[inline(always)]
    fn select(x: Eight, a: Eight, b: Eight) -> Eight {
        w(unsafe {
            let positive = _mm512_cmp_pd_mask::<_CMP_GE_OQ>(m(x), _mm512_setzero_pd());
            _mm512_mask_blend_pd(positive, m(b), m(a))
        })
    }
    #[inline(always)]
    fn sum(a: Eight) -> f64 {
        unsafe { _mm512_reduce_add_pd(m(a)) }
    }
    #[inline(always)]
    fn load(a: &Eight) -> Eight {
        // SAFETY: a reference to eight numbers.
        w(unsafe { _mm512_loadu_pd(a.as_ptr()) })
    }
    #[inline(always)]
    fn store(to: &mut Eight, a: Eight) {
        // SAFETY: a reference to eight numbers.
        unsafe { _mm512_storeu_pd(to.as_mut_ptr(), m(a)) }
    }
    #[inline(always)]
    fn positive(a: Eight) -> u8 {
        unsafe { _mm512_cmp_pd_mask::<_CMP_GT_OQ>(m(a), _mm512_setzero_pd()) }
    }
    #[inline(always)]
    fn mask(a: Eight, bits: u8) -> Eight {
        w(unsafe { _mm512_maskz_mov_pd(bits, m(a)) })
    }
    #[inline(always)]
    fn long(f: impl FnOnce() -> Eight) -> Eight {
        f()
    }
    #[inline(always)]
    fn split(a: Eight) -> (Eight, Eight) {
        unsafe { (w(_mm512_getmant_pd::<_MM_MANT_NORM_1_2, _MM_MANT_SIGN_NAN>(m(a))), w(_mm512_getexp_pd(m(a)))) }
    }
    #[inline(always)]
    fn scale(a: Eight, n: Eight) -> Eight {
        w(unsafe { _mm512_scalef_pd(m(a), m(n)) })
    }
    #[inline(always)]
    fn rows(data: &[f64], j: Indices) -> [Eight; ROW] {
        check(data, j);
        let p = data.as_ptr();
        // SAFETY: `check`: each index addresses a whole row of `data`.
        unsafe {
            let (r04, r15) = (two_rows(p, j[0], j[4]), two_rows(p, j[1], j[5]));
            let (r26, r37) = (two_rows(p, j[2], j[6]), two_rows(p, j[3], j[7]));
            let (xz01, yw01) = (_mm512_unpacklo_pd(r04, r15), _mm512_unpackhi_pd(r04, r15));
            let (xz23, yw23) = (_mm512_unpacklo_pd(r26, r37), _mm512_unpackhi_pd(r26, r37));
            let first = _mm512_setr_epi64(0, 1, 8, 9, 4, 5, 12, 13);
            let second = _mm512_setr_epi64(2, 3, 10, 11, 6, 7, 14, 15);
            [
                w(_mm512_permutex2var_pd(xz01, first, xz23)),
                w(_mm512_permutex2var_pd(yw01, first, yw23)),
                w(_mm512_permutex2var_pd(xz01, second, xz23)),
                w(_mm512_permutex2var_pd(yw01, second, yw23)),
            ]
        }
    }
    #[inline(always)]
    fn subtract_rows(data: &mut [f64], j: Indices, v: [Eight; 3]) {
        check(data, j);
        let p = data.as_mut_ptr();
        // SAFETY: `check`: each index addresses a whole row of `data`.
        unsafe {
            let (x, y, z) = (m(v[0]), m(v[1]), m(v[2]));
            let zero = _mm512_setzero_pd();
            let (xy_even, xy_odd) = (_mm512_unpacklo_pd(x, y), _mm512_unpackhi_pd(x, y));
            let (z_even, z_odd) = (_mm512_unpacklo_pd(z, zero), _mm512_unpackhi_pd(z, zero));
            let first = _mm512_setr_epi64(0, 1, 8, 9, 4, 5, 12, 13);
            let second = _mm512_setr_epi64(2, 3, 10, 11, 6, 7, 14, 15);
            let r04 = _mm512_permutex2var_pd(xy_even, first, z_even);
            let r26 = _mm512_permutex2var_pd(xy_even, second, z_even);
            let r15 = _mm512_permutex2var_pd(xy_odd, first, z_odd);
            let r37 = _mm512_permutex2var_pd(xy_odd, second, z_odd);
            subtract_row(p, j[0], _mm512_castpd512_pd256(r04));
            subtract_row(p, j[1], _mm512_castpd512_pd256(r15));
            subtract_row(p, j[2], _mm512_castpd512_pd256(r26));
            subtract_row(p, j[3], _mm512_castpd512_pd256(r37));
            subtract_row(p, j[4], _mm512_extractf64x4_pd::<1>(r04));
            subtract_row(p, j[5], _mm512_extractf64x4_pd::<1>(r15));
            subtract_row(p, j[6], _mm512_extractf64x4_pd::<1>(r26));
            subtract_row(p, j[7], _mm512_extractf64x4_pd::<1>(r37));
        }
    }
}
