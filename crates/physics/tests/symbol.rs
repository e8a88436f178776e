//! The Bloch symbol of an infinite lattice: what a plane wave of every wave vector costs.
//!
//! For `u(x) = U exp(i k·x)` a bond deforms by `η⟨ξ_b⟩ = e_b u`, `e_b = exp(i k·ξ_b) − 1`, and the second-order energy density
//! is `½ Ū·S(k) U` with
//!
//! `S(k) = Σ_bc ē_b V_b (∂T⟨ξ_b⟩/∂Y⟨ξ_c⟩) e_c`.
//!
//! The derivatives come from jets through `state` and `force` of one interior family: no code here knows a model.

mod common;

use common::closed;
use physics::constitutive::LinearElastic;
use physics::elasticity::{Isotropic, Section, Stiffness};
use physics::family::{Family, Reference};
use physics::influence::{One, Stored};
use physics::isotropy::fourth_moment_factors;
use physics::material::Material;
use physics::models::{
    BondBased, BondBasedConstants, BondStrainCalibration, CorrectedCorrespondence, Correspondence, EmptySubHorizon, ExtendedCorrespondence,
    LinearPeridynamicSolid, LinearPeridynamicSolidConstants, SethHill, SubHorizonCorrespondence,
};
use physics::scalar::{Jet, ROW, Scalar};
use physics::stretch_law::Elastic;
use physics::sub_horizon::Partition;
use physics::tensor::{Vector, symmetric_eigen};
use physics::zero_energy::{self, Control, NoControl, Wan2019};
use std::f64::consts::PI;

/// E = 1, ν = 1/4, on a lattice of unit spacing and volume.
const SOLID: Isotropic = Isotropic { young: 1.0, poisson: 0.25 };
/// Directions of one jet.
const N: usize = 8;

/// Section of unit measure, plane strain in two dimensions.
fn section<const D: usize>() -> Section {
    [Section::Bar { area: 1.0 }, Section::PlaneStrain { thickness: 1.0 }, Section::Solid][D - 1]
}

/// Bonds and tangent of one interior family.
struct Lattice<const D: usize> {
    bonds: Vec<[f64; D]>,
    /// V_b ∂T_b,α/∂Y_c,β at ((b D + α) n + c) D + β
    tangent: Vec<f64>,
}

