//! Sparse Cholesky for assembled symmetric positive definite systems, and `L B Lᵀ` of indefinite ones.
//!
//! The fixed dofs are eliminated, the points ordered by geometric nested dissection or by approximate minimum degree (whichever fills
//! less), and the factor is computed by the supernodal kernels of `faer`. The symbolic work is done once per pattern and set of fixed
//! dofs; each numeric factorisation reuses it and its memory.

use std::sync::Arc;

use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::lblt::factor::LbltParams;
use faer::linalg::cholesky::llt::factor::{LltError, LltParams, LltRegularization};
use faer::perm::PermRef;
use faer::prelude::ReborrowMut;
use faer::sparse::linalg::amd;
use faer::sparse::linalg::cholesky::{simplicial, supernodal};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Spec};

use crate::ordering::{Graph, nested_dissection};
use crate::sparse::{BlockMatrix, BlockPattern};
use crate::vector;

/// Why a direct solution failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DirectError {
    /// The matrix is not positive definite.
    #[error(
        "the stiffness is not positive definite (pivot at dof {dof}): a part of the body is free to move (add supports, or a \
         zero-energy control), or the state is unstable (smaller load steps)"
    )]
    NotPositiveDefinite {
        /// Dof of the first pivot that is not positive, in the numbering of the whole problem.
        dof: usize,
    },
    /// A pivot of an indefinite matrix vanishes.
    #[error(
        "the stiffness is singular (pivot at dof {dof}): a part of the body is free to move (add supports), or the state is exactly \
         critical (change the step a little)"
    )]
    Singular {
        /// Dof of the pivot, in the numbering of the whole problem.
        dof: usize,
    },
    /// The factor does not fit.
    #[error("the factor of {dofs} dofs needs more memory than there is ({values} numbers): use conjugate gradients")]
    OutOfMemory {
        /// Number of free dofs.
        dofs: usize,
        /// Numbers in the factor, as far as known.
        values: usize,
    },
    /// The solution is not accurate, after refinement.
    #[error("the linear solution has relative residual {residual:.1e}: the stiffness is numerically singular, most of all at dof {dof}")]
    Inaccurate {
        /// Relative residual reached.
        residual: f64,
        /// Dof whose pivot lost most digits.
        dof: usize,
    },
    /// [`SparseCholesky::solve`] before a successful [`SparseCholesky::factor`].
    #[error("there is no numeric factor: `factor` must succeed before `solve`")]
    NotFactored,
}

/// Ordering used by a [`SparseCholesky`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ordering {
    /// Geometric nested dissection, see [`crate::ordering`].
    NestedDissection,
    /// Approximate minimum degree on the graph of points (Amestoy, Davis and Duff 1996, SIAM J. Matrix Anal. Appl. 17).
    MinimumDegree,
}

/// What a linear solution reports.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectReport {
    /// `‖b − A x‖ / ‖b‖` over free dofs, after refinement.
    pub residual: f64,
    /// Size of the correction by refinement relative to the solution: about condition number times round-off, so an estimate of the
    /// error of the solution.
    pub error: f64,
}

/// Nested dissection is taken up to this much more fill than minimum degree: its supernodes are larger, so it is faster at equal fill.
const EQUAL_FILL: f64 = 1.05;
/// From this many points on, nested dissection is taken without looking at minimum degree, where there is a geometry.
const DISSECTED: usize = 6000;
/// Relative residual beyond which a solution is looked at more closely.
const INACCURATE: f64 = 1e-6;
/// Relative correction beyond which such a solution is not returned. Stiff systems (beams of many points) have residuals of round-off
/// times ‖A‖‖x‖/‖b‖, however good the solution; what tells a bad one is that its correction is not small.
const UNSETTLED: f64 = 1e-2;
/// A pivot that elimination has reduced to less than this part of its diagonal entry is all round-off: the matrix is singular.
const SINGULAR: f64 = 8.0 * f64::EPSILON;

