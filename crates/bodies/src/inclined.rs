//! Supports in any direction: points whose displacement is prescribed along unit vectors that are no axes of space (rollers on a slope,
//! planes of symmetry in any direction).
//!
//! At such a point solvers see components along axes of its own, the first of which span the prescribed directions: those are fixed dofs like any other, so
//! that every solver keeps its matrices symmetric and definite, and knows nothing of directions. [`Inclined`] stands between solvers and
//! body and turns the vectors and matrices of these points; everywhere else it hands on what it gets.

use crate::body::ordered_sum;
use crate::damage::Broken;
use crate::loads::Condition;
use crate::measures::FieldName;
use crate::structure::{Balance, Simulated, Structure};
use solvers::problem::{Dynamics, Statics, Stop};
use solvers::sparse::{BlockMatrix, BlockPattern};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Directions that differ by less from a combination of others add nothing to them.
pub const DEPENDENT: f64 = 1e-9;

/// Orthonormal axes of directions, and how values along the directions make values along the axes.
#[derive(Clone, Debug)]
pub struct Axes {
    /// The axes.
    pub axes: Vec<[f64; 3]>,
    /// Value along axis j = Σ_i `combine[j][i]` · value along direction i.
    pub combine: Vec<Vec<f64>>,
}

/// What a direction is to those before it.
pub enum Place {
    /// It adds an axis.
    New,
    /// It is a combination of them: the value along it is Σ_i of these factors times the values along directions i.
    Known(Vec<f64>),
}

impl Axes {
    /// No direction yet.
    pub fn new() -> Self {
        Axes { axes: vec![], combine: vec![] }
    }
    /// Adds direction number `i` (of length 1), by Gram and Schmidt.
    pub fn add(&mut self, i: usize, direction: [f64; 3]) -> Place {
        let mut rest = direction;
        let mut factors = vec![0.0; i + 1];
        for (axis, combine) in self.axes.iter().zip(&self.combine) {
            let along = dot(&direction, axis);
            (0..3).for_each(|k| rest[k] -= along * axis[k]);
            factors.iter_mut().zip(combine).for_each(|(f, c)| *f += along * c);
        }
        let length = dot(&rest, &rest).sqrt();
        if length < DEPENDENT {
            factors.pop();
            return Place::Known(factors);
        }
        self.axes.push(rest.map(|r| r / length));
        let mut combine: Vec<f64> = factors.iter().map(|f| -f / length).collect();
        combine[i] += 1.0 / length;
        self.combine.push(combine);
        Place::New
    }
}

impl Default for Axes {
    fn default() -> Self {
        Self::new()
    }
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The unit vector along a component that a condition prescribes: along its direction, or along an axis of space.
pub fn direction_of(condition: &Condition, component: usize) -> [f64; 3] {
    condition.along.unwrap_or_else(|| std::array::from_fn(|k| f64::from(u8::from(k == component))))
}

/// A point with prescribed directions.
pub(crate) struct Support<const D: usize> {
    pub point: usize,
    /// Orthonormal axes as rows.
    axes: [[f64; D]; D],
    /// How many of the axes are prescribed: the first.
    count: usize,
    /// What is prescribed: condition and component.
    given: Vec<(u32, usize)>,
    combine: Vec<Vec<f64>>,
    /// Whether displacements are prescribed, not velocities alone.
    displaced: bool,
}

impl<const D: usize> Support<D> {
    /// The supports of some conditions: all that is prescribed at the points that have a direction, axes of space included. What is prescribed
    /// twice is taken from the first.
    pub fn all(conditions: &[Condition]) -> Vec<Self> {
        let mut given: BTreeMap<u32, Vec<(u32, usize)>> = BTreeMap::new();
        for c in conditions.iter().filter(|c| c.prescribes() && c.along.is_some()) {
            for &p in &c.points {
                given.entry(p).or_default();
            }
        }
        for (n, c) in conditions.iter().enumerate().filter(|(_, c)| c.prescribes()) {
            for p in &c.points {
                if let Some(list) = given.get_mut(p) {
                    list.extend((0..D).filter(|&k| c.components[k].is_some()).map(|k| (n as u32, k)));
                }
            }
        }
        given.into_iter().map(|(point, given)| Self::new(point as usize, given, conditions)).collect()
    }

