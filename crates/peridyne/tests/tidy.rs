//! Order in the house: what CONTRIBUTING.md and ARCHITECTURE.md ask for and no compiler checks.

use std::fs;
use std::path::{Path, PathBuf};

/// Longest source file, in lines: the readers of the deck's expressions and the bodies of beams are near it.
const LONGEST: usize = 1000;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// All files below a folder whose name ends so; build folders and hidden ones left out.
fn files(folder: &Path, ending: &str) -> Vec<PathBuf> {
    let mut found = vec![];
    let mut entries: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            if name != "target" && !name.starts_with('.') {
                found.extend(files(&path, ending));
            }
        } else if name.ends_with(ending) {
            found.push(path);
        }
    }
    found
}

fn text(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Fails with all that was found at once.
fn none(what: &str, found: Vec<String>) {
    assert!(found.is_empty(), "{what}:\n  {}", found.join("\n  "));
}

#[test]
fn source_files_are_not_too_long() {
    let lines = |p: &PathBuf| text(p).lines().count();
    let sources = files(&root().join("crates"), ".rs").into_iter().filter(|p| !p.components().any(|c| c.as_os_str() == "tests"));
    let long = sources.filter(|p| lines(p) > LONGEST).map(|p| format!("{}: {} lines", p.display(), lines(&p))).collect();
    none("files beyond what one sitting reads", long);
}

#[test]
fn crates_depend_one_way() {
    // physics knows nothing, solvers know no peridynamics, bodies join the two, the program knows all
    let allowed: [(&str, &[&str]); 6] = [
        ("physics", &[]),
        ("solvers", &[]),
        ("bodies", &["physics", "solvers"]),
        ("catalog", &["physics", "bodies"]),
        ("thin", &["physics", "bodies", "solvers"]),
        ("peridyne", &["physics", "solvers", "bodies", "catalog", "thin"]),
    ];
    let mut wrong = vec![];
    for (name, may) in allowed {
        let manifest = text(&root().join("crates").join(name).join("Cargo.toml"));
        let dependencies = manifest.split("\n[").find(|section| section.starts_with("dependencies]")).unwrap_or("").to_string();
        for (other, _) in allowed {
            let used = dependencies.lines().any(|line| line.split(['.', ' ', '=']).next() == Some(other));
            if used && !may.contains(&other) {
                wrong.push(format!("{name} depends on {other}"));
            }
        }
    }
    none("the crate graph", wrong);
}

#[test]
fn libraries_print_nothing() {
    let mut found = vec![];
    for name in ["physics", "solvers", "bodies", "catalog", "thin"] {
        for path in files(&root().join("crates").join(name).join("src"), ".rs") {
            // what follows the first test module is not part of the library
            let source = text(&path);
            let library = source.split("#[cfg(test)]").next().unwrap_or("");
            for (n, line) in library.lines().enumerate().filter(|(_, l)| !l.trim_start().starts_with("//")) {
                if ["println!", "print!(", "dbg!"].iter().any(|p| line.contains(p)) {
                    found.push(format!("{}:{}: {}", path.display(), n + 1, line.trim()));
                }
            }
        }
    }
    none("printing outside of the program", found);
}

#[test]
fn models_are_documented_and_named_everywhere() {
    const HEADINGS: [&str; 7] = ["Equations", "Source", "Units", "Holds when", "Fails when", "Differs from the source", "Verified by"];
    let registry = text(&root().join("crates/catalog/src/lib.rs"));
    let contract = text(&root().join("crates/physics/tests/common/table.rs"));
    let mut wrong = vec![];
    for path in files(&root().join("crates/physics/src/models"), ".rs") {
        let source = text(&path);
        let mut at = 0;
        for heading in HEADINGS {
            match source[at..].find(&format!("/// # {heading}\n")) {
                Some(place) => at += place,
                None => wrong.push(format!("{}: no heading `{heading}`, or not in its place", path.display())),
            }
        }
        let stem = path.file_stem().unwrap().to_string_lossy().into_owned();
        let model: String = stem.split('_').map(|w| w[..1].to_uppercase() + &w[1..]).collect();
        for (place, content) in [("the catalog", &registry), ("the contract table", &contract)] {
            if !content.contains(&model) {
                wrong.push(format!("{model} is not in {place}"));
            }
        }
    }
    none("models", wrong);
}

#[test]
fn every_folder_of_decks_says_what_it_is() {
    let decks = root().join("decks");
    let mut wrong = vec![];
    for path in files(&decks, ".yaml") {
        // the folder of the deck, or the one above, which tells of several
        let folder = path.parent().unwrap();
        if !folder.join("README.md").is_file() && !folder.parent().unwrap().join("README.md").is_file() {
            wrong.push(format!("{}: no README.md", folder.display()));
        }
        let source = text(&path);
        if !source.lines().next().unwrap_or("").contains("deck.schema.json") {
            wrong.push(format!("{}: the first line does not name the schema", path.display()));
        }
        if !source.contains("\n    expect:") && !source.contains("\nexpect:") && !source.contains("expect:") {
            wrong.push(format!("{}: expects nothing", path.display()));
        }
    }
    // pictures that a README shows are there
    for readme in files(&decks, "README.md") {
        for link in text(&readme).split("](").skip(1).filter_map(|rest| rest.split(')').next()).filter(|link| link.ends_with(".png")) {
            if !readme.parent().unwrap().join(link).is_file() {
                wrong.push(format!("{}: there is no {link}", readme.display()));
            }
        }
    }
    none("decks", wrong);
}

#[test]
fn one_word_per_concept() {
    // glossary of CONTRIBUTING.md: what else these things are called stays out of code, decks and documents
    const FORBIDDEN: [(&str, &str); 4] = [
        ("hourglass", "zero-energy mode"),
        ("ghost point", "virtual point or halo"),
        ("fictitious point", "virtual point"),
        ("mesh size", "spacing"),
    ];
    let mut found = vec![];
    for folder in ["crates", "decks", "benches"] {
        for ending in [".rs", ".yaml", ".md"] {
            for path in files(&root().join(folder), ending) {
                if path.ends_with("tests/tidy.rs") {
                    continue;
                }
                for (n, line) in text(&path).lines().enumerate() {
                    for (word, right) in FORBIDDEN {
                        if line.to_lowercase().contains(word) {
                            found.push(format!("{}:{}: `{word}` is called {right}", path.display(), n + 1));
                        }
                    }
                }
            }
        }
    }
    none("the glossary", found);
}

#[test]
fn the_changelog_tells_of_this_version() {
    let changelog = text(&root().join("CHANGELOG.md"));
    let version = env!("CARGO_PKG_VERSION");
    assert!(
        changelog.contains(version) || changelog.contains("Unreleased"),
        "CHANGELOG.md tells neither of {version} nor of what is to come"
    );
}
