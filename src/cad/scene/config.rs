//! What a scene file says. Lengths are in object diagonals unless the name says otherwise.

use super::super::{CadError, SourceSpec};
use super::Lighting;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A scene file (TOML). Everything but `seed`, `model` and `arc` has a default.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// The seed of everything random: noise, holes, blotches, jitter. The same file and seed give the same bytes.
    pub seed: u64,
    /// Must leave exactly one model.
    pub model: SourceSpec,
    /// The camera's path about the object.
    pub arc: Arc,
    /// The camera's image size and intrinsics.
    #[serde(default)]
    pub camera: Camera,
    /// The light and how it changes over the sequence.
    #[serde(default)]
    pub light: Lighting,
    /// What stands behind the object.
    #[serde(default)]
    pub background: Background,
    /// Standard deviation of the lens's Gaussian blur, pixels; the sensor's noise comes after it.
    #[serde(default)]
    pub blur_px: f64,
    /// Standard deviation of the sensor's noise, grey levels.
    #[serde(default = "default_image_noise")]
    pub image_noise: f64,
    /// Samples along each side of a pixel, odd.
    #[serde(default = "default_samples_per_axis")]
    pub samples_per_axis: usize,
    /// What draws the frames, their masks and their true depth.
    #[serde(default)]
    pub via: Via,
    /// Points of the true shape, at most.
    #[serde(default = "default_truth_points")]
    pub truth_points: usize,
    /// The noise and the frame of the simulated off-the-shelf poses.
    #[serde(default)]
    pub input: SimulatedInput,
    /// The holes and the noise of the simulated off-the-shelf depth.
    #[serde(default)]
    pub depth: SimulatedDepth,
}

/// A renderer. Both draw the same scene, but for single rays at edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Via {
    /// Our rasteriser.
    #[default]
    Own,
    /// Blender, which must be installed.
    Blender,
}

/// The camera's path: see [`super::super::orbit`] for the angles.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Arc {
    /// The number of frames.
    pub frames: usize,
    /// Azimuths of the first and the last frame, degrees; 0 looks at the front, 90 at the object's right side.
    pub azimuth_deg: [f64; 2],
    /// The camera's height above the object's horizontal plane, degrees.
    pub elevation_deg: f64,
    /// The distance of the camera's centre from the object's, diagonals.
    pub distance: f64,
    /// The frame rate, from which the timestamps come.
    #[serde(default = "default_frames_per_second")]
    pub frames_per_second: f64,
    /// The random deviation of single frames from the path.
    #[serde(default)]
    pub jitter: Jitter,
}

/// Standard deviations of what differs from frame to frame.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Jitter {
    /// Standard deviation of azimuth, elevation and roll, degrees.
    pub angle_deg: f64,
    /// Standard deviation of the distance, as a share of it.
    pub distance: f64,
    /// Standard deviation of the camera's shift across its line of sight, diagonals.
    pub aim: f64,
    /// Standard deviation of the focal length, as a share of it.
    pub zoom: f64,
}

/// The camera of all frames, a pinhole with square pixels.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Camera {
    /// The width of the image, pixels.
    pub width_px: usize,
    /// The height of the image, pixels.
    pub height_px: usize,
    /// The focal length, pixels.
    pub focal_px: f64,
    /// Off the middle, so that a mistake in it shows. The centre of the top-left pixel is (0.5, 0.5).
    pub principal_px: [f64; 2],
}

/// A picture that stays still before the camera while the object moves: blotches, or a photograph.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Background {
    /// PNG or JPEG to show instead of blotches, scaled to cover the frame and cropped about its middle.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub image: Option<PathBuf>,
    /// Mean colour, RGB in \[0, 255\].
    pub colour: [f64; 3],
    /// Half the range of the blotches, grey levels.
    pub contrast: f64,
    /// Size of the largest blotches, pixels.
    pub size_px: f64,
}

/// Off-the-shelf poses: the true ones with noise, in a frame of their own:
/// x_input = scale · R(rotation) x_object + translation.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SimulatedInput {
    /// The number of input units in one diagonal of the object.
    pub scale: f64,
    /// The rotation R as axis times angle, degrees.
    pub rotation_deg: [f64; 3],
    /// The origin of the object frame in the input's frame, input units.
    pub translation: [f64; 3],
    /// Standard deviation of each frame's rotation about the object's centre, per axis.
    pub rotation_noise_deg: f64,
    /// Standard deviation of each frame's translation, per axis, share of the distance.
    pub translation_noise: f64,
}

/// Off-the-shelf semi-dense depth, in input units.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SimulatedDepth {
    /// Only pixels with at least this gradient have depth, grey levels per pixel.
    pub min_gradient: f64,
    /// Share of the picture lost to blotchy holes.
    pub holes: f64,
    /// Standard deviation, share of z.
    pub noise: f64,
    /// Share of the object's depths that are wrong, by up to 30 % of z.
    pub outliers: f64,
    /// Share of the textured pixels off the object that have (wrong) depth.
    pub background: f64,
}

impl Default for Camera {
    fn default() -> Self {
        Self {
            width_px: 320,
            height_px: 240,
            focal_px: 400.0,
            principal_px: [161.5, 118.75],
        }
    }
}

impl Default for Background {
    fn default() -> Self {
        Self {
            image: None,
            colour: [120.0, 125.0, 115.0],
            contrast: 60.0,
            size_px: 80.0,
        }
    }
}

impl Default for SimulatedInput {
    fn default() -> Self {
        Self {
            scale: 2.7,
            rotation_deg: [20.0, -70.0, 35.0],
            translation: [0.8, -1.7, 2.3],
            rotation_noise_deg: 0.4,
            translation_noise: 0.003,
        }
    }
}