impl<const D: usize> Lattice<D> {
    fn new<M: Material<D>>(material: M, constants: M::Constants, delta: f64) -> Self {
        Self::corrected(material, constants, delta, None)
    }
    /// With fourth-moment weights of the given power.
    fn corrected<M: Material<D>>(material: M, constants: M::Constants, delta: f64, power: Option<i32>) -> Self {
        Self::prepared(material, constants, delta, power, None, 1.0)
    }
    /// With the family divided into sub-horizons.
    fn divided<const P: usize>(partition: Partition, empty: EmptySubHorizon, delta: f64) -> Self {
        let model = SubHorizonCorrespondence::<_, _, P> { law: LinearElastic, omega: One, empty };
        Self::prepared(model, Stiffness::isotropic(SOLID, 0.0, section::<D>()), delta, None, Some((partition, P)), 1.0)
    }
    /// About a uniform dilatation of the given stretch.
    fn prepared<M: Material<D>>(
        material: M,
        constants: M::Constants,
        delta: f64,
        power: Option<i32>,
        partition: Option<(Partition, usize)>,
        stretch: f64,
    ) -> Self {
        let n = delta as i64 + 1;
        let side = (2 * n + 1) as usize;
        let bonds: Vec<[f64; D]> = (0..side.pow(D as u32))
            .map(|q| std::array::from_fn(|k| (q / side.pow(k as u32) % side) as f64 - n as f64))
            .filter(|x: &[f64; D]| {
                let r = x.iter().map(|x| x * x).sum::<f64>().sqrt();
                r > 0.0 && r <= delta * (1.0 + 1e-9)
            })
            .collect();
        let list: Vec<([f64; D], f64)> = bonds.iter().map(|x| (*x, 1.0)).collect();
        let mut body = common::Body::star(&list, delta, 1.0);
        body.weight = vec![1.0; body.neighbor.len()];
        if let Some(power) = power {
            let bonds: Vec<(Vector<f64, D>, f64)> = bonds.iter().map(|x| (Vector(*x), 1.0)).collect();
            let factors = fourth_moment_factors(&bonds, power).expect("a family that can be corrected");
            body.weight[..factors.len()].copy_from_slice(&factors);
        }
        if let Some((partition, planes)) = partition {
            body = body.divided(partition, planes);
        }
        let rest = vec![0.0; body.points() * ROW];
        let shape = material.shape(&constants, Reference::new(&body.view(&rest), 0)).expect("a full family");
        let size = bonds.len() * D;
        let mut tangent = vec![0.0; size * size];
        for first in (0..size).step_by(N) {
            let mut u: Vec<Jet<N>> =
                body.displaced(|_, x| std::array::from_fn(|k| (stretch - 1.0) * x[k])).into_iter().map(Jet::of).collect();
            for direction in first..size.min(first + N) {
                // far point c is point c + 1
                u[(direction / D + 1) * ROW + direction % D].slope[direction - first] = 1.0;
            }
            let view = body.view(&u);
            let family = Family::<Jet<N>, D>::new(&view, 0);
            let state = material.state(&constants, &shape, family);
            family.each(|b| {
                let t = material.force(&state, b) * b.volume();
                for alpha in 0..D {
                    for direction in first..size.min(first + N) {
                        tangent[(b.slot() * D + alpha) * size + direction] = t.0[alpha].slope[direction - first];
                    }
                }
            });
        }
        Lattice { bonds, tangent }
    }

    /// S(k): real and imaginary part. Real for a family with a centre of symmetry, which is not assumed.
    fn symbol(&self, k: [f64; D]) -> [[[f64; D]; D]; 2] {
        let e: Vec<[f64; 2]> = self
            .bonds
            .iter()
            .map(|x| {
                let (s, c) = (0..D).map(|a| k[a] * x[a]).sum::<f64>().sin_cos();
                [c - 1.0, s]
            })
            .collect();
        let size = self.bonds.len() * D;
        let mut symbol = [[[0.0; D]; D]; 2];
        for (row, tangent) in self.tangent.chunks(size).enumerate() {
            let (b, alpha) = (e[row / D], row % D);
            let mut sum = [[0.0; 2]; D];
            for (column, t) in tangent.iter().enumerate() {
                let c = e[column / D];
                sum[column % D][0] += t * c[0];
                sum[column % D][1] += t * c[1];
            }
            for beta in 0..D {
                let [re, im] = sum[beta];
                // times the conjugate of e_b
                symbol[0][alpha][beta] += b[0] * re + b[1] * im;
                symbol[1][alpha][beta] += b[0] * im - b[1] * re;
            }
        }
        symbol
    }

    /// The D eigenvalues of the Hermitian S(k), ascending: every second one of the real symmetric matrix of twice the size.
    fn eigenvalues(&self, k: [f64; D]) -> Vec<f64> {
        let [re, im] = self.symbol(k);
        let n = 2 * D;
        let at = |i: usize, j: usize| match (i / D, j / D) {
            (0, 0) | (1, 1) => re[i % D][j % D],
            (0, _) => -im[i % D][j % D],
            _ => im[i % D][j % D],
        };
        let matrix: Vec<f64> = (0..n * n).map(|q| 0.5 * (at(q / n, q % n) + at(q % n, q / n))).collect();
        symmetric_eigen(&matrix, n).0.into_iter().step_by(2).collect()
    }
}

