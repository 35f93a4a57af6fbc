//! The regressor's file: safetensors with `NAME.weight` \[outputs, inputs\] and `NAME.bias` \[outputs\], f16, for the layers
//! `convolutions.k`, `feature`, `from_feature`, `from_state` and `style`, and one metadata entry `spba_regressor` holding
//! [`RegressorInfo`] as JSON.

use super::Regressor;
use super::network::{Conv, Dense, Network};
use half::f16;
use nalgebra::{DMatrix, DVector};
use safetensors::tensor::{Dtype, TensorView};
use safetensors::{SafeTensors, serialize};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The schema this build reads and writes.
const SCHEMA: u32 = 1;
const METADATA_KEY: &str = "spba_regressor";

/// The metadata of a regressor file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RegressorInfo {
    /// The layout's version.
    pub schema: u32,
    /// The category of the prior: `car`.
    pub category: String,
    /// The number of style entries S.
    pub styles: usize,
    /// The number of convolutions.
    pub convolutions: usize,
    /// The command that learned the prior whose styles these are.
    pub prior_command: String,
    /// The command that trained it.
    pub command: String,
    /// The seed of the examples and of the weights' start.
    pub seed: u64,
}

impl RegressorInfo {
    /// Of a network with so many `convolutions` for the prior that says `prior` of itself.
    pub fn new(prior: &crate::prior::PriorInfo, convolutions: usize, command: String, seed: u64) -> Self {
        Self {
            schema: SCHEMA,
            category: prior.category.clone(),
            styles: prior.styles,
            convolutions,
            prior_command: prior.command.clone(),
            command,
            seed,
        }
    }
}

/// Why there is no style; each message is one line.
#[derive(Debug, thiserror::Error)]
pub enum RegressorError {
    /// The file cannot be read.
    #[error("{}: cannot read the regressor: {problem}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        problem: std::io::Error,
    },
    /// The file cannot be written.
    #[error("{}: cannot write the regressor: {problem}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        problem: std::io::Error,
    },
    /// The file is no whole safetensors file.
    #[error("{}: not a whole safetensors file ({reason}): train it again", path.display())]
    NotSafetensors {
        /// The file.
        path: PathBuf,
        /// The parser's error.
        reason: String,
    },
    /// The file's metadata does not describe a regressor.
    #[error("{}: not a regressor (metadata `{METADATA_KEY}` {reason}): make one with `spba-ceres regressor train`", path.display())]
    Metadata {
        /// The file.
        path: PathBuf,
        /// What is missing or wrong.
        reason: String,
    },
    /// A layer is missing or has another shape.
    #[error("{}: {reason}: train it again", path.display())]
    Layer {
        /// The file.
        path: PathBuf,
        /// The layer and what is wrong with it.
        reason: String,
    },
    /// The regressor speaks of another prior's styles.
    #[error(
        "the regressor was trained for the prior of `{trained_for}`, this one's is `{given}`: train another, or start from the mean style"
    )]
    OtherPrior {
        /// The command that learned the prior that it was trained for.
        trained_for: String,
        /// The command that learned the prior that was given.
        given: String,
    },
    /// No regressor is bundled for the category.
    #[error(
        "no regressor for `{category}` is bundled, only for {bundled}: train one, or start from the mean style"
    )]
    NotBundled {
        /// The category that was asked for.
        category: String,
        /// The categories that have one.
        bundled: String,
    },
    /// Every mask is empty. The field is the sequence's name.
    #[error("sequence `{0}`: every mask is empty: mark the object in them")]
    NothingSeen(String),
}

/// The files of the bundled regressors.
#[cfg(feature = "bundled-priors")]
const BUNDLED: [(&str, &[u8]); 1] = [("car", include_bytes!("../../data/regressors/car.safetensors"))];

#[cfg(not(feature = "bundled-priors"))]
const BUNDLED: [(&str, &[u8]); 0] = [];

/// The bundled regressor of a category.
pub fn bundled(category: &str) -> Result<Regressor, RegressorError> {
    let known = BUNDLED.iter().find(|(name, _)| *name == category);
    let (name, bytes) = known.ok_or_else(|| RegressorError::NotBundled {
        category: category.to_owned(),
        bundled: BUNDLED.map(|(name, _)| name).join(", "),
    })?;
    parse(bytes, Path::new(name))
}

fn layers(network: &Network) -> Vec<(String, &Dense)> {
    let convolutions = network.convolutions.iter().enumerate();
    let mut layers: Vec<_> = convolutions
        .map(|(k, Conv(dense))| (format!("convolutions.{k}"), dense))
        .collect();
    layers.push(("feature".to_owned(), &network.feature));
    layers.push(("from_feature".to_owned(), &network.from_feature));
    layers.push(("from_state".to_owned(), &network.from_state));
    layers.push(("style".to_owned(), &network.style));
    layers
}

