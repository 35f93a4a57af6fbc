//! The Ceres problem of Eq. 9. C++ knows cameras, images, points and indices; no file, no prior, no config.

use crate::prior::ShapePrior;
use std::sync::Arc;

#[allow(clippy::missing_safety_doc)]
#[cxx::bridge(namespace = "spba")]
pub mod ffi {
    /// Sizes and weights of the whole problem.
    struct ProblemOptions {
        /// L.
        frames: usize,
        /// N.
        points: usize,
        /// S.
        style: usize,
        /// Weight of L_ph; the paper's is 1.
        photometric_weight: f64,
        /// δ1, in colour levels.
        photometric_huber: f64,
        /// λ1.
        silhouette_weight: f64,
        /// In pixels; 0 = none.
        silhouette_cauchy: f64,
        /// In pixels.
        silhouette_tolerance: f64,
        /// λ2.
        inverse_depth_weight: f64,
        /// δ2, in the off-the-shelf reconstruction's inverse units.
        inverse_depth_huber: f64,
        /// Weight of −log p(s) = ½‖s‖²; 0 leaves the term out.
        style_weight: f64,
        /// ‖s‖ from which that term rises steeply; 0 = nowhere.
        style_reach: f64,
        /// Of what Δp_l differs from Eq. 13's.
        motion_weight: f64,
        /// In object diagonals.
        motion_cauchy: f64,
        /// Every point projects as if it had the depth of the object's origin.
        weak_perspective: bool,
    }

    /// Intrinsics in pixels, top-left pixel centre at (0.5, 0.5).
    struct Camera {
        fx: f64,
        fy: f64,
        cx: f64,
        cy: f64,
    }

    /// A frame's silhouette, its distance transform on a padded grid, and the shares of it in use.
    struct Silhouette<'a> {
        /// Columns of the unpadded mask.
        width: u32,
        padding: u32,
        grid_width: u32,
        grid_height: u32,
        /// Per cell of the padded grid: row-major index (in the mask) of the nearest silhouette pixel.
        nearest: &'a [u32],
        /// Row-major indices of the silhouette's boundary pixels.
        boundary: &'a [u32],
        /// Row-major indices of U_l1's pixels in use, and what each counts.
        pixels: &'a [u32],
        pixel_weight: f64,
        /// How many points of the prefix are in use for the other direction, and what each counts.
        points: u32,
        point_weight: f64,
    }

    /// Off-the-shelf inverse depth d' where a point is seen, to first order.
    struct SeenDepth {
        point: u32,
        /// Centre of the pixel.
        column: f64,
        row: f64,
        /// There.
        inverse_depth: f64,
        /// A pixel.
        by_column: f64,
        by_row: f64,
    }

    /// source_from_target of the off-the-shelf reconstruction, in its units; the rotation row-major.
    struct InputMotion {
        rotation: [f64; 9],
        translation: [f64; 3],
    }

    /// Which variables move, by which of Ceres's minimisers, until when.
    struct SolveOptions {
        free_target: bool,
        free_motion: bool,
        free_style: bool,
        free_alpha: bool,
        /// L-BFGS instead of Levenberg–Marquardt.
        line_search: bool,
        lbfgs_rank: u32,
        interpolation: Interpolation,
        initial_trust_region_radius: f64,
        /// Of Levenberg–Marquardt.
        linear_solver: LinearSolver,
        max_iterations: u32,
        function_tolerance: f64,
    }

    /// Ceres's; the Schur solvers eliminate the motion and need all variables free.
    #[derive(Clone, Copy, Debug)]
    enum LinearSolver {
        DenseSchur,
        SparseSchur,
        IterativeSchur,
        SparseNormalCholesky,
        DenseNormalCholesky,
    }

    /// How L-BFGS's line search chooses its next trial.
    #[derive(Clone, Copy, Debug)]
    enum Interpolation {
        Cubic,
        Quadratic,
        Bisection,
    }

    /// The terms of Eq. 9, weights included.
    #[derive(Clone, Copy, Debug)]
    struct Terms {
        photometric: f64,
        silhouette: f64,
        inverse_depth: f64,
        style: f64,
        motion: f64,
    }

    /// One of Ceres's iterations, at the best state so far.
    struct Iteration {
        number: u32,
        terms: Terms,
        alpha: f64,
        gradient_norm: f64,
        residual_evaluations: u32,
        jacobian_evaluations: u32,
    }

    #[derive(Debug)]
    struct Summary {
        iterations: u32,
        residual_evaluations: u32,
        jacobian_evaluations: u32,
        /// The observer asked for it.
        interrupted: bool,
    }

    extern "Rust" {
        type PriorCallback;
        fn points(self: &PriorCallback, style: &[f64], points: &mut [f64]) -> Result<()>;
        fn jacobian(self: &PriorCallback, style: &[f64], jacobian: &mut [f64]) -> Result<()>;

        type Observer<'a>;
        /// False stops the solver at this iteration.
        unsafe fn on_iteration(self: &mut Observer<'_>, iteration: &Iteration) -> bool;

        fn log_message(severity: i32, message: &str);
    }

    unsafe extern "C++" {
        include!("problem.h");

        type Problem;

        fn new_problem(options: &ProblemOptions, prior: Box<PriorCallback>) -> Result<UniquePtr<Problem>>;

        /// Frame `frame`'s camera at full resolution, for silhouettes and depth.
        fn set_camera(self: Pin<&mut Problem>, frame: usize, camera: &Camera) -> Result<()>;
        /// Its image at the current pyramid level: `rgb` is height × width × 3, and that level's camera.
        fn set_image(
            self: Pin<&mut Problem>,
            frame: usize,
            width: u32,
            height: u32,
            rgb: &[f32],
            camera: &Camera,
        ) -> Result<()>;
        fn set_silhouette(self: Pin<&mut Problem>, frame: usize, silhouette: &Silhouette) -> Result<()>;
        /// The points of Eq. 4 between the target frame and source frame `frame` ≥ 1, each with its count of
        /// directions (1 or 2).
        fn set_photometric(
            self: Pin<&mut Problem>,
            frame: usize,
            points: &[u32],
            directions: &[u8],
        ) -> Result<()>;
        /// The points of Eq. 6 in `frame`, after its camera.
        fn set_inverse_depth(self: Pin<&mut Problem>, frame: usize, seen: &[SeenDepth]) -> Result<()>;
        /// What the term of the motion holds source frame `frame` ≥ 1 to.
        fn set_motion(self: Pin<&mut Problem>, frame: usize, motion: &InputMotion) -> Result<()>;
        fn set_alpha(self: Pin<&mut Problem>, alpha: f64) -> Result<()>;
        fn alpha(self: &Problem) -> f64;
        /// p0 (6), Δp_l (6 each), s (S).
        fn set_variables(
            self: Pin<&mut Problem>,
            target_from_object: &[f64],
            motion: &[f64],
            style: &[f64],
        ) -> Result<()>;
        fn get_variables(
            self: &Problem,
            target_from_object: &mut [f64],
            motion: &mut [f64],
            style: &mut [f64],
        ) -> Result<()>;

        /// The objective at the variables; errs where a point is behind a camera.
        fn evaluate(self: Pin<&mut Problem>) -> Result<Terms>;
        /// ∂L/∂(p0, Δp_1 …, s, log α), 6 L + S + 1 entries.
        fn gradient(self: Pin<&mut Problem>, gradient: &mut [f64]) -> Result<()>;
        /// Leaves the best state found in the variables, whatever stopped it.
        fn solve(
            self: Pin<&mut Problem>,
            options: &SolveOptions,
            observer: &mut Observer<'_>,
        ) -> Result<Summary>;
    }
}

