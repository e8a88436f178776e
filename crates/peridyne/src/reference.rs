//! Reference data: tables of comma-separated numbers, and fields given at points.
//!
//! The first line names the columns; lines that start with `#` are comments. Empty cells are NaN.

use std::path::Path;

/// A table of numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Names of the columns.
    pub columns: Vec<String>,
    /// Rows, one number a column.
    pub rows: Vec<Vec<f64>>,
}

impl Table {
    /// Reads a table.
    ///
    /// # Errors
    /// What is wrong, with file, line and column, and what would be right.
    pub fn read(path: &Path) -> Result<Self, String> {
        let shown = path.display();
        let mut reader = csv::ReaderBuilder::new()
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .from_path(path)
            .map_err(|e| format!("{shown}: cannot be read: {e}"))?;
        let columns: Vec<String> =
            reader.headers().map_err(|e| format!("{shown}: cannot be read: {e}"))?.iter().map(String::from).collect();
        let mut rows = vec![];
        for record in reader.records() {
            let record = record.map_err(|e| format!("{shown}: {e}; every line needs as many cells as the first"))?;
            let line = record.position().map_or(0, csv::Position::line);
            let row: Result<Vec<f64>, String> = record
                .iter()
                .zip(&columns)
                .map(|(cell, column)| match cell {
                    "" => Ok(f64::NAN),
                    _ => cell.parse().map_err(|_| format!("{shown}, line {line}, column {column}: `{cell}` is not a number")),
                })
                .collect();
            rows.push(row?);
        }
        if rows.is_empty() {
            return Err(format!("{shown}: has no rows; the first line names the columns, numbers follow"));
        }
        Ok(Self { columns, rows })
    }

    /// The place of a column.
    ///
    /// # Errors
    /// That there is none, and which there are.
    pub fn column(&self, name: &str, path: &Path) -> Result<usize, String> {
        self.columns
            .iter()
            .position(|c| c == name)
            .ok_or_else(|| format!("{} has no column `{name}`; it has {}", path.display(), self.columns.join(", ")))
    }
}

/// The values of a column at points: each takes the nearest row, which must lie within half of its spacing.
///
/// `position` and `spacing` have one entry a point; `dimension` tells how many of the columns `x`, `y`, `z` are compared.
///
/// # Errors
/// Faults of the file, and the first point without a row.
pub fn field_at(path: &Path, column: &str, position: &[[f64; 3]], spacing: &[f64], dimension: usize) -> Result<Vec<f64>, String> {
    let table = Table::read(path)?;
    let value = table.column(column, path)?;
    let axes: Vec<usize> = ["x", "y", "z"][..dimension].iter().map(|axis| table.column(axis, path)).collect::<Result<_, _>>()?;
    let mut rows: Vec<&Vec<f64>> = table.rows.iter().collect();
    rows.sort_by(|a, b| a[axes[0]].total_cmp(&b[axes[0]]));
    let mut lonely = 0;
    let mut first = None;
    let values = position
        .iter()
        .zip(spacing)
        .map(|(x, spacing)| {
            let reach = 0.5 * spacing * (1.0 + 1e-9);
            let from = rows.partition_point(|row| row[axes[0]] < x[0] - reach);
            let near = rows[from..].iter().take_while(|row| row[axes[0]] <= x[0] + reach);
            let square = |row: &Vec<f64>| axes.iter().enumerate().map(|(k, &a)| (row[a] - x[k]).powi(2)).sum::<f64>();
            match near.map(|row| (square(row), row[value])).min_by(|a, b| a.0.total_cmp(&b.0)) {
                Some((d, v)) if d <= reach * reach => v,
                _ => {
                    lonely += 1;
                    first.get_or_insert(*x);
                    f64::NAN
                }
            }
        })
        .collect();
    match first {
        None => Ok(values),
        Some(x) => Err(format!(
            "{}: {lonely} points of the body have no line within half a spacing, the first is at {:?}",
            path.display(),
            // in the digits that one reads, not those of round-off
            x[..dimension].iter().map(|&c| c as f32).collect::<Vec<_>>()
        )),
    }
}
