//! The prior's file, schema 1 (schema 2, of surfaces, is in `surface`): safetensors with `mean` \[N, 3\] f32, `basis` \[S + M, N, 3\] f16, `normals` \[N, 3\] f16, and
//! one metadata entry `spba_prior` holding [`PriorInfo`] as JSON. A decoder's hidden layers k = 0, 1, … are `hidden.k.weight`
//! \[outputs, inputs\] and `hidden.k.bias` \[outputs\], f32; M is the last one's outputs, 0 without. With
//! `symmetry = "mirror_x"` the tensors over points hold every other one, and point 2i + 1 is point 2i reflected in x = 0.

mod surface;
mod tensors;

use super::ShapePrior;
use super::field::FieldScale;
use super::learned::{Layer, LearnedPrior};
use super::linear::{InvalidPrior, LinearPrior};
use crate::geometry::OBJECT_FRAME;
use nalgebra::{DMatrix, DVector};
use safetensors::SafeTensors;
use safetensors::tensor::Dtype;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use tensors::{Tensor, half, numbers, serialised, single};

/// The schemas this build reads and writes: of points, and of surfaces.
const SCHEMA: u32 = 1;
const SURFACE_SCHEMA: u32 = 2;
const METADATA_KEY: &str = "spba_prior";
/// Of the mean shape's bounding box: antennas and mirrors stand out of the box whose diagonal is 1, and means of many shapes are smooth.
const DIAGONAL: std::ops::RangeInclusive<f64> = 0.9..=1.12;
/// The largest coordinate of that box's centre, diagonals.
const MAX_CENTRE_OFFSET: f64 = 0.1;
/// Of a coordinate, by one standard deviation of a style; the bundled priors' move by less than 0.1.
const MAX_DEFORMATION: f64 = 1.0;
/// Priors that ship inside the library.
#[cfg(feature = "bundled-priors")]
const BUNDLED: [(&str, &[u8]); 3] = [
    ("car", include_bytes!("../../data/priors/car.safetensors")),
    ("chair", include_bytes!("../../data/priors/chair.safetensors")),
    (
        "airplane",
        include_bytes!("../../data/priors/airplane.safetensors"),
    ),
];
#[cfg(not(feature = "bundled-priors"))]
const BUNDLED: [(&str, &[u8]); 0] = [];

/// The files of the bundled priors.
#[cfg(feature = "study")]
pub(crate) fn bundled() -> impl Iterator<Item = &'static [u8]> {
    BUNDLED.into_iter().map(|(_, bytes)| bytes)
}

/// What a prior file says of itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PriorInfo {
    /// The layout's version.
    pub schema: u32,
    /// How points depend on the style.
    pub kind: PriorKind,
    /// The category: `car`, `chair` …
    pub category: String,
    /// The object frame in words: [`OBJECT_FRAME`].
    pub frame: String,
    /// How the file's points become the prior's.
    pub symmetry: Symmetry,
    /// The number of style entries S.
    pub styles: usize,
    /// A decoder's hidden layers: how many outputs each has.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub hidden: Vec<usize>,
    /// The number of points N.
    pub points: usize,
    /// The smooth random field of a prior of surfaces.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub free_form: Option<FreeFormInfo>,
    /// The command that learned it.
    pub command: String,
    /// The seed of everything random in its making.
    pub seed: u64,
    /// Share of the training variance that the first k + 1 modes explain.
    pub explained_variance: Vec<f64>,
    /// The licences of the sources, each once.
    pub licences: Vec<String>,
    /// The models learned from.
    pub sources: Vec<PriorSource>,
}

/// One model that a prior was learned from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PriorSource {
    /// The model's name within its package.
    pub model: String,
    /// The package it comes from.
    pub package: String,
    /// The licence, as SPDX where the package gives it so, else in the package's words.
    pub licence: String,
}

