//! The preconditioner of two levels on a nonlocal lattice of springs: every pair of points within the reach is joined by a spring along its line.

use std::sync::Arc;

use solvers::direct::SparseCholesky;
use solvers::krylov::{BlockJacobi, ConjugateGradients, KrylovEnd, KrylovOptions};
use solvers::sparse::{BlockMatrix, BlockPattern};
use solvers::two_level::{Coarse, TwoLevel};

const REACH: f64 = 3.5;

struct Lattice {
    positions: Vec<f64>,
    fixed: Vec<bool>,
    matrix: BlockMatrix,
}

/// Points of a plate, held at the left edge.
fn plate(columns: usize, rows: usize) -> Lattice {
    let n = columns * rows;
    let at = |p: usize| [(p % columns) as f64, (p / columns) as f64];
    let near = |p: usize| {
        (0..n).filter(move |&q| {
            let (x, y) = (at(p), at(q));
            (x[0] - y[0]).hypot(x[1] - y[1]) <= REACH
        })
    };
    let (mut starts, mut rows_of) = (vec![0], vec![]);
    for p in 0..n {
        rows_of.extend(near(p).map(|q| q as u32));
        starts.push(rows_of.len());
    }
    let mut matrix = BlockMatrix::new(Arc::new(BlockPattern::from_columns(2, &starts, &rows_of).unwrap()));
    for p in 0..n {
        for q in near(p).filter(|&q| q < p) {
            let (x, y) = (at(p), at(q));
            let d = [x[0] - y[0], x[1] - y[1]];
            let square = d[0] * d[0] + d[1] * d[1];
            let block: Vec<f64> = (0..4).map(|k| d[k / 2] * d[k % 2] / square).collect();
            let minus: Vec<f64> = block.iter().map(|b| -b).collect();
            assert!(matrix.add_block(p, p, &block) && matrix.add_block(q, q, &block) && matrix.add_block(p, q, &minus));
        }
    }
    let fixed = (0..2 * n).map(|k| (k / 2) % columns == 0).collect();
    Lattice { positions: (0..n).flat_map(at).collect(), fixed, matrix }
}

/// Iterations of conjugate gradients with and without the coarse problem, and the solutions' distance from the direct one.
fn iterations(l: &Lattice) -> ([usize; 2], f64) {
    let n = l.fixed.len();
    let b: Vec<f64> = (0..n).map(|k| if l.fixed[k] { 0.0 } else { ((k * 31 % 17) as f64 - 8.0) / 8.0 + 0.2 }).collect();
    let mut exact = vec![0.0; n];
    let mut direct = SparseCholesky::analyze(l.matrix.pattern().clone(), &l.positions, &l.fixed, 1).unwrap();
    direct.factor(&l.matrix, None).unwrap();
    direct.solve(&b, &mut exact).unwrap();
    let mut blocks = vec![0.0; 2 * n];
    l.matrix.diagonal_blocks(&mut blocks);
    let product = |x: &[f64], y: &mut [f64]| {
        l.matrix.product(x, y);
        Ok(())
    };
    let mut coarse = Coarse::new(product, &l.positions, &l.fixed, 2, REACH, 1).unwrap().expect("there are boxes enough");
    // nine colours, three rigid motions
    assert_eq!(coarse.size().1, 27);
    let options = KrylovOptions { tolerance: 1e-10, max_iterations: 5000 };
    let mut worst = 0.0f64;
    let mut counts = [0; 2];
    for (with, count) in counts.iter_mut().enumerate() {
        let smoother = BlockJacobi::new(2, &blocks, &l.fixed);
        let mut both = TwoLevel { smoother, coarse: (with == 1).then_some(&mut coarse) };
        let mut x = vec![0.0; n];
        let report = ConjugateGradients::default().solve(product, &mut both, &l.fixed, &b, &mut x, options).unwrap();
        assert_eq!(report.end, KrylovEnd::Converged);
        *count = report.iterations;
        let scale = exact.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        worst = worst.max(x.iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / scale);
    }
    (counts, worst)
}

#[test]
fn iterations_do_not_grow_with_the_body() {
    let ([small_alone, small], error) = iterations(&plate(24, 20));
    let ([large_alone, large], other) = iterations(&plate(72, 60));
    println!("{small_alone} and {large_alone} alone, {small} and {large} with a coarse problem; errors {error:e}, {other:e}");
    assert!(error <= 1e-8 && other <= 1e-8);
    // alone they grow with the length of the body
    assert!(large_alone as f64 >= 2.0 * small_alone as f64);
    assert!(large as f64 <= 1.5 * small as f64 && large <= 60);
}

#[test]
fn a_few_boxes_are_left_to_the_smoother() {
    let l = plate(6, 6);
    let product = |x: &[f64], y: &mut [f64]| {
        l.matrix.product(x, y);
        Ok(())
    };
    assert!(Coarse::new(product, &l.positions, &l.fixed, 2, REACH, 1).unwrap().is_none());
}

#[test]
fn boxes_that_are_held_and_holes_do_no_harm() {
    // a plate whose first two boxes along x are held altogether, and one axis of the rest of the second
    let mut l = plate(24, 20);
    for p in 0..24 * 20 {
        let column = p % 24;
        (l.fixed[2 * p], l.fixed[2 * p + 1]) = (column < 8, column < 12);
    }
    let (counts, error) = iterations(&l);
    assert!(error <= 1e-8 && counts[1] <= counts[0], "{counts:?} {error:e}");
}
