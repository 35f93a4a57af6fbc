//! Compiles our C++ and links what it needs: Ceres for the solver, OpenCV with the feature `vision`.

use std::error::Error;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed=build.rs");
    build_solver()?;
    if std::env::var_os("CARGO_FEATURE_VISION").is_some() {
        build_vision()?;
    }
    Ok(())
}

fn build_solver() -> Result<(), Box<dyn Error>> {
    let eigen = pkg_config::Config::new()
        .cargo_metadata(false)
        .probe("eigen3")
        .map_err(|error| format!("Eigen is needed (Debian: libeigen3-dev): {error}"))?;
    let core = [
        "accumulated_cost",
        "blocks",
        "coordinates",
        "free_depth",
        "geometry",
        "minimise",
        "nearest",
        "objective",
        "parallel",
        "pixel_depth",
        "posed_cameras",
        "reprojection_block",
        "scaling",
        "shape",
        "system",
        "terms/focal",
        "terms/inverse_depth",
        "terms/motion",
        "terms/photometric",
        "terms/silhouette",
        "terms/style",
        "views",
    ]
    .map(|name| format!("cpp/core/{name}.cc"));
    let bridge =
        ["bundle", "free_depth", "logs", "memory", "problem"].map(|name| format!("cpp/bridge/{name}.cc"));
    let sources = [&core[..], &bridge].concat();
    compile(
        &["src/bridge/bundle.rs", "src/bridge/ceres.rs"],
        &sources,
        &eigen.include_paths,
        "spba_ceres_cpp",
    )?;
    for library in ["ceres", "glog"] {
        println!("cargo:rustc-link-lib={library}");
    }
    println!("cargo:rerun-if-changed=cpp/core");
    println!("cargo:rerun-if-changed=cpp/bridge");
    println!("cargo:rerun-if-changed=cpp/include");
    Ok(())
}

/// The modules of OpenCV in use only: `pkg-config --libs opencv4` would link every module it has.
fn build_vision() -> Result<(), Box<dyn Error>> {
    let opencv = pkg_config::Config::new()
        .cargo_metadata(false)
        .atleast_version("4.5")
        .probe("opencv4")
        .map_err(|error| {
            format!("OpenCV is needed (Debian: libopencv-dev), or --no-default-features: {error}")
        })?;
    compile(
        &["src/bridge/vision.rs"],
        &["features", "flow", "remap", "segment", "video"].map(|name| format!("cpp/vision/{name}.cc")),
        &opencv.include_paths,
        "spba_vision",
    )?;
    for path in &opencv.link_paths {
        println!("cargo:rustc-link-search=native={}", path.display());
    }
    for library in [
        "opencv_videoio",
        "opencv_video",
        "opencv_features2d",
        "opencv_calib3d",
        "opencv_imgproc",
        "opencv_core",
    ] {
        println!("cargo:rustc-link-lib={library}");
    }
    println!("cargo:rerun-if-changed=cpp/vision");
    Ok(())
}

/// Bridges and their C++ into one static library; warnings are errors, except in the libraries' headers.
fn compile(
    bridges: &[&str],
    sources: &[String],
    includes: &[PathBuf],
    name: &str,
) -> Result<(), Box<dyn Error>> {
    let mut build = cxx_build::bridges(bridges);
    build
        .files(sources)
        .include("cpp/include")
        .include("cpp")
        .std("c++17")
        // An unoptimised Eigen is fifty times slower, in tests too.
        .opt_level(3)
        .flags(["-Wall", "-Wextra", "-Werror"])
        // A root needs no call for the sake of errno.
        .flag("-fno-math-errno")
        // Lines alone: Ceres' templates described in full are a hundred megabytes in each of thirty programs.
        .flag("-g1");
    if std::env::var("PROFILE").is_ok_and(|profile| profile == "release") {
        build.define("NDEBUG", None);
    }
    for path in includes {
        build.flag(format!("-isystem{}", path.display()));
    }
    build.try_compile(name)?;
    for bridge in bridges {
        println!("cargo:rerun-if-changed={bridge}");
    }
    Ok(())
}
