//! Bodies on lattices: eight points abreast give what the lists give, whatever the model, the dimension, the damage and the threads; and
//! lists serve where points or materials are not for lattices.

mod common;

use bodies::body::{Body, Geometry};
use bodies::chunk::Link;
use bodies::damage::{Criterion, DamageState};
use bodies::neighbors::{Mirror, neighbors_with_mirrors};
use bodies::part::{Constants, Part};
use catalog::{Catalog, Compiled, Law, Model, SmoothLaw};
use common::{CONTROLLED, correspondence, on, saint_venant};
use physics::constitutive::{J2PlasticityConstants, KelvinVoigtConstants, OfStrainConstants, StrainMeasure};
use physics::elasticity::{Isotropic, Section, Stiffness};
use physics::models::{BondStrainCalibration, EmptySubHorizon};
use physics::sub_horizon::Partition;
use physics::tensor::Vector;

/// Seeded numbers in [0, 1).
struct Random(u64);
impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}

const ELASTIC: Isotropic = Isotropic { young: 3.0, poisson: 0.25 };

fn section(d: usize) -> Section {
    match d {
        1 => Section::Bar { area: 0.7 },
        2 => Section::PlaneStrain { thickness: 1.3 },
        _ => Section::Solid,
    }
}

/// What to build.
#[derive(Clone, Copy)]
struct Case<const D: usize> {
    size: [usize; D],
    spacing: [f64; D],
    horizon: f64,
    mirrors: bool,
    weighted: bool,
    /// Sub-horizons that bonds store.
    sets: usize,
}

/// Points of a lattice with a round hole, in spatial order.
fn points<const D: usize>(case: &Case<D>) -> Vec<[f64; 3]> {
    let n: usize = case.size.iter().product();
    let all = (0..n).map(|p| {
        let mut q = p;
        let mut x = [0.0; 3];
        for k in 0..D {
            x[k] = ((q % case.size[k]) as f64 + 0.5) * case.spacing[k];
            q /= case.size[k];
        }
        x
    });
    let middle: [f64; 3] = std::array::from_fn(|k| if k < D { 0.6 * case.size[k] as f64 * case.spacing[k] } else { 0.0 });
    let hole = |x: &[f64; 3]| {
        D > 1 && (0..D).map(|k| (x[k] - middle[k]).powi(2)).sum::<f64>().sqrt() < 0.15 * case.size[0] as f64 * case.spacing[0]
    };
    let position: Vec<[f64; 3]> = all.filter(|x| !hole(x)).collect();
    bodies::sort::spatial_order(&position, D, case.spacing[D - 1]).apply(&position)
}

/// A body without materials. Volumes differ from point to point.
fn bare<const D: usize>(case: &Case<D>, position: &[[f64; 3]]) -> Body<D> {
    let n = position.len();
    let mut random = Random(77);
    let volume: Vec<f64> = (0..n).map(|_| 1.0 + 0.1 * random.next()).collect();
    let largest = case.spacing.iter().fold(0.0f64, |m, x| m.max(*x));
    let (horizon, spacing) = (vec![case.horizon; n], vec![largest; n]);
    let mirrors: Vec<Mirror> = if case.mirrors { (0..D).map(|axis| Mirror { axis, at: 0.0 }).collect() } else { vec![] };
    let found = neighbors_with_mirrors(position, D, &spacing, &horizon, &mirrors).unwrap();
    let g = Geometry { position, volume: &volume, horizon: &horizon };
    Body::<D>::new(&g, case.weighted, case.sets, |p, out: &mut Vec<Link>| {
        out.extend(found.bonds_of(p).map(|b| {
            let end = found.end(position, p, b);
            let r = (0..D).map(|k| (end[k] - position[p][k]).powi(2)).sum::<f64>().sqrt();
            Link { point: found.index[b], flips: found.flips_of(b), end, weight: 1.0 - 0.5 * r / case.horizon, sets: 0 }
        }));
        if case.sets > 0 {
            let bonds: Vec<_> = out.iter().map(|l| (Vector::<f64, D>(std::array::from_fn(|k| l.end[k] - position[p][k])), 1.0)).collect();
            out.iter_mut().zip(Partition::Orthants.membership(&bonds, case.horizon)).for_each(|(l, sets)| l.sets = sets);
        }
    })
}

