//! Stability of a deck's models: what plane waves cost on its lattice, the lowest modes of its body, the energy of sine waves in it.
//!
//! For each material a patch of the deck's lattice is built with the deck's own model, horizon and influence, exactly as a body is
//! built, and its tangent products give the Bloch symbol (`bodies::spectrum`). So whatever model the program learns can be analysed.

use crate::deck::{self, Auto, Axis as DeckAxis, DeckErrors, Dictionary};
use crate::output::plot::{Axis, Curve, Plot, ReferenceLine, Style};
use crate::output::table::History;
use crate::output::vtkhdf::FieldFile;
use crate::output::{OutputError, Snapshot};
use crate::problem::Problem;
use crate::registry::{assemble, initial_state};
use crate::zone;
use bodies::neighbors::Families;
use bodies::points::{Lattice, PointCloud};
use bodies::spectrum::{BodyModes, Branch, Found, Search, Symbol, Verdict, body_modes, patch, patch_points, search, wave_vector};
use bodies::structure::Simulated;
use solvers::problem::Statics;
use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::path::Path;

/// What is analysed, and how finely.
#[derive(Clone, Debug)]
pub struct Options {
    /// Corners of the path with their names, in units of π over the spacing; by dimension if not given.
    pub path: Option<Vec<(String, [f64; 3])>>,
    /// Wave vectors per leg of the path.
    pub points: usize,
    /// Wave vectors of the search along each direction; by dimension and horizon if not given.
    pub grid: Option<usize>,
    /// Fraction of the local solid's stiffness below which a wave has no energy.
    pub threshold: f64,
    /// Uniform displacement gradient F − 1 of the lattice.
    pub gradient: [[f64; 3]; 3],
    /// Wave vectors to be measured.
    pub waves: Vec<(String, [f64; 3])>,
    /// Lowest modes of the body; by size if not given.
    pub modes: Option<usize>,
    /// Sine waves in the body.
    pub imposed: Option<Imposed>,
    /// Where constants that vary are taken.
    pub at: Option<[f64; 3]>,
}

/// Displacements `amplitude sin(k x/length)`.
#[derive(Clone, Debug)]
pub struct Imposed {
    /// The numbers k.
    pub wave_numbers: Vec<f64>,
    /// Length (deck's unit).
    pub length: f64,
    /// Amplitude (deck's unit of length).
    pub amplitude: f64,
    /// Axis along which the wave runs.
    pub along: usize,
    /// Axis along which points move.
    pub displacement: usize,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            path: None,
            points: 60,
            grid: None,
            threshold: 1e-9,
            gradient: [[0.0; 3]; 3],
            waves: vec![],
            modes: None,
            imposed: None,
            at: None,
        }
    }
}

fn given<T, U>(auto: &Auto<T>, f: impl Fn(&T) -> U) -> Option<U> {
    match auto {
        Auto::Auto => None,
        Auto::Given(value) => Some(f(value)),
    }
}

impl From<&deck::Spectrum> for Options {
    fn from(s: &deck::Spectrum) -> Self {
        let corner = |c: &deck::Corner| {
            let name = match c {
                deck::Corner::Named(deck::CornerName::Gamma) => "Γ".into(),
                deck::Corner::Named(name) => name.name().to_uppercase(),
                deck::Corner::Vector(v) => format!("({})", v.components.iter().map(|q| q.value.to_string()).collect::<Vec<_>>().join(", ")),
            };
            (name, c.fraction())
        };
        let index = DeckAxis::index;
        Options {
            path: given(&s.path, |path| path.iter().map(corner).collect()),
            points: s.points.value as usize,
            grid: given(&s.grid, |g| g.value as usize),
            threshold: s.threshold.value,
            gradient: s.stretch.as_ref().map_or([[0.0; 3]; 3], deck::Deformation::displacement_gradient),
            waves: s.waves.iter().map(|(name, w)| (name.value.clone(), w.fraction())).collect(),
            modes: given(&s.modes, |m| m.value as usize),
            imposed: s.imposed.as_ref().map(|i| Imposed {
                wave_numbers: i.wave_numbers.values(),
                length: i.length.value,
                amplitude: i.amplitude.value,
                along: index(&i.along),
                displacement: index(&i.displacement),
            }),
            at: s.at.as_ref().map(deck::Position::point),
        }
    }
}