    fn new(point: usize, all: Vec<(u32, usize)>, conditions: &[Condition]) -> Self {
        let mut found = Axes::new();
        let mut given = vec![];
        for (n, k) in all {
            if let Place::New = found.add(given.len(), direction_of(&conditions[n as usize], k)) {
                given.push((n, k));
            }
        }
        let count = found.axes.len();
        // the rest of the axes: those of space, the least covered first
        while found.axes.len() < D {
            let covered = |k: usize| found.axes.iter().map(|a| a[k] * a[k]).sum::<f64>();
            let k = (0..D).min_by(|&a, &b| covered(a).total_cmp(&covered(b))).unwrap_or(0);
            found.add(found.combine.len(), std::array::from_fn(|q| f64::from(u8::from(q == k))));
        }
        let axes = std::array::from_fn(|j| std::array::from_fn(|k| found.axes[j][k]));
        found.combine.truncate(count);
        let displaced = given.iter().all(|g| matches!(conditions[g.0 as usize].kind, crate::loads::Kind::Displacement));
        Support { point, axes, count, given, combine: found.combine, displaced }
    }

    /// Components along x, y, z from those along the axes.
    fn to_space(&self, u: &mut [f64]) {
        let u = &mut u[self.point * D..][..D];
        let own: [f64; D] = std::array::from_fn(|j| u[j]);
        for (k, u) in u.iter_mut().enumerate() {
            *u = (0..D).map(|j| self.axes[j][k] * own[j]).sum();
        }
    }

    /// Components along the axes from those along x, y, z.
    fn to_axes(&self, f: &mut [f64]) {
        let f = &mut f[self.point * D..][..D];
        let space: [f64; D] = std::array::from_fn(|k| f[k]);
        for (f, axis) in f.iter_mut().zip(&self.axes) {
            *f = (0..D).map(|k| axis[k] * space[k]).sum();
        }
    }

    /// The part of a vector of the point along what is prescribed, given as components along x, y, z.
    pub fn prescribed_part(&self, f: &[f64]) -> [f64; D] {
        let mut out = [0.0; D];
        for axis in &self.axes[..self.count] {
            let along: f64 = (0..D).map(|k| axis[k] * f[k]).sum();
            (0..D).for_each(|k| out[k] += along * axis[k]);
        }
        out
    }

    /// What of a reaction of the point a condition exerts: its direction times the force that does work on the value that it prescribes.
    pub fn share(&self, condition: usize, conditions: &[Condition], reaction: &[f64]) -> [f64; D] {
        let mut out = [0.0; D];
        for (i, _) in self.given.iter().enumerate().filter(|(_, g)| g.0 as usize == condition) {
            let direction = direction_of(&conditions[condition], self.given[i].1);
            let mut force = 0.0;
            for (axis, combine) in self.axes[..self.count].iter().zip(&self.combine) {
                let along: f64 = (0..D).map(|k| axis[k] * reaction[k]).sum();
                force += along * combine.get(i).copied().unwrap_or(0.0);
            }
            (0..D).for_each(|k| out[k] += force * direction[k]);
        }
        out
    }
}

/// A [`Structure`] with supports in any direction, as solvers see it: displacements, velocities and forces of the supported points are
/// along axes of their own.
pub struct Inclined<const D: usize> {
    structure: Structure<D>,
    fixed: Vec<bool>,
    u: Vec<f64>,
    v: Vec<f64>,
}

impl<const D: usize> Inclined<D> {
    /// Stands between solvers and a structure.
    pub fn new(structure: Structure<D>) -> Self {
        let mut made = Inclined { fixed: vec![], u: vec![], v: vec![], structure };
        made.refresh();
        made
    }

    /// The structure.
    pub fn structure(&self) -> &Structure<D> {
        &self.structure
    }

    fn refresh(&mut self) {
        self.fixed.clear();
        self.fixed.extend_from_slice(Dynamics::fixed(&self.structure));
        for s in &self.structure.supports {
            // a fragment that is held is held in every direction
            self.fixed[s.point * D..][..s.count].fill(true);
        }
    }

