//! What a run leaves behind: field files, tables, pictures, plots and a summary.
//!
//! Every writer takes plain data, so that nothing here knows of bodies, solvers or decks.
//! A file appears under its final name only when it is complete: it is written beside its
//! place under a temporary name, synchronised, and then renamed. Two files grow during a
//! run, the field file ([`vtkhdf::FieldFile`]) and the history ([`table::History`]); both
//! are complete and readable after each of their steps.
//!
//! | module | file | content |
//! |---|---|---|
//! | [`vtkhdf`] | `fields.vtkhdf` | all fields of all output steps, for ParaView and h5py |
//! | [`table`] | `final.csv`, `history.csv` | the last state, one row a point; measures over time |
//! | [`picture`] | `*.png` | a field on the deformed points |
//! | [`plot`] | `*.png`, `*.csv` | curves |
//! | [`figure`] | `*.png`, `*.csv` | a field of several runs, side by side |
//! | [`summary`] | `summary.json` | what was run, how it went, what it compares with |

pub mod background;
pub mod canvas;
pub mod color;
pub mod figure;
pub mod picture;
pub mod plot;
pub mod summary;
pub mod table;
pub mod ticks;
pub mod vtkhdf;

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Values of a field, one entry a material point, in the user's order of points.
#[derive(Debug, Clone, PartialEq)]
pub enum FieldValues {
    /// One number a point.
    Scalar(Vec<f64>),
    /// Three Cartesian components a point; unused components are zero.
    Vector(Vec<[f64; 3]>),
    /// Nine components a point, row by row: `xx, xy, xz, yx, …, zz`.
    Tensor(Vec<[f64; 9]>),
    /// One whole number a point (a material, a count, a point set).
    Integer(Vec<i64>),
}

/// Suffixes of the columns of a vector.
const VECTOR_SUFFIXES: [&str; 3] = ["_x", "_y", "_z"];
/// Suffixes of the columns of a tensor, row by row.
const TENSOR_SUFFIXES: [&str; 9] = ["_xx", "_xy", "_xz", "_yx", "_yy", "_yz", "_zx", "_zy", "_zz"];

impl FieldValues {
    /// Number of points.
    pub fn len(&self) -> usize {
        match self {
            Self::Scalar(v) => v.len(),
            Self::Vector(v) => v.len(),
            Self::Tensor(v) => v.len(),
            Self::Integer(v) => v.len(),
        }
    }

    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Numbers a point: 1, 3 or 9.
    pub fn components(&self) -> usize {
        match self {
            Self::Scalar(_) | Self::Integer(_) => 1,
            Self::Vector(_) => 3,
            Self::Tensor(_) => 9,
        }
    }

    /// What each component adds to the name of the field: nothing, `_x`…, `_xx`….
    pub fn suffixes(&self) -> &'static [&'static str] {
        match self {
            Self::Scalar(_) | Self::Integer(_) => &[""],
            Self::Vector(_) => &VECTOR_SUFFIXES,
            Self::Tensor(_) => &TENSOR_SUFFIXES,
        }
    }

    /// The kind in words, for messages.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Scalar(_) => "scalar",
            Self::Vector(_) => "vector",
            Self::Tensor(_) => "tensor",
            Self::Integer(_) => "integer",
        }
    }

    /// One component as a list of numbers, or `None` where the field has no such component.
    pub fn component(&self, component: usize) -> Option<Vec<f64>> {
        if component >= self.components() {
            return None;
        }
        Some(match self {
            Self::Scalar(v) => v.clone(),
            Self::Integer(v) => v.iter().map(|&i| i as f64).collect(),
            Self::Vector(v) => v.iter().map(|a| a[component]).collect(),
            Self::Tensor(v) => v.iter().map(|a| a[component]).collect(),
        })
    }

    /// The Euclidean norm of each entry; a scalar is taken as it is, with its sign.
    pub fn magnitude(&self) -> Vec<f64> {
        match self {
            Self::Scalar(v) => v.clone(),
            Self::Integer(v) => v.iter().map(|&i| i as f64).collect(),
            Self::Vector(v) => v.iter().map(|a| norm(a)).collect(),
            Self::Tensor(v) => v.iter().map(|a| norm(a)).collect(),
        }
    }
}

/// Euclidean norm, scaled by the largest entry so that no system of units over- or underflows.
fn norm(a: &[f64]) -> f64 {
    let largest = a.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
    // A NaN component disappears from the maximum but must not disappear from the result.
    if a.iter().any(|c| c.is_nan()) {
        return f64::NAN;
    }
    if largest == 0.0 || largest.is_infinite() {
        return largest;
    }
    largest * a.iter().map(|c| (c / largest).powi(2)).sum::<f64>().sqrt()
}

/// A named field.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// Name, as in the glossary: `damage`, `dilatation`, `stress`, ….
    pub name: String,
    /// Unit, where the field has one and the deck states units.
    pub unit: Option<String>,
    /// The values.
    pub values: FieldValues,
}

impl Field {
    /// A field without a unit.
    pub fn new(name: impl Into<String>, values: FieldValues) -> Self {
        Self { name: name.into(), unit: None, values }
    }