/// A wave vector of the path.
#[derive(Clone, Debug)]
pub struct Row {
    /// Length of the path so far, in units of π over the spacing.
    pub distance: f64,
    /// The wave vector (1/length).
    pub k: [f64; 3],
    /// Its modes, by ascending stiffness.
    pub branches: Vec<Branch>,
    /// Whether the path passed the origin just before, where there is no wave.
    pub restarts: bool,
}

/// A named wave.
#[derive(Clone, Debug)]
pub struct Wave {
    /// Its name.
    pub name: String,
    /// The wave vector (1/length).
    pub k: [f64; 3],
    /// Its modes, by ascending stiffness.
    pub branches: Vec<Branch>,
}

/// What plane waves cost in one material.
#[derive(Clone, Debug)]
pub struct MaterialSpectrum {
    /// The material.
    pub name: String,
    /// Spacing of the lattice, the smallest over its directions (length).
    pub spacing: f64,
    /// Horizon (length).
    pub horizon: f64,
    /// Density; 1 where the deck has none.
    pub density: f64,
    /// Whether the deck gives a density.
    pub has_density: bool,
    /// Points the centre is coupled to, itself included.
    pub couplings: usize,
    /// Threshold of the search.
    pub threshold: f64,
    /// What was found over the Brillouin zone.
    pub found: Found,
    /// Along the path.
    pub path: Vec<Row>,
    /// Names of the corners of the path and where they lie.
    pub corners: Vec<(f64, String)>,
    /// The waves asked for.
    pub waves: Vec<Wave>,
    /// The whole zone, in the plane.
    pub zone: Vec<zone::Cell>,
}

/// Everything that was found.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Dimension of space.
    pub dimension: usize,
    /// Materials whose symbol could be computed.
    pub materials: Vec<MaterialSpectrum>,
    /// Lowest modes of the body.
    pub modes: Option<BodyModes>,
    /// Sine waves: k and strain energy.
    pub imposed: Vec<[f64; 2]>,
    /// What was left out, and why.
    pub notes: Vec<String>,
}

/// Largest number of dofs of a body whose modes are computed without being asked for, by dimension: some seconds.
const SMALL_BODY: [usize; 3] = [40_000, 12_000, 4_500];
/// Modes that are computed without being asked for.
const DEFAULT_MODES: usize = 6;
/// Directed bonds of a patch beyond which `check` leaves the spectrum out: a second or so.
const QUICK_BONDS: f64 = 1.5e6;
/// A mode of the body has no energy below this fraction of its largest eigenvalue.
const BODY_ZERO: f64 = 1e-12;

/// The lattice that all points lie on, or why there is none.
fn lattice_of(cloud: &PointCloud) -> Result<Lattice, String> {
    let refused = |why: &str| {
        format!("{why}, so that plane waves are no modes and there is no Bloch symbol; the modes of the finite body are its spectrum")
    };
    let lattice = cloud.lattice.or_else(|| Lattice::detect(cloud)).ok_or_else(|| refused("the points lie on no lattice"))?;
    let off = |x: &[f64; 3]| {
        let c = lattice.coordinates(x);
        (0..cloud.dimension).any(|a| (c[a] - c[a].round()).abs() > 1e-6)
    };
    match cloud.position.iter().filter(|x| off(x)).count() {
        0 => Ok(lattice),
        n => Err(refused(&format!("{n} of {} points lie off the lattice (jitter, or an irregular point file)", cloud.len()))),
    }
}

/// The point of a material that stands for it: the nearest to `at`, or to the middle of the material.
fn typical_point(problem: &Problem, material: u32, at: Option<[f64; 3]>) -> Option<usize> {
    let cloud = &problem.cloud;
    let points: Vec<usize> = (0..cloud.len()).filter(|&p| problem.material[p] == material).collect();
    let middle: [f64; 3] = std::array::from_fn(|k| points.iter().map(|&p| cloud.position[p][k]).sum::<f64>() / points.len().max(1) as f64);
    let target = at.unwrap_or(middle);
    let square = |p: usize| (0..3).map(|k| (cloud.position[p][k] - target[k]).powi(2)).sum::<f64>();
    points.into_iter().min_by(|&a, &b| square(a).total_cmp(&square(b)).then(cloud.id[a].cmp(&cloud.id[b])))
}

