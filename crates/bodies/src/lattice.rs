//! A chunk whose points lie on a lattice: planes instead of rows, a stencil instead of lists.
//!
//! Points are numbered by the cells of the box that holds them, rows along the last axis. Eight cells that begin at a multiple of eight are
//! a group: one number of the force loop holds one bond of all its points, and their far points are eight cells in a row as well. A byte for
//! each group and bond of the stencil says which of the points have the bond; breaking a bond clears its bit.

use crate::chunk::{Chunk, Rows};
use crate::places::{EXACT, Places};
use physics::family::{Configuration, Family, Lattice, StencilBond, Undeformed};
use physics::lanes::{Abreast, GroupKernel, WIDTH, widest_abreast};
use physics::scalar::{ROW, VOLUME_WORD};
use physics::tensor::Vector;
use std::collections::HashMap;

/// Share of the box that must be filled, and of the lanes of the groups' bonds that must be bonds. Empty cells cost memory and little else.
const FILLED: f64 = 1.0 / 16.0;
const BUSY: f64 = 0.4;
/// No point.
pub(crate) const NOBODY: u32 = u32::MAX;

/// Eight cells.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Group {
    /// The first of them.
    pub(crate) cell: u32,
    /// The owned points in them, or [`NOBODY`].
    pub(crate) points: [u32; WIDTH],
}

/// Local points that are neighbours in the body's order and on the lattice alike.
#[derive(Clone, Copy, Debug)]
struct Run {
    local: u32,
    cell: u32,
    length: u32,
}

/// The points of a chunk on a lattice.
pub struct LatticePoints<const D: usize> {
    stencil: Vec<StencilBond>,
    /// How many bonds of the stencil come first of which none is the opposite of another: half of them, where each has its opposite.
    half: usize,
    /// Whether pairwise models take each pair at one of its ends only: every pair of the body is then seen from both, by two bonds that are
    /// opposite (the bonds of two mirror images are not).
    pub(crate) once: bool,
    /// Bond of the stencil for each offset from −reach to reach, or [`NOBODY`].
    by_offset: Vec<u32>,
    /// Cell of each local point.
    cell: Vec<u32>,
    /// Local point of each cell; 0 where there is none, which nobody asks for.
    local: Vec<u16>,
    /// The pattern of each owned point: families of one pattern have, broken or not, the same bonds of the stencil.
    pattern: Vec<u32>,
    /// The bonds of each pattern, in the order of the stencil, which is the order of the slots.
    pattern_start: Vec<u32>,
    pattern_bonds: Vec<u16>,
    runs: Vec<Run>,
    pub(crate) groups: Vec<Group>,
    /// Group of each eight cells, or [`NOBODY`].
    group_of: Vec<u32>,
    /// For each group and bond of the stencil the points that have the bond, one bit each.
    mask: Vec<u8>,
    /// Cells, margins included: the length of a plane.
    cells: usize,
    /// The cells between the margins: nothing acts on others.
    inner: std::ops::Range<usize>,
    volume: Rows,
    /// The words of pairwise models, or empty (what a view then has in its place nobody reads).
    word: Rows,
}

