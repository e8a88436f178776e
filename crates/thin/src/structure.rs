//! A thin body with its conditions: what solvers and runs see.

use crate::ThinError;
use crate::body::{Bending, Thin};
use crate::loads::{Action, Condition};
use bodies::body::ordered_sum;
use bodies::damage::Broken;
use bodies::measures::FieldName;
use bodies::structure::{Balance, Simulated};
use solvers::problem::{Dynamics, Statics, Stop};
use solvers::sparse::{BlockMatrix, BlockPattern};
use std::sync::Arc;

/// Displacements beyond this multiple of the body's size count as runaway.
const RUNAWAY: f64 = 1e3;

/// That pairs break at their limit angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Brittle {
    /// In statics, pairs within this fraction of the worst break together; 1: the worst alone, with its ties.
    pub batch: f64,
}

/// What belongs to the points besides the energy.
#[derive(Clone, Debug, Default)]
pub struct PointData {
    /// The user's ids; numbers from 0 where empty.
    pub id: Vec<u64>,
    /// Place of each point in the user's order; the same order where empty.
    pub user: Vec<u32>,
    /// Number of the material; 0 where empty.
    pub material: Vec<u32>,
    /// Mass per length or area of each point, or one for all; 1 where empty. Mean conditions do not spread it.
    pub density: Vec<f64>,
}

/// Work so far, and where it was last added up.
#[derive(Clone, Default)]
struct Work {
    done: f64,
    u: Vec<f64>,
    force: Vec<f64>,
}

/// A thin body, its conditions and its damage.
pub struct ThinStructure<const D: usize> {
    /// The body.
    pub body: Thin<D>,
    conditions: Vec<Condition>,
    data: PointData,
    mass: Vec<f64>,
    positions: Vec<f64>,
    fixed: Vec<bool>,
    prescribed: Vec<(u32, u32)>,
    brittle: Option<Brittle>,
    saved_intact: (Vec<bool>, Vec<bool>),
    saved_plastic: Vec<f64>,
    force_scale: (f64, f64),
    size: f64,
    time_scale: f64,
    work: Work,
    saved_work: Work,
    work_open: bool,
    scratch: Vec<f64>,
    broken: Broken,
    saved_broken: Broken,
    evaluations: (u64, u64),
    statics: bool,
}

/// A body that can be handed to solvers. Implemented for each number of components, so that all that solvers call is compiled in this crate, not
/// again in each that assembles bodies.
pub trait Assembled {
    /// The body with its conditions, see [`ThinStructure::new`].
    ///
    /// # Errors
    /// Those of [`ThinStructure::new`].
    fn simulated(
        self,
        data: PointData,
        conditions: Vec<Condition>,
        brittle: Option<Brittle>,
        duration: f64,
    ) -> Result<Box<dyn Simulated>, ThinError>;
}

macro_rules! assembled {
    ($($components:literal)*) => {$(
        impl Assembled for Thin<$components> {
            fn simulated(
                self,
                data: PointData,
                conditions: Vec<Condition>,
                brittle: Option<Brittle>,
                duration: f64,
            ) -> Result<Box<dyn Simulated>, ThinError> {
                Ok(Box::new(ThinStructure::new(self, data, conditions, brittle, duration)?))
            }
        }
    )*};
}
assembled!(1 2 3);

