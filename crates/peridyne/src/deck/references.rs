//! Checks between sections: names of sets, and what the dimension of space allows.
use super::decode::{Position, Text};
use super::report::{Issue, suggest};
use super::source::Span;
use super::types::*;
use super::{Dictionary, Sections};

/// Notes every reference that leads nowhere.
pub(crate) fn check(deck: &Sections, issues: &mut Vec<Issue>) {
    check_sets(deck, issues);
    check_positions(deck, issues);
    check_components(deck, issues);
    if deck.materials.is_empty() {
        issues.push(Issue::new(
            deck.materials_span(),
            "the deck has no material",
            "add one under `materials:`",
        ));
    }
    if matches!(deck.solver, Solver::VelocityVerlet(_)) {
        for (name, material) in deck
            .materials
            .iter()
            .filter(|(_, material)| material.density.is_none())
        {
            let message = format!("`density` is missing in material `{}`", name.value);
            issues.push(Issue::new(
                name.span,
                message,
                "dynamics need it: add `density: 2440 kg/m^3` or the like",
            ));
            let _ = material;
        }
    }
}

impl Sections {
    fn materials_span(&self) -> Span {
        Span {
            end: self.span.start,
            ..self.span
        }
    }
}

fn lattice(points: &Points) -> Option<&Lattice> {
    match points {
        Points::Line(shape) => Some(&shape.lattice),
        Points::Rectangle(shape) => Some(&shape.lattice),
        Points::Box(shape) => Some(&shape.lattice),
        Points::Disc(shape) => Some(&shape.lattice),
        Points::Cylinder(shape) => Some(&shape.lattice),
        Points::Sphere(shape) => Some(&shape.lattice),
        Points::File(_) => None,
    }
}

fn check_sets(deck: &Sections, issues: &mut Vec<Issue>) {
    let blocks: Vec<&Text> = deck
        .body
        .points
        .iter()
        .filter_map(lattice)
        .filter_map(|lattice| lattice.block.as_ref())
        .collect();
    for (name, _) in deck.sets.iter() {
        if name.value == "all" || blocks.iter().any(|block| block.value == name.value) {
            let what = if name.value == "all" {
                "all points"
            } else {
                "a block of points"
            };
            issues.push(Issue::new(
                name.span,
                format!("`{}` already names {what}", name.value),
                "give the set another name",
            ));
        }
    }
    // A file may bring blocks that are only known once it is read.
    let complete = !deck
        .body
        .points
        .iter()
        .any(|points| matches!(points, Points::File(_)));
    let known: Vec<&str> = ["all"]
        .into_iter()
        .chain(deck.sets.iter().map(|(name, _)| name.value.as_str()))
        .chain(blocks.iter().map(|block| block.value.as_str()))
        .collect();
    let mut references: Vec<&Text> = Vec::new();
    deck.sets
        .iter()
        .for_each(|(_, set)| set.names(&mut references));
    for (_, material) in deck.materials.iter() {
        references.push(&material.points);
        references.extend(
            material
                .damage
                .as_ref()
                .and_then(|damage| damage.no_damage.as_ref()),
        );
    }
    references.extend(deck.conditions.iter().filter_map(Condition::set));
    for expectation in expectations(deck) {
        references.extend(&expectation.over);
        references.extend(expectation.error.as_ref().map(|error| &error.over));
    }
    if complete {
        for name in references
            .into_iter()
            .filter(|name| !known.contains(&name.value.as_str()))
        {
            issues.push(Issue::new(
                name.span,
                format!("there is no set `{}`", name.value),
                suggest(&name.value, known.iter().copied()),
            ));
        }
    }
    for (name, _) in deck.sets.iter() {
        if leads_to(&name.value, &name.value, &deck.sets, &mut Vec::new()) {
            issues.push(Issue::new(
                name.span,
                format!("set `{}` is defined by itself", name.value),
                "break the circle",
            ));
        }
    }
}

fn leads_to<'a>(
    from: &str,
    to: &str,
    sets: &'a Dictionary<PointSet>,
    seen: &mut Vec<&'a str>,
) -> bool {
    let mut names = Vec::new();
    if let Some(set) = sets.get(from) {
        set.names(&mut names);
    }
    names.into_iter().any(|name| {
        if name.value == to {
            return true;
        }
        if seen.contains(&name.value.as_str()) {
            return false;
        }
        seen.push(&name.value);
        leads_to(&name.value, to, sets, seen)
    })
}

