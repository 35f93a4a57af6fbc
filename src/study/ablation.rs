//! The ablation: weights, Huber widths and terms of Eq. 9 changed one at a time.

use super::measures::mean;
use super::table::cell;
use super::{Effort, Jobs, Measures, Method, Run, StudyError, Subject, Table};
use crate::objective::ObjectiveOptions;
use serde::Serialize;

/// The record of one change to the objective on one sequence.
#[derive(Clone, Debug, Serialize)]
pub struct Entry {
    pub change: String,
    pub sequence: String,
    pub run: Run,
}

/// The records of the ablation.
#[derive(Clone, Debug, Serialize)]
pub struct Ablation {
    /// One entry per change and sequence.
    pub entries: Vec<Entry>,
}

type Change = (String, Box<dyn Fn(&mut ObjectiveOptions)>);

/// What is changed, in the table's order.
fn changes() -> Vec<Change> {
    fn scaled(what: &str, factor: f64, field: fn(&mut ObjectiveOptions) -> &mut f64) -> Change {
        (
            format!("{what} × {factor}"),
            Box::new(move |options| *field(options) *= factor),
        )
    }
    let mut changes: Vec<Change> = vec![("none".to_owned(), Box::new(|_| {}))];
    for (term, field) in [
        (
            "no photometric term",
            (|o| &mut o.photometric_weight) as fn(&mut ObjectiveOptions) -> &mut f64,
        ),
        ("no silhouette term", |o| &mut o.silhouette_weight),
        ("no inverse-depth term", |o| &mut o.inverse_depth_weight),
        ("no style term", |o| &mut o.style_weight),
        ("no Cauchy loss on silhouettes", |o| &mut o.silhouette_cauchy),
        ("no silhouette tolerance", |o| &mut o.silhouette_tolerance),
    ] {
        changes.push((term.to_owned(), Box::new(move |options| *field(options) = 0.0)));
    }
    changes.push((
        "hidden points kept in Eq. 4".to_owned(),
        Box::new(|options| options.covisible = false),
    ));
    for factor in [0.1, 10.0] {
        changes.push(scaled("λ1 (silhouette)", factor, |o| &mut o.silhouette_weight));
        changes.push(scaled("λ2 (inverse depth)", factor, |o| {
            &mut o.inverse_depth_weight
        }));
        changes.push(scaled("δ1 (photometric)", factor, |o| &mut o.photometric_huber));
        changes.push(scaled("δ2 (inverse depth)", factor, |o| {
            &mut o.inverse_depth_huber
        }));
    }
    changes
}

/// Every change on every sequence, all from the same start; runs what is missing.
pub fn ablation(
    subjects: impl IntoIterator<Item = Result<Subject, StudyError>>,
    jobs: &Jobs,
    effort: Effort,
) -> Result<Ablation, StudyError> {
    let mut entries = Vec::new();
    for subject in subjects {
        let subject = subject?;
        let start = subject.start(jobs, effort)?.short;
        let wanted = match effort {
            Effort::Full => usize::MAX,
            Effort::Quick => 3,
        };
        let methods: Vec<_> = changes()
            .into_iter()
            .take(wanted)
            .enumerate()
            .map(|(index, (label, change))| {
                let mut method = Method::ours().with(effort);
                change(&mut method.config.objective);
                (
                    Method::new(&format!("ablation-{index}"), &label, method.config),
                    start.clone(),
                )
            })
            .collect();
        for ((method, _), run) in methods.iter().zip(subject.runs(jobs, &methods)?) {
            entries.push(Entry {
                change: method.label.clone(),
                sequence: subject.name.clone(),
                run,
            });
        }
    }
    Ok(Ablation { entries })
}

impl Ablation {
    /// Means over the sequences.
    pub fn summary(&self) -> Table {
        let mut table = Table::new(&[
            "change",
            "depth error",
            "location error, %",
            "orientation error, deg",
            "silhouette IoU",
            "Chamfer, %",
            "evaluations",
        ]);
        for (change, _) in changes() {
            let there = || self.entries.iter().filter(|entry| entry.change == change);
            let measure = |value: fn(&Measures) -> Option<f64>| {
                mean(there().filter_map(|entry| value(&entry.run.measures)))
            };
            let evaluations = mean(
                there().map(|entry| (entry.run.evaluations.residual + entry.run.evaluations.jacobian) as f64),
            );
            table.rows.push(vec![
                change.clone(),
                cell(measure(|m| m.depth_error), 4),
                cell(measure(|m| m.location_error_percent), 2),
                cell(measure(|m| m.orientation_error_deg), 3),
                cell(measure(|m| m.silhouette_iou), 3),
                cell(measure(|m| m.chamfer_percent), 2),
                cell(evaluations, 0),
            ]);
        }
        table
    }

    /// One line per change and sequence.
    pub fn details(&self) -> Table {
        let mut table = Table::new(&[
            "change",
            "sequence",
            "depth_error",
            "location_error_percent",
            "orientation_error_deg",
            "silhouette_iou",
            "chamfer_percent",
            "cpu_seconds",
        ]);
        for Entry {
            change,
            sequence,
            run,
        } in &self.entries
        {
            let m = &run.measures;
            table.rows.push(vec![
                change.clone(),
                sequence.clone(),
                cell(m.depth_error, 5),
                cell(m.location_error_percent, 4),
                cell(m.orientation_error_deg, 4),
                cell(m.silhouette_iou, 4),
                cell(m.chamfer_percent, 4),
                cell(Some(run.cpu_seconds), 1),
            ]);
        }
        table
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_change_but_none_changes_something_and_stays_valid() {
        let mut seen: Vec<ObjectiveOptions> = Vec::new();
        for (label, change) in changes() {
            let mut options = ObjectiveOptions::default();
            change(&mut options);
            options.check().unwrap();
            assert_eq!(options == ObjectiveOptions::default(), label == "none", "{label}");
            assert!(!seen.contains(&options), "{label}");
            seen.push(options);
        }
    }
}
