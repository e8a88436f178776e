//! Families of equal shape: on a lattice most of them are, and what the reference configuration decides is the same for all.

use crate::body::Body;
use crate::chunk::Chunk;
use physics::scalar::ROW;
use rayon::prelude::*;
use std::collections::HashMap;

/// Families handled together by one thread.
const RUN: usize = 256;
/// Numbers that differ by less than this many units of rounding of what they were computed from count as equal.
const UNITS: f64 = 32.0;

impl<const D: usize> Chunk<D> {
    /// The bond slots of owned point `i` in the order in which [`Body::couplings`] lists its far points.
    ///
    /// By the components of ξ, so that families of equal shape list equal bonds at equal places; where the family meets images of points in
    /// symmetry planes, in the order of the slots.
    pub(crate) fn ordered_slots(&self, i: usize, out: &mut Vec<u32>, keys: &mut Vec<([i64; D], u32)>) {
        out.clear();
        if self.meets_images(i) {
            out.extend(self.slots(i).map(|s| s as u32));
            return;
        }
        keys.clear();
        keys.extend(self.slots(i).map(|s| (self.quantised(i, s), s as u32)));
        keys.sort_unstable();
        out.extend(keys.iter().map(|k| k.1));
    }

    /// Whether a bond of owned point `i` ends at the image of a point.
    pub(crate) fn meets_images(&self, i: usize) -> bool {
        self.slots(i).any(|s| self.flips[self.far(i, s)] != 0)
    }

    /// ξ in steps of a millionth of the horizon. Points of lattices lie away from the edges of the steps, whatever the rounding.
    fn quantised(&self, i: usize, slot: usize) -> [i64; D] {
        let (xi, step) = (self.xi(i, slot), self.horizon[i] * 1e-6);
        std::array::from_fn(|k| (xi[k] / step + 0.37).floor() as i64)
    }

    /// All that decides the stiffness of an undeformed family besides ξ and its model: numbers of the point, then of each bond in the given order.
    fn traits(&self, i: usize, slots: &[u32], mut each: impl FnMut(f64)) {
        each(self.volume(i));
        each(self.horizon[i]);
        each(self.temperature.get(i).copied().unwrap_or(0.0));
        for &s in slots {
            let s = s as usize;
            each(self.volume(self.far(i, s)));
            self.influence(i, s).into_iter().for_each(&mut each);
            self.sets(i, s).into_iter().for_each(|sets| each(f64::from(sets)));
        }
    }
}

/// Work space of one thread.
#[derive(Default)]
struct Scratch<const D: usize> {
    slots: [Vec<u32>; 2],
    keys: Vec<([i64; D], u32)>,
    traits: [Vec<f64>; 2],
}

impl<const D: usize> Body<D> {
    /// For each point the first one whose family has the same stiffness in the undeformed body, member by member in the order of
    /// [`couplings`](Self::couplings): the point itself where there is none before.
    ///
    /// Families are the same where bonds, volumes, influence, sub-horizons and temperature agree to the rounding of the coordinates, nothing is
    /// broken, and the material has the same constants everywhere and no history.
    pub fn alike(&self) -> Vec<u32> {
        let points = self.points();
        let mut alike: Vec<u32> = (0..points as u32).collect();
        // the material of each point, where its stiffness depends on the shape of the family alone
        let mut owner = vec![u32::MAX; points];
        for (m, part) in self.parts.iter().enumerate().filter(|(_, p)| p.is_uniform()) {
            for (k, c) in self.chunks.iter().enumerate() {
                part.points(k).iter().for_each(|&i| owner[c.first + i as usize] = m as u32);
            }
        }
        let serves = |p: usize, c: &Chunk<D>| {
            let i = p - c.first;
            owner[p] != u32::MAX && c.slots(i).all(|s| c.is_intact(s)) && !c.meets_images(i)
        };
        let hash = |p: usize, scratch: &mut Scratch<D>| {
            let c = self.chunk_of(p);
            if !serves(p, c) {
                return None;
            }
            let (i, [slots, _]) = (p - c.first, &mut scratch.slots);
            c.ordered_slots(i, slots, &mut scratch.keys);
            let mut h = 0xcbf2_9ce4_8422_2325u64 ^ u64::from(owner[p]);
            for (key, _) in &scratch.keys {
                for &k in key {
                    h = (h ^ k as u64).wrapping_mul(0x0000_0100_0000_01b3).rotate_left(23);
                }
            }
            Some(h)
        };
        let mut hashes = vec![None; points];
        hashes.par_chunks_mut(RUN).enumerate().for_each_init(Scratch::default, |scratch, (run, hashes)| {
            hashes.iter_mut().enumerate().for_each(|(k, h)| *h = hash(run * RUN + k, scratch));
        });
        let mut first: HashMap<u64, u32> = HashMap::new();
        for (p, h) in hashes.iter().enumerate() {
            if let Some(h) = h {
                alike[p] = *first.entry(*h).or_insert(p as u32);
            }
        }
        let far = self.position().iter().flatten().fold(0.0, |a: f64, &b| a.max(b.abs()));
        alike.par_chunks_mut(RUN).enumerate().for_each_init(Scratch::default, |scratch, (run, alike)| {
            for (k, first) in alike.iter_mut().enumerate() {
                let p = run * RUN + k;
                if *first as usize != p && !self.same_family(p, *first as usize, far, scratch) {
                    *first = p as u32;
                }
            }
        });
        alike
    }

    /// Whether the families of two points agree to the rounding of coordinates of size `far`.
    fn same_family(&self, p: usize, q: usize, far: f64, scratch: &mut Scratch<D>) -> bool {
        let Scratch { slots: [a, b], keys, traits: [ta, tb] } = scratch;
        let (c, d) = (self.chunk_of(p), self.chunk_of(q));
        let (i, j) = (p - c.first, q - d.first);
        let rounding = UNITS * f64::EPSILON * far.max(c.horizon[i]);
        c.ordered_slots(i, a, keys);
        d.ordered_slots(j, b, keys);
        let near = |&(s, t): &(&u32, &u32)| {
            let (x, y) = (c.xi(i, *s as usize), d.xi(j, *t as usize));
            (0..D).all(|k| (x[k] - y[k]).abs() <= rounding)
        };
        if a.len() != b.len() || !a.iter().zip(b.iter()).all(|pair| near(&pair)) {
            return false;
        }
        ta.clear();
        tb.clear();
        c.traits(i, a, |x| ta.push(x));
        d.traits(j, b, |x| tb.push(x));
        // influence and volumes are functions of ξ that vary over a spacing, of which a horizon has few
        let relative = UNITS * rounding / c.horizon[i];
        ta.iter().zip(tb.iter()).all(|(x, y)| (x - y).abs() <= relative * x.abs().max(y.abs()))
    }

    /// Whether the displacements last handed out are zero everywhere.
    pub(crate) fn is_undeformed(&self) -> bool {
        self.chunks.iter().all(|c| c.displacement.chunks_exact(ROW).all(|row| row[..D].iter().all(|u| *u == 0.0)))
    }
}
