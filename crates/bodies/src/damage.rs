//! Bond breaking: criteria, the breaking itself with everything that follows from it, and going back.

use crate::body::{Body, on_lattice};
use crate::chunk::Chunk;
use physics::family::Family;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// When a bond breaks. Thresholds are per point (sorted order); a bond's threshold is the mean of its two points', infinite
/// where one of them is.
#[derive(Clone, Debug)]
pub enum Criterion {
    /// Stretch s = e/|ξ| above the critical stretch.
    CriticalStretch(Vec<f64>),
    /// Bond energy `(T[x]⟨ξ⟩ − T[x′]⟨−ξ⟩)·η/2` above the critical bond energy (Foster, Silling & Chen, Int. J. Multiscale
    /// Comput. Eng. 9 (2011) 675–688), for bonds in tension.
    CriticalBondEnergy(Vec<f64>),
}

/// Displacements, and velocities where a material looks at them.
pub type State<'a> = (&'a [f64], Option<&'a [f64]>);

/// A directed bond.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct BondId {
    chunk: u32,
    slot: u32,
}

/// What a round of breaking did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Broken {
    /// Directed bonds that broke, both directions of a pair counted.
    pub bonds: usize,
    /// Points whose family became singular: all their bonds were released.
    pub released: usize,
}

/// What breaking did to the energy that the families store, at the displacements at which bonds broke.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BreakingEnergy {
    /// Σ V (W before − W after) \[J\].
    pub released: f64,
    /// Σ V (W after − W before) over the families that store more than before \[J\]: the part of `released` that has the wrong sign.
    pub raised: f64,
}

/// Damage to go back to.
#[derive(Clone, Debug, Default)]
pub struct DamageState {
    intact: Vec<Vec<u8>>,
    memory: Vec<(Vec<f64>, Vec<f64>)>,
}

impl<const D: usize> Body<D> {
    /// How far each bond is beyond its threshold: calls for the bonds with ratio > 1, as (bond, ratio), in the order of
    /// the chunks and slots.
    pub fn exceeding(&mut self, u: &[f64], v: Option<&[f64]>, criterion: &Criterion) -> Vec<(BondId, f64)> {
        match criterion {
            Criterion::CriticalStretch(critical) => {
                self.spaces.ready();
                let (parts, spaces) = (&self.parts, &self.spaces);
                self.chunks.par_iter_mut().enumerate().with_max_len(1).for_each(|(k, c)| {
                    if let (true, Some(lattice)) = (on_lattice(parts, k, c), &c.lattice) {
                        let planes = &mut spaces.own().displacement;
                        let planes = planes.at_least(lattice.words());
                        lattice.fill(&c.points, &c.flips, u, planes);
                        let found = lattice.find_stretched(c.least(critical), planes);
                        c.note_stretched(planes, &found);
                        return;
                    }
                    c.make_lists();
                    c.forward(u, v);
                });
                self.exceeding_at_force(critical)
            }
            Criterion::CriticalBondEnergy(critical) => {
                self.forward(u, v);
                let half: Vec<Vec<f64>> = self
                    .chunks
                    .par_iter()
                    .enumerate()
                    .with_max_len(1)
                    .map(|(k, c)| {
                        let mut out = vec![0.0; c.slot_count()];
                        let (view, mut family) = (c.configuration(), vec![]);
                        for i in 0..c.owned {
                            self.parts.iter().for_each(|part| part.half_bond_energies_at(k, i, &view, &mut family));
                            family.drain(..).for_each(|(slot, energy)| out[slot] = energy);
                        }
                        out
                    })
                    .collect();
                self.exceeding_by(critical, |k, c, found| {
                    let view = c.configuration();
                    for i in 0..c.owned {
                        Family::<f64, D>::new(&view, i).each(|b| {
                            if b.extension().0 <= 0.0 {
                                return;
                            }
                            let back = self.reverse(BondId { chunk: k as u32, slot: b.slot() as u32 });
                            let other = back.map_or(0.0, |r| half[r.chunk as usize][r.slot as usize]);
                            found(i, b.slot(), half[k][b.slot()] + other);
                        });
                    }
                })
            }
        }
    }

    /// The bonds beyond their critical stretch (per point) at the displacements of the last force evaluation, which watched it
    /// ([`internal_force_watching`](Self::internal_force_watching)).
    pub fn exceeding_at_force(&self, critical: &[f64]) -> Vec<(BondId, f64)> {
        let mut found = self.exceeding_by(critical, |k, c, found| {
            if on_lattice(&self.parts, k, c) {
                c.stretched.iter().for_each(|&(i, slot, stretch)| found(i, slot, stretch));
                return;
            }
            let view = c.configuration();
            for i in 0..c.owned {
                Family::<f64, D>::new(&view, i).each(|b| found(i, b.slot(), b.stretch().0));
            }
        });
        // of each pair at least one was found, in any order
        found.extend(found.clone().iter().filter_map(|&(bond, ratio)| Some((self.reverse(bond)?, ratio))));
        found.sort_by_key(|f| f.0);
        found.dedup_by_key(|f| f.0);
        found
    }

