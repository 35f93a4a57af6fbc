//! Compiles our C++ and links what it needs.

use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed=build.rs");
    if std::env::var_os("CARGO_FEATURE_VISION").is_some() {
        build_vision()?;
    }
    Ok(())
}

/// OpenCV's core and imgproc only: `pkg-config --libs opencv4` would link every module it has.
fn build_vision() -> Result<(), Box<dyn Error>> {
    let opencv = pkg_config::Config::new()
        .cargo_metadata(false)
        .atleast_version("4.5")
        .probe("opencv4")
        .map_err(|error| {
            format!("OpenCV is needed (Debian: libopencv-dev), or --no-default-features: {error}")
        })?;
    cxx_build::bridge("src/bridge/vision.rs")
        .file("cpp/vision/remap.cc")
        .includes(&opencv.include_paths)
        .std("c++17")
        .flag_if_supported("-Wno-deprecated-enum-enum-conversion")
        .try_compile("spba_vision")?;
    for path in &opencv.link_paths {
        println!("cargo:rustc-link-search=native={}", path.display());
    }
    for library in ["opencv_imgproc", "opencv_core"] {
        println!("cargo:rustc-link-lib={library}");
    }
    println!("cargo:rerun-if-changed=cpp/vision");
    println!("cargo:rerun-if-changed=src/bridge/vision.rs");
    Ok(())
}
