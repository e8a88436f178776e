//! The program as a user meets it: help, exit status, messages with their place, files, threads, units.

use assert_cmd::Command;
use std::path::{Path, PathBuf};

fn peridyne() -> Command {
    Command::cargo_bin("peridyne").unwrap()
}

fn write(folder: &Path, name: &str, text: &str) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path
}

const PLATE: &str = "
title: small plate
parameters: {dx: 1 mm, young: 70 GPa}
units: ${units}
body:
  dimension: 2
  plane: strain
  points:
    - rectangle: {from: [0, 0], to: [30*dx, 20*dx], spacing: dx, jitter: {amplitude: 0.1, seed: 3}}
  horizon: 3.015*dx
  cracks:
    - segment: {from: [0, 10*dx], to: [8*dx, 10*dx]}
sets:
  top: {layer: {side: top, count: 3}}
  bottom: {layer: {side: bottom, count: 3}}
materials:
  glass:
    density: 2500 kg/m^3
    model: {correspondence: {law: {saint_venant_kirchhoff: {youngs_modulus: young, poisson_ratio: 0.2}}}}
    damage: {criterion: critical_bond_energy, energy_release_rate: 10 J/m^2}
conditions:
  - velocity: {set: top, name: top, x: 0, y: 4 m/s}
  - velocity: {set: bottom, name: bottom, x: 0, y: -4 m/s}
solver: {velocity_verlet: {steps: 60, step: 50 ns}}
output: {fields: [displacement, velocity, stress, damage], frames: 3}
";

fn plate(folder: &Path, units: &str) -> PathBuf {
    write(folder, &format!("{units}.yaml"), &PLATE.replace("${units}", units))
}

fn table(path: &Path) -> (Vec<String>, Vec<Vec<f64>>) {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let head = lines.next().unwrap().split(',').map(String::from).collect();
    (head, lines.map(|l| l.split(',').map(|x| x.parse().unwrap()).collect()).collect())
}

#[test]
fn words_of_a_deck_are_explained() {
    let said = |word: &str| String::from_utf8(peridyne().args(["explain", word]).assert().success().get_output().stdout.clone()).unwrap();
    let text = said("statics");
    assert!(text.contains("load_steps: Count\n") && text.contains("Number of equal load steps"), "{text}");
    // a key that several sections have
    assert!(said("spacing").matches("    spacing: ").count() > 3);
    let text = String::from_utf8(peridyne().args(["explain", "horizn"]).assert().code(2).get_output().stderr.clone()).unwrap();
    assert!(text.contains("did you mean `horizon`"), "{text}");
}

#[test]
fn help_names_the_commands() {
    let text = String::from_utf8(peridyne().arg("--help").assert().success().get_output().stdout.clone()).unwrap();
    for command in ["run", "check", "verify", "schema", "new", "completions"] {
        assert!(text.contains(command), "{command}");
    }
    peridyne().arg("frobnicate").assert().code(2);
    peridyne().args(["completions", "bash"]).assert().success();
}

#[test]
fn the_starter_deck_checks_and_is_never_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mine.yaml");
    peridyne().arg("new").arg(&path).assert().success();
    peridyne().arg("check").arg(&path).assert().success();
    peridyne().arg("new").arg(&path).assert().code(1);
}

#[test]
fn threads_do_not_change_a_single_bit() {
    let folder = tempfile::tempdir().unwrap();
    let deck = plate(folder.path(), "SI");
    let run = |threads: &str| {
        let out = folder.path().join(format!("out{threads}"));
        peridyne().arg("run").arg(&deck).args(["--threads", threads, "--out"]).arg(&out).assert().success();
        out
    };
    let (one, two) = (run("1"), run("2"));
    for file in ["final.csv", "history.csv"] {
        assert_eq!(std::fs::read(one.join(file)).unwrap(), std::fs::read(two.join(file)).unwrap(), "{file}");
    }
    // the crack grew, so that breaking was part of what was compared
    let (head, rows) = table(&one.join("history.csv"));
    let broken = head.iter().position(|h| h == "damage.broken_bonds").unwrap();
    assert!(rows.last().unwrap()[broken] > 10.0);
    for file in ["fields.vtkhdf", "summary.json"] {
        assert!(one.join(file).exists(), "{file}");
    }
    let (head, rows) = table(&one.join("final.csv"));
    assert_eq!(head[..7], ["id", "x", "y", "z", "ux", "uy", "uz"].map(String::from));
    assert_eq!(rows.len(), 600);
    // the user's ids, in order
    assert!(rows.iter().enumerate().all(|(k, r)| r[0] == k as f64));
}

#[test]
fn the_system_of_units_does_not_change_the_digits() {
    let folder = tempfile::tempdir().unwrap();
    let run = |units: &str| {
        let deck = plate(folder.path(), units);
        let out = folder.path().join(units);
        peridyne().arg("run").arg(&deck).arg("--out").arg(&out).assert().success();
        table(&out.join("final.csv"))
    };
    let ((_, si), (_, mm)) = (run("SI"), run("mm-N-MPa"));
    let largest = si.iter().map(|r| r[5].abs()).fold(0.0, f64::max);
    for (a, b) in si.iter().zip(&mm) {
        for k in 1..6 {
            assert!((a[k] * 1e3 - b[k]).abs() <= 1e-9 * (a[k] * 1e3).abs() + 1e-10 * largest * 1e3, "{k}: {} {}", a[k], b[k]);
        }
        // damage, the last column: the same bonds, so the same sums but for round-off
        assert!((a.last().unwrap() - b.last().unwrap()).abs() < 1e-12);
    }
}

