//! What the tests share: bodies of unit length and stiffness, and ways to solve them.
#![allow(dead_code)]

use solvers::load_steps::LoadSteps;
use solvers::newton::{Newton, NewtonOptions};
use solvers::observe::StepReport;
use solvers::sparse::BlockMatrix;
use std::ops::ControlFlow;
use thin::angle::{Kinematics, Potential};
use thin::beam::Beam;
use thin::body::Thin;
use thin::layout::{Mirror, Parity};
use thin::linear;
use thin::loads::{Action, Condition};
use thin::pairs::Law;
use thin::plate::{IsotropicWeight, Limit, Plate};
use thin::section::ArmTable;
use thin::structure::{Brittle, PointData, ThinStructure};
use thin::weights::Influence;

pub const ELASTIC: Law = Law::Elastic(Potential::Square);

/// `n` points on [0, 1].
pub fn line(n: usize) -> Vec<[f64; 3]> {
    (0..n).map(|k| [k as f64 / (n - 1) as f64, 0.0, 0.0]).collect()
}

/// `n × n` points on the unit square.
pub fn square(n: usize) -> Vec<[f64; 3]> {
    let at = |k: usize| k as f64 / (n - 1) as f64;
    (0..n * n).map(|k| [at(k % n), at(k / n), 0.0]).collect()
}

pub fn uniform(arms: usize) -> ArmTable {
    ArmTable { omega: vec![1.0; arms], limit: vec![1.0; arms] }
}

pub fn mirror(axis: usize, at: f64, parity: Parity) -> Mirror {
    let mut normal = [0.0; 3];
    normal[axis] = 1.0;
    Mirror { normal, at, parity }
}

pub fn beam_of<'a>(arms: &'a ArmTable) -> Beam<'a> {
    Beam { bending: &[1.0], axial: None, arms, limit_curvature: None, law: ELASTIC, kinematics: Kinematics::Small, measure: None }
}

pub fn plate_of<'a>(horizon: f64, poisson: f64, correction: bool) -> Plate<'a> {
    Plate {
        horizon,
        rigidity: &[1.0],
        poisson: Box::leak(Box::new([poisson])),
        membrane: None,
        influence: &[Influence::Constant],
        correction,
        isotropic: IsotropicWeight::Energy,
        limit: Limit::None,
        law: ELASTIC,
        kinematics: Kinematics::Small,
        tension: None,
        measure: None,
    }
}

/// A load per length or area on all points.
pub fn pressure<const D: usize>(
    body: &Thin<D>,
    component: usize,
    value: impl Fn([f64; 3], f64) -> f64 + Send + Sync + 'static,
) -> Condition {
    let points = (0..body.points() as u32).collect();
    Condition::new("pressure", Action::Force { weights: body.measure().to_vec() }, points, component, value)
}

pub fn where_points(positions: &[[f64; 3]], inside: impl Fn(&[f64; 3]) -> bool) -> Vec<u32> {
    (0..positions.len() as u32).filter(|&p| inside(&positions[p as usize])).collect()
}

pub fn structure<const D: usize>(body: Thin<D>, conditions: Vec<Condition>) -> ThinStructure<D> {
    ThinStructure::new(body, PointData::default(), conditions, None, 1.0).unwrap()
}

pub fn brittle_structure(body: Thin<1>, conditions: Vec<Condition>, batch: f64) -> ThinStructure<1> {
    ThinStructure::new(body, PointData::default(), conditions, Some(Brittle { batch }), 1.0).unwrap()
}

/// Displacements of the points at load 1, by the refined linear solution.
pub fn solved(mut s: ThinStructure<1>) -> Vec<f64> {
    let solution = linear::solve(&mut s, 1.0, 2).unwrap();
    s.displacements(&solution.u)
}

/// Follows stations with Newton's method and hands every accepted state to `look`.
pub fn follow<const D: usize>(
    s: &mut ThinStructure<D>,
    stations: Vec<f64>,
    u: &mut [f64],
    mut look: impl FnMut(&mut ThinStructure<D>, &StepReport, &[f64]),
) {
    let mut newton = Newton::new(NewtonOptions { threads: 2, ..Default::default() });
    let mut observer = |report: &StepReport, s: &mut ThinStructure<D>, u: &[f64], _: &[f64]| {
        look(s, report, u);
        ControlFlow::Continue(())
    };
    LoadSteps::at(stations, 0.0).run(s, &mut newton, u, &mut observer, None).unwrap();
}

/// `value` agrees with `printed` to as many digits as are printed, give or take `units` of the last.
#[track_caller]
pub fn digits(what: &str, value: f64, printed: &str, units: f64) {
    let expected: f64 = printed.parse().unwrap();
    let decimals = printed.split('.').nth(1).map_or(0, str::len) as i32;
    let unit = 10f64.powi(-decimals);
    assert!((value - expected).abs() <= 0.51 * units * unit, "{what}: {value}, printed {printed}");
}

/// Seeded numbers, the largest of which is `size`.
pub fn seeded(n: usize, size: f64, seed: u64) -> Vec<f64> {
    let mut x = vec![0.0; n];
    solvers::vector::fill_seeded(&mut x, seed);
    let top = x.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    x.iter().map(|v| v * size / top).collect()
}

/// Force against energy, tangent against force, by differences of a body at a displacement: largest relative errors.
pub fn differences<const D: usize>(body: &mut Thin<D>, u: &[f64]) -> (f64, f64) {
    let n = u.len();
    let direction = seeded(n, 1.0, 99);
    let step = 1e-5 * u.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    let moved = |s: f64| u.iter().zip(&direction).map(|(u, d)| u + s * step * d).collect::<Vec<f64>>();
    let mut f = vec![0.0; n];
    body.force(u, &mut f);
    let slope: f64 = f.iter().zip(&direction).map(|(f, d)| f * d).sum();
    let (a, b) = (body.energy(&moved(1.0)), body.energy(&moved(-1.0)));
    let force_error = ((b - a) / (2.0 * step) - slope).abs() / slope.abs().max(1e-300);
    let (mut fa, mut fb) = (vec![0.0; n], vec![0.0; n]);
    body.force(&moved(1.0), &mut fa);
    body.force(&moved(-1.0), &mut fb);
    let mut matrix = BlockMatrix::new(body.pattern().unwrap());
    body.tangent(u, &mut matrix).unwrap();
    let mut product = vec![0.0; n];
    matrix.product(&direction, &mut product);
    let scale = product.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    let tangent_error = (0..n).map(|k| ((fb[k] - fa[k]) / (2.0 * step) - product[k]).abs()).fold(0.0, f64::max) / scale;
    (force_error, tangent_error)
}
