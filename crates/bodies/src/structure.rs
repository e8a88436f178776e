//! A body with its conditions and damage: what solvers advance.

use crate::body::{Body, StiffnessScratch, ordered_sum};
use crate::damage::{BreakingEnergy, Broken, Criterion, DamageState};
use crate::inclined::{Support, squared_reactions};
use crate::loads::{Condition, Field, Kind, Outside, add_external, add_walls, each_contact};
use rayon::prelude::*;
use solvers::problem::{Dynamics, Statics, Stop};
use solvers::sparse::{BlockMatrix, BlockPattern, FamilyList};
use std::sync::{Arc, OnceLock};

/// Displacements beyond this multiple of the body's size count as runaway.
const RUNAWAY: f64 = 1e3;

/// Largest share of the distance of two points that a step may close, where bonds resist collapse.
pub const APPROACH: f64 = 0.1;

/// A prescribed temperature field.
pub struct Temperature {
    /// T(x, t) \[K\].
    pub field: Field,
    /// Temperature without thermal strain \[K\].
    pub reference: f64,
}

/// How bonds break.
pub struct Failure {
    /// The criterion, with thresholds per point (sorted order).
    pub criterion: Criterion,
    /// In statics, bonds within this fraction of the worst break together; the rest wait for the new equilibrium.
    pub batch: f64,
}

/// What the body consists of, in sorted order.
pub struct Parts {
    /// The user's ids.
    pub id: Vec<u64>,
    /// Place of each sorted point in the user's order.
    pub user: Vec<u32>,
    /// Number of the material of each point.
    pub material: Vec<u32>,
    /// Density of each point \[kg/m³\].
    pub density: Vec<f64>,
}

/// Energies and momenta at an instant.
#[derive(Clone, Copy, Debug, Default)]
pub struct Balance {
    /// Σ m v²/2 \[J\]
    pub kinetic: f64,
    /// Σ V W \[J\]
    pub strain: f64,
    /// Energy of walls \[J\]
    pub contact: f64,
    /// Work done on the body by prescribed motions and external forces so far \[J\]
    pub external_work: f64,
    /// Σ of the energies that the bonds that broke in the run held when they did \[J\]: the energy that fracture is calibrated with
    pub broken_bonds: f64,
    /// What breaking took out of the families, and what of it went up instead, at the displacements at which bonds broke \[J\]
    pub breaking: BreakingEnergy,
    /// Linear momentum \[kg m/s\]
    pub momentum: [f64; 3],
    /// Angular momentum about the origin \[kg m²/s\]
    pub angular_momentum: [f64; 3],
}

/// A body, its conditions and its damage.
pub struct Structure<const D: usize> {
    /// The body.
    pub body: Body<D>,
    pub(crate) id: Vec<u64>,
    pub(crate) user: Vec<u32>,
    pub(crate) material: Vec<u32>,
    mass: Vec<f64>,
    /// Coordinates, `D` a point, for those who ask.
    positions: OnceLock<Vec<f64>>,
    size: f64,
    conditions: Vec<Condition>,
    temperature: Option<Temperature>,
    failure: Vec<Failure>,
    /// Prescribed by a condition, or held because a fragment floats (statics).
    fixed: Vec<bool>,
    /// (dof, condition) of the prescribed dofs, but for those of supports.
    prescribed: Vec<(u32, u32)>,
    /// Points with prescribed directions, ascending.
    pub(crate) supports: Vec<Support<D>>,
    held: Vec<bool>,
    statics: bool,
    time: f64,
    has_time: bool,
    /// Norm of the balanced forces at the last evaluation, and the largest at accepted states. Trial states do not count: with supports
    /// moved alone their forces are far too large, and residuals would look small beside them.
    force_scale: (f64, f64),
    /// Norm of the forces that the temperature alone makes in the undeformed body, and when: a body that expands freely has no other scale.
    thermal_force: Option<(f64, f64)>,
    pattern: Option<(Arc<BlockPattern>, FamilyList)>,
    saved: DamageState,
    /// Work, and what broke, at the last checkpoint.
    saved_work: Option<(Work, Broken, f64, BreakingEnergy)>,
    work: Work,
    work_open: bool,
    scratch: Vec<f64>,
    /// The points of all conditions, ascending, and what acts on their dofs from outside, walls excepted, at the last evaluation.
    driven: Vec<u32>,
    driving: Vec<f64>,
    /// Whether the last force evaluation, at the state that is accepted next, looked for stretched bonds.
    watched: bool,
    /// Whether at the last force evaluation displacements were within bounds, and forces finite.
    sound: bool,
    /// Damage counters of the whole run.
    pub broken: Broken,
    /// Energy that the bonds that broke held when they did.
    broken_energy: f64,
    breaking: BreakingEnergy,
    /// Evaluations of all bonds, for throughput: force, and tangent products.
    pub evaluations: (u64, u64),
    closest: Closest,
    /// Length of a step used to differentiate prescribed displacements.
    time_scale: f64,
    /// Whether products with the stiffness of the undeformed body may come from small forces, once that was tried.
    small_forces: Option<bool>,
}