/// Factor `P A Pᵀ = L Lᵀ` (or `L B Lᵀ`) of the free part of a [`BlockMatrix`].
pub struct SparseCholesky {
    pattern: Arc<BlockPattern>,
    fixed: Vec<bool>,
    ordering: Ordering,
    threads: usize,
    /// Dof of each row of the permuted, reduced system.
    dof: Vec<u32>,
    /// Lower triangle of the permuted, reduced matrix by columns, the diagonal first; and where each entry comes from.
    starts: Vec<usize>,
    rows: Vec<usize>,
    sources: Vec<u32>,
    values: Vec<f64>,
    symbolic: Option<supernodal::SymbolicSupernodalCholesky<usize>>,
    factor: Vec<f64>,
    factored: bool,
    /// The factor is `L B Lᵀ`, with these entries of `B` off its diagonal, and rows exchanged within supernodes (there and back).
    indefinite: bool,
    off_diagonal: Vec<f64>,
    pivoting: [Vec<usize>; 2],
    permuted: Vec<f64>,
    room_for_indefinite: bool,
    /// Row whose pivot is smallest relative to its diagonal entry.
    weakest: usize,
    memory: Option<MemBuffer>,
    right: Vec<f64>,
    solution: Vec<f64>,
    residual: Vec<f64>,
    correction: Vec<f64>,
}

impl SparseCholesky {
    /// Orders and analyses a pattern with the dofs marked in `fixed` eliminated.
    ///
    /// `positions` holds the same number of coordinates for each point; empty where there is no geometry (minimum degree is then
    /// used). `threads` is the number of threads of the numeric work (at least 1, at most the cores, as more only hinder each other); the result is the same for any number.
    ///
    /// # Errors
    /// [`DirectError::OutOfMemory`].
    ///
    /// # Panics
    /// Where lengths do not agree.
    pub fn analyze(pattern: Arc<BlockPattern>, positions: &[f64], fixed: &[bool], threads: usize) -> Result<Self, DirectError> {
        let (d, points) = (pattern.block(), pattern.points());
        assert_eq!(fixed.len(), pattern.dofs());
        let kept: Vec<bool> = (0..points).map(|p| fixed[p * d..(p + 1) * d].contains(&false)).collect();
        let kept_points: Vec<u32> = (0..points as u32).filter(|&p| kept[p as usize]).collect();
        let free_of = |p: u32| (0..d).filter(move |i| !fixed[p as usize * d + i]).map(move |i| p as usize * d + i);
        let graph = Graph::new(&pattern, &kept);
        let dofs: usize = kept_points.iter().map(|&p| free_of(p).count()).sum();
        let out_of_memory = |values| DirectError::OutOfMemory { dofs, values };

        let dissected = match positions.is_empty() || points == 0 {
            true => None,
            false => {
                let dimension = positions.len() / points;
                assert_eq!(positions.len(), points * dimension);
                let of = |&p: &u32| positions[p as usize * dimension..(p as usize + 1) * dimension].iter().copied();
                let kept_positions: Vec<f64> = kept_points.iter().flat_map(of).collect();
                Some(fill(&graph, &nested_dissection(&graph, &kept_positions, dimension)).ok_or(out_of_memory(0))?)
            }
        };
        let (order, ordering) = match dissected {
            // minimum degree takes longer than dissection, the more so the wider the couplings, and hardly ever fills less
            Some((_, dissected)) if graph.len() >= DISSECTED => (dissected, Ordering::NestedDissection),
            dissected => {
                let minimum = minimum_degree(&graph).ok_or(out_of_memory(0))?;
                let (least, minimum) = fill(&graph, &minimum).ok_or(out_of_memory(0))?;
                match dissected {
                    Some((fill, dissected)) if fill as f64 <= EQUAL_FILL * least as f64 => (dissected, Ordering::NestedDissection),
                    _ => (minimum, Ordering::MinimumDegree),
                }
            }
        };

        // Permuted numbers of the free dofs: those of a point stay together.
        let mut dof = Vec::with_capacity(dofs);
        let mut number = vec![usize::MAX; pattern.dofs()];
        for &k in &order {
            for i in free_of(kept_points[k as usize]) {
                number[i] = dof.len();
                dof.push(i as u32);
            }
        }
        let (starts, rows, sources) = reduced_columns(&pattern, &number, dofs);
        let mut this = Self {
            pattern,
            fixed: fixed.to_vec(),
            ordering,
            threads: threads.clamp(1, std::thread::available_parallelism().map_or(1, |n| n.get())),
            dof,
            values: vec![0.0; rows.len()],
            starts,
            rows,
            sources,
            symbolic: None,
            factor: Vec::new(),
            factored: false,
            indefinite: false,
            off_diagonal: Vec::new(),
            pivoting: Default::default(),
            permuted: Vec::new(),
            room_for_indefinite: false,
            weakest: 0,
            memory: None,
            right: vec![0.0; dofs],
            solution: vec![0.0; dofs],
            residual: vec![0.0; dofs],
            correction: vec![0.0; dofs],
        };
        this.symbolic = Some(this.analyze_columns().ok_or(out_of_memory(0))?);
        Ok(this)
    }

