//! Which kind of prior to learn, and how.

use super::Models;
use clap::ValueEnum;
use clap::builder::RangedU64ValueParser;
use spba_ceres::prior::learn::{LearnError, augmented};
use spba_ceres::prior::{LearnedPrior, LinearPrior};
use std::path::Path;

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Kind {
    /// Principal components.
    Linear,
    /// A network with two hidden layers; needs a build with the feature `training`.
    Decoder,
}

impl Kind {
    pub fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Decoder => "decoder",
        }
    }

    /// Refuses what this build cannot learn.
    pub fn check(self) -> Result<(), LearnError> {
        if self == Self::Linear || cfg!(feature = "training") {
            Ok(())
        } else {
            Err(LearnError::NoTraining)
        }
    }
}

/// A decoder's own options.
#[derive(clap::Args)]
pub struct Network {
    /// Decoder: outputs of each of the two hidden layers.
    #[arg(long, value_name = "M", default_value_t = 64, value_parser = RangedU64ValueParser::<usize>::new().range(1..=1024))]
    pub width: usize,
    /// Decoder: steps of training.
    #[arg(long, value_name = "N", default_value_t = 4000)]
    pub steps: usize,
}

/// What is learned from: corresponded shapes, those made of them not among them, and the mean's normals.
pub struct Learning<'a> {
    pub models: &'a Models,
    #[cfg_attr(not(feature = "training"), expect(dead_code))]
    pub network: &'a Network,
    pub shapes: &'a [Vec<f64>],
    /// How much each shape counts.
    pub weights: &'a [f64],
    pub normals: &'a [[f32; 3]],
}

impl Learning<'_> {
    /// The prior, and a linear one's explained variance. A decoder's training keeps its state in `checkpoint`, goes on from it,
    /// and shows every step and its loss to `see`, which returns false to stop.
    pub fn learn(
        &self,
        kind: Kind,
        styles: usize,
        checkpoint: Option<&Path>,
        see: &mut dyn FnMut(usize, f64) -> bool,
    ) -> Result<(LearnedPrior, Vec<f64>), LearnError> {
        let mut shapes = self.shapes.to_vec();
        shapes.extend(augmented(&shapes, self.models.augment, self.models.seed));
        // A shape made of several counts fully.
        let mut weights = self.weights.to_vec();
        weights.resize(shapes.len(), 1.0);
        match kind {
            Kind::Linear => {
                let (prior, explained) =
                    LinearPrior::from_correspondences(&shapes, &weights, self.normals.to_vec(), styles)?;
                Ok((prior.into(), explained))
            }
            Kind::Decoder => Ok((self.decoder(&shapes, styles, checkpoint, see)?, Vec::new())),
        }
    }

    #[cfg(feature = "training")]
    fn decoder(
        &self,
        shapes: &[Vec<f64>],
        styles: usize,
        checkpoint: Option<&Path>,
        see: &mut dyn FnMut(usize, f64) -> bool,
    ) -> Result<LearnedPrior, LearnError> {
        use spba_ceres::prior::learn::{DECODER_RATE, DecoderOptions, decoder};
        let options = DecoderOptions {
            styles,
            width: self.network.width,
            seed: self.models.seed,
        };
        let plan = spba_ceres::training::Plan {
            steps: self.network.steps,
            learning_rate: DECODER_RATE,
            checkpoint: checkpoint.map(Path::to_owned),
            of: format!(
                "a decoder of {} shapes, {}, {} steps",
                shapes.len(),
                self.models.words(),
                self.network.steps
            ) + &format!(", {styles} styles, width {}", self.network.width),
        };
        decoder(shapes, self.normals.to_vec(), &options, &plan, see)
    }

    #[cfg(not(feature = "training"))]
    fn decoder(
        &self,
        _: &[Vec<f64>],
        _: usize,
        _: Option<&Path>,
        _: &mut dyn FnMut(usize, f64) -> bool,
    ) -> Result<LearnedPrior, LearnError> {
        Err(LearnError::NoTraining)
    }
}