impl<const D: usize> ThinStructure<D> {
    /// Joins a body with its conditions. `duration` is the length of the run, the scale for differences in time.
    ///
    /// # Errors
    /// [`ThinError`] for impossible means and wrong lengths.
    pub fn new(
        mut body: Thin<D>,
        data: PointData,
        conditions: Vec<Condition>,
        brittle: Option<Brittle>,
        duration: f64,
    ) -> Result<Self, ThinError> {
        let n = body.points();
        for (what, found) in [("ids", data.id.len()), ("user order", data.user.len()), ("materials", data.material.len())] {
            if found != 0 && found != n {
                return Err(ThinError::Length { what, expected: n, found });
            }
        }
        if !data.density.is_empty() {
            crate::beam::check_values("mass per length or area", &data.density, n)?;
        }
        if brittle.is_some() && body.law.has_history() && body.laws.is_empty() {
            return Err(ThinError::Unsupported { what: "pairs that yield and break at one angle", remedy: "choose plastic or brittle" });
        }
        let (mut fixed, mut prescribed) = (vec![false; n * D], vec![]);
        // points that follow others have no dofs; what is held of one that follows a single point is held of that
        let follows: Vec<Option<crate::stencil::Stencil<D>>> = (0..n as u32)
            .map(|p| body.dependent().get(p as usize).copied().unwrap_or(false).then(|| body.ends().stencil(p).to_vec()))
            .collect();
        for p in (0..n).filter(|&p| follows[p].is_some()) {
            fixed[p * D..(p + 1) * D].fill(true);
        }
        for (c, condition) in conditions.iter().enumerate() {
            for component in (0..D).filter(|&k| condition.components[k].is_some()) {
                let mut hold = |p: u32| {
                    let p = match follows[p as usize].as_deref() {
                        Some([(leader, _)]) => *leader,
                        Some(_) => return false,
                        None => p,
                    };
                    let dof = p as usize * D + component;
                    if !fixed[dof] {
                        fixed[dof] = true;
                        prescribed.push((dof as u32, c as u32));
                    }
                    true
                };
                match &condition.action {
                    Action::Displacement => {
                        if let Some(&point) = condition.points.iter().find(|&&p| !hold(p)) {
                            let why = "follows several others and cannot be held itself; hold those";
                            return Err(ThinError::Tie { point: point as usize, why });
                        }
                    }
                    Action::Mean => {
                        let Some(&kept) = condition.points.get(condition.points.len() / 2) else { continue };
                        let others: Vec<(u32, f64)> = condition.points.iter().filter(|&&p| p != kept).map(|&p| (p, -1.0)).collect();
                        if follows.iter().any(Option::is_some) {
                            let why = "is in a mean together with points that follow others; hold points instead";
                            return Err(ThinError::Tie { point: kept as usize, why });
                        }
                        body.substitute(kept, component, condition.points.len() as f64, &others);
                        let _ = hold(kept);
                    }
                    Action::Force { weights } if weights.len() != condition.points.len() => {
                        let (expected, found) = (condition.points.len(), weights.len());
                        return Err(ThinError::Length { what: "weights of a load", expected, found });
                    }
                    Action::Pressure { vectors, .. } if vectors.len() != condition.points.len() => {
                        let (expected, found) = (condition.points.len(), vectors.len());
                        return Err(ThinError::Length { what: "area vectors of a pressure", expected, found });
                    }
                    Action::Force { .. } | Action::Pressure { .. } => {}
                }
            }
        }
        let density = |p: usize| if data.density.is_empty() { 1.0 } else { crate::beam::at(&data.density, p) };
        let mut mass = vec![0.0; n * D];
        for p in 0..n {
            let m = density(p) * body.measure()[p];
            match &follows[p] {
                None => mass[p * D..(p + 1) * D].iter_mut().for_each(|x| *x += m),
                Some(list) => {
                    // with those it follows
                    for (q, w) in list {
                        (0..D).for_each(|k| mass[*q as usize * D + k] += m * w[k]);
                    }
                }
            }
        }
        for p in (0..n).filter(|&p| follows[p].is_some()) {
            // no dof, but no division by zero either
            mass[p * D..(p + 1) * D].fill(density(p) * body.measure()[p]);
        }
        // coordinates along the rows: for orderings
        let layout = body.layout();
        let d = if layout.is_lattice() { layout.dimension } else { 3 };
        let positions: Vec<f64> = match layout.is_lattice() {
            true => (0..n * d).map(|q| f64::from(layout.cell(q / d)[q % d]) * layout.spacing[q % d]).collect(),
            false => layout.positions.iter().flatten().copied().collect(),
        };
        let size = (0..d)
            .map(|k| {
                let (lo, hi) =
                    (0..n).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| (a.min(positions[p * d + k]), b.max(positions[p * d + k])));
                hi - lo
            })
            .fold(0.0, f64::hypot);
        let work = Work { done: 0.0, u: vec![0.0; n * D], force: vec![0.0; n * D] };
        Ok(ThinStructure {
            body,
            conditions,
            data,
            mass,
            positions,
            fixed,
            prescribed,
            brittle,
            saved_intact: (vec![], vec![]),
            saved_plastic: vec![],
            force_scale: (0.0, 0.0),
            size,
            time_scale: duration,
            saved_work: work.clone(),
            work,
            work_open: true,
            scratch: vec![0.0; n * D],
            broken: Broken::default(),
            saved_broken: Broken::default(),
            evaluations: (0, 0),
            statics: false,
        })
    }

    /// The conditions.
    pub fn conditions(&self) -> &[Condition] {
        &self.conditions
    }

    /// Displacements of the points: entries that stand for means are put back.
    pub fn displacements(&self, u: &[f64]) -> Vec<f64> {
        (0..self.body.points() as u32).flat_map(|p| self.body.ends().value(p, u)).collect()
    }

    /// Adds the external forces of all conditions, on the body at displacement `u`, or where it was.
    fn add_external(&self, t: f64, u: Option<&[f64]>, force: &mut [f64]) {
        let now = u.map(|u| self.places(u));
        let now = now.as_ref().map(|n| n as &dyn Fn(u32) -> [f64; 3]);
        for condition in &self.conditions {
            condition.forces::<D>(&self.body.layout().positions, t, now, |p, f| self.body.ends().scatter(p, &f, force, 0));
        }
    }

    /// Where points are at a displacement.
    fn places<'u>(&'u self, u: &'u [f64]) -> impl Fn(u32) -> [f64; 3] + 'u {
        move |p| {
            let mut x = self.body.layout().positions[p as usize];
            let moved = self.spatial(&self.body.ends().value(p, u));
            (0..3).for_each(|k| x[k] += moved[k]);
            x
        }
    }

    /// Adds all external forces.
    pub(crate) fn external(&self, t: f64, force: &mut [f64]) {
        self.add_external(t, None, force);
    }

    /// Internal and external forces; returns the norm of the external ones.
    pub fn total_force(&mut self, t: f64, u: &[f64], f: &mut [f64]) -> f64 {
        self.body.force(u, f);
        self.evaluations.0 += 1;
        let mut external = vec![0.0; f.len()];
        self.add_external(t, Some(u), &mut external);
        for (f, e) in f.iter_mut().zip(&external) {
            *f += e;
        }
        ordered_sum(external.len(), |q| external[q] * external[q]).sqrt()
    }

    fn check(&self, t: f64, u: &[f64], f: &[f64]) -> Result<(), Stop> {
        let limit = RUNAWAY * self.size;
        let wrong = |q: usize| u[q].is_nan() || u[q].abs() > limit || !f[q].is_finite();
        let Some(dof) = (0..u.len()).find(|&q| wrong(q)) else { return Ok(()) };
        let (id, x) = self.describe(dof);
        Err(Stop::new(format!(
            "at time {t:.6e} the motion of point {id} at ({:.6e}, {:.6e}, {:.6e}) runs away or is not a number (displacement {:.3e}, force {:.3e}); likely cause: the body is not held, the time step is too long, or a load is far too large",
            x[0], x[1], x[2], u[dof], f[dof]
        )))
    }

    fn describe(&self, dof: usize) -> (u64, [f64; 3]) {
        let p = dof / D;
        (self.data.id.get(p).copied().unwrap_or(p as u64), self.body.layout().positions[p])
    }

    fn fill_prescribed(&self, t: f64, out: &mut [f64], rate: bool) {
        let h = self.time_scale * 6e-6;
        for &(dof, c) in &self.prescribed {
            let (p, k) = (dof as usize / D, dof as usize % D);
            let Some(f) = &self.conditions[c as usize].components[k] else { continue };
            let x = self.body.layout().positions[p];
            out[dof as usize] = if rate && h > 0.0 {
                // one-sided at the start, where the function need not be defined before
                let a = (t - h).max(0.0);
                (f(x, t + h) - f(x, a)) / (t + h - a)
            } else if rate {
                0.0
            } else {
                f(x, t)
            };
        }
    }

    fn add_work(&mut self, t: f64, u: &[f64], force: &[f64]) {
        let mut driving = vec![0.0; u.len()];
        self.add_external(t, Some(u), &mut driving);
        for &(dof, _) in &self.prescribed {
            driving[dof as usize] -= force[dof as usize];
        }
        let work = &mut self.work;
        work.done += ordered_sum(u.len(), |q| 0.5 * (driving[q] + work.force[q]) * (u[q] - work.u[q]));
        work.u.copy_from_slice(u);
        work.force = driving;
    }

    fn break_exceeding(&mut self, u: &[f64], all: bool) -> usize {
        let Some(brittle) = self.brittle else { return 0 };
        let found = self.body.exceeding(u);
        let worst = found.iter().fold(0.0f64, |m, f| m.max(f.1));
        let limit = if all { 0.0 } else { worst * brittle.batch.min(1.0) * (1.0 - 1e-9) };
        let broken = self.body.break_pairs(found.into_iter().filter(|f| f.1 >= limit).map(|f| f.0));
        // counted as the two bonds of a pair, as everywhere
        self.broken.bonds += 2 * broken;
        broken
    }

    /// What a condition exerts on the body, per component: the reaction of what it prescribes, or its load.
    pub fn resultant_components(&mut self, condition: usize, t: f64, u: &[f64]) -> [f64; D] {
        let mut out = [0.0; D];
        let mut f = std::mem::take(&mut self.scratch);
        if self.conditions[condition].prescribes() {
            self.total_force(t, u, &mut f);
            for &(dof, _) in self.prescribed.iter().filter(|p| p.1 == condition as u32) {
                out[dof as usize % D] -= f[dof as usize];
            }
        } else {
            let now = self.places(u);
            let add = |_: u32, f: [f64; D]| (0..D).for_each(|k| out[k] += f[k]);
            self.conditions[condition].forces::<D>(&self.body.layout().positions, t, Some(&now), add);
        }
        self.scratch = f;
        out
    }

    /// A vector of the body in space: what acts across it lies along its normal.
    fn spatial(&self, v: &[f64]) -> [f64; 3] {
        let normal = self.body.layout().normal;
        if D == 1 { normal.map(|n| n * v[0]) } else { [0, 1, 2].map(|k| if k < D { v[k] } else { 0.0 }) }
    }

    fn tensors(&self, of: &[Bending]) -> Vec<f64> {
        let layout = self.body.layout();
        of.iter()
            .enumerate()
            .flat_map(|(p, m)| {
                let [a, mut b] = layout.axes.get(p).map_or(layout.rows, |axes| [axes[0], axes[1]]);
                if D == 3 && layout.is_lattice() && layout.dimension == 1 {
                    // the third component of beams in space is across both
                    b = crate::frame::cross(&a, &layout.normal);
                }
                let mut t = [0.0; 9];
                for i in 0..3 {
                    for j in 0..3 {
                        t[3 * i + j] = m[0] * a[i] * a[j] + m[1] * b[i] * b[j] + m[2] * (a[i] * b[j] + b[i] * a[j]);
                    }
                }
                t
            })
            .collect()
    }

    fn user_order(&self, sorted: &[f64], words: usize) -> Vec<f64> {
        if self.data.user.is_empty() {
            return sorted.to_vec();
        }
        let mut out = vec![0.0; sorted.len()];
        for (p, &user) in self.data.user.iter().enumerate() {
            out[user as usize * words..][..words].copy_from_slice(&sorted[p * words..][..words]);
        }
        out
    }
}

