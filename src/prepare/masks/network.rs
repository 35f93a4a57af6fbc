//! Masks from a network: saliency maps as of U²-Net and ISNet, or instances as of YOLO's segmentation networks.

use super::cleaned;
use crate::bridge::vision::ffi::{self, Network, NetworkInput, Picture, Tensor};
use crate::image::{Grid, Mask};
use crate::prepare::PrepareError;
use crate::prepare::cache::Key;
use cxx::UniquePtr;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// What is wrong with a network.
#[derive(Debug, thiserror::Error)]
pub enum SegmenterError {
    #[error("{}: cannot be read ({source}); {mend}", .file.display())]
    Read {
        file: PathBuf,
        source: std::io::Error,
        mend: &'static str,
    },
    #[error("{}: {problem}; correct it (data/README.md says what it holds)", .file.display())]
    Description { file: PathBuf, problem: String },
    #[error("{}: no network that OpenCV can run ({reason}); export it to ONNX with 32-bit floats and fixed sizes", .file.display())]
    Network { file: PathBuf, reason: String },
    #[error("--category: {}: the network knows no {category}, but {known}; give one of these", .file.display())]
    Category {
        file: PathBuf,
        category: String,
        known: String,
    },
}

/// The file beside a network.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Description {
    kind: Kind,
    /// It takes pictures of so many pixels a side.
    side: usize,
    /// Each channel enters as (value in \[0, 255\] − mean) / deviation, RGB.
    mean: [f64; 3],
    deviation: [f64; 3],
    /// Of instances, in the network's order.
    #[serde(default)]
    classes: Vec<String>,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
enum Kind {
    Saliency,
    Instances,
}

/// A network and how to use it.
pub struct Segmenter {
    file: PathBuf,
    network: UniquePtr<Network>,
    input: NetworkInput,
    /// Of instances: how many classes there are, and the one to look for, if it matters.
    classes: Option<(usize, Option<usize>)>,
    key: Key,
}

