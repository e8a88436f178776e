//! Studies and their figures: how lists become combinations, what is refused, and a small study from deck to pictures.

use assert_cmd::Command;
use peridyne::deck::*;
use std::path::{Path, PathBuf};

/// A bar whose displacement is known: linear elastic, pulled by its ends, so that u = e x with e = pull/L.
const BAR: &str = r#"
title: Pulled bar
parameters:
  L: 1 m
  n: 20
  m: 2
  dx: L/n
  pull: 1 mm
  E: 70 GPa
  bond_based: {bond_based: {youngs_modulus: E}}
  linear_solid: {linear_peridynamic_solid: {youngs_modulus: E, poisson_ratio: 0}}
  model: ${bond_based}
body:
  dimension: 1
  area: 1 cm^2
  points: [{line: {from: 0, to: L, spacing: dx}}]
  horizon: (m + 0.01)*dx
sets:
  # two horizons deep: bonds of truncated families are stiffer, and would disturb the uniform strain
  ends: {where: "x < 2*m*dx or x > L - 2*m*dx"}
materials:
  bar:
    model: ${model}
conditions:
  - displacement: {set: ends, name: ends, x: pull*x/L}
solver: {statics: {linear: true}}
runs:
  stiff: {set: {E: 210 GPa}}
  soft: {set: {E: 7 GPa}, expect: [{name: own, quantity: step, value: 1, absolute: 0}]}
expect:
  - {name: middle, field: displacement.x, at: [L/2], value: pull*(L/2 - dx/2)/L, tolerance: 1e-9}
  - {name: fine only, field: displacement.x, at: [0], value: pull*dx/(2*L), tolerance: 1e-9, when: n > 20}
"#;

const STUDY: &str = r#"
study:
  vary: {m: [1, 2], n: [20, 40, 80]}
  measure:
    - {name: first, field: displacement.x, at: [0]}
    - {name: from file, error: {field: displacement.x, csv: field.csv, column: u, norm: relative_l2, over: few}}
  combinations:
    "n=80": {slow: true, expect: [{name: step, quantity: step, value: 1, absolute: 0}]}
  expect:
    - {order: first, against: dx, value: 1, absolute: 1e-6, source: "u = e dx/2 at the first point"}
    - {falls: first, against: n}
    - {rises: first, against: dx}
    - {name: halved, ratio: first, of: "m=2,n=40", to: "m=2,n=20", value: 0.5, tolerance: 1e-9}
figures:
  - lines:
      name: lines
      x: {unit: m}
      y: {label: displacement, unit: mm, factor: 1000}
      curves:
        - {field: displacement.x, runs: n=20, label: "m = {m}, dx = {dx}"}
        - {expression: "pull*x/L", label: exact}
        - {csv: points.csv, label: points}
  - lines:
      name: order
      log: xy
      curves: [{quantity: first, against: dx}]
      slopes: [1]
  - lines:
      name: history
      curves: [{history: reaction.ends.x, against: time, runs: ["m=1,n=20"]}]
  - fields: {name: fields, field: displacement.x, runs: n=20}
"#;

fn bar(study: &str) -> String {
    BAR.replace("sets:\n", "sets:\n  few: {where: \"x < 0.1\"}\n") + study
}

fn write(folder: &Path, name: &str, text: &str) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path
}

/// A field every 1/320: the points of all three bodies are among these.
fn files(folder: &Path) {
    let rows: String = (0..=320).map(|k| f64::from(k) / 320.0).map(|x| format!("{x},{}\n", 1e-3 * x)).collect();
    write(folder, "field.csv", &format!("x,u\n{rows}"));
    write(folder, "points.csv", "# by hand\nx,u\n0,0\n0.5,0.0005\n1,0.001\n");
}

fn combinations(text: &str) -> Vec<Combination> {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), "deck.yaml", text);
    Deck::study(&path, &[]).unwrap_or_else(|e| panic!("{e}")).unwrap().combinations
}

fn names(text: &str) -> Vec<String> {
    combinations(text).into_iter().map(|one| one.name).collect()
}

