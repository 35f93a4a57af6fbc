//! A comparison as tables.

use super::{Comparison, JudgedState, Minimisation};
use crate::solver::Termination;
use crate::study::Table;
use crate::study::table::cell;

/// A column of numbers: its heading, how many decimals, and where its numbers come from.
struct Column<'a> {
    heading: &'a str,
    digits: usize,
    value: Value<'a>,
}

type Value<'a> = Box<dyn Fn(&Minimisation) -> Option<f64> + 'a>;

fn column<'a>(
    heading: &'a str,
    digits: usize,
    value: impl Fn(&Minimisation) -> Option<f64> + 'a,
) -> Column<'a> {
    Column {
        heading,
        digits,
        value: Box::new(value),
    }
}

impl Comparison {
    /// Mean ± standard deviation over the seeds, a line per minimiser. What no truth tells has no column.
    pub fn summary(&self) -> Table {
        let mut columns = vec![
            column("objective", 1, |m| Some(m.last().objective)),
            column("above the best, %", 2, |m| Some(self.above_best_percent(m))),
            column("iterations", 0, |m| Some(m.last().iterations as f64)),
            column("evaluations", 0, |m| Some(m.last().evaluations as f64)),
            column("CPU s", 1, |m| Some(m.last().cpu_seconds)),
            column("CPU s to within 1 %", 1, |m| Some(self.reached(m)?.cpu_seconds)),
        ];
        let errors = [
            column("rotation error, deg", 3, |m| m.last().rotation_error_deg),
            column("location error, %", 2, |m| m.last().location_error_percent),
            column("depth error", 4, |m| m.measures.depth_error),
            column("turn error, deg", 3, |m| m.measures.turn_error_deg),
        ];
        columns.extend(errors.into_iter().filter(|column| self.is_known(column)));
        let mut headings = vec!["minimiser"];
        headings.extend(columns.iter().map(|column| column.heading));
        let mut table = Table::new(&headings);
        for minimiser in &self.minimisers {
            let minimisations = self.of(&minimiser.name);
            let mut row = vec![minimiser.name.clone()];
            row.extend(columns.iter().map(|column| {
                let values = minimisations.iter().map(|m| (column.value)(m)).collect();
                spread(values, column.digits)
            }));
            table.rows.push(row);
        }
        table
    }

    /// What the summary is of, and which minimiser comes within 1 % of the best in the fewest processor seconds.
    pub fn words(&self) -> String {
        let starts = match self.starts.len() {
            1 => "One start: the best of the short solves.".to_owned(),
            count => format!(
                "Mean ± standard deviation over {count} starts: the best of the short solves, and {} perturbed from it by {}° and \
                 {} of the distance.",
                count - 1,
                self.perturbation.rotation_deg,
                self.perturbation.share_of_distance
            ),
        };
        format!(
            "Sequence `{}`, {} frames. {starts} The best objective is the least that any of them reached from the same \
             start, at the end of any solver call; a minimiser may end above what it reached.\n\n{}\n",
            self.sequence,
            self.frames,
            self.soonest()
        )
    }

