//! Checks between sections, once all of them are sound.
use super::decode::{SetName, Text};
use super::report::Issue;
use super::source::Span;
use super::types::*;
use super::{Dictionary, Sections};

/// Notes what does not fit together.
pub(crate) fn check(deck: &Sections, issues: &mut Vec<Issue>) {
    check_sets(deck, issues);
    if deck.materials.is_empty() {
        let span = Span { end: deck.span.start, ..deck.span };
        issues.push(Issue::new(span, "the deck has no material", "add one under `materials:`"));
    }
    if matches!(deck.solver, Solver::VelocityVerlet(_) | Solver::Vibration(_)) {
        for (name, _) in deck.materials.iter().filter(|(_, material)| material.density.is_none()) {
            let message = format!("`density` is missing in material `{}`", name.value);
            issues.push(Issue::new(name.span, message, "dynamics and vibration need it: add `density: 2440 kg/m^3` or the like"));
        }
    }
}

fn block(points: &Points) -> Option<&Text> {
    let lattice = match points {
        Points::Line(shape) => &shape.lattice,
        Points::Rectangle(shape) => &shape.lattice,
        Points::Box(shape) => &shape.lattice,
        Points::Disc(shape) => &shape.lattice,
        Points::Cylinder(shape) => &shape.lattice,
        Points::Sphere(shape) => &shape.lattice,
        Points::File(_) | Points::Surface(_) => return None,
    };
    lattice.block.as_ref()
}

fn check_sets(deck: &Sections, issues: &mut Vec<Issue>) {
    let blocks: Vec<&Text> = deck.body.points.iter().filter_map(block).collect();
    for name in deck.sets.iter().map(|(name, _)| name).chain(blocks.iter().copied()) {
        if name.value == "all" {
            issues.push(Issue::new(name.span, "`all` already names the set of all points", "choose another name"));
        }
    }
    for (name, set) in deck.sets.iter() {
        if blocks.iter().any(|block| block.value == name.value) {
            let message = format!("`{}` already names a block of points", name.value);
            issues.push(Issue::new(name.span, message, "give the set another name"));
        }
        if leads_to(set, &name.value, &deck.sets, &mut Vec::new()) {
            let message = format!("set `{}` is defined by itself", name.value);
            issues.push(Issue::new(name.span, message, "break the circle"));
        }
    }
}

/// Whether following the names in `set` leads to `target`.
fn leads_to<'a>(set: &'a PointSet, target: &str, sets: &'a Dictionary<PointSet>, seen: &mut Vec<&'a str>) -> bool {
    let mut names: Vec<&SetName> = Vec::new();
    set.names(&mut names);
    while let Some(name) = names.pop() {
        if name.value == target {
            return true;
        }
        if !seen.contains(&name.value.as_str()) {
            seen.push(&name.value);
            if let Some(next) = sets.get(&name.value) {
                next.names(&mut names);
            }
        }
    }
    false
}
