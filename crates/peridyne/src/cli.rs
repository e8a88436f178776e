//! The command line. Exit status: 0 done, 1 the run or a verification failed, 2 bad deck or usage.

use crate::deck::{Combination, Deck, DeckErrors, Solver, StudyDecks};
use crate::output::summary::{Exit, Summary};
use crate::problem::Problem;
use crate::registry::{assemble, initial_state};
use crate::run::{self, Outcome, Progress, Quiet, RunError, Target};
use crate::spectrum;
use crate::study::{self, Made};
use crate::verify;
use clap::{CommandFactory, Parser, Subcommand};
use indicatif::{ProgressBar, ProgressStyle};
use solvers::velocity_verlet::stable_step;
use std::collections::BTreeSet;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

/// Peridynamics from a deck: a body, a material, a solver; fields, curves, pictures and a check of what is expected.
#[derive(Parser)]
#[command(name = "peridyne", version, about, propagate_version = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Run a deck and write its results.
    Run {
        /// The deck.
        deck: PathBuf,
        /// Folder for the results [default: the deck's name with `.out`].
        #[arg(long)]
        out: Option<PathBuf>,
        /// Threads [default: all cores].
        #[arg(long)]
        threads: Option<usize>,
        /// Replaces the value of a parameter.
        #[arg(long = "set", value_name = "NAME=VALUE", value_parser = assignment)]
        set: Vec<(String, String)>,
        /// One of the deck's runs, without its study.
        #[arg(long)]
        run: Option<String>,
        /// One combination of the deck's study, or those that have a part of their name, such as `m=2.1`.
        #[arg(long, value_name = "NAME", conflicts_with = "run")]
        only: Option<String>,
        /// Print results only.
        #[arg(long, short)]
        quiet: bool,
    },
    /// Do everything but the solution: check the deck, print sizes, derived constants, memory and the stable step.
    Check {
        /// The deck.
        deck: PathBuf,
        /// Threads [default: all cores].
        #[arg(long)]
        threads: Option<usize>,
        /// Replaces the value of a parameter.
        #[arg(long = "set", value_name = "NAME=VALUE", value_parser = assignment)]
        set: Vec<(String, String)>,
        /// One of the deck's runs.
        #[arg(long)]
        run: Option<String>,
    },
    /// Tell whether waves cost energy in a deck's models, how they travel, and the lowest modes of its body; whatever the deck's solver.
    Spectrum {
        /// The deck.
        deck: PathBuf,
        /// Folder for the results [default: the deck's name with `.spectrum`].
        #[arg(long)]
        out: Option<PathBuf>,
        /// Threads [default: all cores].
        #[arg(long)]
        threads: Option<usize>,
        /// Replaces the value of a parameter.
        #[arg(long = "set", value_name = "NAME=VALUE", value_parser = assignment)]
        set: Vec<(String, String)>,
        /// One of the deck's runs.
        #[arg(long)]
        run: Option<String>,
    },
    /// Run every deck that says what it expects, and compare.
    Verify {
        /// Decks, or folders of decks.
        #[arg(default_value = "decks")]
        paths: Vec<PathBuf>,
        /// Write the results as JSON.
        #[arg(long)]
        json: Option<PathBuf>,
        /// The slow ones too.
        #[arg(long)]
        slow: bool,
        /// Threads [default: all cores].
        #[arg(long)]
        threads: Option<usize>,
    },
    /// Print the JSON Schema of decks, for editors.
    Schema,
    /// Explain what a deck can say.
    Explain {
        /// A key, a choice or a section of a deck, such as `statics` or `horizon`.
        #[arg(required_unless_present = "all")]
        word: Option<String>,
        /// Everything, as the Markdown page `DECK.md`.
        #[arg(long)]
        all: bool,
    },
    /// Write a commented deck to start from.
    New {
        /// Where to.
        #[arg(default_value = "deck.yaml")]
        path: PathBuf,
    },
    /// Print shell completions.
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
}

fn assignment(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.trim().is_empty() => Ok((name.trim().into(), value.trim().into())),
        _ => Err("write NAME=VALUE, for example `--set horizon=3 mm`".into()),
    }
}

