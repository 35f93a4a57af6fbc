//! A folder of networks, and what they say of a picture: boxes of a class, what stands out, and how likely each pixel is of the class.

use super::boxes::Sides;
use super::network::{Kind, Network, NetworkError, Tensor};
use crate::bridge::vision::ffi::Picture;
use crate::image::Grid;
use crate::prepare::PrepareError;
use crate::prepare::cache::Key;
use std::path::Path;

/// How likely something is, 0 to 255.
pub type Likelihood = Grid<u8>;

/// Above this a pixel belongs to it.
pub const LIKELY: u8 = 127;

/// A network that finds whatever stands out and, where the category is known, two that know what it looks like.
pub struct Networks {
    saliency: Network,
    category: Option<OfCategory>,
}

struct OfCategory {
    detector: Network,
    detected: usize,
    classifier: Network,
    class: usize,
}

/// Where something of the category may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detection {
    pub sides: Sides,
    /// 0 to 1.
    pub score: f64,
}

impl Networks {
    /// The networks that the TOML files of a folder describe, one of each kind.
    ///
    /// # Errors
    /// A folder or networks that cannot be read, kinds that are missing or there twice, a category that they do not know.
    pub fn read(folder: &Path, category: Option<&str>) -> Result<Self, NetworkError> {
        let mut found: Vec<Network> = Vec::new();
        for beside in descriptions(folder)? {
            let network = Network::read(&beside)?;
            if let Some(other) = found.iter().find(|other| other.kind() == network.kind()) {
                return Err(NetworkError::Twice {
                    file: network.file().to_owned(),
                    other: other.file().to_owned(),
                    kind: network.kind(),
                });
            }
            found.push(network);
        }
        let mut take = |kind, why| {
            let place = found.iter().position(|network| network.kind() == kind);
            place
                .map(|place| found.swap_remove(place))
                .ok_or(NetworkError::NoneOfKind {
                    folder: folder.to_owned(),
                    kind,
                    why,
                })
        };
        let saliency = take(Kind::Saliency, "which every mask needs")?;
        let category = category
            .map(|category| {
                let needed = "which a known category needs";
                let detector = take(Kind::Detections, needed)?;
                let classifier = take(Kind::Classes, needed)?;
                Ok(OfCategory {
                    detected: detector.class_of(category)?,
                    class: classifier.class_of(category)?,
                    detector,
                    classifier,
                })
            })
            .transpose()?;
        Ok(Self { saliency, category })
    }

    /// A digest of all networks' files.
    pub fn key(&self) -> Key {
        let of_category = self
            .category
            .as_ref()
            .map(|known| (known.detector.key(), known.classifier.key()));
        Key::of(&(self.saliency.key(), of_category))
    }

    /// Whether they know what the object looks like.
    pub fn know_category(&self) -> bool {
        self.category.is_some()
    }

    /// How likely each pixel is of what stands out.
    ///
    /// # Errors
    /// A network that does not run, or whose output is not of its kind.
    pub fn saliency(&self, picture: &Picture) -> Result<Likelihood, PrepareError> {
        let outputs = self.saliency.run(picture)?;
        let map = saliency(&outputs).map_err(|problem| self.saliency.unusable(problem))?;
        Ok(spread(&map, picture.width, picture.height))
    }

    /// How likely each pixel is of the category; `None` where that is not known.
    ///
    /// # Errors
    /// A network that does not run, or whose output is not of its kind.
    pub fn class(&self, picture: &Picture) -> Result<Option<Likelihood>, PrepareError> {
        let Some(known) = &self.category else {
            return Ok(None);
        };
        let outputs = known.classifier.run(picture)?;
        let map = share_of_class(&outputs, known.classifier.classes(), known.class)
            .map_err(|problem| known.classifier.unusable(problem))?;
        Ok(Some(spread(&map, picture.width, picture.height)))
    }

    /// Boxes about what looks like the category, best first, in the picture's pixels; none where the category is not known.
    ///
    /// # Errors
    /// A network that does not run, or whose output is not of its kind.
    pub fn detections(&self, picture: &Picture) -> Result<Vec<Detection>, PrepareError> {
        let Some(known) = &self.category else {
            return Ok(Vec::new());
        };
        let outputs = known.detector.run(picture)?;
        let mut found = detections(&outputs, known.detector.classes(), known.detected)
            .map_err(|problem| known.detector.unusable(problem))?;
        let (width, height) = (picture.width as f64, picture.height as f64);
        for detection in &mut found {
            let Sides([left, top, right, bottom]) = detection.sides;
            detection.sides = Sides([left * width, top * height, right * width, bottom * height]);
        }
        Ok(found)
    }
}

