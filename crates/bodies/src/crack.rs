//! Cracks present from the start: bonds that cross them are cut.
//!
//! The rule, exact in all cases:
//!
//! * A crack has two sides. A material point on the plane (line, place) of a crack belongs to its **positive** side: of a point
//!   crack the side of larger x; of a segment the left one, going from `from` to `to`; of a parallelogram the one that
//!   `edges[0] × edges\[1\]` points to; of a disc the one its normal points to. So a crack along a row of points leaves that row
//!   whole, bound to one side and free of the other.
//! * A bond is cut if its ends are on different sides and it meets the plane within the crack, edges and tips included: a bond that
//!   touches an edge within 1e-12 of the size of crack and bond is cut.
//! * A bond within the plane is not cut.
//! * Both directions of a bond give the same answer.
//!
//! "On the plane" means within 1e-12 of the size of crack and bond, and within the rounding of the coordinates. A polyline is
//! several segments that follow each other in one direction; a bond through a joint touches both and is cut.

use crate::neighbors::{Neighbors, RUN};
use rayon::prelude::*;

/// A crack. Lengths throughout.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Crack {
    /// In one dimension.
    Point {
        /// Coordinate.
        at: f64,
    },
    /// In two dimensions.
    Segment {
        /// One tip.
        from: [f64; 2],
        /// The other tip.
        to: [f64; 2],
    },
    /// In three dimensions: a rectangle or any other parallelogram.
    Parallelogram {
        /// One corner.
        corner: [f64; 3],
        /// The edges that start there.
        edges: [[f64; 3]; 2],
    },
    /// In three dimensions: penny-shaped.
    Disc {
        /// Centre.
        centre: [f64; 3],
        /// Normal, of any length but zero.
        normal: [f64; 3],
        /// Radius.
        radius: f64,
    },
}

/// Why something is no crack.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CrackError {
    /// A number is not finite.
    #[error("crack {number}: {crack:?} has a value that is not finite")]
    NotFinite {
        /// Place in the list, from 0.
        number: usize,
        /// The crack.
        crack: Crack,
    },
    /// It has no length or area.
    #[error("crack {number}: {crack:?} is degenerate; length, area, normal and radius must not vanish")]
    Degenerate {
        /// Place in the list, from 0.
        number: usize,
        /// The crack.
        crack: Crack,
    },
    /// It belongs to another dimension.
    #[error(
        "crack {number}: {crack:?} is no crack in {dimension} dimensions; use a point in one, a segment in two, a parallelogram or a disc in three"
    )]
    Dimension {
        /// Place in the list, from 0.
        number: usize,
        /// The crack.
        crack: Crack,
        /// Dimension of the body.
        dimension: usize,
    },
}

impl Crack {
    /// Dimension of the body it can be in.
    pub fn dimension(&self) -> usize {
        match self {
            Crack::Point { .. } => 1,
            Crack::Segment { .. } => 2,
            Crack::Parallelogram { .. } | Crack::Disc { .. } => 3,
        }
    }

    /// Whether the crack cuts the bond from `a` to `b` (length). A degenerate crack cuts nothing.
    pub fn cuts(&self, a: [f64; 3], b: [f64; 3]) -> bool {
        self.surface().is_some_and(|surface| surface.cuts(a, b))
    }

