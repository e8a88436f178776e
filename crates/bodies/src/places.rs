//! What it means to lie on a lattice along the axes exactly, an axis at a time.

/// Relative deviation from a lattice, beyond the round-off of coordinates.
pub(crate) const EXACT: f64 = 1e-12;

/// Equidistant places along an axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Places {
    low: f64,
    /// From one to the next (length).
    pub(crate) spacing: f64,
    /// How many there are, at least one.
    pub(crate) count: usize,
    round_off: f64,
}

impl Places {
    /// Uncertainty of coordinates between `low` and `high`.
    pub(crate) fn round_off(low: f64, high: f64) -> f64 {
        16.0 * f64::EPSILON * low.abs().max(high.abs())
    }

    /// Places from `low` to `high`, about `step` apart; one where these are the same but for round-off. `None` where so many cannot be numbered,
    /// or told from one another.
    pub(crate) fn between(low: f64, high: f64, step: f64) -> Option<Self> {
        let round_off = Self::round_off(low, high);
        if high - low <= round_off {
            return Some(Places { low, spacing: 0.0, count: 1, round_off });
        }
        let steps = ((high - low) / step).round();
        let sound = (1.0..=f64::from(1 << 30)).contains(&steps) && round_off <= 1e-6 * step;
        sound.then(|| Places { low, spacing: (high - low) / steps, count: steps as usize + 1, round_off })
    }

    /// Number of the place at `x`; `None` where `x` is beside its place.
    #[inline]
    pub(crate) fn number(&self, x: f64) -> Option<usize> {
        let number = if self.count > 1 { ((x - self.low) / self.spacing).round() } else { 0.0 };
        let beside = (x - (self.low + number * self.spacing)).abs();
        (beside <= self.round_off + EXACT * self.spacing && (0.0..self.count as f64).contains(&number)).then_some(number as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_found_in_any_unit_and_far_from_the_origin() {
        for unit in [1e-9, 1.0, 1e9] {
            for origin in [0.0, -7.3, 1e5] {
                let x = |k: usize| (origin + 0.1 * k as f64) * unit;
                let places = Places::between(x(0), x(40), x(1) - x(0)).unwrap();
                assert_eq!(places.count, 41);
                assert!((0..=40).all(|k| places.number(x(k)) == Some(k)), "{unit} {origin}");
                // beside a place, and beyond the last
                assert_eq!(places.number(x(3) + 1e-9 * unit), None);
                assert_eq!((places.number(x(41)), places.number(x(0) - 0.1 * unit)), (None, None));
            }
        }
    }

    #[test]
    fn what_cannot_be_told_apart_has_no_places() {
        assert!(Places::between(1e12, 1e12 + 4e-3, 1e-3).is_none(), "steps of about the round-off");
        assert!(Places::between(0.0, 1.0, 1e-12).is_none(), "too many");
        assert!(Places::between(0.0, 1.0, f64::INFINITY).is_none() && Places::between(0.0, f64::NAN, 1.0).is_none());
        let one = Places::between(2.0, 2.0, f64::INFINITY).unwrap();
        assert_eq!((one.count, one.number(2.0), one.number(2.5)), (1, Some(0), None));
    }
}
