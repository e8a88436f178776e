//! Force evaluation of bodies on a lattice: eight points abreast beside lists of bonds, interleaved in one run, one core. Times are of the
//! processor, not of the clock on the wall, so that a busy machine may be used.
//!
//! `cargo run --release -p peridyne-benches --bin lattice [rounds] [threads]`

use bodies::body::{Body, Geometry};
use bodies::chunk::Link;
use bodies::part::{Assigned, Constants, Part};
use physics::constitutive::SaintVenantKirchhoff;
use physics::elasticity::{Isotropic, Section, Stiffness};
use physics::influence::One;
use physics::models::{BondBased, BondBasedConstants, Correspondence, LinearPeridynamicSolid, LinearPeridynamicSolidConstants};
use physics::stretch_law::Elastic;
use physics::zero_energy;
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
        let u: Vec<f64> = (0..fast.dofs()).map(|q| 1e-3 * fast.position()[q / D][q % D] + 1e-3 * ((q * 7919 % 1000) as f64 / 1000.0)).collect();
        let (mut f, mut g) = (vec![0.0; u.len()], vec![0.0; u.len()]);
        let mut times = [vec![], vec![]];
        let (mut wall, mut spent) = (0.0, 0.0);
        for _ in 0..rounds {
            let (t, w) = (busy(), Instant::now());
            (0..3).for_each(|_| fast.internal_force(&u, None, &mut f));
            wall += w.elapsed().as_secs_f64() / 3.0;
            let m = busy();
            spent += (m - t) / 3.0;
            slow.internal_force(&u, None, &mut g);
            times[0].push((m - t) / 3.0);
            times[1].push(busy() - m);
        }
        let mut ratio: Vec<f64> = times[1].iter().zip(&times[0]).map(|(a, b)| a / b).collect();
        times.iter_mut().for_each(|t| t.sort_by(f64::total_cmp));
        ratio.sort_by(f64::total_cmp);
        let scale = g.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let difference = f.iter().zip(&g).fold(0.0f64, |m, (a, b)| m.max((a - b).abs())) / scale;
        let bytes = |b: &Body<D>| {
            let (x, y, z) = b.bytes();
            (x + y + z) as f64 / bonds as f64
        };
        let ns = |t: f64| t * 1e9 / bonds as f64;
        println!(
            "{name:16}{:>10}{:>8.2}{:>8.2} {:>8.2}{:>8.2}{:>8.2}{:>8.1}{:>7.1}{:>9.1e}{:>7.2}{:>7.2}  {:.2}",
            bonds,
            ns(times[0][rounds / 2]),
            ns(times[0][0]),
            ns(times[1][rounds / 2]),
            ns(times[1][0]),
            ratio[rounds / 2],
            bytes(&fast),
            bytes(&slow),
            difference,
            seconds,
            spent / wall / threads as f64,
            fast.share_on_lattices(),
        );
    }
}

fn main() {
    let mut arguments = std::env::args().skip(1).filter_map(|a| a.parse::<usize>().ok());
    let rounds = arguments.next().unwrap_or(7).max(1);
    let threads = arguments.next().unwrap_or(1).max(1);
    rayon::ThreadPoolBuilder::new().num_threads(threads).build_global().expect("the pool is built once");
    println!("ns per directed bond of processor time, median and best; abreast on the lattice, lists, ratio; bytes a bond; {}", physics::lanes::name());
    compare([50, 50, 40], 3.015, Section::Solid, rounds, threads);
    compare([250, 250], 3.1 * std::f64::consts::SQRT_2, Section::PlaneStrain { thickness: 1.0 }, rounds, threads);
    compare([100_000], 3.015, Section::Bar { area: 1.0 }, 1.max(rounds / 2), threads);
}
