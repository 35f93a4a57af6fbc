//! How to minimise Eq. 9.

use super::ScaleUpdate;
use crate::prior::FreeForm;
use serde::{Deserialize, Serialize};

/// Which of Ceres's linear solvers finds a Levenberg–Marquardt step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LinearSolver {
    /// For blocks `DenseSchur` where all variables move together and every pair holds the target, else
    /// `SparseNormalCholesky`; dense for accumulated normal equations.
    #[default]
    Auto,
    /// Eliminates all poses but the target's, as the two below; for the joint strategy over blocks and
    /// the pairs of a star only.
    DenseSchur,
    /// Ceres's `SPARSE_SCHUR`: the same elimination, with a sparse factorisation of what is left.
    SparseSchur,
    /// Ceres's `ITERATIVE_SCHUR`: the same elimination, with conjugate gradients on what is left.
    IterativeSchur,
    /// Ceres's `SPARSE_NORMAL_CHOLESKY`, a sparse factorisation of JᵀJ.
    SparseNormalCholesky,
    /// Ceres's `DENSE_NORMAL_CHOLESKY`, a dense factorisation of JᵀJ.
    DenseNormalCholesky,
}

/// How L-BFGS's line search chooses its next trial from the values and slopes of the last ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Interpolation {
    /// The minimum of the cubic through the last values and slopes.
    #[default]
    Cubic,
    /// The minimum of the parabola through the last values and slopes.
    Quadratic,
    /// The middle of the bracket.
    Bisection,
}

impl Minimiser {
    /// Levenberg–Marquardt with Ceres's own radius.
    pub const fn lm(linear_solver: LinearSolver) -> Self {
        Self::Lm {
            initial_trust_region_radius: default_trust_region_radius(),
            linear_solver,
        }
    }

    /// How many iterations of one call are worth their time where nobody says: few of LM, as the next call sees a new visibility, more of
    /// L-BFGS, which forgets in each call what it has learned of the curvature.
    pub fn iterations_per_call(self) -> u32 {
        match self {
            Self::Lm { .. } => 5,
            Self::Lbfgs { .. } => 20,
        }
    }

    /// Whether its linear solver is a Schur complement over all poses but the target's.
    pub(crate) fn eliminates_poses(self) -> bool {
        use LinearSolver::{DenseSchur, IterativeSchur, SparseSchur};
        matches!(
            self,
            Self::Lm {
                linear_solver: DenseSchur | SparseSchur | IterativeSchur,
                ..
            }
        )
    }

    /// L-BFGS that remembers `rank` steps.
    pub fn lbfgs(rank: u32) -> Self {
        Self::Lbfgs {
            rank,
            interpolation: Interpolation::default(),
        }
    }
}

/// Which of Ceres's minimisers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "method", rename_all = "lowercase", deny_unknown_fields)]
pub enum Minimiser {
    /// Levenberg–Marquardt.
    Lm {
        /// Trust-region radius of the first step. Ceres's default is 1e4.
        #[serde(default = "default_trust_region_radius")]
        initial_trust_region_radius: f64,
        /// The linear solver of every step.
        #[serde(default)]
        linear_solver: LinearSolver,
    },
    /// Limited-memory BFGS with a Wolfe line search, the paper's choice.
    Lbfgs {
        /// How many past steps approximate the Hessian.
        #[serde(default = "default_lbfgs_rank")]
        rank: u32,
        /// How the line search chooses its next trial.
        #[serde(default)]
        interpolation: Interpolation,
    },
}

/// Ceres's own trust-region radius of the first step, 1e4.
pub const fn default_trust_region_radius() -> f64 {
    1e4
}

/// The default number of past steps that L-BFGS remembers, 20.
pub const fn default_lbfgs_rank() -> u32 {
    20
}

/// Which variables a step moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Strategy {
    /// Algorithm 1: p0, then all Δp_l, then s; α as `scale_update` says.
    Alternating,
    /// All variables at once; α as `scale_update` says.
    Joint,
}

/// How the objective is evaluated for Ceres. Values, derivatives and steps are the same, up to rounding.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Evaluation {
    /// As one cost function, whose normal equations we sum point by point.
    #[default]
    Accumulated,
    /// A residual block for each pixel, as in the paper; for comparison, as it is many times slower.
    Blocks,
}

