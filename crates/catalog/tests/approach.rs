//! Points that approach: the step that follows the stiffness keeps their order and their energy; points that meet are named; what
//! breaking does to the stiffness of those that are left.

mod common;

use bodies::body::{Body, Geometry};
use bodies::chunk::Link;
use bodies::damage::Criterion;
use bodies::loads::{Condition, Kind};
use bodies::structure::{Failure, Parts, Structure};
use catalog::{Catalog, Compiled, Model};
use common::{linear, on};
use physics::elasticity::{Isotropic, Section, Stiffness};
use physics::models::{BondStrainCalibration, EmptySubHorizon};
use physics::sub_horizon::Partition;
use physics::tensor::Vector;
use solvers::observe::StepReport;
use solvers::problem::Dynamics;
use solvers::velocity_verlet::{Following, Motion, VelocityVerlet, stable_step};
use std::ops::ControlFlow;

const UNIT: Isotropic = Isotropic { young: 1.0, poisson: 0.0 };

fn stiffness<const D: usize>() -> Stiffness<D> {
    let section = [Section::Bar { area: 1.0 }, Section::PlaneStrain { thickness: 1.0 }, Section::Solid][D - 1];
    Stiffness::isotropic(UNIT, 0.0, section)
}

/// Points of unit volume and density with every bond up to a horizon of 3.015.
fn structure<const D: usize>(position: &[[f64; 3]], model: Model<D>, conditions: Vec<Condition>, failure: Vec<Failure>) -> Structure<D>
where
    Catalog: Compiled<D>,
{
    let sub_horizons = if matches!(model, Model::SubHorizons(..)) { 1 << D } else { 0 };
    const HORIZON: f64 = 3.015;
    let n = position.len();
    let ones = vec![1.0; n];
    let horizon = vec![HORIZON; n];
    let g = Geometry { position, volume: &ones, horizon: &horizon };
    let mut body = Body::<D>::new(&g, D == 1, sub_horizons, |p, out: &mut Vec<Link>| {
        let far = |q: usize| (0..3).map(|k| (position[q][k] - position[p][k]).powi(2)).sum::<f64>().sqrt();
        out.extend((0..n).filter(|&q| q != p && far(q) <= HORIZON).map(|q| Link {
            point: q as u32,
            flips: 0,
            end: position[q],
            weight: 1.0,
            sets: 0,
        }));
        if sub_horizons > 0 {
            let bonds: Vec<(Vector<f64, D>, f64)> =
                out.iter().map(|l| (Vector(std::array::from_fn(|k| l.end[k] - position[p][k])), 1.0)).collect();
            out.iter_mut().zip(Partition::Orthants.membership(&bonds, HORIZON)).for_each(|(l, sets)| l.sets = sets);
        }
    });
    let points: Vec<u32> = (0..n as u32).collect();
    let part = on(&points, model, false, sub_horizons, &body);
    body.assign(vec![part]).unwrap();
    let parts = Parts { id: (0..n as u64).map(|p| 100 + p).collect(), user: points, material: vec![0; n], density: ones };
    Structure::new(body, parts, conditions, None, failure, 1.0)
}

fn extended<const D: usize>(position: &[[f64; 3]], exponent: f64, control: f64, conditions: Vec<Condition>) -> Structure<D>
where
    Catalog: Compiled<D>,
{
    structure(position, common::extended(stiffness::<D>(), exponent, BondStrainCalibration::MomentTensor, control), conditions, vec![])
}

fn bar(n: usize) -> Vec<[f64; 3]> {
    (0..n).map(|p| [p as f64 + 0.5, 0.0, 0.0]).collect()
}

