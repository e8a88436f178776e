//! Bond force as a law of the bond stretch s = e/|ξ|, for the bond-based solid: the dimensionless force g(s) with g ≈ s
//! for small s, and its (incremental) potential.

use crate::scalar::Scalar;
use std::sync::Arc;

/// A law of the bond stretch. `past(k)` is committed history word `k` of the bond.
pub trait StretchLaw: Clone + Send + Sync + 'static {
    /// Words of history a bond keeps.
    const BOND_MEMORY: usize = 0;
    /// g(s)
    fn force<S: Scalar>(&self, s: S, past: impl Fn(usize) -> S) -> S;
    /// Γ(s) with dΓ/ds = g at fixed history.
    fn potential<S: Scalar>(&self, s: S, past: impl Fn(usize) -> S) -> S;
    /// The history after an accepted increment that ends at stretch `s`.
    fn commit(&self, _s: f64, _memory: &mut [f64]) {}
}

/// g = s
#[derive(Clone, Copy, Debug)]
pub struct Elastic;
impl StretchLaw for Elastic {
    #[inline(always)]
    fn force<S: Scalar>(&self, s: S, _: impl Fn(usize) -> S) -> S {
        s
    }
    #[inline(always)]
    fn potential<S: Scalar>(&self, s: S, _: impl Fn(usize) -> S) -> S {
        s * s * 0.5
    }
}

/// g = s in tension, 0 in compression.
#[derive(Clone, Copy, Debug)]
pub struct TensionOnly;
impl StretchLaw for TensionOnly {
    #[inline(always)]
    fn force<S: Scalar>(&self, s: S, _: impl Fn(usize) -> S) -> S {
        s.max(S::of(0.0))
    }
    #[inline(always)]
    fn potential<S: Scalar>(&self, s: S, past: impl Fn(usize) -> S) -> S {
        let g = self.force(s, past);
        g * g * 0.5
    }
}

/// Elastic up to a peak stretch, then linear softening to no force at the failure stretch; unloading goes straight to the
/// origin, compression is elastic. The bond remembers its largest stretch.
#[derive(Clone, Copy, Debug)]
pub struct Bilinear {
    /// Stretch of the largest force.
    pub peak: f64,
    /// Stretch without force; above `peak`.
    pub failure: f64,
}
impl Bilinear {
    /// Largest stretch so far, at least the peak.
    #[inline(always)]
    fn reached<S: Scalar>(&self, past: impl Fn(usize) -> S) -> S {
        past(0).max(S::of(self.peak))
    }
    /// Force on the envelope beyond the peak.
    #[inline(always)]
    fn envelope<S: Scalar>(&self, s: S) -> S {
        ((S::of(self.failure) - s) * (self.peak / (self.failure - self.peak))).max(S::of(0.0))
    }
}
impl StretchLaw for Bilinear {
    const BOND_MEMORY: usize = 1;
    #[inline(always)]
    fn force<S: Scalar>(&self, s: S, past: impl Fn(usize) -> S) -> S {
        let r = self.reached(past);
        let unloading = (-s).select(s, s * (self.envelope(r) / r));
        (r - s).select(unloading, self.envelope(s))
    }
    #[inline(always)]
    fn potential<S: Scalar>(&self, s: S, past: impl Fn(usize) -> S) -> S {
        let r = self.reached(past);
        let k = self.envelope(r) / r;
        let unloading = (-s).select(s * s * 0.5, s * s * k * 0.5);
        // beyond r the area under the envelope, a triangle of height `envelope` less the one that is left
        let side = (self.failure - self.peak) / self.peak * 0.5;
        let (a, b) = (self.envelope(r), self.envelope(s));
        let loading = r * a * 0.5 + (a * a - b * b) * side;
        (r - s).select(unloading, loading)
    }
    fn commit(&self, s: f64, memory: &mut [f64]) {
        memory[0] = memory[0].max(s);
    }
}