    /// The symbolic supernodal factor; `None` where memory or the range of indices does not suffice.
    fn analyze_columns(&self) -> Option<supernodal::SymbolicSupernodalCholesky<usize>> {
        let n = self.dof.len();
        // `faer` analyses the upper triangle: the transposed pattern.
        let (upper_starts, upper_rows) = transpose(n, &self.starts, &self.rows);
        let upper = SymbolicSparseColMatRef::new_checked(n, n, &upper_starts, None, &upper_rows);
        let request = StackReq::any_of(&[
            simplicial::prefactorize_symbolic_cholesky_scratch::<usize>(n, upper_rows.len()),
            supernodal::factorize_supernodal_symbolic_cholesky_scratch::<usize>(n),
        ]);
        let mut memory = MemBuffer::try_new(request).ok()?;
        let stack = MemStack::new(&mut memory);
        let (mut tree, mut counts) = (vec![0isize; n], vec![0usize; n]);
        let tree = simplicial::prefactorize_symbolic_cholesky(&mut tree, &mut counts, upper, stack);
        supernodal::factorize_supernodal_symbolic_cholesky(upper, tree, &counts, stack, Default::default()).ok()
    }

    fn symbolic(&self) -> &supernodal::SymbolicSupernodalCholesky<usize> {
        self.symbolic.as_ref().expect("set by `analyze`")
    }

    /// Whether this analysis serves a matrix of that pattern with those fixed dofs.
    pub fn serves(&self, pattern: &Arc<BlockPattern>, fixed: &[bool]) -> bool {
        Arc::ptr_eq(&self.pattern, pattern) && self.fixed == fixed
    }

    /// The ordering that was chosen.
    pub fn ordering(&self) -> Ordering {
        self.ordering
    }

    /// Number of free dofs.
    pub fn free_dofs(&self) -> usize {
        self.dof.len()
    }

    /// Numbers in the factor, explicit zeros of the supernodes included.
    pub fn factor_values(&self) -> usize {
        self.symbolic().len_val()
    }

    /// Bytes that the factor and its reduced matrix take.
    pub fn bytes(&self) -> usize {
        8 * self.factor_values() + 20 * self.rows.len()
    }

    /// Factors `matrix + diag(addition)`; `addition` has one entry per dof of the whole problem.
    ///
    /// # Errors
    /// [`DirectError::NotPositiveDefinite`] with the dof of the failing pivot; [`DirectError::OutOfMemory`].
    ///
    /// # Panics
    /// Where the matrix has another pattern than the one analysed.
    pub fn factor(&mut self, matrix: &BlockMatrix, addition: Option<&[f64]>) -> Result<(), DirectError> {
        if !self.take_values(matrix, addition) {
            return Ok(());
        }
        let n = self.dof.len();
        // A pivot that is NaN is not reliably refused by the dense kernels.
        for k in 0..n {
            let pivot = self.values[self.starts[k]];
            if !(pivot > 0.0 && pivot.is_finite()) {
                return Err(DirectError::NotPositiveDefinite { dof: self.dof[k] as usize });
            }
        }
        self.reserve(false)?;
        let par = parallelism(self.threads);
        let symbolic = self.symbolic.as_ref().expect("set by `analyze`");
        let stack = MemStack::new(self.memory.as_mut().expect("allocated with the factor"));
        let pattern = SymbolicSparseColMatRef::new_unsorted_checked(n, n, &self.starts, None, &self.rows);
        let lower = SparseColMatRef::new(pattern, &self.values);
        supernodal::factorize_supernodal_numeric_llt(
            &mut self.factor,
            lower,
            LltRegularization::default(),
            symbolic,
            par,
            stack,
            Default::default(),
        )
        .map_err(|LltError::NonPositivePivot { index }| DirectError::NotPositiveDefinite { dof: self.dof[index.min(n - 1)] as usize })?;
        let (weakest, ratio) = self.weakest_pivot();
        if ratio < SINGULAR || ratio.is_nan() {
            return Err(DirectError::NotPositiveDefinite { dof: self.dof[weakest] as usize });
        }
        self.weakest = weakest;
        self.factored = true;
        Ok(())
    }

