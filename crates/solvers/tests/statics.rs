//! Newton's method and load steps on springs and trusses with closed forms.

mod common;

use std::ops::ControlFlow;

use common::{Truss, chain, lattice};
use solvers::load_steps::{Equilibrium, EquilibriumError, LoadSteps, StaticsError};
use solvers::newton::{LinearSolver, Newton, NewtonOptions};
use solvers::observe::{Ended, Silent, StepReport};
use solvers::problem::Statics;

const SOLVERS: [LinearSolver; 3] = [LinearSolver::Direct, LinearSolver::ConjugateGradients, LinearSolver::Gmres { restart: 30 }];

fn newton(solver: LinearSolver) -> Newton {
    Newton::new(NewtonOptions { solver, threads: 1, ..Default::default() })
}

#[test]
fn convergence_is_quadratic_on_a_cubic_spring() {
    // k e + c e³ = P with the root e = 1: P = k + c.
    let (k, c) = (1.0, 4.0);
    let mut truss = chain(2, k);
    truss.bars[0].c = c;
    truss.hold(0);
    truss.load[1] = k + c;
    let options = NewtonOptions { tolerance: 1e-15, threads: 1, ..Default::default() };
    let mut u = vec![0.0, 0.7];
    let found = Newton::new(options).equilibrate(&mut truss, 1.0, &mut u, None).unwrap();
    assert!((u[1] - 1.0).abs() < 1e-15);
    // r' = −(k + 3c e²), r'' = −6 c e: r_{n+1} / r_n² → |r''| / (2 r'²), here times P for relative residuals.
    let constant = 6.0 * c / (2.0 * (k + 3.0 * c) * (k + 3.0 * c)) * (k + c);
    let ratios: Vec<f64> = found.history.windows(2).filter(|h| h[1] > 1e-13).map(|h| h[1] / (h[0] * h[0])).collect();
    let last = *ratios.last().unwrap();
    assert!(ratios.len() >= 3 && (0.9..1.1).contains(&(last / constant)), "{:?} {ratios:?} {constant}", found.history);
}

#[test]
fn a_line_search_holds_back_a_step_that_overshoots() {
    // From e = 0 the tangent is k alone, and the full step goes to e = 1 + c/k = 10,001.
    for solver in SOLVERS {
        for has_energy in [true, false] {
            let (k, c) = (1e-4, 1.0);
            let mut truss = chain(2, k);
            truss.bars[0].c = c;
            truss.has_energy = has_energy;
            truss.hold(0);
            truss.load[1] = k + c;
            let mut u = vec![0.0; 2];
            let found = newton(solver).equilibrate(&mut truss, 1.0, &mut u, None).unwrap();
            assert!((u[1] - 1.0).abs() < 1e-8, "{u:?}");
            assert!(found.iterations <= 30, "{solver:?} {found:?}");
        }
    }
}

#[test]
fn a_truss_in_large_rotation_is_in_equilibrium_and_at_an_energy_minimum() {
    for (solver, unit) in SOLVERS.into_iter().flat_map(|s| [(s, 1.0), (s, 1e9)]) {
        let mut truss = lattice(10, 4, 1e3 * unit);
        let n = truss.load.len();
        truss.load[n - 1] = -80.0 * unit;
        let mut u = vec![0.0; n];
        let ended = LoadSteps::uniform(0.0, 1.0, 4).run(&mut truss, &mut newton(solver), &mut u, &mut Silent, None);
        assert_eq!(ended.unwrap(), Ended::Completed);
        let mut f = vec![0.0; n];
        Statics::force(&mut truss, 1.0, &u, &mut f).unwrap();
        let worst = (0..n).filter(|&k| !truss.fixed[k]).map(|k| f[k].abs()).fold(0.0, f64::max);
        assert!(worst < 1e-5 * unit, "{solver:?} {worst:e}");
        // Balance of the whole: the reactions carry the load.
        let sum: f64 = (0..n / 2).filter(|p| truss.fixed[2 * p + 1]).map(|p| f[2 * p + 1]).sum();
        assert!((sum + 80.0 * unit).abs() < 1e-4 * unit, "{sum}");
        assert!(u[n - 1] < -1.0, "large: {}", u[n - 1]);
        let least = truss.energy(1.0, &u).unwrap();
        for k in (8..n).step_by(5) {
            let mut other = u.clone();
            other[k] += 1e-3;
            assert!(truss.energy(1.0, &other).unwrap() > least);
        }
    }
}