#[test]
fn lists_are_crossed_zipped_and_combined_with_runs() {
    assert_eq!(names(&bar("study: {vary: {m: [1, 2], n: [20, 40]}}")), ["m=1,n=20", "m=1,n=40", "m=2,n=20", "m=2,n=40"]);
    assert_eq!(names(&bar("study: {vary: {m: [1, 2], n: [20, 40]}, combine: zip}")), ["m=1,n=20", "m=2,n=40"]);
    assert_eq!(names(&bar("study: {vary: {m: [1, 2]}, runs: [soft]}")), ["soft,m=1", "soft,m=2"]);
    assert_eq!(names(&bar("study: {runs: all}")), ["stiff", "soft"]);
    assert_eq!(names(&bar("study: {vary: {n: [20]}}")), ["n=20"]);
    // figures alone show the runs of the deck
    let figures = "figures: [{lines: {name: a, curves: [{field: displacement.x}]}}]";
    assert_eq!(names(&bar(figures)), ["stiff", "soft"]);
    // expressions, units and whole models as values; equal names are told apart
    let text = "study: {vary: {dx: [L/20, 25 mm, 25  mm], model: [${linear_solid}, {bond_based: {youngs_modulus: E}}]}}";
    let expected = [
        "dx=L_20,model=linear_solid",
        "dx=L_20,model=bond_based_youngs_modulus_E",
        "dx=25_mm,model=linear_solid",
        "dx=25_mm,model=bond_based_youngs_modulus_E",
        "dx=25_mm,model=linear_solid,no=2",
        "dx=25_mm,model=bond_based_youngs_modulus_E,no=2",
    ];
    assert_eq!(names(&bar(text)), expected);
}

#[test]
fn a_combination_has_its_values_and_expectations() {
    let all = combinations(&bar(STUDY));
    let of = |name: &str| all.iter().find(|one| one.name == name).unwrap();
    let coarse = &of("m=1,n=20").deck;
    let labels = |deck: &Deck| deck.expectations().map(Expectation::label).collect::<Vec<_>>();
    assert_eq!(labels(coarse), ["middle"]);
    assert_eq!(coarse.measures().count(), 2);
    let fine = of("m=2,n=80");
    assert_eq!(labels(&fine.deck), ["middle", "fine only", "step"]);
    assert!(fine.slow && !of("m=2,n=40").slow);
    assert!(fine.is_called("n=80") && fine.is_called("n = 80") && fine.is_called("n=80,m=2") && !fine.is_called("n=8"));
    assert_eq!(fine.deck.body.horizon.constant(), Some(2.01 * (1.0 / 80.0)));
    // the values expected are expressions of the parameters of the combination
    assert_eq!(fine.deck.expect[0].value.unwrap().value, 1e-3 * (0.5 - 1.0 / 160.0) / 1.0);
    // a deck alone measures nothing of its study, and its resolved form has none
    let alone = Deck::from_text(bar(STUDY), Path::new("deck.yaml"), &[], None).unwrap();
    assert_eq!(alone.measures().count(), 0);
    assert!(alone.resolved().get("study").is_none() && alone.resolved().get("figures").is_none());
}

