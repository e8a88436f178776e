//! Exact angles: pair energies against jets, momenta, tangents, buckling, the elastica.

mod common;

use common::*;
use physics::scalar::{Jet, Scalar};
use solvers::direct::SparseCholesky;
use solvers::observe::StepReport;
use solvers::sparse::BlockMatrix;
use std::f64::consts::PI;
use thin::angle::{self, Kinematics, Potential};
use thin::beam::Beam;
use thin::body::Thin;
use thin::buckling::{buckling_loads, stiffness_and_its_change, vibration_modes};
use thin::layout::{Layout, Parity};
use thin::loads::{Action, Condition};
use thin::plate::Plate;
use thin::structure::ThinStructure;

fn jets<const N: usize>(x: &[f64], first: usize) -> Vec<Jet<N>> {
    x.iter()
        .enumerate()
        .map(|(k, v)| {
            let mut j = Jet::<N>::of(*v);
            j.slope[first + k] = 1.0;
            j
        })
        .collect()
}

#[test]
fn one_pair_regression() {
    // p and q as displacements from a straight pair along x
    let (p, q) = ([0.9, 0.1, 0.2], [-1.1, 0.25, 0.05]);
    let arm = [1.0, 0.0, 0.0];
    let dp = [p[0] - 1.0, p[1], p[2]];
    let dq = [q[0] + 1.0, q[1], q[2]];
    let w = angle::spatial_energy(Potential::Cosine, &arm, &dp, &dq);
    digits("w", w, "0.08799114811", 1.0);
    let (g, _) = angle::spatial_gradient(Potential::Cosine, &arm, &dp, &dq);
    for (value, printed) in g.iter().zip(["-0.09605353183", "0.3447933137", "0.2598442364"]) {
        digits("dw/dp", *value, printed, 1.0);
    }
}

#[test]
fn gradients_are_those_of_the_energy() {
    let arm = [0.7, -0.2, 0.4];
    let length = arm.iter().map(|x| x * x).sum::<f64>().sqrt();
    for size in [1e-6, 1e-2, 0.3, 0.9] {
        for seed in 0..20 {
            let d = seeded(6, size * length, seed);
            let (p, m) = ([d[0], d[1], d[2]], [d[3], d[4], d[5]]);
            for potential in [Potential::Square, Potential::Cosine] {
                let j: Vec<Jet<6>> = jets(&d, 0);
                let energy = angle::spatial_energy(potential, &arm, &[j[0], j[1], j[2]], &[j[3], j[4], j[5]]);
                let (gp, gm) = angle::spatial_gradient(potential, &arm, &p, &m);
                let scale = gp.iter().chain(&gm).fold(0.0f64, |s, x| s.max(x.abs()));
                for (k, g) in gp.iter().chain(&gm).enumerate() {
                    assert!((energy.slope[k] - g).abs() < 1e-12 * scale.max(1e-300), "{size} {potential:?}: {} {g}", energy.slope[k]);
                }
            }
            let j: Vec<Jet<4>> = jets(&d[..4], 0);
            let (phi, _, _) = angle::planar([arm[0], arm[1]], [j[0], j[1]], [j[2], j[3]]);
            let (value, gp, gm) = angle::planar([arm[0], arm[1]], [d[0], d[1]], [d[2], d[3]]);
            assert_eq!(phi.value, value);
            for (k, g) in gp.iter().chain(&gm).enumerate() {
                let scale = gp.iter().chain(&gm).fold(0.0f64, |s, x| s.max(x.abs()));
                assert!((phi.slope[k] - g).abs() < 1e-12 * scale, "{size}: {} {g}", phi.slope[k]);
            }
        }
    }
}

fn check<const D: usize>(what: &str, mut body: Thin<D>, size: f64) {
    let u = seeded(body.points() * D, size, 7);
    let (force, tangent) = differences(&mut body, &u);
    println!("{what}: force {force:.1e}, tangent {tangent:.1e}");
    assert!(force < 1e-7 && tangent < 1e-7, "{what}: {force:.1e} {tangent:.1e}");
}

