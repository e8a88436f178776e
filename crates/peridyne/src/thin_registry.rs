//! Beams and plates: from the deck to a body that solvers see ([`thin::structure::ThinStructure`]).

use crate::deck::{
    self, AngleMeasure, BeamMotion, BondMultiplePlate, BondPairBeam, Condition, CrossSection, Issue, Model, PairBehavior, PairPotential,
    PairWeights, Placement, PlateInfluence, PlateMotion, Points, Span,
};
use crate::problem::Problem;
use crate::registry::{Assembly, Derived};
use bodies::loads::Field;
use bodies::measures::FieldName;
use thin::ThinError;
use thin::angle::{Kinematics, Potential};
use thin::beam::Beam;
use thin::body::Thin;
use thin::layout::{Layout, Mirror, Parity};
use thin::loads::{Action, Condition as Load, Follow, couple, spread};
use thin::pairs::Law;
use thin::plate::{IsotropicWeight, Limit, Plate};
use thin::section::{ArmTable, Properties, Section, Weighting};
use thin::structure::{Assembled, Brittle, PointData};
use thin::weights::Influence;

type Checked<T> = Result<T, Vec<Issue>>;

/// A material with its model.
type Of<'a, M> = (&'a deck::Material, &'a M);

/// Builds the beam or plate of a problem.
pub fn assemble(problem: &Problem) -> Checked<Assembly> {
    let materials = &problem.deck.materials;
    if let Some(surface) = &problem.surface {
        return match problem.section.dimension() {
            2 => shells::<2>(problem, surface),
            _ => shells::<3>(problem, surface),
        };
    }
    let (mut beams, mut plates): (Vec<Of<BondPairBeam>>, Vec<Of<BondMultiplePlate>>) = (vec![], vec![]);
    for (name, material) in materials.iter() {
        if let Some(damage) = &material.damage {
            return Err(vec![Issue::new(damage.span, "`damage` is for solids", "use `behavior: brittle` in the model of a beam or plate")]);
        }
        match &material.model {
            Model::BondPairBeam(b) => beams.push((material, b)),
            Model::BondMultiplePlate(p) => plates.push((material, p)),
            _ => return Err(vec![Issue::new(name.span, "a solid does not mix with beams and plates", "use one kind of model")]),
        }
    }
    let differ = |span: Span, what: &str| {
        let message = format!("the materials of a beam or plate differ in {what}, which must be the same in the whole body");
        let help = "let them differ in stiffness, section, thickness, Poisson ratio, influence, tension, limits, behavior and density";
        vec![Issue::new(span, message, help)]
    };
    match (beams.as_slice(), plates.as_slice()) {
        ([first, rest @ ..], []) => {
            for (_, b) in rest {
                let same = b.motion.name() == first.1.motion.name() && b.angle.name() == first.1.angle.name();
                if !same || b.shape.is_some() {
                    return Err(differ(b.span, "`motion`, `angle` or `shape` (give the shape in the first)"));
                }
            }
            match first.1.motion {
                BeamMotion::Transverse => beam::<1>(problem, &beams),
                BeamMotion::Planar => beam::<2>(problem, &beams),
                BeamMotion::Spatial => beam::<3>(problem, &beams),
            }
        }
        ([], [first, rest @ ..]) => {
            let of = |p: &BondMultiplePlate| {
                let names = [p.motion.name(), p.angle.name(), p.isotropic_weight.name()];
                (names, p.weight_correction)
            };
            if let Some((_, p)) = rest.iter().find(|(_, p)| of(p) != of(first.1)) {
                return Err(differ(p.span, "`motion`, `angle`, `isotropic_weight` or `weight_correction`"));
            }
            match first.1.motion {
                PlateMotion::Transverse => plate::<1>(problem, &plates),
                PlateMotion::Spatial => plate::<3>(problem, &plates),
            }
        }
        ([], []) => Err(vec![]),
        ([beam, ..], _) => Err(vec![Issue::new(beam.1.span, "a beam and a plate in one body", "make a body of one kind")]),
    }
}

/// Lists of values of several materials, each of one or all points, as one list: each point takes that of its material. Materials without a
/// list have `missing`; `None` where no material has one.
fn by_material<T: Copy>(problem: &Problem, lists: Vec<Option<Vec<T>>>, missing: T) -> Option<Vec<T>> {
    if lists.len() == 1 {
        return lists.into_iter().next().flatten();
    }
    if lists.iter().all(Option::is_none) {
        return None;
    }
    let at = |p: usize| match &lists[problem.material[p] as usize] {
        Some(list) => list[if list.len() == 1 { 0 } else { p }],
        None => missing,
    };
    Some((0..problem.cloud.len()).map(at).collect())
}

/// Laws by point where materials differ; `None` where they do not.
fn laws_by_point(problem: &Problem, laws: &[Law]) -> Option<Vec<Law>> {
    (laws.iter().any(|l| *l != laws[0])).then(|| problem.material.iter().map(|m| laws[*m as usize]).collect())
}