impl<const D: usize> LatticePoints<D> {
    /// The lattice of a chunk, where its points lie on one that is worth it and its bonds are the same everywhere.
    pub(crate) fn find(c: &Chunk<D>) -> Option<Self> {
        let place = Numbers::<D>::of(c)?;
        let low: [i64; D] = std::array::from_fn(|k| place.of_point.iter().map(|x| x[k]).min().unwrap_or(0));
        let extent: [usize; D] = std::array::from_fn(|k| (place.of_point.iter().map(|x| x[k]).max().unwrap_or(0) - low[k]) as usize + 1);
        let all = extent.iter().try_fold(1usize, |n, &e| n.checked_mul(e))?;
        if (c.points.len() as f64) < FILLED * all as f64 {
            return None;
        }
        // the box begins where the owned points fill the fewest groups
        let along = D - 1;
        let key = |x: &[i64; D]| (0..along).fold(0, |r, k| r * extent[k] + (x[k] - low[k]) as usize);
        let shift = (0..WIDTH)
            .min_by_key(|shift| {
                let mut groups: Vec<(usize, usize)> =
                    place.of_point[..c.owned].iter().map(|x| (key(x), ((x[along] - low[along]) as usize + shift) / WIDTH)).collect();
                groups.sort_unstable();
                groups.dedup();
                groups.len()
            })
            .unwrap_or(0);
        // rows of whole cache lines, and an odd number of them from layer to layer, so that the rows of a family do not fall on the same few
        // sets of the cache
        let lines = (extent[along] + shift).div_ceil(WIDTH);
        let stride: [usize; D] = match D {
            1 => [1; D],
            2 => std::array::from_fn(|k| if k == along { 1 } else { WIDTH * (lines | 1) }),
            _ => std::array::from_fn(
                |k| if k == along { 1 } else { WIDTH * if k + 1 == along { lines } else { (lines * extent[k + 1]) | 1 } },
            ),
        };
        let length = stride[0].checked_mul(extent[0])?.max(lines * WIDTH).next_multiple_of(WIDTH);
        if length > i32::MAX as usize / 8 {
            return None;
        }
        let mut cell: Vec<u32> =
            place.of_point.iter().map(|x| ((0..D).map(|k| (x[k] - low[k]) as usize * stride[k]).sum::<usize>() + shift) as u32).collect();
        let offsets = (0..c.owned).flat_map(|i| c.slots(i).map(move |s| (i, s)));
        let reach = offsets.fold(0, |m, (i, s)| m.max(cell[c.neighbor[s] as usize].abs_diff(cell[i]))) as usize;
        // in front of the first row and behind the last: a group of eight looks that far although some of its points do not
        let margin = (reach + WIDTH).next_multiple_of(WIDTH);
        cell.iter_mut().for_each(|q| *q += margin as u32);
        let cells = spread_planes(margin + length + margin);
        let mut taken = vec![false; cells];
        for &q in &cell {
            // two points in one place
            if std::mem::replace(&mut taken[q as usize], true) {
                return None;
            }
        }
        let mut lattice = LatticePoints {
            stencil: vec![],
            half: 0,
            once: false,
            by_offset: vec![],
            runs: runs(c, &cell),
            local: vec![0; cells],
            pattern: vec![],
            pattern_start: vec![0],
            pattern_bonds: vec![],
            cell,
            groups: vec![],
            group_of: vec![NOBODY; cells / WIDTH],
            mask: vec![],
            cells,
            inner: margin..margin + length,
            volume: Rows::zeros(cells),
            word: Rows::default(),
        };
        lattice.make_stencil(c, &place, reach)?;
        for i in 0..c.owned {
            let q = lattice.cell[i] as usize;
            let group = &mut lattice.group_of[q / WIDTH];
            if *group == NOBODY {
                *group = lattice.groups.len() as u32;
                lattice.groups.push(Group { cell: (q / WIDTH * WIDTH) as u32, points: [NOBODY; WIDTH] });
            }
            lattice.groups[*group as usize].points[q % WIDTH] = i as u32;
        }
        for (l, &q) in lattice.cell.iter().enumerate() {
            lattice.volume[q as usize] = c.coordinates[l * ROW + VOLUME_WORD];
            lattice.local[q as usize] = l as u16;
        }
        lattice.make_patterns(c)?;
        lattice.remask(c);
        let bonds: usize = c.count.iter().map(|&n| n as usize).sum();
        let lanes = WIDTH * lattice.mask.iter().filter(|m| **m != 0).count();
        (bonds as f64 >= BUSY * lanes as f64).then_some(lattice)
    }