/// Two bars from the supports at (±1, 0) to the apex at (0, h): the shallow arch of von Mises, loaded at the apex.
fn arch(h: f64) -> Truss<2> {
    let mut truss = Truss::new(vec![-1.0, 0.0, 1.0, 0.0, 0.0, h], [[0, 2], [1, 2]], 1.0);
    [0, 1, 2, 3, 4].into_iter().for_each(|dof| truss.hold(dof));
    truss
}

/// Downward load that holds the apex at height `y`: `2 k (L₀ − l) y / l`.
fn arch_load(h: f64, y: f64) -> f64 {
    let (start, now) = (h.hypot(1.0), y.hypot(1.0));
    2.0 * (start - now) * y / now
}

#[test]
fn an_arch_snaps_through_under_load() {
    let h = 0.3;
    let limit = (0..30_000).map(|k| arch_load(h, k as f64 * 1e-5)).fold(0.0, f64::max);
    for solver in SOLVERS {
        let mut truss = arch(h);
        truss.load[5] = -1.55 * limit;
        let mut u = vec![0.0; 6];
        let mut path = Vec::new();
        let mut observer = |report: &StepReport, _: &mut Truss<2>, u: &[f64], _: &[f64]| {
            path.push((report.time, h + u[5]));
            ControlFlow::Continue(())
        };
        LoadSteps::uniform(0.0, 1.0, 12).run(&mut truss, &mut newton(solver), &mut u, &mut observer, None).unwrap();
        for &(t, y) in &path {
            let error = (arch_load(h, y) - 1.55 * t * limit) / limit;
            assert!(error.abs() < 1e-7, "{solver:?} at {t}: {error:e}");
            // Before the limit (t = 0.645) above, after it below, on the stable branch.
            assert_eq!(y > 0.0, t < 1.0 / 1.55, "{solver:?} at {t}: {y}");
        }
        assert!(path.len() >= 12);
    }
}

#[test]
fn a_prescribed_apex_passes_the_limit_point() {
    let h = 0.3;
    let mut truss = arch(h);
    truss.drive(5, |t| (-0.6 * t, -0.6));
    let mut u = vec![0.0; 6];
    let mut observer = |report: &StepReport, truss: &mut Truss<2>, u: &[f64], _: &[f64]| {
        let mut f = vec![0.0; 6];
        Statics::force(truss, report.time, u, &mut f).unwrap();
        assert!((f[5] - arch_load(h, h - 0.6 * report.time)).abs() < 1e-14, "{}", report.time);
        ControlFlow::Continue(())
    };
    LoadSteps::uniform(0.0, 1.0, 10).run(&mut truss, &mut newton(LinearSolver::Automatic), &mut u, &mut observer, None).unwrap();
}

#[test]
fn supports_moved_far_take_the_body_along() {
    // A driven end: without the tangent's prediction the last bar alone would take the whole increment.
    for solver in SOLVERS {
        let n = 50;
        let mut truss = chain(n, 1e6);
        truss.bars.iter_mut().for_each(|bar| bar.c = 1e6);
        truss.hold(0);
        truss.drive(n - 1, |t| (20.0 * t, 20.0));
        let mut u = vec![0.0; n];
        let mut reports = Vec::new();
        let mut observer = |report: &StepReport, _: &mut Truss<1>, _: &[f64], _: &[f64]| {
            reports.push(report.clone());
            ControlFlow::Continue(())
        };
        LoadSteps::uniform(0.0, 1.0, 1).run(&mut truss, &mut newton(solver), &mut u, &mut observer, None).unwrap();
        for p in 0..n {
            assert!((u[p] - 20.0 * p as f64 / (n as f64 - 1.0)).abs() < 1e-6, "{p}: {}", u[p]);
        }
        let most = if solver == LinearSolver::Direct { 1 } else { 4 };
        assert!(reports[0].iterations <= most, "{:?}", reports[0]);
    }
}

#[test]
fn the_weakest_bar_breaks_at_its_strength() {
    // Twelve bars in series, pulled by displacement: all carry k d / 12; bar 4 fails at extension 0.01, that is at d = 0.12.
    let mut truss = chain(13, 1e3);
    truss.hold(0);
    truss.drive(12, |t| (0.2 * t, 0.2));
    truss.bars[4].strength = 0.01 * (1.0 - 1e-9);
    let mut u = vec![0.0; 13];
    let mut broken = Vec::new();
    let mut observer = |report: &StepReport, _: &mut Truss<1>, _: &[f64], _: &[f64]| {
        broken.push((report.time, report.broken));
        ControlFlow::Continue(())
    };
    // Once broken, each piece hangs on its support and carries nothing.
    LoadSteps::uniform(0.0, 1.0, 10).run(&mut truss, &mut newton(LinearSolver::Direct), &mut u, &mut observer, None).unwrap();
    assert_eq!(broken.iter().filter(|b| b.1 > 0).collect::<Vec<_>>(), [&(0.6, 1)]);
    assert!((0..5).all(|p| u[p].abs() < 1e-9) && (5..13).all(|p| (u[p] - 0.2).abs() < 1e-9), "{u:?}");
}

