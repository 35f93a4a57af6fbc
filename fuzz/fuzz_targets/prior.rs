//! Shape priors, `.safetensors`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| spba_ceres::prior::fuzz(data));
