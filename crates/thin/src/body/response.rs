//! What a deformation leaves behind and what is told of it: plastic angles, broken pairs and bonds, curvatures and moments.

use super::*;
use crate::extension::Stretched;

impl<const D: usize> Thin<D> {
    /// Commits plastic angles at an accepted state.
    pub fn commit(&mut self, u: &[f64]) {
        if !self.has_history() {
            return;
        }
        if let Some(basis) = self.basis() {
            return self.commit_vectors(&basis, u);
        }
        // one of the laws may have a history, but none of those that points have
        if self.plastic.is_empty() {
            return;
        }
        let mut plastic = std::mem::take(&mut self.plastic);
        let mut angles = vec![];
        let mut elastic = vec![];
        for point in 0..self.points() {
            let range = self.starts[point]..self.starts[point + 1];
            let n = range.len();
            angles.resize(n, 0.0);
            elastic.resize(n, 0.0);
            self.angles(point, u, &mut angles);
            let family = PairFamily {
                pairs: &self.pairs[range.clone()],
                intact: &self.intact[range.clone()],
                plastic: &plastic[range.clone()],
                isotropic: self.isotropic[point],
                law: self.law_of(point),
            };
            if !family.law.has_history() {
                continue;
            }
            family.elastic_parts(&angles, &mut elastic);
            for (k, q) in range.enumerate() {
                if self.intact[q] && elastic[k] != angles[k] - plastic[q] {
                    plastic[q] = angles[k] - elastic[k];
                }
            }
        }
        self.plastic = plastic;
    }

    /// Plastic angles of all pairs, of beams in space two components each, along the across direction of the layout and across both; empty where
    /// the law has no history.
    pub fn plastic_angles(&self) -> &[f64] {
        &self.plastic
    }

    /// Intact pairs whose angle exceeds their limit, and bonds whose stretch does: number and the ratio to the limit. Bonds are numbered after
    /// the pairs.
    pub fn exceeding(&self, u: &[f64]) -> Vec<(usize, f64)> {
        let chunk = |k: usize| {
            let mut found = vec![];
            let mut angles = vec![];
            for point in k * CHUNK..self.points().min((k + 1) * CHUNK) {
                angles.resize(self.pairs_of(point).len(), 0.0);
                self.angles(point, u, &mut angles);
                // elsewhere the limit is that of yielding
                let breaks = matches!(self.law_of(point), Law::Elastic(_));
                for (j, angle) in angles.iter().enumerate() {
                    let q = self.starts[point] + j;
                    let ratio = angle.abs() / self.pairs[q].limit;
                    if self.intact[q] && ratio > 1.0 && breaks {
                        found.push((q, ratio));
                    }
                }
                self.stretches(point, u, |bond, ratio| {
                    if ratio > 1.0 {
                        found.push((self.pairs.len() + bond, ratio));
                    }
                });
            }
            found
        };
        (0..self.points().div_ceil(CHUNK)).into_par_iter().map(chunk).collect::<Vec<_>>().concat()
    }

    /// A bond of extension at displacements `u`; its extension is that beyond the stress-free shape.
    #[inline(always)]
    pub(super) fn stretched(&self, extension: &Extension, bond: usize, centre: &[f64; D], u: &[f64]) -> Stretched<D> {
        let b = &extension.bonds[bond];
        let mut eta = self.ends.value(b.end, u);
        (0..D).for_each(|k| eta[k] -= centre[k]);
        let arm = &self.arms[b.arm as usize];
        let mut y = stretch(&arm.vector, b.sign, arm.length, &eta);
        if let Some(rest) = &self.rest {
            y.extension -= rest.extensions[bond];
        }
        y
    }

    /// Stretch of the intact bonds of a point over the critical one, where there is one.
    pub(super) fn stretches(&self, point: usize, u: &[f64], mut each: impl FnMut(usize, f64)) {
        let Some(e) = &self.extension else { return };
        let Some(critical) = e.critical.get(point) else { return };
        let centre = self.ends.value(point as u32, u);
        for k in (e.starts[point]..e.starts[point + 1]).filter(|&k| e.is_intact(k)) {
            let length = self.arms[e.bonds[k].arm as usize].length;
            each(k, self.stretched(e, k, &centre, u).extension.abs() / (length * critical));
        }
    }

