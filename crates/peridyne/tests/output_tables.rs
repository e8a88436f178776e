//! Tables and the summary, read back.

use std::fs;
use std::path::Path;

use peridyne::output::summary::{Constant, Exit, Sizes, Summary, Timing, Verdict};
use peridyne::output::table::{History, write_final};
use peridyne::output::{Field, FieldValues, OutputError, Snapshot, write_whole};

/// Doubles that lose something under any fixed number of digits.
const AWKWARD: [f64; 8] = [0.1, -1.0 / 3.0, 5e-324, f64::MAX, -0.0, 1e23, 123_456_789.123_456_79, f64::MIN_POSITIVE];

#[test]
fn final_table_reads_back_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("final.csv");
    let n = AWKWARD.len();
    let reference: Vec<[f64; 3]> = (0..n).map(|i| [AWKWARD[i], i as f64, 0.0]).collect();
    let displacement: Vec<[f64; 3]> = (0..n).map(|i| [0.0, AWKWARD[n - 1 - i], 0.0]).collect();
    let tensor = |i: usize| std::array::from_fn(|c| AWKWARD[(i + c) % n]);
    let fields = [
        Field::new("damage", FieldValues::Scalar(AWKWARD.to_vec())),
        Field::new("force", FieldValues::Vector(reference.clone())),
        Field::new("stress", FieldValues::Tensor((0..n).map(tensor).collect())),
        Field::new("material, number", FieldValues::Integer((0..n as i64).map(|i| i - i64::MAX).collect())),
    ];
    let snapshot = Snapshot { time: 1.0, step: 1, displacement: &displacement, fields: &fields };
    let ids: Vec<i64> = (0..n as i64).map(|i| 10 * i).collect();
    write_final(&path, &ids, &reference, &snapshot).unwrap();

    let mut reader = csv::Reader::from_path(&path).unwrap();
    let header: Vec<String> = reader.headers().unwrap().iter().map(Into::into).collect();
    assert_eq!(&header[..8], ["id", "x", "y", "z", "ux", "uy", "uz", "damage"]);
    assert_eq!(&header[8..12], ["force_x", "force_y", "force_z", "stress_xx"]);
    assert_eq!(header[19..], ["stress_zz", "material, number"]);
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    assert_eq!(rows.len(), n);
    for (i, row) in rows.iter().enumerate() {
        let number = |c: usize| row[c].parse::<f64>().unwrap().to_bits();
        assert_eq!(row[0].parse::<i64>().unwrap(), ids[i]);
        assert_eq!(number(1), AWKWARD[i].to_bits());
        assert_eq!(number(5), AWKWARD[n - 1 - i].to_bits());
        assert_eq!(number(7), AWKWARD[i].to_bits());
        assert_eq!(number(11 + 8), AWKWARD[(i + 8) % n].to_bits());
        assert_eq!(row[20].parse::<i64>().unwrap(), i as i64 - i64::MAX);
    }
    // No digit more than needed.
    assert_eq!(&rows[0][1], "0.1");
    assert_eq!(&rows[5][1], "1e23");
}

#[test]
fn final_table_refuses_lists_of_other_length() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("final.csv");
    let snapshot = Snapshot { time: 0.0, step: 0, displacement: &[[0.0; 3]; 2], fields: &[] };
    let error = write_final(&path, &[1, 2, 3], &[[0.0; 3]; 3], &snapshot).unwrap_err();
    let text = error.to_string();
    assert!(text.contains("final.csv"), "{text}");
    assert!(text.contains("`displacement` has 2 entries where 3"), "{text}");
    assert!(!path.exists());
}

#[test]
fn history_is_complete_after_each_row() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("history.csv");
    fs::write(&path, "left from a former run").unwrap();
    let mut history = History::create(&path, &["time", "reaction, left"]).unwrap();
    assert_eq!(fs::read_to_string(&path).unwrap(), "time,\"reaction, left\"\n");
    history.append(&[0.0, 0.1]).unwrap();
    history.append(&[1e-7, f64::NAN]).unwrap();
    // The history is still open: what was appended is already there.
    let text = fs::read_to_string(&path).unwrap();
    assert_eq!(text, "time,\"reaction, left\"\n0.0,0.1\n1e-7,NaN\n");
    let error = history.append(&[1.0]).unwrap_err();
    assert!(matches!(error, OutputError::Length { expected: 2, found: 1, .. }));
    assert_eq!(fs::read_to_string(&path).unwrap(), text);
    let twice = History::create(&path, &["a", "a"]).unwrap_err();
    assert!(matches!(twice, OutputError::Name { .. }));
}

#[test]
fn a_failed_write_leaves_the_former_file_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("final.csv");
    fs::write(&path, "former").unwrap();
    let failed = write_whole(&path, |file| {
        std::io::Write::write_all(file, b"half of the new file")?;
        Err(std::io::Error::other("disk full"))
    });
    let text = failed.unwrap_err().to_string();
    assert!(text.contains("disk full") && text.contains("final.csv"), "{text}");
    assert_eq!(fs::read_to_string(&path).unwrap(), "former");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);

    // A folder that cannot be made is named as such.
    let impossible = path.join("below/a/file.csv");
    let error = write_whole(Path::new(&impossible), |_| Ok::<(), std::io::Error>(())).unwrap_err();
    assert!(matches!(error, OutputError::Io { .. }));
}

#[cfg(unix)]
#[test]
fn results_are_as_readable_as_other_files() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let ordinary = folder.path().join("ordinary");
    fs::write(&ordinary, "").unwrap();
    let path = folder.path().join("result");
    write_whole(&path, |_| Ok::<(), std::io::Error>(())).unwrap();
    let mode = |p: &Path| fs::metadata(p).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode(&path), mode(&ordinary));
}

#[test]
fn summary_reads_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("summary.json");
    let summary = Summary {
        version: "0.1.0".into(),
        deck: "title: bar\n".into(),
        sizes: Sizes { points: 1000, directed_bonds: 28_000, chunks: 4, bytes_per_bond: 12.5, memory_bytes: 350_000 },
        constants: vec![Constant { name: "bulk modulus".into(), value: 1.0 / 3.0, unit: "Pa".into() }],
        timings: Timing::list([("families", 1.0), ("steps", 3.0)]),
        bonds_per_second: 2.5e8,
        verdicts: vec![Verdict::new("tip displacement", 1.01, 1.0, 0.02), Verdict::new("reaction", f64::NAN, 1.0, 1.0)],
        warnings: vec!["the horizon ratio is small".into()],
        exit: Exit::Stopped { reason: "interrupted".into(), time: 0.5 },
    };
    assert_eq!(summary.timings[1].share, 0.75);
    assert!(summary.verdicts[0].passed && !summary.verdicts[1].passed);
    summary.write(&path).unwrap();
    let json: serde_json::Value = serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
    assert_eq!(json["sizes"]["directed_bonds"], 28_000);
    assert_eq!(json["constants"][0]["value"].as_f64(), Some(1.0 / 3.0));
    assert_eq!(json["exit"]["stopped"]["reason"], "interrupted");
    assert!(json["verdicts"][1]["computed"].is_null());
}
