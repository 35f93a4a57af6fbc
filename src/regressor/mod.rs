//! A first guess of the style from a few masked frames: a small convolutional network per frame, a gated recurrent unit over
//! the frames, the style out of its last state. Inference is plain matrix products; training needs the feature `training`.

mod crop;
#[cfg(feature = "training")]
mod examples;
mod file;
mod judge;
mod network;
#[cfg(feature = "training")]
mod train;

pub(crate) use crop::Crop;
#[cfg(feature = "training")]
pub use examples::{ExampleOptions, Examples, Model};
pub use file::{RegressorError, RegressorInfo, bundled, load, save};
pub use judge::{Guesses, POINTS, judge};
pub use network::Network;
#[cfg(feature = "training")]
pub use train::{REGRESSOR_RATE, train};

use crate::prior::PriorInfo;
use crate::sequence::Sequence;

/// A trained network and the prior whose styles it speaks of.
#[derive(Clone, Debug, PartialEq)]
pub struct Regressor {
    /// What the regressor was trained for, and how.
    pub info: RegressorInfo,
    /// The weights.
    pub network: Network,
}

impl Regressor {
    /// The style (S entries) of the object that the frames show, in their order.
    ///
    /// # Errors
    /// A prior that it was not trained for; no frame with a mask.
    pub fn style(&self, sequence: &Sequence, prior: &PriorInfo) -> Result<Vec<f64>, RegressorError> {
        if self.info.prior_command != prior.command {
            return Err(RegressorError::OtherPrior {
                trained_for: self.info.prior_command.clone(),
                given: prior.command.clone(),
            });
        }
        let crops: Vec<Crop> = sequence
            .frames
            .iter()
            .filter_map(|frame| Crop::of(&frame.image, &frame.mask))
            .collect();
        if crops.is_empty() {
            return Err(RegressorError::NothingSeen(sequence.name.clone()));
        }
        Ok(self.network.style(&crops).into_iter().map(f64::from).collect())
    }
}
