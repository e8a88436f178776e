//! The change of the tangent along a displacement of the straight or flat reference state: `K_σ` of linear buckling, in closed form.
//!
//! # Equations
//! A pair has the energy `a |c|²/2 + O(|c|⁴)` with c = Y+/|Y+| + Y−/|Y−|, for both potentials, and c = 0 in the reference state. So its
//! third derivative there is that of `a |c|²/2`:
//!
//! ```text
//! K_σ[x, y] = a (c″[x, y]·ċ + ċ′[x]·c′[y] + c′[x]·ċ′[y]),   ċ = c′[w],  ċ′[x] = c″[x, w]
//! ```
//!
//! with `n = Y/|Y|`, `n′[x] = (x − n (n·x))/L` and `n″[x, y] = −((n·y) x + (n·x) y + (x·y) n − 3 n (n·x)(n·y))/L²`. A bond of stiffness k
//! has `k (e″[x, y] ė + ė′[x] e′[y] + e′[x] ė′[y])`, e′ = n and e″ = (1 − n⊗n)/L, and the term c θ² likewise. The mean curvature vector is
//! linear in the displacements, so its energy adds nothing.
//!
//! # Holds when
//! The reference state is straight or flat, free of stress, undamaged or not, and nothing has yielded.

use crate::ThinError;
use crate::body::Thin;
use crate::extension::stretch;
use solvers::sparse::BlockMatrix;

type V3 = [f64; 3];

