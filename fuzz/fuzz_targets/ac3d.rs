//! AC3D models.
#![no_main]

libfuzzer_sys::fuzz_target!(init: spba_ceres::quiet_guarded_panics(), |data: &[u8]| {
    let _ = spba_ceres::cad::load(&spba_ceres_fuzz::folder_with("a.ac", data).join("a.ac"));
});