/// How C++ asks for X(s) and ∂X/∂s.
pub struct PriorCallback {
    prior: Arc<dyn ShapePrior>,
}

impl PriorCallback {
    pub fn new(prior: Arc<dyn ShapePrior>) -> Self {
        Self { prior }
    }

    fn points(self: &PriorCallback, style: &[f64], points: &mut [f64]) -> Result<(), String> {
        guarded("the shape prior", || self.prior.points(style, points))?;
        finite("the shape prior's points", points)
    }

    fn jacobian(&self, style: &[f64], jacobian: &mut [f64]) -> Result<(), String> {
        guarded("the shape prior", || self.prior.jacobian(style, jacobian))?;
        finite("the shape prior's Jacobian", jacobian)
    }
}

fn finite(what: &str, values: &[f64]) -> Result<(), String> {
    if values.iter().all(|v| v.is_finite()) {
        Ok(())
    } else {
        Err(format!("{what} are not all finite"))
    }
}

/// A panic must not unwind into C++.
fn guarded<T>(what: &str, work: impl FnOnce() -> T) -> Result<T, String> {
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(work)).map_err(|_| format!("{what} panicked"))
}

/// Sees every Ceres iteration; returns false to stop there.
pub struct Observer<'a> {
    on_iteration: &'a mut dyn FnMut(&ffi::Iteration) -> bool,
}

impl<'a> Observer<'a> {
    pub fn new(on_iteration: &'a mut dyn FnMut(&ffi::Iteration) -> bool) -> Self {
        Self { on_iteration }
    }

    fn on_iteration(&mut self, iteration: &ffi::Iteration) -> bool {
        guarded("the observer", || (self.on_iteration)(iteration)).unwrap_or(false)
    }
}

/// Ceres's own log lines; glog's severities.
fn log_message(severity: i32, message: &str) {
    match severity {
        0 => tracing::debug!(target: "ceres", "{message}"),
        1 => tracing::info!(target: "ceres", "{message}"),
        _ => tracing::warn!(target: "ceres", "{message}"),
    }
}