/// Work so far, and where it was last added up.
#[derive(Clone, Default)]
struct Work {
    done: f64,
    /// Whether there is a state to go on from.
    begun: bool,
    u: Vec<f64>,
    force: Vec<f64>,
}

/// How close points have come, where bonds stiffen as they collapse.
struct Closest {
    /// Smallest |Y|/|ξ| seen.
    ever: f64,
    /// Smallest |Y|/|ξ| at the last look, 1 where none is small enough to matter.
    now: f64,
    /// The way that points may still go before that matters.
    gap: f64,
}

impl<const D: usize> Structure<D> {
    /// Joins a body with its conditions. `duration` is the length of the run, the scale for differences in time.
    pub fn new(
        body: Body<D>,
        parts: Parts,
        mut conditions: Vec<Condition>,
        temperature: Option<Temperature>,
        failure: Vec<Failure>,
        duration: f64,
    ) -> Self {
        let n = body.points();
        let mass = (0..n * D).map(|q| parts.density[q / D] * body.volume()[q / D]).collect();
        let size = (0..D)
            .map(|k| {
                let (lo, hi) = body.position().iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x[k]), b.max(x[k])));
                (hi - lo).powi(2)
            })
            .sum::<f64>()
            .sqrt();
        conditions.iter_mut().for_each(Condition::sort_points);
        let mut prescribed = vec![];
        let mut fixed = vec![false; n * D];
        let supports = Support::<D>::all(&conditions);
        let supported = |p: u32| supports.binary_search_by_key(&(p as usize), |s| s.point).is_ok();
        for (c, condition) in conditions.iter().enumerate().filter(|(_, c)| c.prescribes()) {
            for &p in condition.points.iter().filter(|&&p| !supported(p)) {
                for k in 0..D {
                    let dof = p as usize * D + k;
                    if condition.components[k].is_some() && !fixed[dof] {
                        fixed[dof] = true;
                        prescribed.push((dof as u32, c as u32));
                    }
                }
            }
        }
        let mut driven: Vec<u32> = conditions.iter().flat_map(|c| &c.points).copied().collect();
        driven.sort_unstable();
        driven.dedup();
        Structure {
            id: parts.id,
            user: parts.user,
            material: parts.material,
            mass,
            positions: OnceLock::new(),
            size,
            conditions,
            temperature,
            failure,
            held: vec![false; n * D],
            fixed,
            prescribed,
            supports,
            statics: false,
            time: 0.0,
            has_time: false,
            force_scale: (0.0, 0.0),
            thermal_force: None,
            pattern: None,
            saved: DamageState::default(),
            saved_work: None,
            work: Work { done: 0.0, begun: false, u: vec![0.0; driven.len() * D], force: vec![0.0; driven.len() * D] },
            work_open: true,
            scratch: vec![],
            driving: vec![0.0; driven.len() * D],
            driven,
            watched: false,
            sound: false,
            broken: Broken::default(),
            broken_energy: 0.0,
            breaking: BreakingEnergy::default(),
            evaluations: (0, 0),
            closest: Closest { ever: f64::INFINITY, now: 1.0, gap: 0.0 },
            time_scale: duration,
            small_forces: None,
            body,
        }
    }

    /// The conditions.
    pub fn conditions(&self) -> &[Condition] {
        &self.conditions
    }

    /// Mass per dof.
    pub fn masses(&self) -> &[f64] {
        &self.mass
    }

    /// The user's id of a sorted point.
    pub fn id_of(&self, point: usize) -> u64 {
        self.id[point]
    }

    /// Place of each sorted point in the user's order.
    pub fn user_order(&self) -> &[u32] {
        &self.user
    }

    /// Marks the structure as one in statics (floating fragments are then held) or in dynamics.
    pub fn set_statics(&mut self, statics: bool) {
        self.statics = statics;
        if statics {
            self.hold_fragments();
        }
    }

    /// Sets time and temperature of the body.
    fn at_time(&mut self, t: f64) {
        if self.has_time && self.time == t {
            return;
        }
        match &self.temperature {
            Some(temperature) => {
                let change = |x: [f64; 3]| (temperature.field)(x, t) - temperature.reference;
                self.body.set_time(t, Some(&change));
            }
            None => self.body.set_time(t, None),
        }
        self.time = t;
        self.has_time = true;
    }

    /// Internal, external and contact forces \[N\] at free and fixed dofs alike.
    pub fn total_force(&mut self, t: f64, u: &[f64], v: Option<&[f64]>, f: &mut [f64]) -> f64 {
        self.total_force_watching(t, u, v, false, f)
    }

    /// The same; bonds that come near a critical stretch are looked for in passing where the step will ask for them.
    fn total_force_watching(&mut self, t: f64, u: &[f64], v: Option<&[f64]>, watch: bool, f: &mut [f64]) -> f64 {
        self.at_time(t);
        let critical = match self.failure.as_slice() {
            [Failure { criterion: Criterion::CriticalStretch(critical), .. }] if watch => Some(critical.as_slice()),
            _ => None,
        };
        self.watched = critical.is_some();
        let limit = RUNAWAY * self.size;
        self.sound = self.body.internal_force_watching(u, v, critical, limit, f);
        self.evaluations.0 += 1;
        let (position, volume) = (self.body.position(), self.body.volume());
        let outside = Outside { conditions: &self.conditions, position, volume, u, t };
        let added = outside.add::<D>(&self.driven, 0, f, &mut self.driving);
        self.sound &= added.finite;
        added.squares.sqrt()
    }

    /// Norm of the internal forces of the undeformed body at the temperatures of time `t`, 0 where there are none.
    fn thermal_force(&mut self, t: f64) -> f64 {
        if self.temperature.is_none() {
            return 0.0;
        }
        if let Some((time, norm)) = self.thermal_force
            && time == t
        {
            return norm;
        }
        self.at_time(t);
        let (nothing, mut f) = (vec![0.0; self.body.dofs()], vec![0.0; self.body.dofs()]);
        self.body.internal_force(&nothing, None, &mut f);
        let norm = ordered_sum(f.len(), |q| f[q] * f[q]).sqrt();
        self.thermal_force = Some((t, norm));
        norm
    }

    /// `K x` of the undeformed body by the faster of two ways, after comparing them once. `false` where there is one way only.
    fn undeformed_product(&mut self, u: &[f64], x: &[f64], y: &mut [f64]) -> bool {
        /// Largest relative difference of the two.
        const AGREE: f64 = 1e-11;
        if self.small_forces == Some(false) || u.iter().any(|u| *u != 0.0) {
            return false;
        }
        let mut scratch = std::mem::take(&mut self.scratch);
        let done = self.body.undeformed_product(x, &mut scratch, y);
        if done && self.small_forces.is_none() {
            scratch.clear();
            scratch.resize(y.len(), 0.0);
            self.body.tangent_product(u, None, x, &mut scratch);
            let largest = scratch.iter().fold(0.0, |m: f64, y| m.max(y.abs()));
            self.small_forces = Some(scratch.iter().zip(&*y).all(|(a, b)| (a - b).abs() <= AGREE * largest));
            y.copy_from_slice(&scratch);
            if self.small_forces == Some(true) {
                self.body.forget_duals();
            }
        }
        scratch.resize(y.len(), 0.0);
        self.scratch = scratch;
        done
    }

    /// The first thing wrong with the state of the last force evaluation: not a number, or runaway.
    fn check(&mut self, t: f64, u: &[f64], f: &[f64]) -> Result<(), Stop> {
        if self.sound {
            return Ok(());
        }
        let limit = RUNAWAY * self.size;
        // written so that what is not a number is wrong
        let wrong = |q: usize| !(u[q].abs() <= limit && f[q].abs() < f64::INFINITY);
        let Some(dof) = (0..u.len()).find(|&q| wrong(q)) else { return Ok(()) };
        let p = dof / D;
        let x = self.body.position()[p];
        if u.iter().all(|u| u.is_finite()) {
            let approach = self.body.approach(u, &vec![0.0; u.len()], true);
            if approach.ratio <= 0.0 {
                return Err(Stop::new(format!("at time {t:.6e} {}", self.have_met(approach.pair, approach.ratio))));
            }
        }
        let (what, cause) = if u[dof].is_nan() || f[dof].is_nan() {
            ("is not a number", "two points met, a family turned inside out, or an expression of a condition has no value there")
        } else {
            ("runs away", "the time step is too long, the body is not held, or a load is far too large")
        };
        Err(Stop::new(format!(
            "at time {t:.6e} the motion of point {} at ({:.6e}, {:.6e}, {:.6e}) {what} (displacement {:.3e}, force {:.3e}); likely cause: {cause}",
            self.id[p], x[0], x[1], x[2], u[dof], f[dof]
        )))
    }

    /// Resultant that a condition exerts on the body: reactions of prescribed motion, applied loads, wall forces.
    pub fn resultant(&mut self, condition: usize, t: f64, u: &[f64], v: Option<&[f64]>) -> [f64; 3] {
        let mut out = [0.0; 3];
        match &self.conditions[condition].kind {
            Kind::Displacement | Kind::Velocity => {
                let mut f = vec![0.0; u.len()];
                self.total_force(t, u, v, &mut f);
                for &(dof, c) in self.prescribed.iter().filter(|p| p.1 == condition as u32) {
                    debug_assert_eq!(c as usize, condition);
                    out[dof as usize % D] -= f[dof as usize];
                }
                for s in &self.supports {
                    let share = s.share(condition, &self.conditions, &f[s.point * D..][..D]);
                    out.iter_mut().zip(share).for_each(|(out, share)| *out -= share);
                }
            }
            Kind::RigidWall(_) => {
                let only = &self.conditions[condition..=condition];
                each_contact::<D>(only, self.body.position(), u, t, |_, wall, stiffness, depth| {
                    (0..D).for_each(|k| out[k] += stiffness * depth * wall.normal[k]);
                });
            }
            Kind::ForceDensity | Kind::Traction { .. } => {
                let mut f = vec![0.0; u.len()];
                add_external::<D>(&self.conditions[condition..=condition], self.body.position(), self.body.volume(), t, &mut f);
                for (q, f) in f.iter().enumerate() {
                    out[q % D] += f;
                }
            }
        }
        out
    }

    /// Energies and momenta.
    pub fn balance(&mut self, t: f64, u: &[f64], v: &[f64]) -> Balance {
        self.at_time(t);
        let n = self.body.points();
        let strain = self.body.energy(u);
        let mut nothing = vec![0.0; u.len()];
        let contact = add_walls::<D>(&self.conditions, self.body.position(), u, t, &mut nothing);
        let kinetic = ordered_sum(u.len(), |q| 0.5 * self.mass[q] * v[q] * v[q]);
        let mut momentum = [0.0; 3];
        for k in 0..D {
            momentum[k] = ordered_sum(n, |p| self.mass[p * D] * v[p * D + k]);
        }
        let x = |p: usize, k: usize| if k < D { self.body.position()[p][k] + u[p * D + k] } else { 0.0 };
        let w = |p: usize, k: usize| if k < D { v[p * D + k] } else { 0.0 };
        let mut angular_momentum = [0.0; 3];
        for (k, l) in angular_momentum.iter_mut().enumerate() {
            let (a, b) = ((k + 1) % 3, (k + 2) % 3);
            *l = ordered_sum(n, |p| self.mass[p * D] * (x(p, a) * w(p, b) - x(p, b) * w(p, a)));
        }
        Balance {
            kinetic,
            strain,
            contact,
            external_work: self.work.done,
            broken_bonds: self.broken_energy,
            breaking: self.breaking,
            momentum,
            angular_momentum,
        }
    }

    /// Adds the work of the motion since the last call: mean of the old and new forces times the increment. `force` is the
    /// total force that was evaluated last, at `u`; where a dof is fixed the body is driven by its opposite, elsewhere by the external part
    /// only.
    fn add_work(&mut self, u: &[f64], force: &[f64]) {
        let mut driving = std::mem::take(&mut self.driving);
        for &(dof, _) in &self.prescribed {
            driving[self.driven_place(dof as usize / D) + dof as usize % D] -= force[dof as usize];
        }
        for s in &self.supports {
            let place = self.driven_place(s.point);
            let part = s.prescribed_part(&force[s.point * D..][..D]);
            driving[place..place + D].iter_mut().zip(part).for_each(|(d, part)| *d -= part);
        }
        let (work, driven) = (&mut self.work, &self.driven);
        // what is prescribed at the start of a motion is its initial state, not work
        let at_start = !std::mem::replace(&mut work.begun, true) && !self.statics;
        /// Most blocks: their sums live on the stack.
        const MOST: usize = 256;
        let block = driven.len().div_ceil(MOST).max(1024);
        let mut sums = [0.0; MOST];
        let sums = &mut sums[..driven.len().div_ceil(block)];
        let forces = driving.par_chunks(block * D).zip(work.force.par_chunks(block * D));
        let blocks = driven.par_chunks(block).zip(work.u.par_chunks_mut(block * D)).zip(forces).zip(sums.par_iter_mut());
        blocks.with_max_len(1).for_each(|(((points, before), (new, old)), sum)| {
            for (j, &p) in points.iter().enumerate() {
                for (q, &now) in (j * D..).zip(&u[p as usize * D..][..D]) {
                    *sum += 0.5 * (new[q] + old[q]) * (now - before[q]);
                    before[q] = now;
                }
            }
        });
        if !at_start {
            work.done += sums.iter().sum::<f64>();
        }
        self.driving = std::mem::replace(&mut work.force, driving);
    }

    /// Place of the dofs of a point of a condition among those of all driven points.
    fn driven_place(&self, point: usize) -> usize {
        self.driven.binary_search(&(point as u32)).expect("points of conditions are driven") * D
    }

    /// Breaks what exceeds its threshold: everything, or what comes close to the worst (see [`Failure::batch`]).
    fn break_exceeding(&mut self, u: &[f64], v: Option<&[f64]>, all: bool) -> Broken {
        let mut total = Broken::default();
        let mut found = vec![];
        let mut least = f64::INFINITY;
        // in an explicit step the force was evaluated here just before
        let watched = std::mem::take(&mut self.watched);
        for failure in &self.failure {
            least = least.min(failure.batch);
            found.extend(match &failure.criterion {
                Criterion::CriticalStretch(critical) if watched => self.body.exceeding_at_force(critical),
                criterion => self.body.exceeding(u, v, criterion),
            });
        }
        if found.is_empty() {
            return total;
        }
        let worst = found.iter().fold(0.0f64, |m, f| m.max(f.1));
        // ties break together: the threshold is a shade below the fraction of the worst
        let limit = if all { 0.0 } else { worst * least * (1.0 - 1e-9) };
        let chosen: Vec<_> = found.into_iter().filter(|f| f.1 >= limit).map(|f| f.0).collect();
        self.broken_energy += self.body.bond_energies(chosen.iter().copied(), (u, v));
        let (broken, energy) = self.body.break_deformed_bonds(chosen, (u, v));
        self.breaking.released += energy.released;
        self.breaking.raised += energy.raised;
        total.bonds += broken.bonds;
        total.released += broken.released;
        self.broken.bonds += total.bonds;
        self.broken.released += total.released;
        total
    }

    /// What is said of two points that have met, `ratio` = |Y|/|ξ|.
    fn have_met(&self, (a, b): (usize, usize), ratio: f64) -> String {
        format!(
            "points {} and {} have met (|Y| = {ratio:.3e} |ξ|), where the force of their bond has no value; use a material whose bonds resist \
             collapse (extended correspondence with an exponent of -d/2 or less), a shorter step, or another initial displacement",
            self.id[a], self.id[b]
        )
    }

    /// In statics: holds every dof of a fragment that no condition holds, so that the stiffness stays regular. A fragment
    /// is a set of points joined by intact bonds.
    fn hold_fragments(&mut self) {
        let n = self.body.points();
        let mut root: Vec<u32> = (0..n as u32).collect();
        fn find(root: &mut [u32], mut a: u32) -> u32 {
            while root[a as usize] != a {
                root[a as usize] = root[root[a as usize] as usize];
                a = root[a as usize];
            }
            a
        }
        for c in &self.body.chunks {
            for i in 0..c.owned {
                for s in c.slots(i).filter(|&s| c.is_intact(s)) {
                    let a = find(&mut root, (c.first + i) as u32);
                    let b = find(&mut root, c.points[c.far(i, s)]);
                    root[a.max(b) as usize] = a.min(b);
                }
            }
        }
        let mut anchored = vec![false; n];
        for &(dof, _) in &self.prescribed {
            anchored[find(&mut root, dof / D as u32) as usize] = true;
        }
        for s in &self.supports {
            anchored[find(&mut root, s.point as u32) as usize] = true;
        }
        let whole = find(&mut root, 0);
        let one_piece = (0..n as u32).all(|p| find(&mut root, p) == whole);
        self.held.fill(false);
        self.fixed.fill(false);
        for &(dof, _) in &self.prescribed {
            self.fixed[dof as usize] = true;
        }
        // a body in one piece that nobody holds is the user's mistake, not a fragment: the solver will say so
        if one_piece {
            return;
        }
        for p in 0..n {
            if !anchored[find(&mut root, p as u32) as usize] {
                for k in 0..D {
                    self.held[p * D + k] = true;
                    self.fixed[p * D + k] = true;
                }
            }
        }
    }

    /// Number of points of floating fragments (statics).
    pub fn held_points(&self) -> usize {
        self.held.iter().step_by(D).filter(|h| **h).count()
    }

    /// The prescribed displacements, or with `rate` all prescribed velocities.
    fn fill_prescribed(&self, t: f64, out: &mut [f64], rate: bool) {
        for &(dof, c) in &self.prescribed {
            if rate || matches!(self.conditions[c as usize].kind, Kind::Displacement) {
                out[dof as usize] = self.prescribed_value(c, dof as usize % D, dof as usize / D, t, rate);
            }
        }
    }

    /// What a condition prescribes of a component of a point: its function, or with `rate` the velocity that this means.
    pub(crate) fn prescribed_value(&self, condition: u32, component: usize, point: usize, t: f64, rate: bool) -> f64 {
        // difference step: the cube root of the round-off, relative to the run
        let h = self.time_scale * 6e-6;
        let condition = &self.conditions[condition as usize];
        let x = self.body.position()[point];
        let f = condition.components[component].as_ref().expect("prescribed components have a function");
        if rate && matches!(condition.kind, Kind::Displacement) {
            // one-sided at the start, where the function need not be defined before
            let a = (t - h).max(0.0);
            return (f(x, t + h) - f(x, a)) / (t + h - a);
        }
        f(x, t)
    }

    /// Whether a point belongs to a fragment that is held (statics).
    pub(crate) fn is_held(&self, point: usize) -> bool {
        self.held[point * D]
    }

    /// Whether some point is supported along a direction that is no axis of space: solvers then see the body through
    /// [`Inclined`](crate::inclined::Inclined).
    pub fn is_inclined(&self) -> bool {
        !self.supports.is_empty()
    }
}

