//! Bloch symbols measured through whole bodies, against closed forms and an independent implementation's numbers.

mod common;

use bodies::body::{Body, Geometry};
use bodies::chunk::Link;
use bodies::neighbors::neighbors;
use bodies::points::Lattice;
use bodies::spectrum::{Search, Symbol, Verdict, patch, search, wave_vector};
use catalog::{Catalog, Compiled, Model};
use common::{CONTROLLED, UNCONTROLLED, bonds, everywhere, linear, linear_solid, saint_venant};
use physics::elasticity::{Isotropic, Section, Stiffness};
use physics::zero_energy::{self, AnyControl};
use std::f64::consts::PI;

/// E = 1, ν = 1/4.
const SOLID: Isotropic = Isotropic { young: 1.0, poisson: 0.25 };
const UNIT: Lattice = Lattice { origin: [0.0; 3], axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], spacing: [1.0; 3] };
const SILLING: AnyControl = AnyControl::Isotropic(zero_energy::Isotropic::Silling2017 { strength: 1.0 });
const SEARCH: Search = Search { grid: 16, threshold: 1e-9, refine: false };

fn section<const D: usize>() -> Section {
    [Section::Bar { area: 1.0 }, Section::PlaneStrain { thickness: 1.0 }, Section::Solid][D - 1]
}

/// The symbol about the uniform stretch `stretch`.
fn stretched<const D: usize>(model: Model<D>, lattice: &Lattice, delta: f64, stretch: [f64; D]) -> Symbol
where
    Catalog: Compiled<D>,
{
    let (position, centre) = patch(lattice, D, delta);
    let n = position.len();
    let cell: f64 = lattice.spacing[..D].iter().product();
    let (volume, horizon) = (vec![cell; n], vec![delta; n]);
    let found = neighbors(&position, D, &horizon).unwrap();
    let g = Geometry { position: &position, volume: &volume, horizon: &horizon };
    let mut body = Body::<D>::new(&g, D == 1, 0, |p, out: &mut Vec<Link>| {
        out.extend(found.of(p).iter().map(|&q| Link { point: q, flips: 0, end: position[q as usize], weight: 1.0, sets: 0 }));
    });
    let part = everywhere(model, &body);
    body.assign(vec![part]).unwrap();
    let flat: Vec<f64> = position.iter().flat_map(|x| x[..D].to_vec()).collect();
    let u: Vec<f64> = flat.iter().enumerate().map(|(q, x)| (stretch[q % D] - 1.0) * x).collect();
    let symbol = Symbol::measure(D, &flat, centre, cell, |x, y| {
        body.tangent_product(&u, None, x, y);
        Ok(())
    })
    .unwrap();
    assert!(symbol.imbalance() < 1e-11, "{}", symbol.imbalance());
    assert!(symbol.reach() <= 2.0 * delta * (1.0 + 1e-9));
    // relative to S, which for waves that cost little is far smaller than the couplings it sums
    for k in [[0.3, 0.2, 0.1], [2.0, -1.0, 0.7]] {
        assert!(symbol.asymmetry(k) < 1e-11, "{}", symbol.asymmetry(k));
    }
    symbol
}
fn symbol<const D: usize>(model: Model<D>, delta: f64) -> Symbol
where
    Catalog: Compiled<D>,
{
    stretched(model, &UNIT, delta, [1.0; D])
}
fn correspondence<const D: usize>(control: AnyControl, delta: f64) -> Symbol
where
    Catalog: Compiled<D>,
{
    symbol::<D>(common::correspondence(linear(Stiffness::isotropic(SOLID, 0.0, section::<D>())), control), delta)
}
fn bond_based<const D: usize>(delta: f64, stretch: [f64; D]) -> Symbol
where
    Catalog: Compiled<D>,
{
    stretched::<D>(bonds(1.0, section::<D>()), &UNIT, delta, stretch)
}
fn family<const D: usize>(delta: f64) -> Vec<[f64; D]> {
    let n = delta as i64;
    let side = (2 * n + 1) as usize;
    (0..side.pow(D as u32))
        .map(|q| std::array::from_fn(|k| (q / side.pow(k as u32) % side) as f64 - n as f64))
        .filter(|x: &[f64; D]| {
            let r = x.iter().map(|x| x * x).sum::<f64>().sqrt();
            r > 0.0 && r <= delta
        })
        .collect()
}

