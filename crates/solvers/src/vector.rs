//! Reductions and updates on flat vectors whose result does not depend on the number of threads.
//!
//! Every reduction cuts its vectors into chunks whose size depends on the length alone, sums each chunk on its own and adds the
//! chunk sums in index order. Nothing here allocates.

use rayon::prelude::*;

/// Shortest chunk: below this, starting a parallel task costs more than the sum.
const SHORTEST_CHUNK: usize = 4096;
/// Most chunks of one reduction: their sums live on the stack.
const MOST_CHUNKS: usize = 128;
/// Vectors shorter than this are reduced by the calling thread (same chunks, same result).
const PARALLEL_FROM: usize = 65_536;

/// Sums `term(range)` over the fixed chunks of `0..length`, in index order.
fn reduce(length: usize, term: impl Fn(std::ops::Range<usize>) -> f64 + Sync) -> f64 {
    let chunk = SHORTEST_CHUNK.max(length.div_ceil(MOST_CHUNKS));
    let count = length.div_ceil(chunk);
    let mut sums = [0.0; MOST_CHUNKS];
    let one = |(k, sum): (usize, &mut f64)| *sum = term(k * chunk..length.min((k + 1) * chunk));
    if length < PARALLEL_FROM {
        sums[..count].iter_mut().enumerate().for_each(one);
    } else {
        sums[..count].par_iter_mut().enumerate().with_max_len(1).for_each(one);
    }
    sums[..count].iter().sum()
}

/// Dot product of two vectors of equal length.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    debug_assert_eq!(a.len(), b.len());
    reduce(a.len(), |range| {
        let (a, b) = (&a[range.clone()], &b[range]);
        // Eight running sums let the compiler use vector registers; their order is fixed.
        let mut lanes = [0.0; 8];
        let (a8, a_rest) = a.as_chunks::<8>();
        let (b8, b_rest) = b.as_chunks::<8>();
        for (x, y) in a8.iter().zip(b8) {
            for k in 0..8 {
                lanes[k] += x[k] * y[k];
            }
        }
        let rest: f64 = a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum();
        lanes.iter().sum::<f64>() + rest
    })
}

/// Euclidean norm, safe against overflow and underflow of the squares.
pub fn norm(a: &[f64]) -> f64 {
    let plain = dot(a, a).sqrt();
    if plain.is_normal() && plain < 1e150 && plain > 1e-140 {
        return plain;
    }
    let largest = largest(a);
    if largest == 0.0 || !largest.is_finite() {
        return largest;
    }
    largest * reduce(a.len(), |range| a[range].iter().map(|x| (x / largest) * (x / largest)).sum()).sqrt()
}

/// Largest absolute entry; NaN where any entry is NaN; 0 for an empty vector.
pub fn largest(a: &[f64]) -> f64 {
    let mut largest = 0.0f64;
    for x in a {
        if x.is_nan() {
            return f64::NAN;
        }
        largest = largest.max(x.abs());
    }
    largest
}

/// `y += alpha x`.
pub fn add_scaled(y: &mut [f64], alpha: f64, x: &[f64]) {
    debug_assert_eq!(x.len(), y.len());
    for (y, x) in y.iter_mut().zip(x) {
        *y += alpha * x;
    }
}

/// `y = x + beta y`.
pub fn scale_and_add(y: &mut [f64], beta: f64, x: &[f64]) {
    debug_assert_eq!(x.len(), y.len());
    for (y, x) in y.iter_mut().zip(x) {
        *y = x + beta * *y;
    }
}

/// `out = a + alpha b`.
pub fn combine(out: &mut [f64], a: &[f64], alpha: f64, b: &[f64]) {
    for ((out, a), b) in out.iter_mut().zip(a).zip(b) {
        *out = a + alpha * b;
    }
}

/// Sets the entries that `fixed` marks to zero.
pub fn clear_fixed(x: &mut [f64], fixed: &[bool]) {
    debug_assert_eq!(x.len(), fixed.len());
    for (x, fixed) in x.iter_mut().zip(fixed) {
        if *fixed {
            *x = 0.0;
        }
    }
}

/// Fills `x` with a reproducible sequence in (−1, 1) (SplitMix64), for start vectors of iterations.
pub fn fill_seeded(x: &mut [f64], seed: u64) {
    let mut state = seed;
    for x in x {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^= z >> 31;
        *x = ((z >> 11) as f64 + 0.5) / (1u64 << 52) as f64 - 1.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dot_of_integers_is_exact() {
        let n = 200_003usize;
        let a: Vec<f64> = (0..n).map(|i| (i % 17) as f64).collect();
        let b = vec![1.0; n];
        let exact: usize = (0..n).map(|i| i % 17).sum();
        assert_eq!(dot(&a, &b), exact as f64);
    }

    #[test]
    fn norm_survives_extreme_units() {
        for scale in [1e-200, 1e-3, 1.0, 1e200] {
            let value = norm(&[3.0 * scale, 4.0 * scale]);
            assert!((value / (5.0 * scale) - 1.0).abs() < 1e-15, "{value}");
        }
        assert!(norm(&[1.0, f64::NAN]).is_nan());
        assert_eq!(norm(&[]), 0.0);
    }

    #[test]
    fn seeded_fill_is_centred() {
        let mut x = vec![0.0; 100_000];
        fill_seeded(&mut x, 7);
        let mean = x.iter().sum::<f64>() / x.len() as f64;
        assert!(mean.abs() < 0.01 && x.iter().all(|x| x.abs() < 1.0));
    }
}