    /// The same field with a unit.
    pub fn with_unit(mut self, unit: impl Into<String>) -> Self {
        self.unit = Some(unit.into());
        self
    }
}

/// The state of all points at one output step.
#[derive(Debug, Clone, Copy)]
pub struct Snapshot<'a> {
    /// Time (or load factor of a static problem).
    pub time: f64,
    /// Number of the time step or load increment.
    pub step: u64,
    /// Displacement of each point; unused components are zero.
    pub displacement: &'a [[f64; 3]],
    /// The other fields.
    pub fields: &'a [Field],
}

/// Why a file could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OutputError {
    /// The operating system refused.
    #[error("cannot {action} {path}: {source}; check that the folder exists, is writable and has space left")]
    Io {
        /// What was attempted.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The reason.
        source: io::Error,
    },
    /// The HDF5 layer refused.
    #[error("cannot {action} in {path}: {source}; if the file was changed by another program, move it away and run again")]
    Hdf5 {
        /// What was attempted.
        action: String,
        /// The file.
        path: PathBuf,
        /// The reason.
        source: Box<rust_hdf5::Hdf5Error>,
    },
    /// The PNG encoder refused.
    #[error("cannot encode the picture {path}: {source}")]
    Encode {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: png::EncodingError,
    },
    /// The summary could not be put into JSON.
    #[error("cannot put the summary {path} into JSON: {source}")]
    Json {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: serde_json::Error,
    },
    /// A list of values has the wrong length.
    #[error("{path}: `{name}` has {found} entries where {expected} are needed: one for each {each}")]
    Length {
        /// The file.
        path: PathBuf,
        /// Name of the field, column or list.
        name: String,
        /// What one entry stands for.
        each: &'static str,
        /// Entries needed.
        expected: usize,
        /// Entries given.
        found: usize,
    },
    /// The set of fields is not that of the first step.
    #[error(
        "{path}: the fields of step {step} are {found}, those of the first step were {expected}; every step must write the same fields in the same order"
    )]
    FieldsChanged {
        /// The file.
        path: PathBuf,
        /// Number of the step.
        step: u64,
        /// Names and kinds of the first step.
        expected: String,
        /// Names and kinds of this step.
        found: String,
    },
    /// A name that cannot be used.
    #[error("{path}: the name `{name}` {reason}; choose another name")]
    Name {
        /// The file.
        path: PathBuf,
        /// The name.
        name: String,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// A picture or plot without anything to draw, or with impossible options.
    #[error("cannot draw {what}: {reason}")]
    Drawing {
        /// Which picture or plot.
        what: String,
        /// What is wrong, and what would be right.
        reason: String,
    },
}

impl OutputError {
    pub(crate) fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io { action, path: path.to_path_buf(), source }
    }
}

/// The folder a file lies in; a bare name lies in the current folder.
fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// A new empty file beside `path`, removed again unless it is renamed.
pub(crate) fn temporary_beside(path: &Path) -> Result<tempfile::NamedTempFile, OutputError> {
    let folder = folder_of(path);
    fs::create_dir_all(folder).map_err(OutputError::io("create the folder of", path))?;
    let mut builder = tempfile::Builder::new();
    let prefix = format!(".{}.", path.file_name().unwrap_or_default().to_string_lossy());
    builder.prefix(&prefix).suffix(".part");
    // Temporary files are private by default; a result is as readable as any other file.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder).map_err(OutputError::io("create a temporary file for", path))
}

/// Writes a file under a temporary name and renames it when it is complete, so that the final
/// name always holds either the former file or the whole new one.
///
/// Missing folders are created.
///
/// # Errors
/// [`OutputError::Io`], or what `write` returns; the final name is then untouched.
pub fn write_whole<E>(path: &Path, write: impl FnOnce(&mut BufWriter<&File>) -> Result<(), E>) -> Result<(), OutputError>
where
    E: IntoOutputError,
{
    let temporary = temporary_beside(path)?;
    let mut buffer = BufWriter::new(temporary.as_file());
    write(&mut buffer).map_err(|e| e.into_output_error(path))?;
    buffer.flush().map_err(OutputError::io("write", path))?;
    drop(buffer);
    temporary.as_file().sync_all().map_err(OutputError::io("write", path))?;
    temporary.persist(path).map_err(|e| OutputError::io("rename the finished file to", path)(e.error))?;
    Ok(())
}

/// Errors of the inside of [`write_whole`], which gain the path on their way out.
pub trait IntoOutputError {
    /// The error with the path of its file.
    fn into_output_error(self, path: &Path) -> OutputError;
}

impl IntoOutputError for io::Error {
    fn into_output_error(self, path: &Path) -> OutputError {
        OutputError::io("write", path)(self)
    }
}

impl IntoOutputError for png::EncodingError {
    fn into_output_error(self, path: &Path) -> OutputError {
        OutputError::Encode { path: path.to_path_buf(), source: self }
    }
}

impl IntoOutputError for serde_json::Error {
    fn into_output_error(self, path: &Path) -> OutputError {
        OutputError::Json { path: path.to_path_buf(), source: self }
    }
}

impl IntoOutputError for OutputError {
    fn into_output_error(self, _path: &Path) -> OutputError {
        self
    }
}
