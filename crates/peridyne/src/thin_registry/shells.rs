//! Shells, curved beams and stiffeners: every surface and line of a deck is a part; parts are joined where the deck says so.

use super::*;
use crate::surface::Part;
use std::ops::Range;
use thin::interpolation::Interpolation;
use thin::joint::{along_line, resolved, touching};
use thin::shell::{Horizon, Shell, Turn, Values};
use thin::surface::Surface;

/// What a part came to.
struct Made<const D: usize> {
    body: Thin<D>,
    /// Per area or length.
    mass: Vec<f64>,
    /// Bending stiffness, one value or one per point.
    rigidity: Vec<f64>,
    breaks: Option<Brittle>,
    derived: Vec<Derived>,
    warnings: Vec<String>,
}

/// Builds the structure.
pub(super) fn shells<const D: usize>(problem: &Problem, surface: &Surface) -> Checked<Assembly>
where
    Thin<D>: Assembled,
{
    let several = problem.parts.len() > 1;
    let (mut bodies, mut mass, mut rigidities) = (vec![], vec![], vec![]);
    let (mut derived, mut warnings, mut breaks): (Vec<Derived>, Vec<String>, Option<Brittle>) = (vec![], vec![], None);
    for part in &problem.parts {
        let made = if part.surface.dimension == 1 && D == 3 { stiffener::<D>(problem, part)? } else { shell::<D>(problem, part)? };
        let n = part.surface.len();
        bodies.push(made.body);
        mass.extend((0..n).map(|p| made.mass[if made.mass.len() == 1 { 0 } else { p }]));
        rigidities.push(made.rigidity);
        breaks = breaks.or(made.breaks);
        let named = |what: String| if several { format!("{}: {what}", part.name) } else { what };
        derived.extend(made.derived.into_iter().map(|(what, value, unit)| (named(what), value, unit)));
        warnings.extend(made.warnings.into_iter().map(named));
    }
    let mut body = match bodies.len() {
        1 => bodies.remove(0),
        _ => Thin::join(bodies).map_err(fault(problem.deck.body.span))?,
    };
    warnings.extend(join(problem, &mut body, &rigidities, &mut derived)?);
    // counted with the points of the surface: a load on it is one on all parts
    debug_assert_eq!(surface.len(), body.points());
    let mut made = finish(problem, body, breaks, mass, derived)?;
    made.warnings.extend(warnings);
    Ok(made)
}

/// Points of one part, and those of another that each of them follows, with weights.
type Ties = Vec<(u32, Vec<(u32, f64)>)>;

