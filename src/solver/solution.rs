//! What a solve reports: objective values, counters, the trace and the result.

use super::Deviations;
use crate::geometry::Similarity;
use crate::init::Estimate;

/// The value of Eq. 9 and of its terms, weights included.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ObjectiveValue {
    /// The sum of all terms.
    pub total: f64,
    /// The term of Eq. 4, which compares colours.
    pub photometric: f64,
    /// The term of Eq. 5, which compares silhouettes.
    pub silhouette: f64,
    /// The term of Eq. 6, which compares inverse depths.
    pub inverse_depth: f64,
    /// The style's regulariser; 0 where its weight is 0.
    pub style: f64,
    /// The term that holds the motion to the off-the-shelf poses (Eq. 13); 0 where its weight is 0.
    #[serde(default)]
    pub motion: f64,
    /// The term that holds the focal length to its given value; 0 where it is fixed.
    #[serde(default)]
    pub focal: f64,
}

/// Ceres's counters; line search counts all of its evaluations as Jacobian evaluations.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Evaluations {
    /// Evaluations of residuals alone.
    pub residual: usize,
    /// Evaluations of residuals and Jacobian.
    pub jacobian: usize,
}

impl Evaluations {
    pub(crate) fn plus(self, other: Self) -> Self {
        Self {
            residual: self.residual + other.residual,
            jacobian: self.jacobian + other.jacobian,
        }
    }
}

/// Why the solver stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Termination {
    /// The objective fell below δ_L.
    BelowThreshold,
    /// Further steps lowered the objective by less than the tolerance.
    Converged,
    /// The steps reached their limit.
    StepLimit,
    /// The observer stopped the solve; the best state so far is kept.
    Interrupted,
}

/// One line of `trace.csv`: the state after one solver iteration.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TraceRow {
    /// `hypothesis-2`, `level-1` …: which solve.
    pub stage: String,
    /// The alternation's step (one Ceres call each).
    pub step: usize,
    /// Which variables moved: `all`, `p0`, `motion`, `style`.
    pub block: String,
    /// The Ceres iteration within the call; 0 is its start.
    pub iteration: usize,
    /// The objective and its terms.
    pub objective: ObjectiveValue,
    /// The Euclidean norm of the gradient, as Ceres reports it.
    pub gradient_norm: f64,
    /// α of Eq. 6, x_cam = α x'_cam.
    pub alpha: f64,
    /// Residual evaluations since the stage began.
    pub residual_evaluations: usize,
    /// Jacobian evaluations since the stage began.
    pub jacobian_evaluations: usize,
    /// Wall-clock seconds since the stage began; the one column that differs from run to run.
    pub seconds: f64,
}

/// One pose hypothesis after its short solve.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct HypothesisOutcome {
    /// The direction from which the template sees the object, degrees: 0 sees its front, 90 its right side.
    pub azimuth_deg: f64,
    /// The template's height above the object's horizontal plane, degrees.
    pub elevation_deg: f64,
    /// The template's roll about its line of sight, degrees.
    pub roll_deg: f64,
    /// Silhouette IoU of the template in the target frame.
    pub template_iou: f64,
    /// The objective before the short solve, comparable among hypotheses alone.
    pub objective_start: f64,
    /// The objective after the short solve, comparable among hypotheses alone; infinite where it was interrupted before its start.
    pub objective_end: f64,
    /// Whether the main solve started from here.
    pub chosen: bool,
}

/// The state after one solver call: a step's, or that of one of its blocks.
#[derive(Clone, Debug)]
pub struct StepState {
    /// Pyramid level; 0 is the finest.
    pub level: usize,
    /// The variables.
    pub estimate: Estimate,
    /// Ceres iterations since the descent began.
    pub iterations: usize,
    /// Evaluations since the descent began.
    pub evaluations: Evaluations,
    /// Processor seconds since the descent began.
    pub cpu_seconds: f64,
}

/// What a solve found.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The variables in the canonical object frame; the style holds s alone.
    pub estimate: Estimate,
    /// g: the coordinates of the free form that bends the shape; empty without one.
    pub free_form: Vec<f64>,
    /// How sure that is; `None` where nothing says so ([`Deviations`]), and after an interruption.
    pub deviations: Option<Deviations>,
    /// From the frame in which the prior puts the shape of s and g to the estimate's, the canonical one, where they differ: that of a prior
    /// of surfaces.
    pub canonical_from_shape: Option<Similarity>,
    /// The objective before the first iteration of the main solve.
    pub objective_start: ObjectiveValue,
    /// The objective after the last iteration of the main solve, or of the free form's stage where there is one.
    pub objective_end: ObjectiveValue,
    /// Evaluations of the main solve and of the free form's stage, counted by Ceres; short solves are left out.
    pub evaluations: Evaluations,
    /// Ceres iterations of the main solve and of the free form's stage; short solves are left out.
    pub iterations: usize,
    /// Why the last stage of the solve stopped.
    pub termination: Termination,
    /// One entry per starting point, after its short solve.
    pub hypotheses: Vec<HypothesisOutcome>,
    /// The state after every call of the main solve.
    pub steps: Vec<StepState>,
    /// One row per Ceres iteration, short solves first.
    pub trace: Vec<TraceRow>,
    /// Stage name → seconds: wall clock, or processor time where the name ends in `_cpu`.
    pub seconds: Vec<(String, f64)>,
}

impl Solution {
    /// Itself, found after `earlier`, from whose motion it started: with the trace, counters and times of both.
    pub fn after(mut self, earlier: Self) -> Self {
        let renamed = self.trace.into_iter().map(|row| TraceRow {
            stage: format!("again-{}", row.stage),
            ..row
        });
        self.trace = earlier.trace.into_iter().chain(renamed).collect();
        self.steps.splice(0..0, earlier.steps);
        self.seconds.splice(0..0, earlier.seconds);
        self.evaluations = earlier.evaluations.plus(self.evaluations);
        self.iterations += earlier.iterations;
        self.hypotheses = earlier.hypotheses;
        self
    }
}
