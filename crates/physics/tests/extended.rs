//! Extended correspondence: the properties of its nonlocal strain, and the examples of Tupek & Radovitzky (2014), sections 3, 4.2 and 4.3,
//! against closed forms and beside the conventional model.
//!
//! `cargo test --release -p peridyne-physics --test extended -- --nocapture` prints the tables.

mod common;

use common::{Body, Random};
use physics::constitutive::{Deformation, J2Plasticity, J2PlasticityConstants, Law, LinearElastic, Strain, StrainLaw};
use physics::elasticity::{Isotropic, Section, Stiffness};
use physics::family::{Family, Reference};
use physics::influence::{One, Stored};
use physics::material::{Material, SingularFamily};
use physics::models::{BondStrainCalibration, Correspondence, ExtendedCorrespondence, SethHill};
use physics::scalar::{Dual, ROW, Scalar};
use physics::tensor::{Matrix, symmetric_eigen};
use physics::zero_energy::NoControl;
use std::f64::consts::PI;

use BondStrainCalibration::{AsPublished, MomentTensor, TruncatedMomentTensor};

const STEEL: Isotropic = Isotropic { young: 200e9, poisson: 0.3 };
const EXPONENTS: [f64; 7] = [-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 0.7];

/// A law whose "energy" is one component of what it is given: shows the nonlocal strain, or the nonlocal gradient.
#[derive(Clone, Copy)]
struct Probe;

fn section<const D: usize>() -> Section {
    [Section::Bar { area: 1.0 }, Section::PlaneStrain { thickness: 1.0 }, Section::Solid][D - 1]
}

impl<const D: usize> StrainLaw<D> for Probe {
    type Constants = (usize, usize);
    fn stiffness(&self, _: &(usize, usize)) -> Stiffness<D> {
        Stiffness::isotropic(STEEL, 0.0, section::<D>())
    }
    fn stress<R: Scalar>(&self, _: &(usize, usize), _: &Strain<R, D>) -> Matrix<R, D> {
        Matrix::zero()
    }
    fn energy<R: Scalar>(&self, &(a, b): &(usize, usize), e: &Strain<R, D>) -> R {
        e.tensor.0[a][b]
    }
}
impl<const D: usize> Law<D> for Probe {
    type Constants = (usize, usize);
    fn stiffness(&self, _: &(usize, usize)) -> Stiffness<D> {
        Stiffness::isotropic(STEEL, 0.0, section::<D>())
    }
    fn first_piola<R: Scalar>(&self, _: &(usize, usize), _: &Deformation<R, D>) -> Matrix<R, D> {
        Matrix::zero()
    }
    fn energy<R: Scalar>(&self, &(a, b): &(usize, usize), f: &Deformation<R, D>) -> R {
        f.f().0[a][b]
    }
}

fn model<L, I>(law: L, m: f64, calibration: BondStrainCalibration, omega: I) -> ExtendedCorrespondence<L, I> {
    ExtendedCorrespondence { law, exponent: SethHill::new(m).expect("a moderate exponent"), calibration, control: 0.0, omega }
}

/// The body with an influence of 1 where it stores none.
fn stored<const D: usize>(body: &Body<D>) -> Body<D> {
    let mut body = body.clone();
    if body.weight.is_empty() {
        body.weight = vec![1.0; body.neighbor.len()];
    }
    body
}

/// Energy of the first family.
fn energy<M: Material<D>, R: Scalar<Sum = R>, const D: usize>(material: &M, constants: &M::Constants, body: &Body<D>, u: &[R]) -> R {
    let body = stored(body);
    let rest = vec![0.0; body.points() * ROW];
    let shape = material.shape(constants, Reference::new(&body.view(&rest), 0)).expect("a regular family");
    material.energy_density(constants, &shape, Family::<R, D>::new(&body.view(u), 0))
}

/// Ē of the first family.
fn strain<const D: usize>(body: &Body<D>, u: &[f64], m: f64, calibration: BondStrainCalibration) -> [[f64; D]; D] {
    let model = model(Probe, m, calibration, Stored);
    std::array::from_fn(|a| std::array::from_fn(|b| energy(&model, &(a, b), body, u)))
}

/// Derivative of a component of Ē in the reference state.
fn first_order<const D: usize>(body: &Body<D>, z: &[f64], m: f64, calibration: BondStrainCalibration, at: (usize, usize)) -> f64 {
    let u: Vec<Dual> = z.iter().map(|&z| Dual { value: 0.0, slope: [z] }).collect();
    energy(&model(Probe, m, calibration, Stored), &at, body, &u).slope[0]
}

/// F̄ of the conventional model in the first family.
fn gradient<const D: usize>(body: &Body<D>, u: &[f64]) -> [[f64; D]; D] {
    let model = Correspondence { law: Probe, control: NoControl, omega: Stored };
    std::array::from_fn(|a| std::array::from_fn(|b| energy(&model, &(a, b), body, u)))
}

