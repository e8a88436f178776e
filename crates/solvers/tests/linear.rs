//! Linear solvers against dense elimination and known spectra.

mod common;

use std::f64::consts::PI;
use std::sync::Arc;

use common::{Truss, chain, dense_solve, lattice, with_threads};
use solvers::direct::{DirectError, Ordering, SparseCholesky};
use solvers::krylov::{BlockJacobi, ConjugateGradients, Gmres, Identity, KrylovEnd, KrylovOptions};
use solvers::problem::Statics;
use solvers::sparse::{BlockMatrix, BlockPattern, FamilyList, SparseError};
use solvers::vector;

/// The free part of the tangent, dense, from products with unit vectors.
fn dense<const D: usize>(truss: &mut Truss<D>, u: &[f64]) -> Vec<Vec<f64>> {
    let n = u.len();
    let mut a = vec![vec![0.0; n]; n];
    for j in 0..n {
        let mut unit = vec![0.0; n];
        let mut column = vec![0.0; n];
        unit[j] = 1.0;
        Statics::tangent_product(truss, 0.0, u, &unit, &mut column).unwrap();
        for i in 0..n {
            let fixed = truss.fixed[i] || truss.fixed[j];
            a[i][j] = if fixed { f64::from(u8::from(i == j)) } else { column[i] };
        }
    }
    a
}

fn assembled<const D: usize>(truss: &mut Truss<D>, u: &[f64]) -> BlockMatrix {
    let mut matrix = BlockMatrix::new(truss.pattern().unwrap());
    truss.tangent(0.0, u, &mut matrix).unwrap();
    matrix
}

fn bent(n: usize) -> Vec<f64> {
    (0..n).map(|k| 0.03 * ((3 * k) as f64).sin()).collect()
}

#[test]
fn a_truss_agrees_with_dense_elimination() {
    let mut truss = lattice(12, 7, 2.5e9);
    truss.fixed[50] = true; // One component of a point: blocks in part.
    let n = truss.load.len();
    let u = bent(n);
    let matrix = assembled(&mut truss, &u);
    let mut b: Vec<f64> = (0..n).map(|k| 1e3 * (k as f64).cos()).collect();
    let mut cholesky = SparseCholesky::analyze(matrix.pattern().clone(), &truss.positions, &truss.fixed, 2).unwrap();
    cholesky.factor(&matrix, None).unwrap();
    let mut x = vec![f64::NAN; n];
    let report = cholesky.solve(&b, &mut x).unwrap();
    let a = dense(&mut truss, &u);
    vector::clear_fixed(&mut b, &truss.fixed);
    let exact = dense_solve(a, b.clone());
    let scale = vector::largest(&exact);
    for k in 0..n {
        assert!((x[k] - exact[k]).abs() < 1e-11 * scale, "{k}: {} {}", x[k], exact[k]);
    }
    assert!(report.residual < 1e-14, "{report:?}");
    // With an addition to the diagonal, through the same analysis.
    let addition: Vec<f64> = (0..n).map(|k| 1e8 * (1.0 + (k % 3) as f64)).collect();
    cholesky.factor(&matrix, Some(&addition)).unwrap();
    cholesky.solve(&b, &mut x).unwrap();
    let mut a = dense(&mut truss, &u);
    (0..n).filter(|&k| !truss.fixed[k]).for_each(|k| a[k][k] += addition[k]);
    let exact = dense_solve(a, b);
    assert!((0..n).all(|k| (x[k] - exact[k]).abs() < 1e-11 * scale));
}

#[test]
fn products_agree_with_the_bars() {
    let mut truss = lattice(9, 8, 3.0);
    let n = truss.load.len();
    let u = bent(n);
    let matrix = assembled(&mut truss, &u);
    let x: Vec<f64> = (0..n).map(|k| (k as f64 * 0.7).sin()).collect();
    let (mut by_matrix, mut by_bars) = (vec![0.0; n], vec![0.0; n]);
    matrix.product(&x, &mut by_matrix);
    Statics::tangent_product(&mut truss, 0.0, &u, &x, &mut by_bars).unwrap();
    let scale = vector::largest(&by_bars);
    assert!((0..n).all(|k| (by_matrix[k] - by_bars[k]).abs() < 1e-13 * scale));
    let (mut diagonal, mut unit) = (vec![0.0; n], vec![0.0; n]);
    matrix.diagonal(&mut diagonal);
    unit[33] = 1.0;
    matrix.product(&unit, &mut by_matrix);
    assert_eq!(diagonal[33], by_matrix[33]);
}