/// Ties the parts where they touch, and puts pairs across rigid joints.
fn join<const D: usize>(
    problem: &Problem,
    body: &mut Thin<D>,
    rigidities: &[Vec<f64>],
    derived: &mut Vec<Derived>,
) -> Checked<Vec<String>> {
    let joints = &problem.deck.body.joints;
    let parts = &problem.parts;
    let mut found: Vec<Ties> = vec![];
    let mut between: Vec<[usize; 2]> = vec![];
    for joint in joints {
        let mut pair = [0; 2];
        for (k, name) in joint.between.iter().enumerate() {
            pair[k] = parts.iter().position(|p| p.name == name.value).ok_or_else(|| {
                let names: Vec<&str> = parts.iter().map(|p| p.name.as_str()).collect();
                let help = format!("there are {}", names.join(", "));
                vec![Issue::new(name.span, format!("there is no surface called `{}`", name.value), help)]
            })?;
        }
        let [a, b] = pair.map(|k| &parts[k]);
        if pair[0] == pair[1] {
            return Err(vec![Issue::new(joint.span, format!("a joint of `{}` with itself", a.name), "name two parts")]);
        }
        let ties = touching(&a.surface, a.first as u32, &b.surface, b.first as u32);
        if ties.is_empty() {
            let nearest = gap(&a.surface, &b.surface);
            let message = format!("`{}` and `{}` do not touch: no point of `{}` lies on `{}`{nearest}", a.name, b.name, b.name, a.name);
            let help = "move one of them with `place`; where they are curved, give both points in the same places; or exchange the two in `between`";
            return Err(vec![Issue::new(joint.span, message, help)]);
        }
        between.push(pair);
        found.push(ties);
    }
    let lines: Vec<Vec<u32>> = found.iter().map(|ties| ties.iter().map(|t| t.0).collect()).collect();
    let ties = resolved(found);
    if !ties.is_empty() {
        derived.push(("points that follow others".into(), ties.len() as f64, ""));
        body.tie(&ties).map_err(fault(problem.deck.body.span))?;
    }
    let mut across = vec![];
    for ((joint, [a, b]), line) in joints.iter().zip(&between).zip(&lines) {
        let (one, other) = (&parts[*a], &parts[*b]);
        // a beam along a plate turns with it
        let beam = D == 3 && one.surface.dimension.min(other.surface.dimension) == 1;
        if beam || matches!(joint.kind, deck::JointKind::Hinge) {
            continue;
        }
        let of = |k: usize, p: usize| rigidities[k][if rigidities[k].len() == 1 { 0 } else { p }];
        let positions = &body.layout().positions;
        // compliances of both parts in series, where the line is
        let centres: Vec<(u32, f64)> = along_line(positions, line)
            .into_iter()
            .map(|(p, length)| {
                let x = positions[p as usize];
                let stiff = 2.0 / (1.0 / of(*a, one.surface.nearest(x) as usize) + 1.0 / of(*b, p as usize - other.first));
                (p, length * stiff)
            })
            .collect();
        let range = |part: &Part| -> Vec<u32> { (part.first as u32..(part.first + part.surface.len()) as u32).collect() };
        let horizon = line.iter().map(|p| problem.horizon[*p as usize]).fold(0.0, f64::max);
        let pairs = body.stiff_joint(&centres, &range(one), &range(other), horizon, 1.0);
        if pairs.is_empty() {
            let message = format!("the joint of `{}` and `{}` has no pair of points to transmit a moment", one.name, other.name);
            let help = "parts that lie on one another need `kind: hinge`; else enlarge the horizon, or space both parts alike";
            return Err(vec![Issue::new(joint.span, message, help)]);
        }
        derived.push((format!("pairs across the joint of {} and {}", one.name, other.name), pairs.len() as f64, ""));
        across.push((joint.span, pairs));
    }
    for (span, pairs) in across {
        body.add_joint_pairs(&pairs).map_err(fault(span))?;
    }
    let alone = |k: &usize| parts.len() > 1 && !between.iter().any(|pair| pair.contains(k));
    let alone = (0..parts.len()).filter(alone);
    Ok(alone.map(|k| format!("the surface `{}` is joined with nothing: it moves by itself", parts[k].name)).collect())
}

/// How far two small parts are apart, for messages.
fn gap(a: &Surface, b: &Surface) -> String {
    if a.len() * b.len() > 30_000_000 {
        return String::new();
    }
    let distance = |x: &[f64; 3], y: &[f64; 3]| (0..3).map(|k| (x[k] - y[k]).powi(2)).sum::<f64>();
    let least = a.positions.iter().flat_map(|x| b.positions.iter().map(move |y| distance(x, y))).fold(f64::INFINITY, f64::min);
    format!("; the nearest points are {:.3e} apart", least.sqrt())
}

/// Values of a field at the points of a part, or one if it is constant.
fn within<K: deck::Kind>(field: &deck::SpaceField<K>, problem: &Problem, range: &Range<usize>) -> Vec<f64> {
    match field.constant() {
        Some(value) => vec![value],
        None => problem.cloud.position[range.clone()].iter().map(|&x| field.eval(x, 0.0)).collect(),
    }
}

/// Mirror planes of the conditions.
fn mirrors(problem: &Problem) -> Vec<Mirror> {
    let mut mirrors = vec![];
    for c in &problem.deck.conditions {
        let (normal, at, parity) = match c {
            Condition::SimplySupported(e) if e.mirror => (Some(&e.normal.value), e.at.value, Parity::Odd),
            Condition::Clamped(e) if e.mirror => (Some(&e.normal.value), e.at.value, Parity::Even),
            Condition::Symmetry(s) => (s.axis(), s.at.value, Parity::Even),
            _ => continue,
        };
        let mut n = [0.0; 3];
        // shells have no other planes
        n[normal.map_or(0, |axis| axis.index())] = 1.0;
        mirrors.push(Mirror { normal: n, at, parity });
    }
    mirrors
}

