//! A small body of flat arrays for the tests: brute-force families, and models behind one object-safe trait, so that a
//! table of models is plain data.
#![allow(dead_code)]

pub mod any;
pub mod closed;
pub mod counting;
pub mod table;

use physics::family::{Configuration, Family, Lattice, Reference};
use physics::lanes::{self, Kernel};
use physics::material::Material;
use physics::scalar::{Dual, ROW, Record, Scalar, lift};
use physics::tensor::Vector;

/// Seeded numbers (xorshift).
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }
    /// Uniform between −1 and 1.
    pub fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// A number between 0 and 1 that belongs to a directed bond, whatever the order of the bonds.
pub fn of_bond(i: usize, j: usize, seed: u64) -> f64 {
    let mut r = Random::new(seed ^ ((i as u64) << 40) ^ ((j as u64 + 1) << 16));
    for _ in 0..4 {
        r.next();
    }
    0.5 + 0.5 * r.next()
}

/// The number of a pair: the same for i→j and j→i.
fn of_pair(i: usize, j: usize, seed: u64) -> f64 {
    of_bond(i.min(j), i.max(j), seed)
}

/// Arrays of points and families in the layout of [`Configuration`].
#[derive(Clone)]
pub struct Body<const D: usize> {
    pub coordinates: Vec<f64>,
    pub velocity: Vec<f64>,
    pub horizon: Vec<f64>,
    pub temperature: Vec<f64>,
    pub start: Vec<u32>,
    pub neighbor: Vec<u16>,
    pub length: Vec<f64>,
    pub weight: Vec<f64>,
    /// Bits of the bonds before any broke.
    pub whole: Vec<u8>,
    pub intact: Vec<u8>,
    /// Bits of the sub-horizons.
    pub membership: Vec<u8>,
    pub memory: Vec<f64>,
    pub memory_words: usize,
    pub bond_memory: Vec<f64>,
}

impl<const D: usize> Body<D> {
    /// A body of points with given families.
    pub fn of_families(points: &[[f64; D]], volume: &[f64], horizon: &[f64], families: &[Vec<usize>]) -> Self {
        let mut coordinates = vec![0.0; points.len() * ROW];
        for (i, x) in points.iter().enumerate() {
            coordinates[i * ROW..i * ROW + D].copy_from_slice(x);
            coordinates[i * ROW + 3] = volume[i];
        }
        let (mut start, mut neighbor, mut length, mut bits) = (vec![0u32], vec![], vec![], vec![]);
        for (i, family) in families.iter().enumerate() {
            for slot in 0..family.len().div_ceil(8) * 8 {
                let j = family[slot.min(family.len() - 1)];
                neighbor.push(j as u16);
                length.push((0..D).map(|k| (points[j][k] - points[i][k]).powi(2)).sum::<f64>().sqrt());
                bits.push(slot < family.len());
            }
            start.push(neighbor.len() as u32);
        }
        let whole: Vec<u8> = bits.chunks(8).map(|c| c.iter().enumerate().fold(0, |m, (k, &on)| m | ((on as u8) << k))).collect();
        Body {
            coordinates,
            velocity: vec![],
            horizon: horizon.to_vec(),
            temperature: vec![],
            start,
            neighbor,
            length,
            weight: vec![],
            intact: whole.clone(),
            whole,
            membership: vec![],
            memory: vec![],
            memory_words: 0,
            bond_memory: vec![],
        }
    }

    /// A body whose points own all bonds within their horizon; `order` sorts the bonds of a family.
    pub fn new(points: &[[f64; D]], volume: &[f64], horizon: &[f64], order: impl Fn(usize, usize) -> f64) -> Self {
        let families: Vec<Vec<usize>> = (0..points.len())
            .map(|i| {
                let inside = |j: &usize| {
                    let r2: f64 = (0..D).map(|k| (points[*j][k] - points[i][k]).powi(2)).sum();
                    *j != i && r2.sqrt() <= horizon[i] * (1.0 + 1e-9)
                };
                let mut family: Vec<usize> = (0..points.len()).filter(inside).collect();
                family.sort_by(|&a, &b| order(i, a).total_cmp(&order(i, b)));
                family
            })
            .collect();
        Self::of_families(points, volume, horizon, &families)
    }

