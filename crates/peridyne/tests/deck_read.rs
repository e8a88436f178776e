//! Sound decks: what their values become.
use peridyne::deck::*;
use std::path::Path;

fn read(text: &str, overrides: &[(&str, &str)], run: Option<&str>) -> Result<Deck, DeckErrors> {
    let overrides: Vec<(String, String)> = overrides.iter().map(|(name, value)| (name.to_string(), value.to_string())).collect();
    Deck::from_text(text.to_string(), Path::new("decks/test/deck.yaml"), &overrides, run)
}

fn sound(text: &str, overrides: &[(&str, &str)], run: Option<&str>) -> Deck {
    read(text, overrides, run).unwrap_or_else(|errors| panic!("{errors}"))
}

const BAR: &str = r#"
title: Bar with m = ${m}
units: ${system}
parameters:
  system: SI
  L: 1.6 m
  n: 160
  dx: L/n
  m: 3
  delta: m*dx
  E: 72 GPa
  control: wan_2019
runs:
  coarse: {set: {n: 80, m: 4}, expect: [{quantity: energy.strain, value: 2, tolerance: 0.1}]}
  millimetres: {set: {system: mm-N-MPa}}
  silling: {set: {control: {silling_2017: {strength: 0.5}}}, slow: true}
body:
  dimension: 1
  area: 4 mm^2
  points: [{line: {from: -L/2, to: L/2, spacing: dx, block: bar}}]
  horizon: delta
sets:
  left: {where: "x < -0.49*L"}
  ends: {any_of: [left, {layer: {side: right, count: 2}}, {nearest: 0.25*L}, {ids: [1, 2, 3]}]}
materials:
  steel:
    density: 7850 kg/m^3
    model: {correspondence: {law: {linear_elastic: {youngs_modulus: "E*(1 + 0.5*x/L)", poisson_ratio: 0}}, control: ${control}}}
conditions:
  - displacement: {set: left, name: grip, x: 0}
  - displacement: {set: bar, x: {table: [[0, 0], [1 ms, 2 mm]]}}
  - velocity: {set: ends, x: "20*sin(2*pi*t) if x > 0 else 0"}
solver: {statics: {end: 1, tolerance: 1e-8}}
expect:
  - {quantity: reaction.grip.x, value: 1656.40, tolerance: 5e-6, source: text}
  - {field: displacement.x, at: [0.5*L], value: 1 mm, absolute: 1e-3 um}
  - {error: {field: displacement.x, against: "1e-3*x"}, value: 0, absolute: 1e-12}
"#;

#[test]
fn the_starter_is_a_sound_deck() {
    let deck = sound(starter(), &[], None);
    assert_eq!(deck.body.dimensions(), 2);
    let again = sound(&deck.resolved().to_string(), &[], None);
    assert_eq!(deck.resolved(), again.resolved());
}

#[test]
fn the_committed_schema_is_current() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../deck.schema.json");
    if std::env::var_os("PERIDYNE_WRITE_SCHEMA").is_some() {
        std::fs::write(&path, schema()).unwrap();
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(committed == schema(), "deck.schema.json is old: run this test with PERIDYNE_WRITE_SCHEMA=1");
}

#[test]
fn the_committed_reference_is_current_and_complete() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../DECK.md");
    let page = peridyne::deck::reference_page();
    if std::env::var_os("PERIDYNE_WRITE_SCHEMA").is_some() {
        std::fs::write(&path, &page).unwrap();
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(committed == page, "DECK.md is old: run this test with PERIDYNE_WRITE_SCHEMA=1");
    // every definition of the schema has a section, every section says what it is, and every link leads somewhere
    let schema: serde_json::Value = serde_json::from_str(&schema()).unwrap();
    for name in schema["$defs"].as_object().unwrap().keys() {
        let (_, section) = page.split_once(&format!("\n## {name}\n\n")).unwrap_or_else(|| panic!("{name} has no section"));
        assert!(section.starts_with(|c: char| !c.is_whitespace() && c != '|' && c != '#'), "{name} says nothing");
    }
    for link in page.split("](#").skip(1).map(|s| s.split(')').next().unwrap()) {
        assert!(page.lines().any(|l| l.strip_prefix("## ").is_some_and(|h| h.to_lowercase() == link)), "#{link} leads nowhere");
    }
}

