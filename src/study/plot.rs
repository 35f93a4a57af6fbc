//! Charts as SVG.

use super::{StudyError, write_text};
use plotters::prelude::*;
use std::path::Path;

const SIZE_PX: (u32, u32) = (620, 440);
/// Of the legend beside it: for the sample and the margins, and per letter.
const LEGEND_PX: [usize; 2] = [48, 7];
const LEGEND_LINE_PX: i32 = 19;
const FONT: &str = "sans-serif";

/// Lines over common axes.
pub(super) struct Chart<'a> {
    pub title: &'a str,
    pub x: Axis<'a>,
    pub y: Axis<'a>,
    pub lines: Vec<Line>,
}

pub(super) struct Axis<'a> {
    pub label: &'a str,
    /// Positive values on a scale of powers of ten; others are left out.
    pub logarithmic: bool,
}

pub(super) struct Line {
    pub label: String,
    pub points: Vec<(f64, f64)>,
    /// Points joined by a line; otherwise dots.
    pub joined: bool,
}

impl<'a> Axis<'a> {
    pub fn linear(label: &'a str) -> Self {
        Self {
            label,
            logarithmic: false,
        }
    }

    pub fn logarithmic(label: &'a str) -> Self {
        Self {
            label,
            logarithmic: true,
        }
    }

    /// Where a value lies along the axis.
    fn place(&self, value: f64) -> Option<f64> {
        match self.logarithmic {
            true => (value > 0.0).then(|| value.log10()),
            false => Some(value),
        }
        .filter(|value| value.is_finite())
    }

    fn name(&self, place: &f64) -> String {
        let value = if self.logarithmic {
            10f64.powf(*place)
        } else {
            *place
        };
        match value.abs() {
            0.0 => "0".to_owned(),
            size if !(1e-3..1e5).contains(&size) => format!("{value:.1e}"),
            _ => {
                // Three digits that count.
                let place = 10f64.powi(value.abs().log10().floor() as i32 - 2);
                let digits = format!("{:.5}", (value / place).round() * place);
                digits.trim_end_matches('0').trim_end_matches('.').to_owned()
            }
        }
    }
}

impl Chart<'_> {
    /// Writes the chart; axes span what there is.
    pub fn write(&self, path: &Path) -> Result<(), StudyError> {
        let lines: Vec<Vec<(f64, f64)>> = self
            .lines
            .iter()
            .map(|line| {
                let placed = |&(x, y): &(f64, f64)| Some((self.x.place(x)?, self.y.place(y)?));
                line.points.iter().filter_map(placed).collect()
            })
            .collect();
        let span = |value: fn(&(f64, f64)) -> f64| {
            let (low, high) = lines
                .iter()
                .flatten()
                .map(value)
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
                    (low.min(v), high.max(v))
                });
            let (low, high) = if low <= high { (low, high) } else { (0.0, 1.0) };
            let margin = 0.04 * (high - low).max(1e-9 * (1.0 + high.abs()));
            low - margin..high + margin
        };
        let mut svg = String::new();
        {
            let longest = self.lines.iter().map(|line| line.label.chars().count()).max();
            let legend = LEGEND_PX[0] + LEGEND_PX[1] * longest.unwrap_or(0);
            let size = (SIZE_PX.0 + legend as u32, SIZE_PX.1);
            let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
            self.draw(&area, &lines, span(|p| p.0), span(|p| p.1))
                .map_err(|reason| StudyError::Plot {
                    path: path.to_owned(),
                    reason,
                })?;
        }
        write_text(path, &svg)
    }

    fn draw(
        &self,
        area: &DrawingArea<SVGBackend, plotters::coord::Shift>,
        lines: &[Vec<(f64, f64)>],
        x: std::ops::Range<f64>,
        y: std::ops::Range<f64>,
    ) -> Result<(), String> {
        let failed = |error: DrawingAreaErrorKind<_>| error.to_string();
        area.fill(&WHITE).map_err(failed)?;
        // Beside the chart, where it hides no line.
        let (plot, legend) = area.split_horizontally(SIZE_PX.0);
        let mut chart = ChartBuilder::on(&plot)
            .caption(self.title, (FONT, 17))
            .margin(12)
            .x_label_area_size(42)
            .y_label_area_size(64)
            .build_cartesian_2d(x, y)
            .map_err(failed)?;
        chart
            .configure_mesh()
            .x_desc(self.x.label)
            .y_desc(self.y.label)
            .x_label_formatter(&|place| self.x.name(place))
            .y_label_formatter(&|place| self.y.name(place))
            .light_line_style(TRANSPARENT)
            .label_style((FONT, 13))
            .draw()
            .map_err(failed)?;
        for (index, (line, points)) in self.lines.iter().zip(lines).enumerate() {
            let colour = Palette99::pick(index).to_rgba();
            match line.joined {
                true => chart
                    .draw_series(LineSeries::new(points.iter().copied(), colour.stroke_width(2)))
                    .map_err(failed)?,
                false => chart
                    .draw_series(points.iter().map(|&at| Circle::new(at, 3, colour.filled())))
                    .map_err(failed)?,
            };
            let top = 44 + LEGEND_LINE_PX * index as i32;
            let sample = Rectangle::new([(8, top + 4), (24, top + 8)], colour.filled());
            legend.draw(&sample).map_err(failed)?;
            let label = Text::new(line.label.clone(), (32, top), (FONT, 13));
            legend.draw(&label).map_err(failed)?;
        }
        area.present().map_err(failed)
    }
}

