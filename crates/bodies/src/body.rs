//! A discretised body: chunks of points, the parts that own their families, and the two exchanges between chunks.
//!
//! Everything that a solver evaluates goes through here: displacements go out to the chunks (with their halos and mirror
//! images), every part adds the forces of its families, and what landed on halos comes back in a fixed order. The number
//! of chunks depends on the body only, so results are the same bit for bit on any number of threads.

use crate::chunk::{Chunk, Link, MOST_LOCAL, Rows};
use crate::lattice::LatticePoints;
use crate::part::{Part, SEEDS};
use crate::scratch::{Scratch, Spaces};
use physics::scalar::{Dual, Jet, ROW, SPARE_WORD, Scalar};
use physics::tensor::Matrix;
use rayon::prelude::*;

/// Most neighbours of a point: a chunk of two points must be able to number them all.
pub const MOST_NEIGHBORS: usize = MOST_LOCAL / 2 - 1;

/// Points per chunk: large enough that halos stay small, small enough to occupy the threads of a small problem.
const CHUNK_POINTS: std::ops::RangeInclusive<usize> = 256..=8192;
/// Chunks that a body of moderate size is cut into. At the end of a loop a thread waits for the last chunk of another, half of one on average;
/// twice as many would halve that, and cost some hundredths of the time of one thread in halos.
const CHUNKS: usize = 32;

/// Forces of one chunk's halo that belong to another chunk's points.
struct Inflow {
    /// Chunk whose halo holds them.
    source: u32,
    runs: Vec<InflowRun>,
}

/// Places of a halo that are points in a row of another chunk.
struct InflowRun {
    /// First place in the halo, and first owned local index.
    halo: u16,
    owned: u16,
    length: u16,
    /// Reflected components.
    flip: u8,
}

impl Inflow {
    /// One more place of the halo, behind those that are here.
    fn push(&mut self, halo: usize, owned: usize, flip: u8) {
        if let Some(run) = self.runs.last_mut()
            && run.flip == flip
            && [run.halo, run.owned].map(|first| usize::from(first) + usize::from(run.length)) == [halo, owned]
        {
            run.length += 1;
            return;
        }
        self.runs.push(InflowRun { halo: halo as u16, owned: owned as u16, length: 1, flip });
    }

    /// Adds the forces on the halo to those of its points.
    fn add<const D: usize>(&self, out: &mut [f64], halo_force: &[f64]) {
        for run in &self.runs {
            let words = run.length as usize * D;
            let out = &mut out[run.owned as usize * D..][..words];
            let force = &halo_force[run.halo as usize * D..][..words];
            if run.flip == 0 {
                out.iter_mut().zip(force).for_each(|(o, f)| *o += f);
                continue;
            }
            for (o, f) in out.chunks_exact_mut(D).zip(force.chunks_exact(D)) {
                (0..D).for_each(|k| o[k] += if run.flip >> k & 1 == 1 { -f[k] } else { f[k] });
            }
        }
    }
}

/// Whether all materials of a chunk take their families from its lattice.
pub(crate) fn on_lattice<const D: usize>(parts: &[Box<dyn Part<D>>], chunk: usize, c: &Chunk<D>) -> bool {
    c.lattice.is_some() && parts.iter().all(|p| p.takes_lattice(chunk))
}

/// |Y|/|ξ| above which the stiffening of bonds that collapse is within the safety of an explicit step.
pub const STIFFENS: f64 = 0.95;

/// How bonds approach collapse.
#[derive(Clone, Copy, Debug)]
pub struct Approach {
    /// Smallest |Y|/|ξ|.
    pub ratio: f64,
    /// The points (sorted index) of that bond.
    pub pair: (usize, usize),
    /// Smallest |Y| over the speed at which it shrinks.
    pub time: f64,
    /// Smallest |Y| − [`STIFFENS`] |ξ|.
    pub gap: f64,
}

/// What a body is made of, in sorted order.
pub struct Geometry<'a> {
    /// Positions.
    pub position: &'a [[f64; 3]],
    /// Volumes (length × area, area × thickness, volume).
    pub volume: &'a [f64],
    /// Horizons.
    pub horizon: &'a [f64],
}

/// A body in `D` dimensions: `D` displacement components per point.
pub struct Body<const D: usize> {
    points: usize,
    /// Points of a chunk (the last may have fewer).
    chunk_points: usize,
    pub(crate) chunks: Vec<Chunk<D>>,
    inflow: Vec<Vec<Inflow>>,
    pub(crate) parts: Vec<Box<dyn Part<D>>>,
    position: Vec<[f64; 3]>,
    volume: Vec<f64>,
    /// Directed bonds of the reference body.
    bonds: usize,
    pub(crate) spaces: Spaces,
}

