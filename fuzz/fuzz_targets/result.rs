//! `result.json`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let _ = spba_ceres::report::RunResult::load(spba_ceres_fuzz::folder_with("result.json", data));
});