#[test]
fn faults_of_studies_and_figures_have_places_and_remedies() {
    let study = "study:\n  vary: {mm: [1, 2], n: []}\n  runs: [stif]\n";
    let zipped = "study:\n  vary: {m: [1, 2], n: [20, 40, 80]}\n  combine: zip\n";
    let base = "study:\n  vary: {m: [1, 2]}\n  measure: [{name: first, field: displacement.x, at: [0]}]\n";
    let with = |line: &str| format!("{base}{line}\n");
    let curve = |curve: &str| with(&format!("figures: [{{lines: {{name: a, log: xy, curves: [{curve}]}}}}]"));
    let cases: Vec<(String, &str, &[&str])> = vec![
        (study.into(), "mm", &["no parameter `mm`", "`m`"]),
        (study.into(), "[]", &["`n` is empty"]),
        (study.into(), "stif", &["no run `stif`", "`stiff`"]),
        (zipped.into(), "[20, 40, 80]", &["`n` has 3 values, but `m` has 2"]),
        ("study: {vary: {m: 3}}\n".into(), "3", &["a list is needed"]),
        (with("  combinations: {m=3: {slow: true}}"), "m=3", &["no combination `m=3`", "m=2"]),
        (with("  expect: [{order: frist, against: m, between: [1, 2]}]"), "frist", &["called `frist`", "`first`"]),
        (with("  expect: [{order: first, against: mm, between: [1, 2]}]"), "mm", &["no parameter `mm`", "`m`"]),
        (with("  expect: [{order: first, against: m}]"), "{order", &["has no value"]),
        (with("  expect: [{order: first, between: [1, 2]}]"), "{order", &["`against: dx`"]),
        (with("  expect: [{falls: first, rises: first, against: m}]"), "{falls", &["`falls` and `rises`"]),
        (with("  expect: [{ratio: first, of: all, to: m=1, value: 1, tolerance: 0.1}]"), "all", &["2 combinations", "name one"]),
        (curve("{field: displacement.q}"), "displacement.q", &["not a component"]),
        (curve("{history: reaction.end.x}"), "reaction.end.x", &["no history", "`reaction.ends.x`"]),
        (curve("{field: displacement.x, runs: m=7}"), "m=7", &["no combination `m=7`"]),
        (curve("{field: displacement.x, runs: []}"), "[]", &["the list is empty"]),
        (curve("{field: displacement.x, label: \"{mu}\"}"), "\"{mu}\"", &["`{mu}` does not name"]),
        (curve("{quantity: first, history: step}"), "{quantity", &["one thing"]),
        (curve("{quantity: first}"), "{quantity", &["`against: dx`"]),
        (curve("{expression: \"sinn(x)\"}"), "sinn", &["sin"]),
        (curve("{field: displacement.x, against: q}"), "q", &["over `q`"]),
        (with("figures: [{lines: {name: a, curves: [{field: damage}], slopes: [2]}}]"), "2", &["`log: xy`"]),
        (with("figures: [{lines: {name: a, curves: []}}]"), "{name", &["no curves"]),
        (with("figures: [{fields: {name: a/b, field: damage, range: [1, 0]}}]"), "a/b", &["cannot be the name"]),
        (with("figures: [{fields: {name: a, field: damage, range: [1, 0]}}]"), "0", &["above the first"]),
        (with("figures: [{fields: {name: a, field: damage}}, {fields: {name: a, field: damage}}]"), "a", &["two figures"]),
    ];
    for (study, mark, parts) in cases {
        let text = bar(&study);
        let errors = Deck::from_text(text.clone(), Path::new("deck.yaml"), &[], None).map(|_| ()).expect_err(&study);
        let shown = errors.to_string();
        for part in parts {
            assert!(shown.contains(part), "{study}: no {part} in {shown}");
        }
        let marked = errors.faults().iter().any(|fault| {
            let rest: String = text.lines().nth(fault.line - 1).unwrap().chars().skip(fault.column - 1).collect();
            rest.starts_with(mark) && !fault.issue.help.is_empty()
        });
        assert!(marked, "{study}: no fault at {mark} with a remedy in {shown}");
    }
    // all at once
    let errors = Deck::from_text(bar(study), Path::new("deck.yaml"), &[], None).map(|_| ()).unwrap_err();
    assert_eq!(errors.faults().len(), 3, "{errors}");
}

