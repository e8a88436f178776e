//! Second derivatives of the energy of a family.

use super::*;

impl<const D: usize> Thin<D> {
    /// The dense Hessian of pairs measured with the normal of the family, added to `dense`.
    pub(super) fn framed_tangent(
        &self,
        point: usize,
        state: &FrameState,
        u: &[f64],
        centre: &[f64; D],
        s: &mut Scratch,
        width: usize,
        dense: &mut [f64],
    ) {
        let frames = self.frames.as_ref().expect("has frames");
        let (pairs, first_pair) = (self.pairs_of(point), self.starts[point]);
        let n = pairs.len();
        self.angles(point, u, &mut s.angles[..n]);
        let law = self.law_family(point);
        law.respond(&s.angles[..n], &mut s.elastic[..n], &mut s.forces[..n]);
        let tangent = Tangent { diagonal: &mut s.diagonal[..n], vector: &mut s.vector[..n] };
        let gamma = law.tangent(&s.angles[..n], &s.elastic[..n], tangent);
        let FrameState { reference, da, db, normal, .. } = state;
        // rows of a and b over the dofs: each component of a is a sum over that component of the members
        for v in [&mut s.first, &mut s.second, &mut s.sums, &mut s.whole] {
            v.clear();
            v.resize(width, 0.0);
        }
        for bond in &frames.bonds[frames.starts[point]..frames.starts[point + 1]] {
            for (end, sign) in [(bond.end, 1.0), (point as u32, -1.0)] {
                for (q, w) in self.ends.stencil(end) {
                    let at = s.place[*q as usize] as usize * D;
                    for c in 0..D {
                        s.first[at + c] += sign * bond.weights[0] * w[c];
                        s.second[at + c] += sign * bond.weights[1] * w[c];
                    }
                }
            }
        }
        let mut turning = [0.0; 3];
        let mut geometric = false;
        for (k, pair) in pairs.iter().enumerate() {
            let (t, g) = (s.diagonal[k], s.forces[k]);
            if t == 0.0 && g == 0.0 && s.vector[k] == 0.0 {
                continue;
            }
            let length = self.arms[pair.arm as usize].length;
            let (_, chord) = self.framed_angle(state, first_pair + k, pair, centre, u);
            let ends = [(pair.plus, 0), (pair.minus, 1)];
            let by_normal = frames.bend(first_pair + k).is_none();
            let mut gradients = [[0.0; 3]; 2];
            let mut along_frame = [[0.0; 3]; 2];
            if let Some(bend) = frames.bend(first_pair + k) {
                let (p, m) = self.differences(pair, centre, u);
                let (_, gp, gm) = frame::bent(D == 2, bend, &three(&p), &three(&m));
                gradients = [gp, gm];
                if g != 0.0 {
                    let h = frame::bent_second(D == 2, bend, &three(&p), &three(&m));
                    for (ea, sa) in ends {
                        for (eb, sb) in ends {
                            for (ca, fa) in [(ea, 1.0), (point as u32, -1.0)] {
                                for (cb, fb) in [(eb, 1.0), (point as u32, -1.0)] {
                                    for (qa, wa) in self.ends.stencil(ca) {
                                        for (qb, wb) in self.ends.stencil(cb) {
                                            let (ra, rb) = (s.place[*qa as usize] as usize * D, s.place[*qb as usize] as usize * D);
                                            for i in 0..D {
                                                for j in 0..D {
                                                    dense[(ra + i) * width + rb + j] +=
                                                        g * fa * fb * wa[i] * wb[j] * h[3 * sa + i][3 * sb + j];
                                                }
                                            }
                                        }
                                    }
                                }
                            }
                        }
                    }
                }
            } else {
                gradients.fill(normal.map(|x| x / length));
                along_frame = frame::normal_gradient(reference, da, db, &chord.map(|x| x / length));
                // what rounding leaves of a chord along the normal
                if along_frame.iter().flatten().all(|x| x.abs() <= 1e-13) {
                    along_frame = [[0.0; 3]; 2];
                }
                if g != 0.0 {
                    geometric = true;
                    (0..3).for_each(|c| turning[c] += g / length * chord[c]);
                }
            }
            let framed = along_frame.iter().flatten().any(|x| *x != 0.0);
            let sums = &mut s.sums;
            let place = &s.place;
            let mut row = |add: &mut dyn FnMut(usize, f64)| {
                for (end, which) in ends {
                    for (e, sign) in [(end, 1.0), (point as u32, -1.0)] {
                        for (q, w) in self.ends.stencil(e) {
                            let at = place[*q as usize] as usize * D;
                            (0..D).for_each(|c| add(at + c, sign * w[c] * gradients[which][c]));
                            if by_normal && g != 0.0 {
                                (0..D).for_each(|c| sums[at + c] += sign * w[c] * g / length);
                            }
                        }
                    }
                }
                if framed {
                    for at in 0..width {
                        add(at, along_frame[0][at % D] * s.first[at] + along_frame[1][at % D] * s.second[at]);
                    }
                }
            };
            let (line, touched, marked) = (&mut s.line, &mut s.touched, &mut s.marked);
            if line.len() < width {
                line.resize(width, 0.0);
                marked.resize(width, false);
            }
            row(&mut |at, x| {
                if !std::mem::replace(&mut marked[at], true) {
                    touched.push(at as u32);
                }
                line[at] += x;
            });
            for &a in touched.iter() {
                let scaled = t * line[a as usize];
                s.whole[a as usize] += s.vector[k] * line[a as usize];
                if scaled != 0.0 {
                    let into = &mut dense[a as usize * width..][..width];
                    for &b in touched.iter() {
                        into[b as usize] += scaled * line[b as usize];
                    }
                }
            }
            for a in touched.drain(..) {
                line[a as usize] = 0.0;
                marked[a as usize] = false;
            }
        }
        if gamma != 0.0 {
            rank_one(&s.whole, gamma, dense);
        }
        if !geometric {
            return;
        }
        // g d²φ: twice dn·d(Σ g c/s), and d²n·(Σ g c/s)
        let axis = |i: usize| [0, 1, 2].map(|k| if k == i { 1.0 } else { 0.0 });
        let of_normal: Vec<[V3; 2]> = (0..3).map(|i| frame::normal_gradient(reference, da, db, &axis(i))).collect();
        let second = frame::normal_second(reference, da, db, &turning);
        for x in 0..width {
            let (i, into) = (x % D, &mut dense[x * width..][..width]);
            for y in 0..width {
                let j = y % D;
                // component i of the sums with component i of the normal
                let one = s.sums[x] * (of_normal[i][0][j] * s.first[y] + of_normal[i][1][j] * s.second[y]);
                let other = s.sums[y] * (of_normal[j][0][i] * s.first[x] + of_normal[j][1][i] * s.second[x]);
                let both = s.first[x] * (second[i][j] * s.first[y] + second[i][3 + j] * s.second[y])
                    + s.second[x] * (second[3 + i][j] * s.first[y] + second[3 + i][3 + j] * s.second[y]);
                into[y] += one + other + both;
            }
        }
    }

