//! `cameras.txt`, `images.txt`, `points3D.txt`; the first byte chooses.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let Some((which, data)) = data.split_first() else { return };
    let name = ["cameras.txt", "images.txt", "points3D.txt"][usize::from(*which) % 3];
    spba_ceres::sequence::fuzz(name, data);
});
