//! A part: a material and the points it is assigned to. The loops over families are here, written once for every model.

use crate::chunk::Chunk;
use crate::lattice::{Group, LatticePoints, NOBODY};
use crate::scratch::Scratch;
use crate::shared::{Distinct, Shared, by_cells};
use physics::family::{Bond, Configuration, Family, Place, Reference, Undeformed};
use physics::lanes::{Abreast, GroupKernel, Kernel, WIDTH, widest, widest_abreast};
use physics::material::Material;
use physics::scalar::{Dual, Jet, ROW, Record, Scalar, VOLUME_WORD, lift};
use physics::tensor::{Linear, Matrix, Vector};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::OnceLock;

/// Derivatives taken at a time when a family's stiffness is computed.
pub(crate) const SEEDS: usize = 8;

/// The constants of a material at its points.
#[derive(Clone, Debug)]
pub enum Constants<C> {
    /// The same everywhere.
    Uniform(C),
    /// One for each point of the body, in sorted order.
    PerPoint(Vec<C>),
}

impl<C> Constants<C> {
    /// The constants of a point (sorted index).
    #[inline(always)]
    pub fn at(&self, point: usize) -> &C {
        match self {
            Constants::Uniform(c) => c,
            Constants::PerPoint(v) => &v[point],
        }
    }
}

/// Does something for each number below `count`, in any order. Compiled once, where a parallel iterator is compiled for every model.
fn in_parallel(count: usize, each: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().for_each(each);
}

/// A material on some of the points of a body, whatever the model. Chunks are given by number with their views.
pub trait Part<const D: usize>: Send + Sync {
    /// Name of the material.
    fn name(&self) -> &str;
    /// Words of history per point and per bond.
    fn memory_words(&self) -> (usize, usize);
    /// Whether the force depends on velocities.
    fn needs_velocity(&self) -> bool;
    /// Whether the force is the derivative of an energy.
    fn is_conservative(&self) -> bool;
    /// Whether families of equal shape have equal forces: the same constants everywhere, and no history.
    fn is_uniform(&self) -> bool;
    /// Whether the bonds must store the influence.
    fn stores_influence(&self) -> bool;
    /// The points of each chunk that the part owns families of (local index).
    fn points(&self, chunk: usize) -> &[u32];
    /// Computes all shapes. Returns the points (chunk, local) whose family cannot carry the model.
    fn make_shapes(&mut self, chunks: &[Chunk<D>]) -> Vec<(usize, usize)>;
    /// Computes the shape of one family again, after bonds broke. `false` where it has become singular.
    fn reshape(&mut self, chunk: usize, point: usize, c: &Configuration<f64>) -> bool;
    /// Energy density of one family, if it is the part's.
    fn energy_density_at(&self, chunk: usize, point: usize, c: &Configuration<f64>) -> Option<f64>;
    /// A copy of the shapes, to go back to.
    fn save_shapes(&mut self);
    /// Back to the saved shapes.
    fn restore_shapes(&mut self);
    /// Adds the force densities × volumes of the part's families to the rows of all local points \[N\].
    fn add_force(&self, chunk: usize, c: &Configuration<f64>, force: &mut [f64]);
    /// Whether the part takes the families of a chunk from its lattice.
    fn takes_lattice(&self, chunk: usize) -> bool;
    /// The same as [`add_force`](Self::add_force) in planes, where all parts take the lattice. Where there is a `watch`, bonds with
    /// |Y|² − |ξ|² above it times |ξ|² are added to `stretched`, one of the two of a pair at least.
    fn add_force_on_lattice(
        &self,
        chunk: usize,
        c: &Configuration<f64>,
        lattice: &LatticePoints<D>,
        watch: Option<f64>,
        scratch: &mut Scratch,
    );
    /// The same with a derivative along a direction.
    fn add_force_dual(&self, chunk: usize, c: &Configuration<Dual>, force: &mut [Dual]);
    /// Energy density of the part's families, into the entries of owned points.
    fn energy_density(&self, chunk: usize, c: &Configuration<f64>, out: &mut [f64]);
    /// First Piola stress `∫ T ⊗ ξ dV′` and stress across the plane, into the entries of owned points.
    fn stress(&self, chunk: usize, c: &Configuration<f64>, out: &mut [Matrix<f64, D>], across: &mut [f64]);
    /// `T⟨ξ⟩·η/2` of each bond of one family, if it is the part's: slots and values, appended.
    fn half_bond_energies_at(&self, chunk: usize, point: usize, c: &Configuration<f64>, out: &mut Vec<(usize, f64)>);
    /// Stiffness of one family, if it is the part's: `H[(b,k),(c,l)] = V V_b ∂T_b,k/∂Y_c,l` over its intact bonds, row-major, into `out` (resized).
    /// `u` are displacements without derivatives, restored before return.
    fn family_stiffness(&self, chunk: usize, point: usize, arrays: &Chunk<D>, u: &mut [Jet<SEEDS>], out: &mut Vec<f64>);
    /// Writes the history of an accepted increment.
    fn commit(&self, chunk: usize, arrays: &mut Chunk<D>);
    /// Whether the part covers the body and sums both halves of its pairs at each point, given that every bond has its opposite.
    /// It then wants its points' state in the spare words of the displacements: see [`state_word`](Self::state_word).
    fn gathers(&self) -> bool;
    /// The state of an owned point of a pairwise model, which is fixed with its shape.
    fn state_word(&self, chunk: usize, point: usize, c: &Configuration<f64>) -> f64;
    /// Whether bonds stiffen without bound as they collapse: see [`Material::collapse`].
    fn collapse(&self) -> bool;
    /// Whether breaking stiffens the bonds that are left: see [`Material::rebuilds`].
    fn is_rebuilt(&self) -> bool;
    /// `F − 1` as the material sees it, into the entries of owned points.
    fn displacement_gradient(&self, chunk: usize, c: &Configuration<f64>, out: &mut [Matrix<f64, D>]);
    /// The nonlocal strain of extended correspondence, into the entries of owned points of such a material.
    fn extended_strain(&self, chunk: usize, c: &Configuration<f64>, out: &mut [Matrix<f64, D>]);
    /// Sub-horizons whose membership the bonds must store.
    fn sub_horizons(&self) -> usize;
    /// What the shapes had to do without, and in how many families.
    fn shortfalls(&self) -> BTreeMap<&'static str, usize>;
    /// Bytes of shapes and constants.
    fn bytes(&self) -> usize;
}

