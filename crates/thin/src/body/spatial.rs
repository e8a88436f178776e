//! Pairs in space without a normal: unsigned angles where they are elastic, turning vectors where they yield.

use super::*;
use crate::turn::{self, Basis, Response};

impl<const D: usize> Thin<D> {
    /// Axis of a straight beam in space and two directions across it, in which turning vectors are measured.
    pub(super) fn basis(&self) -> Option<Basis> {
        if D != 3 || self.frames.is_some() || !self.layout.is_lattice() || self.layout.dimension != 1 {
            return None;
        }
        let (axis, across) = (self.layout.rows[0], self.layout.normal);
        Some([axis, across, frame::cross(&axis, &across)])
    }

    /// The basis, where the pairs of a point yield.
    pub(super) fn yielding_basis(&self, point: usize) -> Option<Basis> {
        if matches!(self.law_of(point), Law::Elastic(_)) { None } else { self.basis() }
    }

    /// Plastic angles that a pair keeps: a vector of two components in space.
    pub(super) fn plastic_words(&self) -> usize {
        if self.basis().is_some() { 2 } else { 1 }
    }

    /// Turning vector of pair `q` of a point, and the response to it.
    fn vector_response(&self, basis: &Basis, point: usize, q: usize, plus: &V3, minus: &V3) -> Response {
        let pair = &self.pairs[q];
        let turned = turn::turning(basis, &self.arms[pair.arm as usize].vector, plus, minus);
        let before = if self.law_of(point).has_history() { [self.plastic[2 * q], self.plastic[2 * q + 1]] } else { [0.0; 2] };
        turn::respond(pair, turned, before)
    }

    /// Pairs in space: energy and forces on the ends; the isotropic term with the mean curvature as a vector.
    pub(super) fn spatial_family(
        &self,
        point: usize,
        u: &[f64],
        centre: &[f64; D],
        rows: &mut Option<(&mut [f64], usize)>,
        at_centre: &mut [f64; D],
    ) -> f64 {
        let (mut energy, potential, basis) = (0.0, self.potential(point), self.yielding_basis(point));
        let range = self.starts[point]..self.starts[point + 1];
        let c = self.isotropic[point];
        let mut mean = [0.0; D];
        if c != 0.0 {
            for q in range.clone().filter(|&q| self.intact[q]) {
                let pair = &self.pairs[q];
                let (p, m) = self.differences(pair, centre, u);
                let weight = pair.isotropic / self.arms[pair.arm as usize].length;
                (0..D).for_each(|k| mean[k] += weight * (p[k] + m[k]));
            }
            energy += c * mean.iter().map(|x| x * x).sum::<f64>();
        }
        for q in range.filter(|&q| self.intact[q]) {
            let pair = &self.pairs[q];
            let arm = &self.arms[pair.arm as usize];
            let (p, m) = self.differences(pair, centre, u);
            let (p3, m3) = (three(&p), three(&m));
            let response = basis.as_ref().map(|b| (b, self.vector_response(b, point, q, &p3, &m3)));
            energy += match &response {
                Some((_, r)) => r.energy,
                None => pair.stiffness * angle::spatial_energy(potential, &arm.vector, &p3, &m3),
            };
            if let Some((rows, first)) = rows {
                let (gp, gm) = match &response {
                    Some((basis, r)) => turn::gradient(basis, &r.force, &arm.vector, &p3, &m3),
                    None => {
                        let (gp, gm) = angle::spatial_gradient(potential, &arm.vector, &p3, &m3);
                        (gp.map(|x| pair.stiffness * x), gm.map(|x| pair.stiffness * x))
                    }
                };
                let weight = 2.0 * c * pair.isotropic / arm.length;
                let (mut fp, mut fm) = ([0.0; D], [0.0; D]);
                for k in 0..D {
                    fp[k] = -gp[k] - weight * mean[k];
                    fm[k] = -gm[k] - weight * mean[k];
                    at_centre[k] -= fp[k] + fm[k];
                }
                self.ends.scatter(pair.plus, &fp, rows, *first);
                self.ends.scatter(pair.minus, &fm, rows, *first);
            }
        }
        energy
    }

    /// Second derivatives of the energy of pair `q` with respect to its ends, that of the isotropic term excluded.
    pub(super) fn spatial_hessian(&self, point: usize, q: usize, plus: &V3, minus: &V3) -> [[f64; 6]; 6] {
        let pair = &self.pairs[q];
        let arm = &self.arms[pair.arm as usize].vector;
        let Some(basis) = self.yielding_basis(point) else {
            return angle::spatial_second(self.potential(point), arm, plus, minus).map(|row| row.map(|x| pair.stiffness * x));
        };
        let r = self.vector_response(&basis, point, q, plus, minus);
        let mut h = turn::second(&basis, &r.force, arm, plus, minus);
        let of = |g: [f64; 2]| -> [f64; 6] {
            let (p, m) = turn::gradient(&basis, &g, arm, plus, minus);
            [p[0], p[1], p[2], m[0], m[1], m[2]]
        };
        let slopes = [of([1.0, 0.0]), of([0.0, 1.0])];
        for i in 0..6 {
            for j in 0..6 {
                for k in 0..2 {
                    for l in 0..2 {
                        h[i][j] += r.tangent[k][l] * slopes[k][i] * slopes[l][j];
                    }
                }
            }
        }
        h
    }

    /// Commits the plastic angles of pairs in space.
    pub(super) fn commit_vectors(&mut self, basis: &Basis, u: &[f64]) {
        // (each pair reads its own words alone)
        let mut plastic = self.plastic.clone();
        for point in (0..self.points()).filter(|&p| self.law_of(p).has_history()) {
            let centre = self.ends.value(point as u32, u);
            for q in (self.starts[point]..self.starts[point + 1]).filter(|&q| self.intact[q]) {
                let (p, m) = self.differences(&self.pairs[q], &centre, u);
                plastic[2 * q..2 * q + 2].copy_from_slice(&self.vector_response(basis, point, q, &three(&p), &three(&m)).plastic);
            }
        }
        self.plastic = plastic;
    }

    /// Turning angles and moments of the pairs of a point of a beam in space, along both directions of the basis.
    pub(super) fn vector_forces(&self, basis: &Basis, point: usize, u: &[f64], angles: &mut [Vec<f64>; 2], forces: &mut [Vec<f64>; 2]) {
        let centre = self.ends.value(point as u32, u);
        for list in angles.iter_mut().chain(forces.iter_mut()) {
            list.clear();
        }
        for q in self.starts[point]..self.starts[point + 1] {
            let pair = &self.pairs[q];
            let (p, m) = self.differences(pair, &centre, u);
            let (p, m) = (three(&p), three(&m));
            let turned = turn::turning(basis, &self.arms[pair.arm as usize].vector, &p, &m);
            let force = match self.law_of(point) {
                _ if !self.intact[q] => [0.0; 2],
                Law::Elastic(potential) => {
                    let size = turned[0].hypot(turned[1]);
                    let secant = if potential == Potential::Cosine && size > 0.0 { size.sin() / size } else { 1.0 };
                    turned.map(|t| pair.stiffness * secant * t)
                }
                _ => self.vector_response(basis, point, q, &p, &m).force,
            };
            for k in 0..2 {
                angles[k].push(turned[k]);
                forces[k].push(force[k]);
            }
        }
    }
}
