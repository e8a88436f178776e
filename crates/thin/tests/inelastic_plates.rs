//! Plates that break and yield.

mod common;

use common::*;
use thin::body::Thin;
use thin::layout::{Layout, Parity};
use thin::linear;
use thin::loads::{Action, Condition};
use thin::pairs::Law;
use thin::plate::{Limit, Plate};
use thin::structure::ThinStructure;

/// Pressure at which a simply supported square plate collapses, as part of 24 M_p/a², M_p = 1.5 D (1 − ν²) κ_c; the loads on the way
/// up; residual over largest mean deflection.
fn collapse(n: usize, nu: f64, far: f64) -> (f64, Vec<f64>, f64) {
    let positions = square(n);
    let h = 1.0 / (n - 1) as f64;
    let mirrors = [mirror(0, 0.0, Parity::Odd), mirror(0, 1.0, Parity::Odd), mirror(1, 0.0, Parity::Odd), mirror(1, 1.0, Parity::Odd)];
    let plate = Plate { limit: Limit::Layers(&[1.0]), law: Law::ElasticPlastic, ..plate_of(3.0 * h, nu, true) };
    let body: Thin<1> = plate.build(Layout::plane(&positions).unwrap().with_mirrors(&mirrors).unwrap()).unwrap();
    let inside = |x: &[f64; 3]| x[0] > 1e-9 && x[0] < 1.0 - 1e-9 && x[1] > 1e-9 && x[1] < 1.0 - 1e-9;
    let edge = where_points(&positions, |x| !inside(x));
    let within = where_points(&positions, inside);
    let count = within.len() as f64;
    // the mean deflection is prescribed: equal forces on all points, a uniform pressure
    let conditions = vec![
        Condition::hold("edges", edge, &[0]),
        Condition::new("mean", Action::Mean, within, 0, move |_, t| if t <= 1.0 { far * t } else { far * (2.0 - t) }),
    ];
    let mut s: ThinStructure<1> = structure(body, conditions);
    let mut u = vec![0.0; n * n];
    let mut loads = vec![];
    let stations = (1..=20).map(|k| f64::from(k) / 20.0).chain([1.02]).collect();
    follow(&mut s, stations, &mut u, |s, report, u| {
        loads.push(s.resultant_components(1, report.time, u)[0] / (count * h * h));
    });
    let plastic_moment = 1.5 * (1.0 - nu * nu);
    // unloading is elastic: from the last two stations to no load
    let (top, after) = (loads[19], loads[20]);
    let back = 0.02 * far * top / (top - after);
    loads.truncate(20);
    (top / (24.0 * plastic_moment), loads, (far - back) / far)
}

#[test]
fn plastic_plate_collapses_and_comes_back_elastically() {
    let nu = 1.0 / 3.0;
    let (ratio, loads, residual) = collapse(21, nu, 0.4);
    println!("ν={nu:.3}: collapse at {ratio:.4} of 24 Mp/a², residual part {residual:.4}; loads {loads:.3?}");
    // a plateau
    assert!((loads[19] / loads[18] - 1.0).abs() < 0.004, "{loads:?}");
    assert!(residual > 0.7 && residual < 1.0, "{residual}");
    // pairs are stronger than the square criterion where both curvatures have one sign (at most 2/(1 + ν) = 1.5 times), and weaker in
    // twist (4/(π (1 + ν)) = 0.95 times)
    assert!((1.38..1.41).contains(&ratio), "{ratio}");
}

/// The double torsion specimen: what is there at multiples of the displacement of the first break.
fn double_torsion(notch: f64, multiples: &[f64]) -> Vec<(f64, usize, usize, f64)> {
    let (nx, ny) = (61usize, 32usize);
    let positions: Vec<[f64; 3]> = (0..nx * ny).map(|k| [(k % nx) as f64, (k / nx) as f64, 0.0]).collect();
    let plate = Plate { limit: Limit::Angle(&[1.0]), ..plate_of(3.0, 1.0 / 3.0, false) };
    let mut body: Thin<1> = plate.build(Layout::plane(&positions).unwrap()).unwrap();
    body.cut(|a, b| {
        let (below, above) = (a[1] - 15.5, b[1] - 15.5);
        below * above < 0.0 && a[0] + (b[0] - a[0]) * below / (below - above) < notch
    });
    let cut = body.intact().iter().filter(|i| !**i).count();
    let mouth = vec![15 * nx as u32, 16 * nx as u32];
    let long = where_points(&positions, |x| x[1] == 0.0 || x[1] == 31.0);
    let conditions = || {
        vec![Condition::hold("long edges", long.clone(), &[0]), Condition::new("mouth", Action::Displacement, mouth.clone(), 0, |_, t| t)]
    };
    let mut s = brittle_structure(body, conditions(), 0.8);
    let solution = linear::solve(&mut s, 1.0, 2).unwrap();
    let first = 1.0 / s.body.most_loaded(&solution.u).unwrap().1;
    println!("first break at {first:.6} times the limit angle");
    let mut u = vec![0.0; nx * ny];
    let mut seen = vec![];
    follow(&mut s, multiples.iter().map(|m| m * first).collect(), &mut u, |s, report, u| {
        let health = s.body.health();
        let tip = (0..nx).filter(|&x| health[15 * nx + x] < 0.6).max().unwrap();
        let broken = s.body.intact().iter().filter(|i| !**i).count() - cut;
        seen.push((report.time / first, tip, broken, s.resultant_components(1, report.time, u)[0] / first));
    });
    seen
}

#[test]
fn double_torsion_is_stable() {
    let seen = double_torsion(10.0, &[0.999, 1.5, 2.0, 2.5, 3.0]);
    println!("(Δ/Δ_first, tip, broken, load/Δ_first): {seen:?}");
    let printed = [9, 10, 14, 19, 24];
    for (s, tip) in seen.iter().zip(printed) {
        assert!(s.1.abs_diff(tip) <= 1, "{seen:?}");
    }
    // linear in the displacement within 15 %: about ten spacings per displacement of the first break
    let rate = |a: usize, b: usize| (seen[b].1 - seen[a].1) as f64 / (seen[b].0 - seen[a].0);
    let all = rate(1, 4);
    assert!((8.0..12.0).contains(&all), "{all}");
    for k in 2..4 {
        let on_line = seen[1].1 as f64 + all * (seen[k].0 - seen[1].0);
        assert!((seen[k].1 as f64 - on_line).abs() < 0.15 * on_line, "{seen:?}");
    }
    // a plateau of the load
    assert!(seen[4].3 / seen[3].3 < 1.06, "{seen:?}");
}
