//! A chunk: a contiguous run of spatially sorted points, the halo its bonds reach, and the arrays of its families.

use crate::lattice::LatticePoints;
use physics::family::{Configuration, Lattice};
use physics::scalar::{ROW, SPARE_WORD, Scalar, VOLUME_WORD};

/// A bond of a family as the builder hands it over.
#[derive(Clone, Copy, Debug)]
pub struct Link {
    /// Far point.
    pub point: u32,
    /// Components of the far point that a symmetry plane reflects: bit k for component k.
    pub flips: u8,
    /// Position of the far end, reflected where it is a mirror image.
    pub end: [f64; 3],
    /// Influence ω, where it is not constant.
    pub weight: f64,
    /// Sub-horizons the bond belongs to, one bit each, where the family has any.
    pub sets: u8,
}

/// Rows of numbers that begin at a cache line, so that no row of 32 bytes lies across two: such loads and stores take twice as long.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rows {
    data: Vec<f64>,
    offset: usize,
    length: usize,
}

impl Rows {
    const LINE: usize = 64;
    /// `length` zeros.
    pub(crate) fn zeros(length: usize) -> Self {
        let data = vec![0.0; length + Self::LINE / size_of::<f64>()];
        // the vector never grows, so the place found now stays
        let offset = data.as_ptr().align_offset(Self::LINE);
        Rows { data, offset, length }
    }
    /// The first `length` numbers, whatever they are.
    pub(crate) fn at_least(&mut self, length: usize) -> &mut [f64] {
        if self.length < length {
            *self = Self::zeros(length);
        }
        &mut self[..length]
    }
    fn of(values: &[f64]) -> Self {
        let mut rows = Self::zeros(values.len());
        rows.copy_from_slice(values);
        rows
    }
}
impl std::ops::Deref for Rows {
    type Target = [f64];
    #[inline(always)]
    fn deref(&self) -> &[f64] {
        &self.data[self.offset..self.offset + self.length]
    }
}
impl std::ops::DerefMut for Rows {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.data[self.offset..self.offset + self.length]
    }
}

/// Most local points of a chunk: their numbers have 16 bits.
pub(crate) const MOST_LOCAL: usize = 1 << 16;

/// The arrays of one chunk. Local points: the `owned` ones first, then the halo (other points, and mirror images).
///
/// On a lattice the arrays with an entry for each bond, and the rows of displacements, are made when something asks for them (`make_lists`).
pub struct Chunk<const D: usize> {
    /// First point (in sorted order) that the chunk owns.
    pub(crate) first: usize,
    /// Number of owned points.
    pub(crate) owned: usize,
    /// Sorted index of each local point.
    pub(crate) points: Vec<u32>,
    /// Reflected components of each local point.
    pub(crate) flips: Vec<u8>,
    pub(crate) coordinates: Rows,
    pub(crate) horizon: Vec<f64>,
    /// Whether bonds have an influence of their own, and how many sub-horizons they are divided among.
    weighted: bool,
    pub(crate) sub_horizons: usize,
    pub(crate) start: Vec<u32>,
    /// Bonds of each owned point, broken ones included, padding not.
    pub(crate) count: Vec<u32>,
    /// Local point of each bond slot; a chunk has at most [`MOST_LOCAL`].
    pub(crate) neighbor: Vec<u16>,
    pub(crate) length: Vec<f64>,
    pub(crate) weight: Vec<f64>,
    pub(crate) intact: Vec<u8>,
    /// One bit a bond slot for each sub-horizon, one sub-horizon after the other.
    pub(crate) membership: Vec<u8>,
    pub(crate) temperature: Vec<f64>,
    pub(crate) displacement: Rows,
    pub(crate) velocity: Rows,
    /// The force on the halo at the last evaluation, `D` words a point: it belongs to other chunks' points.
    pub(crate) halo_force: Vec<f64>,
    /// Bonds stretched beyond a limit at the displacements of the last force evaluation, as owned point, slot and stretch: on lattices.
    pub(crate) stretched: Vec<(usize, usize, f64)>,
    pub(crate) memory: Vec<f64>,
    pub(crate) memory_words: usize,
    pub(crate) bond_memory: Vec<f64>,
    pub(crate) time: f64,
    /// The local points on a lattice, where they lie on one; lengths are then not stored.
    pub(crate) lattice: Option<LatticePoints<D>>,
}

