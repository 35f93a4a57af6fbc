//! Table 1: methods against truth on rendered sequences, and on natural ones.

use super::measures::mean;
use super::table::cell;
use super::{Effort, Jobs, Measures, Method, Run, StudyError, Subject, Table};
use crate::prior;
use serde::Serialize;

/// One row's records.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    pub label: String,
    /// What the method is; `None` for what is not a solve.
    pub config: Option<crate::config::Config>,
    pub entries: Vec<Entry>,
}

/// What a sequence and its off-the-shelf poses and depth are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SequenceKind {
    /// Rendered; poses and depth are the truth with noise, holes and outliers.
    Rendered,
    /// Rendered; poses and sparse points are what COLMAP made of the images.
    RenderedRealInput,
    /// Rendered; poses are what COLMAP made of the images, and depth what openMVS made of both.
    RenderedOpenMvsInput,
    /// Photographed; without truth, but perhaps on a turning platform.
    Natural,
}

impl SequenceKind {
    const ALL: [Self; 4] = [
        Self::Rendered,
        Self::RenderedRealInput,
        Self::RenderedOpenMvsInput,
        Self::Natural,
    ];

    fn label(self) -> &'static str {
        match self {
            Self::Rendered => "rendered",
            Self::RenderedRealInput => "rendered, COLMAP",
            Self::RenderedOpenMvsInput => "rendered, COLMAP + openMVS",
            Self::Natural => "natural",
        }
    }
}

/// One row on one sequence.
#[derive(Clone, Debug, Serialize)]
pub struct Entry {
    pub sequence: String,
    pub kind: SequenceKind,
    pub measures: Measures,
    /// The processor time of a solve, seconds; `None` for what is not a solve.
    pub run: Option<Run>,
}

/// All records of the table.
#[derive(Clone, Debug, Serialize)]
pub struct Table1 {
    /// The rows, in the printed order.
    pub rows: Vec<Row>,
}

/// Runs what is missing, sequence by sequence, and collects the table.
pub fn table1<'s>(
    subjects: impl IntoIterator<Item = (SequenceKind, Result<Subject, StudyError>)> + 's,
    jobs: &Jobs,
    effort: Effort,
) -> Result<Table1, StudyError> {
    let methods = [
        Method::ours(),
        Method::ours_alternating_lbfgs(),
        Method::paper()?,
        Method::zhu()?,
    ]
    .map(|method| method.with(effort));
    let row = |label: &str, config| Row {
        label: label.to_owned(),
        config,
        entries: Vec::new(),
    };
    let mut solved: Vec<Row> = methods
        .iter()
        .map(|method| row(&method.label, Some(method.config.clone())))
        .collect();
    let mut given = row("off-the-shelf input", None);
    let mut template = row("initialisation (template)", None);
    let mut short = row("short solves (all start there)", None);
    for (kind, subject) in subjects {
        let subject = subject?;
        let start = subject.start(jobs, effort)?;
        let learned = prior::find(&methods[0].config.prior)?;
        let note = |row: &mut Row, measures, run| {
            row.entries.push(Entry {
                sequence: subject.name.clone(),
                kind,
                measures,
                run,
            });
        };
        note(
            &mut given,
            Measures::of_input(&subject.sequence, subject.platform.as_ref()),
            None,
        );
        note(&mut template, subject.measure(&learned, &start.template), None);
        note(&mut short, subject.measure(&learned, &start.short), None);
        let runs: Vec<_> = methods
            .iter()
            .map(|method| (method.clone(), start.short.clone()))
            .collect();
        for (row, run) in solved.iter_mut().zip(subject.runs(jobs, &runs)?) {
            note(row, run.measures.clone(), Some(run));
        }
    }
    Ok(Table1 {
        rows: solved.into_iter().chain([given, template, short]).collect(),
    })
}

impl Table1 {
    /// Means over the sequences of each kind, in the paper's units.
    pub fn summary(&self) -> Table {
        let mut table = Table::new(&[
            "method",
            "sequences",
            "depth error",
            "depth error at the best scale",
            "density",
            "location error",
            "orientation error, deg",
            "first camera given: location",
            "orientation, deg",
            "turn error, deg",
            "silhouette IoU",
            "Chamfer, %",
            "CPU s",
        ]);
        for kind in SequenceKind::ALL {
            for row in &self.rows {
                let entries: Vec<&Entry> = row.entries.iter().filter(|entry| entry.kind == kind).collect();
                if entries.is_empty() {
                    continue;
                }
                let measure = |value: fn(&Measures) -> Option<f64>| {
                    mean(entries.iter().filter_map(|entry| value(&entry.measures)))
                };
                let share = |percent: Option<f64>| percent.map(|percent| percent / 100.0);
                let cpu_seconds = entries
                    .iter()
                    .filter_map(|entry| Some(entry.run.as_ref()?.cpu_seconds));
                table.rows.push(vec![
                    row.label.clone(),
                    format!("{} ({})", kind.label(), entries.len()),
                    cell(measure(|m| m.depth_error), 4),
                    cell(measure(|m| m.depth_error_at_best_scale), 4),
                    cell(measure(|m| m.density), 4),
                    cell(share(measure(|m| m.location_error_percent)), 4),
                    cell(measure(|m| m.orientation_error_deg), 3),
                    cell(share(measure(|m| m.aligned_location_error_percent)), 4),
                    cell(measure(|m| m.aligned_orientation_error_deg), 3),
                    cell(measure(|m| m.turn_error_deg), 3),
                    cell(measure(|m| m.silhouette_iou), 3),
                    cell(measure(|m| m.chamfer_percent), 2),
                    cell(mean(cpu_seconds), 0),
                ]);
            }
        }
        table
    }

    /// One line per method and sequence.
    pub fn details(&self) -> Table {
        let mut table = Table::new(&[
            "method",
            "sequence",
            "orientation_error_deg",
            "location_error_percent",
            "aligned_orientation_error_deg",
            "aligned_location_error_percent",
            "depth_error",
            "depth_error_at_best_scale",
            "density",
            "silhouette_iou",
            "chamfer_percent",
            "turn_error_deg",
            "objective_start",
            "objective_end",
            "residual_evaluations",
            "jacobian_evaluations",
            "cpu_seconds",
        ]);
        for row in &self.rows {
            for Entry {
                sequence,
                measures: m,
                run,
                ..
            } in &row.entries
            {
                let run = |value: fn(&Run) -> f64| run.as_ref().map(value);
                table.rows.push(vec![
                    row.label.clone(),
                    sequence.clone(),
                    cell(m.orientation_error_deg, 4),
                    cell(m.location_error_percent, 4),
                    cell(m.aligned_orientation_error_deg, 4),
                    cell(m.aligned_location_error_percent, 4),
                    cell(m.depth_error, 5),
                    cell(m.depth_error_at_best_scale, 5),
                    cell(m.density, 4),
                    cell(m.silhouette_iou, 4),
                    cell(m.chamfer_percent, 4),
                    cell(m.turn_error_deg, 4),
                    cell(run(|run| run.objective_start.total), 2),
                    cell(run(|run| run.objective_end.total), 2),
                    cell(run(|run| run.evaluations.residual as f64), 0),
                    cell(run(|run| run.evaluations.jacobian as f64), 0),
                    cell(run(|run| run.cpu_seconds), 1),
                ]);
            }
        }
        table
    }
}