/// A patch of the lattice made of one material, its constants those at `place`, as a problem of its own.
fn patch_problem(problem: &Problem, material: usize, lattice: &Lattice, typical: usize, place: [f64; 3]) -> (Problem, usize) {
    let cloud = &problem.cloud;
    let horizon = problem.deck.body.horizon.eval(place, 0.0);
    let (position, centre) = patch(lattice, cloud.dimension, horizon);
    let n = position.len();
    let mut deck = problem.deck.clone();
    let (name, mut typed) = deck.sections.materials.0.swap_remove(material);
    typed.damage = None;
    deck.sections.materials = Dictionary(vec![(name, typed)]);
    deck.sections.conditions.clear();
    deck.sections.temperature = None;
    let cloud = PointCloud {
        dimension: cloud.dimension,
        volume: vec![cloud.volume[typical]; n],
        spacing: vec![cloud.spacing[typical]; n],
        block: vec![0; n],
        block_names: vec!["patch".into()],
        id: (0..n as u64).collect(),
        lattice: Some(*lattice),
        position,
    };
    let horizon = vec![horizon; n];
    // positions are multiples of finite spacings and horizons were checked: there is nothing left to refuse
    let families = Families::find(&cloud.position, cloud.dimension, &cloud.spacing, &horizon, &[]).unwrap_or_default();
    let patch = Problem {
        deck,
        section: problem.section,
        user: (0..n as u32).collect(),
        horizon,
        sets: BTreeMap::new(),
        material: vec![0; n],
        families,
        hidden_bonds: 0,
        cracks: None,
        thin: false,
        surface: None,
        parts: vec![],
        constants_at: Some(place),
        cloud,
    };
    (patch, centre)
}

/// Wave vectors of the search along each direction: fine enough for the waves that the horizon resolves.
fn default_grid(dimension: usize, ratio: f64) -> usize {
    let (least, per_point) = [(512, 32.0), (64, 8.0), (16, 4.0)][dimension - 1];
    least.max((per_point * ratio / 2.0).ceil() as usize * 2)
}

fn default_path(dimension: usize) -> Vec<(String, [f64; 3])> {
    let corners: &[(&str, [f64; 3])] = match dimension {
        1 => &[("Γ", [0.0; 3]), ("X", [1.0, 0.0, 0.0])],
        2 => &[("Γ", [0.0; 3]), ("X", [1.0, 0.0, 0.0]), ("M", [1.0, 1.0, 0.0]), ("Γ", [0.0; 3])],
        _ => &[("Γ", [0.0; 3]), ("X", [1.0, 0.0, 0.0]), ("M", [1.0, 1.0, 0.0]), ("R", [1.0; 3]), ("Γ", [0.0; 3])],
    };
    corners.iter().map(|(name, f)| (name.to_string(), *f)).collect()
}

/// How one material's symbol is looked at.
struct Look<'a> {
    options: &'a Options,
    grid: Option<usize>,
    refine: bool,
}

