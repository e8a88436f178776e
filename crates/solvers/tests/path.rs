//! Paths past limit points on trusses with closed forms, and factors of indefinite matrices.

mod common;

use std::ops::ControlFlow;

use common::{Truss, lattice};
use solvers::arc_length::{ArcLength, Control, PathError};
use solvers::direct::SparseCholesky;
use solvers::observe::{Ended, StepReport};
use solvers::problem::Statics;
use solvers::sparse::BlockMatrix;
use solvers::vector;

/// Two bars from (∓1, 0) to an apex at height `h`, pulled down by a unit load (von Mises 1923).
fn two_bars(h: f64, unit: f64) -> Truss<2> {
    let mut truss = Truss::new(vec![-1.0, 0.0, 0.0, h, 1.0, 0.0], [[0, 1], [1, 2]], 100.0 * unit);
    [0, 1, 4, 5].into_iter().for_each(|k| truss.hold(k));
    truss.load[3] = -unit;
    truss
}

/// Load on the symmetric path at depth `w` below the start: `2 k (l₀ − l) (h − w)/l`.
fn symmetric_load(h: f64, w: f64) -> f64 {
    let (y, l0) = (h - w, h.hypot(1.0));
    let l = y.hypot(1.0);
    2.0 * 100.0 * (l0 - l) * y / l
}

/// The limit load: on the symmetric path `l³ = l₀` (dP/dw = 0).
fn limit(h: f64) -> f64 {
    let l0 = h.hypot(1.0);
    let y = (l0.powf(2.0 / 3.0) - 1.0).sqrt();
    symmetric_load(h, h - y)
}

/// Load, displacement and unstable modes of each step.
type Seen = Vec<(f64, f64, usize)>;

fn follow(arc: &ArcLength, truss: &mut Truss<2>, u: &mut [f64]) -> (Result<solvers::arc_length::Path, PathError>, Seen) {
    let mut seen = vec![];
    let mut observer = |report: &StepReport, _: &mut Truss<2>, u: &[f64], _: &[f64]| {
        seen.push((report.time, u[3], report.unstable_modes.unwrap()));
        ControlFlow::Continue(())
    };
    let path = arc.run(truss, u, &mut observer, None);
    (path, seen)
}

#[test]
fn snap_through_of_two_bars() {
    let h = 0.3;
    for unit in [1.0, 1e9] {
        let mut truss = two_bars(h, unit);
        let mut u = vec![0.0; 6];
        let arc = ArcLength { end: 4.0, stations: vec![0.5], threads: 1, ..Default::default() };
        let (path, seen) = follow(&arc, &mut truss, &mut u);
        let path = path.unwrap();
        assert_eq!(path.ended, Ended::Completed);
        assert_eq!(path.load, 4.0);
        assert!(seen.iter().any(|s| s.0 == 0.5), "a station is met");
        let worst = seen.iter().map(|s| (s.0 - symmetric_load(h, -s.1)).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-8, "{worst}");
        let limits: Vec<f64> = path.limit_points.iter().map(|p| p.load).collect();
        println!("{} steps, limits {limits:?} of {}", seen.len(), limit(h));
        assert!(limits.len() == 2 && (limits[0] / limit(h) - 1.0).abs() < 1e-6 && (limits[1] / limit(h) + 1.0).abs() < 1e-6, "{limits:?}");
        // unstable between the limit points, stable outside
        let y = |w: f64| h + w;
        let critical = (h.hypot(1.0).powf(2.0 / 3.0) - 1.0).sqrt();
        for s in &seen {
            assert_eq!(s.2, usize::from(y(s.1).abs() < critical), "{s:?}");
        }
        assert!(path.bifurcations.is_empty());
    }
}

#[test]
fn steep_bars_bifurcate_before_the_limit() {
    // the sideways stiffness 2k(1 − l₀ y²/l³ …) vanishes first where l³ = l₀ y² … for steep bars: tangent xx = 2k (1 − (l₀/l)(y²/l²))
    let h: f64 = 3.0;
    let mut truss = two_bars(h, 1.0);
    let mut u = vec![0.0; 6];
    let arc = ArcLength { end: 400.0, threads: 1, ..Default::default() };
    let (path, _) = follow(&arc, &mut truss, &mut u);
    let path = path.unwrap();
    let l0 = h.hypot(1.0);
    // l³ = l₀ (l² − 1), the largest root
    let mut l = l0;
    for _ in 0..200 {
        l -= (l * l * l - l0 * (l * l - 1.0)) / (3.0 * l * l - 2.0 * l0 * l);
    }
    let load = symmetric_load(h, h - (l * l - 1.0f64).sqrt());
    let first = path.bifurcations[0];
    println!("{first:?} {load}");
    assert!(first.between[0] <= load && load <= first.between[1] && first.unstable_modes == [0, 1], "{first:?} {load}");
    assert_eq!(path.limit_points.len(), 2);
    assert!((path.limit_points[0].load / limit(h) - 1.0).abs() < 1e-6);
}