    /// The intact pair nearest to its limit, or farthest beyond: its number and |φ|/φ_c.
    pub fn most_loaded(&self, u: &[f64]) -> Option<(usize, f64)> {
        let mut angles = vec![];
        let mut worst: Option<(usize, f64)> = None;
        for point in 0..self.points() {
            angles.resize(self.pairs_of(point).len(), 0.0);
            self.angles(point, u, &mut angles);
            for (j, angle) in angles.iter().enumerate() {
                let q = self.starts[point] + j;
                let ratio = angle.abs() / self.pairs[q].limit;
                if self.intact[q] && worst.is_none_or(|w| ratio > w.1) {
                    worst = Some((q, ratio));
                }
            }
            self.stretches(point, u, |bond, ratio| {
                if worst.is_none_or(|w| ratio > w.1) {
                    worst = Some((self.pairs.len() + bond, ratio));
                }
            });
        }
        worst
    }

    /// Breaks pairs (and bonds, numbered after the pairs) for good; a broken bond breaks the opposite one, and the pairs of both points that it is
    /// an arm of or whose virtual end follows the point that it went to. Normals are those of intact bonds from then on. Returns how many
    /// pairs and bonds broke.
    pub fn break_pairs(&mut self, pairs: impl IntoIterator<Item = usize>) -> usize {
        let mut broken = 0;
        let mut touched = vec![];
        let n = self.points();
        let mut work: Vec<usize> = pairs.into_iter().collect();
        work.reverse();
        while let Some(q) = work.pop() {
            if q < self.pairs.len() {
                broken += usize::from(std::mem::replace(&mut self.intact[q], false));
                continue;
            }
            let Some(e) = &mut self.extension else { continue };
            let k = q - self.pairs.len();
            if e.intact.is_empty() {
                e.intact = vec![true; e.bonds.len()];
            }
            if !std::mem::replace(&mut e.intact[k], false) {
                continue;
            }
            broken += 1;
            let point = e.starts.partition_point(|&s| s <= k) - 1;
            touched.push(point);
            let end = e.bonds[k].end;
            if (end as usize) < n {
                let back = (e.starts[end as usize]..e.starts[end as usize + 1]).find(|&b| e.bonds[b].end == point as u32);
                work.extend(back.filter(|&b| e.intact[b]).map(|b| b + self.pairs.len()));
            }
            for q in self.starts[point]..self.starts[point + 1] {
                let ends = &self.ends;
                let follows = |e: u32| e == end || (e as usize >= n && (end as usize) < n && ends.stencil(e).iter().any(|s| s.0 == end));
                if follows(self.pairs[q].plus) || follows(self.pairs[q].minus) {
                    broken += usize::from(std::mem::replace(&mut self.intact[q], false));
                }
            }
        }
        touched.sort_unstable();
        self.reframe(touched);
        broken
    }

    /// Breaks the bonds, joint pairs, and the pairs with an arm or a virtual point, that `cut` says a crack crosses (from one place to the other); returns
    /// how many. A virtual point counts as cut where one of the points it follows is on the other side of the crack.
    pub fn cut(&mut self, cut: impl Fn(&[f64; 3], &[f64; 3]) -> bool) -> usize {
        let mut crossing = vec![];
        let n = self.points();
        for point in 0..n {
            let x = self.layout.positions[point];
            for q in self.starts[point]..self.starts[point + 1] {
                let pair = &self.pairs[q];
                let xi = self.arms[pair.arm as usize].vector;
                let plus = frame::add_scaled(&x, 1.0, &xi);
                let minus = match self.frames.as_ref().map(|f| f.chords[q]) {
                    Some(chord) => [0, 1, 2].map(|k| x[k] + chord[k] - xi[k]),
                    None => frame::add_scaled(&x, -1.0, &xi),
                };
                let supports = |end: u32| {
                    let stencil = self.ends.stencil(end);
                    let follows = end as usize >= n && stencil.len() > 1;
                    follows && stencil.iter().any(|(p, _)| *p as usize != point && cut(&x, &self.layout.positions[*p as usize]))
                };
                if cut(&x, &plus) || cut(&x, &minus) || supports(pair.plus) || supports(pair.minus) {
                    crossing.push(q);
                }
            }
            if let Some(e) = &self.extension {
                for k in e.starts[point]..e.starts[point + 1] {
                    let arm = &self.arms[e.bonds[k].arm as usize];
                    if cut(&x, &frame::add_scaled(&x, e.bonds[k].sign, &arm.vector)) {
                        crossing.push(self.pairs.len() + k);
                    }
                }
            }
        }
        self.cut_joints(&cut) + self.break_pairs(crossing)
    }

