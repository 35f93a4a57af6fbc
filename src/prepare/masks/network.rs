//! One network: its ONNX file, the TOML file beside it that says how to use it, and running it.

use crate::bridge::vision::ffi::{self, Picture};
use crate::prepare::PrepareError;
use crate::prepare::cache::Key;
use rten::{Dimension, Model, RunOptions, ThreadPool, Value};
use rten_tensor::NdTensor;
use rten_tensor::prelude::*;
use serde::Deserialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What is wrong with a network, or with a folder of them.
#[derive(Debug, thiserror::Error)]
pub enum NetworkError {
    /// A file cannot be read.
    #[error("{}: cannot be read ({problem}); {mend}", .file.display())]
    Read {
        /// The file.
        file: PathBuf,
        // Not `source`: the message has it already, and whoever prints the chain would print it twice.
        /// The operating system's error.
        problem: std::io::Error,
        /// How to mend it.
        mend: &'static str,
    },
    /// The TOML file beside a network is wrong.
    #[error("{}: {problem}; correct it (docs/formats.md says what it holds)", .file.display())]
    Description {
        /// The TOML file.
        file: PathBuf,
        /// The key and what is wrong with it.
        problem: String,
    },
    /// The ONNX file holds no network that can be run.
    #[error("{}: no network that can be run ({reason}); export it to ONNX with 32-bit floats", .file.display())]
    Network {
        /// The ONNX file.
        file: PathBuf,
        /// The runtime's error.
        reason: String,
    },
    /// The folder lacks a network that is needed.
    #[error("--networks {}: no {kind} network, {why}; `scripts/fetch_networks {}` fetches one", .folder.display(), .folder.display())]
    NoneOfKind {
        /// The folder of networks.
        folder: PathBuf,
        /// What the missing network would give.
        kind: Kind,
        /// What it is needed for.
        why: &'static str,
    },
    /// The folder holds two networks of one kind.
    #[error("{}: a second {kind} network beside {}; leave one of the two in its folder", .file.display(), .other.display())]
    Twice {
        /// The second network.
        file: PathBuf,
        /// The first network.
        other: PathBuf,
        /// What both give.
        kind: Kind,
    },
    /// The network does not know the category.
    #[error("category: {}: the network knows no {category}, but {known}; leave --category out, or name one of these", .file.display())]
    Category {
        /// The TOML file with the network's classes.
        file: PathBuf,
        /// The category that was asked for.
        category: String,
        /// The categories that the network knows.
        known: String,
    },
}

/// What a network's outputs are.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Likelihoods of whatever stands out, 1 × 1 × h × w in \[0, 1\].
    Saliency,
    /// Boxes of known classes, 1 × (5 + classes) × h × w, as FastestDet's.
    Detections,
    /// A score per class and pixel, 1 × classes × h × w, before any softmax.
    Classes,
}

impl std::fmt::Display for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(match self {
            Self::Saliency => "saliency",
            Self::Detections => "detections",
            Self::Classes => "classes",
        })
    }
}

#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
enum Channels {
    #[default]
    Rgb,
    Bgr,
}

/// The file beside a network.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Description {
    kind: Kind,
    /// It takes pictures of so many pixels a side.
    side: usize,
    /// Each channel enters as (value in \[0, 255\] − mean) / deviation; both in the order of red, green, blue.
    mean: [f32; 3],
    deviation: [f32; 3],
    /// The order in which the channels enter.
    #[serde(default)]
    channels: Channels,
    /// In the network's order; none for saliency.
    #[serde(default)]
    classes: Vec<String>,
}

/// An output, the last dimension fastest.
#[derive(Clone, Debug)]
pub struct Tensor {
    pub shape: Vec<usize>,
    pub values: Vec<f32>,
}

/// A network and how to use it.
pub struct Network {
    file: PathBuf,
    description: Description,
    model: Model,
    threads: Arc<ThreadPool>,
    key: Key,
}

impl Network {
    /// That which the TOML file `beside` describes: its namesake that ends in `.onnx`.
    ///
    /// # Errors
    /// Files that cannot be read, or that hold something else.
    pub fn read(beside: &Path) -> Result<Self, NetworkError> {
        let read = |file: &Path, mend| {
            std::fs::read(file).map_err(|problem| NetworkError::Read {
                file: file.to_owned(),
                problem,
                mend,
            })
        };
        let text = read(beside, "check its permissions")?;
        let wrong = |problem: String| NetworkError::Description {
            file: beside.to_owned(),
            problem,
        };
        let description: Description = std::str::from_utf8(&text)
            .map_err(|error| wrong(error.to_string()))
            .and_then(|text| {
                toml::from_str(text).map_err(|error| wrong(crate::image::one_line(&error.to_string())))
            })?;
        if !(32..=4096).contains(&description.side) {
            return Err(wrong(format!("side = {} is not in 32..4096", description.side)));
        }
        if !description.mean.iter().all(|x| x.is_finite())
            || !description.deviation.iter().all(|x| x.is_finite() && *x > 0.0)
        {
            return Err(wrong("mean must be finite, deviation finite and above 0".into()));
        }
        if (description.kind == Kind::Saliency) != description.classes.is_empty() {
            return Err(wrong(
                "detections and classes need classes = [names], saliency none".into(),
            ));
        }
        let file = beside.with_extension("onnx");
        let weights = read(&file, "put the network beside its description")?;
        let key = Key::of(&(&weights, text));
        let unusable = |reason: String| NetworkError::Network {
            file: file.clone(),
            reason: crate::image::one_line(&reason),
        };
        let model = Model::load(weights).map_err(|error| unusable(error.to_string()))?;
        let side = description.side;
        let taken = model.input_shape(0);
        let fits = |dimensions: &[Dimension]| {
            let expected = [1, 3, side, side];
            dimensions.len() == 4
                && dimensions
                    .iter()
                    .zip(expected)
                    .all(|(taken, expected)| match taken {
                        Dimension::Fixed(size) => *size == expected,
                        Dimension::Symbolic(_) => true,
                    })
        };
        if model.input_ids().len() != 1 || taken.is_some_and(|taken| !fits(&taken)) {
            return Err(unusable(format!("its input is not 1 × 3 × {side} × {side}")));
        }
        Ok(Self {
            file,
            description,
            model,
            threads: Arc::new(ThreadPool::with_num_threads(rayon::current_num_threads())),
            key,
        })
    }