#[test]
fn the_ordering_is_chosen_by_fill() {
    // A square lattice suits dissection; a chain has no fill in the right order.
    let side = 40i64;
    let mut members = Vec::new();
    let mut starts = vec![0];
    for x in 0..side {
        for y in 0..side {
            for dx in -3..=3 {
                for dy in -3..=3 {
                    if (0..side).contains(&(x + dx)) && (0..side).contains(&(y + dy)) {
                        members.push(((x + dx) * side + y + dy) as u32);
                    }
                }
            }
            starts.push(members.len());
        }
    }
    let points = (side * side) as usize;
    let families = FamilyList::new(points, starts, members).unwrap();
    let pattern = Arc::new(BlockPattern::from_families(2, &families).unwrap());
    let positions: Vec<f64> = (0..points).flat_map(|p| [(p as i64 / side) as f64, (p as i64 % side) as f64]).collect();
    let with = SparseCholesky::analyze(pattern.clone(), &positions, &vec![false; 2 * points], 1).unwrap();
    let without = SparseCholesky::analyze(pattern, &[], &vec![false; 2 * points], 1).unwrap();
    assert_eq!((with.ordering(), without.ordering()), (Ordering::NestedDissection, Ordering::MinimumDegree));
    let ratio = with.factor_values() as f64 / without.factor_values() as f64;
    assert!((0.8..1.1).contains(&ratio), "{ratio}");
    let mut chain = chain(200, 1.0);
    let line = SparseCholesky::analyze(chain.pattern().unwrap(), &chain.positions, &[false; 200], 1).unwrap();
    // Neighbouring supernodes of up to 16 columns are merged: a band, no more.
    assert!(line.factor_values() < 20 * 200, "{}", line.factor_values());
}

#[test]
fn an_unstable_matrix_is_refused_with_its_dof() {
    // A chain in two pieces, the second of which nothing holds: points 6..=9.
    let mut truss = chain(10, 1e-4);
    truss.hold(0);
    truss.bars[5].broken = true;
    let matrix = assembled(&mut truss, &[0.0; 10]);
    let mut cholesky = SparseCholesky::analyze(matrix.pattern().clone(), &truss.positions, &truss.fixed, 1).unwrap();
    let refused = cholesky.factor(&matrix, None).and_then(|()| cholesky.solve(&[1e-7; 10], &mut [0.0; 10]).map(|_| ()));
    match refused {
        Err(DirectError::NotPositiveDefinite { dof }) => assert!((6..=9).contains(&dof), "{dof}"),
        other => panic!("{other:?}"),
    }
    assert!(matches!(cholesky.solve(&[0.0; 10], &mut [0.0; 10]), Err(DirectError::NotFactored)));
    // An indefinite one: a spring that pushes.
    truss.bars[5].broken = false;
    truss.bars[3].k = -1e-4;
    let matrix = assembled(&mut truss, &[0.0; 10]);
    assert!(matches!(cholesky.factor(&matrix, None), Err(DirectError::NotPositiveDefinite { .. })));
    // And one that is not a number.
    truss.bars[3].k = f64::NAN;
    let matrix = assembled(&mut truss, &[0.0; 10]);
    assert!(matches!(cholesky.factor(&matrix, None), Err(DirectError::NotPositiveDefinite { .. })));
}

