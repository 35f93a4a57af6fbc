//! Classic bundle adjustment with Ceres: of features, and photometric.

#[cxx::bridge(namespace = "spba::bridge")]
pub mod ffi {
    /// A point where a camera sees it, in pixels.
    #[derive(Clone, Copy, Debug)]
    struct Observation {
        camera: u32,
        point: u32,
        x: f64,
        y: f64,
    }

    /// All that is adjusted, and what it is adjusted to.
    #[derive(Clone, Debug)]
    struct Bundle {
        /// camera_from_world: six numbers each, axis times angle and translation. The first is the frame of the world.
        cameras: Vec<f64>,
        /// In the world: three numbers each.
        points: Vec<f64>,
        /// Multiplies fx and fy of all cameras.
        zoom: f64,
        observations: Vec<Observation>,
    }

    struct BundleOptions {
        fx: f64,
        fy: f64,
        cx: f64,
        cy: f64,
        /// Cauchy scale of a reprojection error, in pixels.
        loss_width: f64,
        /// How well the focal length is known, as the standard deviation of the zoom's logarithm; 0 keeps it.
        zoom_deviation: f64,
        max_iterations: u32,
    }

    /// A pixel with depth, and the frames that see the same.
    #[derive(Clone, Debug)]
    struct FreePixel {
        frame: u32,
        x: f64,
        y: f64,
        inverse_depth: f64,
        seen_in: Vec<u32>,
        /// After adjusting depths: root mean square of its residuals, per value of a colour, in the images' range.
        error: f64,
        /// After adjusting depths: standard deviation of `inverse_depth` with noise of 1 in the images' range.
        deviation: f64,
    }

    struct PhotometricOptions {
        fx: f64,
        fy: f64,
        cx: f64,
        cy: f64,
        width: u32,
        height: u32,
        /// Huber width of a residual, per value of a colour.
        loss_width: f64,
        max_iterations: u32,
    }

    unsafe extern "C++" {
        include!("bridge/bundle.h");
        include!("bridge/free_depth.h");

        /// Minimises what `pixels` look unlike in the frames that see them, over their inverse depths and `cameras` (camera_from_world,
        /// six numbers each); the first camera stays where it is, and the second as far from it. `images`: of every camera, RGB, row-major,
        /// one after another.
        fn adjust_photometric(
            cameras: &mut [f64],
            pixels: &mut Vec<FreePixel>,
            images: &[f32],
            options: &PhotometricOptions,
        ) -> Result<()>;

        /// The same, every pixel by itself, the cameras held; and judges the pixels. What cannot be evaluated stays where it is, and has an
        /// infinite deviation.
        fn adjust_pixel_depths(
            cameras: &[f64],
            pixels: &mut Vec<FreePixel>,
            images: &[f32],
            options: &PhotometricOptions,
        ) -> Result<()>;

        /// Minimises the reprojection errors; the first camera stays where it is, and the second as far from it. Half their sum of squares, under the loss.
        fn adjust(bundle: &mut Bundle, options: &BundleOptions) -> Result<f64>;
    }
}