    /// The bonds of all points, as long as they are the same: place, influence and sub-horizons.
    fn make_stencil(&mut self, c: &Chunk<D>, place: &Numbers<D>, reach: usize) -> Option<()> {
        let mut of_offset = vec![NOBODY; 2 * reach + 1];
        let planes = if c.neighbor.is_empty() { 0 } else { c.membership.len() / (c.neighbor.len() / 8) };
        let plain = planes == 0 && c.weight.is_empty();
        let mut steps: Vec<[i64; D]> = vec![];
        // one number for the place of a point, and so for the step of a bond: most bonds are compared by that alone
        let folded = |x: [i64; D]| x.iter().fold(0i64, |sum, x| sum.wrapping_mul(1 << 20).wrapping_add(*x));
        let folds: Vec<i64> = if place.of_point.iter().flatten().all(|x| x.abs() < 1 << 19) {
            place.of_point.iter().map(|x| folded(*x)).collect()
        } else {
            vec![]
        };
        let mut step_folds: Vec<i64> = vec![];
        for i in 0..c.owned {
            for s in c.slots(i) {
                let far = c.neighbor[s] as usize;
                let offset = self.offset(i, far);
                let known = &mut of_offset[(offset as i64 + reach as i64) as usize];
                if plain && *known != NOBODY && !folds.is_empty() {
                    if step_folds[*known as usize] != folds[far] - folds[i] {
                        return None;
                    }
                    continue;
                }
                let step: [i64; D] = std::array::from_fn(|k| place.of_point[far][k] - place.of_point[i][k]);
                let sets = (0..planes).fold(0, |sets, k| sets | (c.membership[k * c.neighbor.len() / 8 + s / 8] >> (s % 8) & 1) << k);
                let weight = if c.weight.is_empty() { 1.0 } else { c.weight[s] };
                if *known == NOBODY {
                    step_folds.push(folded(step));
                    *known = self.stencil.len() as u32;
                    let xi: [f64; 3] = std::array::from_fn(|k| if k < D { step[k] as f64 * place.spacing[k] } else { 0.0 });
                    let length = xi.iter().map(|x| x * x).sum::<f64>().sqrt();
                    self.stencil.push(StencilBond { offset, sets, xi, length, weight });
                    steps.push(step);
                    continue;
                }
                let bond = &self.stencil[*known as usize];
                let same = steps[*known as usize] == step && bond.sets == sets && (bond.weight - weight).abs() <= EXACT * weight.abs();
                if !same {
                    return None;
                }
            }
        }
        // bonds to neighbouring cells of a row far from one another in time: what one stores the other does not wait for
        let along = D - 1;
        let forward = |step: &[i64; D]| step.iter().rev().find(|s| **s != 0).is_some_and(|s| *s > 0);
        let mut order: Vec<usize> = (0..steps.len()).collect();
        order.sort_by_key(|&b| (!forward(&steps[b]), steps[b][along].abs(), steps[b]));
        self.half = steps.iter().filter(|s| forward(s)).count();
        self.stencil = order.iter().map(|&b| self.stencil[b]).collect();
        for (k, bond) in self.stencil.iter().enumerate() {
            of_offset[(bond.offset + reach as i32) as usize] = k as u32;
        }
        self.by_offset = of_offset;
        Some(())
    }

    fn offset(&self, near: usize, far: usize) -> i32 {
        self.cell[far] as i32 - self.cell[near] as i32
    }

    /// Sorts the families by the bonds of the stencil that they have. `None` where the stencil has more bonds than 16 bits count.
    fn make_patterns(&mut self, c: &Chunk<D>) -> Option<()> {
        let last = u16::try_from(self.stencil.len()).ok()?;
        let mut known: HashMap<Vec<u64>, u32> = HashMap::new();
        let mut bonds = vec![0u64; self.stencil.len().div_ceil(64)];
        let middle = self.by_offset.len() / 2;
        for i in 0..c.owned {
            bonds.fill(0);
            let near = self.cell[i] as usize;
            for &far in &c.neighbor[c.slots(i)] {
                let bond = self.by_offset[self.cell[far as usize] as usize + middle - near] as usize;
                bonds[bond / 64] |= 1 << (bond % 64);
            }
            let number = known.get(&bonds).copied().unwrap_or_else(|| {
                let fresh = known.len() as u32;
                known.insert(bonds.clone(), fresh);
                self.pattern_bonds.extend((0..last).filter(|b| bonds[*b as usize / 64] >> (b % 64) & 1 == 1));
                self.pattern_start.push(self.pattern_bonds.len() as u32);
                fresh
            });
            self.pattern.push(number);
        }
        self.pattern_bonds.shrink_to_fit();
        Some(())
    }

    /// The pattern of each owned point: equal numbers, equal bonds of the stencil.
    pub(crate) fn patterns(&self) -> &[u32] {
        &self.pattern
    }

    /// The bonds of the stencil that owned point `i` has or had, in the order of its slots.
    #[inline]
    fn bonds_of(&self, i: usize) -> &[u16] {
        let p = self.pattern[i] as usize;
        &self.pattern_bonds[self.pattern_start[p] as usize..self.pattern_start[p + 1] as usize]
    }

    /// The bond in place `k` of the family of owned point `i`.
    #[inline]
    pub(crate) fn bond(&self, i: usize, k: usize) -> &StencilBond {
        &self.stencil[self.bonds_of(i)[k] as usize]
    }

    /// The local point at the far end of that bond.
    #[inline]
    pub(crate) fn far(&self, i: usize, k: usize) -> usize {
        self.local[self.cell[i].wrapping_add_signed(self.bond(i, k).offset) as usize] as usize
    }