/// Wave vectors of a grid over the Brillouin zone, components jπ/`n` with −n < j ≤ n, without k = 0: all that have
/// components in {0, π} are among them.
fn zone<const D: usize>(n: i64) -> Vec<[i64; D]> {
    let side = 2 * n as usize;
    (0..side.pow(D as u32))
        .map(|q| std::array::from_fn(|k| (q / side.pow(k as u32) % side) as i64 - n + 1))
        .filter(|k: &[i64; D]| k.iter().any(|&k| k != 0))
        .collect()
}

/// Zero eigenvalues (below 1e-12 of the largest) at corners and elsewhere, and the smallest other eigenvalue over the largest.
fn zeros<const D: usize>(lattice: &Lattice<D>, n: i64) -> (usize, usize, f64) {
    let all: Vec<([i64; D], Vec<f64>)> =
        zone::<D>(n).into_iter().map(|k| (k, lattice.eigenvalues(k.map(|j| j as f64 * PI / n as f64)))).collect();
    let largest = all.iter().flat_map(|(_, e)| e).fold(0.0f64, |m, x| m.max(x.abs()));
    let (mut corners, mut elsewhere, mut smallest) = (0, 0, f64::INFINITY);
    for (k, e) in &all {
        let corner = k.iter().all(|&j| j == 0 || j == n);
        for x in e {
            assert!(*x > -1e-12 * largest, "unstable at {k:?}");
            if x.abs() < 1e-12 * largest {
                if corner { corners += 1 } else { elsewhere += 1 }
            } else {
                smallest = smallest.min(x / largest);
            }
        }
    }
    (corners, elsewhere, smallest)
}

fn correspondence<Z: Control<D>, const D: usize>(control: Z, delta: f64) -> Lattice<D> {
    let model = Correspondence { law: LinearElastic, control, omega: One };
    Lattice::new(model, Stiffness::isotropic(SOLID, 0.0, section::<D>()), delta)
}
fn silling(strength: f64) -> zero_energy::Isotropic {
    zero_energy::Isotropic::Silling2017 { strength }
}
fn extended<const D: usize>(m: f64, calibration: BondStrainCalibration, control: f64, delta: f64, stretch: f64) -> Lattice<D> {
    let exponent = SethHill::new(m).expect("a moderate exponent");
    let model = ExtendedCorrespondence { law: LinearElastic, exponent, calibration, control, omega: Stored };
    Lattice::prepared(model, Stiffness::isotropic(SOLID, 0.0, section::<D>()), delta, None, None, stretch)
}
fn bond_based<const D: usize>(delta: f64) -> Lattice<D> {
    let c = BondBasedConstants { young: 1.0, section: section::<D>(), continuum: false };
    Lattice::new(BondBased { law: Elastic, omega: One }, c, delta)
}
fn linear_solid<const D: usize>(delta: f64) -> Lattice<D> {
    Lattice::new(LinearPeridynamicSolid { omega: One }, LinearPeridynamicSolidConstants::new(SOLID, section::<D>()), delta)
}

