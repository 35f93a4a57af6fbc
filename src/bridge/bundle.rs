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

#[cfg(test)]
mod tests {
    use super::ffi::{Bundle, BundleOptions, Observation, adjust};
    use crate::geometry::{Pinhole, Pose, Vector3};
    use nalgebra::Vector6;

    #[test]
    fn the_first_camera_and_the_distance_to_the_second_stay() {
        let camera = Pinhole {
            fx: 300.0,
            fy: 300.0,
            cx: 160.0,
            cy: 120.0,
        };
        // The first camera is the frame of the world.
        let poses: Vec<Pose> = (0..4)
            .map(|l| 0.3 * f64::from(l))
            .map(|l| Pose::from_twist(&Vector6::new(0.1 * l, -l, 0.02 * l, 2.7 * l, 0.3 * l, 0.6 * l)))
            .collect();
        let share = |i: usize, prime: f64| (i as f64 * prime).fract() - 0.5;
        let points: Vec<Vector3<f64>> = (0..40)
            .map(|i| Vector3::new(share(i, 0.819), share(i, 0.671), 3.0 + share(i, 0.549)))
            .collect();
        let mut observations = Vec::new();
        for (k, pose) in poses.iter().enumerate() {
            for (i, point) in points.iter().enumerate() {
                let pixel = camera.project(&pose.transform(point)).unwrap();
                observations.push(Observation {
                    camera: k as u32,
                    point: i as u32,
                    // Not quite where it is seen, so that nothing fits exactly.
                    x: pixel.x + 0.2 * share(7 * i + k, 0.317),
                    y: pixel.y + 0.2 * share(5 * i + k, 0.731),
                });
            }
        }
        // Points are taken for nearer than they are: a smaller world would fit them as well.
        let start = Bundle {
            cameras: poses
                .iter()
                .flat_map(|pose| pose.to_twist().as_slice().to_vec())
                .collect(),
            points: points
                .iter()
                .flat_map(|point| (0.8 * point).as_slice().to_vec())
                .collect(),
            zoom: 1.0,
            observations,
        };
        let mut bundle = start.clone();
        let options = BundleOptions {
            fx: camera.fx,
            fy: camera.fy,
            cx: camera.cx,
            cy: camera.cy,
            loss_width: 2.0,
            zoom_deviation: 0.0,
            max_iterations: 40,
        };
        adjust(&mut bundle, &options).unwrap();
        assert_eq!(bundle.cameras[..6], start.cameras[..6]);
        assert_eq!(bundle.zoom, 1.0);
        let baseline = |bundle: &Bundle| Vector3::from_column_slice(&bundle.cameras[9..12]).norm();
        assert!((baseline(&bundle) / baseline(&start) - 1.0).abs() < 1e-6);
        for (found, point) in bundle.points.chunks_exact(3).zip(&points) {
            let off = (Vector3::from_column_slice(found) - point).norm();
            assert!(off < 0.02, "{off}");
        }
        // Cameras in one place leave no unit of length.
        bundle.cameras[9..12].fill(0.0);
        let refused = adjust(&mut bundle, &options).unwrap_err();
        assert!(refused.what().contains("second camera"), "{}", refused.what());
    }
}