/// The stress-free shape of a beam as displacements of its points.
pub fn stress_free_shape(problem: &Problem, d: usize, u: &mut [f64]) {
    for (_, material) in problem.deck.materials.iter() {
        let Model::BondPairBeam(BondPairBeam { shape: Some(shape), .. }) = &material.model else { continue };
        for (p, x) in problem.cloud.position.iter().enumerate() {
            let [along, across] = [&shape.x, &shape.y].map(|f| f.as_ref().map_or(0.0, |f| f.eval(*x, 0.0)));
            match d {
                1 => u[p] = across,
                _ => (u[p * d], u[p * d + 1]) = (along, across),
            }
        }
    }
}

/// What is wrong and, after the last semicolon of the message, what would be right.
fn issue(span: Span, e: &ThinError) -> Issue {
    let text = e.to_string();
    match text.rsplit_once("; ") {
        Some((what, remedy)) => Issue::new(span, what, remedy),
        None => Issue::new(span, text, "correct the deck accordingly"),
    }
}

fn fault(span: Span) -> impl Fn(ThinError) -> Vec<Issue> {
    move |e| vec![issue(span, &e)]
}

/// As [`fault`]; a value that is wrong somewhere is shown where it was typed, given by its name and the number of the material, and with its place.
fn fault_somewhere<'a>(
    problem: &'a Problem,
    span: Span,
    typed: impl Fn(&str, usize) -> Option<Span> + 'a,
) -> impl Fn(ThinError) -> Vec<Issue> + 'a {
    move |e| match &e {
        ThinError::NotPositive { what, point, value } => {
            let [x, y, z] = problem.cloud.position[*point];
            let message = format!("the {what} is {value:.6e} at ({x}, {y}, {z})");
            let span = typed(what, problem.material[*point] as usize).unwrap_or(span);
            vec![Issue::new(span, message, "make it positive everywhere in the body")]
        }
        _ => vec![issue(span, &e)],
    }
}

/// Fields that beams, plates and shells have.
const FIELDS: [FieldName; 11] = [
    FieldName::Displacement,
    FieldName::Velocity,
    FieldName::ForceDensity,
    FieldName::Curvature,
    FieldName::Moment,
    FieldName::PlasticAngle,
    FieldName::EnergyDensity,
    FieldName::Damage,
    FieldName::FamilySize,
    FieldName::Material,
    FieldName::Id,
];

/// Measures, pictures and plots of fields that thin bodies do not have.
fn check_fields(problem: &Problem) -> Checked<()> {
    let output = &problem.deck.output;
    let measured = output.measures.iter().map(|m| &m.field);
    let drawn = output.pictures.iter().map(|p| &p.field);
    let along = output.plots.iter().filter_map(|p| p.fields.as_ref()).flatten();
    let known = |name: &str| FieldName::parse(name).is_some_and(|f| FIELDS.contains(&f));
    let unknown = measured.chain(drawn).chain(along).filter(|f| !known(f.field.name()));
    let issues: Vec<Issue> = unknown
        .map(|f| {
            let help = "use `curvature.xx`, `moment.xx`, `displacement.y` or another of what pairs carry";
            Issue::new(f.span, format!("beams, plates and shells have no `{f}` of their own"), help)
        })
        .collect();
    if issues.is_empty() { Ok(()) } else { Err(issues) }
}

/// Where the cross-section was typed.
fn section_span(section: &CrossSection) -> Span {
    match section {
        CrossSection::Rectangle(s) => s.span,
        CrossSection::I(s) => s.span,
        CrossSection::Tube(s) => s.span,
        CrossSection::Profile(s) => s.span,
    }
}

/// A place of a load must be in the body.
fn check_place(problem: &Problem, at: &deck::Position) -> Checked<()> {
    let (x, p) = (at.point(), problem.nearest(at.point()));
    let near = problem.cloud.position[p];
    let distance = (0..3).map(|k| (x[k] - near[k]).powi(2)).sum::<f64>().sqrt();
    if problem.surface.is_some() || distance <= problem.cloud.spacing[p] * (1.0 + 1e-6) {
        return Ok(());
    }
    let message =
        format!("the load acts outside the body: the nearest point, ({}, {}, {}), is {distance:.6e} away", near[0], near[1], near[2]);
    Err(vec![Issue::new(at.span, message, "give a place in the body")])
}

/// Values of a field at all points, or one if it is constant.
fn values<K>(field: &deck::SpaceField<K>, problem: &Problem) -> Vec<f64>
where
    K: deck::Kind,
{
    match field.constant() {
        Some(value) => vec![value],
        None => problem.cloud.position.iter().map(|&x| field.eval(x, 0.0)).collect(),
    }
}

/// A product or other function of two lists, each of one or all values.
fn combine(a: &[f64], b: &[f64], f: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    let at = |v: &[f64], k: usize| v[if v.len() == 1 { 0 } else { k }];
    (0..a.len().max(b.len())).map(|k| f(at(a, k), at(b, k))).collect()
}

/// Where the points were typed.
fn points_span(deck: &deck::Deck) -> Span {
    match deck.body.points.first() {
        Some(Points::Line(s)) => s.span,
        Some(Points::Rectangle(s)) => s.span,
        _ => deck.body.span,
    }
}

