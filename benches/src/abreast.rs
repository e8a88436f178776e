//! Bodies on a lattice: force evaluation with points abreast beside lists of bonds, and the explicit step with a check of critical
//! stretches, interleaved in one run. Times are of the processor, not of the clock on the wall, so that a busy machine may be used.
//!
//! `cargo bench -p peridyne-benches --bench abreast [rounds] [threads]`

use bodies::body::{Body, Geometry};
use bodies::chunk::Link;
use bodies::damage::Criterion;
use bodies::part::{Assigned, Constants, Part};
use bodies::structure::{Failure, Parts, Structure};
use physics::constitutive::SaintVenantKirchhoff;
use physics::elasticity::{Isotropic, Section, Stiffness};
use physics::influence::One;
use physics::models::{BondBased, BondBasedConstants, Correspondence, LinearPeridynamicSolid, LinearPeridynamicSolidConstants};
use physics::stretch_law::Elastic;
use physics::zero_energy;
use solvers::observe::Silent;
use solvers::velocity_verlet::{Motion, VelocityVerlet};
use std::time::Instant;

/// Seconds that all threads of this process have run.
fn busy() -> f64 {
    let threads = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let nanoseconds = |path: std::path::PathBuf| -> Option<f64> {
        std::fs::read_to_string(path.join("schedstat")).ok()?.split_whitespace().next()?.parse().ok()
    };
    threads.filter_map(|t| nanoseconds(t.path())).sum::<f64>() * 1e-9
}

/// A block of a lattice of unit spacing, in spatial order.
fn block<const D: usize>(size: [usize; D], horizon: f64) -> Body<D> {
    let n: usize = size.iter().product();
    let mut position = vec![[0.0; 3]; n];
    for (p, x) in position.iter_mut().enumerate() {
        let mut q = p;
        for k in 0..D {
            x[k] = (q % size[k]) as f64;
            q /= size[k];
        }
    }
    let order = bodies::sort::spatial_order(&position, D, 1.0);
    let place = order.inverse();
    let sorted = order.apply(&position);
    let reach = horizon as i64;
    let mut offsets = vec![];
    let width = (2 * reach + 1) as usize;
    for q in 0..width.pow(D as u32) {
        let o: [i64; D] = std::array::from_fn(|k| (q / width.pow(k as u32) % width) as i64 - reach);
        let square: i64 = o.iter().map(|a| a * a).sum();
        if square > 0 && (square as f64).sqrt() <= horizon {
            offsets.push(o);
        }
    }
    let (volume, horizons) = (vec![1.0; n], vec![horizon; n]);
    let g = Geometry { position: &sorted, volume: &volume, horizon: &horizons };
    Body::<D>::new(&g, false, 0, |p, out: &mut Vec<Link>| {
        out.extend(offsets.iter().filter_map(|o| {
            let (mut q, mut stride) = (0, 1);
            for k in 0..D {
                let x = sorted[p][k] as i64 + o[k];
                if x < 0 || x >= size[k] as i64 {
                    return None;
                }
                q += x as usize * stride;
                stride *= size[k];
            }
            Some(Link { point: place.order()[q], flips: 0, end: position[q], weight: 1.0, sets: 0 })
        }));
    })
}