    /// Takes the values of a matrix into the reduced one; `false` where no dof is free and nothing is left to do.
    fn take_values(&mut self, matrix: &BlockMatrix, addition: Option<&[f64]>) -> bool {
        assert!(Arc::ptr_eq(matrix.pattern(), &self.pattern), "the matrix must share the analysed pattern");
        (self.factored, self.indefinite) = (false, false);
        let n = self.dof.len();
        if n == 0 {
            self.factored = true;
            return false;
        }
        let source = matrix.values();
        for (value, &from) in self.values.iter_mut().zip(&self.sources) {
            *value = source[from as usize];
        }
        if let Some(addition) = addition {
            for k in 0..n {
                self.values[self.starts[k]] += addition[self.dof[k] as usize];
            }
        }
        true
    }

    /// Makes room for a factor.
    fn reserve(&mut self, indefinite: bool) -> Result<(), DirectError> {
        let par = parallelism(self.threads);
        let symbolic = self.symbolic.as_ref().expect("set by `analyze`");
        let out_of_memory = DirectError::OutOfMemory { dofs: self.dof.len(), values: symbolic.len_val() };
        if self.factor.is_empty() {
            // asked for twice, because only the second way gets pages that are zero without being written
            Vec::<f64>::new().try_reserve_exact(symbolic.len_val()).map_err(|_| out_of_memory.clone())?;
            self.factor = vec![0.0; symbolic.len_val()];
        } else if self.memory.is_some() && (!indefinite || self.room_for_indefinite) {
            return Ok(());
        }
        let solve = symbolic.solve_in_place_scratch::<f64>(1, par);
        let (llt, lblt): (Spec<LltParams, f64>, Spec<LbltParams, f64>) = Default::default();
        let mut request = supernodal::factorize_supernodal_numeric_llt_scratch::<usize, f64>(symbolic, par, llt).or(solve);
        if indefinite {
            request = request.or(supernodal::factorize_supernodal_numeric_intranode_lblt_scratch::<usize, f64>(symbolic, par, lblt));
            self.off_diagonal.resize(self.dof.len(), 0.0);
            self.permuted.resize(self.dof.len(), 0.0);
            self.pivoting.iter_mut().for_each(|p| p.resize(self.dof.len(), 0));
        }
        self.memory = Some(MemBuffer::try_new(request).map_err(|_| out_of_memory)?);
        self.room_for_indefinite = indefinite;
        Ok(())
    }

    /// Factors a symmetric matrix that need not be positive definite, `P A Pᵀ = L B Lᵀ` with blocks of one or two pivots in `B` (Bunch and
    /// Kaufman 1977, Math. Comp. 31), and returns the number of its negative eigenvalues (Sylvester's law of inertia): 0 where an
    /// equilibrium is stable.
    ///
    /// Pivots are chosen within supernodes, so the fill is that of the analysis; where that does not suffice, digits are lost, which
    /// [`solve`](Self::solve) refines or tells.
    ///
    /// # Errors
    /// [`DirectError::Singular`] where a pivot vanishes; [`DirectError::OutOfMemory`].
    ///
    /// # Panics
    /// Where the matrix has another pattern than the one analysed.
    pub fn factor_indefinite(&mut self, matrix: &BlockMatrix, addition: Option<&[f64]>) -> Result<usize, DirectError> {
        if !self.take_values(matrix, addition) {
            return Ok(0);
        }
        self.reserve(true)?;
        let n = self.dof.len();
        let par = parallelism(self.threads);
        let symbolic = self.symbolic.as_ref().expect("set by `analyze`");
        let stack = MemStack::new(self.memory.as_mut().expect("allocated with the factor"));
        let pattern = SymbolicSparseColMatRef::new_unsorted_checked(n, n, &self.starts, None, &self.rows);
        let lower = SparseColMatRef::new(pattern, &self.values);
        let [forward, inverse] = &mut self.pivoting;
        supernodal::factorize_supernodal_numeric_intranode_lblt(
            &mut self.factor,
            &mut self.off_diagonal,
            forward,
            inverse,
            lower,
            symbolic,
            par,
            stack,
            Default::default(),
        );
        let (mut negative, mut weakest) = (0, (0, f64::INFINITY));
        let mut first: Option<f64> = None;
        for (k, pivot) in self.pivots() {
            let row = self.pivoting[0][k];
            let dof = self.dof[row] as usize;
            let off = self.off_diagonal[k];
            let size = match first.take() {
                // the second of a pair: the determinant of the block tells
                Some(before) => {
                    let off = self.off_diagonal[k - 1];
                    let determinant = before * pivot - off * off;
                    negative += if determinant < 0.0 { 1 } else { 2 * usize::from(before < 0.0) };
                    determinant.abs().sqrt()
                }
                None if off != 0.0 => {
                    first = Some(pivot);
                    continue;
                }
                None => {
                    negative += usize::from(pivot < 0.0);
                    pivot.abs()
                }
            };
            if !(size > 0.0 && size.is_finite()) {
                return Err(DirectError::Singular { dof });
            }
            let ratio = size / self.values[self.starts[row]].abs();
            if ratio < weakest.1 {
                weakest = (row, ratio);
            }
        }
        self.weakest = weakest.0;
        (self.factored, self.indefinite) = (true, true);
        Ok(negative)
    }

