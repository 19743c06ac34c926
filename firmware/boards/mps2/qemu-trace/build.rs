//! Keeps the plugin's code in memory after QEMU has unloaded it: a virtual core may still sleep in it.

fn main() {
    println!("cargo::rustc-link-arg-cdylib=-Wl,-z,nodelete");
}