fn dot(a: &V3, b: &V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `n′[x]` of n = Y/|Y|.
fn first(n: &V3, length: f64, x: &V3) -> V3 {
    let along = dot(n, x);
    [0, 1, 2].map(|k| (x[k] - along * n[k]) / length)
}

/// `n″[x, y]`.
fn second(n: &V3, length: f64, x: &V3, y: &V3) -> V3 {
    let (nx, ny, xy) = (dot(n, x), dot(n, y), dot(x, y));
    [0, 1, 2].map(|k| -(ny * x[k] + nx * y[k] + (xy - 3.0 * nx * ny) * n[k]) / (length * length))
}

fn unit(k: usize) -> V3 {
    std::array::from_fn(|c| if c == k { 1.0 } else { 0.0 })
}

/// Blocks of a pair, by (end, component), for `a = 1`.
pub(crate) fn pair_change(arm: &V3, length: f64, plus: &V3, minus: &V3) -> [[f64; 6]; 6] {
    let n = [arm.map(|x| x / length), arm.map(|x| -x / length)];
    let w = [plus, minus];
    let parts = [first(&n[0], length, w[0]), first(&n[1], length, w[1])];
    let rate: V3 = std::array::from_fn(|k| parts[0][k] + parts[1][k]);
    let mut h = [[0.0; 6]; 6];
    for a in 0..2 {
        for i in 0..3 {
            let (ca, da) = (first(&n[a], length, &unit(i)), second(&n[a], length, &unit(i), w[a]));
            for b in 0..2 {
                for j in 0..3 {
                    let (cb, db) = (first(&n[b], length, &unit(j)), second(&n[b], length, &unit(j), w[b]));
                    let own = if a == b { dot(&second(&n[a], length, &unit(i), &unit(j)), &rate) } else { 0.0 };
                    h[3 * a + i][3 * b + j] = own + dot(&da, &cb) + dot(&ca, &db);
                }
            }
        }
    }
    h
}

impl<const D: usize> Thin<D> {
    /// Adds the derivative of the tangent at the reference state along `along` to a matrix of the pattern of [`pattern`](Self::pattern).
    /// Across the body alone that is the stiffness of a given tension. `false`, adding nothing, where the state is not straight and free of
    /// stress, so that the closed form does not hold.
    ///
    /// # Errors
    /// [`ThinError::Sparse`].
    pub fn tangent_change(&mut self, along: &[f64], matrix: &mut BlockMatrix) -> Result<bool, ThinError> {
        if self.is_prestrained() || (D == 1 && self.prestress.is_none()) {
            return Ok(false);
        }
        let members = self.members()?;
        let body = &*self;
        matrix.add_families(
            &members,
            || (vec![0u32; body.points()], vec![]),
            |(place, terms), k, dense| {
                let family = members.family(k);
                for (local, q) in family.iter().enumerate() {
                    place[*q as usize] = local as u32;
                }
                body.family_change(k, along, family.len() * D, place, terms, dense);
                Ok::<(), ThinError>(())
            },
        )?;
        Ok(true)
    }

    /// Adds `Σ h` over the stencils of differences with the centre; `ends` are the far ends.
    fn spread(
        &self,
        place: &[u32],
        ends: &[u32],
        centre: u32,
        h: &dyn Fn(usize, usize, usize, usize) -> f64,
        width: usize,
        terms: &mut Vec<(usize, [f64; D], usize)>,
        dense: &mut [f64],
    ) {
        terms.clear();
        for (slot, end) in ends.iter().enumerate() {
            for (e, sign) in [(*end, 1.0), (centre, -1.0)] {
                terms.extend(self.ends.stencil(e).iter().map(|(q, w)| (place[*q as usize] as usize, w.map(|x| sign * x), slot)));
            }
        }
        for (qa, wa, sa) in terms.iter() {
            for (qb, wb, sb) in terms.iter() {
                for i in 0..D {
                    for j in 0..D {
                        dense[(qa * D + i) * width + qb * D + j] += wa[i] * wb[j] * h(*sa, i, *sb, j);
                    }
                }
            }
        }
    }

    fn family_change(
        &self,
        point: usize,
        along: &[f64],
        width: usize,
        place: &[u32],
        terms: &mut Vec<(usize, [f64; D], usize)>,
        dense: &mut [f64],
    ) {
        dense.fill(0.0);
        let centre = point as u32;
        if let Some(prestress) = &self.prestress {
            for (end, k) in &prestress.springs[prestress.starts[point]..prestress.starts[point + 1]] {
                let h = |_: usize, i: usize, _: usize, j: usize| if i == 0 && j == 0 { *k } else { 0.0 };
                self.spread(place, &[*end], centre, &h, width, terms, dense);
            }
        }
        if D == 1 {
            return;
        }
        let own = self.ends.value(centre, along);
        let difference = |end: u32| -> V3 {
            let value = self.ends.value(end, along);
            std::array::from_fn(|k| if k < D { value[k] - own[k] } else { 0.0 })
        };
        for q in self.starts[point]..self.starts[point + 1] {
            if !self.intact[q] {
                continue;
            }
            let (pair, arm) = (&self.pairs[q], &self.arms[self.pairs[q].arm as usize]);
            let block = pair_change(&arm.vector, arm.length, &difference(pair.plus), &difference(pair.minus));
            let h = |a: usize, i: usize, b: usize, j: usize| pair.stiffness * block[3 * a + i][3 * b + j];
            self.spread(place, &[pair.plus, pair.minus], centre, &h, width, terms, dense);
        }
        let Some(extension) = &self.extension else { return };
        let c = extension.dilatational[point];
        // rows of θ′ and of its rate over the dofs of the family
        let (mut theta, mut rate_of_theta) = (vec![0.0; width], vec![0.0; width]);
        let mut rate = 0.0;
        if c != 0.0 {
            for b in extension.family(point) {
                let arm = &self.arms[b.arm as usize];
                let n = stretch(&arm.vector, b.sign, arm.length, &[0.0; 3]).direction;
                let w = difference(b.end);
                let turn = first(&n, arm.length, &w);
                rate += b.dilatation * dot(&n, &w);
                for (end, sign) in [(b.end, 1.0), (centre, -1.0)] {
                    for (q, weight) in self.ends.stencil(end) {
                        let at = place[*q as usize] as usize * D;
                        for k in 0..D {
                            theta[at + k] += sign * b.dilatation * weight[k] * n[k];
                            rate_of_theta[at + k] += sign * b.dilatation * weight[k] * turn[k];
                        }
                    }
                }
            }
        }
        for b in extension.family(point) {
            let arm = &self.arms[b.arm as usize];
            let n = stretch(&arm.vector, b.sign, arm.length, &[0.0; 3]).direction;
            let w = difference(b.end);
            let turn = first(&n, arm.length, &w);
            let pull = (b.stiffness * dot(&n, &w) + 2.0 * c * rate * b.dilatation) / arm.length;
            let h = |_: usize, i: usize, _: usize, j: usize| {
                let one = if i == j { 1.0 } else { 0.0 };
                pull * (one - n[i] * n[j]) + b.stiffness * (turn[i] * n[j] + n[i] * turn[j])
            };
            self.spread(place, &[b.end], centre, &h, width, terms, dense);
        }
        if c != 0.0 {
            for (a, row) in dense.chunks_mut(width).enumerate() {
                for (b, entry) in row.iter_mut().enumerate() {
                    *entry += 2.0 * c * (rate_of_theta[a] * theta[b] + theta[a] * rate_of_theta[b]);
                }
            }
        }
    }
}
