//! Minimisers and strategies on one objective from the same starts.
//!
//! Iterations of different methods mean different things, and each sees its own visibility while a call runs. So every
//! state at the end of a call is judged by one referee: the objective at full resolution with the visibility of that
//! state, against processor seconds and against all evaluations, of residuals and of Jacobians.

use super::measures::mean;
use super::plot::{Axis, Chart, Line};
use super::table::cell;
use super::{Effort, Jobs, Measures, Method, StudyError, Subject, Table, perturbed_pose};
use crate::config::Config;
use crate::eval::{location_error, orientation_error_deg};
use crate::init::{Estimate, cameras_from_input};
use crate::objective::Objective;
use crate::prior::{self, ShapePrior};
use crate::report::Surface;
use crate::sequence::Sequence;
use crate::solver::{self, Evaluation, Interpolation, LinearSolver, Minimiser, Strategy, Termination};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::path::Path;
use std::sync::Arc;

/// Seed 0 is the start itself; the others turn its target pose by so much and move it by a share of its distance.
const ANGLE_DEG: f64 = 5.0;
const SHIFT: f64 = 0.02;

/// A state on a method's way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stage {
    /// The referee's.
    pub objective: f64,
    /// Since the start, residual and Jacobian evaluations together.
    pub evaluations: usize,
    pub cpu_seconds: f64,
    /// Means over the frames, where the truth is known.
    pub orientation_error_deg: Option<f64>,
    pub location_error_percent: Option<f64>,
}

/// One method from one start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Course {
    pub method: String,
    pub seed: u64,
    /// From the start to the end.
    pub stages: Vec<Stage>,
    pub measures: Measures,
}

/// All methods from all starts.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    pub sequence: String,
    pub methods: Vec<(String, Config)>,
    pub courses: Vec<Course>,
}

/// Both minimisers with both strategies, L-BFGS with each history of `ranks` and each of `interpolations`; and joint LM
/// over a residual block each with each of `linear_solvers`.
pub fn methods(
    ranks: &[u32],
    interpolations: &[Interpolation],
    linear_solvers: &[LinearSolver],
) -> Vec<Method> {
    let method = |name: String, label: String, minimiser, strategy| {
        let mut config = Config::default();
        config.solver.minimiser = minimiser;
        config.solver.strategy = strategy;
        Method::new(&name, &label, config)
    };
    let mut methods = Vec::new();
    for (strategy, word) in [(Strategy::Joint, "joint"), (Strategy::Alternating, "alternating")] {
        let lm = Minimiser::lm(LinearSolver::Auto);
        methods.push(method(format!("lm-{word}"), format!("LM, {word}"), lm, strategy));
    }
    for (&rank, &interpolation) in ranks.iter().flat_map(|rank| {
        interpolations
            .iter()
            .map(move |interpolation| (rank, interpolation))
    }) {
        for (strategy, word) in [(Strategy::Joint, "joint"), (Strategy::Alternating, "alternating")] {
            let kind = format!("{interpolation:?}").to_lowercase();
            let label = format!("L-BFGS, {word}, history {rank}, {kind}");
            let lbfgs = Minimiser::Lbfgs { rank, interpolation };
            methods.push(method(
                format!("lbfgs-{rank}-{kind}-{word}"),
                label,
                lbfgs,
                strategy,
            ));
        }
    }
    for &solver in linear_solvers {
        let label = format!("LM, joint, over blocks, {solver:?}");
        let name = format!("lm-joint-{solver:?}");
        let mut over_blocks = method(name, label, Minimiser::lm(solver), Strategy::Joint);
        over_blocks.config.solver.evaluation = Evaluation::Blocks;
        methods.push(over_blocks);
    }
    methods
}

