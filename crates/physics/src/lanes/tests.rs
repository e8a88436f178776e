//! Lanes of all instruction sets against one another and against numbers one by one.

use super::*;

/// Runs with nothing wider than these instructions. Tests share the limit: one at a time.
fn limited<T>(instructions: Instructions, run: impl FnOnce() -> T) -> T {
    static ALONE: std::sync::Mutex<()> = std::sync::Mutex::new(());
    let _alone = ALONE.lock().unwrap_or_else(|e| e.into_inner());
    limit(instructions);
    let out = run();
    limit(Instructions::Avx512);
    out
}

/// Every operation, folded into numbers that two instruction sets must agree on.
struct Everything<'a>(&'a [f64], &'a [u16]);
impl Kernel for Everything<'_> {
    type Output = Vec<f64>;
    const OFTEN: bool = true;
    #[inline(always)]
    fn run<S: Scalar<Sum = f64>>(self) -> Vec<f64> {
        let (mut out, mut rows) = (vec![], self.0.to_vec());
        for at in (0..self.1.len()).step_by(S::WIDTH) {
            let j = S::index(self.1, at);
            let [a, b, c, d] = S::row_f64(self.0, j);
            let x = S::load(self.0, at);
            let r = (a + b) * c - d / (x + S::of(2.0)) + (a * a + S::of(1.0)).rsqrt() + (b - S::of(30.0)).recip() + b.abs().sqrt() - (-c);
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
    let index: Vec<u16> = (0..64).map(|k| (k * k % 37) as u16 % 13).collect();
    let b = portable(Everything(&data, &index));
    for i in [Instructions::Avx2, Instructions::Avx512].into_iter().filter(|i| i.available()) {
        let a = limited(i, || widest(Everything(&data, &index)));
        assert_eq!(a.len(), b.len());
        for (x, y) in a.iter().zip(&b) {
            assert!(x.is_finite() && (x - y).abs() <= 1e-12 * (1.0 + y.abs()), "{i:?}: {x} {y}");
        }
    }
}

/// Every operation of points abreast, one group at a time or two.
struct EverythingAbreast<'a, const PAIRED: bool>(&'a [f64]);
impl<const PAIRED: bool> GroupKernel for EverythingAbreast<'_, PAIRED> {
    type Output = Vec<f64>;
    const PAIRED: bool = PAIRED;
    #[inline(always)]
    fn run<S: Abreast>(self) -> Vec<f64> {
        let (mut plane, mut bits) = (self.0.to_vec(), vec![]);
        // what one group writes the other sees
        for cells in [[0, 40], [3, 51], [17, 20], [90, 9]] {
            for cells in cells.chunks(S::GROUPS) {
                let cells = [cells[0], cells.get(1).copied().unwrap_or(0)];
                let x = S::load_cells(self.0, cells);
                let y = S::load_cells(self.0, cells.map(|c| c + 5));
                let r = (x * y + S::of(2.0)).abs().sqrt() - (x * x + S::of(1.0)).rsqrt() / (y.abs() + S::of(0.5)).recip();
                r.keep(0b0101_1001_0101_1001).subtract_from(&mut plane, cells);
                x.select(y, -r).fma(y, x * 0.5).add_to(&mut plane, cells.map(|c| c + 1));
                let twice = S::of_lanes(
                    #[inline(always)]
                    |l| 2.0 * r.lane(l),
                );
                twice.max(y).min(x).subtract_from(&mut plane, cells);
                let positive = y.positive();
                bits.extend((0..S::GROUPS * WIDTH).map(|l| f64::from(positive >> l & 1)));
            }
        }
        plane.extend(bits);
        plane
    }
}

#[test]
fn points_abreast_agree_with_the_portable_ones() {
    let data: Vec<f64> = (0..128).map(|k| ((k * 7919 % 1009) as f64 - 504.0) / 100.0).collect();
    let portable = portable_abreast(EverythingAbreast::<false>(&data));
    for i in Instructions::ALL.into_iter().filter(|i| i.available()) {
        let single = limited(i, || widest_abreast(EverythingAbreast::<false>(&data)));
        let paired = limited(i, || widest_abreast(EverythingAbreast::<true>(&data)));
        for a in [single, paired] {
            assert_eq!(a.len(), portable.len());
            for (x, y) in a.iter().zip(&portable) {
                assert!(x.is_finite() && (x - y).abs() <= 1e-12 * (1.0 + y.abs()), "{i:?}: {x} {y}");
            }
        }
    }
}