fn material_spectrum(
    problem: &Problem,
    material: usize,
    lattice: &Lattice,
    typical: usize,
    look: &Look,
) -> Result<MaterialSpectrum, DeckErrors> {
    let d = problem.cloud.dimension;
    let options = look.options;
    let place = options.at.unwrap_or(problem.cloud.position[typical]);
    let (patch, centre) = patch_problem(problem, material, lattice, typical, place);
    let mut model = assemble(&patch)?.model;
    let positions = Statics::positions(&*model).to_vec();
    let h = options.gradient;
    let u: Vec<f64> = (0..positions.len()).map(|q| (0..d).map(|c| h[q % d][c] * positions[q / d * d + c]).sum()).collect();
    let (name, typed) = &problem.deck.materials.0[material];
    let symbol =
        Symbol::measure(d, &positions, centre, problem.cloud.volume[typical], |x, y| Statics::tangent_product(&mut *model, 0.0, &u, x, y))
            .map_err(|stop| {
                let issue = deck::Issue::new(
                    name.span,
                    format!("the spectrum of `{}` cannot be computed: {stop}", name.value),
                    "choose a smaller stretch",
                );
                problem.deck.errors(vec![issue])
            })?;
    let spacing = lattice.spacing[..d].iter().fold(f64::INFINITY, |m, h| m.min(*h));
    let horizon = patch.horizon[0];
    let options_search =
        Search { grid: look.grid.unwrap_or_else(|| default_grid(d, horizon / spacing)), threshold: options.threshold, refine: look.refine };
    let found = search(&symbol, lattice, &options_search);
    let path = options.path.clone().unwrap_or_else(|| default_path(d));
    let mut rows = vec![];
    let mut corners = vec![(0.0, path[0].0.clone())];
    let (mut start, mut restarts) = (0.0, false);
    for leg in path.windows(2) {
        let (from, to) = (leg[0].1, leg[1].1);
        let length = (0..d).map(|a| (to[a] - from[a]).powi(2)).sum::<f64>().sqrt();
        for i in 0..=options.points {
            let s = i as f64 / options.points as f64;
            let fraction: [f64; 3] = std::array::from_fn(|a| from[a] + s * (to[a] - from[a]));
            if fraction.iter().all(|f| f.abs() < 1e-12) {
                restarts = true;
                continue;
            }
            // a corner belongs to the leg that ends there
            if i == 0 && !rows.is_empty() {
                continue;
            }
            let k = wave_vector(lattice, d, fraction);
            rows.push(Row { distance: start + s * length, k, branches: symbol.branches(k), restarts });
            restarts = false;
        }
        start += length;
        corners.push((start, leg[1].0.clone()));
    }
    let waves = options.waves.iter().map(|(name, fraction)| {
        let k = wave_vector(lattice, d, *fraction);
        Wave { name: name.clone(), k, branches: symbol.branches(k) }
    });
    Ok(MaterialSpectrum {
        name: name.value.clone(),
        spacing,
        horizon,
        density: typed.density.as_ref().map_or(1.0, |f| f.eval(place, 0.0)),
        has_density: typed.density.is_some(),
        couplings: symbol.couplings(),
        threshold: options.threshold,
        found,
        waves: waves.collect(),
        zone: if d == 2 && look.refine { zone::map(&symbol, lattice) } else { vec![] },
        path: rows,
        corners,
    })
}

/// Analyses a problem and its body.
///
/// # Errors
/// Faults of the deck that show only here: a model that the lattice cannot carry, modes that are not found.
pub fn analyse(problem: &Problem, model: &mut dyn Simulated, options: &Options) -> Result<Report, DeckErrors> {
    if problem.thin {
        let issue = deck::Issue::new(
            problem.deck.body.span,
            "plane waves are analysed in solids, not in beams and plates",
            "use `velocity_verlet` for their vibrations",
        );
        return Err(problem.deck.errors(vec![issue]));
    }
    let d = problem.cloud.dimension;
    let mut report = Report { dimension: d, ..Report::default() };
    match lattice_of(&problem.cloud) {
        Err(why) => report.notes.push(format!("no plane waves: {why}")),
        Ok(lattice) => {
            for m in 0..problem.deck.materials.len() {
                let Some(typical) = typical_point(problem, m as u32, options.at) else { continue };
                let look = Look { options, grid: options.grid, refine: true };
                report.materials.push(material_spectrum(problem, m, &lattice, typical, &look)?);
            }
        }
    }
    if problem.deck.materials.iter().any(|(_, m)| m.density.is_none()) {
        report.notes.push("the deck gives no density: frequencies and velocities are those of density 1".into());
    }
    if problem.deck.temperature.is_some() {
        report.notes.push("plane waves are those of the solid without thermal strain".into());
    }
    let dofs = problem.cloud.len() * d;
    let count = match options.modes {
        Some(count) => count,
        None if dofs <= SMALL_BODY[d - 1] => DEFAULT_MODES,
        None => {
            report.notes.push(format!("no modes of the body: it has {dofs} dofs; ask for some with `modes: {DEFAULT_MODES}`"));
            0
        }
    };
    let (u, _) = initial_state(problem, dofs);
    if count > 0 {
        match body_modes(model, &u, count, rayon::current_num_threads()) {
            Ok(modes) => report.modes = Some(modes),
            // what was asked for must come or fail; what was not must not stand in the way
            Err(e) if options.modes.is_some() => {
                let span = match &problem.deck.solver {
                    deck::Solver::Spectrum(s) => s.span,
                    _ => problem.deck.body.span,
                };
                let issue = deck::Issue::new(span, format!("the modes of the body were not found: {e}"), "use `modes: 0`");
                return Err(problem.deck.errors(vec![issue]));
            }
            Err(e) => report.notes.push(format!("no modes of the body: {e}")),
        }
    }
    if let Some(imposed) = &options.imposed {
        let position = Statics::positions(model).to_vec();
        let (mut x, mut y) = (vec![0.0; dofs], vec![0.0; dofs]);
        for &k in &imposed.wave_numbers {
            for p in 0..dofs / d {
                x[p * d + imposed.displacement] = imposed.amplitude * (k * position[p * d + imposed.along] / imposed.length).sin();
            }
            let energy =
                Statics::tangent_product(model, 0.0, &u, &x, &mut y).map(|()| 0.5 * x.iter().zip(&y).map(|(x, y)| x * y).sum::<f64>());
            match energy {
                Ok(energy) => report.imposed.push([k, energy]),
                Err(stop) => report.notes.push(format!("no energy of the imposed wave {k}: {stop}")),
            }
        }
    }
    Ok(report)
}