/// κ n ⊗ n of a point against a wall, times x.
fn add_along<const D: usize>(wall: &crate::loads::Wall, stiffness: f64, p: usize, x: &[f64], y: &mut [f64]) {
    let along: f64 = (0..D).map(|k| wall.normal[k] * x[p * D + k]).sum();
    for k in 0..D {
        y[p * D + k] += stiffness * along * wall.normal[k];
    }
}

impl<const D: usize> Dynamics for Structure<D> {
    fn dofs(&self) -> usize {
        self.body.dofs()
    }
    fn mass(&self) -> &[f64] {
        &self.mass
    }
    fn fixed(&self) -> &[bool] {
        &self.fixed
    }
    fn force(&mut self, t: f64, u: &[f64], v: &[f64], f: &mut [f64]) -> Result<(), Stop> {
        // products with the stiffness are over for a while
        self.scratch = vec![];
        self.total_force_watching(t, u, Some(v), true, f);
        self.check(t, u, f)?;
        self.add_work(u, f);
        Ok(())
    }
    fn prescribe_displacement(&mut self, t: f64, u: &mut [f64]) {
        self.fill_prescribed(t, u, false);
    }
    fn prescribe_velocity(&mut self, t: f64, v: &mut [f64]) {
        self.fill_prescribed(t, v, true);
    }
    fn step_limit(&mut self, _: f64, u: &[f64], v: &[f64], step: f64) -> Result<f64, Stop> {
        if self.closest.gap == f64::INFINITY {
            return Ok(step);
        }
        // a pair of points comes closer by twice the largest speed at most: until that has used up the gap nothing can happen
        let fastest = v.chunks(D).map(|v| v.iter().map(|v| v * v).sum::<f64>()).fold(0.0, f64::max).sqrt();
        let reach = 2.0 * fastest * step;
        if self.closest.gap > reach {
            self.closest.gap -= reach;
            return Ok(step);
        }
        if !self.body.collapses() {
            self.closest.gap = f64::INFINITY;
            return Ok(step);
        }
        let approach = self.body.approach(u, v, false);
        if approach.ratio <= 0.0 || approach.ratio.is_nan() {
            return Err(Stop::new(self.have_met(approach.pair, approach.ratio)));
        }
        let now = if approach.gap > 0.0 { 1.0 } else { approach.ratio.min(1.0) };
        self.closest = Closest { ever: self.closest.ever.min(approach.ratio), now, gap: approach.gap - reach };
        Ok(step.min(APPROACH * approach.time))
    }
    fn hardness(&self) -> f64 {
        1.0 / self.closest.now
    }
    fn stiffens_by_breaking(&self) -> bool {
        self.body.is_rebuilt()
    }
    fn accept(&mut self, _: f64, u: &[f64], v: &[f64]) -> Result<bool, Stop> {
        self.body.commit(u, Some(v));
        if self.failure.is_empty() {
            return Ok(false);
        }
        Ok(self.break_exceeding(u, Some(v), true).bonds > 0)
    }
    fn tangent_product(&mut self, t: f64, u: &[f64], x: &[f64], y: &mut [f64]) -> Result<(), Stop> {
        self.at_time(t);
        if !self.undeformed_product(u, x, y) {
            self.body.tangent_product(u, None, x, y);
        }
        self.evaluations.1 += 1;
        // for stable steps: a point may come into contact later, so every wall counts everywhere
        for c in &self.conditions {
            if let Kind::RigidWall(wall) = &c.kind {
                for (q, &p) in c.points.iter().enumerate() {
                    add_along::<D>(wall, wall.stiffness[q], p as usize, x, y);
                }
            }
        }
        Ok(())
    }
}

