//! How a surface and its canonical frame move with the shape's coordinates.

use super::surface::{SurfacePrior, canonical_frame};
use crate::geometry::Similarity;
use nalgebra::{DMatrix, DVector, Vector3};
use rayon::prelude::*;

type V3 = Vector3<f64>;

/// The derivative by one of a shape's coordinates of a similarity that does not turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameDerivative {
    /// The change of the scale.
    pub scale: f64,
    /// The change of the translation, object units.
    pub translation: V3,
}

impl SurfacePrior {
    /// The derivative of [`Self::canonical_from_shape`] by each of (s, g): differences over one deviation of the prior, on the mesh as it is.
    /// `None` where the shape has no size.
    pub fn canonical_by_shape(&self, style: &[f64], form: &[f64]) -> Option<Vec<FrameDerivative>> {
        let faces = self.mesh().faces();
        let vertices = self.vertices(style, form);
        let exact = self.canonical_from_shape(style, form)?;
        let here = canonical_frame(&vertices, &faces)?;
        let centre = |frame: &Similarity| -frame.translation / frame.scale;
        let by_shape = self.by_shape(form.len());
        (0..by_shape.ncols())
            .into_par_iter()
            .map(|k| {
                let column = by_shape.column(k);
                let moved = vertices
                    .iter()
                    .zip(column.as_slice().chunks_exact(3))
                    .map(|(v, by)| v + V3::from_column_slice(by));
                let there = canonical_frame(&moved.collect::<Vec<V3>>(), &faces)?;
                let scale = exact.scale * (there.scale / here.scale - 1.0);
                let shift = centre(&there) - centre(&here);
                Some(FrameDerivative {
                    scale,
                    translation: -(exact.scale * shift + scale * centre(&exact)),
                })
            })
            .collect()
    }

    /// Root mean square distances of the whole's vertices in the canonical frame from where they are, of shapes whose (s, g) have the covariance
    /// C Cᵀ about these: object diagonals. `frame` is what [`Self::canonical_by_shape`] says here. `None` where the shape has no size, or C or
    /// `frame` not as many rows as (s, g).
    pub fn vertex_deviations(
        &self,
        style: &[f64],
        form: &[f64],
        c: &DMatrix<f64>,
        frame: &[FrameDerivative],
    ) -> Option<Vec<f64>> {
        let canonical = self.canonical_from_shape(style, form)?;
        if c.nrows() != style.len() + form.len() || frame.len() != c.nrows() {
            return None;
        }
        let mut by_shape = self.by_shape(form.len()) * canonical.scale;
        let vertices = self.vertices(style, form);
        for (mut column, by) in by_shape.column_iter_mut().zip(frame) {
            for (moved, vertex) in column.as_mut_slice().chunks_exact_mut(3).zip(&vertices) {
                let also = by.scale * vertex + by.translation;
                moved.iter_mut().zip(&also).for_each(|(x, y)| *x += y);
            }
        }
        let spread = by_shape * c;
        let squares: Vec<f64> = spread.row_iter().map(|row| row.norm_squared()).collect();
        Some(
            squares
                .chunks_exact(3)
                .map(|xyz| xyz.iter().sum::<f64>().sqrt())
                .collect(),
        )
    }

    /// The derivative of [`Self::vertices`]: x, y, z vertex after vertex by each of (s, g), g having `form_len` coordinates.
    fn by_shape(&self, form_len: usize) -> DMatrix<f64> {
        let whole = |style: &[f64], form: &[f64]| -> Vec<f64> {
            self.vertices(style, form)
                .iter()
                .flat_map(|v| <[f64; 3]>::from(*v))
                .collect()
        };
        let mean = DVector::from_vec(whole(&[], &[]));
        let mut by_shape = DMatrix::zeros(mean.len(), self.style_len() + form_len);
        for (k, mut column) in by_shape.column_iter_mut().enumerate() {
            let unit = |len: usize, at: Option<usize>| -> Vec<f64> {
                (0..len).map(|i| f64::from(u8::from(Some(i) == at))).collect()
            };
            let (style, form) = (Some(k), k.checked_sub(self.style_len()));
            let moved = whole(&unit(self.style_len(), style), &unit(form_len, form));
            column.copy_from_slice(&moved);
            column -= &mean;
        }
        by_shape
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prior::mesh::tests::half_octahedron;
    use crate::prior::{FieldModes, SurfacePoint};

    #[test]
    fn what_moves_the_canonical_frame_along_is_no_deviation() {
        let (mesh, mean) = half_octahedron();
        let moving = |by: &dyn Fn(&V3) -> V3| -> Vec<f64> {
            let field = FieldModes {
                even: DMatrix::zeros(5, 0),
                odd: DMatrix::zeros(5, 0),
            };
            let point = SurfacePoint {
                face: 0,
                weights: [0.25, 0.5],
            };
            let components = mean.iter().map(by).collect();
            let prior = SurfacePrior::new(mesh.clone(), mean.clone(), components, field, 0.5, vec![point]);
            let prior = prior.unwrap();
            let frame = prior.canonical_by_shape(&[0.0], &[]).unwrap();
            let deviation = DMatrix::from_element(1, 1, 2.0);
            let found = prior.vertex_deviations(&[0.0], &[], &deviation, &frame).unwrap();
            assert!(
                prior
                    .vertex_deviations(&[0.0], &[0.0], &deviation, &frame)
                    .is_none()
            );
            found
        };
        let most = |of: Vec<f64>| of.into_iter().fold(0.0, f64::max);
        assert!(most(moving(&|v| v * 1e-4)) < 1e-7);
        assert!(most(moving(&|_| V3::new(0.0, 3e-4, 1e-4))) < 1e-12);
        // A stretch along one axis alone makes the others shorter.
        let stretched = moving(&|v| V3::new(0.0, 1e-3 * v.y, 0.0));
        assert!(stretched.iter().all(|&x| x > 1e-5) && most(stretched) < 2e-3);
    }
}