/// What `check` tells: one line a material, and warnings. Small patches and coarse grids only.
pub fn quick(problem: &Problem) -> (Vec<String>, Vec<String>) {
    let (mut lines, mut warnings) = (vec![], vec![]);
    if problem.thin {
        return (lines, warnings);
    }
    let d = problem.cloud.dimension;
    let Ok(lattice) = lattice_of(&problem.cloud) else {
        lines.push("no lattice: zero-energy modes not looked for".into());
        return (lines, warnings);
    };
    let options = Options { points: 1, ..Options::default() };
    for (m, (name, _)) in problem.deck.materials.iter().enumerate() {
        let Some(typical) = typical_point(problem, m as u32, None) else { continue };
        let family = problem.families.size(typical).max(1) as f64;
        if patch_points(&lattice, d, problem.horizon[typical]) * family > QUICK_BONDS {
            lines.push(format!("zero-energy modes of {} not looked for: the horizon is large; `peridyne spectrum` does", name.value));
            continue;
        }
        let look = Look { options: &options, grid: Some([64, 16, 6][d - 1]), refine: false };
        match material_spectrum(problem, m, &lattice, typical, &look) {
            Err(_) => lines.push(format!("zero-energy modes of {} not looked for: its model does not fit the lattice", name.value)),
            Ok(s) => match s.verdict() {
                Verdict::Stable => {
                    lines.push(format!("{}: every wave costs energy, at least {:.2e} of the local solid's", s.name, s.found.worst.ratio))
                }
                _ => warnings.push(format!(
                    "material `{}`: {} ({}); `peridyne spectrum` tells more",
                    s.name,
                    s.verdict_text(),
                    s.worst_text()
                )),
            },
        }
    }
    (lines, warnings)
}

impl MaterialSpectrum {
    /// The verdict on this material.
    pub fn verdict(&self) -> Verdict {
        self.found.verdict(self.threshold)
    }

    /// The verdict in words.
    pub fn verdict_text(&self) -> String {
        let f = &self.found;
        let plural = |n: usize| if n == 1 { "" } else { "s" };
        match self.verdict() {
            Verdict::Stable => "stable".into(),
            Verdict::ZeroEnergy => {
                let between = if f.zero_between > 0 { format!(" and {} between grid vectors", f.zero_between) } else { String::new() };
                format!("{} zero-energy mode{}{between}", f.zero_modes, plural(f.zero_modes))
            }
            Verdict::Unstable if f.negative_modes == 0 => "unstable".into(),
            Verdict::Unstable => format!("unstable, {} growing wave{}", f.negative_modes, plural(f.negative_modes)),
        }
    }