#[test]
fn forces_and_tangents_of_bodies() {
    let arms = uniform(3);
    let n = 13;
    let mirrors = [mirror(0, 0.0, Parity::Even), mirror(0, 1.0, Parity::Odd)];
    let layout = || Layout::line(&line(n)).unwrap().with_mirrors(&mirrors).unwrap();
    let dx = 1.0 / 12.0;
    let beam = Beam { axial: Some(&[50.0]), ..beam_of(&arms) };
    check::<1>("transverse, small", beam.build(layout()).unwrap(), 0.2 * dx);
    check::<1>("transverse, exact", Beam { kinematics: Kinematics::Exact, ..beam_of(&arms) }.build(layout()).unwrap(), 0.3 * dx);
    check::<2>("planar", beam.build(layout()).unwrap(), 0.1 * dx);
    check::<3>("spatial", beam.build(layout()).unwrap(), 0.1 * dx);
    let cosine = Beam { axial: Some(&[50.0]), law: thin::pairs::Law::Elastic(Potential::Cosine), ..beam_of(&arms) };
    check::<2>("planar, cosine", cosine.build(layout()).unwrap(), 0.1 * dx);
    check::<3>("spatial, cosine", cosine.build(layout()).unwrap(), 0.1 * dx);
    let plastic = Beam { limit_curvature: Some(&[0.3]), law: thin::pairs::Law::NonlinearElastic, axial: Some(&[50.0]), ..beam_of(&arms) };
    check::<2>("planar, yielding", plastic.build(layout()).unwrap(), 0.1 * dx);
    let edges = [mirror(0, 0.0, Parity::Odd), mirror(1, 1.0, Parity::Even)];
    let plate = |nu| Plate { membrane: Some(&[50.0]), ..plate_of(3.0 / 8.0, nu, true) };
    let layout = || Layout::plane(&square(9)).unwrap().with_mirrors(&edges).unwrap();
    for nu in [-0.3, 1.0 / 3.0, 0.45] {
        check::<1>("plate", plate(nu).build(layout()).unwrap(), 0.02);
        check::<3>("plate in space", plate(nu).build(layout()).unwrap(), 0.01);
    }
    let yielding =
        Plate { limit: thin::plate::Limit::Layers(&[2.0]), law: thin::pairs::Law::NonlinearElastic, ..plate_of(3.0 / 8.0, 0.0, true) };
    check::<1>("yielding plate", yielding.build(layout()).unwrap(), 0.02);
    let tense = Plate { tension: Some(&[[3.0, -1.0, 0.5]]), ..plate(0.2) };
    check::<1>("plate under tension", tense.build(layout()).unwrap(), 0.02);
}

#[test]
fn momenta_balance() {
    let arms = uniform(3);
    let beam = Beam { axial: Some(&[50.0]), ..beam_of(&arms) };
    let (n, dx) = (13, 1.0 / 12.0);
    let mut body: Thin<2> = beam.build(Layout::line(&line(n)).unwrap()).unwrap();
    let u = seeded(2 * n, 0.3 * dx, 3);
    let mut f = vec![0.0; 2 * n];
    body.force(&u, &mut f);
    let scale: f64 = f.iter().map(|x| x.abs()).sum();
    let place = |p: usize| body.layout().positions[p][0] + u[2 * p];
    for k in 0..2 {
        assert!((0..n).map(|p| f[2 * p + k]).sum::<f64>().abs() < 1e-13 * scale);
    }
    let turn: f64 = (0..n).map(|p| place(p) * f[2 * p + 1] - u[2 * p + 1] * f[2 * p]).sum();
    assert!(turn.abs() < 1e-13 * scale, "{turn} of {scale}");
    // in space, with all terms but the isotropic one, which is a vector and keeps both momenta too
    for nu in [1.0 / 3.0, 0.1] {
        let plate = Plate { membrane: Some(&[50.0]), ..plate_of(3.0 / 8.0, nu, true) };
        let mut body: Thin<3> = plate.build(Layout::plane(&square(9)).unwrap()).unwrap();
        let n = 81;
        let u = seeded(3 * n, 0.03, 4);
        let mut f = vec![0.0; 3 * n];
        body.force(&u, &mut f);
        let scale: f64 = f.iter().map(|x| x.abs()).sum();
        let place = |p: usize| [0, 1, 2].map(|k| body.layout().positions[p][k] + u[3 * p + k]);
        for k in 0..3 {
            let (a, b) = ((k + 1) % 3, (k + 2) % 3);
            assert!((0..n).map(|p| f[3 * p + k]).sum::<f64>().abs() < 1e-12 * scale);
            let turn: f64 = (0..n).map(|p| place(p)[a] * f[3 * p + b] - place(p)[b] * f[3 * p + a]).sum();
            assert!(turn.abs() < 1e-12 * scale, "{nu}: {turn} of {scale}");
        }
    }
}

