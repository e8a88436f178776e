//! A body as a whole: forces, tangents and energies are derivatives of one another through chunks, halos and mirror images; threads do
//! not matter; breaking and going back.

mod common;

use bodies::body::{Body, Geometry, StiffnessScratch};
use bodies::chunk::Link;
use bodies::damage::{Criterion, DamageState};
use bodies::neighbors::{Mirror, neighbors_with_mirrors};
use bodies::part::{Constants, Part};
use catalog::{Law, Model, SmoothLaw};
use common::{CONTROLLED, UNCONTROLLED, bonds, correspondence, everywhere, linear_solid, on, saint_venant};
use physics::constitutive::HyperelasticConstants;
use physics::elasticity::{Isotropic, Section, Stiffness};
use physics::models::{BondStrainCalibration, EmptySubHorizon};

const ELASTIC: Isotropic = Isotropic { young: 3.0, poisson: 0.3 };
const SECTION: Section = Section::PlaneStrain { thickness: 1.0 };

/// A lattice of unit spacing over the given columns and rows.
fn lattice(columns: std::ops::Range<i32>, rows: std::ops::Range<i32>) -> Vec<[f64; 3]> {
    rows.flat_map(|j| columns.clone().map(move |i| [i as f64 + 0.5, j as f64 + 0.5, 0.0])).collect()
}

fn body(position: &[[f64; 3]], horizon: f64, mirrors: &[Mirror], finite: bool) -> Body<2> {
    let n = position.len();
    let (volume, horizons, spacing) = (vec![1.0; n], vec![horizon; n], vec![1.0; n]);
    let found = neighbors_with_mirrors(position, 2, &spacing, &horizons, mirrors).unwrap();
    let g = Geometry { position, volume: &volume, horizon: &horizons };
    let mut body = Body::<2>::new(&g, false, 0, |p, out: &mut Vec<Link>| {
        out.extend(found.bonds_of(p).map(|b| Link {
            point: found.index[b],
            flips: found.flips_of(b),
            end: found.end(position, p, b),
            weight: 1.0,
            sets: 0,
        }));
    });
    let part = everywhere(if finite { solid() } else { linear_solid(ELASTIC, SECTION) }, &body);
    body.assign(vec![part]).unwrap();
    body
}

fn stiffness() -> Stiffness<2> {
    Stiffness::isotropic(ELASTIC, 0.0, SECTION)
}

fn solid() -> Model<2> {
    correspondence(saint_venant(stiffness()), CONTROLLED)
}

/// Smooth and rough at once, of moderate size.
fn motion(position: &[[f64; 3]]) -> Vec<f64> {
    position
        .iter()
        .enumerate()
        .flat_map(|(p, x)| [0.03 * x[0] * (0.2 * x[1]).sin(), 0.02 * x[1] + 0.01 * ((p * 7919 % 101) as f64 / 101.0)])
        .collect()
}

fn largest(x: &[f64]) -> f64 {
    assert!(x.iter().all(|x| x.is_finite()));
    x.iter().fold(0.0, |m, x| m.max(x.abs()))
}

#[test]
fn the_body_has_several_chunks() {
    let position = lattice(0..70, 0..40);
    assert!(body(&position, 3.015, &[], false).chunk_count() > 4, "the tests below must cross chunks");
}

