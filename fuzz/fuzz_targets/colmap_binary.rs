//! `cameras.bin`, `images.bin`, `points3D.bin`; the first byte chooses.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let Some((which, data)) = data.split_first() else { return };
    let name = ["cameras.bin", "images.bin", "points3D.bin"][usize::from(*which) % 3];
    spba_ceres::sequence::fuzz(name, data);
});
