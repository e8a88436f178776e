//! Seconds of linear statics, phase by phase.
//!
//! `cargo bench -p peridyne-benches --bench statics [plate | block] [points per side]`
//!
//! `plate`: plate with a diamond hole, horizon of 3.1 diagonals, four quadrants, sparse Cholesky. `block`: cube of correspondence with
//! control in tension, conjugate gradients.

mod lattice;

use bodies::loads::{Condition, Field, Kind};
use bodies::structure::{Parts, Structure};
use lattice::Lattice;
use physics::constitutive::LinearElastic;
use physics::elasticity::{Isotropic, Section, Stiffness};
use physics::influence::One;
use physics::models::{Correspondence, EmptySubHorizon, SubHorizonCorrespondence};
use physics::sub_horizon::Partition;
use physics::zero_energy;
use solvers::load_steps::Equilibrium;
use solvers::newton::{LinearSolver, Newton, NewtonOptions};
use solvers::problem::Statics;
use solvers::sparse::BlockMatrix;
use std::time::Instant;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let which = arguments.next().unwrap_or_else(|| "plate".into());
    let side: Option<usize> = arguments.next().and_then(|a| a.parse().ok());
    if which == "block" { block(side.unwrap_or(58)) } else { plate(side.unwrap_or(80)) }
}

/// Pulls the two ends along x apart by 1e-3 of the length; one point is held in every direction.
fn pulled<const D: usize>(body: bodies::body::Body<D>, lattice: &Lattice<D>, ends: [f64; 2]) -> Structure<D> {
    let n = body.points();
    let at = |x: f64| (0..n as u32).filter(|&p| lattice.position[p as usize][0] == x).collect::<Vec<u32>>();
    let constant = |value: f64| -> Option<Field> { Some(Box::new(move |_, _| value)) };
    let held = |name: &str, points: Vec<u32>, components| Condition {
        name: name.into(),
        kind: Kind::Displacement,
        points,
        components,
        along: None,
    };
    let (left, right) = (at(ends[0]), at(ends[1]));
    let (first, last) = (left[0], left[left.len() - 1]);
    let mut conditions = vec![
        held("left", left, [constant(0.0), None, None]),
        held("right", right, [constant(1e-3 * (ends[1] - ends[0])), None, None]),
        held("held", vec![first], [None, constant(0.0), constant(0.0)]),
    ];
    if D == 3 {
        conditions.push(held("turn", vec![last], [None, constant(0.0), None]));
    }
    let parts = Parts { id: (0..n as u64).collect(), user: (0..n as u32).collect(), material: vec![0; n], density: vec![1.0; n] };
    let mut structure = Structure::new(body, parts, conditions, None, vec![], 1.0);
    structure.set_statics(true);
    structure
}

fn solve<const D: usize>(structure: &mut Structure<D>, solver: LinearSolver) {
    let mut u = vec![0.0; Statics::dofs(structure)];
    let options = NewtonOptions { linear: true, solver, threads: rayon::current_num_threads(), ..NewtonOptions::default() };
    let mut newton = Newton::new(options);
    let clock = Instant::now();
    let result = newton.equilibrate(structure, 1.0, &mut u, None);
    let seconds = clock.elapsed().as_secs_f64();
    match result {
        Ok(r) => println!("solution: {seconds:.3} s, {}, {} iterations, residual {:.1e}", r.solver, r.linear_iterations, r.residual),
        Err(e) => println!("failed after {seconds:.3} s: {e}"),
    }
    if let Some((dofs, products)) = newton.coarse() {
        println!("  coarse problem of {dofs} dofs from {products} products");
    }
    if let Some(c) = newton.cholesky() {
        println!("  {:?}, {} free dofs, {} numbers in the factor", c.ordering(), c.free_dofs(), c.factor_values());
    }
    let sum: f64 = u.iter().map(|x| x * x).sum::<f64>().sqrt();
    println!("  |u| = {sum:.15e}, residual of the forces {:.3e}", {
        let mut f = vec![0.0; u.len()];
        Statics::force(structure, 1.0, &u, &mut f).expect("evaluates");
        let free = f.iter().zip(Statics::fixed(structure)).filter(|x| !x.1).map(|x| x.0 * x.0).sum::<f64>().sqrt();
        free / structure.force_scale()
    });
}