#[test]
fn force_is_the_derivative_of_energy_and_tangent_that_of_force() {
    let position = lattice(0..70, 0..40);
    for correspondence in [false, true] {
        for mirrors in [vec![], vec![Mirror { axis: 0, at: 0.0 }, Mirror { axis: 1, at: 0.0 }]] {
            let mut b = body(&position, 3.015, &mirrors, correspondence);
            let u = motion(&position);
            let direction: Vec<f64> = (0..u.len()).map(|q| ((q * 31 % 17) as f64 - 8.0) / 8.0).collect();
            let at = |h: f64| -> Vec<f64> { u.iter().zip(&direction).map(|(u, d)| u + h * d).collect() };
            let (mut f, mut plus, mut minus, mut k) = (vec![0.0; u.len()], vec![0.0; u.len()], vec![0.0; u.len()], vec![0.0; u.len()]);
            b.internal_force(&u, None, &mut f);
            let h = 1e-5;
            let slope = (b.energy(&at(h)) - b.energy(&at(-h))) / (2.0 * h);
            let power: f64 = -f.iter().zip(&direction).map(|(f, d)| f * d).sum::<f64>();
            // the accuracy of the difference quotient; jets are exact (physics/tests/contract.rs)
            assert!((slope - power).abs() <= 1e-7 * power.abs(), "{correspondence}: {slope} {power}");
            b.internal_force(&at(h), None, &mut plus);
            b.internal_force(&at(-h), None, &mut minus);
            b.tangent_product(&u, None, &direction, &mut k);
            let worst = (0..u.len()).map(|q| (k[q] + (plus[q] - minus[q]) / (2.0 * h)).abs()).fold(0.0, f64::max);
            assert!(worst <= 1e-8 * largest(&k), "{correspondence}: {worst}");
        }
    }
}

#[test]
fn assembled_families_are_the_tangent() {
    let position = lattice(0..30, 0..20);
    for mirrors in [vec![], vec![Mirror { axis: 0, at: 0.0 }]] {
        let mut b = body(&position, 2.015, &mirrors, true);
        let u = motion(&position);
        let x: Vec<f64> = (0..u.len()).map(|q| ((q * 13 % 23) as f64 - 11.0) / 11.0).collect();
        let mut want = vec![0.0; u.len()];
        b.tangent_product(&u, None, &x, &mut want);
        let (starts, members) = b.couplings();
        b.forward(&u, None);
        let mut got = vec![0.0; u.len()];
        let mut scratch = StiffnessScratch::default();
        let mut asymmetry = 0.0f64;
        for p in 0..position.len() {
            let m = &members[starts[p]..starts[p + 1]];
            let n = m.len() * 2;
            let mut dense = vec![0.0; n * n];
            b.family_stiffness(&mut scratch, p, &mut dense);
            for r in 0..n {
                for c in 0..n {
                    asymmetry = asymmetry.max((dense[r * n + c] - dense[c * n + r]).abs());
                    got[m[r / 2] as usize * 2 + r % 2] += dense[r * n + c] * x[m[c / 2] as usize * 2 + c % 2];
                }
            }
        }
        let scale = largest(&want);
        assert!(asymmetry <= 1e-13 * scale, "{asymmetry}");
        let worst = want.iter().zip(&got).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst <= 1e-12 * scale, "{worst}");
        let mut blocks = vec![0.0; u.len() * 2];
        b.block_diagonal(&u, &mut blocks);
        // the diagonal by tangent products with unit vectors
        for q in [0, 77, 400] {
            let mut e = vec![0.0; u.len()];
            e[q] = 1.0;
            b.tangent_product(&u, None, &e, &mut got);
            assert!((got[q] - blocks[q / 2 * 4 + q % 2 * 3]).abs() <= 1e-12 * scale);
        }
    }
}

