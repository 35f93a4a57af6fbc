//! Training networks: Adam with a falling rate, checkpoints and their resumption. Only with the feature `training`.

mod checkpoint;

use burn::module::{Module, Param};
use burn::nn::{Linear, LinearConfig};
use burn::optim::{AdamConfig, GradientsParams};
use burn::tensor::{Device, Tensor, TensorData};
use checkpoint::Checkpoint;
use nalgebra::{DMatrix, DVector};
use std::path::{Path, PathBuf};

/// How long to train, how fast, and where the state is kept.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The number of steps in all.
    pub steps: usize,
    /// Adam's rate at the first and at the last step; geometric between.
    pub learning_rate: [f64; 2],
    /// The file that holds the state of an unfinished training, if any; gone once training ends.
    pub checkpoint: Option<PathBuf>,
    /// What the state depends on, in words: a checkpoint of anything else is refused.
    pub of: String,
}

/// The number of steps between checkpoints.
const KEEP_EVERY: usize = 500;
/// Steps between looks at the loss.
const SEE_EVERY: usize = 25;

/// Why training ended without a network; each message is one line.
#[derive(Debug, thiserror::Error)]
pub enum TrainingError {
    /// The caller stopped training, and its state was kept.
    #[error("interrupted at step {step}; its state is in {}: the same command with --resume goes on", path.display())]
    Interrupted {
        /// The checkpoint.
        path: PathBuf,
        /// The next step.
        step: usize,
    },
    /// The caller stopped training, and no checkpoint was asked for. The field is the step.
    #[error("interrupted at step {0}")]
    InterruptedForGood(usize),
    /// The loss is infinite or not a number. The field is the step.
    #[error("the loss at step {0} is no number: lower the learning rate")]
    NotFinite(usize),
    /// A checkpoint cannot be read or written.
    #[error("{}: {reason}", path.display())]
    Checkpoint {
        /// The checkpoint.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
}

/// Trains `model`: `loss` is what a step descends, given its number, from which it must draw all that is random, so that a
/// resumed training ends like one that was never interrupted. `see` gets a step's number and its loss, and returns false to stop.
///
/// Goes on from the plan's checkpoint where there is one.
pub fn train<M: Module>(
    mut model: M,
    plan: &Plan,
    mut loss: impl FnMut(&M, usize) -> Tensor<1>,
    see: &mut dyn FnMut(usize, f64) -> bool,
) -> Result<M, TrainingError> {
    let mut adam = AdamConfig::new().init();
    let mut first = 0;
    if let Some(path) = plan.checkpoint.as_deref().filter(|path| path.exists()) {
        let found = Checkpoint::read(path, &plan.of)?;
        (model, adam) = found.load(path, model, adam)?;
        first = found.step;
    }
    let keep = |model: &M, adam: &_, step: usize| match &plan.checkpoint {
        Some(path) => Checkpoint::new(path, model, adam, step)?.write(path, &plan.of),
        None => Ok(()),
    };
    for step in first..plan.steps {
        if step > first && step % KEEP_EVERY == 0 {
            keep(&model, &adam, step)?;
        }
        let value = loss(&model, step);
        if step % SEE_EVERY == 0 {
            let seen = f64::from(value.clone().into_scalar::<f32>());
            if !seen.is_finite() {
                return Err(TrainingError::NotFinite(step));
            }
            if !see(step, seen) {
                keep(&model, &adam, step)?;
                return Err(match &plan.checkpoint {
                    Some(path) => TrainingError::Interrupted {
                        path: path.clone(),
                        step,
                    },
                    None => TrainingError::InterruptedForGood(step),
                });
            }
        }
        let gradients = GradientsParams::from_grads(value.backward(), &model);
        let [start, end] = plan.learning_rate;
        let rate = start * (end / start).powf(step as f64 / plan.steps as f64);
        model = adam.step(rate, model, gradients);
    }
    if let Some(path) = plan.checkpoint.as_deref().filter(|path| path.exists()) {
        std::fs::remove_file(path).map_err(|error| failed(path, &error))?;
    }
    Ok(model)
}

fn failed(path: &Path, reason: &impl ToString) -> TrainingError {
    TrainingError::Checkpoint {
        path: path.to_owned(),
        reason: reason.to_string(),
    }
}

/// A layer with `weight` (a row per input, as burn has it), and with a bias of zeros if wanted.
pub(crate) fn linear(
    inputs: usize,
    outputs: usize,
    bias: bool,
    device: &Device,
    weight: impl FnMut(usize, usize) -> f64,
) -> Linear {
    let mut layer = LinearConfig::new(inputs, outputs).with_bias(bias).init(device);
    layer.weight = Param::from_tensor(tensor(&DMatrix::from_fn(inputs, outputs, weight), device));
    if bias {
        layer.bias = Some(Param::from_tensor(Tensor::zeros([outputs], device)));
    }
    layer
}

/// A matrix on the device.
pub(crate) fn tensor(matrix: &DMatrix<f64>, device: &Device) -> Tensor<2> {
    let values: Vec<f32> = matrix.transpose().iter().map(|&x| x as f32).collect();
    Tensor::from_data(TensorData::new(values, [matrix.nrows(), matrix.ncols()]), device)
}

/// A tensor's numbers, row after row.
pub(crate) fn numbers<const D: usize>(tensor: Tensor<D>) -> Vec<f64> {
    tensor.into_data().iter::<f32>().map(f64::from).collect()
}

/// A layer's weight as y = W x has it, a row per output.
pub(crate) fn weight(layer: &Linear) -> DMatrix<f64> {
    let [inputs, outputs] = layer.weight.dims();
    DMatrix::from_column_slice(outputs, inputs, &numbers(layer.weight.val()))
}

/// A layer's bias; empty where it has none.
pub(crate) fn bias(layer: &Linear) -> DVector<f64> {
    DVector::from_vec(
        layer
            .bias
            .as_ref()
            .map_or_else(Vec::new, |bias| numbers(bias.val())),
    )
}

#[cfg(test)]
mod tests;
