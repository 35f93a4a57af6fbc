//! Eq. 9 and its minimisation with Ceres. C++ knows cameras, images, points and indices; no file, no prior, no config.

use crate::image::RgbImage;
use crate::prior::ShapePrior;
use std::sync::Arc;

#[allow(clippy::missing_safety_doc)]
#[cxx::bridge(namespace = "spba::bridge")]
pub mod ffi {
    /// Intrinsics in pixels, top-left pixel centre at (0.5, 0.5).
    struct Camera {
        fx: f64,
        fy: f64,
        cx: f64,
        cy: f64,
    }

    /// A frame's image at one pyramid level, and that level's camera.
    struct LevelImage {
        image: Box<Colours>,
        camera: Camera,
    }

    /// The distance transform of a mask, on a padded grid.
    struct NearestPixels {
        /// Columns of the mask itself.
        width: u32,
        padding: u32,
        grid_width: u32,
        grid_height: u32,
        /// Per cell of the padded grid: row-major index (in the mask) of the nearest silhouette pixel.
        nearest: Vec<u32>,
        /// Row-major indices of the silhouette's boundary pixels.
        boundary: Vec<u32>,
    }

    /// What one frame shows.
    struct FrameFootage {
        /// At full resolution, for silhouettes and depth.
        camera: Camera,
        /// The pyramid's levels, finest first.
        levels: Vec<LevelImage>,
        silhouette: NearestPixels,
    }

    /// The photometric term, Eq. 4.
    struct PhotometricTerm {
        weight: f64,
        /// δ1, in colour levels.
        huber_width: f64,
    }

    /// What one frame gives to Eq. 5.
    struct SilhouetteShare {
        /// Row-major indices of U_l1's pixels in use, and what each counts.
        pixels: Vec<u32>,
        pixel_weight: f64,
        /// How many of the points are in use for the other direction, and what each counts.
        points: u32,
        point_weight: f64,
    }

    /// The silhouette term, Eq. 5.
    struct SilhouetteTerm {
        /// λ1.
        weight: f64,
        /// In pixels; 0 = none.
        cauchy_width: f64,
        /// In pixels.
        tolerance: f64,
        /// One per frame.
        frames: Vec<SilhouetteShare>,
    }

    /// The inverse-depth term, Eq. 6.
    struct InverseDepthTerm {
        /// λ2.
        weight: f64,
        /// δ2, in the off-the-shelf reconstruction's inverse units.
        huber_width: f64,
    }

    /// −log p(s) = ½‖s‖².
    struct StyleTerm {
        weight: f64,
    }

    /// b_from_a of the off-the-shelf reconstruction, in its units; the rotation row-major.
    struct KnownMotion {
        a: u32,
        b: u32,
        rotation: [f64; 9],
        translation: [f64; 3],
    }

    /// What the cameras' motion differs from Eq. 13's.
    struct MotionTerm {
        weight: f64,
        /// In object diagonals.
        cauchy_width: f64,
        motions: Vec<KnownMotion>,
    }

    /// What is known of the focal length beforehand.
    struct FocalTerm {
        /// Standard deviation of the logarithm of the factor that multiplies all focal lengths.
        deviation: f64,
    }

    /// The terms of the objective; a weight of 0 (of the focal term: a deviation of 0) leaves one out.
    struct Terms {
        photometric: PhotometricTerm,
        silhouette: SilhouetteTerm,
        inverse_depth: InverseDepthTerm,
        style: StyleTerm,
        motion: MotionTerm,
        focal: FocalTerm,
        /// Every point projects as if it had the depth of the object's origin.
        weak_perspective: bool,
    }

    /// Two frames that Eq. 4 compares, and what their share of it weighs.
    struct FramePair {
        a: u32,
        b: u32,
        weight: f64,
    }

    /// A point that is compared between the frames of a pair.
    struct Comparison {
        point: u32,
        pair: u32,
        /// In how many of Eq. 4's two sums: 1 or 2.
        directions: u8,
    }

