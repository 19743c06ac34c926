//! The regulators cannot be given the plant, nor find its state in what they are given: the compiler refuses.
//!
//! Not here: what the compiler says. A small crate compiles as it stands, and with any one of its features, each of
//! which is a single line, it does not.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

/// The features of the small crate.
const LINES: [&str; 5] = ["r_uw", "v_uw", "state", "winder", "winder_as_command"];

fn manifest(root: &Path) -> String {
    let features: String = LINES.map(|line| format!("{line} = []\n")).concat();
    format!(
        "[package]\nname = \"cannot_name_the_plant\"\nedition = \"2024\"\n\
         [lib]\npath = {:?}\n\
         [dependencies]\nmodel-core = {{ path = {:?} }}\n\
         [features]\n{features}[workspace]\n",
        root.join("host-tests/tests/cannot_name_the_plant/lib.rs"),
        root.join("model-core"),
    )
}

/// Checks the crate with the versions of this workspace, from what is already on this machine.
fn check(directory: &Path, features: &str) -> Output {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let manifest = directory.join("Cargo.toml");
    Command::new(cargo)
        .args(["check", "--quiet", "--offline", "--features", features])
        .arg("--manifest-path")
        .arg(manifest)
        .arg("--target-dir")
        .arg(directory.join("target"))
        .current_dir(directory)
        .output()
        .unwrap()
}

#[test]
fn the_drives_cannot_be_given_the_plant() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let directory = Path::new(env!("CARGO_TARGET_TMPDIR")).join("cannot_name_the_plant");
    fs::create_dir_all(&directory).unwrap();
    fs::write(directory.join("Cargo.toml"), manifest(root)).unwrap();
    fs::copy(root.join("Cargo.lock"), directory.join("Cargo.lock")).unwrap();

    let sound = check(&directory, "");
    let said = String::from_utf8_lossy(&sound.stderr);
    assert!(sound.status.success(), "{said}");
    for line in LINES {
        assert!(!check(&directory, line).status.success(), "{line} compiles");
    }
}