/// A material of a known type on its points.
pub struct Assigned<M: Material<D>, const D: usize> {
    name: String,
    material: M,
    constants: Constants<M::Constants>,
    /// Local indices per chunk, and the sorted index of the chunk's first point.
    points: Vec<(usize, Vec<u32>)>,
    /// Position of each owned point among the part's points, per chunk.
    place: Vec<Vec<u32>>,
    shapes: Vec<Shared<M::Shape>>,
    saved: Vec<Shared<M::Shape>>,
    /// Pairwise, with a radial influence and one horizon for the whole body.
    gathers: bool,
    /// On lattices: the groups of each chunk, and which of their points are the part's.
    groups: Vec<Vec<(u32, u8)>>,
    /// Chunks with a shape that is treated otherwise: see [`Material::is_regular`].
    irregular: Vec<bool>,
}

impl<M: Material<D>, const D: usize> Assigned<M, D> {
    /// Assigns a material to points given by sorted index.
    pub fn new(name: impl Into<String>, material: M, constants: Constants<M::Constants>, points: &[u32], chunks: &[Chunk<D>]) -> Self {
        let mut sorted = points.to_vec();
        sorted.sort_unstable();
        let mut part = Assigned {
            name: name.into(),
            material,
            constants,
            points: vec![],
            place: vec![],
            shapes: vec![],
            saved: vec![],
            gathers: false,
            groups: vec![],
            irregular: vec![],
        };
        for c in chunks {
            let a = sorted.partition_point(|&p| (p as usize) < c.first);
            let z = sorted.partition_point(|&p| (p as usize) < c.first + c.owned);
            let own: Vec<u32> = sorted[a..z].iter().map(|&p| p - c.first as u32).collect();
            let mut place = vec![u32::MAX; c.owned];
            for (q, &i) in own.iter().enumerate() {
                place[i as usize] = q as u32;
            }
            let groups = c.lattice.iter().flat_map(|l| l.groups.iter().enumerate()).map(|(g, group)| {
                let mine = |l: usize| group.points[l] != NOBODY && place[group.points[l] as usize] != u32::MAX;
                (g as u32, (0..WIDTH).fold(0, |lanes, l| lanes | u8::from(mine(l)) << l))
            });
            part.groups.push(groups.filter(|g| g.1 != 0).collect());
            part.points.push((c.first, own));
            part.place.push(place);
            part.irregular.push(false);
        }
        let horizon = chunks.first().and_then(|c| c.horizon.first());
        part.gathers = M::PAIRWISE
            && !M::STORED_INFLUENCE
            && sorted.len() == chunks.iter().map(|c| c.owned).sum::<usize>()
            && chunks.iter().all(|c| c.horizon.iter().all(|h| Some(h) == horizon));
        part
    }

