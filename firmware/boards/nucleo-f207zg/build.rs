//! Links the firmware by the board's own script; `sections.x` says why not by cortex-m-rt's.

fn main() {
    for script in ["f207zg.x", "../sections.x"] {
        println!("cargo::rerun-if-changed={script}");
    }
    let here = std::env::var("CARGO_MANIFEST_DIR").expect("cargo sets it");
    println!("cargo::rustc-link-search={here}/..");
    println!("cargo::rustc-link-arg-bins=-T{here}/f207zg.x");
    println!("cargo::rustc-link-arg-bins=-Tdefmt.x");
}
