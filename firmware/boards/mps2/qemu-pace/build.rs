//! Keeps the plugin in memory: QEMU unloads plugins while threads of its own may still run in them.

fn main() {
    println!("cargo::rustc-link-arg-cdylib=-Wl,-z,nodelete");
}