#[test]
#[should_panic(expected = "out of range")]
fn a_group_outside_the_plane_is_caught() {
    widest_abreast(EverythingAbreast::<true>(&data_of(97)));
}
fn data_of(n: usize) -> Vec<f64> {
    (0..n).map(|k| k as f64).collect()
}

/// ln, ln(1 + x), eˣ, eˣ − 1, powers, and ln c of c = 1 + x ≥ 0, of numbers, in rows.
struct Functions<'a>(&'a [f64], &'a [u16]);
impl Kernel for Functions<'_> {
    type Output = Vec<f64>;
    const OFTEN: bool = true;
    #[inline(always)]
    fn run<S: Scalar<Sum = f64>>(self) -> Vec<f64> {
        let mut rows = vec![0.0; self.0.len() * ROW];
        for at in (0..self.1.len()).step_by(S::WIDTH) {
            let x = S::load(self.0, at);
            S::subtract_rows::<3>(&mut rows, S::index(self.1, at), [-x.ln(), -x.ln_1p(), -x.exp_m1()]);
        }
        let firsts: Vec<f64> = rows.chunks(ROW).flat_map(|r| r[..3].to_vec()).collect();
        rows.fill(0.0);
        for at in (0..self.1.len()).step_by(S::WIDTH) {
            let x = S::load(self.0, at);
            S::subtract_rows::<3>(&mut rows, S::index(self.1, at), [-x.exp(), -x.powf(1.5), -x.ln_grown(x + S::of(1.0))]);
        }
        rows.chunks(ROW).zip(firsts.chunks(3)).flat_map(|(r, f)| [f[0], f[1], r[0], f[2], r[1], r[2]]).collect()
    }
}

/// Distance in units of the last place of `b`.
fn places(a: f64, b: f64) -> f64 {
    if a == b || (a.is_nan() && b.is_nan()) {
        return 0.0;
    }
    let next = f64::from_bits(b.abs().to_bits() + 1) - b.abs();
    (a - b).abs() / next
}

#[test]
fn transcendental_functions_to_two_units_of_the_last_place() {
    let mut x =
        vec![0.0, 1.0, f64::INFINITY, f64::NAN, -0.5, -1.0, -1.5, 1e-310, 5e-324, f64::MAX, 1e300, -1e-18, 3e-17, 2.3e-16, -710.0, 709.7];
    let mut state = 88172645463325252u64;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    for _ in 0..20_000 {
        let u = next();
        x.extend([
            u,
            2.0 * u,
            40.0 * (u - 0.5),
            1400.0 * (u - 0.5),
            1e-3 * (u - 0.5),
            (u - 0.5) * 0.8,
            (200.0 * (u - 0.5)).exp(),
            1.0 + 1e-7 * u,
        ]);
    }
    for i in Instructions::ALL.into_iter().filter(|i| i.available()) {
        let some = |x: &[f64]| {
            let index: Vec<u16> = (0..x.len() as u16).collect();
            widest(Functions(x, &index))
        };
        let (name, out) = (i.name(), limited(i, || x.chunks(1 << 15).flat_map(some).collect::<Vec<_>>()));
        for (x, got) in x.iter().zip(out.chunks(6)) {
            // c has lost digits of x, which count where c is small
            let grown = if x + 1.0 < 0.75 { (x + 1.0).ln() } else { x.ln_1p() };
            let want = [x.ln(), x.ln_1p(), x.exp(), x.exp_m1(), x.powf(1.5), grown];
            // the last is for c >= 0
            for k in 0..if *x < -1.0 { 5 } else { 6 } {
                // relative accuracy ends with the normal numbers
                let tiny = want[k].abs() < f64::MIN_POSITIVE && got[k].abs() <= f64::MIN_POSITIVE;
                let off = if tiny { 0.0 } else { places(got[k], want[k]) };
                // the error of a power grows with the logarithm, which is multiplied
                let allowed = match k {
                    4 => 2.0 + 3.0 * (1.5 * x.ln()).abs(),
                    // two units and no more: c is rounded before its logarithm is taken
                    5 => 2.5,
                    _ => 2.0,
                };
                assert!(off == 0.0 || off < allowed, "{name}, function {k} of {x:e}: {:e} {:e}, {off} units", got[k], want[k]);
            }
        }
    }
}

#[test]
#[should_panic(expected = "out of")]
fn a_far_point_outside_the_rows_is_caught() {
    widest(Everything(&[0.0; 64], &[0, 1, 2, 3, 4, 5, 6, 16]));
}
