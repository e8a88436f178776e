//! Conditions on a body: what is prescribed, what pushes, and walls.

use std::ops::Range;

/// A function of the reference position and time.
pub type Field = Box<dyn Fn([f64; 3], f64) -> f64 + Send + Sync>;

/// What a condition does to its points.
pub enum Kind {
    /// Prescribed displacement components.
    Displacement,
    /// Prescribed velocity components (dynamics).
    Velocity,
    /// Force per volume.
    ForceDensity,
    /// Force per area, spread over a depth: a force density of traction/depth.
    Traction {
        /// Depth over which the traction is spread, per point of the condition.
        depth: Vec<f64>,
    },
    /// A rigid, frictionless, unilateral wall: the energy ½ κ g² of each point's penetration g.
    RigidWall(Wall),
}

/// A rigid wall: points stay on the side its normal points to.
pub struct Wall {
    /// Unit normal, pointing to the free side.
    pub normal: [f64; 3],
    /// A point of the wall at time 0.
    pub at: [f64; 3],
    /// Displacement of the wall along its normal.
    pub motion: Box<dyn Fn(f64) -> f64 + Send + Sync>,
    /// κ per point of the condition \[N/m\].
    pub stiffness: Vec<f64>,
}

/// A condition on a set of points.
pub struct Condition {
    /// Name, for histories and messages.
    pub name: String,
    /// What it does.
    pub kind: Kind,
    /// Points in sorted order.
    pub points: Vec<u32>,
    /// The components it acts on; `None` is free.
    pub components: [Option<Field>; 3],
    /// The unit vector along which the first component is prescribed instead; the others are none.
    pub along: Option<[f64; 3]>,
}

impl Condition {
    /// Whether it prescribes motion.
    pub fn prescribes(&self) -> bool {
        matches!(self.kind, Kind::Displacement | Kind::Velocity)
    }

    /// Brings the points into ascending order, and with them what there is for each.
    pub(crate) fn sort_points(&mut self) {
        if self.points.is_sorted() {
            return;
        }
        let mut order: Vec<usize> = (0..self.points.len()).collect();
        order.sort_by_key(|&q| self.points[q]);
        self.points = order.iter().map(|&q| self.points[q]).collect();
        match &mut self.kind {
            Kind::Traction { depth: values } | Kind::RigidWall(Wall { stiffness: values, .. }) => {
                *values = order.iter().map(|&q| values[q]).collect();
            }
            Kind::Displacement | Kind::Velocity | Kind::ForceDensity => {}
        }
    }

    /// Calls `f(point, component, force)` for what it pushes its points in places `range` with at time `t`; walls do not count.
    fn each_load<const D: usize>(
        &self,
        range: Range<usize>,
        position: &[[f64; 3]],
        volume: &[f64],
        t: f64,
        mut f: impl FnMut(usize, usize, f64),
    ) {
        let depth = match &self.kind {
            Kind::ForceDensity => None,
            Kind::Traction { depth } => Some(depth),
            Kind::Displacement | Kind::Velocity | Kind::RigidWall(_) => return,
        };
        for q in range {
            let p = self.points[q] as usize;
            let per_density = volume[p] * depth.map_or(1.0, |depth| 1.0 / depth[q]);
            for k in 0..D {
                if let Some(density) = &self.components[k] {
                    f(p, k, density(position[p], t) * per_density);
                }
            }
        }
    }

    /// Calls `f(point, wall, κ, penetration)` for its points in places `range` that are in contact.
    fn each_contact<const D: usize>(
        &self,
        range: Range<usize>,
        position: &[[f64; 3]],
        u: &[f64],
        t: f64,
        mut f: impl FnMut(usize, &Wall, f64, f64),
    ) {
        let Kind::RigidWall(wall) = &self.kind else { return };
        if range.is_empty() {
            return;
        }
        let moved = (wall.motion)(t);
        for q in range {
            let p = self.points[q] as usize;
            let mut gap = -moved;
            for k in 0..3 {
                let x = position[p][k] + if k < D { u[p * D + k] } else { 0.0 };
                gap += (x - wall.at[k]) * wall.normal[k];
            }
            if gap < 0.0 {
                f(p, wall, wall.stiffness[q], -gap);
            }
        }
    }
}

/// Adds the external forces of all conditions at time `t` to `force` \[N\].
pub fn add_external<const D: usize>(conditions: &[Condition], position: &[[f64; 3]], volume: &[f64], t: f64, force: &mut [f64]) {
    for c in conditions {
        c.each_load::<D>(0..c.points.len(), position, volume, t, |p, k, load| force[p * D + k] += load);
    }
}

