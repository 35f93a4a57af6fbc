//! EXR depth maps and PLY clouds; the first byte chooses.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let Some((which, data)) = data.split_first() else { return };
    if which % 2 == 0 {
        let _ = spba_ceres::image::read_depth(&spba_ceres_fuzz::folder_with("a.exr", data).join("a.exr"));
    } else {
        let _ = spba_ceres::report::read_shape(&spba_ceres_fuzz::folder_with("a.ply", data).join("a.ply"));
    }
});