fn layout(problem: &Problem, plane: bool) -> Checked<Layout> {
    let deck = &problem.deck;
    let positions = &problem.cloud.position;
    let made = if plane { Layout::plane(positions) } else { Layout::line(positions) };
    let (mut mirrors, mut spans) = (vec![], vec![]);
    for c in &deck.conditions {
        let (normal, at, parity) = match c {
            Condition::SimplySupported(e) if e.mirror => (Some(&e.normal.value), e.at.value, Parity::Odd),
            Condition::Clamped(e) if e.mirror => (Some(&e.normal.value), e.at.value, Parity::Even),
            Condition::Symmetry(s) => (s.axis(), s.at.value, Parity::Even),
            _ => continue,
        };
        spans.push(c.span());
        let mut n = [0.0; 3];
        // beams and plates have no other planes
        n[normal.map_or(0, |axis| axis.index())] = 1.0;
        mirrors.push(Mirror { normal: n, at, parity });
    }
    let first = spans.first().copied().unwrap_or(deck.body.span);
    made.map_err(fault(points_span(deck)))?.with_mirrors(&mirrors).map_err(|e| {
        let guilty = |m: &Mirror| matches!(e, ThinError::Mirror { normal, at, .. } if normal == m.normal && at == m.at);
        vec![issue(mirrors.iter().position(guilty).map_or(first, |k| spans[k]), &e)]
    })
}

/// Lengths or areas of the points: trapezoidal where points lie on edges, as generated or given where they are centres of cells.
fn measure(problem: &Problem) -> Option<Vec<f64>> {
    let on_edges = |p: &Points| match p {
        Points::Line(s) => matches!(s.lattice.placement, Placement::Edges),
        Points::Rectangle(s) => matches!(s.lattice.placement, Placement::Edges),
        _ => false,
    };
    if problem.deck.body.points.iter().any(on_edges) {
        return None;
    }
    let section = problem.section.measure();
    Some(problem.cloud.volume.iter().map(|v| v / section).collect())
}

fn potential(p: &PairPotential) -> Potential {
    match p {
        PairPotential::Square => Potential::Square,
        PairPotential::Cosine => Potential::Cosine,
    }
}

fn kinematics(a: &AngleMeasure) -> Kinematics {
    match a {
        AngleMeasure::Small => Kinematics::Small,
        AngleMeasure::Exact => Kinematics::Exact,
    }
}

fn influence(i: &PlateInfluence) -> Influence {
    match i {
        PlateInfluence::Constant => Influence::Constant,
        PlateInfluence::Length => Influence::Linear,
        PlateInfluence::InverseLength => Influence::Inverse,
        PlateInfluence::Cone => Influence::Conical,
    }
}

fn law(behavior: &PairBehavior, p: &PairPotential) -> Law {
    match behavior {
        PairBehavior::Elastic | PairBehavior::Brittle(_) => Law::Elastic(potential(p)),
        PairBehavior::NonlinearElastic => Law::NonlinearElastic,
        PairBehavior::ElasticPlastic => Law::ElasticPlastic,
    }
}

fn brittle(behavior: &PairBehavior) -> Option<Brittle> {
    match behavior {
        PairBehavior::Brittle(b) => Some(Brittle { batch: b.batch.value }),
        _ => None,
    }
}

fn section_of(s: &CrossSection) -> Section {
    match s {
        CrossSection::Rectangle(r) => Section::Rectangle { width: r.width.value, height: r.height.value },
        CrossSection::I(i) => {
            Section::I { width: i.width.value, height: i.height.value, web_width: i.web_width.value, web_height: i.web_height.value }
        }
        CrossSection::Tube(t) => Section::Tube { outer: t.outer.value, inner: t.inner.value },
        CrossSection::Profile(p) => {
            let width = p.width.clone();
            Section::Custom {
                height: p.height.value,
                width: Box::new(move |y| width.eval([0.0, y, 0.0], 0.0)),
                breaks: p.breaks.iter().map(|b| b.value).collect(),
            }
        }
    }
}

