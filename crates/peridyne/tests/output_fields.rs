//! The field file, read back by the HDF5 layer, h5py and VTK.

use std::path::Path;
use std::process::Command;

use peridyne::output::vtkhdf::FieldFile;
use peridyne::output::{Field, FieldValues, OutputError, Snapshot};
use rust_hdf5::H5File;

const POINTS: usize = 700;

/// Values without a pattern that a wrong offset could repeat.
fn value(step: usize, i: usize, component: usize) -> f64 {
    ((step * 7919 + i * 104_729 + component * 1_299_709) as f64 * 0.618_033_988_749_895).fract() * 1e-3 - 4e-4
}

fn reference() -> Vec<[f64; 3]> {
    (0..POINTS).map(|i| [(i % 28) as f64 * 0.1, (i / 28) as f64 * 0.1, 0.0]).collect()
}

fn ids() -> Vec<i64> {
    (0..POINTS as i64).map(|i| 3 * i + 1).collect()
}

fn displacement(step: usize) -> Vec<[f64; 3]> {
    let entry = |i| [value(step, i, 0), value(step, i, 1), 0.0];
    (0..POINTS).map(entry).collect()
}

fn fields(step: usize) -> Vec<Field> {
    let tensor = |i| std::array::from_fn(|c| value(step, i, 10 + c));
    vec![
        Field::new("damage", FieldValues::Scalar((0..POINTS).map(|i| value(step, i, 5)).collect())),
        Field::new("stress", FieldValues::Tensor((0..POINTS).map(tensor).collect())).with_unit("N/mm²"),
        Field::new("intact bonds", FieldValues::Integer((0..POINTS).map(|i| (i * (step + 1)) as i64).collect())),
    ]
}

fn constant() -> Vec<Field> {
    let volume = (0..POINTS).map(|i| 1e-3 + 1e-6 * i as f64).collect();
    vec![Field::new("volume", FieldValues::Scalar(volume)).with_unit("m³")]
}

fn time(step: usize) -> f64 {
    0.1 * step as f64
}

fn write_series(path: &Path, steps: usize) -> FieldFile {
    let mut file = None;
    for step in 0..steps {
        let displacement = displacement(step);
        let fields = fields(step);
        let snapshot = Snapshot { time: time(step), step: 100 * step as u64, displacement: &displacement, fields: &fields };
        match &mut file {
            None => {
                let created = FieldFile::create(path, &ids(), &reference(), &constant(), &snapshot);
                file = Some(created.unwrap());
            }
            Some(file) => file.append(&snapshot).unwrap(),
        }
    }
    file.unwrap()
}

#[test]
fn each_step_reads_back_exactly() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new/fields.vtkhdf");
    // More steps than a chunk of the per-step datasets holds.
    let steps = 70;
    let file = write_series(&path, steps);
    assert_eq!(file.steps(), steps);

    let hdf = H5File::open(&path).unwrap();
    let read = |name: &str| hdf.dataset(&format!("VTKHDF/{name}")).unwrap();
    assert_eq!(read("Points").read_raw::<f64>().unwrap(), reference().as_flattened());
    assert_eq!(read("PointData/id").read_raw::<i64>().unwrap(), ids());
    let times = read("Steps/Values").read_raw::<f64>().unwrap();
    assert_eq!(times, (0..steps).map(time).collect::<Vec<_>>());
    let offsets = read("Steps/PointDataOffsets/displacement");
    let offsets = offsets.read_raw::<i64>().unwrap();
    assert_eq!(offsets.len(), steps);

    let all = read("PointData/displacement").read_raw::<f64>().unwrap();
    assert_eq!(all.len(), 3 * POINTS * steps);
    let tensor = read("PointData/stress");
    let counts = read("PointData/intact bonds").read_raw::<i64>().unwrap();
    for step in [0, 1, 63, 64, steps - 1] {
        let start = offsets[step] as usize;
        let u = &all[3 * start..3 * (start + POINTS)];
        assert_eq!(u, displacement(step).as_flattened(), "step {step}");
        let expected = fields(step);
        let FieldValues::Tensor(stress) = &expected[1].values else { unreachable!() };
        let found = tensor.read_slice::<f64>(&[start, 0], &[POINTS, 9]).unwrap();
        assert_eq!(found, stress.as_flattened(), "step {step}");
        let FieldValues::Integer(intact) = &expected[2].values else { unreachable!() };
        assert_eq!(&counts[start..start + POINTS], intact, "step {step}");
    }
    // Only the finished file is left behind.
    let left: Vec<_> = std::fs::read_dir(path.parent().unwrap()).unwrap().collect();
    assert_eq!(left.len(), 1);
}

#[test]
fn vtk_and_h5py_read_every_step() {
    let python = std::env::var("PERIDYNE_PYTHON").unwrap_or_else(|_| "python3".to_string());
    let has_vtk =
        Command::new(&python).args(["-c", "import numpy, h5py, vtkmodules.vtkIOHDF"]).output().is_ok_and(|output| output.status.success());
    if !has_vtk {
        eprintln!("skipped: {python} lacks numpy, h5py or vtk; PERIDYNE_PYTHON names another");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fields.vtkhdf");
    let steps = 4;
    write_series(&path, steps);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts/check_vtkhdf.py");
    let output = Command::new(&python).arg(script).arg(&path).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let errors = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{text}\n{errors}");

    for step in 0..steps {
        let line = format!("step {} time {:?} points {POINTS}", 100 * step, time(step));
        assert!(text.contains(&line), "{line} in\n{text}");
        // The sum in index order, from the values this test made.
        let mut sum = 0.0;
        for i in 0..POINTS {
            sum += value(step, i, 5);
        }
        assert!(text.contains(&format!("sum {sum:?} unit -")), "{text}");
    }
    assert!(text.contains("stress components 9"), "{text}");
    assert!(text.contains("unit N/mm²"), "{text}");
    assert!(text.contains("volume components 1 min 0.001 "), "{text}");
}

fn still<'a>(displacement: &'a [[f64; 3]], fields: &'a [Field]) -> Snapshot<'a> {
    Snapshot { time: 0.0, step: 0, displacement, fields }
}

#[test]
fn wrong_input_is_refused_and_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fields.vtkhdf");
    let displacement = displacement(0);
    let scalar = |name: &str, n| Field::new(name, FieldValues::Scalar(vec![0.0; n]));
    let create = |fields: &[Field]| FieldFile::create(&path, &ids(), &reference(), &[], &still(&displacement, fields)).unwrap_err();
    let short = create(&[scalar("damage", POINTS - 1)]);
    assert!(matches!(short, OutputError::Length { expected: POINTS, found: 699, .. }));
    let slash = create(&[scalar("a/b", POINTS)]);
    assert!(matches!(slash, OutputError::Name { .. }));
    let twice = create(&[scalar("id", POINTS)]);
    assert!(matches!(twice, OutputError::Name { .. }));
    assert!(!path.exists());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);

    let mut file = write_series(&path, 1);
    let changed = file.append(&still(&displacement, &[])).unwrap_err();
    assert!(matches!(changed, OutputError::FieldsChanged { .. }));
    let text = changed.to_string();
    assert!(text.contains("`stress` (tensor)") && text.contains("none"), "{text}");
}
