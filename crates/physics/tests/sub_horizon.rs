//! Sub-horizons beside the contract: a convex law gives a convex energy of the body, and the mean gradient is of second order.

mod common;

use common::Body;
use physics::constitutive::{
    HyperelasticConstants, J2Plasticity, J2PlasticityConstants, Law, LinearElastic, OfStrain, OfStrainConstants, StrainLaw, StrainMeasure,
};
use physics::elasticity::{Isotropic, Section, Stiffness};
use physics::family::{Family, Reference};
use physics::influence::One;
use physics::material::Material;
use physics::models::{EmptySubHorizon, SubHorizonCorrespondence};
use physics::scalar::ROW;
use physics::sub_horizon::Partition;

const STEEL: Isotropic = Isotropic { young: 200e9, poisson: 0.3 };
const PLANE: Section = Section::PlaneStrain { thickness: 1.0 };
const SPACING: f64 = 1e-3;

/// Energy of a jittered body with unequal volumes, on closed quadrants.
fn energy<L: Law<2>>(body: &Body<2>, law: L, c: &L::Constants, u: &[f64]) -> f64 {
    let model = SubHorizonCorrespondence::<_, _, 4> { law, omega: One, empty: EmptySubHorizon::Renormalise };
    let rest = vec![0.0; u.len()];
    (0..body.families())
        .map(|i| {
            let shape = Material::<2>::shape(&model, c, Reference::new(&body.view(&rest), i)).expect("a regular family");
            body.volume(i) * model.energy_density(c, &shape, Family::<f64, 2>::new(&body.view(u), i))
        })
        .sum()
}

#[test]
fn a_convex_law_gives_a_convex_energy() {
    let body = Body::<2>::cloud(10, SPACING, 2.6, false).divided(Partition::Orthants, 4);
    let elastic = Stiffness::isotropic(STEEL, 0.0, PLANE);
    // the incremental potential of plastic flow is convex too: linear where it flows without hardening
    let plastic = J2PlasticityConstants::new(STEEL, 0.02 * STEEL.young, 0.1 * STEEL.young, 0.0, PLANE).expect("a material");
    let plastic = OfStrainConstants { measure: StrainMeasure::Small, law: plastic };
    let with_history = {
        let mut b = body.clone();
        b.memory_words = 4 * <J2Plasticity as StrainLaw<2>>::MEMORY;
        b.memory = vec![0.0; b.memory_words * b.points()];
        b
    };
    let mut least = [f64::INFINITY; 2];
    for seed in 0..20 {
        let [a, b] = [1, 2].map(|k| body.random(SPACING, 10 * seed + k));
        for t in [0.1, 0.5, 0.8] {
            let between: Vec<f64> = a.iter().zip(&b).map(|(a, b)| (1.0 - t) * a + t * b).collect();
            let chord = |w: &dyn Fn(&[f64]) -> f64| {
                let above = (1.0 - t) * w(&a) + t * w(&b);
                (above - w(&between)) / above
            };
            let slack = [
                chord(&|u| energy(&body, LinearElastic, &elastic, u)),
                chord(&|u| energy(&with_history, OfStrain(J2Plasticity), &plastic, u)),
            ];
            least = [0, 1].map(|k: usize| least[k].min(slack[k]));
        }
    }
    println!("least slack of a chord: elastic {:.3}, plastic {:.3}", least[0], least[1]);
    assert!(least.iter().all(|s| *s > 0.0));
}

/// F_α is off by first order in δ, the mean of all by second: u = x² about x = 0 of a bar has no gradient there, u = x³ a small one.
#[test]
fn the_mean_gradient_is_of_second_order() {
    let gradient = |points: usize, power: i32, side: f64| {
        // one family of `points` on each side within δ = 1; the gradient of a half-line is Σ ξ u/Σ ξ²
        let xi = |k: usize| k as f64 / points as f64;
        let (sum, square) = (1..=points).fold((0.0, 0.0), |(a, b), k| (a + side * xi(k) * (side * xi(k)).powi(power), b + xi(k) * xi(k)));
        sum / square
    };
    let c = HyperelasticConstants::LinearElastic(Stiffness::isotropic(STEEL, 0.0, Section::Bar { area: 1.0 }));
    let model =
        SubHorizonCorrespondence::<_, _, 8> { law: physics::constitutive::Hyperelastic, omega: One, empty: EmptySubHorizon::Renormalise };
    for (points, power) in [(5, 2), (5, 3), (12, 2), (12, 3)] {
        let bonds: Vec<([f64; 1], f64)> = (1..=points).flat_map(|k| [1.0, -1.0].map(|s| ([s * k as f64 / points as f64], 0.1))).collect();
        let body = Body::<1>::star(&bonds, 1.0, 0.1).divided(Partition::Intervals(2), 8);
        let u = body.displaced(|_, x| [1e-3 * x[0].powi(power)]);
        let rest = vec![0.0; body.points() * ROW];
        let shape = Material::<1>::shape(&model, &c, Reference::new(&body.view(&rest), 0)).expect("a regular family");
        let view = body.view(&u);
        let family = Family::<f64, 1>::new(&view, 0);
        let state = model.state(&c, &shape, family);
        let stress: f64 = family.integrate(|b| model.force(&state, b).outer(b.xi())).0[0][0] / STEEL.young;
        let want = 0.5 * 1e-3 * (gradient(points, power, 1.0) + gradient(points, power, -1.0));
        assert!((stress - want).abs() < 1e-15, "{points} {power}: {stress} {want}");
        assert!(power == 3 || stress.abs() < 1e-15);
    }
}