#[test]
fn displacement_control_passes_the_limit() {
    let h = 0.3;
    let mut truss = two_bars(h, 1.0);
    let mut u = vec![0.0; 6];
    let control = Control::Displacement { measure: vec![(3, -1.0)], end: 0.7 };
    let arc = ArcLength { control, end: 4.0, largest_step: 0.1, stations: vec![0.3], threads: 1, ..Default::default() };
    let (path, seen) = follow(&arc, &mut truss, &mut u);
    let path = path.unwrap();
    assert!((u[3] + 0.7).abs() < 1e-14 && (path.load / symmetric_load(h, 0.7) - 1.0).abs() < 1e-9);
    assert!(seen.iter().any(|s| (s.1 + 0.3).abs() < 1e-15 && s.0.abs() < 1e-9), "the flat state carries nothing");
    assert_eq!(path.limit_points.len(), 2);
}

#[test]
fn moving_supports_follow_the_load() {
    // supports pushed together by t instead of a load: straight bars of length √(1 + h²) rise
    let h = 0.3;
    let mut truss = two_bars(h, 1.0);
    truss.load[3] = 0.0;
    truss.motions[0].1 = |t| (0.5 * t, 0.5);
    truss.motions[2].1 = |t| (-0.5 * t, -0.5);
    let mut u = vec![0.0; 6];
    let arc = ArcLength { end: 1.0, threads: 1, ..Default::default() };
    let (path, _) = follow(&arc, &mut truss, &mut u);
    assert_eq!(path.unwrap().load, 1.0);
    let rise = (1.0 + h * h - 0.25f64).sqrt() - h;
    assert!((u[3] - rise).abs() < 1e-9, "{} {rise}", u[3]);
}

#[test]
fn a_brittle_bar_lets_the_load_fall() {
    let mut truss = Truss::<1>::new(vec![0.0, 1.0], [[0, 1], [0, 1]], 1.0);
    truss.bars[1].strength = 0.1;
    truss.hold(0);
    truss.load[1] = 1.0;
    let mut u = vec![0.0; 2];
    let control = Control::Displacement { measure: vec![(1, 1.0)], end: 0.2 };
    let arc = ArcLength { control, threads: 1, ..Default::default() };
    let mut loads = vec![];
    let mut observer = |report: &StepReport, _: &mut Truss<1>, u: &[f64], _: &[f64]| {
        loads.push((u[1], report.time));
        ControlFlow::Continue(())
    };
    arc.run(&mut truss, &mut u, &mut observer, None).unwrap();
    for (u, p) in loads {
        let bars = if u > 0.1 { 1.0 } else { 2.0 };
        assert!((p - bars * u).abs() < 1e-12, "{u} {p}");
    }
}

#[test]
fn impossible_options_are_refused() {
    let mut u = vec![0.0; 6];
    for arc in [
        ArcLength { end: 0.0, ..Default::default() },
        ArcLength { first_step: f64::NAN, ..Default::default() },
        ArcLength { control: Control::Displacement { measure: vec![], end: 1.0 }, ..Default::default() },
    ] {
        assert!(matches!(follow(&arc, &mut two_bars(0.3, 1.0), &mut u).0, Err(PathError::Options { .. })));
    }
    let arc = ArcLength { end: 1e6, most_steps: 3, ..Default::default() };
    assert!(matches!(follow(&arc, &mut two_bars(0.3, 1.0), &mut u).0, Err(PathError::Steps { steps: 3, .. })));
}

#[test]
fn indefinite_factors_tell_inertia_and_solve() {
    let truss = &mut lattice(10, 4, 1.0);
    let n = truss.load.len();
    let u = vec![0.0; n];
    let mut matrix = BlockMatrix::new(truss.pattern().unwrap());
    truss.tangent(0.0, &u, &mut matrix).unwrap();
    let mut cholesky = SparseCholesky::analyze(matrix.pattern().clone(), &truss.positions, &truss.fixed, 1).unwrap();
    assert_eq!(cholesky.factor_indefinite(&matrix, None).unwrap(), 0);
    // shifted by −σ the number of negative pivots is that of eigenvalues below σ
    let free = cholesky.free_dofs();
    let mut last = 0;
    for shift in [0.01, 0.3, 1.0, 3.1, 20.0] {
        let addition = vec![-shift; n];
        let negative = cholesky.factor_indefinite(&matrix, Some(&addition)).unwrap();
        assert!(negative >= last);
        last = negative;
        let (mut b, mut x, mut y) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        vector::fill_seeded(&mut b, 3);
        vector::clear_fixed(&mut b, &truss.fixed);
        let report = cholesky.solve(&b, &mut x).unwrap();

        matrix.product(&x, &mut y);
        vector::add_scaled(&mut y, -shift, &x);
        vector::clear_fixed(&mut y, &truss.fixed);
        let error = y.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(error < 1e-10 && report.residual < 1e-10, "{shift}: {error:.1e} {report:?}");
    }
    assert_eq!(last, free, "all eigenvalues lie below 20");
    // and back to the positive definite one
    cholesky.factor(&matrix, None).unwrap();
}