fn plate(side: usize) {
    let clock = Instant::now();
    let (w, h) = (2 * side, side);
    let hole = side as f64 / 4.0 + 0.5;
    let lattice = Lattice::<2>::new([w, h, 1], 3.1 * std::f64::consts::SQRT_2, |x| {
        (x[0] - 0.5 * (w - 1) as f64).abs() + (x[1] - 0.5 * (h - 1) as f64).abs() >= hole
    });
    let elastic = Stiffness::<2>::isotropic(Isotropic { young: 1.0, poisson: 0.25 }, 0.0, Section::PlaneStrain { thickness: 1.0 });
    let model = SubHorizonCorrespondence::<_, _, 4> { law: LinearElastic, omega: One, empty: EmptySubHorizon::Renormalise };
    let body = lattice.of(model, elastic, Some((Partition::Orthants, 4)));
    println!("{} points, {} directed bonds; set-up {:.3} s", lattice.points(), body.bonds(), clock.elapsed().as_secs_f64());
    let mut structure = pulled(body, &lattice, [0.0, (w - 1) as f64]);
    let clock = Instant::now();
    let pattern = structure.pattern().expect("assembles");
    println!("pattern: {:.3} s, {} blocks", clock.elapsed().as_secs_f64(), pattern.blocks());
    let mut matrix = BlockMatrix::new(pattern.clone());
    let u = vec![0.0; Statics::dofs(&structure)];
    let clock = Instant::now();
    structure.tangent(1.0, &u, &mut matrix).expect("evaluates");
    println!("assembly: {:.3} s", clock.elapsed().as_secs_f64());
    let clock = Instant::now();
    let threads = rayon::current_num_threads();
    let mut cholesky =
        solvers::direct::SparseCholesky::analyze(pattern, structure.positions(), Statics::fixed(&structure), threads).unwrap();
    println!("analysis: {:.3} s", clock.elapsed().as_secs_f64());
    let clock = Instant::now();
    cholesky.factor(&matrix, None).unwrap();
    println!("factor: {:.3} s", clock.elapsed().as_secs_f64());
    solve(&mut structure, LinearSolver::Direct);
    solve(&mut structure, LinearSolver::ConjugateGradients);
}

fn block(side: usize) {
    let clock = Instant::now();
    let lattice = Lattice::<3>::new([side; 3], 3.015, |_| true);
    let elastic = Stiffness::<3>::isotropic(Isotropic { young: 1.0, poisson: 0.25 }, 0.0, Section::Solid);
    let model = Correspondence { law: LinearElastic, control: zero_energy::Isotropic::Wan2019, omega: One };
    let body = lattice.of(model, elastic, None);
    println!("{} points, {} directed bonds; set-up {:.3} s", lattice.points(), body.bonds(), clock.elapsed().as_secs_f64());
    let mut structure = pulled(body, &lattice, [0.0, (side - 1) as f64]);
    let mut u = vec![0.0; Statics::dofs(&structure)];
    let (x, mut y) = (u.clone(), u.clone());
    let clock = Instant::now();
    for _ in 0..3 {
        Statics::tangent_product(&mut structure, 1.0, &u, &x, &mut y).expect("evaluates");
    }
    println!("tangent product: {:.3} s", clock.elapsed().as_secs_f64() / 3.0);
    let clock = Instant::now();
    for _ in 0..3 {
        Statics::force(&mut structure, 1.0, &u, &mut y).expect("evaluates");
    }
    println!("force: {:.3} s", clock.elapsed().as_secs_f64() / 3.0);
    u.fill(0.0);
    solve(&mut structure, LinearSolver::ConjugateGradients);
}
