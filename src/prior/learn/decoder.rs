//! Learning a decoder: an autoencoder over the principal coefficients of corresponded shapes. It starts as principal component
//! analysis and learns what that leaves out.

use super::LearnError;
use super::principal::{Components, components};
use crate::prior::{Layer, LearnedPrior, LinearPrior};
use crate::training::{Plan, bias, linear, numbers, tensor, train, weight};
use burn::module::Module;
use burn::nn::Linear;
use burn::tensor::{Device, Tensor};
use nalgebra::{DMatrix, DVector};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// Options of training a decoder.
#[derive(Clone, Debug)]
pub struct DecoderOptions {
    /// The number of style entries S.
    pub styles: usize,
    /// Outputs of each of the two hidden layers.
    pub width: usize,
    /// The seed of the starting weights and of the batches.
    pub seed: u64,
}

/// Adam's rate at the first and the last step.
pub const DECODER_RATE: [f64; 2] = [2e-3, 5e-5];
/// Principal coefficients that the network sees at most.
const COEFFICIENTS: usize = 96;
/// Components shorter than this, of the first one's length, are rounding.
const LEAST: f64 = 1e-5;
const BATCH: usize = 64;
/// Standard deviation of what training adds to a style: neighbouring styles must make like shapes.
const STYLE_NOISE: f64 = 0.1;

/// Both ways are straight + bent: the straight part starts as principal component analysis, the bent one as nothing.
#[derive(Module, Debug)]
struct Autoencoder {
    encode_straight: Linear,
    encode_hidden: Linear,
    encode_bent: Linear,
    decode_straight: Linear,
    decode_first: Linear,
    decode_second: Linear,
    decode_bent: Linear,
}

impl Autoencoder {
    /// `scale`: standard deviations of the coefficients, in those of the first.
    fn new(scale: &[f64], options: &DecoderOptions, device: &Device) -> Self {
        let (count, styles, width) = (scale.len(), options.styles, options.width);
        let mut random = ChaCha8Rng::seed_from_u64(options.seed);
        let mut any = |inputs, outputs| {
            let most = (inputs as f64).sqrt().recip();
            linear(inputs, outputs, true, device, |_, _| {
                random.random_range(-most..most)
            })
        };
        let diagonal = |i, j, value| if i == j { value } else { 0.0 };
        Self {
            encode_straight: linear(count, styles, true, device, |i, j| diagonal(i, j, 1.0 / scale[j])),
            encode_hidden: any(count, width),
            encode_bent: linear(width, styles, false, device, |_, _| 0.0),
            decode_straight: linear(styles, count, true, device, |i, j| diagonal(i, j, scale[j])),
            decode_first: any(styles, width),
            decode_second: any(width, width),
            decode_bent: linear(width, count, false, device, |_, _| 0.0),
        }
    }

    fn encode(&self, coefficients: Tensor<2>) -> Tensor<2> {
        let hidden = self.encode_hidden.forward(coefficients.clone()).tanh();
        self.encode_straight.forward(coefficients) + self.encode_bent.forward(hidden)
    }

    fn decode(&self, style: Tensor<2>) -> Tensor<2> {
        let first = self.decode_first.forward(style.clone()).tanh();
        let second = self.decode_second.forward(first).tanh();
        self.decode_straight.forward(style) + self.decode_bent.forward(second)
    }
}