/// The TOML files of a folder, by name.
///
/// # Errors
/// A folder that cannot be read.
pub fn descriptions(folder: &Path) -> Result<Vec<std::path::PathBuf>, NetworkError> {
    let mut files: Vec<_> = std::fs::read_dir(folder)
        .map_err(|problem| NetworkError::Read {
            file: folder.to_owned(),
            problem,
            mend: "give --networks the folder that scripts/fetch_networks made",
        })?
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "toml"))
        .collect();
    files.sort();
    Ok(files)
}

/// A map over a picture of this size, bilinear between its pixels.
fn spread(map: &Grid<f32>, width: usize, height: usize) -> Likelihood {
    let share = |x: usize, of: usize| (x as f64 + 0.5) / of as f64;
    Grid::from_fn(width, height, |column, row| {
        let likely = between(map, share(column, width), share(row, height));
        (255.0 * likely).round().clamp(0.0, 255.0) as u8
    })
}

/// Bilinear; x and y are shares of the map's width and height.
fn between(map: &Grid<f32>, x: f64, y: f64) -> f32 {
    let (width, height) = map.size();
    let (x, y) = (x * width as f64 - 0.5, y * height as f64 - 0.5);
    let (left, top) = (x.floor(), y.floor());
    let (right_share, down_share) = ((x - left) as f32, (y - top) as f32);
    let clamped = |x: f64, size: usize| x.clamp(0.0, size as f64 - 1.0) as usize;
    let value = |dx: f64, dy: f64| map[(clamped(left + dx, width), clamped(top + dy, height))];
    let row = |dy| value(0.0, dy) * (1.0 - right_share) + value(1.0, dy) * right_share;
    row(0.0) * (1.0 - down_share) + row(1.0) * down_share
}

/// The first output of one channel: \[1, 1, h, w\], values in \[0, 1\].
fn saliency(outputs: &[Tensor]) -> Result<Grid<f32>, String> {
    let map = outputs.iter().find_map(|output| match output.shape[..] {
        [1, 1, height, width] => Grid::from_vec(width, height, output.values.clone()),
        _ => None,
    });
    let map = map.ok_or("it has no output of shape 1 × 1 × height × width, as saliency networks have")?;
    if map.data().iter().any(|p| !(-1e-3..=1.001).contains(p)) {
        return Err("its output is not within 0 and 1".into());
    }
    Ok(map)
}

/// An output of shape \[1, `channels`, h, w\] with finite values.
fn planes(outputs: &[Tensor], channels: usize) -> Result<(&[f32], usize, usize), String> {
    let found = outputs.iter().find_map(|output| match output.shape[..] {
        [1, planes, height, width] if planes == channels && width > 0 && height > 0 => {
            Some((&output.values[..], width, height))
        }
        _ => None,
    });
    let found = found.ok_or_else(|| format!("it has no output of shape 1 × {channels} × height × width"))?;
    if found.0.iter().any(|x| !x.is_finite()) {
        return Err("its output is not finite".into());
    }
    Ok(found)
}

/// One class's share of the softmax over all.
fn share_of_class(outputs: &[Tensor], classes: usize, class: usize) -> Result<Grid<f32>, String> {
    let (values, width, height) = planes(outputs, classes)?;
    let pixels = width * height;
    Ok(Grid::from_fn(width, height, |column, row| {
        let score = |class: usize| values[class * pixels + row * width + column];
        let all: f32 = (0..classes)
            .map(|other| (score(other) - score(class)).exp())
            .sum();
        1.0 / all
    }))
}

/// Detections below this score are none.
const MIN_SCORE: f64 = 0.1;
/// Of two boxes that overlap by more, the better one stays.
const SAME: f64 = 0.45;