    /// Far points, influence and sub-horizons of all slots as a chunk stores them, given its first slot of each family. Families without slots
    /// are left out.
    pub(crate) fn lists(&self, start: &[u32], weighted: bool, sub_horizons: usize) -> (Vec<u16>, Vec<f64>, Vec<u8>) {
        let slots = start.last().map_or(0, |s| *s as usize);
        let (mut neighbor, mut weight) = (Vec::with_capacity(slots), Vec::with_capacity(if weighted { slots } else { 0 }));
        let mut membership = vec![0; sub_horizons * slots / 8];
        for (i, first) in (0..self.pattern.len()).zip(start).filter(|(i, first)| start[i + 1] > **first) {
            let near = self.cell[i];
            for (&b, s) in self.bonds_of(i).iter().zip(*first as usize..) {
                let bond = &self.stencil[b as usize];
                neighbor.push(self.local[near.wrapping_add_signed(bond.offset) as usize]);
                if weighted {
                    weight.push(bond.weight);
                }
                for k in 0..sub_horizons {
                    membership[(k * slots + s) / 8] |= (bond.sets >> k & 1) << (s % 8);
                }
            }
            // the last block is filled with copies of the last bond
            let end = start[i + 1] as usize;
            if let Some(&last) = neighbor.last() {
                neighbor.resize(end, last);
            }
            if let Some(&last) = weight.last() {
                weight.resize(end, last);
            }
        }
        (neighbor, weight, membership)
    }

    /// The bond in place `k` of the family of owned point `i` has broken.
    pub(crate) fn clear(&mut self, i: usize, k: usize) {
        let bond = self.bonds_of(i)[k] as usize;
        let group = self.group_of[self.cell[i] as usize / WIDTH] as usize;
        self.mask[group * self.stencil.len() + bond] &= !(1 << (self.cell[i] as usize % WIDTH));
    }

    /// The masks of the intact bonds.
    pub(crate) fn remask(&mut self, c: &Chunk<D>) {
        let mut mask = std::mem::take(&mut self.mask);
        mask.clear();
        mask.resize(self.groups.len() * self.stencil.len(), 0);
        for i in 0..c.owned {
            let near = self.cell[i] as usize;
            let group = self.group_of[near / WIDTH] as usize;
            let (masks, bit) = (&mut mask[group * self.stencil.len()..][..self.stencil.len()], 1 << (near % WIDTH));
            for (&bond, _) in self.bonds_of(i).iter().zip(c.slots(i)).filter(|(_, s)| c.is_intact(*s)) {
                masks[bond as usize] |= bit;
            }
        }
        self.mask = mask;
    }

    /// The masks of a group.
    #[inline(always)]
    pub(crate) fn masks(&self, group: u32) -> &[u8] {
        &self.mask[group as usize * self.stencil.len()..][..self.stencil.len()]
    }
    /// Bonds that come before the opposite of any.
    #[inline(always)]
    pub(crate) fn half(&self) -> usize {
        self.half
    }

    /// Cells of a plane.
    #[inline(always)]
    pub(crate) fn cells(&self) -> usize {
        self.cells
    }

    /// Numbers of the planes of displacements, or of forces.
    pub(crate) fn words(&self) -> usize {
        D * self.cells
    }

    /// The view that families borrow, with displacements in planes.
    #[inline(always)]
    pub(crate) fn view<'a>(&'a self, displacement: &'a [f64]) -> Lattice<'a> {
        let n = self.cells;
        let planes = &displacement[..D * n];
        Lattice {
            stencil: &self.stencil,
            displacement: std::array::from_fn(|k| if k < D { &planes[k * n..][..n] } else { &planes[..0] }),
            volume: &self.volume[..n],
            // planes of one length, so that an index is checked once
            word: if self.word.is_empty() { &self.volume[..n] } else { &self.word[..n] },
        }
    }

    /// The arrays that families of points abreast borrow.
    #[inline(always)]
    pub(crate) fn configuration<'a, R>(&'a self, displacement: &'a [f64]) -> Configuration<'a, R> {
        Configuration {
            time: 0.0,
            coordinates: &[],
            displacement: &[],
            velocity: &[],
            horizon: &[],
            temperature: &[],
            start: &[],
            neighbor: &[],
            length: &[],
            weight: &[],
            intact: &[],
            membership: &[],
            memory: &[],
            memory_words: 0,
            bond_memory: &[],
            lattice: self.view(displacement),
        }
    }

    /// |Y|² − |ξ|² over |ξ|² of a stretch, less what round-off may do.
    pub(crate) fn growth_limit(stretch: f64) -> f64 {
        let limit = stretch * (2.0 + stretch);
        limit - EXACT * (1.0 + limit.abs())
    }