/// Follows a motion from rest with the automatic step. Returns the steps observed, the smallest |Y|/|ξ| of neighbours in a row, and the
/// largest error of the energy over the energy at the end.
fn automatic<const D: usize>(s: &mut Structure<D>, end: f64) -> (usize, f64, f64) {
    let n = Dynamics::dofs(s);
    let mut motion = Motion::at_rest(n, 0.0);
    let stable = stable_step(s, 0.0, &motion.u, 0.9).unwrap();
    let following = Some(Following { safety: 0.9, frequency: stable.frequency });
    let verlet = VelocityVerlet { time_step: stable.time_step, end, observe_every: 1, following };
    let (mut seen, mut least, mut start, mut worst, mut total) = (0, f64::INFINITY, None, 0.0f64, 0.0);
    let mut observer = |_: &StepReport, s: &mut Structure<D>, u: &[f64], v: &[f64]| {
        seen += 1;
        least = (D..n).step_by(D).map(|q| 1.0 + u[q] - u[q - D]).fold(least, f64::min);
        let b = s.balance(0.0, u, v);
        total = b.kinetic + b.strain;
        worst = worst.max((total - b.external_work - *start.get_or_insert(total - b.external_work)).abs());
        ControlFlow::Continue(())
    };
    verlet.run(s, &mut motion, &mut observer, None).unwrap();
    (seen, least, worst / total)
}

#[test]
fn a_bar_driven_into_itself_keeps_order_and_energy_with_the_automatic_step() {
    // 30 points, a third of the bar is pushed in at the speed of sound: a local bar would have strain -1
    for (exponent, control, bound) in [(0.0, 0.0, 4e-3), (0.0, 1.0, 1e-3), (-0.5, 0.0, 2e-3), (-1.0, 0.0, 3e-3), (-2.0, 1.0, 2e-3)] {
        let on = |kind, points: std::ops::Range<u32>, value: f64| Condition {
            name: String::new(),
            kind,
            points: points.collect(),
            components: [Some(Box::new(move |_, _| value)), None, None],
            along: None,
        };
        let conditions = vec![on(Kind::Displacement, 0..3, 0.0), on(Kind::Velocity, 27..30, -1.0)];
        let mut s = extended::<1>(&bar(30), exponent, control, conditions);
        let (steps, least, drift) = automatic(&mut s, 10.0);
        println!("m = {exponent}, control {control}: {steps} parts, smallest gap {least:.3e}, energy {drift:.1e}");
        assert!(least > 0.0, "{exponent}: points have passed each other");
        assert!(drift < bound, "{exponent} {control}: {drift:e}");
    }
}

#[test]
fn points_that_meet_are_named() {
    // in the plane, at the very start: point 107 is displaced onto 108
    let position: Vec<[f64; 3]> = (0..25).map(|p| [(p % 5) as f64, (p / 5) as f64, 0.0]).collect();
    for exponent in [1.0, 0.0, -1.0] {
        let mut s = extended::<2>(&position, exponent, 0.0, vec![]);
        let (mut u, v, mut f) = (vec![0.0; 50], vec![0.0; 50], vec![0.0; 50]);
        u[14] = 1.0;
        let met = s.step_limit(0.0, &u, &v, 1.0).and_then(|_| Dynamics::force(&mut s, 0.0, &u, &v, &mut f));
        if exponent == 1.0 {
            // a closed bond has a finite strain: nothing is wrong
            assert!(met.is_ok());
            continue;
        }
        let message = met.unwrap_err().to_string();
        assert!(message.contains("107") && message.contains("108") && message.contains("met"), "{message}");
        // the force alone says so too (statics)
        let message = Dynamics::force(&mut s, 0.0, &u, &v, &mut f).unwrap_err().to_string();
        assert!(message.contains("107") && message.contains("108"), "{message}");
    }
}