#[test]
fn families_assemble_to_their_sum() {
    // Families of seeded members in seeded order, in one, two, three and four components, against a dense sum.
    let mut state = 5u64;
    let mut random = move |below: usize| {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) as usize % below
    };
    for d in 1..=4usize {
        let points = 50;
        let (mut starts, mut members) = (vec![0], Vec::new());
        for _ in 0..80 {
            let mut all: Vec<u32> = (0..points as u32).collect();
            for k in 0..9 {
                let other = k + random(points - k);
                all.swap(k, other);
            }
            members.extend(&all[..3 + random(7)]);
            starts.push(members.len());
        }
        let families = FamilyList::new(points, starts, members).unwrap();
        let entry = |k: usize, a: usize, b: usize| ((a.min(b) * 31 + a.max(b) * 17 + k * 7) % 64) as f64 - 31.0;
        let n = points * d;
        let mut exact = vec![vec![0.0; n]; n];
        for k in 0..families.len() {
            let family = families.family(k);
            for a in 0..family.len() * d {
                for b in 0..family.len() * d {
                    exact[family[a / d] as usize * d + a % d][family[b / d] as usize * d + b % d] += entry(k, a, b);
                }
            }
        }
        let mut matrix = BlockMatrix::new(Arc::new(BlockPattern::from_families(d, &families).unwrap()));
        let fill = |_: &mut (), k: usize, dense: &mut [f64]| {
            let width = families.family(k).len() * d;
            for a in 0..width {
                for b in 0..width {
                    dense[a * width + b] = entry(k, a, b);
                }
            }
            Ok::<(), ()>(())
        };
        matrix.add_families(&families, || (), fill).unwrap();
        for j in 0..n {
            let (mut unit, mut column) = (vec![0.0; n], vec![0.0; n]);
            unit[j] = 1.0;
            matrix.product(&unit, &mut column);
            // Whole numbers: no round-off.
            assert!((0..n).all(|i| column[i] == exact[i][j]), "D = {d}, column {j}");
        }
        let failed = matrix.add_families(&families, || (), |_, k, _| if k >= 5 { Err(k) } else { Ok(()) });
        assert_eq!(failed, Err(5));
    }
}

#[test]
fn of_families_that_are_alike_one_is_computed() {
    // Families of four on a line, of three kinds in turn: the sum is that of Hessians of the kinds, and `fill` sees their first members only.
    let points = 5000;
    let (mut starts, mut members) = (vec![0], Vec::new());
    for k in 0..points - 3 {
        members.extend([k + 2, k, k + 3, k + 1].map(|p| p as u32));
        starts.push(members.len());
    }
    let mut families = FamilyList::new(points, starts, members).unwrap();
    families.set_alike((0..families.len() as u32).map(|k| k % 3).collect());
    let entry = |kind: usize, a: usize, b: usize| ((a.min(b) * 3 + a.max(b) * 5 + kind * 7) % 16) as f64 - 7.0;
    let mut matrix = BlockMatrix::new(Arc::new(BlockPattern::from_families(1, &families).unwrap()));
    let fill = |_: &mut (), k: usize, dense: &mut [f64]| {
        (0..16).for_each(|q| dense[q] = entry(k, q / 4, q % 4));
        if k < 3 { Ok(()) } else { Err(k) }
    };
    matrix.add_families(&families, || (), fill).unwrap();
    let x: Vec<f64> = (0..points).map(|p| (p % 5) as f64 - 2.0).collect();
    let (mut got, mut want) = (vec![0.0; points], vec![0.0; points]);
    for k in 0..families.len() {
        for (a, &p) in families.family(k).iter().enumerate() {
            for (b, &q) in families.family(k).iter().enumerate() {
                want[p as usize] += entry(k % 3, a, b) * x[q as usize];
            }
        }
    }
    matrix.product(&x, &mut got);
    // Whole numbers: no round-off.
    assert_eq!(got, want);
}

#[test]
fn bad_lists_are_refused() {
    assert_eq!(FamilyList::new(3, vec![0, 2, 4], vec![0, 1, 2, 2]).unwrap_err(), SparseError::Repeated { list: 1, index: 2 });
    assert_eq!(FamilyList::new(3, vec![0, 2], vec![3, 1]).unwrap_err(), SparseError::OutOfRange { list: 0, index: 3, points: 3 });
    assert!(BlockPattern::from_columns(2, &[0, 2, 2], &[1, 0]).is_err());
    let pattern = Arc::new(BlockPattern::from_columns(1, &[0, 1, 2, 2], &[1, 0]).unwrap());
    assert!(!BlockMatrix::new(pattern).add_block(2, 0, &[1.0]));
}

