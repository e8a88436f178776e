//! Velocity Verlet and eigenvalues against closed forms of chains of springs.

mod common;

use std::f64::consts::PI;
use std::ops::ControlFlow;
use std::sync::atomic::AtomicBool;

use common::{Truss, chain, with_threads};
use solvers::eigen::{EigenError, largest_eigenvalue, lowest_modes};
use solvers::observe::{Ended, Silent, StepReport};
use solvers::problem::{Dynamics, Statics, Stop};
use solvers::sparse::BlockMatrix;
use solvers::velocity_verlet::{Motion, MotionError, VelocityVerlet, kinetic_energy, stable_step};

/// `n` free masses between two held ends: `ω_j² = 4 k/m sin²(jπ / (2 (n + 1)))`.
fn held_chain(free: usize, k: f64, m: f64) -> Truss<1> {
    let mut truss = chain(free + 2, k);
    truss.mass.fill(m);
    truss.hold(0);
    truss.hold(free + 1);
    truss
}

fn exact(free: usize, k: f64, m: f64, j: usize) -> f64 {
    4.0 * k / m * (j as f64 * PI / (2.0 * (free as f64 + 1.0))).sin().powi(2)
}

fn run(truss: &mut Truss<1>, motion: &mut Motion, dt: f64, end: f64) {
    let verlet = VelocityVerlet { time_step: dt, end, observe_every: usize::MAX, following: None };
    assert_eq!(verlet.run(truss, motion, &mut Silent, None).unwrap(), Ended::Completed);
}

#[test]
fn a_mode_swings_with_the_frequency_that_theory_gives_the_scheme() {
    // Started at rest, u_n = u_0 cos(n θ) with sin(θ/2) = ω Δt / 2, exactly.
    let (n, k, m) = (9, 3.0e7, 0.02);
    let mut truss = held_chain(n, k, m);
    for j in [1, 4, 9] {
        let omega = exact(n, k, m, j).sqrt();
        let dt = 0.6 / exact(n, k, m, n).sqrt();
        let amplitude = 1e-3;
        let mut motion = Motion::at_rest(n + 2, 0.0);
        let shape = |p: usize| (j as f64 * p as f64 * PI / (n as f64 + 1.0)).sin();
        (1..=n).for_each(|p| motion.u[p] = amplitude * shape(p));
        let steps = 400;
        run(&mut truss, &mut motion, dt, steps as f64 * dt);
        assert_eq!(motion.step, steps);
        let angle = 2.0 * (0.5 * omega * dt).asin() * steps as f64;
        for p in 1..=n {
            let error = (motion.u[p] - amplitude * shape(p) * angle.cos()).abs() / amplitude;
            assert!(error < 1e-10, "mode {j}, point {p}: {error:.1e}");
        }
    }
}

#[test]
fn errors_fall_with_the_square_of_the_step() {
    let (n, k, m) = (5, 2.0, 1.0);
    let omega = exact(n, k, m, 2).sqrt();
    let error = |dt: f64| {
        let mut truss = held_chain(n, k, m);
        let mut motion = Motion::at_rest(n + 2, 0.0);
        let shape = |p: usize| (2.0 * p as f64 * PI / 6.0).sin();
        (1..=n).for_each(|p| motion.v[p] = omega * 0.01 * shape(p));
        run(&mut truss, &mut motion, dt, 5.0);
        (motion.u[1] - 0.01 * shape(1) * (omega * 5.0).sin()).abs()
    };
    let order = (error(0.05) / error(0.025)).log2();
    assert!((1.95..2.05).contains(&order), "{order}");
}