static CANCEL: AtomicBool = AtomicBool::new(false);

/// The program.
pub fn main() -> ExitCode {
    let arguments = Arguments::parse();
    // the first interrupt ends the run cleanly, a second one at once
    let handler = || {
        if CANCEL.swap(true, Ordering::Relaxed) {
            std::process::exit(1);
        }
    };
    if ctrlc::set_handler(handler).is_err() {
        eprintln!("warning: interrupts cannot be caught; Ctrl-C will end the program at once");
    }
    ExitCode::from(match arguments.command {
        Command::Run { deck, out, threads, set, run, only, quiet } => with_threads(threads, || {
            let study = if run.is_none() { Deck::study(&deck, &set) } else { Ok(None) };
            match (study, only) {
                (Err(e), _) => show(&e),
                (Ok(Some(study)), only) => run_study(&deck, &study, out, only.as_deref(), quiet),
                (Ok(None), Some(name)) => {
                    eprintln!("error: --only {name}: {} has no study; `--run` chooses one of its runs", deck.display());
                    2
                }
                (Ok(None), None) => run_deck(&deck, out, &set, run.as_deref(), quiet),
            }
        }),
        Command::Check { deck, threads, set, run } => with_threads(threads, || check_deck(&deck, &set, run.as_deref())),
        Command::Spectrum { deck, out, threads, set, run } => with_threads(threads, || spectrum_of(&deck, out, &set, run.as_deref())),
        Command::Verify { paths, json, slow, threads } => with_threads(threads, || verify_decks(&paths, json.as_deref(), slow)),
        Command::Schema => print(&crate::deck::schema()),
        Command::Explain { word: Some(word), all: false } => explain(&word),
        Command::Explain { .. } => print(&crate::deck::reference_page()),
        Command::New { path } => new_deck(&path),
        Command::Completions { shell } => {
            let mut text = vec![];
            clap_complete::generate(shell, &mut Arguments::command(), "peridyne", &mut text);
            print(&String::from_utf8_lossy(&text))
        }
    })
}

fn explain(word: &str) -> u8 {
    if let Some(text) = crate::deck::explain(word) {
        return print(&text);
    }
    let near = crate::deck::similar(word);
    let hint = if near.is_empty() {
        "`peridyne explain --all` lists everything".into()
    } else {
        format!("did you mean `{}`?", near.join("` or `"))
    };
    eprintln!("error: a deck has no key or choice `{word}`; {hint}");
    2
}

/// A closed pipe (`peridyne schema | head`) is no failure.
fn print(text: &str) -> u8 {
    let _ = writeln!(std::io::stdout(), "{}", text.trim_end());
    0
}

fn with_threads(threads: Option<usize>, f: impl FnOnce() -> u8) -> u8 {
    if threads == Some(0) {
        eprintln!("error: --threads 0: at least one thread is needed");
        return 2;
    }
    // 0 stands for all cores. This thread is one of them: what it computes in parallel begins here, and waits for no other thread to wake up
    if let Err(e) = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).use_current_thread().build_global() {
        eprintln!("error: {} could not be started: {e}", threads.map_or("threads".into(), |n| format!("{n} threads")));
        return 1;
    }
    f()
}

fn show(errors: &DeckErrors) -> u8 {
    eprintln!("{errors}");
    2
}

/// The same where several runs of a deck are read one after the other: a fault that was told is not told again.
fn show_new(errors: &DeckErrors, told: &mut BTreeSet<String>) -> u8 {
    for fault in errors.faults() {
        let text = fault.to_string();
        if !told.contains(&text) {
            eprintln!("{text}");
            told.insert(text);
        }
    }
    2
}

struct Bar(ProgressBar);

impl Bar {
    fn new() -> Self {
        let bar = ProgressBar::new(1000);
        let style = ProgressStyle::with_template("{bar:40} {percent:>3}%  {msg}  elapsed {elapsed}, left {eta}");
        if let Ok(style) = style {
            bar.set_style(style);
        }
        Bar(bar)
    }
}