/// Runs what is missing: every method from the start and from `seeds` − 1 others near it.
pub fn compare(
    subject: &Subject,
    methods: &[Method],
    seeds: u64,
    jobs: &Jobs,
    effort: Effort,
) -> Result<Comparison, StudyError> {
    let start = subject.start(jobs, effort)?.short;
    let target = subject.sequence.frames.len() / 2;
    let methods: Vec<Method> = methods.iter().map(|method| method.clone().with(effort)).collect();
    let runs: Vec<(&Method, u64)> = (0..seeds)
        .flat_map(|seed| methods.iter().map(move |method| (method, seed)))
        .collect();
    let courses = jobs.run(
        &runs,
        |(method, seed)| format!("{}/compare-{}-{seed}", subject.name, method.name),
        |(method, seed)| Ok(json!([subject.digest(), method.config, start, seed])),
        |&(method, seed), observer| {
            course(
                subject,
                target,
                method,
                &near(&start, target, seed),
                seed,
                observer,
            )
        },
    )?;
    Ok(Comparison {
        sequence: subject.name.clone(),
        methods: methods
            .iter()
            .map(|method| (method.label.clone(), method.config.clone()))
            .collect(),
        courses,
    })
}

/// The seed's start; relative motion (Eq. 13), style and α stay.
fn near(start: &Estimate, target: usize, seed: u64) -> Estimate {
    if seed == 0 {
        return start.clone();
    }
    let cameras = &start.camera_from_object;
    let target_from_object = perturbed_pose(&cameras[target], ANGLE_DEG, SHIFT, seed);
    Estimate {
        camera_from_object: cameras_from_input(&target_from_object, target, cameras, 1.0),
        ..start.clone()
    }
}

fn course(
    subject: &Subject,
    target: usize,
    method: &Method,
    start: &Estimate,
    seed: u64,
    observer: &solver::Observer,
) -> Result<Course, StudyError> {
    let name = || format!("{}/{}", subject.name, method.name);
    let Config {
        objective, solver, ..
    } = &method.config;
    let learned = prior::find(&method.config.prior)?;
    let prior: Arc<dyn ShapePrior> = Arc::new(learned.clone());
    let footage = subject.footage(solver.levels)?;
    let solution = solver::refine(&footage, &prior, target, start, objective, solver, observer)
        .map_err(|source| StudyError::Solve { name: name(), source })?;
    if solution.termination == Termination::Interrupted {
        return Err(StudyError::Interrupted);
    }
    let failed = |source| StudyError::Objective { name: name(), source };
    let mut referee = Objective::new(&footage, prior, objective, target, start, 1).map_err(failed)?;
    let mut judge = |estimate: &Estimate, evaluations, cpu_seconds| {
        let visibility = referee.visibility(estimate, 0)?;
        let canonical = Surface::of_estimate(&learned, estimate).1;
        let [orientation_error_deg, location_error_percent] = camera_errors(&subject.sequence, &canonical);
        Ok(Stage {
            objective: referee.evaluate(estimate, &visibility)?.total,
            evaluations,
            cpu_seconds,
            orientation_error_deg,
            location_error_percent,
        })
    };
    let mut stages = vec![judge(start, 0, 0.0).map_err(failed)?];
    for step in &solution.steps {
        let evaluations = step.evaluations.residual + step.evaluations.jacobian;
        stages.push(judge(&step.estimate, evaluations, step.cpu_seconds).map_err(failed)?);
    }
    Ok(Course {
        method: method.label.clone(),
        seed,
        stages,
        measures: subject.measure(&learned, &solution.estimate),
    })
}

/// Mean orientation error in degrees and location error in % of the diagonal.
fn camera_errors(sequence: &Sequence, estimate: &Estimate) -> [Option<f64>; 2] {
    let Some(truth) = &sequence.truth else {
        return [None, None];
    };
    let poses = || truth.camera_from_object.iter().enumerate();
    let orientation = poses()
        .map(|(l, pose)| orientation_error_deg(&estimate.camera_from_object[l].rotation, &pose.rotation));
    let location = poses().map(|(l, pose)| 100.0 * location_error(&estimate.camera_from_object[l], pose));
    [mean(orientation), mean(location)]
}

impl Comparison {
    /// The least objective that any method found from a seed's start.
    fn best(&self, seed: u64) -> f64 {
        let there = self.courses.iter().filter(|course| course.seed == seed);
        there
            .flat_map(|course| &course.stages)
            .map(|stage| stage.objective)
            .fold(f64::INFINITY, f64::min)
    }