    fn surface(&self) -> Option<Surface> {
        let lift = |p: [f64; 2]| [p[0], p[1], 0.0];
        let (origin, normal, extent, size, corners) = match *self {
            Crack::Point { at } => ([at, 0.0, 0.0], [1.0, 0.0, 0.0], Extent::Unbounded, 0.0, vec![[at, 0.0, 0.0]]),
            Crack::Segment { from, to } => {
                let edge = lift(sub2(to, from));
                let normal = [-edge[1], edge[0], 0.0];
                (lift(from), normal, Extent::Along(edge), norm(edge), vec![lift(from), lift(to)])
            }
            Crack::Parallelogram { corner, edges: [e, f] } => {
                let normal = cross(e, f);
                let area = norm(normal);
                // Parallel edges: their cross product is rounding.
                if area <= 1e-12 * norm(e) * norm(f) {
                    return None;
                }
                let corners = vec![corner, add(corner, e), add(corner, f), add(add(corner, e), f)];
                // Reciprocal edges: the coordinates of a point are its products with them.
                let square = area * area;
                let reciprocal = [cross(f, normal).map(|c| c / square), cross(normal, e).map(|c| c / square)];
                (corner, normal, Extent::Between(reciprocal), norm(e).max(norm(f)), corners)
            }
            Crack::Disc { centre, normal, radius } => {
                if radius <= 0.0 {
                    return None;
                }
                let unit = normal.map(|c| c / norm(normal));
                let half = unit.map(|n| radius * (1.0 - n * n).max(0.0).sqrt());
                (centre, normal, Extent::Within(radius), 2.0 * radius, vec![sub(centre, half), add(centre, half)])
            }
        };
        let length = norm(normal);
        if !(length.is_finite() && length > 0.0) {
            return None;
        }
        let low = [0, 1, 2].map(|k| corners.iter().map(|c| c[k]).fold(f64::INFINITY, f64::min));
        let high = [0, 1, 2].map(|k| corners.iter().map(|c| c[k]).fold(f64::NEG_INFINITY, f64::max));
        let far = low.iter().chain(&high).fold(0.0, |a: f64, c| a.max(c.abs()));
        Some(Surface { origin, normal: normal.map(|c| c / length), extent, size, low, high, far })
    }
}

/// Cracks made ready for many bonds.
#[derive(Clone, Debug, Default)]
pub struct Cracks {
    surfaces: Vec<Surface>,
}

impl Cracks {
    /// Prepares `cracks` for a body of the given dimension.
    ///
    /// # Errors
    /// If a crack is not finite, degenerate, or of another dimension.
    pub fn new(cracks: &[Crack], dimension: usize) -> Result<Self, CrackError> {
        let mut surfaces = Vec::with_capacity(cracks.len());
        for (number, &crack) in cracks.iter().enumerate() {
            let finite = match crack {
                Crack::Point { at } => at.is_finite(),
                Crack::Segment { from, to } => from.iter().chain(&to).all(|c| c.is_finite()),
                Crack::Parallelogram { corner, edges } => corner.iter().chain(edges.as_flattened()).all(|c| c.is_finite()),
                Crack::Disc { centre, normal, radius } => centre.iter().chain(&normal).all(|c| c.is_finite()) && radius.is_finite(),
            };
            if !finite {
                return Err(CrackError::NotFinite { number, crack });
            }
            if crack.dimension() != dimension {
                return Err(CrackError::Dimension { number, crack, dimension });
            }
            surfaces.push(crack.surface().ok_or(CrackError::Degenerate { number, crack })?);
        }
        Ok(Self { surfaces })
    }

    /// Whether any crack cuts the bond from `a` to `b` (length).
    pub fn cut(&self, a: [f64; 3], b: [f64; 3]) -> bool {
        self.surfaces.iter().any(|s| s.cuts(a, b))
    }