    fn exceeding_by(
        &self,
        critical: &[f64],
        measure: impl Fn(usize, &Chunk<D>, &mut dyn FnMut(usize, usize, f64)) + Sync,
    ) -> Vec<(BondId, f64)> {
        let found: Vec<Vec<(BondId, f64)>> = self
            .chunks
            .par_iter()
            .enumerate()
            .with_max_len(1)
            .map(|(k, c)| {
                let mut list = vec![];
                measure(k, c, &mut |i, slot, value| {
                    let far = c.points[c.far(i, slot)] as usize;
                    let threshold = 0.5 * (critical[c.first + i] + critical[far]);
                    if value > threshold {
                        list.push((BondId { chunk: k as u32, slot: slot as u32 }, value / threshold));
                    }
                });
                list
            })
            .collect();
        found.into_iter().flatten().collect()
    }

    /// The same pair seen from the far point, where the far point's family has it.
    pub(crate) fn reverse(&self, bond: BondId) -> Option<BondId> {
        let c = &self.chunks[bond.chunk as usize];
        let i = c.point_of(bond.slot as usize);
        let near = (c.first + i) as u32;
        let l = c.far(i, bond.slot as usize);
        let (far, flips) = (c.points[l] as usize, c.flips[l]);
        let chunk = self.chunks.partition_point(|c| c.first <= far) - 1;
        let other = &self.chunks[chunk];
        let j = far - other.first;
        let slot = other.slots(j).find(|&s| {
            let l = other.far(j, s);
            other.points[l] == near && other.flips[l] == flips
        })?;
        Some(BondId { chunk: chunk as u32, slot: slot as u32 })
    }

    /// The directed bonds of the pairs of these bonds that are intact.
    fn both_ways(&self, bonds: impl IntoIterator<Item = BondId>) -> Vec<BondId> {
        let both = bonds.into_iter().flat_map(|b| [Some(b), self.reverse(b)]).flatten();
        let mut directed: Vec<BondId> = both.filter(|b| self.chunks[b.chunk as usize].is_intact(b.slot as usize)).collect();
        directed.sort_unstable();
        directed.dedup();
        directed
    }

    /// Makes the lists of the chunks of these bonds, and hands them displacements where the body is deformed.
    fn list_chunks(&mut self, bonds: &[BondId], deformed: Option<State>) {
        for same in bonds.chunk_by(|a, b| a.chunk == b.chunk) {
            let c = &mut self.chunks[same[0].chunk as usize];
            c.make_lists();
            deformed.into_iter().for_each(|(u, v)| c.forward(u, v));
        }
    }

    /// Energy of the pairs of these bonds that are intact, each pair once: `Σ (T[x]⟨ξ⟩ − T[x′]⟨−ξ⟩)·η/2 V V′`, in a state \[J\].
    pub fn bond_energies(&mut self, bonds: impl IntoIterator<Item = BondId>, state: State) -> f64 {
        let directed = self.both_ways(bonds);
        self.list_chunks(&directed, Some(state));
        let (mut sum, mut family, mut values) = (0.0, None, vec![]);
        for b in directed {
            let (k, slot) = (b.chunk as usize, b.slot as usize);
            let c = &self.chunks[k];
            let i = c.point_of(slot);
            if family != Some((k, i)) {
                family = Some((k, i));
                values.clear();
                self.parts.iter().for_each(|p| p.half_bond_energies_at(k, i, &c.configuration(), &mut values));
            }
            let half = values.iter().find(|v| v.0 == slot).map_or(0.0, |v| v.1);
            sum += half * c.volume(i) * c.volume(c.far(i, slot));
        }
        sum
    }

    /// Breaks bonds, both directions of each, and rebuilds the shapes of the touched points. A point whose family has
    /// become singular is released: its remaining bonds break too, and so on until no family is singular.
    pub fn break_bonds(&mut self, bonds: impl IntoIterator<Item = BondId>) -> Broken {
        self.breaking(bonds, None).0
    }

    /// The same in a deformed body, with the energies of the touched families before and after.
    pub fn break_deformed_bonds(&mut self, bonds: impl IntoIterator<Item = BondId>, state: State) -> (Broken, BreakingEnergy) {
        self.breaking(bonds, Some(state))
    }