#[test]
fn energy_of_a_nonlinear_chain_does_not_drift() {
    let n = 20;
    let drift = |dt: f64| {
        let mut truss = held_chain(n, 1.0, 1.0);
        truss.bars.iter_mut().for_each(|bar| bar.c = 5.0);
        let mut motion = Motion::at_rest(n + 2, 0.0);
        (1..=n).for_each(|p| motion.u[p] = 0.3 * (p as f64 * PI / 21.0).sin());
        let start = truss.energy(0.0, &motion.u).unwrap();
        let (mut worst, mut last) = (0.0f64, 0.0);
        let mut observer = |_: &StepReport, truss: &mut Truss<1>, u: &[f64], v: &[f64]| {
            last = (truss.energy(0.0, u).unwrap() + kinetic_energy(truss.mass(), v)) / start - 1.0;
            worst = worst.max(last.abs());
            ControlFlow::Continue(())
        };
        let verlet = VelocityVerlet { time_step: dt, end: 2000.0, observe_every: 10, following: None };
        verlet.run(&mut truss, &mut motion, &mut observer, None).unwrap();
        worst
    };
    let (coarse, fine) = (drift(0.2), drift(0.1));
    // Bounded oscillation of second order, over hundreds of periods: a drift would not shrink fourfold.
    assert!((1e-5..2e-3).contains(&coarse), "{coarse}");
    assert!((3.4..4.6).contains(&(coarse / fine)), "{coarse} {fine}");
}

#[test]
fn a_driven_end_follows_its_motion_and_shakes_the_mass() {
    // m ü = k (s(t) − u), s = A sin(Ωt), from rest: u = A ω² / (ω² − Ω²) (sin Ωt − (Ω/ω) sin ωt).
    const A: f64 = 0.01;
    const DRIVE: f64 = 1.3;
    let omega = 2.0;
    let error = |dt: f64| {
        let mut truss = chain(2, 4.0);
        truss.drive(0, |t| (A * (DRIVE * t).sin(), A * DRIVE * (DRIVE * t).cos()));
        let mut motion = Motion::at_rest(2, 0.0);
        run(&mut truss, &mut motion, dt, 7.0);
        assert_eq!(motion.u[0], A * (DRIVE * 7.0f64).sin());
        assert_eq!(motion.v[0], A * DRIVE * (DRIVE * 7.0f64).cos());
        let exact = A * omega * omega / (omega * omega - DRIVE * DRIVE) * ((DRIVE * 7.0f64).sin() - DRIVE / omega * (omega * 7.0).sin());
        (motion.u[1] - exact).abs() / A
    };
    let order = (error(0.02) / error(0.01)).log2();
    assert!((1.9..2.1).contains(&order) && error(0.01) < 2e-3, "{order} {}", error(0.01));
}

/// A free mass whose velocity is prescribed, its displacement not.
struct Ramp {
    fixed: [bool; 1],
}

impl Dynamics for Ramp {
    fn dofs(&self) -> usize {
        1
    }
    fn mass(&self) -> &[f64] {
        &[0.0]
    }
    fn fixed(&self) -> &[bool] {
        &self.fixed
    }
    fn force(&mut self, t: f64, _: &[f64], v: &[f64], f: &mut [f64]) -> Result<(), Stop> {
        // What the force sees at the end of a step is the velocity at its middle.
        f[0] = v[0] - 3.0 * t;
        if t > 1.5 { Err(Stop::new("late")) } else { Ok(()) }
    }
    fn prescribe_displacement(&mut self, _: f64, _: &mut [f64]) {}
    fn prescribe_velocity(&mut self, t: f64, v: &mut [f64]) {
        v[0] = 3.0 * t;
    }
    fn accept(&mut self, _: f64, _: &[f64], _: &[f64]) -> Result<bool, Stop> {
        Ok(false)
    }
    fn tangent_product(&mut self, _: f64, _: &[f64], _: &[f64], y: &mut [f64]) -> Result<(), Stop> {
        y.fill(f64::NAN);
        Ok(())
    }
}