/// λ = E (Σ n sin kn / Σ n²)² and, with the control of Wan 2019, λ = (E/K) Σ |exp(ikn) − 1|².
#[test]
fn bars_in_closed_form() {
    for delta in [1.1, 3.1, 10.1] {
        let n = delta as i64;
        let shape: f64 = (1..=n).map(|n| 2.0 * (n * n) as f64).sum();
        let (plain, wan) = (correspondence::<1>(UNCONTROLLED, delta), correspondence::<1>(CONTROLLED, delta));
        let bonds = bond_based::<1>(delta, [1.0]);
        let length: f64 = (1..=n).map(|n| 2.0 * n as f64).sum();
        for k in [1e-4, 0.3, 1.0, 2.0, 3.0, PI] {
            let g: f64 = (1..=n).map(|n| 2.0 * n as f64 * (k * n as f64).sin()).sum::<f64>() / shape;
            let squares: f64 = (1..=n).map(|n| 8.0 * (0.5 * k * n as f64).sin().powi(2)).sum::<f64>();
            // pair force density c s with c = 2E/Σ|ξ|: Σ (c/|ξ|)(1 − cos kξ) over the family
            let pairs: f64 = (1..=n).map(|n| 8.0 / (length * n as f64) * (0.5 * k * n as f64).sin().powi(2)).sum();
            for (name, symbol, want) in [("conventional", &plain, g * g), ("Wan2019", &wan, squares / shape), ("bond-based", &bonds, pairs)]
            {
                let b = symbol.branches([k, 0.0, 0.0])[0];
                assert!((b.stiffness - want).abs() <= 1e-14 * (want + k * k), "{name} δ = {delta}, k = {k}: {} {want}", b.stiffness);
                assert!((b.local / (k * k) - 1.0).abs() < 1e-13, "{name}: local modulus {}", b.local / (k * k));
            }
        }
    }
}

/// Fine lattices approach the continuum: the factor 3(sin q − q cos q)/q³ with its zero at q = kδ = 4.4934, and for short waves
/// δ²λ/E → 0 without control and → 6 with that of Wan 2019.
#[test]
fn a_fine_bar_is_the_continuum() {
    let points = 200;
    let delta = points as f64 + 0.1;
    // that many points stand for a continuum of half-width points + 1/2
    let width = points as f64 + 0.5;
    let plain = correspondence::<1>(UNCONTROLLED, delta);
    for q in [0.5, 2.0, 4.0, 6.0] {
        let factor = 3.0 * (f64::sin(q) - q * f64::cos(q)) / f64::powi(q, 3);
        let got = plain.stiffness([q / width, 0.0, 0.0])[0].ratio();
        assert!((got - factor * factor).abs() < 2e-5, "{q}: {got} {}", factor * factor);
    }
    let found = search(&plain, &UNIT, &Search { grid: 8192, threshold: 1e-9, refine: true });
    let q = found.worst.k[0] * width;
    println!("zero at kδ = {q:.5}; {} zeros on the grid, {} between", found.zero_modes, found.zero_between);
    assert!((q / 4.493409457909064 - 1.0).abs() < 1e-4 && found.worst.ratio < 1e-12, "{q}");
    // short waves cost less than 1e-9 of what they cost the local solid, wherever they are: their number tells nothing here
    assert_eq!(found.verdict(1e-9), Verdict::ZeroEnergy);
    let k = 60.5 * PI / width;
    let short = |s: &Symbol| width * width * s.stiffness([k, 0.0, 0.0])[0].stiffness;
    let wan = correspondence::<1>(CONTROLLED, delta);
    println!("δ²λ/E for short waves: {:.4e}, Wan2019 {:.4}", short(&plain), short(&wan));
    assert!(short(&plain) < 1e-3 && (short(&wan) / 6.0 - 1.0).abs() < 0.02, "{} {}", short(&plain), short(&wan));
}

