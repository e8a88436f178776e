//! Exact sign of an area.

/// Sign of twice the area of the triangle a, b, p: positive if p lies to the left of the line from a to b, zero if on it.
///
/// Exact for all finite coordinates whose products neither overflow nor underflow: where rounding leaves the sign open, the
/// determinant is summed without error (after J. R. Shewchuk, Adaptive precision floating-point arithmetic, 1997).
pub(crate) fn orientation(a: [f64; 2], b: [f64; 2], p: [f64; 2]) -> i8 {
    let left = (a[0] - p[0]) * (b[1] - p[1]);
    let right = (a[1] - p[1]) * (b[0] - p[0]);
    let det = left - right;
    // Shewchuk's bound for the error of the four differences, two products and one difference.
    if det.abs() > 4.0 * f64::EPSILON * (left.abs() + right.abs()) {
        return sign(det);
    }
    // det = ax by − ax py − px by − ay bx + ay px + py bx, each product split into two floats without error.
    let products = [(a[0], b[1]), (-a[0], p[1]), (-p[0], b[1]), (-a[1], b[0]), (a[1], p[0]), (p[1], b[0])].map(|(u, v)| {
        let high = u * v;
        [high, u.mul_add(v, -high)]
    });
    let mut expansion: Vec<f64> = Vec::with_capacity(12);
    for &term in products.as_flattened() {
        // Grow the expansion: its components stay non-overlapping, smallest first, so that the last that is not zero has the sign.
        let mut carry = term;
        for e in &mut expansion {
            let sum = carry + *e;
            let part = sum - carry;
            *e = (carry - (sum - part)) + (*e - part);
            carry = sum;
        }
        expansion.push(carry);
    }
    expansion.iter().rev().find(|e| **e != 0.0).map_or(0, |&e| sign(e))
}

fn sign(x: f64) -> i8 {
    if x > 0.0 {
        1
    } else if x < 0.0 {
        -1
    } else {
        0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sign_is_exact_where_rounding_is_not() {
        // The neighbours of a point on a diagonal, one unit in the last place apart: the sign follows from integers.
        let unit = f64::EPSILON;
        let (a, b) = ([12.0, 12.0], [24.0, 24.0]);
        for i in -8i32..=8 {
            for j in -8i32..=8 {
                let p = [0.5 + f64::from(i) * unit, 0.5 + f64::from(j) * unit];
                assert_eq!(i32::from(orientation(a, b, p)), (j - i).signum(), "{i} {j}");
            }
        }
    }
}