/// Random displacements of 3 % of the spacing on a smooth field.
fn motion<const D: usize>(position: &[[f64; 3]], spacing: f64, seed: u64) -> Vec<f64> {
    let mut random = Random(seed);
    position
        .iter()
        .flat_map(|x| {
            let smooth: f64 = (0..D).map(|k| 0.2 * x[k] / spacing).sum::<f64>().sin();
            (0..D).map(|_| 0.03 * spacing * (random.next() - 0.5) + 0.3 * spacing * smooth).collect::<Vec<_>>()
        })
        .collect()
}

fn largest(x: &[f64]) -> f64 {
    assert!(x.iter().all(|x| x.is_finite()));
    x.iter().fold(0.0, |m, x| m.max(x.abs()))
}

/// The materials of a body: the first on the points in front, others behind.
type Parts<'a, const D: usize> = &'a dyn Fn(&Body<D>) -> Vec<Box<dyn Part<D>>>;

/// Largest difference of forces, relative to the largest force: whole, cut, with a random share of the bonds broken, with a
/// committed history, and back.
fn worst<const D: usize>(case: &Case<D>, parts: Parts<D>) -> f64 {
    let position = points(case);
    let build = || {
        let mut body = bare(case, &position);
        let parts = parts(&body);
        body.assign(parts).unwrap();
        body
    };
    let (mut abreast, mut lists) = (build(), build());
    assert_eq!(abreast.share_on_lattices(), 1.0);
    lists.leave_lattices();
    assert_eq!(lists.share_on_lattices(), 0.0);
    let spacing = case.spacing[0];
    let mut saved = [DamageState::default(), DamageState::default()];
    abreast.save_damage(&mut saved[0]);
    lists.save_damage(&mut saved[1]);
    let (mut f, mut g) = (vec![0.0; position.len() * D], vec![0.0; position.len() * D]);
    let mut worst = 0.0f64;
    for stage in 0..5 {
        let u = motion::<D>(&position, spacing, 5 + stage);
        match stage {
            1 => {
                let plane = 0.3 * case.size[0] as f64 * spacing;
                let cut = |x: [f64; 3], y: [f64; 3]| (x[0] - plane) * (y[0] - plane) < 0.0 && x[1] <= plane && y[1] <= plane;
                let broken = [abreast.cut(cut), lists.cut(cut)];
                assert_eq!(broken[0], broken[1]);
                assert!(broken[0].bonds > 0 && abreast.intact_bonds() < abreast.bonds());
            }
            2 => {
                let threshold = vec![0.012; position.len()];
                let by_stretch = Criterion::CriticalStretch(threshold.clone());
                let mut found = vec![];
                for body in [&mut abreast, &mut lists] {
                    found.push(body.exceeding(&u, None, &by_stretch));
                    // in passing, while forces are evaluated
                    body.internal_force_watching(&u, None, Some(&threshold), f64::INFINITY, &mut f);
                    found.push(body.exceeding_at_force(&threshold));
                }
                for other in &found[1..] {
                    assert!(found[0].iter().map(|b| b.0).eq(other.iter().map(|b| b.0)));
                }
                let some: Vec<_> = found[0].iter().filter(|b| b.1 > 1.5).map(|b| b.0).collect();
                assert!(!some.is_empty() && some.len() < found[0].len());
                abreast.break_bonds(some.clone());
                lists.break_bonds(some);
                assert_eq!(abreast.intact_bonds(), lists.intact_bonds());
            }
            3 => {
                let large: Vec<f64> = u.iter().map(|u| 1.5 * u).collect();
                abreast.commit(&large, None);
                lists.commit(&large, None);
            }
            4 => {
                abreast.restore_damage(&saved[0]);
                lists.restore_damage(&saved[1]);
            }
            _ => {}
        }
        abreast.internal_force(&u, None, &mut f);
        lists.internal_force(&u, None, &mut g);
        let scale = largest(&g);
        assert!(scale > 0.0);
        let off: Vec<f64> = f.iter().zip(&g).map(|(a, b)| a - b).collect();
        worst = worst.max(largest(&off) / scale);
    }
    worst
}

/// A model on a whole body of a case.
fn everywhere<const D: usize>(case: &Case<D>, model: Model<D>) -> impl Fn(&Body<D>) -> Vec<Box<dyn Part<D>>>
where
    Catalog: Compiled<D>,
{
    let (weighted, sets) = (case.weighted, case.sets);
    move |b: &Body<D>| vec![on(&(0..b.points() as u32).collect::<Vec<_>>(), model.clone(), weighted, sets, b)]
}