#[test]
fn rigid_motions_cost_nothing() {
    let arms = uniform(3);
    let beam = Beam { axial: Some(&[1e4]), ..beam_of(&arms) };
    let mut body: Thin<2> = beam.build(Layout::line(&line(13)).unwrap()).unwrap();
    let (c, s) = (0.8f64, 0.6f64);
    let u: Vec<f64> = line(13).iter().flat_map(|x| [(c - 1.0) * x[0] + 0.3, s * x[0] - 2.0]).collect();
    let mut f = vec![0.0; 26];
    body.force(&u, &mut f);
    assert!(body.energy(&u) < 1e-24 * 1e4 && f.iter().all(|x| x.abs() < 1e-9), "{f:?}");
}

/// A planar column: odd or even mirrors, its own conditions.
fn column(n: usize, count: usize, axial: f64, left: Parity, right: Option<Parity>) -> Thin<2> {
    let arms = uniform(count);
    let axial = [axial];
    let beam = Beam { axial: Some(&axial), ..beam_of(&arms) };
    let mut mirrors = vec![mirror(0, 0.0, left)];
    mirrors.extend(right.map(|r| mirror(0, 1.0, r)));
    beam.build(Layout::line(&line(n)).unwrap().with_mirrors(&mirrors).unwrap()).unwrap()
}

#[test]
fn euler_buckling() {
    let axial = 1e8;
    let load = |n: usize, count: usize, left: Parity, right: Option<Parity>| {
        let mut body = column(n, count, axial, left, right);
        let u: Vec<f64> = line(n).iter().flat_map(|x| [-x[0] / axial, 0.0]).collect();
        let (k, change) = stiffness_and_its_change(&mut body, &u).unwrap();
        let mut fixed = vec![false; 2 * n];
        (fixed[0], fixed[1]) = (true, true);
        fixed[2 * n - 1] = right.is_some();
        if right == Some(Parity::Even) {
            fixed[2 * n - 2] = true;
        }
        buckling_loads(&k, &change, &fixed, &[], 2, 1e-10, 1).unwrap().factors[0]
    };
    let odd = Some(Parity::Odd);
    for (n, printed) in [(21, "0.985735"), (41, "0.996410"), (81, "0.999101"), (161, "0.999775")] {
        let ratio = load(n, 3, Parity::Odd, odd) / (PI * PI);
        println!("pinned n={n}: {ratio:.7}");
        digits(&format!("pinned n={n}"), ratio, printed, 1.0);
    }
    let ratio = load(81, 3, Parity::Even, Some(Parity::Even)) / (4.0 * PI * PI);
    digits("clamped", ratio, "0.99641", 1.0);
    let ratio = load(81, 3, Parity::Even, None) / (0.25 * PI * PI);
    println!("cantilever {ratio:.7}");
    digits("cantilever", ratio, "0.999802", 1.0);
}