    /// Off-the-shelf inverse depth d' where a frame sees a point, to first order about a pixel's centre.
    struct SeenDepth {
        frame: u32,
        point: u32,
        column: f64,
        row: f64,
        /// d' at the pixel's centre.
        inverse_depth: f64,
        /// Derivative of d' by the column, per pixel.
        by_column: f64,
        /// Derivative of d' by the row, per pixel.
        by_row: f64,
        /// What it weighs against one that is exact.
        weight: f64,
    }

    /// What is compared at some estimate.
    struct VisibilityInput {
        /// Pyramid level of the images.
        level: u32,
        pairs: Vec<FramePair>,
        comparisons: Vec<Comparison>,
        depths: Vec<SeenDepth>,
        /// By point of those that look for a silhouette's pixel.
        silhouette_weights: Vec<f64>,
    }

    /// camera_from_object; the rotation row-major.
    #[derive(Clone, Copy, Debug)]
    struct Pose {
        rotation: [f64; 9],
        translation: [f64; 3],
    }

    /// Every unknown.
    #[derive(Clone, Debug)]
    struct Variables {
        camera_from_object: Vec<Pose>,
        style: Vec<f64>,
        log_alpha: f64,
        /// The logarithm of the factor that multiplies all focal lengths.
        log_focal: f64,
    }

    /// How the poses move in one call.
    #[derive(Clone, Copy, Debug)]
    enum PoseMotion {
        Held,
        /// Each by itself.
        Each,
        /// Each but the target's: the paper's Δp_l.
        Sources,
        /// All as p0 moves them, every Δp_l held.
        Together,
    }

    /// Which variables move, by which of Ceres's minimisers, until when.
    struct MinimiseOptions {
        poses: PoseMotion,
        free_style: bool,
        free_alpha: bool,
        free_focal: bool,
        target: u32,
        /// A residual block each instead of the accumulated evaluation.
        blocks: bool,
        /// L-BFGS instead of Levenberg–Marquardt.
        line_search: bool,
        lbfgs_rank: u32,
        interpolation: Interpolation,
        initial_trust_region_radius: f64,
        /// The linear solver of Levenberg–Marquardt over blocks.
        linear_solver: LinearSolver,
        max_iterations: u32,
        /// Stop once an iteration changes the objective by a smaller share.
        tolerance: f64,
        /// The threads of the accumulated evaluation.
        threads: u32,
    }

    /// Ceres's. The Schur solvers eliminate all poses but the target's: no two of these may share a residual.
    #[derive(Clone, Copy, Debug)]
    enum LinearSolver {
        DenseSchur,
        SparseSchur,
        SparseNormalCholesky,
        DenseNormalCholesky,
        IterativeSchur,
    }

    /// How L-BFGS's line search chooses its next trial.
    #[derive(Clone, Copy, Debug)]
    enum Interpolation {
        Cubic,
        Quadratic,
        Bisection,
    }

    /// The objective by term, weights included.
    #[derive(Clone, Copy, Debug)]
    struct Costs {
        photometric: f64,
        silhouette: f64,
        inverse_depth: f64,
        style: f64,
        motion: f64,
        focal: f64,
    }

    /// The objective and its derivatives by [ω_l; t_l] of each frame (a twist about the current pose), style, log α and log focal.
    struct Derivatives {
        gradient: Vec<f64>,
        /// The Gauss–Newton matrix, row-major.
        normal_matrix: Vec<f64>,
    }

    /// Styles, one after another, that move points along the same axis (0 = x, 1 = y, 2 = z).
    struct AxisStyles {
        axis: u32,
        count: u32,
    }

    /// The state after one of Ceres's iterations; 0 is the start.
    struct Iteration {
        number: u32,
        costs: Costs,
        log_alpha: f64,
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
        /// After the last iteration; 0 of L-BFGS.
        trust_region_radius: f64,
    }