impl Progress for Bar {
    fn at(&mut self, share: f64, text: &str) {
        self.0.set_position((share * 1000.0) as u64);
        self.0.set_message(text.to_string());
    }
}

/// `deck.out`, or `deck.run.out`.
fn default_folder(path: &Path, name: Option<&str>, ending: &str) -> PathBuf {
    let stem = path.file_stem().map_or_else(|| "deck".into(), |s| s.to_string_lossy().into_owned());
    PathBuf::from(name.map_or_else(|| format!("{stem}.{ending}"), |n| format!("{stem}.{n}.{ending}")))
}

fn spectrum_of(path: &Path, out: Option<PathBuf>, set: &[(String, String)], name: Option<&str>) -> u8 {
    let out = out.unwrap_or_else(|| default_folder(path, name, "spectrum"));
    let made = Deck::load(path, set, name).and_then(Problem::new).and_then(|problem| {
        let options = match &problem.deck.solver {
            Solver::Spectrum(options) => options.into(),
            _ => spectrum::Options::default(),
        };
        let mut assembly = assemble(&problem)?;
        let report = spectrum::analyse(&problem, &mut *assembly.model, &options)?;
        Ok((problem, report))
    });
    let (problem, report) = match made {
        Ok(made) => made,
        Err(e) => return show(&e),
    };
    println!("peridyne {}: {}", env!("CARGO_PKG_VERSION"), problem.deck.title.value);
    for note in &report.notes {
        eprintln!("note: {note}");
    }
    report.lines().iter().for_each(|line| println!("{line}"));
    if let Err(e) = report.write(&problem, &out) {
        eprintln!("error: {e}");
        return 1;
    }
    println!("results in {}", out.display());
    0
}

/// Shows how far a study is: a bar on a terminal, else a line for each combination.
struct StudyProgress {
    bar: Option<Bar>,
    lines: bool,
    place: String,
}

impl Progress for StudyProgress {
    fn at(&mut self, share: f64, text: &str) {
        if let Some(bar) = &mut self.bar {
            bar.at(share, &format!("{}: {text}", self.place));
        }
    }
}

impl study::Listener for StudyProgress {
    fn begins(&mut self, number: usize, count: usize, name: &str) {
        self.place = format!("{number} of {count}, {name}");
        self.at(0.0, "set-up");
    }

    fn ends(&mut self, made: &Made, outcome: &Outcome) {
        let say = |text: String| match &self.bar {
            Some(bar) => bar.0.println(text),
            None => println!("{text}"),
        };
        for warning in &outcome.summary.warnings {
            eprintln!("warning: {}: {warning}", made.name);
        }
        if let Some(reason) = &made.stopped {
            eprintln!("{} stopped: {reason}", made.name);
        }
        if self.lines {
            let points = outcome.summary.sizes.points;
            say(format!("{}: {points} points, {:.2} s", self.place, made.seconds));
        }
    }
}

