//! `spba-ceres eval`: a result, or an input's own poses, against truth or against a turning platform.

use super::input::{holds_frames, solved_from};
use anyhow::{Context, bail, ensure};
use serde::Serialize;
use spba_ceres::eval::{Estimated, MeanMax, Platform, TruthErrors, TurnErrors, TurnTable, against_truth};
use spba_ceres::geometry::Rotation3;
use spba_ceres::image::{mask_of, read_depth, read_mask};
use spba_ceres::report::{
    RunResult, density, file_stems, hole_share, outside_share, read_shape, silhouette_iou,
};
use spba_ceres::sequence::{LoadOptions, Sequence, load};
use std::path::{Path, PathBuf};

/// Measure a result against truth or a turning platform, side by side with the input's own poses.
///
/// PATH is a result folder, or a sequence or COLMAP workspace whose own poses and depth are to be measured.
#[derive(clap::Args)]
#[command(group(clap::ArgGroup::new("against").required(true).args(["truth", "turn", "masks"])))]
pub struct Args {
    /// Result folder of `solve`, a sequence, or a COLMAP workspace
    path: PathBuf,
    /// A sequence of ours with [truth]: errors of orientation, location, depth and shape, density and IoU. The poses and
    /// depth of a result's own input, aligned by frame 0 and scale, stand beside the result's
    #[arg(long, value_name = "SEQUENCE")]
    truth: Option<PathBuf>,
    /// openMVS folder (scene.mvs, depth*.dmap) that goes with PATH, or with --input, a COLMAP workspace
    #[arg(long, value_name = "FOLDER", requires = "truth")]
    depth: Option<PathBuf>,
    /// What is known of a turning platform (turn.txt): every frame's rotation error
    #[arg(long, value_name = "FILE", requires = "times")]
    turn: Option<PathBuf>,
    /// When each image was taken (times.txt: image, seconds)
    #[arg(long, value_name = "FILE", requires = "turn")]
    times: Option<PathBuf>,
    /// Folder of masks named like PATH's frames: how well the masks of PATH, a sequence, or the shape of PATH, a result, agree with
    /// them
    #[arg(long, value_name = "FOLDER")]
    masks: Option<PathBuf>,
    /// What PATH, a result, was solved from, to measure it beside the result [default: with --truth, the input that the
    /// result names; with --turn, none]
    #[arg(long, value_name = "SEQUENCE", conflicts_with = "masks")]
    input: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args) -> anyhow::Result<()> {
    let result = match args.path.join("result.json").exists() {
        true => Some(RunResult::load(&args.path)?),
        false => None,
    };
    match (&args.masks, &result) {
        (Some(folder), Some(result)) => return shape_columns(args, result, folder),
        (Some(folder), None) => return mask_columns(args, folder),
        (None, _) => {}
    }
    ensure!(
        result.is_some() || args.input.is_none(),
        "--input: {} is no result, so that it is measured itself; leave --input out",
        args.path.display()
    );
    match (&args.truth, &args.turn, &args.times) {
        (Some(truth), _, _) => truth_columns(args, result.as_ref(), truth),
        (None, Some(turn), Some(times)) => turn_columns(args, result.as_ref(), &Platform::load(turn, times)?),
        _ => bail!("nothing to measure against; give --truth, or --turn and --times"),
    }
}

