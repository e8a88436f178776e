//! Supports in any direction: a body turned in space, with its supports, does what the body along the axes does.

mod common;

use bodies::body::{Body, Geometry};
use bodies::chunk::Link;
use bodies::loads::{Condition, Field, Kind};
use bodies::neighbors::neighbors;
use bodies::structure::{Parts, Simulated, Structure};
use catalog::{Catalog, Compiled};
use common::{CONTROLLED, correspondence, everywhere, linear_solid, saint_venant};
use physics::elasticity::{Isotropic, Section, Stiffness};
use solvers::load_steps::Equilibrium;
use solvers::newton::{LinearSolver, Newton, NewtonOptions};
use solvers::observe::StepReport;
use solvers::problem::{Dynamics, Statics};
use solvers::velocity_verlet::{Motion, VelocityVerlet, stable_step};
use std::ops::ControlFlow;

const ELASTIC: Isotropic = Isotropic { young: 3.0, poisson: 0.3 };
type Rotation = [[f64; 3]; 3];
const NONE: Rotation = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// About the unit vector along (1, 2, 3), or about z.
fn rotation(angle: f64, d: usize) -> Rotation {
    let (s, c) = angle.sin_cos();
    if d == 2 {
        return [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]];
    }
    let [x, y, z] = [1.0, 2.0, 3.0].map(|a: f64| a / 14f64.sqrt());
    let t = 1.0 - c;
    [
        [c + t * x * x, t * x * y - s * z, t * x * z + s * y],
        [t * x * y + s * z, c + t * y * y, t * y * z - s * x],
        [t * x * z - s * y, t * y * z + s * x, c + t * z * z],
    ]
}

fn turned(r: &Rotation, x: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| (0..3).map(|k| r[i][k] * x[k]).sum())
}

/// A block of points, turned, with a roller on each of its low faces; its high face along x is moved along x by 0.02 (statics) or at a speed of
/// 0.02. `along_axes`: the same prescribed by components.
fn block<const D: usize>(r: &Rotation, along_axes: bool, kind: fn() -> Kind, finite: bool) -> Box<dyn Simulated>
where
    Catalog: Compiled<D>,
{
    let sides = [7, 5, if D == 3 { 4 } else { 1 }];
    let place = |p: usize| [p % sides[0], p / sides[0] % sides[1], p / (sides[0] * sides[1])];
    let n = sides[0] * sides[1] * sides[2];
    let position: Vec<[f64; 3]> = (0..n).map(|p| turned(r, place(p).map(|q| q as f64))).collect();
    let (ones, horizon) = (vec![1.0; n], vec![2.3; n]);
    let found = neighbors(&position, D, &horizon).unwrap();
    let g = Geometry { position: &position, volume: &ones, horizon: &horizon };
    let mut body = Body::<D>::new(&g, false, 0, |p, out: &mut Vec<Link>| {
        out.extend(found.of(p).iter().map(|&q| Link { point: q, flips: 0, end: position[q as usize], weight: 1.0, sets: 0 }));
    });
    let section = if D == 3 { Section::Solid } else { Section::PlaneStrain { thickness: 1.0 } };
    let points: Vec<u32> = (0..n as u32).collect();
    let elastic = Stiffness::isotropic(ELASTIC, 0.0, section);
    let model = if finite { correspondence(saint_venant(elastic), CONTROLLED) } else { linear_solid(ELASTIC, section) };
    let part = everywhere(model, &body);
    body.assign(vec![part]).unwrap();
    let condition = |name: &str, axis: usize, last: bool, value: f64| {
        let points = (0..n).filter(|&p| place(p)[axis] == if last { sides[axis] - 1 } else { 0 }).map(|p| p as u32).collect();
        let f: Field = Box::new(move |_, t| value * if value == 0.02 { t } else { 1.0 });
        let kind = kind();
        let f: Field = if matches!(kind, Kind::Velocity) { Box::new(move |_, _| value) } else { f };
        let mut components = [None, None, None];
        components[if along_axes { axis } else { 0 }] = Some(f);
        let unit: [f64; 3] = std::array::from_fn(|k| f64::from(u8::from(k == axis)));
        Condition { name: name.into(), kind, points, components, along: (!along_axes).then(|| turned(r, unit)) }
    };
    let mut conditions: Vec<Condition> = (0..D).map(|k| condition(["x", "y", "z"][k], k, false, 0.0)).collect();
    conditions.push(condition("pull", 0, true, 0.02));
    let parts = Parts { id: (0..n as u64).collect(), user: points, material: vec![0; n], density: ones };
    let structure = Structure::new(body, parts, conditions, None, vec![], 1.0);
    assert_eq!(structure.is_inclined(), !along_axes);
    Catalog::simulated(structure)
}