#[test]
fn a_quarter_with_mirrors_is_the_whole() {
    let (columns, rows) = (12, 9);
    let whole = lattice(-columns..columns, -rows..rows);
    let quarter = lattice(0..columns, 0..rows);
    let displacement = |x: &[f64; 3]| {
        // odd normal to the planes, even along them
        [0.01 * x[0] * (1.0 + 0.1 * x[1].abs()), -0.004 * x[1] * (1.0 + 0.05 * x[0].abs())]
    };
    let u = |p: &[[f64; 3]]| -> Vec<f64> { p.iter().flat_map(displacement).collect() };
    for correspondence in [false, true] {
        let mut a = body(&whole, 3.015, &[], correspondence);
        let mut b = body(&quarter, 3.015, &[Mirror { axis: 0, at: 0.0 }, Mirror { axis: 1, at: 0.0 }], correspondence);
        let (mut fa, mut fb) = (vec![0.0; whole.len() * 2], vec![0.0; quarter.len() * 2]);
        a.internal_force(&u(&whole), None, &mut fa);
        b.internal_force(&u(&quarter), None, &mut fb);
        for (q, x) in quarter.iter().enumerate() {
            let p = whole.iter().position(|w| w == x).unwrap();
            for k in 0..2 {
                assert!((fa[p * 2 + k] - fb[q * 2 + k]).abs() <= 1e-13 * largest(&fa));
            }
        }
        let (ea, eb) = (a.energy(&u(&whole)), b.energy(&u(&quarter)));
        assert!((ea - 4.0 * eb).abs() <= 1e-13 * ea);
    }
}

#[test]
fn one_thread_and_three_give_the_same_bits() {
    let position = lattice(0..70, 0..40);
    let u = motion(&position);
    let run = |threads: usize| {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
            let mut b = body(&position, 3.015, &[], true);
            let mut f = vec![0.0; u.len()];
            b.internal_force(&u, None, &mut f);
            (f, b.energy(&u))
        })
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn broken_bonds_leave_both_ends_and_come_back() {
    let position = lattice(0..30, 0..20);
    for correspondence in [false, true] {
        let mut b = body(&position, 3.015, &[], correspondence);
        let u = motion(&position);
        let mut saved = DamageState::default();
        b.save_damage(&mut saved);
        let mut before = vec![0.0; u.len()];
        b.internal_force(&u, None, &mut before);
        // a cut between columns 14 and 15, over the whole height
        let broken = b.cut(|x, y| (x[0] - 15.0) * (y[0] - 15.0) < 0.0);
        // per row and distance: Σ over lattice bonds (a, b) with a > 0 of a, both directions, less those that leave the body
        assert!(broken.bonds > 0 && broken.bonds.is_multiple_of(2));
        assert_eq!(b.intact_bonds() + broken.bonds, b.bonds());
        // the halves move apart without force between them
        let apart: Vec<f64> = position.iter().flat_map(|x| [if x[0] > 15.0 { 7.0 } else { 0.0 }, 0.0]).collect();
        let mut f = vec![0.0; u.len()];
        b.internal_force(&apart, None, &mut f);
        assert_eq!(largest(&f), 0.0);
        assert_eq!(b.energy(&apart), 0.0);
        let damage = b.damage();
        assert!(damage[14] > 0.3 && damage[0] == 0.0);
        // momenta with broken families
        b.internal_force(&u, None, &mut f);
        for k in 0..2 {
            let sum: f64 = f.iter().skip(k).step_by(2).sum();
            assert!(sum.abs() <= 1e-12 * largest(&f));
        }
        b.restore_damage(&saved);
        b.internal_force(&u, None, &mut f);
        assert_eq!(f, before);
    }
}

#[test]
fn a_point_whose_family_becomes_flat_is_released() {
    let position = lattice(0..12, 0..12);
    let mut b = body(&position, 1.5, &[], true);
    // leave the corner point its bond to the right only: one direction, so K is singular
    let corner = [0.5, 0.5, 0.0];
    let broken = b.cut(|x, y| (x == corner && y[1] > 1.0) || (y == corner && x[1] > 1.0));
    assert_eq!(broken.released, 1);
    assert_eq!(b.family_size()[0], 0);
    // the others keep theirs
    assert!(b.family_size().iter().skip(1).all(|&n| n >= 2));
}