impl<const D: usize> Statics for Structure<D> {
    fn dofs(&self) -> usize {
        self.body.dofs()
    }
    fn dofs_per_point(&self) -> usize {
        D
    }
    fn positions(&self) -> &[f64] {
        self.positions.get_or_init(|| self.body.position().iter().flat_map(|x| x[..D].to_vec()).collect())
    }
    fn fixed(&self) -> &[bool] {
        &self.fixed
    }
    fn prescribe(&mut self, t: f64, u: &mut [f64]) {
        self.fill_prescribed(t, u, false);
    }
    fn force(&mut self, t: f64, u: &[f64], f: &mut [f64]) -> Result<(), Stop> {
        let thermal = self.thermal_force(t);
        let applied = self.total_force(t, u, None, f);
        self.check(t, u, f)?;
        let reaction = self.prescribed.iter().map(|&(q, _)| f[q as usize] * f[q as usize]).sum::<f64>();
        let reaction = (reaction + squared_reactions(&self.supports, f)).sqrt();
        self.force_scale.0 = applied.max(reaction).max(thermal);
        Ok(())
    }
    fn energy(&mut self, t: f64, u: &[f64]) -> Option<f64> {
        if !self.body.is_conservative() {
            return None;
        }
        self.at_time(t);
        let mut external = vec![0.0; u.len()];
        add_external::<D>(&self.conditions, self.body.position(), self.body.volume(), t, &mut external);
        let load = ordered_sum(u.len(), |q| external[q] * u[q]);
        let wall = add_walls::<D>(&self.conditions, self.body.position(), u, t, &mut external);
        Some(self.body.energy(u) + wall - load)
    }
    fn tangent_product(&mut self, t: f64, u: &[f64], x: &[f64], y: &mut [f64]) -> Result<(), Stop> {
        self.at_time(t);
        // where nothing is solved, every digit counts (spectra)
        if !(self.statics && self.undeformed_product(u, x, y)) {
            self.body.tangent_product(u, None, x, y);
        }
        self.evaluations.1 += 1;
        each_contact::<D>(&self.conditions, self.body.position(), u, t, |p, wall, stiffness, _| add_along::<D>(wall, stiffness, p, x, y));
        Ok(())
    }
    fn pattern(&mut self) -> Option<Arc<BlockPattern>> {
        if self.pattern.is_none() {
            let (starts, members) = self.body.couplings();
            let families = FamilyList::new(self.body.points(), starts, members).ok()?;
            let pattern = BlockPattern::from_families(D, &families).ok()?;
            self.pattern = Some((Arc::new(pattern), families));
        }
        self.pattern.as_ref().map(|p| p.0.clone())
    }
    fn tangent(&mut self, t: f64, u: &[f64], matrix: &mut BlockMatrix) -> Result<(), Stop> {
        self.at_time(t);
        self.pattern();
        self.body.forward(u, None);
        let Some((_, families)) = &mut self.pattern else {
            return Err(Stop::new("the stiffness is too large to be assembled; choose `method: conjugate_gradients`"));
        };
        families.set_alike(if self.body.is_undeformed() { self.body.alike() } else { vec![] });
        let body = &self.body;
        matrix.add_families(families, StiffnessScratch::default, |scratch, k, dense| {
            body.family_stiffness(scratch, k, dense);
            Ok::<(), Stop>(())
        })?;
        each_contact::<D>(&self.conditions, self.body.position(), u, t, |p, wall, stiffness, _| {
            let block: Vec<f64> = (0..D * D).map(|q| stiffness * wall.normal[q / D] * wall.normal[q % D]).collect();
            let added = matrix.add_block(p, p, &block);
            debug_assert!(added, "the pattern has every diagonal block");
        });
        Ok(())
    }
    fn block_diagonal(&mut self, t: f64, u: &[f64], blocks: &mut [f64]) -> Result<(), Stop> {
        self.at_time(t);
        self.body.block_diagonal(u, blocks);
        each_contact::<D>(&self.conditions, self.body.position(), u, t, |p, wall, stiffness, _| {
            for q in 0..D * D {
                blocks[p * D * D + q] += stiffness * wall.normal[q / D] * wall.normal[q % D];
            }
        });
        Ok(())
    }
    fn reach(&self) -> Option<f64> {
        self.body.chunks.iter().flat_map(|c| &c.horizon).copied().reduce(f64::max).map(|h| 2.0 * h)
    }
    fn force_scale(&self) -> f64 {
        self.force_scale.0.max(self.force_scale.1)
    }
    fn break_bonds(&mut self, t: f64, u: &[f64]) -> Result<usize, Stop> {
        if self.work_open {
            // work of the increment at the forces before anything breaks: what breaks at this load dissipates, it does no work
            let mut f = vec![0.0; u.len()];
            self.total_force(t, u, None, &mut f);
            self.add_work(u, &f);
            self.work_open = false;
        }
        if self.failure.is_empty() {
            return Ok(0);
        }
        let broken = self.break_exceeding(u, None, false);
        if broken.bonds > 0 {
            self.hold_fragments();
        }
        Ok(broken.bonds)
    }
    fn first_failure(&mut self, t: f64, u: &[f64]) -> Result<Option<f64>, Stop> {
        self.at_time(t);
        let mut share: Option<f64> = None;
        for failure in &self.failure {
            let worst = self.body.exceeding(u, None, &failure.criterion).iter().fold(0.0f64, |m, f| m.max(f.1));
            if worst > 0.0 {
                // stretches go with the load, energies with its square
                let at = match failure.criterion {
                    Criterion::CriticalStretch(_) => 1.0 / worst,
                    Criterion::CriticalBondEnergy(_) => 1.0 / worst.sqrt(),
                };
                share = Some(share.map_or(at, |s| s.min(at)));
            }
        }
        Ok(share)
    }
    fn accept(&mut self, t: f64, u: &[f64]) -> Result<(), Stop> {
        let mut f = vec![0.0; u.len()];
        self.total_force(t, u, None, &mut f);
        self.add_work(u, &f);
        self.work_open = true;
        self.force_scale.1 = self.force_scale.1.max(self.force_scale.0);
        self.body.commit(u, None);
        Ok(())
    }
    fn checkpoint(&mut self) {
        self.saved_work = Some((self.work.clone(), self.broken, self.broken_energy, self.breaking));
        self.work_open = true;
        if !self.failure.is_empty() {
            self.body.save_damage(&mut self.saved);
        }
    }
    fn rollback(&mut self) {
        if let Some((work, broken, held, breaking)) = &self.saved_work {
            self.work = work.clone();
            (self.broken, self.broken_energy, self.breaking) = (*broken, *held, *breaking);
        }
        self.work_open = true;
        if !self.failure.is_empty() {
            self.body.restore_damage(&self.saved);
            self.hold_fragments();
        }
    }
}