impl<const D: usize> Body<D> {
    /// Cuts the points into chunks and builds their arrays. `links` gives the family of a point (sorted index). The bonds store their
    /// influence where it is `weighted`, and their place in as many `sub_horizons`.
    ///
    /// # Panics
    /// If a family has more than [`MOST_NEIGHBORS`] points.
    pub fn new(g: &Geometry, weighted: bool, sub_horizons: usize, links: impl Fn(usize, &mut Vec<Link>) + Sync) -> Self {
        let points = g.position.len();
        let mut chunk_points = points.div_ceil(CHUNKS).clamp(*CHUNK_POINTS.start(), *CHUNK_POINTS.end());
        let chunks: Vec<Chunk<D>> = loop {
            let made: Option<_> = (0..points.div_ceil(chunk_points))
                .into_par_iter()
                .map_init(
                    || vec![u32::MAX; points],
                    |seen, k| {
                        let first = k * chunk_points;
                        let owned = chunk_points.min(points - first);
                        Chunk::new(first, owned, g.position, g.volume, g.horizon, weighted, sub_horizons, &links, seen)
                    },
                )
                .collect();
            match made {
                Some(chunks) => break chunks,
                // families so large that a chunk and its halo outgrow their numbers
                None => chunk_points = chunk_points.div_ceil(2),
            }
            assert!(chunk_points > 1, "a family of more than {MOST_NEIGHBORS} points");
        };
        let mut inflow: Vec<Vec<Inflow>> = (0..chunks.len()).map(|_| vec![]).collect();
        for (s, c) in chunks.iter().enumerate() {
            for l in c.owned..c.points.len() {
                let p = c.points[l] as usize;
                let target = p / chunk_points;
                if inflow[target].last().is_none_or(|i| i.source != s as u32) {
                    inflow[target].push(Inflow { source: s as u32, runs: vec![] });
                }
                inflow[target].last_mut().expect("just pushed").push(l - c.owned, p - target * chunk_points, c.flips[l]);
            }
        }
        let mut chunks = chunks;
        // the bonds of two mirror images to each other's points are one pair, but not opposite
        let once =
            g.horizon.iter().all(|h| *h == g.horizon[0]) && chunks.iter().all(|c| c.lattice.is_some() && c.flips.iter().all(|f| *f == 0));
        chunks.iter_mut().filter_map(|c| c.lattice.as_mut()).for_each(|l| l.once = once);
        let bonds = chunks.iter().map(|c| c.count.iter().map(|&n| n as usize).sum::<usize>()).sum();
        let (position, volume) = (g.position.to_vec(), g.volume.to_vec());
        Body { points, chunk_points, chunks, inflow, parts: vec![], position, volume, bonds, spaces: Spaces::default() }
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.points
    }
    /// Number of displacement components, `D` a point.
    pub fn dofs(&self) -> usize {
        self.points * D
    }
    /// Number of directed bonds of the reference body.
    pub fn bonds(&self) -> usize {
        self.bonds
    }
    /// Reference positions in sorted order.
    pub fn position(&self) -> &[[f64; 3]] {
        &self.position
    }
    /// Volumes in sorted order.
    pub fn volume(&self) -> &[f64] {
        &self.volume
    }
    /// Chunks, to assign parts to.
    pub fn chunks(&self) -> &[Chunk<D>] {
        &self.chunks
    }
    /// Number of chunks.
    pub fn chunk_count(&self) -> usize {
        self.chunks.len()
    }
    /// Bytes of bonds, points, and shapes with constants.
    pub fn bytes(&self) -> (usize, usize, usize) {
        let (b, p) = self.chunks.iter().map(Chunk::bytes).fold((0, 0), |a, c| (a.0 + c.0, a.1 + c.1));
        let exchange: usize = self.inflow.iter().flatten().map(|i| i.runs.len() * size_of::<InflowRun>()).sum();
        (b, p + exchange + self.points * 32, self.parts.iter().map(|q| q.bytes()).sum())
    }
    /// What the shapes of each material had to do without, and in how many families.
    pub fn shortfalls(&self) -> Vec<(String, &'static str, usize)> {
        self.parts.iter().flat_map(|p| p.shortfalls().into_iter().map(|(what, n)| (p.name().to_string(), what, n))).collect()
    }
    /// Whether the force is the derivative of an energy.
    pub fn is_conservative(&self) -> bool {
        self.parts.iter().all(|p| p.is_conservative())
    }

