//! Bodies read from text files: one material point per line.
//!
//! The first line that is neither empty nor a comment names the columns, in any order: `x`, then `y` and `z` in two and three
//! dimensions, `volume`, and if wanted `spacing`, `block` and `id`. If it has a comma, columns are separated by commas (names of
//! blocks may then be quoted), else by blanks. Lines that start with `#` are comments. The volume is the measure of the point:
//! length × area in one dimension, area × thickness in two. Without `spacing`, a point's spacing is (volume/section)^(1/dimension);
//! without `id`, points are numbered from 0 in the order of the file; without `block`, all are in the block `body`.

use bodies::points::{PointCloud, PointErrors};
use std::path::{Path, PathBuf};

/// Why a file gives no body.
#[derive(Debug, thiserror::Error)]
pub enum PointFileError {
    /// It cannot be read.
    #[error("{}: cannot be read: {source}; check path and permissions", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// Lines that are wrong.
    #[error("{}", lines(file, first, *count))]
    Lines {
        /// The file.
        file: PathBuf,
        /// The first faults, at most twenty.
        first: Vec<LineError>,
        /// Number of all faults.
        count: usize,
    },
    /// The lines are right, but together they are no body.
    #[error("{}:\n{source}", file.display())]
    Points {
        /// The file.
        file: PathBuf,
        /// The faults; points are told by their ids, without a column `id` by their number in the file from 0.
        source: PointErrors,
    },
}

/// What is wrong in a line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LineError {
    /// Line, from 1.
    pub line: u64,
    /// Column, from 1, and its name; none if it is about the whole line.
    pub column: Option<(usize, String)>,
    /// What is there.
    pub value: String,
    /// What is wrong with it, and what would be right.
    pub remedy: String,
}

/// So many faults are kept.
const MOST: usize = 20;

fn lines(file: &Path, first: &[LineError], count: usize) -> String {
    let mut text: Vec<String> = first
        .iter()
        .map(|e| {
            let column = e.column.as_ref().map_or(String::new(), |(number, name)| format!(", column {number} ({name})"));
            format!("{}, line {}{column}: '{}': {}", file.display(), e.line, e.value, e.remedy)
        })
        .collect();
    if count > first.len() {
        text.push(format!("and {} more of {count} in all", count - first.len()));
    }
    text.join("\n")
}

/// Faults found so far.
#[derive(Default)]
struct Faults {
    first: Vec<LineError>,
    count: usize,
}

impl Faults {
    fn add(&mut self, line: u64, column: Option<(usize, &str)>, value: &str, remedy: impl Into<String>) {
        self.count += 1;
        if self.first.len() < MOST {
            // A long value would hide the remedy.
            let value = if value.chars().count() > 40 { value.chars().take(40).chain("…".chars()).collect() } else { value.to_owned() };
            let column = column.map(|(number, name)| (number + 1, name.to_owned()));
            self.first.push(LineError { line, column, value, remedy: remedy.into() });
        }
    }
}

/// A line cut into fields.
struct Row {
    line: u64,
    fields: Vec<String>,
}

/// What a column holds.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Column {
    Coordinate(usize),
    Volume,
    Spacing,
    Block,
    Id,
}

const COLUMNS: [(&str, Column); 7] = [
    ("x", Column::Coordinate(0)),
    ("y", Column::Coordinate(1)),
    ("z", Column::Coordinate(2)),
    ("volume", Column::Volume),
    ("spacing", Column::Spacing),
    ("block", Column::Block),
    ("id", Column::Id),
];

/// Reads the points of a file.
///
/// * `dimension`: that of the body; by default the number of coordinates in the file. A file may have more coordinates than the
///   body has dimensions, if they are zero.
/// * `section`: what measures were multiplied with: area in one dimension (length²), thickness in two (length), 1 in three.
///
/// # Errors
/// If the file cannot be read; all lines that are wrong, the first twenty in words; and what [`PointCloud::validate`] finds.
pub fn read(file: &Path, dimension: Option<usize>, section: f64) -> Result<PointCloud, PointFileError> {
    let bytes = std::fs::read(file).map_err(|source| PointFileError::Read { file: file.to_owned(), source })?;
    parse(&bytes, file, dimension, section)
}

/// Reads point ids from a file: one a line; empty lines and lines that begin with `#` are skipped.
///
/// # Errors
/// A sentence with file, line and value.
pub fn read_ids(file: &Path) -> Result<Vec<u64>, String> {
    let text = std::fs::read_to_string(file).map_err(|e| format!("{}: cannot be read: {e}", file.display()))?;
    let mut ids = vec![];
    for (k, line) in text.lines().enumerate().map(|(k, l)| (k, l.trim())).filter(|(_, l)| !l.is_empty() && !l.starts_with('#')) {
        let id = line.parse().map_err(|_| format!("{}, line {}: '{line}' is no point id", file.display(), k + 1))?;
        ids.push(id);
    }
    Ok(ids)
}