    /// Lattice of `count` points an edge.
    pub fn lattice(count: usize, spacing: f64, ratio: f64) -> Self {
        let n = count.pow(D as u32);
        Self::new(&grid(count, spacing), &vec![spacing.powi(D as i32); n], &vec![ratio * spacing; n], |_, j| j as f64)
    }

    /// Jittered points of unequal volumes and horizons; bonds in index order, or in an order of their own.
    pub fn cloud(count: usize, spacing: f64, ratio: f64, shuffled: bool) -> Self {
        let mut r = Random::new(42);
        let mut points = grid(count, spacing);
        for x in points.iter_mut().flatten() {
            *x += 0.2 * spacing * r.next();
        }
        let volume: Vec<f64> = points.iter().map(|_| spacing.powi(D as i32) * (1.0 + 0.4 * r.next())).collect();
        let horizon: Vec<f64> = points.iter().map(|_| ratio * spacing * (1.0 + 0.15 * r.next())).collect();
        Self::new(&points, &volume, &horizon, |i, j| if shuffled { of_bond(i, j, 77) } else { j as f64 })
    }

    /// One family: the point at the origin with the given bonds (ξ, V′); the far points own none.
    pub fn star(bonds: &[([f64; D], f64)], horizon: f64, volume: f64) -> Self {
        let mut points = vec![[0.0; D]];
        points.extend(bonds.iter().map(|b| b.0));
        let mut volumes = vec![volume];
        volumes.extend(bonds.iter().map(|b| b.1));
        Self::of_families(&points, &volumes, &vec![horizon; points.len()], &[(1..points.len()).collect()])
    }

    /// Divides the families into sub-horizons, stored in `planes` planes.
    pub fn divided(mut self, partition: physics::sub_horizon::Partition, planes: usize) -> Self {
        let blocks = self.neighbor.len() / 8;
        self.membership = vec![0; planes * blocks];
        for i in 0..self.families() {
            // padding repeats the last bond: it belongs to the lanes, not to the family
            let own: Vec<usize> = self.slots(i).filter(|&s| (self.whole[s / 8] >> (s % 8)) & 1 == 1).collect();
            let bonds: Vec<(Vector<f64, D>, f64)> =
                own.iter().map(|&s| (Vector(self.xi(i, s)), self.volume(self.neighbor[s] as usize))).collect();
            for (slot, sets) in own.into_iter().zip(partition.membership(&bonds, self.horizon[i])) {
                for k in 0..planes {
                    self.membership[k * blocks + slot / 8] |= (sets >> k & 1) << (slot % 8);
                }
            }
        }
        self
    }
    /// Breaks the given share of the pairs, both directions.
    pub fn broken(mut self, share: f64) -> Self {
        for i in 0..self.families() {
            for slot in self.slots(i) {
                if of_pair(i, self.neighbor[slot] as usize, 5) < share {
                    self.intact[slot / 8] &= !(1 << (slot % 8));
                }
            }
        }
        self
    }
    /// Volumes per the measure of a section (area of a bar, thickness of a plane).
    pub fn per(mut self, measure: f64) -> Self {
        self.coordinates.chunks_mut(ROW).for_each(|row| row[3] *= measure);
        self
    }
    /// Stores an influence per bond, not the same in both directions.
    pub fn weighted(mut self) -> Self {
        self.weight = (0..self.neighbor.len()).map(|_| 0.0).collect();
        for i in 0..self.families() {
            for slot in self.slots(i) {
                let q = self.length[slot] / self.horizon[i];
                self.weight[slot] = 1.2 - 0.8 * q + 0.3 * of_bond(i, self.neighbor[slot] as usize, 9);
            }
        }
        self
    }
    /// A temperature change per point.
    pub fn heated(mut self, scale: f64) -> Self {
        self.temperature = (0..self.points()).map(|i| scale * (of_bond(i, i, 3) - 0.3)).collect();
        self
    }
    /// Committed history of the bonds.
    pub fn with_history(mut self, words: usize, scale: f64) -> Self {
        self.bond_memory = vec![0.0; words * self.neighbor.len()];
        for word in 0..words {
            for i in 0..self.families() {
                for slot in self.slots(i) {
                    let at = word * self.neighbor.len() + slot;
                    self.bond_memory[at] = scale * (of_bond(i, self.neighbor[slot] as usize, 11 + word as u64) - 0.4);
                }
            }
        }
        self
    }