/// Intersection over union of each frame's mask, and the share of it with off-the-shelf depth.
fn mask_columns(args: &Args, folder: &Path) -> anyhow::Result<()> {
    #[derive(Serialize)]
    struct Row {
        frame: String,
        iou: f64,
        depth_share: f64,
    }
    let row = |frame: spba_ceres::sequence::Frame| -> anyhow::Result<Row> {
        let reference = read_mask(&mask_of(folder, &frame.name))?;
        anyhow::ensure!(
            reference.size() == frame.mask.size(),
            "frame {}: its mask is {:?} pixels, the one in {} {:?}; give masks of the sequence's own pictures",
            frame.name,
            frame.mask.size(),
            folder.display(),
            reference.size()
        );
        let known = frame
            .depth
            .as_ref()
            .map(|depth| density(&frame.mask, &depth.known()));
        Ok(Row {
            iou: silhouette_iou(&frame.mask, &reference),
            depth_share: known.unwrap_or(0.0),
            frame: frame.name,
        })
    };
    let rows: Vec<Row> = sequence(&args.path)?
        .into_content()
        .frames
        .into_iter()
        .map(row)
        .collect::<anyhow::Result<_>>()?;
    if args.json {
        println!("{}", serde_json::to_string_pretty(&rows)?);
        return Ok(());
    }
    println!("{:<32}{:>10}{:>16}", "frame", "mask IoU", "with depth, %");
    let line = |name: &str, iou: f64, share: f64| println!("{name:<32}{iou:>10.3}{:>16.1}", 100.0 * share);
    for row in &rows {
        line(&row.frame, row.iou, row.depth_share);
    }
    let mean = |value: &dyn Fn(&Row) -> f64| rows.iter().map(value).sum::<f64>() / rows.len() as f64;
    line("mean", mean(&|row| row.iou), mean(&|row| row.depth_share));
    let least = |value: &dyn Fn(&Row) -> f64| rows.iter().map(value).fold(f64::INFINITY, f64::min);
    line("min", least(&|row| row.iou), least(&|row| row.depth_share));
    Ok(())
}

/// Pixels by which a shape must miss a mask to be outside it.
const OUTSIDE_BEYOND_PX: u8 = 3;

/// How each frame's shape, as far as its depth goes, fits that frame's mask.
fn shape_columns(args: &Args, result: &RunResult, folder: &Path) -> anyhow::Result<()> {
    #[derive(Serialize)]
    struct Row {
        frame: String,
        iou: f64,
        outside_share: f64,
        hole_share: f64,
    }
    let stems = file_stems(result.frames.iter().map(|frame| frame.name.as_str()));
    let mut rows = Vec::new();
    for (frame, stem) in result.frames.iter().zip(&stems) {
        let mask = read_mask(&mask_of(folder, &frame.name))?;
        let shape = read_depth(&args.path.join("depth").join(format!("{stem}.exr")))?.known();
        ensure!(
            mask.size() == shape.size(),
            "frame {}: its depth is {:?} pixels, the mask in {} {:?}; give the masks of what was solved",
            frame.name,
            shape.size(),
            folder.display(),
            mask.size()
        );
        rows.push(Row {
            frame: frame.name.clone(),
            iou: silhouette_iou(&shape, &mask),
            outside_share: outside_share(&shape, &mask, OUTSIDE_BEYOND_PX),
            hole_share: hole_share(&mask, &shape),
        });
    }
    if args.json {
        println!("{}", serde_json::to_string_pretty(&rows)?);
        return Ok(());
    }
    let outside = format!("outside by > {OUTSIDE_BEYOND_PX} px, %");
    println!("{:<32}{:>10}{outside:>24}{:>12}", "frame", "IoU", "holes, %");
    let line = |name: &str, [iou, outside, holes]: [f64; 3]| {
        println!(
            "{name:<32}{iou:>10.3}{:>24.2}{:>12.2}",
            100.0 * outside,
            100.0 * holes
        );
    };
    let cells = |row: &Row| [row.iou, row.outside_share, row.hole_share];
    rows.iter().for_each(|row| line(&row.frame, cells(row)));
    let mean = [0, 1, 2].map(|k| rows.iter().map(|row| cells(row)[k]).sum::<f64>() / rows.len() as f64);
    line("mean", mean);
    Ok(())
}

fn sequence(path: &Path) -> anyhow::Result<Sequence> {
    load(path, &LoadOptions::default()).with_context(|| format!("{}", path.display()))
}

