//! The prior's file, schema 1 (schema 2, of surfaces, is in `surface`): safetensors with `mean` \[N, 3\] f32, `basis` \[S + M, N, 3\] f16, `normals` \[N, 3\] f16, and
//! one metadata entry `spba_prior` holding [`PriorInfo`] as JSON. A decoder's hidden layers k = 0, 1, … are `hidden.k.weight`
//! \[outputs, inputs\] and `hidden.k.bias` \[outputs\], f32; M is the last one's outputs, 0 without. With
//! `symmetry = "mirror_x"` the tensors over points hold every other one, and point 2i + 1 is point 2i reflected in x = 0.

mod error;
mod info;
mod surface;
mod tensors;

pub use error::PriorError;
use info::info;
pub use info::{FreeFormInfo, PriorInfo, PriorKind, PriorSource, Symmetry};

use super::ShapePrior;
use super::learned::{Layer, LearnedPrior};
use super::linear::{InvalidPrior, LinearPrior};
use nalgebra::{DMatrix, DVector};
use safetensors::SafeTensors;
use safetensors::tensor::Dtype;
use std::path::Path;
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
/// Priors that ship inside the library: a category's name, or the category's and a template's.
#[cfg(feature = "bundled-priors")]
const BUNDLED: [(&str, &[u8]); 5] = [
    ("car", include_bytes!("../../data/priors/car.safetensors")),
    (
        "chair-legs",
        include_bytes!("../../data/priors/chair-legs.safetensors"),
    ),
    (
        "chair-armchair",
        include_bytes!("../../data/priors/chair-armchair.safetensors"),
    ),
    (
        "chair-foot",
        include_bytes!("../../data/priors/chair-foot.safetensors"),
    ),
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

/// A bundled prior by its name (`car`), or the file that `name_or_path` points to. Of a category with several templates (`chair`), the first.
pub fn find(name_or_path: &str) -> Result<LearnedPrior, PriorError> {
    open(name_or_path).map(|(prior, _)| prior)
}

/// Reads and checks a prior file.
pub fn load(path: &Path) -> Result<LearnedPrior, PriorError> {
    open_file(path).map(|(prior, _)| prior)
}

/// Like [`find`], with what the file says of itself.
pub fn open(name_or_path: &str) -> Result<(LearnedPrior, PriorInfo), PriorError> {
    if let Some((name, bytes)) = bundled_as(name_or_path).next() {
        return parse(bytes, Path::new(name));
    }
    let path = Path::new(name_or_path);
    if !path.exists() && path.components().count() <= 1 && path.extension().is_none() {
        let mut categories = BUNDLED
            .map(|(name, _)| name.split('-').next().unwrap_or(name))
            .to_vec();
        categories.dedup();
        let bundled = match &categories[..] {
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

/// The priors that `names_or_paths` stand for, separated by commas: of a bundled category with several templates (`chair`), one for each.
/// [`solver::compete`](crate::solver::compete) says which of them fits a sequence.
///
/// # Errors
/// One that cannot be read, or priors of several categories.
pub fn open_all(names_or_paths: &str) -> Result<Vec<(LearnedPrior, PriorInfo)>, PriorError> {
    let mut found = Vec::new();
    let is_one = Path::new(names_or_paths).exists();
    for name in names_or_paths.split(|letter| letter == ',' && !is_one) {
        let mut bundled = bundled_as(name).peekable();
        if bundled.peek().is_none() {
            found.push(open(name)?);
        }
        for (name, bytes) in bundled {
            found.push(parse(bytes, Path::new(name))?);
        }
    }
    let category = |(_, info): &(LearnedPrior, PriorInfo)| info.category.clone();
    if let Some(other) = found.iter().find(|prior| category(prior) != category(&found[0])) {
        return Err(PriorError::Categories(category(&found[0]), category(other)));
    }
    Ok(found)
}

/// The bundled prior of that name, else those of that category.
fn bundled_as(name: &str) -> impl Iterator<Item = (&'static str, &'static [u8])> {
    let is_one = BUNDLED.iter().any(|(bundled, _)| *bundled == name);
    BUNDLED.into_iter().filter(move |(bundled, _)| {
        let template = bundled.strip_prefix(name);
        template.is_some_and(|rest| rest.is_empty() || (!is_one && rest.starts_with('-')))
    })
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

#[cfg(test)]
mod tests;