fn solid<const D: usize>() -> Model<D> {
    correspondence(saint_venant(stiffness()), CONTROLLED)
}

fn corrected<const D: usize>(law: SmoothLaw<D>, order: usize) -> Model<D> {
    Model::Corrected(law, physics::zero_energy::Isotropic::Silling2017 { strength: 1.0 }, order)
}

fn stiffness<const D: usize>() -> Stiffness<D> {
    Stiffness::isotropic(ELASTIC, 0.0, section(D))
}

fn plasticity<const D: usize>() -> SmoothLaw<D> {
    let law = J2PlasticityConstants::new(ELASTIC, 0.02, 0.3, 0.0, section(D)).unwrap();
    SmoothLaw::Plastic(Constants::Uniform(OfStrainConstants { measure: StrainMeasure::Logarithmic, law }))
}

fn bonds<const D: usize>() -> Model<D> {
    common::bonds(3.0, section(D))
}

fn linear_solid<const D: usize>() -> Model<D> {
    common::linear_solid(ELASTIC, section(D))
}

/// Models of every kind in the plane.
fn in_the_plane(case: Case<2>) -> Vec<(&'static str, f64)> {
    let (weighted, divided) = (Case { weighted: true, ..case }, Case { sets: 4, ..case });
    let extended = common::extended(stiffness(), -0.5, BondStrainCalibration::TruncatedMomentTensor, 1.0);
    let of = |case: &Case<2>, model: Model<2>| worst(case, &everywhere(case, model));
    vec![
        ("bond-based", of(&case, bonds())),
        ("bond-based, cone", of(&weighted, bonds())),
        ("linear solid, cone", of(&weighted, linear_solid())),
        ("correspondence", of(&case, solid())),
        ("correspondence, plastic, cone", of(&weighted, correspondence(plasticity(), CONTROLLED))),
        ("extended", of(&case, extended)),
        ("corrected, order 1", of(&weighted, corrected(saint_venant(stiffness()), 1))),
        ("corrected, order 2, plastic", of(&weighted, corrected(plasticity(), 2))),
        ("corrected, order 3", of(&weighted, corrected(saint_venant(stiffness()), 3))),
        ("corrected, order 4", of(&weighted, corrected(saint_venant(stiffness()), 4))),
        ("sub-horizons", of(&divided, Model::SubHorizons(saint_venant(stiffness()), EmptySubHorizon::Renormalise))),
    ]
}