    /// The weakest wave in words.
    pub fn worst_text(&self) -> String {
        let w = &self.found.worst;
        let length = w.wavelength();
        format!(
            "weakest: {:.3e} of the local solid, wavelength {:.4} spacings = {:.4} horizons",
            w.ratio,
            length / self.spacing,
            length / self.horizon
        )
    }

    /// Named numbers, without prefix.
    fn quantities(&self, d: usize) -> Vec<(String, f64)> {
        let f = &self.found;
        let mut out: Vec<(String, f64)> = [
            ("zero_modes", f.zero_modes as f64),
            ("zero_modes_between", f.zero_between as f64),
            ("negative_modes", f.negative_modes as f64),
            ("smallest", f.worst.ratio),
            ("smallest.wavelength", f.worst.wavelength()),
            ("smallest.wave_number", 2.0 * PI / f.worst.wavelength()),
            ("largest", f.largest),
            ("couplings", self.couplings as f64),
            ("asymmetry", f.asymmetry),
        ]
        .map(|(name, value)| (name.to_string(), value))
        .into();
        for (a, axis) in ["x", "y", "z"].iter().enumerate().take(d) {
            out.push((format!("smallest.{axis}"), f.worst.fraction[a]));
        }
        for w in &self.waves {
            for (b, values) in w.branches.iter().map(|b| self.measures(w.k, b)).enumerate() {
                out.extend(values.into_iter().map(|(name, value)| (format!("wave.{}.{name}.{}", w.name, b + 1), value)));
            }
        }
        out
    }

    /// What is told of one mode of a wave.
    fn measures(&self, k: [f64; 3], b: &Branch) -> [(&'static str, f64); 8] {
        let number = k.iter().map(|k| k * k).sum::<f64>().sqrt();
        let (frequency, local) = (b.frequency(self.density), b.local_velocity(number, self.density));
        let group = b.group_velocity(self.density);
        [
            ("stiffness", b.stiffness),
            ("ratio", b.ratio()),
            ("frequency", frequency),
            ("phase_velocity", frequency / number),
            ("group_velocity", group),
            ("local_velocity", local),
            ("phase_velocity_ratio", frequency / number / local),
            ("group_velocity_ratio", group / local),
        ]
    }

    fn write(&self, folder: &Path, title: &str, suffix: &str, d: usize) -> Result<(), OutputError> {
        let mut columns: Vec<String> = vec!["distance".into()];
        columns.extend(["kx", "ky", "kz"].iter().take(d).map(|c| c.to_string()));
        for b in 1..=d {
            let names = self.measures([1.0; 3], &Branch::default()).map(|(name, _)| name);
            columns.extend(names.iter().map(|name| format!("{name}.{b}")));
        }
        let names: Vec<&str> = columns.iter().map(String::as_str).collect();
        let mut table = History::create(&folder.join(format!("spectrum{suffix}.csv")), &names)?;
        for row in &self.path {
            let mut values = vec![row.distance];
            values.extend(&row.k[..d]);
            for b in &row.branches {
                values.extend(self.measures(row.k, b).map(|(_, value)| value));
            }
            table.append(&values)?;
        }
        let what = if self.has_density { "angular frequency" } else { "angular frequency at density 1" };
        self.plot(folder, title, &format!("dispersion{suffix}.png"), what, d, |row, b| {
            let number = row.k.iter().map(|k| k * k).sum::<f64>().sqrt();
            [b.frequency(self.density), b.local_velocity(number, self.density) * number]
        })?;
        let what = if self.has_density { "group velocity" } else { "group velocity at density 1" };
        self.plot(folder, title, &format!("group_velocity{suffix}.png"), what, d, |row, b| {
            let number = row.k.iter().map(|k| k * k).sum::<f64>().sqrt();
            [b.group_velocity(self.density), b.local_velocity(number, self.density)]
        })
    }

    /// A quantity of all modes along the path, over that of the local solid.
    fn plot(
        &self,
        folder: &Path,
        title: &str,
        file: &str,
        what: &str,
        d: usize,
        value: impl Fn(&Row, &Branch) -> [f64; 2],
    ) -> Result<(), OutputError> {
        let heading = format!("{title}: {}, {}", self.name, self.verdict_text());
        let mut plot = Plot::new(heading, Axis::new("wave vector along the path (π / spacing)"), Axis::new(what));
        let all: Vec<Vec<[f64; 2]>> = self.path.iter().map(|r| r.branches.iter().map(|b| value(r, b)).collect()).collect();
        let top = all.iter().flatten().fold(0.0f64, |m, v| m.max(v[0]));
        let mut curve = |label: String, style: Style, pick: &dyn Fn(usize) -> f64| {
            let mut points = vec![];
            for (i, row) in self.path.iter().enumerate() {
                // a wave at the origin has no direction: a path that passes it is drawn in pieces
                if row.restarts {
                    points.push([row.distance, f64::NAN]);
                }
                points.push([row.distance, pick(i)]);
            }
            plot.curves.push(Curve { label, points, style });
        };
        for b in 0..d {
            let label = if d == 1 { self.name.clone() } else { format!("mode {}", b + 1) };
            curve(label, Style::Line, &|i| all[i][b][0]);
        }
        for b in 0..d {
            let label = if b == 0 { "local solid".into() } else { String::new() };
            // the local solid's frequencies grow without bound: what is far above the others is left out
            curve(label, Style::Dashed, &|i| if all[i][b][1] <= 1.15 * top { all[i][b][1] } else { f64::NAN });
        }
        for (x, name) in &self.corners {
            plot.references.push(ReferenceLine::Vertical { x: *x, label: name.clone() });
        }
        plot.write_png(&folder.join(file))
    }
}

impl Report {
    /// Named numbers for expectations: `spectrum.MATERIAL.zero_modes`, …, and without the material where there is only one;
    /// `mode.1.frequency`, …; `imposed.1.energy`, ….
    pub fn quantities(&self) -> Vec<(String, f64)> {
        let mut out = vec![];
        for m in &self.materials {
            let all = m.quantities(self.dimension);
            if self.materials.len() == 1 {
                out.extend(all.iter().map(|(name, value)| (format!("spectrum.{name}"), *value)));
            }
            out.extend(all.into_iter().map(|(name, value)| (format!("spectrum.{}.{name}", m.name), value)));
        }
        if let Some(modes) = &self.modes {
            for (n, value) in modes.values.iter().enumerate() {
                out.push((format!("mode.{}.eigenvalue", n + 1), *value));
                out.push((format!("mode.{}.frequency", n + 1), cycles(*value, modes)));
            }
            out.push(("mode.zero".into(), modes.zero(BODY_ZERO) as f64));
            out.push(("mode.largest".into(), modes.largest));
            if let Some(value) = modes.first_elastic(BODY_ZERO) {
                out.push(("mode.first_elastic".into(), value));
            }
        }
        for (n, [_, energy]) in self.imposed.iter().enumerate() {
            out.push((format!("imposed.{}.energy", n + 1), *energy));
        }
        out
    }