fn stop(e: ThinError) -> Stop {
    Stop::new(e.to_string())
}

impl<const D: usize> Statics for ThinStructure<D> {
    fn dofs(&self) -> usize {
        self.mass.len()
    }
    fn dofs_per_point(&self) -> usize {
        D
    }
    fn positions(&self) -> &[f64] {
        &self.positions
    }
    fn fixed(&self) -> &[bool] {
        &self.fixed
    }
    fn prescribe(&mut self, t: f64, u: &mut [f64]) {
        self.fill_prescribed(t, u, false);
    }
    fn force(&mut self, t: f64, u: &[f64], f: &mut [f64]) -> Result<(), Stop> {
        let applied = self.total_force(t, u, f);
        self.check(t, u, f)?;
        let reaction = self.prescribed.iter().map(|&(q, _)| f[q as usize] * f[q as usize]).sum::<f64>().sqrt();
        self.force_scale.0 = applied.max(reaction);
        Ok(())
    }
    fn energy(&mut self, t: f64, u: &[f64]) -> Option<f64> {
        if self.conditions.iter().any(Condition::follows) {
            // a load that follows has a potential only where its edges are held
            return None;
        }
        let mut external = vec![0.0; u.len()];
        self.add_external(t, None, &mut external);
        let load = ordered_sum(u.len(), |q| external[q] * u[q]);
        Some(self.body.energy(u) - load)
    }
    fn tangent_product(&mut self, _: f64, u: &[f64], x: &[f64], y: &mut [f64]) -> Result<(), Stop> {
        self.evaluations.1 += 1;
        self.body.tangent_product(u, x, y).map_err(stop)
    }
    fn pattern(&mut self) -> Option<Arc<BlockPattern>> {
        self.body.pattern().ok()
    }
    fn tangent(&mut self, _: f64, u: &[f64], matrix: &mut BlockMatrix) -> Result<(), Stop> {
        self.body.tangent(u, matrix).map_err(stop)
    }
    fn tangent_change(&mut self, _: f64, u: &[f64], along: &[f64], matrix: &mut BlockMatrix) -> Result<bool, Stop> {
        if u.iter().any(|x| *x != 0.0) {
            return Ok(false);
        }
        self.body.tangent_change(along, matrix).map_err(stop)
    }
    fn block_diagonal(&mut self, _: f64, u: &[f64], blocks: &mut [f64]) -> Result<(), Stop> {
        self.body.block_diagonal(u, blocks).map_err(stop)
    }
    fn force_scale(&self) -> f64 {
        self.force_scale.0.max(self.force_scale.1)
    }
    fn break_bonds(&mut self, t: f64, u: &[f64]) -> Result<usize, Stop> {
        if self.work_open {
            // work of the increment at the forces before anything breaks
            let mut f = std::mem::take(&mut self.scratch);
            self.total_force(t, u, &mut f);
            self.add_work(t, u, &f);
            self.scratch = f;
            self.work_open = false;
        }
        Ok(self.break_exceeding(u, false))
    }
    fn accept(&mut self, t: f64, u: &[f64]) -> Result<(), Stop> {
        let mut f = std::mem::take(&mut self.scratch);
        self.total_force(t, u, &mut f);
        self.add_work(t, u, &f);
        self.scratch = f;
        self.work_open = true;
        self.force_scale.1 = self.force_scale.1.max(self.force_scale.0);
        self.body.commit(u);
        Ok(())
    }
    fn checkpoint(&mut self) {
        self.saved_work.clone_from(&self.work);
        self.work_open = true;
        self.saved_broken = self.broken;
        if self.brittle.is_some() {
            self.body.save_intact(&mut self.saved_intact);
        }
        self.saved_plastic.clone_from(&self.body.plastic);
    }
    fn rollback(&mut self) {
        self.work.clone_from(&self.saved_work);
        self.work_open = true;
        self.broken = self.saved_broken;
        if self.brittle.is_some() {
            self.body.restore_intact(&self.saved_intact);
        }
        self.body.plastic.clone_from(&self.saved_plastic);
    }
}

