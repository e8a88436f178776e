//! Round numbers for axes, and numbers as engineers write them.

/// The marks of an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Ticks {
    /// Positions.
    pub values: Vec<f64>,
    /// Text of each position.
    pub labels: Vec<String>,
    /// Common factor of all labels, such as `10⁻³`.
    pub factor: Option<String>,
    /// Positions of small marks without text.
    pub minor: Vec<f64>,
}

/// A whole number in raised digits.
pub fn superscript(number: i32) -> String {
    number
        .to_string()
        .chars()
        .map(|c| match c {
            '-' => '⁻',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            digit => char::from_u32('⁰' as u32 + digit.to_digit(10).unwrap_or(0)).unwrap_or(digit),
        })
        .collect()
}

/// `10ᵏ`.
fn power(exponent: i32) -> String {
    format!("10{}", superscript(exponent))
}

/// Ten to a whole power, exact where a double can be.
fn ten(exponent: i32) -> f64 {
    // Parsing rounds correctly, which repeated multiplication does not.
    format!("1e{exponent}").parse().unwrap_or(f64::NAN)
}

/// The exponent of the leading digit of a positive number.
fn leading(value: f64) -> i32 {
    let text = format!("{value:e}");
    let exponent = text.rsplit('e').next().unwrap_or("0");
    exponent.parse().unwrap_or(0)
}