/// Only the conventional model has modes without energy, and it has all D of them at each of the 2^D − 1 corners k ≠ 0.
#[test]
fn number_of_zero_energy_modes() {
    fn asked<const D: usize>(delta: f64, n: i64) {
        let (corners, elsewhere, smallest) = zeros(&correspondence::<_, D>(NoControl, delta), n);
        println!("{D}D, δ = {delta}: conventional {corners} + {elsewhere} zeros, smallest other eigenvalue {smallest:.1e} of the largest");
        assert_eq!((corners, elsewhere), (D * ((1 << D) - 1), 0), "{D}D, δ = {delta}");
        let mut others = vec![
            ("Wan2019", correspondence::<_, D>(Wan2019, delta)),
            ("isotropic Wan2019", correspondence::<_, D>(zero_energy::Isotropic::Wan2019, delta)),
            ("Silling2017, G = 1", correspondence::<_, D>(silling(1.0), delta)),
            ("Silling2017, G = 0.1", correspondence::<_, D>(silling(0.1), delta)),
        ];
        // nearest neighbours alone carry no shear in ordinary models: that is no matter of zero-energy control
        if delta > 1.5 || D == 1 {
            others.push(("bond-based", bond_based::<D>(delta)));
        }
        if delta > 1.5 && D > 1 {
            others.push(("linear peridynamic solid", linear_solid::<D>(delta)));
        }
        for (name, lattice) in others {
            let (corners, elsewhere, smallest) = zeros(&lattice, n);
            println!("  {name}: {} zeros, smallest eigenvalue {smallest:.2e} of the largest", corners + elsewhere);
            assert_eq!((corners, elsewhere), (0, 0), "{D}D, δ = {delta}, {name}");
            assert!(smallest > 1e-4, "{D}D, δ = {delta}, {name}: {smallest}");
        }
    }
    asked::<1>(1.1, 32);
    asked::<1>(5.1, 32);
    asked::<2>(1.1 * 2f64.sqrt(), 8);
    asked::<2>(3.1 * 2f64.sqrt(), 8);
    asked::<3>(1.8, 4);
    asked::<3>(3.1, 4);
}

/// Away from the grid of corners the conventional model has more zeros: its symbol is that of a gradient whose response
/// Σ ξ sin kξ changes sign within the zone, as 3(sin q − q cos q)/q³ does at q = kδ = 4.4934 in the continuum.
#[test]
fn the_conventional_gradient_also_vanishes_between_the_corners() {
    let delta = 20.1;
    let lattice = correspondence::<_, 1>(NoControl, delta);
    // twenty points fill a continuum of half-width 20.5: the root of Σ n sin kn near 4.4934/δ, by bisection
    let response = |k: f64| (1..=20).map(|n| n as f64 * (k * n as f64).sin()).sum::<f64>();
    let (mut a, mut b) = (4.0 / delta, 5.0 / delta);
    assert!(response(a) > 0.0 && response(b) < 0.0);
    for _ in 0..60 {
        let c = 0.5 * (a + b);
        if response(c) > 0.0 { a = c } else { b = c }
    }
    let ratio = lattice.eigenvalues([a])[0] / lattice.eigenvalues([2.0 / delta])[0];
    println!("zero within the zone at k δ = {:.4}, energy {ratio:.1e}", a * delta);
    assert!(ratio.abs() < 1e-14 && (a * 20.5 / 4.4934 - 1.0).abs() < 1e-3);
    assert!(correspondence::<_, 1>(Wan2019, delta).eigenvalues([a])[0] > 1e-2 * lattice.eigenvalues([2.0 / delta])[0]);
}