/// D modes at each of the 2^D − 1 corners k ≠ 0 without control: 1, 6, 21; none otherwise.
#[test]
fn number_of_zero_energy_modes() {
    fn asked<const D: usize>(delta: f64)
    where
        Catalog: Compiled<D>,
    {
        let plain = search(&correspondence::<D>(UNCONTROLLED, delta), &UNIT, &SEARCH);
        println!("{D}D, δ = {delta}: {} zeros, worst {:?}", plain.zero_modes, plain.worst);
        assert_eq!((plain.zero_modes, plain.negative_modes), (D * ((1 << D) - 1), 0), "{D}D");
        assert_eq!(plain.verdict(SEARCH.threshold), Verdict::ZeroEnergy);
        // of all corners the longest wave is told: two spacings
        assert!(plain.worst.ratio.abs() < 1e-15 && (plain.worst.wavelength() - 2.0).abs() < 1e-12, "{:?}", plain.worst);
        for (name, found) in [
            ("Wan2019", search(&correspondence::<D>(AnyControl::Wan2019, delta), &UNIT, &SEARCH)),
            ("Silling2017", search(&correspondence::<D>(SILLING, delta), &UNIT, &SEARCH)),
            ("bond-based", search(&bond_based::<D>(delta, [1.0; D]), &UNIT, &SEARCH)),
        ] {
            println!("  {name}: smallest {:.4}", found.worst.ratio);
            assert_eq!((found.zero_modes, found.verdict(SEARCH.threshold)), (0, Verdict::Stable), "{D}D, {name}");
            assert!(found.worst.ratio > 1e-2, "{D}D, {name}: {:?}", found.worst);
        }
    }
    asked::<1>(3.1);
    asked::<2>(3.1);
    asked::<3>(2.1);
    // minima are followed within the zone only: beyond its boundary the same waves are compared with shorter ones
    let wan = search(&correspondence::<2>(AnyControl::Wan2019, 3.1), &UNIT, &Search { refine: true, ..SEARCH });
    assert!(wan.worst.fraction.iter().all(|f| f.abs() <= 1.0) && wan.worst.ratio > 0.02, "{:?}", wan.worst);
    // 12 c² + 4 c − 2 = 0 with c = cos k: Σ n sin kn of three neighbours vanishes twice between 0 and π
    let found = search(&correspondence::<1>(UNCONTROLLED, 3.1), &UNIT, &Search { grid: 64, refine: true, ..SEARCH });
    assert_eq!((found.zero_modes, found.zero_between), (1, 2));
    let first = ((-4.0 + 112f64.sqrt()) / 24.0).acos();
    assert!((found.worst.k[0] - first).abs() < 1e-6, "{} {first}", found.worst.k[0]);
}

/// Energy ½ V λ per point of u = ±e₁ at the corner of the zone: the numbers of an independent implementation. Without control the couplings
/// cancel to round-off.
#[test]
fn checkerboard_energies() {
    fn asked<const D: usize>(delta: f64, wan: f64, silling: f64)
    where
        Catalog: Compiled<D>,
    {
        let energy = |s: Symbol| 0.5 * s.at([PI; 3]).0[0];
        let plain = energy(correspondence::<D>(UNCONTROLLED, delta)).abs();
        let got = [
            energy(correspondence::<D>(AnyControl::Wan2019, delta)) / wan,
            energy(correspondence::<D>(CONTROLLED, delta)) / wan,
            energy(correspondence::<D>(SILLING, delta)) / silling,
        ];
        println!("{D}D, δ = {delta:.4}: conventional {plain:.0e}; over references {got:.6?}");
        assert!(plain < 1e-15 && got.iter().all(|g| (g - 1.0).abs() < 6e-5), "{D}D, δ = {delta}: {plain:.1e} {got:?}");
    }
    asked::<1>(1.1, 2.0, 6.0105);
    asked::<1>(5.1, 0.10909, 0.18093);
    asked::<2>(1.1 * 2f64.sqrt(), 2.1333, 4.1743);
    asked::<2>(3.1 * 2f64.sqrt(), 0.34595, 0.52941);
    asked::<3>(1.1, 12.0, 28.461);
    asked::<3>(3.1, 1.1525, 1.8145);
}

/// About a uniform stretch 1 + s of a bond-based plate the symbol is `Σ (c/|ξ|)(n⊗n + s/(1+s) (1 − n⊗n))(1 − cos k·ξ)`: strong
/// compression makes it unstable.
#[test]
fn bond_based_plate_under_uniform_stretch() {
    let delta = 3.1;
    let bonds = family::<2>(delta);
    let length: f64 = bonds.iter().map(|x| x[0].hypot(x[1])).sum();
    let c = 6.4 / length;
    for (s, verdict) in [(0.2, Verdict::Stable), (-0.1, Verdict::Stable), (-0.4, Verdict::Unstable)] {
        let symbol = bond_based::<2>(delta, [1.0 + s; 2]);
        for k in [[0.3, 0.1, 0.0], [1.0, -2.0, 0.0], [PI, PI, 0.0]] {
            let mut want = [0.0; 4];
            for x in &bonds {
                let r = x[0].hypot(x[1]);
                let n = [x[0] / r, x[1] / r];
                let wave = 2.0 * (0.5 * (k[0] * x[0] + k[1] * x[1])).sin().powi(2);
                for q in 0..4 {
                    let (nn, one) = (n[q / 2] * n[q % 2], (q / 2 == q % 2) as u8 as f64);
                    want[q] += c / r * (nn + s / (1.0 + s) * (one - nn)) * wave;
                }
            }
            let (re, im) = symbol.at(k);
            let scale = want.iter().fold(0.0f64, |m, x| m.max(x.abs()));
            for q in 0..4 {
                assert!((re[q] - want[q]).abs() < 1e-12 * scale && im[q].abs() < 1e-12 * scale, "{s} {k:?}: {re:?} {want:?}");
            }
        }
        let found = search(&symbol, &UNIT, &SEARCH);
        println!("stretch {:.1}: smallest {:.4}, {} negative", 1.0 + s, found.worst.ratio, found.negative_modes);
        assert_eq!(found.verdict(SEARCH.threshold), verdict, "{s}");
        assert_eq!(found.negative_modes > 0, verdict == Verdict::Unstable);
    }
}

