//! Links the program by the script of the board `mps2`, whose memory all boards of the family have.

fn main() {
    let here = std::env::var("CARGO_MANIFEST_DIR").expect("cargo sets it");
    println!("cargo::rerun-if-changed=../mps2/mps2.x");
    println!("cargo::rustc-link-arg-bins=-T{here}/../mps2/mps2.x");
}