    /// Owned point, slot and stretch of bonds, given as owned point and bond of the stencil, at the displacements of the planes.
    pub(crate) fn stretches(&self, c: &Chunk<D>, planes: &[f64], bonds: &[(u32, u32)], out: &mut Vec<(usize, usize, f64)>) {
        let n = self.cells;
        out.clear();
        out.extend(bonds.iter().map(|&(i, bond)| {
            let i = i as usize;
            let near = self.cell[i];
            let far = near.wrapping_add_signed(self.stencil[bond as usize].offset);
            let k = self.bonds_of(i).binary_search(&(bond as u16)).expect("a bond of the point");
            let slot = c.start[i] as usize + k;
            let u = |cell: u32, k: usize| planes[k * n + cell as usize];
            let eta = Vector::<f64, D>(std::array::from_fn(|k| u(far, k) - u(near, k)));
            let xi = c.xi(i, slot);
            (i, slot, stretch(Vector(std::array::from_fn(|k| xi[k])), eta))
        }));
    }

    /// Finds the bonds whose stretch is above `least`, or so near to it that round-off decides, at the displacements of the planes.
    pub(crate) fn find_stretched(&self, least: f64, planes: &[f64]) -> Vec<(u32, u32)> {
        widest_abreast(Stretched { lattice: self, planes, limit: Self::growth_limit(least) })
    }

    /// Keeps the words of pairwise models, one for each local point.
    pub(crate) fn set_words(&mut self, word: impl Fn(usize) -> f64) {
        self.word = Rows::zeros(self.cells);
        for (l, &q) in self.cell.iter().enumerate() {
            self.word[q as usize] = word(l);
        }
    }

    /// The word of a local point; 0 where there is none.
    pub(crate) fn word(&self, local: usize) -> f64 {
        if self.word.is_empty() { 0.0 } else { self.word[self.cell[local] as usize] }
    }

    /// Spreads displacements of the body (`D` words a point, sorted order) to the planes.
    pub(crate) fn fill(&self, points: &[u32], flips: &[u8], u: &[f64], planes: &mut [f64]) {
        let n = self.cells;
        for run in &self.runs {
            let (p, q, m) = (points[run.local as usize] as usize, run.cell as usize, run.length as usize);
            let source = &u[p * D..(p + m) * D];
            let flip = flips[run.local as usize];
            for k in 0..D {
                let sign = if flip >> k & 1 == 1 { -1.0 } else { 1.0 };
                for (x, u) in planes[k * n + q..][..m].iter_mut().zip(source.chunks_exact(D)) {
                    *x = sign * u[k];
                }
            }
        }
    }

    /// The force on the owned points, or on the halo (`D` words a point): local points from `first` on, as many as there is room for.
    pub(crate) fn take_force(&self, first: usize, planes: &[f64], out: &mut [f64]) {
        let n = self.cells;
        // runs end with the owned points
        let begin = self.runs.partition_point(|r| (r.local as usize) < first);
        let end = self.runs.partition_point(|r| (r.local as usize) < first + out.len() / D);
        for run in &self.runs[begin..end] {
            let (l, q, m) = (run.local as usize - first, run.cell as usize, run.length as usize);
            for k in 0..D {
                for (f, x) in out[l * D..(l + m) * D].chunks_exact_mut(D).zip(&planes[k * n + q..][..m]) {
                    f[k] = *x;
                }
            }
        }
    }

    /// Nothing acts on any point.
    pub(crate) fn clear_force(&self, planes: &mut [f64]) {
        planes.chunks_exact_mut(self.cells).for_each(|plane| plane[self.inner.clone()].fill(0.0));
    }

    /// Bytes held for bonds and for points.
    pub(crate) fn bytes(&self) -> (usize, usize) {
        let bonds = self.mask.len() + self.stencil.len() * size_of::<StencilBond>() + self.by_offset.len() * 4;
        let planes = self.volume.len() + self.word.len();
        let patterns = self.pattern.len() * 4 + self.pattern_start.len() * 4 + self.pattern_bonds.len() * 2;
        let points = self.cell.len() * 4
            + self.local.len() * 2
            + patterns
            + self.groups.len() * size_of::<Group>()
            + self.group_of.len() * 4
            + self.runs.len() * size_of::<Run>()
            + planes * 8;
        (bonds, points)
    }
}

