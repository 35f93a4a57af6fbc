//! openMVS's `depth*.dmap`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| spba_ceres::sequence::fuzz("depth0000.dmap", data));