    fn find_irregular(&mut self) {
        for (irregular, shapes) in self.irregular.iter_mut().zip(&self.shapes) {
            *irregular = shapes.iter().any(|s| !self.material.is_regular(s));
        }
    }

    #[inline(always)]
    fn each(&self, chunk: usize, mut f: impl FnMut(usize, &M::Constants, &M::Shape)) {
        let (first, points) = &self.points[chunk];
        for (&i, shape) in points.iter().zip(self.shapes[chunk].iter()) {
            f(i as usize, self.constants.at(first + i as usize), shape);
        }
    }

    /// Constants and shape of a point, if it is the part's.
    fn own(&self, chunk: usize, point: usize) -> Option<(&M::Constants, &M::Shape)> {
        let place = self.place[chunk][point];
        (place != u32::MAX).then(|| (self.constants.at(self.points[chunk].0 + point), &self.shapes[chunk][place as usize]))
    }

    /// THE loop: each point evaluates its force state on its own family; `f_i += T⟨ξ⟩ V_i V_j`, `f_j −= T⟨ξ⟩ V_i V_j`.
    #[inline(always)]
    fn scatter<S: Scalar>(&self, chunk: usize, c: &Configuration<S::Sum>, force: &mut [S::Sum]) {
        self.each(
            chunk,
            #[inline(always)]
            |i, constants, shape| {
                let family = Family::<S, D>::new(c, i);
                let state: M::State<S> = lift::<S, _, _>(&self.material.state(constants, shape, family));
                let near = S::of(c.coordinates[i * ROW + VOLUME_WORD]);
                let mut own = <Vector<S, D> as Linear<S>>::nothing();
                family.each(
                    #[inline(always)]
                    |b| {
                        let pair = self.material.force(&state, b) * (b.volume() * near);
                        own.add_times(S::of(1.0), pair);
                        S::subtract_rows(force, b.far(), pair.0);
                    },
                );
                let own = own.total();
                for k in 0..D {
                    force[i * ROW + k] += own.0[k];
                }
            },
        );
    }
}

impl<M: Material<D>, const D: usize> Assigned<M, D> {
    /// The same for pairwise models: `f_i = Σ (T_i⟨ξ⟩ − T_j⟨−ξ⟩) V_i V_j`, where the second half is the first with the neighbour's
    /// state. A third fewer loads and no stores a bond.
    #[inline(always)]
    fn gather<S: Scalar<Sum = f64>>(&self, chunk: usize, c: &Configuration<f64>, force: &mut [f64]) {
        self.each(
            chunk,
            #[inline(always)]
            |i, constants, shape| {
                let family = Family::<S, D>::new(c, i);
                let own: M::State<S::Sum> = self.material.state(constants, shape, family);
                let own = S::of(own.word(0));
                let sum: Vector<f64, D> = family.integrate(
                    #[inline(always)]
                    |b| {
                        let both = own + b.far_word();
                        let state = <M::State<S> as Record<S>>::read(
                            #[inline(always)]
                            |_| both,
                            0,
                        );
                        self.material.force(&state, b)
                    },
                );
                let near = c.coordinates[i * ROW + VOLUME_WORD];
                for k in 0..D {
                    force[i * ROW + k] += sum.0[k] * near;
                }
            },
        );
    }
}

