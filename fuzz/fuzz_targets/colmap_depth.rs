//! COLMAP's `*.geometric.bin`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| spba_ceres::sequence::fuzz("a.geometric.bin", data));