    /// From most starts, and of those from as many in the fewest seconds on average.
    fn soonest(&self) -> String {
        let reached = self.minimisers.iter().map(|minimiser| {
            let seconds: Vec<f64> = self
                .of(&minimiser.name)
                .into_iter()
                .filter_map(|m| Some(self.reached(m)?.cpu_seconds))
                .collect();
            let mean = seconds.iter().sum::<f64>() / seconds.len().max(1) as f64;
            (seconds.len(), mean, &minimiser.name)
        });
        let soonest = reached.max_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)));
        soonest.map_or_else(String::new, |(count, seconds, name)| {
            format!(
                "Within 1 % of the best objective first: `{name}`, after {seconds:.1} CPU s, from {count} of {} starts.",
                self.starts.len()
            )
        })
    }

    /// A line per minimiser and seed. The columns of processor seconds, the last two, are the only ones that differ from run
    /// to run.
    pub fn results(&self) -> Table {
        let mut columns = vec![
            column("objective", 4, |m| Some(m.last().objective)),
            column("best_objective", 4, |m| Some(self.best(m.seed))),
            column("above_best_percent", 4, |m| Some(self.above_best_percent(m))),
            column("iterations", 0, |m| Some(m.last().iterations as f64)),
            column("evaluations", 0, |m| Some(m.last().evaluations as f64)),
            column("evaluations_to_1_percent", 0, |m| {
                Some(self.reached(m)?.evaluations as f64)
            }),
        ];
        let measures = [
            column("rotation_error_deg", 4, |m| m.last().rotation_error_deg),
            column("location_error_percent", 4, |m| m.last().location_error_percent),
            column("depth_error", 5, |m| m.measures.depth_error),
            column("depth_error_at_best_scale", 5, |m| {
                m.measures.depth_error_at_best_scale
            }),
            column("chamfer_percent", 4, |m| m.measures.chamfer_percent),
            column("turn_error_deg", 4, |m| m.measures.turn_error_deg),
            column("silhouette_iou", 4, |m| m.measures.silhouette_iou),
            column("density", 4, |m| m.measures.density),
        ];
        columns.extend(measures.into_iter().filter(|column| self.is_known(column)));
        columns.push(column("cpu_seconds", 3, |m| Some(m.last().cpu_seconds)));
        columns.push(column("cpu_seconds_to_1_percent", 3, |m| {
            Some(self.reached(m)?.cpu_seconds)
        }));
        let mut headings = vec!["minimiser", "seed", "termination"];
        headings.extend(columns.iter().map(|column| column.heading));
        let mut table = Table::new(&headings);
        for minimisation in &self.minimisations {
            let mut row = vec![
                minimisation.minimiser.clone(),
                minimisation.seed.to_string(),
                termination(minimisation.termination).to_owned(),
            ];
            row.extend(
                columns
                    .iter()
                    .map(|column| number((column.value)(minimisation), column.digits)),
            );
            table.rows.push(row);
        }
        table
    }

    /// A line per judged state. Only the last column differs from run to run.
    pub fn calls(&self) -> Table {
        let has_truth = self.is_known(&column("", 0, |m| m.last().location_error_percent));
        let errors = |state: &JudgedState| {
            let errors = [state.rotation_error_deg, state.location_error_percent];
            errors.map(|error| number(error, 4)).to_vec()
        };
        let mut headings = vec![
            "minimiser",
            "seed",
            "call",
            "level",
            "iterations",
            "evaluations",
            "objective",
        ];
        if has_truth {
            headings.extend(["rotation_error_deg", "location_error_percent"]);
        }
        headings.push("cpu_seconds");
        let mut table = Table::new(&headings);
        for minimisation in &self.minimisations {
            for (call, state) in minimisation.states.iter().enumerate() {
                let mut row = vec![
                    minimisation.minimiser.clone(),
                    minimisation.seed.to_string(),
                    call.to_string(),
                    state.level.map_or_else(String::new, |level| level.to_string()),
                    state.iterations.to_string(),
                    state.evaluations.to_string(),
                    number(Some(state.objective), 4),
                ];
                if has_truth {
                    row.extend(errors(state));
                }
                row.push(number(Some(state.cpu_seconds), 3));
                table.rows.push(row);
            }
        }
        table
    }

    /// A line per solver iteration, as the minimiser saw it. Only the last column differs from run to run.
    pub fn iterations(&self) -> Table {
        let mut table = Table::new(&[
            "minimiser",
            "seed",
            "call",
            "level",
            "block",
            "iterations",
            "evaluations",
            "objective_in_call",
            "cpu_seconds",
        ]);
        for minimisation in &self.minimisations {
            for iteration in &minimisation.iterations {
                table.rows.push(vec![
                    minimisation.minimiser.clone(),
                    minimisation.seed.to_string(),
                    iteration.call.to_string(),
                    iteration.level.to_string(),
                    iteration.block.clone(),
                    iteration.iterations.to_string(),
                    iteration.evaluations.to_string(),
                    number(Some(iteration.objective), 4),
                    number(Some(iteration.cpu_seconds), 3),
                ]);
            }
        }
        table
    }

    fn above_best_percent(&self, minimisation: &Minimisation) -> f64 {
        100.0 * (minimisation.last().objective / self.best(minimisation.seed) - 1.0)
    }

    fn is_known(&self, column: &Column) -> bool {
        self.minimisations
            .iter()
            .any(|minimisation| (column.value)(minimisation).is_some())
    }
}

