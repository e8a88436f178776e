//! J2 plasticity against closed forms, in every section and both kinematics.

use physics::constitutive::{
    Almansi, Deformation, FromCauchy, J2Plasticity, J2PlasticityConstants, Law, LinearElastic, NeoHookean, NeoHookeanConstants, OfStrain,
    OfStrainConstants, SaintVenantKirchhoff, Strain, StrainLaw, StrainMeasure,
};
use physics::elasticity::{Isotropic, Orthotropic, Section, Stiffness, rotate};
use physics::scalar::{Dual, Scalar};
use physics::tensor::Matrix;

const STEEL: Isotropic = Isotropic { young: 200e9, poisson: 0.3 };
/// σ_y, H
const YIELD: f64 = 400e6;
const HARDENING: f64 = 5e9;
const SHEAR: f64 = 200e9 / 2.6;

const SOLID: Section = Section::Solid;
const BAR: Section = Section::Bar { area: 2e-6 };
const PLANE_STRAIN: Section = Section::PlaneStrain { thickness: 3e-3 };
const PLANE_STRESS: Section = Section::PlaneStress { thickness: 3e-3 };

fn constants(section: Section) -> J2PlasticityConstants {
    J2PlasticityConstants::new(STEEL, YIELD, HARDENING, 0.0, section).expect("steel")
}

/// Seeded numbers between −1 and 1.
struct Random(u64);
impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
    fn matrix<const D: usize>(&mut self, scale: f64) -> Matrix<f64, D> {
        Matrix(std::array::from_fn(|_| std::array::from_fn(|_| scale * self.next())))
    }
}

/// A point with its history.
struct Point<const D: usize> {
    constants: J2PlasticityConstants,
    memory: Vec<f64>,
}
impl<const D: usize> Point<D> {
    fn new(section: Section) -> Self {
        Point { constants: constants(section), memory: vec![0.0; <J2Plasticity as StrainLaw<D>>::MEMORY] }
    }
    fn strain<R: Scalar>(&self, e: Matrix<R, D>) -> Strain<'_, R, D> {
        Strain { tensor: e, temperature: 0.0, memory: &self.memory }
    }
    fn stress(&self, e: Matrix<f64, D>) -> Matrix<f64, D> {
        J2Plasticity.stress(&self.constants, &self.strain(e))
    }
    fn energy(&self, e: Matrix<f64, D>) -> f64 {
        J2Plasticity.energy(&self.constants, &self.strain(e))
    }
    fn accept(&mut self, e: Matrix<f64, D>) {
        let mut new = self.memory.clone();
        J2Plasticity.commit(&self.constants, &self.strain(e), &mut new);
        self.memory = new;
    }
    fn equivalent(&self) -> f64 {
        self.memory[self.memory.len() - 1]
    }
}

fn close(name: &str, got: f64, want: f64, scale: f64) {
    let off = (got - want).abs() / scale;
    assert!(off < 1e-13, "{name}: {got:e}, {want:e}: {off:.1e}");
}

fn diagonal<const D: usize>(x: [f64; D]) -> Matrix<f64, D> {
    Matrix(std::array::from_fn(|i| std::array::from_fn(|j| if i == j { x[i] } else { 0.0 })))
}

/// The uniaxial test by hand: loading, unloading, reloading, and yielding in compression at the hardened strength.
fn uniaxial_path() -> Vec<(f64, f64, f64)> {
    let e = STEEL.young;
    // (strain, stress, plastic strain)
    let (mut plastic, mut equivalent, mut path) = (0.0f64, 0.0f64, vec![]);
    for strain in [0.001, 0.002, 0.0035, 0.006, 0.0052, 0.0035, 0.0055, 0.0065, 0.009, 0.002, -0.004, -0.0035, 0.004] {
        let trial: f64 = e * (strain - plastic);
        let beyond = trial.abs() - YIELD - HARDENING * equivalent;
        if beyond > 0.0 {
            plastic += trial.signum() * beyond / (e + HARDENING);
            equivalent += beyond / (e + HARDENING);
        }
        path.push((strain, e * (strain - plastic), plastic));
    }
    // monotone part in the textbook form: σ = σ_y + E H/(E + H) (ε − ε_y)
    let tangent = e * HARDENING / (e + HARDENING);
    assert!((path[3].1 / (YIELD + tangent * (0.006 - YIELD / e)) - 1.0).abs() < 1e-14);
    path
}

