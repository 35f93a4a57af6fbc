//! `trace.csv`: one line per solver iteration.

use super::ReportError;
use crate::solver::{ObjectiveValue, TraceRow};
use std::fmt::Write;
use std::path::Path;

const HEADER: &str = "stage,step,block,iteration,total,photometric,silhouette,inverse_depth,style,motion,focal,gradient_norm,\
                      alpha,residual_evaluations,jacobian_evaluations,seconds\n";

/// The cell of a number that is not finite stays empty.
pub(super) fn csv(rows: &[TraceRow]) -> String {
    let mut text = HEADER.to_owned();
    for row in rows {
        let value = &row.objective;
        let numbers = [
            value.total,
            value.photometric,
            value.silhouette,
            value.inverse_depth,
            value.style,
            value.motion,
            value.focal,
            row.gradient_norm,
            row.alpha,
        ]
        .map(cell)
        .join(",");
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{},{},{},{},{numbers},{},{},{}",
            row.stage,
            row.step,
            row.block,
            row.iteration,
            row.residual_evaluations,
            row.jacobian_evaluations,
            cell(row.seconds),
        );
    }
    text
}

/// Reads what [`csv`] made of a trace; an empty cell is not a number.
///
/// # Errors
/// A file that cannot be read, other headings than this version's, a line of other cells.
pub(super) fn read(path: &Path) -> Result<Vec<TraceRow>, ReportError> {
    let text = crate::files::read_text(path).map_err(ReportError::io(path))?;
    let Some(lines) = text.strip_prefix(HEADER) else {
        return Err(ReportError::format(
            path,
            "its headings are not those of this version; solve again",
        ));
    };
    let rows = lines.lines().enumerate().map(|(index, line)| {
        row(line).ok_or_else(|| {
            ReportError::format(path, format!("line {} is cut or edited; solve again", index + 2))
        })
    });
    rows.collect()
}

fn row(line: &str) -> Option<TraceRow> {
    let cells: Vec<&str> = line.split(',').collect();
    let [
        stage,
        step,
        block,
        iteration,
        numbers @ ..,
        residual_evaluations,
        jacobian_evaluations,
        seconds,
    ] = &cells[..]
    else {
        return None;
    };
    let number = |cell: &&str| {
        if cell.is_empty() {
            Some(f64::NAN)
        } else {
            cell.parse::<f64>().ok()
        }
    };
    let numbers: Vec<f64> = numbers.iter().map(number).collect::<Option<_>>()?;
    let [
        total,
        photometric,
        silhouette,
        inverse_depth,
        style,
        motion,
        focal,
        gradient_norm,
        alpha,
    ] = numbers[..]
    else {
        return None;
    };
    Some(TraceRow {
        stage: (*stage).to_owned(),
        step: step.parse().ok()?,
        block: (*block).to_owned(),
        iteration: iteration.parse().ok()?,
        objective: ObjectiveValue {
            total,
            photometric,
            silhouette,
            inverse_depth,
            style,
            motion,
            focal,
        },
        gradient_norm,
        alpha,
        residual_evaluations: residual_evaluations.parse().ok()?,
        jacobian_evaluations: jacobian_evaluations.parse().ok()?,
        seconds: number(seconds)?,
    })
}

fn cell(number: f64) -> String {
    if number.is_finite() {
        number.to_string()
    } else {
        String::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_cells_as_headings_and_no_nan() {
        let row = TraceRow {
            stage: "level-1".into(),
            step: 3,
            block: "all".into(),
            iteration: 7,
            objective: ObjectiveValue {
                total: 1.5,
                ..Default::default()
            },
            gradient_norm: f64::NAN,
            alpha: 0.25,
            residual_evaluations: 8,
            jacobian_evaluations: 9,
            seconds: 0.5,
        };
        let text = csv(std::slice::from_ref(&row));
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines[1], "level-1,3,all,7,1.5,0,0,0,0,0,0,,0.25,8,9,0.5");
        assert_eq!(lines[0].split(',').count(), lines[1].split(',').count());
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trace.csv");
        std::fs::write(&path, &text).unwrap();
        let back = read(&path).unwrap();
        assert!(back[0].gradient_norm.is_nan());
        assert_eq!(
            TraceRow {
                gradient_norm: 0.0,
                ..back[0].clone()
            },
            TraceRow {
                gradient_norm: 0.0,
                ..row
            }
        );
        std::fs::write(&path, &text[..text.len() - 12]).unwrap();
        let refused = read(&path).unwrap_err().to_string();
        assert!(refused.contains("trace.csv: line 2"), "{refused}");
    }
}
