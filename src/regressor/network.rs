//! The network's forward pass, in matrix products.

use super::crop::{CHANNELS, Crop, SIDE_PX};
use nalgebra::{DMatrix, DVector};

/// y = W x + b, a row of W per output.
#[derive(Clone, Debug, PartialEq)]
pub struct Dense {
    pub weight: DMatrix<f32>,
    pub bias: DVector<f32>,
}

/// 3 × 3, stride 2, a border of one zero. A row of the weight per output channel, whose columns run over input channels,
/// then rows, then columns.
#[derive(Clone, Debug, PartialEq)]
pub struct Conv(pub Dense);

/// Convolutions with ReLU, a dense layer with tanh, a gated recurrent unit, a dense layer.
#[derive(Clone, Debug, PartialEq)]
pub struct Network {
    /// The convolutions, from the crop on.
    pub convolutions: Vec<Conv>,
    /// The layer after the convolutions, whose output is the frame's feature.
    pub feature: Dense,
    /// The layer from the frame's feature to the gates: update, reset and new state, one below the other.
    pub from_feature: Dense,
    /// The layer from the state to the gates, likewise.
    pub from_state: Dense,
    /// The layer from the last state to the style.
    pub style: Dense,
}

impl Dense {
    fn apply(&self, x: &DVector<f32>) -> DVector<f32> {
        &self.weight * x + &self.bias
    }
}

/// Side of a square plane after a convolution.
pub(super) fn halved(side: usize) -> usize {
    side.div_ceil(2)
}

impl Conv {
    /// `planes`: a row per channel, `side`² columns; the result likewise with half the side.
    fn apply(&self, planes: &DMatrix<f32>, side: usize) -> DMatrix<f32> {
        let out = halved(side);
        let patches = DMatrix::from_fn(9 * planes.nrows(), out * out, |row, column| {
            let (channel, tap) = (row / 9, row % 9);
            let at = |cell: usize, tap: usize| (2 * cell + tap).checked_sub(1).filter(|&at| at < side);
            match (at(column / out, tap / 3), at(column % out, tap % 3)) {
                (Some(r), Some(c)) => planes[(channel, r * side + c)],
                _ => 0.0,
            }
        });
        let mut planes = &self.0.weight * patches;
        for mut column in planes.column_iter_mut() {
            column += &self.0.bias;
            column.apply(|value| *value = value.max(0.0));
        }
        planes
    }
}

fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + (-x).exp())
}

impl Network {
    /// The style after all frames, in their order.
    pub fn style(&self, frames: &[Crop]) -> Vec<f32> {
        let size = self.from_state.weight.ncols();
        let mut state = DVector::zeros(size);
        for frame in frames {
            let (new, old) = (
                self.from_feature.apply(&self.feature(frame)),
                self.from_state.apply(&state),
            );
            state = DVector::from_fn(size, |i, _| {
                let update = sigmoid(new[i] + old[i]);
                let reset = sigmoid(new[size + i] + old[size + i]);
                let fresh = (new[2 * size + i] + reset * old[2 * size + i]).tanh();
                update * state[i] + (1.0 - update) * fresh
            });
        }
        self.style.apply(&state).as_slice().to_vec()
    }

    fn feature(&self, frame: &Crop) -> DVector<f32> {
        let mut side = SIDE_PX;
        let mut planes = DMatrix::from_row_slice(CHANNELS, side * side, &frame.0);
        for convolution in &self.convolutions {
            planes = convolution.apply(&planes, side);
            side = halved(side);
        }
        // Channel after channel.
        let flat = DVector::from_column_slice(planes.transpose().as_slice());
        self.feature.apply(&flat).map(f32::tanh)
    }