#[test]
fn faults_of_a_deck_are_told_at_once_with_their_places() {
    let folder = tempfile::tempdir().unwrap();
    let text = PLATE
        .replace("${units}", "SI")
        .replace("horizon: 3.015*dx", "horizon: 3.015*dz")
        .replace("poisson_ratio: 0.2", "poisson_ratio: 0.5")
        .replace("set: top, name", "set: tpo, name")
        .replace("young: 70 GPa", "young: 70 GPa, size: 3 mm")
        .replace("2500 kg/m^3", "2500 mm");
    let deck = write(folder.path(), "bad.yaml", &text);
    let output = peridyne().arg("check").arg(&deck).assert().code(2).get_output().stderr.clone();
    let text = String::from_utf8(output).unwrap();
    for part in ["bad.yaml:10:", "dz", "tpo", "top", "2500 mm"] {
        assert!(text.contains(part), "{part} is missing in:\n{text}");
    }
    assert!(!folder.path().join("bad.out").exists(), "nothing is computed or written");
}

#[test]
fn faults_of_the_problem_are_told_too() {
    let folder = tempfile::tempdir().unwrap();
    let base = PLATE.replace("${units}", "SI");
    let cases = [
        (base.replace("horizon: 3.015*dx", "horizon: 0.5*dx"), "below the spacing"),
        (base.replace("layer: {side: top, count: 3}", "where: \"y > 1\""), "has no points"),
        (base.replace("set: bottom, name: bottom", "set: top, name: again"), "prescribed by"),
        (base.replace("poisson_ratio: 0.2", "poisson_ratio: 0.5"), "0.5"),
        (base.replace("- rectangle: {from", "- file: {path: none.csv}\n    - rectangle: {from"), "none.csv"),
        (base.replace("spacing: dx", "spacing: 0.7*dx"), "spacing"),
    ];
    for (text, part) in cases {
        let deck = write(folder.path(), "bad.yaml", &text);
        let output = peridyne().arg("check").arg(&deck).assert().code(2).get_output().stderr.clone();
        let message = String::from_utf8(output).unwrap();
        assert!(message.contains(part) && message.contains("bad.yaml:"), "{part} is missing in:\n{message}");
    }
}

#[test]
fn a_point_file_with_faults_names_lines_and_columns() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "points.csv", "x,y,volume\n0,0,1\n1,nan,1\n2,0,-1\n");
    let text = "
body:
  dimension: 2
  plane: stress
  points:
    - file: {path: points.csv}
  horizon: 3
materials: {a: {model: {bond_based: {youngs_modulus: 1}}}}
solver: {statics: {}}
";
    let deck = write(folder.path(), "deck.yaml", text);
    let message = String::from_utf8(peridyne().arg("check").arg(&deck).assert().code(2).get_output().stderr.clone()).unwrap();
    assert!(message.contains("line 3") && message.contains("line 4") && message.contains("volume"), "{message}");
}

#[test]
fn a_run_that_blows_up_stops_with_point_and_cause_and_keeps_its_files() {
    let folder = tempfile::tempdir().unwrap();
    let text = PLATE.replace("${units}", "SI").replace("step: 50 ns", "step: 5 us").replace("steps: 60", "steps: 2000");
    let deck = write(
        folder.path(),
        "fast.yaml",
        &text.replace("    damage: {criterion: critical_bond_energy, energy_release_rate: 10 J/m^2}\n", ""),
    );
    let out = folder.path().join("out");
    let output = peridyne().arg("run").arg(&deck).arg("--out").arg(&out).assert().code(1).get_output().clone();
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(message.contains("point") && message.contains("time step is too long"), "{message}");
    assert!(table(&out.join("history.csv")).1.len() > 1);
    assert!(std::fs::read_to_string(out.join("summary.json")).unwrap().contains("stopped"));
}

#[test]
fn verify_reports_what_failed_as_json() {
    let folder = tempfile::tempdir().unwrap();
    let text = PLATE.replace("${units}", "SI")
        + "expect:\n  - {quantity: step, value: 60, tolerance: 0, source: the deck}\n  - {quantity: energy.kinetic, value: 1, tolerance: 1e-3, source: wrong on purpose}\n";
    write(folder.path(), "deck.yaml", &text);
    let json = folder.path().join("out.json");
    peridyne().arg("verify").arg(folder.path()).arg("--json").arg(&json).assert().code(1);
    let report: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&json).unwrap()).unwrap();
    let results = report["results"].as_array().unwrap();
    assert_eq!(results.len(), 2);
    for key in ["deck", "run", "quantity", "computed", "reference", "tolerance", "source", "passed"] {
        assert!(results[0].get(key).is_some(), "{key}");
    }
    assert_eq!(results[0]["passed"], true);
    assert_eq!(results[1]["passed"], false);
}
