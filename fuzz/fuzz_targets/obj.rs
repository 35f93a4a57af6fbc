//! Wavefront OBJ; what follows a zero byte is its MTL.
#![no_main]

libfuzzer_sys::fuzz_target!(init: spba_ceres::quiet_guarded_panics(), |data: &[u8]| {
    let (obj, mtl) = spba_ceres_fuzz::split(data);
    spba_ceres_fuzz::folder_with("a.mtl", mtl);
    let _ = spba_ceres::cad::load(&spba_ceres_fuzz::folder_with("a.obj", obj).join("a.obj"));
});
