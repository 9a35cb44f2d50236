//! What the linker is told when the module for browsers is made.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if std::env::var("CARGO_CFG_TARGET_FAMILY").is_ok_and(|family| family == "wasm") {
        // Numbers that the linker fills in need no room for longer ones.
        println!("cargo::rustc-link-arg-cdylib=--compress-relocations");
    }
}