/// The materials of the points of a part, in the order of the deck, and which of them each point has.
fn materials_of<'a>(problem: &'a Problem, range: &Range<usize>) -> (Vec<(&'a crate::deck::Text, &'a deck::Material)>, Vec<usize>) {
    let all: Vec<_> = problem.deck.materials.iter().collect();
    let mut used: Vec<u32> = problem.material[range.clone()].to_vec();
    used.sort_unstable();
    used.dedup();
    let which = problem.material[range.clone()].iter().map(|m| used.partition_point(|u| u < m)).collect();
    (used.iter().map(|m| all[*m as usize]).collect(), which)
}

/// A shell, a plate of any points or a curved beam.
fn shell<const D: usize>(problem: &Problem, part: &Part) -> Checked<Made<D>> {
    let range = part.first..part.first + part.surface.len();
    let (materials, which) = materials_of(problem, &range);
    let mut shells = vec![];
    for (name, material) in &materials {
        match &material.model {
            Model::Shell(s) => shells.push((*material, s)),
            _ => {
                let message = format!("points of the surface `{}` are for the model `shell`", part.name);
                return Err(vec![Issue::new(name.span, message, "use it; a `bond_pair_beam` is for lines in space")]);
            }
        }
    }
    let Some((_, first)) = shells.first().copied() else { return Err(vec![]) };
    let of =
        |s: &deck::Shell| [s.influence.name(), s.virtual_points.name(), s.turn.name(), if s.weight_correction { "corrected" } else { "" }];
    if let Some((_, s)) = shells.iter().find(|(_, s)| of(s) != of(first)) {
        let message = "the materials of a surface differ in influence, virtual points, measure of bending or weight correction";
        return Err(vec![Issue::new(
            s.span,
            message,
            "let them differ in stiffness, thickness, Poisson ratio, limits, behavior and density",
        )]);
    }
    let (mut rigidities, mut membranes, mut thicknesses, mut poissons) = (vec![], vec![], vec![], vec![]);
    let (mut curvatures, mut angles, mut stretches, mut masses, mut laws) = (vec![], vec![], vec![], vec![], vec![]);
    for (material, s) in &shells {
        let nu = s.poisson_ratio.value;
        let young = s.youngs_modulus.as_ref().map(|f| within(f, problem, &range));
        let thickness = s.thickness.as_ref().map(|f| within(f, problem, &range));
        let solid = young.as_ref().zip(thickness.as_ref());
        let unknown = || vec![Issue::new(s.span, "the stiffness is not known", "give `youngs_modulus` and `thickness`")];
        let rigidity = s.bending_stiffness.as_ref().map(|f| within(f, problem, &range));
        let rigidity = rigidity.or_else(|| solid.map(|(e, h)| combine(e, h, |e, h| e * h.powi(3) / (12.0 * (1.0 - nu * nu)))));
        let membrane = s.membrane_stiffness.as_ref().map(|f| within(f, problem, &range));
        let membrane = membrane.or_else(|| solid.map(|(e, h)| combine(e, h, |e, h| e * h))).ok_or_else(unknown)?;
        let curvature = limit_curvature(
            s.yield_stress.as_ref().map(|f| within(f, problem, &range)),
            s.limit_curvature.as_ref().map(|f| within(f, problem, &range)),
            solid,
        );
        let angle = s.limit_angle.as_ref().map(|f| within(f, problem, &range));
        // brittle pairs break at one angle, that of the horizon
        let angle = match (&curvature, brittle(&s.behavior)) {
            (Some(curvature), Some(_)) => Some(combine(curvature, &problem.horizon[range.clone()], |c, h| c * h)),
            _ => angle,
        };
        let density = material.density.as_ref().map_or(vec![1.0], |d| within(d, problem, &range));
        masses.push(Some(combine(&density, thickness.as_deref().unwrap_or(&[1.0]), |r, h| r * h)));
        rigidities.push(Some(rigidity.ok_or_else(unknown)?));
        membranes.push(Some(membrane));
        thicknesses.push(thickness);
        poissons.push(Some(vec![nu]));
        curvatures.push(if angle.is_some() { None } else { curvature });
        angles.push(angle);
        stretches.push(s.critical_stretch.as_ref().map(|f| within(f, problem, &range)));
        laws.push(law(&s.behavior, &PairPotential::Square));
    }
    // each point takes the value of its material
    let merge = |lists: Vec<Option<Vec<f64>>>, missing: f64| -> Option<Vec<f64>> {
        if lists.len() == 1 {
            return lists.into_iter().next().flatten();
        }
        let at = |p: usize| lists[which[p]].as_ref().map_or(missing, |list| list[if list.len() == 1 { 0 } else { p }]);
        lists.iter().any(Option::is_some).then(|| (0..which.len()).map(at).collect())
    };
    let breaks = shells.iter().find_map(|(_, s)| brittle(&s.behavior));
    let rigidity = merge(rigidities, 0.0).unwrap_or_default();
    let membrane = merge(membranes, 0.0).unwrap_or_default();
    // where one material has no thickness, that of its stiffness is asked for
    let thickness = if thicknesses.iter().all(Option::is_some) { merge(thicknesses, 1.0) } else { None };
    let poisson = merge(poissons, 0.0).unwrap_or_default();
    let (curvature, angle) = (merge(curvatures, f64::INFINITY), merge(angles, f64::INFINITY));
    let stretch = merge(stretches, f64::INFINITY);
    let limit = match (&angle, &curvature) {
        (Some(_), Some(_)) => {
            let help = "give both materials a `limit_angle`, or both a curvature or yield stress, of the same kind of behavior; or make them surfaces of their own";
            return Err(vec![Issue::new(first.span, "limits by angle and by layers in one surface", help)]);
        }
        (Some(angle), _) => Limit::Angle(angle),
        (None, Some(curvature)) => Limit::Layers(curvature),
        _ => Limit::None,
    };
    let (mut body, report) = Shell {
        horizon: Horizon::PerPoint(&problem.horizon[range]),
        rigidity: &rigidity,
        membrane: Some(&membrane),
        poisson: match poisson.as_slice() {
            [nu] => Values::One(*nu),
            list => Values::Each(list),
        },
        thickness: thickness.as_deref(),
        influence: influence(&first.influence),
        correction: first.weight_correction,
        interpolation: match first.virtual_points {
            deck::VirtualPoints::Quadratic => Interpolation::Quadratic,
            deck::VirtualPoints::Barycentric => Interpolation::Barycentric,
            deck::VirtualPoints::Nearest => Interpolation::Nearest,
        },
        turn: match first.turn {
            deck::ShellTurn::NormalCurvature => Turn::NormalCurvature,
            deck::ShellTurn::Angle => Turn::Angle,
        },
        limit,
        // of a plastic law alone a limit is asked for
        law: laws[0],
        critical_stretch: stretch.as_deref(),
    }
    .build::<D>(&part.surface, &mirrors(problem))
    .map_err(fault(first.span))?;
    if laws.iter().any(|l| *l != laws[0]) {
        body.set_laws(which.iter().map(|m| laws[*m]).collect()).map_err(fault(first.span))?;
    }
    let mut derived: Vec<Derived> = vec![("bending stiffness D".into(), rigidity[0], "force length")];
    for (what, value) in [
        ("pairs with a virtual point", report.virtual_points),
        ("pairs not made at edges", report.outside),
        ("points of a single line of pairs", report.single_line),
        ("points whose weights could not be corrected", report.uncorrected),
        ("points without a pair", report.without_pairs),
    ] {
        derived.push((what.into(), value as f64, ""));
    }
    if let Some((value, _)) = report.locking {
        derived.push(("largest horizon^2/(radius thickness)".into(), value, ""));
    }
    let mass = merge(masses, 1.0).unwrap_or_else(|| vec![1.0]);
    let breaks = breaks.or_else(|| stretch.is_some().then_some(Brittle { batch: 1.0 }));
    Ok(Made { body, mass, rigidity, breaks, derived, warnings: report.warnings() })
}

