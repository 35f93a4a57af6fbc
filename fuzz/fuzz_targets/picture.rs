//! PNG and JPEG, as pictures and as masks, and their EXIF data.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| spba_ceres::image::fuzz(data));