fn beam<const D: usize>(problem: &Problem, parts: &[Of<BondPairBeam>]) -> Checked<Assembly>
where
    Thin<D>: Assembled,
{
    let layout = layout(problem, false)?;
    let horizon = problem.horizon[0];
    let count = (horizon / layout.spacing[0] * (1.0 + 1e-9)).floor() as usize;
    let uneven = problem.horizon.iter().any(|h| (h / horizon - 1.0).abs() > 1e-9);
    if count == 0 || uneven {
        let span = problem.deck.body.horizon.span;
        return Err(vec![Issue::new(
            span,
            "a beam needs one horizon of at least a spacing for all points",
            "write for example `horizon: 3*dx`",
        )]);
    }
    let mut derived: Vec<Derived> = vec![("arms of a pair".into(), count as f64, "")];
    let mut warnings: Vec<String> = too_long(problem, &layout)?.into_iter().collect();
    if D == 1 && matches!(problem.deck.solver, deck::Solver::Buckling(_)) {
        let help = "write `motion: planar` (and `axial_stiffness`, if there is no cross-section)";
        return Err(vec![Issue::new(
            parts[0].1.span,
            "a beam that moves across alone feels no load along it, so it does not buckle",
            help,
        )]);
    }
    let (mut tables, mut laws): (Vec<ArmTable>, Vec<Law>) = (vec![], vec![]);
    let (mut bendings, mut axials, mut limits, mut masses) = (vec![], vec![], vec![], vec![]);
    for (material, b) in parts {
        let properties: Option<Properties> =
            b.cross_section.as_ref().map(|s| section_of(s).properties(count).map_err(fault(section_span(s)))).transpose()?;
        let weighting = match b.weights {
            PairWeights::Layer => Weighting::Layer,
            PairWeights::Uniform => Weighting::Uniform,
            PairWeights::Width => Weighting::Width,
            PairWeights::Thesis => Weighting::Thesis,
        };
        let plain = || -> Checked<Properties> { Section::Rectangle { width: 1.0, height: 1.0 }.properties(count).map_err(fault(b.span)) };
        let mut arms: ArmTable = match &properties {
            Some(p) => p.arms(weighting),
            // without a section: one of constant width
            None => plain()?.arms(weighting),
        };
        if brittle(&b.behavior).is_some() {
            // pairs break at one angle, whatever their arm
            arms.limit.fill(1.0);
        }
        let young = b.youngs_modulus.as_ref().map(|f| values(f, problem));
        let from_section = |moment: f64| young.as_ref().map(|e| e.iter().map(|e| e * moment).collect::<Vec<f64>>());
        let given = b.bending_stiffness.as_ref().map(|f| values(f, problem));
        let Some(bending) = given.or_else(|| properties.as_ref().and_then(|p| from_section(p.second_moment))) else {
            return Err(vec![Issue::new(b.span, "the bending stiffness is not known", "give `bending_stiffness`")]);
        };
        let axial = b.axial_stiffness.as_ref().map(|f| values(f, problem));
        let axial = axial.or_else(|| properties.as_ref().and_then(|p| from_section(p.area)));
        if axial.is_none() && D > 1 {
            return Err(vec![Issue::new(b.span, "the axial stiffness is not known", "give `axial_stiffness`, or `motion: transverse`")]);
        }
        let limit = match (&b.yield_stress, &b.limit_curvature, &young, &properties) {
            (Some(stress), _, Some(young), Some(p)) => Some(combine(&values(stress, problem), young, |s, e| 2.0 * s / (e * p.height))),
            (_, Some(curvature), ..) => Some(values(curvature, problem)),
            _ => None,
        };
        derived.push(("bending stiffness EI".into(), bending[0], "force length^2"));
        if let Some(p) = properties.as_ref().filter(|p| D == 3 && (p.lateral_second_moment / p.second_moment - 1.0).abs() > 0.01) {
            warnings.push(format!(
                "a beam in space bends alike in all directions, here with the second moment {:.6e} of its section; the section itself has {:.6e} for bending the other way, along z: give a round or square section, or load it along y alone",
                p.second_moment, p.lateral_second_moment
            ));
        }
        if let Some(p) = &properties {
            derived.push(("second moment of the section".into(), p.second_moment, "length^4"));
            derived.push(("plastic over yield moment of the section".into(), p.plastic_modulus / p.elastic_modulus, ""));
        }
        derived.push(("plastic over yield moment of the pairs".into(), arms.shape_factor(), ""));
        if let Some(limit) = &limit {
            derived.push(("yield moment".into(), bending[0] * limit[0], "force length"));
        }
        let area = properties.as_ref().map_or(problem.section.measure(), |p| p.area);
        let density = material.density.as_ref().map_or(vec![1.0], |d| values(d, problem));
        tables.push(arms);
        laws.push(law(&b.behavior, &b.potential));
        bendings.push(Some(bending));
        axials.push(axial);
        limits.push(limit);
        masses.push(Some(combine(&density, &[area], |r, a| r * a)));
    }
    let first = parts[0].1;
    let measure = measure(problem);
    let bending = by_material(problem, bendings, 0.0).unwrap_or_default();
    let axial = by_material(problem, axials, 0.0);
    let limit = by_material(problem, limits, f64::INFINITY);
    let by_point = laws_by_point(problem, &laws);
    let beam = Beam {
        bending: &bending,
        axial: axial.as_deref(),
        arms: &tables[0],
        limit_curvature: limit.as_deref(),
        law: laws[0],
        kinematics: kinematics(&first.angle),
        measure: measure.as_deref(),
    };
    let typed = |what: &str, material: usize| {
        let b = parts[material].1;
        match what {
            "bending stiffness" => b.bending_stiffness.as_ref().map(|f| f.span).or(b.youngs_modulus.as_ref().map(|f| f.span)),
            "axial stiffness" => b.axial_stiffness.as_ref().map(|f| f.span).or(b.youngs_modulus.as_ref().map(|f| f.span)),
            _ => b.limit_curvature.as_ref().map(|f| f.span).or(b.yield_stress.as_ref().map(|f| f.span)),
        }
    };
    let mut body: Thin<D> = match parts.len() {
        1 => beam.build(layout),
        _ => beam.build_sections(layout, &tables, &problem.material),
    }
    .map_err(fault_somewhere(problem, first.span, typed))?;
    if let Some(laws) = by_point {
        body.set_laws(laws).map_err(fault(first.span))?;
    }
    if let Some(shape) = &first.shape {
        if let deck::Solver::Statics(deck::Statics { linear: true, .. }) = &problem.deck.solver {
            let help = "remove `linear: true`: the shape makes stiffness along and across depend on each other";
            return Err(vec![Issue::new(shape.span, "a stress-free shape and a linear solution about the straight beam", help)]);
        }
        let mut u = vec![0.0; problem.cloud.len() * D];
        stress_free_shape(problem, D, &mut u);
        body.relax_at(&u).map_err(fault(shape.span))?;
    }
    let breaks = parts.iter().find_map(|(_, b)| brittle(&b.behavior));
    let mass = by_material(problem, masses, 1.0).unwrap_or_default();
    let plastic = laws.iter().any(|l| l.has_history());
    if D == 3 && plastic && matches!(problem.deck.solver, deck::Solver::VelocityVerlet(_)) {
        warnings.push(
            "sections of a beam in space are held against spinning about its axis, so bending across a plastic bend takes a twisting moment from outside: angular momentum is not kept there".into(),
        );
    }
    let mut made = finish(problem, body, breaks, mass, derived)?;
    made.warnings.extend(warnings);
    Ok(made)
}

