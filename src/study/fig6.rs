//! Fig. 6: how the depth error is distributed over the pixels of the rendered sequences.

use super::plot::{Axis, Chart, Line};
use super::table::cell;
use super::{DepthHistogram, StudyError, Table, Table1};
use std::path::Path;

/// Per row of Table 1 that has depth against truth: its label and the pooled histogram.
pub struct Fig6 {
    /// Per method, its label and the depth errors of all sequences in one histogram.
    pub rows: Vec<(String, DepthHistogram)>,
}

/// The figure's histograms, from the records of Table 1.
pub fn fig6(table: &Table1) -> Fig6 {
    let rows = table.rows.iter().filter_map(|row| {
        let mut pooled: Option<DepthHistogram> = None;
        for entry in &row.entries {
            if let Some(histogram) = &entry.measures.depth_errors {
                pooled.get_or_insert_default().merge(histogram);
            }
        }
        Some((row.label.clone(), pooled?))
    });
    Fig6 { rows: rows.collect() }
}

impl Fig6 {
    /// The share of pixels below each error.
    pub fn table(&self) -> Table {
        let mut table = Table::new(&["depth error below"]);
        table
            .headings
            .extend(self.rows.iter().map(|(label, _)| label.clone()));
        let cumulative: Vec<_> = self
            .rows
            .iter()
            .map(|(_, histogram)| histogram.cumulative())
            .collect();
        for bin in 0..cumulative.first().map_or(0, Vec::len) {
            let mut row = vec![format!("{:.3}", bin as f64 * DepthHistogram::BIN)];
            row.extend(cumulative.iter().map(|shares| cell(shares.get(bin).copied(), 4)));
            table.rows.push(row);
        }
        table
    }

    /// `fig6-histogram.svg` and `fig6-cumulative.svg`.
    pub fn draw(&self, folder: &Path) -> Result<(), StudyError> {
        let at = |bin: usize| bin as f64 * DepthHistogram::BIN;
        let lines = |points: &dyn Fn(&DepthHistogram) -> Vec<(f64, f64)>| -> Vec<Line> {
            self.rows
                .iter()
                .map(|(label, histogram)| Line {
                    label: label.clone(),
                    points: points(histogram),
                    joined: true,
                })
                .collect()
        };
        let shares = |histogram: &DepthHistogram| {
            let cumulative = histogram.cumulative();
            let steps = cumulative.windows(2).enumerate();
            steps
                .map(|(bin, pair)| (at(bin) + 0.5 * DepthHistogram::BIN, 100.0 * (pair[1] - pair[0])))
                .collect()
        };
        Chart {
            title: "Depth error on the rendered sequences",
            x: Axis::linear("depth error, diagonals"),
            y: Axis::linear("% of pixels per 0.002"),
            lines: lines(&shares),
        }
        .write(&folder.join("fig6-histogram.svg"))?;
        let below = |histogram: &DepthHistogram| {
            let cumulative = histogram.cumulative().into_iter().enumerate();
            cumulative.map(|(bin, share)| (at(bin), 100.0 * share)).collect()
        };
        Chart {
            title: "Depth error on the rendered sequences",
            x: Axis::linear("threshold, diagonals"),
            y: Axis::linear("% of pixels below"),
            lines: lines(&below),
        }
        .write(&folder.join("fig6-cumulative.svg"))
    }
}
