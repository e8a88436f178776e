//! Speed of every model, as the program runs it: force evaluation and explicit step, one core and all, beside the roofline; growth with the
//! size of the body; and set-up.
//!
//! ```text
//! cargo bench -p peridyne-benches --bench suite [-- [--quick] [--large] [--cores] [--csv FILE] [--only NAME] [--lanes portable|avx2|avx512]]
//! ```
//!
//! `--lanes`: nothing wider, to see what older processors would do. `--quick`: small blocks, few rounds. `--large`: two cores at 10⁶ points,
//! growth up to 10⁷ (8 GB). `--cores`: two cores only. Rounds are interleaved: each runs every model once, and what is printed is the
//! median over rounds with least and most; one core and two are compared within a round.

mod decks;

use bodies::structure::Simulated;
use decks::{Block, MODELS, Model, Push, STEP, block, block_under};
use physics::lanes::{Instructions, limit};
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use solvers::observe::{Observer, StepReport};
use solvers::problem::Dynamics;
use solvers::velocity_verlet::{Motion, VelocityVerlet};
use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::time::Instant;

/// Force evaluations and steps of one timing.
const TIMES: [usize; 2] = [3, 8];
/// Seconds on one core of one timing where one core is compared with two: so long that waking the second, a matter of milliseconds, does not
/// count, and so short that the machine is the same for both.
const SPAN: f64 = 0.15;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let has = |name: &str| arguments.iter().any(|a| a == name);
    let value = |name: &str| arguments.iter().position(|a| a == name).and_then(|k| arguments.get(k + 1)).cloned();
    match value("--lanes").as_deref() {
        None | Some("avx512") => {}
        Some("avx2") => limit(Instructions::Avx2),
        Some("portable") => limit(Instructions::Portable),
        Some(other) => {
            eprintln!("no lanes `{other}`; there are portable, avx2, avx512");
            std::process::exit(2);
        }
    }
    let (quick, only) = (has("--quick"), value("--only"));
    let rounds = if quick { 3 } else { 7 };
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get()).min(2);
    let pools: Vec<ThreadPool> = (1..=cores).map(|n| ThreadPoolBuilder::new().num_threads(n).build().expect("threads start")).collect();

    println!("{}, {} cores used; {}", processor(), cores, physics::lanes::name());
    let bandwidth: Vec<f64> = pools.iter().map(triad).collect();
    let list: Vec<String> = bandwidth.iter().map(|b| format!("{:.1}", b / 1e9)).collect();
    println!(
        "triad bandwidth: {} GB/s on {} core(s)\n",
        list.join(", "),
        (1..=cores).map(|n| n.to_string()).collect::<Vec<_>>().join(", ")
    );

    let mut csv = String::from(
        "kind,dimension,model,points,bonds,bytes_per_bond,force_ns,force_ns_least,force_ns_most,step_ns,step_ns_least,step_ns_most,roofline_share,\
         force_efficiency,step_efficiency\n",
    );
    let wanted = |m: &&Model| only.as_ref().is_none_or(|name| m.name.contains(name.as_str()));
    let only_cores = has("--cores");
    for dimension in [3, 2, 1].into_iter().filter(|_| !only_cores) {
        let cells = match (dimension, quick) {
            (3, false) => [50, 50, 40],
            (3, true) => [24, 24, 20],
            (2, false) => [400, 250, 1],
            (2, true) => [120, 100, 1],
            (_, false) => [100_000, 1, 1],
            _ => [10_000, 1, 1],
        };
        let models: Vec<&Model> = MODELS.iter().filter(|m| m.dimension == dimension).filter(wanted).collect();
        let mut blocks: Vec<Block> = models.iter().map(|m| pools[cores - 1].install(|| block(m, cells))).collect();
        let Some(first) = blocks.first() else { continue };
        println!(
            "{dimension} D: {} points, {} directed bonds, horizon {:.3} spacings",
            first.points,
            first.bonds,
            decks::horizon(dimension)
        );
        println!(
            "{:28}{:>7}{:>24}{:>24}{:>10}{:>9}{:>10}",
            "", "bytes/", "force, 1 core", "explicit step, 1 core", "million", "beside", "roofline"
        );
        println!(
            "{:28}{:>7}{:>24}{:>24}{:>10}{:>9}{:>10}",
            "model", "bond", "ns/bond [least, most]", "ns/bond [least, most]", "bonds/s", "first", "share"
        );
        let mut times: Vec<Times> = vec![Times::default(); blocks.len()];
        for _ in 0..rounds {
            for (b, times) in blocks.iter_mut().zip(&mut times) {
                times.force.push(pools[0].install(|| time_force(b, TIMES[0])));
                times.step.push(pools[0].install(|| time_step(b, TIMES[1])));
            }
        }
        let plainest = median(&times[0].step) / blocks[0].bonds as f64;
        for ((b, model), times) in blocks.iter().zip(&models).zip(&times) {
            let (force, step) = (&times.force, &times.step);
            let ns = |t: f64| t * 1e9 / b.bonds as f64;
            let bytes = b.bytes as f64 / b.bonds as f64;
            let share = b.bytes as f64 / bandwidth[0] / median(force);
            let cell = |t: &[f64]| format!("{:.2} [{:.2}, {:.2}]", ns(median(t)), ns(least(t)), ns(most(t)));
            println!(
                "{:28}{bytes:>7.1}{:>24}{:>24}{:>10.0}{:>9.2}{:>9.0} %",
                model.name,
                cell(force),
                cell(step),
                1e3 / ns(median(step)),
                median(step) / b.bonds as f64 / plainest,
                100.0 * share,
            );
            let numbers = [median(force), least(force), most(force), median(step), least(step), most(step)]
                .map(|t| format!("{:.4}", ns(t)))
                .join(",");
            let name = model.name.replace(',', "");
            let _ = writeln!(csv, "model,{dimension},{name},{},{},{bytes:.2},{numbers},{share:.4},,", b.points, b.bonds);
        }
        println!();
    }

    if let [one, .., all] = pools.as_slice() {
        two_cores(one, all, &wanted, (quick, has("--large")), &mut csv);
    }
    if !only_cores {
        growth(&pools, &wanted, (quick, has("--large")), rounds.min(3), &mut csv);
    }
    if let Some(path) = value("--csv") {
        match std::fs::write(&path, csv) {
            Ok(()) => println!("\nwritten to {path}"),
            Err(e) => println!("\n{path} could not be written: {e}"),
        }
    }
}