#[test]
fn values_are_read_in_si() {
    let deck = sound(BAR, &[], None);
    assert_eq!(deck.title.value, "Bar with m = 3");
    let numbers: Vec<(&str, f64)> = deck.parameters.numbers().collect();
    assert_eq!(numbers, [("L", 1.6), ("n", 160.0), ("dx", 0.01), ("m", 3.0), ("delta", 0.03), ("E", 72e9)]);
    assert_eq!(deck.body.area.unwrap().value, 4e-6);
    assert_eq!(deck.body.horizon.constant(), Some(0.03));
    let Points::Line(line) = &deck.body.points[0] else { panic!() };
    assert_eq!((line.from.value, line.lattice.spacing.value), (-0.8, 0.01));
    let Model::Correspondence(model) = &deck.materials.get("steel").unwrap().model else { panic!() };
    assert!(model.control.as_ref().is_some_and(|c| matches!(c.value, Control::Wan2019)));
    let Law::LinearElastic(law) = &model.law else { panic!() };
    let modulus = law.youngs_modulus.as_ref().unwrap();
    assert_eq!(modulus.constant(), None);
    assert_eq!(modulus.eval([0.8, 0.0, 0.0], 0.0), 90e9);
    let Condition::Displacement(ramp) = &deck.conditions[1] else { panic!() };
    let ramp = ramp.x.as_ref().unwrap();
    for (t, u) in [(0.0, 0.0), (0.25e-3, 0.5e-3), (1.0, 2e-3)] {
        assert!((ramp.eval([0.0; 3], t) - u).abs() < 1e-18);
    }
    assert_eq!(deck.conditions[0].label(), "grip");
    assert_eq!(deck.conditions[1].label(), "displacement_bar");
    let Solver::Statics(statics) = &deck.solver else { panic!() };
    assert_eq!((statics.tolerance.value, statics.max_iterations.value), (1e-8, 30));
    assert_eq!(deck.expectations().count(), 3);
    assert!(matches!(deck.expect[1].measured(), Some(Measured::FieldAt(..))));
    assert_eq!(deck.resolve("points.csv"), Path::new("decks/test/points.csv"));
}

#[test]
fn runs_and_overrides_replace_parameters() {
    let coarse = sound(BAR, &[], Some("coarse"));
    assert_eq!(coarse.title.value, "Bar with m = 4");
    assert_eq!(coarse.body.horizon.constant(), Some(4.0 * (1.6 / 80.0)));
    assert_eq!(coarse.expectations().count(), 4);
    assert!(!coarse.is_slow());

    let own = sound(BAR, &[("m", "5"), ("L", "800 mm")], Some("coarse"));
    assert_eq!(own.body.horizon.constant(), Some(5.0 * (0.8 / 80.0)));

    let silling = sound(BAR, &[], Some("silling"));
    assert!(silling.is_slow());
    let Model::Correspondence(model) = &silling.materials.get("steel").unwrap().model else { panic!() };
    assert!(matches!(model.control.as_ref().map(|c| &c.value), Some(Control::Silling2017(control)) if control.strength.value == 0.5));

    let text = sound(BAR, &[("control", "{silling_2017: {strength: 0.25}}")], None);
    let Model::Correspondence(model) = &text.materials.get("steel").unwrap().model else { panic!() };
    assert!(matches!(model.control.as_ref().map(|c| &c.value), Some(Control::Silling2017(control)) if control.strength.value == 0.25));

    let typo = read(BAR, &[("mm", "5")], None).unwrap_err().to_string();
    assert!(typo.contains("no parameter `mm`") && typo.contains("`m`"), "{typo}");
    let typo = read(BAR, &[], Some("corse")).unwrap_err().to_string();
    assert!(typo.contains("no run `corse`") && typo.contains("`coarse`"), "{typo}");
    let wrong = read(BAR, &[("m", "5*q")], None).unwrap_err().to_string();
    assert!(wrong.contains("--set m:1:3") && wrong.contains("`q` is neither"), "{wrong}");
}

#[test]
fn runs_are_listed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("deck.yaml");
    std::fs::write(&path, BAR).unwrap();
    let runs = Deck::runs(&path).unwrap();
    let names: Vec<(&str, bool)> = runs.iter().map(|run| (run.name.as_str(), run.slow)).collect();
    assert_eq!(names, [("coarse", false), ("millimetres", false), ("silling", true)]);
    assert_eq!(Deck::load(&path, &[], Some("coarse")).unwrap().run, "coarse");
    std::fs::write(&path, starter()).unwrap();
    let runs = Deck::runs(&path).unwrap();
    assert_eq!(runs, [RunName { name: "default".into(), slow: false }]);
    assert!(Deck::load(&path, &[], Some("default")).is_ok());
}

#[test]
fn units_of_the_deck_are_chosen() {
    let deck = sound(BAR, &[], Some("millimetres"));
    assert_eq!(deck.body.horizon.constant(), Some(3.0 * (1600.0 / 160.0)));
    assert_eq!(deck.body.area.unwrap().value, 4.0);
    let steel = deck.materials.get("steel").unwrap();
    assert_eq!(steel.density.as_ref().unwrap().constant(), Some(7.85e-9));
    let numbers: Vec<(&str, f64)> = deck.parameters.numbers().collect();
    assert!(numbers.contains(&("E", 72000.0)) && numbers.contains(&("L", 1600.0)));
    let own = BAR.replace("units: ${system}", "units: {length: cm, time: ms}");
    let deck = sound(&own, &[], None);
    assert_eq!(deck.body.area.unwrap().value, 0.04);
    assert_eq!(deck.units.symbols(), ["kg", "cm", "ms", "K"]);
    // 72 GPa = 72e9 kg/(m s^2) = 72e9 / 100 / 1e6 kg/(cm ms^2).
    assert!(deck.parameters.numbers().any(|number| number == ("E", 720.0)));
}