#[test]
fn a_prescribed_velocity_is_integrated_exactly_where_it_is_linear() {
    let mut motion = Motion::at_rest(1, 0.0);
    let verlet = VelocityVerlet { time_step: 0.1, end: 1.0, observe_every: 1, following: None };
    verlet.run(&mut Ramp { fixed: [true] }, &mut motion, &mut Silent, None).unwrap();
    assert!((motion.u[0] - 1.5).abs() < 1e-14 && motion.v[0] == 3.0, "{motion:?}");
    let error = VelocityVerlet { end: 2.0, ..verlet }.run(&mut Ramp { fixed: [true] }, &mut motion, &mut Silent, None);
    assert!(matches!(error, Err(MotionError::Stopped { step: 16, .. })), "{error:?}");
    let error = verlet.run(&mut Ramp { fixed: [false] }, &mut Motion::at_rest(1, 0.0), &mut Silent, None);
    assert!(matches!(error, Err(MotionError::Mass { dof: 0, .. })), "{error:?}");
    let error = VelocityVerlet { time_step: 0.0, ..verlet }.run(&mut Ramp { fixed: [true] }, &mut motion, &mut Silent, None);
    assert!(matches!(error, Err(MotionError::Times { .. })), "{error:?}");
}

#[test]
fn the_stable_step_is_stable_and_not_much_too_short() {
    for (n, k, m) in [(1, 5.0, 2.0), (7, 1e9, 1e-6), (300, 2e-7, 3.0)] {
        let mut truss = held_chain(n, k, m);
        let limit = 2.0 / exact(n, k, m, n).sqrt();
        let found = stable_step(&mut truss, 0.0, &vec![0.0; n + 2], 1.0).unwrap();
        let ratio = found.time_step / limit;
        assert!((0.99..=1.0 + 1e-12).contains(&ratio), "{n}: {ratio} after {}", found.iterations);
        // Growth above the limit, none below: the limit is what theory says.
        for (factor, grows) in [(0.999, false), (1.01, true)] {
            let mut motion = Motion::at_rest(n + 2, 0.0);
            (1..=n).for_each(|p| motion.u[p] = if p % 2 == 0 { 1e-6 } else { -1e-6 });
            run(&mut truss, &mut motion, factor * limit, 100.0 * factor * limit);
            let size = motion.u.iter().fold(0.0f64, |s, u| s.max(u.abs()));
            assert_eq!(size > 1e-4, grows, "{n} {factor} {size:e}");
        }
    }
}

#[test]
fn the_largest_eigenvalue_is_bracketed() {
    let (n, k, m) = (500, 3.0, 0.7);
    let truss = held_chain(n, k, m);
    let mut truss = truss;
    let u = vec![0.0; n + 2];
    let (mass, fixed) = (truss.mass.clone(), truss.fixed.clone());
    let product = |x: &[f64], y: &mut [f64]| Dynamics::tangent_product(&mut truss, 0.0, &u, x, y);
    let found = largest_eigenvalue(product, &mass, &fixed, 1e-3).unwrap();
    let top = exact(n, k, m, n);
    assert!(found.value <= top * (1.0 + 1e-12) && found.value > 0.998 * top, "{found:?} {top}");
    assert!(found.upper >= top && found.upper < 1.002 * top, "{found:?} {top}");
    let none = largest_eigenvalue(
        |_: &[f64], y: &mut [f64]| {
            y.fill(0.0);
            Ok(())
        },
        &mass,
        &fixed,
        1e-3,
    );
    assert!(matches!(none, Err(EigenError::NoStiffness { .. })), "{none:?}");
}

#[test]
fn lowest_modes_of_a_chain_held_and_free() {
    let (n, k, m) = (60, 2e8, 4e-3);
    let mut truss = held_chain(n, k, m);
    let mut matrix = BlockMatrix::new(truss.pattern().unwrap());
    truss.tangent(0.0, &vec![0.0; n + 2], &mut matrix).unwrap();
    let modes = lowest_modes(&matrix, &truss.mass, &truss.fixed, &truss.positions, 5, 0.0, 1e-12, 1).unwrap();
    for (j, value) in modes.values.iter().enumerate() {
        let error = value / exact(n, k, m, j + 1) - 1.0;
        assert!(error.abs() < 1e-10, "mode {j}: {error:e}");
        // Shape: sin(jπp/(n+1)), of unit modal mass.
        let vector = &modes.vectors[j * (n + 2)..(j + 1) * (n + 2)];
        let size = (2.0 / (m * (n as f64 + 1.0))).sqrt();
        for p in 0..n + 2 {
            let shape = size * ((j + 1) as f64 * PI * p as f64 / (n as f64 + 1.0)).sin();
            assert!((vector[p].abs() - shape.abs()).abs() < 1e-5 * size, "mode {j} at {p}");
        }
    }
    // Free–free: ω_j² = 4 k/m sin²(jπ / 2n), j = 0, 1, …; the shift makes the rigid motion harmless.
    let mut free = chain(n, k);
    free.mass.fill(m);
    let mut matrix = BlockMatrix::new(free.pattern().unwrap());
    free.tangent(0.0, &vec![0.0; n], &mut matrix).unwrap();
    let second = 4.0 * k / m * (PI / (2.0 * n as f64)).sin().powi(2);
    let modes = lowest_modes(&matrix, &free.mass, &free.fixed, &[], 3, 0.1 * second, 1e-11, 1).unwrap();
    assert!(modes.values[0].abs() < 1e-8 * second, "{:?}", modes.values);
    assert!((modes.values[1] / second - 1.0).abs() < 1e-8, "{:?} {second}", modes.values);
}