/// The points of two groups that are taken abreast.
struct TwoGroups<'a> {
    chunk: usize,
    c: &'a Configuration<'a, f64>,
    groups: [&'a Group; 2],
    /// A bit for each of the part's points.
    lanes: u16,
}
impl TwoGroups<'_> {
    /// Calls `f` with each lane and its point.
    #[inline(always)]
    fn each<S: Abreast>(&self, mut f: impl FnMut(usize, usize)) {
        for l in (0..S::GROUPS * WIDTH).filter(|l| self.lanes >> l & 1 == 1) {
            f(l, self.groups[l / WIDTH].points[l % WIDTH] as usize);
        }
    }
    /// One record of all lanes.
    #[inline(always)]
    fn together<S: Abreast, A: Record<f64>, B: Record<S>>(records: &[A; 2 * WIDTH]) -> B {
        B::read(
            #[inline(always)]
            |k| {
                S::of_lanes(
                    #[inline(always)]
                    |l| records[l].word(k),
                )
            },
            0,
        )
    }
    /// A record of zeros.
    #[inline(always)]
    fn nothing<A: Record<f64>>() -> A {
        A::read(
            #[inline(always)]
            |_| 0.0,
            0,
        )
    }
}

impl<M: Material<D>, const D: usize> Assigned<M, D> {
    /// What the integrals must know of the shapes.
    #[inline(always)]
    fn weights_of<S: Abreast>(&self, points: &TwoGroups) -> M::Weights<S> {
        let (place, shapes) = (&self.place[points.chunk], &self.shapes[points.chunk]);
        let mut weights = [TwoGroups::nothing::<M::Weights<f64>>(); 2 * WIDTH];
        if <M::Weights<f64> as Record<f64>>::WORDS > 0 {
            points.each::<S>(
                #[inline(always)]
                |l, i| weights[l] = self.material.weights(&shapes[place[i] as usize]),
            );
        }
        TwoGroups::together(&weights)
    }

    /// What families reduce to: shapes and laws are of one point at a time.
    #[inline(always)]
    fn states_of<S: Abreast>(&self, points: &TwoGroups, moments: &M::Moments<S>) -> M::State<S> {
        let chunk = points.chunk;
        let (first, place, shapes) = (self.points[chunk].0, &self.place[chunk], &self.shapes[chunk]);
        let mut states = [TwoGroups::nothing::<M::State<f64>>(); 2 * WIDTH];
        points.each::<S>(
            #[inline(always)]
            |l, i| {
                let moments = <M::Moments<f64> as Record<f64>>::read(
                    #[inline(always)]
                    |k| moments.word(k).lane(l),
                    0,
                );
                let shape = &shapes[place[i] as usize];
                states[l] = self.material.state_of(self.constants.at(first + i), shape, &moments, Place::new(points.c, i));
            },
        );
        TwoGroups::together(&states)
    }
}

/// The same loops with points of a lattice abreast.
struct OnLattice<'a, M: Material<D>, const D: usize> {
    part: &'a Assigned<M, D>,
    chunk: usize,
    c: &'a Configuration<'a, f64>,
    lattice: &'a LatticePoints<D>,
    watch: Option<f64>,
    scratch: &'a mut Scratch,
}

