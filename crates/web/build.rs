//! Linker options of the module for browsers.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if std::env::var("CARGO_CFG_TARGET_FAMILY").is_ok_and(|family| family == "wasm") {
        // Relocations need no padding for longer numbers.
        println!("cargo::rustc-link-arg-cdylib=--compress-relocations");
    }
}