/// Long waves cost what they cost in the classical solid: S(k)/k² → C_ijkl n_j n_l.
#[test]
fn long_waves_are_classical() {
    fn asked<const D: usize>(lattice: &Lattice<D>, name: &str, limit: f64) -> f64 {
        let (e, n) = (SOLID.young, SOLID.poisson);
        let (lambda, mu) = (e * n / ((1.0 + n) * (1.0 - 2.0 * n)), e / (2.0 * (1.0 + n)));
        let mut worst = 0.0f64;
        for direction in [[1.0, 0.0, 0.0], [0.6, 0.8, 0.0], [2.0 / 7.0, 3.0 / 7.0, 6.0 / 7.0]] {
            let length = direction[..D].iter().map(|x| x * x).sum::<f64>().sqrt();
            let n: [f64; D] = std::array::from_fn(|k| direction[k] / length);
            let k = 1e-4;
            let [re, im] = lattice.symbol(n.map(|x| k * x));
            for a in 0..D {
                for b in 0..D {
                    let one = (a == b) as u8 as f64;
                    let want = if D == 1 { e } else { (lambda + mu) * n[a] * n[b] + mu * one };
                    let off = (re[a][b] / (k * k) - want).abs().max(im[a][b].abs() / (k * k)) / (lambda + 2.0 * mu);
                    worst = worst.max(off);
                }
            }
        }
        println!("long waves, {name}: off by {worst:.1e}");
        assert!(worst < limit, "{name}: {worst:.1e}");
        worst
    }
    // truncation of order (kδ)² ≈ 1e-7
    asked::<1>(&correspondence(NoControl, 5.1), "conventional 1D", 1e-6);
    asked::<1>(&correspondence(Wan2019, 5.1), "Wan2019 1D", 1e-6);
    asked::<1>(&bond_based(5.1), "bond-based 1D", 1e-6);
    asked::<2>(&correspondence(NoControl, 3.1), "conventional 2D", 1e-6);
    asked::<2>(&correspondence(Wan2019, 3.1), "Wan2019 2D", 1e-6);
    asked::<2>(&correspondence(silling(1.0), 3.1), "Silling2017 2D", 1e-6);
    asked::<3>(&correspondence(NoControl, 2.1), "conventional 3D", 1e-6);
    asked::<3>(&correspondence(Wan2019, 2.1), "Wan2019 3D", 1e-6);
    asked::<3>(&correspondence(silling(0.1), 2.1), "Silling2017 3D", 1e-6);
    // ordinary models without fourth-moment weights: the anisotropy of the lattice, some per cent
    let band = |x: f64| assert!(x > 1e-3, "an uncorrected lattice is not isotropic: {x:.1e}");
    band(asked::<2>(&bond_based(3.1), "bond-based 2D", 0.02));
    band(asked::<2>(&linear_solid(3.1), "linear peridynamic solid 2D", 0.02));
    band(asked::<3>(&bond_based(3.1), "bond-based 3D", 0.08));
    band(asked::<3>(&linear_solid(3.1), "linear peridynamic solid 3D", 0.08));
    // with them, none
    fn weighted<const D: usize>(delta: f64) {
        let c = BondBasedConstants { young: 1.0, section: section::<D>(), continuum: false };
        let bonds = Lattice::<D>::corrected(BondBased { law: Elastic, omega: Stored }, c, delta, Some(1));
        asked::<D>(&bonds, &format!("bond-based {D}D with fourth-moment weights"), 1e-6);
        let c = LinearPeridynamicSolidConstants::new(SOLID, section::<D>());
        let solid = Lattice::<D>::corrected(LinearPeridynamicSolid { omega: Stored }, c, delta, Some(2));
        asked::<D>(&solid, &format!("linear peridynamic solid {D}D with fourth-moment weights"), 1e-6);
    }
    weighted::<2>(3.1);
    weighted::<3>(2.1);
}

/// Energy per point of u = ±e₁ at k = (π, …, π), to the digits of an independent implementation.
#[test]
fn checkerboard_energies() {
    fn asked<const D: usize>(delta: f64, wan: f64, silling_1: f64) {
        let energy = |lattice: Lattice<D>| 0.5 * lattice.symbol([PI; D])[0][0][0];
        let conventional = energy(correspondence(NoControl, delta)).abs();
        println!("{D}D, δ = {delta:.4}: conventional {conventional:.0e}");
        assert!(conventional < 1e-29, "{D}D, δ = {delta}: {conventional:.1e}");
        for (name, got, want) in [
            ("Wan2019", energy(correspondence(Wan2019, delta)), wan),
            ("isotropic Wan2019", energy(correspondence(zero_energy::Isotropic::Wan2019, delta)), wan),
            ("Silling2017, G = 1", energy(correspondence(silling(1.0), delta)), silling_1),
            ("Silling2017, G = 0.1", energy(correspondence(silling(0.1), delta)), 0.1 * silling_1),
        ] {
            println!("  {name}: {got:.6}, reference {want}");
            assert!((got / want - 1.0).abs() < 6e-5, "{D}D, δ = {delta}, {name}: {got} {want}");
        }
    }
    asked::<1>(1.1, 2.0, 6.0105);
    asked::<1>(5.1, 0.10909, 0.18093);
    asked::<2>(1.1 * 2f64.sqrt(), 2.1333, 4.1743);
    asked::<2>(3.1 * 2f64.sqrt(), 0.34595, 0.52941);
    asked::<3>(1.1, 12.0, 28.461);
    asked::<3>(3.1, 1.1525, 1.8145);
}