#[test]
fn parallel_bars_break_one_after_another_under_load() {
    // Fibres of rising strength under dead load: the bundle of Daniels, N fibres of strength s_k = k/N: it carries until
    // max (N − k + 1) s_k, here N (N + 1)²/(4N²) k → breaking of any further fibre is without end.
    let fibres = 10;
    let mut truss = Truss::<1>::new(vec![0.0, 1.0], (0..fibres).map(|_| [0, 1]), 1.0);
    truss.hold(0);
    for (k, bar) in truss.bars.iter_mut().enumerate() {
        bar.strength = (k + 1) as f64 / fibres as f64;
    }
    let peak = (1..=fibres).map(|k| (fibres - k + 1) as f64 * k as f64 / fibres as f64).fold(0.0, f64::max);
    truss.load[1] = peak / 0.7;
    let mut u = vec![0.0; 2];
    let error = LoadSteps::uniform(0.0, 1.0, 10).run(&mut truss, &mut newton(LinearSolver::Direct), &mut u, &mut Silent, None).unwrap_err();
    match error {
        StaticsError::Increment { time, cause, .. } => {
            assert!((0.6999..=0.7 + 1e-9).contains(&time), "{time}");
            // All fibres gone: nothing holds the load.
            assert!(matches!(cause, EquilibriumError::Direct(_)) && cause.worst_dof() == Some(1), "{cause}");
        }
        other => panic!("{other}"),
    }
    // The last good state stays: half of the fibres, rolled back to.
    assert!((u[1] - 0.5).abs() < 0.11 && truss.bars.iter().filter(|b| b.broken).count() >= 4, "{u:?}");
    assert!(truss.bars.iter().filter(|b| b.broken).count() <= 5);
}

#[test]
fn linear_mode_superposes_and_factors_once() {
    for solver in [LinearSolver::Direct, LinearSolver::ConjugateGradients] {
        let mut truss = lattice(8, 5, 2e11);
        let n = truss.load.len();
        truss.load[n - 1] = 1e11;
        truss.drive(n - 2, |t| (0.3 * t, 0.3));
        let options = NewtonOptions { solver, linear: true, threads: 1, tolerance: 1e-12, ..Default::default() };
        let mut states = Vec::new();
        let mut observer = |_: &StepReport, _: &mut Truss<2>, u: &[f64], _: &[f64]| {
            states.push(u.to_vec());
            ControlFlow::Continue(())
        };
        let mut u = vec![0.0; n];
        LoadSteps::uniform(0.0, 1.0, 4).run(&mut truss, &mut Newton::new(options), &mut u, &mut observer, None).unwrap();
        let scale = states[3].iter().fold(0.0f64, |s, u| s.max(u.abs()));
        assert!(scale > 0.3);
        for k in 0..n {
            assert!((states[3][k] - 4.0 * states[0][k]).abs() < 1e-9 * scale);
        }
        let mut product = vec![0.0; n];
        Statics::tangent_product(&mut truss, 0.0, &vec![0.0; n], &u, &mut product).unwrap();
        for k in (0..n).filter(|&k| !truss.fixed[k]) {
            assert!((product[k] - truss.load[k]).abs() < 1e-9 * 1e11, "{k}");
        }
        assert!(truss.factored <= 1);
    }
}

