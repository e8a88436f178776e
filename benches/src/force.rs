//! ns per directed bond of the force evaluation, model by model, one core, beside plain hand-written loops of the same
//! kernels, interleaved in one run; and bytes per directed bond.
//!
//! `cargo bench -p peridyne-benches --bench force [points per side] [rounds]`

mod yardstick;

use bodies::body::{Body, Geometry};
use bodies::chunk::Link;
use bodies::part::{Assigned, Constants, Part};
use physics::constitutive::LinearElastic;
use physics::constitutive::SaintVenantKirchhoff;
use physics::elasticity::{Isotropic, Section, Stiffness};
use physics::influence::One;
use physics::models::{
    BondBased, BondBasedConstants, BondStrainCalibration, Correspondence, ExtendedCorrespondence, LinearPeridynamicSolid,
    LinearPeridynamicSolidConstants, SethHill,
};
use physics::stretch_law::Elastic;
use physics::zero_energy;
use std::time::Instant;
use yardstick::Lists;

const HORIZON: f64 = 3.015;

fn main() {
    let mut arguments = std::env::args().skip(1).filter_map(|a| a.parse::<usize>().ok());
    let side = arguments.next().unwrap_or(46);
    let rounds = arguments.next().unwrap_or(7).max(1);
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("the pool is built once");

    let n = side * side * side;
    let position: Vec<[f64; 3]> = (0..n).map(|p| [p % side, p / side % side, p / side / side].map(|k| k as f64)).collect();
    let mut offsets = vec![];
    for c in -3i32..=3 {
        for b in -3i32..=3 {
            for a in -3i32..=3 {
                let square = (a * a + b * b + c * c) as f64;
                if square > 0.0 && square.sqrt() <= HORIZON {
                    offsets.push([a, b, c]);
                }
            }
        }
    }
    let family = |p: usize| {
        let x = position[p];
        offsets.iter().filter_map(move |o| {
            let q = [x[0] as i32 + o[0], x[1] as i32 + o[1], x[2] as i32 + o[2]];
            q.iter().all(|&k| k >= 0 && (k as usize) < side).then(|| q[0] as usize + side * (q[1] as usize + side * q[2] as usize))
        })
    };
    let mut lists = Lists { x: position.iter().flatten().copied().collect(), start: vec![0], neighbor: vec![], length: vec![] };
    for p in 0..n {
        for q in family(p) {
            lists.neighbor.push(q as u32);
            let d: f64 = (0..3).map(|k| (position[q][k] - position[p][k]).powi(2)).sum();
            lists.length.push(d.sqrt());
        }
        lists.start.push(lists.neighbor.len());
    }
    let bonds = lists.neighbor.len();
    let u: Vec<f64> = (0..3 * n).map(|q| 1e-3 * lists.x[q] + 1e-3 * ((q * 7919 % 1000) as f64 / 1000.0)).collect();
    let y: Vec<f64> = u.iter().zip(&lists.x).map(|(u, x)| u + x).collect();
    println!("{n} points, {bonds} directed bonds, horizon ratio {HORIZON}, one thread, {}", physics::lanes::name());

    let elastic = Isotropic { young: 1.0, poisson: 0.25 };
    let section = Section::Solid;
    let volume = vec![1.0; n];
    let horizon = vec![HORIZON; n];
    let points: Vec<u32> = (0..n as u32).collect();
    // the body is in spatial order, as in every run of the program; the hand-written loops in the order of the lattice
    let order = bodies::sort::spatial_order(&position, 3, 1.0);
    let place = order.inverse();
    let sorted = order.apply(&position);
    let moved: Vec<f64> = order.order().iter().flat_map(|&p| u[3 * p as usize..3 * p as usize + 3].to_vec()).collect();
    let make = |part: &dyn Fn(&Body<3>) -> Box<dyn Part<3>>| {
        let g = Geometry { position: &sorted, volume: &volume, horizon: &horizon };
        let mut body = Body::<3>::new(&g, false, 0, |p, out: &mut Vec<Link>| {
            let neighbors = family(order.order()[p] as usize);
            out.extend(neighbors.map(|q| Link { point: place.order()[q], flips: 0, end: position[q], weight: 1.0, sets: 0 }));
        });
        let part = part(&body);
        body.assign(vec![part]).expect("every family is regular");
        body
    };

    // what the yardsticks need, by their own arithmetic
    let c = 18.0 * elastic.bulk() / (std::f64::consts::PI * HORIZON.powi(4));
    let m: Vec<f64> = (0..n).map(|p| (lists.start[p]..lists.start[p + 1]).map(|s| lists.length[s].powi(2)).sum()).collect();
    let inverse: Vec<[f64; 9]> = (0..n)
        .map(|p| {
            let mut k = [[0.0; 3]; 3];
            for q in family(p) {
                for a in 0..3 {
                    for b in 0..3 {
                        k[a][b] += (position[q][a] - position[p][a]) * (position[q][b] - position[p][b]);
                    }
                }
            }
            let i = physics::tensor::Matrix(k).inverse();
            std::array::from_fn(|e| i.0[e / 3][e % 3])
        })
        .collect();
    // one strength everywhere (that of an interior family), so that the hand-written loop can hold it in a register
    let middle = n / 2 + side * (side / 2) + side / 2;
    let trace: f64 = inverse[middle][0] + inverse[middle][4] + inverse[middle][8];
    let strength = (3.0 * elastic.lambda() + 2.0 * elastic.shear()) * trace / 3.0;

    let bond_based = |b: &Body<3>| -> Box<dyn Part<3>> {
        let constants = BondBasedConstants { young: 1.0, section, continuum: true };
        Box::new(Assigned::new("bond-based", BondBased { law: Elastic, omega: One }, Constants::Uniform(constants), &points, b.chunks()))
    };
    let linear_solid = |b: &Body<3>| -> Box<dyn Part<3>> {
        let constants = LinearPeridynamicSolidConstants::new(elastic, section);
        Box::new(Assigned::new("linear solid", LinearPeridynamicSolid { omega: One }, Constants::Uniform(constants), &points, b.chunks()))
    };
    let correspondence = |b: &Body<3>| -> Box<dyn Part<3>> {
        let model = Correspondence { law: SaintVenantKirchhoff, control: zero_energy::Isotropic::Wan2019, omega: One };
        let constants = Stiffness::<3>::isotropic(elastic, 0.0, section);
        Box::new(Assigned::new("correspondence", model, Constants::Uniform(constants), &points, b.chunks()))
    };

    // exponent, strength of the control
    let extended = |m: f64, control: f64| {
        let points = &points;
        move |b: &Body<3>| -> Box<dyn Part<3>> {
            let exponent = SethHill::new(m).expect("a moderate exponent");
            let calibration = BondStrainCalibration::MomentTensor;
            let model = ExtendedCorrespondence { law: LinearElastic, exponent, calibration, control, omega: One };
            let constants = Stiffness::<3>::isotropic(elastic, 0.0, section);
            Box::new(Assigned::new("extended", model, Constants::Uniform(constants), points, b.chunks()))
        }
    };

    println!("{:32}{:>12}{:>12}{:>12}{:>10}{:>14}", "ns per directed bond", "ours", "by hand", "ratio", "bytes", "difference");
    let mut f = vec![0.0; 3 * n];
    let mut g = vec![0.0; 3 * n];
    type Model<'a> = (&'a str, &'a dyn Fn(&Body<3>) -> Box<dyn Part<3>>, Box<dyn Fn(&mut [f64]) + 'a>);
    let models: [Model; 3] = [
        ("bond-based", &bond_based, Box::new(|f| yardstick::bond_based(&lists, &y, c, f))),
        (
            "linear peridynamic solid",
            &linear_solid,
            Box::new(|f| yardstick::linear_solid(&lists, &y, &m, elastic.bulk(), elastic.shear(), f)),
        ),
        (
            "correspondence + control",
            &correspondence,
            Box::new(|f| yardstick::correspondence(&lists, &y, &inverse, elastic.lambda(), elastic.shear(), strength, f)),
        ),
    ];
    for (name, part, by_hand) in &models {
        let mut body = make(part);
        let (mut ours, mut theirs) = (vec![], vec![]);
        for _ in 0..rounds {
            let t = Instant::now();
            body.internal_force(&moved, None, &mut f);
            ours.push(t.elapsed().as_secs_f64());
            let t = Instant::now();
            by_hand(&mut g);
            theirs.push(t.elapsed().as_secs_f64());
        }
        let mut ratio: Vec<f64> = theirs.iter().zip(&ours).map(|(a, b)| a / b).collect();
        for v in [&mut ours, &mut theirs, &mut ratio] {
            v.sort_by(f64::total_cmp);
        }
        let scale = g.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        // interior points only: the hand-written control has one strength
        let interior = |p: usize| position[p].iter().all(|&x| x >= 7.0 && x < side as f64 - 7.0);
        let difference =
            (0..3 * n).filter(|q| interior(q / 3)).fold(0.0f64, |m, q| m.max((f[3 * place.order()[q / 3] as usize + q % 3] - g[q]).abs()))
                / scale;
        let (b, p, s) = body.bytes();
        println!(
            "{name:32}{:>12.2}{:>12.2}{:>12.2}{:>10.1}{:>14.1e}",
            ours[rounds / 2] * 1e9 / bonds as f64,
            theirs[rounds / 2] * 1e9 / bonds as f64,
            ratio[rounds / 2],
            (b + p + s) as f64 / bonds as f64,
            difference
        );
        println!("{:32}{:>12.2}{:>12.2}", "   (best of the rounds)", ours[0] * 1e9 / bonds as f64, theirs[0] * 1e9 / bonds as f64);
    }

    // no hand-written loops: beside the linear solid, interleaved
    println!("\n{:32}{:>12}{:>12}{:>12}{:>10}", "ns per directed bond", "ours", "linear solid", "ratio", "bytes");
    let mut yardstick = make(&linear_solid);
    for (m, control) in
        [(1.0, 0.0), (0.0, 0.0), (0.5, 0.0), (-0.5, 0.0), (-1.0, 0.0), (0.7, 0.0), (1.0, 1.0), (-0.5, 1.0), (0.0, 1.0), (0.7, 1.0)]
    {
        let mut body = make(&extended(m, control));
        let (mut ours, mut theirs) = (vec![], vec![]);
        for _ in 0..rounds {
            let t = Instant::now();
            body.internal_force(&moved, None, &mut f);
            ours.push(t.elapsed().as_secs_f64());
            let t = Instant::now();
            yardstick.internal_force(&moved, None, &mut g);
            theirs.push(t.elapsed().as_secs_f64());
        }
        let mut ratio: Vec<f64> = ours.iter().zip(&theirs).map(|(a, b)| a / b).collect();
        for v in [&mut ours, &mut theirs, &mut ratio] {
            v.sort_by(f64::total_cmp);
        }
        let (b, p, s) = body.bytes();
        let name = format!("extended, m = {m}{}", if control > 0.0 { ", control" } else { "" });
        let ns = |t: f64| t * 1e9 / bonds as f64;
        let bytes = (b + p + s) as f64 / bonds as f64;
        println!("{name:32}{:>12.2}{:>12.2}{:>12.2}{bytes:>10.1}", ns(ours[rounds / 2]), ns(theirs[rounds / 2]), ratio[rounds / 2]);
        println!("{:32}{:>12.2}{:>12.2}{:>12.2}", "   (best of the rounds)", ns(ours[0]), ns(theirs[0]), ours[0] / theirs[0]);
    }
}
