//! Joined structures: ties where parts touch, several laws and materials, cracks that grow, pressures that follow.

mod common;

use common::*;
use std::f64::consts::PI;
use thin::body::Thin;
use thin::generate;
use thin::joint::{along_line, resolved, touching};
use thin::loads::{Condition, Follow};
use thin::pairs::Law;
use thin::plate::Limit;
use thin::shell::{Horizon, Report, Shell};
use thin::structure::{Brittle, PointData, ThinStructure};

/// Right-handed axes of a panel that stands on the x axis.
const UPRIGHT: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]];

#[test]
fn parts_follow_where_they_touch() {
    let skin = generate::panel([1.0, 1.0], [10, 10]).unwrap();
    // a rib along the middle row, in the same places
    let rib = generate::panel([1.0, 0.4], [10, 4]).unwrap().moved([0.0, 0.5, 0.0], UPRIGHT).unwrap();
    let ties = touching(&skin, 0, &rib, 121);
    assert_eq!(ties.len(), 11);
    for (p, list) in &ties {
        assert_eq!(list.len(), 1);
        assert_eq!(rib.positions[*p as usize - 121], skin.positions[list[0].0 as usize]);
    }
    // one between rows of the skin, with other spacings: weights that put each point where it is
    let rib = generate::panel([0.9, 0.4], [7, 4]).unwrap().moved([0.05, 0.52, 0.0], UPRIGHT).unwrap();
    let ties = touching(&skin, 0, &rib, 121);
    assert_eq!(ties.len(), 8);
    for (p, list) in &ties {
        let x = &rib.positions[*p as usize - 121];
        assert!((list.iter().map(|l| l.1).sum::<f64>() - 1.0).abs() < 1e-12);
        for k in 0..3 {
            let put: f64 = list.iter().map(|(q, w)| w * skin.positions[*q as usize][k]).sum();
            assert!((put - x[k]).abs() < 1e-12);
        }
    }
    // above the skin, or beside it: nothing
    assert!(touching(&skin, 0, &rib.moved([0.0, 0.0, 0.01], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]).unwrap(), 121).is_empty());
    assert!(touching(&skin, 0, &rib.moved([0.0, 0.6, 0.0], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]).unwrap(), 121).is_empty());
}

#[test]
fn chains_of_followers_are_resolved() {
    // 2 follows 1, 1 follows 0 and later 3 follows 2; a pair that follows each other is one tie
    let joints = vec![vec![(2, vec![(1, 1.0)])], vec![(1, vec![(0, 1.0)])], vec![(3, vec![(2, 1.0)]), (0, vec![(1, 1.0)])]];
    assert_eq!(resolved(joints), vec![(1, vec![(0, 1.0)]), (2, vec![(0, 1.0)]), (3, vec![(0, 1.0)])]);
    let halves = vec![vec![(2, vec![(1, 0.5), (4, 0.5)])], vec![(1, vec![(4, 1.0)])]];
    assert_eq!(resolved(halves), vec![(1, vec![(4, 1.0)]), (2, vec![(4, 1.0)])]);
}

#[test]
fn lines_are_walked_in_order() {
    let positions: Vec<[f64; 3]> = [3.0, 0.0, 2.0, 1.0].iter().map(|x| [*x, 0.0, 0.0]).collect();
    let line = along_line(&positions, &[0, 1, 2, 3]);
    let total: f64 = line.iter().map(|l| l.1).sum();
    assert!((total - 3.0).abs() < 1e-15 && line[0].1 == 0.5 && line[1].1 == 1.0);
    let ring = generate::ring(1.0, [0.0, 2.0 * PI], 24).unwrap();
    let line = along_line(&ring.positions, &(0..24).collect::<Vec<_>>());
    let side = 2.0 * (PI / 24.0).sin();
    assert!(line.iter().all(|l| (l.1 / side - 1.0).abs() < 1e-12));
}

#[test]
fn parts_of_different_laws_are_joined() {
    let panel = generate::panel([1.0, 1.0], [10, 10]).unwrap();
    let upright = panel.moved([1.0, 0.0, 0.0], [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]).unwrap();
    let elastic = Shell::new(Horizon::Ratio(2.0), &[1.0], &[1e4], 0.3);
    let yields = Shell { limit: Limit::Layers(&[0.05]), law: Law::ElasticPlastic, ..Shell::new(Horizon::Ratio(2.0), &[2.0], &[2e4], 0.1) };
    let one: Thin<3> = elastic.build(&panel, &[]).unwrap().0;
    let two: Thin<3> = yields.build(&upright, &[]).unwrap().0;
    let pairs = one.pair_count();
    // each part bent by itself, as if it were alone
    let bend = |x: &[f64; 3]| [0.0, 0.0, 0.1 * x[0] * x[0]];
    let u: Vec<f64> =
        panel.positions.iter().flat_map(bend).chain(upright.positions.iter().flat_map(|x| [-0.1 * x[2] * x[2], 0.0, 0.0])).collect();
    let n = 3 * panel.len();
    let alone = |mut body: Thin<3>, u: &[f64]| {
        body.commit(u);
        (body.energy(u), body.plastic_angles().to_vec())
    };
    let ((e1, p1), (e2, p2)) = (alone(one, &u[..n]), alone(two, &u[n..]));
    assert!(p1.is_empty() && p2.iter().any(|p| *p != 0.0));
    let rebuilt = [elastic.build::<3>(&panel, &[]).unwrap().0, yields.build::<3>(&upright, &[]).unwrap().0];
    let mut whole = Thin::join(rebuilt.into()).unwrap();
    whole.commit(&u);
    assert_eq!(whole.law_of(0), elastic.law);
    assert_eq!(whole.law_of(panel.len()), Law::ElasticPlastic);
    assert!(whole.plastic_angles()[..pairs].iter().all(|p| *p == 0.0) && whole.plastic_angles()[pairs..] == p2[..]);
    assert!((whole.energy(&u) / (e1 + e2) - 1.0).abs() < 1e-12);
}