    /// The verdicts as lines of text.
    pub fn lines(&self) -> Vec<String> {
        let mut out = vec![];
        for m in &self.materials {
            let f = &m.found;
            out.push(format!("{}: {}", m.name, m.verdict_text()));
            out.push(format!("  {}", m.worst_text()));
            let vector: Vec<String> = f.worst.fraction[..self.dimension].iter().map(|x| format!("{x:.4}")).collect();
            out.push(format!(
                "  at wave vector ({}) π/spacing; {} wave vectors searched, {} points coupled",
                vector.join(", "),
                f.waves,
                m.couplings
            ));
            if f.asymmetry > 1e-9 {
                out.push(format!("  the stiffness is not symmetric ({:.1e}): its symmetric part was looked at", f.asymmetry));
            }
            for w in &m.waves {
                for (b, branch) in w.branches.iter().enumerate() {
                    let values = m.measures(w.k, branch);
                    out.push(format!(
                        "  wave {} mode {}: stiffness {:.6e}, of the local solid {:.6e}; velocity over local: phase {:.6}, group {:.6}",
                        w.name,
                        b + 1,
                        values[0].1,
                        values[1].1,
                        values[6].1,
                        values[7].1
                    ));
                }
            }
        }
        if let Some(modes) = &self.modes {
            out.push(format!("body: {} lowest modes, {} of them without energy", modes.values.len(), modes.zero(BODY_ZERO)));
            for (n, value) in modes.values.iter().enumerate() {
                out.push(format!("  mode {:<3} eigenvalue {value:>14.6e}  frequency {:>14.6e}", n + 1, cycles(*value, modes)));
            }
        }
        for [k, energy] in self.imposed.iter().take(12) {
            out.push(format!("imposed wave {k}: energy {energy:.6e}"));
        }
        out
    }