fn run_study(path: &Path, study: &StudyDecks, out: Option<PathBuf>, only: Option<&str>, quiet: bool) -> u8 {
    let chosen = |one: &Combination| only.is_none_or(|wanted| one.is_called(wanted));
    let count = study.combinations.iter().filter(|one| chosen(one)).count();
    if count == 0 {
        let names: Vec<&str> = study.combinations.iter().map(|one| one.name.as_str()).collect();
        eprintln!("error: --only {}: the study has no such combination; it has\n  {}", only.unwrap_or_default(), names.join("\n  "));
        return 2;
    }
    let out = out.unwrap_or_else(|| default_folder(path, None, "out"));
    let shown = std::io::stderr().is_terminal() && !quiet;
    if !quiet {
        println!("peridyne {}: {}, {count} of {} runs", env!("CARGO_PKG_VERSION"), study.written.title.value, study.combinations.len());
    }
    let mut listener = StudyProgress { bar: shown.then(Bar::new), lines: !quiet, place: String::new() };
    let result = study::run(study, Some(&out), &chosen, &mut listener, &CANCEL);
    if let Some(bar) = &listener.bar {
        bar.0.finish_and_clear();
    }
    let outcome = match result {
        Ok(outcome) => outcome,
        Err(RunError::Deck(e)) => return show(&e),
        Err(e) => {
            eprintln!("error: {e}");
            return 1;
        }
    };
    for made in outcome.made.iter().filter(|made| !made.measurements.is_empty()) {
        println!("{:<44}{:>20}{:>20}", made.name, "computed", "reference");
        for m in &made.measurements {
            line(&format!("  {}", m.quantity), m.computed, m.reference, m.tolerance, m.passed, m.problem.as_deref());
        }
    }
    if !outcome.measurements.is_empty() {
        println!("{:<44}{:>20}{:>20}", "the study", "computed", "reference");
        for m in &outcome.measurements {
            line(&format!("  {}", m.quantity), m.computed, m.reference, m.tolerance, m.passed, m.problem.as_deref());
        }
    }
    for why in &outcome.undrawn {
        eprintln!("error: {why}");
    }
    if !quiet {
        if only.is_some() && outcome.left_out + study.written.figures.len() > 0 {
            println!("what is expected of all runs together was not measured, and no figures were drawn");
        }
        println!("results in {}", out.display());
    }
    u8::from(!outcome.is_good() || outcome.made.len() < count)
}

fn run_deck(path: &Path, out: Option<PathBuf>, set: &[(String, String)], name: Option<&str>, quiet: bool) -> u8 {
    let deck = match Deck::load(path, set, name) {
        Ok(deck) => deck,
        Err(e) => return show(&e),
    };
    let out = out.unwrap_or_else(|| default_folder(path, name, "out"));
    let title = deck.title.value.clone();
    let shown = std::io::stderr().is_terminal() && !quiet;
    if !quiet {
        println!("peridyne {}: {title}", env!("CARGO_PKG_VERSION"));
    }
    let result = if shown {
        let mut bar = Bar::new();
        let result = run::run(deck, &Target::Folder(&out), &mut bar, &CANCEL);
        bar.0.finish_and_clear();
        result
    } else {
        run::run(deck, &Target::Folder(&out), &mut Quiet, &CANCEL)
    };
    match result {
        Err(RunError::Deck(e)) => show(&e),
        Err(e) => {
            eprintln!("error: {e}");
            1
        }
        Ok(outcome) => {
            close(&outcome.summary, &out, quiet);
            if let (Some(report), false) = (&outcome.spectrum, quiet) {
                report.lines().iter().for_each(|line| println!("{line}"));
            }
            let failed = outcome.measurements.iter().any(|m| !m.passed);
            if !outcome.measurements.is_empty() {
                println!("{:<44}{:>20}{:>20}{:>11}", "expected", "computed", "reference", "");
                for m in &outcome.measurements {
                    line(&m.quantity, m.computed, m.reference, m.tolerance, m.passed, m.problem.as_deref());
                }
            }
            u8::from(failed || !outcome.completed)
        }
    }
}

/// The closing screen.
fn close(s: &Summary, out: &Path, quiet: bool) {
    for w in &s.warnings {
        eprintln!("warning: {w}");
    }
    match &s.exit {
        Exit::Completed { .. } => {}
        Exit::Stopped { reason, time } => eprintln!("stopped at time {time:.6e}: {reason}"),
    }
    if quiet {
        return;
    }
    println!(
        "{} points, {} directed bonds in {} chunks; {:.1} bytes per bond, {:.1} MB",
        s.sizes.points,
        s.sizes.directed_bonds,
        s.sizes.chunks,
        s.sizes.bytes_per_bond,
        s.sizes.memory_bytes as f64 / 1e6
    );
    for c in &s.constants {
        println!("  {:<40}{:>20} {}", c.name, number(c.value), c.unit);
    }
    for t in &s.timings {
        println!("  {:<40}{:>16.3} s{:>6.1} %", t.name, t.seconds, 100.0 * t.share);
    }
    println!("  {:<40}{:>20.3e}", "bond evaluations per second", s.bonds_per_second);
    println!("results in {}", out.display());
}

fn number(x: f64) -> String {
    if x == x.trunc() && x.abs() < 1e15 { format!("{x}") } else { format!("{x:.9e}") }
}