#[test]
fn a_tension_test_in_every_section() {
    let (mut bar, mut plane, mut solid) = (Point::<1>::new(BAR), Point::<2>::new(PLANE_STRESS), Point::<3>::new(SOLID));
    for (strain, stress, plastic) in uniaxial_path() {
        // across: −ν σ/E − εᵖ/2
        let across = -STEEL.poisson * stress / STEEL.young - 0.5 * plastic;
        let strains = (diagonal([strain]), diagonal([strain, across]), diagonal([strain, across, across]));
        close("bar", bar.stress(strains.0).0[0][0], stress, YIELD);
        let s = plane.stress(strains.1).0;
        close("plane stress", s[0][0], stress, YIELD);
        close("plane stress, across", s[1][1], 0.0, YIELD);
        let s = solid.stress(strains.2).0;
        for k in 0..3 {
            close("solid", s[k][k], if k == 0 { stress } else { 0.0 }, YIELD);
        }
        // the energies too: elastic energy and plastic work
        bar.accept(strains.0);
        plane.accept(strains.1);
        solid.accept(strains.2);
        let a = bar.equivalent();
        let want = 0.5 * stress * stress / STEEL.young + YIELD * a + 0.5 * HARDENING * a * a;
        for (got, name) in [(bar.energy(strains.0), "bar"), (plane.energy(strains.1), "plane"), (solid.energy(strains.2), "solid")] {
            close(name, got, want, want);
        }
        for (got, name) in [(plane.equivalent(), "plane"), (solid.equivalent(), "solid")] {
            close(name, got, a, 1e-3);
        }
    }
    println!("tension, unloading, reloading, reversal: equivalent plastic strain {:.6}", bar.equivalent());
}

#[test]
fn simple_shear_of_small_strain() {
    // τ = τ_y + G H/(3G + H) (γ − γ_y), and elastic unloading
    let (mut solid, mut strain, mut stress) = (Point::<3>::new(SOLID), Point::<2>::new(PLANE_STRAIN), Point::<2>::new(PLANE_STRESS));
    let start = YIELD / 3f64.sqrt();
    let hand = |g: f64| start + SHEAR * HARDENING / (3.0 * SHEAR + HARDENING) * (g - start / SHEAR);
    for (g, want) in [
        (0.002, SHEAR * 0.002),
        (0.01, hand(0.01)),
        (0.02, hand(0.02)),
        (0.018, hand(0.02) - SHEAR * 0.002),
        (0.0145, hand(0.02) - SHEAR * 0.0055),
        (0.03, hand(0.03)),
    ] {
        let e3 = Matrix([[0.0, 0.5 * g, 0.0], [0.5 * g, 0.0, 0.0], [0.0; 3]]);
        let e2 = Matrix([[0.0, 0.5 * g], [0.5 * g, 0.0]]);
        close("solid", solid.stress(e3).0[0][1], want, YIELD);
        close("plane strain", strain.stress(e2).0[0][1], want, YIELD);
        close("plane stress", stress.stress(e2).0[0][1], want, YIELD);
        solid.accept(e3);
        strain.accept(e2);
        stress.accept(e2);
    }
}

/// Random paths in the plane: plane strain is the solid without strain across, plane stress the solid whose strain across makes the
/// stress there vanish.
#[test]
fn planes_are_sections_of_the_solid() {
    let mut r = Random(7);
    let (mut worst, mut yielded) = (0.0f64, 0);
    for _ in 0..20 {
        let (mut strain, mut stress) = (Point::<2>::new(PLANE_STRAIN), Point::<2>::new(PLANE_STRESS));
        let (mut held, mut free) = (Point::<3>::new(SOLID), Point::<3>::new(SOLID));
        for _ in 0..4 {
            let e: Matrix<f64, 2> = r.matrix(0.01).symmetric();
            let embed = |across: f64| Matrix([[e.0[0][0], e.0[0][1], 0.0], [e.0[1][0], e.0[1][1], 0.0], [0.0, 0.0, across]]);
            let in_plane = stress.stress(e);
            stress.accept(e);
            let across = -STEEL.poisson / STEEL.young * in_plane.trace() - stress.memory[0] - stress.memory[1];
            for (got, want, free) in [(strain.stress(e), held.stress(embed(0.0)), false), (in_plane, free.stress(embed(across)), true)] {
                for a in 0..2 {
                    for b in 0..2 {
                        worst = worst.max((got.0[a][b] - want.0[a][b]).abs() / YIELD);
                    }
                }
                if free {
                    worst = worst.max(want.0[2][2].abs() / YIELD);
                }
            }
            worst = worst.max((strain.energy(e) / held.energy(embed(0.0)) - 1.0).abs());
            worst = worst.max((stress.energy(e) / free.energy(embed(across)) - 1.0).abs());
            strain.accept(e);
            held.accept(embed(0.0));
            free.accept(embed(across));
            yielded += (stress.equivalent() > 0.0) as usize;
        }
    }
    println!("planes against the solid: worst {worst:.1e}, {yielded} of 80 increments after yielding");
    assert!(worst < 1e-12 && yielded > 60, "{worst:.1e}");
}