impl Segmenter {
    /// From `file` and the TOML file of the same name.
    ///
    /// # Errors
    /// Files that cannot be read, or a category that the network does not know.
    pub fn read(file: &Path, category: Option<&str>) -> Result<Self, SegmenterError> {
        let read = |file: &Path, mend| {
            std::fs::read(file).map_err(|source| SegmenterError::Read {
                file: file.to_owned(),
                source,
                mend,
            })
        };
        let weights = read(file, "correct --segmenter")?;
        let beside = file.with_extension("toml");
        let text = read(&beside, "describe the network in it (data/README.md)")?;
        let wrong = |problem: String| SegmenterError::Description {
            file: beside.clone(),
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
        let finite = |x: &f64| x.is_finite();
        if !description.mean.iter().all(finite)
            || !description.deviation.iter().all(|x| x.is_finite() && *x > 0.0)
        {
            return Err(wrong("mean must be finite, deviation finite and above 0".into()));
        }
        let classes = match description.kind {
            Kind::Saliency => None,
            Kind::Instances if description.classes.is_empty() => {
                return Err(wrong("instances need classes = [names]".into()));
            }
            Kind::Instances => {
                let wanted = category
                    .map(|category| {
                        let named = description.classes.iter().position(|class| class == category);
                        named.ok_or_else(|| SegmenterError::Category {
                            file: file.to_owned(),
                            category: category.to_owned(),
                            known: description.classes.join(", "),
                        })
                    })
                    .transpose()?;
                Some((description.classes.len(), wanted))
            }
        };
        let network = ffi::read_network(&file.to_string_lossy()).map_err(|error| refused(file, &error))?;
        Ok(Self {
            file: file.to_owned(),
            network,
            input: NetworkInput {
                side: description.side,
                mean: description.mean,
                deviation: description.deviation,
            },
            classes,
            key: Key::of(&(weights, text)),
        })
    }

    /// Of its files' contents.
    pub fn key(&self) -> Key {
        self.key
    }

    /// The object in a picture; empty where there is none.
    ///
    /// # Errors
    /// A network that does not run, or whose outputs are not of its kind.
    pub fn mask(&mut self, picture: &Picture) -> Result<Mask, PrepareError> {
        let outputs = self
            .network
            .pin_mut()
            .run(picture, &self.input)
            .map_err(|error| refused(&self.file, &error))?;
        let found = match self.classes {
            None => saliency(&outputs),
            Some((classes, wanted)) => instance(&outputs, classes, wanted, self.input.side),
        };
        let found = found.map_err(|problem| SegmenterError::Network {
            file: self.file.clone(),
            reason: problem,
        })?;
        let (width, height) = (picture.width, picture.height);
        let share = |x: usize, of: usize| (x as f64 + 0.5) / of as f64;
        let mask = (0..width * height)
            .map(|i| u8::from(found.at(share(i % width, width), share(i / width, height)) > 0.5))
            .collect();
        Ok(cleaned(mask, width, height, 1)?)
    }
}

fn refused(file: &Path, error: &cxx::Exception) -> SegmenterError {
    SegmenterError::Network {
        file: file.to_owned(),
        reason: crate::image::one_line(error.what()),
    }
}

/// How likely the object is, over the whole picture.
struct Likelihood(Grid<f32>);

impl Likelihood {
    /// Bilinear; x and y are shares of the picture's width and height.
    fn at(&self, x: f64, y: f64) -> f32 {
        let (width, height) = self.0.size();
        let (x, y) = (x * width as f64 - 0.5, y * height as f64 - 0.5);
        let (left, top) = (x.floor(), y.floor());
        let (right_share, down_share) = ((x - left) as f32, (y - top) as f32);
        let clamped = |x: f64, size: usize| x.clamp(0.0, size as f64 - 1.0) as usize;
        let value = |dx: f64, dy: f64| self.0[(clamped(left + dx, width), clamped(top + dy, height))];
        let row = |dy| value(0.0, dy) * (1.0 - right_share) + value(1.0, dy) * right_share;
        row(0.0) * (1.0 - down_share) + row(1.0) * down_share
    }
}

/// The first output of one channel: \[1, 1, h, w\], values in \[0, 1\].
fn saliency(outputs: &[Tensor]) -> Result<Likelihood, String> {
    let map = outputs.iter().find_map(|output| match output.shape[..] {
        [1, 1, height, width] => Grid::from_vec(width, height, output.values.clone()),
        _ => None,
    });
    let map = map.ok_or("it has no output of shape 1 × 1 × height × width, as saliency networks have")?;
    if map.data().iter().any(|p| !(-1e-3..=1.001).contains(p)) {
        return Err("its output is not within 0 and 1".into());
    }
    Ok(Likelihood(map))
}

/// Detections below this score are none.
const LEAST_SCORE: f32 = 0.25;

/// The largest sure instance: outputs \[1, 4 + classes + m, n\] (boxes by centre and size in pixels of the network's input, scores,
/// coefficients) and \[1, m, h, w\] (whose sums are masks' logits). Nothing likely where nothing was detected.
fn instance(
    outputs: &[Tensor],
    classes: usize,
    wanted: Option<usize>,
    side: usize,
) -> Result<Likelihood, String> {
    let unlike = || {
        format!(
            "its outputs are not 1 × (4 + {classes} + m) × n and 1 × m × height × width, as segmenting YOLO networks have"
        )
    };
    let found = outputs
        .iter()
        .find(|output| output.shape.len() == 3)
        .ok_or_else(unlike)?;
    let bases = outputs
        .iter()
        .find(|output| output.shape.len() == 4)
        .ok_or_else(unlike)?;
    let ([1, rows, count], [1, terms, height, width]) = (&found.shape[..], &bases.shape[..]) else {
        return Err(unlike());
    };
    let (rows, count, terms, height, width) = (*rows, *count, *terms, *height, *width);
    if rows != 4 + classes + terms || width == 0 || height == 0 {
        return Err(unlike());
    }
    let entry = |row: usize, column: usize| found.values[row * count + column];
    let score = |column: usize| match wanted {
        Some(class) => entry(4 + class, column),
        None => (0..classes)
            .map(|class| entry(4 + class, column))
            .fold(0.0, f32::max),
    };
    let worth = |column: usize| score(column) * (entry(2, column) * entry(3, column)).max(0.0).sqrt();
    let best = (0..count)
        .filter(|&column| score(column) >= LEAST_SCORE)
        .max_by(|&a, &b| worth(a).total_cmp(&worth(b)));
    let Some(best) = best else {
        return Ok(Likelihood(Grid::filled(width, height, 0.0)));
    };
    let [x, y, across, down] = [0, 1, 2, 3].map(|row| entry(row, best) / side as f32);
    Ok(Likelihood(Grid::from_fn(width, height, |column, row| {
        let (dx, dy) = (
            (column as f32 + 0.5) / width as f32 - x,
            (row as f32 + 0.5) / height as f32 - y,
        );
        if 2.0 * dx.abs() > across || 2.0 * dy.abs() > down {
            return 0.0;
        }
        let logit: f32 = (0..terms)
            .map(|term| {
                entry(4 + classes + term, best) * bases.values[(term * height + row) * width + column]
            })
            .sum();
        1.0 / (1.0 + (-logit).exp())
    })))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tensor(shape: &[usize], value: impl Fn(usize) -> f32) -> Tensor {
        Tensor {
            shape: shape.to_vec(),
            values: (0..shape.iter().product()).map(value).collect(),
        }
    }

    #[test]
    fn saliency_is_read_between_its_pixels() {
        let found = saliency(&[
            tensor(&[1, 64, 2, 2], |_| 9.0),
            tensor(&[1, 1, 2, 2], |i| i as f32 / 4.0),
        ])
        .unwrap();
        assert_eq!(found.at(0.25, 0.25), 0.0);
        assert_eq!(found.at(0.5, 0.25), 0.125);
        assert_eq!(found.at(0.5, 0.5), 0.375);
        assert_eq!(found.at(1.0, 1.0), 0.75);
        assert!(saliency(&[tensor(&[1, 2, 2, 2], |_| 0.5)]).is_err());
        assert!(saliency(&[tensor(&[1, 1, 2, 2], |_| 7.0)]).is_err());
        assert!(saliency(&[tensor(&[1, 1, 2, 2], |_| f32::NAN)]).is_err());
    }

    /// A field of a protocol buffer.
    fn field(number: u8, bytes: &[u8]) -> Vec<u8> {
        assert!(bytes.len() < 128);
        [&[number << 3 | 2, bytes.len() as u8], bytes].concat()
    }

    fn whole(number: u8, value: u8) -> Vec<u8> {
        vec![number << 3, value]
    }

    /// `name`, 32-bit floats of 1 × channels × side × side.
    fn value_info(name: &str, channels: u8, side: u8) -> Vec<u8> {
        let dims = [1, channels, side, side]
            .map(|dim| field(1, &whole(1, dim)))
            .concat();
        let tensor_type = [whole(1, 1), field(2, &dims)].concat();
        [field(1, name.as_bytes()), field(2, &field(1, &tensor_type))].concat()
    }

    fn weights(name: &str, shape: &[u8], values: &[f32]) -> Vec<u8> {
        let dims: Vec<u8> = shape.iter().flat_map(|&dim| whole(1, dim)).collect();
        let values: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        [dims, whole(2, 1), field(8, name.as_bytes()), field(9, &values)].concat()
    }

    /// An ONNX network of one layer: likely where red is more than blue, as (4 red − 4 blue) / deviation tells.
    fn redness(folder: &Path) -> PathBuf {
        let node = |kind: &str, inputs: &[&str], output: &str, attribute: &[u8]| {
            let inputs: Vec<u8> = inputs
                .iter()
                .flat_map(|input| field(1, input.as_bytes()))
                .collect();
            let names = [field(2, output.as_bytes()), field(4, kind.as_bytes())].concat();
            field(1, &[&inputs, &names, attribute].concat())
        };
        // The last field is number 20, of whole numbers: type 7.
        let one_by_one = [
            &field(1, b"kernel_shape")[..],
            &whole(8, 1),
            &whole(8, 1),
            &[160, 1, 7],
        ]
        .concat();
        let graph = [
            node("Conv", &["x", "w"], "y", &field(5, &one_by_one)),
            node("Sigmoid", &["y"], "z", &[]),
            field(2, b"redness"),
            field(5, &weights("w", &[1, 3, 1, 1], &[4.0, 0.0, -4.0])),
            field(11, &value_info("x", 3, 32)),
            field(12, &value_info("z", 1, 32)),
        ]
        .concat();
        // Its length takes two bytes.
        let length = [graph.len() as u8 | 128, (graph.len() >> 7) as u8];
        let opset = field(8, &whole(2, 11));
        let model = [&whole(1, 6)[..], &[7 << 3 | 2], &length, &graph, &opset].concat();
        let file = folder.join("redness.onnx");
        std::fs::write(&file, model).unwrap();
        file
    }

    const DESCRIPTION: &str =
        "kind = \"saliency\"\nside = 32\nmean = [128, 128, 128]\ndeviation = [64, 64, 64]\n";

    #[test]
    fn a_network_runs_and_what_it_finds_becomes_a_mask() {
        let folder = tempfile::tempdir().unwrap();
        let file = redness(folder.path());
        std::fs::write(folder.path().join("redness.toml"), DESCRIPTION).unwrap();
        let mut segmenter = Segmenter::read(&file, Some("car")).unwrap();
        let inside = |column: usize, row: usize| (16..48).contains(&column) && (8..24).contains(&row);
        let picture =
            super::super::picture(&Grid::from_fn(64, 32, |column, row| match inside(column, row) {
                true => [200.0, 60.0, 40.0],
                false => [60.0, 90.0, 180.0],
            }));
        let mask = segmenter.mask(&picture).unwrap();
        let wrong = (0..64 * 32)
            .filter(|i| mask.data()[*i] != inside(i % 64, i / 64))
            .count();
        assert!(
            wrong <= 4,
            "{wrong} pixels, all at the corners that cleaning rounds"
        );
    }

    #[test]
    fn networks_that_cannot_be_used_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let refused = |file: &Path, category: Option<&str>, message: &str| {
            let said = Segmenter::read(file, category).err().unwrap().to_string();
            assert!(said.contains(message), "{said}");
        };
        let file = folder.path().join("redness.onnx");
        let beside = folder.path().join("redness.toml");
        refused(&file, None, "redness.onnx: cannot be read");
        redness(folder.path());
        refused(&file, None, "redness.toml: cannot be read");
        let instances = DESCRIPTION.replace("saliency", "instances");
        for (text, message) in [
            ("side = 32", "missing field"),
            (&DESCRIPTION.replace("32", "3"), "side = 3 is not in 32..4096"),
            (
                &DESCRIPTION.replace("[64, 64, 64]", "[64, 0, 64]"),
                "deviation finite and above 0",
            ),
            (&instances, "instances need classes"),
            (
                &(instances.clone() + "classes = [\"person\", \"dog\"]"),
                "knows no car, but person, dog",
            ),
        ] {
            std::fs::write(&beside, text).unwrap();
            refused(&file, Some("car"), message);
        }
        std::fs::write(&beside, DESCRIPTION).unwrap();
        std::fs::write(&file, "no network").unwrap();
        refused(&file, None, "no network that OpenCV can run");
    }