/// Forces of all bonds.
fn forces<M: Material<D>, const D: usize>(material: &M, constants: &M::Constants, body: &Body<D>, u: &[f64]) -> Vec<[f64; D]> {
    let rest = vec![0.0; body.points() * ROW];
    let (reference, view) = (body.view(&rest), body.view(u));
    let mut out = vec![[0.0; D]; body.neighbor.len()];
    for i in 0..body.families() {
        let shape = material.shape(constants, Reference::new(&reference, i)).expect("a regular family");
        let family = Family::<f64, D>::new(&view, i);
        let state = material.state(constants, &shape, family);
        family.each(|b| out[b.slot()] = material.force(&state, b).0);
    }
    out
}

fn seth_hill(stretch: f64, m: f64) -> f64 {
    if m == 0.0 { stretch.ln() } else { (stretch.powf(2.0 * m) - 1.0) / (2.0 * m) }
}

fn worst<const D: usize>(a: [[f64; D]; D], b: [[f64; D]; D]) -> f64 {
    a.as_flattened().iter().zip(b.as_flattened()).fold(0.0, |w, (x, y)| if (x - y).is_nan() { f64::NAN } else { w.max((x - y).abs()) })
}

fn multiple<const D: usize>(x: f64) -> [[f64; D]; D] {
    std::array::from_fn(|a| std::array::from_fn(|b| if a == b { x } else { 0.0 }))
}

// ------------------------------------------------------------------------------------------------ section 4.2

/// Where a point lies in a half or quarter space of lattice points.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    Interior,
    Face,
    Corner,
}

/// One lattice family of unit spacing, weighted by `omega` of r/δ.
fn lattice<const D: usize>(ratio: f64, place: Place, omega: fn(f64) -> f64) -> Body<D> {
    let n = ratio as i64;
    let side = (2 * n + 1) as usize;
    let bonds: Vec<([f64; D], f64)> = (0..side.pow(D as u32))
        .map(|q| std::array::from_fn(|k| (q / side.pow(k as u32) % side) as f64 - n as f64))
        .filter(|x: &[f64; D]| {
            let r = x.iter().map(|x| x * x).sum::<f64>().sqrt();
            let inside = match place {
                Place::Interior => true,
                Place::Face => x[0] >= 0.0,
                Place::Corner => x.iter().all(|&x| x >= 0.0),
            };
            r > 0.0 && r <= ratio * (1.0 + 1e-9) && inside
        })
        .map(|x| (x, 1.0))
        .collect();
    let mut body = Body::star(&bonds, ratio, 1.0);
    body.weight = body.length.iter().map(|r| omega(r / ratio)).collect();
    body
}

/// The linear map ε → Ē of infinitesimal uniform strains, less one, in the components of Mandel: its 2-norm.
fn operator_error<const D: usize>(body: &Body<D>, calibration: BondStrainCalibration) -> (f64, Vec<f64>) {
    let pairs: Vec<(usize, usize)> = (0..D).flat_map(|a| (a..D).map(move |b| (a, b))).collect();
    let n = pairs.len();
    let scale = |(a, b): (usize, usize)| if a == b { 1.0 } else { 2f64.sqrt() };
    let mut map = vec![0.0; n * n];
    for (column, &(p, q)) in pairs.iter().enumerate() {
        let mut e = [[0.0; D]; D];
        e[p][q] = 1.0 / scale((p, q));
        e[q][p] = e[p][q];
        if p == q {
            e[p][p] = 1.0;
        }
        let z = body.displaced(|_, x| std::array::from_fn(|a| (0..D).map(|b| e[a][b] * x[b]).sum()));
        for (row, &(a, b)) in pairs.iter().enumerate() {
            // the exponent does not matter
            map[row * n + column] = first_order(body, &z, 0.7, calibration, (a, b)) * scale((a, b));
        }
    }
    let off = |i: usize, j: usize| map[i * n + j] - (i == j) as u8 as f64;
    let square: Vec<f64> = (0..n * n).map(|k| (0..n).map(|q| off(q, k / n) * off(q, k % n)).sum()).collect();
    (symmetric_eigen(&square, n).0[n - 1].max(0.0).sqrt(), map)
}