    /// The dense Hessian of one family over its members.
    pub(super) fn family_tangent(&self, point: usize, u: &[f64], family: &[u32], s: &mut Scratch, dense: &mut [f64]) {
        dense.fill(0.0);
        let width = family.len() * D;
        s.place.resize(self.points(), 0);
        for (local, q) in family.iter().enumerate() {
            s.place[*q as usize] = local as u32;
        }
        let pairs = self.pairs_of(point);
        let n = pairs.len();
        s.fit(n);
        let centre = self.ends.value(point as u32, u);
        let mut outer = std::mem::take(&mut s.outer);
        outer.clear();
        outer.resize(width, 0.0);
        let mut terms: Vec<Term<D>> = Vec::with_capacity(24);
        let mut hold = |place: &[u32], ends: &[u32; 3], used: usize, h: &dyn Fn(usize, usize, usize, usize) -> f64, dense: &mut [f64]| {
            // ends[0..used] are the differences' ends, ends[2] the centre, which is in each with weight −1
            terms.clear();
            for (slot, &end) in ends[..used].iter().enumerate() {
                for (q, w) in self.ends.stencil(end) {
                    push(&mut terms, (place[*q as usize], *w, slot));
                }
                for (q, w) in self.ends.stencil(ends[2]) {
                    push(&mut terms, (place[*q as usize], w.map(|x| -x), slot));
                }
            }
            for (qa, wa, sa) in &terms {
                for (qb, wb, sb) in &terms {
                    for i in 0..D {
                        for j in 0..D {
                            dense[(*qa as usize * D + i) * width + *qb as usize * D + j] += wa[i] * wb[j] * h(*sa, i, *sb, j);
                        }
                    }
                }
            }
        };
        if let Some(joints) = &self.joints {
            for joint in joints.family(point) {
                let (p, m) = self.joint_differences(joint, &centre, u);
                let (angle, gp, gm) = frame::bent(D == 2, &joint.bend, &three(&p), &three(&m));
                let (a, force) = (joint.stiffness, joint.stiffness * (angle - joint.bend.angle));
                let second = frame::bent_second(D == 2, &joint.bend, &three(&p), &three(&m));
                let gradient = [gp, gm];
                let h = |sa: usize, i: usize, sb: usize, j: usize| {
                    a * gradient[sa][i] * gradient[sb][j] + force * second[3 * sa + i][3 * sb + j]
                };
                hold(&s.place, &[joint.plus, joint.minus, point as u32], 2, &h, dense);
            }
        }
        if let Some(state) = self.frame_state(point, &centre, u) {
            self.framed_tangent(point, &state, u, &centre, s, width, dense);
        } else if D == 3 {
            let c = self.isotropic[point];
            let mut mean_rows = vec![[0.0; D]; if c != 0.0 { family.len() } else { 0 }];
            for (k, pair) in pairs.iter().enumerate() {
                if !self.intact[self.starts[point] + k] {
                    continue;
                }
                let arm = &self.arms[pair.arm as usize];
                let (p, m) = self.differences(pair, &centre, u);
                let h = self.spatial_hessian(point, self.starts[point] + k, &three(&p), &three(&m));
                hold(&s.place, &[pair.plus, pair.minus, point as u32], 2, &|sa, i, sb, j| h[3 * sa + i][3 * sb + j], dense);
                if c != 0.0 {
                    let weight = pair.isotropic / arm.length;
                    for (end, factor) in [(pair.plus, 1.0), (pair.minus, 1.0), (point as u32, -2.0)] {
                        for (q, w) in self.ends.stencil(end) {
                            (0..D).for_each(|k| mean_rows[s.place[*q as usize] as usize][k] += weight * factor * w[k]);
                        }
                    }
                }
            }
            for (a, ra) in mean_rows.iter().enumerate() {
                for (b, rb) in mean_rows.iter().enumerate() {
                    for k in 0..D {
                        dense[(a * D + k) * width + b * D + k] += 2.0 * c * ra[k] * rb[k];
                    }
                }
            }
        } else {
            self.angles(point, u, &mut s.angles[..n]);
            let law = self.law_family(point);
            law.respond(&s.angles[..n], &mut s.elastic[..n], &mut s.forces[..n]);
            let tangent = Tangent { diagonal: &mut s.diagonal[..n], vector: &mut s.vector[..n] };
            let gamma = law.tangent(&s.angles[..n], &s.elastic[..n], tangent);
            for (k, pair) in pairs.iter().enumerate() {
                let arm = &self.arms[pair.arm as usize];
                let (p, m) = self.differences(pair, &centre, u);
                let t = angle::turning(self.kinematics, &arm.vector, arm.length, &p, &m);
                let (diagonal, force) = (s.diagonal[k], s.forces[k]);
                let curved = (D == 2 || self.kinematics == Kinematics::Exact) && force != 0.0;
                let second: Second = match curved {
                    true => angle::second(self.kinematics, &arm.vector, arm.length, &p, &m),
                    false => Default::default(),
                };
                let gradient = [t.plus, t.minus];
                if D == 1 && !curved {
                    if diagonal != 0.0 {
                        let both = t.plus[0] + t.minus[0];
                        add_square(&mut s.line, &mut s.touched, &mut s.marked, width, diagonal, dense, |add| {
                            for (end, g) in [(pair.plus, t.plus[0]), (pair.minus, t.minus[0]), (point as u32, -both)] {
                                for (q, w) in self.ends.stencil(end) {
                                    add(s.place[*q as usize], w[0] * g);
                                }
                            }
                        });
                    }
                } else if diagonal != 0.0 || force != 0.0 {
                    let h = |sa: usize, i: usize, sb: usize, j: usize| {
                        diagonal * gradient[sa][i] * gradient[sb][j] + force * second[sa * D + i][sb * D + j]
                    };
                    hold(&s.place, &[pair.plus, pair.minus, point as u32], 2, &h, dense);
                }
                if gamma != 0.0 && s.vector[k] != 0.0 {
                    for (end, g, sign) in [
                        (pair.plus, &t.plus, 1.0),
                        (pair.minus, &t.minus, 1.0),
                        (point as u32, &t.plus, -1.0),
                        (point as u32, &t.minus, -1.0),
                    ] {
                        for (q, w) in self.ends.stencil(end) {
                            let at = s.place[*q as usize] as usize * D;
                            (0..D).for_each(|c| outer[at + c] += sign * s.vector[k] * w[c] * g[c]);
                        }
                    }
                }
            }
            if gamma != 0.0 {
                rank_one(&outer, gamma, dense);
            }
        }
        if let Some(extension) = &self.extension {
            let intact = || extension.intact_bonds(point);
            let c = extension.dilatational[point];
            let at = |q: usize| self.stretched(extension, q, &centre, u);
            let theta: f64 = if c == 0.0 { 0.0 } else { intact().map(|q| extension.bonds[q].dilatation * at(q).extension).sum() };
            outer.fill(0.0);
            for q in intact() {
                let (b, y) = (&extension.bonds[q], at(q));
                let over = (b.stiffness * y.extension + 2.0 * c * theta * b.dilatation) / y.length;
                let h = |_: usize, i: usize, _: usize, j: usize| {
                    (b.stiffness - over) * y.direction[i] * y.direction[j] + if i == j { over } else { 0.0 }
                };
                hold(&s.place, &[b.end, b.end, point as u32], 1, &h, dense);
                if c != 0.0 {
                    for (end, sign) in [(b.end, 1.0), (point as u32, -1.0)] {
                        for (q, w) in self.ends.stencil(end) {
                            let at = s.place[*q as usize] as usize * D;
                            (0..D).for_each(|k| outer[at + k] += sign * b.dilatation * w[k] * y.direction[k]);
                        }
                    }
                }
            }
            if c != 0.0 {
                rank_one(&outer, 2.0 * c, dense);
            }
        }
        if let Some(prestress) = &self.prestress {
            for (end, k) in &prestress.springs[prestress.starts[point]..prestress.starts[point + 1]] {
                hold(&s.place, &[*end, *end, point as u32], 1, &|_, i, _, j| if i == 0 && j == 0 { *k } else { 0.0 }, dense);
            }
        }
        s.outer = outer;
    }
}