/// What a turned body did, turned back: displacements, reaction of the pull, energy and work.
fn measured<const D: usize>(s: &mut dyn Simulated, r: &Rotation, u: &[f64], v: &[f64]) -> Vec<f64> {
    let back: Rotation = std::array::from_fn(|i| std::array::from_fn(|k| r[k][i]));
    let space = s.field(bodies::measures::FieldName::Displacement, 1.0, u, v);
    let mut out: Vec<f64> = space.chunks(3).flat_map(|u| turned(&back, [u[0], u[1], u[2]])).collect();
    for condition in 0..=D {
        out.extend(turned(&back, s.resultant(condition, 1.0, u, None)));
    }
    let b = s.balance(1.0, u, v);
    out.extend([b.strain, b.kinetic, b.external_work]);
    out
}

fn assert_same(what: &str, want: &[f64], got: &[f64], bound: f64) {
    let scale = want.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    let worst = want.iter().zip(got).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / scale;
    println!("{what}: {worst:.1e}");
    assert!(want.len() == got.len() && worst < bound, "{what}: {worst:e}");
}

fn equilibrium<const D: usize>(r: &Rotation, along_axes: bool, solver: LinearSolver, finite: bool) -> Vec<f64>
where
    Catalog: Compiled<D>,
{
    let mut s = block::<D>(r, along_axes, || Kind::Displacement, finite);
    s.set_statics(true);
    let mut u = vec![0.0; Statics::dofs(&*s)];
    let mut newton = Newton::new(NewtonOptions { linear: !finite, solver, tolerance: 1e-12, threads: 1, ..NewtonOptions::default() });
    s.checkpoint();
    newton.equilibrate(&mut *s, 1.0, &mut u, None).unwrap();
    Statics::accept(&mut *s, 1.0, &u).unwrap();
    let rest = vec![0.0; u.len()];
    measured::<D>(&mut *s, r, &u, &rest)
}

fn statics<const D: usize>(finite: bool, bound: f64)
where
    Catalog: Compiled<D>,
{
    let want = equilibrium::<D>(&NONE, true, LinearSolver::Direct, finite);
    let same = |r: &Rotation, solver| equilibrium::<D>(r, false, solver, finite);
    let r = rotation(0.7, D);
    assert_same("directions along the axes, Cholesky", &want, &same(&NONE, LinearSolver::Direct), bound);
    assert_same("turned, Cholesky", &want, &same(&r, LinearSolver::Direct), bound);
    assert_same("turned, conjugate gradients", &want, &same(&r, LinearSolver::ConjugateGradients), 1e-9);
}

#[test]
fn a_turned_patch_on_rollers_in_equilibrium_is_the_patch_along_the_axes() {
    statics::<2>(false, 1e-12);
    statics::<3>(false, 1e-12);
    statics::<2>(true, 1e-11);
    statics::<3>(true, 1e-11);
}