/// What a run needs of a structure, whatever its dimension.
pub trait Simulated: Dynamics + Statics + Send {
    /// Statics or dynamics: see [`Structure::set_statics`].
    fn set_statics(&mut self, statics: bool);
    /// Displacements or velocities along x, y, z become what solvers see: where points are supported along directions of their own,
    /// components along those.
    fn enter(&self, _u: &mut [f64]) {}
    /// A field: see [`Structure::field`].
    fn field(&mut self, name: crate::measures::FieldName, t: f64, u: &[f64], v: &[f64]) -> Vec<f64>;
    /// Energies and momenta.
    fn balance(&mut self, t: f64, u: &[f64], v: &[f64]) -> Balance;
    /// Names of the conditions, in order.
    fn condition_names(&self) -> Vec<String>;
    /// What a condition exerts on the body.
    fn resultant(&mut self, condition: usize, t: f64, u: &[f64], v: Option<&[f64]>) -> [f64; 3];
    /// Largest damage, and bonds broken and points released during the run.
    fn damage(&self) -> (f64, Broken);
    /// Evaluations of all bonds so far: forces, tangent products.
    fn evaluations(&self) -> (u64, u64);
    /// Directed bonds, chunks, and bytes of bonds, points, and shapes.
    fn sizes(&self) -> (usize, usize, (usize, usize, usize));
    /// The user's id and position of the point of a dof.
    fn describe_dof(&self, dof: usize) -> (u64, [f64; 3]);
    /// Points of floating fragments that are held (statics).
    fn held_points(&self) -> usize;
    /// Smallest |Y|/|ξ| that an explicit run came to, where bonds resist collapse and it was watched.
    fn closest_approach(&self) -> Option<f64> {
        None
    }
}