#[test]
fn exceeding_bonds_are_found_by_stretch_and_by_energy() {
    let position = lattice(0..30, 0..20);
    let mut b = body(&position, 3.015, &[], false);
    // uniform stretch along x: a bond at angle φ stretches by s cos²φ (to first order in s)
    let s = 1e-6;
    let u: Vec<f64> = position.iter().flat_map(|x| [s * x[0], 0.0]).collect();
    let found = b.exceeding(&u, None, &Criterion::CriticalStretch(vec![0.85 * s; position.len()]));
    // cos²φ > 0.85: (±1, 0), (±2, 0), (±3, 0) of a full family; (±2, ±1) has 0.8 and (±3, ±1) lies outside the horizon
    let interior = |p: usize| position[p][0] > 4.0 && position[p][0] < 26.0 && position[p][1] > 4.0 && position[p][1] < 16.0;
    let p = (0..position.len()).find(|&p| interior(p)).unwrap();
    assert_eq!(found.iter().filter(|f| b.ends(f.0).0 == p).count(), 6);
    // energy: the bonds that reach farthest carry most; both directions of a pair agree
    let found = b.exceeding(&u, None, &Criterion::CriticalBondEnergy(vec![1e-30; position.len()]));
    let worst = found.iter().filter(|f| interior(b.ends(f.0).0)).max_by(|x, y| x.1.total_cmp(&y.1)).unwrap();
    let (i, j) = b.ends(worst.0);
    assert_eq!((position[i][0] - position[j][0]).abs(), 3.0);
    assert_eq!(position[i][1], position[j][1]);
}

#[test]
fn gathered_and_scattered_forces_are_the_same() {
    // one material on the whole body sums both halves of its pairs at each point; two materials with the same constants scatter
    let position = lattice(0..70, 0..40);
    let u = motion(&position);
    let n = position.len() as u32;
    let forces = |parts: &[std::ops::Range<u32>]| {
        let mut b = body(&position, 3.015, &[Mirror { axis: 0, at: 0.0 }], false);
        let made: Vec<Box<dyn Part<2>>> =
            parts.iter().map(|range| on(&range.clone().collect::<Vec<u32>>(), bonds(3.0, SECTION), false, 0, &b)).collect();
        assert_eq!(made[0].gathers(), parts.len() == 1);
        b.assign(made).unwrap();
        let mut f = vec![0.0; u.len()];
        b.internal_force(&u, None, &mut f);
        f
    };
    let (gathered, scattered) = (forces(std::slice::from_ref(&(0..n))), forces(&[0..n / 3, n / 3..n]));
    let worst = gathered.iter().zip(&scattered).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(worst <= 1e-13 * largest(&gathered), "{worst:e} of {:e}", largest(&gathered));
}