#[test]
fn points_that_meet_in_space_are_named_and_others_are_watched() {
    // 3 × 3 × 3 points; 113 is the one in the middle, 114 the next along x
    let position: Vec<[f64; 3]> = (0..27).map(|p| [(p % 3) as f64, (p / 3 % 3) as f64, (p / 9) as f64]).collect();
    for exponent in [0.0, -0.5, -1.5, -2.0] {
        let mut s = extended::<3>(&position, exponent, 0.0, vec![]);
        let (mut u, mut v, mut f) = (vec![0.0; 81], vec![0.0; 81], vec![0.0; 81]);
        // on the way: a quarter of the distance is left, closing at a speed of one
        (u[13 * 3], v[13 * 3]) = (0.75, 1.0);
        let step = s.step_limit(0.0, &u, &v, 1.0).unwrap();
        assert!((step - bodies::structure::APPROACH * 0.25).abs() < 1e-12, "{exponent}: {step}");
        assert!((s.hardness() - 4.0).abs() < 1e-12);
        let closest = bodies::structure::Simulated::closest_approach(&s).unwrap();
        assert!((closest - 0.25).abs() < 1e-15, "{closest}");
        assert!(Dynamics::force(&mut s, 0.0, &u, &v, &mut f).is_ok());
        // there
        u[13 * 3] = 1.0;
        let message = s.step_limit(0.0, &u, &v, 1.0).unwrap_err().to_string();
        assert!(message.contains("113") && message.contains("114") && message.contains("met"), "{message}");
        let message = Dynamics::force(&mut s, 0.0, &u, &v, &mut f).unwrap_err().to_string();
        assert!(message.contains("113") && message.contains("114"), "{message}");
    }
}

/// Numbers between −1/2 and 1/2.
fn random(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
    (*seed >> 33) as f64 / f64::from(1u32 << 31) - 0.5
}

#[test]
fn what_breaking_does_to_stored_energy_is_accounted_for() {
    let position: Vec<[f64; 3]> = (0..144).map(|p| [(p % 12) as f64, (p / 12) as f64, 0.0]).collect();
    for empty in [EmptySubHorizon::Renormalise, EmptySubHorizon::ZeroEnergy { of: 4 }] {
        let (mut seed, mut raised, mut rounds) = (11u64, 0.0, 0);
        for round in 0..20 {
            let model = Model::SubHorizons(linear(stiffness::<2>()), empty);
            let failure = vec![Failure { criterion: Criterion::CriticalStretch(vec![0.02; 144]), batch: 1.0 }];
            let mut s = structure::<2>(&position, model, vec![], failure);
            let still = vec![0.0; 288];
            let size = 0.03 + 0.003 * f64::from(round);
            // breaks again and again, until next to nothing is left
            for _ in 0..6 {
                let u: Vec<f64> = (0..288).map(|_| size * random(&mut seed)).collect();
                let before = s.balance(0.0, &u, &still);
                let broke = Dynamics::accept(&mut s, 0.0, &u, &still).unwrap();
                let after = s.balance(0.0, &u, &still);
                let released = after.breaking.released - before.breaking.released;
                let rose = after.breaking.raised - before.breaking.raised;
                let dropped = before.strain - after.strain;
                assert!((released - dropped).abs() <= 1e-12 * before.strain, "{empty:?} {round}: {released:e} {dropped:e}");
                // what rises is counted in what is released, with the other sign
                assert!(rose >= 0.0 && released >= -rose * (1.0 + 1e-12));
                raised += rose / before.strain.max(f64::MIN_POSITIVE);
                rounds += usize::from(broke);
            }
        }
        println!("{empty:?}: {rounds} rounds broke bonds, which raised the energy of families by {raised:.3} of that of the body in all");
        assert!(rounds > 60 && raised > 0.0);
    }
}

