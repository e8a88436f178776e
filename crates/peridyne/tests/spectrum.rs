//! `peridyne spectrum`, the solver of that name, and the quick look of `check`, as a user meets them.

use assert_cmd::Command;
use std::path::{Path, PathBuf};

fn peridyne() -> Command {
    Command::cargo_bin("peridyne").unwrap()
}

fn write(folder: &Path, text: &str) -> PathBuf {
    let path = folder.join("deck.yaml");
    std::fs::write(&path, text).unwrap();
    path
}

/// Standard output and error of a command that ends with a status.
fn told(command: &str, deck: &Path, more: &[&str], status: i32) -> (String, String) {
    let output = peridyne().arg(command).arg(deck).args(more).assert().code(status).get_output().clone();
    (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap())
}

fn table(path: &Path) -> (Vec<String>, Vec<Vec<f64>>) {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let head = lines.next().unwrap().split(',').map(String::from).collect();
    (head, lines.map(|l| l.split(',').map(|x| x.parse().unwrap()).collect()).collect())
}

const PLATE: &str = "
title: plate
parameters: {control: none, jitter: 0}
body:
  dimension: 2
  plane: strain
  points:
    - rectangle: {from: [0, 0], to: [12 mm, 8 mm], spacing: 1 mm, jitter: {amplitude: jitter, seed: 5}}
  horizon: 3.015 mm
sets:
  left: {layer: {side: left}}
materials:
  glass:
    density: 2500 kg/m^3
    model: {correspondence: {law: {linear_elastic: {youngs_modulus: 72 GPa, poisson_ratio: 0.2}}, control: '${control}'}}
conditions:
  - displacement: {set: left, name: clamp, x: 0, y: 0}
solver: {statics: {}}
";

#[test]
fn any_deck_has_a_spectrum() {
    let folder = tempfile::tempdir().unwrap();
    let deck = write(folder.path(), PLATE);
    let out = folder.path().join("none");
    let (text, _) = told("spectrum", &deck, &["--out", out.to_str().unwrap()], 0);
    assert!(text.contains("glass: 6 zero-energy modes"), "{text}");
    assert!(text.contains("6 lowest modes, 0 of them without energy"), "the clamp holds the body:\n{text}");
    for file in ["spectrum.csv", "dispersion.png", "group_velocity.png", "modes.csv", "modes.vtkhdf"] {
        assert!(out.join(file).exists(), "{file}");
    }
    let (head, rows) = table(&out.join("spectrum.csv"));
    assert_eq!(head[..5], ["distance", "kx", "ky", "stiffness.1", "ratio.1"].map(String::from));
    // Γ-X-M-Γ: three legs of 60 without the two visits to Γ
    assert_eq!(rows.len(), 179);
    // waves of k delta = 0.16 travel as in the solid but for some (k delta)²/10: shear and pressure waves of E = 72 GPa, ν = 0.2, ρ = 2500
    let column = |name: &str| head.iter().position(|h| h == name).unwrap();
    for (mode, modulus) in [(1, 30e9), (2, 80e9)] {
        let (local, phase) = (rows[0][column(&format!("local_velocity.{mode}"))], rows[0][column(&format!("phase_velocity.{mode}"))]);
        assert!(
            (local / f64::sqrt(modulus / 2500.0) - 1.0).abs() < 1e-12 && (1e-3..4e-3).contains(&(1.0 - phase / local)),
            "{local} {phase}"
        );
    }
    let out = folder.path().join("wan");
    let (text, _) = told("spectrum", &deck, &["--set", "control=wan_2019", "--out", out.to_str().unwrap()], 0);
    assert!(text.contains("glass: stable"), "{text}");
}

#[test]
fn an_irregular_body_has_modes_but_no_plane_waves() {
    let folder = tempfile::tempdir().unwrap();
    let deck = write(folder.path(), PLATE);
    let out = folder.path().join("out");
    let (text, notes) = told("spectrum", &deck, &["--set", "jitter=0.2", "--set", "control=wan_2019", "--out", out.to_str().unwrap()], 0);
    assert!(notes.contains("96 of 96 points lie off the lattice") && notes.contains("no Bloch symbol"), "{notes}");
    assert!(text.contains("6 lowest modes") && !out.join("spectrum.csv").exists() && out.join("modes.csv").exists(), "{text}");
    assert!(told("check", &deck, &["--set", "jitter=0.2"], 0).0.contains("no lattice"));
}

