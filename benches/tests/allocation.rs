//! Nothing is allocated in hot loops: force evaluations and explicit steps of every model, once they are warm.

#[path = "../../crates/physics/tests/common/counting.rs"]
mod counting;
#[path = "../src/decks.rs"]
mod decks;

use bodies::structure::Simulated;
use decks::{MODELS, Push, STEP, block_under};
use solvers::observe::{Observer, StepReport};
use solvers::problem::Dynamics;
use solvers::velocity_verlet::{Motion, VelocityVerlet};
use std::ops::ControlFlow;

/// Counts the allocations of ten steps after the second.
struct Counter {
    warm: usize,
    calls: usize,
}

impl Observer<dyn Simulated> for Counter {
    fn step(&mut self, report: &StepReport, _: &mut (dyn Simulated + 'static), _: &[f64], _: &[f64]) -> ControlFlow<()> {
        match report.step {
            2 => self.warm = counting::calls(),
            12 => self.calls = counting::calls() - self.warm,
            _ => {}
        }
        ControlFlow::Continue(())
    }
}

#[test]
fn hot_loops_do_not_allocate() {
    // this thread does all the work, so that its count is the whole
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build().unwrap();
    pool.install(|| {
        let pushed = MODELS.iter().filter(|m| m.name == "bond-based").map(|m| (m, Push::LoadAndWall));
        for (model, push) in MODELS.iter().map(|m| (m, Push::Nothing)).chain(pushed) {
            let cells = [[600, 1, 1], [30, 20, 1], [9, 8, 8]][model.dimension - 1];
            let mut b = block_under(model, cells, push);
            let mut f = vec![0.0; b.u.len()];
            Dynamics::force(&mut *b.model, 0.0, &b.u, &b.v, &mut f).unwrap();
            let before = counting::calls();
            Dynamics::force(&mut *b.model, 0.0, &b.u, &b.v, &mut f).unwrap();
            let force = counting::calls() - before;

            let mut motion = Motion::at_rest(b.u.len(), 0.0);
            motion.v.copy_from_slice(&b.v);
            let mut counter = Counter { warm: 0, calls: 0 };
            let solver = VelocityVerlet { time_step: STEP, end: 12.0 * STEP, observe_every: 1, following: None };
            solver.run(&mut *b.model, &mut motion, &mut counter, None).unwrap();
            let calls = counter.calls;
            println!("{} D {}: {force} in a force evaluation, {calls} in ten steps", model.dimension, model.name);
            assert_eq!((force, calls), (0, 0), "{} D {}", model.dimension, model.name);
        }
    });
}