    /// What does not fit together, if anything; `styles` is S.
    pub(super) fn check(&self, styles: usize) -> Result<(), String> {
        let mut side = SIDE_PX;
        let mut channels = CHANNELS;
        for (k, Conv(layer)) in self.convolutions.iter().enumerate() {
            check_layer(&format!("convolutions.{k}"), layer, 9 * channels, None)?;
            side = halved(side);
            channels = layer.weight.nrows();
        }
        check_layer("feature", &self.feature, channels * side * side, None)?;
        let size = self.from_state.weight.ncols();
        check_layer(
            "from_feature",
            &self.from_feature,
            self.feature.weight.nrows(),
            Some(3 * size),
        )?;
        check_layer("from_state", &self.from_state, size, Some(3 * size))?;
        check_layer("style", &self.style, size, Some(styles))
    }
}

fn check_layer(name: &str, layer: &Dense, inputs: usize, outputs: Option<usize>) -> Result<(), String> {
    let (rows, columns) = layer.weight.shape();
    if columns != inputs || outputs.is_some_and(|outputs| rows != outputs) || layer.bias.len() != rows {
        let expected = outputs.map_or("any number of".to_owned(), |outputs| outputs.to_string());
        return Err(format!(
            "`{name}` has {rows} × {columns} weights and {} biases; {expected} × {inputs} fit",
            layer.bias.len()
        ));
    }
    if layer.weight.iter().chain(&layer.bias).any(|x| !x.is_finite()) {
        return Err(format!("`{name}` holds a number that is not finite"));
    }
    Ok(())
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Two convolutions, a feature of 5, a state of 3 and 2 styles.
    pub(crate) fn small() -> Network {
        let dense = |outputs: usize, inputs: usize, seed: usize| Dense {
            weight: DMatrix::from_fn(outputs, inputs, |r, c| {
                ((r * 31 + c * 17 + seed) % 13) as f32 / 26.0 - 0.23
            }),
            bias: DVector::from_fn(outputs, |r, _| ((r * 7 + seed) % 5) as f32 / 5.0 - 0.3),
        };
        let side = halved(halved(SIDE_PX));
        Network {
            convolutions: vec![Conv(dense(3, 9 * CHANNELS, 0)), Conv(dense(2, 27, 5))],
            feature: dense(5, 2 * side * side, 1),
            from_feature: dense(9, 5, 2),
            from_state: dense(9, 3, 3),
            style: dense(2, 3, 4),
        }
    }

    pub(crate) fn crop(seed: usize) -> Crop {
        Crop(
            (0..CHANNELS * SIDE_PX * SIDE_PX)
                .map(|i| ((i * 13 + seed) % 29) as f32 / 29.0)
                .collect(),
        )
    }

    #[test]
    fn a_convolution_by_hand() {
        // 1 channel of 3 × 3, an output that adds the cell's left neighbour twice and the cell.
        let mut weight = DMatrix::zeros(1, 9);
        weight[(0, 3)] = 2.0;
        weight[(0, 4)] = 1.0;
        let conv = Conv(Dense {
            weight,
            bias: DVector::from_element(1, -10.0),
        });
        let planes = DMatrix::from_row_slice(1, 9, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]);
        // Cells (0, 0), (0, 2), (2, 0), (2, 2).
        assert_eq!(conv.apply(&planes, 3).as_slice(), [0.0, 0.0, 0.0, 15.0]);
    }

    #[test]
    fn order_and_number_of_frames_count() {
        let network = small();
        network.check(2).unwrap();
        let [a, b] = [1, 2].map(crop);
        let one = network.style(std::slice::from_ref(&a));
        assert_ne!(one, network.style(&[a.clone(), b.clone()]));
        assert_ne!(network.style(&[b.clone(), a.clone()]), network.style(&[a, b]));
    }

    #[test]
    fn a_state_that_is_always_updated_is_kept() {
        let mut network = small();
        network.from_feature.bias.rows_mut(0, 3).fill(100.0);
        assert_eq!(network.style(&[crop(1)]), network.style.bias.as_slice());
    }

    #[test]
    fn layers_that_do_not_fit_are_named() {
        assert!(small().check(3).unwrap_err().contains("`style` has 2 × 3"));
        let mut network = small();
        network.convolutions.pop();
        assert!(network.check(2).unwrap_err().contains("`feature`"));
        let mut network = small();
        network.from_state.weight[(1, 1)] = f32::NAN;
        assert!(network.check(2).unwrap_err().contains("not finite"));
    }
}