impl<M: Material<D>, const D: usize> OnLattice<'_, M, D> {
    #[inline(always)]
    fn run<S: Abreast>(self) {
        let (lattice, material) = (self.lattice, &self.part.material);
        let n = lattice.cells();
        let Scratch { displacement, force, stretched, .. } = self.scratch;
        let (planes, c) = (&mut force[..], lattice.configuration::<S>(displacement));
        // each pair at one of its ends
        let once = M::PAIRWISE && self.part.gathers && lattice.once;
        let bonds = if once { lattice.half() } else { c.lattice.stencil.len() };
        // of each pair one bond is enough to look at
        let (limit, watched) = match self.watch {
            Some(limit) => (limit, if lattice.once { lattice.half() } else { usize::MAX }),
            None => (0.0, 0),
        };
        for groups in self.part.groups[self.chunk].chunks(S::GROUPS) {
            // a last group without another stands beside itself, asked for nothing there
            let (a, b) = (groups[0], groups.get(1).copied().unwrap_or((groups[0].0, 0)));
            let lanes = u16::from(a.1) | u16::from(b.1) << WIDTH;
            let [first, second] = [&lattice.groups[a.0 as usize], &lattice.groups[b.0 as usize]];
            let cells = [first.cell as usize, second.cell as usize];
            let masks = [a.0, b.0].map(|g| &lattice.masks(g)[..bonds]);
            let family = Family::<S, D>::abreast(&c, cells, masks, lanes);
            let near = S::load_cells(c.lattice.volume, cells);
            let mut own = <Vector<S, D> as Linear<S>>::nothing();
            if M::PAIRWISE && self.part.gathers {
                let word = S::load_cells(c.lattice.word, cells);
                family.each(
                    #[inline(always)]
                    |b| {
                        let both = word + b.far_word();
                        let state = <M::State<S> as Record<S>>::read(
                            #[inline(always)]
                            |_| both,
                            0,
                        );
                        let pair = material.force(&state, b) * (b.volume() * near);
                        own = own + pair;
                        if once {
                            for k in 0..D {
                                pair.0[k].subtract_from(&mut planes[k * n..][..n], b.far_cells());
                            }
                        }
                        if b.slot() < watched {
                            look(b, limit, [first, second], stretched);
                        }
                    },
                );
            } else {
                let points = TwoGroups { chunk: self.chunk, c: self.c, groups: [first, second], lanes };
                let moments = material.moments(&self.part.weights_of(&points), family);
                let state = self.part.states_of(&points, &moments);
                family.each(
                    #[inline(always)]
                    |b| {
                        let pair = material.force(&state, b) * (b.volume() * near);
                        own = own + pair;
                        for k in 0..D {
                            pair.0[k].subtract_from(&mut planes[k * n..][..n], b.far_cells());
                        }
                        if b.slot() < watched {
                            look(b, limit, [first, second], stretched);
                        }
                    },
                );
            }
            for k in 0..D {
                own.0[k].add_to(&mut planes[k * n..][..n], cells);
            }
        }
    }
}

/// Notes the bonds with |Y|² − |ξ|² above a limit times |ξ|².
#[inline(always)]
fn look<S: Abreast, const D: usize>(b: Bond<S, D>, limit: f64, groups: [&Group; 2], found: &mut Vec<(u32, u32)>) {
    let beyond = (b.growth() - b.length() * b.length() * limit).positive() & b.lanes();
    if beyond != 0 {
        note(groups, beyond, b.slot(), found);
    }
}

/// Notes the points of lanes.
#[cold]
#[inline(never)]
fn note(groups: [&Group; 2], lanes: u16, bond: usize, found: &mut Vec<(u32, u32)>) {
    for l in (0..2 * WIDTH).filter(|l| lanes >> l & 1 == 1) {
        found.push((groups[l / WIDTH].points[l % WIDTH], bond as u32));
    }
}

impl<M: Material<D>, const D: usize> GroupKernel for OnLattice<'_, M, D> {
    type Output = ();
    /// More words than this leave too few registers for two groups.
    const PAIRED: bool = <M::State<f64> as Record<f64>>::WORDS <= 8;
    #[inline(always)]
    fn run<S: Abreast>(self) {
        OnLattice::run::<S>(self);
    }
}

struct Gather<'a, M: Material<D>, const D: usize> {
    part: &'a Assigned<M, D>,
    chunk: usize,
    c: &'a Configuration<'a, f64>,
    force: &'a mut [f64],
}
impl<M: Material<D>, const D: usize> Kernel for Gather<'_, M, D> {
    type Output = ();
    const OFTEN: bool = true;
    #[inline(always)]
    fn run<S: Scalar<Sum = f64>>(self) {
        self.part.gather::<S>(self.chunk, self.c, self.force);
    }
}