#[test]
fn a_resolved_deck_is_a_deck() {
    for run in [None, Some("coarse"), Some("millimetres"), Some("silling")] {
        let deck = sound(BAR, &[], run);
        let again = sound(&deck.resolved().to_string(), &[], None);
        assert_eq!(deck.resolved(), again.resolved());
        assert_eq!(again.body.horizon.constant(), deck.body.horizon.constant());
    }
    let resolved = sound(BAR, &[], None).resolved();
    assert_eq!(resolved["output"]["fields"], serde_json::json!(["displacement", "damage"]));
    assert_eq!(resolved["body"]["partial_volumes"], "none");
    assert_eq!(resolved["solver"]["statics"]["method"], "auto");
}

#[test]
fn units_agree_with_nist() {
    // NIST SP 811 (2008), appendix B.8; exact conversions of the SI brochure.
    let si = UnitSystem::si();
    for (number, unit, expected, relative) in [
        (1.0, "psi", 6.894757e3, 5e-8),
        (1.0, "ksi", 6.894757e6, 5e-8),
        (1.0, "lbf", 4.448222, 1e-7),
        (1.0, "kip", 4.448222e3, 1e-7),
        (1.0, "lb", 4.535924e-1, 1e-7),
        (1.0, "slug", 1.459390e1, 3e-7),
        (1.0, "ft", 0.3048, 0.0),
        (1.0, "in", 0.0254, 0.0),
        (1.0, "mil", 2.54e-5, 0.0),
        (1.0, "lbf/in", 1.751268e2, 3e-7),
        (1.0, "lbf/in^2", 6.894757e3, 5e-8),
        (1.0, "lb/ft^3", 1.601846e1, 3e-7),
        (1.0, "ft/min", 5.08e-3, 1e-15),
        (1.0, "km/h", 1.0 / 3.6, 1e-15),
        (1.0, "kgf/cm^2", 9.80665e4, 1e-15),
        (1.0, "atm", 1.01325e5, 0.0),
        (1.0, "bar", 1e5, 0.0),
        (1.0, "erg", 1e-7, 0.0),
        (1.0, "dyn/cm", 1e-3, 1e-15),
        (180.0, "deg", std::f64::consts::PI, 1e-15),
        (1.0, "ksi*in^0.5", 1.098843e6, 5e-7),
        (72.0, "GPa", 72e9, 0.0),
        (0.5, "mm", 0.5e-3, 0.0),
        (3.0, "mm", 0.003, 0.0),
        (7.0, "um", 7e-6, 0.0),
        (3.8, "J/m^2", 3.8, 0.0),
        (3.8, "N/mm", 3800.0, 1e-15),
        (2.44, "g/cm³", 2440.0, 1e-15),
        (2440.0, "kg/m3", 2440.0, 0.0),
        (1.0, "MPa*m^0.5", 1e6, 0.0),
        (1.0, "MPa*mm^(1/2)", 1e6 * 0.001f64.sqrt(), 1e-15),
        (1.0, "N mm", 1e-3, 0.0),
        (12.0, "um/(m*K)", 12e-6, 1e-15),
        (12.0, "1/K", 12.0, 0.0),
        (2.0, "%", 0.02, 0.0),
        (20.0, "degC", 293.15, 0.0),
        (1.0, "kW*h", 3.6e6, 1e-15),
    ] {
        let parsed: Unit = unit.parse().unwrap_or_else(|error| panic!("{unit}: {error}"));
        let value = si.convert(number, &parsed);
        assert!((value - expected).abs() <= relative * expected.abs(), "{number} {unit} = {value}, not {expected}");
    }
    let mm = UnitSystem::mm_n_mpa();
    for (number, unit, expected) in [
        (72.0, "GPa", 72000.0),
        (0.1, "mm", 0.1),
        (1.0, "N", 1.0),
        (3.8, "J/m^2", 3.8e-3),
        (2440.0, "kg/m^3", 2.44e-9),
        (20.0, "m/s", 20000.0),
        (20.0, "degC", 293.15),
        (1.0, "MPa*mm^0.5", 1.0),
    ] {
        assert_eq!(mm.convert(number, &unit.parse().unwrap()), expected, "{number} {unit}");
    }
    for (unit, part) in [
        ("gpa", "`GPa`"),
        ("Mpa", "`MPa`"),
        ("metre", ""),
        ("kg/", ""),
        ("m^x", ""),
        ("(m", ""),
        ("m)", ""),
        ("K/degC", ""),
        ("m^0.37", ""),
    ] {
        let error = unit.parse::<Unit>().unwrap_err();
        assert!(error.help.contains(part), "{unit}: {error:?}");
    }
    assert_eq!(mm.in_si(Dimension::new(0, 1, 0, 0)), 1e-3);
}