    pub fn kind(&self) -> Kind {
        self.description.kind
    }

    pub fn file(&self) -> &Path {
        &self.file
    }

    /// A digest of the network's files.
    pub fn key(&self) -> Key {
        self.key
    }

    /// How many classes it tells apart.
    pub fn classes(&self) -> usize {
        self.description.classes.len()
    }

    /// Which of its classes has this name.
    ///
    /// # Errors
    /// A category that it does not know.
    pub fn class_of(&self, category: &str) -> Result<usize, NetworkError> {
        let classes = &self.description.classes;
        classes
            .iter()
            .position(|class| class == category)
            .ok_or_else(|| NetworkError::Category {
                file: self.file.clone(),
                category: category.to_owned(),
                known: classes.join(", "),
            })
    }

    /// All outputs for a picture, which is squeezed into a square first.
    ///
    /// # Errors
    /// A network that does not run.
    pub fn run(&self, picture: &Picture) -> Result<Vec<Tensor>, PrepareError> {
        let side = self.description.side;
        let square = ffi::resized(picture, side, side)?;
        let Description {
            mean,
            deviation,
            channels,
            ..
        } = &self.description;
        let entered = NdTensor::<f32, 4>::from_fn([1, 3, side, side], |[_, channel, row, column]| {
            let channel = match channels {
                Channels::Rgb => channel,
                Channels::Bgr => 2 - channel,
            };
            let value = f32::from(square.rgb[3 * (row * side + column) + channel]);
            (value - mean[channel]) / deviation[channel]
        });
        let options = RunOptions::default().with_thread_pool(Some(self.threads.clone()));
        let found = self
            .model
            .run(
                vec![(self.model.input_ids()[0], entered.view().into())],
                self.model.output_ids(),
                Some(options),
            )
            .map_err(|error| self.unusable(error.to_string()))?;
        found
            .into_iter()
            .map(|value: Value| {
                let tensor = value
                    .into_tensor::<f32>()
                    .ok_or_else(|| self.unusable("an output is not of 32-bit floats".into()))?;
                Ok(Tensor {
                    shape: tensor.shape().to_vec(),
                    values: tensor.into_data(),
                })
            })
            .collect()
    }

    /// The error that the network's outputs are not what its description says.
    pub fn unusable(&self, reason: String) -> PrepareError {
        PrepareError::Network(NetworkError::Network {
            file: self.file.clone(),
            reason: crate::image::one_line(&reason),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::tiny;
    use super::*;

    #[test]
    fn a_network_runs_on_channels_in_its_order() {
        let folder = tempfile::tempdir().unwrap();
        let description = tiny::description("classes", "classes = [\"red\", \"blue\"]");
        let weights = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
        let picture = Picture {
            width: 2,
            height: 1,
            rgb: vec![255, 0, 0, 255, 0, 0],
            seconds: 0.0,
        };
        for (channels, expected) in [("rgb", [1.0, -1.0]), ("bgr", [-1.0, 1.0])] {
            let description = format!("channels = \"{channels}\"\n{description}");
            tiny::network(
                folder.path(),
                "colours",
                &description,
                0,
                &weights,
                &[0.0, 0.0],
                false,
            );
            let network = Network::read(&folder.path().join("colours.toml")).unwrap();
            let outputs = network.run(&picture).unwrap();
            assert_eq!(outputs[0].shape, [1, 2, tiny::SIDE, tiny::SIDE]);
            let pixels = tiny::SIDE * tiny::SIDE;
            assert_eq!([outputs[0].values[0], outputs[0].values[pixels]], expected);
        }
    }

    #[test]
    fn networks_that_cannot_be_used_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        tiny::redness(folder.path());
        let beside = folder.path().join("saliency.toml");
        let refused = |message: &str| {
            let said = Network::read(&beside).err().unwrap().to_string();
            assert!(said.contains(message), "{said}");
        };
        let good = tiny::description("saliency", "");
        for (text, message) in [
            ("side = 32".to_owned(), "missing field"),
            (good.replace("32", "3"), "side = 3 is not in 32..4096"),
            (
                good.replace("side = 32", "side = 64"),
                "input is not 1 × 3 × 64 × 64",
            ),
            (
                good.replace("deviation = [127.5", "deviation = [0"),
                "deviation finite and above 0",
            ),
            (good.replace("saliency", "classes"), "need classes = [names]"),
            (good.replace("saliency", "magic"), "unknown variant"),
        ] {
            std::fs::write(&beside, text).unwrap();
            refused(message);
        }
        std::fs::write(&beside, &good).unwrap();
        std::fs::write(folder.path().join("saliency.onnx"), "no network").unwrap();
        refused("no network that can be run");
        std::fs::remove_file(folder.path().join("saliency.onnx")).unwrap();
        refused("saliency.onnx: cannot be read");
    }
}