    /// Rows and the diagonal entries of the factor: roots of pivots, or the diagonal of `B` of an indefinite one.
    fn pivots(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let symbolic = self.symbolic();
        (0..symbolic.n_supernodes()).flat_map(move |s| {
            let (first, last) = (symbolic.supernode_begin()[s], symbolic.supernode_end()[s]);
            let rows = last - first + symbolic.supernode(s).pattern().len();
            (first..last).map(move |k| (k, self.factor[symbolic.col_ptr_for_val()[s] + (k - first) * (rows + 1)]))
        })
    }

    /// The row whose pivot is smallest relative to its diagonal entry before elimination, and that ratio.
    fn weakest_pivot(&self) -> (usize, f64) {
        let mut weakest = (0, f64::INFINITY);
        for (k, root) in self.pivots() {
            let ratio = root * root / self.values[self.starts[k]];
            if ratio < weakest.1 || ratio.is_nan() {
                weakest = (k, ratio);
            }
            if ratio.is_nan() {
                return weakest;
            }
        }
        weakest
    }

    /// Solves `A x = b` for the free dofs with the matrix last factored, with one step of iterative refinement where it helps. Fixed
    /// entries of `b` are not read; those of `x` become zero.
    ///
    /// # Errors
    /// [`DirectError::Inaccurate`] where the relative residual stays above 1e-6; [`DirectError::NotFactored`].
    pub fn solve(&mut self, b: &[f64], x: &mut [f64]) -> Result<DirectReport, DirectError> {
        if !self.factored {
            return Err(DirectError::NotFactored);
        }
        x.fill(0.0);
        for (right, &dof) in self.right.iter_mut().zip(&self.dof) {
            *right = b[dof as usize];
        }
        let scale = vector::norm(&self.right);
        if scale == 0.0 {
            return Ok(DirectReport { residual: 0.0, error: 0.0 });
        }
        self.solution.copy_from_slice(&self.right);
        self.back_substitute(false);
        let mut reached = self.compute_residual() / scale;
        let mut error = 0.0;
        // without pivoting more digits may be lost
        for _ in 0..if self.indefinite { 4 } else { 1 } {
            if reached <= 4.0 * f64::EPSILON {
                break;
            }
            self.back_substitute(true);
            error = vector::norm(&self.residual) / vector::norm(&self.solution);
            vector::add_scaled(&mut self.solution, 1.0, &self.residual);
            // Keep the refined solution only where it is better: near singular matrices can make it worse.
            self.correction.copy_from_slice(&self.residual);
            let refined = self.compute_residual() / scale;
            if refined < reached {
                reached = refined;
            } else {
                vector::add_scaled(&mut self.solution, -1.0, &self.correction);
                break;
            }
        }
        if (reached > INACCURATE && error > UNSETTLED) || reached.is_nan() || error.is_nan() {
            return Err(DirectError::Inaccurate { residual: reached, dof: self.dof[self.weakest] as usize });
        }
        for (&dof, &value) in self.dof.iter().zip(&self.solution) {
            x[dof as usize] = value;
        }
        Ok(DirectReport { residual: reached, error })
    }

