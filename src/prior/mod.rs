//! Learned, category-specific shape priors: X = G(s).

mod evaluate;
mod file;
mod frame_error;
mod glyphs;
pub mod learn;
mod learned;
mod linear;
mod sheet;

pub use evaluate::{FitError, Learner, chamfer, leave_one_out, points_of, style_of};
pub(crate) use file::bundled;
#[cfg(fuzzing)]
pub use file::fuzz;
pub use file::{PriorError, PriorInfo, PriorKind, PriorSource, Symmetry, find, load, open, save};
pub use frame_error::{FrameError, Known, frame_errors};
pub use learned::{Layer, LearnedPrior};
pub use linear::{InvalidPrior, LinearPrior};
pub use sheet::contact_sheet;

/// A shape prior: style → N points in the object frame, and the derivative.
///
/// Points are stored so that any prefix is an even sample of the surface (farthest-point order).
pub trait ShapePrior: Send + Sync {
    /// S.
    fn style_len(&self) -> usize;

    /// N.
    fn point_count(&self) -> usize;

    /// X(s): fills `points` with `points.len() / 3` points, xyz after xyz: a prefix of all N.
    /// `style` has S entries, i.i.d. standard normal under the prior.
    fn points(&self, style: &[f64], points: &mut [f64]);

    /// ∂X/∂s at `style`: fills `jacobian` (rows x0 y0 z0 x1 …, S columns, row-major), for the same prefix.
    fn jacobian(&self, style: &[f64], jacobian: &mut [f64]);

    /// Whether that is the same at every style.
    fn is_linear(&self) -> bool {
        false
    }
}
