//! One Ceres call: which variables move, how, and until when.

use crate::bridge::ceres::ffi;
use crate::solver::{Evaluations, Interpolation, LinearSolver, Minimiser, ObjectiveValue};

/// The variables that a call moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Block {
    All,
    /// p0.
    Target,
    /// All Δp_l.
    Motion,
    /// s.
    Style,
}

impl Block {
    /// As in `trace.csv`.
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
    pub block: Block,
    /// Whether α of Eq. 6 moves too.
    pub free_alpha: bool,
    pub minimiser: Minimiser,
    pub max_iterations: u32,
    /// Stop once an iteration lowers the objective by a smaller share.
    pub tolerance: f64,
}

impl Call {
    pub(super) fn options(&self) -> ffi::SolveOptions {
        let free = |block| self.block == Block::All || self.block == block;
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
        ffi::SolveOptions {
            free_target: free(Block::Target),
            free_motion: free(Block::Motion),
            free_style: free(Block::Style),
            free_alpha: self.free_alpha,
            line_search,
            lbfgs_rank,
            interpolation: match interpolation {
                Interpolation::Cubic => ffi::Interpolation::Cubic,
                Interpolation::Quadratic => ffi::Interpolation::Quadratic,
                Interpolation::Bisection => ffi::Interpolation::Bisection,
            },
            initial_trust_region_radius: radius,
            linear_solver: match (linear_solver, self.block) {
                (LinearSolver::Auto, Block::All) | (LinearSolver::DenseSchur, _) => {
                    ffi::LinearSolver::DenseSchur
                }
                (LinearSolver::Auto, _) | (LinearSolver::SparseNormalCholesky, _) => {
                    ffi::LinearSolver::SparseNormalCholesky
                }
                (LinearSolver::SparseSchur, _) => ffi::LinearSolver::SparseSchur,
                (LinearSolver::IterativeSchur, _) => ffi::LinearSolver::IterativeSchur,
                (LinearSolver::DenseNormalCholesky, _) => ffi::LinearSolver::DenseNormalCholesky,
            },
            max_iterations: self.max_iterations,
            function_tolerance: self.tolerance,
        }
    }
}

/// The state after one of Ceres's iterations.
#[derive(Clone, Copy, Debug)]
pub struct Iteration {
    /// 0 is the start.
    pub number: usize,
    pub objective: ObjectiveValue,
    /// α of Eq. 6, x_cam = α x'_cam.
    pub alpha: f64,
    pub gradient_norm: f64,
    /// Of this call so far.
    pub evaluations: Evaluations,
}

/// What one call did.
#[derive(Clone, Copy, Debug)]
pub struct CallOutcome {
    pub iterations: usize,
    pub evaluations: Evaluations,
    /// The observer stopped it.
    pub interrupted: bool,
}

impl Iteration {
    pub(super) fn new(iteration: &ffi::Iteration, input_unit: f64) -> Self {
        Self {
            number: iteration.number as usize,
            objective: iteration.terms.into(),
            alpha: iteration.alpha * input_unit,
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
        }
    }
}

impl From<ffi::Terms> for ObjectiveValue {
    fn from(terms: ffi::Terms) -> Self {
        Self {
            total: terms.photometric + terms.silhouette + terms.inverse_depth + terms.style + terms.motion,
            photometric: terms.photometric,
            silhouette: terms.silhouette,
            inverse_depth: terms.inverse_depth,
            style: terms.style,
            motion: terms.motion,
        }
    }
}