/// The symbol of the conventional model in closed form, C(g, g) with g = K⁻¹ Σ ξ sin k·ξ, at a few wave vectors.
#[test]
fn conventional_symbol_by_hand() {
    let lattice = correspondence::<_, 2>(NoControl, 3.1);
    let (lambda, mu) = (0.4, 0.4);
    for k in [[0.3, 0.1], [1.0, -2.0], [2.5, 3.0]] {
        let (mut shape, mut g) = ([[0.0; 2]; 2], [0.0; 2]);
        for x in &lattice.bonds {
            for a in 0..2 {
                g[a] += x[a] * (k[0] * x[0] + k[1] * x[1]).sin();
                for b in 0..2 {
                    shape[a][b] += x[a] * x[b];
                }
            }
        }
        let g = closed::solve(shape, g);
        let square = g[0] * g[0] + g[1] * g[1];
        for a in 0..2 {
            for b in 0..2 {
                let want = (lambda + mu) * g[a] * g[b] + mu * square * (a == b) as u8 as f64;
                assert!((lattice.symbol(k)[0][a][b] - want).abs() < 1e-14, "{k:?}");
            }
        }
    }
}

/// Sub-horizons in half-spaces: no mode is free, and the checkerboard costs what an independent implementation found.
#[test]
fn sub_horizons_leave_no_zero_energy_mode() {
    const DROP: EmptySubHorizon = EmptySubHorizon::Renormalise;
    fn asked<const D: usize>(lattice: &Lattice<D>, name: &str, n: i64, checkerboard: Option<f64>) {
        let (corners, elsewhere, smallest) = zeros(lattice, n);
        let energy = 0.5 * lattice.symbol([PI; D])[0][0][0];
        println!("{D}D, {name}: smallest eigenvalue {smallest:.2e} of the largest, checkerboard {energy:.6}");
        assert_eq!((corners, elsewhere), (0, 0), "{D}D, {name}");
        assert!(smallest > 1e-4, "{D}D, {name}: {smallest}");
        if let Some(want) = checkerboard {
            assert!((energy / want - 1.0).abs() < 6e-5, "{D}D, {name}: {energy} {want}");
        }
    }
    let axes = Partition::Orthants;
    asked(&Lattice::<1>::divided::<8>(axes, DROP, 1.1), "half-lines, 1.1", 32, Some(2.0));
    asked(&Lattice::<1>::divided::<8>(axes, DROP, 5.1), "half-lines, 5.1", 32, Some(0.053554));
    asked(&Lattice::<1>::divided::<8>(Partition::Intervals(4), DROP, 5.1), "four intervals, 5.1", 32, None);
    asked(&Lattice::<2>::divided::<8>(axes, DROP, 1.1 * 2f64.sqrt()), "quadrants, 1.1", 8, Some(0.35556));
    asked(&Lattice::<2>::divided::<8>(axes, DROP, 3.1 * 2f64.sqrt()), "quadrants, 3.1", 8, Some(0.052281));
    for n in 3..=8 {
        asked(&Lattice::<2>::divided::<8>(Partition::Sectors(n), DROP, 3.1 * 2f64.sqrt()), &format!("{n} sectors, 3.1"), 8, None);
    }
    asked(&Lattice::<3>::divided::<8>(axes, DROP, 1.1), "octants, 1.1", 4, Some(4.0));
    asked(&Lattice::<3>::divided::<8>(axes, DROP, 3.1), "octants, 3.1", 4, Some(0.11111));
    asked(&Lattice::<3>::divided::<8>(Partition::Cones(6), DROP, 3.1), "six cones, 3.1", 4, None);
    asked(&Lattice::<3>::divided::<8>(Partition::Automatic(8), DROP, 3.1), "automatic, 3.1", 4, None);
}