    /// Adds the parts, which must cover every point once, and computes their shapes on the unbroken families.
    ///
    /// # Errors
    /// The points (sorted index) whose family cannot carry their material.
    pub fn assign(&mut self, parts: Vec<Box<dyn Part<D>>>) -> Result<(), Vec<usize>> {
        self.parts = parts;
        let (mut point_words, mut bond_words, mut velocity) = (0, 0, false);
        for part in &self.parts {
            let (p, b) = part.memory_words();
            (point_words, bond_words) = (point_words.max(p), bond_words.max(b));
            velocity |= part.needs_velocity();
        }
        for c in &mut self.chunks {
            c.memory_words = point_words;
            c.memory = vec![0.0; point_words * c.owned];
            c.bond_memory = vec![0.0; bond_words * c.slot_count()];
            c.velocity = Rows::zeros(if velocity { c.points.len() * ROW } else { 0 });
        }
        let mut singular = vec![];
        for part in &mut self.parts {
            singular.extend(part.make_shapes(&self.chunks).into_iter().map(|(k, i)| self.chunks[k].first + i));
        }
        singular.sort_unstable();
        if !singular.is_empty() {
            return Err(singular);
        }
        for k in 0..self.chunks.len() {
            if !self.parts.iter().all(|p| p.takes_lattice(k)) {
                self.chunks[k].leave_lattice();
            }
        }
        if let [part] = self.parts.as_slice()
            && part.gathers()
        {
            let words = self.per_point(0.0, |k, c, out| {
                let view = c.configuration();
                (0..c.owned).for_each(|i| out[i] = part.state_word(k, i, &view));
            });
            for c in &mut self.chunks {
                if let Some(lattice) = &mut c.lattice {
                    lattice.set_words(|l| words[c.points[l] as usize]);
                    continue;
                }
                for (l, &p) in c.points.iter().enumerate() {
                    c.displacement[l * ROW + SPARE_WORD] = words[p as usize];
                }
            }
        }
        // what looks at bonds in every step keeps its lists
        if self.collapses() || (point_words, bond_words) != (0, 0) {
            self.chunks.par_iter_mut().for_each(|c| {
                c.make_lists();
            });
        }
        Ok(())
    }

    /// Goes over to lists everywhere, also where points lie on a lattice: for comparisons.
    pub fn leave_lattices(&mut self) {
        self.chunks.iter_mut().for_each(Chunk::leave_lattice);
    }

    /// Stores no lengths of bonds: eight bytes a bond less where points lie on no lattice, and longer force evaluations.
    pub fn forget_lengths(&mut self) {
        self.chunks.iter_mut().for_each(|c| c.length = vec![]);
    }

    /// The share of the points whose families come from a lattice.
    pub fn share_on_lattices(&self) -> f64 {
        let on = self.chunks.iter().enumerate().filter(|(k, c)| on_lattice(&self.parts, *k, c)).map(|(_, c)| c.owned).sum::<usize>();
        on as f64 / self.points.max(1) as f64
    }

    /// Sets time, and the temperature change at a reference position where there is one.
    pub fn set_time(&mut self, t: f64, temperature: Option<&(dyn Fn([f64; 3]) -> f64 + Sync)>) {
        self.chunks.iter_mut().for_each(|c| c.time = t);
        if let Some(change) = temperature {
            let position = &self.position;
            self.chunks.par_iter_mut().with_max_len(1).for_each(|c| {
                c.temperature.clear();
                c.temperature.extend(position[c.first..c.first + c.owned].iter().map(|&x| change(x)));
            });
        }
    }

    /// Hands displacements (and velocities, where a material looks at them) to the chunks, for what looks at single families after it.
    pub fn forward(&mut self, u: &[f64], v: Option<&[f64]>) {
        self.chunks.par_iter_mut().with_max_len(1).for_each(|c| {
            c.make_lists();
            c.forward(u, v);
        });
    }

    /// Internal forces \[N\] at displacements `u` (and velocities `v`), overwriting `force`.
    pub fn internal_force(&mut self, u: &[f64], v: Option<&[f64]>, force: &mut [f64]) {
        self.internal_force_watching(u, v, None, f64::INFINITY, force);
    }

    /// The same, where bonds are to be looked at that come near their critical stretch (per point), for
    /// [`exceeding_at_force`](Self::exceeding_at_force). Whether no displacement is beyond `limit`, and all forces are finite.
    pub fn internal_force_watching(
        &mut self,
        u: &[f64],
        v: Option<&[f64]>,
        critical: Option<&[f64]>,
        limit: f64,
        force: &mut [f64],
    ) -> bool {
        let within = |first: usize, force: &[f64]| {
            let sound = |u: f64, f: f64| (u.abs() <= limit) & (f.abs() < f64::INFINITY);
            u[first..].iter().zip(force).fold(true, |all, (u, f)| all & sound(*u, *f))
        };
        self.forces(force, within, |parts, k, c, scratch, out| {
            c.stretched.clear();
            if !on_lattice(parts, k, c) {
                c.make_lists();
                c.forward(u, v);
                let rows = scratch.force.at_least(c.points.len() * ROW);
                rows.fill(0.0);
                let view = c.configuration();
                for part in parts {
                    part.add_force(k, &view, rows);
                }
                for (f, row) in out.chunks_exact_mut(D).zip(rows.chunks_exact(ROW)) {
                    f.copy_from_slice(&row[..D]);
                }
                let owned = c.owned;
                for (f, row) in c.halo_force().chunks_exact_mut(D).zip(rows[owned * ROW..].chunks_exact(ROW)) {
                    f.copy_from_slice(&row[..D]);
                }
                return;
            }
            let Some(lattice) = c.lattice.take() else { return };
            lattice.fill(&c.points, &c.flips, u, scratch.displacement.at_least(lattice.words()));
            lattice.clear_force(scratch.force.at_least(lattice.words()));
            scratch.stretched.clear();
            let watch = critical.map(|critical| LatticePoints::<D>::growth_limit(c.least(critical)));
            for part in parts {
                part.add_force_on_lattice(k, &c.configuration(), &lattice, watch, scratch);
            }
            lattice.take_force(0, &scratch.force, out);
            lattice.take_force(c.owned, &scratch.force, c.halo_force());
            c.lattice = Some(lattice);
            c.note_stretched(&scratch.displacement, &scratch.stretched);
        })
    }