    /// Words of history a point, all zeros: those of the undeformed body.
    pub fn with_point_history(mut self, words: usize) -> Self {
        self.memory_words = words;
        self.memory = vec![0.0; words * self.families()];
        self
    }

    pub fn points(&self) -> usize {
        self.coordinates.len() / ROW
    }
    pub fn families(&self) -> usize {
        self.start.len() - 1
    }
    pub fn slots(&self, i: usize) -> std::ops::Range<usize> {
        self.start[i] as usize..self.start[i + 1] as usize
    }
    pub fn is_intact(&self, slot: usize) -> bool {
        (self.intact[slot / 8] >> (slot % 8)) & 1 == 1
    }
    pub fn volume(&self, i: usize) -> f64 {
        self.coordinates[i * ROW + 3]
    }
    pub fn x(&self, i: usize) -> [f64; D] {
        std::array::from_fn(|k| self.coordinates[i * ROW + k])
    }
    /// ξ of a slot of family i
    pub fn xi(&self, i: usize, slot: usize) -> [f64; D] {
        let (a, b) = (self.x(i), self.x(self.neighbor[slot] as usize));
        std::array::from_fn(|k| b[k] - a[k])
    }
    /// Intact slots of a family.
    pub fn bonds(&self, i: usize) -> impl Iterator<Item = usize> + '_ {
        self.slots(i).filter(|&s| self.is_intact(s))
    }
    /// Displacement rows of a map of the reference position and the point's index.
    pub fn displaced(&self, map: impl Fn(usize, [f64; D]) -> [f64; D]) -> Vec<f64> {
        let mut u = vec![0.0; self.points() * ROW];
        for i in 0..self.points() {
            let d = map(i, self.x(i));
            u[i * ROW..i * ROW + D].copy_from_slice(&d);
        }
        u
    }
    /// u = (F − 1) x
    pub fn affine(&self, f: [[f64; D]; D]) -> Vec<f64> {
        self.displaced(|_, x| std::array::from_fn(|a| (0..D).map(|b| f[a][b] * x[b]).sum::<f64>() - x[a]))
    }
    /// A finite deformation without any symmetry: a stretch and shear of about 10 % and noise.
    pub fn random(&self, spacing: f64, seed: u64) -> Vec<f64> {
        let mut r = Random::new(seed);
        let h: [[f64; D]; D] = std::array::from_fn(|_| std::array::from_fn(|_| 0.1 * r.next()));
        let noise: Vec<f64> = (0..self.points() * D).map(|_| 0.06 * spacing * r.next()).collect();
        self.displaced(|i, x| std::array::from_fn(|a| (0..D).map(|b| h[a][b] * x[b]).sum::<f64>() + noise[i * D + a]))
    }
    /// Directions for derivatives, of the size of the displacements.
    pub fn direction(&self, spacing: f64, seed: u64) -> Vec<f64> {
        let mut r = Random::new(seed);
        let z: Vec<f64> = (0..self.points() * D).map(|_| spacing * r.next()).collect();
        self.displaced(|i, _| std::array::from_fn(|a| z[i * D + a]))
    }

    pub fn view<'a, R>(&'a self, displacement: &'a [R]) -> Configuration<'a, R> {
        Configuration {
            time: 0.0,
            coordinates: &self.coordinates,
            displacement,
            velocity: &self.velocity,
            horizon: &self.horizon,
            temperature: &self.temperature,
            start: &self.start,
            neighbor: &self.neighbor,
            length: &self.length,
            weight: &self.weight,
            intact: &self.intact,
            memory: &self.memory,
            memory_words: self.memory_words,
            bond_memory: &self.bond_memory,
            membership: &self.membership,
            lattice: Lattice::NONE,
        }
    }
}

fn grid<const D: usize>(count: usize, spacing: f64) -> Vec<[f64; D]> {
    (0..count.pow(D as u32)).map(|i| std::array::from_fn(|k| (i / count.pow(k as u32) % count) as f64 * spacing)).collect()
}