/// δ²·symbol/E for short waves in the continuum: 0 for the whole family, 9/4 for two and (9 + 81/49)/2 for four sub-horizons.
#[test]
fn short_waves_of_sub_horizons() {
    let (delta, k) = (400.5, 0.31 * PI);
    let limit = |lattice: Lattice<1>| delta * delta * lattice.eigenvalues([k])[0];
    let zero = limit(correspondence(NoControl, delta));
    let two = limit(Lattice::divided::<8>(Partition::Intervals(2), EmptySubHorizon::ZeroEnergy { of: 2 }, delta));
    let four = limit(Lattice::divided::<8>(Partition::Intervals(4), EmptySubHorizon::ZeroEnergy { of: 4 }, delta));
    println!("short waves: whole {zero:.4}, two {two:.4}, four {four:.4}");
    // the lattice of 400 points a half adds terms of order 1/(k δ) and 1/400
    assert!(zero < 0.01 && (two / 2.25 - 1.0).abs() < 0.02 && (four / 5.3265 - 1.0).abs() < 0.02);
}

/// The correction is even where the family is symmetric: the modes at the corners stay free whatever the order.
#[test]
fn corrected_influence_functions_do_not_control_the_corners() {
    for order in 1..=8 {
        let model = CorrectedCorrespondence::<_, _, _, 10> { law: LinearElastic, control: zero_energy::Isotropic::None, omega: One, order };
        let lattice = Lattice::<1>::new(model, Stiffness::isotropic(SOLID, 0.0, section::<1>()), 5.1);
        let largest = (1..32).map(|j| lattice.eigenvalues([j as f64 * PI / 32.0])[0]).fold(0.0, f64::max);
        assert!(lattice.eigenvalues([PI])[0] < 1e-14 * largest, "{order}");
        // long waves are classical, the better the higher the order: E k² to (kδ)^N with N even
        let off = |k: f64| (lattice.eigenvalues([k])[0] / (k * k) - 1.0).abs();
        let observed = (off(0.2) / off(0.1)).log2();
        println!("order {order}: symbol at kδ = 1.02 off by {:.1e}, observed order {observed:.2}", off(0.2));
        assert!((observed - 2.0 * order.div_ceil(2) as f64).abs() < 0.2, "{order} {observed}");
    }
    let model = CorrectedCorrespondence::<_, _, _, 14> { law: LinearElastic, control: zero_energy::Isotropic::None, omega: One, order: 3 };
    let (corners, _, _) = zeros(&Lattice::<2>::new(model, Stiffness::isotropic(SOLID, 0.0, section::<2>()), 3.1), 8);
    assert_eq!(corners, 6);
}

