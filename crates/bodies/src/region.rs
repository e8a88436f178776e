//! Regions of space: what to cut from a body, or to keep of it.
//!
//! A region is any `Fn([f64; 3]) -> bool`; these are the usual ones. All are closed: their boundary belongs to them. Combine them
//! with closures: `|x| disc(x) && !notch(x)`.

use crate::orientation::orientation;

/// The points inside a polygon in the x-y plane, by the even–odd rule, edges and corners included. The sign of every area is
/// exact, so that no point is missed or counted twice by rounding. `vertices` are coordinates (length); the polygon closes itself.
pub fn polygon(vertices: Vec<[f64; 2]>) -> impl Fn([f64; 3]) -> bool + Clone {
    move |x| {
        let p = [x[0], x[1]];
        let mut inside = false;
        for k in 0..vertices.len() {
            let (a, b) = (vertices[k], vertices[(k + 1) % vertices.len()]);
            // Below in the half-open sense: a ray to the right through a vertex meets one of its two edges.
            let crosses = (a[1] <= p[1]) != (b[1] <= p[1]);
            let boxed = |c: usize| p[c] >= a[c].min(b[c]) && p[c] <= a[c].max(b[c]);
            let near = boxed(0) && boxed(1);
            if !(crosses || near) {
                continue;
            }
            match orientation(a, b, p) {
                0 if near => return true,
                side if crosses => inside ^= (side > 0) == (b[1] > a[1]),
                _ => {}
            }
        }
        inside
    }
}

/// The points of the x-y plane within `radius` of `centre` (length).
pub fn disc(centre: [f64; 2], radius: f64) -> impl Fn([f64; 3]) -> bool + Clone {
    move |x| (0..2).map(|k| (x[k] - centre[k]).powi(2)).sum::<f64>() <= radius * radius
}

/// The points within `radius` of `centre` (length).
pub fn ball(centre: [f64; 3], radius: f64) -> impl Fn([f64; 3]) -> bool + Clone {
    move |x| (0..3).map(|k| (x[k] - centre[k]).powi(2)).sum::<f64>() <= radius * radius
}

/// The points between two corners (length), in any order. In less than three dimensions the components above are zeros.
pub fn cuboid(from: [f64; 3], to: [f64; 3]) -> impl Fn([f64; 3]) -> bool + Clone {
    move |x| (0..3).all(|k| x[k] >= from[k].min(to[k]) && x[k] <= from[k].max(to[k]))
}

/// The points within `radius` (length) of the axis from `from` to `to`, between the planes through its ends.
pub fn cylinder(from: [f64; 3], to: [f64; 3], radius: f64) -> impl Fn([f64; 3]) -> bool + Clone {
    let axis = [0, 1, 2].map(|k| to[k] - from[k]);
    let square: f64 = axis.iter().map(|a| a * a).sum();
    move |x| {
        let d = [0, 1, 2].map(|k| x[k] - from[k]);
        let along = (0..3).map(|k| d[k] * axis[k]).sum::<f64>() / square;
        let off: f64 = (0..3).map(|k| (d[k] - along * axis[k]).powi(2)).sum();
        (0.0..=1.0).contains(&along) && off <= radius * radius
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polygon_is_closed_and_even_odd() {
        let square = polygon(vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        for (x, y, inside) in [
            (0.5, 0.5, true),
            (0.0, 0.0, true),
            (1.0, 1.0, true),
            (1.0, 0.5, true),
            (0.5, 0.0, true),
            (1.0 + 1e-15, 0.5, false),
            (-1e-300, 0.0, false),
            (2.0, 0.0, false),
            (-1.0, 1.0, false),
            (2.0, 1.0, false),
        ] {
            assert_eq!(square([x, y, 0.0]), inside, "{x} {y}");
        }
        // A five-pointed star drawn in one stroke: its middle lies inside twice, hence outside.
        let corner = |k: usize| {
            let a = std::f64::consts::TAU * (2 * k % 5) as f64 / 5.0;
            [a.cos(), a.sin()]
        };
        let star = polygon((0..5).map(corner).collect());
        assert!(!star([0.0, 0.0, 0.0]));
        assert!(star([0.9, 0.0, 0.0]));
        assert!(!star([-0.6, 0.0, 0.0]));
        // Orientation does not matter.
        let reversed = polygon((0..5).rev().map(corner).collect());
        for k in 0..400 {
            let p = [-1.0 + 0.1 * f64::from(k % 20), -1.0 + 0.1 * f64::from(k / 20), 0.0];
            assert_eq!(star(p), reversed(p));
        }
    }

    #[test]
    fn diamond_on_its_own_lattice_has_known_counts() {
        // |x| + |y| ≤ n holds 2n² + 2n + 1 lattice points, 4n of them on the boundary, in whatever unit.
        for unit in [1.0, 1e-9, 0.1, 1e9] {
            let n = 20.0 * unit;
            let diamond = polygon(vec![[n, 0.0], [0.0, n], [-n, 0.0], [0.0, -n]]);
            let mut inner = 0;
            for i in -25i32..=25 {
                for j in -25i32..=25 {
                    // Half a spacing aside no point lies on the boundary: 4 × (1 + … + 19) + … = 2 n².
                    let p = [(f64::from(i) + 0.5) * unit, f64::from(j) * unit, 0.0];
                    inner += usize::from(diamond(p));
                }
            }
            assert_eq!(inner, 2 * 20 * 20, "{unit}");
        }
    }

    #[test]
    fn round_and_straight_regions() {
        assert!(disc([1.0, 0.0], 2.0)([3.0, 0.0, 7.0]) && !disc([1.0, 0.0], 2.0)([3.1, 0.0, 0.0]));
        assert!(ball([0.0; 3], 3.0)([2.0, 2.0, 1.0]) && !ball([0.0; 3], 3.0)([2.0, 2.0, 1.1]));
        let b = cuboid([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
        assert!(b([0.5, 1.0, 0.0]) && !b([0.5, 1.1, 0.0]) && !b([0.5, 0.5, 0.1]));
        let c = cylinder([0.0; 3], [0.0, 0.0, 2.0], 1.0);
        assert!(c([0.6, 0.8, 2.0]) && !c([0.7, 0.8, 1.0]) && !c([0.0, 0.0, 2.1]));
    }
}
