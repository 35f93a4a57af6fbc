//! A prior as files hold it: hidden layers, none for a linear prior, and a linear output layer, so that X and ∂X/∂s are a
//! few matrix products.

use super::deviations::FrameDerivative;
use super::linear::InvalidPrior;
use super::surface::{FreeForm, SurfacePrior};
use super::{AxisStyles, LinearPrior, ShapePrior};
use crate::geometry::Similarity;
use crate::surface::Mesh;
#[cfg(feature = "cad")]
use crate::surface::spacing;
use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut, DVector, Vector3};
use std::sync::Arc;

/// A hidden layer: y = tanh(W x + b), W with a row per output.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// W: outputs × inputs.
    pub weight: DMatrix<f64>,
    /// b, one entry per output.
    pub bias: DVector<f64>,
}

/// X(s) = output(s, h(s)), h(s) being the last hidden layer; X(s) = output(s) where there is none.
#[derive(Clone, Debug, PartialEq)]
pub struct LearnedPrior {
    style_len: usize,
    hidden: Vec<Layer>,
    output: LinearPrior,
    surface: Option<Arc<SurfacePrior>>,
}

impl From<LinearPrior> for LearnedPrior {
    fn from(output: LinearPrior) -> Self {
        Self {
            style_len: output.style_len(),
            hidden: Vec::new(),
            output,
            surface: None,
        }
    }
}

impl LearnedPrior {
    /// `hidden` layers from a style of `style_len` entries; the "style" of `output` is (s, h(s)).
    pub fn new(style_len: usize, hidden: Vec<Layer>, output: LinearPrior) -> Result<Self, InvalidPrior> {
        let mut width = style_len;
        for layer in &hidden {
            for (what, found, expected) in [
                ("a row of a hidden layer's weight", layer.weight.ncols(), width),
                ("a hidden layer's bias", layer.bias.len(), layer.weight.nrows()),
            ] {
                if found != expected {
                    return Err(InvalidPrior::Length {
                        what,
                        found,
                        expected,
                    });
                }
            }
            let mut numbers = layer.weight.iter().chain(&layer.bias);
            if let Some(index) = numbers.position(|x| !x.is_finite()) {
                let what = "a hidden layer";
                return Err(InvalidPrior::NotFinite { what, index });
            }
            width = layer.weight.nrows();
        }
        let expected = if hidden.is_empty() {
            style_len
        } else {
            style_len + width
        };
        if output.style_len() != expected {
            return Err(InvalidPrior::Length {
                what: "a row of the output layer",
                found: output.style_len(),
                expected,
            });
        }
        Ok(Self {
            style_len,
            hidden,
            output,
            surface: None,
        })
    }

    /// The points of a prior of surfaces, moved by its style.
    pub fn of_surface(surface: SurfacePrior) -> Result<Self, InvalidPrior> {
        let points = surface.at_points(2 * surface.half_points().len(), FreeForm::None)?;
        Ok(Self {
            surface: Some(Arc::new(surface)),
            ..Self::from(points)
        })
    }

    /// The surface that the points lie on, where the prior has one.
    pub fn surface(&self) -> Option<&SurfacePrior> {
        self.surface.as_deref()
    }

    /// The hidden layers, from the style on; empty for a prior without a network.
    pub fn hidden(&self) -> &[Layer] {
        &self.hidden
    }

    /// The last layer, which is linear in its input: the style, followed by the last hidden layer's outputs.
    pub fn output(&self) -> &LinearPrior {
        &self.output
    }

    /// X(s) of all N points.
    pub fn shape(&self, style: &[f64]) -> Vec<Vector3<f64>> {
        let mut points = vec![0.0; 3 * self.point_count()];
        self.points(style, &mut points);
        points.chunks_exact(3).map(Vector3::from_column_slice).collect()
    }

    /// N outward unit normals of the mean shape.
    pub fn normals(&self) -> &[[f32; 3]] {
        self.output.normals()
    }

    /// How far apart the first `point_count` points of X(0) lie: the median distance to the nearest other point, object
    /// units. 0 below two points.
    #[cfg(feature = "cad")]
    pub fn sample_spacing(&self, point_count: usize) -> f64 {
        let mut points = self.shape(&vec![0.0; self.style_len]);
        points.truncate(point_count);
        spacing(&points)
    }