    /// Calls with vectors along x, y, z.
    fn in_space<T>(&mut self, u: &[f64], v: &[f64], f: impl FnOnce(&mut Structure<D>, &[f64], &[f64]) -> T) -> T {
        let (mut here, mut there) = (std::mem::take(&mut self.u), std::mem::take(&mut self.v));
        for (space, own) in [(&mut here, u), (&mut there, v)] {
            space.clear();
            space.extend_from_slice(own);
            if !space.is_empty() {
                self.structure.supports.iter().for_each(|s| s.to_space(space));
            }
        }
        let out = f(&mut self.structure, &here, &there);
        (self.u, self.v) = (here, there);
        out
    }

    fn to_axes(&self, f: &mut [f64]) {
        self.structure.supports.iter().for_each(|s| s.to_axes(f));
    }

    /// Values along the axes of the supports, of displacements or velocities.
    fn prescribe_axes(&self, t: f64, out: &mut [f64], rate: bool) {
        for s in self.structure.supports.iter().filter(|s| rate || s.displaced) {
            if self.structure.is_held(s.point) {
                continue;
            }
            let values: Vec<f64> = s.given.iter().map(|&(c, k)| self.structure.prescribed_value(c, k, s.point, t, rate)).collect();
            for (j, combine) in s.combine.iter().enumerate() {
                out[s.point * D + j] = combine.iter().zip(&values).map(|(c, g)| c * g).sum();
            }
        }
    }
}

impl<const D: usize> Dynamics for Inclined<D> {
    fn dofs(&self) -> usize {
        Dynamics::dofs(&self.structure)
    }
    fn mass(&self) -> &[f64] {
        self.structure.mass()
    }
    fn fixed(&self) -> &[bool] {
        &self.fixed
    }
    fn force(&mut self, t: f64, u: &[f64], v: &[f64], f: &mut [f64]) -> Result<(), Stop> {
        self.in_space(u, v, |s, u, v| Dynamics::force(s, t, u, v, f))?;
        self.to_axes(f);
        Ok(())
    }
    fn prescribe_displacement(&mut self, t: f64, u: &mut [f64]) {
        self.structure.prescribe_displacement(t, u);
        self.prescribe_axes(t, u, false);
    }
    fn prescribe_velocity(&mut self, t: f64, v: &mut [f64]) {
        self.structure.prescribe_velocity(t, v);
        self.prescribe_axes(t, v, true);
    }
    fn step_limit(&mut self, t: f64, u: &[f64], v: &[f64], step: f64) -> Result<f64, Stop> {
        self.in_space(u, v, |s, u, v| s.step_limit(t, u, v, step))
    }
    fn hardness(&self) -> f64 {
        self.structure.hardness()
    }
    fn stiffens_by_breaking(&self) -> bool {
        self.structure.stiffens_by_breaking()
    }
    fn accept(&mut self, t: f64, u: &[f64], v: &[f64]) -> Result<bool, Stop> {
        self.in_space(u, v, |s, u, v| Dynamics::accept(s, t, u, v))
    }
    fn tangent_product(&mut self, t: f64, u: &[f64], x: &[f64], y: &mut [f64]) -> Result<(), Stop> {
        self.in_space(u, x, |s, u, x| Dynamics::tangent_product(s, t, u, x, y))?;
        self.to_axes(y);
        Ok(())
    }
}

impl<const D: usize> Statics for Inclined<D> {
    fn dofs(&self) -> usize {
        Statics::dofs(&self.structure)
    }
    fn dofs_per_point(&self) -> usize {
        D
    }
    fn positions(&self) -> &[f64] {
        self.structure.positions()
    }
    fn fixed(&self) -> &[bool] {
        &self.fixed
    }
    fn prescribe(&mut self, t: f64, u: &mut [f64]) {
        self.structure.prescribe(t, u);
        self.prescribe_axes(t, u, false);
    }
    fn force(&mut self, t: f64, u: &[f64], f: &mut [f64]) -> Result<(), Stop> {
        self.in_space(u, &[], |s, u, _| Statics::force(s, t, u, f))?;
        self.to_axes(f);
        Ok(())
    }
    fn energy(&mut self, t: f64, u: &[f64]) -> Option<f64> {
        self.in_space(u, &[], |s, u, _| s.energy(t, u))
    }
    fn tangent_product(&mut self, t: f64, u: &[f64], x: &[f64], y: &mut [f64]) -> Result<(), Stop> {
        self.in_space(u, x, |s, u, x| Statics::tangent_product(s, t, u, x, y))?;
        self.to_axes(y);
        Ok(())
    }
    fn pattern(&mut self) -> Option<Arc<BlockPattern>> {
        self.structure.pattern()
    }
    fn tangent(&mut self, t: f64, u: &[f64], matrix: &mut BlockMatrix) -> Result<(), Stop> {
        self.in_space(u, &[], |s, u, _| s.tangent(t, u, matrix))?;
        let supports = &self.structure.supports;
        matrix.turn(|p| supports.binary_search_by_key(&p, |s| s.point).ok().map(|k| supports[k].axes.as_flattened()));
        Ok(())
    }
    fn block_diagonal(&mut self, t: f64, u: &[f64], blocks: &mut [f64]) -> Result<(), Stop> {
        self.in_space(u, &[], |s, u, _| s.block_diagonal(t, u, blocks))?;
        for s in &self.structure.supports {
            let block = &mut blocks[s.point * D * D..][..D * D];
            let old = block.to_vec();
            for i in 0..D {
                for j in 0..D {
                    block[i * D + j] = (0..D * D).map(|q| s.axes[i][q / D] * old[q] * s.axes[j][q % D]).sum();
                }
            }
        }
        Ok(())
    }
    fn reach(&self) -> Option<f64> {
        self.structure.reach()
    }
    fn force_scale(&self) -> f64 {
        self.structure.force_scale()
    }
    fn break_bonds(&mut self, t: f64, u: &[f64]) -> Result<usize, Stop> {
        let broken = self.in_space(u, &[], |s, u, _| s.break_bonds(t, u));
        self.refresh();
        broken
    }
    fn first_failure(&mut self, t: f64, u: &[f64]) -> Result<Option<f64>, Stop> {
        self.in_space(u, &[], |s, u, _| s.first_failure(t, u))
    }
    fn accept(&mut self, t: f64, u: &[f64]) -> Result<(), Stop> {
        let accepted = self.in_space(u, &[], |s, u, _| Statics::accept(s, t, u));
        self.refresh();
        accepted
    }
    fn checkpoint(&mut self) {
        self.structure.checkpoint();
    }
    fn rollback(&mut self) {
        self.structure.rollback();
        self.refresh();
    }
}

impl<const D: usize> Simulated for Inclined<D> {
    fn set_statics(&mut self, statics: bool) {
        self.structure.set_statics(statics);
        self.refresh();
    }
    fn enter(&self, u: &mut [f64]) {
        self.to_axes(u);
    }
    fn field(&mut self, name: FieldName, t: f64, u: &[f64], v: &[f64]) -> Vec<f64> {
        self.in_space(u, v, |s, u, v| s.field(name, t, u, v))
    }
    fn balance(&mut self, t: f64, u: &[f64], v: &[f64]) -> Balance {
        self.in_space(u, v, |s, u, v| s.balance(t, u, v))
    }
    fn condition_names(&self) -> Vec<String> {
        self.structure.condition_names()
    }
    fn resultant(&mut self, condition: usize, t: f64, u: &[f64], v: Option<&[f64]>) -> [f64; 3] {
        let moving = v.is_some();
        self.in_space(u, v.unwrap_or(&[]), |s, u, v| s.resultant(condition, t, u, moving.then_some(v)))
    }
    fn damage(&self) -> (f64, Broken) {
        Simulated::damage(&self.structure)
    }
    fn evaluations(&self) -> (u64, u64) {
        Simulated::evaluations(&self.structure)
    }
    fn sizes(&self) -> (usize, usize, (usize, usize, usize)) {
        self.structure.sizes()
    }
    fn describe_dof(&self, dof: usize) -> (u64, [f64; 3]) {
        self.structure.describe_dof(dof)
    }
    fn held_points(&self) -> usize {
        Simulated::held_points(&self.structure)
    }
    fn closest_approach(&self) -> Option<f64> {
        self.structure.closest_approach()
    }
}

/// Square of the norm of the reactions of supports to forces along x, y, z.
pub(crate) fn squared_reactions<const D: usize>(supports: &[Support<D>], f: &[f64]) -> f64 {
    ordered_sum(supports.len(), |k| {
        let s = &supports[k];
        s.prescribed_part(&f[s.point * D..][..D]).iter().map(|r| r * r).sum()
    })
}