/// Writes `regressor` beside `path`, then renames.
pub fn save(path: &Path, regressor: &Regressor) -> Result<(), RegressorError> {
    let half = |numbers: &[f32]| -> Vec<u8> {
        numbers
            .iter()
            .flat_map(|&x| f16::from_f32(x).to_le_bytes())
            .collect()
    };
    let mut tensors: Vec<(String, Vec<usize>, Vec<u8>)> = Vec::new();
    for (name, Dense { weight, bias }) in layers(&regressor.network) {
        let shape = vec![weight.nrows(), weight.ncols()];
        tensors.push((
            format!("{name}.weight"),
            shape,
            half(weight.transpose().as_slice()),
        ));
        tensors.push((format!("{name}.bias"), vec![bias.len()], half(bias.as_slice())));
    }
    let impossible = |reason: String| RegressorError::Layer {
        path: path.to_owned(),
        reason,
    };
    let views = tensors
        .iter()
        .map(|(name, shape, data)| Ok((name, TensorView::new(Dtype::F16, shape.clone(), data)?)))
        .collect::<Result<Vec<_>, safetensors::SafeTensorError>>()
        .map_err(|e| impossible(e.to_string()))?;
    let json = serde_json::to_string(&regressor.info).map_err(|e| impossible(e.to_string()))?;
    let about = Some([(METADATA_KEY.to_owned(), json)].into());
    let bytes = serialize(views, about).map_err(|e| impossible(e.to_string()))?;
    crate::files::write_whole(path, &bytes).map_err(|problem| RegressorError::Write {
        path: path.to_owned(),
        problem,
    })
}

/// Reads and checks a regressor file.
pub fn load(path: &Path) -> Result<Regressor, RegressorError> {
    let bytes = std::fs::read(path).map_err(|problem| RegressorError::Read {
        path: path.to_owned(),
        problem,
    })?;
    parse(&bytes, path)
}

fn parse(bytes: &[u8], path: &Path) -> Result<Regressor, RegressorError> {
    let broken = |error: safetensors::SafeTensorError| RegressorError::NotSafetensors {
        path: path.to_owned(),
        reason: error.to_string(),
    };
    let file = SafeTensors::deserialize(bytes).map_err(broken)?;
    let (_, header) = SafeTensors::read_metadata(bytes).map_err(broken)?;
    let about = |reason: String| RegressorError::Metadata {
        path: path.to_owned(),
        reason,
    };
    let json = header.metadata().as_ref().and_then(|m| m.get(METADATA_KEY));
    let json = json.ok_or_else(|| about("is missing".to_owned()))?;
    let info: RegressorInfo =
        serde_json::from_str(json).map_err(|e| about(crate::image::one_line(&e.to_string())))?;
    if info.schema != SCHEMA {
        return Err(about(format!(
            "is of schema {}, this build reads {SCHEMA}",
            info.schema
        )));
    }
    let layer = |reason: String| RegressorError::Layer {
        path: path.to_owned(),
        reason,
    };
    let numbers = |name: &str| -> Result<(Vec<usize>, Vec<f32>), RegressorError> {
        let tensor = file
            .tensor(name)
            .map_err(|_| layer(format!("tensor `{name}` is missing")))?;
        if tensor.dtype() != Dtype::F16 {
            return Err(layer(format!("tensor `{name}` is not f16")));
        }
        let halves = tensor
            .data()
            .chunks_exact(2)
            .map(|b| f16::from_le_bytes([b[0], b[1]]).to_f32());
        Ok((tensor.shape().to_vec(), halves.collect()))
    };
    let dense = |name: &str| -> Result<Dense, RegressorError> {
        let (shape, weight) = numbers(&format!("{name}.weight"))?;
        let &[rows, columns] = shape.as_slice() else {
            return Err(layer(format!("tensor `{name}.weight` is not a matrix")));
        };
        Ok(Dense {
            weight: DMatrix::from_row_slice(rows, columns, &weight),
            bias: DVector::from_vec(numbers(&format!("{name}.bias"))?.1),
        })
    };
    let network = Network {
        convolutions: (0..info.convolutions)
            .map(|k| Ok(Conv(dense(&format!("convolutions.{k}"))?)))
            .collect::<Result<_, RegressorError>>()?,
        feature: dense("feature")?,
        from_feature: dense("from_feature")?,
        from_state: dense("from_state")?,
        style: dense("style")?,
    };
    network.check(info.styles).map_err(layer)?;
    Ok(Regressor { info, network })
}

#[cfg(test)]
mod tests {
    use super::super::network::tests::{crop, small};
    use super::*;

    fn regressor() -> Regressor {
        Regressor {
            info: RegressorInfo {
                schema: SCHEMA,
                category: "car".into(),
                styles: 2,
                convolutions: 2,
                prior_command: "spba-ceres prior learn".into(),
                command: "spba-ceres regressor train".into(),
                seed: 7,
            },
            network: small(),
        }
    }

    #[test]
    fn a_file_is_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("car.safetensors");
        save(&path, &regressor()).unwrap();
        let found = load(&path).unwrap();
        assert_eq!(found.info, regressor().info);
        let frames = [crop(1), crop(2)];
        let styles = found.network.style(&frames);
        for (a, b) in styles.iter().zip(small().style(&frames)) {
            assert!((a - b).abs() < 5e-3, "{a} {b}");
        }
        let first = std::fs::read(&path).unwrap();
        save(&path, &found).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), first);
    }

    #[test]
    fn files_that_are_no_regressors_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("car.safetensors");
        let refused = || load(&path).unwrap_err().to_string();
        assert!(refused().contains("cannot read"));
        save(&path, &regressor()).unwrap();
        let whole = std::fs::read(&path).unwrap();
        std::fs::write(&path, &whole[..whole.len() - 3]).unwrap();
        assert!(refused().contains("not a whole safetensors file"));
        std::fs::copy(
            concat!(env!("CARGO_MANIFEST_DIR"), "/data/priors/car.safetensors"),
            &path,
        )
        .unwrap();
        assert!(refused().contains("not a regressor (metadata `spba_regressor` is missing)"));
        let mut wrong = regressor();
        wrong.info.styles = 3;
        save(&path, &wrong).unwrap();
        assert!(refused().contains("`style` has 2 × 3 weights"));
    }
}