/// As [`read`], from the contents of a file; `file` is for messages.
///
/// # Errors
/// As those of [`read`].
pub fn parse(bytes: &[u8], file: &Path, dimension: Option<usize>, section: f64) -> Result<PointCloud, PointFileError> {
    let mut faults = Faults::default();
    let cloud = parse_rows(bytes, dimension, section, &mut faults);
    match cloud {
        Some(cloud) if faults.count == 0 => match cloud.validate() {
            Ok(()) => Ok(cloud),
            Err(source) => Err(PointFileError::Points { file: file.to_owned(), source }),
        },
        _ => Err(PointFileError::Lines { file: file.to_owned(), first: faults.first, count: faults.count }),
    }
}

fn parse_rows(bytes: &[u8], dimension: Option<usize>, section: f64, faults: &mut Faults) -> Option<PointCloud> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let text = match std::str::from_utf8(bytes) {
        Ok(text) => text,
        Err(error) => {
            let line = 1 + bytes[..error.valid_up_to()].iter().filter(|&&b| b == b'\n').count() as u64;
            faults.add(line, None, "", "is not text in UTF-8; save the file as plain text");
            return None;
        }
    };
    let mut rows = rows(text, faults).into_iter();
    let Some(header) = rows.next() else {
        faults.add(1, None, "", "there is no header; begin with the names of the columns, as in 'x,y,volume'");
        return None;
    };
    let columns = columns(&header, dimension, faults)?;
    let has = |column| columns.contains(&column);
    let dimension = dimension.unwrap_or_else(|| (0..3).take_while(|&k| has(Column::Coordinate(k))).count());

    let mut cloud = PointCloud { dimension, ..PointCloud::default() };
    let mut spacings = Vec::new();
    let mut last = header.line;
    for row in rows {
        last = row.line;
        if row.fields.len() != columns.len() {
            let remedy = format!("has {} values, the header names {} columns", row.fields.len(), columns.len());
            faults.add(row.line, None, &row.fields.join(" "), remedy);
            continue;
        }
        let before = faults.count;
        let mut x = [0.0; 3];
        let (mut volume, mut spacing, mut block, mut id) = (0.0, None, None, cloud.id.len() as u64);
        for (k, (field, column)) in row.fields.iter().zip(&columns).enumerate() {
            let name = header.fields[k].as_str();
            let mut fault = |remedy: &str| faults.add(row.line, Some((k, name)), field, remedy);
            match column {
                Column::Coordinate(axis) => match number(field) {
                    Ok(value) if *axis >= dimension && value != 0.0 => {
                        fault(&format!("is not zero, but the body has {dimension} dimensions"));
                    }
                    Ok(value) => x[*axis] = value,
                    Err(remedy) => fault(remedy),
                },
                Column::Volume | Column::Spacing => match number(field) {
                    Ok(value) if value <= 0.0 => fault("must be positive"),
                    Ok(value) if *column == Column::Volume => volume = value,
                    Ok(value) => spacing = Some(value),
                    Err(remedy) => fault(remedy),
                },
                Column::Block if field.is_empty() => fault("is empty; give the block a name"),
                Column::Block => block = Some(field.as_str()),
                Column::Id => match field.parse() {
                    Ok(value) => id = value,
                    Err(_) => fault("is not a whole number from 0"),
                },
            }
        }
        if faults.count > before {
            continue;
        }
        cloud.position.push(x);
        cloud.volume.push(volume);
        spacings.extend(spacing);
        let block = cloud.block_named(block.unwrap_or("body"));
        cloud.block.push(block);
        cloud.id.push(id);
    }
    if cloud.is_empty() && faults.count == 0 {
        faults.add(last, None, "", "no points follow the header");
    }
    let spaced = PointCloud::from_points(dimension, Vec::new(), cloud.volume.clone(), section).spacing;
    cloud.spacing = if has(Column::Spacing) { spacings } else { spaced };
    Some(cloud)
}