impl<const D: usize> Chunk<D> {
    /// Builds the arrays of the points `first..first + owned`. `seen` maps sorted index to local index during the call: as
    /// long as there are points, all `u32::MAX` before and after. `None` where there are more local points than 16 bits count.
    pub(crate) fn new(
        first: usize,
        owned: usize,
        position: &[[f64; 3]],
        volume: &[f64],
        horizon: &[f64],
        weighted: bool,
        sub_horizons: usize,
        links: impl Fn(usize, &mut Vec<Link>),
        seen: &mut [u32],
    ) -> Option<Self> {
        let mut c = Chunk {
            first,
            owned,
            points: (first..first + owned).map(|p| p as u32).collect(),
            flips: vec![0; owned],
            coordinates: Rows::default(),
            horizon: vec![],
            weighted,
            sub_horizons,
            start: vec![0],
            count: vec![],
            neighbor: vec![],
            length: vec![],
            weight: vec![],
            intact: vec![],
            membership: vec![],
            temperature: vec![],
            displacement: Rows::default(),
            velocity: Rows::default(),
            halo_force: vec![],
            stretched: vec![],
            memory: vec![],
            memory_words: 0,
            bond_memory: vec![],
            time: 0.0,
            lattice: None,
        };
        let mut ends: Vec<[f64; 3]> = position[first..first + owned].to_vec();
        for p in first..first + owned {
            seen[p] = (p - first) as u32;
        }
        // mirror images are rare: a map of their own
        let mut images = std::collections::HashMap::new();
        let mut family = vec![];
        let mut sets = vec![];
        for p in first..first + owned {
            if c.points.len() > MOST_LOCAL {
                break;
            }
            family.clear();
            links(p, &mut family);
            c.count.push(family.len() as u32);
            for link in &family {
                let fresh = c.points.len() as u32;
                let known = if link.flips == 0 {
                    &mut seen[link.point as usize]
                } else {
                    images.entry((link.point, link.flips)).or_insert(u32::MAX)
                };
                if *known == u32::MAX {
                    *known = fresh;
                    c.points.push(link.point);
                    c.flips.push(link.flips);
                    ends.push(link.end);
                }
                c.neighbor.push(*known as u16);
                if weighted {
                    c.weight.push(link.weight);
                }
                if sub_horizons > 0 {
                    sets.push(link.sets);
                }
            }
            // the last block is filled with copies of the last bond, so that every lane computes with sane numbers
            let slots = c.neighbor.len().next_multiple_of(8);
            for s in (*c.start.last().expect("starts with 0") as usize..slots).step_by(8) {
                let real = (c.start[c.start.len() - 1] as usize + family.len()).saturating_sub(s).min(8);
                c.intact.push(((1u16 << real) - 1) as u8);
            }
            if let Some(&last) = c.neighbor.last() {
                c.neighbor.resize(slots, last);
                if weighted {
                    c.weight.resize(slots, *c.weight.last().expect("as many as neighbours"));
                }
                if sub_horizons > 0 {
                    sets.resize(slots, 0);
                }
            }
            c.start.push(slots as u32);
        }
        for p in &c.points {
            seen[*p as usize] = u32::MAX;
        }
        if c.points.len() > MOST_LOCAL {
            return None;
        }
        // from a byte a bond to a bit a bond and sub-horizon: the lanes of eight bonds then come as one byte
        c.membership = (0..sub_horizons)
            .flat_map(|k| sets.chunks(8).map(move |block: &[u8]| (0..8).fold(0, |m, l| m | (block[l] >> k & 1) << l)))
            .collect();
        c.sort_halo(&mut ends);
        let mut coordinates = Vec::with_capacity(c.points.len() * ROW);
        for (l, p) in c.points.iter().enumerate() {
            let mut row = [0.0; ROW];
            row[..D].copy_from_slice(&ends[l][..D]);
            row[VOLUME_WORD] = volume[*p as usize];
            coordinates.extend(row);
        }
        c.horizon = horizon[first..first + owned].to_vec();
        c.coordinates = Rows::of(&coordinates);
        c.neighbor.shrink_to_fit();
        c.weight.shrink_to_fit();
        c.lattice = LatticePoints::find(&c);
        if c.lattice.is_none() {
            c.store_lengths();
            c.make_rows();
        } else {
            c.drop_lists();
        }
        Some(c)
    }