fn truth_columns(args: &Args, result: Option<&RunResult>, truth: &Path) -> anyhow::Result<()> {
    let reference = sequence(truth)?;
    let known = reference
        .truth
        .as_ref()
        .with_context(|| format!("{}: no [truth]; give a rendered sequence", truth.display()))?;
    ensure!(
        result.is_none() || args.input.is_some() || args.depth.is_none(),
        "--depth: {} is a result and names its own; leave it out, or give --input too",
        args.path.display()
    );
    let mut columns = Vec::new();
    if let Some(result) = result {
        columns.push((
            "result",
            against_truth(&of_result(&args.path, result, &reference)?, known),
        ));
    }
    if let Some(own) = own_input(args, result)? {
        let kept =
            |name: &str| result.is_none_or(|result| result.frames.iter().any(|frame| frame.name == name));
        match Estimated::of_input(&own, &reference, kept) {
            Some(input) => columns.push(("input", against_truth(&input, known))),
            None => {
                let problem = format!(
                    "{}: no off-the-shelf poses that could be aligned; frame 0 and one that moves must have one",
                    own.name
                );
                ensure!(result.is_some(), problem);
                eprintln!("note: no column `input`: {problem}");
            }
        }
    }
    if args.json {
        return print_json(&columns);
    }
    print_truth(&columns);
    Ok(())
}

/// What is measured as the input: PATH, or what the result at PATH was solved from. `None`, said on standard error, where
/// that is not to be found: nothing else may stand in for it.
fn own_input(args: &Args, result: Option<&RunResult>) -> anyhow::Result<Option<Sequence>> {
    let named = |path: &Path| {
        let options = LoadOptions {
            depth: args.depth.clone(),
            ..LoadOptions::default()
        };
        load(path, &options)
    };
    match (result, &args.input) {
        (None, _) => Ok(Some(named(&args.path)?)),
        (Some(result), Some(input)) => {
            let own = named(input)?;
            holds_frames(&own, input, result).context("--input")?;
            Ok(Some(own))
        }
        (Some(result), None) => match solved_from(&args.path, result) {
            Ok(own) => Ok(Some(own)),
            Err(error) => {
                eprintln!("note: no column `input`: {error:#}; name what was solved with --input");
                Ok(None)
            }
        },
    }
}

/// Reads what `solve` wrote for the frames that the truth knows by name.
fn of_result(folder: &Path, result: &RunResult, reference: &Sequence) -> anyhow::Result<Estimated> {
    let stems = file_stems(result.frames.iter().map(|frame| frame.name.as_str()));
    let (mut frames, mut depth) = (Vec::new(), Vec::new());
    for (frame, stem) in result.frames.iter().zip(&stems) {
        let index = index_of(reference, &frame.name)?;
        let pose = frame
            .camera_from_object()
            .with_context(|| format!("frame {}: no rotation", frame.name))?;
        let map = read_depth(&folder.join("depth").join(format!("{stem}.exr")))?;
        let size = reference.frames[index].image.size();
        if map.size() != size {
            let (width, height) = map.size();
            bail!(
                "depth/{stem}.exr is {width} × {height}, the truth {} × {}; give the truth of this input",
                size.0,
                size.1
            );
        }
        frames.push((frame.name.clone(), index, pose));
        depth.push(Some(map));
    }
    Ok(Estimated {
        frames,
        depth,
        depth_scale: 1.0,
        dense: true,
        shape: Some(read_shape(&folder.join("shape.ply"))?),
    })
}

fn index_of(reference: &Sequence, name: &str) -> anyhow::Result<usize> {
    let index = reference.frames.iter().position(|frame| frame.name == name);
    index.with_context(|| format!("frame {name} is not in the truth; give the truth of this input"))
}

fn turn_columns(args: &Args, result: Option<&RunResult>, platform: &Platform) -> anyhow::Result<()> {
    let own = match (&args.input, result) {
        (Some(input), _) => Some(sequence(input)?),
        (None, None) => Some(sequence(&args.path)?),
        (None, Some(_)) => None,
    };
    let own: Option<Vec<(String, Rotation3<f64>)>> = own.map(|sequence| {
        let posed =
            |frame: spba_ceres::sequence::Frame| Some((frame.name, frame.camera_from_input?.rotation));
        sequence
            .into_content()
            .frames
            .into_iter()
            .filter_map(posed)
            .collect()
    });
    let solved: Option<Vec<(String, Rotation3<f64>)>> = result.map(|result| {
        let posed = |frame: &spba_ceres::report::FrameResult| {
            Some((frame.name.clone(), frame.camera_from_object()?.rotation))
        };
        result.frames.iter().filter_map(posed).collect()
    });
    let own = match (own, &solved) {
        (Some(own), Some(solved)) => {
            // The same frames in both columns, or their means would not compare.
            let shared = |name: &String| solved.iter().any(|(other, _)| other == name);
            Some(own.into_iter().filter(|(name, _)| shared(name)).collect())
        }
        (own, _) => own,
    };
    let mut columns = Vec::new();
    for (title, rotations) in [("result", solved), ("input", own)] {
        if let Some(rotations) = rotations {
            columns.push((
                title,
                platform.errors(&rotations).with_context(|| title.to_owned())?,
            ));
        }
    }
    if args.json {
        return print_json(&columns);
    }
    print_turn(&columns);
    Ok(())
}