/// Seconds of force evaluations and explicit steps, by rounds.
#[derive(Clone, Default)]
struct Times {
    force: Vec<f64>,
    step: Vec<f64>,
}

/// What two cores are good for: one run on one core, the same on two, and two of them at once with a core each, in turns. The last tells what the
/// machine gives to programs that have nothing to do with each other: its cores share memory and power, and virtual ones share cores.
fn two_cores(one: &ThreadPool, all: &ThreadPool, wanted: &impl Fn(&&Model) -> bool, (quick, large): (bool, bool), csv: &mut String) {
    let other = ThreadPoolBuilder::new().num_threads(1).build().expect("threads start");
    let (many, few) = (if quick { 5 } else { 15 }, 5);
    println!(
        "Two cores: the time of one core over twice that of two, median of {many} rounds ({few} where there are more than 10^5 points) \
         [quartiles],\nthe same of the least times of all rounds, and the time beside two separate runs at once"
    );
    println!("{:28}{:>4}{:>10}{:>36}{:>36}{:>10}{:>10}", "", "", "", "force", "explicit step", "force", "step");
    println!("{:28}{:>4}{:>10}{3:>36}{3:>36}{4:>10}{4:>10}", "model", "D", "points", "efficiency [quartiles], of least", "beside");
    let small = |dimension: usize| if dimension == 3 { [50, 50, 40] } else { [400, 250, 1] };
    let blocks = MODELS.iter().filter(|m| m.dimension > 1).filter(wanted).map(|m| (m, small(m.dimension), Push::Nothing));
    let million = MODELS.iter().filter(|m| m.dimension == 3).take(3).filter(wanted).map(|m| (m, [100; 3], Push::Nothing));
    let pushed = MODELS.iter().take(1).filter(wanted).map(|m| (m, small(m.dimension), Push::LoadAndWall));
    let blocks = blocks.chain(pushed);
    let blocks: Vec<_> = match (quick, large) {
        (true, _) => blocks.map(|(m, _, push)| (m, [60, 60, if m.dimension == 3 { 12 } else { 1 }], push)).collect(),
        (false, false) => blocks.collect(),
        (false, true) => blocks.chain(million).collect(),
    };
    for (model, cells, push) in blocks {
        let (mut a, mut b) = all.install(|| (block_under(model, cells, push), block_under(model, cells, push)));
        let name = if push == Push::LoadAndWall { format!("{}, load and wall", model.name) } else { model.name.into() };
        let mut ratios = [const { vec![] }; 4];
        let mut shortest = [[f64::INFINITY; 2]; 2];
        let times = [time_force, time_step].map(|time| (SPAN / one.install(|| time(&mut a, 2))).ceil() as usize);
        for _ in 0..if a.points > 100_000 { few } else { many } {
            for (k, (time, n)) in [time_force, time_step].into_iter().zip(times).enumerate() {
                let alone = one.install(|| time(&mut a, n));
                let shared = all.install(|| time(&mut a, n));
                let (x, y) = std::thread::scope(|s| {
                    let second = s.spawn(|| other.install(|| time(&mut b, n)));
                    (one.install(|| time(&mut a, n)), second.join().expect("the block is sound"))
                });
                ratios[k].push(0.5 * alone / shared);
                shortest[k] = [shortest[k][0].min(alone), shortest[k][1].min(shared)];
                // two runs are made in this time, and in twice that of two cores
                ratios[2 + k].push(0.25 * (x + y) / shared);
            }
        }
        let quartiles = |k: usize| {
            let t = sorted(&ratios[k]);
            let [alone, shared] = shortest[k];
            format!("{:.2} [{:.2}, {:.2}], {:.2}", t[t.len() / 2], t[t.len() / 4], t[t.len() * 3 / 4], 0.5 * alone / shared)
        };
        println!(
            "{:28}{:>4}{:>10}{:>36}{:>36}{:>10.2}{:>10.2}",
            name,
            model.dimension,
            a.points,
            quartiles(0),
            quartiles(1),
            median(&ratios[2]),
            median(&ratios[3])
        );
        let name = name.replace(',', "");
        let _ = writeln!(
            csv,
            "two cores,{},{name},{},{},,,,,,,,,{:.4},{:.4}",
            model.dimension,
            a.points,
            a.bonds,
            median(&ratios[0]),
            median(&ratios[1])
        );
    }
    println!();
}