/// Which numbers evaluate a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum With {
    Scalars,
    WidestLanes,
    PortableLanes,
}

/// What a model gives on a body.
pub struct Evaluation<const D: usize> {
    /// Words of the states, point by point.
    pub states: Vec<f64>,
    /// T per bond slot, zero where broken.
    pub forces: Vec<[f64; D]>,
    /// W per point.
    pub energies: Vec<f64>,
    /// Rows of the force density ∫ (T − T′) dV′.
    pub density: Vec<f64>,
}

/// Value and derivative of what a model gives.
pub struct Slopes<const D: usize> {
    pub forces: Vec<[Dual; D]>,
    pub energies: Vec<Dual>,
}

/// A model with its constants, whatever its types.
pub trait Model<const D: usize> {
    fn stored(&self) -> bool;
    /// Evaluates everything; the number is what `count` grew by meanwhile.
    fn measure(&self, body: &Body<D>, u: &[f64], with: With, count: fn() -> usize) -> (Evaluation<D>, usize);
    fn slopes(&self, body: &Body<D>, u: &[f64], direction: &[f64]) -> Slopes<D>;
    fn commit(&self, body: &mut Body<D>, u: &[f64]);
    fn evaluate(&self, body: &Body<D>, u: &[f64], with: With) -> Evaluation<D> {
        self.measure(body, u, with, || 0).0
    }
}

pub struct Case<M, C>(pub M, pub C);

impl<M, C> Case<M, C> {
    /// The shapes of the whole body, then those of the broken one.
    pub fn shapes<const D: usize>(&self, body: &Body<D>) -> Vec<M::Shape>
    where
        M: Material<D, Constants = C>,
    {
        let u = vec![0.0; body.points() * ROW];
        let broken = body.view(&u);
        let whole = Configuration { intact: &body.whole, ..broken };
        (0..body.families())
            .map(|i| {
                let shape = self.0.shape(&self.1, Reference::new(&whole, i)).expect("a regular family");
                self.0.reshape(&self.1, &shape, Reference::new(&broken, i)).expect("a regular family after breaking")
            })
            .collect()
    }
}

/// Everything a model gives, over any number type.
struct Sweep<'a, M: Material<D>, const D: usize> {
    material: &'a M,
    constants: &'a M::Constants,
    shapes: &'a [M::Shape],
    view: &'a Configuration<'a, f64>,
    /// 0, 1, 2, …
    slots: &'a [u16],
    /// Rows of force states, one a slot.
    rows: &'a mut [f64],
    out: &'a mut Evaluation<D>,
}

impl<M: Material<D>, const D: usize> Kernel for Sweep<'_, M, D> {
    type Output = ();
    // lanes of AVX2, as the portable ones, are asked once for each model: the compiler's time
    const OFTEN: bool = !M::STORED_INFLUENCE;
    #[inline(always)]
    fn run<S: Scalar<Sum = f64>>(self) {
        let Sweep { material, constants, shapes, view, slots, rows, out } = self;
        let words = <M::State<f64> as Record<f64>>::WORDS;
        for i in 0..shapes.len() {
            let family = Family::<S, D>::new(view, i);
            out.energies[i] = material.energy_density(constants, &shapes[i], family);
            let state: M::State<f64> = material.state(constants, &shapes[i], family);
            for k in 0..words {
                out.states[i * words + k] = state.word(k);
            }
            let state: M::State<S> = lift::<S, _, _>(&state);
            let mut own = Vector::<S, D>::zero();
            let first = family.first_slot();
            let (forces, density) = (&mut rows[first * ROW..], &mut out.density);
            family.each(
                #[inline(always)]
                |b| {
                    let t = material.force(&state, b);
                    own = own + t * b.volume();
                    S::subtract_rows(density, b.far(), (t * b.near_volume()).0);
                    // slots are rows of their own: the only way to write single lanes
                    let kept = t.0.map(
                        #[inline(always)]
                        |t| -t.masked(view.intact, b.slot()),
                    );
                    S::subtract_rows(forces, S::index(slots, b.slot() - first), kept);
                },
            );
            for k in 0..D {
                density[i * ROW + k] += own.0[k].sum();
            }
        }
    }
}

