//! Whether a result can be used, in words, and what to try next.

use super::facts::{Frame, main_rows};
use crate::report::{Doubts, RunResult};
use crate::solver::{HypothesisOutcome, Termination, TraceRow};
use serde::Serialize;

/// The solve was still getting somewhere where its last so many iterations brought the objective down by this share.
const LAST_ITERATIONS: usize = 10;
const STILL_FALLING: f64 = 0.005;
/// A hypothesis that ends within this share of the chosen one, from a direction this far off, explains the frames as well.
const AS_GOOD: f64 = 0.05;
const OTHER_DIRECTION_DEG: f64 = 30.0;
/// Frames that turn by less than this in all show one side.
const ONE_SIDE_DEG: f64 = 15.0;

/// The page's first words.
#[derive(Serialize)]
pub(super) struct Verdict {
    /// `good`, `doubtful` or `bad`.
    level: &'static str,
    title: &'static str,
    words: String,
}

impl Verdict {
    pub fn of(result: &RunResult, doubts: &Doubts) -> Self {
        let iou = result.silhouette_iou_mean;
        let interrupted = result.termination == Termination::Interrupted;
        if !doubts.explained {
            return Self {
                level: "bad",
                title: "Not usable",
                words: "No likely shape of the prior explains the masks. The result is here to be looked at, not to be used.".to_owned(),
            };
        }
        if !doubts.words.is_empty() || interrupted {
            let words = if interrupted {
                "The solve was interrupted; this is the best state that it had found."
            } else {
                "Look at the points below before you use the result."
            };
            return Self {
                level: "doubtful",
                title: "In doubt",
                words: words.to_owned(),
            };
        }
        Self {
            level: "good",
            title: "Usable",
            words: format!(
                "Shape and masks agree by an IoU of {iou:.2}, the shape is a likely one of the prior, and nothing else that is checked speaks \
                 against the result. Truth was not known, so that no error is measured here."
            ),
        }
    }
}

/// What a person can do next, the most pressing first.
pub(super) struct Advice {
    pub steps: Vec<Step>,
}

/// One thing to try.
#[derive(Serialize)]
pub(super) struct Step {
    words: String,
    /// Options to add to `spba-ceres solve`, or a whole command; empty where there is none.
    command: String,
}

impl Advice {
    pub fn of(result: &RunResult, trace: &[TraceRow], frames: &[Frame], doubts: &Doubts) -> Self {
        let mut advice = Self { steps: Vec::new() };
        advice.about_the_end(result, trace);
        advice.about_the_start(result);
        let turned: f64 = frames.iter().filter_map(|frame| frame.turn_deg).sum();
        if turned < ONE_SIDE_DEG {
            let words = format!(
                "The frames turn by {turned:.0}° in all, so that one side is seen: the rest is the prior's guess. Add frames from other sides."
            );
            advice.add(words, "");
        }
        if !doubts.words.is_empty() {
            let words = "Go through the frames above with the mask's outline on: where it leaves the object, mend the mask; where the shape \
                         leaves a right mask, the prior is to blame, or the pose.";
            advice.add(words, "");
        }
        if !result.prior.contains(" surface ") {
            let words =
                "This prior is one of points. A prior of surfaces gives a closed mesh with a texture.";
            advice.add(words, "");
        }
        if doubts.words.is_empty() {
            let words = "Where the truth is known, measure the result.";
            advice.add(words, "spba-ceres eval RESULT --truth SEQUENCE");
        }
        advice
    }

    fn add(&mut self, words: impl Into<String>, command: &str) {
        self.steps.push(Step {
            words: words.into(),
            command: command.to_owned(),
        });
    }

    fn about_the_end(&mut self, result: &RunResult, trace: &[TraceRow]) {
        match result.termination {
            Termination::Interrupted => self.add(
                "Go on from where the solve was stopped, into a new folder.",
                "--init-pose RESULT --init-style RESULT",
            ),
            Termination::StepLimit if still_falling(trace) => self.add(
                "The solve stopped at its step limit while the objective was still falling. Allow more steps.",
                "--max-steps 60",
            ),
            _ => {}
        }
    }

    fn about_the_start(&mut self, result: &RunResult) {
        if let Some((chosen, other)) = as_good(&result.hypotheses) {
            let words = format!(
                "Another direction explains the frames nearly as well: azimuth {:.0}° instead of {:.0}°. Check in the viewer that the front is \
                 the front, and let more hypotheses compete.",
                other.azimuth_deg, chosen.azimuth_deg
            );
            self.add(words, "--hypotheses 16");
        }
    }
}

fn still_falling(trace: &[TraceRow]) -> bool {
    let rows = main_rows(trace);
    // The free form has a limit of its own, of which no option asks.
    let Some(last) = rows.last().filter(|row| !row.stage.contains("free-form")) else {
        return false;
    };
    let of_stage: Vec<_> = rows.iter().filter(|row| row.stage == last.stage).collect();
    let before = of_stage[of_stage.len().saturating_sub(LAST_ITERATIONS + 1)];
    before.objective.total - last.objective.total > STILL_FALLING * last.objective.total
}

/// The chosen hypothesis and the best one from another direction, where that is as good.
fn as_good(hypotheses: &[HypothesisOutcome]) -> Option<(&HypothesisOutcome, &HypothesisOutcome)> {
    let chosen = hypotheses.iter().find(|hypothesis| hypothesis.chosen)?;
    let apart = |other: &HypothesisOutcome| {
        let turn = (other.azimuth_deg - chosen.azimuth_deg).rem_euclid(360.0);
        turn.min(360.0 - turn)
    };
    let others = hypotheses.iter().filter(|other| {
        !other.chosen
            && apart(other) > OTHER_DIRECTION_DEG
            && other.objective_end < (1.0 + AS_GOOD) * chosen.objective_end
    });
    let best = others.min_by(|a, b| a.objective_end.total_cmp(&b.objective_end))?;
    Some((chosen, best))
}