/// What the columns hold, by the header; none if the rows cannot be read for it.
fn columns(header: &Row, dimension: Option<usize>, faults: &mut Faults) -> Option<Vec<Column>> {
    let before = faults.count;
    let mut columns = Vec::new();
    for (k, field) in header.fields.iter().enumerate() {
        let lower = field.to_lowercase();
        match COLUMNS.iter().find(|(name, _)| *name == lower) {
            Some(&(_, column)) if columns.contains(&column) => faults.add(header.line, Some((k, field)), field, "is named twice"),
            Some(&(_, column)) => columns.push(column),
            None if field.parse::<f64>().is_ok() => {
                faults.add(header.line, Some((k, field)), field, "is a number; begin with the names of the columns, as in 'x,y,volume'");
            }
            None => {
                let nearest = COLUMNS.iter().max_by(|a, b| strsim::jaro_winkler(a.0, &lower).total_cmp(&strsim::jaro_winkler(b.0, &lower)));
                let hint = nearest
                    .filter(|n| strsim::jaro_winkler(n.0, &lower) > 0.7)
                    .map_or(String::new(), |n| format!("did you mean '{}'? ", n.0));
                faults.add(
                    header.line,
                    Some((k, field)),
                    field,
                    format!("is no column; {hint}known are x, y, z, volume, spacing, block, id"),
                );
            }
        }
    }
    let wanted = dimension.unwrap_or_else(|| (0..3).rev().find(|&k| columns.contains(&Column::Coordinate(k))).map_or(1, |k| k + 1));
    for (name, column) in COLUMNS {
        let needed = match column {
            Column::Coordinate(axis) => axis < wanted,
            column => column == Column::Volume,
        };
        if needed && !columns.contains(&column) {
            faults.add(header.line, None, &header.fields.join(" "), format!("the column '{name}' is missing"));
        }
    }
    (faults.count == before).then_some(columns)
}

/// Lines cut into fields, without comments and empty lines.
fn rows(text: &str, faults: &mut Faults) -> Vec<Row> {
    let is_empty = |line: &str| line.trim().is_empty() || line.trim_start().starts_with('#');
    let header = text.lines().find(|line| !is_empty(line)).unwrap_or("");
    if !header.contains(',') {
        let numbered = text.lines().zip(1u64..).filter(|(line, _)| !is_empty(line));
        return numbered.map(|(line, number)| Row { line: number, fields: line.split_whitespace().map(str::to_owned).collect() }).collect();
    }
    // With \r\n the reader would count a line end only when it comes to the next record.
    let text = text.replace("\r\n", "\n");
    let all: Vec<&str> = text.lines().collect();
    let mut reader =
        csv::ReaderBuilder::new().has_headers(false).flexible(true).trim(csv::Trim::All).comment(Some(b'#')).from_reader(text.as_bytes());
    let mut rows = Vec::new();
    for record in reader.records() {
        match record {
            Ok(record) => {
                let first = record.get(0).unwrap_or("");
                // A comment may be indented, a line may be blank.
                if first.starts_with('#') || (record.len() == 1 && first.is_empty()) {
                    continue;
                }
                // The reader takes its position before it skips blank lines and comments.
                let mut line = record.position().map_or(1, csv::Position::line);
                while all.get(line as usize - 1).is_some_and(|l| is_empty(l)) {
                    line += 1;
                }
                rows.push(Row { line, fields: record.iter().map(str::to_owned).collect() });
            }
            Err(error) => faults.add(error.position().map_or(0, csv::Position::line), None, "", error.to_string()),
        }
    }
    rows
}