impl<M, const D: usize> Model<D> for Case<M, M::Constants>
where
    M: Material<D>,
{
    fn stored(&self) -> bool {
        M::STORED_INFLUENCE
    }
    fn measure(&self, body: &Body<D>, u: &[f64], with: With, count: fn() -> usize) -> (Evaluation<D>, usize) {
        let shapes = self.shapes(body);
        let view = body.view(u);
        let mut out = Evaluation {
            states: vec![0.0; <M::State<f64> as Record<f64>>::WORDS * body.families()],
            forces: vec![[0.0; D]; body.neighbor.len()],
            energies: vec![0.0; body.families()],
            density: vec![0.0; body.points() * ROW],
        };
        let longest = body.start.windows(2).map(|w| w[1] - w[0]).max().unwrap_or(0);
        let slots: Vec<u16> = (0..longest as u16).collect();
        let mut rows = vec![0.0; body.neighbor.len() * ROW];
        let sweep =
            Sweep { material: &self.0, constants: &self.1, shapes: &shapes, view: &view, slots: &slots, rows: &mut rows, out: &mut out };
        let before = count();
        match with {
            With::Scalars => sweep.run::<f64>(),
            With::WidestLanes => lanes::widest(sweep),
            // the portable lanes do not tell influences apart: asked once, to keep the compiler's time bearable
            With::PortableLanes if M::STORED_INFLUENCE => lanes::widest(sweep),
            With::PortableLanes => lanes::portable(sweep),
        }
        let grown = count() - before;
        for (force, row) in out.forces.iter_mut().zip(rows.chunks(ROW)) {
            force.copy_from_slice(&row[..D]);
        }
        (out, grown)
    }
    fn slopes(&self, body: &Body<D>, u: &[f64], direction: &[f64]) -> Slopes<D> {
        let u: Vec<Dual> = u.iter().zip(direction).map(|(&value, &z)| Dual { value, slope: [z] }).collect();
        let view = body.view(&u);
        let mut forces = vec![[Dual::of(0.0); D]; body.neighbor.len()];
        let mut energies = vec![];
        for (i, shape) in self.shapes(body).iter().enumerate() {
            let family = Family::<Dual, D>::new(&view, i);
            energies.push(self.0.energy_density(&self.1, shape, family));
            let state = self.0.state(&self.1, shape, family);
            family.each(|b| forces[b.slot()] = self.0.force(&state, b).0);
        }
        Slopes { forces, energies }
    }
    fn commit(&self, body: &mut Body<D>, u: &[f64]) {
        let shapes = self.shapes(body);
        let mut memory = body.memory.clone();
        let mut words: Vec<Vec<f64>> = body.bond_memory.chunks(body.neighbor.len()).map(<[f64]>::to_vec).collect();
        for (i, shape) in shapes.iter().enumerate() {
            let slots = body.slots(i);
            let mut bonds: Vec<&mut [f64]> = words.iter_mut().map(|w| &mut w[slots.clone()]).collect();
            let point = &mut memory[i * body.memory_words..][..M::MEMORY];
            self.0.commit(&self.1, shape, Family::new(&body.view(u), i), point, &mut bonds);
        }
        body.memory = memory;
        body.bond_memory = words.concat();
    }
}

/// Largest magnitude.
pub fn largest<'a>(x: impl IntoIterator<Item = &'a f64>) -> f64 {
    x.into_iter().fold(0.0, |m, x| if x.is_nan() { f64::NAN } else { x.abs().max(m) })
}

/// Largest difference relative to the largest magnitude (of `b`); not finite where one of them is not.
pub fn difference<'a>(a: impl IntoIterator<Item = &'a f64>, b: impl IntoIterator<Item = &'a f64> + Clone) -> f64 {
    let scale = largest(b.clone());
    let mut worst = 0.0f64;
    for (x, y) in a.into_iter().zip(b) {
        let d = (x - y).abs();
        worst = if d.is_finite() { worst.max(d) } else { return f64::INFINITY };
    }
    if worst == 0.0 { 0.0 } else { worst / scale }
}