    /// The first stage of a course within a share of the best.
    fn reached(&self, course: &Course, share: f64) -> Option<Stage> {
        let bound = (1.0 + share) * self.best(course.seed);
        course
            .stages
            .iter()
            .find(|stage| stage.objective <= bound)
            .cloned()
    }

    /// Per method, over the seeds: medians, and least to greatest.
    pub fn summary(&self) -> Table {
        let mut table = Table::new(&[
            "method",
            "objective / best",
            "CPU s",
            "evaluations",
            "CPU s to 1 %",
            "evaluations to 1 %",
            "CPU s to 0.1 %",
            "evaluations to 0.1 %",
            "location error, %",
            "orientation error, deg",
            "turn error, deg",
        ]);
        for (method, _) in &self.methods {
            let courses: Vec<&Course> = self
                .courses
                .iter()
                .filter(|course| course.method == *method)
                .collect();
            let over = |value: &dyn Fn(&Course) -> Option<f64>, digits: usize| {
                spread(courses.iter().map(|course| value(course)).collect(), digits)
            };
            let last = |course: &Course| course.stages.last().cloned();
            table.rows.push(vec![
                method.clone(),
                over(
                    &|course| Some(last(course)?.objective / self.best(course.seed)),
                    4,
                ),
                over(&|course| Some(last(course)?.cpu_seconds), 0),
                over(&|course| Some(last(course)?.evaluations as f64), 0),
                over(&|course| Some(self.reached(course, 0.01)?.cpu_seconds), 0),
                over(&|course| Some(self.reached(course, 0.01)?.evaluations as f64), 0),
                over(&|course| Some(self.reached(course, 0.001)?.cpu_seconds), 0),
                over(&|course| Some(self.reached(course, 0.001)?.evaluations as f64), 0),
                over(&|course| course.measures.location_error_percent, 2),
                over(&|course| course.measures.orientation_error_deg, 3),
                over(&|course| course.measures.turn_error_deg, 3),
            ]);
        }
        table
    }

    /// One line per state.
    pub fn details(&self) -> Table {
        let mut table = Table::new(&[
            "method",
            "seed",
            "call",
            "objective",
            "evaluations",
            "cpu_seconds",
            "orientation_error_deg",
            "location_error_percent",
        ]);
        for course in &self.courses {
            for (call, stage) in course.stages.iter().enumerate() {
                table.rows.push(vec![
                    course.method.clone(),
                    course.seed.to_string(),
                    call.to_string(),
                    cell(Some(stage.objective), 4),
                    stage.evaluations.to_string(),
                    cell(Some(stage.cpu_seconds), 3),
                    cell(stage.orientation_error_deg, 4),
                    cell(stage.location_error_percent, 4),
                ]);
            }
        }
        table
    }

    /// `compare-objective-seconds.svg`, `compare-objective-evaluations.svg` and, with truth,
    /// `compare-location-seconds.svg`: seed 0.
    pub fn draw(&self, folder: &Path) -> Result<(), StudyError> {
        let best = self.best(0);
        let lines = |place: &dyn Fn(&Stage) -> (f64, f64)| -> Vec<Line> {
            let there = self.courses.iter().filter(|course| course.seed == 0);
            there
                .map(|course| Line {
                    label: course.method.clone(),
                    points: course.stages.iter().map(place).collect(),
                    joined: true,
                })
                .collect()
        };
        // The best itself has no place on a logarithmic axis.
        let above = |stage: &Stage| (stage.objective / best - 1.0).max(1e-5);
        Chart {
            title: "Objective above the best found",
            x: Axis::linear("processor seconds"),
            y: Axis::logarithmic("share above the best"),
            lines: lines(&|stage| (stage.cpu_seconds, above(stage))),
        }
        .write(&folder.join("compare-objective-seconds.svg"))?;
        Chart {
            title: "Objective above the best found",
            x: Axis::linear("evaluations, residual and Jacobian"),
            y: Axis::logarithmic("share above the best"),
            lines: lines(&|stage| (stage.evaluations as f64, above(stage))),
        }
        .write(&folder.join("compare-objective-evaluations.svg"))?;
        if self
            .courses
            .iter()
            .all(|course| course.measures.location_error_percent.is_none())
        {
            return Ok(());
        }
        Chart {
            title: "Camera location error",
            x: Axis::linear("processor seconds"),
            y: Axis::linear("% of the diagonal"),
            lines: lines(&|stage| {
                (
                    stage.cpu_seconds,
                    stage.location_error_percent.unwrap_or(f64::NAN),
                )
            }),
        }
        .write(&folder.join("compare-location-seconds.svg"))
    }
}