    /// Sums what the chunks compute for their own points and, in the order of the chunks, for each other's: `f` computes the force on the
    /// chunk's own points, and keeps that on its halo. Whether all sums are `sound`, given with their first dof.
    fn forces(
        &mut self,
        force: &mut [f64],
        sound: impl Fn(usize, &[f64]) -> bool + Sync,
        f: impl Fn(&[Box<dyn Part<D>>], usize, &mut Chunk<D>, &mut Scratch, &mut [f64]) + Sync,
    ) -> bool {
        self.spaces.ready();
        let (parts, spaces, words) = (&self.parts, &self.spaces, self.chunk_points * D);
        // chunk by chunk, or a thread that others interrupt would keep chunks that another has time for
        force.par_chunks_mut(words).zip(&mut self.chunks).enumerate().with_max_len(1).for_each(|(k, (out, c))| {
            f(parts, k, c, &mut spaces.own(), out);
        });
        let chunks = &self.chunks;
        let sums = force.par_chunks_mut(words).zip(&self.inflow).enumerate().with_max_len(1).map(|(k, (out, inflow))| {
            for flow in inflow {
                flow.add::<D>(out, &chunks[flow.source as usize].halo_force);
            }
            sound(k * words, out)
        });
        sums.reduce(|| true, |a, b| a & b)
    }

    /// `K x` with `K = −∂f/∂u` of the internal forces, exact.
    pub fn tangent_product(&mut self, u: &[f64], v: Option<&[f64]>, x: &[f64], out: &mut [f64]) {
        self.forces(
            out,
            |_, _| true,
            |parts, k, c, scratch, out| {
                let product = |c: &Chunk<D>, Scratch { dual_displacement: duals, dual_force: rows, .. }: &mut Scratch| {
                    rows.clear();
                    rows.resize(c.points.len() * ROW, Dual::of(0.0));
                    duals.resize(c.points.len() * ROW, Dual::of(0.0));
                    Chunk::<D>::fill_rows(&c.points, &c.flips, duals, |q| Dual { value: u[q], slope: [x[q]] });
                    let view = c.view(duals);
                    for part in parts {
                        part.add_force_dual(k, &view, rows);
                    }
                };
                c.listed(u, v, |c| product(c, scratch));
                for (f, row) in out.chunks_exact_mut(D).zip(scratch.dual_force.chunks_exact(ROW)) {
                    (0..D).for_each(|k| f[k] = -row[k].slope[0]);
                }
                let owned = c.owned;
                for (f, row) in c.halo_force().chunks_exact_mut(D).zip(scratch.dual_force[owned * ROW..].chunks_exact(ROW)) {
                    (0..D).for_each(|k| f[k] = -row[k].slope[0]);
                }
            },
        );
    }

    /// Gives back the memory of [`tangent_product`](Self::tangent_product), which takes it anew.
    pub(crate) fn forget_duals(&mut self) {
        self.spaces.forget_duals();
    }

    /// `K x` of the undeformed body by the vector kernel of the forces: they are linear in displacements so small that their squares are below
    /// round-off, and keep all digits of them. `false`, with nothing computed, where a material has a history or its temperature has changed:
    /// there the undeformed body has forces. Who calls this compares it with [`tangent_product`](Self::tangent_product) once.
    pub(crate) fn undeformed_product(&mut self, x: &[f64], scratch: &mut Vec<f64>, out: &mut [f64]) -> bool {
        /// Largest displacement, in horizons.
        const SMALL: f64 = 1e-14;
        let plain = self.parts.iter().all(|p| p.memory_words() == (0, 0));
        if !plain || self.chunks.iter().any(|c| c.temperature.iter().any(|t| *t != 0.0)) {
            return false;
        }
        let largest = x.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let horizon = self.chunks.iter().flat_map(|c| &c.horizon).fold(f64::INFINITY, |m: f64, h| m.min(*h));
        let scale = SMALL * horizon / largest;
        if !(scale.is_normal() && largest.is_normal()) {
            return false;
        }
        scratch.clear();
        scratch.extend(x.iter().map(|x| x * scale));
        self.internal_force(scratch, None, out);
        out.iter_mut().for_each(|f| *f /= -scale);
        true
    }

