//! Faulty decks: every fault at once, with place, key, value and remedy.
use peridyne::deck::*;
use std::path::Path;

fn faults(text: &str) -> DeckErrors {
    Deck::from_text(text.to_string(), Path::new("deck.yaml"), &[], None).map(|_| ()).expect_err("the deck has faults")
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
        assert!(fault.line > 0 && fault.column > 0 && !fault.issue.path.is_empty(), "{fault}");
        assert!(!fault.issue.help.is_empty() || fault.issue.message.contains("must be"), "{fault}");
    }
}

/// One change of a sound deck, and its fault: the text that is marked, the key, and parts of the message.
struct Case(&'static str, &'static str, &'static str, &'static str, &'static [&'static str]);

const SPACING: &str = "body.points[0].rectangle.spacing";
const CASES: &[Case] = &[
    Case("spacing: dx", "spacing: 0", "0", SPACING, &["must be positive", "0"]),
    Case("spacing: dx", "spacing: dz", "dz", SPACING, &["`dz`", "`dx`"]),
    Case("spacing: dx", "spacing: 3 kg", "3 kg", SPACING, &["`3 kg` is a mass", "a length is needed", "`0.5 mm`"]),
    Case("spacing: dx", "spacing: m*x", "x", SPACING, &["`x` cannot be used here", "only parameters"]),
    Case("spacing: dx", "spacing: pull", "pull", SPACING, &["`pull` is a pressure", "a length"]),
    Case("spacing: dx", "spacing: ${dz}", "${dz}", SPACING, &["`${dz}` does not name a parameter", "`dx`"]),
    Case("  plane: stress ", "  plan: stress ", "plan", "body.plan", &["`plan` is not a key", "`plane`"]),
    Case("solver:", "slover:", "slover", "slover", &["`slover` is not a key of a deck", "`solver`"]),
    Case("horizon: m*dx", "horizon: m*dy", "dy", "body.horizon", &["`dy`", "`dx`"]),
    Case("{set: top, y: pull}", "{set: topp, y: pull}", "topp", "conditions[0].traction.set", &["no set `topp`", "`top`"]),
    Case("{set: top, y: pull}", "{set: top, z: pull}", "pull", "conditions[0].traction.z", &["no `z` direction", "2D"]),
    Case("[0.75*L, 0]", "[0.75*L]", "[0.75*L]", "sets.middle.nearest", &["1 coordinates", "dimension 2", "`[x, y]`"]),
    Case(
        "youngs_modulus: 72 GPa",
        "youngs_modulus: 72 GPa\n        bulk_modulus: 1",
        "youngs_modulus",
        "linear_peridynamic_solid",
        &["two elastic constants", "`bulk_modulus`"],
    ),
    Case("  m: 3.015", "  m: 3.015\n  m: 4", "m", "parameters", &["twice"]),
    Case("dimension: 2", "dimension: 2\n  dimension: 3", "dimension", "body", &["twice"]),
    Case("dimension: 2", "dimension: 4", "4", "body.dimension", &["1, 2 or 3"]),
    Case("pull: 14 MPa", "pull: 14 ${m", "14 ${m", "parameters.pull", &["`${` has no `}`"]),
    Case("title: Plate", "title: ${n} Plate", "${n}", "title", &["`${n}`", "`m`"]),
    Case("    density: 2440 kg/m^3\n", "", "glass", "materials.glass", &["`density` is missing", "dynamics"]),
    Case("    end: 20 us\n", "", "step: auto", "solver.velocity_verlet", &["`end` or `steps`"]),
    Case("  top: {layer: {side: top}}", "  top: {not: bottom}\n  bottom: top", "bottom", "sets", &["twice"]),
    Case(
        "  top: {layer: {side: top}}",
        "  top: {not: middle}\n  centre: {any_of: [top, centre]}",
        "centre",
        "sets.centre",
        &["defined by itself"],
    ),
    Case("{side: top}", "{side: upper}", "upper", "sets.top.layer.side", &["is not a side", "`front`"]),
    Case("between: [0, 1]", "value: 0, tolerance: 1e-3", "0", "expect[0].value", &["relative tolerance", "`absolute"]),
];

#[test]
fn single_faults_are_exact() {
    for Case(from, to, mark, path, parts) in CASES {
        let text = starter().replacen(from, to, 1);
        assert_ne!(text, starter(), "{from}");
        let errors = faults(&text);
        let shown = errors.to_string();
        let fault = errors.faults().iter().find(|fault| fault.issue.path.ends_with(path));
        let fault = fault.unwrap_or_else(|| panic!("{to}: no {path} in {shown}"));
        for part in *parts {
            assert!(shown.contains(part), "{to}: no {part} in {shown}");
        }
        let line = text.lines().nth(fault.line - 1).unwrap();
        let marked: String = line.chars().skip(fault.column - 1).collect();
        assert!(marked.starts_with(mark), "{to}: {shown}");
    }
}

