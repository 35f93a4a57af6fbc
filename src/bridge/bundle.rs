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
        /// six numbers each). Of those that see something, the first stays where it is, and the one farthest from it as far. `images`: of
        /// every camera, RGB, row-major, one after another.
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
    use super::ffi::{
        Bundle, BundleOptions, FreePixel, Observation, PhotometricOptions, adjust, adjust_photometric,
    };
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

    /// Reconstructions start with any pair of frames, so that the frame of the world is any camera's.
    #[test]
    fn photometric_adjustment_holds_the_first_and_the_farthest_camera() {
        let (width, height) = (96u32, 64u32);
        let camera = Pinhole {
            fx: 80.0,
            fy: 80.0,
            cx: 48.0,
            cy: 32.0,
        };
        // Of the second camera's axes, a surface with waves, and its colours.
        let surface = |x: f64, y: f64| 4.0 + 0.4 * (1.7 * x + 0.3).sin() * (1.3 * y).cos();
        let colour = |at: Vector3<f64>| {
            let wave = |a: f64, b: f64| 120.0 + 90.0 * (a * at.x + b * at.y).sin();
            [wave(3.0, 1.0), wave(-1.0, 2.5), wave(2.0, -2.0)]
        };
        let centres = [-0.35, 0.0, 0.45];
        let seen = |k: usize, column: f64, row: f64| {
            let ray = camera.unproject(&nalgebra::Vector2::new(column, row), 1.0);
            let centre = Vector3::x() * centres[k];
            let z = (0..60).fold(4.0, |z, _| {
                let at = centre + z * ray;
                surface(at.x, at.y)
            });
            (centre + z * ray, z)
        };
        let mut images = Vec::new();
        for k in 0..3 {
            for row in 0..height {
                for column in 0..width {
                    let (at, _) = seen(k, f64::from(column) + 0.5, f64::from(row) + 0.5);
                    images.extend(colour(at).map(|value| value as f32));
                }
            }
        }
        let twist = |x: f64, off: f64| [0.3 * off, -0.2 * off, 0.1 * off, -x, 0.5 * off, -0.4 * off];
        let start = [
            twist(centres[0], 0.0),
            twist(centres[1], 0.01),
            twist(centres[2], -0.01),
        ]
        .concat();
        let mut pixels = Vec::new();
        for frame in 0..3u32 {
            for (column, row) in
                (1..8).flat_map(|i| (1..6).map(move |j| (12.0 * f64::from(i), 10.0 * f64::from(j))))
            {
                let (at, z) = seen(frame as usize, column, row);
                let seen_in = (0..3).filter(|&other| {
                    let x = at.x - centres[other as usize];
                    other != frame && (80.0 * x / z).abs() < 40.0
                });
                pixels.push(FreePixel {
                    frame,
                    x: column,
                    y: row,
                    inverse_depth: 0.99 / z,
                    seen_in: seen_in.collect(),
                    error: 0.0,
                    deviation: 0.0,
                });
            }
        }
        let options = PhotometricOptions {
            fx: camera.fx,
            fy: camera.fy,
            cx: camera.cx,
            cy: camera.cy,
            width,
            height,
            loss_width: 10.0,
            max_iterations: 40,
        };
        let adjusted = |second_at_origin: bool| {
            let (mut cameras, mut pixels) = (start.clone(), pixels.clone());
            if second_at_origin {
                cameras[6..12].fill(0.0);
            }
            let pose = |cameras: &[f64], k: usize| {
                Pose::from_twist(&Vector6::from_column_slice(&cameras[6 * k..][..6]))
            };
            let apart = |cameras: &[f64]| {
                let centre = |k| pose(cameras, k).inverse().translation;
                (centre(2) - centre(0)).norm()
            };
            let before = cameras.clone();
            adjust_photometric(&mut cameras, &mut pixels, &images, &options).unwrap();
            assert_eq!(cameras[..6], before[..6]);
            assert!((apart(&cameras) / apart(&before) - 1.0).abs() < 1e-6);
            assert_ne!(cameras[6..12], before[6..12]);
            assert_ne!(cameras[12..], before[12..]);
        };
        adjusted(false);
        adjusted(true);
    }
}