/// Growth with the size of the body, and set-up.
fn growth(pools: &[ThreadPool], wanted: &impl Fn(&&Model) -> bool, (quick, large): (bool, bool), rounds: usize, csv: &mut String) {
    println!("Growth in space, one core: ns per directed bond of an explicit step (median of {} rounds), bytes per bond, set-up", rounds);
    println!("{:28}{:>12}{:>14}{:>10}{:>10}{:>22}", "model", "points", "bonds", "ns/bond", "bytes", "search + build, s");
    let sizes: &[usize] = match (quick, large) {
        (true, _) => &[22, 46],
        (false, false) => &[22, 46, 100],
        (false, true) => &[22, 46, 100, 215],
    };
    for model in MODELS.iter().filter(|m| m.dimension == 3).take(3).filter(wanted) {
        for &side in sizes {
            // built on all cores, timed on one
            let mut b = pools[pools.len() - 1].install(|| block(model, [side; 3]));
            let times: Vec<f64> = (0..rounds).map(|_| pools[0].install(|| time_step(&mut b, TIMES[1]))).collect();
            let ns = median(&times) * 1e9 / b.bonds as f64;
            let bytes = b.bytes as f64 / b.bonds as f64;
            println!("{:28}{:>12}{:>14}{ns:>10.2}{bytes:>10.1}{:>14.2} +{:>6.2}", model.name, b.points, b.bonds, b.seconds.0, b.seconds.1);
            let _ = writeln!(
                csv,
                "growth,3,{},{},{},{bytes:.2},,,,{ns:.4},{:.4},{:.4},,,",
                model.name,
                b.points,
                b.bonds,
                least(&times) * 1e9 / b.bonds as f64,
                most(&times) * 1e9 / b.bonds as f64
            );
        }
    }
}