#[test]
fn conjugate_gradients_need_one_iteration_per_distinct_eigenvalue() {
    let n = 1000;
    let options = KrylovOptions { tolerance: 1e-12, max_iterations: 100 };
    for distinct in [1, 3, 7] {
        let product = |x: &[f64], y: &mut [f64]| {
            (0..n).for_each(|k| y[k] = (1 + k % distinct) as f64 * 1e-9 * x[k]);
            Ok(())
        };
        let b: Vec<f64> = (0..n).map(|k| 1.0 + (k as f64).sin()).collect();
        let mut x = vec![0.0; n];
        let free = vec![false; n];
        let report = ConjugateGradients::default().solve(product, &mut Identity, &free, &b, &mut x, options).unwrap();
        assert_eq!((report.iterations, report.end), (distinct, KrylovEnd::Converged));
        assert!((0..n).all(|k| (x[k] * (1 + k % distinct) as f64 * 1e-9 / b[k] - 1.0).abs() < 1e-10));
        let report = Gmres::new(20).solve(product, &mut Identity, &free, &b, &mut x, options).unwrap();
        assert_eq!((report.iterations, report.end), (distinct, KrylovEnd::Converged));
    }
}

#[test]
fn conjugate_gradients_converge_as_fast_as_their_bound_and_no_faster_than_the_graph() {
    // Held chain: κ = cot²(π / (2 (n + 1))); the error bound is 2 ((√κ − 1)/(√κ + 1))^i in the energy norm, and a load at one
    // end is not felt at the other in fewer than n iterations.
    let n = 100;
    let mut truss = chain(n + 2, 4.0);
    truss.hold(0);
    truss.hold(n + 1);
    let fixed = truss.fixed.clone();
    let mut b = vec![0.0; n + 2];
    b[1] = 1.0;
    let mut x = vec![0.0; n + 2];
    let product = |x: &[f64], y: &mut [f64]| Statics::tangent_product(&mut truss, 0.0, &[0.0; 102], x, y);
    let options = KrylovOptions { tolerance: 1e-10, max_iterations: 1000 };
    let report = ConjugateGradients::default().solve(product, &mut Identity, &fixed, &b, &mut x, options).unwrap();
    assert_eq!(report.iterations, n, "{report:?}");
    // Displacement of the loaded point: two springs in parallel, k and k/n.
    let exact = 1.0 / (4.0 * (1.0 + 1.0 / n as f64));
    assert!((x[1] / exact - 1.0).abs() < 1e-9);
    let bound = 2.0 * (-2.0 * n as f64 * (PI / (2.0 * (n as f64 + 1.0))).tan()).exp();
    assert!(bound < 0.2, "the bound says something: {bound}");
}

#[test]
fn block_jacobi_undoes_bad_scaling() {
    let mut truss = lattice(20, 10, 1.0);
    // Stiffnesses over six orders, by place.
    for (k, bar) in truss.bars.iter_mut().enumerate() {
        bar.k = 10f64.powi((bar.ends[0] / 20) as i32 % 7 - 3) * (1.0 + 0.1 * (k % 3) as f64);
    }
    let n = truss.load.len();
    let (u, fixed) = (vec![0.0; n], truss.fixed.clone());
    let mut blocks = vec![0.0; 2 * n];
    truss.block_diagonal(0.0, &u, &mut blocks).unwrap();
    let b: Vec<f64> = (0..n).map(|k| (k as f64).sin()).collect();
    let options = KrylovOptions { tolerance: 1e-8, max_iterations: 100_000 };
    let mut product = |x: &[f64], y: &mut [f64]| Statics::tangent_product(&mut truss, 0.0, &u, x, y);
    let (mut plain, mut preconditioned, mut by_gmres) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    let mut cg = ConjugateGradients::default();
    let slow = cg.solve(&mut product, &mut Identity, &fixed, &b, &mut plain, options).unwrap();
    let mut jacobi = BlockJacobi::new(2, &blocks, &fixed);
    let fast = cg.solve(&mut product, &mut jacobi, &fixed, &b, &mut preconditioned, options).unwrap();
    assert_eq!(fast.end, KrylovEnd::Converged);
    assert!(5 * fast.iterations < slow.iterations, "{} {}", fast.iterations, slow.iterations);
    let mut y = vec![0.0; n];
    product(&preconditioned, &mut y).unwrap();
    let residual: Vec<f64> = (0..n).map(|k| if fixed[k] { 0.0 } else { y[k] - b[k] }).collect();
    assert!(vector::norm(&residual) < 2e-8 * vector::norm(&b));
    let restarted = Gmres::new(300).solve(&mut product, &mut jacobi, &fixed, &b, &mut by_gmres, options).unwrap();
    assert_eq!(restarted.end, KrylovEnd::Converged, "{restarted:?}");
}