    extern "Rust" {
        type Colours;
        fn width(self: &Colours) -> usize;
        fn height(self: &Colours) -> usize;
        /// height × width × 3, in [0, 255].
        fn rgb(self: &Colours) -> &[f32];

        type PriorCallback;
        /// The number of points N.
        fn point_count(self: &PriorCallback) -> usize;
        /// The number of style entries S.
        fn style_count(self: &PriorCallback) -> usize;
        /// The Jacobian where it is the same at every style, else nothing.
        fn constant_jacobian(self: &PriorCallback) -> Result<&[f64]>;
        fn axis_styles(self: &PriorCallback) -> Vec<AxisStyles>;
        fn points(self: &PriorCallback, style: &[f64], points: &mut [f64]) -> Result<()>;
        fn jacobian(self: &PriorCallback, style: &[f64], jacobian: &mut [f64]) -> Result<()>;

        type Observer<'a>;
        /// False stops the solver at this iteration.
        unsafe fn on_iteration(self: &mut Observer<'_>, iteration: &Iteration) -> bool;

        fn log_message(severity: i32, message: &str);
    }

    unsafe extern "C++" {
        include!("bridge/logs.h");
        include!("bridge/memory.h");
        include!("bridge/problem.h");

        /// Sends the log lines of Ceres to `log_message`; a process whose glog is set up already keeps its destinations.
        fn route_logs() -> Result<()>;

        /// Keeps freed memory for the process, where the C library is glibc.
        fn keep_freed_memory();

        /// What the frames show; read-only, for any number of problems and threads.
        type Footage;
        /// Takes the images over.
        fn new_footage(frames: Vec<FrameFootage>) -> Result<SharedPtr<Footage>>;

        /// The terms over the frames and the prior.
        type Problem;
        fn new_problem(
            footage: SharedPtr<Footage>,
            prior: Box<PriorCallback>,
            terms: &Terms,
        ) -> Result<UniquePtr<Problem>>;

        /// [`VisibilityInput`], sorted by point.
        type Visibility;
        fn new_visibility(problem: &Problem, input: &VisibilityInput) -> Result<UniquePtr<Visibility>>;

        /// The objective; errs where a point is behind a camera.
        fn evaluate(
            self: Pin<&mut Problem>,
            variables: &Variables,
            visibility: &Visibility,
            threads: u32,
        ) -> Result<Costs>;
        fn differentiate(
            self: Pin<&mut Problem>,
            variables: &Variables,
            visibility: &Visibility,
            threads: u32,
        ) -> Result<Derivatives>;
        /// The best state found, whatever stopped it.
        fn minimise(
            self: Pin<&mut Problem>,
            variables: &mut Variables,
            visibility: &Visibility,
            options: &MinimiseOptions,
            observer: &mut Observer<'_>,
        ) -> Result<Summary>;
    }
}

// SAFETY: footage is never changed after it was made, and holds no thread's own state.
unsafe impl Send for ffi::Footage {}
// SAFETY: as above.
unsafe impl Sync for ffi::Footage {}

/// An image as C++ borrows it.
pub struct Colours(pub Arc<RgbImage>);

impl Colours {
    fn width(&self) -> usize {
        self.0.width()
    }

    fn height(&self) -> usize {
        self.0.height()
    }

    fn rgb(&self) -> &[f32] {
        self.0.data().as_flattened()
    }
}

/// How C++ asks for X(s) and ∂X/∂s.
pub struct PriorCallback {
    prior: Arc<dyn ShapePrior>,
    points: usize,
}

impl PriorCallback {
    /// The first `points` of the prior's.
    pub fn new(prior: Arc<dyn ShapePrior>, points: usize) -> Self {
        Self { prior, points }
    }

    fn point_count(&self) -> usize {
        self.points
    }

    fn style_count(&self) -> usize {
        self.prior.style_len()
    }

    fn constant_jacobian(&self) -> Result<&[f64], String> {
        let whole = guarded("the shape prior", || self.prior.constant_jacobian())?.unwrap_or_default();
        let of_points = &whole[..whole.len().min(3 * self.points * self.prior.style_len())];
        finite("the shape prior's Jacobian", of_points)?;
        Ok(of_points)
    }

    fn axis_styles(&self) -> Vec<ffi::AxisStyles> {
        let runs = self.prior.axis_styles().iter();
        runs.map(|styles| ffi::AxisStyles {
            axis: styles.axis as u32,
            count: styles.count as u32,
        })
        .collect()
    }

    fn points(&self, style: &[f64], points: &mut [f64]) -> Result<(), String> {
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