    /// For each directed bond whether a crack cuts it.
    ///
    /// `position` are the coordinates the families were found in (length). Where the body is continued by mirror images, so are
    /// the cracks.
    pub fn cut_bonds(&self, position: &[[f64; 3]], neighbors: &Neighbors) -> Vec<bool> {
        let mut cut = vec![false; neighbors.bonds()];
        if self.surfaces.is_empty() {
            return cut;
        }
        let mut parts = by_runs(neighbors, &mut cut);
        parts.par_iter_mut().enumerate().for_each(|(run, part)| {
            let first = run * RUN;
            let base = neighbors.offsets[first];
            let mut near: Vec<&Surface> = Vec::new();
            for i in first..(first + RUN).min(neighbors.points()) {
                let a = position[i];
                let mut reach = 0.0f64;
                for bond in neighbors.bonds_of(i) {
                    let d = sub(neighbors.end(position, i, bond), a);
                    reach = reach.max(dot(d, d));
                }
                let reach = reach.sqrt();
                near.clear();
                near.extend(self.surfaces.iter().filter(|s| s.may_reach(a, reach)));
                if near.is_empty() {
                    continue;
                }
                for bond in neighbors.bonds_of(i) {
                    let b = neighbors.end(position, i, bond);
                    let flips = neighbors.flips_of(bond);
                    let real = position[neighbors.index[bond] as usize];
                    // The images of a crack cut a bond where the crack cuts the image of the bond.
                    part[bond - base] = (0..=flips).filter(|mask| mask & !flips == 0).any(|mask| {
                        let image = |x: [f64; 3]| [0, 1, 2].map(|k| if mask & (1 << k) != 0 { real[k] + b[k] - x[k] } else { x[k] });
                        let (a, b) = (image(a), image(b));
                        near.iter().any(|s| s.cuts(a, b))
                    });
                }
            }
        });
        cut
    }
}

/// Splits values of directed bonds into those of runs of points.
pub(crate) fn by_runs<'a>(neighbors: &Neighbors, values: &'a mut [bool]) -> Vec<&'a mut [bool]> {
    let n = neighbors.points();
    let mut rest = values;
    let mut parts = Vec::with_capacity(n.div_ceil(RUN));
    for first in (0..n).step_by(RUN) {
        let (part, next) = rest.split_at_mut(neighbors.offsets[(first + RUN).min(n)] - neighbors.offsets[first]);
        parts.push(part);
        rest = next;
    }
    parts
}

/// A plane and the part of it that is cracked.
#[derive(Clone, Debug)]
struct Surface {
    origin: [f64; 3],
    normal: [f64; 3],
    extent: Extent,
    size: f64,
    low: [f64; 3],
    high: [f64; 3],
    /// Largest coordinate: the scale of rounding.
    far: f64,
}

#[derive(Clone, Debug)]
enum Extent {
    Unbounded,
    /// From the origin along an edge.
    Along([f64; 3]),
    /// From the origin along two edges, given by their reciprocals.
    Between([[f64; 3]; 2]),
    /// Around the origin.
    Within(f64),
}

impl Surface {
    /// Whether a bond of length up to `reach` from `a` may meet the crack: never false by rounding.
    fn may_reach(&self, a: [f64; 3], reach: f64) -> bool {
        let reach = reach * (1.0 + 1e-9) + self.slack(a, a, reach);
        (0..3).all(|k| a[k] + reach >= self.low[k] && a[k] - reach <= self.high[k])
    }

    /// How near counts as touching.
    fn slack(&self, a: [f64; 3], b: [f64; 3], length: f64) -> f64 {
        let far = a.iter().chain(&b).fold(self.far, |m, c| m.max(c.abs()));
        1e-12 * (length + self.size) + 8.0 * f64::EPSILON * far
    }

    fn cuts(&self, a: [f64; 3], b: [f64; 3]) -> bool {
        // One order of the ends, so that both directions round alike.
        let (a, b) = if a <= b { (a, b) } else { (b, a) };
        let length = norm(sub(b, a));
        let slack = self.slack(a, b, length);
        let (da, db) = (dot(sub(a, self.origin), self.normal), dot(sub(b, self.origin), self.normal));
        if (da < -slack) == (db < -slack) {
            return false;
        }
        // An end on the plane is where the bond meets it.
        let t = if da.abs() <= slack {
            0.0
        } else if db.abs() <= slack {
            1.0
        } else {
            da / (da - db)
        };
        let meets = sub([0, 1, 2].map(|k| a[k] + t * (b[k] - a[k])), self.origin);
        match &self.extent {
            Extent::Unbounded => true,
            Extent::Along(edge) => {
                let along = dot(meets, *edge) / self.size;
                along >= -slack && along <= self.size + slack
            }
            Extent::Between(reciprocal) => reciprocal.iter().all(|r| {
                let (u, slack) = (dot(meets, *r), slack * norm(*r));
                u >= -slack && u <= 1.0 + slack
            }),
            Extent::Within(radius) => norm(meets) <= radius + slack,
        }
    }
}