/// A horizon that reaches beyond the body is refused; one beyond its middle is told of: the longest pairs then have no centre.
fn too_long(problem: &Problem, layout: &Layout) -> Checked<Option<String>> {
    let extent = |row: &[f64; 3]| {
        let along = layout.positions.iter().map(|x| x[0] * row[0] + x[1] * row[1] + x[2] * row[2]);
        let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), s| (a.min(s), b.max(s)));
        high - low
    };
    let shortest = layout.rows[..layout.dimension].iter().map(extent).fold(f64::INFINITY, f64::min);
    let (horizon, span) = (problem.horizon[0], problem.deck.body.horizon.span);
    if horizon > shortest * (1.0 + 1e-9) {
        let message = format!("a horizon of {horizon:.6e} reaches beyond the whole body, which is {shortest:.6e} across");
        return Err(vec![Issue::new(span, message, "write for example `horizon: 3*dx`, with many points across the body")]);
    }
    Ok((horizon > 0.5 * shortest * (1.0 + 1e-9)).then(|| {
        format!(
            "the horizon of {horizon:.6e} is longer than half the body ({shortest:.6e} across): pairs that long have no centre but at mirrors, so that the body is not as stiff as it should be"
        )
    }))
}

fn plate<const D: usize>(problem: &Problem, parts: &[Of<BondMultiplePlate>]) -> Checked<Assembly>
where
    Thin<D>: Assembled,
{
    let layout = layout(problem, true)?;
    let warning = too_long(problem, &layout)?;
    let horizon = problem.horizon[0];
    if problem.horizon.iter().any(|h| (h / horizon - 1.0).abs() > 1e-9) {
        let span = problem.deck.body.horizon.span;
        return Err(vec![Issue::new(span, "a plate needs one horizon for all points", "write for example `horizon: 3*dx`")]);
    }
    let first = parts[0].1;
    let mut derived: Vec<Derived> = vec![];
    let mut laws: Vec<Law> = vec![];
    let poissons: Vec<_> = parts.iter().map(|(_, p)| Some(vec![p.poisson_ratio.value])).collect();
    let influences: Vec<_> = parts.iter().map(|(_, p)| Some(vec![influence(&p.influence)])).collect();
    let tension_of = |p: &BondMultiplePlate| p.tension.as_ref().map(|t| vec![t.each_ref().map(|q| q.value)]);
    let tensions: Vec<_> = parts.iter().map(|(_, p)| tension_of(p)).collect();
    let (mut rigidities, mut membranes, mut curvatures, mut angles, mut masses) = (vec![], vec![], vec![], vec![], vec![]);
    for (material, p) in parts {
        let nu = p.poisson_ratio.value;
        let young = p.youngs_modulus.as_ref().map(|f| values(f, problem));
        let thickness = p.thickness.as_ref().map(|f| values(f, problem));
        let solid = young.as_ref().zip(thickness.as_ref());
        let given = p.bending_stiffness.as_ref().map(|f| values(f, problem));
        let Some(rigidity) = given.or_else(|| solid.map(|(e, h)| combine(e, h, |e, h| e * h.powi(3) / (12.0 * (1.0 - nu * nu))))) else {
            return Err(vec![Issue::new(p.span, "the bending stiffness is not known", "give `bending_stiffness`")]);
        };
        let membrane = p.membrane_stiffness.as_ref().map(|f| values(f, problem));
        let membrane = membrane.or_else(|| solid.map(|(e, h)| combine(e, h, |e, h| e * h)));
        if membrane.is_none() && D > 1 {
            return Err(vec![Issue::new(p.span, "the membrane stiffness is not known", "give `membrane_stiffness`")]);
        }
        // a given tension needs a membrane stiffness only to share it among bonds: any will do
        let membrane = membrane.or_else(|| p.tension.as_ref().filter(|_| D == 1).map(|_| vec![1.0]));
        let curvature = limit_curvature(
            p.yield_stress.as_ref().map(|f| values(f, problem)),
            p.limit_curvature.as_ref().map(|f| values(f, problem)),
            solid,
        );
        let angle = p.limit_angle.as_ref().map(|f| values(f, problem));
        // brittle pairs break at one angle, that of the horizon
        let angle = match (&curvature, brittle(&p.behavior)) {
            (Some(curvature), Some(_)) => Some(curvature.iter().map(|c| c * horizon).collect()),
            _ => angle,
        };
        derived.push(("bending stiffness D".into(), rigidity[0], "force length"));
        if let (Some(c), None) = (&curvature, &angle) {
            derived.push(("plastic moment of a strip".into(), 1.5 * rigidity[0] * (1.0 - nu * nu) * c[0], "force"));
        }
        let thickness = thickness.unwrap_or_else(|| vec![problem.section.measure()]);
        let density = material.density.as_ref().map_or(vec![1.0], |d| values(d, problem));
        laws.push(law(&p.behavior, &p.potential));
        rigidities.push(Some(rigidity));
        membranes.push(membrane);
        curvatures.push(if angle.is_some() { None } else { curvature });
        angles.push(angle);
        masses.push(Some(combine(&density, &thickness, |r, h| r * h)));
    }
    let rigidity = by_material(problem, rigidities, 0.0).unwrap_or_default();
    let membrane = by_material(problem, membranes, 1.0);
    let curvature = by_material(problem, curvatures, f64::INFINITY);
    let angle = by_material(problem, angles, f64::INFINITY);
    let limit = match (&angle, &curvature) {
        (Some(_), Some(_)) => {
            let help = "give both materials a `limit_angle`, or both a curvature or yield stress, of the same kind of behavior";
            return Err(vec![Issue::new(first.span, "limits by angle and by layers in one plate", help)]);
        }
        (Some(angle), _) => Limit::Angle(angle),
        (None, Some(curvature)) => Limit::Layers(curvature),
        _ => Limit::None,
    };
    let measure = measure(problem);
    let poisson = by_material(problem, poissons, 0.0).unwrap_or_default();
    let typed = |what: &str, material: usize| {
        let p = parts[material].1;
        let solid = || p.youngs_modulus.as_ref().map(|f| f.span);
        match what {
            "bending stiffness" => p.bending_stiffness.as_ref().map(|f| f.span).or_else(solid),
            "membrane stiffness" => p.membrane_stiffness.as_ref().map(|f| f.span).or_else(solid),
            "limit angle" => p.limit_angle.as_ref().map(|f| f.span),
            _ => p.limit_curvature.as_ref().map(|f| f.span).or(p.yield_stress.as_ref().map(|f| f.span)),
        }
    };
    let influences = by_material(problem, influences, Influence::Constant).unwrap_or_default();
    let tension = by_material(problem, tensions, [0.0; 3]);
    let mut body: Thin<D> = Plate {
        horizon,
        rigidity: &rigidity,
        poisson: &poisson,
        membrane: membrane.as_deref(),
        influence: &influences,
        correction: first.weight_correction,
        isotropic: match first.isotropic_weight {
            deck::IsotropicWeight::Energy => IsotropicWeight::Energy,
            deck::IsotropicWeight::Thesis => IsotropicWeight::Thesis,
        },
        limit,
        law: laws[0],
        kinematics: kinematics(&first.angle),
        tension: tension.as_deref(),
        measure: measure.as_deref(),
    }
    .build(layout)
    .map_err(fault_somewhere(problem, first.span, typed))?;
    if let Some(laws) = laws_by_point(problem, &laws) {
        body.set_laws(laws).map_err(fault(first.span))?;
    }
    let breaks = parts.iter().find_map(|(_, p)| brittle(&p.behavior));
    let mass = by_material(problem, masses, 1.0).unwrap_or_default();
    let mut made = finish(problem, body, breaks, mass, derived)?;
    made.warnings.extend(warning);
    Ok(made)
}

