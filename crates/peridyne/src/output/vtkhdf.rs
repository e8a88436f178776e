//! The field file: all fields of all output steps in one VTKHDF file.
//!
//! The format is that of the VTK file format documentation, "VTKHDF", version 2.2: an
//! `UnstructuredGrid` of vertex cells (of triangles, where a surface has them) whose mesh is stored once and whose point data grows along
//! the first axis. ParaView opens the file as a time series; `displacement` is a point vector, so
//! the filter Warp By Vector shows the deformed body. h5py reads step `s` of a field as
//! `file["VTKHDF/PointData/<name>"]\[s*n:(s+1)*n\]` for `n` points.
//!
//! HDF5 describes a growing dataset only when the file is closed. So each step opens the file,
//! appends, and closes it again; between two steps the file is complete, whatever happens to
//! the program. A reader that opens the file in the very milliseconds of an append may be
//! refused, and succeeds when it tries again.

use std::path::{Path, PathBuf};

use rust_hdf5::format::messages::datatype::DatatypeMessage;
use rust_hdf5::types::H5Type;
use rust_hdf5::{H5Dataset, H5File, H5Group, Hdf5Error};

use super::table::check_length;
use super::{Field, FieldValues, OutputError, Snapshot, temporary_beside};

/// `VTK_VERTEX`, the cell of a single point.
const VERTEX: u8 = 1;
/// `VTK_TRIANGLE`.
const TRIANGLE: u8 = 5;
/// Entries a chunk of the small datasets that gain one entry a step.
const STEPS_PER_CHUNK: usize = 64;
/// A step is one chunk, so that reading it touches nothing else and appending it rewrites
/// nothing; only beyond this many bytes is it divided (HDF5 allows 4 GiB a chunk).
const LARGEST_CHUNK: usize = 1 << 30;
/// The fastest level: higher ones shrink doubles hardly further.
const DEFLATE_LEVEL: u32 = 1;

const DISPLACEMENT: &str = "displacement";
const ID: &str = "id";

/// A VTKHDF time series on disk, complete and readable after each call.
#[derive(Debug)]
pub struct FieldFile {
    path: PathBuf,
    points: usize,
    steps: usize,
    /// Names and components of the fields that change, after the displacement.
    layout: Vec<(String, &'static str)>,
}

impl FieldFile {
    /// Creates the file with the points and the first step; a former file is replaced.
    ///
    /// `id` and `reference` (reference positions, zeros in unused directions) have one entry
    /// a point. `constant` are fields that never change (volume, material); they are stored once.
    ///
    /// # Errors
    /// [`OutputError::Length`], [`OutputError::Name`], [`OutputError::Hdf5`], [`OutputError::Io`];
    /// the final name is then untouched.
    pub fn create(path: &Path, id: &[i64], reference: &[[f64; 3]], constant: &[Field], first: &Snapshot<'_>) -> Result<Self, OutputError> {
        Self::create_with(path, id, reference, &[], constant, first)
    }

    /// The same with triangles of points as cells; without any, each point is a cell of its own.
    ///
    /// # Errors
    /// Those of [`create`](Self::create).
    pub fn create_with(
        path: &Path,
        id: &[i64],
        reference: &[[f64; 3]],
        triangles: &[[u32; 3]],
        constant: &[Field],
        first: &Snapshot<'_>,
    ) -> Result<Self, OutputError> {
        let points = reference.len();
        check_length(path, ID, id.len(), points)?;
        check_names(path, constant, first.fields)?;
        for field in constant {
            check_length(path, &field.name, field.values.len(), points)?;
        }
        let mut file = Self { path: path.to_path_buf(), points, steps: 0, layout: layout_of(first.fields) };
        file.check_snapshot(first)?;

        let temporary = temporary_beside(path)?.into_temp_path();
        let written = (|| {
            let hdf = H5File::options().no_locking().create(&temporary)?;
            file.write_mesh(&hdf, id, reference, triangles, constant, first)?;
            file.append_step(&hdf, first)?;
            hdf.close()
        })();
        written.map_err(file.hdf5_error("write the first step"))?;
        temporary.persist(path).map_err(|e| OutputError::io("rename the finished file to", path)(e.error))?;
        file.steps = 1;
        Ok(file)
    }

