//! `trace.csv`: one line per solver iteration.

use crate::solver::TraceRow;
use std::fmt::Write;

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
    use crate::solver::ObjectiveValue;

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
        let text = csv(&[row]);
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines[1], "level-1,3,all,7,1.5,0,0,0,0,0,0,,0.25,8,9,0.5");
        assert_eq!(lines[0].split(',').count(), lines[1].split(',').count());
    }
}