fn expectations(deck: &Sections) -> impl Iterator<Item = &Expectation> {
    deck.expect
        .iter()
        .chain(deck.runs.iter().flat_map(|(_, run)| &run.expect))
}

fn check_positions(deck: &Sections, issues: &mut Vec<Issue>) {
    let mut positions: Vec<&Position> = Vec::new();
    let mut bounds: Vec<&Bounds> = Vec::new();
    for lattice in deck.body.points.iter().filter_map(lattice) {
        for region in lattice.minus.iter().chain(&lattice.only) {
            match region {
                Region::Shape(Shape::Box(shape)) => bounds.push(shape),
                Region::Shape(Shape::Disc(ball)) => positions.push(&ball.center),
                _ => {}
            }
        }
    }
    deck.sets
        .iter()
        .for_each(|(_, set)| positions_of(set, &mut positions, &mut bounds));
    positions.extend(bounds.iter().flat_map(|bounds| [&bounds.from, &bounds.to]));
    for expectation in expectations(deck) {
        if let Some(At::Position(position)) = &expectation.at {
            positions.push(position);
        }
    }
    positions.extend(
        deck.output
            .plots
            .iter()
            .filter_map(|plot| plot.along.as_ref())
            .flat_map(|line| [&line.from, &line.to]),
    );
    let dimension = deck.body.dimensions();
    for position in positions
        .into_iter()
        .filter(|position| position.coordinates.len() != dimension)
    {
        let message = format!(
            "the position has {} coordinates, but the body has dimension {dimension}",
            position.coordinates.len()
        );
        issues.push(Issue::new(
            position.span,
            message,
            format!(
                "write `[{}]`",
                ["x", "x, y", "x, y, z"][dimension.clamp(1, 3) - 1]
            ),
        ));
    }
    for bounds in bounds {
        for (low, high) in bounds
            .from
            .coordinates
            .iter()
            .zip(&bounds.to.coordinates)
            .filter(|(low, high)| low.value > high.value)
        {
            let message = format!(
                "`to` must not be below `from`, but {} is below {}",
                high.value, low.value
            );
            issues.push(Issue::new(
                high.span,
                message,
                "exchange the two, or correct one",
            ));
        }
    }
}

fn positions_of<'a>(
    set: &'a PointSet,
    positions: &mut Vec<&'a Position>,
    bounds: &mut Vec<&'a Bounds>,
) {
    let PointSet::Rule(rule) = set else { return };
    match rule {
        SetRule::Box(shape) => bounds.push(shape),
        SetRule::Disc(ball) => positions.push(&ball.center),
        SetRule::Nearest(position) => positions.push(position),
        SetRule::AllOf(parts) | SetRule::AnyOf(parts) => parts
            .iter()
            .for_each(|part| positions_of(part, positions, bounds)),
        SetRule::Not(part) => positions_of(part, positions, bounds),
        _ => {}
    }
}

fn check_components(deck: &Sections, issues: &mut Vec<Issue>) {
    let dimension = deck.body.dimensions();
    for condition in &deck.conditions {
        let axis = match condition {
            Condition::Symmetry(plane) => Some((plane.normal.index(), plane.normal.span)),
            _ => None,
        };
        let components = condition.components();
        let given = components
            .iter()
            .enumerate()
            .filter_map(|(axis, span)| span.map(|span| (axis, span)))
            .chain(axis);
        for (axis, span) in given.filter(|(axis, _)| *axis >= dimension) {
            let name = ["x", "y", "z"][axis];
            issues.push(Issue::new(
                span,
                format!("there is no `{name}` direction in a {dimension}D body"),
                "remove it",
            ));
        }
        if let Condition::RigidWall(wall) = condition
            && wall.normal.len() != dimension
        {
            let message = format!(
                "`normal` and `at` have {} components, but the body has dimension {dimension}",
                wall.normal.len()
            );
            issues.push(Issue::new(
                wall.span,
                message,
                "give as many as the body has dimensions",
            ));
        }
    }
}