/// Curvature at which layers yield or break: given, or that at which the outermost of the `solid` (E, h) reaches the yield stress.
fn limit_curvature(yield_stress: Option<Vec<f64>>, given: Option<Vec<f64>>, solid: Option<(&Vec<f64>, &Vec<f64>)>) -> Option<Vec<f64>> {
    match (yield_stress, solid) {
        (Some(stress), Some((e, h))) => Some(combine(&combine(&stress, e, |s, e| s / e), h, |s, h| 2.0 * s / h)),
        _ => given,
    }
}

mod shells;
use shells::shells;

/// Conditions, masses (per length or area), cracks.
fn finish<const D: usize>(
    problem: &Problem,
    mut body: Thin<D>,
    brittle: Option<Brittle>,
    mass: Vec<f64>,
    mut derived: Vec<Derived>,
) -> Checked<Assembly>
where
    Thin<D>: Assembled,
{
    check_fields(problem)?;
    let mut warnings = vec![];
    let yields = body.has_history() || brittle.is_some();
    if yields && matches!(problem.deck.solver, deck::Solver::Statics(deck::Statics { linear: true, .. })) {
        warnings.push("`linear: true` solves with the stiffness of the unloaded body: pairs neither yield nor break".into());
    }
    derived.push(("bond pairs".into(), body.pair_count() as f64, ""));
    if let Some(cracks) = &problem.cracks {
        let cut = body.cut(|a, b| cracks.cut(*a, *b));
        derived.push(("pairs cut by cracks".into(), cut as f64, ""));
        if cut == 0 {
            warnings.push("the cracks cut no pair: check their place".into());
        }
    }
    let data = PointData { id: problem.cloud.id.clone(), user: problem.user.clone(), material: problem.material.clone(), density: mass };
    let conditions = conditions(problem, &body)?;
    let model = body.simulated(data, conditions, brittle, problem.end().unwrap_or(0.0)).map_err(fault(problem.deck.body.span))?;
    Ok(Assembly { model, derived, warnings })
}