/// FastestDet's: per cell how likely an object is, the tanh of its centre's offset in cells, the logits of its size in pictures, and
/// the classes' shares. Sides as shares of the picture.
fn detections(outputs: &[Tensor], classes: usize, class: usize) -> Result<Vec<Detection>, String> {
    let (values, width, height) = planes(outputs, 5 + classes)?;
    let mut found: Vec<Detection> = Vec::new();
    for cell in 0..width * height {
        let value = |plane: usize| f64::from(values[plane * width * height + cell]);
        let score = value(0).max(0.0).powf(0.6) * value(5 + class).max(0.0).powf(0.4);
        if score < MIN_SCORE {
            continue;
        }
        let x = ((cell % width) as f64 + value(1).tanh()) / width as f64;
        let y = ((cell / width) as f64 + value(2).tanh()) / height as f64;
        let half = |plane| 0.5 / (1.0 + (-value(plane)).exp());
        let (across, down) = (half(3), half(4));
        found.push(Detection {
            sides: Sides([x - across, y - down, x + across, y + down]),
            score,
        });
    }
    found.sort_by(|a, b| b.score.total_cmp(&a.score));
    let mut kept: Vec<Detection> = Vec::new();
    for detection in found {
        if kept
            .iter()
            .all(|better| better.sides.overlap(&detection.sides) <= SAME)
        {
            kept.push(detection);
        }
    }
    Ok(kept)
}

#[cfg(test)]
mod tests {
    use super::super::tiny;
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
        assert_eq!(between(&found, 0.25, 0.25), 0.0);
        assert_eq!(between(&found, 0.5, 0.25), 0.125);
        assert_eq!(between(&found, 0.5, 0.5), 0.375);
        assert_eq!(between(&found, 1.0, 1.0), 0.75);
        assert!(saliency(&[tensor(&[1, 2, 2, 2], |_| 0.5)]).is_err());
        assert!(saliency(&[tensor(&[1, 1, 2, 2], |_| 7.0)]).is_err());
        assert!(saliency(&[tensor(&[1, 1, 2, 2], |_| f32::NAN)]).is_err());
    }

    #[test]
    fn a_class_has_its_share_of_all() {
        let scores = [tensor(&[1, 2, 1, 2], |i| [0.0, 100.0, 3f32.ln(), 0.0][i])];
        let shares = share_of_class(&scores, 2, 1).unwrap();
        assert!((shares[(0, 0)] - 0.75).abs() < 1e-6);
        assert_eq!(shares[(1, 0)], 0.0);
        assert!(share_of_class(&scores, 3, 1).is_err());
        assert!(share_of_class(&[tensor(&[1, 2, 1, 1], |_| f32::NAN)], 2, 1).is_err());
    }

    #[test]
    fn a_detection_is_read_from_its_cell_and_doubles_are_dropped() {
        // Two classes on 2 × 2 cells; the two cells on the right see the same car, that at the bottom better.
        let planes: [[f32; 4]; 7] = [
            [0.0, 0.8, 0.0, 1.0],
            [0.0; 4],
            [0.0, 0.5f32.atanh(), 0.0, (-0.5f32).atanh()],
            [0.0; 4],
            [0.0; 4],
            [0.9; 4],
            [0.0, 0.5, 0.0, 1.0],
        ];
        let outputs = [tensor(&[1, 7, 2, 2], |i| planes[i / 4][i % 4])];
        let found = detections(&outputs, 2, 1).unwrap();
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].score, 1.0);
        let expected = [0.25, 0.0, 0.75, 0.5];
        for (side, expected) in found[0].sides.0.iter().zip(expected) {
            assert!((side - expected).abs() < 1e-6, "{found:?}");
        }
        assert!(detections(&outputs, 80, 2).is_err());
    }

    #[test]
    fn a_folder_lacks_nothing_and_has_nothing_twice() {
        let folder = tempfile::tempdir().unwrap();
        let refused = |category: Option<&str>, message: &str| {
            let said = Networks::read(folder.path(), category).err().unwrap().to_string();
            assert!(said.contains(message), "{said}");
        };
        refused(None, "no saliency network");
        refused(None, "scripts/fetch_networks");
        tiny::redness(folder.path());
        assert!(
            Networks::read(folder.path(), Some("car"))
                .unwrap()
                .know_category()
        );
        assert!(!Networks::read(folder.path(), None).unwrap().know_category());
        refused(Some("boat"), "knows no boat, but person, car");
        for end in ["onnx", "toml"] {
            let file = |name: &str| folder.path().join(name).with_extension(end);
            std::fs::copy(file("detector"), file("other")).unwrap();
        }
        refused(None, "a second detections network");
        for end in ["onnx", "toml"] {
            for name in ["detector", "other"] {
                std::fs::remove_file(folder.path().join(name).with_extension(end)).unwrap();
            }
        }
        refused(Some("car"), "no detections network");
        let nowhere = Networks::read(&folder.path().join("nowhere"), None)
            .err()
            .unwrap();
        assert!(
            nowhere.to_string().contains("nowhere: cannot be read"),
            "{nowhere}"
        );
    }
}
