//! Links by cortex-m-rt's script, which takes the memory map from the top of the repository.

fn main() {
    let map = "../../../memory.x";
    println!("cargo::rerun-if-changed={map}");
    for script in ["link.x", "defmt.x"] {
        println!("cargo::rustc-link-arg-bins=-T{script}");
    }
}