struct Scatter<'a, M: Material<D>, const D: usize> {
    part: &'a Assigned<M, D>,
    chunk: usize,
    c: &'a Configuration<'a, f64>,
    force: &'a mut [f64],
}
impl<M: Material<D>, const D: usize> Kernel for Scatter<'_, M, D> {
    type Output = ();
    const OFTEN: bool = true;
    #[inline(always)]
    fn run<S: Scalar<Sum = f64>>(self) {
        self.part.scatter::<S>(self.chunk, self.c, self.force);
    }
}

struct Energy<'a, M: Material<D>, const D: usize> {
    part: &'a Assigned<M, D>,
    chunk: usize,
    c: &'a Configuration<'a, f64>,
    out: &'a mut [f64],
}
impl<M: Material<D>, const D: usize> Kernel for Energy<'_, M, D> {
    type Output = ();
    const OFTEN: bool = false;
    #[inline(always)]
    fn run<S: Scalar<Sum = f64>>(self) {
        let (c, out) = (self.c, self.out);
        self.part.each(
            self.chunk,
            #[inline(always)]
            |i, constants, shape| out[i] = self.part.material.energy_density(constants, shape, Family::<S, D>::new(c, i)),
        );
    }
}

impl<M: Material<D>, const D: usize> Part<D> for Assigned<M, D> {
    fn name(&self) -> &str {
        &self.name
    }
    fn memory_words(&self) -> (usize, usize) {
        (M::MEMORY, M::BOND_MEMORY)
    }
    fn needs_velocity(&self) -> bool {
        M::RATE
    }
    fn is_conservative(&self) -> bool {
        M::CONSERVATIVE
    }
    fn is_uniform(&self) -> bool {
        matches!(self.constants, Constants::Uniform(_)) && self.memory_words() == (0, 0)
    }
    fn stores_influence(&self) -> bool {
        M::STORED_INFLUENCE
    }
    fn collapse(&self) -> bool {
        self.material.collapse()
    }
    fn is_rebuilt(&self) -> bool {
        match &self.constants {
            Constants::Uniform(c) => self.material.rebuilds(c),
            Constants::PerPoint(all) => all.iter().any(|c| self.material.rebuilds(c)),
        }
    }
    fn displacement_gradient(&self, chunk: usize, c: &Configuration<f64>, out: &mut [Matrix<f64, D>]) {
        self.each(chunk, |i, constants, shape| {
            out[i] = self.material.displacement_gradient(constants, shape, Family::<f64, D>::new(c, i));
        });
    }
    fn extended_strain(&self, chunk: usize, c: &Configuration<f64>, out: &mut [Matrix<f64, D>]) {
        self.each(chunk, |i, constants, shape| {
            if let Some(strain) = self.material.extended_strain(constants, shape, Family::<f64, D>::new(c, i)) {
                out[i] = strain;
            }
        });
    }
    fn sub_horizons(&self) -> usize {
        M::SUB_HORIZONS
    }
    fn shortfalls(&self) -> BTreeMap<&'static str, usize> {
        let mut all = BTreeMap::new();
        for what in self.shapes.iter().flat_map(Shared::iter).filter_map(|s| self.material.shortfall(s)) {
            *all.entry(what).or_default() += 1;
        }
        all
    }
    fn points(&self, chunk: usize) -> &[u32] {
        &self.points[chunk].1
    }
    fn make_shapes(&mut self, chunks: &[Chunk<D>]) -> Vec<(usize, usize)> {
        type Made<S> = Result<Shared<S>, Vec<usize>>;
        let (uniform, small) = (matches!(self.constants, Constants::Uniform(_)), size_of::<M::Shape>() <= 2 * size_of::<u32>());
        let made: Vec<OnceLock<Made<M::Shape>>> = chunks.iter().map(|_| OnceLock::new()).collect();
        in_parallel(chunks.len(), &|k| {
            made[k].get_or_init(|| {
                let (first, points) = &self.points[k];
                let shape_of = |c: &Configuration<f64>, i: u32| {
                    self.material.shape(self.constants.at(first + i as usize), Reference::new(c, i as usize))
                };
                let mut singular = vec![];
                if uniform && let Some((own, number)) = by_cells(&chunks[k], points) {
                    let made: Vec<_> = chunks[k].with_lists_of(&own, |c| own.iter().map(|&i| shape_of(c, i)).collect());
                    singular.extend(points.iter().zip(&number).filter(|(_, n)| made[**n as usize].is_err()).map(|(i, _)| *i as usize));
                    let table = made.into_iter().flatten().collect();
                    return if singular.is_empty() { Ok(Shared::of(table, number)) } else { Err(singular) };
                }
                chunks[k].with_lists(|c| {
                    let mut shapes = Shared::with_capacity(points.len());
                    // shapes as small as an index are not worth a search among bonds
                    let mut distinct = (uniform && !small).then(|| Distinct::<D>::new(M::SUB_HORIZONS, M::STORED_INFLUENCE));
                    for &i in points {
                        let same = distinct.as_mut().and_then(|known| known.find(c, i as usize, shapes.distinct()));
                        if let Some(same) = same {
                            shapes.push_same(same);
                            continue;
                        }
                        match shape_of(c, i) {
                            Ok(shape) => shapes.push(shape),
                            Err(_) => singular.push(i as usize),
                        }
                    }
                    shapes.seal();
                    if singular.is_empty() { Ok(shapes) } else { Err(singular) }
                })
            });
        });
        let mut singular = vec![];
        self.shapes.clear();
        for (k, made) in made.into_iter().enumerate() {
            match made.into_inner() {
                Some(Ok(shapes)) => self.shapes.push(shapes),
                Some(Err(points)) => singular.extend(points.into_iter().map(|i| (k, i))),
                None => {}
            }
        }
        if singular.is_empty() {
            self.find_irregular();
        }
        singular
    }
    fn reshape(&mut self, chunk: usize, point: usize, c: &Configuration<f64>) -> bool {
        let place = self.place[chunk][point];
        if place == u32::MAX {
            return true;
        }
        let old = self.shapes[chunk][place as usize];
        match self.material.reshape(self.constants.at(self.points[chunk].0 + point), &old, Reference::new(c, point)) {
            Ok(shape) => {
                self.irregular[chunk] |= !self.material.is_regular(&shape);
                self.shapes[chunk].set(place as usize, shape);
                true
            }
            Err(_) => false,
        }
    }
    fn energy_density_at(&self, chunk: usize, point: usize, c: &Configuration<f64>) -> Option<f64> {
        let (constants, shape) = self.own(chunk, point)?;
        Some(self.material.energy_density(constants, shape, Family::<f64, D>::new(c, point)))
    }
    fn save_shapes(&mut self) {
        self.saved.clone_from(&self.shapes);
    }
    fn restore_shapes(&mut self) {
        self.shapes.clone_from(&self.saved);
        self.find_irregular();
    }
    fn add_force(&self, chunk: usize, c: &Configuration<f64>, force: &mut [f64]) {
        // the first test is known when the program is compiled
        if M::PAIRWISE && self.gathers {
            widest(Gather { part: self, chunk, c, force });
        } else {
            widest(Scatter { part: self, chunk, c, force });
        }
    }
    fn takes_lattice(&self, chunk: usize) -> bool {
        !M::RATE && M::BOND_MEMORY == 0 && !self.irregular[chunk]
    }
    fn add_force_on_lattice(
        &self,
        chunk: usize,
        c: &Configuration<f64>,
        lattice: &LatticePoints<D>,
        watch: Option<f64>,
        scratch: &mut Scratch,
    ) {
        // known when the program is compiled
        if !M::RATE && M::BOND_MEMORY == 0 {
            widest_abreast(OnLattice { part: self, chunk, c, lattice, watch, scratch });
        }
    }
    fn add_force_dual(&self, chunk: usize, c: &Configuration<Dual>, force: &mut [Dual]) {
        self.scatter::<Dual>(chunk, c, force);
    }
    fn energy_density(&self, chunk: usize, c: &Configuration<f64>, out: &mut [f64]) {
        widest(Energy { part: self, chunk, c, out });
    }
    fn stress(&self, chunk: usize, c: &Configuration<f64>, out: &mut [Matrix<f64, D>], across: &mut [f64]) {
        self.each(chunk, |i, constants, shape| {
            let family = Family::<f64, D>::new(c, i);
            let state = self.material.state(constants, shape, family);
            out[i] = family.integrate(|b| self.material.force(&state, b).outer(b.xi()));
            across[i] = self.material.out_of_plane_stress(constants, shape, family, &out[i]);
        });
    }
    #[inline(never)]
    fn half_bond_energies_at(&self, chunk: usize, point: usize, c: &Configuration<f64>, out: &mut Vec<(usize, f64)>) {
        let Some((constants, shape)) = self.own(chunk, point) else { return };
        let family = Family::<f64, D>::new(c, point);
        let state = self.material.state(constants, shape, family);
        family.each(|b| out.push((b.slot(), 0.5 * self.material.force(&state, b).dot(b.eta()))));
    }
    fn family_stiffness(&self, chunk: usize, point: usize, arrays: &Chunk<D>, u: &mut [Jet<SEEDS>], out: &mut Vec<f64>) {
        let Some((constants, shape)) = self.own(chunk, point) else { return };
        let far: Vec<usize> = arrays.slots(point).filter(|&s| arrays.is_intact(s)).map(|s| arrays.far(point, s) * ROW).collect();
        let n = far.len() * D;
        let near = arrays.volume(point);
        out.clear();
        out.resize(n * n, 0.0);
        for first in (0..n).step_by(SEEDS) {
            let seeds = (n - first).min(SEEDS);
            for q in 0..seeds {
                u[far[(first + q) / D] + (first + q) % D].slope[q] = 1.0;
            }
            {
                let c = arrays.view::<Jet<SEEDS>>(u);
                let family = Family::<Jet<SEEDS>, D>::new(&c, point);
                let state = self.material.state(constants, shape, family);
                let mut row = 0;
                family.each(|b| {
                    let t = self.material.force(&state, b);
                    let volumes = near * b.volume().value;
                    for k in 0..D {
                        for q in 0..seeds {
                            out[(row * D + k) * n + first + q] = t.0[k].slope[q] * volumes;
                        }
                    }
                    row += 1;
                });
            }
            for q in 0..seeds {
                u[far[(first + q) / D] + (first + q) % D].slope = [0.0; SEEDS];
            }
        }
    }
    fn commit(&self, chunk: usize, arrays: &mut Chunk<D>) {
        if M::MEMORY == 0 && M::BOND_MEMORY == 0 {
            return;
        }
        let (mut memory, mut bond_memory) = (arrays.memory.clone(), arrays.bond_memory.clone());
        let slots = arrays.slot_count();
        let c = arrays.configuration();
        self.each(chunk, |i, constants, shape| {
            let family = Family::<f64, D>::new(&c, i);
            let range = arrays.start[i] as usize..arrays.start[i + 1] as usize;
            let mut bonds: Vec<&mut [f64]> =
                bond_memory.chunks_mut(slots.max(1)).take(M::BOND_MEMORY).map(|w| &mut w[range.clone()]).collect();
            let point = &mut memory[i * arrays.memory_words..][..M::MEMORY];
            self.material.commit(constants, shape, family, point, &mut bonds);
        });
        arrays.memory = memory;
        arrays.bond_memory = bond_memory;
    }
    fn gathers(&self) -> bool {
        self.gathers
    }
    fn state_word(&self, chunk: usize, point: usize, c: &Configuration<f64>) -> f64 {
        let (constants, shape) = (self.constants.at(self.points[chunk].0 + point), &self.shapes[chunk][self.place[chunk][point] as usize]);
        const { assert!(!M::PAIRWISE || <M::Moments<f64> as Record<f64>>::WORDS == 0, "a pairwise model takes no integrals") };
        let nothing = <M::Moments<f64> as Record<f64>>::read(|_| 0.0, 0);
        let state: M::State<f64> = self.material.state_of(constants, shape, &nothing, Place::new(c, point));
        state.word(0)
    }
    fn bytes(&self) -> usize {
        let shapes: usize = self.shapes.iter().map(Shared::bytes).sum();
        let constants = match &self.constants {
            Constants::Uniform(_) => size_of::<M::Constants>(),
            Constants::PerPoint(v) => v.len() * size_of::<M::Constants>(),
        };
        shapes + constants + self.points.iter().map(|p| p.1.len() * 8).sum::<usize>()
    }
}
