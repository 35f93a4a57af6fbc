//! Compiles the C++ side: the Ceres problem, and with the feature `vision` what calls OpenCV.

fn main() {
    build_solver();
}


fn build_solver() {
    let eigen = pkg_config::Config::new()
        .cargo_metadata(false)
        .probe("eigen3")
        .unwrap_or_else(|error| panic!("Eigen is missing; apt-get install libeigen3-dev: {error}"));
    let mut build = cxx_build::bridge("src/bridge/ceres.rs");
    build
        .files(["cpp/src/nearest.cc", "cpp/src/state.cc", "cpp/src/objective.cc", "cpp/src/problem.cc", "cpp/src/solve.cc"])
        .include("cpp/include")
        .include("cpp/src")
        .std("c++17")
        // An unoptimised Eigen is fifty times slower, in tests too.
        .opt_level(3)
        .flag("-Wall")
        .flag("-Wextra")
        .flag("-Werror");
    for path in eigen.include_paths {
        build.flag(format!("-isystem{}", path.display()));
    }
    build.compile("spba_ceres_cpp");
    println!("cargo:rustc-link-lib=ceres");
    println!("cargo:rustc-link-lib=glog");
    println!("cargo:rerun-if-changed=cpp");
}