fn compare<const D: usize>(size: [usize; D], horizon: f64, section: Section, rounds: usize, threads: usize) {
    let elastic = Isotropic { young: 1.0, poisson: 0.25 };
    let make = |part: &dyn Fn(&Body<D>) -> Box<dyn Part<D>>| {
        let t = Instant::now();
        let mut body = block(size, horizon);
        let part = part(&body);
        body.assign(vec![part]).expect("every family is regular");
        (body, t.elapsed().as_secs_f64())
    };
    let points: Vec<u32> = (0..size.iter().product::<usize>() as u32).collect();
    let bond_based = |b: &Body<D>| -> Box<dyn Part<D>> {
        let constants = BondBasedConstants { young: 1.0, section, continuum: false };
        Box::new(Assigned::new("b", BondBased { law: Elastic, omega: One }, Constants::Uniform(constants), &points, b.chunks()))
    };
    let linear_solid = |b: &Body<D>| -> Box<dyn Part<D>> {
        let constants = LinearPeridynamicSolidConstants::new(elastic, section);
        Box::new(Assigned::new("l", LinearPeridynamicSolid { omega: One }, Constants::Uniform(constants), &points, b.chunks()))
    };
    let correspondence = |b: &Body<D>| -> Box<dyn Part<D>> {
        let model = Correspondence { law: SaintVenantKirchhoff, control: zero_energy::Isotropic::Wan2019, omega: One };
        let constants = Stiffness::<D>::isotropic(elastic, 0.0, section);
        Box::new(Assigned::new("c", model, Constants::Uniform(constants), &points, b.chunks()))
    };
    type Make<'a, const D: usize> = &'a dyn Fn(&Body<D>) -> Box<dyn Part<D>>;
    let models: [(&str, Make<D>); 3] = [("bond-based", &bond_based), ("linear solid", &linear_solid), ("correspondence", &correspondence)];
    for (name, part) in models {
        let ((mut fast, seconds), (mut slow, _)) = (make(part), make(part));
        slow.leave_lattices();
        let bonds = fast.bonds();
        let u: Vec<f64> =
            (0..fast.dofs()).map(|q| 1e-3 * fast.position()[q / D][q % D] + 1e-3 * ((q * 7919 % 1000) as f64 / 1000.0)).collect();
        let bytes = |b: &Body<D>| {
            let (x, y, z) = b.bytes();
            (x + y + z) as f64 / bonds as f64
        };
        let (bytes, share) = ([bytes(&fast), bytes(&slow)], fast.share_on_lattices());
        let (mut f, mut g) = (vec![0.0; u.len()], vec![0.0; u.len()]);
        slow.internal_force(&u, None, &mut g);
        fast.internal_force(&u, None, &mut f);
        let scale = g.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let difference = f.iter().zip(&g).fold(0.0f64, |m, (a, b)| m.max((a - b).abs())) / scale;
        let n = fast.points();
        let parts = Parts { id: (0..n as u64).collect(), user: (0..n as u32).collect(), material: vec![0; n], density: vec![1.0; n] };
        // no bond comes near its threshold
        let failure = Failure { criterion: Criterion::CriticalStretch(vec![1.0; n]), batch: 0.9 };
        let mut structure = Structure::new(fast, parts, vec![], None, vec![failure], 1.0);
        let mut motion = Motion { time: 0.0, step: 0, u: u.clone(), v: vec![0.0; u.len()] };
        let mut times = [vec![], vec![], vec![]];
        let (mut wall, mut spent) = (0.0, 0.0);
        const STEPS: usize = 4;
        for _ in 0..rounds {
            let (a, w) = (busy(), Instant::now());
            let run =
                VelocityVerlet { time_step: 1e-6, end: motion.time + STEPS as f64 * 1e-6, observe_every: usize::MAX, following: None };
            run.run(&mut structure, &mut motion, &mut Silent, None).expect("a motion that can be followed");
            let b = busy();
            wall += w.elapsed().as_secs_f64();
            spent += b - a;
            (0..STEPS).for_each(|_| structure.body.internal_force(&u, None, &mut f));
            let c = busy();
            slow.internal_force(&u, None, &mut g);
            // the force at the start of the run is one evaluation more
            times[0].push((b - a) / (STEPS + 1) as f64);
            times[1].push((c - b) / STEPS as f64);
            times[2].push(busy() - c);
        }
        let ns = |t: &mut Vec<f64>| {
            t.sort_by(f64::total_cmp);
            [t[t.len() / 2], t[0]].map(|t| t * 1e9 / bonds as f64)
        };
        let [step, force, lists] = times.each_mut().map(ns);
        println!(
            "{name:16}{bonds:>10}  {:>6.2}{:>6.2}  {:>6.2}{:>6.2}  {:>6.2}{:>6.2}  {:>6.2} {:>6.1}{:>6.1}{difference:>9.1e}{seconds:>6.2}{:>6.2}{share:>6.2}",
            step[0],
            step[1],
            force[0],
            force[1],
            lists[0],
            lists[1],
            lists[0] / force[0],
            bytes[0],
            bytes[1],
            spent / wall / threads as f64,
        );
    }
}

fn main() {
    let mut arguments = std::env::args().skip(1).filter_map(|a| a.parse::<usize>().ok());
    let rounds = arguments.next().unwrap_or(7).max(1);
    let threads = arguments.next().unwrap_or(1).max(1);
    rayon::ThreadPoolBuilder::new().num_threads(threads).build_global().expect("the pool is built once");
    println!("ns of processor time per directed bond, median and best: explicit step (and critical stretches), force, force by lists;");
    println!(
        "ratio of forces; bytes a bond, by lists; difference; set-up in seconds; share of the clock; share on lattices. {}",
        physics::lanes::name()
    );
    compare([50, 50, 40], 3.015, Section::Solid, rounds, threads);
    compare([250, 250], 3.1 * std::f64::consts::SQRT_2, Section::PlaneStrain { thickness: 1.0 }, rounds, threads);
}