/// The bar asked for is 1e-12; sums in another order differ by a few units of the last place.
fn ask(dimension: &str, found: Vec<(&'static str, f64)>) {
    for (name, worst) in found {
        println!("{dimension}, {name}: {worst:.1e}");
        assert!(worst <= 1e-12, "{dimension}, {name}: {worst:e}");
    }
}

#[test]
fn abreast_as_by_lists_in_three_dimensions() {
    let case = Case { size: [13, 14, 21], spacing: [1e-3; 3], horizon: 2.515e-3, mirrors: false, weighted: false, sets: 0 };
    let of = |model: Model<3>| worst(&case, &everywhere(&case, model));
    let weighted = Case { weighted: true, ..case };
    let corrected = |order: usize| worst(&weighted, &everywhere(&weighted, corrected(saint_venant(stiffness()), order)));
    let found = vec![
        ("bond-based", of(bonds())),
        ("linear solid", of(linear_solid())),
        ("correspondence", of(solid())),
        ("corrected, order 2", corrected(2)),
        ("corrected, order 3", corrected(3)),
    ];
    ask("3D", found);
}

#[test]
fn abreast_as_by_lists_in_the_plane() {
    let case = Case { size: [40, 35], spacing: [2.0, 2.0], horizon: 6.03, mirrors: false, weighted: false, sets: 0 };
    ask("2D", in_the_plane(case));
    // a lattice whose spacings differ, with symmetry planes
    let case = Case { size: [37, 30], spacing: [1.0, 0.8], horizon: 3.015, mirrors: true, weighted: false, sets: 0 };
    ask("2D, mirrors", in_the_plane(case));
}

#[test]
fn abreast_as_by_lists_on_a_line() {
    let case = Case { size: [900], spacing: [0.1], horizon: 0.3015, mirrors: true, weighted: true, sets: 0 };
    let of = |model: Model<1>| worst(&case, &everywhere(&case, model));
    ask("1D", vec![("bond-based", of(bonds())), ("corrected, order 4", of(corrected(saint_venant(stiffness()), 4)))]);
}

#[test]
fn two_materials_in_one_chunk() {
    let case = Case { size: [40, 35], spacing: [1.0, 1.0], horizon: 3.015, mirrors: false, weighted: false, sets: 0 };
    let parts = |b: &Body<2>| -> Vec<Box<dyn Part<2>>> {
        let (front, back): (Vec<u32>, Vec<u32>) = (0..b.points() as u32).partition(|&p| b.position()[p as usize][1] < 17.3);
        vec![on(&front, solid(), false, 0, b), on(&back, common::bonds(7.0, section(2)), false, 0, b)]
    };
    ask("two materials", vec![("correspondence and bonds", worst(&case, &parts))]);
}

#[test]
fn threads_do_not_matter() {
    let case = Case { size: [70, 45], spacing: [1.0, 1.0], horizon: 3.015, mirrors: true, weighted: true, sets: 0 };
    let position = points(&case);
    let run = |threads: usize| {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
            let mut body = bare(&case, &position);
            assert!(body.chunk_count() > 4);
            let parts = everywhere(&case, linear_solid())(&body);
            body.assign(parts).unwrap();
            let mut f = vec![0.0; body.dofs()];
            body.internal_force(&motion::<2>(&position, 1.0, 3), None, &mut f);
            f
        })
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn a_translation_by_a_spacing_meets_nobody() {
    // the near points then lie where empty cells are: no bond may be computed with them
    let case = Case { size: [20, 20], spacing: [1.0, 1.0], horizon: 3.015, mirrors: false, weighted: false, sets: 0 };
    let position = points(&case);
    let mut body = bare(&case, &position);
    let parts = everywhere(&case, bonds())(&body);
    body.assign(parts).unwrap();
    let u: Vec<f64> = position.iter().flat_map(|_| [-1.0, 2.0]).collect();
    let mut f = vec![1.0; u.len()];
    body.internal_force(&u, None, &mut f);
    assert_eq!(largest(&f), 0.0);
}

#[test]
fn what_is_not_for_lattices_keeps_lists() {
    let case = Case { size: [30, 20], spacing: [1.0, 1.0], horizon: 3.015, mirrors: false, weighted: false, sets: 0 };
    let share = |case: &Case<2>, position: &[[f64; 3]], model: Model<2>| {
        let mut body = bare(case, position);
        let parts = everywhere(case, model)(&body);
        body.assign(parts).unwrap();
        body.share_on_lattices()
    };
    let position = points(&case);
    assert_eq!(share(&case, &position, solid()), 1.0);
    // points off the lattice by a millionth of the spacing
    let mut random = Random(9);
    let moved: Vec<[f64; 3]> = position.iter().map(|x| [x[0] + 1e-6 * random.next(), x[1], 0.0]).collect();
    assert_eq!(share(&case, &moved, solid()), 0.0);
    // a law of the rate
    let weighted = Case { weighted: true, ..case };
    assert_eq!(share(&weighted, &position, solid()), 1.0);
    let viscous = Law::KelvinVoigt(Constants::Uniform(KelvinVoigtConstants { stiffness: stiffness::<2>(), retardation_time: 0.1 }));
    assert_eq!(share(&weighted, &position, Model::Correspondence(viscous, CONTROLLED)), 0.0);
}

#[test]
fn a_bond_costs_what_it_should() {
    let case = Case { size: [24, 24, 24], spacing: [1.0; 3], horizon: 3.015, mirrors: false, weighted: false, sets: 0 };
    let position = points(&case);
    let mut body = bare(&case, &position);
    let parts = everywhere(&case, bonds())(&body);
    body.assign(parts).unwrap();
    let each = |body: &Body<3>| body.bytes().0 as f64 / body.bonds() as f64;
    // two bits, padding to eights, the stencil
    assert!((0.2..0.6).contains(&each(&body)), "{}", each(&body));
    // two bytes more where something has asked for lists
    body.forward(&vec![0.0; 3 * position.len()], None);
    assert!((2.2..2.8).contains(&each(&body)), "{}", each(&body));
    // what computes with lists for a moment leaves none
    let mut body = bare(&case, &position);
    let parts = everywhere(&case, bonds())(&body);
    body.assign(parts).unwrap();
    let before = body.bytes();
    assert_eq!(body.energy(&vec![0.0; 3 * position.len()]), 0.0);
    assert_eq!(body.bytes(), before);
}