/// Seconds of one force evaluation, the mean of so many after one that warms up.
fn time_force(b: &mut Block, times: usize) -> f64 {
    let mut f = vec![0.0; b.u.len()];
    Dynamics::force(&mut *b.model, 0.0, &b.u, &b.v, &mut f).expect("the block is sound");
    let clock = Instant::now();
    for _ in 0..times {
        Dynamics::force(&mut *b.model, 0.0, &b.u, &b.v, &mut f).expect("the block is sound");
    }
    clock.elapsed().as_secs_f64() / times as f64
}

/// Seconds of one explicit step, the mean of so many, with an observer that looks at every one; from the state where the last timing ended.
fn time_step(b: &mut Block, steps: usize) -> f64 {
    let solver = VelocityVerlet { time_step: STEP, end: steps as f64 * STEP, observe_every: 1, following: None };
    let mut motion = Motion::at_rest(b.u.len(), 0.0);
    motion.u.copy_from_slice(&b.u);
    motion.v.copy_from_slice(&b.v);
    let mut clock = Clock { started: Instant::now(), seconds: 0.0 };
    solver.run(&mut *b.model, &mut motion, &mut clock, None).expect("the block is sound");
    b.u.copy_from_slice(&motion.u);
    b.v.copy_from_slice(&motion.v);
    clock.seconds / steps as f64
}

/// Looks at every step, and at the clock.
struct Clock {
    started: Instant,
    seconds: f64,
}

impl Observer<dyn Simulated> for Clock {
    fn step(&mut self, report: &StepReport, _: &mut (dyn Simulated + 'static), _: &[f64], _: &[f64]) -> ControlFlow<()> {
        // the first report follows the force at the start
        if report.step == 0 {
            self.started = Instant::now();
        }
        self.seconds = self.started.elapsed().as_secs_f64();
        ControlFlow::Continue(())
    }
}

/// Bytes per second of a = b + s c.
fn triad(pool: &ThreadPool) -> f64 {
    const LENGTH: usize = 1 << 24;
    const PART: usize = 1 << 16;
    let (mut a, b, c) = (vec![0.0f64; LENGTH], vec![1.0f64; LENGTH], vec![2.0f64; LENGTH]);
    let once = |a: &mut [f64]| {
        pool.install(|| {
            let clock = Instant::now();
            a.par_chunks_mut(PART).zip(b.par_chunks(PART)).zip(c.par_chunks(PART)).for_each(|((a, b), c)| {
                a.iter_mut().zip(b).zip(c).for_each(|((a, b), c)| *a = b + 3.0 * c);
            });
            clock.elapsed().as_secs_f64()
        })
    };
    let times: Vec<f64> = (0..7).map(|_| once(&mut a)).collect();
    24.0 * LENGTH as f64 / least(&times)
}

/// The name of the processor, where the system tells.
fn processor() -> String {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = info.lines().find(|l| l.starts_with("model name")).and_then(|l| l.split(':').nth(1));
    name.map_or_else(|| std::env::consts::ARCH.into(), |n| n.trim().into())
}

fn sorted(t: &[f64]) -> Vec<f64> {
    let mut t = t.to_vec();
    t.sort_by(f64::total_cmp);
    t
}
fn median(t: &[f64]) -> f64 {
    sorted(t)[t.len() / 2]
}
fn least(t: &[f64]) -> f64 {
    sorted(t)[0]
}
fn most(t: &[f64]) -> f64 {
    sorted(t)[t.len() - 1]
}