/// What the free form of a prior of surfaces is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FreeFormInfo {
    /// The terms of its covariance.
    pub scales: Vec<FieldScale>,
    /// The amplitude of asymmetric modes in units of the symmetric ones'.
    pub asymmetry: f64,
}

/// What stands between the style and the output layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PriorKind {
    /// Points are linear in the style.
    Linear,
    /// A network's hidden layers stand before the linear output layer.
    Decoder,
    /// Points are linear in the style and lie on a mesh that is bent with it.
    Surface,
}

impl std::fmt::Display for PriorKind {
    fn fmt(&self, formatter: &mut std::fmt::Formatter) -> std::fmt::Result {
        formatter.write_str(match self {
            Self::Linear => "linear",
            Self::Decoder => "decoder",
            Self::Surface => "surface",
        })
    }
}

/// How the file's points become the prior's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Symmetry {
    /// The file holds all points.
    None,
    /// Point 2i + 1 is point 2i reflected in x = 0, for every style.
    MirrorX,
}

/// Why a prior file cannot be used or written; each message is one line.
#[derive(Debug, thiserror::Error)]
pub enum PriorError {
    /// The file cannot be read.
    #[error("{}: cannot read the prior: {problem}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        problem: std::io::Error,
    },
    /// The file cannot be written.
    #[error("{}: cannot write the prior: {problem}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        problem: std::io::Error,
    },
    /// No bundled prior has this name, and no file has this path.
    #[error(
        "prior `{name}` is neither bundled ({bundled}) nor a file: give one of those names or a path to a .safetensors file"
    )]
    Unknown {
        /// The name or path that was given.
        name: String,
        /// The names of the bundled priors.
        bundled: String,
    },
    /// The file is no whole safetensors file.
    #[error("{}: not a whole safetensors file ({reason}): download or learn it again", path.display())]
    NotSafetensors {
        /// The file.
        path: PathBuf,
        /// The parser's error.
        reason: String,
    },
    /// The file's metadata does not describe a prior.
    #[error("{}: not a shape prior (metadata `{METADATA_KEY}` {reason}): make one with `spba-ceres prior learn`", path.display())]
    Metadata {
        /// The file.
        path: PathBuf,
        /// What is missing or wrong.
        reason: String,
    },
    /// The file has a schema that this build does not read.
    #[error("{}: prior schema {found}, this build reads {SCHEMA} and {SURFACE_SCHEMA}: learn the prior again with this version", path.display())]
    Version {
        /// The file.
        path: PathBuf,
        /// The schema of the file.
        found: u64,
    },
    /// The file's object frame is not that of this library.
    #[error("{}: object frame `{found}`, this build's is `{OBJECT_FRAME}`: learn the prior again with this version", path.display())]
    Frame {
        /// The file.
        path: PathBuf,
        /// The frame in the file's words.
        found: String,
    },
    /// A tensor is missing, or has another type or shape.
    #[error("{}: tensor `{tensor}` {reason}: learn the prior again", path.display())]
    Tensor {
        /// The file.
        path: PathBuf,
        /// The tensor's name.
        tensor: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The file's numbers do not make a prior.
    #[error("{}: {problem}: learn the prior again", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// What is wrong with them.
        problem: InvalidPrior,
    },
    /// The mean shape is not in the unit and the frame of a prior.
    #[error("{}: the mean shape's {what} is {found:.3}, {expected} expected, as shapes are in diagonals of their box about its centre: \
             scale or move it, or learn the prior again", path.display())]
    Unit {
        /// The file.
        path: PathBuf,
        /// The measure of the mean shape that is out of range, in words.
        what: &'static str,
        /// Its value.
        found: f64,
        /// The range that it must lie in.
        expected: &'static str,
    },
    /// The prior is not mirror-symmetric although its description says so. The field is a point that is not the mirror image of its partner.
    #[error("the prior is not symmetric in x = 0 at point {0}, though its description says so")]
    NotSymmetric(usize),
}