/// Adds the contact forces of all walls to `force` and returns their energy.
pub fn add_walls<const D: usize>(conditions: &[Condition], position: &[[f64; 3]], u: &[f64], t: f64, force: &mut [f64]) -> f64 {
    let mut energy = 0.0;
    each_contact::<D>(conditions, position, u, t, |p, wall, stiffness, depth| {
        energy += 0.5 * stiffness * depth * depth;
        for k in 0..D {
            force[p * D + k] += stiffness * depth * wall.normal[k];
        }
    });
    energy
}

/// Calls `f(point, wall, κ, penetration)` for every point in contact.
pub fn each_contact<const D: usize>(
    conditions: &[Condition],
    position: &[[f64; 3]],
    u: &[f64],
    t: f64,
    mut f: impl FnMut(usize, &Wall, f64, f64),
) {
    for c in conditions {
        c.each_contact::<D>(0..c.points.len(), position, u, t, &mut f);
    }
}

/// What acts on a body from outside at an instant; points of conditions ascend.
pub(crate) struct Outside<'a> {
    pub conditions: &'a [Condition],
    pub position: &'a [[f64; 3]],
    pub volume: &'a [f64],
    pub u: &'a [f64],
    pub t: f64,
}

/// What was added to forces.
#[derive(Clone, Copy)]
pub(crate) struct Added {
    /// Sum of its squares.
    pub squares: f64,
    /// Whether the forces are finite now.
    pub finite: bool,
}