    /// What the output layer takes, (s, h(s)), and the derivative of h by s; without hidden layers, s and nothing.
    fn features(&self, style: &[f64]) -> (Vec<f64>, DMatrix<f64>) {
        let mut features = style.to_vec();
        if self.hidden.is_empty() {
            return (features, DMatrix::zeros(0, self.style_len));
        }
        let mut value = DVector::from_column_slice(style);
        let mut by_style = DMatrix::identity(self.style_len, self.style_len);
        for Layer { weight, bias } in &self.hidden {
            value = (weight * value + bias).map(f64::tanh);
            by_style = weight * by_style;
            for (mut row, y) in by_style.row_iter_mut().zip(&value) {
                row *= 1.0 - y * y;
            }
        }
        features.extend(&value);
        (features, by_style)
    }
}

/// So many points go along with a free form: its derivative is many times as long as the style's.
const FREED_POINTS: usize = 16384;

impl ShapePrior for LearnedPrior {
    fn style_len(&self) -> usize {
        self.style_len
    }

    fn point_count(&self) -> usize {
        self.output.point_count()
    }

    fn points(&self, style: &[f64], points: &mut [f64]) {
        self.output.points(&self.features(style).0, points);
    }

    fn constant_jacobian(&self) -> Option<&[f64]> {
        self.hidden.is_empty().then(|| self.output.basis())
    }

    fn mesh(&self, style: &[f64]) -> Option<Mesh> {
        self.surface().map(|surface| surface.whole(style, &[]))
    }

    fn canonical_from_shape(&self, style: &[f64], free_form: &[f64]) -> Option<Similarity> {
        self.surface()?.canonical_from_shape(style, free_form)
    }

    fn canonical_by_shape(&self, style: &[f64], free_form: &[f64]) -> Option<Vec<FrameDerivative>> {
        self.surface()?.canonical_by_shape(style, free_form)
    }

    fn form_len(&self, form: FreeForm) -> usize {
        self.surface().map_or(0, |surface| surface.form_len(form))
    }

    fn freed(&self, form: FreeForm) -> Result<Option<Arc<dyn ShapePrior>>, InvalidPrior> {
        let Some(surface) = self.surface.clone().filter(|_| self.form_len(form) > 0) else {
            return Ok(None);
        };
        let points = surface.at_points(FREED_POINTS.min(self.point_count()), form)?;
        Ok(Some(Arc::new(Freed { points, surface })))
    }

    fn jacobian(&self, style: &[f64], jacobian: &mut [f64]) {
        if self.hidden.is_empty() {
            self.output.jacobian(style, jacobian);
            return;
        }
        let hidden_by_style = self.features(style).1;
        let rows = jacobian.len() / self.style_len.max(1);
        let width = self.output.style_len();
        // Both row-major: as nalgebra's column-major matrices they are transposes, (AB)ᵀ = Bᵀ Aᵀ.
        let basis = DMatrixView::from_slice(&self.output.basis()[..rows * width], width, rows);
        let mut jacobian = DMatrixViewMut::from_slice(jacobian, self.style_len, rows);
        jacobian.copy_from(&basis.rows(0, self.style_len));
        let of_hidden = basis.rows(self.style_len, width - self.style_len);
        jacobian.gemm_tr(1.0, &hidden_by_style, &of_hidden, 1.0);
    }
}

/// A prior of surfaces with a free form: its style is (s, g).
struct Freed {
    points: LinearPrior,
    surface: Arc<SurfacePrior>,
}

impl ShapePrior for Freed {
    fn style_len(&self) -> usize {
        self.points.style_len()
    }

    fn point_count(&self) -> usize {
        self.points.point_count()
    }

    fn points(&self, style: &[f64], points: &mut [f64]) {
        self.points.points(style, points);
    }

    fn jacobian(&self, style: &[f64], jacobian: &mut [f64]) {
        self.points.jacobian(style, jacobian);
    }

    fn constant_jacobian(&self) -> Option<&[f64]> {
        self.points.constant_jacobian()
    }

    fn mesh(&self, style: &[f64]) -> Option<Mesh> {
        let (style, form) = style.split_at(self.surface.style_len());
        Some(self.surface.whole(style, form))
    }