/// Without yielding the law is the linear elastic one, temperature included.
#[test]
fn below_yield_it_is_linear_elastic() {
    fn asked<const D: usize>(section: Section) {
        let c = J2PlasticityConstants { expansion: 1e-5, ..constants(section) };
        let memory = [0.0; 7];
        let mut r = Random(3);
        for _ in 0..10 {
            let e = Strain { tensor: r.matrix::<D>(3e-4).symmetric(), temperature: 20.0, memory: &memory };
            let k = Stiffness::isotropic(STEEL, 1e-5, section);
            let (got, want) = (J2Plasticity.stress(&c, &e), StrainLaw::<D>::stress(&LinearElastic, &k, &e));
            for a in 0..D {
                for b in 0..D {
                    close("stress", got.0[a][b], want.0[a][b], YIELD);
                }
            }
            let want = StrainLaw::<D>::energy(&LinearElastic, &k, &e);
            assert!((J2Plasticity.energy(&c, &e) / want - 1.0).abs() < 1e-12);
        }
    }
    asked::<1>(BAR);
    asked::<2>(PLANE_STRAIN);
    asked::<2>(PLANE_STRESS);
    asked::<3>(SOLID);
}

#[test]
fn constants_that_no_material_has() {
    let bad = [
        (Isotropic { young: -1.0, ..STEEL }, YIELD, HARDENING, "Young"),
        (Isotropic { poisson: 0.5, ..STEEL }, YIELD, HARDENING, "Poisson"),
        (STEEL, 0.0, HARDENING, "yield"),
        (STEEL, f64::NAN, HARDENING, "yield"),
        (STEEL, YIELD, -1.0, "softening"),
        (STEEL, YIELD, f64::INFINITY, "hardening"),
    ];
    for (elastic, strength, hardening, word) in bad {
        let error = J2PlasticityConstants::new(elastic, strength, hardening, 0.0, SOLID).expect_err("not a material").to_string();
        assert!(error.contains(word), "{error}");
    }
}

// ------------------------------------------------------------------------------------------------ laws of F

type Finite = OfStrain<J2Plasticity>;

fn law(measure: StrainMeasure, section: Section) -> (Finite, OfStrainConstants<J2PlasticityConstants>) {
    (OfStrain(J2Plasticity), OfStrainConstants { measure, law: constants(section) })
}

fn deformation<R: Scalar, const D: usize>(gradient: Matrix<R, D>, memory: &[f64]) -> Deformation<'_, R, D> {
    Deformation { memory, ..Deformation::of(gradient) }
}

fn words<const D: usize>() -> usize {
    <Finite as Law<D>>::MEMORY
}

/// History after two random increments far beyond yield.
fn used<const D: usize>(measure: StrainMeasure, section: Section, seed: u64) -> Vec<f64> {
    let (law, c) = law(measure, section);
    let (mut memory, mut r) = (vec![0.0; words::<D>()], Random(seed));
    for _ in 0..2 {
        let old = memory.clone();
        law.commit(&c, &deformation(r.matrix::<D>(0.03), &old), &mut memory);
    }
    assert!(memory[words::<D>() - 1] > 0.0);
    memory
}