    /// Appends a step. Its fields must be those of the first step, in the same order.
    ///
    /// # Errors
    /// [`OutputError::FieldsChanged`], [`OutputError::Length`], [`OutputError::Hdf5`].
    pub fn append(&mut self, snapshot: &Snapshot<'_>) -> Result<(), OutputError> {
        if layout_of(snapshot.fields) != self.layout {
            return Err(OutputError::FieldsChanged {
                path: self.path.clone(),
                step: snapshot.step,
                expected: describe(&self.layout),
                found: describe(&layout_of(snapshot.fields)),
            });
        }
        self.check_snapshot(snapshot)?;
        let written = (|| {
            // Without a lock: a viewer that has the file open must not stop the run.
            let hdf = H5File::options().no_locking().open_rw(&self.path)?;
            self.append_step(&hdf, snapshot)?;
            hdf.close()
        })();
        written.map_err(self.hdf5_error(&format!("append step {}", snapshot.step)))?;
        self.steps += 1;
        Ok(())
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Steps written so far.
    pub fn steps(&self) -> usize {
        self.steps
    }

    fn hdf5_error(&self, action: &str) -> impl FnOnce(Hdf5Error) -> OutputError {
        move |source| OutputError::Hdf5 { action: action.to_string(), path: self.path.clone(), source: Box::new(source) }
    }

    fn check_snapshot(&self, snapshot: &Snapshot<'_>) -> Result<(), OutputError> {
        let found = snapshot.displacement.len();
        check_length(&self.path, DISPLACEMENT, found, self.points)?;
        for field in snapshot.fields {
            check_length(&self.path, &field.name, field.values.len(), self.points)?;
        }
        Ok(())
    }

    /// All that does not change, and the empty growing datasets.
    fn write_mesh(
        &self,
        hdf: &H5File,
        id: &[i64],
        reference: &[[f64; 3]],
        triangles: &[[u32; 3]],
        constant: &[Field],
        first: &Snapshot<'_>,
    ) -> Result<(), Hdf5Error> {
        let n = self.points;
        let root = hdf.create_group("VTKHDF")?;
        root.set_attr_array_numeric("Version", &[2_i64, 2])?;
        set_text(&root, "Type", "UnstructuredGrid")?;

        let (cells, corners, kind) = if triangles.is_empty() { (n, 1, VERTEX) } else { (triangles.len(), 3, TRIANGLE) };
        for (name, count) in [("NumberOfPoints", n), ("NumberOfCells", cells), ("NumberOfConnectivityIds", cells * corners)] {
            write_static(&root, name, &[1], &[count as i64])?;
        }
        write_static(&root, "Points", &[n, 3], reference.as_flattened())?;
        let connectivity: Vec<i64> = match triangles {
            [] => (0..n as i64).collect(),
            _ => triangles.as_flattened().iter().map(|q| i64::from(*q)).collect(),
        };
        let offsets: Vec<i64> = (0..=cells).map(|c| (c * corners) as i64).collect();
        write_static(&root, "Connectivity", &[cells * corners], &connectivity)?;
        write_static(&root, "Offsets", &[cells + 1], &offsets)?;
        write_static(&root, "Types", &[cells], &vec![kind; cells])?;

        let data = root.create_group("PointData")?;
        write_static(&data, ID, &[n], id)?;
        for field in constant {
            let name = &field.name;
            let dataset = match &field.values {
                FieldValues::Scalar(v) => write_static(&data, name, &[n], v)?,
                FieldValues::Integer(v) => write_static(&data, name, &[n], v)?,
                FieldValues::Vector(v) => write_static(&data, name, &[n, 3], v.as_flattened())?,
                FieldValues::Tensor(v) => write_static(&data, name, &[n, 9], v.as_flattened())?,
            };
            set_unit(&dataset, field)?;
        }
        create_growing::<f64>(&data, DISPLACEMENT, n, 3)?;
        for field in first.fields {
            let components = field.values.components();
            let dataset = match field.values {
                FieldValues::Integer(_) => create_growing::<i64>(&data, &field.name, n, 1)?,
                _ => create_growing::<f64>(&data, &field.name, n, components)?,
            };
            set_unit(&dataset, field)?;
        }

        let steps = root.create_group("Steps")?;
        create_per_step::<f64>(&steps, "Values", &[])?;
        for name in ["PartOffsets", "NumberOfParts", "PointOffsets"] {
            create_per_step::<i64>(&steps, name, &[])?;
        }
        for name in ["CellOffsets", "ConnectivityIdOffsets"] {
            create_per_step::<i64>(&steps, name, &[1])?;
        }
        let offsets = steps.create_group("PointDataOffsets")?;
        create_per_step::<i64>(&offsets, DISPLACEMENT, &[])?;
        for field in first.fields {
            create_per_step::<i64>(&offsets, &field.name, &[])?;
        }
        create_per_step::<i64>(&offsets, ID, &[])?;
        for field in constant {
            create_per_step::<i64>(&offsets, &field.name, &[])?;
        }

        // The number of the step travels as field data: one value a step.
        let field_data = root.create_group("FieldData")?;
        create_per_step::<i64>(&field_data, "step", &[])?;
        let offsets = steps.create_group("FieldDataOffsets")?;
        create_per_step::<i64>(&offsets, "step", &[])?;
        let sizes = steps.create_group("FieldDataSizes")?;
        create_per_step::<i64>(&sizes, "step", &[2])?;
        Ok(())
    }

    fn append_step(&self, hdf: &H5File, snapshot: &Snapshot<'_>) -> Result<(), Hdf5Error> {
        let root = hdf.root_group().group("VTKHDF")?;
        let data = root.group("PointData")?;
        let displacement = data.dataset_writer(DISPLACEMENT)?;
        displacement.append(snapshot.displacement.as_flattened())?;
        for field in snapshot.fields {
            let dataset = data.dataset_writer(&field.name)?;
            match &field.values {
                FieldValues::Scalar(v) => dataset.append(v)?,
                FieldValues::Integer(v) => dataset.append(v)?,
                FieldValues::Vector(v) => dataset.append(v.as_flattened())?,
                FieldValues::Tensor(v) => dataset.append(v.as_flattened())?,
            }
        }

        let steps = root.group("Steps")?;
        steps.dataset_writer("Values")?.append(&[snapshot.time])?;
        // All steps share the one mesh: every offset into it is zero.
        for name in ["PartOffsets", "PointOffsets", "CellOffsets", "ConnectivityIdOffsets"] {
            steps.dataset_writer(name)?.append(&[0_i64])?;
        }
        steps.dataset_writer("NumberOfParts")?.append(&[1_i64])?;
        let start = (self.steps * self.points) as i64;
        let offsets = steps.group("PointDataOffsets")?;
        for name in offsets.dataset_names()? {
            // Constant fields are stored once, at zero.
            let changes = name == DISPLACEMENT || self.layout.iter().any(|(n, _)| *n == name);
            let offset = if changes { start } else { 0 };
            offsets.dataset_writer(&name)?.append(&[offset])?;
        }

        let step = root.group("FieldData")?.dataset_writer("step")?;
        step.append(&[snapshot.step as i64])?;
        let offsets = steps.group("FieldDataOffsets")?;
        offsets.dataset_writer("step")?.append(&[self.steps as i64])?;
        let sizes = steps.group("FieldDataSizes")?;
        sizes.dataset_writer("step")?.append(&[1_i64, 1])?;

        steps.set_attr_numeric("NSteps", &(self.steps as i64 + 1))
    }
}

/// Names and kinds of the fields.
fn layout_of(fields: &[Field]) -> Vec<(String, &'static str)> {
    let entry = |field: &Field| (field.name.clone(), field.values.kind());
    fields.iter().map(entry).collect()
}

fn describe(layout: &[(String, &'static str)]) -> String {
    if layout.is_empty() {
        return "none".to_string();
    }
    let entries: Vec<String> = layout.iter().map(|(n, k)| format!("`{n}` ({k})")).collect();
    entries.join(", ")
}

fn check_names(path: &Path, constant: &[Field], changing: &[Field]) -> Result<(), OutputError> {
    let mut seen = vec![DISPLACEMENT, ID];
    for field in constant.iter().chain(changing) {
        let name = field.name.as_str();
        let reason = if name.is_empty() || name == "." {
            "is empty"
        } else if name.contains('/') {
            "contains `/`, which separates groups in HDF5"
        } else if seen.contains(&name) {
            "is taken by another field"
        } else {
            seen.push(name);
            continue;
        };
        return Err(OutputError::Name { path: path.to_path_buf(), name: name.to_string(), reason });
    }
    Ok(())
}

/// A text attribute as VTK wants it: ASCII of fixed length.
fn set_text(group: &H5Group, name: &str, text: &str) -> Result<(), Hdf5Error> {
    let datatype = DatatypeMessage::FixedString { size: text.len() as u32, padding: 1, charset: 0 };
    group.set_attr_typed(name, datatype, text.as_bytes().to_vec())
}

/// The unit as an attribute of the dataset, in UTF-8 (`µm`).
fn set_unit(dataset: &H5Dataset, field: &Field) -> Result<(), Hdf5Error> {
    let Some(unit) = field.unit.as_deref().filter(|unit| !unit.is_empty()) else {
        return Ok(());
    };
    let datatype = DatatypeMessage::FixedString { size: unit.len() as u32, padding: 1, charset: 1 };
    dataset.set_attr_typed("units", datatype, unit.as_bytes().to_vec())
}

/// Rows of a chunk of `n` entries of `bytes` each: all of them, or equal parts below the limit.
fn rows_per_chunk(n: usize, bytes: usize) -> usize {
    let parts = (n * bytes).div_ceil(LARGEST_CHUNK).max(1);
    n.div_ceil(parts).max(1)
}

fn write_static<T: H5Type>(group: &H5Group, name: &str, shape: &[usize], values: &[T]) -> Result<H5Dataset, Hdf5Error> {
    let mut builder = group.new_dataset::<T>().shape(shape);
    // Compression needs chunks, and pays only beyond a few of them.
    if values.len() > STEPS_PER_CHUNK {
        let mut chunk = shape.to_vec();
        let row_bytes = size_of_val(values) / shape[0];
        chunk[0] = rows_per_chunk(shape[0], row_bytes);
        builder = builder.chunk(&chunk).shuffle_deflate(DEFLATE_LEVEL);
    }
    let dataset = builder.create(name)?;
    dataset.write_raw(values)?;
    Ok(dataset)
}

/// A dataset that gains `points` rows a step.
fn create_growing<T: H5Type>(group: &H5Group, name: &str, points: usize, components: usize) -> Result<H5Dataset, Hdf5Error> {
    let rows = rows_per_chunk(points, components * size_of::<T>());
    let builder = group.new_dataset::<T>();
    let builder = if components == 1 {
        builder.shape([0]).chunk(&[rows]).max_shape(&[None])
    } else {
        builder.shape([0, components]).chunk(&[rows, components]).max_shape(&[None, Some(components)])
    };
    builder.shuffle_deflate(DEFLATE_LEVEL).create(name)
}

/// A dataset that gains one entry of shape `entry` a step.
fn create_per_step<T: H5Type>(group: &H5Group, name: &str, entry: &[usize]) -> Result<H5Dataset, Hdf5Error> {
    let shape: Vec<usize> = [&[0], entry].concat();
    let chunk: Vec<usize> = [&[STEPS_PER_CHUNK], entry].concat();
    let limits: Vec<Option<usize>> = std::iter::once(None).chain(entry.iter().copied().map(Some)).collect();
    group.new_dataset::<T>().shape(shape).chunk(&chunk).max_shape(&limits).create(name)
}