#[test]
fn infinitesimal_uniform_strain() {
    fn check(name: &str, got: f64, want: f64, digit: f64) {
        println!("  {name}: {:.3} %, reference {want}", 100.0 * got);
        assert!((100.0 * got - want).abs() <= 0.51 * digit, "{name}: {got} {want}");
    }
    fn asked<const D: usize>(reference: [[f64; 2]; 5]) {
        type Shape = (&'static str, Place, fn(f64) -> f64, f64);
        let shapes: [Shape; 5] = [
            ("constant", Place::Interior, |_| 1.0, 0.01),
            ("inverse length", Place::Interior, |q| 1.0 / q, 0.1),
            ("cone", Place::Interior, |q| 1.0 - q, 0.1),
            ("constant, free face", Place::Face, |_| 1.0, 1.0),
            ("constant, corner", Place::Corner, |_| 1.0, 1.0),
        ];
        for ((name, place, omega, digit), reference) in shapes.into_iter().zip(reference) {
            for (ratio, want) in [3.0, 4.0].into_iter().zip(reference) {
                let body = lattice::<D>(ratio, place, omega);
                check(&format!("{D}D, horizon ratio {ratio}, {name}"), operator_error(&body, AsPublished).0, want, digit);
                let corrected = operator_error(&body, MomentTensor).0;
                assert!(corrected < 1e-13, "{D}D, {ratio}, {name}, corrected: {corrected:.1e}");
            }
        }
    }
    // of the cone the reference gives one digit, cut off and not rounded: 12.9, 7.4, 11.7, 4.6
    asked::<2>([[6.29, 4.93], [13.8, 10.7], [12.95, 7.45], [43.0, 35.0], [82.0, 89.0]]);
    asked::<3>([[7.49, 0.37], [1.5, 4.2], [11.75, 4.65], [33.0, 28.0], [153.0, 167.0]]);
    // one dimension is exact as published, at ends too
    for place in [Place::Interior, Place::Face] {
        assert!(operator_error(&lattice::<1>(3.0, place, |_| 1.0), AsPublished).0 < 1e-15);
    }
    // components: E₁₁ and E₂₂ of a unit ε₁₁ and the shear, horizon ratio 3
    let plane = operator_error(&lattice::<2>(3.0, Place::Interior, |_| 1.0), AsPublished).1;
    for (got, want) in [(plane[0], 1.0314), (plane[6], -0.0314), (plane[4], 0.9371)] {
        assert!((got - want).abs() < 6e-5, "{got} {want}");
    }
    let solid = operator_error(&lattice::<3>(3.0, Place::Interior, |_| 1.0), AsPublished).1;
    for (got, want) in [(solid[0], 0.9501), (solid[18], 0.0250), (solid[7], 1.0499)] {
        assert!((got - want).abs() < 6e-5, "{got} {want}");
    }
}

/// Clouds, with broken bonds before the shape is made, of unequal volumes and influences.
fn irregular<const D: usize>() -> Body<D> {
    let (count, ratio) = [(30, 3.1), (9, 2.6), (5, 2.1)][D - 1];
    Body::cloud(count, 1.0, ratio, false).weighted()
}

fn rotation<const D: usize>(angle: f64) -> [[f64; D]; D] {
    let axis = if D == 3 { [2.0 / 7.0, 3.0 / 7.0, 6.0 / 7.0] } else { [0.0, 0.0, 1.0] };
    let (s, c) = angle.sin_cos();
    let cross = [[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]];
    std::array::from_fn(|i| std::array::from_fn(|j| (i == j) as u8 as f64 * c + (1.0 - c) * axis[i] * axis[j] + s * cross[i][j]))
}

/// F = λR: exact for every m and every family, corners and clouds included; as published in full continuum families only.
#[test]
fn pure_dilatation_with_rotation_is_exact() {
    fn asked<const D: usize>() -> f64 {
        let bodies = [
            lattice::<D>(3.0, Place::Interior, |_| 1.0),
            lattice::<D>(3.0, Place::Face, |q| 1.0 / q),
            lattice::<D>(3.0, Place::Corner, |_| 1.0),
            irregular::<D>(),
        ];
        let q = if D == 1 { multiple(1.0) } else { rotation::<D>(2.1) };
        let mut off = 0.0f64;
        for body in &bodies {
            for m in EXPONENTS {
                for stretch in [0.5, 0.98, 1.3, 2.0] {
                    let u = body.affine(q.map(|row| row.map(|x| x * stretch)));
                    let want = seth_hill(stretch, m);
                    off = off.max(worst(strain(body, &u, m, MomentTensor), multiple(want)) / want.abs());
                }
            }
        }
        off
    }
    let all = [asked::<1>(), asked::<2>(), asked::<3>()];
    println!("dilatation and rotation: off by {all:?}");
    assert!(all.iter().all(|x| *x < 2e-12), "{all:?}");
}

/// m = 1: every finite uniform F is exact, in every family.
#[test]
fn green_lagrange_strain_is_exact() {
    fn asked<const D: usize>() -> f64 {
        let mut r = Random::new(4);
        let mut off = 0.0f64;
        for body in [irregular::<D>(), lattice::<D>(3.0, Place::Corner, |_| 1.0)] {
            let f: [[f64; D]; D] = std::array::from_fn(|i| std::array::from_fn(|j| (i == j) as u8 as f64 + 0.6 * r.next()));
            let e = strain(&body, &body.affine(f), 1.0, MomentTensor);
            off = off.max(worst(e, common::closed::green_lagrange(f)));
        }
        off
    }
    let off = asked::<1>().max(asked::<2>()).max(asked::<3>());
    println!("finite uniform F, m = 1: off by {off:.1e}");
    assert!(off < 1e-13);
}

/// Nodes and weights of Gauss–Legendre quadrature on (a, b), by Newton's method on the polynomials of Legendre.
fn gauss(n: usize, a: f64, b: f64) -> Vec<(f64, f64)> {
    (0..n)
        .map(|k| {
            let mut x = (PI * (k as f64 + 0.75) / (n as f64 + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..20 {
                let (mut p, mut q) = (1.0, x);
                for j in 2..=n {
                    (p, q) = (q, ((2 * j - 1) as f64 * x * q - (j - 1) as f64 * p) / j as f64);
                }
                slope = n as f64 * (x * q - p) / (x * x - 1.0);
                x -= q / slope;
            }
            (0.5 * (a + b) - 0.5 * (b - a) * x, (b - a) / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

/// Directions and weights on the unit sphere of D dimensions that integrate polynomials of high degree.
fn directions<const D: usize>() -> Vec<([f64; D], f64)> {
    match D {
        1 => [1.0, -1.0].map(|x| ([x; D], 1.0)).to_vec(),
        2 => (0..64)
            .map(|k| {
                let (s, c) = (2.0 * PI * (k as f64 + 0.3) / 64.0).sin_cos();
                (std::array::from_fn(|a| [c, s][a]), 1.0)
            })
            .collect(),
        _ => gauss(40, -1.0, 1.0)
            .into_iter()
            .flat_map(|(z, w)| {
                (0..12).map(move |k| {
                    let (s, c) = (2.0 * PI * (k as f64 + 0.3) / 12.0).sin_cos();
                    let r = (1.0 - z * z).sqrt();
                    (std::array::from_fn(|a| [z, r * c, r * s][a]), w)
                })
            })
            .collect(),
    }
}

/// A finite uniform deviatoric strain is not E₍ₘ₎ (m ≠ 1): uniaxial stretch 1/2 in a continuous 3D family.
#[test]
fn uniaxial_stretch_of_one_half() {
    let bonds: Vec<([f64; 3], f64)> = directions::<3>();
    let body = Body::star(&bonds, 1.0, 1.0);
    let mut f = multiple::<3>(1.0);
    f[0][0] = 0.5;
    println!("m, nonlocal strain 11 and 22, classical 11");
    for (m, want, across) in [(-1.0, -0.96294, None), (-0.5, -0.73220, None), (0.0, -0.57188, Some(0.0273)), (0.5, -0.45790, None)] {
        for calibration in [AsPublished, MomentTensor] {
            let e = strain(&body, &body.affine(f), m, calibration);
            assert!((e[0][0] - want).abs() < 6e-6, "{m}: {} {want}", e[0][0]);
            if let Some(want) = across {
                assert!((e[1][1] - want).abs() < 6e-5, "{m}: {} {want}", e[1][1]);
            }
            if calibration == MomentTensor {
                println!("{m:5} {:9.5} {:9.5} {:9.5}", e[0][0], e[1][1], seth_hill(0.5, m));
            }
        }
    }
}

// ------------------------------------------------------------------------------------------------ sections 3 and 4.3

/// Example 1: a ball of radius ρ about the point collapses to the share η of its size, the rest stays.
#[test]
fn collapse_of_a_sub_ball() {
    fn asked<const D: usize>(conventional: f64) {
        let rho = 0.5;
        let bonds: Vec<([f64; D], f64)> = [(0.0, rho), (rho, 1.0)]
            .into_iter()
            .flat_map(|(a, b)| gauss(6, a, b))
            .flat_map(|(r, w)| directions::<D>().into_iter().map(move |(n, v)| (n.map(|n| n * r), v * w * r.powi(D as i32 - 1))))
            .collect();
        let body = Body::star(&bonds, 1.0, 1.0);
        let moved = |eta: f64| {
            body.displaced(|_, x| {
                let inside = x.iter().map(|x| x * x).sum::<f64>().sqrt() < rho;
                x.map(|x| if inside { (eta - 1.0) * x } else { 0.0 })
            })
        };
        let f = gradient(&body, &moved(0.0));
        println!("{D}D: conventional F of the collapsed family {:.6} 1", f[0][0]);
        assert!(worst(f, multiple(conventional)) < 1e-13, "{f:?}");
        for m in EXPONENTS {
            let got: Vec<f64> = [0.5, 0.1, 1e-3]
                .into_iter()
                .map(|eta| {
                    let want = rho.powi(D as i32) * seth_hill(eta, m);
                    for calibration in [AsPublished, MomentTensor] {
                        let e = strain(&body, &moved(eta), m, calibration);
                        // c = η² is what is left of 1: its last digits, and the power's, are lost
                        let digits = 1e-12 + 4e-16 * f64::max(1.0, m.abs()) / (eta * eta);
                        assert!(worst(e, multiple(want)) < digits * want.abs(), "{D}D, {m}, {eta}: {e:?} {want}");
                    }
                    want
                })
                .collect();
            println!("  m = {m:4}: extended strain at a size of 1/2, 1/10, 1/1000: {got:.4?}");
        }
    }
    asked::<1>(0.875);
    asked::<2>(0.9375);
    asked::<3>(0.96875);
}

/// Quadrature on (−1, 1) that is graded towards the given places, none of which is a node, with ends at a distance `cut` from them.
fn graded(places: &[f64], cut: f64) -> Vec<(f64, f64)> {
    let mut ends = vec![-1.0, 1.0];
    for &p in places {
        for side in [-1.0, 1.0] {
            ends.extend((0..48).map(|k| p + side * 0.5f64.powi(k)));
            ends.push(p + side * cut);
        }
        ends.push(p);
    }
    ends.retain(|x| x.abs() <= 1.0);
    ends.sort_by(f64::total_cmp);
    ends.dedup();
    ends.windows(2).filter(|w| w[1] - w[0] > 1e-16).flat_map(|w| gauss(10, w[0], w[1])).collect()
}

/// The family of x in a bar with δ = 1 whose points x′ > 0 are displaced by a; bonds within `cut` of a coincidence are left as they are.
fn jump(x: f64, a: f64, cut: f64, omega: impl Fn(f64) -> f64) -> (Body<1>, Vec<f64>) {
    let bonds: Vec<([f64; 1], f64)> =
        graded(&[0.0, -x, -a], cut).into_iter().filter(|(r, _)| *r != 0.0).map(|(r, w)| ([r], w * omega(r.abs()))).collect();
    let body = Body::star(&bonds, 1.0, 1.0);
    let u = body.displaced(|i, r| [if i > 0 && x + r[0] > 0.0 && (r[0] + a).abs() > cut && r[0] > cut { a } else { 0.0 }]);
    (body, u)
}

/// Example 2: the conventional F̄ = 1 + ¾ a (1 − x²) (constant ω) or 1 + a (1 − |x|) (ω = 1/|ξ|) sees no interpenetration, …
#[test]
fn the_conventional_model_is_blind_to_a_jump() {
    for x in [0.0, -0.1, -0.5] {
        for a in [0.3, -0.3, -0.9] {
            for (name, omega, want) in [
                ("constant", (|_| 1.0) as fn(f64) -> f64, 1.0 + 0.75 * a * (1.0 - x * x)),
                ("inverse length", |r| 1.0 / r, 1.0 + a * (1.0 - f64::abs(x))),
            ] {
                let (body, u) = jump(x, a, 0.0, omega);
                let f = gradient(&body, &u)[0][0];
                println!("jump {a:4} seen from {x:4}, ω {name}: conventional F = {f:.6}");
                assert!((f - want).abs() < 1e-12, "{f} {want}");
            }
        }
    }
    // F̄(0) > 0 down to a = −4/3 and −1
    let (body, u) = jump(0.0, -4.0 / 3.0, 0.0, |_| 1.0);
    assert!(gradient(&body, &u)[0][0].abs() < 1e-12);
    let (body, u) = jump(0.0, -1.0, 0.0, |r| 1.0 / r);
    assert!(gradient(&body, &u)[0][0].abs() < 1e-12);
}

/// … but the extended strain does (section 4.3, example 2): finite for −1/2 < m ≤ 0, logarithmic at −1/2, a power below.
#[test]
fn interpenetrating_jump() {
    let (x, a) = (-0.1, -0.3);
    let at = |m: f64, cut: f64| {
        let (body, u) = jump(x, a, cut, |_| 1.0);
        strain(&body, &u, m, AsPublished)[0][0]
    };
    // m = −1/2: by the closed form ∫ξ/|ξ − 0.3|, and to the digits of an independent implementation
    for (cut, want) in [(1e-2, -0.897), (1e-4, -2.268), (1e-6, -3.650), (1e-8, -5.031)] {
        let got = at(-0.5, cut);
        println!("m = −1/2, cut-off {cut:.0e}: {got:.4}, reference {want}");
        assert!((got - want).abs() < 6e-4, "{cut}: {got} {want}");
    }
    let exact = |m: f64| match m {
        // ½∫ ln(|ξ − 0.3|/ξ) over (0.1, 1)
        0.0 => {
            let g = |u: f64| u * u.ln() - u;
            0.5 * ((g(0.2) + g(0.7)) - (g(1.0) - g(0.1)))
        }
        _ => unreachable!(),
    };
    let got = at(0.0, 1e-13);
    println!("m = 0: {got:.6}, closed form {:.6}", exact(0.0));
    assert!((got - exact(0.0)).abs() < 1e-9 && (got + 0.4009).abs() < 6e-5, "{got}");
    // finite at m = −1/4, whatever the cut-off, …
    let (coarse, fine) = (at(-0.25, 1e-9), at(-0.25, 1e-12));
    println!("m = −1/4: {coarse:.6} and {fine:.6}");
    assert!((coarse / fine - 1.0).abs() < 1e-4);
    // … and at m = −1 ∫ξ²/(ξ − 0.3)² grows as 0.09/cut on either side, half of it times ½
    for cut in [1e-3, 1e-5] {
        let got = at(-1.0, cut) * cut;
        println!("m = −1, cut-off {cut:.0e}: strain × cut-off {got:.5}");
        assert!((got + 0.045).abs() < 0.01, "{got}");
    }
}

/// Section 4.3, example 3: an opening jump has a finite strain where ω is tame enough.
#[test]
fn opening_jump() {
    for (x, a) in [(-0.1, 0.3), (-0.01, 0.3), (-0.4, 0.05)] {
        let (body, u) = jump(x, a, 0.0, |_| 1.0);
        let near = -x;
        // m = 0: ½∫ ln((ξ + a)/ξ); m = 1: ¼∫ (2a/ξ + a²/ξ²); m = 1/2: ½ ∫ a/ξ; over (|x|, 1)
        let g = |u: f64| u * u.ln() - u;
        let log = 0.5 * ((g(1.0 + a) - g(near + a)) - (g(1.0) - g(near)));
        let green = 0.25 * (2.0 * a * (1.0 / near).ln() + a * a * (1.0 / near - 1.0));
        let biot = 0.5 * a * (1.0 / near).ln();
        for (m, want) in [(0.0, log), (1.0, green), (0.5, biot)] {
            let got = strain(&body, &u, m, AsPublished)[0][0];
            println!("opening {a} seen from {x}, m = {m}: {got:.6}");
            assert!((got / want - 1.0).abs() < 1e-10, "{m}: {got} {want}");
        }
    }
    // at the surface itself, m = 1: ω ∝ ξ² gives ¾ (a + a²); the printed limit ω ∝ ξ^(2m − 1) diverges, by a²/2 ln 10 a decade
    let a = 0.3;
    let (body, u) = jump(-1e-15, a, 0.0, |r| r * r);
    let got = strain(&body, &u, 1.0, AsPublished)[0][0];
    assert!((got - 0.75 * (a + a * a)).abs() < 1e-10, "{got}");
    let at = |cut: f64| {
        let (body, u) = jump(-1e-15, a, cut, |r| r);
        strain(&body, &u, 1.0, AsPublished)[0][0]
    };
    let decades = (at(1e-10) - at(1e-6)) / 4.0;
    println!("opening at the surface, ω = |ξ|: {decades:.4} a decade");
    assert!((decades / (0.5 * a * a * 10f64.ln()) - 1.0).abs() < 1e-4, "{decades}");
}

/// Examples 3 and 4: sine waves y = x + a sin(2πkx + φ) leave the conventional F̄ = 1 (ω = 1/|ξ|, and the cone), or change it by
/// 3a/(2πk) (ω = 1); the extended strain with ω ξ² is the same to first order and of second order beyond.
#[test]
fn sine_waves() {
    // a lattice family of horizon ratio n: full weight at its ends
    let n = 40;
    let lattice = |omega: &dyn Fn(f64) -> f64| {
        let bonds: Vec<([f64; 1], f64)> =
            (-n..=n).filter(|j| *j != 0).map(|j| ([j as f64 / n as f64], omega((j as f64 / n as f64).abs()) / n as f64)).collect();
        Body::star(&bonds, 1.0, 1.0)
    };
    let wave = |body: &Body<1>, k: usize, phase: f64, a: f64| body.displaced(|_, x| [a * (2.0 * PI * k as f64 * x[0] + phase).sin()]);
    let a = 1e-3;
    for (name, omega) in [("inverse length", &(|r: f64| 1.0 / r) as &dyn Fn(f64) -> f64), ("cone", &|r: f64| 1.0 - r)] {
        for k in [1, 2, 7] {
            let conventional = lattice(omega);
            // the same first-order operator: ω ξ²
            let extended = lattice(&|r| omega(r) * r * r);
            let f = gradient(&conventional, &wave(&conventional, k, 0.4, a))[0][0];
            assert!((f - 1.0).abs() < 1e-14, "{name}, {k}: {f}");
            for m in EXPONENTS {
                let z = wave(&extended, k, 0.4, 1.0);
                let first = first_order(&extended, &z, m, MomentTensor, (0, 0));
                assert!(first.abs() < 1e-12, "{name}, {k}, {m}: {first:.1e}");
                // second order: halving the amplitude quarters the strain; (2m − 1) is its factor, which vanishes at m = 1/2
                let [e, half] = [a, 0.5 * a].map(|a| strain(&extended, &wave(&extended, k, 0.4, a), m, MomentTensor)[0][0]);
                if m == 0.5 {
                    assert!(e.abs() < 1e-13, "{e:.1e}");
                } else {
                    assert!((e / half - 4.0).abs() < 0.2 && e * (2.0 * m - 1.0) > 0.0, "{name}, {k}, {m}: {e:.1e} {half:.1e}");
                }
            }
        }
        println!("ω {name}: sine waves have no strain to first order, in both models");
    }
    // constant ω, continuous family: amplitude 3a/(2πk)
    let continuum = |weight: &dyn Fn(f64) -> f64| {
        let bonds: Vec<([f64; 1], f64)> =
            (0..40).flat_map(|k| gauss(12, -1.0 + 0.05 * k as f64, -0.95 + 0.05 * k as f64)).map(|(r, w)| ([r], w * weight(r))).collect();
        Body::star(&bonds, 1.0, 1.0)
    };
    let (conventional, extended) = (continuum(&|_| 1.0), continuum(&|r| r * r));
    for k in [1, 2, 4, 8, 16] {
        let want = -3.0 * a / (2.0 * PI * k as f64);
        let f = gradient(&conventional, &wave(&conventional, k, 0.0, a))[0][0] - 1.0;
        let z = wave(&extended, k, 0.0, a);
        let e = first_order(&extended, &z, 0.0, AsPublished, (0, 0));
        println!("ω constant, k = {k:2}: conventional F − 1 = {f:.4e}, extended strain to first order {e:.4e}");
        assert!((f / want - 1.0).abs() < 1e-11 && (e / want - 1.0).abs() < 1e-11, "{k}: {f} {e} {want}");
    }
}

// ------------------------------------------------------------------------------------------------ force, history, errors

/// Eq. (13) summed by hand on a random deformation of a cloud, as published; T × Y = 0 for every bond.
#[test]
fn force_state_by_hand() {
    fn asked<const D: usize>() -> [f64; 2] {
        let (mut off, mut across) = (0.0f64, 0.0f64);
        let body = irregular::<D>();
        let u = body.random(1.0, 3);
        for m in EXPONENTS {
            let k = Stiffness::<D>::isotropic(STEEL, 0.0, section::<D>());
            let forces = forces(&model(LinearElastic, m, AsPublished, Stored), &k, &body, &u);
            let (a, b) = (0.5 * (D + 2) as f64, 0.5);
            for i in 0..body.families() {
                let bond = |slot: usize| {
                    let j = body.neighbor[slot] as usize;
                    let xi = body.xi(i, slot);
                    let y: [f64; D] = std::array::from_fn(|k| xi[k] + u[j * ROW + k] - u[i * ROW + k]);
                    let square = |v: [f64; D]| v.iter().map(|x| x * x).sum::<f64>();
                    (xi, y, square(xi), square(y) / square(xi), body.weight[slot], body.volume(j))
                };
                let total: f64 = body.bonds(i).map(|s| bond(s).4 * bond(s).5).sum();
                let h = |xi: [f64; D], r2: f64| -> [[f64; D]; D] {
                    std::array::from_fn(|p| std::array::from_fn(|q| a * xi[p] * xi[q] / r2 - b * (p == q) as u8 as f64))
                };
                let mut e = [[0.0; D]; D];
                for slot in body.bonds(i) {
                    let (xi, _, r2, c, w, v) = bond(slot);
                    for p in 0..D {
                        for q in 0..D {
                            e[p][q] += w * v * D as f64 / total * seth_hill(c.sqrt(), m) * h(xi, r2)[p][q];
                        }
                    }
                }
                let sigma = k.stress(&Matrix(e)).0;
                let scale = body.bonds(i).map(|s| forces[s].iter().map(|x| x * x).sum::<f64>().sqrt()).fold(0.0, f64::max);
                for slot in body.bonds(i) {
                    let (xi, y, r2, c, w, _) = bond(slot);
                    let h = h(xi, r2);
                    let along: f64 = (0..D * D).map(|k| sigma[k / D][k % D] * h[k / D][k % D]).sum();
                    let norm = |v: [f64; D]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
                    for k in 0..D {
                        let want = along * w * D as f64 / total * c.powf(m - 1.0) / r2 * y[k];
                        off = off.max((want - forces[slot][k]).abs() / scale);
                        let l = (k + 1) % D;
                        let cross = forces[slot][k] * y[l] - forces[slot][l] * y[k];
                        across = across.max(cross.abs() / (norm(forces[slot]) * norm(y)));
                    }
                }
            }
        }
        [off, across]
    }
    let all = [asked::<1>(), asked::<2>(), asked::<3>()];
    println!("eq. (13) by hand and T × Y: {all:?}");
    for [off, across] in all {
        // parallel to the last digit of the components
        assert!(off < 1e-12 && across < 1e-15, "{off:.1e} {across:.1e}");
    }
}

/// A bar of J2 plastic material in E₍ₘ₎ is stretched, let go and compressed: ∫Tξ dV′ = σ c^(m − 1/2), σ by the uniaxial law.
#[test]
fn plastic_bar() {
    let section = Section::Bar { area: 1.0 };
    let (yield_stress, hardening) = (400e6, 5e9);
    for m in EXPONENTS {
        let c = J2PlasticityConstants::new(STEEL, yield_stress, hardening, 0.0, section).expect("steel");
        let material = model(J2Plasticity, m, MomentTensor, Stored);
        let mut body = irregular::<1>().with_point_history(2);
        let (mut plastic, mut equivalent) = (0.0f64, 0.0);
        for stretch in [1.001, 1.004, 1.02, 1.018, 1.0, 0.97, 1.05] {
            let u = body.affine([[stretch]]);
            let trial = STEEL.young * (seth_hill(stretch, m) - plastic);
            let beyond = (trial.abs() - yield_stress - hardening * equivalent).max(0.0) / (STEEL.young + hardening);
            plastic += trial.signum() * beyond;
            equivalent += beyond;
            let sigma = STEEL.young * (seth_hill(stretch, m) - plastic);
            let forces = forces(&material, &c, &body, &u);
            for i in 0..body.families() {
                let p: f64 = body.bonds(i).map(|s| forces[s][0] * body.xi(i, s)[0] * body.volume(body.neighbor[s] as usize)).sum();
                let want = sigma * stretch.powf(2.0 * m - 1.0);
                assert!((p - want).abs() < 1e-11 * yield_stress, "{m}, {stretch}: {p:e} {want:e}");
            }
            let (rest, old) = (vec![0.0; body.points() * ROW], body.clone());
            for i in 0..old.families() {
                let shape = material.shape(&c, Reference::<1>::new(&old.view(&rest), i)).expect("a regular family");
                material.commit(&c, &shape, Family::<f64, 1>::new(&old.view(&u), i), &mut body.memory[2 * i..][..2], &mut []);
            }
        }
    }
}

/// A family along a line in the plane: an error, or the strain along it alone.
#[test]
fn families_that_do_not_see_every_strain() {
    let bonds: Vec<([f64; 2], f64)> = [-2.0, -1.0, 1.0, 2.0].map(|x| ([0.6 * x, 0.8 * x], 1.0)).to_vec();
    let body = Body::star(&bonds, 2.0, 1.0);
    let rest = vec![0.0; body.points() * ROW];
    let view = body.view(&rest);
    let shape = |calibration| model(Probe, 0.0, calibration, One).shape(&(0, 0), Reference::<2>::new(&view, 0)).err();
    assert_eq!(shape(MomentTensor), Some(SingularFamily));
    assert_eq!(shape(TruncatedMomentTensor), None);
    let truncated = model(Probe, 0.0, TruncatedMomentTensor, One);
    let kept = truncated.shape(&(0, 0), Reference::<2>::new(&view, 0)).expect("the strain along the line");
    assert!(Material::<2>::shortfall(&truncated, &kept).is_some());
    let f = [[1.05, 0.02], [0.01, 0.97]];
    let e = strain(&body, &body.affine(f), 1.0, TruncatedMomentTensor);
    // n n (n·E n) with n = (0.6, 0.8)
    let green = common::closed::green_lagrange(f);
    let along = 0.36 * green[0][0] + 0.96 * green[0][1] + 0.64 * green[1][1];
    let want = [[0.36 * along, 0.48 * along], [0.48 * along, 0.64 * along]];
    assert!(worst(e, want) < 1e-16, "{e:?} {want:?}");
    // three directions in the plane are enough
    let bonds: Vec<([f64; 2], f64)> = [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].map(|x| (x, 1.0)).to_vec();
    let body = Body::star(&bonds, 2.0, 1.0);
    assert!(worst(strain(&body, &body.affine(f), 1.0, MomentTensor), green) < 1e-15);
    // and no bonds are none
    let body = Body::<2>::star(&bonds, 2.0, 1.0).broken(2.0);
    let view = body.view(&rest);
    for calibration in [AsPublished, MomentTensor, TruncatedMomentTensor] {
        assert!(model(Probe, 0.0, calibration, One).shape(&(0, 0), Reference::<2>::new(&view, 0)).is_err());
    }
}

#[test]
fn exponents_that_overflow() {
    for m in [50.1, -51.0, 1e300, f64::NAN, f64::INFINITY] {
        let error = SethHill::new(m).expect_err("too large").to_string();
        assert!(error.contains("overflow") && error.contains("-50 and 50"), "{error}");
    }
    for m in [-50.0, 50.0] {
        for stretch in [1e-3f64, 1e3] {
            let x = stretch * stretch - 1.0;
            assert!(SethHill::new(m).unwrap().strain(x).is_finite());
        }
    }
    // a tiny exponent is the logarithm
    for m in [1e-300, -1e-18, 1e-16, 1e-9] {
        let e: f64 = SethHill::new(m).unwrap().strain(0.44);
        assert!((e - 1.2f64.ln()).abs() < 1e-9, "{m}: {e}");
    }
    for (d, m) in [(1, 0.5), (2, 0.0), (3, -0.5)] {
        assert_eq!(SethHill::neutral(d).exponent(), m);
    }
    // small strains keep their digits
    for m in EXPONENTS {
        let e: f64 = SethHill::new(m).unwrap().strain(2e-12);
        assert!((e / 1e-12 - 1.0).abs() < 1e-11, "{m}: {e}");
    }
}
