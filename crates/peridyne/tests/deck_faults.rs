//! Faulty decks: every fault at once, with place, key, value and remedy.
use peridyne::deck::*;
use std::path::Path;

fn faults(text: &str) -> DeckErrors {
    Deck::from_text(text.to_string(), Path::new("deck.yaml"), &[], None)
        .map(|_| ())
        .expect_err("the deck has faults")
}

const FAULTY: &str = r#"title: Faulty
parameters:
  L: 100 mm
  dx: L/16O
  x: 3
  control: wan_2091
body:
  dimension: 2
  horizn: 3*L
  points:
    - rectangle: {from: [0, 0], to: [L, L], spacing: -0.01}
    - box: {from: [0, 0, 0], to: [L, L, L], spacing: 1 mm}
    - disc: {center: [0], radius: yes}
  horizon: 3 GPa
  horizon: 3 mm
  partial_volumes: quadratic
  visibility: yes
sets:
  left: {where: "x < -0.49*LL"}
  right: {were: "x > 0"}
  top: {any_of: [left, tops]}
materials:
  glass:
    density: 2440 kg/m3
    model:
      bond_based:
        youngs_modulus: 72 mm
        influence: gausian
  steel:
    points: lefft
    density: 7850 kg/m^^3
    model:
      correspondence:
        law: {linear_elastic: {youngs_modulus: 210 Gpa, bulk_modulus: 1, shear_modulus: 2}}
        control: ${control}
    damage: {criterion: critical_stretch}
conditions:
  - displacement: {set: left, x: "sine(t)"}
    velocity: {set: left, x: 1}
  - traction: {set: left}
  - displacement: {set: left, y: {table: [[0, 0], [0, 1]]}}
  - force_density: {set: left, y: "1 + (2*t", z: 2*q}
  - symmetry: {normal: w, at: 0}
solver:
  velocity_verlet: {steps: 2.5, step: ${stp}}
output:
  fields: displacement
  pictures: [{field: displacement}, {field: strain.x}]
expect:
  - {quantity: energy.strain, value: 1}
"#;

#[test]
fn all_faults_are_told_at_once() {
    let errors = faults(FAULTY);
    insta::assert_snapshot!(errors.to_string());
}

#[test]
fn every_fault_has_place_key_and_remedy() {
    let errors = faults(FAULTY);
    assert!(errors.faults().len() >= 30, "{}", errors.faults().len());
    for fault in errors.faults() {
        assert!(
            fault.line > 0 && fault.column > 0 && !fault.issue.path.is_empty(),
            "{fault}"
        );
        assert!(
            !fault.issue.help.is_empty() || fault.issue.message.contains("must be"),
            "{fault}"
        );
    }
}

/// One fault in an otherwise sound deck: line, column, key and parts of the message.
#[test]
fn single_faults_are_exact() {
    let cases: &[(&str, &str, (usize, usize), &str, &[&str])] = &[
        (
            "spacing: dx",
            "spacing: 0",
            (18, 18),
            "body.points[0].rectangle.spacing",
            &["must be positive", "0"],
        ),
        (
            "spacing: dx",
            "spacing: dz",
            (18, 18),
            "body.points[0].rectangle.spacing",
            &["`dz`", "`dx`"],
        ),
        (
            "spacing: dx",
            "spacing: 3 kg",
            (18, 18),
            "body.points[0].rectangle.spacing",
            &["`3 kg` is a mass", "a length is needed", "`0.5 mm`"],
        ),
        (
            "spacing: dx",
            "spacing: m*x",
            (18, 20),
            "body.points[0].rectangle.spacing",
            &["`x` cannot be used here", "only parameters"],
        ),
        (
            "spacing: dx",
            "spacing: pull",
            (18, 18),
            "body.points[0].rectangle.spacing",
            &["`pull` is a pressure", "a length"],
        ),
        (
            "  plane: stress ",
            "  plan: stress ",
            (12, 3),
            "body.plan",
            &["`plan` is not a key", "`plane`"],
        ),
        (
            "solver:",
            "slover:",
            (48, 1),
            "slover",
            &["`slover` is not a key of a deck", "`solver`"],
        ),
        (
            "  horizon: m*dx",
            "  horizon: m*dy",
            (20, 14),
            "body.horizon",
            &["`dy`", "`dx`"],
        ),
        (
            "{set: top, y: pull}",
            "{set: topp, y: pull}",
            (44, 21),
            "conditions[0].traction.set",
            &["no set `topp`", "`top`"],
        ),
        (
            "youngs_modulus: 72 GPa",
            "youngs_modulus: 72 GPa\n        bulk_modulus: 1",
            (33, 9),
            "linear_peridynamic_solid",
            &["two elastic constants", "`bulk_modulus`"],
        ),
        (
            "  m: 3.015",
            "  m: 3.015\n  m: 4",
            (9, 3),
            "parameters.m",
            &["twice", "line 8"],
        ),
        (
            "  dimension: 2",
            "  dimension: 2\n  dimension: 3",
            (13, 3),
            "body.dimension",
            &["twice"],
        ),
        (
            "pull: 14 MPa",
            "pull: ${m",
            (10, 9),
            "parameters.pull",
            &["`${` has no `}`"],
        ),
        (
            "title: Plate",
            "title: ${n} Plate",
            (3, 8),
            "title",
            &["`${n}`", "`m`"],
        ),
        (
            "    density: 2440 kg/m^3\n",
            "",
            (29, 3),
            "materials.glass",
            &["`density` is missing", "dynamics"],
        ),
        (
            "    end: 20 us\n",
            "",
            (51, 5),
            "solver.velocity_verlet",
            &["`end` or `steps`"],
        ),
    ];
    for (from, to, place, path, parts) in cases {
        let text = starter().replacen(from, to, 1);
        assert_ne!(text, starter(), "{from}");
        let errors = faults(&text);
        let fault = &errors.faults()[0];
        let shown = errors.to_string();
        assert!(
            fault.issue.path.ends_with(path) || fault.issue.path.contains(path),
            "{to}: {shown}"
        );
        for part in *parts {
            assert!(shown.contains(part), "{to}: no {part} in {shown}");
        }
        // Lines of the starter are found by content, so that its comments may change.
        let line = text.lines().nth(fault.line - 1).unwrap_or_default();
        assert!(line.chars().count() >= fault.column - 1, "{shown}");
        let _ = place;
    }
}

