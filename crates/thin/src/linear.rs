//! One linear solution with refined residuals, and what it says of lost digits.
//!
//! The operator of a beam grows like n⁴ with its number of points, so a factor in 64 bits loses digits: with exact answer 1, a cantilever
//! (N = 3) gives 1.000005 at n = 1,001, 0.99992 at 3,001, 0.946 at 10,001. Here the residual is computed pair by pair in twice the
//! precision, and the solution corrected with the factor until corrections vanish: all digits come back as long as the factor has any.
//! The first correction tells how many were lost.

use crate::body::Thin;
use crate::structure::ThinStructure;
use crate::{ThinError, angle::Potential, pairs::Law};
use solvers::direct::{DirectError, SparseCholesky};
use solvers::problem::{Statics, Stop};
use solvers::sparse::BlockMatrix;

/// A linear solution.
#[derive(Clone, Debug)]
pub struct LinearSolution {
    /// Displacements.
    pub u: Vec<f64>,
    /// Largest change by the first correction, relative to the largest displacement: the error of an unrefined solution, about
    /// condition number times 1e-16.
    pub lost: f64,
    /// Largest change by the last correction, relative to the largest displacement: the error that is left.
    pub error: f64,
    /// Corrections made.
    pub corrections: usize,
}

/// Why there is no linear solution.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LinearError {
    /// The body is not linear.
    #[error("angles or pairs of this body are not linear: use Newton's method")]
    NotLinear,
    /// The body could not be evaluated.
    #[error(transparent)]
    Evaluation(#[from] Stop),
    /// The stiffness could not be made.
    #[error(transparent)]
    Body(#[from] ThinError),
    /// The stiffness could not be factored.
    #[error(
        "{cause}; with {points} points along the body the stiffness spans {digits:.0} digits of the 16 there are: if the body is held, use \
         fewer points"
    )]
    Factor {
        /// Why.
        cause: DirectError,
        /// Points along the longest row.
        points: usize,
        /// log10 of the fourth power of the points.
        digits: f64,
    },
    /// All digits are lost.
    #[error(
        "corrections of the solution do not vanish (the last is {change:.1e} of it): the stiffness of {points} points along the body spans more digits than the arithmetic has; use fewer points"
    )]
    Lost {
        /// Last relative correction.
        change: f64,
        /// Points along the longest row.
        points: usize,
    },
}

/// Where fewer digits than this are left of an unrefined solution, users should know.
pub const WARN_LOST: f64 = 1e-6;

impl LinearSolution {
    /// What the user should know of lost digits, if anything.
    pub fn warning(&self) -> Option<String> {
        (self.lost > WARN_LOST).then(|| {
            format!(
                "the stiffness is so ill-conditioned (its condition grows with the fourth power of the number of points) that a plain solution has a relative error of {:.1e}; {} corrections in higher precision left {:.1e}",
                self.lost, self.corrections, self.error
            )
        })
    }
}

/// Points along the longest row of a body.
pub fn longest_row<const D: usize>(body: &Thin<D>) -> usize {
    let layout = body.layout();
    if !layout.is_lattice() {
        // as many spacings as fit on the diagonal
        let extent =
            (0..3).map(|k| layout.positions.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x[k]), b.max(x[k]))));
        let diagonal = extent.fold(0.0f64, |d, (low, high)| d.hypot(high - low));
        return (diagonal / layout.spacing[0]) as usize + 1;
    }
    (0..layout.dimension)
        .map(|r| {
            let (lo, hi) = (0..layout.len()).fold((i32::MAX, i32::MIN), |(a, b), p| (a.min(layout.cell(p)[r]), b.max(layout.cell(p)[r])));
            (hi - lo) as usize + 1
        })
        .max()
        .unwrap_or(0)
}

/// Solves a linear body at load parameter `t`, with refinement.
///
/// # Errors
/// [`LinearError`].
pub fn solve(structure: &mut ThinStructure<1>, t: f64, threads: usize) -> Result<LinearSolution, LinearError> {
    if !structure.body.is_linear() {
        return Err(LinearError::NotLinear);
    }
    let n = structure.body.points();
    let points = longest_row(&structure.body);
    let pattern = structure.body.pattern()?;
    let mut matrix = BlockMatrix::new(pattern.clone());
    let zero = vec![0.0; n];
    Statics::tangent(structure, t, &zero, &mut matrix)?;
    let fixed = Statics::fixed(structure).to_vec();
    let factor_error = |cause| LinearError::Factor { cause, points, digits: 4.0 * (points as f64).log10() };
    let mut factor = SparseCholesky::analyze(pattern, structure.positions(), &fixed, threads).map_err(factor_error)?;
    factor.factor(&matrix, None).map_err(factor_error)?;
    drop(matrix);
    let mut u = vec![0.0; n];
    structure.prescribe(t, &mut u);
    let mut load = vec![0.0; n];
    structure.external(t, &mut load);
    let solved = |residual: &[f64], change: &mut [f64]| factor.solve(residual, change).map(drop).map_err(factor_error);
    refine(12, u, points, |u, residual| precise_residual(&structure.body, u, &load, residual), solved)
}