fn number(field: &str) -> Result<f64, &'static str> {
    match field.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        Ok(_) => Err("is not finite"),
        Err(_) if field.is_empty() => Err("is empty; give a number"),
        Err(_) if field.contains(['d', 'D']) && field.replace(['d', 'D'], "e").parse::<f64>().is_ok() => {
            Err("is no number here; write the exponent with e, as in 1.5e-3")
        }
        Err(_) => Err("is not a number; write it like 0.25 or 2.5e-1"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> PointCloud {
        parse(text.as_bytes(), Path::new("points.csv"), None, 0.5).unwrap()
    }

    fn told(text: &str) -> String {
        parse(text.as_bytes(), Path::new("points.csv"), None, 1.0).unwrap_err().to_string()
    }

    #[test]
    fn commas_and_blanks_give_the_same_points() {
        let csv = parsed("# a plate\r\nx, y, volume, block, id\r\n\r\n0, 0, 0.02, left, 7\r\n  # more\r\n0.2, 1e-1, 0.02, right, 3\r\n");
        let blanks = parsed("\u{feff}# a plate\n\n  x y   volume block\tid\n0 0 0.02 left 7\n 0.2 1e-1\t0.02 right 3");
        assert_eq!(csv, blanks);
        assert_eq!((csv.dimension, csv.len()), (2, 2));
        assert_eq!(csv.position[1], [0.2, 0.1, 0.0]);
        assert_eq!((csv.block.as_slice(), csv.id.as_slice()), (&[0, 1][..], &[7, 3][..]));
        assert_eq!(csv.block_names, ["left", "right"]);
        assert!((csv.spacing[0] - 0.2).abs() < 1e-15, "√(0.02/0.5)");
    }

    #[test]
    fn columns_in_any_order_and_defaults() {
        let cloud = parsed("Volume,X,spacing\n2,1,0.25\n2,3,0.5\n");
        assert_eq!((cloud.dimension, cloud.position[1][0], cloud.volume[0]), (1, 3.0, 2.0));
        assert_eq!((cloud.spacing.as_slice(), cloud.id.as_slice()), (&[0.25, 0.5][..], &[0, 1][..]));
        assert_eq!((cloud.block.as_slice(), cloud.block_names.as_slice()), (&[0, 0][..], &["body".to_owned()][..]));
        let quoted = parsed("x,volume,block\n0,1,\"left, upper\"\n");
        assert_eq!(quoted.block_names, ["left, upper"]);
        let flat = parse(b"x,y,z,volume\n0,0,0,1\n", Path::new("f"), Some(2), 1.0).unwrap();
        assert_eq!(flat.dimension, 2);
    }

    #[test]
    fn every_bad_line_is_told_with_place_value_and_remedy() {
        let text = told("x,y,volume,id\n0,0,1,0\n1,a,1,1\n2,0,-1,2\n3,0\n4,1.5d-3,1,3\n5,inf,1,x\n6,,1,4\n");
        let expected = [
            "points.csv, line 3, column 2 (y): 'a': is not a number",
            "points.csv, line 4, column 3 (volume): '-1': must be positive",
            "points.csv, line 5: '3 0': has 2 values, the header names 4 columns",
            "points.csv, line 6, column 2 (y): '1.5d-3': is no number here; write the exponent with e",
            "points.csv, line 7, column 2 (y): 'inf': is not finite",
            "points.csv, line 7, column 4 (id): 'x': is not a whole number from 0",
            "points.csv, line 8, column 2 (y): '': is empty",
        ];
        assert_eq!(text.lines().count(), expected.len(), "{text}");
        for (line, start) in text.lines().zip(expected) {
            assert!(line.starts_with(start), "{line}\n{start}");
        }
        // Comments, blank lines and either line ending count as lines.
        for end in ["\n", "\r\n"] {
            let text = told(&["# one", "x,volume", "# three", "", "0,q", "  # six", "", "1,r", ""].join(end));
            assert!(text.contains("line 5, column 2") && text.contains("line 8, column 2"), "{text}");
        }
        let many = format!("x volume\n{}", "0 q\n".repeat(33));
        let text = told(&many);
        assert_eq!(text.lines().count(), 21);
        assert!(text.ends_with("and 13 more of 33 in all"), "{text}");
    }

    #[test]
    fn bad_headers_are_told() {
        assert!(told("x,y,volum\n0,0,1\n").contains("line 1, column 3 (volum): 'volum': is no column; did you mean 'volume'?"));
        assert!(told("x,z,volume\n0,0,1\n").contains("the column 'y' is missing"));
        assert!(told("x,y\n0,0\n").contains("the column 'volume' is missing"));
        assert!(told("x,x,volume\n0,0,1\n").contains("'x': is named twice"));
        assert!(told("0 0 1\n").contains("is a number; begin with the names"));
        assert!(told("# nothing\n").contains("there is no header"));
        assert!(told("x volume\n# nothing\n").contains("no points follow"));
        let text = parse(b"x volume\n0 1\n\xff 1\n", Path::new("f"), None, 1.0).unwrap_err().to_string();
        assert!(text.contains("line 3") && text.contains("UTF-8"), "{text}");
        let text = parse(b"x,y,volume\n0,1,1\n", Path::new("f"), Some(1), 1.0).unwrap_err().to_string();
        assert!(text.contains("is not zero, but the body has 1 dimensions"), "{text}");
    }

    #[test]
    fn what_is_wrong_with_the_whole_is_told_too() {
        let text = told("x volume id\n0 1 5\n0 1 6\n1 1 6\n");
        assert!(text.contains("share the id 6") && text.contains("points 5 and 6 coincide"), "{text}");
        let missing = read(Path::new("/nowhere/points.csv"), None, 1.0).unwrap_err().to_string();
        assert!(missing.starts_with("/nowhere/points.csv: cannot be read:"), "{missing}");
    }
}