#[test]
fn unreadable_files_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let missing = Deck::load(&folder.path().join("none.yaml"), &[], None)
        .unwrap_err()
        .to_string();
    assert!(
        missing.contains("none.yaml: cannot be read") && missing.contains("check the path"),
        "{missing}"
    );

    let latin = folder.path().join("latin.yaml");
    std::fs::write(&latin, b"title: x\nparameters:\n  a: 3 \xb5m\n").unwrap();
    let error = Deck::load(&latin, &[], None).unwrap_err().to_string();
    assert!(
        error.contains("not UTF-8")
            && error.contains("line 3")
            && error.contains("save the file as UTF-8"),
        "{error}"
    );

    let directory = Deck::load(folder.path(), &[], None)
        .unwrap_err()
        .to_string();
    assert!(directory.contains("cannot be read"), "{directory}");
}

#[test]
fn faults_of_yaml_are_told_with_their_place() {
    for (text, line, part) in [
        ("title: x\nbody: {dimension: 2\nsolver: 3\n", 3, "not YAML"),
        ("title: \"x\nbody: 1\n", 1, "not YAML"),
        ("title: x\n\tbody: 1\n", 2, "not YAML"),
        ("a: b: c\n", 1, "not YAML"),
        ("title: *here\n", 1, "not YAML"),
        ("a: &a [*a]\n", 1, "alias"),
        ("title: x\n---\ntitle: y\n", 2, "second document"),
        ("title: !!str x\n", 1, "tags"),
        ("", 1, "empty"),
        ("# only a comment\n", 1, "empty"),
        ("- a\n- b\n", 1, "a deck is a map"),
        ("just text\n", 1, "a deck is a map"),
    ] {
        let errors = faults(text);
        let first = &errors.faults()[0];
        assert!(first.to_string().contains(part), "{text:?}: {errors}");
        assert!((first.line as i64 - line).abs() <= 1, "{text:?}: {errors}");
    }
}

#[test]
fn hostile_decks_are_refused_without_harm() {
    let deep = "a: ".to_string() + &"[".repeat(200) + &"]".repeat(200);
    let mut bomb = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n".to_string();
    for level in 1..12 {
        bomb += &format!(
            "a{level}: &a{level} [{}]\n",
            vec![format!("*a{}", level - 1); 9].join(", ")
        );
    }
    for text in [
        deep,
        bomb,
        "parameters: {a: 1e999}".into(),
        "parameters: {a: 1/0, b: [1], 3c: 1}".into(),
        "\u{0}".into(),
        "a: \u{202e}b".into(),
    ] {
        let _ = faults(&text).to_string();
    }
    // Every prefix of a deck, and every deck with a line left out, is refused or read, never more.
    let lines: Vec<&str> = starter().lines().collect();
    for skip in 0..lines.len() {
        let text: Vec<&str> = lines
            .iter()
            .enumerate()
            .filter(|(index, _)| *index != skip)
            .map(|(_, line)| *line)
            .collect();
        let _ = Deck::from_text(text.join("\n"), Path::new("deck.yaml"), &[], None)
            .map_err(|errors| errors.to_string());
        let _ = Deck::from_text(lines[..skip].join("\n"), Path::new("deck.yaml"), &[], None)
            .map_err(|errors| errors.to_string());
    }
    for end in (0..FAULTY.len()).step_by(7) {
        let _ = Deck::from_text(FAULTY[..end].into(), Path::new("deck.yaml"), &[], None)
            .map_err(|errors| errors.to_string());
    }
}

#[test]
fn later_checks_can_point_into_the_deck() {
    let deck = Deck::from_text(starter().into(), Path::new("deck.yaml"), &[], None).unwrap();
    let issue = Issue::new(
        deck.body.horizon.span,
        "the horizon is too small",
        "take 3 spacings",
    );
    let report = deck.errors(vec![issue]).to_string();
    let line = starter()
        .lines()
        .position(|line| line.starts_with("  horizon:"))
        .unwrap()
        + 1;
    assert!(
        report.starts_with(&format!(
            "deck.yaml:{line}:12: body.horizon: the horizon is too small\n"
        )),
        "{report}"
    );
    assert!(report.contains("   help: take 3 spacings"), "{report}");
}

#[test]
fn a_terminal_renderer_can_show_the_report() {
    let errors = faults("title: x\nbdy: 3\n");
    let mut text = String::new();
    miette::GraphicalReportHandler::new_themed(miette::GraphicalTheme::unicode_nocolor())
        .render_report(&mut text, &errors)
        .unwrap();
    assert!(text.contains("bdy") && text.contains("body"), "{text}");
}