    fn breaking(&mut self, bonds: impl IntoIterator<Item = BondId>, state: Option<State>) -> (Broken, BreakingEnergy) {
        let mut broken = Broken::default();
        let mut energy = BreakingEnergy::default();
        let deformed = state.is_some();
        let mut queue: Vec<BondId> = bonds.into_iter().collect();
        // what families stored before they became singular
        let mut singular: BTreeMap<(usize, usize), f64> = BTreeMap::new();
        while !queue.is_empty() {
            let all = self.both_ways(queue.drain(..));
            self.list_chunks(&all, state);
            let mut touched: Vec<(usize, usize)> =
                all.iter().map(|b| (b.chunk as usize, self.chunks[b.chunk as usize].point_of(b.slot as usize))).collect();
            touched.dedup();
            let before: Vec<f64> = match deformed {
                true => touched.iter().map(|&at| singular.remove(&at).unwrap_or_else(|| self.energy_at(at))).collect(),
                false => vec![0.0; touched.len()],
            };
            for b in &all {
                let c = &mut self.chunks[b.chunk as usize];
                c.break_bond(c.point_of(b.slot as usize), b.slot as usize);
            }
            broken.bonds += all.len();
            for ((k, i), before) in touched.into_iter().zip(before) {
                let c = &self.chunks[k];
                let view = c.configuration();
                let regular = self.parts.iter_mut().all(|p| p.reshape(k, i, &view));
                let left: Vec<usize> = c.slots(i).filter(|&s| c.is_intact(s)).collect();
                if deformed && (regular || left.is_empty()) {
                    // a family without bonds stores nothing, whatever its last shape
                    let after = if left.is_empty() { 0.0 } else { self.energy_at((k, i)) };
                    let volume = self.chunks[k].volume(i);
                    energy.released += (before - after) * volume;
                    energy.raised += (after - before).max(0.0) * volume;
                } else if deformed {
                    // what it stores is asked for when the rest of it is broken
                    singular.insert((k, i), before);
                }
                if !regular && !left.is_empty() {
                    broken.released += 1;
                    queue.extend(left.into_iter().map(|s| BondId { chunk: k as u32, slot: s as u32 }));
                }
            }
        }
        (broken, energy)
    }

    /// Energy density of the family of a local point, at the displacements last handed out \[J/m³\].
    fn energy_at(&self, (k, i): (usize, usize)) -> f64 {
        let view = self.chunks[k].configuration();
        self.parts.iter().find_map(|p| p.energy_density_at(k, i, &view)).unwrap_or(0.0)
    }

    /// Breaks the bonds for which `cut(near, far)` holds (reference positions of their ends): pre-cracks.
    pub fn cut(&mut self, cut: impl Fn([f64; 3], [f64; 3]) -> bool + Sync) -> Broken {
        let found: Vec<Vec<BondId>> = self
            .chunks
            .par_iter()
            .enumerate()
            .with_max_len(1)
            .map(|(k, c)| {
                let mut list = vec![];
                for i in 0..c.owned {
                    let near = self.position()[c.first + i];
                    for s in c.slots(i) {
                        let xi = c.xi(i, s);
                        if c.is_intact(s) && cut(near, std::array::from_fn(|k| near[k] + xi[k])) {
                            list.push(BondId { chunk: k as u32, slot: s as u32 });
                        }
                    }
                }
                list
            })
            .collect();
        self.break_bonds(found.into_iter().flatten())
    }

    /// The two ends (sorted index) of a bond.
    pub fn ends(&self, bond: BondId) -> (usize, usize) {
        let c = &self.chunks[bond.chunk as usize];
        let i = c.point_of(bond.slot as usize);
        (c.first + i, c.points[c.far(i, bond.slot as usize)] as usize)
    }

    /// Number of intact directed bonds.
    pub fn intact_bonds(&self) -> usize {
        self.chunks.iter().map(|c| c.intact.iter().map(|b| b.count_ones() as usize).sum::<usize>()).sum()
    }

    /// Remembers damage and history.
    pub fn save_damage(&mut self, state: &mut DamageState) {
        state.intact = self.chunks.iter().map(|c| c.intact.clone()).collect();
        state.memory = self.chunks.iter().map(|c| (c.memory.clone(), c.bond_memory.clone())).collect();
        for p in &mut self.parts {
            p.save_shapes();
        }
    }

    /// Goes back to remembered damage and history.
    pub fn restore_damage(&mut self, state: &DamageState) {
        for (c, (intact, memory)) in self.chunks.iter_mut().zip(state.intact.iter().zip(&state.memory)) {
            c.restore_bonds(intact);
            c.memory.clone_from(&memory.0);
            c.bond_memory.clone_from(&memory.1);
        }
        for p in &mut self.parts {
            p.restore_shapes();
        }
    }
}
