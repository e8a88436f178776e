//! Beams, plates and joined shells that cannot be built: what is wrong is told at its place, with a remedy.
use peridyne::deck::Deck;
use peridyne::problem::Problem;
use peridyne::registry::assemble;
use std::path::Path;

/// Message and remedy of the first fault, and what else is told; or the warnings of a body that can be built.
fn told(text: &str) -> Result<Vec<String>, String> {
    let deck = Deck::from_text(text.to_string(), Path::new("deck.yaml"), &[], None).map_err(|e| e.to_string())?;
    let problem = Problem::new(deck).map_err(|e| e.to_string())?;
    assemble(&problem).map(|made| made.warnings).map_err(|e| e.to_string())
}

const CORNER: &str = "title: corner
body:
  dimension: 3
  points:
    - surface: {shape: {panel: {size: [1, 0.4], cells: [10, 4]}}, block: floor}
    - surface: {shape: {panel: {size: [1, 0.4], cells: [10, 4]}}, block: wall, place: {origin: [1, 0, 0], x: [0, 0, 1], y: [0, 1, 0]}}
  horizon: 0.2
  joints:
    - {between: [floor, wall], kind: rigid}
materials:
  plate:
    model: {shell: {bending_stiffness: 1, membrane_stiffness: 3e4, poisson_ratio: 0}}
conditions:
  - clamped: {normal: x, at: 0, name: clamp}
solver:
  statics: {linear: true}
";

#[test]
fn joints_that_cannot_be_made_are_told() {
    assert!(told(CORNER).is_ok());
    for (from, to, wanted) in [
        (
            "between: [floor, wall]",
            "between: [floor, wal]",
            &["joints[0].between[1]", "there is no surface called `wal`", "floor, wall"][..],
        ),
        ("between: [floor, wall]", "between: [floor, floor]", &["a joint of `floor` with itself", "name two parts"]),
        ("between: [floor, wall]", "between: [floor]", &["joints[0].between"]),
        ("kind: rigid", "kind: glued", &["`glued` is not a kind of joint", "`rigid`, `hinge`"]),
        ("origin: [1, 0, 0]", "origin: [1.5, 0, 0]", &["`floor` and `wall` do not touch", "place"]),
        (", block: wall, place", ", place", &["block"]),
        ("block: wall", "block: floor", &["floor"]),
        // one goes on where the other ends, so that there is no angle between them
        ("origin: [1, 0, 0], x: [0, 0, 1]", "origin: [1, 0, 0], x: [1, 0, 0]", &["joints[0]", "straight", "one surface of both parts"]),
    ] {
        assert!(CORNER.contains(from), "{from}");
        let message = told(&CORNER.replace(from, to)).expect_err(to);
        for part in wanted {
            assert!(message.contains(part), "{to}: `{part}` is missing in\n{message}");
        }
    }
    // without any joint nothing holds them together
    let apart = CORNER.replace("  joints:\n    - {between: [floor, wall], kind: rigid}\n", "");
    assert!(told(&apart).is_ok_and(|warnings| {
        ["floor", "wall"].iter().all(|part| warnings.contains(&format!("the surface `{part}` is joined with nothing: it moves by itself")))
    }));
}

const BEAM: &str = "title: beam
body:
  dimension: 1
  points:
    - line: {from: 0, to: 1, spacing: 0.05, placement: edges}
  horizon: 0.15
materials:
  beam:
    density: 1
    model: {bond_pair_beam: {bending_stiffness: 1}}
conditions:
  - clamped: {normal: x, at: 0}
solver:
  vibration: {modes: 2}
";

#[test]
fn horizons_and_densities_of_beams_and_plates_are_checked() {
    assert_eq!(told(BEAM), Ok(vec![]));
    let message = told(&BEAM.replace("    density: 1\n", "")).unwrap_err();
    assert!(message.contains("`density` is missing in material `beam`") && message.contains("vibration"), "{message}");
    let message = told(&BEAM.replace("horizon: 0.15", "horizon: 1.1")).unwrap_err();
    assert!(message.contains("body.horizon") && message.contains("reaches beyond the whole body"), "{message}");
    let warnings = told(&BEAM.replace("horizon: 0.15", "horizon: 0.7")).unwrap();
    assert!(warnings.len() == 1 && warnings[0].contains("longer than half the body"), "{warnings:?}");
    let plate = BEAM
        .replace("dimension: 1", "dimension: 2\n  plane: stress")
        .replace("line: {from: 0, to: 1,", "rectangle: {from: [0, 0], to: [1, 0.3],")
        .replace("bond_pair_beam: {bending_stiffness: 1}", "bond_multiple_plate: {bending_stiffness: 1, poisson_ratio: 0.3}");
    assert_eq!(told(&plate), Ok(vec![]));
    // half of the shorter side counts
    let warnings = told(&plate.replace("horizon: 0.15", "horizon: 0.2")).unwrap();
    assert!(warnings.len() == 1 && warnings[0].contains("longer than half the body"), "{warnings:?}");
    assert!(told(&plate.replace("horizon: 0.15", "horizon: 0.4")).is_err());
}
