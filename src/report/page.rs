//! `report.html`: the result folder as one page that opens anywhere, with nothing fetched when it is looked at.
//!
//! The page is made of the folder's files and the sequence alone, so that it can be made anew at any time, to the same bytes.

mod advice;
mod encode;
mod facts;
mod input_points;
mod shape;
#[cfg(test)]
mod tests;

use super::{Doubts, ReportError, RunResult, doubts, file_stems, trace};
use crate::files::write_whole;
use crate::image::read_mask;
use crate::sequence::Sequence;
use advice::{Advice, Step, Verdict};
use facts::{File, Frame, Hypothesis, Objective, Seconds, Style, Tile};
use minijinja::value::Serde;
use minijinja::{Environment, Value};
use serde::Serialize;
use shape::{InputPoints, Shape};
use std::path::Path;

/// The page's name in the result folder.
pub(super) const PAGE: &str = "report.html";

const TEMPLATE: &str = include_str!("page/page.html");
const STYLE_SHEET: &str = include_str!("page/page.css");
const SCRIPTS: [&str; 5] = [
    include_str!("page/frames.js"),
    include_str!("page/shapes.js"),
    include_str!("page/scene.js"),
    include_str!("page/charts.js"),
    include_str!("page/main.js"),
];
/// three.js and Observable Plot, as `scripts/fetch_viewer` bundles them.
const LIBRARIES: &str = include_str!("../../data/viewer/viewer.min.js");
const LICENCES: &str = include_str!("../../data/viewer/LICENCES.txt");

/// What the page's scripts read, as JSON.
#[derive(Serialize)]
struct Data {
    frames: Vec<Frame>,
    shape: Shape,
    /// `None` where the sequence has no depth.
    input_points: Option<InputPoints>,
    objective: Objective,
    style: Style,
    /// The colour scale of inverse depth, dark to bright.
    colour_scale: Vec<[u8; 3]>,
}

/// What the template reads.
#[derive(Serialize)]
struct Words<'a> {
    style_sheet: &'static str,
    scripts: [&'static str; 5],
    libraries: &'static str,
    licences: &'static str,
    /// [`Data`] as JSON.
    data: String,
    name: &'a str,
    result: &'a RunResult,
    tiles: Vec<Tile>,
    verdict: Verdict,
    doubts: &'a [String],
    advice: Vec<Step>,
    seconds: Vec<Seconds>,
    hypotheses: Vec<Hypothesis>,
    files: Vec<&'static File>,
    config: String,
}

/// Writes `report.html` into the result folder `folder`, in place of one that is there.
///
/// `sequence` is what the result was solved from, with the cameras and masks that were found ([`as_solved`]).
/// `focal_deviation` is the standard deviation of the focal lengths' logarithm that the solve was given, 0 where they were held.
/// What speaks against the result is returned, as the page says it.
///
/// # Errors
/// A file of the folder that is missing or cannot be read, frames that `sequence` does not have, a page that cannot be written.
pub fn write_page(folder: &Path, sequence: &Sequence, focal_deviation: f64) -> Result<Doubts, ReportError> {
    let result = RunResult::load(folder)?;
    check_frames(folder, sequence, &result)?;
    let doubts = doubts(
        &result.frames,
        (&result.style, &result.free_form),
        result.focal_factor,
        focal_deviation,
    );
    let page = page(folder, sequence, &result, &doubts)?;
    let path = folder.join(PAGE);
    write_whole(&path, page.as_bytes()).map_err(ReportError::io(&path))?;
    Ok(doubts)
}

/// The frames of `sequence` that the result in `folder` is of, with the focal lengths that were found and the masks that were decided anew.
///
/// # Errors
/// A frame or mask that is missing.
pub fn as_solved(sequence: Sequence, folder: &Path, result: &RunResult) -> Result<Sequence, ReportError> {
    let stems = file_stems(result.frames.iter().map(|frame| frame.name.as_str()));
    let mut masks = Vec::new();
    for (frame, stem) in result.frames.iter().zip(&stems) {
        if result.masks_anew.contains(&frame.name) {
            let path = folder.join("masks").join(format!("{stem}.png"));
            masks.push((frame.name.clone(), read_mask(&path)?));
        }
    }
    let edited = sequence.edited(|content| {
        content
            .frames
            .retain(|frame| result.frames.iter().any(|found| found.name == frame.name));
        content.truth = None;
        for frame in &mut content.frames {
            frame.camera.fx *= result.focal_factor;
            frame.camera.fy *= result.focal_factor;
            if let Some((_, mask)) = masks.iter().find(|(name, _)| *name == frame.name) {
                frame.mask = mask.clone();
            }
        }
    });
    edited.map_err(|error| ReportError::format(&folder.join("result.json"), error))
}

fn check_frames(folder: &Path, sequence: &Sequence, result: &RunResult) -> Result<(), ReportError> {
    let names = sequence.frames.iter().map(|frame| &frame.name);
    if names.eq(result.frames.iter().map(|frame| &frame.name)) {
        return Ok(());
    }
    let message = "its frames are not those of the sequence; give the sequence that it was solved from";
    Err(ReportError::format(&folder.join("result.json"), message))
}

fn page(
    folder: &Path,
    sequence: &Sequence,
    result: &RunResult,
    doubts: &Doubts,
) -> Result<String, ReportError> {
    let trace = trace::read(&folder.join("trace.csv"))?;
    let frames = facts::frames(folder, sequence, result)?;
    let advice = Advice::of(result, &trace, &frames, doubts);
    let data = Data {
        shape: Shape::read(folder)?,
        input_points: input_points::of(sequence, result).map(InputPoints::from),
        objective: Objective::of(&trace),
        style: Style::of(result),
        colour_scale: encode::colour_scale(),
        frames,
    };
    let config = folder.join("config.toml");
    let config = crate::files::read_text(&config).map_err(ReportError::io(&config))?;
    let words = Words {
        style_sheet: STYLE_SHEET,
        scripts: SCRIPTS,
        libraries: LIBRARIES,
        licences: LICENCES,
        data: script_safe(&data),
        name: &sequence.name,
        result,
        tiles: facts::tiles(result),
        verdict: Verdict::of(result, doubts),
        doubts: &doubts.words,
        advice: advice.steps,
        seconds: facts::seconds(result),
        hypotheses: facts::hypotheses(result),
        files: facts::files(folder),
        config,
    };
    Environment::new()
        .render_named_str(PAGE, TEMPLATE, Value::from(Serde(words)))
        .map_err(|error| ReportError::format(&folder.join(PAGE), error))
}

/// JSON in which no `</script>` or `<!--` ends or changes the element around it.
fn script_safe(data: &Data) -> String {
    // What cannot be JSON is caught by `RunResult::load` and the readers; strings and finite numbers are left.
    serde_json::to_string(data)
        .unwrap_or_default()
        .replace('<', "\\u003c")
}