    /// Solves `A x = b` by substitution alone, without refinement: for preconditioners. Zero at fixed dofs.
    ///
    /// # Errors
    /// [`DirectError::NotFactored`].
    pub fn substitute(&mut self, b: &[f64], x: &mut [f64]) -> Result<(), DirectError> {
        if !self.factored {
            return Err(DirectError::NotFactored);
        }
        x.fill(0.0);
        for (solution, &dof) in self.solution.iter_mut().zip(&self.dof) {
            *solution = b[dof as usize];
        }
        if !self.dof.is_empty() {
            self.back_substitute(false);
        }
        for (&dof, &value) in self.dof.iter().zip(&self.solution) {
            x[dof as usize] = value;
        }
        Ok(())
    }

    /// Solves in place with the factor alone: in `residual` or in `solution`.
    fn back_substitute(&mut self, residual: bool) {
        let symbolic = self.symbolic.as_ref().expect("set by `analyze`");
        let stack = MemStack::new(self.memory.as_mut().expect("allocated with the factor"));
        let vector = if residual { &mut self.residual } else { &mut self.solution };
        let n = vector.len();
        // One right-hand side is bound by memory: threads would only spin.
        if self.indefinite {
            let [forward, inverse] = &self.pivoting;
            for (p, &from) in self.permuted.iter_mut().zip(forward) {
                *p = vector[from];
            }
            let perm = PermRef::new_checked(forward, inverse, n);
            supernodal::SupernodalIntranodeLbltRef::new(symbolic, &self.factor, &self.off_diagonal, perm)
                .solve_in_place_no_numeric_permute_with_conj(
                    Conj::No,
                    MatMut::from_column_major_slice_mut(&mut self.permuted, n, 1),
                    Par::Seq,
                    stack,
                );
            for (p, &to) in self.permuted.iter().zip(forward) {
                vector[to] = *p;
            }
        } else {
            let llt = supernodal::SupernodalLltRef::new(symbolic, &self.factor);
            let mut vector = MatMut::from_column_major_slice_mut(vector, n, 1);
            llt.solve_in_place_with_conj(Conj::No, vector.rb_mut(), Par::Seq, stack);
        }
    }

    /// `residual = right − A solution`; returns its norm.
    fn compute_residual(&mut self) -> f64 {
        self.residual.copy_from_slice(&self.right);
        for column in 0..self.dof.len() {
            let (first, last) = (self.starts[column], self.starts[column + 1]);
            let x = self.solution[column];
            let mut sum = self.values[first] * x;
            for k in first + 1..last {
                let row = self.rows[k];
                sum += self.values[k] * self.solution[row];
                self.residual[row] -= self.values[k] * x;
            }
            self.residual[column] -= sum;
        }
        vector::norm(&self.residual)
    }
}

fn parallelism(threads: usize) -> Par {
    if threads > 1 { Par::rayon(threads) } else { Par::Seq }
}

/// Lower triangle of the permuted matrix by columns (diagonal first), with the place of each entry among the block values. `number`
/// maps dofs to permuted numbers, `usize::MAX` for fixed ones.
fn reduced_columns(pattern: &BlockPattern, number: &[usize], dofs: usize) -> (Vec<usize>, Vec<usize>, Vec<u32>) {
    fn visit(pattern: &BlockPattern, number: &[usize], mut entry: impl FnMut(usize, usize, usize)) {
        let d = pattern.block();
        for column in 0..pattern.points() {
            let first = pattern.first_slot(column);
            for (k, &row) in pattern.column(column).iter().enumerate() {
                for j in 0..d {
                    // Of a diagonal block, whole in memory, the lower half is enough.
                    for i in if k == 0 { j } else { 0 }..d {
                        let (a, b) = (number[row as usize * d + i], number[column * d + j]);
                        if a != usize::MAX && b != usize::MAX {
                            entry(a.max(b), a.min(b), ((first + k) * d + j) * d + i);
                        }
                    }
                }
            }
        }
    }
    let mut starts = vec![0usize; dofs + 1];
    visit(pattern, number, |_, column, _| starts[column + 1] += 1);
    for k in 0..dofs {
        starts[k + 1] += starts[k];
    }
    let (mut rows, mut sources) = (vec![0usize; starts[dofs]], vec![0u32; starts[dofs]]);
    // The diagonal takes the first place of its column.
    let mut next: Vec<usize> = starts[..dofs].iter().map(|s| s + 1).collect();
    visit(pattern, number, |row, column, source| {
        let place = if row == column { starts[column] } else { next[column] };
        next[column] += usize::from(row != column);
        rows[place] = row;
        sources[place] = source as u32;
    });
    (starts, rows, sources)
}