/// Values over a square grid, dark where they are low.
pub(super) struct Heat<'a> {
    pub title: &'a str,
    pub x: Axis<'a>,
    pub y: Axis<'a>,
    /// Both axes' positions, ascending and evenly spaced.
    pub at: &'a [f64],
    /// `values[i][j]` at x = `at[i]`, y = `at[j]`.
    pub values: &'a [Vec<f64>],
}

impl Heat<'_> {
    /// Writes the map, with a line along y = 0 and a mark at the least value.
    pub fn write(&self, path: &Path) -> Result<(), StudyError> {
        let mut svg = String::new();
        {
            let area = SVGBackend::with_string(&mut svg, (620, 560)).into_drawing_area();
            self.draw(&area).map_err(|reason| StudyError::Plot {
                path: path.to_owned(),
                reason,
            })?;
        }
        write_text(path, &svg)
    }

    fn draw(&self, area: &DrawingArea<SVGBackend, plotters::coord::Shift>) -> Result<(), String> {
        let failed = |error: DrawingAreaErrorKind<_>| error.to_string();
        let (Some(first), Some(last)) = (self.at.first(), self.at.last()) else {
            return Err("no values".to_owned());
        };
        let half = 0.5 * (last - first) / (self.at.len().max(2) - 1) as f64;
        let cells = || {
            let rows = self.at.iter().zip(self.values);
            rows.flat_map(|(&x, row)| self.at.iter().zip(row).map(move |(&y, &value)| (x, y, value)))
        };
        let low = cells().map(|cell| cell.2).fold(f64::INFINITY, f64::min);
        let high = cells().map(|cell| cell.2).fold(f64::NEG_INFINITY, f64::max);
        area.fill(&WHITE).map_err(failed)?;
        let mut chart = ChartBuilder::on(area)
            .caption(self.title, (FONT, 15))
            .margin(12)
            .x_label_area_size(42)
            .y_label_area_size(56)
            .build_cartesian_2d(first - half..last + half, first - half..last + half)
            .map_err(failed)?;
        chart
            .configure_mesh()
            .disable_mesh()
            .x_desc(self.x.label)
            .y_desc(self.y.label)
            .label_style((FONT, 13))
            .draw()
            .map_err(failed)?;
        chart
            .draw_series(cells().map(|(x, y, value)| {
                let share = (value - low) / (high - low).max(f64::MIN_POSITIVE);
                let colour = ViridisRGB.get_color(share.clamp(0.0, 1.0));
                Rectangle::new([(x - half, y - half), (x + half, y + half)], colour.filled())
            }))
            .map_err(failed)?;
        chart
            .draw_series(LineSeries::new(
                [(*first, 0.0), (*last, 0.0)],
                YELLOW.stroke_width(2),
            ))
            .map_err(failed)?;
        let least = cells().min_by(|a, b| a.2.total_cmp(&b.2)).map(|(x, y, _)| (x, y));
        chart
            .draw_series(least.map(|at| Circle::new(at, 5, RED.filled())))
            .map_err(failed)?;
        area.present().map_err(failed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_have_three_digits_that_count() {
        let name = |value: f64| Axis::linear("x").name(&value);
        let names = [15848.932, 0.25, -3.0, 0.0, 1e-5].map(name);
        assert_eq!(names, ["15800", "0.25", "-3", "0", "1.0e-5"]);
        assert_eq!(Axis::logarithmic("x").name(&2.0), "100");
    }

    #[test]
    fn a_chart_names_its_axes_and_lines_and_leaves_out_what_has_no_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.svg");
        let chart = Chart {
            title: "Title",
            x: Axis::linear("frames"),
            y: Axis::logarithmic("error"),
            lines: vec![Line {
                label: "ours".into(),
                points: vec![(1.0, 0.0), (2.0, 0.1), (3.0, 10.0), (4.0, f64::NAN)],
                joined: false,
            }],
        };
        chart.write(&path).unwrap();
        let svg = std::fs::read_to_string(&path).unwrap();
        for text in ["Title", "frames", "error", "ours"] {
            assert!(svg.contains(text), "{text}");
        }
        assert_eq!(svg.matches("<circle").count(), 2);
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }
}