#[test]
fn faults_of_single_combinations_name_them_and_nothing_is_run() {
    let folder = tempfile::tempdir().unwrap();
    files(folder.path());
    let run = |text: &str| {
        let deck = write(folder.path(), "deck.yaml", text);
        let output =
            Command::cargo_bin("peridyne").unwrap().arg("run").arg(&deck).current_dir(folder.path()).assert().code(2).get_output().clone();
        assert!(!folder.path().join("deck.out").exists());
        String::from_utf8(output.stderr).unwrap()
    };
    let message = run(&bar("study: {vary: {n: [20, 0, -4]}}\n"));
    assert!(message.contains("n=0") && message.contains("must be"), "{message}");
    // a file of a figure that has no such column, or is not there
    let figure = "study: {vary: {n: [20]}}\nfigures: [{lines: {name: a, curves: [{csv: points.csv, columns: [x, v]}, {csv: none.csv}]}}]\n";
    let message = run(&bar(figure));
    assert!(message.contains("no column `v`; it has x, u") && message.contains("none.csv: cannot be read"), "{message}");
    // a reference field that ends before the body does
    write(folder.path(), "short.csv", "x,u\n0.025,1\n");
    let measure = "study: {vary: {n: [20]}, measure: [{name: a, error: {field: displacement.x, csv: short.csv, column: u}}]}\n";
    let message = run(&bar(measure));
    assert!(message.contains("19 points of the body have no line within half a spacing, the first is at [0.075]"), "{message}");
    let deck = write(folder.path(), "deck.yaml", &bar("study: {vary: {n: [20]}}\n"));
    let fails = |arguments: &[&str]| {
        let output = Command::cargo_bin("peridyne").unwrap().arg("run").arg(&deck).args(arguments).assert().code(2).get_output().clone();
        String::from_utf8(output.stderr).unwrap()
    };
    assert!(fails(&["--only", "n=30"]).contains("n=20"));
    assert!(fails(&["--set", "n=30"]).contains("the study varies `n`"));
}

fn table(path: &Path) -> (Vec<String>, Vec<Vec<String>>) {
    let mut reader = csv::Reader::from_path(path).unwrap();
    let head = reader.headers().unwrap().iter().map(String::from).collect();
    (head, reader.records().map(|row| row.unwrap().iter().map(String::from).collect()).collect())
}

#[test]
fn a_study_runs_measures_and_draws() {
    let folder = tempfile::tempdir().unwrap();
    files(folder.path());
    let deck = write(folder.path(), "deck.yaml", &bar(STUDY));
    let out = folder.path().join("out");
    let output =
        Command::cargo_bin("peridyne").unwrap().arg("run").arg(&deck).arg("--out").arg(&out).assert().success().get_output().clone();
    let text = String::from_utf8(output.stdout).unwrap();
    for part in ["6 of 6 runs", "3 of 6, m=1,n=80", "order of first against dx (m = 2)", "halved"] {
        assert!(text.contains(part), "{part} is missing in:\n{text}");
    }
    assert!(out.join("m=2,n=40/summary.json").exists() && out.join("m=2,n=40/final.csv").exists());
    let (head, rows) = table(&out.join("study.csv"));
    assert_eq!(head, ["combination", "n", "m", "dx", "first", "from file", "middle", "fine only", "step"]);
    assert_eq!(rows.len(), 6);
    let number = |row: &[String], name: &str| row[head.iter().position(|h| h == name).unwrap()].parse::<f64>().unwrap();
    for row in &rows {
        // u = e x at the first point, dx/2
        let exact = 1e-3 * number(row, "dx") / 2.0;
        assert!((number(row, "first") / exact - 1.0).abs() < 1e-9, "{row:?}");
        assert!(number(row, "from file") < 1e-9, "{row:?}");
    }
    assert_eq!(rows[0][0], "m=1,n=20");
    // not expected there, and no history; `step` is a column of every history, so that it has a last value
    assert_eq!(rows[0][7..], ["", "1.0"]);
    for name in ["lines", "order", "history", "fields"] {
        let png = std::fs::read(out.join(format!("{name}.png"))).unwrap();
        assert!(png.len() > 3000, "{name}");
        assert!(out.join(format!("{name}.csv")).exists(), "{name}");
    }
    let (head, rows) = table(&out.join("lines.csv"));
    assert_eq!(head, ["curve", "x (m)", "displacement (mm)"]);
    let points = |name: &str| rows.iter().filter(|row| row[0] == name).count();
    assert_eq!((points("m = 1, dx = 0.05"), points("m = 2, dx = 0.05"), points("points")), (20, 20, 3));
    for row in rows.iter().filter(|row| row[0] != "points") {
        let (x, u): (f64, f64) = (row[1].parse().unwrap(), row[2].parse().unwrap());
        assert!((u - x).abs() < 1e-9, "{row:?}");
    }
    let (_, rows) = table(&out.join("order.csv"));
    assert_eq!(rows.iter().filter(|row| row[0] == "m = 2").count(), 3);
    assert_eq!(table(&out.join("fields.csv")).1.len(), 40);
}