#[test]
fn fields_are_those_of_the_model() {
    // an affine map is exact for every model, whatever its weights; a quadratic one tells them apart
    let position = lattice(0..14, 0..12);
    let n = position.len();
    let (volume, horizons, spacing) = (vec![1.0; n], vec![3.015; n], vec![1.0; n]);
    let found = neighbors_with_mirrors(&position, 2, &spacing, &horizons, &[]).unwrap();
    // ω = 1/|ξ|, and closed quadrants
    let make = |part: &dyn Fn(&Body<2>) -> Box<dyn Part<2>>| {
        let g = Geometry { position: &position, volume: &volume, horizon: &horizons };
        let mut body = Body::<2>::new(&g, true, 4, |p, out: &mut Vec<Link>| {
            let x = position[p];
            out.extend(found.bonds_of(p).map(|b| {
                let end = found.end(&position, p, b);
                let xi = [end[0] - x[0], end[1] - x[1]];
                let sets = (0..4).filter(|k| (0..2).all(|a| xi[a] * if k >> a & 1 == 1 { -1.0 } else { 1.0 } >= 0.0)).map(|k| 1 << k).sum();
                Link { point: found.index[b], flips: 0, end, weight: 1.0 / xi[0].hypot(xi[1]), sets }
            }));
        });
        let part = part(&body);
        body.assign(vec![part]).unwrap();
        body
    };
    let law = || saint_venant(stiffness());
    let weighted = |model: Model<2>| move |b: &Body<2>| on(&(0..b.points() as u32).collect::<Vec<_>>(), model.clone(), true, 4, b);
    let conventional = weighted(correspondence(law(), UNCONTROLLED));
    let solid = weighted(linear_solid(ELASTIC, SECTION));
    let corrected = weighted(Model::Corrected(law(), physics::zero_energy::Isotropic::None, 2));
    let divided = weighted(Model::SubHorizons(law(), EmptySubHorizon::Renormalise));
    let h = [[0.02, -0.01], [0.03, 0.04]];
    let affine: Vec<f64> = position.iter().flat_map(|x| [h[0][0] * x[0] + h[0][1] * x[1], h[1][0] * x[0] + h[1][1] * x[1]]).collect();
    // u = 0.01 x² along x: the gradient is 0.02 x
    let quadratic: Vec<f64> = position.iter().flat_map(|x| [0.01 * x[0] * x[0], 0.0]).collect();
    let corner = 0;
    let bonds: Vec<[f64; 2]> = found
        .bonds_of(corner)
        .map(|b| {
            let end = found.end(&position, corner, b);
            [end[0] - position[corner][0], end[1] - position[corner][1]]
        })
        .collect();
    // the mean of the corner by its definition, with ω = 1/|ξ|
    let mean = {
        let sum = |a: &dyn Fn(&[f64; 2]) -> f64| bonds.iter().map(|xi| a(xi) / xi[0].hypot(xi[1])).sum::<f64>();
        let x0 = position[corner][0];
        let eta = |xi: &[f64; 2]| 0.01 * ((x0 + xi[0]).powi(2) - x0 * x0);
        let k = [sum(&|x| x[0] * x[0]), sum(&|x| x[0] * x[1]), sum(&|x| x[1] * x[1])];
        let a = [sum(&|x| eta(x) * x[0]), sum(&|x| eta(x) * x[1])];
        (a[0] * k[2] - a[1] * k[1]) / (k[0] * k[2] - k[1] * k[1])
    };
    let exact = 0.02 * position[corner][0];
    type Make<'a> = &'a dyn Fn(&Body<2>) -> Box<dyn Part<2>>;
    let all: [(&str, Make, f64); 4] = [
        ("conventional", &conventional, mean),
        ("linear solid", &solid, mean),
        ("corrected", &corrected, exact),
        ("quadrants", &divided, mean),
    ];
    for (name, part, want) in all {
        let mut b = make(part);
        let got = b.displacement_gradient(&affine);
        let off = got.iter().flat_map(|m| (0..4).map(move |q| (m.0[q / 2][q % 2] - h[q / 2][q % 2]).abs())).fold(0.0, f64::max);
        assert!(off < 1e-14, "{name}: {off:e}");
        // at the corner one quadrant alone is left, which is the whole family
        let got = b.displacement_gradient(&quadratic)[corner].0[0][0];
        assert!((got / want - 1.0).abs() < 1e-12, "{name}: {got} {want}");
        assert!(b.extended_strain(&affine).iter().all(|e| e.0[0][0].is_nan()));
    }
    assert!(mean > 2.0 * exact, "the case tells the models apart");
    let extended = weighted(common::extended(stiffness(), 1.0, BondStrainCalibration::MomentTensor, 0.0));
    // m = 1: the Green–Lagrange strain of every uniform F, at corners too
    for e in make(&extended).extended_strain(&affine) {
        for q in 0..4 {
            let (i, j) = (q / 2, q % 2);
            let green = 0.5 * (h[i][j] + h[j][i] + h[0][i] * h[0][j] + h[1][i] * h[1][j]);
            assert!((e.0[i][j] - green).abs() < 1e-14, "{:e}", e.0[i][j] - green);
        }
    }
}