    /// Fills one entry per point from a computation per chunk.
    fn per_point<T: Send + Sync + Clone>(&self, nothing: T, f: impl Fn(usize, &Chunk<D>, &mut [T]) + Sync) -> Vec<T> {
        let mut out = vec![nothing; self.points];
        out.par_chunks_mut(self.chunk_points).zip(&self.chunks).enumerate().with_max_len(1).for_each(|(k, (out, c))| f(k, c, out));
        out
    }

    /// The same from lists, at displacements `u` and velocities `v`.
    fn per_point_at<T: Send + Sync + Clone>(
        &mut self,
        u: &[f64],
        v: Option<&[f64]>,
        nothing: T,
        f: impl Fn(&[Box<dyn Part<D>>], usize, &Chunk<D>, &mut [T]) + Sync,
    ) -> Vec<T> {
        let (mut out, parts) = (vec![nothing; self.points], &self.parts);
        let chunks = self.chunks.par_iter_mut().enumerate().with_max_len(1);
        out.par_chunks_mut(self.chunk_points).zip(chunks).for_each(|(out, (k, c))| c.listed(u, v, |c| f(parts, k, c, out)));
        out
    }

    /// Energy density per point at displacements `u`, sorted order.
    pub fn energy_density(&mut self, u: &[f64]) -> Vec<f64> {
        self.per_point_at(u, None, 0.0, |parts, k, c, out| {
            for part in parts {
                part.energy_density(k, &c.configuration(), out);
            }
        })
    }

    /// Strain energy \[J\].
    pub fn energy(&mut self, u: &[f64]) -> f64 {
        let density = self.energy_density(u);
        ordered_sum(self.points, |p| density[p] * self.volume[p])
    }

    /// First Piola stress `P = ∫ T ⊗ ξ dV′` per point, and the stress across the plane.
    ///
    /// For correspondence this is the law's stress; for the other models it is the collapsed stress of Silling & Lehoucq,
    /// J. Elasticity 93 (2008) 13–37.
    pub fn stress(&mut self, u: &[f64], v: Option<&[f64]>) -> (Vec<Matrix<f64, D>>, Vec<f64>) {
        let both = self.per_point_at(u, v, (Matrix::zero(), 0.0), |parts, k, c, out| {
            let (mut p, mut across) = (vec![Matrix::zero(); c.owned], vec![0.0; c.owned]);
            for part in parts {
                part.stress(k, &c.configuration(), &mut p, &mut across);
            }
            for (o, x) in out.iter_mut().zip(p.into_iter().zip(across)) {
                *o = x;
            }
        });
        both.into_iter().unzip()
    }

    /// Nonlocal deformation gradient minus 1 per point, as its material sees it: of the intact family with the influence of the material;
    /// of corrected correspondence with its weights, of sub-horizons the mean over them. Zero where the family is flat.
    pub fn displacement_gradient(&mut self, u: &[f64]) -> Vec<Matrix<f64, D>> {
        self.per_point_at(u, None, Matrix::zero(), |parts, k, c, out| {
            for part in parts {
                part.displacement_gradient(k, &c.configuration(), out);
            }
        })
    }

    /// Nonlocal strain of extended correspondence per point, NaN where the material is another.
    pub fn extended_strain(&mut self, u: &[f64]) -> Vec<Matrix<f64, D>> {
        self.per_point_at(u, None, Matrix::scaled_identity(f64::NAN), |parts, k, c, out| {
            for part in parts {
                part.extended_strain(k, &c.configuration(), out);
            }
        })
    }

    /// Whether breaking stiffens the bonds that are left in some material.
    pub fn is_rebuilt(&self) -> bool {
        self.parts.iter().any(|p| p.is_rebuilt())
    }

    /// Whether bonds of some material stiffen without bound as they collapse.
    pub fn collapses(&self) -> bool {
        self.parts.iter().any(|p| p.collapse())
    }

    /// Smallest |Y|/|ξ| of the intact bonds per point; 1 where none is left.
    pub fn min_bond_ratio(&mut self, u: &[f64]) -> Vec<f64> {
        self.per_point_at(u, None, 1.0, |_, _, c, out| {
            let view = c.configuration();
            for i in 0..c.owned {
                let mut least = f64::INFINITY;
                physics::family::Family::<f64, D>::new(&view, i).each(|b| {
                    least = least.min(1.0 + b.stretch().0);
                });
                if least.is_finite() {
                    out[i] = least;
                }
            }
        })
    }

