//! Tables that are kept: what has been measured, to be compared with what is.
//!
//! Not here: how it is measured. A table belongs to a compiler, since another one makes other instructions.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

/// How a table compares with the one that is kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It is the same.
    Same,
    /// It was kept by another compiler, and does not compare.
    OtherCompiler(String),
    /// It differs in these lines.
    Differs(String),
    /// There is none yet.
    Missing,
}

/// The first line of a table: who made the instructions.
const COMPILER: &str = "compiler: ";

/// A table with its compiler, as it is kept.
pub fn with_compiler(compiler: &str, table: &str) -> String {
    format!("{COMPILER}{compiler}\n\n{table}")
}

/// Where a table is kept.
pub fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("golden")
        .join(name)
}

/// Compares a table with the one that is kept.
pub fn compare(name: &str, table: &str) -> Result<Outcome> {
    let path = path(name);
    if !path.exists() {
        return Ok(Outcome::Missing);
    }
    let kept =
        fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
    Ok(outcome(&kept, table))
}

fn outcome(kept: &str, table: &str) -> Outcome {
    let compiler = |table: &str| {
        let line = table.lines().next().unwrap_or_default();
        line.strip_prefix(COMPILER).unwrap_or_default().to_owned()
    };
    let kept_by = compiler(kept);
    if kept == table {
        Outcome::Same
    } else if kept_by != compiler(table) {
        Outcome::OtherCompiler(kept_by)
    } else {
        Outcome::Differs(difference(kept, table))
    }
}

/// Keeps a table.
pub fn keep(name: &str, table: &str) -> Result<()> {
    let path = path(name);
    fs::write(&path, table).with_context(|| format!("cannot write {}", path.display()))
}

/// The lines that differ, under the last heading before them.
fn difference(kept: &str, table: &str) -> String {
    let mut out = String::new();
    let mut heading = None;
    let (mut old, mut new) = (kept.lines(), table.lines());
    loop {
        let (a, b) = (old.next(), new.next());
        if a.is_none() && b.is_none() {
            return out;
        }
        if let Some(line) = b.filter(|line| line.starts_with('#')) {
            heading = Some(line);
        }
        if a == b {
            continue;
        }
        // a string takes all that is written to it
        if let Some(heading) = heading.take() {
            let _ = writeln!(out, "  {heading}");
        }
        for (sign, line) in [('-', a), ('+', b)] {
            if let Some(line) = line {
                let _ = writeln!(out, "{sign} {line}");
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_shows_with_its_heading() {
        let a = with_compiler("rustc 1", "# M7\nx 1\ny 2\n# M3\nx 3\n");
        let b = with_compiler("rustc 1", "# M7\nx 1\ny 2\n# M3\nx 4\n");
        assert_eq!(outcome(&a, &a), Outcome::Same);
        assert_eq!(
            outcome(&a, &b),
            Outcome::Differs("  # M3\n- x 3\n+ x 4\n".to_owned())
        );
    }

    #[test]
    fn another_compiler_s_table_does_not_compare() {
        let a = with_compiler("rustc 1", "x 1\n");
        let b = with_compiler("rustc 2", "x 2\n");
        assert_eq!(
            outcome(&a, &b),
            Outcome::OtherCompiler("rustc 1".to_owned())
        );
    }
}
