//! A preconditioner of two levels for bodies whose couplings have a finite reach: block Jacobi for what varies within that reach, and a
//! coarse problem for what is smooth.
//!
//! Nonlocal stiffness is bounded: waves shorter than the reach all cost about the same energy, which block Jacobi sees. Waves that
//! are longer are nearly rigid motions of boxes as large as the reach. So the coarse space has the rigid motions of each box, the coarse matrix is
//! the Galerkin product, and both corrections are added (two-level additive Schwarz; Dryja and Widlund 1987, Nicolaides 1987 for the coarse
//! space). Boxes that do not touch are not coupled, so the coarse matrix comes from a fixed number of products with the stiffness
//! whatever the number of boxes: 3 colours an axis times the number of rigid motions.

use std::sync::Arc;

use rayon::prelude::*;

use crate::direct::SparseCholesky;
use crate::krylov::{BlockJacobi, Preconditioner};
use crate::problem::Stop;
use crate::sparse::{BlockMatrix, BlockPattern};

/// Added to the coarse diagonal, relative: motions that fixed dofs or too few points make dependent stay harmless.
const REGULAR: f64 = 1e-9;
/// Boxes coupled to a box along one axis, itself included.
const COLOURS: usize = 3;

/// Boxes of points and their rigid motions.
struct Boxes {
    /// Dofs of a point, and coordinates of a point.
    block: usize,
    /// Rigid motions of a box.
    motions: usize,
    /// Box of each point.
    of: Vec<u32>,
    /// Place of each point relative to the middle of its box, in reaches.
    relative: Vec<f64>,
    /// Indices of each box along the axes.
    index: Vec<[usize; 3]>,
    /// Points of box b are `points[starts[b]..starts[b + 1]]`.
    starts: Vec<usize>,
    points: Vec<u32>,
    fixed: Vec<bool>,
}

impl Boxes {
    fn new(positions: &[f64], block: usize, fixed: &[bool], reach: f64) -> Self {
        let n = fixed.len() / block;
        let bounds: Vec<(f64, f64)> = (0..block)
            .map(|k| {
                let along = positions.iter().skip(k).step_by(block);
                along.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &x| (a.min(x), b.max(x)))
            })
            .collect();
        // boxes at least as long as the reach, so that only neighbours are coupled
        let counts: Vec<usize> = bounds.iter().map(|(a, b)| (((b - a) / (reach * (1.0 + 1e-6))) as usize).max(1)).collect();
        let place = |p: usize| -> [usize; 3] {
            let mut at = [0; 3];
            for k in 0..block {
                let (a, b) = bounds[k];
                let share = if b > a { (positions[p * block + k] - a) / (b - a) } else { 0.0 };
                at[k] = ((share * counts[k] as f64) as usize).min(counts[k] - 1);
            }
            at
        };
        let mut order: Vec<([usize; 3], u32)> = (0..n).map(|p| (place(p), p as u32)).collect();
        order.sort_unstable();
        let mut boxes = Boxes {
            block,
            motions: [1, 3, 6][block - 1],
            of: vec![0; n],
            relative: vec![0.0; n * block],
            index: vec![],
            starts: vec![],
            points: order.iter().map(|o| o.1).collect(),
            fixed: fixed.to_vec(),
        };
        for (q, (at, p)) in order.iter().enumerate() {
            if boxes.index.last() != Some(at) {
                boxes.index.push(*at);
                boxes.starts.push(q);
            }
            boxes.of[*p as usize] = boxes.index.len() as u32 - 1;
            for k in 0..block {
                let (a, b) = bounds[k];
                let middle = a + (b - a) * (at[k] as f64 + 0.5) / counts[k] as f64;
                boxes.relative[*p as usize * block + k] = (positions[*p as usize * block + k] - middle) / reach;
            }
        }
        boxes.starts.push(n);
        boxes
    }

    fn len(&self) -> usize {
        self.index.len()
    }

    /// Component `k` at point `p` of the rigid motion `m` of its box: translations, then rotations in the planes of two axes.
    #[inline]
    fn motion(&self, p: usize, m: usize, k: usize) -> f64 {
        let d = self.block;
        if m < d {
            return f64::from(u8::from(m == k));
        }
        let (a, b) = [(0, 1), (1, 2), (2, 0)][m - d];
        if k == a {
            -self.relative[p * d + b]
        } else if k == b {
            self.relative[p * d + a]
        } else {
            0.0
        }
    }

    /// `coarse = Pᵀ x`, a box after the other.
    fn restrict(&self, x: &[f64], coarse: &mut [f64]) {
        let (d, r) = (self.block, self.motions);
        coarse.par_chunks_mut(r).with_min_len(16).enumerate().for_each(|(b, coarse)| {
            coarse.fill(0.0);
            for &p in &self.points[self.starts[b]..self.starts[b + 1]] {
                let p = p as usize;
                for k in (0..d).filter(|k| !self.fixed[p * d + k]) {
                    for (m, c) in coarse.iter_mut().enumerate() {
                        *c += self.motion(p, m, k) * x[p * d + k];
                    }
                }
            }
        });
    }

    /// `x += P coarse`.
    fn prolong(&self, coarse: &[f64], x: &mut [f64]) {
        let (d, r) = (self.block, self.motions);
        x.par_chunks_mut(d).with_min_len(1024).enumerate().for_each(|(p, x)| {
            let coarse = &coarse[self.of[p] as usize * r..][..r];
            for k in (0..d).filter(|k| !self.fixed[p * d + k]) {
                for (m, c) in coarse.iter().enumerate() {
                    x[k] += self.motion(p, m, k) * c;
                }
            }
        });
    }
}

