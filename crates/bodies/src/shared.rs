//! Shapes of families that are shared: on a lattice most families are the same, and one shape serves them all.

use crate::chunk::Chunk;
use physics::family::{Configuration, Reference, Undeformed};
use physics::tensor::Vector;
use std::collections::HashMap;
use std::ops::Index;

/// A list of shapes whose entries may be the same one: a table of distinct shapes and an index of four bytes a point.
#[derive(Clone)]
pub(crate) struct Shared<S> {
    table: Vec<S>,
    place: Vec<u32>,
    /// Entries of the table from here on belong to one point each.
    shared: usize,
}

impl<S> Shared<S> {
    pub fn with_capacity(points: usize) -> Self {
        Shared { table: vec![], place: Vec::with_capacity(points), shared: 0 }
    }
    /// Entries of a table, for each point one.
    pub fn of(table: Vec<S>, place: Vec<u32>) -> Self {
        Shared { shared: table.len(), table, place }
    }
    /// Number of distinct shapes so far.
    pub fn distinct(&self) -> usize {
        self.table.len()
    }
    pub fn push(&mut self, shape: S) {
        self.place.push(self.table.len() as u32);
        self.table.push(shape);
    }
    /// The next point has the shape of this entry of the table.
    pub fn push_same(&mut self, entry: usize) {
        self.place.push(entry as u32);
    }
    /// All points have their shapes: from now on the table's entries may be shared.
    pub fn seal(&mut self) {
        self.shared = self.table.len();
        self.table.shrink_to_fit();
    }
    /// Gives a point a shape of its own.
    pub fn set(&mut self, point: usize, shape: S) {
        let entry = self.place[point] as usize;
        if entry >= self.shared {
            self.table[entry] = shape;
        } else {
            self.place[point] = self.table.len() as u32;
            self.table.push(shape);
        }
    }
    #[inline(always)]
    pub fn iter(&self) -> impl Iterator<Item = &S> {
        self.place.iter().map(|&p| &self.table[p as usize])
    }
    pub fn bytes(&self) -> usize {
        self.table.len() * size_of::<S>() + self.place.len() * size_of::<u32>()
    }
}

impl<S> Index<usize> for Shared<S> {
    type Output = S;
    #[inline(always)]
    fn index(&self, point: usize) -> &S {
        &self.table[self.place[point] as usize]
    }
}

/// Families are the same where their bonds are, to this fraction of horizon, volume and influence: the round-off of coordinates.
const SAME: f64 = 1e-12;
/// Grid on which bonds are put in order, as a fraction of the horizon: much wider than round-off, much finer than a spacing.
const GRID: f64 = 1e-9;

/// Place on the grid, ξ, V′, ω and sub-horizons of a bond.
type Placed<const D: usize> = ([i64; D], [f64; D], f64, f64, u32);

/// The bonds of a family as far as shapes depend on them.
struct Bonds<const D: usize> {
    horizon: f64,
    /// In the order of the places.
    bonds: Vec<Placed<D>>,
}

impl<const D: usize> Bonds<D> {
    fn of(c: &Configuration<f64>, point: usize, sub_horizons: usize, weighted: bool) -> Self {
        let h = Reference::<D>::new(c, point);
        let horizon = h.horizon();
        let mut bonds = Vec::with_capacity(64);
        h.each(|b| {
            let Vector(xi) = b.xi();
            let sets = (0..sub_horizons).fold(0, |sets, k| sets | u32::from(b.belongs_to(k)) << k);
            bonds.push((xi.map(|x| (x / (horizon * GRID)).round() as i64), xi, b.volume(), if weighted { b.weight() } else { 1.0 }, sets));
        });
        bonds.sort_unstable_by_key(|b| b.0);
        Bonds { horizon, bonds }
    }
    /// The same number for families that are the same (but for bad luck on the borders of the grid, which costs memory only).
    fn hash(&self) -> u64 {
        let mix = |h: u64, x: u64| (h ^ x).wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(29);
        self.bonds.iter().fold(self.bonds.len() as u64, |h, b| b.0.iter().fold(mix(h, u64::from(b.4)), |h, &x| mix(h, x as u64)))
    }
    fn same(&self, other: &Self) -> bool {
        let near = |a: f64, b: f64, scale: f64| (a - b).abs() <= SAME * scale;
        near(self.horizon, other.horizon, self.horizon)
            && self.bonds.len() == other.bonds.len()
            && self.bonds.iter().zip(&other.bonds).all(|(a, b)| {
                a.4 == b.4 && (0..D).all(|k| near(a.1[k], b.1[k], self.horizon)) && near(a.2, b.2, a.2.abs()) && near(a.3, b.3, a.3.abs())
            })
    }
}

/// On a lattice of equal volumes: points whose families are all that there are, and for each of `points` the number of the one that is as its
/// own, because the same cells are taken around both (see `LatticePoints::patterns`). `None` elsewhere.
pub(crate) fn by_cells<const D: usize>(chunk: &Chunk<D>, points: &[u32]) -> Option<(Vec<u32>, Vec<u32>)> {
    let near = |a: f64, b: f64| (a - b).abs() <= SAME * b.abs();
    let lattice = chunk.lattice.as_ref()?;
    let alike =
        chunk.horizon.iter().all(|h| near(*h, chunk.horizon[0])) && (0..chunk.points.len()).all(|l| near(chunk.volume(l), chunk.volume(0)));
    let (mut first, mut number): (Vec<u32>, HashMap<u32, u32>) = Default::default();
    let mut number_of = |&i: &u32| {
        *number.entry(lattice.patterns()[i as usize]).or_insert_with(|| {
            first.push(i);
            first.len() as u32 - 1
        })
    };
    let numbers = alike.then(|| points.iter().map(&mut number_of).collect())?;
    Some((first, numbers))
}

/// The distinct families met so far, each by one of its points.
pub(crate) struct Distinct<const D: usize> {
    sub_horizons: usize,
    weighted: bool,
    /// Representative points with their entries in the table, by hash.
    known: HashMap<u64, Vec<(usize, usize)>>,
    /// Families looked at, and found again.
    tried: (usize, usize),
}

/// Families after which a search that finds few again is given up: a cloud of points.
const ENOUGH: usize = 256;

impl<const D: usize> Distinct<D> {
    pub fn new(sub_horizons: usize, weighted: bool) -> Self {
        Distinct { sub_horizons, weighted, known: HashMap::new(), tried: (0, 0) }
    }
    /// The entry of a family that is the same as that of `point`; where there is none, `point` will be found under `next` later.
    pub fn find(&mut self, c: &Configuration<f64>, point: usize, next: usize) -> Option<usize> {
        if self.tried.0 >= ENOUGH && self.tried.1 * 8 < self.tried.0 {
            return None;
        }
        let bonds = Bonds::<D>::of(c, point, self.sub_horizons, self.weighted);
        let entries = self.known.entry(bonds.hash()).or_default();
        let found = entries.iter().find(|(p, _)| bonds.same(&Bonds::of(c, *p, self.sub_horizons, self.weighted))).map(|e| e.1);
        if found.is_none() {
            entries.push((point, next));
        }
        self.tried = (self.tried.0 + 1, self.tried.1 + usize::from(found.is_some()));
        found
    }
}