    /// Two detections, three classes, two bases of 4 × 4: object left of the middle, and everywhere.
    fn detections() -> [Tensor; 2] {
        let columns = [
            // A small sure car, of all bases the first.
            [8.0, 16.0, 12.0, 12.0, 0.0, 0.9, 0.0, 1.0, 0.0],
            // A large person over all.
            [16.0, 16.0, 32.0, 32.0, 0.8, 0.1, 0.0, 0.0, 1.0],
        ];
        let found = tensor(&[1, 9, 2], |i| columns[i % 2][i / 2]);
        let bases = tensor(&[1, 2, 4, 4], |i| match (i / 16, i % 4 < 2) {
            (0, false) => -5.0,
            _ => 5.0,
        });
        [bases, found]
    }

    #[test]
    fn the_wanted_class_is_taken_within_its_box_and_the_largest_otherwise() {
        let car = instance(&detections(), 3, Some(1), 32).unwrap();
        let sure = |found: &Likelihood| Grid::from_fn(4, 4, |column, row| found.0[(column, row)] > 0.5);
        // The box spans 0.0625 to 0.4375 across, 0.3125 to 0.6875 down.
        assert_eq!(
            sure(&car),
            Grid::from_fn(4, 4, |column, row| column < 2 && (1..3).contains(&row))
        );
        let any = instance(&detections(), 3, None, 32).unwrap();
        assert_eq!(sure(&any), Grid::filled(4, 4, true));
        let none = instance(&detections(), 3, Some(2), 32).unwrap();
        assert_eq!(sure(&none), Grid::filled(4, 4, false));
        assert!(instance(&detections(), 4, None, 32).is_err());
        assert!(instance(&detections()[..1], 3, None, 32).is_err());
    }
}
