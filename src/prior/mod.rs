//! Learned, category-specific shape priors: X = G(s).

mod deviations;
#[cfg(feature = "cad")]
mod evaluate;
mod field;
mod file;
#[cfg(feature = "cad")]
mod frame_error;
#[cfg(feature = "cad")]
mod glyphs;
#[cfg(feature = "cad")]
pub mod learn;
mod learned;
mod linear;
mod mesh;
#[cfg(feature = "cad")]
mod sheet;
mod surface;
#[cfg(feature = "cad")]
mod surface_sheet;

pub use deviations::FrameDerivative;
#[cfg(feature = "cad")]
pub use evaluate::{DEFAULT_NOISE, Fit, FitError, Learner, chamfer, leave_one_out, points_of, style_of};
pub use field::{FieldModes, FieldScale, field_modes};
#[cfg(feature = "study")]
pub(crate) use file::bundled;
#[cfg(fuzzing)]
pub use file::fuzz;
pub use file::{
    FreeFormInfo, PriorError, PriorInfo, PriorKind, PriorSource, Symmetry, check_unit, find, load, open,
    open_all, save,
};
#[cfg(feature = "cad")]
pub use frame_error::{FrameError, Known, frame_errors};
pub use learned::{Layer, LearnedPrior};
pub use linear::{InvalidPrior, LinearPrior};
pub(crate) use mesh::subdivided;
pub use mesh::{Distortion, InvalidMesh, MirroredMesh, distortion, write_mesh};
#[cfg(feature = "cad")]
pub use sheet::contact_sheet;
pub use surface::{FreeForm, SurfacePoint, SurfacePrior};

use crate::geometry::Similarity;
use crate::surface::Mesh;
use std::sync::Arc;

/// Styles, one after another, that move points along the same axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AxisStyles {
    /// 0 = x, 1 = y, 2 = z, object frame.
    pub axis: usize,
    /// How many there are.
    pub count: usize,
}

/// A shape prior: style → N points in the object frame, and the derivative.
///
/// Points are stored so that any prefix is an even sample of the surface (farthest-point order).
pub trait ShapePrior: Send + Sync {
    /// The number of style entries S.
    fn style_len(&self) -> usize;

    /// The number of points N.
    fn point_count(&self) -> usize;

    /// X(s): fills `points` with `points.len() / 3` points, xyz after xyz: a prefix of all N.
    /// `style` has S entries, i.i.d. standard normal under the prior.
    fn points(&self, style: &[f64], points: &mut [f64]);

    /// ∂X/∂s at `style`: fills `jacobian` (rows x0 y0 z0 x1 …, S columns, row-major), for the same prefix.
    fn jacobian(&self, style: &[f64], jacobian: &mut [f64]);

    /// ∂X/∂s of all N points where it is the same at every style, laid out as by [`ShapePrior::jacobian`].
    fn constant_jacobian(&self) -> Option<&[f64]> {
        None
    }

    /// The closed surface that the points of X(s) lie on; `None` where this prior knows points alone.
    fn mesh(&self, style: &[f64]) -> Option<Mesh> {
        let _ = style;
        None
    }

    /// What the last styles are, run after run, where each moves every point along one axis of the object alone, as the modes of a free
    /// form do: the other two rows of its derivative are zero.
    fn axis_styles(&self) -> &[AxisStyles] {
        &[]
    }

    /// From the frame of X(s), bent by the free form of coordinates g, to the canonical frame, where the shape itself tells: a prior of
    /// surfaces knows the whole body's box. `None`: X(s) is taken to be in it.
    fn canonical_from_shape(&self, style: &[f64], free_form: &[f64]) -> Option<Similarity> {
        let _ = (style, free_form);
        None
    }

    /// The derivative of [`ShapePrior::canonical_from_shape`] by each of (s, g), where there is one.
    fn canonical_by_shape(&self, style: &[f64], free_form: &[f64]) -> Option<Vec<FrameDerivative>> {
        let _ = (style, free_form);
        None
    }

    /// The number of the free form's coordinates; 0 where this prior has none.
    fn form_len(&self, form: FreeForm) -> usize {
        let _ = form;
        0
    }

    /// The same shapes, bent by a free form: a prior whose style is (s, g), g being the form's coordinates, standard normal too.
    /// `None` where this prior has no free form.
    ///
    /// # Errors
    /// The free form does not make a prior.
    fn freed(&self, form: FreeForm) -> Result<Option<Arc<dyn ShapePrior>>, InvalidPrior> {
        let _ = form;
        Ok(None)
    }
}