fn line(quantity: &str, computed: f64, reference: f64, tolerance: f64, passed: bool, problem: Option<&str>) {
    let verdict = if passed { "ok" } else { "FAILED" };
    let shown: String =
        if quantity.chars().count() > 43 { quantity.chars().take(42).chain("…".chars()).collect() } else { quantity.into() };
    println!("{shown:<44}{:>20}{:>20} ±{:<9.1e}{verdict}", format!("{computed:.10e}"), format!("{reference:.10e}"), tolerance);
    if let Some(p) = problem {
        println!("    {p}");
    }
}

/// Checks every combination of a study, and tells how many there are.
fn check_study(path: &Path, set: &[(String, String)]) -> u8 {
    let study = match Deck::study(path, set) {
        Ok(Some(study)) => study,
        Ok(None) => return 0,
        Err(e) => return show(&e),
    };
    if let Err(e) = crate::figures::check(&study.written) {
        return show(&e);
    }
    let count = study.combinations.len();
    println!("  {:<40}{count:>20} runs", "study");
    let mut faults = vec![];
    for one in study.combinations {
        match Problem::new(one.deck) {
            Ok(problem) => println!("    {:<38}{:>20} points{}", one.name, problem.cloud.len(), if one.slow { ", slow" } else { "" }),
            Err(e) => faults.push(e.of(&one.name)),
        }
    }
    println!("  {:<40}{:>20}", "figures", study.written.figures.len());
    if faults.is_empty() { 0 } else { show(&DeckErrors::joined(faults)) }
}

fn check_deck(path: &Path, set: &[(String, String)], name: Option<&str>) -> u8 {
    let problem = match Deck::load(path, set, name).and_then(Problem::new) {
        Ok(p) => p,
        Err(e) => return show(&e),
    };
    let mut assembly = match assemble(&problem) {
        Ok(a) => a,
        Err(e) => return show(&e),
    };
    let (bonds, chunks, bytes) = assembly.model.sizes();
    let memory = bytes.0 + bytes.1 + bytes.2;
    println!("{}: ok", path.display());
    println!("  {:<40}{:>20}", "points", problem.cloud.len());
    println!("  {:<40}{:>20}", "directed bonds", bonds);
    println!("  {:<40}{:>20.2}", "neighbours per point", bonds as f64 / problem.cloud.len() as f64);
    println!("  {:<40}{:>20}", "chunks", chunks);
    println!(
        "  {:<40}{:>20.1} MB ({:.1} bytes per directed bond)",
        "memory of the body",
        memory as f64 / 1e6,
        memory as f64 / bonds.max(1) as f64
    );
    for (name, points) in &problem.sets {
        println!("  {:<40}{:>20} points", format!("set {name}"), points.len());
    }
    for (name, value) in problem.deck.parameters.numbers() {
        println!("  {:<40}{:>20}", format!("parameter {name}"), number(value));
    }
    for (name, value, unit) in &assembly.derived {
        println!("  {name:<40}{:>20} {unit}", number(*value));
    }
    for w in &assembly.warnings {
        println!("warning: {w}");
    }
    let (lines, warnings) = spectrum::quick(&problem);
    lines.iter().for_each(|line| println!("  {line}"));
    warnings.iter().for_each(|w| println!("warning: {w}"));
    if let Solver::VelocityVerlet(v) = &problem.deck.solver {
        assembly.model.set_statics(false);
        let (u, _) = initial_state(&problem, solvers::problem::Statics::dofs(&*assembly.model));
        match stable_step(&mut *assembly.model, 0.0, &u, v.safety.value) {
            Ok(s) => {
                println!("  {:<40}{:>20} (safety {} included)", "stable step", number(s.time_step), v.safety.value);
                if let crate::deck::Auto::Given(q) = v.step {
                    println!("  {:<40}{:>20.3}", "step of the deck over stable step", q.value / s.time_step);
                    if q.value > s.time_step / v.safety.value {
                        println!("warning: the step of the deck is above the stability limit");
                    }
                }
                if let Some(end) = v.end {
                    println!("  {:<40}{:>20}", "steps", (end.value / s.time_step).ceil());
                }
            }
            Err(e) => println!("warning: no stable step could be found: {e}"),
        }
    }
    if name.is_none() { check_study(path, set) } else { 0 }
}

