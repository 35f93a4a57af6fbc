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

    /// 8-bit RGB, row-major.
    #[derive(Clone, Debug, Default)]
    struct Picture {
        width: usize,
        height: usize,
        rgb: Vec<u8>,
        /// Since the start of its video; 0 of a photo.
        seconds: f64,
    }

    /// The mixtures of colours of what GrabCut took for background and object, as OpenCV keeps them.
    #[derive(Clone, Debug, Default)]
    struct Colours {
        background: Vec<f64>,
        object: Vec<f64>,
    }

    /// The options of feature detection.
    #[derive(Clone, Copy, Debug)]
    struct DetectOptions {
        /// The image is looked at so many times larger.
        zoom: f64,
        /// SIFT's threshold; OpenCV's default is 0.04.
        contrast: f64,
        /// The maximum number of features; the strongest are kept.
        max_features: usize,
    }

    /// Where a feature is; the centre of the top-left pixel is (0.5, 0.5).
    #[derive(Clone, Copy, Debug)]
    struct Feature {
        x: f64,
        y: f64,
    }

    /// A pose `x_b = R x_a + t`, R row-major, if there is any.
    #[derive(Clone, Copy, Debug)]
    struct Found {
        any: bool,
        rotation: [f64; 9],
        translation: [f64; 3],
    }

    unsafe extern "C++" {
        include!("spba-ceres/cpp/vision/features.h");
        include!("spba-ceres/cpp/vision/flow.h");
        include!("spba-ceres/cpp/vision/remap.h");
        include!("spba-ceres/cpp/vision/segment.h");
        include!("spba-ceres/cpp/vision/video.h");

        type Video;
        /// Null where the file is no video that OpenCV can decode.
        fn open_video(path: &str) -> Result<UniquePtr<Video>>;
        /// How many frames the file announces; not positive where it does not say.
        fn announced(self: &Video) -> f64;
        /// The next frame, in RGB, turned as players turn it, of square pixels; false at the end, or where no further one can be decoded.
        fn next(self: Pin<&mut Video>, picture: &mut Picture) -> Result<bool>;
        /// The variance of a picture's Laplacian.
        fn sharpness(picture: &Picture) -> Result<f64>;
        /// At another size: averaged over what each pixel covers, bilinear where both sides grow.
        fn resized(picture: &Picture, width: usize, height: usize) -> Result<Picture>;

        /// GrabCut. `labels` per pixel: 0 background, 1 object, 2 probably background, 3 probably object; the last two are decided
        /// anew. `learn` starts with colours from the labels, otherwise with the given ones; both leave their own.
        fn grab_cut(
            picture: &Picture,
            labels: &mut [u8],
            colours: &mut Colours,
            learn: bool,
            iterations: usize,
        ) -> Result<()>;
        /// Leaves of a mask (0, 1) what is wider than `radius` pixels and largest, its holes closed.
        fn clean(mask: &mut [u8], width: usize, height: usize, radius: usize) -> Result<()>;
        /// The parts of a mask (0, 1) that are wider than `radius` pixels: 1, 2, … of each, 0 elsewhere.
        fn parts(mask: &[u8], width: usize, height: usize, radius: usize) -> Result<Vec<u16>>;
        /// A mask (0, 1) so many pixels wider, or narrower.
        fn grow(mask: &mut [u8], width: usize, height: usize, by: i32) -> Result<()>;

        /// What `map`, a byte per pixel of `from`, is in `to`, a picture of the same size, by optical flow between the two.
        fn carried(map: &[u8], from: &Picture, to: &Picture) -> Result<Vec<u8>>;

        /// SIFT features where the mask is not 0, the strongest first, and their descriptors (128 each, the roots of shares), appended.
        fn detect(
            gray: &[u8],
            mask: &[u8],
            width: usize,
            height: usize,
            options: &DetectOptions,
            descriptors: &mut Vec<f32>,
        ) -> Result<Vec<Feature>>;
        /// b_from_a from rays (x, y on the plane z = 1) by the five-point algorithm and RANSAC; its translation has length 1.
        /// `inliers`, one per pair, are those within `threshold` and before both cameras.
        fn two_views(a: &[f64], b: &[f64], threshold: f64, inliers: &mut [u8]) -> Result<Found>;
        /// camera_from_space of `points` (xyz) seen along `rays` (x, y on the plane z = 1), by RANSAC.
        fn resect(points: &[f64], rays: &[f64], threshold: f64, inliers: &mut [u8]) -> Result<Found>;

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