    /// How the intact bonds approach collapse at `(u, v)`: of the materials whose bonds stiffen then, or of all; ties in sorted order.
    pub fn approach(&mut self, u: &[f64], v: &[f64], all: bool) -> Approach {
        let none = Approach { ratio: f64::INFINITY, pair: (0, 0), time: f64::INFINITY, gap: f64::INFINITY };
        let parts = &self.parts;
        let approach = |k: usize, c: &Chunk<D>| {
            let mut a = none;
            let view = c.configuration();
            for part in parts.iter().filter(|p| all || p.collapse()) {
                for &i in part.points(k) {
                    let near = (c.first + i as usize) * D;
                    physics::family::Family::<f64, D>::new(&view, i as usize).each(|b| {
                        let l = b.far() as usize;
                        let (far, flips) = (c.points[l] as usize * D, c.flips[l]);
                        let y = b.xi() + b.eta();
                        let (length, reference) = (y.norm(), b.xi().norm());
                        let ratio = length / reference;
                        // the reflected neighbour moves the other way
                        let closing: f64 = (0..D)
                            .map(|q| {
                                let far = if flips >> q & 1 == 1 { -v[far + q] } else { v[far + q] };
                                -y.0[q] * (far - v[near + q])
                            })
                            .sum();
                        if closing > 0.0 {
                            a.time = a.time.min(length * length / closing);
                        }
                        a.gap = a.gap.min(length - STIFFENS * reference);
                        if ratio < a.ratio || ratio.is_nan() {
                            (a.ratio, a.pair) = (ratio, (near / D, far / D));
                        }
                    });
                }
            }
            a
        };
        let each: Vec<Approach> =
            self.chunks.par_iter_mut().enumerate().with_max_len(1).map(|(k, c)| c.listed(u, None, |c| approach(k, c))).collect();
        each.into_iter().fold(none, |a, b| {
            let closest = if b.ratio < a.ratio || b.ratio.is_nan() { b } else { a };
            Approach { time: a.time.min(b.time), gap: a.gap.min(b.gap), ..closest }
        })
    }

    /// Damage per point: the share of the reference family's volume whose bonds are broken.
    pub fn damage(&self) -> Vec<f64> {
        self.per_point(0.0, |_, c, out| {
            // most families are whole, which is seen without looking at their bonds
            for i in (0..c.owned).filter(|&i| c.intact_bonds(i) < c.count[i] as usize) {
                let (mut all, mut broken) = (0.0, 0.0);
                for s in c.slots(i) {
                    let v = c.volume(c.far(i, s));
                    all += v;
                    if !c.is_intact(s) {
                        broken += v;
                    }
                }
                if all > 0.0 {
                    out[i] = broken / all;
                }
            }
        })
    }

    /// Intact bonds per point.
    pub fn family_size(&self) -> Vec<u32> {
        self.per_point(0, |_, c, out| {
            for i in 0..c.owned {
                out[i] = c.intact_bonds(i) as u32;
            }
        })
    }

    /// The reference family of a point (sorted index) as (ξ, V′), for calibrations.
    pub fn reference_family(&self, point: usize) -> Vec<([f64; 3], f64)> {
        let c = &self.chunks[point / self.chunk_points];
        let i = point - c.first;
        c.slots(i).map(|s| (c.xi(i, s), c.volume(c.far(i, s)))).collect()
    }

    /// Stored influence of the reference family of a point; ones where none is stored.
    pub fn reference_weights(&self, point: usize) -> Vec<f64> {
        let c = &self.chunks[point / self.chunk_points];
        let i = point - c.first;
        c.slots(i).map(|s| c.influence(i, s).unwrap_or(1.0)).collect()
    }

    /// Commits the history of the increment that ends at the displacements `u`.
    pub fn commit(&mut self, u: &[f64], v: Option<&[f64]>) {
        if self.parts.iter().all(|p| p.memory_words() == (0, 0)) {
            return;
        }
        self.forward(u, v);
        let parts = &self.parts;
        self.chunks.par_iter_mut().enumerate().with_max_len(1).for_each(|(k, c)| {
            for part in parts {
                part.commit(k, c);
            }
        });
    }

    /// The chunk that owns a point.
    pub(crate) fn chunk_of(&self, point: usize) -> &Chunk<D> {
        &self.chunks[point / self.chunk_points]
    }

    /// The distinct points each family couples, its own point first, the others by their bonds (see `ordered_slots`): `(starts, members)`.
    pub fn couplings(&self) -> (Vec<usize>, Vec<u32>) {
        let lists: Vec<(Vec<usize>, Vec<u32>)> = self
            .chunks
            .par_iter()
            .map(|c| {
                let (mut lengths, mut all) = (Vec::with_capacity(c.owned), Vec::with_capacity(c.slot_count() + c.owned));
                let mut scratch = MemberScratch::default();
                for i in 0..c.owned {
                    c.members(i, &mut scratch);
                    lengths.push(scratch.members.len());
                    all.extend(&scratch.members);
                }
                (lengths, all)
            })
            .collect();
        let mut starts = Vec::with_capacity(self.points + 1);
        starts.push(0);
        let mut members = Vec::with_capacity(lists.iter().map(|l| l.1.len()).sum());
        for (lengths, all) in lists {
            for length in lengths {
                starts.push(starts[starts.len() - 1] + length);
            }
            members.extend(all);
        }
        (starts, members)
    }