fn verify_decks(paths: &[PathBuf], json: Option<&Path>, slow: bool) -> u8 {
    let decks = match verify::find(paths) {
        Ok(decks) => decks,
        Err(e) => {
            eprintln!("error: decks cannot be listed: {e}; give files or folders");
            return 2;
        }
    };
    let mut report = verify::Report { results: vec![] };
    let (mut status, mut faulty) = (0, 0);
    for path in &decks {
        let mut told_faults = BTreeSet::new();
        let runs = match Deck::runs(path) {
            Ok(runs) => runs,
            Err(e) => {
                status = status.max(show_new(&e, &mut told_faults));
                faulty += 1;
                continue;
            }
        };
        let study = match Deck::study(path, &[]) {
            Ok(study) => study,
            Err(e) => {
                status = status.max(show_new(&e, &mut told_faults));
                faulty += 1;
                continue;
            }
        };
        for r in runs.iter().filter(|r| slow || !r.slow).filter(|r| study.as_ref().is_none_or(|study| !study.covers(&r.name))) {
            if CANCEL.load(Ordering::Relaxed) {
                return 1;
            }
            let only = (r.name != crate::deck::DEFAULT_RUN).then_some(r.name.as_str());
            let clock = std::time::Instant::now();
            match verify::verify(path, &r.name, only, &mut Quiet, &CANCEL) {
                Err(e) => {
                    status = status.max(show_new(&e, &mut told_faults));
                    faulty += 1;
                }
                Ok(verdicts) if verdicts.is_empty() => {}
                Ok(verdicts) => {
                    println!("{} [{}] {:.1} s", path.display(), r.name, clock.elapsed().as_secs_f64());
                    for v in &verdicts {
                        line(&format!("  {}", v.quantity), v.computed, v.reference, v.tolerance, v.passed, v.problem.as_deref());
                    }
                    report.results.extend(verdicts);
                }
            }
        }
        let Some(study) = study else { continue };
        let mut told = |name: &str, seconds: Option<f64>, verdicts: Vec<verify::Verdict>| {
            if !verdicts.is_empty() {
                let seconds = seconds.map_or_else(String::new, |s| format!(" {s:.1} s"));
                println!("{} [{name}]{seconds}", path.display());
                for v in &verdicts {
                    line(&format!("  {}", v.quantity), v.computed, v.reference, v.tolerance, v.passed, v.problem.as_deref());
                }
                report.results.extend(verdicts);
            }
        };
        if let Err(e) = verify::verify_study(path, &study, slow, &mut told, &CANCEL) {
            status = status.max(show_new(&e, &mut told_faults));
            faulty += 1;
        }
    }
    let failed = report.results.iter().filter(|v| !v.passed).count();
    if faulty > 0 {
        println!("{faulty} runs have faults in their deck and were not made");
    }
    println!("{} passed, {} failed", report.results.len() - failed, failed + faulty);
    if let Some(path) = json {
        let written = crate::output::write_whole(path, |file| -> std::io::Result<()> {
            serde_json::to_writer_pretty(&mut *file, &report).map_err(std::io::Error::other)?;
            writeln!(file)
        });
        if let Err(e) = written {
            eprintln!("error: {}: cannot be written: {e}", path.display());
            return 1;
        }
    }
    if failed > 0 { status.max(1) } else { status }
}

fn new_deck(path: &Path) -> u8 {
    let file = std::fs::OpenOptions::new().write(true).create_new(true).open(path);
    match file.and_then(|mut f| f.write_all(crate::deck::starter().as_bytes())) {
        Ok(()) => {
            println!("{} written; `peridyne check {}` tells what it holds", path.display(), path.display());
            0
        }
        Err(e) => {
            eprintln!("error: {}: cannot be written: {e}; an existing file is never overwritten", path.display());
            1
        }
    }
}