/// A straight beam in space.
fn stiffener<const D: usize>(problem: &Problem, part: &Part) -> Checked<Made<D>> {
    let range = part.first..part.first + part.surface.len();
    let (materials, _) = materials_of(problem, &range);
    let Some((name, material)) = materials.first() else { return Err(vec![]) };
    let Model::BondPairBeam(b) = &material.model else {
        let message = format!("`{}` is a line in space, which is for the model `bond_pair_beam`", part.name);
        return Err(vec![Issue::new(name.span, message, "give it a material of its own with `bond_pair_beam: {motion: spatial, …}`")]);
    };
    if materials.len() > 1 || !matches!(b.behavior, PairBehavior::Elastic) || b.shape.is_some() {
        let message = format!("the line `{}` has several materials, a limit, or a shape of its own", part.name);
        return Err(vec![Issue::new(
            b.span,
            message,
            "a line in space is elastic and of one material; its stiffness may vary by expressions",
        )]);
    }
    let spacing = part.surface.spacing[0];
    let horizon = problem.horizon[range.start];
    let count = (horizon / spacing * (1.0 + 1e-9)).floor() as usize;
    let plain = Section::Rectangle { width: 1.0, height: 1.0 };
    let section = b.cross_section.as_ref().map_or(plain, section_of);
    let properties = section.properties(count.max(1)).map_err(fault(b.span))?;
    let arms = properties.arms(match b.weights {
        PairWeights::Layer => Weighting::Layer,
        PairWeights::Uniform => Weighting::Uniform,
        PairWeights::Width => Weighting::Width,
        PairWeights::Thesis => Weighting::Thesis,
    });
    let solid = b.youngs_modulus.as_ref().filter(|_| b.cross_section.is_some()).map(|e| within(e, problem, &range));
    let by = |x: f64| solid.as_ref().map(|e| e.iter().map(|e| e * x).collect::<Vec<f64>>());
    let given = |f: Option<Vec<f64>>, x: f64, key: &str| {
        let unknown = || vec![Issue::new(b.span, format!("`{key}` is not known"), "give it, or `youngs_modulus` and `cross_section`")];
        f.or_else(|| by(x)).ok_or_else(unknown)
    };
    let bending = given(b.bending_stiffness.as_ref().map(|f| within(f, problem, &range)), properties.second_moment, "bending_stiffness")?;
    let axial = given(b.axial_stiffness.as_ref().map(|f| within(f, problem, &range)), properties.area, "axial_stiffness")?;
    let area = if b.cross_section.is_some() { properties.area } else { 1.0 };
    let density = material.density.as_ref().map_or(vec![1.0], |d| within(d, problem, &range));
    // planes across its ends; it may lie in others
    let line = Layout::line(&part.surface.positions).map_err(fault(b.span))?;
    let along = line.rows[0];
    let ends = [&part.surface.positions[0], &part.surface.positions[part.surface.len() - 1]];
    let mirrors: Vec<Mirror> = mirrors(problem)
        .into_iter()
        .filter(|m| {
            let dot = |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|k| a[k] * b[k]).sum::<f64>();
            let across = (dot(&m.normal, &along).abs() - 1.0).abs() < 1e-9;
            across && ends.iter().any(|x| (dot(&m.normal, x) - m.at).abs() <= 0.75 * spacing)
        })
        .collect();
    let layout = line.with_mirrors(&mirrors).map_err(fault(b.span))?;
    let body = Beam {
        bending: &bending,
        axial: Some(&axial),
        arms: &arms,
        limit_curvature: None,
        law: law(&b.behavior, &b.potential),
        kinematics: Kinematics::Small,
        measure: None,
    }
    .build::<D>(layout)
    .map_err(fault(b.span))?;
    let derived: Vec<Derived> =
        vec![("bending stiffness EI".into(), bending[0], "force length^2"), ("arms of a pair".into(), count as f64, "")];
    Ok(Made { body, mass: combine(&density, &[area], |r, a| r * a), rigidity: bending, breaks: None, derived, warnings: vec![] })
}