fn moved<const D: usize>(r: &Rotation, along_axes: bool, kind: fn() -> Kind) -> Vec<f64>
where
    Catalog: Compiled<D>,
{
    let mut s = block::<D>(r, along_axes, kind, true);
    s.set_statics(false);
    let n = Dynamics::dofs(&*s);
    let mut motion = Motion::at_rest(n, 0.0);
    let step = stable_step(&mut *s, 0.0, &motion.u, 0.9).unwrap().time_step;
    assert!((0.1..0.6).contains(&step), "{step}");
    let verlet = VelocityVerlet { time_step: 0.1, end: 6.0, observe_every: 1, following: None };
    let mut observer = |_: &StepReport, _: &mut (dyn Simulated + 'static), _: &[f64], _: &[f64]| ControlFlow::Continue(());
    verlet.run(&mut *s, &mut motion, &mut observer, None).unwrap();
    measured::<D>(&mut *s, r, &motion.u, &motion.v)
}

#[test]
fn a_turned_patch_on_rollers_in_motion_is_the_patch_along_the_axes() {
    for kind in [|| Kind::Displacement, || Kind::Velocity] as [fn() -> Kind; 2] {
        let r2 = rotation(0.7, 2);
        assert_same("plane", &moved::<2>(&NONE, true, kind), &moved::<2>(&r2, false, kind), 1e-11);
        let r3 = rotation(0.7, 3);
        assert_same("space", &moved::<3>(&NONE, true, kind), &moved::<3>(&r3, false, kind), 1e-11);
    }
}

#[test]
fn directions_at_any_angle_make_one_displacement() {
    // a triangle of points each of which is held along (1, 1) and along x: what is left is u_y = sqrt(2) g - u_x
    let position = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let (ones, horizon) = (vec![1.0; 3], vec![1.5; 3]);
    let g = Geometry { position: &position, volume: &ones, horizon: &horizon };
    let mut body = Body::<2>::new(&g, false, 0, |p, out: &mut Vec<Link>| {
        out.extend((0..3).filter(|&q| q != p).map(|q| Link { point: q as u32, flips: 0, end: position[q], weight: 1.0, sets: 0 }));
    });
    let part = everywhere(linear_solid(ELASTIC, Section::PlaneStrain { thickness: 1.0 }), &body);
    body.assign(vec![part]).unwrap();
    let condition = |along: Option<[f64; 3]>, points: Vec<u32>, value: fn([f64; 3]) -> f64| Condition {
        name: "held".into(),
        kind: Kind::Displacement,
        points,
        components: [Some(Box::new(move |x, _| value(x))), None, None],
        along,
    };
    let slope = 0.5f64.sqrt();
    let conditions =
        vec![condition(Some([slope, slope, 0.0]), vec![0, 1, 2], |x| 0.01 * x[0]), condition(None, vec![0, 1, 2], |x| 0.02 * x[1])];
    let parts = Parts { id: vec![0, 1, 2], user: vec![0, 1, 2], material: vec![0; 3], density: ones };
    let mut s = Catalog::simulated(Structure::new(body, parts, conditions, None, vec![], 1.0));
    s.set_statics(true);
    assert!(Statics::fixed(&*s).iter().all(|f| *f));
    let mut u = vec![0.0; 6];
    s.prescribe(1.0, &mut u);
    let space = s.field(bodies::measures::FieldName::Displacement, 1.0, &u, &[0.0; 6]);
    for (x, u) in position.iter().zip(space.chunks(3)) {
        let want = [0.02 * x[1], 2f64.sqrt() * 0.01 * x[0] - 0.02 * x[1]];
        assert!((u[0] - want[0]).abs() < 1e-16 && (u[1] - want[1]).abs() < 1e-16, "{u:?} {want:?}");
    }
    // each reaction lies along its direction, and together they balance (no other force acts)
    let (first, second) = (s.resultant(0, 1.0, &u, None), s.resultant(1, 1.0, &u, None));
    let scale = first[0].abs() + second[0].abs() + 1e-30;
    assert!((first[0] - first[1]).abs() < 1e-12 && second[1] == 0.0, "{first:?} {second:?}");
    assert!((first[0] + second[0]).abs() < 1e-12 * scale.max(1e-3) && first[1].abs() < 1e-12, "{first:?} {second:?}");
}