fn add(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn sub2(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn norm(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::{Filling, Placement, Shape, uniform};
    use crate::neighbors::{Mirror, neighbors, neighbors_with_mirrors};

    /// Both directions, scaled to three units and shifted: all must say the same.
    fn cuts(crack: Crack, a: [f64; 3], b: [f64; 3]) -> bool {
        let answer = crack.cuts(a, b);
        assert_eq!(answer, crack.cuts(b, a));
        for unit in [1e-9, 1e9] {
            let s = |x: [f64; 3]| x.map(|c| c * unit);
            let s2 = |x: [f64; 2]| x.map(|c| c * unit);
            let scaled = match crack {
                Crack::Point { at } => Crack::Point { at: at * unit },
                Crack::Segment { from, to } => Crack::Segment { from: s2(from), to: s2(to) },
                Crack::Parallelogram { corner, edges } => Crack::Parallelogram { corner: s(corner), edges: edges.map(s) },
                Crack::Disc { centre, normal, radius } => Crack::Disc { centre: s(centre), normal, radius: radius * unit },
            };
            assert_eq!(answer, scaled.cuts(s(a), s(b)), "{crack:?} in units of {unit}");
        }
        answer
    }

    #[test]
    fn point_in_one_dimension() {
        let crack = Crack::Point { at: 0.3 };
        assert!(cuts(crack, [0.2, 0.0, 0.0], [0.4, 0.0, 0.0]));
        assert!(!cuts(crack, [0.4, 0.0, 0.0], [0.5, 0.0, 0.0]));
        // On the crack (0.1 + 0.2 is not 0.3 in binary): of the right side.
        assert!(cuts(crack, [0.2, 0.0, 0.0], [0.1 + 0.2, 0.0, 0.0]));
        assert!(!cuts(crack, [0.1 + 0.2, 0.0, 0.0], [0.4, 0.0, 0.0]));
    }

    #[test]
    fn segment_in_two_dimensions() {
        let crack = Crack::Segment { from: [0.0, 0.0], to: [1.0, 0.0] };
        for (a, b, cut, why) in [
            ([0.5, -1.0], [0.5, 1.0], true, "across"),
            ([0.5, 0.5], [0.5, 1.0], false, "one side"),
            ([1.5, -1.0], [1.5, 1.0], false, "beyond the tip"),
            ([1.0, -1.0], [1.0, 1.0], true, "through the tip"),
            ([0.0, -1.0], [0.0, 1.0], true, "through the other tip"),
            ([1.0 + 1e-13, -1.0], [1.0 + 1e-13, 1.0], true, "touching the tip"),
            ([1.0 + 1e-10, -1.0], [1.0 + 1e-10, 1.0], false, "not touching"),
            ([0.5, 0.0], [0.5, 1.0], false, "from the crack to its left"),
            ([0.5, 0.0], [0.5, -1.0], true, "from the crack to its right"),
            ([0.5, 1e-14], [0.5, -1.0], true, "on the crack by rounding"),
            ([0.5, -1e-14], [0.5, 1.0], false, "on the crack by rounding, to its left"),
            ([1.0, 0.0], [1.0, -1.0], true, "from the tip to the right"),
            ([1.5, 0.0], [1.5, -1.0], false, "from the plane beyond the tip"),
            ([0.2, 0.0], [0.8, 0.0], false, "within the crack"),
            ([-1.0, 0.0], [2.0, 0.0], false, "along all of it"),
            ([-1.0, -1.0], [2.0, 0.5], true, "oblique, meets (1, 0)"),
            ([-1.0, -1.0], [2.0, 0.49], false, "oblique, meets beyond (1, 0)"),
        ] {
            assert_eq!(cuts(crack, [a[0], a[1], 0.0], [b[0], b[1], 0.0]), cut, "{why}");
        }
        // A kinked polyline has no hole at its joint.
        let kink = [Crack::Segment { from: [0.0, 0.0], to: [1.0, 0.1] }, Crack::Segment { from: [1.0, 0.1], to: [2.0, 0.0] }];
        let kink = Cracks::new(&kink, 2).unwrap();
        for k in 0..1000 {
            let angle = 0.2 + 2.7 * uniform(2, k);
            let (s, c) = angle.sin_cos();
            assert!(kink.cut([1.0 + c, 0.1 + s, 0.0], [1.0 - c, 0.1 - s, 0.0]), "{angle}");
        }
    }

    #[test]
    fn planes_in_three_dimensions() {
        let sheared = Crack::Parallelogram { corner: [0.0; 3], edges: [[1.0, 0.0, 0.0], [1.0, 1.0, 0.0]] };
        let through = |x: f64, y: f64| cuts(sheared, [x, y, -0.3], [x, y, 0.7]);
        assert!(through(1.0, 0.5) && through(0.1, 0.05) && through(1.9, 0.95));
        assert!(!through(0.2, 0.5) && !through(1.6, 0.5) && !through(1.0, 1.1) && !through(0.5, -0.1));
        assert!(through(0.0, 0.0) && through(2.0, 1.0) && through(0.5, 0.5) && through(1.5, 0.5), "corners and edges");
        assert!(!through(0.5 - 1e-9, 0.5) && through(0.5 - 1e-13, 0.5));
        assert!(!cuts(sheared, [1.0, 0.5, 0.0], [1.0, 0.5, 1.0]) && cuts(sheared, [1.0, 0.5, 0.0], [1.0, 0.5, -1.0]));

        let third = 1.0 / 3f64.sqrt();
        let penny = Crack::Disc { centre: [1.0, 1.0, 1.0], normal: [2.0, 2.0, 2.0], radius: 0.5 };
        let tangent = [1.0 / 2f64.sqrt(), -1.0 / 2f64.sqrt(), 0.0];
        let through = |r: f64| {
            let end = |s: f64| [0, 1, 2].map(|k| 1.0 + r * tangent[k] + s * third);
            cuts(penny, end(-0.4), end(0.9))
        };
        assert!(through(0.0) && through(0.49) && through(0.5) && through(0.5 + 1e-14) && !through(0.501));
    }

    #[test]
    fn faults_are_told() {
        let bad = |crack| Cracks::new(&[crack], 3).unwrap_err();
        assert!(matches!(bad(Crack::Point { at: 0.0 }), CrackError::Dimension { number: 0, dimension: 3, .. }));
        let flat = Crack::Parallelogram { corner: [0.0; 3], edges: [[1.0, 1.0, 1.0], [2.0, 2.0, 2.0]] };
        assert!(matches!(bad(flat), CrackError::Degenerate { .. }));
        assert!(!flat.cuts([0.0, 1.0, 0.0], [2.0, 0.0, 1.0]));
        assert!(matches!(bad(Crack::Disc { centre: [0.0; 3], normal: [0.0; 3], radius: 1.0 }), CrackError::Degenerate { .. }));
        assert!(matches!(bad(Crack::Disc { centre: [0.0; 3], normal: [1.0; 3], radius: f64::NAN }), CrackError::NotFinite { .. }));
        let same = Crack::Segment { from: [1.0; 2], to: [1.0; 2] };
        assert!(matches!(Cracks::new(&[same], 2).unwrap_err(), CrackError::Degenerate { .. }));
    }

    #[test]
    fn bonds_of_a_plate_are_counted_by_hand() {
        // Crack from the left edge to the middle, between rows: 10 columns. Of the bonds |ξ| ≤ 2: 3 vertical ones per column
        // (rows −1|0, −2|0, −1|1), diagonals that cross at x half way between columns.
        let plate = Shape::Rectangle { from: [0.0, -5.0], to: [20.0, 5.0] }.fill(&Filling::of_spacing(1.0)).unwrap();
        let families = neighbors(&plate.position, 2, &vec![2.0; plate.len()]).unwrap();
        let cracks = Cracks::new(&[Crack::Segment { from: [-1.0, 0.0], to: [9.9, 0.0] }], 2).unwrap();
        let cut = cracks.cut_bonds(&plate.position, &families);
        // Vertical: 3 × 10 columns (x = 0.5 … 9.5). Diagonal: two per gap between columns, gaps at x = 1 … 9. Both directions.
        assert_eq!(cut.iter().filter(|&&c| c).count(), 2 * (3 * 10 + 2 * 9));
        let intact = families.without(&cut);
        assert_eq!(intact.bonds(), families.bonds() - 96);
        // Every bond on its own agrees.
        for i in 0..plate.len() {
            for b in families.bonds_of(i) {
                assert_eq!(cut[b], cracks.cut(plate.position[i], plate.position[families.index[b] as usize]));
            }
        }
    }

    #[test]
    fn a_crack_along_a_row_splits_a_body_in_two() {
        // The row lies on the crack; no path of bonds may lead from below to above.
        for h in [1.0, 0.1, 1e-7] {
            let filling = Filling { placement: Placement::Ends, ..Filling::of_spacing(h) };
            let plate = Shape::Rectangle { from: [0.0, 0.0], to: [9.0 * h, 6.0 * h] }.fill(&filling).unwrap();
            let families = neighbors(&plate.position, 2, &vec![3.0 * h; plate.len()]).unwrap();
            let crack = Crack::Segment { from: [0.0, 3.0 * h], to: [9.0 * h, 3.0 * h] };
            let cut = Cracks::new(&[crack], 2).unwrap().cut_bonds(&plate.position, &families);
            for i in 0..plate.len() {
                for b in families.bonds_of(i) {
                    let above = |p: usize| plate.position[p][1] > 2.5 * h;
                    let j = families.index[b] as usize;
                    // Crossing points beyond the ends of the row would not count, but the plate is convex.
                    assert_eq!(cut[b], above(i) != above(j), "{h} {i} {j}");
                }
            }
        }
    }

    #[test]
    fn cracks_are_mirrored_with_the_body() {
        let half = Shape::Rectangle { from: [0.0, 0.0], to: [6.0, 6.0] }.fill(&Filling::of_spacing(1.0)).unwrap();
        let whole = Shape::Rectangle { from: [-6.0, 0.0], to: [6.0, 6.0] }.fill(&Filling::of_spacing(1.0)).unwrap();
        let crack = |x: f64| Crack::Segment { from: [0.0, 1.3], to: [x, 3.1] };
        let folded =
            neighbors_with_mirrors(&half.position, 2, &half.spacing, &vec![3.0; half.len()], &[Mirror { axis: 0, at: 0.0 }]).unwrap();
        let plain = neighbors(&whole.position, 2, &vec![3.0; whole.len()]).unwrap();
        let folded = folded.without(&Cracks::new(&[crack(2.7)], 2).unwrap().cut_bonds(&half.position, &folded));
        let plain = plain.without(&Cracks::new(&[crack(2.7), crack(-2.7)], 2).unwrap().cut_bonds(&whole.position, &plain));
        for (i, x) in whole.position.iter().enumerate().filter(|(_, x)| x[0] > 0.0) {
            let k = half.position.iter().position(|y| y == x).unwrap();
            let mut a: Vec<[i64; 2]> =
                plain.of(i).iter().map(|&j| whole.position[j as usize]).map(|y| [0, 1].map(|k| (2.0 * y[k]).round() as i64)).collect();
            let mut b: Vec<[i64; 2]> =
                folded.bonds_of(k).map(|b| folded.end(&half.position, k, b)).map(|y| [0, 1].map(|k| (2.0 * y[k]).round() as i64)).collect();
            a.sort_unstable();
            b.sort_unstable();
            assert_eq!(a, b);
        }
    }
}