/// Components in the order of a body's dofs: where it moves across alone, the one along its normal.
fn components<const D: usize>(problem: &Problem, given: [Option<Field>; 3], spans: [Option<Span>; 3]) -> Checked<[Option<Field>; 3]> {
    let across = problem.section.dimension();
    let mut out = [None, None, None];
    for (k, field) in given.into_iter().enumerate() {
        let Some(field) = field else { continue };
        let to = if D == 1 { if k == across { 0 } else { 3 } } else { k };
        if to >= D {
            let span = spans[k].unwrap_or(problem.deck.body.span);
            let axis = ["x", "y", "z"];
            let allowed: Vec<&str> = if D == 1 { vec![axis[across]] } else { axis[..D].to_vec() };
            return Err(vec![Issue::new(
                span,
                format!("the body does not move along {}", axis[k]),
                format!("use {}, or another `motion` of the model", allowed.join(", ")),
            )]);
        }
        out[to] = Some(field);
    }
    Ok(out)
}

fn conditions<const D: usize>(problem: &Problem, body: &Thin<D>) -> Checked<Vec<Load>> {
    let deck = &problem.deck;
    let positions = &problem.cloud.position;
    let mut out = vec![];
    macro_rules! fields {
        ($c:expr) => {{
            let given = [&$c.x, &$c.y, &$c.z].map(|f| {
                f.as_ref().map(|f| {
                    let f = f.clone();
                    Box::new(move |x, t| f.eval(x, t)) as Field
                })
            });
            components::<D>(problem, given, [&$c.x, &$c.y, &$c.z].map(|f| f.as_ref().map(|f| f.span)))?
        }};
    }
    // what is held on a plane
    let on_plane = |normal: usize, at: f64| -> Vec<u32> {
        (0..positions.len() as u32)
            .filter(|&p| (positions[p as usize][normal] - at).abs() < 1e-4 * problem.cloud.spacing[p as usize])
            .collect()
    };
    let hold = |name: String, points: Vec<u32>, which: &[usize]| Load::hold(&name, points, which);
    let across = if D == 1 { 0 } else { problem.section.dimension().min(2) };
    for (c, name) in deck.conditions.iter().zip(deck::labels(&deck.conditions)) {
        let points = c.set().map(|s| problem.set(&s.value).to_vec()).unwrap_or_default();
        match c {
            Condition::Displacement(d) => out.push(Load { name, action: Action::Displacement, points, components: fields!(d) }),
            Condition::SimplySupported(e) => {
                let points = on_plane(e.normal.value.index(), e.at.value);
                let all: Vec<usize> = (0..D).collect();
                // in space a beam is held across both ways
                let which: Vec<usize> = match (e.slide, D) {
                    // a diaphragm: free to move along its normal
                    (true, _) if problem.surface.is_some() => (0..D).filter(|k| *k != e.normal.value.index()).collect(),
                    (_, 1) => vec![0],
                    (false, _) => all,
                    (true, 3) if problem.section.dimension() == 1 => vec![1, 2],
                    (true, _) => vec![across],
                };
                out.push(hold(name, points, &which));
            }
            Condition::Clamped(e) => {
                let all: Vec<usize> = (0..D).collect();
                let points = on_plane(e.normal.value.index(), e.at.value);
                if points.is_empty() && problem.surface.is_none() {
                    let message = format!("no point lies at {} = {}, so the clamp holds none", e.normal.value.name(), e.at.value);
                    let help = "let points lie on the edge (`placement: edges`), or clamp where they are";
                    return Err(vec![Issue::new(e.span, message, help)]);
                }
                out.push(hold(name, points, &all));
            }
            Condition::Symmetry(s) => {
                let k = s.axis().map_or(0, |axis| axis.index());
                if D > 1 && k < D {
                    out.push(hold(name, on_plane(k, s.at.value), &[k]));
                }
            }
            Condition::Pin(p) => {
                if problem.surface.is_some() {
                    let help = "hold one of its points by `displacement`";
                    return Err(vec![Issue::new(p.span, "a pin is for straight beams and flat plates", help)]);
                }
                let f = p.deflection.clone();
                let mut components = [None, None, None];
                components[across] = Some(Box::new(move |x, t| f.eval(x, t)) as Field);
                out.push(Load { name, action: Action::Mean, points, components });
            }
            Condition::PointLoad(l) => {
                check_place(problem, &l.at)?;
                let horizon = if l.spread { problem.horizon[0] } else { 0.0 };
                let (points, weights) = spread(positions, l.at.point(), horizon);
                out.push(Load { name, action: Action::Force { weights }, points, components: fields!(l) });
            }
            Condition::DistributedLoad(l) => {
                let weights = points.iter().map(|&p| body.measure()[p as usize]).collect();
                out.push(Load { name, action: Action::Force { weights }, points, components: fields!(l) });
            }
            Condition::Pressure(l) => {
                let f = l.value.clone();
                if let Some(surface) = &problem.surface {
                    let load = Load::pressure(&name, surface, points, move |x, t| f.eval(x, t));
                    out.push(if l.follow { load.following(faces(problem, l.span)?) } else { load });
                } else if l.follow {
                    let help = "make the body a `surface` with the model `shell`";
                    return Err(vec![Issue::new(l.span, "a pressure follows shells only", help)]);
                } else {
                    let weights = points.iter().map(|&p| body.measure()[p as usize]).collect();
                    let mut components = [None, None, None];
                    components[across] = Some(Box::new(move |x, t| f.eval(x, t)) as Field);
                    out.push(Load { name, action: Action::Force { weights }, points, components });
                }
            }
            Condition::LineLoad(l) => {
                let weights = along_a_row(positions, &points);
                out.push(Load { name, action: Action::Force { weights }, points, components: fields!(l) });
            }
            Condition::Moment(m) => {
                if problem.section.dimension() != 1 {
                    return Err(vec![Issue::new(m.span, "a moment acts on a beam", "use two line loads on a plate")]);
                }
                check_place(problem, &m.at)?;
                let (points, weights) = couple(positions, m.at.point(), body.layout().rows[0], problem.horizon[0]);
                let f = m.value.clone();
                let mut components = [None, None, None];
                components[across] = Some(Box::new(move |x, t| f.eval(x, t)) as Field);
                out.push(Load { name, action: Action::Force { weights }, points, components });
            }
            Condition::InitialVelocity(_) | Condition::InitialDisplacement(_) => {}
            Condition::Velocity(_) | Condition::ForceDensity(_) | Condition::Traction(_) | Condition::RigidWall(_) => {
                return Err(vec![Issue::new(
                    c.span(),
                    format!("`{}` is for solids", c.name()),
                    "beams and plates have `displacement`, `distributed_load`, `point_load`, `line_load`, `pin`, `simply_supported`, `clamped`",
                )]);
            }
        }
    }
    if matches!(deck.solver, deck::Solver::Statics(_)) && !out.iter().any(Load::prescribes) {
        let help = "add `clamped`, `simply_supported`, `pin` or `displacement`";
        return Err(vec![Issue::new(deck.conditions.first().map_or(deck.body.span, Condition::span), "nothing holds the body", help)]);
    }
    if let Some(temperature) = &deck.temperature {
        return Err(vec![Issue::new(temperature.span, "beams and plates know no temperature", "remove `temperature`")]);
    }
    Ok(out)
}