/// P against the derivative of ψ, and the derivative of P against differences, also where principal stretches are equal.
#[test]
fn stress_and_tangent_are_derivatives() {
    fn asked<const D: usize>(section: Section) -> [f64; 2] {
        let mut worst = [0.0f64; 2];
        for measure in [StrainMeasure::Small, StrainMeasure::GreenLagrange, StrainMeasure::Logarithmic] {
            let (law, c) = law(measure, section);
            let mut r = Random(11);
            let rotated = {
                // a dilatation turned: all stretches equal
                let (s, k) = 0.4f64.sin_cos();
                let mut q = Matrix::<f64, D>::identity();
                if D > 1 {
                    (q.0[0][0], q.0[0][1], q.0[1][0], q.0[1][1]) = (k, -s, s, k);
                }
                q * 1.07 - Matrix::identity()
            };
            let mut two_equal = Matrix::<f64, D>::identity() * 0.04;
            two_equal.0[0][0] = -0.09;
            let cases = [r.matrix(0.06), r.matrix(0.06), rotated, two_equal, Matrix::identity() * 0.05, Matrix::zero()];
            for (k, h) in cases.into_iter().enumerate() {
                for memory in [vec![0.0; words::<D>()], used::<D>(measure, section, 5 + k as u64)] {
                    let p = law.first_piola(&c, &deformation(h, &memory));
                    let size = p.double_dot(p).sqrt() + YIELD;
                    for _ in 0..3 {
                        let z = r.matrix::<D>(1.0);
                        let along = |s: f64| h + z * s;
                        let jet: Matrix<Dual, D> =
                            Matrix(std::array::from_fn(|i| std::array::from_fn(|j| Dual { value: h.0[i][j], slope: [z.0[i][j]] })));
                        let f = deformation(jet, &memory);
                        let slope = law.energy(&c, &f).slope[0];
                        worst[0] = worst[0].max((slope - p.double_dot(z)).abs() / size);
                        let by_jets = law.first_piola(&c, &f);
                        let step = 1e-6;
                        let [plus, minus] = [step, -step].map(|s| law.first_piola(&c, &deformation(along(s), &memory)));
                        // at the reference state without history nothing yields, elsewhere everything does: no kink within a step
                        for a in 0..D {
                            for b in 0..D {
                                let difference = (plus.0[a][b] - minus.0[a][b]) / (2.0 * step);
                                worst[1] = worst[1].max((difference - by_jets.0[a][b].slope[0]).abs() / STEEL.young);
                            }
                        }
                    }
                }
            }
        }
        worst
    }
    let all = [asked::<1>(BAR), asked::<2>(PLANE_STRAIN), asked::<2>(PLANE_STRESS), asked::<3>(SOLID)];
    println!("P = ∂ψ/∂F and ∂P/∂F against differences, bar, plane strain, plane stress, solid: {all:?}");
    for [energy, tangent] in all {
        assert!(energy < 1e-12 && tangent < 3e-8, "{energy:.1e} {tangent:.1e}");
    }
}

/// ψ(QF) = ψ(F) and P(QF) = Q P(F), with history, for a rotation by 2.5 rad.
#[test]
fn large_rotations_are_free() {
    let mut worst = 0.0f64;
    for measure in [StrainMeasure::GreenLagrange, StrainMeasure::Logarithmic] {
        let (law, c) = law(measure, SOLID);
        let memory = used::<3>(measure, SOLID, 21);
        let mut r = Random(9);
        let axis = [2.0 / 7.0, 3.0 / 7.0, 6.0 / 7.0];
        let (s, k) = 2.5f64.sin_cos();
        let cross = [[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]];
        let q = Matrix(std::array::from_fn(|i| {
            std::array::from_fn(|j| (i == j) as u8 as f64 * k + (1.0 - k) * axis[i] * axis[j] + s * cross[i][j])
        }));
        for _ in 0..5 {
            let h = r.matrix::<3>(0.05);
            let turned = q * (h + Matrix::identity()) - Matrix::identity();
            let (a, b) = (deformation(h, &memory), deformation(turned, &memory));
            let (p, want) = (law.first_piola(&c, &b), q * law.first_piola(&c, &a));
            let d = p - want;
            worst = worst.max((d.double_dot(d) / p.double_dot(p)).sqrt());
            worst = worst.max((law.energy(&c, &b) / law.energy(&c, &a) - 1.0).abs());
        }
    }
    println!("rotation by 2.5 rad: worst {worst:.1e}");
    assert!(worst < 1e-11, "{worst:.1e}");
}

