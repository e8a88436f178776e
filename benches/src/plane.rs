//! ns per directed bond of the force evaluation in the plane: kinematics of correspondence beside the conventional ones, interleaved in
//! one run, one core.
//!
//! `cargo bench -p peridyne-benches --bench plane [points per side] [rounds]`

use bodies::body::{Body, Geometry};
use bodies::chunk::Link;
use bodies::part::{Assigned, Constants};
use physics::constitutive::SaintVenantKirchhoff;
use physics::elasticity::{Isotropic, Section, Stiffness};
use physics::influence::One;
use physics::material::Material;
use physics::models::{CorrectedCorrespondence, Correspondence, EmptySubHorizon, SubHorizonCorrespondence};
use physics::sub_horizon::Partition;
use physics::tensor::Vector;
use physics::zero_energy::Isotropic::{None as NoControl, Wan2019};
use std::time::Instant;

/// 3.1 diagonals: 60 neighbours.
const HORIZON: f64 = 3.1 * std::f64::consts::SQRT_2;

fn main() {
    let mut arguments = std::env::args().skip(1).filter_map(|a| a.parse::<usize>().ok());
    let side = arguments.next().unwrap_or(250);
    let rounds = arguments.next().unwrap_or(9).max(1);
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("the pool is built once");

    let n = side * side;
    let position: Vec<[f64; 3]> = (0..n).map(|p| [(p % side) as f64, (p / side) as f64, 0.0]).collect();
    let reach = HORIZON as i32;
    let offsets: Vec<[i32; 2]> = (-reach..=reach)
        .flat_map(|b| (-reach..=reach).map(move |a| [a, b]))
        .filter(|&[a, b]| (a, b) != (0, 0) && f64::from(a * a + b * b).sqrt() <= HORIZON)
        .collect();
    let order = bodies::sort::spatial_order(&position, 2, 1.0);
    let place = order.inverse();
    let sorted = order.apply(&position);
    let volume = vec![1.0; n];
    let horizon = vec![HORIZON; n];
    let points: Vec<u32> = (0..n as u32).collect();
    let u: Vec<f64> = (0..2 * n).map(|q| 1e-3 * sorted[q / 2][q % 2] + 1e-3 * ((q * 7919 % 1000) as f64 / 1000.0)).collect();
    let quadrants = |links: &mut [Link], x: [f64; 3]| {
        let bonds: Vec<_> = links.iter().map(|l| (Vector([l.end[0] - x[0], l.end[1] - x[1]]), 1.0)).collect();
        links.iter_mut().zip(Partition::Orthants.membership(&bonds, HORIZON)).for_each(|(l, sets)| l.sets = sets);
    };
    let body = |divided: bool| {
        let g = Geometry { position: &sorted, volume: &volume, horizon: &horizon };
        Body::<2>::new(&g, false, if divided { 4 } else { 0 }, |p, out: &mut Vec<Link>| {
            let x = sorted[p];
            let near = offsets.iter().filter_map(|o| {
                let q = [x[0] as i32 + o[0], x[1] as i32 + o[1]];
                q.iter().all(|&k| k >= 0 && (k as usize) < side).then(|| q[0] as usize + side * q[1] as usize)
            });
            out.extend(near.map(|q| Link { point: place.order()[q], flips: 0, end: position[q], weight: 1.0, sets: 0 }));
            if divided {
                quadrants(out, x);
            }
        })
    };
    let constants = || {
        Constants::Uniform(Stiffness::<2>::isotropic(Isotropic { young: 1.0, poisson: 0.25 }, 0.0, Section::PlaneStrain { thickness: 1.0 }))
    };
    fn with<M: Material<2>>(mut body: Body<2>, model: M, c: Constants<M::Constants>, points: &[u32]) -> Body<2> {
        let part = Assigned::new("material", model, c, points, body.chunks());
        body.assign(vec![Box::new(part)]).expect("every family is regular");
        body
    }
    let law = SaintVenantKirchhoff;
    let conventional = |control| with(body(false), Correspondence { law, control, omega: One }, constants(), &points);
    let mut yardstick = conventional(NoControl);
    let bonds = yardstick.bonds();
    println!("{n} points, {bonds} directed bonds, one thread, {}", physics::lanes::name());
    println!("{:32}{:>12}{:>14}{:>12}{:>10}", "ns per directed bond", "ours", "conventional", "ratio", "bytes");
    let divided = SubHorizonCorrespondence::<_, _, 4> { law, omega: One, empty: EmptySubHorizon::Renormalise };
    let corrected = CorrectedCorrespondence::<_, _, _, 14> { law, control: NoControl, omega: One, order: 3 };
    let others = [
        ("conventional, Wan2019 control", conventional(Wan2019)),
        ("four quadrants", with(body(true), divided, constants(), &points)),
        ("corrected, order 3", with(body(false), corrected, constants(), &points)),
    ];
    let (mut f, mut g) = (vec![0.0; 2 * n], vec![0.0; 2 * n]);
    for (name, mut body) in others {
        let (mut ours, mut theirs) = (vec![], vec![]);
        for _ in 0..rounds {
            let t = Instant::now();
            body.internal_force(&u, None, &mut f);
            ours.push(t.elapsed().as_secs_f64());
            let t = Instant::now();
            yardstick.internal_force(&u, None, &mut g);
            theirs.push(t.elapsed().as_secs_f64());
        }
        let mut ratio: Vec<f64> = ours.iter().zip(&theirs).map(|(a, b)| a / b).collect();
        for v in [&mut ours, &mut theirs, &mut ratio] {
            v.sort_by(f64::total_cmp);
        }
        let ns = |t: f64| t * 1e9 / bonds as f64;
        let (b, p, s) = body.bytes();
        let bytes = (b + p + s) as f64 / bonds as f64;
        println!("{name:32}{:>12.2}{:>14.2}{:>12.2}{bytes:>10.1}", ns(ours[rounds / 2]), ns(theirs[rounds / 2]), ratio[rounds / 2]);
    }
}
