//! OpenCV, behind the feature `vision`.

#[cxx::bridge(namespace = "spba::vision")]
pub mod ffi {
    /// How `remap` reads between pixels and beyond the border.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    enum Sampling {
        /// The nearest pixel; 0 outside the source.
        Nearest,
        /// Bilinear (OpenCV's bicubic bends even a linear ramp); the border's colour outside the source.
        Linear,
    }

    unsafe extern "C++" {
        include!("spba-ceres/cpp/vision/remap.h");

        /// `target[i] = source(map_x[i], map_y[i])`, all of `width` × `height` pixels of `channels` interleaved values,
        /// row-major. Map entries are in OpenCV's pixels: the centre of the top-left one is (0, 0).
        #[allow(clippy::too_many_arguments)]
        fn remap(
            source: &[f32],
            width: usize,
            height: usize,
            channels: usize,
            map_x: &[f32],
            map_y: &[f32],
            sampling: Sampling,
            target: &mut [f32],
        ) -> Result<()>;
    }
}