/// A bar, a sheet and a solid drawn to a stretch of 1.5: the true (logarithmic) strain follows the uniaxial law, P = τ/λ.
#[test]
fn tension_at_finite_strain() {
    for stretch in [1.001f64, 1.05, 1.5, 0.7] {
        let e = stretch.ln();
        let trial = STEEL.young * e;
        let step = (trial.abs() - YIELD).max(0.0) / (STEEL.young + HARDENING);
        let plastic = trial.signum() * step;
        let tau = STEEL.young * (e - plastic);
        let across = (-STEEL.poisson * tau / STEEL.young - 0.5 * plastic).exp();
        let want = tau / stretch;
        let bar = law(StrainMeasure::Logarithmic, BAR);
        let got = bar.0.first_piola(&bar.1, &deformation(diagonal([stretch - 1.0]), &[0.0; 2]));
        close("bar", got.0[0][0], want, YIELD);
        let sheet = law(StrainMeasure::Logarithmic, PLANE_STRESS);
        let got = sheet.0.first_piola(&sheet.1, &deformation(diagonal([stretch - 1.0, across - 1.0]), &[0.0; 4]));
        let solid = law(StrainMeasure::Logarithmic, SOLID);
        let full = solid.0.first_piola(&solid.1, &deformation(diagonal([stretch - 1.0, across - 1.0, across - 1.0]), &[0.0; 7]));
        // strains of some tenths against yield strains of 0.002: digits are lost in the trial stress
        let scale = YIELD + trial.abs();
        close("sheet", got.0[0][0], want, scale);
        close("sheet, across", got.0[1][1], 0.0, scale);
        for k in 0..3 {
            close("solid", full.0[k][k], if k == 0 { want } else { 0.0 }, scale);
        }
    }
}

/// Simple shear γ = 1.2 in one increment: ln λ = arsinh(γ/2) in principal axes, q = 2√3 G ln λ − 3G ε̄ᵖ, P₁₂ = q/√(3(1 + γ²/4)).
#[test]
fn simple_shear_at_finite_strain() {
    for gamma in [0.004f64, 0.1, 1.2] {
        let log = (0.5 * gamma).asinh();
        let trial = 2.0 * 3f64.sqrt() * SHEAR * log;
        let equivalent = (trial - YIELD).max(0.0) / (3.0 * SHEAR + HARDENING);
        let q = trial - 3.0 * SHEAR * equivalent;
        let energy = q * q / (6.0 * SHEAR) + YIELD * equivalent + 0.5 * HARDENING * equivalent * equivalent;
        let want = q / (3.0 * (1.0 + 0.25 * gamma * gamma)).sqrt();
        let h = Matrix([[0.0, gamma], [0.0, 0.0]]);
        let h3 = Matrix([[0.0, gamma, 0.0], [0.0; 3], [0.0; 3]]);
        let (l, c) = law(StrainMeasure::Logarithmic, SOLID);
        close("solid", l.first_piola(&c, &deformation(h3, &[0.0; 7])).0[0][1], want, YIELD + trial);
        close("energy", l.energy(&c, &deformation(h3, &[0.0; 7])), energy, energy);
        for section in [PLANE_STRAIN, PLANE_STRESS] {
            let (l, c) = law(StrainMeasure::Logarithmic, section);
            close("plane", l.first_piola(&c, &deformation(h, &[0.0; 4])).0[0][1], want, YIELD + trial);
        }
    }
}

/// At strains of 10⁻⁶ (of a soft material that yields there) the measures agree to the order of the strain.
#[test]
fn the_finite_law_is_the_small_one_for_small_strains() {
    let soft = J2PlasticityConstants { yield_stress: 1e-6 * STEEL.young, hardening: 0.1 * STEEL.young, ..constants(SOLID) };
    let mut r = Random(13);
    let mut worst = 0.0f64;
    for _ in 0..5 {
        let h = r.matrix::<3>(3e-6);
        let [small, log] = [StrainMeasure::Small, StrainMeasure::Logarithmic].map(|measure| {
            let c = OfStrainConstants { measure, law: soft };
            let mut memory = [0.0; 7];
            OfStrain(J2Plasticity).commit(&c, &deformation(h, &[0.0; 7]), &mut memory);
            assert!(memory[6] > 0.0);
            OfStrain(J2Plasticity).first_piola(&c, &deformation(h * 1.5, &memory))
        });
        let d = small - log;
        worst = worst.max((d.double_dot(d) / small.double_dot(small)).sqrt());
    }
    println!("small against logarithmic strain at 1e-6: {worst:.1e}");
    assert!(worst < 5e-5 && worst > 1e-9, "{worst:.1e}");
}

/// A strain in the plane as one of space.
fn embedded(h: &Matrix<f64, 2>) -> Matrix<f64, 3> {
    Matrix(std::array::from_fn(|a| std::array::from_fn(|b| if a < 2 && b < 2 { h.0[a][b] } else { 0.0 })))
}