#[test]
fn a_faulty_parameter_is_told_once() {
    let errors = faults(&starter().replacen("dx: L/100", "dx: L/1OO", 1));
    assert_eq!(errors.faults().len(), 1, "{errors}");
    assert_eq!(errors.faults()[0].issue.path, "parameters.dx");
}

#[test]
fn unreadable_files_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let missing = Deck::load(&folder.path().join("none.yaml"), &[], None).unwrap_err().to_string();
    assert!(missing.contains("none.yaml: cannot be read") && missing.contains("check the path"), "{missing}");

    let latin = folder.path().join("latin.yaml");
    std::fs::write(&latin, b"title: x\nparameters:\n  a: 3 \xb5m\n").unwrap();
    let error = Deck::load(&latin, &[], None).unwrap_err().to_string();
    assert!(error.contains("not UTF-8") && error.contains("line 3") && error.contains("save the file as UTF-8"), "{error}");

    let directory = Deck::load(folder.path(), &[], None).unwrap_err().to_string();
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
        let first = errors.faults().iter().find(|fault| fault.to_string().contains(part));
        let first = first.unwrap_or_else(|| panic!("{text:?}: {errors}"));
        assert!((first.line as i64 - line).abs() <= 1, "{text:?}: {errors}");
    }
}

#[test]
fn hostile_decks_are_refused_without_harm() {
    let deep = "a: ".to_string() + &"[".repeat(200) + &"]".repeat(200);
    let mut bomb = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n".to_string();
    for level in 1..12 {
        bomb += &format!("a{level}: &a{level} [{}]\n", vec![format!("*a{}", level - 1); 9].join(", "));
    }
    let mut parameters = "parameters:\n  p0: [x, x, x, x, x, x, x, x, x]\n  q0: xxxxxxxxx\n".to_string();
    for level in 1..12 {
        let (p, q) = (format!("${{p{}}}", level - 1), format!("${{q{}}}", level - 1));
        parameters += &format!("  p{level}: [{}]\n  q{level}: \"{}\"\n", vec![p; 9].join(", "), q.repeat(9));
    }
    for text in [
        parameters,
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
        let text: Vec<&str> = lines.iter().enumerate().filter(|(index, _)| *index != skip).map(|(_, line)| *line).collect();
        let _ = Deck::from_text(text.join("\n"), Path::new("deck.yaml"), &[], None).map_err(|errors| errors.to_string());
        let _ = Deck::from_text(lines[..skip].join("\n"), Path::new("deck.yaml"), &[], None).map_err(|errors| errors.to_string());
    }
    for end in (0..FAULTY.len()).step_by(7) {
        let _ = Deck::from_text(FAULTY[..end].into(), Path::new("deck.yaml"), &[], None).map_err(|errors| errors.to_string());
    }
}

#[test]
fn directions_and_breaking_loads_are_checked() {
    let plane = |condition: &str, solver: &str| {
        format!(
            "body:\n  dimension: 2\n  plane: strain\n  points:\n    - rectangle: {{from: [0, 0], to: [5, 5], spacing: 1}}\n  horizon: 3.015\nmaterials:\n  m:\n    model: {{bond_based: {{youngs_modulus: 1}}}}\nconditions:\n  - {condition}\nsolver: {solver}\n"
        )
    };
    for (condition, solver, part) in [
        ("displacement: {set: all, direction: [1, 1, 0]}", "statics", "`direction` has 3 components, but the body has dimension 2"),
        ("displacement: {set: all, direction: [0, 0]}", "statics", "`direction` has no direction"),
        ("displacement: {set: all, direction: [1, 1], x: 0}", "statics", "components along the axes go with no `direction`"),
        ("displacement: {set: all, along: 1}", "statics", "`along` needs a `direction`"),
        ("symmetry: {normal: [1, 1]}", "statics", "needs the `set` of points that lie in it"),
        ("symmetry: {normal: x, set: all}", "statics", "it has no set"),
        ("displacement: {set: all, x: 0}", "{statics: {control: breaking}}", "needs `linear: true`"),
    ] {
        let told = faults(&plane(condition, solver)).to_string();
        assert!(told.contains(part) && told.contains("help: "), "{told}");
    }
}

#[test]
fn later_checks_can_point_into_the_deck() {
    let deck = Deck::from_text(starter().into(), Path::new("deck.yaml"), &[], None).unwrap();
    let issue = Issue::new(deck.body.horizon.span, "the horizon is too small", "take 3 spacings");
    let report = deck.errors(vec![issue]).to_string();
    let line = starter().lines().position(|line| line.starts_with("  horizon:")).unwrap() + 1;
    assert!(report.starts_with(&format!("deck.yaml:{line}:12: body.horizon: the horizon is too small\n")), "{report}");
    assert!(report.contains("   help: take 3 spacings"), "{report}");
}

#[test]
fn a_terminal_renderer_can_show_the_report() {
    let errors = faults("title: x\nbdy: 3\n");
    let mut text = String::new();
    miette::GraphicalReportHandler::new_themed(miette::GraphicalTheme::unicode_nocolor()).render_report(&mut text, &errors).unwrap();
    assert!(text.contains("bdy") && text.contains("body"), "{text}");
}
