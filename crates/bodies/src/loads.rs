//! Conditions on a body: what is prescribed, what pushes, and walls.

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
}

/// Adds the external forces of all conditions at time `t` to `force` \[N\].
pub fn add_external<const D: usize>(conditions: &[Condition], position: &[[f64; 3]], volume: &[f64], t: f64, force: &mut [f64]) {
    for c in conditions {
        let per_volume = |q: usize| match &c.kind {
            Kind::ForceDensity => Some(1.0),
            Kind::Traction { depth } => Some(1.0 / depth[q]),
            _ => None,
        };
        for (q, &p) in c.points.iter().enumerate() {
            let Some(factor) = per_volume(q) else { break };
            let p = p as usize;
            for k in 0..D {
                if let Some(f) = &c.components[k] {
                    force[p * D + k] += f(position[p], t) * factor * volume[p];
                }
            }
        }
    }
}

impl Wall {
    /// Penetration of a point, negative where it is free.
    pub fn penetration<const D: usize>(&self, position: &[f64; 3], u: &[f64], t: f64) -> f64 {
        let mut gap = -(self.motion)(t);
        for k in 0..3 {
            let x = position[k] + if k < D { u[k] } else { 0.0 };
            gap += (x - self.at[k]) * self.normal[k];
        }
        -gap
    }
}

/// Adds the contact forces of all walls to `force` and returns their energy.
pub fn add_walls<const D: usize>(conditions: &[Condition], position: &[[f64; 3]], u: &[f64], t: f64, force: &mut [f64]) -> f64 {
    let mut energy = 0.0;
    each_contact::<D>(conditions, position, u, t, |_, p, wall, stiffness, depth| {
        energy += 0.5 * stiffness * depth * depth;
        for k in 0..D {
            force[p * D + k] += stiffness * depth * wall.normal[k];
        }
    });
    energy
}

/// Calls `f(condition, point, wall, κ, penetration)` for every point in contact.
pub fn each_contact<const D: usize>(
    conditions: &[Condition],
    position: &[[f64; 3]],
    u: &[f64],
    t: f64,
    mut f: impl FnMut(usize, usize, &Wall, f64, f64),
) {
    for (n, c) in conditions.iter().enumerate() {
        if let Kind::RigidWall(wall) = &c.kind {
            for (q, &p) in c.points.iter().enumerate() {
                let p = p as usize;
                let depth = wall.penetration::<D>(&position[p], &u[p * D..][..D], t);
                if depth > 0.0 {
                    f(n, p, wall, wall.stiffness[q], depth);
                }
            }
        }
    }
}