#[test]
fn failures_say_what_and_where() {
    // A load that nothing carries.
    let mut truss = chain(4, 1.0);
    truss.hold(0);
    truss.bars[2].broken = true;
    truss.load[3] = 1.0;
    let mut u = vec![0.0; 4];
    let error = LoadSteps::uniform(0.0, 1.0, 1).run(&mut truss, &mut newton(LinearSolver::Direct), &mut u, &mut Silent, None).unwrap_err();
    assert!(matches!(error, StaticsError::Increment { time: 0.0, .. }), "{error:?}");
    assert_eq!(u, [0.0; 4]);
    let StaticsError::Increment { cause, .. } = &error else { unreachable!() };
    assert_eq!(cause.worst_dof(), Some(3), "{error}");
    // Too few iterations: the history is told, and the increment was cut in vain as often as allowed.
    let mut truss = chain(2, 1.0);
    truss.bars[0].c = 1e6;
    truss.hold(0);
    truss.load[1] = 1e6;
    let options = NewtonOptions { max_iterations: 1, threads: 1, ..Default::default() };
    let error = Newton::new(options).equilibrate(&mut truss, 1.0, &mut [0.0; 2], None).unwrap_err();
    match error {
        EquilibriumError::NotConverged { history, worst_dof: 1, .. } => assert_eq!(history.len(), 2),
        other => panic!("{other}"),
    }
    let program = LoadSteps::at(vec![0.5, 0.4], 0.0);
    let error = program.run(&mut truss, &mut newton(LinearSolver::Direct), &mut [0.0; 2], &mut Silent, None);
    assert!(matches!(error, Err(StaticsError::Stations { index: 1, .. })));
}

#[test]
fn increments_are_cut_where_they_fail_and_grow_again() {
    // Few iterations allowed: the first increments must be cut, and every station is still reached exactly.
    let mut truss = chain(2, 1e-3);
    truss.bars[0].c = 1.0;
    truss.hold(0);
    truss.load[1] = 1.0 + 1e-3;
    let options = NewtonOptions { max_iterations: 5, threads: 1, ..Default::default() };
    let mut reports = Vec::new();
    let mut observer = |report: &StepReport, _: &mut Truss<1>, _: &[f64], _: &[f64]| {
        reports.push(report.clone());
        ControlFlow::Continue(())
    };
    let mut u = vec![0.0; 2];
    LoadSteps::uniform(0.0, 1.0, 2).run(&mut truss, &mut Newton::new(options), &mut u, &mut observer, None).unwrap();
    let stations: Vec<f64> = reports.iter().filter(|r| r.station).map(|r| r.time).collect();
    assert_eq!(stations, [0.5, 1.0]);
    assert!((u[1] - 1.0).abs() < 1e-7, "{u:?}");
    assert!(reports.iter().map(|r| r.cuts).sum::<usize>() >= 1 && reports.len() > 2, "{reports:?}");
}

#[test]
fn a_body_that_does_not_assemble_is_solved_without() {
    let mut truss = lattice(6, 3, 1.0);
    truss.assembles = false;
    let n = truss.load.len();
    truss.load[n - 1] = -0.01;
    let mut reports = Vec::new();
    let mut observer = |report: &StepReport, _: &mut Truss<2>, _: &[f64], _: &[f64]| {
        reports.push(report.clone());
        ControlFlow::Continue(())
    };
    let mut u = vec![0.0; n];
    let program = LoadSteps::uniform(0.0, 1.0, 1);
    program.run(&mut truss, &mut newton(LinearSolver::Automatic), &mut u, &mut observer, None).unwrap();
    assert!(reports[0].linear_iterations > 0 && reports[0].solver.contains("conjugate"), "{reports:?}");
    u.fill(0.0);
    let error = program.run(&mut truss, &mut newton(LinearSolver::Direct), &mut u, &mut Silent, None).unwrap_err();
    assert!(error.to_string().contains("does not assemble"), "{error}");
}

#[test]
fn pieces_that_break_off_stay_where_they_are() {
    // A lattice torn in two along a line, and one point torn out altogether: the free piece has a singular tangent.
    let mut truss = lattice(8, 3, 1e5);
    let n = truss.load.len();
    truss.load[2 * 9] = 1e3;
    for bar in &mut truss.bars {
        let columns = bar.ends.map(|p| p / 3);
        bar.broken = columns.contains(&3) && columns.contains(&4) || bar.ends.contains(&23);
    }
    let mut u = vec![0.0; n];
    let mut reports = Vec::new();
    let mut observer = |report: &StepReport, _: &mut Truss<2>, _: &[f64], _: &[f64]| {
        reports.push(report.clone());
        ControlFlow::Continue(())
    };
    LoadSteps::uniform(0.0, 1.0, 1).run(&mut truss, &mut newton(LinearSolver::Direct), &mut u, &mut observer, None).unwrap();
    assert!(u[18] > 1e-3 && u[24..].iter().all(|u| u.abs() < 1e-9), "{u:?}");
    // Quadratic convergence is not lost to the shift.
    assert!(reports[0].iterations <= 5 && reports[0].residual < 1e-8, "{reports:?}");
}