#[test]
fn check_warns_of_zero_energy_modes() {
    let folder = tempfile::tempdir().unwrap();
    let deck = write(folder.path(), PLATE);
    let (text, _) = told("check", &deck, &[], 0);
    assert!(text.contains("warning: material `glass`: 6 zero-energy modes") && text.contains("wavelength 2.0000 spacings"), "{text}");
    let (text, _) = told("check", &deck, &["--set", "control=wan_2019"], 0);
    assert!(!text.contains("warning") && text.contains("every wave costs energy"), "{text}");
}

const BAR: &str = "
body:
  dimension: 1
  points:
    - line: {from: 0, to: 40, spacing: 1, block: bar}
  horizon: 1.1
sets:
  ends: {any_of: [{layer: {side: left}}, {layer: {side: right}}]}
  first: {where: 'x < 20'}
  rest: {not: first}
materials: ${materials}
conditions:
  - displacement: {set: ends, name: ends, x: 0}
solver: ${solver}
expect:
${expect}
";

fn bar(folder: &Path, materials: &str, solver: &str, expect: &[(&str, f64, f64)]) -> PathBuf {
    let lines: Vec<String> =
        expect.iter().map(|(q, v, a)| format!("  - {{quantity: {q}, value: {v:?}, absolute: {a:?}, source: closed form}}")).collect();
    let text = BAR.replace("${materials}", materials).replace("${solver}", solver).replace("${expect}", &lines.join("\n"));
    write(folder, &text)
}

/// A chain between walls: ω_j = 2 √(κ/m) sin(jπ/2(N + 1)), κ = 2E/δ² (continuum calibration); and its waves, ω = 2 √(κ/m) sin(k/2).
#[test]
fn a_chain_in_closed_form() {
    let folder = tempfile::tempdir().unwrap();
    let materials = "{chain: {density: 3, model: {bond_based: {youngs_modulus: 2, calibration: continuum}}}}";
    let kappa = 2.0 * 2.0 / 1.21;
    let omega = |s: f64| 2.0 * f64::sqrt(kappa / 3.0) * s.sin();
    let mode = |j: usize| omega(j as f64 * std::f64::consts::PI / 78.0);
    let quarter = std::f64::consts::PI / 4.0;
    let expect = [
        ("mode.1.eigenvalue", mode(1).powi(2), 1e-10),
        ("mode.3.frequency", mode(3) / (2.0 * std::f64::consts::PI), 1e-10),
        ("mode.zero", 0.0, 0.0),
        ("spectrum.wave.half.frequency.1", omega(quarter), 1e-13),
        ("spectrum.wave.half.group_velocity.1", f64::sqrt(kappa / 3.0) * f64::cos(quarter), 1e-12),
        ("spectrum.wave.half.local_velocity.1", f64::sqrt(kappa / 3.0), 1e-12),
        ("spectrum.chain.zero_modes", 0.0, 0.0),
        ("spectrum.smallest", 4.0 / std::f64::consts::PI.powi(2), 1e-12),
    ];
    let deck = bar(folder.path(), materials, "{spectrum: {modes: 3, waves: {half: 0.5}}}", &expect);
    let out = folder.path().join("out");
    let (text, _) = told("run", &deck, &["--out", out.to_str().unwrap()], 0);
    assert!(text.contains("chain: stable") && !text.contains("FAILED"), "{text}");
    assert!(out.join("dispersion.png").exists() && out.join("summary.json").exists());
    told("verify", &deck, &[], 0);
}