/// The coarse problem of the rigid motions of boxes.
pub struct Coarse {
    boxes: Boxes,
    factor: SparseCholesky,
    right: Vec<f64>,
    solution: Vec<f64>,
    products: usize,
}

impl Coarse {
    /// Builds the coarse problem from products with the stiffness.
    ///
    /// `positions` has as many coordinates a point as there are dofs a point (`block`: 1, 2 or 3). Couplings end at `reach`. `None` where a coarse
    /// problem makes no sense (few boxes) or is not positive definite: block Jacobi must then do alone.
    ///
    /// # Errors
    /// [`Stop`] from the product.
    ///
    /// # Panics
    /// Where lengths do not agree.
    pub fn new(
        mut product: impl FnMut(&[f64], &mut [f64]) -> Result<(), Stop>,
        positions: &[f64],
        fixed: &[bool],
        block: usize,
        reach: f64,
        threads: usize,
    ) -> Result<Option<Self>, Stop> {
        /// A body of fewer boxes has no smooth part to speak of.
        const FEWEST: usize = 4;
        assert!(positions.len() == fixed.len() && (1..=3).contains(&block));
        let boxes = Boxes::new(positions, block, fixed, reach);
        let (n, r) = (boxes.len(), boxes.motions);
        if n < FEWEST || 4 * n * r > fixed.len() {
            return Ok(None);
        }
        let place: std::collections::HashMap<[usize; 3], u32> = boxes.index.iter().enumerate().map(|(b, at)| (*at, b as u32)).collect();
        // for each box those it is coupled to, ascending
        let around = |at: [usize; 3]| {
            let mut near: Vec<u32> = (0..27usize)
                .filter_map(|q| {
                    let mut other = at;
                    for (k, step) in [q / 9, q / 3 % 3, q % 3].into_iter().enumerate() {
                        other[k] = (at[k] + step).checked_sub(1)?;
                    }
                    place.get(&other).copied()
                })
                .collect();
            near.sort_unstable();
            near
        };
        let (mut starts, mut rows) = (vec![0], vec![]);
        for at in &boxes.index {
            rows.extend(around(*at));
            starts.push(rows.len());
        }
        // entry (m of b, s of its j-th neighbour), for all neighbours
        let mut entries = vec![0.0; rows.len() * r * r];
        let (mut x, mut y) = (vec![0.0; fixed.len()], vec![0.0; fixed.len()]);
        let (mut unit, mut coarse) = (vec![0.0; n * r], vec![0.0; n * r]);
        let mut products = 0;
        for colour in 0..COLOURS.pow(3) {
            let of = [colour % 3, colour / 3 % 3, colour / 9];
            let chosen = |b: usize| (0..3).all(|k| boxes.index[b][k] % COLOURS == of[k]);
            if !(0..n).any(chosen) {
                continue;
            }
            for s in 0..r {
                unit.fill(0.0);
                (0..n).filter(|&b| chosen(b)).for_each(|b| unit[b * r + s] = 1.0);
                x.fill(0.0);
                boxes.prolong(&unit, &mut x);
                product(&x, &mut y)?;
                products += 1;
                boxes.restrict(&y, &mut coarse);
                for b in 0..n {
                    // the only neighbour of this colour
                    if let Some(j) = (starts[b]..starts[b + 1]).find(|&j| chosen(rows[j] as usize)) {
                        (0..r).for_each(|m| entries[(j * r + m) * r + s] = coarse[b * r + m]);
                    }
                }
            }
        }
        let Ok(pattern) = BlockPattern::from_columns(r, &starts, &rows) else {
            return Ok(None);
        };
        let pattern = Arc::new(pattern);
        let mut matrix = BlockMatrix::new(pattern.clone());
        let mut entry = vec![0.0; r * r];
        for b in 0..n {
            for j in starts[b]..starts[b + 1] {
                let c = rows[j] as usize;
                if c > b {
                    continue;
                }
                let back = (starts[c]..starts[c + 1]).find(|&i| rows[i] as usize == b).expect("boxes are neighbours of each other");
                for m in 0..r {
                    for s in 0..r {
                        entry[m * r + s] = 0.5 * (entries[(j * r + m) * r + s] + entries[(back * r + s) * r + m]);
                    }
                }
                let added = matrix.add_block(b, c, &entry);
                debug_assert!(added, "the pattern has every pair of neighbours");
            }
        }
        let mut diagonal = vec![0.0; n * r];
        matrix.diagonal(&mut diagonal);
        let mean = diagonal.iter().map(|d| d.abs()).sum::<f64>() / diagonal.len() as f64;
        // motions that have no free dof get a stiffness of their own
        let addition: Vec<f64> = diagonal.iter().map(|d| if d.abs() <= REGULAR * mean { mean } else { REGULAR * d.abs() }).collect();
        let middles: Vec<f64> = boxes.index.iter().flat_map(|at| at[..block].iter().map(|&k| k as f64)).collect();
        let free = vec![false; n * r];
        let factored =
            SparseCholesky::analyze(pattern, &middles, &free, threads).and_then(|mut f| f.factor(&matrix, Some(&addition)).map(|()| f));
        Ok(factored.ok().map(|factor| Self { boxes, factor, right: vec![0.0; n * r], solution: vec![0.0; n * r], products }))
    }

    /// Whether the coarse problem was made for these fixed dofs.
    pub fn serves(&self, fixed: &[bool]) -> bool {
        self.boxes.fixed == fixed
    }

    /// Dofs of the coarse problem, and the products it took to make it.
    pub fn size(&self) -> (usize, usize) {
        (self.right.len(), self.products)
    }

    /// `z += P (Pᵀ K P)⁻¹ Pᵀ r`.
    pub fn correct(&mut self, r: &[f64], z: &mut [f64]) {
        self.boxes.restrict(r, &mut self.right);
        if self.factor.substitute(&self.right, &mut self.solution).is_ok() {
            self.boxes.prolong(&self.solution, z);
        }
    }
}

/// Block Jacobi plus a correction by a coarse problem, where there is one.
pub struct TwoLevel<'a> {
    /// For what varies from point to point.
    pub smoother: BlockJacobi,
    /// For what is smooth.
    pub coarse: Option<&'a mut Coarse>,
}

impl Preconditioner for TwoLevel<'_> {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        self.smoother.apply(r, z);
        if let Some(coarse) = &mut self.coarse {
            coarse.correct(r, z);
        }
    }
}
