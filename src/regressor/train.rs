//! Training the network.

use super::crop::{CHANNELS, SIDE_PX};
use super::examples::Examples;
use super::network::{Conv, Dense, Network, halved};
use crate::prior::{LearnedPrior, ShapePrior};
use crate::training::{self, Plan, TrainingError, bias, linear, weight};
use burn::module::Module;
use burn::nn::Linear;
use burn::tensor::activation::sigmoid;
use burn::tensor::module::conv2d;
use burn::tensor::ops::ConvOptions;
use burn::tensor::{Device, Tensor, TensorData};
use nalgebra::DVector;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Adam's rate at the first and the last step.
pub const REGRESSOR_RATE: [f64; 2] = [2e-3, 5e-5];
/// Channels after each convolution.
const WIDTHS: [usize; 4] = [16, 24, 32, 48];
/// Entries of a frame's feature and of the state.
const SIZE: usize = 128;
/// Sequences a step.
const BATCH: usize = 16;

#[derive(Module, Debug)]
struct Trained {
    convolutions: Vec<Linear>,
    feature: Linear,
    from_feature: Linear,
    from_state: Linear,
    style: Linear,
}

impl Trained {
    fn new(styles: usize, seed: u64, device: &Device) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        // Uniform, of variance `gain` / inputs.
        let mut layer = |inputs: usize, outputs: usize, gain: f64| {
            let most = (3.0 * gain / inputs as f64).sqrt();
            linear(inputs, outputs, true, device, |_, _| {
                random.random_range(-most..most)
            })
        };
        let (mut channels, mut side) = (CHANNELS, SIDE_PX);
        let convolutions = WIDTHS
            .iter()
            .map(|&width| {
                let convolution = layer(9 * channels, width, 2.0);
                (channels, side) = (width, halved(side));
                convolution
            })
            .collect();
        Self {
            convolutions,
            feature: layer(channels * side * side, SIZE, 1.0),
            from_feature: layer(SIZE, 3 * SIZE, 1.0),
            from_state: layer(SIZE, 3 * SIZE, 1.0),
            style: layer(SIZE, styles, 0.1),
        }
    }

    /// `frames`: \[sequences · frames, channels, side, side\], a sequence's frames one after the other. The style after each frame,
    /// \[sequences, S\].
    fn styles(&self, frames: Tensor<4>, sequences: usize) -> Vec<Tensor<2>> {
        let [all, ..] = frames.dims();
        let count = all / sequences;
        let mut planes = frames;
        for convolution in &self.convolutions {
            let [inputs, outputs] = convolution.weight.dims();
            let weight = convolution
                .weight
                .val()
                .transpose()
                .reshape([outputs, inputs / 9, 3, 3]);
            let bias = convolution.bias.as_ref().map(|bias| bias.val());
            let options = ConvOptions::new([2, 2], [1, 1], [1, 1], 1);
            planes = burn::tensor::activation::relu(conv2d(planes, weight, bias, options));
        }
        let new = self
            .from_feature
            .forward(self.feature.forward(planes.flatten::<2>(1, 3)).tanh());
        let new = new.reshape([sequences, count, 3 * SIZE]);
        let mut state = Tensor::<2>::zeros([sequences, SIZE], &new.device());
        (0..count)
            .map(|frame| {
                let new = new
                    .clone()
                    .slice([0..sequences, frame..frame + 1])
                    .reshape([sequences, 3 * SIZE]);
                let old = self.from_state.forward(state.clone());
                let part = |whole: &Tensor<2>, k: usize| {
                    whole.clone().slice([0..sequences, k * SIZE..(k + 1) * SIZE])
                };
                let update = sigmoid(part(&new, 0) + part(&old, 0));
                let reset = sigmoid(part(&new, 1) + part(&old, 1));
                let fresh = (part(&new, 2) + reset * part(&old, 2)).tanh();
                state = update.clone() * state.clone() + (-update + 1.0) * fresh;
                self.style.forward(state.clone())
            })
            .collect()
    }

    fn network(&self) -> Network {
        let dense = |layer: &Linear| Dense {
            weight: weight(layer).map(|x| x as f32),
            bias: bias(layer).map(|x| x as f32),
        };
        Network {
            convolutions: self.convolutions.iter().map(|layer| Conv(dense(layer))).collect(),
            feature: dense(&self.feature),
            from_feature: dense(&self.from_feature),
            from_state: dense(&self.from_state),
            style: dense(&self.style),
        }
    }
}