#[test]
fn the_stress_across_the_plane_is_that_of_the_solid() {
    // plane strain is a solid that is held across: along a random path beyond yield, and after it, σ₃₃ is the solid's
    let mut random = Random(91);
    let (mut plane, mut solid) = (Point::<2>::new(PLANE_STRAIN), Point::<3>::new(SOLID));
    let (mut elastic, mut worst) = (0.0f64, 0.0f64);
    for step in 1..=20 {
        let e = random.matrix::<2>(1e-3 * step as f64).symmetric();
        let want = solid.stress(embedded(&e)).0[2][2];
        let got = J2Plasticity.out_of_plane_stress(&plane.constants, &plane.strain(e));
        worst = worst.max((got - want).abs() / YIELD);
        let in_plane = plane.stress(e);
        elastic = elastic.max((STEEL.poisson * in_plane.trace() - want).abs() / YIELD);
        plane.accept(e);
        solid.accept(embedded(&e));
    }
    println!("stress across the plane: {worst:.1e} of the yield stress; by the elastic relation {elastic:.2}");
    assert!(worst < 1e-13, "{worst:e}");
    assert!(elastic > 0.1, "the elastic relation would do: {elastic}");
    // plane stress has none
    let e = random.matrix::<2>(0.01).symmetric();
    let point = Point::<2>::new(PLANE_STRESS);
    assert_eq!(J2Plasticity.out_of_plane_stress(&point.constants, &point.strain(e)), 0.0);

    // the laws of F: the same with the solid's first Piola stress, heated
    fn compare<A: Law<2>, B: Law<3>>(name: &str, plane: (A, A::Constants), solid: (B, B::Constants), scale: f64, words: (usize, usize)) {
        let mut random = Random(17);
        for _ in 0..10 {
            let h = random.matrix::<2>(0.2);
            let (few, many) = (vec![0.0; words.0], vec![0.0; words.1]);
            let f = Deformation { gradient: h, rate: Matrix::zero(), temperature: 40.0, time: 0.0, memory: &few };
            let g = Deformation { gradient: embedded(&h), rate: Matrix::zero(), temperature: 40.0, time: 0.0, memory: &many };
            let want = solid.0.first_piola(&solid.1, &g).0[2][2];
            let got = plane.0.out_of_plane_stress(&plane.1, &f);
            assert!((got - want).abs() < 1e-12 * scale, "{name}: {got:e} {want:e}");
        }
    }
    let (alpha, young) = (1.2e-4, STEEL.young);
    let c = (Stiffness::<2>::isotropic(STEEL, alpha, PLANE_STRAIN), Stiffness::<3>::isotropic(STEEL, alpha, SOLID));
    compare("linear", (LinearElastic, c.0), (LinearElastic, c.1), young, (0, 0));
    compare("Saint-Venant-Kirchhoff", (SaintVenantKirchhoff, c.0), (SaintVenantKirchhoff, c.1), young, (0, 0));
    let hooke = |section| NeoHookeanConstants { elastic: STEEL, expansion: alpha, section };
    compare("neo-Hooke", (NeoHookean, hooke(PLANE_STRAIN)), (NeoHookean, hooke(SOLID)), young, (0, 0));
    compare("Almansi", (FromCauchy(Almansi), (STEEL, PLANE_STRAIN)), (FromCauchy(Almansi), (STEEL, SOLID)), young, (0, 0));
    for measure in [StrainMeasure::Small, StrainMeasure::GreenLagrange, StrainMeasure::Logarithmic] {
        let (a, b) = (law(measure, PLANE_STRAIN), law(measure, SOLID));
        compare("plastic", (a.0, a.1), (b.0, b.1), young, (words::<2>(), words::<3>()));
    }
    // an orthotropic stiffness turned in the plane
    let axes = [[0.8, 0.6, 0.0], [-0.6, 0.8, 0.0], [0.0, 0.0, 1.0]];
    let ply = Orthotropic { young: [140e9, 10e9, 9e9], shear: [3e9, 5e9, 6e9], poisson: [0.4, 0.3, 0.25] };
    let voigt = rotate(&ply.voigt().unwrap(), &axes);
    let expansion = [1e-6, 3e-5, 2e-5, 0.0, 0.0, 4e-6];
    let c = (Stiffness::<2>::new(&voigt, &expansion, PLANE_STRAIN), Stiffness::<3>::new(&voigt, &expansion, SOLID));
    compare("orthotropic", (SaintVenantKirchhoff, c.0), (SaintVenantKirchhoff, c.1), 140e9, (0, 0));
}