/// A bundled prior by its name (`car`), or the file that `name_or_path` points to.
pub fn find(name_or_path: &str) -> Result<LearnedPrior, PriorError> {
    open(name_or_path).map(|(prior, _)| prior)
}

/// Reads and checks a prior file.
pub fn load(path: &Path) -> Result<LearnedPrior, PriorError> {
    open_file(path).map(|(prior, _)| prior)
}

/// Like [`find`], with what the file says of itself.
pub fn open(name_or_path: &str) -> Result<(LearnedPrior, PriorInfo), PriorError> {
    if let Some((name, bytes)) = BUNDLED.iter().find(|(name, _)| *name == name_or_path) {
        return parse(bytes, Path::new(name));
    }
    let path = Path::new(name_or_path);
    if !path.exists() && path.components().count() == 1 && path.extension().is_none() {
        let bundled = match &BUNDLED.map(|(name, _)| name)[..] {
            [] => "none in this build".to_owned(),
            names => names.join(", "),
        };
        return Err(PriorError::Unknown {
            name: name_or_path.to_owned(),
            bundled,
        });
    }
    open_file(path)
}

fn open_file(path: &Path) -> Result<(LearnedPrior, PriorInfo), PriorError> {
    let bytes = std::fs::read(path).map_err(|problem| PriorError::Read {
        path: path.to_owned(),
        problem,
    })?;
    parse(&bytes, path)
}

/// Writes `prior` beside `path`, then renames. The same prior and description give the same bytes.
pub fn save(path: &Path, prior: &LearnedPrior, info: &PriorInfo) -> Result<(), PriorError> {
    let bytes = match prior.surface() {
        Some(found) => surface::to_bytes(found, info)?,
        None => to_bytes(prior, info)?,
    };
    crate::files::write_whole(path, &bytes).map_err(|problem| PriorError::Write {
        path: path.to_owned(),
        problem,
    })
}

fn to_bytes(prior: &LearnedPrior, info: &PriorInfo) -> Result<Vec<u8>, PriorError> {
    let stride = match info.symmetry {
        Symmetry::None => 1,
        Symmetry::MirrorX => 2,
    };
    let output = prior.output();
    let (mean, basis, features) = (output.mean(), output.basis(), output.style_len());
    if info.symmetry == Symmetry::MirrorX {
        check_mirrored(mean, 1)?;
        check_mirrored(basis, features)?;
    }
    let kept: Vec<usize> = (0..mean.len())
        .filter(|row| (row / 3).is_multiple_of(stride))
        .collect();
    let count = kept.len() / 3;
    let normals = output.normals().iter().step_by(stride).flatten();
    let basis = (0..features).flat_map(|k| kept.iter().map(move |&row| basis[row * features + k]));
    let mut tensors: Vec<Tensor> = vec![
        (
            "mean".to_owned(),
            Dtype::F32,
            vec![count, 3],
            single(kept.iter().map(|&row| mean[row])),
        ),
        (
            "basis".to_owned(),
            Dtype::F16,
            vec![features, count, 3],
            half(basis),
        ),
        (
            "normals".to_owned(),
            Dtype::F16,
            vec![count, 3],
            half(normals.map(|&x| f64::from(x))),
        ),
    ];
    for (k, Layer { weight, bias }) in prior.hidden().iter().enumerate() {
        let (weight_name, bias_name) = layer_names(k);
        let rows = weight.transpose();
        let shape = vec![weight.nrows(), weight.ncols()];
        tensors.push((weight_name, Dtype::F32, shape, single(rows.iter().copied())));
        tensors.push((
            bias_name,
            Dtype::F32,
            vec![bias.len()],
            single(bias.iter().copied()),
        ));
    }
    serialised(&tensors, info)
}

fn layer_names(k: usize) -> (String, String) {
    (format!("hidden.{k}.weight"), format!("hidden.{k}.bias"))
}

