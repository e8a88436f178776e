//! The summary of a run: what was run, how it went and what it compares with.

use std::io::Write;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{OutputError, write_whole};

/// Everything worth knowing about a run once it is over.
///
/// Numbers that are not finite become `null` in JSON, which knows no others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Version of the program.
    pub version: String,
    /// The deck as it was run: parameters replaced, defaults filled in.
    pub deck: String,
    /// Sizes of the problem.
    pub sizes: Sizes,
    /// Constants derived from the inputs of the deck.
    pub constants: Vec<Constant>,
    /// Where the time went.
    pub timings: Vec<Timing>,
    /// Bond evaluations per second of wall time, over the whole run.
    pub bonds_per_second: f64,
    /// Comparison of measures with the values that the deck expects.
    pub verdicts: Vec<Verdict>,
    /// What the user should know although the run went on.
    pub warnings: Vec<String>,
    /// How the run ended.
    pub exit: Exit,
}

/// Sizes of a problem.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Sizes {
    /// Material points.
    pub points: u64,
    /// Directed bonds: each pair of points counts twice where both families hold it.
    pub directed_bonds: u64,
    /// Chunks of work.
    pub chunks: u64,
    /// Bytes of memory per directed bond.
    pub bytes_per_bond: f64,
    /// Bytes of memory of the body.
    pub memory_bytes: u64,
}

/// A constant derived from the inputs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Constant {
    /// Name.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Unit, empty for a pure number.
    pub unit: String,
}

/// Time spent in one part of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// Name of the part.
    pub name: String,
    /// Seconds of wall time.
    pub seconds: f64,
    /// Share of the whole, 0 to 1.
    pub share: f64,
}

impl Timing {
    /// Timings with their shares of the sum of all parts.
    pub fn list<'a>(parts: impl IntoIterator<Item = (&'a str, f64)>) -> Vec<Self> {
        let mut timings: Vec<Self> =
            parts.into_iter().map(|(name, seconds)| Self { name: name.to_string(), seconds, share: 0.0 }).collect();
        let whole: f64 = timings.iter().map(|part| part.seconds).sum();
        if whole > 0.0 {
            for part in &mut timings {
                part.share = part.seconds / whole;
            }
        }
        timings
    }
}

/// A measure compared with its expected value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// What was measured.
    pub quantity: String,
    /// The value of this run.
    pub computed: f64,
    /// The value expected.
    pub reference: f64,
    /// The largest deviation allowed, in the unit of the quantity.
    pub tolerance: f64,
    /// Whether the deviation is within the tolerance.
    pub passed: bool,
}

impl Verdict {
    /// Compares a value with its reference. A value that is not finite never passes.
    pub fn new(quantity: impl Into<String>, computed: f64, reference: f64, tolerance: f64) -> Self {
        Self { quantity: quantity.into(), computed, reference, tolerance, passed: (computed - reference).abs() <= tolerance }
    }
}

/// How a run ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Exit {
    /// All steps were taken.
    Completed {
        /// The time reached.
        time: f64,
    },
    /// The run ended early.
    Stopped {
        /// Why.
        reason: String,
        /// The time reached.
        time: f64,
    },
}

impl Summary {
    /// Writes the summary as indented JSON.
    ///
    /// # Errors
    /// [`OutputError::Json`], [`OutputError::Io`]; the final name is then untouched.
    pub fn write(&self, path: &Path) -> Result<(), OutputError> {
        write_whole(path, |file| -> Result<(), OutputError> {
            serde_json::to_writer_pretty(&mut *file, self).map_err(|source| OutputError::Json { path: path.to_path_buf(), source })?;
            writeln!(file).map_err(OutputError::io("write", path))
        })
    }
}