/// The extended model has the zero-energy modes of the corners too, whatever m and the correction; its control removes them. Long
/// waves are classical with the corrected strain.
#[test]
fn extended_correspondence_keeps_the_zero_energy_modes() {
    use BondStrainCalibration::{AsPublished, MomentTensor};
    fn asked<const D: usize>(delta: f64, n: i64) {
        for (m, calibration) in [(1.0, MomentTensor), (0.0, AsPublished)] {
            let free = extended::<D>(m, calibration, 0.0, delta, 1.0);
            let (corners, elsewhere, smallest) = zeros(&free, n);
            println!("{D}D, δ = {delta}, m = {m}, {calibration:?}: {corners} + {elsewhere} zeros, smallest other {smallest:.1e}");
            assert_eq!((corners, elsewhere), (D * ((1 << D) - 1), 0), "{D}D");
            let held = extended::<D>(m, calibration, 1.0, delta, 1.0);
            let (corners, elsewhere, smallest) = zeros(&held, n);
            println!("  with control: {} zeros, smallest {smallest:.1e}", corners + elsewhere);
            assert_eq!((corners, elsewhere), (0, 0), "{D}D");
            assert!(smallest > 1e-4, "{D}D: {smallest}");
            if calibration == MomentTensor {
                for lattice in [&free, &held] {
                    long_waves(lattice, &format!("extended {D}D"));
                }
            }
        }
    }
    fn long_waves<const D: usize>(lattice: &Lattice<D>, name: &str) {
        let (lambda, mu) = (0.4, 0.4);
        let mut worst = 0.0f64;
        for n in [[1.0, 0.0, 0.0], [0.6, 0.8, 0.0], [2.0 / 7.0, 3.0 / 7.0, 6.0 / 7.0]] {
            let length = n[..D].iter().map(|x| x * x).sum::<f64>().sqrt();
            let n: [f64; D] = std::array::from_fn(|k| n[k] / length);
            let k = 1e-4;
            let [re, _] = lattice.symbol(n.map(|x| k * x));
            for a in 0..D {
                for b in 0..D {
                    let want = if D == 1 { 1.0 } else { (lambda + mu) * n[a] * n[b] + if a == b { mu } else { 0.0 } };
                    worst = worst.max((re[a][b] / (k * k) - want).abs());
                }
            }
        }
        println!("  long waves, {name}: off by {worst:.1e}");
        assert!(worst < 1e-6, "{name}: {worst:.1e}");
    }
    asked::<1>(3.1, 16);
    asked::<2>(3.1, 8);
    asked::<3>(2.1, 4);
}

/// Under a dilatation the checkerboard has the stiffness 4 p λ^(2m − 2) (2m + d − 2)/Σω · Σ_odd ω/ξ² with the mean stress p of the law: of
/// the sign of p (2m + d − 2), and none at m = (2 − d)/2.
#[test]
fn stressed_checkerboards_of_extended_correspondence() {
    fn asked<const D: usize>(delta: f64) {
        for m in [-1.0, -0.5, 0.0, 0.5, 1.0] {
            for stretch in [0.98, 1.02] {
                let lattice = extended::<D>(m, BondStrainCalibration::MomentTensor, 0.0, delta, stretch);
                let strain = if m == 0.0 { f64::ln(stretch) } else { (f64::powf(stretch, 2.0 * m) - 1.0) / (2.0 * m) };
                // λ = μ = 0.4; E = 1 in a bar
                let mean = if D == 1 { strain } else { (0.4 * D as f64 + 0.8) * strain };
                let odd: f64 = lattice
                    .bonds
                    .iter()
                    .filter(|x| x.iter().sum::<f64>().rem_euclid(2.0) == 1.0)
                    .map(|x| 1.0 / x.iter().map(|x| x * x).sum::<f64>())
                    .sum();
                let factor = 2.0 * m + D as f64 - 2.0;
                let want = 4.0 * mean * stretch.powf(2.0 * m - 2.0) * factor / lattice.bonds.len() as f64 * odd;
                let scale = 4.0 * mean.abs() / lattice.bonds.len() as f64 * odd;
                let got = lattice.eigenvalues([PI; D]);
                println!("{D}D, m = {m:4}, stretch {stretch}: checkerboard stiffness {:+.3e}, closed form {want:+.3e}", got[0]);
                for x in &got {
                    assert!((x - want).abs() < 1e-12 * scale, "{D}D, {m}, {stretch}: {x} {want}");
                    assert!(factor == 0.0 || x * mean * factor > 0.0);
                }
            }
        }
    }
    asked::<1>(3.1);
    asked::<2>(3.1);
    asked::<3>(2.1);
}