/// Lowest load at which the whole tangent about the compressed, straight column is singular, in units of Euler's.
fn full_tangent_load(n: usize, count: usize, axial: f64, mirrored: bool) -> f64 {
    let arms = uniform(count);
    let beam = Beam { axial: Some(&[axial]), ..beam_of(&arms) };
    let mirrors = [mirror(0, 0.0, Parity::Odd), mirror(0, 1.0, Parity::Odd)];
    let layout = Layout::line(&line(n)).unwrap().with_mirrors(if mirrored { &mirrors } else { &[] }).unwrap();
    let body: Thin<2> = beam.build(layout).unwrap();
    let tip = n as u32 - 1;
    let conditions = vec![
        Condition::hold("foot", vec![0], &[0, 1]),
        Condition::hold("head", vec![tip], &[1]),
        Condition::new("load", Action::Force { weights: vec![1.0] }, vec![tip], 0, |_, t| -t),
    ];
    let mut s = structure(body, conditions);
    let fixed = solvers::problem::Statics::fixed(&s).to_vec();
    let pattern = s.body.pattern().unwrap();
    let mut factor = SparseCholesky::analyze(pattern.clone(), &[], &fixed, 1).unwrap();
    let (mut low, mut high) = (0.9 * PI * PI, 1.1 * PI * PI);
    for _ in 0..40 {
        let p = 0.5 * (low + high);
        let mut u = vec![0.0; 2 * n];
        follow(&mut s, vec![p], &mut u, |_, _, _| {});
        let mut matrix = BlockMatrix::new(pattern.clone());
        s.body.tangent(&u, &mut matrix).unwrap();
        match factor.factor(&matrix, None) {
            Ok(()) => low = p,
            Err(_) => high = p,
        }
    }
    low / (PI * PI)
}

#[test]
fn buckling_of_the_full_tangent() {
    // Straight and compressed by ε the bending stiffness grows by 1/(1 − ε)² and the tension term by 1/(1 − ε), so with mirrors, where the
    // body is periodic, P = P_linear/(1 − ε), ε = P/EA. The numbers of the sheet, 0.98469 (n = 21) and 0.99405 (n = 31), are those of
    // families that end at the ends of the column, without mirrors (an independent calculation with dense matrices gives 0.984685 and
    // 0.994048 there, and 0.986696 and 0.994605 with mirrors); at N = 1 ends make no difference.
    let axial = 1e4;
    for (n, count, linear, truncated) in [(21, 1, 0.997947, "0.99893"), (21, 3, 0.985735, "0.98469"), (31, 3, 0.993623, "0.99405")] {
        let mirrored = full_tangent_load(n, count, axial, true);
        let expected = linear / (1.0 - mirrored * PI * PI / axial);
        let ended = full_tangent_load(n, count, axial, false);
        println!("n={n} N={count}: mirrored {mirrored:.6} (expected {expected:.6}), truncated {ended:.6}");
        assert!((mirrored - expected).abs() < 2e-5);
        digits("truncated", ended, truncated, 1.0);
    }
}

#[test]
fn the_change_of_the_tangent_is_its_derivative() {
    fn check<const D: usize>(what: &str, mut body: Thin<D>) {
        let along = seeded(body.points() * D, 1.0, 17);
        let pattern = body.pattern().unwrap();
        let at = |step: f64, body: &mut Thin<D>| {
            let mut matrix = BlockMatrix::new(pattern.clone());
            let u: Vec<f64> = along.iter().map(|x| step * x).collect();
            body.tangent(&u, &mut matrix).unwrap();
            matrix
        };
        let h = 1e-5 * body.layout().spacing[0];
        let (plus, minus) = (at(h, &mut body), at(-h, &mut body));
        let mut exact = BlockMatrix::new(pattern.clone());
        assert!(body.tangent_change(&along, &mut exact).unwrap());
        let scale = exact.values().iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let error = plus
            .values()
            .iter()
            .zip(minus.values())
            .zip(exact.values())
            .map(|((p, m), e)| ((p - m) / (2.0 * h) - e).abs())
            .fold(0.0f64, f64::max);
        println!("{what}: {:.1e}", error / scale);
        assert!(error < 1e-7 * scale, "{what}: {:.1e}", error / scale);
    }
    let arms = uniform(3);
    let mirrors = [mirror(0, 0.0, Parity::Even), mirror(0, 1.0, Parity::Odd)];
    let layout = || Layout::line(&line(13)).unwrap().with_mirrors(&mirrors).unwrap();
    for potential in [Potential::Square, Potential::Cosine] {
        let beam = Beam { axial: Some(&[50.0]), law: thin::pairs::Law::Elastic(potential), ..beam_of(&arms) };
        check::<2>("planar", beam.build(layout()).unwrap());
        check::<3>("spatial", beam.build(layout()).unwrap());
        for nu in [-0.3, 1.0 / 3.0, 0.45] {
            let law = thin::pairs::Law::Elastic(potential);
            let plate = Plate { membrane: Some(&[50.0]), law, ..plate_of(3.0 / 8.0, nu, true) };
            let edges = [mirror(0, 0.0, Parity::Odd), mirror(1, 1.0, Parity::Even)];
            check::<3>("plate", plate.build(Layout::plane(&square(9)).unwrap().with_mirrors(&edges).unwrap()).unwrap());
        }
    }
}