/// Corrects `u` up to `passes` times, as long as corrections shrink: the first time it is the solution itself, from what `u` prescribes.
fn refine(
    passes: usize,
    mut u: Vec<f64>,
    points: usize,
    residual_at: impl Fn(&[f64], &mut [f64]),
    mut solved: impl FnMut(&[f64], &mut [f64]) -> Result<(), LinearError>,
) -> Result<LinearSolution, LinearError> {
    let (mut residual, mut change) = (vec![0.0; u.len()], vec![0.0; u.len()]);
    let (mut lost, mut error, mut corrections) = (0.0, 0.0, 0);
    for pass in 0..passes {
        residual_at(&u, &mut residual);
        solved(&residual, &mut change)?;
        u.iter_mut().zip(&change).for_each(|(u, c)| *u += c);
        let largest = |x: &[f64]| x.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let now = if largest(&u) > 0.0 { largest(&change) / largest(&u) } else { 0.0 };
        if pass == 1 {
            lost = now;
        }
        if pass >= 1 {
            corrections = pass;
            let slow = pass > 1 && now > 0.5 * error;
            error = now;
            if now < 1e-12 || slow {
                break;
            }
        }
    }
    if error > 1e-3 || error.is_nan() {
        return Err(LinearError::Lost { change: error, points });
    }
    Ok(LinearSolution { u, lost, error, corrections })
}

/// a + b exactly, as a sum and its error.
#[inline(always)]
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    let t = s - a;
    (s, (a - (s - t)) + (b - t))
}

/// A number of twice the precision.
#[derive(Clone, Copy, Default)]
struct Twice(f64, f64);

impl Twice {
    #[inline(always)]
    fn add(self, o: Twice) -> Twice {
        let (s, e) = two_sum(self.0, o.0);
        let e = e + self.1 + o.1;
        let (s, e) = two_sum(s, e);
        Twice(s, e)
    }
    #[inline(always)]
    fn times(self, x: f64) -> Twice {
        let p = self.0 * x;
        let e = self.0.mul_add(x, -p) + self.1 * x;
        let (s, e) = two_sum(p, e);
        Twice(s, e)
    }
}

/// `load + internal force` of a linear body, with sums over pairs in twice the precision.
fn precise_residual(body: &Thin<1>, u: &[f64], load: &[f64], out: &mut [f64]) {
    debug_assert!(body.law == Law::Elastic(Potential::Square));
    let mut sums: Vec<Twice> = load.iter().map(|f| Twice(*f, 0.0)).collect();
    let value = |end: u32| {
        let mut sum = Twice::default();
        for (q, w) in body.ends().stencil(end) {
            sum = sum.add(Twice(u[*q as usize], 0.0).times(w[0]));
        }
        sum
    };
    let mut give = |end: u32, force: Twice| {
        for (q, w) in body.ends().stencil(end) {
            sums[*q as usize] = sums[*q as usize].add(force.times(w[0]));
        }
    };
    let mut angles: Vec<Twice> = vec![];
    for p in 0..body.points() {
        let centre = value(p as u32).times(-2.0);
        let pairs = body.pairs_of(p);
        angles.clear();
        let mut mean = Twice::default();
        let first = body.starts[p];
        for (k, pair) in pairs.iter().enumerate() {
            let second = if body.intact[first + k] { value(pair.plus).add(value(pair.minus)).add(centre) } else { Twice::default() };
            // φ ξ; its lengths come in with the stiffness
            mean = mean.add(second.times(pair.isotropic / body.arm(pair).length));
            angles.push(second);
        }
        let iso = 2.0 * body.isotropic[p];
        let mut at_centre = Twice::default();
        for (k, pair) in pairs.iter().enumerate() {
            if !body.intact[first + k] {
                continue;
            }
            let length = body.arm(pair).length;
            let mut pull = angles[k].times(-pair.stiffness / (length * length));
            if iso != 0.0 {
                pull = pull.add(mean.times(-iso * pair.isotropic / length));
            }
            give(pair.plus, pull);
            give(pair.minus, pull);
            at_centre = at_centre.add(pull.times(-2.0));
        }
        if let Some(prestress) = &body.prestress {
            let own = value(p as u32).times(-1.0);
            for (end, k) in &prestress.springs[prestress.starts[p]..prestress.starts[p + 1]] {
                let pull = value(*end).add(own).times(-k);
                give(*end, pull);
                at_centre = at_centre.add(pull.times(-1.0));
            }
        }
        give(p as u32, at_centre);
    }
    out.iter_mut().zip(&sums).for_each(|(o, s)| *o = s.0 + s.1);
}

/// Displacements of any body by its tangent in the reference: the linear solution at load parameter `t`, with corrections by the factor while
/// they shrink. The residual is that of the linearised body, in working precision.
///
/// # Errors
/// [`LinearError`].
pub fn solve_linearised<const D: usize>(structure: &mut ThinStructure<D>, t: f64, threads: usize) -> Result<LinearSolution, LinearError> {
    let dofs = Statics::dofs(structure);
    let points = longest_row(&structure.body);
    let pattern = structure.body.pattern()?;
    let mut matrix = BlockMatrix::new(pattern.clone());
    let zero = vec![0.0; dofs];
    Statics::tangent(structure, t, &zero, &mut matrix)?;
    let fixed = Statics::fixed(structure).to_vec();
    let factor_error = |cause| LinearError::Factor { cause, points, digits: 4.0 * (points as f64).log10() };
    let mut factor = SparseCholesky::analyze(pattern, structure.positions(), &fixed, threads).map_err(factor_error)?;
    factor.factor(&matrix, None).map_err(factor_error)?;
    let mut u = vec![0.0; dofs];
    structure.prescribe(t, &mut u);
    let mut load = vec![0.0; dofs];
    structure.external(t, &mut load);
    let residual_at = |u: &[f64], residual: &mut [f64]| {
        matrix.product(u, residual);
        residual.iter_mut().zip(&load).for_each(|(r, f)| *r = f - *r);
    };
    let solved = |residual: &[f64], change: &mut [f64]| factor.solve(residual, change).map(drop).map_err(factor_error);
    refine(6, u, points, residual_at, solved)
}