impl<const D: usize> Dynamics for ThinStructure<D> {
    fn dofs(&self) -> usize {
        self.mass.len()
    }
    fn mass(&self) -> &[f64] {
        &self.mass
    }
    fn fixed(&self) -> &[bool] {
        &self.fixed
    }
    fn force(&mut self, t: f64, u: &[f64], _: &[f64], f: &mut [f64]) -> Result<(), Stop> {
        self.total_force(t, u, f);
        self.check(t, u, f)?;
        self.add_work(t, u, f);
        Ok(())
    }
    fn prescribe_displacement(&mut self, t: f64, u: &mut [f64]) {
        self.fill_prescribed(t, u, false);
    }
    fn prescribe_velocity(&mut self, t: f64, v: &mut [f64]) {
        self.fill_prescribed(t, v, true);
    }
    fn accept(&mut self, _: f64, u: &[f64], _: &[f64]) -> Result<bool, Stop> {
        self.body.commit(u);
        Ok(self.break_exceeding(u, true) > 0)
    }
    fn tangent_product(&mut self, _: f64, u: &[f64], x: &[f64], y: &mut [f64]) -> Result<(), Stop> {
        self.evaluations.1 += 1;
        self.body.tangent_product(u, x, y).map_err(stop)
    }
}

impl<const D: usize> Simulated for ThinStructure<D> {
    fn set_statics(&mut self, statics: bool) {
        self.statics = statics;
    }
    fn field(&mut self, name: FieldName, t: f64, u: &[f64], v: &[f64]) -> Vec<f64> {
        let n = self.body.points();
        let words = name.words();
        let vectors = |s: &Self, x: &[f64]| x.chunks(D).flat_map(|c| s.spatial(c)).collect::<Vec<f64>>();
        let sorted: Vec<f64> = match name {
            FieldName::Displacement => vectors(self, &self.displacements(u)),
            FieldName::Velocity if v.is_empty() => vec![0.0; n * words],
            FieldName::Velocity => vectors(self, &self.displacements(v)),
            FieldName::ForceDensity => {
                let mut f = vec![0.0; n * D];
                self.total_force(t, u, &mut f);
                (0..n * D).for_each(|q| f[q] /= self.body.measure()[q / D]);
                vectors(self, &f)
            }
            FieldName::Curvature => self.tensors(&self.body.curvatures(u)),
            FieldName::Moment => self.tensors(&self.body.moments(u)),
            FieldName::PlasticAngle => self.body.largest_plastic_angle(),
            FieldName::EnergyDensity => {
                let energies = self.body.family_energies(u);
                energies.iter().zip(self.body.measure()).map(|(e, m)| e / m).collect()
            }
            FieldName::Damage => self.body.health().iter().map(|h| 1.0 - h).collect(),
            FieldName::FamilySize => (0..n)
                .map(|p| {
                    let all = self.body.starts[p]..self.body.starts[p + 1];
                    all.filter(|&q| self.body.intact[q]).count() as f64
                })
                .collect(),
            FieldName::Material => (0..n).map(|p| self.data.material.get(p).map_or(0.0, |&m| f64::from(m))).collect(),
            FieldName::Id => (0..n).map(|p| self.describe(p * D).0 as f64).collect(),
            // strains and stresses through the thickness are not what pairs carry
            _ => vec![f64::NAN; n * words],
        };
        self.user_order(&sorted, words)
    }
    fn balance(&mut self, _: f64, u: &[f64], v: &[f64]) -> Balance {
        let n = self.body.points();
        let strain = self.body.energy(u);
        let mut balance = Balance { strain, external_work: self.work.done, ..Default::default() };
        if v.is_empty() {
            return balance;
        }
        let follows = |p: usize| self.body.dependent().get(p).copied().unwrap_or(false);
        balance.kinetic = ordered_sum(u.len(), |q| if follows(q / D) { 0.0 } else { 0.5 * self.mass[q] * v[q] * v[q] });
        for p in (0..n).filter(|&p| !follows(p)) {
            let x = self.body.layout().positions[p];
            let (u, w) = (self.spatial(&u[p * D..][..D]), self.spatial(&v[p * D..][..D]));
            let m = self.mass[p * D];
            for k in 0..3 {
                let (a, b) = ((k + 1) % 3, (k + 2) % 3);
                balance.momentum[k] += m * w[k];
                balance.angular_momentum[k] += m * ((x[a] + u[a]) * w[b] - (x[b] + u[b]) * w[a]);
            }
        }
        balance
    }
    fn condition_names(&self) -> Vec<String> {
        self.conditions.iter().map(|c| c.name.clone()).collect()
    }
    fn resultant(&mut self, condition: usize, t: f64, u: &[f64], _: Option<&[f64]>) -> [f64; 3] {
        let components = self.resultant_components(condition, t, u);
        self.spatial(&components)
    }
    fn damage(&self) -> (f64, Broken) {
        (self.body.health().iter().fold(0.0, |m: f64, h| m.max(1.0 - h)), self.broken)
    }
    fn evaluations(&self) -> (u64, u64) {
        self.evaluations
    }
    fn sizes(&self) -> (usize, usize, (usize, usize, usize)) {
        let n = self.body.points();
        (self.body.pair_count(), n.div_ceil(1024), (self.body.bytes(), n * (24 + 16 * D), 0))
    }
    fn describe_dof(&self, dof: usize) -> (u64, [f64; 3]) {
        self.describe(dof)
    }
    fn held_points(&self) -> usize {
        0
    }
}
