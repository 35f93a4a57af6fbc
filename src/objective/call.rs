//! One Ceres call: which variables move, how, and until when.

use super::{Objective, Pairs};
use crate::bridge::ceres::ffi;
use crate::solver::{Evaluation, Evaluations, Interpolation, LinearSolver, Minimiser, ObjectiveValue};

/// The variables that a call moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Block {
    /// All variables: every pose and s, and the focal factor where it is free.
    All,
    /// p0, which moves all frames together.
    Target,
    /// All Δp_l: every pose but the target's.
    Motion,
    /// The style s.
    Style,
}

impl Block {
    /// The block's name in `trace.csv`.
    pub fn name(self) -> &'static str {
        match self {
            Block::All => "all",
            Block::Target => "p0",
            Block::Motion => "motion",
            Block::Style => "style",
        }
    }
}

/// Options of [`Objective::minimise`](super::Objective::minimise).
#[derive(Clone, Copy, Debug)]
pub struct Call {
    /// The variables that move.
    pub block: Block,
    /// Whether α of Eq. 6 moves too.
    pub free_alpha: bool,
    /// The minimiser and its settings.
    pub minimiser: Minimiser,
    /// How the objective is evaluated for Ceres.
    pub evaluation: Evaluation,
    /// The maximum number of Ceres iterations.
    pub max_iterations: u32,
    /// Stop once an iteration lowers the objective by a smaller share.
    pub tolerance: f64,
}

impl Call {
    pub(super) fn options(&self, objective: &Objective) -> ffi::MinimiseOptions {
        let all = self.block == Block::All;
        let (radius, linear_solver) = match self.minimiser {
            Minimiser::Lm {
                initial_trust_region_radius,
                linear_solver,
            } => (initial_trust_region_radius, linear_solver),
            Minimiser::Lbfgs { .. } => (0.0, LinearSolver::Auto),
        };
        let (line_search, lbfgs_rank, interpolation) = match self.minimiser {
            Minimiser::Lm { .. } => (false, 0, Interpolation::Cubic),
            Minimiser::Lbfgs { rank, interpolation } => (true, rank, interpolation),
        };
        let star = all && objective.matcher.options.pairs == Pairs::Star;
        ffi::MinimiseOptions {
            poses: match self.block {
                Block::All => ffi::PoseMotion::Each,
                Block::Target => ffi::PoseMotion::Together,
                Block::Motion => ffi::PoseMotion::Sources,
                Block::Style => ffi::PoseMotion::Held,
            },
            free_style: all || self.block == Block::Style,
            free_alpha: self.free_alpha,
            free_focal: all && objective.matcher.options.focal_deviation > Some(0.0),
            target: objective.target as u32,
            blocks: self.evaluation == Evaluation::Blocks,
            line_search,
            lbfgs_rank,
            interpolation: match interpolation {
                Interpolation::Cubic => ffi::Interpolation::Cubic,
                Interpolation::Quadratic => ffi::Interpolation::Quadratic,
                Interpolation::Bisection => ffi::Interpolation::Bisection,
            },
            initial_trust_region_radius: radius,
            linear_solver: match linear_solver {
                LinearSolver::Auto if star => ffi::LinearSolver::DenseSchur,
                LinearSolver::Auto | LinearSolver::SparseNormalCholesky => {
                    ffi::LinearSolver::SparseNormalCholesky
                }
                LinearSolver::DenseSchur => ffi::LinearSolver::DenseSchur,
                LinearSolver::SparseSchur => ffi::LinearSolver::SparseSchur,
                LinearSolver::IterativeSchur => ffi::LinearSolver::IterativeSchur,
                LinearSolver::DenseNormalCholesky => ffi::LinearSolver::DenseNormalCholesky,
            },
            max_iterations: self.max_iterations,
            tolerance: self.tolerance,
            threads: objective.matcher.threads as u32,
        }
    }
}

/// The state after one of Ceres's iterations.
#[derive(Clone, Copy, Debug)]
pub struct Iteration {
    /// The iteration's number; 0 is the start.
    pub number: usize,
    /// The objective and its terms after this iteration.
    pub objective: ObjectiveValue,
    /// α of Eq. 6, x_cam = α x'_cam.
    pub alpha: f64,
    /// The Euclidean norm of the gradient, as Ceres reports it.
    pub gradient_norm: f64,
    /// Evaluations of this call so far.
    pub evaluations: Evaluations,
}

/// What one call did.
#[derive(Clone, Copy, Debug)]
pub struct CallOutcome {
    /// The number of the last Ceres iteration; unsuccessful ones count, the start does not.
    pub iterations: usize,
    /// Evaluations of residuals and of Jacobians.
    pub evaluations: Evaluations,
    /// Whether the observer stopped the call.
    pub interrupted: bool,
    /// The trust-region radius after the last iteration; 0 of L-BFGS.
    pub trust_region_radius: f64,
}

impl Iteration {
    pub(super) fn new(iteration: &ffi::Iteration, input_unit: f64) -> Self {
        Self {
            number: iteration.number as usize,
            objective: iteration.costs.into(),
            alpha: iteration.log_alpha.exp() * input_unit,
            gradient_norm: iteration.gradient_norm,
            evaluations: Evaluations {
                residual: iteration.residual_evaluations as usize,
                jacobian: iteration.jacobian_evaluations as usize,
            },
        }
    }
}

impl From<ffi::Summary> for CallOutcome {
    fn from(summary: ffi::Summary) -> Self {
        Self {
            iterations: summary.iterations as usize,
            evaluations: Evaluations {
                residual: summary.residual_evaluations as usize,
                jacobian: summary.jacobian_evaluations as usize,
            },
            interrupted: summary.interrupted,
            trust_region_radius: summary.trust_region_radius,
        }
    }
}

impl From<ffi::Costs> for ObjectiveValue {
    fn from(costs: ffi::Costs) -> Self {
        Self {
            total: costs.photometric
                + costs.silhouette
                + costs.inverse_depth
                + costs.style
                + costs.motion
                + costs.focal,
            photometric: costs.photometric,
            silhouette: costs.silhouette,
            inverse_depth: costs.inverse_depth,
            style: costs.style,
            motion: costs.motion,
            focal: costs.focal,
        }
    }
}