#[test]
fn repeated_eigenvalues_come_with_all_their_vectors() {
    // Two equal chains side by side in one problem: each value twice.
    let (n, k) = (10, 1.0);
    let mut truss = Truss::<1>::new(
        (0..2 * (n + 2)).map(|x| x as f64).collect(),
        (0..2 * (n + 2) - 1).filter(|a| a + 1 != n + 2).map(|a| [a, a + 1]),
        k,
    );
    [0, n + 1, n + 2, 2 * n + 3].into_iter().for_each(|dof| truss.hold(dof));
    let mut matrix = BlockMatrix::new(truss.pattern().unwrap());
    truss.tangent(0.0, &vec![0.0; 2 * n + 4], &mut matrix).unwrap();
    let modes = lowest_modes(&matrix, &truss.mass, &truss.fixed, &truss.positions, 4, 0.0, 1e-12, 1).unwrap();
    for (found, j) in modes.values.iter().zip([1, 1, 2, 2]) {
        assert!((found / exact(n, k, 1.0, j) - 1.0).abs() < 1e-9, "{:?}", modes.values);
    }
}

#[test]
fn observers_and_flags_end_a_run() {
    let mut truss = held_chain(3, 1.0, 1.0);
    let mut motion = Motion::at_rest(5, 0.0);
    let mut seen = Vec::new();
    let mut observer = |report: &StepReport, _: &mut Truss<1>, _: &[f64], _: &[f64]| {
        seen.push(report.step);
        if report.step >= 6 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let verlet = VelocityVerlet { time_step: 0.1, end: 1.0, observe_every: 3, following: None };
    assert_eq!(verlet.run(&mut truss, &mut motion, &mut observer, None).unwrap(), Ended::Observer);
    assert_eq!(seen, [0, 3, 6]);
    let flag = AtomicBool::new(true);
    assert_eq!(verlet.run(&mut truss, &mut motion, &mut Silent, Some(&flag)).unwrap(), Ended::Cancelled);
    // Continued, it ends at the end, with the steps counted on.
    assert_eq!(verlet.run(&mut truss, &mut motion, &mut Silent, None).unwrap(), Ended::Completed);
    assert_eq!((motion.step, motion.time), (10, 1.0));
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let work = || {
        let n = 100_000;
        let mut truss = held_chain(n, 2.0, 0.3);
        truss.bars.iter_mut().for_each(|bar| bar.c = 1.0);
        let step = stable_step(&mut truss, 0.0, &vec![0.0; n + 2], 0.9).unwrap();
        let mut motion = Motion::at_rest(n + 2, 0.0);
        (1..=n).for_each(|p| motion.u[p] = 1e-2 * (p as f64).sin());
        run(&mut truss, &mut motion, step.time_step, 20.0 * step.time_step);
        (step.time_step.to_bits(), motion.u.iter().map(|u| u.to_bits()).collect::<Vec<_>>())
    };
    let one = with_threads(1, work);
    for threads in [2, 5] {
        assert!(with_threads(threads, work) == one, "{threads} threads");
    }
}