/// A shallow pinned arch, half a sine of the given rise, stress-free as it is; EI = 1, radius of gyration `r`.
fn arch(n: usize, rise: f64, r: f64) -> (Thin<2>, Vec<f64>) {
    let mut body = column(n, 3, 1.0 / (r * r), Parity::Odd, Some(Parity::Odd));
    let shape: Vec<f64> = line(n).iter().flat_map(|x| [0.0, rise * (PI * x[0]).sin()]).collect();
    body.relax_at(&shape).unwrap();
    (body, shape)
}

#[test]
fn a_bent_shape_without_stress() {
    let n = 21;
    let (mut body, shape) = arch(n, 0.05, 0.01);
    let mut f = vec![0.0; 2 * n];
    body.force(&shape, &mut f);
    assert!(body.energy(&shape) == 0.0 && f.iter().all(|x| *x == 0.0));
    // turned as a whole it stays so, but for the mirrors, which turn too
    let u: Vec<f64> = shape.iter().zip(seeded(2 * n, 0.005, 5)).map(|(s, d)| s + d).collect();
    let (force, tangent) = differences(&mut body, &u);
    assert!(force < 1e-7 && tangent < 1e-7, "{force:.1e} {tangent:.1e}");
    let arms = uniform(2);
    let spatial: Result<(), _> =
        Beam { axial: Some(&[1.0]), ..beam_of(&arms) }.build::<3>(Layout::line(&line(9)).unwrap()).unwrap().relax_at(&[0.0; 27]);
    assert!(spatial.is_err());
}

#[test]
fn snap_through_of_the_shallow_arch() {
    use solvers::arc_length::ArcLength;
    // q = p L⁴/(2 r π⁴ EI), λ = rise/(2 r): q = λ + √(4 (λ² − 1)³/27)
    let (n, r) = (81, 0.002);
    for lambda in [1.5, 1.9, 2.3f64] {
        let (body, mut u) = arch(n, 2.0 * r * lambda, r);
        let scale = 2.0 * r * PI.powi(4);
        let weights: Vec<f64> = body.measure().to_vec();
        let points: Vec<u32> = (0..n as u32).collect();
        let load = Condition::new("load", Action::Force { weights }, points, 1, move |x, q| -q * scale * (PI * x[0]).sin());
        let mut s = structure(body, vec![Condition::hold("pins", vec![0, n as u32 - 1], &[0, 1]), load]);
        let arc =
            ArcLength { end: 1.5 * (lambda + (4.0 * (lambda * lambda - 1.0).powi(3) / 27.0).sqrt()), threads: 1, ..Default::default() };
        let mut steps = 0;
        let mut observer = |report: &StepReport, _: &mut ThinStructure<2>, _: &[f64], _: &[f64]| {
            steps = report.step;
            std::ops::ControlFlow::Continue(())
        };
        let path = arc.run(&mut s, &mut u, &mut observer, None).unwrap();
        let (upper, lower) = (path.limit_points[0].load, path.limit_points[1].load);
        let root = (4.0 * (lambda * lambda - 1.0).powi(3) / 27.0).sqrt();
        println!(
            "λ={lambda}: {:.5} {:.5} of {:.5} {:.5}, {steps} steps, {:?}",
            upper,
            lower,
            lambda + root,
            lambda - root,
            path.bifurcations
        );
        assert!((upper / (lambda + root) - 1.0).abs() < 0.005, "{upper}");
        assert!((lower - (lambda - root)).abs() < 0.005 * (lambda + root), "{lower}");
    }
}