/// A bar of Saint-Venant and Kirchhoff's solid: P = E (F³ − F)/2, so that long waves feel dP/dF = E (3F² − 1)/2, and all others that
/// times the square of the discrete gradient's response.
#[test]
fn saint_venant_bar_under_stretch() {
    let plain = correspondence::<1>(UNCONTROLLED, 3.1);
    for stretch in [0.8, 1.0, 1.3] {
        let model = common::correspondence(saint_venant(Stiffness::isotropic(SOLID, 0.0, section::<1>())), UNCONTROLLED);
        let s = stretched::<1>(model, &UNIT, 3.1, [stretch]);
        let modulus = 0.5 * (3.0 * stretch * stretch - 1.0);
        assert!((s.acoustic([1.0, 0.0, 0.0])[0] / modulus - 1.0).abs() < 1e-13);
        for k in [0.2, 1.1, 2.9] {
            let (got, want) = (s.stiffness([k, 0.0, 0.0])[0].stiffness, modulus * plain.stiffness([k, 0.0, 0.0])[0].stiffness);
            assert!((got / want - 1.0).abs() < 1e-12, "{stretch} {k}: {got} {want}");
        }
    }
}

/// Nearest neighbours: ω = 2 sin(k/2), c_g = cos(k/2). In general the slope is that of the stiffness, degenerate or not.
#[test]
fn group_velocity_is_the_slope_of_the_dispersion() {
    let chain = bond_based::<1>(1.1, [1.0]);
    for k in [0.01, 0.5, 1.5, 3.0] {
        let b = chain.branches([k, 0.0, 0.0])[0];
        assert!((b.frequency(1.0) - 2.0 * f64::sin(0.5 * k)).abs() < 1e-14);
        assert!((b.group_velocity(1.0) - f64::cos(0.5 * k)).abs() < 1e-12, "{k}: {}", b.group_velocity(1.0));
        assert!((b.local_velocity(k, 4.0) - 0.5).abs() < 1e-14);
    }
    let symbol = symbol::<3>(linear_solid(SOLID, section::<3>()), 2.1);
    // the first two are directions in which both shear waves are one
    for k in [[0.9, 0.0, 0.0], [0.8, 0.8, 0.8], [1.1, 0.4, -0.7]] {
        let h = 1e-5;
        let at = |s: f64| symbol.stiffness(k.map(|k| k * (1.0 + s)));
        let length = f64::sqrt(k.iter().map(|k| k * k).sum());
        for (i, b) in symbol.branches(k).iter().enumerate() {
            let want = (at(h)[i].stiffness - at(-h)[i].stiffness) / (2.0 * h * length);
            assert!((b.slope / want - 1.0).abs() < 1e-7, "{k:?} {i}: {} {want}", b.slope);
        }
    }
}

/// The same material on another lattice: rows of 0.5 and 0.25, turned by 30 degrees. An isotropic law on the turned lattice gives the
/// turned waves, and wave vectors follow the rows.
#[test]
fn lattices_of_any_spacing_and_direction() {
    let (s, c) = (0.5, 0.75f64.sqrt());
    let straight = Lattice { spacing: [0.5, 0.25, 1.0], ..UNIT };
    let turned = Lattice { axes: [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]], ..straight };
    let model = |control| common::correspondence(linear(Stiffness::isotropic(SOLID, 0.0, section::<2>())), control);
    let [a, b] = [&straight, &turned].map(|l| stretched::<2>(model(AnyControl::Wan2019), l, 1.05, [1.0; 2]));
    for f in [[0.3, 0.2, 0.0], [1.0, 0.5, 0.0], [1.0, 1.0, 0.0]] {
        let (x, y) = (a.branches(wave_vector(&straight, 2, f)), b.branches(wave_vector(&turned, 2, f)));
        for (x, y) in x.iter().zip(&y) {
            assert!((x.stiffness / y.stiffness - 1.0).abs() < 1e-11, "{f:?}: {x:?} {y:?}");
        }
    }
    let found = search(&stretched::<2>(model(UNCONTROLLED), &turned, 1.05, [1.0; 2]), &turned, &SEARCH);
    assert_eq!(found.zero_modes, 6);
}
