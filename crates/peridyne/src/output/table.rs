//! Tables as comma-separated values: the final state and the history of measures.
//!
//! Numbers are written with the fewest digits that read back to the same double, so a table
//! loses nothing.

use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use super::{FieldValues, OutputError, Snapshot, write_whole};

/// A number with the fewest digits that read back to exactly the same double
/// (`0.1`, `1e-7`, `NaN`, `inf`).
pub fn shortest(value: f64) -> String {
    // `Debug`, unlike `Display`, turns to an exponent for very large and small numbers.
    format!("{value:?}")
}

/// A cell of text, quoted where the comma-separated format asks for it.
pub(crate) fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_string() }
}

/// Writes the state of all points, one row a point: `id, x, y, z, ux, uy, uz`, then the fields,
/// vectors and tensors spread over `name_x`, … and `name_xx`, ….
///
/// `x, y, z` is the reference position. `id` has one entry a point.
///
/// # Errors
/// [`OutputError::Length`] if a list does not have one entry a point, [`OutputError::Io`].
pub fn write_final(path: &Path, id: &[i64], reference: &[[f64; 3]], snapshot: &Snapshot<'_>) -> Result<(), OutputError> {
    let points = reference.len();
    check_length(path, "id", id.len(), points)?;
    check_length(path, "displacement", snapshot.displacement.len(), points)?;
    for field in snapshot.fields {
        check_length(path, &field.name, field.values.len(), points)?;
    }
    write_whole(path, |file| -> io::Result<()> {
        write!(file, "id,x,y,z,ux,uy,uz")?;
        for field in snapshot.fields {
            for suffix in field.values.suffixes() {
                write!(file, ",{}", quoted(&format!("{}{suffix}", field.name)))?;
            }
        }
        writeln!(file)?;
        for i in 0..points {
            write!(file, "{}", id[i])?;
            write_numbers(file, &reference[i])?;
            write_numbers(file, &snapshot.displacement[i])?;
            for field in snapshot.fields {
                match &field.values {
                    FieldValues::Scalar(v) => write_numbers(file, &v[i..=i])?,
                    FieldValues::Vector(v) => write_numbers(file, &v[i])?,
                    FieldValues::Tensor(v) => write_numbers(file, &v[i])?,
                    FieldValues::Integer(v) => write!(file, ",{}", v[i])?,
                }
            }
            writeln!(file)?;
        }
        Ok(())
    })
}

fn write_numbers(file: &mut impl Write, numbers: &[f64]) -> io::Result<()> {
    for number in numbers {
        write!(file, ",{number:?}")?;
    }
    Ok(())
}

pub(crate) fn check_length(path: &Path, name: &str, found: usize, expected: usize) -> Result<(), OutputError> {
    if found == expected {
        return Ok(());
    }
    Err(OutputError::Length { path: path.to_path_buf(), name: name.to_string(), each: "material point", expected, found })
}

/// A table that grows during the run: measures over time.
///
/// The header is known at the start. Each row is handed to the operating system in one piece
/// before [`History::append`] returns, so a crash loses nothing that was appended.
#[derive(Debug)]
pub struct History {
    path: PathBuf,
    file: File,
    columns: usize,
    row: String,
}

impl History {
    /// Starts a history, replacing a former one. The columns usually begin with `time`.
    ///
    /// # Errors
    /// [`OutputError::Io`]; [`OutputError::Name`] if two columns share a name.
    pub fn create(path: &Path, columns: &[&str]) -> Result<Self, OutputError> {
        for (i, name) in columns.iter().enumerate() {
            if columns[..i].contains(name) {
                return Err(OutputError::Name { path: path.to_path_buf(), name: (*name).to_string(), reason: "is that of two columns" });
            }
        }
        let header: Vec<String> = columns.iter().map(|name| quoted(name)).collect();
        write_whole(path, |file| writeln!(file, "{}", header.join(",")))?;
        let file = OpenOptions::new().append(true).open(path).map_err(OutputError::io("append to", path))?;
        Ok(Self { path: path.to_path_buf(), file, columns: columns.len(), row: String::new() })
    }

    /// Appends a row, one value a column.
    ///
    /// # Errors
    /// [`OutputError::Length`] if the row does not have one value a column, [`OutputError::Io`].
    pub fn append(&mut self, values: &[f64]) -> Result<(), OutputError> {
        use std::fmt::Write as _;
        if values.len() != self.columns {
            return Err(OutputError::Length {
                path: self.path.clone(),
                name: "row".to_string(),
                each: "column",
                expected: self.columns,
                found: values.len(),
            });
        }
        self.row.clear();
        for (i, value) in values.iter().enumerate() {
            let comma = if i == 0 { "" } else { "," };
            // Writing to a string cannot fail.
            let _ = write!(self.row, "{comma}{value:?}");
        }
        self.row.push('\n');
        // One call for the whole row: a reader never sees half of it.
        self.file.write_all(self.row.as_bytes()).map_err(OutputError::io("append to", &self.path))
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }
}