/// Constants that vary are taken at a place; several materials have a spectrum each; a stretch changes a nonlinear law's stiffness.
#[test]
fn places_materials_and_stretches() {
    let folder = tempfile::tempdir().unwrap();
    let model = |law: &str, e: &str| {
        format!("model: {{correspondence: {{law: {{{law}: {{youngs_modulus: {e}, poisson_ratio: 0}}}}, control: none}}}}")
    };
    // nearest neighbours: λ = E sin² k, and at k = π/2 just E
    let one = format!("{{a: {{{}}}}}", model("linear_elastic", "1 + x/10"));
    let wave = "spectrum.wave.half.stiffness.1";
    let deck = bar(folder.path(), &one, "{spectrum: {modes: 0, waves: {half: 0.5}, at: 4}}", &[(wave, 1.4, 1e-13)]);
    told("verify", &deck, &[], 0);
    // the middle of the body otherwise: the point at 19.5
    let deck = bar(folder.path(), &one, "{spectrum: {modes: 0, waves: {half: 0.5}}}", &[(wave, 2.95, 1e-13)]);
    told("verify", &deck, &[], 0);
    let two = format!(
        "{{a: {{points: first, {}}}, b: {{points: rest, {}}}}}",
        model("linear_elastic", "1"),
        model("saint_venant_kirchhoff", "3")
    );
    // P = E (F³ − F)/2
    let stretched = 3.0 * 0.5 * (3.0 * 1.1f64.powi(2) - 1.0);
    let expect = [
        ("spectrum.a.wave.half.stiffness.1", 1.0, 1e-13),
        ("spectrum.b.wave.half.stiffness.1", stretched, 1e-12),
        ("spectrum.b.zero_modes", 1.0, 0.0),
    ];
    let deck = bar(folder.path(), &two, "{spectrum: {modes: 0, waves: {half: 0.5}, stretch: 1.1}}", &expect);
    let out = folder.path().join("out");
    told("run", &deck, &["--out", out.to_str().unwrap()], 0);
    assert!(out.join("spectrum.a.csv").exists() && out.join("dispersion.b.png").exists());
}

#[test]
fn threads_do_not_change_a_bit() {
    let folder = tempfile::tempdir().unwrap();
    let deck = write(folder.path(), PLATE);
    let [one, two] = ["1", "2"].map(|threads| {
        let out = folder.path().join(threads);
        told("spectrum", &deck, &["--threads", threads, "--out", out.to_str().unwrap()], 0);
        std::fs::read(out.join("spectrum.csv")).unwrap()
    });
    assert_eq!(one, two);
}

#[test]
fn faults_are_told_with_their_places() {
    let folder = tempfile::tempdir().unwrap();
    let spectrum = "{spectrum: {path: [gamma, m], waves: {none: 0, 'a b': [1, 0]}, stretch: [1.1, 1], threshold: 0, modes: -1, at: [1, 2],
  imposed: {wave_numbers: [1], length: 1, along: y}}}";
    let deck = bar(folder.path(), "{a: {model: {bond_based: {youngs_modulus: 1}}}}", spectrum, &[("spectrum.smallest", 1.0, 1.0)]);
    let (_, message) = told("check", &deck, &[], 2);
    for part in [
        "`m` does not exist in 1 dimensions",
        "the wave vector has 2 components",
        "does not fit a body of dimension 1",
        "must be positive",
        "the position has 2 coordinates",
        "a whole number is needed",
    ] {
        assert!(message.contains(part), "{part} is missing in:\n{message}");
    }
    let spectrum = "{spectrum: {grid: 15, waves: {none: 0, 'a b': 1}, path: [gamma], imposed: {wave_numbers: [1], length: 1, along: y}}}";
    let deck = bar(folder.path(), "{a: {model: {bond_based: {youngs_modulus: 1}}}}", spectrum, &[("spectrum.smallest", 1.0, 1.0)]);
    let (_, message) = told("check", &deck, &[], 2);
    for part in
        ["a rigid translation", "`a b` cannot be part", "two corners or more", "has no axis y", "a grid of 15 misses the corners", "16"]
    {
        assert!(message.contains(part), "{part} is missing in:\n{message}");
    }
    let deck = bar(
        folder.path(),
        "{a: {model: {bond_based: {youngs_modulus: 1}}}}",
        "{spectrum: {stretch: -1}}",
        &[("spectrum.smallest", 1.0, 1.0)],
    );
    assert!(told("check", &deck, &[], 2).1.contains("inside out"));
    // more modes than dofs are as many as there are; a quantity that does not exist is told with the nearest that does
    let deck = bar(
        folder.path(),
        "{a: {model: {bond_based: {youngs_modulus: 1}}}}",
        "{spectrum: {modes: 1000}}",
        &[("spectrum.zero_mode", 0.0, 0.0)],
    );
    let (text, _) = told("verify", &deck, &[], 1);
    assert!(text.contains("did you mean `spectrum.zero_modes`"), "{text}");
}