    /// Stiffness of the family of `point` over the points that [`couplings`](Self::couplings) lists for it, at the
    /// displacements last handed out by [`forward`](Self::forward): dense, row-major, overwritten.
    pub fn family_stiffness(&self, scratch: &mut StiffnessScratch<D>, point: usize, dense: &mut [f64]) {
        let (c, i) = self.bond_stiffness(scratch, point);
        c.expand(i, &scratch.bonds, &mut scratch.list, &mut scratch.sums, dense);
    }

    /// Stiffness of a family over its intact bonds, into `scratch.bonds`; its chunk and local index.
    fn bond_stiffness(&self, scratch: &mut StiffnessScratch<D>, point: usize) -> (&Chunk<D>, usize) {
        let k = point / self.chunk_points;
        let c = &self.chunks[k];
        if scratch.chunk != Some(k) {
            scratch.chunk = Some(k);
            scratch.jets.clear();
            scratch.jets.extend(c.displacement.iter().map(|&x| Jet::of(x)));
        }
        let i = point - c.first;
        scratch.bonds.clear();
        for part in &self.parts {
            part.family_stiffness(k, i, c, &mut scratch.jets, &mut scratch.bonds);
        }
        (c, i)
    }

    /// The diagonal D×D blocks of the stiffness at `u`, row-major, `D²` words a point.
    pub fn block_diagonal(&mut self, u: &[f64], out: &mut [f64]) {
        /// Families computed before they are added up.
        const WAVE: usize = 4096;
        self.forward(u, None);
        let alike = if self.is_undeformed() { self.alike() } else { vec![] };
        let first = |p: usize| alike.get(p).map_or(p, |&q| q as usize);
        // how often the blocks of a family serve after it
        let mut uses = vec![0u32; self.points];
        (0..self.points).for_each(|p| uses[first(p)] += 1);
        let body = &*self;
        let mut kept: std::collections::HashMap<usize, Vec<f64>> = Default::default();
        let mut scratch = MemberScratch::default();
        out.fill(0.0);
        for begin in (0..self.points).step_by(WAVE) {
            let wave = begin..self.points.min(begin + WAVE);
            let own: Vec<usize> = wave.clone().filter(|&p| first(p) == p).collect();
            let blocks: Vec<Vec<f64>> = own
                .par_iter()
                .map_init(StiffnessScratch::default, |scratch, &p| {
                    let mut blocks = vec![];
                    body.family_diagonal(scratch, p, &mut blocks);
                    blocks
                })
                .collect();
            kept.extend(own.into_iter().zip(blocks));
            // in the order of the families: the same sum on any number of threads
            for p in wave {
                let (q, c) = (first(p), body.chunk_of(p));
                let blocks = &kept[&q];
                c.members(p - c.first, &mut scratch);
                for (&j, block) in scratch.members.iter().zip(blocks.chunks(D * D)) {
                    out[j as usize * D * D..][..D * D].iter_mut().zip(block).for_each(|(o, x)| *o += x);
                }
                uses[q] -= 1;
                if uses[q] == 0 {
                    kept.remove(&q);
                }
            }
        }
    }

    /// Diagonal blocks of the stiffness of a family, of the points that [`couplings`](Self::couplings) lists for it.
    fn family_diagonal(&self, scratch: &mut StiffnessScratch<D>, point: usize, out: &mut Vec<f64>) {
        let (c, i) = self.bond_stiffness(scratch, point);
        let n = c.slots(i).len();
        let whole = c.slots(i).all(|s| c.is_intact(s)) && !c.meets_images(i);
        if !whole {
            // bonds that are missing, and points that are met twice: by way of the points
            c.members(i, &mut scratch.list);
            let m = scratch.list.members.len() * D;
            scratch.dense.resize(m * m, 0.0);
            c.expand(i, &scratch.bonds, &mut scratch.list, &mut scratch.sums, &mut scratch.dense);
            out.clear();
            for b in 0..m / D {
                (0..D).for_each(|k| out.extend(&scratch.dense[(b * D + k) * m + b * D..][..D]));
            }
            return;
        }
        c.ordered_slots(i, &mut scratch.list.slots, &mut scratch.list.keys);
        let (m, h) = (n * D, &scratch.bonds);
        out.clear();
        out.resize((n + 1) * D * D, 0.0);
        let (own, far) = out.split_at_mut(D * D);
        for b in 0..n {
            for k in 0..D {
                for row in h[(b * D + k) * m..][..m].chunks_exact(D) {
                    (0..D).for_each(|l| own[k * D + l] += row[l]);
                }
            }
        }
        // rows are in the order of the slots
        let first = c.slots(i).start;
        for (&s, block) in scratch.list.slots.iter().zip(far.chunks_exact_mut(D * D)) {
            let b = s as usize - first;
            for k in 0..D {
                block[k * D..(k + 1) * D].copy_from_slice(&h[(b * D + k) * m + b * D..][..D]);
            }
        }
    }
}