/// `median (least – greatest)`, with how many there are where some are missing.
fn spread(values: Vec<Option<f64>>, digits: usize) -> String {
    let all = values.len();
    let mut there: Vec<f64> = values.into_iter().flatten().collect();
    there.sort_by(f64::total_cmp);
    let (Some(least), Some(greatest)) = (there.first(), there.last()) else {
        return "-".to_owned();
    };
    let middle = 0.5 * (there[(there.len() - 1) / 2] + there[there.len() / 2]);
    let mut text = format!("{middle:.digits$}");
    if there.len() > 1 {
        text += &format!(" ({least:.digits$} – {greatest:.digits$})");
    }
    if there.len() < all {
        text += &format!(" in {} of {all}", there.len());
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Pose, Rotation3, Vector3};

    fn comparison() -> Comparison {
        let stage = |objective, evaluations, cpu_seconds| Stage {
            objective,
            evaluations,
            cpu_seconds,
            orientation_error_deg: None,
            location_error_percent: None,
        };
        let course = |method: &str, seed, stages| Course {
            method: method.into(),
            seed,
            stages,
            measures: Measures::default(),
        };
        Comparison {
            sequence: "s".into(),
            methods: vec![("a".into(), Config::default()), ("b".into(), Config::default())],
            courses: vec![
                course(
                    "a",
                    0,
                    vec![stage(200.0, 0, 0.0), stage(100.5, 10, 1.0), stage(100.0, 20, 2.0)],
                ),
                course("b", 0, vec![stage(200.0, 0, 0.0), stage(102.0, 30, 3.0)]),
                course("a", 1, vec![stage(300.0, 0, 0.0), stage(200.0, 40, 5.0)]),
                course("b", 1, vec![stage(300.0, 0, 0.0), stage(150.0, 50, 6.0)]),
            ],
        }
    }

    #[test]
    fn the_best_is_per_seed_and_convergence_is_measured_to_it() {
        let table = comparison().summary();
        let cells = |row: usize| table.rows[row][1..6].join(" | ");
        assert_eq!(
            cells(0),
            "1.1667 (1.0000 – 1.3333) | 4 (2 – 5) | 30 (20 – 40) | 1 in 1 of 2 | 10 in 1 of 2"
        );
        assert_eq!(
            cells(1),
            "1.0100 (1.0000 – 1.0200) | 4 (3 – 6) | 40 (30 – 50) | 6 in 1 of 2 | 50 in 1 of 2"
        );
    }

    #[test]
    fn seeds_keep_the_relative_motion() {
        let start = Estimate {
            camera_from_object: vec![
                Pose {
                    translation: Vector3::new(0.0, 0.1, 1.7),
                    ..Pose::identity()
                },
                Pose {
                    rotation: Rotation3::from_scaled_axis(Vector3::new(0.0, 0.2, 0.1)),
                    translation: Vector3::new(0.1, 0.1, 1.75),
                },
            ],
            style: vec![0.5],
            alpha: 0.7,
            focal_factor: 1.0,
        };
        assert_eq!(near(&start, 1, 0), start);
        let moved = near(&start, 1, 3);
        let relative = |estimate: &Estimate| {
            estimate.camera_from_object[1].after(&estimate.camera_from_object[0].inverse())
        };
        let (a, b) = (relative(&start), relative(&moved));
        assert!((a.to_twist() - b.to_twist()).norm() < 1e-12);
        let angle = orientation_error_deg(
            &moved.camera_from_object[1].rotation,
            &start.camera_from_object[1].rotation,
        );
        assert!((angle - ANGLE_DEG).abs() < 1e-9);
    }
}
