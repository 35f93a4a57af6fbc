//! Tables as text, CSV and Markdown.

/// Rows of cells under headings; the first column is text, the others numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// The columns' headings.
    pub headings: Vec<String>,
    /// The cells, row by row, each row as long as `headings`.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// A table of these columns without rows.
    pub fn new(headings: &[&str]) -> Self {
        Self {
            headings: headings.iter().map(|&heading| heading.to_owned()).collect(),
            rows: Vec::new(),
        }
    }

    /// Aligned, for a terminal.
    pub fn text(&self) -> String {
        let width = |column: usize| {
            let cells = std::iter::once(&self.headings).chain(&self.rows);
            cells
                .filter_map(|row| row.get(column))
                .map(|cell| cell.chars().count())
                .max()
                .unwrap_or(0)
        };
        let widths: Vec<usize> = (0..self.headings.len()).map(width).collect();
        std::iter::once(&self.headings)
            .chain(&self.rows)
            .map(|row| {
                let cells = row.iter().zip(&widths).enumerate();
                let cells = cells.map(|(column, (cell, &width))| match column {
                    0 => format!("{cell:<width$}"),
                    _ => format!("{cell:>width$}"),
                });
                cells.collect::<Vec<_>>().join("  ").trim_end().to_owned() + "\n"
            })
            .collect()
    }

    /// Cells with commas or quotes are quoted.
    pub fn csv(&self) -> String {
        let quoted = |cell: &String| match cell.contains([',', '"']) {
            true => format!("\"{}\"", cell.replace('"', "\"\"")),
            false => cell.clone(),
        };
        std::iter::once(&self.headings)
            .chain(&self.rows)
            .map(|row| row.iter().map(quoted).collect::<Vec<_>>().join(",") + "\n")
            .collect()
    }

    /// The table in GitHub's Markdown.
    pub fn markdown(&self) -> String {
        let line = |row: &[String]| format!("| {} |\n", row.join(" | "));
        let rule = format!("|{}\n", "---|".repeat(self.headings.len()));
        let rows = self.rows.iter().map(|row| line(row));
        std::iter::once(line(&self.headings))
            .chain(std::iter::once(rule))
            .chain(rows)
            .collect()
    }
}

/// A number with `digits` decimals; `-` for none.
pub(super) fn cell(value: Option<f64>, digits: usize) -> String {
    value
        .filter(|value| value.is_finite())
        .map_or("-".to_owned(), |value| format!("{value:.digits$}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_ways_to_write_a_table() {
        let mut table = Table::new(&["row", "x"]);
        table.rows.push(vec!["a, b".into(), cell(Some(1.25), 1)]);
        table.rows.push(vec!["c".into(), cell(Some(f64::NAN), 1)]);
        assert_eq!(table.text(), "row     x\na, b  1.2\nc       -\n");
        assert_eq!(table.csv(), "row,x\n\"a, b\",1.2\nc,-\n");
        assert_eq!(
            table.markdown(),
            "| row | x |\n|---|---|\n| a, b | 1.2 |\n| c | - |\n"
        );
    }
}