/// Every odd point is the mirror image of the one before it; `columns` numbers per coordinate.
fn check_mirrored(rows: &[f64], columns: usize) -> Result<(), PriorError> {
    for (pair, both) in rows.chunks(6 * columns.max(1)).enumerate() {
        let (even, odd) = both.split_at(both.len() / 2);
        let mirrored = even.len() == odd.len()
            && even
                .iter()
                .zip(odd)
                .enumerate()
                .all(|(i, (a, b))| *a == if i < columns { -b } else { *b });
        if !mirrored {
            return Err(PriorError::NotSymmetric(2 * pair + 1));
        }
    }
    Ok(())
}

fn parse(bytes: &[u8], path: &Path) -> Result<(LearnedPrior, PriorInfo), PriorError> {
    let broken = |reason: String| PriorError::NotSafetensors {
        path: path.to_owned(),
        reason,
    };
    let file = SafeTensors::deserialize(bytes).map_err(|e| broken(e.to_string()))?;
    let (_, header) = SafeTensors::read_metadata(bytes).map_err(|e| broken(e.to_string()))?;
    let info = info(header.metadata().as_ref().and_then(|m| m.get(METADATA_KEY)), path)?;
    if info.schema == SURFACE_SCHEMA {
        return Ok((surface::parse(&file, &info, path)?, info));
    }
    let mirrored = info.symmetry == Symmetry::MirrorX;
    let count = if mirrored { info.points / 2 } else { info.points };
    let tensor = |name: &str, shape: &[usize], dtype| numbers(&file, path, name, shape, dtype);
    let mut hidden = Vec::new();
    let mut width = info.styles;
    for (k, &outputs) in info.hidden.iter().enumerate() {
        let (weight, bias) = layer_names(k);
        hidden.push(Layer {
            weight: DMatrix::from_row_slice(outputs, width, &tensor(&weight, &[outputs, width], Dtype::F32)?),
            bias: DVector::from_vec(tensor(&bias, &[outputs], Dtype::F32)?),
        });
        width = outputs;
    }
    let features = info
        .styles
        .saturating_add(info.hidden.last().copied().unwrap_or(0));
    let mean = tensor("mean", &[count, 3], Dtype::F32)?;
    let modes = tensor("basis", &[features, count, 3], Dtype::F16)?;
    let normals = tensor("normals", &[count, 3], Dtype::F16)?;
    let expand = |values: &[f64]| -> Vec<f64> {
        values
            .chunks_exact(3)
            .flat_map(|p| {
                let image = [-p[0], p[1], p[2]];
                [p[0], p[1], p[2]]
                    .into_iter()
                    .chain(image.into_iter().take(if mirrored { 3 } else { 0 }))
            })
            .collect()
    };
    let mean = expand(&mean);
    let modes = expand(&modes);
    let basis = (0..mean.len())
        .flat_map(|row| modes.iter().skip(row).step_by(mean.len()).copied())
        .collect();
    let normals = expand(&normals)
        .chunks_exact(3)
        .map(|n| [n[0] as f32, n[1] as f32, n[2] as f32])
        .collect();
    let prior = LinearPrior::new(mean, basis, features, normals)
        .and_then(|output| LearnedPrior::new(info.styles, hidden, output))
        .map_err(|problem| PriorError::Invalid {
            path: path.to_owned(),
            problem,
        })?;
    check_unit(prior.output(), path)?;
    Ok((prior, info))
}