/// A point of a stencil: its place in the family, its weights, and the difference it belongs to.
type Term<const D: usize> = (u32, [f64; D], usize);

/// Adds a term, joined with one of the same place and difference.
#[inline(always)]
pub(super) fn push<const D: usize>(terms: &mut Vec<Term<D>>, term: Term<D>) {
    match terms.iter_mut().find(|t| t.0 == term.0 && t.2 == term.2) {
        Some(t) => (0..D).for_each(|c| t.1[c] += term.1[c]),
        None => terms.push(term),
    }
}

/// Adds `factor v vᵀ` to a dense matrix for a sparse vector `v` given entry by entry.
pub(super) fn add_square(
    line: &mut Vec<f64>,
    touched: &mut Vec<u32>,
    marked: &mut Vec<bool>,
    width: usize,
    factor: f64,
    dense: &mut [f64],
    entries: impl Fn(&mut dyn FnMut(u32, f64)),
) {
    if line.len() < width {
        line.resize(width, 0.0);
        marked.resize(width, false);
    }
    entries(&mut |at, weight| {
        if !std::mem::replace(&mut marked[at as usize], true) {
            touched.push(at);
        }
        line[at as usize] += weight;
    });
    for &a in touched.iter() {
        let row = &mut dense[a as usize * width..][..width];
        let scaled = factor * line[a as usize];
        for &b in touched.iter() {
            row[b as usize] += scaled * line[b as usize];
        }
    }
    for a in touched.drain(..) {
        line[a as usize] = 0.0;
        marked[a as usize] = false;
    }
}