/// Trains a network on `examples`. A step's loss, which `see` gets, is the mean squared distance between the points of the
/// style that it finds and the shown one, as a share of that between the mean shape's and the shown one's; `see` returns
/// false to stop. `mirrored` says that the prior is mirror-symmetric, so that crops may be mirrored, too.
pub fn train(
    prior: &LearnedPrior,
    mirrored: bool,
    examples: &Examples,
    seed: u64,
    plan: &Plan,
    see: &mut dyn FnMut(usize, f64) -> bool,
) -> Result<Network, TrainingError> {
    let device = Device::flex().autodiff();
    let styles = prior.style_len();
    let weights = style_weights(prior);
    let expected: f64 = (0..examples.len())
        .map(|k| {
            examples
                .style(k)
                .iter()
                .zip(&weights)
                .map(|(s, w)| w * s * s)
                .sum::<f64>()
        })
        .sum::<f64>()
        / examples.len().max(1) as f64;
    let weights: Vec<f32> = weights.iter().map(|w| (w / expected) as f32).collect();
    let weights = Tensor::<2>::from_data(TensorData::new(weights, [1, styles]), &device);
    let frames = examples.frame_count();
    let loss = |model: &Trained, step: usize| {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(1 + step as u64);
        let (mut crops, mut shown) = (Vec::new(), Vec::new());
        for _ in 0..BATCH {
            let sequence = random.random_range(0..examples.len());
            let (mirror, backwards, light) = (
                mirrored && random.random(),
                random.random(),
                random.random_range(0.8..1.2),
            );
            for frame in 0..frames {
                let frame = if backwards { frames - 1 - frame } else { frame };
                push(&mut crops, examples.crop(sequence, frame), mirror, light);
            }
            shown.extend(examples.style(sequence).iter().map(|&s| s as f32));
        }
        let crops = TensorData::new(crops, [BATCH * frames, CHANNELS, SIDE_PX, SIDE_PX]);
        let shown = Tensor::<2>::from_data(TensorData::new(shown, [BATCH, styles]), &device);
        let found = model.styles(Tensor::<4>::from_data(crops, &device), BATCH);
        let off = found.into_iter().map(|found| {
            let off = found - shown.clone();
            (off.square() * weights.clone()).sum_dim(1).mean()
        });
        off.reduce(|sum, off| sum + off)
            .map_or_else(|| Tensor::zeros([1], &device), |sum| sum / frames as f32)
    };
    let trained = training::train(Trained::new(styles, seed, &device), plan, loss, see)?;
    Ok(trained.network())
}

/// A crop, perhaps mirrored (the mirrored object has the same style), its colours `light` times as bright.
fn push(crops: &mut Vec<f32>, crop: impl Iterator<Item = f32>, mirrored: bool, light: f32) {
    let start = crops.len();
    crops.extend(crop);
    let crop = &mut crops[start..];
    if mirrored {
        crop.chunks_exact_mut(SIDE_PX).for_each(<[f32]>::reverse);
    }
    crop[..(CHANNELS - 1) * SIDE_PX * SIDE_PX]
        .iter_mut()
        .for_each(|value| *value *= light);
}

/// How far, squared, one unit of each style entry moves the mean shape's points.
fn style_weights(prior: &LearnedPrior) -> Vec<f64> {
    let styles = prior.style_len();
    let mut jacobian = vec![0.0; 3 * prior.point_count() * styles];
    prior.jacobian(&vec![0.0; styles], &mut jacobian);
    let mut sums = DVector::zeros(styles);
    for row in jacobian.chunks_exact(styles.max(1)) {
        for (sum, x) in sums.iter_mut().zip(row) {
            *sum += x * x / prior.point_count() as f64;
        }
    }
    sums.as_slice().to_vec()
}

#[cfg(test)]
mod tests {
    use super::super::crop::Crop;
    use super::super::examples::ExampleOptions;
    use super::*;
    use crate::prior;

    #[test]
    fn training_and_inference_are_one_network() {
        let device = Device::flex().autodiff();
        let trained = Trained::new(6, 3, &device);
        let crop = |seed: usize| {
            Crop(
                (0..CHANNELS * SIDE_PX * SIDE_PX)
                    .map(|i| ((i * 13 + seed) % 29) as f32 / 29.0)
                    .collect(),
            )
        };
        let frames = [1, 5, 9].map(crop);
        let data: Vec<f32> = frames.iter().flat_map(|crop| crop.0.clone()).collect();
        let data = Tensor::<4>::from_data(TensorData::new(data, [3, CHANNELS, SIDE_PX, SIDE_PX]), &device);
        let network = trained.network();
        network.check(6).unwrap();
        for (k, found) in trained.styles(data, 1).into_iter().enumerate() {
            let expected = network.style(&frames[..=k]);
            for (a, b) in training::numbers(found).into_iter().zip(expected) {
                assert!((a - f64::from(b)).abs() < 1e-4, "frame {k}: {a} {b}");
            }
        }
    }

    #[test]
    fn it_learns_to_tell_a_few_shapes_apart() {
        let prior = prior::find("car").unwrap();
        let options = ExampleOptions {
            sequences: 12,
            frames: 2,
            seed: 1,
        };
        let examples = Examples::render(&prior, &[], &options, &|| ());
        let plan = Plan {
            steps: 120,
            learning_rate: REGRESSOR_RATE,
            checkpoint: None,
            of: "a test".into(),
        };
        let mut losses = Vec::new();
        train(&prior, true, &examples, 0, &plan, &mut |_, loss| {
            losses.push(loss);
            true
        })
        .unwrap();
        assert!(
            (losses[0] - 1.0).abs() < 0.5 && losses[losses.len() - 1] < 0.5,
            "{losses:?}"
        );
    }
}