/// A decoder of `shapes`, those to learn from, made ones included; `normals` are those of the mean shape. `see` gets a step's
/// number and the mean squared distance of its shapes' points, in squared standard deviations of the first component, and
/// returns false to stop.
pub fn decoder(
    shapes: &[Vec<f64>],
    normals: Vec<[f32; 3]>,
    options: &DecoderOptions,
    plan: &Plan,
    see: &mut dyn FnMut(usize, f64) -> bool,
) -> Result<LearnedPrior, LearnError> {
    for (option, value) in [("styles", options.styles), ("width", options.width)] {
        if value == 0 {
            return Err(LearnError::Option {
                option,
                value,
                range: "1 or more",
            });
        }
    }
    let mut found = components(shapes, &vec![1.0; shapes.len()], COEFFICIENTS);
    let length = |mode: &Vec<f64>| DVector::from_column_slice(mode).norm();
    let mut lengths: Vec<f64> = found.modes.iter().map(length).collect();
    let told = lengths
        .iter()
        .take_while(|&&length| length > LEAST * lengths[0])
        .count();
    lengths.truncate(told);
    found.modes.truncate(told);
    if options.styles > told {
        return Err(LearnError::TooManyStyles {
            styles: options.styles,
            possible: told,
        });
    }
    let scale: Vec<f64> = lengths.iter().map(|length| length / lengths[0]).collect();
    let coefficients = DMatrix::from_fn(shapes.len(), scale.len(), |shape, k| {
        let along = found.modes[k].iter().zip(&shapes[shape]).zip(&found.mean);
        along.map(|((b, x), m)| b * (x - m)).sum::<f64>() / (lengths[k] * lengths[0])
    });
    let device = Device::flex().autodiff();
    let loss = |model: &Autoencoder, step: usize| {
        let mut random = ChaCha8Rng::seed_from_u64(options.seed);
        random.set_stream(1 + step as u64);
        let batch = tensor(&mixed(&coefficients, &mut random), &device);
        let noise = DMatrix::from_fn(BATCH, options.styles, |_, _| {
            STYLE_NOISE * random.sample::<f64, _>(StandardNormal)
        });
        let off = model.decode(model.encode(batch.clone()) + tensor(&noise, &device)) - batch;
        off.square().sum_dim(1).mean()
    };
    let model = train(Autoencoder::new(&scale, options, &device), plan, loss, see)?;
    let reached = numbers(model.encode(tensor(&coefficients, &device)));
    let reached = DMatrix::from_row_slice(shapes.len(), options.styles, &reached);
    finish(&found, &scale, &model, &reached, normals)
}

/// A batch of coefficients, each up to half of the way from one shape to another.
fn mixed(coefficients: &DMatrix<f64>, random: &mut impl Rng) -> DMatrix<f64> {
    let mut batch = DMatrix::zeros(BATCH, coefficients.ncols());
    for mut row in batch.row_iter_mut() {
        let mut pick = || coefficients.row(random.random_range(0..coefficients.nrows()));
        let (from, to) = (pick(), pick());
        row.copy_from(&(from + (to - from) * random.random_range(0.0..0.5)));
    }
    batch
}