#[test]
fn materials_of_a_surface_differ_by_point() {
    // Poisson's ratio of its own on each half: uniform curvature has the energy of each where no family sees both
    let panel = generate::panel([1.0, 1.0], [20, 20]).unwrap();
    let left = |x: &[f64; 3]| x[0] < 0.5;
    let nu: Vec<f64> = panel.positions.iter().map(|x| if left(x) { 0.1 } else { 0.4 }).collect();
    let d: Vec<f64> = panel.positions.iter().map(|x| if left(x) { 1.0 } else { 3.0 }).collect();
    let shell = Shell { membrane: None, ..Shell::new(Horizon::Ratio(2.0), &d, &[1.0], nu.as_slice()) };
    let (body, report): (Thin<1>, Report) = shell.build(&panel, &[]).unwrap();
    let u: Vec<f64> = panel.positions.iter().map(|x| 0.5 * x[0] * x[0] - 0.2 * x[1] * x[1] + 0.3 * x[0] * x[1]).collect();
    let (a, b, c) = (1.0, -0.4, 0.3);
    for (p, e) in body.family_energies(&u).iter().enumerate().filter(|(p, _)| report.corrected[*p]) {
        let exact = 0.5 * d[p] * (a * a + b * b + 2.0 * nu[p] * a * b + 2.0 * (1.0 - nu[p]) * c * c) * panel.measure[p];
        assert!((e / exact - 1.0).abs() < 1e-11, "{p}: {e} {exact}");
    }
    let wrong = Shell::new(Horizon::Ratio(2.0), &[1.0], &[1.0], &nu[1..]).build::<3>(&panel, &[]).map(|b| b.1);
    assert!(matches!(wrong, Err(thin::ThinError::Length { .. })));
}

#[test]
fn opposite_bonds_break_together() {
    // a strip pulled until the weaker points of one column let go; their neighbours' bonds to them go too
    let panel = generate::panel([1.0, 0.5], [20, 10]).unwrap();
    let critical: Vec<f64> = panel.positions.iter().map(|x| if (x[0] - 0.5).abs() < 0.01 { 0.01 } else { 1.0 }).collect();
    let shell = Shell { critical_stretch: Some(&critical), ..Shell::new(Horizon::Ratio(2.0), &[1e-4], &[1.0], 0.2) };
    let (body, _): (Thin<3>, Report) = shell.build(&panel, &[]).unwrap();
    let mut s = ThinStructure::new(body, PointData::default(), vec![], Some(Brittle { batch: 0.0 }), 1.0).unwrap();
    let u: Vec<f64> = panel.positions.iter().flat_map(|x| [0.03 * x[0], 0.0, 0.0]).collect();
    use solvers::problem::Statics;
    Statics::checkpoint(&mut s);
    let broken = Statics::break_bonds(&mut s, 1.0, &u).unwrap();
    assert!(broken > 0);
    // the force on both ends of every bond is that of one: nothing is left that only one side feels
    let mut f = vec![0.0; u.len()];
    s.body.force(&u, &mut f);
    for k in 0..3 {
        let sum: f64 = f.iter().skip(k).step_by(3).sum();
        assert!(sum.abs() < 1e-13 * f.iter().map(|x| x.abs()).sum::<f64>());
    }
    let health = s.body.health();
    for (p, x) in panel.positions.iter().enumerate() {
        let touched = (x[0] - 0.5).abs() < 0.11;
        assert_eq!(health[p] < 1.0, touched, "{x:?} {}", health[p]);
    }
}

#[test]
fn pressure_follows() {
    // a ring (whose normals point inwards) inflated by p per length: EA (r − R)/R = p r where the pressure follows, p R where it does not. Bending adds EI/R² to EA
    let (n, ea, p) = (120, 1.0, 0.2);
    let ring = generate::ring(1.0, [0.0, 0.5 * PI], n / 4).unwrap();
    let ei = 1e-4;
    for follow in [false, true] {
        let (body, _): (Thin<2>, Report) =
            Shell::new(Horizon::Ratio(2.0), &[ei], &[ea], 0.0).build(&ring, &[even(0, 0.0), even(1, 0.0)]).unwrap();
        let all: Vec<u32> = (0..ring.len() as u32).collect();
        let load = Condition::pressure("pressure", &ring, all, move |_, t| -p * t);
        let edges = (1..ring.len() as u32).map(|k| [k - 1, k]).collect();
        let load = if follow { load.following(Follow { faces: vec![], edges }) } else { load };
        let top = ring.len() as u32 - 1;
        let conditions = vec![load, Condition::hold("y", vec![0], &[1]), Condition::hold("x", vec![top], &[0])];
        let mut s = ThinStructure::new(body, PointData::default(), conditions, None, 1.0).unwrap();
        let mut u = vec![0.0; 2 * ring.len()];
        follow_path(&mut s, &mut u);
        let exact = if follow { 1.0 / (1.0 - p / ea) } else { 1.0 + p / ea };
        let r = 1.0 + u[0];
        println!("follows {follow}: radius {r:.6}, exact {exact:.6}; top {:.6}", 1.0 + u[2 * top as usize + 1]);
        assert!((r / exact - 1.0).abs() < 2e-3);
    }
}

fn follow_path(s: &mut ThinStructure<2>, u: &mut [f64]) {
    follow(s, vec![0.25, 0.5, 0.75, 1.0], u, |_, _, _| {});
}

fn even(axis: usize, at: f64) -> thin::layout::Mirror {
    mirror(axis, at, thin::layout::Parity::Even)
}