#[test]
fn broken_bonds_are_counted_with_the_displacements_at_which_they_broke() {
    // on a lattice forces do not go through the rows that families read: what was in them before must not matter
    let position: Vec<[f64; 3]> = (0..144).map(|p| [(p % 12) as f64, (p / 12) as f64, 0.0]).collect();
    let still = vec![0.0; 288];
    let mut seed = 5u64;
    let [u, other]: [Vec<f64>; 2] = std::array::from_fn(|_| (0..288).map(|_| 0.04 * random(&mut seed)).collect());
    let held = |before: &[f64]| {
        let model = Model::SubHorizons(linear(stiffness::<2>()), EmptySubHorizon::Renormalise);
        let failure = vec![Failure { criterion: Criterion::CriticalStretch(vec![0.02; 144]), batch: 1.0 }];
        let mut s = structure::<2>(&position, model, vec![], failure);
        s.balance(0.0, before, &still);
        let mut f = still.clone();
        Dynamics::force(&mut s, 0.0, &u, &still, &mut f).unwrap();
        assert!(Dynamics::accept(&mut s, 0.0, &u, &still).unwrap());
        let b = s.balance(0.0, &u, &still);
        (b.broken_bonds, b.breaking.released)
    };
    assert_eq!(held(&u), held(&other));
    assert!(held(&u).0 > 0.0);
}

#[test]
fn a_step_follows_what_breaking_stiffens() {
    // quadrants: the bonds of a quadrant that has lost most of its own carry its whole stress, so that frequencies rise; breaking beyond the
    // stable step would let the energy of what is left grow without bound
    let position: Vec<[f64; 3]> = (0..144).map(|p| [(p % 12) as f64, (p / 12) as f64, 0.0]).collect();
    let model = || Model::SubHorizons(linear(stiffness::<2>()), EmptySubHorizon::ZeroEnergy { of: 4 });
    let made = |critical: f64| {
        let failure = vec![Failure { criterion: Criterion::CriticalStretch(vec![critical; 144]), batch: 1.0 }];
        structure::<2>(&position, model(), vec![], failure)
    };
    // a rough displacement: what grows by more than 1 % breaks at once, here and there
    let mut seed = 7u64;
    let mut random = || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 33) as f64 / f64::from(1u32 << 31) - 0.5
    };
    let rough: Vec<f64> = (0..288).map(|_| 0.06 * random()).collect();
    let still = vec![0.0; 288];
    let mut s = made(0.01);
    let before = stable_step(&mut s, 0.0, &still, 0.9).unwrap();
    assert!(s.stiffens_by_breaking() && s.hardness() == 1.0);
    assert!(Dynamics::accept(&mut s, 0.0, &rough, &still).unwrap());
    let after = stable_step(&mut s, 0.0, &still, 0.9).unwrap();
    let grown = (after.frequency / before.frequency).powi(2);
    println!("largest eigenvalue grown by {grown:.2} as {} directed bonds broke", s.broken.bonds);
    assert!(grown > 1.1, "the case shows nothing: {grown}");
    // the same from the first step of a motion on: left alone the energy grows, followed it does not
    let energy_after = |following: Option<Following>| {
        let mut s = made(0.01);
        let mut motion = Motion::at_rest(288, 0.0);
        motion.u.iter_mut().zip(&rough).for_each(|(u, r)| *u = *r);
        let (mut first, mut last) = (None, 0.0);
        let mut observer = |_: &StepReport, s: &mut Structure<2>, u: &[f64], v: &[f64]| {
            let b = s.balance(0.0, u, v);
            last = b.kinetic + b.strain;
            first.get_or_insert(last);
            ControlFlow::Continue(())
        };
        let verlet = VelocityVerlet { time_step: before.time_step, end: 60.0 * before.time_step, observe_every: 1, following };
        let ended = verlet.run(&mut s, &mut motion, &mut observer, None);
        if ended.is_err() { f64::INFINITY } else { last / first.unwrap() }
    };
    let alone = energy_after(None);
    let followed = energy_after(Some(Following { safety: 0.9, frequency: before.frequency }));
    println!("energy over that at the start: {alone:.3e} at the step of the whole body, {followed:.3} followed");
    assert!(alone > 10.0 && followed <= 1.0 + 1e-3, "{alone} {followed}");
}