fn termination(termination: Termination) -> &'static str {
    match termination {
        Termination::BelowThreshold => "below_threshold",
        Termination::Converged => "converged",
        Termination::StepLimit => "step_limit",
        Termination::Interrupted => "interrupted",
    }
}

/// A cell for programs; empty for none.
fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(String::new, |_| cell(value, digits))
}

/// `mean ± standard deviation`, with how many values there are where some are missing.
fn spread(values: Vec<Option<f64>>, digits: usize) -> String {
    let all = values.len();
    let known: Vec<f64> = values.into_iter().flatten().collect();
    let count = known.len();
    if count == 0 {
        return "-".to_owned();
    }
    let mean = known.iter().sum::<f64>() / count as f64;
    let mut text = format!("{mean:.digits$}");
    if count > 1 {
        let squares: f64 = known.iter().map(|value| (value - mean).powi(2)).sum();
        text += &format!(" ± {:.digits$}", (squares / (count - 1) as f64).sqrt());
    }
    if count < all {
        text += &format!(" in {count} of {all}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::tests::comparison;

    #[test]
    fn the_best_is_per_seed_and_what_is_not_known_has_no_column() {
        let comparison = comparison();
        let table = comparison.summary();
        assert_eq!(
            table.headings,
            [
                "minimiser",
                "objective",
                "above the best, %",
                "iterations",
                "evaluations",
                "CPU s",
                "CPU s to within 1 %"
            ]
        );
        let cells = |row: usize| table.rows[row].join(" | ");
        assert_eq!(
            cells(0),
            "a | 150.0 ± 70.7 | 16.67 ± 23.57 | 6 ± 3 | 30 ± 14 | 3.5 ± 2.1 | 1.0 in 1 of 2"
        );
        assert_eq!(
            cells(1),
            "b | 126.0 ± 33.9 | 1.00 ± 1.41 | 8 ± 3 | 40 ± 14 | 4.5 ± 2.1 | 6.0 in 1 of 2"
        );
        assert!(
            comparison
                .words()
                .contains("`a`, after 1.0 CPU s, from 1 of 2 starts")
        );
        assert_eq!(
            comparison.results().csv(),
            "minimiser,seed,termination,objective,best_objective,above_best_percent,iterations,evaluations,\
             evaluations_to_1_percent,cpu_seconds,cpu_seconds_to_1_percent\n\
             a,0,converged,100.0000,100.0000,0.0000,4,20,10,2.000,1.000\n\
             b,0,converged,102.0000,100.0000,2.0000,6,30,,3.000,\n\
             a,1,converged,200.0000,150.0000,33.3333,8,40,,5.000,\n\
             b,1,converged,150.0000,150.0000,0.0000,10,50,50,6.000,6.000\n"
        );
        assert!(!comparison.calls().csv().contains("error"));
    }

    #[test]
    fn errors_have_columns_where_the_truth_is_known() {
        let mut comparison = comparison();
        for minimisation in &mut comparison.minimisations {
            minimisation.measures.depth_error = Some(0.02);
            for state in &mut minimisation.states {
                state.rotation_error_deg = Some(1.5);
                state.location_error_percent = Some(3.0);
            }
        }
        let table = comparison.summary();
        assert_eq!(
            table.headings[7..],
            ["rotation error, deg", "location error, %", "depth error"]
        );
        assert_eq!(
            table.rows[0][7..],
            ["1.500 ± 0.000", "3.00 ± 0.00", "0.0200 ± 0.0000"]
        );
        let calls = comparison.calls();
        assert_eq!(calls.rows[0].join(","), "a,0,0,,0,0,200.0000,1.5000,3.0000,0.000");
    }
}
