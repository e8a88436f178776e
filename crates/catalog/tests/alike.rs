//! Families of equal shape: found where they are, not where they are not, and their stiffness is the same as computed one by one.

mod common;

use bodies::body::{Body, Geometry};
use bodies::chunk::Link;
use bodies::loads::{self, Condition, Field};
use bodies::neighbors::neighbors;
use bodies::part::Constants;
use bodies::structure::{Parts, Structure};
use catalog::Model;
use common::{CONTROLLED, correspondence, on, saint_venant};
use physics::elasticity::{Isotropic, Section, Stiffness};
use physics::models::{BondBasedConstants, EmptySubHorizon};
use physics::sub_horizon::Partition;
use physics::tensor::Vector;
use solvers::problem::Statics;
use solvers::sparse::BlockMatrix;
use std::collections::BTreeSet;

const ELASTIC: Isotropic = Isotropic { young: 3.0, poisson: 0.25 };
const SECTION: Section = Section::PlaneStrain { thickness: 1.0 };

#[derive(Clone, Copy, Debug)]
enum Kind {
    BondBased,
    Correspondence,
    Quadrants,
}

/// A lattice far from the origin in a unit of 0.1, so that differences of coordinates carry rounding.
fn lattice(columns: usize, rows: usize) -> Vec<[f64; 3]> {
    (0..columns * rows).map(|q| [17.3 + 0.1 * (q % columns) as f64, -5.1 + 0.1 * (q / columns) as f64, 0.0]).collect()
}

fn body(position: &[[f64; 3]], volume: &[f64], kind: Kind) -> Body<2> {
    let n = position.len();
    let horizon = vec![0.21; n];
    let found = neighbors(position, 2, &horizon).unwrap();
    let g = Geometry { position, volume, horizon: &horizon };
    let divided = matches!(kind, Kind::Quadrants);
    let mut body = Body::<2>::new(&g, false, if divided { 4 } else { 0 }, |p, out: &mut Vec<Link>| {
        out.extend(found.of(p).iter().map(|&q| Link { point: q, flips: 0, end: position[q as usize], weight: 1.0, sets: 0 }));
        if divided {
            let bonds: Vec<_> = out.iter().map(|l| (Vector([l.end[0] - position[p][0], l.end[1] - position[p][1]]), 0.01)).collect();
            out.iter_mut().zip(Partition::Orthants.membership(&bonds, 0.21)).for_each(|(l, sets)| l.sets = sets);
        }
    });
    let points: Vec<u32> = (0..n as u32).collect();
    let law = saint_venant(Stiffness::<2>::isotropic(ELASTIC, 0.0, SECTION));
    let model = match kind {
        Kind::BondBased => Model::ElasticBonds(Constants::Uniform(BondBasedConstants { young: 3.0, section: SECTION, continuum: true })),
        Kind::Correspondence => correspondence(law, CONTROLLED),
        Kind::Quadrants => Model::SubHorizons(law, EmptySubHorizon::Renormalise),
    };
    let part = on(&points, model, false, if divided { 4 } else { 0 }, &body);
    body.assign(vec![part]).unwrap();
    body
}

fn structure(body: Body<2>) -> Structure<2> {
    let n = body.points();
    let zero = || -> Option<Field> { Some(Box::new(|_, _| 0.0)) };
    let held = Condition {
        name: "held".into(),
        kind: loads::Kind::Displacement,
        points: vec![0, 1, 2],
        components: [zero(), zero(), None],
        along: None,
    };
    let parts = Parts { id: (0..n as u64).collect(), user: (0..n as u32).collect(), material: vec![0; n], density: vec![1.0; n] };
    Structure::new(body, parts, vec![held], None, vec![], 1.0)
}

fn distinct(body: &Body<2>) -> usize {
    body.alike().into_iter().collect::<BTreeSet<u32>>().len()
}

#[test]
fn a_lattice_has_as_many_shapes_as_places_relative_to_its_edges() {
    let position = lattice(14, 11);
    let even = vec![0.01; position.len()];
    for model in [Kind::BondBased, Kind::Correspondence, Kind::Quadrants] {
        let mut b = body(&position, &even, model);
        b.forward(&vec![0.0; 2 * position.len()], None);
        // two layers at each edge and the middle, along both axes
        assert_eq!(distinct(&b), 25, "{model:?}");
    }
    // one point of another volume: the 13 families that hold it stand alone, and the other 24 shapes remain besides that of the middle
    let mut uneven = even.clone();
    uneven[5 * 14 + 6] = 0.011;
    assert_eq!(distinct(&body(&position, &uneven, Kind::Correspondence)), 25 + 13);
    // and one that is out of its place by a millionth of the spacing
    let mut moved = position.clone();
    moved[5 * 14 + 6][0] += 1e-7;
    assert_eq!(distinct(&body(&moved, &even, Kind::Correspondence)), 25 + 13);
}

#[test]
fn shared_stiffness_is_the_stiffness() {
    let mut position = lattice(40, 30);
    position[411][1] += 0.02;
    let volume: Vec<f64> = (0..position.len()).map(|p| if p == 700 { 0.02 } else { 0.01 }).collect();
    for model in [Kind::BondBased, Kind::Correspondence, Kind::Quadrants] {
        let mut s = structure(body(&position, &volume, model));
        let n = Statics::dofs(&s);
        let (u, x): (Vec<f64>, Vec<f64>) = (vec![0.0; n], (0..n).map(|q| ((q * 7919 % 1009) as f64 - 504.0) / 504.0).collect());
        let (mut want, mut got) = (vec![0.0; n], vec![0.0; n]);
        Statics::tangent_product(&mut s, 0.0, &u, &x, &mut want).unwrap();
        let scale = want.iter().fold(0.0f64, |m, y| m.max(y.abs()));
        let differs = |got: &[f64]| want.iter().zip(got).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / scale;
        let mut matrix = BlockMatrix::new(s.pattern().unwrap());
        s.tangent(0.0, &u, &mut matrix).unwrap();
        matrix.product(&x, &mut got);
        // coordinates of 20 in steps of 0.1: bonds of equal families differ by 200 roundings
        assert!(differs(&got) <= 1e-12, "{model:?}: {:e}", differs(&got));
        // products in statics, from small forces: the first is compared with the exact one inside, the second is not
        s.set_statics(true);
        for _ in 0..2 {
            got.fill(0.0);
            Statics::tangent_product(&mut s, 0.0, &u, &x, &mut got).unwrap();
            assert!(differs(&got) <= 1e-11, "{model:?}: {:e}", differs(&got));
        }
        // the diagonal blocks, against the matrix
        let (mut blocks, mut of_matrix) = (vec![0.0; 2 * n], vec![0.0; 2 * n]);
        s.block_diagonal(0.0, &u, &mut blocks).unwrap();
        matrix.diagonal_blocks(&mut of_matrix);
        let most = of_matrix.iter().fold(0.0f64, |m, y| m.max(y.abs()));
        let worst = blocks.iter().zip(&of_matrix).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst <= 1e-12 * most, "{model:?}: {:e}", worst / most);
    }
}