fn transpose(n: usize, starts: &[usize], rows: &[usize]) -> (Vec<usize>, Vec<usize>) {
    let mut upper = vec![0usize; n + 1];
    for &row in rows {
        upper[row + 1] += 1;
    }
    for k in 0..n {
        upper[k + 1] += upper[k];
    }
    let mut next = upper.clone();
    let mut columns = vec![0usize; rows.len()];
    for column in 0..n {
        for &row in &rows[starts[column]..starts[column + 1]] {
            columns[next[row]] = column;
            next[row] += 1;
        }
    }
    (upper, columns)
}

/// Approximate minimum degree on the graph of points; `None` where memory does not suffice.
fn minimum_degree(graph: &Graph) -> Option<Vec<u32>> {
    let n = graph.len();
    let (mut starts, mut rows) = (vec![0usize], Vec::new());
    for p in 0..n {
        rows.extend(graph.neighbors(p).iter().map(|&q| q as usize).filter(|&q| q < p));
        starts.push(rows.len());
    }
    let upper = SymbolicSparseColMatRef::new_unsorted_checked(n, n, &starts, None, &rows);
    let mut memory = MemBuffer::try_new(amd::order_maybe_unsorted_scratch::<usize>(n, rows.len())).ok()?;
    let (mut order, mut inverse) = (vec![0usize; n], vec![0usize; n]);
    let stack = MemStack::new(&mut memory);
    amd::order_maybe_unsorted(&mut order, &mut inverse, upper, Default::default(), stack).ok()?;
    Some(order.into_iter().map(|p| p as u32).collect())
}

/// Blocks in the factor of the graph of points eliminated in this order, and the order rearranged as a postorder of the elimination
/// tree: the same fill, with columns of equal structure side by side, as supernodes need them.
fn fill(graph: &Graph, order: &[u32]) -> Option<(usize, Vec<u32>)> {
    let n = graph.len();
    let mut number = vec![0usize; n];
    for (k, &p) in order.iter().enumerate() {
        number[p as usize] = k;
    }
    let (mut starts, mut rows) = (vec![0usize], Vec::new());
    for (k, &p) in order.iter().enumerate() {
        rows.extend(graph.neighbors(p as usize).iter().map(|&q| number[q as usize]).filter(|&q| q < k));
        starts.push(rows.len());
    }
    let upper = SymbolicSparseColMatRef::new_unsorted_checked(n, n, &starts, None, &rows);
    let request = simplicial::prefactorize_symbolic_cholesky_scratch::<usize>(n, rows.len());
    let mut memory = MemBuffer::try_new(request).ok()?;
    let (mut tree, mut counts) = (vec![0isize; n], vec![0usize; n]);
    simplicial::prefactorize_symbolic_cholesky(&mut tree, &mut counts, upper, MemStack::new(&mut memory));
    // Children in ascending order, by lists built backwards; a root has the parent −1.
    let (mut first_child, mut next_sibling) = (vec![n; n + 1], vec![n; n]);
    for k in (0..n).rev() {
        let parent = usize::try_from(tree[k]).unwrap_or(n);
        next_sibling[k] = first_child[parent];
        first_child[parent] = k;
    }
    let (mut postorder, mut stack) = (Vec::with_capacity(n), Vec::new());
    let mut root = first_child[n];
    while root < n {
        stack.push(root);
        while let Some(&k) = stack.last() {
            let child = first_child[k];
            if child < n {
                first_child[k] = next_sibling[child];
                stack.push(child);
            } else {
                postorder.push(order[k]);
                stack.pop();
            }
        }
        root = next_sibling[root];
    }
    Some((counts.iter().sum(), postorder))
}
