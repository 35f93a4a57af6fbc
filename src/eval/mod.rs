//! Metrics: a result against truth or against a turning platform.
//!
//! Pure functions on poses, depth maps and points; the verb `eval` reads the files and prints.

mod align;
mod depth;
mod estimated;
mod metrics;
mod platform;
mod truth;
mod turn;

use align::align_to_truth;
pub(crate) use depth::DepthPairs;
pub use estimated::Estimated;
pub(crate) use metrics::location_error;
pub use metrics::{MeanMax, chamfer, orientation_error_deg};
pub use platform::{Platform, PlatformError, TurnError, TurnTable};
pub use truth::{FrameErrors, TruthErrors, against_truth};
pub use turn::{TurnErrors, against_turn};
