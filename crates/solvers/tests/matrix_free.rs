//! Nonlinear conjugate gradients and dynamic relaxation against Newton's method and closed forms.

mod common;

use std::ops::ControlFlow;

use common::{Truss, chain, lattice};
use solvers::dynamic_relaxation::{DynamicRelaxation, DynamicRelaxationOptions};
use solvers::load_steps::{Equilibrium, EquilibriumError, LoadSteps};
use solvers::newton::{Newton, NewtonOptions};
use solvers::nonlinear_cg::{NonlinearCg, NonlinearCgOptions};
use solvers::observe::{Silent, StepReport};

fn methods() -> [(Box<dyn Equilibrium>, f64); 2] {
    let relaxation = DynamicRelaxationOptions { tolerance: 1e-8, ..Default::default() };
    let gradients = NonlinearCgOptions { tolerance: 1e-8, ..Default::default() };
    [(Box::new(NonlinearCg::new(gradients)), 1e-6), (Box::new(DynamicRelaxation::new(relaxation)), 1e-6)]
}

fn final_state<const D: usize>(truss: &mut Truss<D>, method: &mut dyn Equilibrium, steps: usize) -> (Vec<f64>, usize) {
    truss.accepted_scale = 0.0;
    let mut u = vec![0.0; truss.load.len()];
    let mut iterations = 0;
    let mut observer = |report: &StepReport, _: &mut Truss<D>, _: &[f64], _: &[f64]| {
        iterations += report.iterations;
        ControlFlow::Continue(())
    };
    LoadSteps::uniform(0.0, 1.0, steps).run(truss, method, &mut u, &mut observer, None).unwrap();
    (u, iterations)
}

#[test]
fn a_truss_in_large_rotation_comes_to_the_same_rest() {
    for unit in [1.0, 1e-9, 1e9] {
        for (mut method, tolerance) in methods() {
            let mut truss = lattice(10, 4, 1e3 * unit);
            let n = truss.load.len();
            truss.load[n - 1] = -80.0 * unit;
            let mut newton = Newton::new(NewtonOptions { threads: 1, ..Default::default() });
            let (exact, _) = final_state(&mut truss, &mut newton, 4);
            let (found, iterations) = final_state(&mut truss, method.as_mut(), 4);
            let scale = exact.iter().fold(0.0f64, |s, u| s.max(u.abs()));
            let error = (0..n).map(|k| (found[k] - exact[k]).abs()).fold(0.0, f64::max) / scale;
            assert!(error < tolerance, "{error:e} after {iterations}");
            assert!(iterations < 20_000, "{iterations}");
        }
    }
}

#[test]
fn driven_ends_take_the_chain_along() {
    for (mut method, tolerance) in methods() {
        let n = 30;
        let mut truss = chain(n, 1e6);
        truss.bars.iter_mut().for_each(|bar| bar.c = 1e6);
        truss.hold(0);
        truss.drive(n - 1, |t| (8.0 * t, 8.0));
        let (u, _) = final_state(&mut truss, method.as_mut(), 2);
        for p in 0..n {
            assert!((u[p] - 8.0 * p as f64 / (n as f64 - 1.0)).abs() < 8.0 * tolerance, "{p}: {}", u[p]);
        }
    }
}

#[test]
fn the_weakest_bar_breaks_and_the_rest_relaxes() {
    for (mut method, _) in methods() {
        let mut truss = chain(13, 1e3);
        truss.hold(0);
        truss.drive(12, |t| (0.2 * t, 0.2));
        truss.bars[4].strength = 0.0099;
        let (u, _) = final_state(&mut truss, method.as_mut(), 10);
        assert_eq!(truss.bars.iter().filter(|b| b.broken).count(), 1);
        assert!((0..5).all(|p| u[p].abs() < 1e-7) && (5..13).all(|p| (u[p] - 0.2).abs() < 1e-7), "{u:?}");
    }
}

#[test]
fn an_arch_snaps_through_without_a_matrix() {
    let h: f64 = 0.3;
    for (mut method, _) in methods() {
        let mut truss = Truss::<2>::new(vec![-1.0, 0.0, 1.0, 0.0, 0.0, h], [[0, 2], [1, 2]], 1.0);
        [0, 1, 2, 3, 4].into_iter().for_each(|dof| truss.hold(dof));
        truss.load[5] = -0.03;
        let (u, _) = final_state(&mut truss, method.as_mut(), 5);
        let y = h + u[5];
        let (start, now) = (h.hypot(1.0), y.hypot(1.0));
        assert!(y < 0.0 && (2.0 * (start - now) * y / now - 0.03).abs() < 1e-9, "{y}");
    }
}

#[test]
fn steps_that_run_out_are_an_error_with_the_residual() {
    let mut truss = lattice(20, 3, 1.0);
    let n = truss.load.len();
    truss.load[n - 1] = 1e-3;
    let relaxation = DynamicRelaxationOptions { max_steps: 20, ..Default::default() };
    let gradients = NonlinearCgOptions { max_iterations: 3, ..Default::default() };
    let few: [Box<dyn Equilibrium>; 2] = [Box::new(DynamicRelaxation::new(relaxation)), Box::new(NonlinearCg::new(gradients))];
    for mut method in few {
        match method.equilibrate(&mut truss, 1.0, &mut vec![0.0; n], None) {
            Err(EquilibriumError::NotConverged { residual, worst_dof, .. }) => {
                assert!(residual > 1e-4 && residual.is_finite() && !truss.fixed[worst_dof]);
            }
            other => panic!("{other:?}"),
        }
    }
    let program = LoadSteps::uniform(0.0, 1.0, 1);
    assert!(program.run(&mut truss, &mut DynamicRelaxation::default(), &mut vec![0.0; n], &mut Silent, None).is_ok());
}