impl Default for SimulatedDepth {
    fn default() -> Self {
        Self {
            min_gradient: 6.0,
            holes: 0.25,
            noise: 0.005,
            outliers: 0.05,
            background: 0.3,
        }
    }
}

fn default_image_noise() -> f64 {
    1.5
}

fn default_samples_per_axis() -> usize {
    5
}

fn default_truth_points() -> usize {
    20_000
}

fn default_frames_per_second() -> f64 {
    10.0
}

impl Scene {
    /// Every option in its range.
    pub(super) fn check(&self) -> Result<(), CadError> {
        self.arc.check()?;
        self.camera.check()?;
        self.light.check()?;
        self.input.check()?;
        self.depth.check()?;
        require(
            (1..=15).contains(&self.samples_per_axis) && self.samples_per_axis % 2 == 1,
            "samples_per_axis",
            "give an odd number up to 15",
        )?;
        require(self.truth_points > 0, "truth_points", "give more than 0")?;
        require((0.0..=20.0).contains(&self.blur_px), "blur_px", "give 0 to 20")?;
        require(
            self.image_noise >= 0.0 && self.image_noise.is_finite(),
            "image_noise",
            "give 0 or more",
        )?;
        require(
            positive(self.background.size_px),
            "background.size_px",
            "give more than 0",
        )?;
        require(
            finite(&self.background.colour) && self.background.contrast.is_finite(),
            "background",
            "give finite numbers",
        )?;
        Ok(())
    }
}

impl Arc {
    fn check(&self) -> Result<(), CadError> {
        require(
            (2..=10_000).contains(&self.frames),
            "arc.frames",
            "give 2 to 10000",
        )?;
        require(
            finite(&self.azimuth_deg),
            "arc.azimuth_deg",
            "give two finite angles",
        )?;
        require(
            self.elevation_deg.abs() < 90.0,
            "arc.elevation_deg",
            "give less than 90",
        )?;
        require(
            positive(self.distance) && self.distance > 0.6,
            "arc.distance",
            "give more than 0.6, outside of the object",
        )?;
        require(
            positive(self.frames_per_second),
            "arc.frames_per_second",
            "give more than 0",
        )?;
        let jitter = &self.jitter;
        require(
            (0.0..45.0).contains(&jitter.angle_deg),
            "arc.jitter.angle_deg",
            "give 0 to 45",
        )?;
        require(
            spread(jitter.distance),
            "arc.jitter.distance",
            "give 0 to below 1",
        )?;
        require(spread(jitter.aim), "arc.jitter.aim", "give 0 to below 1")?;
        require(
            (0.0..0.2).contains(&jitter.zoom),
            "arc.jitter.zoom",
            "give 0 to below 0.2",
        )?;
        Ok(())
    }
}

impl Camera {
    fn check(&self) -> Result<(), CadError> {
        require(size(self.width_px), "camera.width_px", "give 1 to 8192")?;
        require(size(self.height_px), "camera.height_px", "give 1 to 8192")?;
        require(positive(self.focal_px), "camera.focal_px", "give more than 0")?;
        require(
            finite(&self.principal_px),
            "camera.principal_px",
            "give two finite numbers",
        )?;
        Ok(())
    }
}

impl Lighting {
    fn check(&self) -> Result<(), CadError> {
        let length: f64 = self.direction.iter().map(|x| x * x).sum();
        require(
            positive(length),
            "light.direction",
            "give a direction other than 0",
        )?;
        require(
            finite(&[self.ambient, self.diffuse]),
            "light",
            "give finite numbers",
        )?;
        require(finite(&self.turn_deg), "light.turn_deg", "give two finite angles")?;
        require(
            finite(&self.brightness) && self.brightness.iter().all(|&factor| factor >= 0.0),
            "light.brightness",
            "give two factors of 0 or more",
        )?;
        Ok(())
    }
}

impl SimulatedInput {
    fn check(&self) -> Result<(), CadError> {
        require(positive(self.scale), "input.scale", "give more than 0")?;
        require(
            finite(&self.rotation_deg) && finite(&self.translation),
            "input",
            "give finite numbers",
        )?;
        require(
            (0.0..90.0).contains(&self.rotation_noise_deg),
            "input.rotation_noise_deg",
            "give 0 to below 90",
        )?;
        require(
            spread(self.translation_noise),
            "input.translation_noise",
            "give 0 to below 1",
        )?;
        Ok(())
    }
}

impl SimulatedDepth {
    fn check(&self) -> Result<(), CadError> {
        require(self.min_gradient >= 0.0, "depth.min_gradient", "give 0 or more")?;
        require(
            (0.0..0.3).contains(&self.noise),
            "depth.noise",
            "give 0 to below 0.3",
        )?;
        for (value, field) in [
            (self.holes, "depth.holes"),
            (self.outliers, "depth.outliers"),
            (self.background, "depth.background"),
        ] {
            require(share(value), field, "give a share from 0 to 1")?;
        }
        Ok(())
    }
}

fn require(holds: bool, field: &'static str, problem: &str) -> Result<(), CadError> {
    match holds {
        true => Ok(()),
        false => Err(CadError::Scene {
            field,
            problem: problem.to_owned(),
        }),
    }
}

fn positive(value: f64) -> bool {
    value.is_finite() && value > 0.0
}

fn share(value: f64) -> bool {
    (0.0..=1.0).contains(&value)
}

fn spread(value: f64) -> bool {
    (0.0..1.0).contains(&value)
}

fn finite(values: &[f64]) -> bool {
    values.iter().all(|value| value.is_finite())
}

fn size(value: usize) -> bool {
    (1..=8192).contains(&value)
}
