//! `spba-ceres inspect`.

use super::input::InputArgs;
use spba_ceres::sequence::{self, Examination, FrameExamination};
use std::fmt::Write;

/// Say what a sequence holds and what is wrong with it, without solving.
///
/// Exit status 0 if `solve` could use the input, 1 if not.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    input: InputArgs,
}

pub fn run(args: &Args) -> anyhow::Result<()> {
    let examination = sequence::examine(&args.input.input, &args.input.options()?)?;
    print!("{}", report(&examination));
    let input = args.input.input.display();
    match examination.problems.len() {
        0 => Ok(()),
        1 => anyhow::bail!("{input}: not usable; mend the problem above"),
        count => anyhow::bail!("{input}: not usable; mend the {count} problems above"),
    }
}

const HEADINGS: [&str; 10] = [
    "frame", "size", "fx fy", "cx cy", "mask", "border", "parts", "depth", "pose", "time",
];

fn report(examination: &Examination) -> String {
    let mut text = format!(
        "{}: {}, {} frames\n\n",
        examination.name,
        examination.kind,
        examination.frames.len()
    );
    text += &table(&examination.frames);
    text += "\nmask: share of the image; border: object pixels in its outermost rows and columns; parts: connected parts;\n\
             depth: share of the mask's pixels with off-the-shelf depth; pose: off-the-shelf; time: seconds\n";
    // Writing to a string cannot fail.
    for note in &examination.notes {
        let _ = writeln!(text, "note: {note}");
    }
    for problem in &examination.problems {
        let _ = writeln!(text, "problem: {problem}");
    }
    if examination.problems.is_empty() {
        text += "usable\n";
    }
    text
}

fn table(frames: &[FrameExamination]) -> String {
    let mut rows = vec![HEADINGS.map(str::to_owned)];
    rows.extend(frames.iter().map(row));
    let widths: [usize; HEADINGS.len()] = std::array::from_fn(|column| {
        rows.iter()
            .map(|row| row[column].chars().count())
            .max()
            .unwrap_or(0)
    });
    let line = |row: &[String; HEADINGS.len()]| {
        let cells: Vec<_> = row
            .iter()
            .zip(widths)
            .map(|(cell, width)| format!("{cell:<width$}"))
            .collect();
        cells.join("  ").trim_end().to_owned() + "\n"
    };
    rows.iter().map(line).collect()
}

fn row(frame: &FrameExamination) -> [String; HEADINGS.len()] {
    const NONE: &str = "-";
    let or_none = |cell: Option<String>| cell.unwrap_or_else(|| NONE.to_owned());
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let camera = frame.camera;
    let pose = if frame.has_pose { "yes" } else { "no" };
    [
        frame.name.clone(),
        or_none(frame.size.map(|(width, height)| format!("{width} × {height}"))),
        format!("{:.1} {:.1}", camera.fx, camera.fy),
        format!("{:.1} {:.1}", camera.cx, camera.cy),
        or_none(frame.mask.map(|mask| percent(mask.share))),
        or_none(frame.mask.map(|mask| mask.border_px.to_string())),
        or_none(frame.mask.map(|mask| mask.parts.to_string())),
        or_none(frame.depth_share.map(percent)),
        pose.to_owned(),
        or_none(frame.timestamp_s.map(|time| time.to_string())),
    ]
}