/// Triangles of all surfaces and edges of all curves, for a pressure that follows them.
fn faces(problem: &Problem, span: Span) -> Checked<Follow> {
    if let Some(deck::Solver::Statics(deck::Statics { linear: true, .. })) = Some(&problem.deck.solver) {
        return Err(vec![Issue::new(span, "a linear solution does not move the pressure", "remove `linear: true` or `follow: true`")]);
    }
    let mut follow = Follow::default();
    for part in &problem.parts {
        let (s, first) = (&part.surface, part.first as u32);
        let n = s.len() as u32;
        if s.dimension == 1 {
            let x = |p: u32| s.positions[p as usize];
            let gap = |a: u32, b: u32| (0..3).map(|k| (x(a)[k] - x(b)[k]).powi(2)).sum::<f64>().sqrt();
            follow.edges.extend((1..n).map(|p| [first + p - 1, first + p]));
            if n > 4 && gap(0, n - 1) <= 1.5 * gap(0, 1) {
                follow.edges.push([first + n - 1, first]);
            }
        } else if s.triangles.is_empty() {
            let message = format!("the surface `{}` has no triangles, which a pressure could follow", part.name);
            return Err(vec![Issue::new(span, message, "give a shape or a mesh, or remove `follow: true`")]);
        }
        follow.faces.extend(s.triangles.iter().map(|t| t.map(|p| p + first)));
    }
    Ok(follow)
}

/// Trapezoidal lengths of points along the row they lie in.
fn along_a_row(positions: &[[f64; 3]], points: &[u32]) -> Vec<f64> {
    let far = |from: [f64; 3]| {
        let distance = |p: &u32| (0..3).map(|k| (positions[*p as usize][k] - from[k]).powi(2)).sum::<f64>();
        points.iter().max_by(|a, b| distance(a).total_cmp(&distance(b))).map_or(from, |p| positions[*p as usize])
    };
    let Some(&first) = points.first() else { return vec![] };
    let end = far(positions[first as usize]);
    let mut order: Vec<(f64, usize)> = points
        .iter()
        .enumerate()
        .map(|(q, &p)| ((0..3).map(|k| (positions[p as usize][k] - end[k]).powi(2)).sum::<f64>().sqrt(), q))
        .collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut weights = vec![0.0; points.len()];
    for pair in order.windows(2) {
        let half = 0.5 * (pair[1].0 - pair[0].0);
        weights[pair[0].1] += half;
        weights[pair[1].1] += half;
    }
    weights
}