    /// Which bonds are intact; empty where all are.
    pub fn intact_bonds(&self) -> &[bool] {
        self.extension.as_ref().map_or(&[], |e| &e.intact)
    }

    pub(crate) fn save_intact(&self, into: &mut (Vec<bool>, Vec<bool>)) {
        into.0.clone_from(&self.intact);
        if let Some(e) = &self.extension {
            into.1.clone_from(&e.intact);
        }
    }

    pub(crate) fn restore_intact(&mut self, from: &(Vec<bool>, Vec<bool>)) {
        self.intact.clone_from(&from.0);
        let Some(e) = &mut self.extension else { return };
        let before = std::mem::replace(&mut e.intact, from.1.clone());
        let changed = |k: usize| before.get(k).copied().unwrap_or(true) != e.is_intact(k);
        let touched = (0..e.starts.len() - 1).filter(|&p| (e.starts[p]..e.starts[p + 1]).any(changed)).collect();
        self.reframe(touched);
    }

    /// Makes the normals of points anew from their intact bonds; those with too few keep what they have.
    pub(super) fn reframe(&mut self, mut touched: Vec<usize>) {
        let (Some(frames), Some(e)) = (&mut self.frames, &self.extension) else { return };
        touched.dedup();
        for p in touched {
            let own = frames.starts[p]..frames.starts[p + 1];
            let bonds = e.starts[p]..e.starts[p + 1];
            // normals from other bonds than those that stretch stay as they are
            if own.len() != bonds.len() || own.clone().zip(bonds.clone()).any(|(f, b)| frames.bonds[f].end != e.bonds[b].end) {
                continue;
            }
            let whole: Vec<(u32, [f64; 2])> = bonds
                .clone()
                .map(|k| {
                    let arm = &self.arms[e.bonds[k].arm as usize];
                    (k as u32, arm.direction.map(|c| c * arm.length))
                })
                .collect();
            let near: Vec<_> = whole.iter().filter(|n| e.is_intact(n.0 as usize)).copied().collect();
            let scale = near.iter().fold(f64::INFINITY, |m, n| m.min(n.1[0].hypot(n.1[1])));
            let dimension = if D == 2 { 1 } else { 2 };
            let gradient = |quadratic| crate::interpolation::gradient(dimension, &near, scale, quadratic);
            let Some(weights) = gradient(true).or_else(|| gradient(false)) else { continue };
            let mut tangents = [[0.0; 3]; 2];
            frames.bonds[own.clone()].iter_mut().for_each(|b| b.weights = [0.0; 2]);
            for ((k, _), w) in near.iter().zip(weights) {
                frames.bonds[own.start + *k as usize - bonds.start].weights = w;
                let arm = &self.arms[e.bonds[*k as usize].arm as usize];
                for t in 0..2 {
                    tangents[t] = frame::add_scaled(&tangents[t], w[t] * e.bonds[*k as usize].sign, &arm.vector);
                }
            }
            if D == 2 {
                tangents[1] = self.layout.axes[p][1];
            }
            frames.tangents[p] = Some(tangents);
        }
    }

    /// Which pairs are intact.
    pub fn intact(&self) -> &[bool] {
        &self.intact
    }

    /// Intact part of the pairs of each point, or of its bonds where less of them is; 1 where it has none.
    pub fn health(&self) -> Vec<f64> {
        let part = |whole: usize, intact: usize| if whole == 0 { 1.0 } else { intact as f64 / whole as f64 };
        (0..self.points())
            .map(|p| {
                let all = self.starts[p]..self.starts[p + 1];
                let pairs = part(all.len(), all.filter(|&q| self.intact[q]).count());
                let bonds = self.extension.as_ref().map_or(1.0, |e| part(e.starts[p + 1] - e.starts[p], e.family(p).count()));
                pairs.min(bonds)
            })
            .collect()
    }

