//! Links the firmware by the board's own script; `mps2.x` says why not by cortex-m-rt's.

fn main() {
    println!("cargo::rerun-if-changed=mps2.x");
    let here = std::env::var("CARGO_MANIFEST_DIR").expect("cargo sets it");
    println!("cargo::rustc-link-arg-bins=-T{here}/mps2.x");
    println!("cargo::rustc-link-arg-bins=-Tdefmt.x");
}