impl<const D: usize> Simulated for Structure<D> {
    fn set_statics(&mut self, statics: bool) {
        Structure::set_statics(self, statics);
    }
    fn field(&mut self, name: crate::measures::FieldName, t: f64, u: &[f64], v: &[f64]) -> Vec<f64> {
        Structure::field(self, name, t, u, v)
    }
    fn balance(&mut self, t: f64, u: &[f64], v: &[f64]) -> Balance {
        Structure::balance(self, t, u, v)
    }
    fn condition_names(&self) -> Vec<String> {
        self.conditions.iter().map(|c| c.name.clone()).collect()
    }
    fn resultant(&mut self, condition: usize, t: f64, u: &[f64], v: Option<&[f64]>) -> [f64; 3] {
        Structure::resultant(self, condition, t, u, v)
    }
    fn damage(&self) -> (f64, Broken) {
        (self.body.damage().iter().fold(0.0, |m, d| m.max(*d)), self.broken)
    }
    fn evaluations(&self) -> (u64, u64) {
        self.evaluations
    }
    fn sizes(&self) -> (usize, usize, (usize, usize, usize)) {
        (self.body.bonds(), self.body.chunk_count(), self.body.bytes())
    }
    fn describe_dof(&self, dof: usize) -> (u64, [f64; 3]) {
        (self.id[dof / D], self.body.position()[dof / D])
    }
    fn held_points(&self) -> usize {
        Structure::held_points(self)
    }
    fn closest_approach(&self) -> Option<f64> {
        self.closest.ever.is_finite().then_some(self.closest.ever)
    }
}