fn print_json<T: Serialize>(columns: &[(&str, T)]) -> anyhow::Result<()> {
    let mut object = serde_json::Map::new();
    for (title, column) in columns {
        object.insert((*title).to_owned(), serde_json::to_value(column)?);
    }
    println!("{}", serde_json::to_string_pretty(&object)?);
    Ok(())
}

fn print_truth(columns: &[(&str, TruthErrors)]) {
    let row = |label: &str, value: &dyn Fn(&TruthErrors) -> Option<String>| {
        let cells = columns
            .iter()
            .map(|(_, errors)| value(errors).unwrap_or_else(|| "-".to_owned()));
        println!(
            "{label:<44}{}",
            cells.map(|cell| format!("{cell:>22}")).collect::<String>()
        );
    };
    let spread = |value: Option<MeanMax>| value.map(|m| format!("{:.3} / {:.3}", m.mean, m.max));
    let number = |value: Option<f64>| value.map(|value| format!("{value:.4}"));
    let titles: String = columns.iter().map(|(title, _)| format!("{title:>22}")).collect();
    println!("{:<44}{titles}", "");
    row("frames", &|e| Some(e.frames.len().to_string()));
    row("camera orientation error, deg, mean / max", &|e| {
        spread(e.orientation_error_deg)
    });
    row("camera location error, % diagonal, mean / max", &|e| {
        spread(e.location_error_percent)
    });
    row("  orientation, first camera and scale given", &|e| {
        spread(e.aligned_orientation_error_deg)
    });
    row("  location, first camera and scale given", &|e| {
        spread(e.aligned_location_error_percent)
    });
    row("depth error, object units", &|e| number(e.depth_error));
    row("  at the best scale", &|e| number(e.depth_error_at_best_scale));
    row("  the best scale / the given one", &|e| {
        number(e.best_depth_scale)
    });
    row("density", &|e| number(e.density_mean));
    row("silhouette IoU", &|e| number(e.silhouette_iou_mean));
    row("shape, Chamfer distance, % diagonal", &|e| {
        number(e.chamfer_percent)
    });
}

fn print_turn(columns: &[(&str, TurnTable)]) {
    let Some((_, first)) = columns.first() else { return };
    let titles: String = columns.iter().map(|(title, _)| format!("{title:>10}")).collect();
    println!("rotation error against the platform, deg");
    println!("{:<32}{:>12}{titles}", "frame", "platform");
    for (name, angle) in first.frames.iter().zip(&first.platform_deg) {
        let cells = columns.iter().map(|(_, table)| {
            let index = table.frames.iter().position(|other| other == name);
            let error = index.and_then(|index| table.errors.errors_deg.get(index));
            error.map_or(format!("{:>10}", "-"), |error| format!("{error:>10.3}"))
        });
        println!("{name:<32}{angle:>12.2}{}", cells.collect::<String>());
    }
    let summary = |label: &str, value: &dyn Fn(&TurnErrors) -> f64| {
        let cells = columns
            .iter()
            .map(|(_, table)| format!("{:>10.3}", value(&table.errors)));
        println!("{label:<44}{}", cells.collect::<String>());
    };
    summary("mean", &|errors| errors.summary.mean);
    summary("max", &|errors| errors.summary.max);
    summary("offset fitted", &|errors| errors.offset_deg);
    for (title, table) in columns {
        let [x, y, z] = table.errors.axis;
        println!("axis in camera 0, {title}: ({x:.4}, {y:.4}, {z:.4})");
    }
}