pub(super) fn rank_one(vector: &[f64], factor: f64, dense: &mut [f64]) {
    let width = vector.len();
    for (a, x) in vector.iter().enumerate() {
        if *x != 0.0 {
            let row = &mut dense[a * width..][..width];
            let scaled = factor * x;
            for (r, y) in row.iter_mut().zip(vector) {
                *r += scaled * y;
            }
        }
    }
}

#[inline(always)]
pub(super) fn three<const D: usize>(v: &[f64; D]) -> [f64; 3] {
    [0, 1, 2].map(|k| if k < D { v[k] } else { 0.0 })
}

/// Least-squares solution of a symmetric 3×3 system that may be singular (beams, edges).
pub(super) fn solve_3(matrix: [[f64; 3]; 3], right: [f64; 3]) -> [f64; 3] {
    let mut a: Vec<f64> = matrix.into_iter().flatten().collect();
    let (values, vectors) = crate::weights::symmetric_eigen(&mut a, 3);
    let top = values.iter().fold(0.0f64, |m, v| m.max(*v));
    let mut x = [0.0; 3];
    for k in 0..3 {
        if values[k] > 1e-10 * top {
            let share: f64 = (0..3).map(|i| vectors[i * 3 + k] * right[i]).sum::<f64>() / values[k];
            (0..3).for_each(|i| x[i] += vectors[i * 3 + k] * share);
        }
    }
    x
}
