//! Lanes of AVX2: the portable ones, compiled for processors that have four numbers in a register and a fused multiplication.
//!
//! Soundness: [`Avx2`] is private to the parent module and reaches a kernel only through [`available`], which has asked the processor. Calling
//! code compiled for it is all that is unsafe here.

use super::{Bonds, Eight, GroupKernel, InstructionSet, Kernel, Lanes, Points};
use crate::scalar::array;

#[derive(Clone, Copy, Debug)]
pub(super) struct Avx2;

/// Whether the processor has what code for [`Avx2`] uses.
#[inline]
pub(super) fn detected() -> bool {
    is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")
}

#[target_feature(enable = "avx2,fma")]
#[inline(never)]
fn run<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Lanes<Avx2, Bonds>>()
}

#[target_feature(enable = "avx2,fma")]
#[inline(never)]
fn run_abreast<K: GroupKernel>(kernel: K) -> K::Output {
    // sixteen registers of four: two groups do not fit
    kernel.run::<Lanes<Avx2, Points>>()
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

impl InstructionSet for Avx2 {
    #[inline(always)]
    fn fma(a: Eight, b: Eight, c: Eight) -> Eight {
        array(
            #[inline(always)]
            |l| a[l].mul_add(b[l], c[l]),
        )
    }
    #[inline(always)]
    fn long(f: impl FnOnce() -> Eight) -> Eight {
        f()
    }
}
