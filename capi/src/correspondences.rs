//! The solver's correspondences for a problem of the host's own.

use spba_ceres::config::Config;
use spba_ceres::init::Estimate;
use spba_ceres::objective::{self, ComparedPoint, KnownInverseDepth};
use spba_ceres::prior::{LearnedPrior, ShapePrior};
use spba_host::fault::Fault;
use spba_host::frames::{CPose, Frames};
use spba_host::solve::thread_count;
use std::sync::Arc;

/// What may be an α.
const SCALES: std::ops::RangeInclusive<f64> = 1e-9..=1e9;

#[derive(Clone, Copy)]
#[repr(C)]
pub struct CComparedPoint {
    point: u32,
    frame_a: u32,
    frame_b: u32,
    reserved: u32,
    weight: f64,
}

impl From<&ComparedPoint> for CComparedPoint {
    fn from(compared: &ComparedPoint) -> Self {
        Self {
            point: compared.point,
            frame_a: compared.frame_a,
            frame_b: compared.frame_b,
            reserved: 0,
            weight: compared.weight,
        }
    }
}

#[derive(Clone, Copy)]
#[repr(C)]
pub struct CKnownInverseDepth {
    point: u32,
    frame: u32,
    pixel: [f64; 2],
    inverse_depth: f64,
    slope: [f64; 2],
    weight: f64,
}

impl From<&KnownInverseDepth> for CKnownInverseDepth {
    fn from(known: &KnownInverseDepth) -> Self {
        Self {
            point: known.point,
            frame: known.frame,
            pixel: known.pixel,
            inverse_depth: known.inverse_depth,
            slope: known.slope,
            weight: known.weight,
        }
    }
}

/// `spba_correspondences`.
pub struct Correspondences {
    pub found: objective::Correspondences,
    pub compared: Vec<CComparedPoint>,
    pub inverse_depths: Vec<CKnownInverseDepth>,
}

/// What a host says of where its problem stands.
///
/// # Errors
/// A quaternion that is none, a number that is not finite, an α that is no scale.
pub fn estimate(poses: &[CPose], style: &[f64], alpha: f64) -> Result<Estimate, Fault> {
    let pose = |(index, pose): (usize, &CPose)| {
        let what = format!("cam_from_object[{index}]");
        if !pose.translation.iter().all(|x| x.is_finite()) {
            return Err(Fault::input(
                format!("{what}.translation"),
                "it is not finite",
                "give three numbers",
            ));
        }
        pose.checked(&what)
    };
    if let Some(index) = style.iter().position(|x| !x.is_finite()) {
        return Err(Fault::input(
            format!("style[{index}]"),
            "it is not finite",
            "give finite numbers",
        ));
    }
    if !SCALES.contains(&alpha) {
        return Err(Fault::input(
            "alpha",
            format!("it is {alpha:e}"),
            "give object diagonals a unit of the poses, 1e-9 to 1e9",
        ));
    }
    Ok(Estimate {
        camera_from_object: poses.iter().enumerate().map(pose).collect::<Result<_, _>>()?,
        style: style.to_vec(),
        alpha,
        focal_factor: 1.0,
    })
}

impl Correspondences {
    /// # Errors
    /// Frames that are no sequence, and options that do not fit.
    pub fn new(
        frames: &Frames,
        prior: &Arc<LearnedPrior>,
        config: &Config,
        start: impl FnOnce(usize) -> Result<Estimate, Fault>,
    ) -> Result<Self, Fault> {
        let sequence = Arc::new(frames.sequence()?);
        let count = sequence.frames.len();
        let target = config
            .input
            .target_of(count)
            .map_err(|error| Fault::Target(error.to_string()))?;
        let prior: Arc<dyn ShapePrior> = prior.clone();
        let start = start(count)?;
        let threads = thread_count(config);
        let found =
            objective::Correspondences::new(sequence, prior, &config.objective, target, &start, threads)?;
        let mut made = Self {
            found,
            compared: Vec::new(),
            inverse_depths: Vec::new(),
        };
        made.keep();
        Ok(made)
    }

    /// # Errors
    /// An estimate of another size.
    pub fn update(&mut self, estimate: &Estimate) -> Result<(), Fault> {
        self.found.update(estimate)?;
        self.keep();
        Ok(())
    }

    fn keep(&mut self) {
        self.compared = self.found.compared().iter().map(Into::into).collect();
        self.inverse_depths = self.found.depths().iter().map(Into::into).collect();
    }
}