#[test]
fn one_combination_is_run_alone_and_the_whole_is_checked_and_verified() {
    let folder = tempfile::tempdir().unwrap();
    files(folder.path());
    let deck = write(folder.path(), "deck.yaml", &bar(STUDY));
    let out = folder.path().join("out");
    let program = || Command::cargo_bin("peridyne").unwrap();
    program().arg("run").arg(&deck).args(["--only", "m=2,n=40", "--out"]).arg(&out).assert().success();
    assert_eq!(table(&out.join("study.csv")).1.len(), 1);
    assert!(!out.join("lines.png").exists() && !out.join("m=1,n=40").exists());
    let text = String::from_utf8(program().arg("check").arg(&deck).assert().success().get_output().stdout.clone()).unwrap();
    assert!(text.contains("6 runs") && text.contains("m=2,n=80") && text.contains("80 points, slow"), "{text}");

    let verify = |arguments: &[&str]| {
        let json = folder.path().join("report.json");
        program().arg("verify").arg(&deck).arg("--json").arg(&json).args(arguments).assert().success();
        let report: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&json).unwrap()).unwrap();
        let results = report["results"].as_array().unwrap().clone();
        results.iter().map(|r| format!("{}: {}", r["run"].as_str().unwrap(), r["quantity"].as_str().unwrap())).collect::<Vec<_>>()
    };
    // the runs of the deck are verified besides; what needs slow combinations is left out without them
    let quick = verify(&[]);
    assert!(quick.contains(&"stiff: middle".into()) && quick.contains(&"soft: own".into()), "{quick:?}");
    assert!(quick.contains(&"study: halved".into()) && !quick.iter().any(|q| q.contains("order") || q.contains("n=80")), "{quick:?}");
    let slow = verify(&["--slow"]);
    assert!(slow.contains(&"study: order of first against dx (m = 1)".into()), "{slow:?}");
    assert!(slow.contains(&"m=1,n=80: step".into()), "{slow:?}");
}

#[test]
fn what_other_runs_expect_is_read_with_their_own_parameters() {
    // 1/(m - 1) has no value with m = 1, which is the deck as the other runs see it
    let own = "  soft: {set: {E: 7 GPa, m: 2}, expect: [{name: own, quantity: step, value: 1/(m - 1), absolute: 0}]}";
    let text = BAR.replace("  soft: {set: {E: 7 GPa}, expect: [{name: own, quantity: step, value: 1, absolute: 0}]}", own);
    let text = text.replace("stiff: {set: {E: 210 GPa}}", "stiff: {set: {E: 210 GPa, m: 1}}");
    assert!(text.contains(own), "the deck has changed");
    let read = |run: &str| Deck::from_text(text.clone(), Path::new("deck.yaml"), &[], Some(run)).map_err(|e| e.to_string());
    let stiff = read("stiff").expect("what `soft` expects is none of its business");
    assert!(stiff.expectations().all(|e| e.label() != "own"));
    let soft = read("soft").unwrap();
    assert_eq!(soft.expectations().find(|e| e.label() == "own").unwrap().value.unwrap().value, 1.0);
    // in a study the same holds for the expectations of combinations
    let study = format!(
        "{}study:\n  vary: {{m: [1, 2]}}\n  combinations:\n    \"m=2\": {{expect: [{{name: second, quantity: step, value: 1/(m - 1), absolute: 0}}]}}\n",
        BAR.replace("  soft: {set: {E: 7 GPa}, expect: [{name: own, quantity: step, value: 1, absolute: 0}]}\n", "")
    );
    let folder = std::env::temp_dir().join(format!("peridyne-study-own-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("deck.yaml");
    std::fs::write(&path, study).unwrap();
    let combinations = Deck::study(&path, &[]).map_err(|e| e.to_string()).unwrap().unwrap().combinations;
    let labels: Vec<Vec<String>> = combinations.iter().map(|c| c.deck.expectations().map(|e| e.label()).collect()).collect();
    std::fs::remove_dir_all(&folder).unwrap();
    assert_eq!(labels.len(), 2);
    assert!(!labels[0].contains(&"second".to_string()) && labels[1].contains(&"second".to_string()), "{labels:?}");
}
