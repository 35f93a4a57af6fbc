//! openMVS's `scene.mvs`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| spba_ceres::sequence::fuzz("scene.mvs", data));