/// The starting values of the source frames' motion Δp_l.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MotionStart {
    /// The off-the-shelf poses (Eq. 13), as the short solve moved them.
    Given,
    /// No motion, as in Zhu et al.
    Zero,
}

/// Minimiser, strategy and when to stop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SolverOptions {
    /// The minimiser that Ceres runs. The paper's is L-BFGS.
    pub minimiser: Minimiser,
    /// How the objective is evaluated for Ceres.
    pub evaluation: Evaluation,
    /// Which variables a step moves together. The paper's is `alternating`.
    pub strategy: Strategy,
    /// Where the source frames' motion Δp_l starts.
    pub motion_start: MotionStart,
    /// How α is found: in every solver call (`variable`), or between calls by the paper's Eq. 8 (`regression`).
    pub scale_update: ScaleUpdate,
    /// Steps of Algorithm 1 per pyramid level; visibility is renewed before each.
    pub max_steps: usize,
    /// The maximum number of Ceres iterations per call. `None`: as many as [`Minimiser::iterations_per_call`] says.
    pub iterations_per_call: Option<u32>,
    /// δ_L: the solve stops once the objective is below.
    pub threshold: f64,
    /// A step that lowers the objective by less than this share of it is no progress. Levels before the last end at ten times this.
    pub tolerance: f64,
    /// Pyramid levels, each half the size of the one before. 1 is no pyramid; the paper mentions none.
    pub levels: usize,
    /// After the joint solve, the shape is also bent by the prior's free form, where it has one (a prior of surfaces): `symmetric`,
    /// `any`, or `none`. The paper has none.
    pub free_form: FreeForm,
    /// Threads of one solve; no byte of the result depends on them.
    #[serde(skip, default = "one")]
    pub threads: usize,
}

fn one() -> usize {
    1
}

impl Default for SolverOptions {
    fn default() -> Self {
        Self {
            minimiser: Minimiser::lm(LinearSolver::Auto),
            evaluation: Evaluation::default(),
            strategy: Strategy::Joint,
            motion_start: MotionStart::Given,
            scale_update: ScaleUpdate::Variable,
            max_steps: 20,
            iterations_per_call: None,
            threshold: 0.0,
            tolerance: 1e-3,
            levels: 3,
            free_form: FreeForm::Symmetric,
            threads: one(),
        }
    }
}

impl SolverOptions {
    /// The maximum number of Ceres iterations per call.
    pub fn iterations_per_call(&self) -> u32 {
        self.iterations_per_call
            .unwrap_or_else(|| self.minimiser.iterations_per_call())
    }

    /// The name of the first option that cannot be used, and why.
    pub fn check(&self) -> Result<(), (&'static str, &'static str)> {
        match self.minimiser {
            Minimiser::Lm {
                initial_trust_region_radius: radius,
                ..
            } if !(radius.is_finite() && radius > 0.0) => {
                return Err(("initial_trust_region_radius", "must be more than 0"));
            }
            minimiser if minimiser.eliminates_poses() && self.strategy == Strategy::Alternating => {
                return Err(("linear_solver", "a Schur solver needs the joint strategy"));
            }
            Minimiser::Lm { linear_solver, .. }
                if linear_solver != LinearSolver::Auto && self.evaluation == Evaluation::Accumulated =>
            {
                return Err((
                    "linear_solver",
                    "only with evaluation = \"blocks\": accumulated normal equations are dense",
                ));
            }
            Minimiser::Lbfgs { rank: 0, .. } => return Err(("rank", "must be 1 or more")),
            _ => {}
        }
        if self.max_steps == 0 {
            return Err(("max_steps", "must be 1 or more"));
        }
        if self.iterations_per_call == Some(0) {
            return Err(("iterations_per_call", "must be 1 or more"));
        }
        if !(1..=8).contains(&self.levels) {
            return Err(("levels", "must be 1 to 8"));
        }
        if !(self.threshold >= 0.0 && self.tolerance >= 0.0 && self.tolerance < 1.0) {
            return Err((
                "threshold, tolerance",
                "must be 0 or more, the tolerance less than 1",
            ));
        }
        Ok(())
    }
}