/// Elastic, perfectly plastic at ± the yield stretch. The bond remembers its plastic stretch.
#[derive(Clone, Copy, Debug)]
pub struct ElasticPlastic {
    /// Stretch at first yield.
    pub yield_stretch: f64,
}
impl StretchLaw for ElasticPlastic {
    const BOND_MEMORY: usize = 1;
    #[inline(always)]
    fn force<S: Scalar>(&self, s: S, past: impl Fn(usize) -> S) -> S {
        (s - past(0)).max(S::of(-self.yield_stretch)).min(S::of(self.yield_stretch))
    }
    #[inline(always)]
    fn potential<S: Scalar>(&self, s: S, past: impl Fn(usize) -> S) -> S {
        let elastic = s - past(0);
        let g = self.force(s, past);
        g * (elastic - g * 0.5)
    }
    fn commit(&self, s: f64, memory: &mut [f64]) {
        let elastic = s - memory[0];
        memory[0] += elastic - elastic.clamp(-self.yield_stretch, self.yield_stretch);
    }
}

/// A law given by values at equally spaced stretches, linear between them and beyond the ends. One of them is s = 0, so that
/// a table of a law with g(0) = 0 has exactly no force in the reference state.
#[derive(Clone, Debug)]
pub struct Tabulated {
    /// Intervals below s = 0.
    below: usize,
    spacing: f64,
    force: Arc<[f64]>,
    potential: Arc<[f64]>,
}
impl Tabulated {
    /// Samples `g` at stretches (last − first)/intervals apart that cover `first` to `last` and include 0, where the
    /// potential is zero.
    pub fn new(first: f64, last: f64, intervals: usize, g: impl Fn(f64) -> f64) -> Self {
        let spacing = (last - first) / intervals as f64;
        // a range that ends at a multiple of the spacing up to round-off needs no further interval
        let reach = |s: f64| (s / spacing - 1e-9).ceil().max(0.0) as usize;
        // an interval above 0 at least, or 0 would be reached from below with round-off
        let (below, above) = (reach(-first), reach(last).max(1));
        let intervals = below + above;
        let at = |k: usize| spacing * (k as f64 - below as f64);
        let force: Arc<[f64]> = (0..=intervals).map(|k| g(at(k))).collect();
        let mut sum = 0.0;
        let work: Vec<f64> = (0..=intervals)
            .map(|k| {
                if k > 0 {
                    sum += 0.5 * (force[k - 1] + force[k]) * spacing;
                }
                sum
            })
            .collect();
        let potential = work.iter().map(|w| w - work[below]).collect();
        Tabulated { below, spacing, force, potential }
    }
    /// Potential, force and slope.
    #[inline(always)]
    fn evaluate(&self, s: f64) -> (f64, f64, f64) {
        let below = self.below as f64;
        let position = s / self.spacing + below;
        let k = (position.max(0.0) as usize).min(self.force.len() - 2);
        let ds = s - self.spacing * (k as f64 - below);
        let slope = (self.force[k + 1] - self.force[k]) / self.spacing;
        (self.potential[k] + ds * (self.force[k] + 0.5 * slope * ds), self.force[k] + slope * ds, slope)
    }
}
impl StretchLaw for Tabulated {
    #[inline(always)]
    fn force<S: Scalar>(&self, s: S, _: impl Fn(usize) -> S) -> S {
        s.map(
            #[inline(always)]
            |s| {
                let (_, g, slope) = self.evaluate(s);
                (g, slope)
            },
        )
    }
    #[inline(always)]
    fn potential<S: Scalar>(&self, s: S, _: impl Fn(usize) -> S) -> S {
        s.map(
            #[inline(always)]
            |s| {
                let (potential, g, _) = self.evaluate(s);
                (potential, g)
            },
        )
    }
}