/// A number with the given count of significant digits, trailing zeros removed, with a power of
/// ten where it is very large or small: `0.25`, `1.2×10⁻³`, `−3×10⁷`.
pub fn number(value: f64, digits: usize) -> String {
    if value == 0.0 {
        return "0".to_string();
    }
    if !value.is_finite() {
        return value.to_string().replace("inf", "∞").replace('-', "−");
    }
    let rounded = format!("{:.*e}", digits.max(1) - 1, value);
    let (mantissa, exponent) = rounded.split_once('e').unwrap_or((&rounded, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    let text = if (-3..=4).contains(&exponent) {
        let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
        let number: f64 = rounded.parse().unwrap_or(value);
        without_trailing_zeros(&format!("{number:.decimals$}")).to_string()
    } else {
        let mantissa = without_trailing_zeros(mantissa);
        format!("{mantissa}×{}", power(exponent))
    };
    text.replace('-', "−")
}

fn without_trailing_zeros(text: &str) -> &str {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text }
}

/// A range with a width, whatever it is given: not finite becomes 0 to 1, and a range too narrow
/// for its own digits is widened around its middle.
pub fn open_range(min: f64, max: f64) -> (f64, f64) {
    if !(min.is_finite() && max.is_finite()) {
        return (0.0, 1.0);
    }
    let (min, max) = (min.min(max), min.max(max));
    let size = min.abs().max(max.abs());
    if size == 0.0 {
        (0.0, 1.0)
    } else if max - min <= 1e-12 * size {
        let (low, high) = (0.5 * min, 1.5 * max);
        (low.min(high), low.max(high))
    } else {
        (min, max)
    }
}

/// About `count` round positions within `min..=max`, a step of 1, 2 or 5 times a power of ten apart.
pub fn linear(min: f64, max: f64, count: usize) -> Ticks {
    let (min, max) = open_range(min, max);
    let rough = (max - min) / count.max(1) as f64;
    let mut exponent = leading(rough);
    let mantissa = rough / ten(exponent);
    let step = if mantissa < 1.5 {
        1.0
    } else if mantissa < 3.5 {
        2.0
    } else if mantissa < 7.5 {
        5.0
    } else {
        exponent += 1;
        1.0
    };
    // Whole multiples of the step, divided by exact powers of ten, carry no rounding dust.
    let value = |i: i64| {
        if exponent < 0 { i as f64 * step / ten(-exponent) } else { i as f64 * step * ten(exponent) }
    };
    let unit = step * ten(exponent);
    let first = (min / unit - 1e-6).ceil() as i64;
    let last = (max / unit + 1e-6).floor() as i64;
    let values: Vec<f64> = (first..=last).map(value).collect();
    let largest = values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let top = leading(largest.max(unit));
    // Engineering notation: powers of a thousand.
    let common = if (-2..=4).contains(&top) { 0 } else { 3 * top.div_euclid(3) };
    let decimals = (common - exponent).max(0) as usize;
    let labels = (first..=last)
        .map(|i| {
            let digits = exponent - common;
            let scaled = if digits < 0 { i as f64 * step / ten(-digits) } else { i as f64 * step * ten(digits) };
            if i == 0 { "0".to_string() } else { format!("{scaled:.decimals$}").replace('-', "−") }
        })
        .collect();
    Ticks { values, labels, factor: (common != 0).then(|| power(common)), minor: Vec::new() }
}

/// Powers of ten within `min..=max` (both positive), with the whole multiples between as small
/// marks. A range of less than about a decade also shows 2 and 5 times powers of ten.
pub fn logarithmic(min: f64, max: f64, count: usize) -> Ticks {
    let (from, to) = (leading(min), leading(max) + 1);
    let inside = |v: &f64| *v >= min * (1.0 - 1e-9) && *v <= max * (1.0 + 1e-9);
    let decades: Vec<i32> = (from..=to).filter(|&e| inside(&ten(e))).collect();
    let mut minor: Vec<f64> = Vec::new();
    let mut marks: Vec<(f64, String)> = Vec::new();
    if decades.len() >= 2 {
        let stride = decades.len().div_ceil(count.max(1)) as i32;
        for &exponent in &decades {
            if exponent.rem_euclid(stride) == 0 {
                marks.push((ten(exponent), power(exponent)));
            } else {
                minor.push(ten(exponent));
            }
        }
    } else {
        for exponent in from..=to {
            for multiple in [1.0, 2.0, 5.0] {
                let value = multiple * ten(exponent);
                if inside(&value) {
                    marks.push((value, number(value, 2)));
                }
            }
        }
    }
    if decades.len() <= count {
        for exponent in from..=to {
            let multiples = (2..10).map(|m| f64::from(m) * ten(exponent));
            minor.extend(multiples.filter(inside));
        }
    }
    let (values, labels) = marks.into_iter().unzip();
    Ticks { values, labels, factor: None, minor }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_ticks_are_round_and_exact() {
        let ticks = linear(0.0, 1.0, 5);
        assert_eq!(ticks.values, [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]);
        assert_eq!(ticks.labels, ["0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(ticks.factor, None);
        let small = linear(-3.1e-5, 4.2e-5, 7);
        assert_eq!(small.labels, ["−30", "−20", "−10", "0", "10", "20", "30", "40"]);
        assert_eq!(small.factor.as_deref(), Some("10⁻⁶"));
        let large = linear(0.0, 2.1e11, 4);
        assert_eq!(large.labels, ["0", "50", "100", "150", "200"]);
        assert_eq!(large.factor.as_deref(), Some("10⁹"));
        let offset = linear(1.000_001, 1.000_003, 4);
        assert_eq!(offset.labels[0], "1.0000010");
        assert_eq!(offset.labels[4], "1.0000030");
    }

    #[test]
    fn impossible_ranges_become_possible() {
        assert_eq!(open_range(f64::NAN, 1.0), (0.0, 1.0));
        assert_eq!(open_range(0.0, 0.0), (0.0, 1.0));
        assert_eq!(open_range(-2.0, -2.0), (-3.0, -1.0));
        assert_eq!(open_range(2.0, -1.0), (-1.0, 2.0));
        for range in [(f64::INFINITY, 0.0), (1e300, 1e300), (5e-320, 6e-320)] {
            let count = linear(range.0, range.1, 6).values.len();
            assert!(count < 15, "{range:?}: {count}");
        }
    }

    #[test]
    fn logarithmic_ticks_are_decades() {
        let ticks = logarithmic(1e-3, 10.0, 8);
        assert_eq!(ticks.values, [1e-3, 1e-2, 0.1, 1.0, 10.0]);
        assert_eq!(ticks.labels[0], "10⁻³");
        assert_eq!(ticks.minor.len(), 4 * 8);
        let narrow = logarithmic(0.15, 0.9, 8);
        assert_eq!(narrow.labels, ["0.2", "0.5"]);
        assert!(logarithmic(1e-200, 1e200, 8).values.len() <= 9);
    }

    #[test]
    fn numbers_read_as_engineers_write_them() {
        let cases = [
            (0.0, "0"),
            (0.25, "0.25"),
            (-12.0, "−12"),
            (0.001_234_5, "0.00123"),
            (1.234_5e-7, "1.23×10⁻⁷"),
            (2e11, "2×10¹¹"),
            (99_960.0, "1×10⁵"),
            (1500.0, "1500"),
        ];
        for (value, text) in cases {
            assert_eq!(number(value, 3), text);
        }
    }
}