#[test]
fn elastica() {
    let n = 41;
    for (potential, printed) in [
        // of the independent implementation
        (Potential::Cosine, ["0.302472", "0.494847", "0.716379", "0.814588"]),
        // nearer to the classical one, whose moment is linear in the curvature
        (Potential::Square, ["0.302374", "0.494489", "0.715560", "0.813440"]),
    ] {
        let arms = uniform(3);
        let beam = Beam { axial: Some(&[1e4]), law: thin::pairs::Law::Elastic(potential), ..beam_of(&arms) };
        let body: Thin<2> = beam.build(Layout::line(&line(n)).unwrap().with_mirrors(&[mirror(0, 0.0, Parity::Even)]).unwrap()).unwrap();
        let tip = n as u32 - 1;
        let conditions = vec![
            Condition::hold("clamp", vec![0], &[0, 1]),
            Condition::new("load", Action::Force { weights: vec![1.0] }, vec![tip], 1, |_, t| t),
        ];
        let mut s: ThinStructure<2> = structure(body, conditions);
        let mut u = vec![0.0; 2 * n];
        let mut tips = vec![];
        follow(&mut s, vec![1.0, 2.0, 5.0, 10.0], &mut u, |_, _, u| tips.push(u[2 * n - 1]));
        for ((v, printed), exact) in tips.iter().zip(printed).zip([0.301721, 0.493457, 0.713792, 0.810609]) {
            digits("tip", *v, printed, 1.0);
            assert!((v / exact - 1.0).abs() < 0.005);
        }
    }
}

#[test]
fn elastica_in_space_bends_in_its_plane() {
    let n = 41;
    let arms = uniform(3);
    let beam = Beam { axial: Some(&[1e4]), ..beam_of(&arms) };
    let body: Thin<3> = beam.build(Layout::line(&line(n)).unwrap().with_mirrors(&[mirror(0, 0.0, Parity::Even)]).unwrap()).unwrap();
    let tip = n as u32 - 1;
    // the load along a diagonal of y and z
    let mut load = Condition::new("load", Action::Force { weights: vec![1.0] }, vec![tip], 1, |_, t| 0.6 * t);
    load.components[2] = Some(Box::new(|_, t| 0.8 * t));
    let mut s: ThinStructure<3> = structure(body, vec![Condition::hold("clamp", vec![0], &[0, 1, 2]), load]);
    let mut u = vec![0.0; 3 * n];
    follow(&mut s, vec![1.0, 2.0, 5.0], &mut u, |_, _, _| {});
    let (y, z) = (u[3 * n - 2], u[3 * n - 1]);
    // as in the plane
    digits("tip", y.hypot(z), "0.715560", 1.0);
    assert!((y / z - 0.75).abs() < 1e-7);
}

#[test]
fn frequencies_converge_to_the_classical_ones() {
    // simply supported: ω = (k π)², at second order in Δx
    let mut errors = vec![];
    for n in [21, 41, 81] {
        let arms = uniform(3);
        let mirrors = [mirror(0, 0.0, Parity::Odd), mirror(0, 1.0, Parity::Odd)];
        let body: Thin<1> = beam_of(&arms).build(Layout::line(&line(n)).unwrap().with_mirrors(&mirrors).unwrap()).unwrap();
        let mut s = structure(body, vec![Condition::hold("ends", vec![0, n as u32 - 1], &[0])]);
        let modes = vibration_modes(&mut s, &vec![0.0; n], 3, 1e-10, 1).unwrap();
        let first = modes.values[0].sqrt() / (PI * PI);
        let third = modes.values[2].sqrt() / (9.0 * PI * PI);
        // the symbol: ⟨sinc⁴(k ξ/2)⟩ with weights ξ²
        let symbol: f64 = (1..=3)
            .map(|j| {
                let xi = f64::from(j) / (n - 1) as f64;
                let a = 0.5 * PI * xi;
                f64::from(j * j) / 14.0 * (a.sin() / a).powi(4)
            })
            .sum();
        assert!((first - symbol.sqrt()).abs() < 1e-9, "{first} {}", symbol.sqrt());
        errors.push(1.0 - first);
        println!("n={n}: {first:.7} {third:.7}");
    }
    let order = (errors[1] / errors[2]).log2();
    assert!((order - 2.0).abs() < 0.05, "{order}");
}
