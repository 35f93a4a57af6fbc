//! Our own `sequence.toml`, beside a picture and a mask.
#![no_main]

use spba_ceres::sequence::{LoadOptions, examine};

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let folder = spba_ceres_fuzz::folder_with("sequence.toml", data);
    let _ = examine(folder, &LoadOptions::default());
});