/// The length of planes that lie one after the other, at least `cells`: nine cache lines beyond a multiple of 4096 bytes, so that the
/// entries of a cell in seven planes fall on different sets of the first-level cache.
fn spread_planes(cells: usize) -> usize {
    const PERIOD: usize = 512;
    const BEYOND: usize = 72;
    cells.saturating_sub(BEYOND).next_multiple_of(PERIOD) + BEYOND
}

/// (|Y| − |ξ|)/|ξ|, with all digits of a small strain.
fn stretch<const D: usize>(xi: Vector<f64, D>, eta: Vector<f64, D>) -> f64 {
    let y = xi + eta;
    let length = xi.norm();
    eta.dot(xi + y) / ((y.norm() + length) * length)
}

/// Bonds for which |Y|² − |ξ|² is above `limit` |ξ|² or close below, as owned point and bond of the stencil.
struct Stretched<'a, const D: usize> {
    lattice: &'a LatticePoints<D>,
    planes: &'a [f64],
    limit: f64,
}
impl<const D: usize> GroupKernel for Stretched<'_, D> {
    type Output = Vec<(u32, u32)>;
    const PAIRED: bool = true;
    #[inline(always)]
    fn run<S: Abreast>(self) -> Self::Output {
        let lattice = self.lattice;
        let c = lattice.configuration::<S>(self.planes);
        let limit = self.limit;
        let mut found = vec![];
        for (k, groups) in lattice.groups.chunks(S::GROUPS).enumerate() {
            let first = (k * S::GROUPS) as u32;
            // a last group without another stands beside itself, asked for nothing there
            let (second, other) = if groups.len() > 1 { (first + 1, &groups[1]) } else { (first, &groups[0]) };
            let lanes = if groups.len() > 1 { u16::MAX } else { u16::from(u8::MAX) };
            let cells = [groups[0].cell as usize, other.cell as usize];
            let family = Family::<S, D>::abreast(&c, cells, [lattice.masks(first), lattice.masks(second)], lanes);
            family.each(
                #[inline(always)]
                |b| {
                    let square = b.length() * b.length();
                    let beyond = (b.growth() - square * limit).positive() & b.lanes();
                    if beyond != 0 {
                        for l in (0..2 * WIDTH).filter(|l| beyond >> l & 1 == 1) {
                            found.push((groups[l / WIDTH].points[l % WIDTH], b.slot() as u32));
                        }
                    }
                },
            );
        }
        found
    }
}

/// Runs of local points.
fn runs<const D: usize>(c: &Chunk<D>, cell: &[u32]) -> Vec<Run> {
    let mut runs: Vec<Run> = vec![];
    for l in 0..cell.len() {
        if let Some(run) = runs.last_mut()
            && l != c.owned
            && c.points[l] == c.points[l - 1] + 1
            && cell[l] == cell[l - 1] + 1
            && c.flips[l] == c.flips[l - 1]
        {
            run.length += 1;
            continue;
        }
        runs.push(Run { local: l as u32, cell: cell[l], length: 1 });
    }
    runs
}

/// Whole numbers of the points of a lattice.
struct Numbers<const D: usize> {
    spacing: [f64; D],
    of_point: Vec<[i64; D]>,
}

impl<const D: usize> Numbers<D> {
    /// `None` where the points lie on no lattice along the axes.
    fn of(c: &Chunk<D>) -> Option<Self> {
        let n = c.points.len();
        let x = |l: usize, k: usize| c.coordinates[l * ROW + k];
        let mut of_point = vec![[0; D]; n];
        let mut spacing = [0.0; D];
        for k in 0..D {
            let (low, high) = (0..n).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), l| (a.min(x(l, k)), b.max(x(l, k))));
            let round_off = Places::round_off(low, high);
            if !(high - low).is_finite() {
                return None;
            }
            // the shortest way along the axis of the bonds of a few points
            let sample = c.owned.div_ceil(64).max(1);
            let mut step = f64::INFINITY;
            for i in (0..c.owned).step_by(sample) {
                let reach = c.slots(i).map(|s| c.xi(i, s)[k].abs()).fold(0.0, f64::max);
                for d in c.slots(i).map(|s| c.xi(i, s)[k].abs()) {
                    if d > 1e-6 * reach && d > round_off {
                        step = step.min(d);
                    }
                }
            }
            let places = Places::between(low, high, step)?;
            spacing[k] = places.spacing;
            for l in 0..n {
                of_point[l][k] = places.number(x(l, k))? as i64;
            }
        }
        Some(Numbers { spacing, of_point })
    }
}