/// Whitens the styles that training reached (rows of `reached`), so that s ~ N(0, I), and writes coefficients as points.
fn finish(
    found: &Components,
    scale: &[f64],
    model: &Autoencoder,
    reached: &DMatrix<f64>,
    normals: Vec<[f32; 3]>,
) -> Result<LearnedPrior, LearnError> {
    let styles = reached.ncols();
    let mean = reached.row_mean().transpose();
    let mut centred = reached.clone();
    centred.row_iter_mut().for_each(|mut row| row -= mean.transpose());
    let covariance = centred.tr_mul(&centred) / (reached.nrows() as f64 - 1.0);
    // A style that training left unused spreads by nothing.
    let unused = DMatrix::identity(styles, styles) * 1e-9;
    let spread = (covariance + unused)
        .cholesky()
        .map(|c| c.l())
        .ok_or(LearnError::Collapsed)?;
    let hidden = vec![
        Layer {
            bias: bias(&model.decode_first) + weight(&model.decode_first) * &mean,
            weight: weight(&model.decode_first) * &spread,
        },
        Layer {
            weight: weight(&model.decode_second),
            bias: bias(&model.decode_second),
        },
    ];
    let straight = weight(&model.decode_straight);
    let offset = bias(&model.decode_straight) + &straight * &mean;
    let straight = straight * &spread;
    let bent = weight(&model.decode_bent);
    let features = styles + bent.ncols();
    // mode_k is as long as `scale` says, and coefficients count in the first one's length. In one order for every row, so that
    // mirrored points stay exactly mirrored.
    let mut points = found.mean.clone();
    let mut basis = vec![0.0; points.len() * features];
    for (k, mode) in found.modes.iter().enumerate() {
        let by_feature: Vec<f64> = straight
            .row(k)
            .iter()
            .chain(bent.row(k).iter())
            .map(|x| x / scale[k])
            .collect();
        for ((x, row), along) in points.iter_mut().zip(basis.chunks_exact_mut(features)).zip(mode) {
            *x += offset[k] / scale[k] * along;
            for (out, by) in row.iter_mut().zip(&by_feature) {
                *out += by * along;
            }
        }
    }
    Ok(LearnedPrior::new(
        styles,
        hidden,
        LinearPrior::new(points, basis, features, normals)?,
    )?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prior::ShapePrior;

    /// Mirrored pairs on a curve that a straight line fits badly: one parameter bends every point.
    fn bent() -> Vec<Vec<f64>> {
        (0..40)
            .map(|m| {
                let t = f64::from(m) / 20.0 - 1.0;
                (0..50)
                    .flat_map(|i| {
                        let place = f64::from(i) / 50.0;
                        let (x, y, z) = (0.3 + 0.1 * (3.0 * t).sin() * place, 0.2 * t, place + 0.1 * t * t);
                        [x, y, z, -x, y, z]
                    })
                    .collect()
            })
            .collect()
    }

    fn plan(checkpoint: Option<std::path::PathBuf>) -> Plan {
        Plan {
            steps: 1200,
            learning_rate: DECODER_RATE,
            checkpoint,
            of: "a curve".into(),
        }
    }

    fn error(prior: &LearnedPrior, shapes: &[Vec<f64>]) -> f64 {
        // By the best of many styles.
        let grid: Vec<Vec<f64>> = (-250..=250)
            .map(|k| {
                let mut points = vec![0.0; shapes[0].len()];
                prior.points(&[f64::from(k) / 100.0], &mut points);
                points
            })
            .collect();
        let off = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        let least = |shape: &Vec<f64>| {
            grid.iter()
                .map(|found| off(found, shape))
                .fold(f64::INFINITY, f64::min)
        };
        shapes.iter().map(least).sum::<f64>() / shapes.len() as f64
    }

    #[test]
    fn one_style_follows_a_curve_that_one_component_cannot() {
        let shapes = bent();
        let normals = vec![[0.0, 1.0, 0.0]; 100];
        let options = DecoderOptions {
            styles: 1,
            width: 16,
            seed: 3,
        };
        let mut losses = Vec::new();
        let learned = decoder(&shapes, normals.clone(), &options, &plan(None), &mut |_, loss| {
            losses.push(loss);
            true
        })
        .unwrap();
        let straight =
            LinearPrior::from_correspondences(&shapes, &vec![1.0; shapes.len()], normals.clone(), 1)
                .unwrap()
                .0;
        let (bent, straight) = (error(&learned, &shapes), error(&straight.into(), &shapes));
        assert!(bent < 0.5 * straight, "{bent} {straight} {losses:?}");
        for pair in learned.shape(&[0.7]).chunks_exact(2) {
            assert_eq!(
                pair[0].component_mul(&nalgebra::Vector3::new(-1.0, 1.0, 1.0)),
                pair[1]
            );
        }

        // Interrupted and resumed, it ends with the same bytes.
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state");
        let learn = |see: &mut dyn FnMut(usize, f64) -> bool| {
            decoder(&shapes, normals.clone(), &options, &plan(Some(path.clone())), see)
        };
        let interrupted = learn(&mut |step, _| step < 600).unwrap_err().to_string();
        assert!(
            interrupted.contains("step 600") && interrupted.contains("--resume"),
            "{interrupted}"
        );
        let mut first = None;
        let resumed = learn(&mut |step, _| {
            first.get_or_insert(step);
            true
        });
        assert_eq!(resumed.unwrap(), learned);
        assert_eq!(first, Some(600));
        assert!(!path.exists());
    }
}