    fn axis_styles(&self) -> &[AxisStyles] {
        self.points.axis_styles()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Two styles, a hidden layer of three and one of two, two mirrored pairs of points.
    pub(crate) fn small_decoder() -> LearnedPrior {
        let number = |i: usize| f64::from((i * 37 % 17) as u8) / 8.0 - 1.0;
        let layer = |rows, columns, offset| Layer {
            weight: DMatrix::from_fn(rows, columns, |r, c| number(offset + r * columns + c)),
            bias: DVector::from_fn(rows, |r, _| number(offset + 50 + r)),
        };
        let mean = vec![
            0.4375, -0.25, 0.125, -0.4375, -0.25, 0.125, 0.4375, 0.25, -0.125, -0.4375, 0.25, -0.125,
        ];
        let features = 4;
        let mut basis: Vec<f64> = (0..12 * features).map(number).collect();
        for pair in basis.chunks_exact_mut(6 * features) {
            let (even, odd) = pair.split_at_mut(3 * features);
            odd.copy_from_slice(even);
            odd[..features].iter_mut().for_each(|x| *x = -*x);
        }
        let output = LinearPrior::new(mean, basis, features, vec![[0.0, 0.0, -1.0]; 4]).unwrap();
        LearnedPrior::new(2, vec![layer(3, 2, 0), layer(2, 3, 9)], output).unwrap()
    }

    proptest! {
        #[test]
        fn the_jacobian_is_the_derivative(a in -2.0..2.0f64, b in -2.0..2.0f64, count in 1..5usize) {
            let prior = small_decoder();
            let at = |style: &[f64]| {
                let mut points = vec![0.0; 3 * count];
                prior.points(style, &mut points);
                points
            };
            let mut jacobian = vec![0.0; 6 * count];
            prior.jacobian(&[a, b], &mut jacobian);
            const STEP: f64 = 1e-5;
            for k in 0..2 {
                let moved = |sign: f64| {
                    let mut style = [a, b];
                    style[k] += sign * STEP;
                    at(&style)
                };
                for (i, (high, low)) in moved(1.0).iter().zip(moved(-1.0)).enumerate() {
                    // Central differences err by STEP² and by rounding over STEP, both about 1e-10.
                    prop_assert!(((high - low) / (2.0 * STEP) - jacobian[2 * i + k]).abs() < 1e-8);
                }
            }
        }
    }

    #[test]
    fn a_known_answer() {
        let layer = Layer {
            weight: DMatrix::from_row_slice(1, 2, &[1.0, -1.0]),
            bias: DVector::from_element(1, 0.5),
        };
        let basis = vec![1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 3.0];
        let output = LinearPrior::new(vec![0.0, 0.0, 1.0], basis, 3, vec![[0.0, 1.0, 0.0]]).unwrap();
        let prior = LearnedPrior::new(2, vec![layer], output).unwrap();
        let shape = prior.shape(&[0.25, 0.75]);
        assert_eq!(
            shape,
            [Vector3::new(0.25, 1.5, 1.0)],
            "tanh(0.25 − 0.75 + 0.5) is 0"
        );
        let mut jacobian = [0.0; 6];
        prior.jacobian(&[0.25, 0.75], &mut jacobian);
        assert_eq!(jacobian, [1.0, 0.0, 0.0, 2.0, 3.0, -3.0], "tanh' there is 1");
    }

    #[test]
    fn without_hidden_layers_it_is_its_output_layer() {
        let output = small_decoder().output;
        let prior = LearnedPrior::from(output.clone());
        let style = [0.3, -1.0, 0.5, 2.0];
        let (mut a, mut b) = (vec![0.0; 48], vec![0.0; 48]);
        prior.jacobian(&style, &mut a);
        output.jacobian(&style, &mut b);
        assert_eq!(a, b);
        prior.points(&style, &mut a[..12]);
        output.points(&style, &mut b[..12]);
        assert_eq!(a, b);
    }

    #[test]
    fn layers_that_do_not_fit_are_refused() {
        let LearnedPrior { hidden, output, .. } = small_decoder();
        let refused = |styles, hidden, output: &LinearPrior| {
            let refused = LearnedPrior::new(styles, hidden, output.clone());
            refused.unwrap_err().to_string()
        };
        assert!(refused(3, hidden.clone(), &output).contains("weight holds 2 numbers, 3 expected"));
        assert!(refused(2, hidden[..1].to_vec(), &output).contains("output layer holds 4 numbers, 5"));
        let mut broken = hidden.clone();
        broken[1].bias = DVector::zeros(3);
        assert!(refused(2, broken, &output).contains("bias holds 3 numbers, 2"));
        let mut broken = hidden;
        broken[0].weight[(2, 1)] = f64::NAN;
        assert!(refused(2, broken, &output).contains("not finite"));
    }

    #[test]
    #[cfg(feature = "cad")]
    fn spacing_is_the_grid_s() {
        let mean = vec![0.5, 0.0, 0.0, -0.5, 0.0, 0.0, 0.5, 0.5, 0.0, -0.5, 0.5, 0.0];
        let grid = LinearPrior::new(mean, vec![], 0, vec![[0.0, 0.0, -1.0]; 4]).unwrap();
        let grid = LearnedPrior::from(grid);
        assert!((grid.sample_spacing(2) - 1.0).abs() < 1e-6);
        assert!((grid.sample_spacing(4) - 0.5).abs() < 1e-6);
        assert_eq!(grid.sample_spacing(1), 0.0);
    }
}
