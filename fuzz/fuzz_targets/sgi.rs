//! SGI pictures, as textures of a model.
#![no_main]

libfuzzer_sys::fuzz_target!(init: spba_ceres::quiet_guarded_panics(), |data: &[u8]| {
    // Told by content.
    let data = [&[0x01, 0xda], data].concat();
    spba_ceres_fuzz::folder_with("a.rgb", &data);
    let _ = spba_ceres::cad::load(&spba_ceres_fuzz::folder_with("a.ac", spba_ceres_fuzz::TEXTURED).join("a.ac"));
});