/// Refuses shapes in another unit than their diagonal, or about another origin than their centre: whatever takes a prior counts on both.
/// `path` is what messages call the prior.
pub fn check_unit(output: &LinearPrior, path: &Path) -> Result<(), PriorError> {
    let along = |axis: usize| {
        let coordinates = output.mean().iter().skip(axis).step_by(3);
        coordinates.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &x| {
            (low.min(x), high.max(x))
        })
    };
    let sides = [along(0), along(1), along(2)];
    let length = |of: fn(&(f64, f64)) -> f64| sides.iter().map(of).map(|x| x * x).sum::<f64>().sqrt();
    let farthest_moved = output.basis().iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    for (what, found, within, expected) in [
        (
            "diagonal",
            length(|(low, high)| high - low),
            DIAGONAL,
            "0.9 to 1.12",
        ),
        (
            "centre's distance from the origin",
            length(|(low, high)| (low + high) / 2.0),
            0.0..=MAX_CENTRE_OFFSET,
            "0",
        ),
        (
            "largest change by one standard deviation of a style",
            farthest_moved,
            0.0..=MAX_DEFORMATION,
            "less than 1",
        ),
    ] {
        if !within.contains(&found) {
            return Err(PriorError::Unit {
                path: path.to_owned(),
                what,
                found,
                expected,
            });
        }
    }
    Ok(())
}

/// Reads a file's bytes, for the targets in `fuzz/`.
#[cfg(fuzzing)]
pub fn fuzz(data: &[u8]) {
    let _ = parse(data, Path::new("a.safetensors"));
}

/// The version is looked at before the rest, so that a newer file is called newer and not broken.
fn info(json: Option<&String>, path: &Path) -> Result<PriorInfo, PriorError> {
    let wrong = |reason: String| PriorError::Metadata {
        path: path.to_owned(),
        reason,
    };
    let json = json.ok_or_else(|| wrong("is missing".to_owned()))?;
    let value: serde_json::Value =
        serde_json::from_str(json).map_err(|e| wrong(format!("is no JSON: {e}")))?;
    match value.get("schema").and_then(serde_json::Value::as_u64) {
        Some(found) if found == u64::from(SCHEMA) || found == u64::from(SURFACE_SCHEMA) => {}
        Some(found) => {
            return Err(PriorError::Version {
                path: path.to_owned(),
                found,
            });
        }
        None => return Err(wrong("has no schema number".to_owned())),
    }
    let info: PriorInfo = serde_json::from_value(value).map_err(|e| wrong(format!("is wrong: {e}")))?;
    if (info.kind == PriorKind::Decoder) == info.hidden.is_empty() {
        return Err(wrong(
            "must name hidden layers if and only if its kind is decoder".to_owned(),
        ));
    }
    let of_surface = info.schema == SURFACE_SCHEMA;
    if (info.kind == PriorKind::Surface) != of_surface || info.free_form.is_some() != of_surface {
        return Err(wrong(format!(
            "must be of kind surface with a free form if and only if its schema is {SURFACE_SCHEMA}"
        )));
    }
    if info.frame != OBJECT_FRAME {
        return Err(PriorError::Frame {
            path: path.to_owned(),
            found: info.frame,
        });
    }
    if info.symmetry == Symmetry::MirrorX && !info.points.is_multiple_of(2) {
        return Err(wrong(format!(
            "has symmetry mirror_x and an odd number of points, {}",
            info.points
        )));
    }
    Ok(info)
}

impl PriorInfo {
    /// The description of `prior`, mirrored, by this version in the canonical frame.
    pub fn mirrored(category: &str, prior: &LearnedPrior) -> Self {
        let hidden: Vec<usize> = prior.hidden().iter().map(|layer| layer.bias.len()).collect();
        let (schema, kind) = match (prior.surface(), hidden.is_empty()) {
            (Some(_), _) => (SURFACE_SCHEMA, PriorKind::Surface),
            (None, true) => (SCHEMA, PriorKind::Linear),
            (None, false) => (SCHEMA, PriorKind::Decoder),
        };
        Self {
            schema,
            kind,
            category: category.to_owned(),
            frame: OBJECT_FRAME.to_owned(),
            symmetry: Symmetry::MirrorX,
            styles: prior.style_len(),
            hidden,
            points: prior.point_count(),
            free_form: None,
            command: String::new(),
            seed: 0,
            explained_variance: Vec::new(),
            licences: Vec::new(),
            sources: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests;
