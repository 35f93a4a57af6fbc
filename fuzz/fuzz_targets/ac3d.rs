//! AC3D models.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let _ = spba_ceres::cad::load(&spba_ceres_fuzz::folder_with("a.ac", data).join("a.ac"));
});
