//! The same scene drawn by Blender (Cycles): pictures, masks and depth that our rasteriser has no say in.
//!
//! A temporary folder holds `scene.json` and the textures for Blender, and then the EXR files that it makes;
//! `render.py` says which.

mod description;

use super::render::{Light, Rendering, Viewpoint};
use super::{CadError, Mesh};
use crate::image::{DepthMap, Grid, one_line};
use exr::prelude::{AnyChannels, FlatSamples, Image, Layer, read_first_flat_layer_from_file};
use std::io::ErrorKind;
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;

const SCRIPT: &str = include_str!("render.py");
const PROGRAM: &str = "blender";

/// What Blender made of some views, on disk: many of them are too large to hold at once.
pub(super) struct Pictures {
    folder: TempDir,
    width: usize,
    height: usize,
}

impl Pictures {
    /// Draws every view, all of one size, under its light with `samples_per_axis`² rays a pixel.
    pub(super) fn of(
        mesh: &Mesh,
        shots: &[(Viewpoint, Light)],
        samples_per_axis: usize,
    ) -> Result<Self, CadError> {
        let folder = tempfile::Builder::new()
            .prefix("spba-blender-")
            .tempdir()
            .map_err(|error| failed(format!("no temporary folder ({error}); check the free space")))?;
        description::write(mesh, shots, samples_per_axis, folder.path())?;
        run(PROGRAM, folder.path())?;
        let (width, height) = shots
            .first()
            .map_or((0, 0), |(view, _)| (view.width, view.height));
        Ok(Self {
            folder,
            width,
            height,
        })
    }

    /// The picture of view `index`.
    pub(super) fn rendering(&self, index: usize) -> Result<Rendering, CadError> {
        let colour = Passes::read(&self.folder.path().join(format!("colour-{index}.exr")))?;
        let [red, green, blue] = [
            colour.grid("Combined.R", self)?,
            colour.grid("Combined.G", self)?,
            colour.grid("Combined.B", self)?,
        ];
        let centre = Passes::read(&self.folder.path().join(format!("centre-{index}.exr")))?;
        let (hit, z) = (centre.grid("Combined.A", self)?, centre.grid("Depth.Z", self)?);
        let (width, height) = (self.width, self.height);
        Ok(Rendering {
            // EXR is premultiplied, as ours are.
            image: Grid::from_fn(width, height, |column, row| {
                [&red, &green, &blue].map(|channel| 255.0 * channel[(column, row)])
            }),
            coverage: colour.grid("Combined.A", self)?,
            mask: Grid::from_fn(width, height, |column, row| hit[(column, row)] > 0.5),
            depth: Grid::from_fn(width, height, |column, row| {
                if hit[(column, row)] > 0.5 {
                    z[(column, row)]
                } else {
                    0.0
                }
            }),
        })
    }
}

/// The layers of one EXR file of Blender's.
struct Passes {
    file: String,
    image: Image<Layer<AnyChannels<FlatSamples>>>,
}

impl Passes {
    fn read(path: &Path) -> Result<Self, CadError> {
        let file = path
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        let image = read_first_flat_layer_from_file(path)
            .map_err(|error| failed(format!("{file} cannot be read ({error}); check the free space")))?;
        Ok(Self { file, image })
    }

    /// The channel `<view layer>.<name>`.
    fn grid(&self, name: &str, pictures: &Pictures) -> Result<DepthMap, CadError> {
        let channels = &self.image.layer_data.channel_data.list;
        channels
            .iter()
            .find(|channel| channel.name.to_string().ends_with(&format!(".{name}")))
            .and_then(|channel| match &channel.sample_data {
                FlatSamples::F32(values) => Some(values.clone()),
                _ => None,
            })
            .and_then(|values| Grid::from_vec(pictures.width, pictures.height, values))
            .ok_or_else(|| {
                failed(format!(
                    "{} has no f32 channel {name} of the picture's size; use Blender 3.4",
                    self.file
                ))
            })
    }
}

fn run(program: &str, folder: &Path) -> Result<(), CadError> {
    let script = folder.join("render.py");
    std::fs::write(&script, SCRIPT).map_err(|error| failed(format!("{}: {error}", script.display())))?;
    // The exit code must come before the script, or it does not hold for it.
    let output = Command::new(program)
        .args([
            "--background",
            "--factory-startup",
            "-noaudio",
            "--python-exit-code",
            "1",
            "--python",
        ])
        .arg(&script)
        .arg("--")
        .arg(folder)
        .output()
        .map_err(|error| match error.kind() {
            ErrorKind::NotFound => failed("not installed; apt-get install blender".to_owned()),
            _ => failed(format!("cannot be run ({error})")),
        })?;
    if output.status.success() {
        return Ok(());
    }
    // It tells of its script's faults on standard output, at the end but for one line.
    let told = [output.stdout, output.stderr].concat();
    let told = String::from_utf8_lossy(&told);
    let mut reasons = told
        .lines()
        .filter(|line| line.contains("Error") && !line.contains("script failed"));
    let reason = reasons.next_back().unwrap_or("without a reason");
    Err(failed(format!("{}: {}", output.status, one_line(reason))))
}

fn failed(problem: String) -> CadError {
    CadError::Blender(problem)
}

#[cfg(test)]
mod tests;