    /// Rows for displacements: where families are taken from a lattice not before something else asks for them.
    fn make_rows(&mut self) {
        let words = self.points.len() * ROW;
        if self.displacement.len() < words {
            self.displacement = Rows::zeros(words);
            if let Some(lattice) = &self.lattice {
                for l in 0..self.points.len() {
                    self.displacement[l * ROW + SPARE_WORD] = lattice.word(l);
                }
            }
        }
    }

    /// Number of bond slots.
    pub(crate) fn slot_count(&self) -> usize {
        self.start.last().map_or(0, |s| *s as usize)
    }

    fn has_lists(&self) -> bool {
        self.neighbor.len() == self.slot_count()
    }

    /// Makes the arrays with an entry for each bond where a lattice has stood for them; whether it had.
    pub(crate) fn make_lists(&mut self) -> bool {
        if self.has_lists() {
            return false;
        }
        if let Some(lattice) = &self.lattice {
            (self.neighbor, self.weight, self.membership) = lattice.lists(&self.start, self.weighted, self.sub_horizons);
        }
        true
    }

    /// Computes with lists that nobody keeps.
    pub(crate) fn with_lists<T>(&self, f: impl FnOnce(&Configuration<'_, f64>) -> T) -> T {
        match &self.lattice {
            Some(lattice) if !self.has_lists() => {
                let (neighbor, weight, membership) = lattice.lists(&self.start, self.weighted, self.sub_horizons);
                f(&Configuration { neighbor: &neighbor, weight: &weight, membership: &membership, ..self.configuration() })
            }
            _ => f(&self.configuration()),
        }
    }

    /// Computes with lists of the families of some owned points, ascending; other families are empty where the lattice stands for lists.
    pub(crate) fn with_lists_of<T>(&self, points: &[u32], f: impl FnOnce(&Configuration<'_, f64>) -> T) -> T {
        let Some(lattice) = self.lattice.as_ref().filter(|_| !self.has_lists()) else { return f(&self.configuration()) };
        let mut wanted = points.iter().peekable();
        let (mut start, mut intact) = (vec![0], vec![]);
        for i in 0..self.owned {
            if wanted.next_if(|p| **p as usize == i).is_some() {
                intact.extend(&self.intact[self.start[i] as usize / 8..self.start[i + 1] as usize / 8]);
            }
            start.push(8 * intact.len() as u32);
        }
        let (neighbor, weight, membership) = lattice.lists(&start, self.weighted, self.sub_horizons);
        f(&Configuration {
            start: &start,
            neighbor: &neighbor,
            weight: &weight,
            membership: &membership,
            intact: &intact,
            ..self.configuration()
        })
    }

    /// Gives back what [`make_lists`](Self::make_lists) and displacements by rows take, on a lattice.
    pub(crate) fn drop_lists(&mut self) {
        if self.lattice.is_some() {
            (self.neighbor, self.weight, self.membership) = (vec![], vec![], vec![]);
            self.displacement = Rows::default();
        }
    }

    /// Computes with lists, and with rows of these displacements, which are there afterwards only if they were before.
    pub(crate) fn listed<T>(&mut self, u: &[f64], v: Option<&[f64]>, f: impl FnOnce(&Self) -> T) -> T {
        let made = self.make_lists();
        self.forward(u, v);
        let result = f(self);
        if made {
            self.drop_lists();
        }
        result
    }

    /// Brings the halo into the order of the body, so that exchange goes through memory in order.
    fn sort_halo(&mut self, ends: &mut [[f64; 3]]) {
        let mut order: Vec<u32> = (self.owned as u32..self.points.len() as u32).collect();
        order.sort_unstable_by_key(|&l| (self.flips[l as usize], self.points[l as usize]));
        let old = (self.points.clone(), self.flips.clone(), ends.to_vec());
        let mut place: Vec<u32> = (0..self.points.len() as u32).collect();
        for (k, &l) in order.iter().enumerate() {
            let new = self.owned + k;
            place[l as usize] = new as u32;
            (self.points[new], self.flips[new], ends[new]) = (old.0[l as usize], old.1[l as usize], old.2[l as usize]);
        }
        for far in &mut self.neighbor {
            *far = place[*far as usize] as u16;
        }
    }

    /// Stores the lengths of the bonds.
    fn store_lengths(&mut self) {
        self.length = vec![0.0; self.neighbor.len()];
        for i in 0..self.owned {
            for s in self.start[i] as usize..self.start[i + 1] as usize {
                self.length[s] = self.xi(i, s)[..D].iter().map(|x| x * x).sum::<f64>().sqrt();
            }
        }
    }

    /// Forgets the lattice, where the materials have no use for it.
    pub(crate) fn leave_lattice(&mut self) {
        if self.lattice.is_some() {
            self.make_lists();
            self.make_rows();
            self.lattice = None;
            self.store_lengths();
        }
    }

    /// A bond slot of owned point `i` breaks.
    pub(crate) fn break_bond(&mut self, i: usize, slot: usize) {
        self.intact[slot / 8] &= !(1 << (slot % 8));
        if let Some(lattice) = &mut self.lattice {
            lattice.clear(i, slot - self.start[i] as usize);
        }
    }

    /// Other bonds are intact than before.
    pub(crate) fn restore_bonds(&mut self, intact: &[u8]) {
        if self.intact == intact {
            return;
        }
        self.intact.copy_from_slice(intact);
        if let Some(mut lattice) = self.lattice.take() {
            lattice.remask(self);
            self.lattice = Some(lattice);
        }
    }

    /// The view that families borrow.
    pub(crate) fn configuration(&self) -> Configuration<'_, f64> {
        self.view(&self.displacement)
    }

    /// The view with displacements of another number type.
    pub(crate) fn view<'a, R>(&'a self, displacement: &'a [R]) -> Configuration<'a, R> {
        Configuration {
            time: self.time,
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
            membership: &self.membership,
            memory: &self.memory,
            memory_words: self.memory_words,
            bond_memory: &self.bond_memory,
            lattice: Lattice::NONE,
        }
    }

    /// Spreads a field of the body (`D` words a point, sorted order) to the rows of the local points.
    pub(crate) fn fill_rows<R: Scalar>(points: &[u32], flips: &[u8], rows: &mut [R], value: impl Fn(usize) -> R) {
        for (l, (&p, &flip)) in points.iter().zip(flips).enumerate() {
            for k in 0..D {
                let x = value(p as usize * D + k);
                rows[l * ROW + k] = if flip >> k & 1 == 1 { -x } else { x };
            }
        }
    }

    /// Displacements (and velocities, where a material looks at them) of the body in the rows of the local points.
    pub(crate) fn forward(&mut self, u: &[f64], v: Option<&[f64]>) {
        self.make_rows();
        Self::fill_rows(&self.points, &self.flips, &mut self.displacement, |q| u[q]);
        if let (false, Some(v)) = (self.velocity.is_empty(), v) {
            Self::fill_rows(&self.points, &self.flips, &mut self.velocity, |q| v[q]);
        } else {
            self.velocity.fill(0.0);
        }
    }

    /// Room for the force on the halo, which stays until the chunks that own its points fetch it.
    pub(crate) fn halo_force(&mut self) -> &mut [f64] {
        self.halo_force.resize((self.points.len() - self.owned) * D, 0.0);
        &mut self.halo_force
    }

    /// Keeps the bonds, given as owned point and bond of the stencil, that were found stretched, at displacements in planes.
    pub(crate) fn note_stretched(&mut self, planes: &[f64], bonds: &[(u32, u32)]) {
        let mut stretched = std::mem::take(&mut self.stretched);
        if let Some(lattice) = &self.lattice {
            lattice.stretches(self, planes, bonds, &mut stretched);
        }
        self.stretched = stretched;
    }

    /// The least threshold of the local points, given one per point of the body: no bond breaks below it.
    pub(crate) fn least(&self, critical: &[f64]) -> f64 {
        self.points.iter().fold(f64::INFINITY, |m, &p| m.min(critical[p as usize]))
    }

    /// The bond slots of owned point `i`, padding excluded.
    #[inline]
    pub(crate) fn slots(&self, i: usize) -> std::ops::Range<usize> {
        let a = self.start[i] as usize;
        a..a + self.count[i] as usize
    }

    /// Whether a slot is intact.
    #[inline]
    pub(crate) fn is_intact(&self, slot: usize) -> bool {
        physics::scalar::is_intact(&self.intact, slot)
    }

    /// Number of intact bonds of owned point `i`: eight at a time, and padding counts as broken.
    pub(crate) fn intact_bonds(&self, i: usize) -> usize {
        self.intact[self.start[i] as usize / 8..self.start[i + 1] as usize / 8].iter().map(|bits| bits.count_ones() as usize).sum()
    }

    /// The owned point of a slot.
    pub(crate) fn point_of(&self, slot: usize) -> usize {
        self.start.partition_point(|&s| s as usize <= slot) - 1
    }

    /// The local point at the far end of a slot of owned point `i`.
    #[inline]
    pub(crate) fn far(&self, i: usize, slot: usize) -> usize {
        match &self.lattice {
            Some(lattice) if !self.has_lists() => lattice.far(i, slot - self.start[i] as usize),
            _ => self.neighbor[slot] as usize,
        }
    }

    /// Influence of a slot of owned point `i`, where it is not constant.
    pub(crate) fn influence(&self, i: usize, slot: usize) -> Option<f64> {
        self.weighted.then(|| match &self.lattice {
            Some(lattice) if !self.has_lists() => lattice.bond(i, slot - self.start[i] as usize).weight,
            _ => self.weight[slot],
        })
    }

    /// The sub-horizons of a slot of owned point `i`, a bit each, where the family has any.
    pub(crate) fn sets(&self, i: usize, slot: usize) -> Option<u8> {
        let bit = |k: usize| u8::from(physics::scalar::is_intact(&self.membership[k * self.intact.len()..], slot)) << k;
        (self.sub_horizons > 0).then(|| match &self.lattice {
            Some(lattice) if !self.has_lists() => lattice.bond(i, slot - self.start[i] as usize).sets,
            _ => (0..self.sub_horizons).map(bit).sum(),
        })
    }

    /// Reference bond vector of a slot of owned point `i`.
    #[inline]
    pub(crate) fn xi(&self, i: usize, slot: usize) -> [f64; 3] {
        let (a, b) = (i * ROW, self.far(i, slot) * ROW);
        std::array::from_fn(|k| self.coordinates[b + k] - self.coordinates[a + k])
    }

    /// Volume of local point `l`.
    #[inline]
    pub(crate) fn volume(&self, l: usize) -> f64 {
        self.coordinates[l * ROW + VOLUME_WORD]
    }

    /// Bytes held for bonds and for points.
    pub(crate) fn bytes(&self) -> (usize, usize) {
        let bonds = self.neighbor.len() * 2
            + (self.length.len() + self.weight.len() + self.bond_memory.len()) * 8
            + self.intact.len()
            + self.membership.len();
        let rows = self.coordinates.len() + self.displacement.len() + self.velocity.len() + self.halo_force.len();
        let points =
            (rows + self.horizon.len() + self.temperature.len() + self.memory.len()) * 8 + self.points.len() * 5 + self.start.len() * 8;
        let lattice = self.lattice.as_ref().map_or((0, 0), LatticePoints::bytes);
        (bonds + lattice.0, points + lattice.1)
    }
}