#[test]
fn lattice_families_share_their_shapes() {
    // constants point by point are never shared: the same forces, by far less memory
    let position = lattice(0..70, 0..40);
    let u = motion(&position);
    let n = position.len();
    let constants = HyperelasticConstants::SaintVenantKirchhoff(stiffness());
    let run = |constants: Constants<HyperelasticConstants<2>>| {
        let mut b = body(&position, 3.015, &[Mirror { axis: 0, at: 0.0 }], true);
        let part = everywhere(Model::Correspondence(Law::Smooth(SmoothLaw::Hyperelastic(constants)), CONTROLLED), &b);
        b.assign(vec![part]).unwrap();
        let mut f = vec![0.0; u.len()];
        b.internal_force(&u, None, &mut f);
        let whole = b.bytes().2;
        // broken families have shapes of their own again, and go back
        let mut saved = DamageState::default();
        b.save_damage(&mut saved);
        b.cut(|x, y| (x[0] - 20.0) * (y[0] - 20.0) < 0.0);
        let mut g = vec![0.0; u.len()];
        b.internal_force(&u, None, &mut g);
        b.restore_damage(&saved);
        let mut again = vec![0.0; u.len()];
        b.internal_force(&u, None, &mut again);
        assert_eq!(f, again);
        (f, g, whole)
    };
    let (shared, own) = (run(Constants::Uniform(constants)), run(Constants::PerPoint(vec![constants; n])));
    for (a, b) in [(&shared.0, &own.0), (&shared.1, &own.1)] {
        let worst = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst <= 1e-12 * largest(a), "{worst:e} of {:e}", largest(a));
    }
    let each = own.2 as f64 / n as f64 - size_of::<HyperelasticConstants<2>>() as f64;
    let few = shared.2 as f64 / n as f64;
    println!("bytes a point: {few:.1} shared, {each:.1} else");
    assert!(few < 0.5 * each);
}

#[test]
fn bonds_that_break_held_the_energy_of_their_springs() {
    // bond-based: a pair of micromodulus c (mean of both ends) holds c s² |ξ| V V'/2; counted once whichever end is named
    let position = lattice(0..12, 0..9);
    let u = motion(&position);
    let n = position.len();
    let mut b = body(&position, 2.015, &[], false);
    let part = everywhere(bonds(3.0, SECTION), &b);
    b.assign(vec![part]).unwrap();
    let critical = vec![0.02; n];
    let found: Vec<_> = b.exceeding(&u, None, &Criterion::CriticalStretch(critical)).into_iter().map(|f| f.0).collect();
    assert!(found.len() > 10);
    let moment = |p: usize| b.reference_family(p).iter().map(|(xi, v)| xi[0].hypot(xi[1]) * v).sum::<f64>();
    let mut pairs: Vec<(usize, usize)> = found.iter().map(|f| b.ends(*f)).map(|(p, q)| (p.min(q), p.max(q))).collect();
    pairs.sort_unstable();
    pairs.dedup();
    let want: f64 = pairs
        .iter()
        .map(|&(p, q)| {
            let xi = [position[q][0] - position[p][0], position[q][1] - position[p][1]];
            let y = [xi[0] + u[2 * q] - u[2 * p], xi[1] + u[2 * q + 1] - u[2 * p + 1]];
            let (length, stretch) = (xi[0].hypot(xi[1]), y[0].hypot(y[1]) / xi[0].hypot(xi[1]) - 1.0);
            let c = 0.5 * 6.4 * 3.0 * (1.0 / moment(p) + 1.0 / moment(q));
            // T.eta/2 of both halves: the force is along Y, eta is not
            let along = ((y[0] - xi[0]) * y[0] + (y[1] - xi[1]) * y[1]) / y[0].hypot(y[1]);
            0.5 * c * stretch * along * if length > 0.0 { 1.0 } else { 0.0 }
        })
        .sum();
    let got = b.bond_energies(found.iter().copied(), (&u, None));
    assert!((got / want - 1.0).abs() < 1e-12, "{got} {want}");
    b.break_bonds(found.iter().copied());
    assert_eq!(b.bond_energies(found, (&u, None)), 0.0);
}