#[test]
fn negative_curvature_is_noticed_and_gmres_does_not_mind() {
    let product = |x: &[f64], y: &mut [f64]| {
        // diag(2, −1) and a rotation between the last two: indefinite and not symmetric.
        (y[0], y[1]) = (2.0 * x[0], -x[1]);
        (y[2], y[3]) = (x[2] - 3.0 * x[3], x[3] + 3.0 * x[2]);
        Ok(())
    };
    let options = KrylovOptions { tolerance: 1e-12, max_iterations: 50 };
    let mut x = [0.0; 4];
    let report = ConjugateGradients::default();
    let report = { report }.solve(product, &mut Identity, &[false; 4], &[0.1, 1.0, 0.0, 0.0], &mut x, options).unwrap();
    assert_eq!(report.end, KrylovEnd::NegativeCurvature);
    assert!(x[1] > 0.0, "a direction of descent: {x:?}");
    let report = Gmres::new(2).solve(product, &mut Identity, &[false; 4], &[2.0, -3.0, 4.0, 2.0], &mut x, options);
    assert!(matches!(report.unwrap().end, KrylovEnd::Converged | KrylovEnd::Exhausted | KrylovEnd::BrokenDown));
    let report = Gmres::new(4).solve(product, &mut Identity, &[false; 4], &[2.0, -3.0, 4.0, 2.0], &mut x, options);
    assert_eq!(report.unwrap().end, KrylovEnd::Converged);
    for (found, exact) in x.iter().zip([1.0, 3.0, 1.0, -1.0]) {
        assert!((found - exact).abs() < 1e-12, "{x:?}");
    }
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let solve = |threads: usize| {
        let mut truss = lattice(60, 60, 7.0);
        let n = truss.load.len();
        let u = bent(n);
        let matrix = assembled(&mut truss, &u);
        let mut cholesky = SparseCholesky::analyze(matrix.pattern().clone(), &truss.positions, &truss.fixed, threads).unwrap();
        cholesky.factor(&matrix, None).unwrap();
        let b: Vec<f64> = (0..n).map(|k| (k as f64).cos()).collect();
        let (mut x, mut y) = (vec![0.0; n], vec![0.0; n]);
        cholesky.solve(&b, &mut x).unwrap();
        matrix.product(&x, &mut y);
        x.extend(y);
        x.iter().map(|x| x.to_bits()).collect::<Vec<u64>>()
    };
    let one = with_threads(1, || solve(1));
    for threads in [2, 3] {
        assert!(with_threads(threads, || solve(threads)) == one, "{threads} threads");
    }
}

#[test]
fn assembly_from_families_does_not_depend_on_threads() {
    // Enough families for several waves, entries that round.
    let (points, width) = (3000, 60);
    let starts: Vec<usize> = (0..=points - width).map(|k| k * width).collect();
    let members = (0..points - width).flat_map(|k| (k..k + width).map(|p| p as u32)).collect();
    let families = FamilyList::new(points, starts, members).unwrap();
    let pattern = Arc::new(BlockPattern::from_families(2, &families).unwrap());
    let assemble = || {
        let mut matrix = BlockMatrix::new(pattern.clone());
        let fill = |_: &mut (), k: usize, dense: &mut [f64]| {
            let n = 2 * width;
            for a in 0..n {
                for b in 0..n {
                    dense[a * n + b] = 1.0 / (1.0 + (a * b + k) as f64);
                }
            }
            Ok::<(), ()>(())
        };
        matrix.add_families(&families, || (), fill).unwrap();
        matrix.values().iter().map(|x| x.to_bits()).collect::<Vec<u64>>()
    };
    let one = with_threads(1, assemble);
    for threads in [2, 5] {
        assert!(with_threads(threads, assemble) == one, "{threads} threads");
    }
}