    /// Writes `spectrum.csv`, `dispersion.png`, `group_velocity.png`, and in the plane `zone.csv` and `zone.png` (with the material's name where there are several),
    /// `modes.csv` and `modes.vtkhdf`, `imposed.csv` and `imposed.png`.
    ///
    /// # Errors
    /// [`OutputError`].
    pub fn write(&self, problem: &Problem, folder: &Path) -> Result<(), OutputError> {
        std::fs::create_dir_all(folder).map_err(|source| OutputError::Io { action: "create", path: folder.to_path_buf(), source })?;
        let title = &problem.deck.title.value;
        for m in &self.materials {
            let suffix = if self.materials.len() == 1 { String::new() } else { format!(".{}", m.name) };
            m.write(folder, title, &suffix, self.dimension)?;
            if !m.zone.is_empty() {
                zone::write(&m.zone, folder, &format!("{title}: {}, {}", m.name, m.verdict_text()), &suffix)?;
            }
        }
        if let Some(modes) = &self.modes {
            let mut table = History::create(&folder.join("modes.csv"), &["mode", "eigenvalue", "frequency"])?;
            for (n, value) in modes.values.iter().enumerate() {
                table.append(&[(n + 1) as f64, *value, cycles(*value, modes)])?;
            }
            self.write_shapes(modes, problem, folder)?;
        }
        if !self.imposed.is_empty() {
            let mut table = History::create(&folder.join("imposed.csv"), &["wave_number", "energy"])?;
            for row in &self.imposed {
                table.append(row)?;
            }
            let mut plot = Plot::new(title.clone(), Axis::new("wave number"), Axis::new("energy of the imposed wave"));
            plot.curves.push(Curve::new("", self.imposed.clone()));
            plot.write_png(&folder.join("imposed.png"))?;
        }
        Ok(())
    }

    /// One step a mode, the largest displacement a twentieth of the body's size.
    fn write_shapes(&self, modes: &BodyModes, problem: &Problem, folder: &Path) -> Result<(), OutputError> {
        let (d, n) = (self.dimension, problem.cloud.len());
        let (mut reference, mut id) = (vec![[0.0; 3]; n], vec![0; n]);
        for (p, &q) in problem.user.iter().enumerate() {
            reference[q as usize] = problem.cloud.position[p];
            id[q as usize] = problem.cloud.id[p] as i64;
        }
        let size = (0..3)
            .map(|k| {
                let ends = reference.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x[k]), b.max(x[k])));
                (ends.1 - ends.0).powi(2)
            })
            .sum::<f64>()
            .sqrt();
        let mut file: Option<FieldFile> = None;
        for (m, shape) in modes.vectors.chunks(n * d).enumerate() {
            let largest = shape.iter().fold(0.0f64, |m, x| m.max(x.abs()));
            let scale = if largest > 0.0 { 0.05 * size / largest } else { 0.0 };
            let mut displacement = vec![[0.0; 3]; n];
            for (p, &q) in problem.user.iter().enumerate() {
                (0..d).for_each(|k| displacement[q as usize][k] = scale * shape[p * d + k]);
            }
            let snapshot = Snapshot { time: (m + 1) as f64, step: (m + 1) as u64, displacement: &displacement, fields: &[] };
            match &mut file {
                Some(file) => file.append(&snapshot)?,
                None => file = Some(FieldFile::create(&folder.join("modes.vtkhdf"), &id, &reference, &[], &snapshot)?),
            }
        }
        Ok(())
    }
}

/// Cycles per time of an eigenvalue ω²; negative for one that grows, zero for one that is round-off.
fn cycles(eigenvalue: f64, modes: &BodyModes) -> f64 {
    if eigenvalue.abs() <= BODY_ZERO * modes.largest { 0.0 } else { eigenvalue.signum() * eigenvalue.abs().sqrt() / (2.0 * PI) }
}