    /// Largest plastic angle of the pairs of each point, signed (of beams in space its magnitude).
    pub fn largest_plastic_angle(&self) -> Vec<f64> {
        let words = self.plastic_words();
        (0..self.points())
            .map(|p| {
                let range = words * self.starts[p]..words * self.starts[p + 1];
                let of = if self.plastic.is_empty() { &[][..] } else { &self.plastic[range] };
                let largest = |m: f64, x: f64| if x.abs() > m.abs() { x } else { m };
                match words {
                    1 => of.iter().copied().fold(0.0, largest),
                    _ => of.chunks(2).map(|v| v[0].hypot(v[1])).fold(0.0, largest),
                }
            })
            .collect()
    }

    /// Curvature of each point: least squares over its intact pairs, in lattice directions. Of beams in space the first component is that
    /// along the direction across of the layout, the third that across both.
    pub fn curvatures(&self, u: &[f64]) -> Vec<Bending> {
        self.per_point(
            |point, angles, _| {
                let mut matrix = [[0.0; 3]; 3];
                let mut right = [0.0; 3];
                for (k, pair) in self.pairs_of(point).iter().enumerate() {
                    if !self.intact[self.starts[point] + k] {
                        continue;
                    }
                    let arm = &self.arms[pair.arm as usize];
                    let [c, s] = arm.direction;
                    let q = [c * c, s * s, 2.0 * c * s];
                    let weight = pair.stiffness * arm.length * arm.length;
                    for i in 0..3 {
                        right[i] += weight * q[i] * angles[k] / arm.length;
                        (0..3).for_each(|j| matrix[i][j] += weight * q[i] * q[j]);
                    }
                }
                solve_3(matrix, right)
            },
            u,
        )
    }

    /// Moment of each point per width: the derivative of its energy density with curvature, in lattice directions, of beams in space as
    /// [`curvatures`](Self::curvatures).
    pub fn moments(&self, u: &[f64]) -> Vec<Bending> {
        self.per_point(
            |point, _, forces| {
                let mut moment = [0.0; 3];
                for (pair, g) in self.pairs_of(point).iter().zip(forces) {
                    let arm = &self.arms[pair.arm as usize];
                    let [c, s] = arm.direction;
                    let m = g * arm.length / self.measure[point];
                    for (k, q) in [c * c, s * s, c * s].into_iter().enumerate() {
                        moment[k] += m * q;
                    }
                }
                moment
            },
            u,
        )
    }

    pub(super) fn per_point(&self, of: impl Fn(usize, &[f64], &[f64]) -> Bending + Sync, u: &[f64]) -> Vec<Bending> {
        let run = |k: usize| {
            let mut s = Scratch::default();
            let mut out = vec![];
            let basis = self.basis();
            let (mut turns, mut pulls) = ([vec![], vec![]], [vec![], vec![]]);
            for point in k * CHUNK..self.points().min((k + 1) * CHUNK) {
                if let Some(basis) = &basis {
                    self.vector_forces(basis, point, u, &mut turns, &mut pulls);
                    out.push([of(point, &turns[0], &pulls[0])[0], 0.0, of(point, &turns[1], &pulls[1])[0]]);
                    continue;
                }
                let n = self.pairs_of(point).len();
                s.fit(n);
                self.angles(point, u, &mut s.angles[..n]);
                let framed = self.frames.as_ref().is_some_and(|f| f.tangents[point].is_some());
                if D < 3 || framed {
                    self.law_family(point).respond(&s.angles[..n], &mut s.elastic[..n], &mut s.forces[..n]);
                } else {
                    // small turns: the component along the normal
                    let centre = self.ends.value(point as u32, u);
                    for (q, pair) in self.pairs_of(point).iter().enumerate() {
                        let (p, m) = self.differences(pair, &centre, u);
                        let normal = self.layout.axes.get(point).map_or(self.layout.normal, |a| a[2]);
                        let along: f64 = (0..D).map(|k| normal[k] * (p[k] + m[k])).sum();
                        s.angles[q] = along / self.arms[pair.arm as usize].length;
                    }
                    self.law_family(point).respond(&s.angles[..n], &mut s.elastic[..n], &mut s.forces[..n]);
                }
                out.push(of(point, &s.angles[..n], &s.forces[..n]));
            }
            out
        };
        (0..self.points().div_ceil(CHUNK)).into_par_iter().map(run).collect::<Vec<_>>().concat()
    }
}
