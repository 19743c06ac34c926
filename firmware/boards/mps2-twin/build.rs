//! Links the program by the script of the board `mps2`, whose memory all boards of the family have.

fn main() {
    for script in ["../mps2/mps2.x", "../sections.x"] {
        println!("cargo::rerun-if-changed={script}");
    }
    let here = std::env::var("CARGO_MANIFEST_DIR").expect("cargo sets it");
    println!("cargo::rustc-link-search={here}/..");
    println!("cargo::rustc-link-arg-bins=-T{here}/../mps2/mps2.x");
}