impl Outside<'_> {
    /// Adds what acts on `points` (ascending, all of one set of conditions or more) to `force`, whose first entry is that of point `first`, walls included;
    /// `external` (`D` words for each of `points`) becomes what acts without them. The same bits on any number of threads.
    pub(crate) fn add<const D: usize>(&self, points: &[u32], first: usize, force: &mut [f64], external: &mut [f64]) -> Added {
        /// Points that are not divided among threads.
        const FEW: usize = 1024;
        let middle = points.len() / 2;
        if points.len() > FEW {
            let (left, right) = points.split_at(middle);
            let (force_left, force_right) = force.split_at_mut((right[0] as usize - first) * D);
            let (external_left, external_right) = external.split_at_mut(middle * D);
            let (a, b) = rayon::join(
                || self.add::<D>(left, first, force_left, external_left),
                || self.add::<D>(right, right[0] as usize, force_right, external_right),
            );
            return Added { squares: a.squares + b.squares, finite: a.finite & b.finite };
        }
        let (Some(&low), Some(&high)) = (points.first(), points.last()) else { return Added { squares: 0.0, finite: true } };
        external.fill(0.0);
        let range = |c: &Condition| c.points.partition_point(|p| *p < low)..c.points.partition_point(|p| *p <= high);
        // both lists ascend: the place of a point is at or behind that of the one before
        let place = |from: &mut usize, p: usize| {
            while points[*from] as usize != p {
                *from += 1;
            }
            *from * D
        };
        for c in self.conditions {
            let mut from = 0;
            c.each_load::<D>(range(c), self.position, self.volume, self.t, |p, k, load| external[place(&mut from, p) + k] += load);
        }
        let mut all = [0.0; FEW * 3];
        let all = &mut all[..external.len()];
        all.copy_from_slice(external);
        for c in self.conditions {
            let mut from = 0;
            c.each_contact::<D>(range(c), self.position, self.u, self.t, |p, wall, stiffness, depth| {
                let place = place(&mut from, p);
                (0..D).for_each(|k| all[place + k] += stiffness * depth * wall.normal[k]);
            });
        }
        let mut added = Added { squares: 0.0, finite: true };
        for (p, all) in points.iter().zip(all.chunks_exact(D)) {
            for (f, x) in force[(*p as usize - first) * D..].iter_mut().zip(all) {
                *f += x;
                added.squares += x * x;
                added.finite &= f.abs() < f64::INFINITY;
            }
        }
        added
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::uniform;

    const POINTS: usize = 3000;

    fn conditions() -> Vec<Condition> {
        let some = |share: f64, seed: u64| -> Vec<u32> { (0..POINTS as u32).filter(|p| uniform(seed, u64::from(*p)) < share).collect() };
        let pushing: fn() -> [Option<Field>; 3] = || [Some(Box::new(|x, t| x[0] * t)), None, Some(Box::new(|x, _| 2.0 - x[1]))];
        let each = |kind, points, components| Condition { name: String::new(), kind, points, components, along: None };
        let on_all: Vec<u32> = (0..POINTS as u32).collect();
        let mut backwards = some(0.3, 2);
        backwards.reverse();
        let depth = backwards.iter().map(|p| 1.0 + f64::from(*p)).collect();
        let stiffness = on_all.iter().map(|p| 5.0 + f64::from(*p)).collect();
        let wall = Wall { normal: [0.36, 0.48, 0.8], at: [0.1; 3], motion: Box::new(|t| 0.2 * t), stiffness };
        vec![
            each(Kind::Displacement, some(0.1, 1), pushing()),
            each(Kind::Traction { depth }, backwards, pushing()),
            each(Kind::RigidWall(wall), on_all, [None, None, None]),
            each(Kind::ForceDensity, some(0.5, 3), pushing()),
            each(Kind::ForceDensity, vec![], pushing()),
        ]
    }

    /// What pushes a point, from the conditions as they were given, one after the other.
    fn expected<const D: usize>(
        conditions: &[Condition],
        position: &[[f64; 3]],
        volume: &[f64],
        u: &[f64],
        t: f64,
    ) -> (Vec<f64>, Vec<f64>) {
        let (mut external, mut walls) = (vec![0.0; POINTS * D], vec![0.0; POINTS * D]);
        for c in conditions {
            for (q, &p) in c.points.iter().enumerate() {
                let p = p as usize;
                let x = position[p];
                let density = [x[0] * t, 0.0, 2.0 - x[1]];
                let per_density = match &c.kind {
                    Kind::ForceDensity => volume[p],
                    Kind::Traction { depth } => volume[p] / depth[q],
                    _ => 0.0,
                };
                (0..D).for_each(|k| external[p * D + k] += density[k] * per_density);
                if let Kind::RigidWall(wall) = &c.kind {
                    let y: [f64; 3] = std::array::from_fn(|k| x[k] + if k < D { u[p * D + k] } else { 0.0 });
                    let height: f64 = (0..3).map(|k| (y[k] - wall.at[k]) * wall.normal[k]).sum::<f64>() - 0.2 * t;
                    (0..D).for_each(|k| walls[p * D + k] += wall.stiffness[q] * (-height).max(0.0) * wall.normal[k]);
                }
            }
        }
        (external, walls)
    }

    fn compare<const D: usize>() {
        let position: Vec<[f64; 3]> = (0..POINTS as u64).map(|p| [0, 1, 2].map(|k| uniform(10 + k, p))).collect();
        let volume: Vec<f64> = (0..POINTS as u64).map(|p| 0.5 + uniform(20, p)).collect();
        let u: Vec<f64> = (0..(POINTS * D) as u64).map(|q| 0.1 * uniform(21, q)).collect();
        let t = 0.7;
        let (external, walls) = expected::<D>(&conditions(), &position, &volume, &u, t);
        let mut sorted = conditions();
        sorted.iter_mut().for_each(Condition::sort_points);
        assert!(sorted.iter().all(|c| c.points.is_sorted()));
        let mut points: Vec<u32> = sorted.iter().flat_map(|c| c.points.clone()).collect();
        points.sort_unstable();
        points.dedup();
        let outside = Outside { conditions: &sorted, position: &position, volume: &volume, u: &u, t };
        let before = |q: usize| (q as f64).sin();
        let on = |threads: usize| {
            let mut force: Vec<f64> = (0..POINTS * D).map(before).collect();
            let mut without = vec![f64::NAN; points.len() * D];
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let added = pool.install(|| outside.add::<D>(&points, 0, &mut force, &mut without));
            assert!(added.finite);
            (force, without, added.squares)
        };
        let (force, without, squares) = on(1);
        let near = |a: f64, b: f64, scale: f64| (a - b).abs() <= 1e-13 * scale;
        for q in 0..POINTS * D {
            let all = external[q] + walls[q];
            assert!(near(force[q], before(q) + all, 1.0 + all.abs()), "{D} D, dof {q}: {} beside {}", force[q] - before(q), all);
        }
        for (j, &p) in points.iter().enumerate() {
            (0..D).for_each(|k| assert!(near(without[j * D + k], external[p as usize * D + k], 10.0)));
        }
        let square: f64 = external.iter().zip(&walls).map(|(a, b)| (a + b) * (a + b)).sum();
        assert!(near(squares, square, square) && square > 0.0);
        assert!(walls.iter().any(|w| *w != 0.0) && walls.contains(&0.0), "some points touch the wall");
        assert_eq!(on(2), (force, without, squares));
    }

    #[test]
    fn what_acts_from_outside_is_added_once_on_any_number_of_threads() {
        compare::<1>();
        compare::<2>();
        compare::<3>();
    }

    #[test]
    fn a_force_that_is_not_finite_is_told() {
        let infinite = Condition {
            name: String::new(),
            kind: Kind::ForceDensity,
            points: vec![1, 3],
            components: [Some(Box::new(|x, _| 1.0 / (x[0] - 3.0))), None, None],
            along: None,
        };
        let position: Vec<[f64; 3]> = (0..4).map(|p| [f64::from(p), 0.0, 0.0]).collect();
        let outside = Outside { conditions: &[infinite], position: &position, volume: &[1.0; 4], u: &[0.0; 4], t: 0.0 };
        assert!(!outside.add::<1>(&[1, 3], 0, &mut [0.0; 4], &mut [0.0; 2]).finite);
    }
}