/// One of the laws that are not plainly elastic, so that models need not be compiled once for every one.
#[derive(Clone, Debug)]
pub enum Nonlinear {
    /// [`TensionOnly`].
    TensionOnly,
    /// [`Bilinear`].
    Bilinear(Bilinear),
    /// [`ElasticPlastic`].
    ElasticPlastic(ElasticPlastic),
    /// [`Tabulated`].
    Tabulated(Tabulated),
}
impl StretchLaw for Nonlinear {
    const BOND_MEMORY: usize = 1;
    #[inline(always)]
    fn force<S: Scalar>(&self, s: S, past: impl Fn(usize) -> S) -> S {
        match self {
            Nonlinear::TensionOnly => TensionOnly.force(s, past),
            Nonlinear::Bilinear(law) => law.force(s, past),
            Nonlinear::ElasticPlastic(law) => law.force(s, past),
            Nonlinear::Tabulated(law) => law.force(s, past),
        }
    }
    #[inline(always)]
    fn potential<S: Scalar>(&self, s: S, past: impl Fn(usize) -> S) -> S {
        match self {
            Nonlinear::TensionOnly => TensionOnly.potential(s, past),
            Nonlinear::Bilinear(law) => law.potential(s, past),
            Nonlinear::ElasticPlastic(law) => law.potential(s, past),
            Nonlinear::Tabulated(law) => law.potential(s, past),
        }
    }
    fn commit(&self, s: f64, memory: &mut [f64]) {
        match self {
            Nonlinear::TensionOnly => TensionOnly.commit(s, memory),
            Nonlinear::Bilinear(law) => law.commit(s, memory),
            Nonlinear::ElasticPlastic(law) => law.commit(s, memory),
            Nonlinear::Tabulated(law) => law.commit(s, memory),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bilinear_envelope_and_unloading() {
        let law = Bilinear { peak: 0.01, failure: 0.03 };
        let g = |s: f64, r: f64| law.force(s, |_| r);
        assert_eq!(g(0.005, 0.0), 0.005);
        assert!((g(0.02, 0.0) - 0.005).abs() < 1e-17);
        // unloaded from 0.02 halfway: secant
        assert!((g(0.01, 0.02) - 0.0025).abs() < 1e-17);
        assert_eq!(g(-0.01, 0.02), -0.01);
        assert_eq!(g(0.04, 0.0), 0.0);
        // work to failure: half of peak × failure
        assert!((law.potential(0.05, |_| 0.0) - 0.5 * 0.01 * 0.03).abs() < 1e-18);
        let mut memory = [0.0];
        law.commit(0.02, &mut memory);
        law.commit(0.01, &mut memory);
        assert_eq!(memory, [0.02]);
    }

    #[test]
    fn plastic_stretch_stays() {
        let law = ElasticPlastic { yield_stretch: 0.01 };
        let mut memory = [0.0];
        law.commit(0.03, &mut memory);
        assert!((memory[0] - 0.02).abs() < 1e-17);
        assert!((law.force(0.02, |_| memory[0])).abs() < 1e-17);
        assert_eq!(law.force(-1.0, |_| memory[0]), -0.01);
    }

    #[test]
    fn a_table_reproduces_a_parabola_at_its_knots() {
        let law = Tabulated::new(-0.1, 0.1, 200, |s| s - 3.0 * s * s);
        assert!((law.force(0.05, |_| 0.0) - (0.05 - 0.0075)).abs() < 1e-15);
        // potential s²/2 − s³, trapezoidal error h²/12·f″·s
        assert!((law.potential(0.1, |_| 0.0) - (0.005 - 0.001)).abs() < 1e-6 * 0.06);
    }

    #[test]
    fn a_table_has_no_force_at_no_stretch() {
        // neither the ends nor the number of intervals are made for a knot at 0
        for (first, last, n) in [(-0.2, 0.2, 37), (-0.13, 0.4, 11), (0.05, 0.1, 3), (-0.3, -0.1, 7)] {
            let law = Tabulated::new(first, last, n, |s| s - 2.0 * s * s);
            assert_eq!((law.force(0.0, |_| 0.0), law.potential(0.0, |_| 0.0)), (0.0, 0.0), "{first} {last} {n}");
            let h = (last - first) / n as f64;
            for s in [first, last, 0.5 * (first + last)] {
                // interpolation error of a parabola: at most 2·h²/4 between knots
                assert!((law.force(s, |_| 0.0) - (s - 2.0 * s * s)).abs() <= 0.51 * h * h, "{first} {last} {s}");
            }
        }
    }
}