/// Work space of [`Body::family_stiffness`], one a thread. Holds displacements: make a new one when they change.
#[derive(Default)]
pub struct StiffnessScratch<const D: usize> {
    chunk: Option<usize>,
    jets: Vec<Jet<SEEDS>>,
    bonds: Vec<f64>,
    list: MemberScratch<D>,
    sums: Vec<f64>,
    dense: Vec<f64>,
}

/// The distinct points that a family couples.
#[derive(Default)]
struct MemberScratch<const D: usize> {
    slots: Vec<u32>,
    keys: Vec<([i64; D], u32)>,
    /// The points, the family's own first.
    members: Vec<u32>,
    /// For each entry of `slots` its place in `members`.
    place: Vec<u32>,
}

impl<const D: usize> Chunk<D> {
    fn members(&self, i: usize, out: &mut MemberScratch<D>) {
        let MemberScratch { slots, keys, members, place } = out;
        self.ordered_slots(i, slots, keys);
        members.clear();
        place.clear();
        let own = self.points[i];
        members.push(own);
        let end = |s: &u32| self.points[self.far(i, *s as usize)];
        if !self.meets_images(i) {
            members.extend(slots.iter().map(end));
            place.extend(1..=slots.len() as u32);
            return;
        }
        members.extend(slots.iter().map(end).filter(|&p| p != own));
        members[1..].sort_unstable();
        members.dedup();
        let find = |p: u32| if p == own { 0 } else { 1 + members[1..].binary_search(&p).expect("listed above") as u32 };
        place.extend(slots.iter().map(|s| find(end(s))));
    }

    /// From bonds to points: the stiffness of a family over its own point and the distinct far points (broken ones keep
    /// zero rows), mirror images folded onto their points.
    fn expand(&self, i: usize, bonds: &[f64], list: &mut MemberScratch<D>, sums: &mut Vec<f64>, dense: &mut [f64]) {
        self.members(i, list);
        let n = list.members.len() * D;
        dense.fill(0.0);
        // by slot: the rows of `bonds` are the intact bonds in that order
        let first = self.slots(i).start;
        let mut to = vec![(0usize, 0u8); list.slots.len()];
        for (&s, &place) in list.slots.iter().zip(&list.place) {
            to[s as usize - first] = (place as usize * D, self.flips[self.far(i, s as usize)]);
        }
        let intact: Vec<(usize, u8)> = self.slots(i).filter(|&s| self.is_intact(s)).map(|s| to[s - first]).collect();
        let m = intact.len() * D;
        let sign = |flips: u8, k: usize| if flips >> k & 1 == 1 { -1.0 } else { 1.0 };
        // Y = ±u_far − u_own: the own point's columns and rows are minus the sums
        sums.clear();
        sums.resize(D * n, 0.0);
        for (b, &(row, flips_b)) in intact.iter().enumerate() {
            for k in 0..D {
                let source = &bonds[(b * D + k) * m..][..m];
                let own = sign(flips_b, k);
                let target = &mut dense[(row + k) * n..][..n];
                let mut row_sum = [0.0; D];
                for (&(column, flips_c), h) in intact.iter().zip(source.as_chunks::<D>().0) {
                    for l in 0..D {
                        let h = if flips_b | flips_c == 0 { h[l] } else { own * sign(flips_c, l) * h[l] };
                        target[column + l] += h;
                        sums[k * n + column + l] -= own * h;
                    }
                    for l in 0..D {
                        row_sum[l] += h[l];
                    }
                }
                for l in 0..D {
                    target[l] -= own * row_sum[l];
                    sums[k * n + l] += row_sum[l];
                }
            }
        }
        for (d, s) in dense[..D * n].iter_mut().zip(sums.iter()) {
            *d += s;
        }
    }
}

/// A sum over points in fixed blocks: the same bits on any number of threads.
pub fn ordered_sum(n: usize, f: impl Fn(usize) -> f64 + Sync) -> f64 {
    const BLOCK: usize = 4096;
    /// Most blocks: their sums live on the stack.
    const MOST: usize = 256;
    let block = BLOCK.max(n.div_ceil(MOST));
    let mut sums = [0.0; MOST];
    let sums = &mut sums[..n.div_ceil(block)];
    sums.par_iter_mut().enumerate().for_each(|(b, sum)| *sum = (b * block..n.min((b + 1) * block)).map(&f).sum());
    sums.iter().sum()
}
