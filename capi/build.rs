//! Gives the library its SONAME, and exports nothing but the functions of `include/spba/spba.h`.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=spba.map");
    let folder = std::env::var("CARGO_MANIFEST_DIR").unwrap_or_else(|_| ".".to_owned());
    println!("cargo:rustc-cdylib-link-arg=-Wl,-soname,libspba.so.0");
    println!("cargo:rustc-cdylib-link-arg=-Wl,--version-script={folder}/spba.map");
    // rustc's own script names what the bridge between Rust and C++ exports, too; that comes from archives.
    println!("cargo:rustc-cdylib-link-arg=-Wl,--exclude-libs,ALL");
    println!("cargo:rustc-cdylib-link-arg=-Wl,--no-undefined");
}
