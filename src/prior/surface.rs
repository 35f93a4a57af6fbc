//! A prior of closed surfaces: vertices(s, g) = mean + Σ s_k component_k + Σ g_k mode_k, s and g i.i.d. standard normal. The
//! components (style) are what models have in common; the modes (free form) are a smooth random field for what they have not.

use super::AxisStyles;
use super::field::FieldModes;
use super::linear::{InvalidPrior, LinearPrior};
use super::mesh::{MirroredMesh, body_box, subdivided};
use crate::geometry::{BODY_BEYOND, Rotation3, Similarity, mirror};
use crate::surface::Mesh;
use nalgebra::Vector3;

type V3 = Vector3<f64>;

/// A shape of less is none.
const MIN_DIAGONAL: f64 = 1e-3;

/// Which modes of the free form there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FreeForm {
    /// The shape is the style's alone.
    None,
    /// The modes that keep the shape symmetric.
    Symmetric,
    /// The symmetric modes and as many asymmetric ones.
    Any,
}

/// A place on the half-mesh that goes along with it: a face, and the weights of its corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// An index into the half-mesh's faces.
    pub face: u32,
    /// Of the second and the third corner; the first has the rest.
    pub weights: [f32; 2],
}

/// See the module. Everything is given on the half x ≥ 0 of a mirror-symmetric mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfacePrior {
    mesh: MirroredMesh,
    style_len: usize,
    mean: Vec<V3>,
    /// Component after component, a vector a vertex.
    components: Vec<V3>,
    field: FieldModes,
    asymmetry: f64,
    points: Vec<SurfacePoint>,
}

/// What one coordinate of the free form does: a scalar mode along an axis.
#[derive(Clone, Copy)]
struct FormMode {
    mode: usize,
    axis: usize,
    symmetric: bool,
}

impl SurfacePrior {
    /// `mean` holds the half's vertices; `components` style after style as many vectors. `asymmetry` is the amplitude of asymmetric
    /// modes in units of the symmetric ones'. `points` is in farthest-point order.
    pub fn new(
        mesh: MirroredMesh,
        mean: Vec<V3>,
        components: Vec<V3>,
        field: FieldModes,
        asymmetry: f64,
        points: Vec<SurfacePoint>,
    ) -> Result<Self, InvalidPrior> {
        let vertices = mesh.half_len();
        if vertices == 0 || points.is_empty() {
            return Err(InvalidPrior::Empty);
        }
        let style_len = components.len() / vertices;
        for (what, found, expected) in [
            ("the mean", mean.len(), vertices),
            ("the components", components.len(), style_len * vertices),
            ("the field's even modes", field.even.nrows(), vertices),
            ("the field's odd modes", field.odd.nrows(), vertices),
        ] {
            if found != expected {
                return Err(InvalidPrior::Length {
                    what,
                    found,
                    expected,
                });
            }
        }
        let faces = mesh.half_faces().len();
        if let Some(index) = points.iter().position(|p| p.face as usize >= faces) {
            return Err(InvalidPrior::NoFace { index, faces });
        }
        Ok(Self {
            mesh,
            style_len,
            mean,
            components,
            field,
            asymmetry,
            points,
        })
    }

    /// The same mesh and points on another mean, without style or free form.
    pub fn moved_to(&self, mean: Vec<V3>) -> Result<Self, InvalidPrior> {
        let none = FieldModes {
            even: nalgebra::DMatrix::zeros(mean.len(), 0),
            odd: nalgebra::DMatrix::zeros(mean.len(), 0),
        };
        Self::new(
            self.mesh.clone(),
            mean,
            Vec::new(),
            none,
            self.asymmetry,
            self.points.clone(),
        )
    }

    /// With the points of `other`, a prior on the same mesh.
    pub fn with_points_of(self, other: &Self) -> Self {
        Self {
            points: other.points.clone(),
            ..self
        }
    }

    /// The faces and the seam of the mesh.
    pub fn mesh(&self) -> &MirroredMesh {
        &self.mesh
    }

    /// The mean shape's half.
    pub fn mean(&self) -> &[V3] {
        &self.mean
    }

    /// Component after component, the half's vertices each.
    pub fn components(&self) -> &[V3] {
        &self.components
    }

    /// The scalar modes of the free form at the half's vertices.
    pub fn field(&self) -> &FieldModes {
        &self.field
    }

    /// The amplitude of asymmetric modes in units of the symmetric ones'.
    pub fn asymmetry(&self) -> f64 {
        self.asymmetry
    }

    /// The points of the half that sums over the surface go over, in farthest-point order; their mirror images go with them.
    pub fn half_points(&self) -> &[SurfacePoint] {
        &self.points
    }

    /// The number of style entries S.
    pub fn style_len(&self) -> usize {
        self.style_len
    }

    /// The number of the free form's coordinates.
    pub fn form_len(&self, form: FreeForm) -> usize {
        self.form_modes(form).len()
    }

    /// The whole's vertices, in the order of [`MirroredMesh::whole`]. `form` has the coordinates of [`FreeForm::Any`], or only the first
    /// so many of them.
    pub fn vertices(&self, style: &[f64], form: &[f64]) -> Vec<V3> {
        let half_len = self.mean.len();
        let mut symmetric = self.mean.clone();
        let components = self.components.chunks_exact(half_len).zip(style);
        for (component, amount) in components.filter(|(_, amount)| **amount != 0.0) {
            symmetric
                .iter_mut()
                .zip(component)
                .for_each(|(v, c)| *v += c * *amount);
        }
        let mut asymmetric = vec![V3::zeros(); half_len];
        let modes = self.form_modes(FreeForm::Any).into_iter().zip(form);
        for (mode, amount) in modes.filter(|(_, amount)| **amount != 0.0) {
            let moved = if mode.symmetric {
                &mut symmetric
            } else {
                &mut asymmetric
            };
            for (vertex, moved) in moved.iter_mut().enumerate() {
                moved[mode.axis] += amount * self.value(mode, vertex);
            }
        }
        let others = (0..half_len).filter(|&v| !self.mesh.on_seam(v));
        let others: Vec<V3> = others.map(|v| mirror(&(symmetric[v] - asymmetric[v]))).collect();
        symmetric
            .iter()
            .zip(&asymmetric)
            .map(|(s, a)| s + a)
            .chain(others)
            .collect()
    }

    /// [`SurfacePrior::vertices`] and the faces between them.
    pub fn whole(&self, style: &[f64], form: &[f64]) -> Mesh {
        Mesh {
            vertices: self.vertices(style, form),
            faces: self.mesh.faces(),
        }
    }

    /// From the frame of (s, g)'s vertices to the canonical one: theirs is where likelihood puts the shape, the canonical one is that of
    /// its own body's box, centred and of diagonal 1. `None` where the shape has no size.
    pub fn canonical_from_shape(&self, style: &[f64], form: &[f64]) -> Option<Similarity> {
        let (vertices, faces) = subdivided(&self.vertices(style, form), &self.mesh.faces());
        canonical_frame(&vertices, &faces)
    }

    /// The first `count` points (even: each is followed by its mirror image) as a linear prior, its style being (s, g).
    pub fn at_points(&self, count: usize, form: FreeForm) -> Result<LinearPrior, InvalidPrior> {
        let modes = self.form_modes(form);
        let columns = self.style_len + modes.len();
        let normals = self.mesh.half_normals(&self.mean);
        let half_len = self.mean.len();
        let points = &self.points[..self.points.len().min(count / 2)];
        let mut mean = Vec::with_capacity(6 * points.len());
        let mut basis = vec![0.0; 6 * points.len() * columns];
        let mut point_normals = Vec::with_capacity(2 * points.len());
        for (index, point) in points.iter().enumerate() {
            let rows = &mut basis[index * 6 * columns..(index + 1) * 6 * columns];
            let corners = self.corners(point);
            let at = |values: &[V3]| -> V3 { corners.iter().map(|&(v, w)| values[v] * w).sum() };
            let place = at(&self.mean);
            mean.extend(
                <[f64; 3]>::from(place)
                    .into_iter()
                    .chain(<[f64; 3]>::from(mirror(&place))),
            );
            let normal = at(&normals).try_normalize(1e-12).unwrap_or(V3::y());
            point_normals.extend([normal, mirror(&normal)].map(|n| [n.x as f32, n.y as f32, n.z as f32]));
            for (k, component) in self.components.chunks_exact(half_len).enumerate() {
                let moved = at(component);
                for axis in 0..3 {
                    rows[axis * columns + k] = moved[axis];
                    rows[(3 + axis) * columns + k] = if axis == 0 { -moved[0] } else { moved[axis] };
                }
            }
            for (k, &mode) in modes.iter().enumerate() {
                let moved: f64 = corners.iter().map(|&(v, w)| self.value(mode, v) * w).sum();
                let flips = (mode.axis == 0) == mode.symmetric;
                rows[mode.axis * columns + self.style_len + k] = moved;
                rows[(3 + mode.axis) * columns + self.style_len + k] = if flips { -moved } else { moved };
            }
        }
        let along = modes.chunk_by(|a, b| a.axis == b.axis).map(|run| AxisStyles {
            axis: run[0].axis,
            count: run.len(),
        });
        let prior = LinearPrior::new(mean, basis, columns, point_normals)?;
        Ok(prior.with_axis_styles(along.collect()))
    }

    /// The corners of a point's face and their weights.
    fn corners(&self, point: &SurfacePoint) -> [(usize, f64); 3] {
        corners(&self.mesh, point)
    }

    fn form_modes(&self, form: FreeForm) -> Vec<FormMode> {
        let parities: &[bool] = match form {
            FreeForm::None => &[],
            FreeForm::Symmetric => &[true],
            FreeForm::Any => &[true, false],
        };
        let mut modes = Vec::new();
        for &symmetric in parities {
            for axis in 0..3 {
                let along = 0..self.modes_along(axis, symmetric).ncols();
                modes.extend(along.map(|mode| FormMode {
                    mode,
                    axis,
                    symmetric,
                }));
            }
        }
        modes
    }

    fn modes_along(&self, axis: usize, symmetric: bool) -> &nalgebra::DMatrix<f64> {
        if (axis == 0) == symmetric {
            &self.field.odd
        } else {
            &self.field.even
        }
    }

    fn value(&self, mode: FormMode, vertex: usize) -> f64 {
        let amplitude = if mode.symmetric { 1.0 } else { self.asymmetry };
        amplitude * self.modes_along(mode.axis, mode.symmetric)[(vertex, mode.mode)]
    }
}

/// The corners of a point's face and their weights.
pub(super) fn corners(mesh: &MirroredMesh, point: &SurfacePoint) -> [(usize, f64); 3] {
    let [a, b, c] = mesh.half_faces()[point.face as usize].map(|v| v as usize);
    let [second, third] = point.weights.map(f64::from);
    [(a, 1.0 - second - third), (b, second), (c, third)]
}

/// The frame in which the body's box is centred in height and length and has diagonal 1, from that of the vertices; `None` where there is no such box.
pub(super) fn canonical_frame(vertices: &[V3], faces: &[[u32; 3]]) -> Option<Similarity> {
    let (low, high) = body_box(vertices, faces, BODY_BEYOND)?;
    let diagonal = (high - low).norm();
    let centre = (low + high) / 2.0;
    (diagonal.is_finite() && diagonal > MIN_DIAGONAL).then(|| Similarity {
        scale: 1.0 / diagonal,
        rotation: Rotation3::identity(),
        // Symmetric in x = 0 but for an asymmetric form.
        translation: -V3::new(0.0, centre.y, centre.z) / diagonal,
    })
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::prior::mesh::tests::half_octahedron;
    use crate::prior::{LearnedPrior, ShapePrior};
    use nalgebra::DMatrix;

    /// An octahedron that one style stretches along y, with two even modes and an odd one.
    pub(crate) fn octahedron() -> SurfacePrior {
        let (mesh, mean) = half_octahedron();
        let components = mean.iter().map(|v| V3::new(0.0, 0.25 * v.y, 0.0)).collect();
        let field = FieldModes {
            even: DMatrix::from_fn(5, 2, |v, k| f64::from((v + 3 * k) as u8) / 64.0),
            odd: DMatrix::from_fn(5, 1, |v, _| if v == 0 { 0.125 } else { 0.0 }),
        };
        let points = (0..4).map(|face| SurfacePoint {
            face,
            weights: [0.25, 0.5],
        });
        SurfacePrior::new(mesh, mean, components, field, 0.5, points.collect()).unwrap()
    }

    #[test]
    fn points_lie_on_the_surface() {
        let prior = octahedron();
        let (style, form) = ([0.7], [0.3, -0.4, 0.2, 0.9, -1.1, 0.6, 0.5, -0.2, 0.8]);
        assert_eq!(prior.form_len(FreeForm::Any), 9);
        let vertices = prior.vertices(&style, &form);
        let linear = LearnedPrior::from(prior.at_points(8, FreeForm::Any).unwrap());
        let points = linear.shape(&[&style[..], &form].concat());
        let faces = prior.mesh().faces();
        for (i, point) in prior.half_points().iter().enumerate() {
            let of = |face: [u32; 3], weights: [f64; 3]| -> V3 {
                face.iter()
                    .zip(weights)
                    .map(|(&v, w)| vertices[v as usize] * w)
                    .sum()
            };
            let expected = of(faces[point.face as usize], [0.25, 0.25, 0.5]);
            assert!((points[2 * i] - expected).norm() < 1e-12);
            // The mirror image's corners run the other way.
            let expected = of(faces[4 + point.face as usize], [0.5, 0.25, 0.25]);
            assert!(
                (points[2 * i + 1] - expected).norm() < 1e-12,
                "{} {expected}",
                points[2 * i + 1]
            );
        }
    }

    #[test]
    fn the_canonical_frame_is_that_of_the_shape_s_own_box() {
        let prior = octahedron();
        let canonical = prior.canonical_from_shape(&[1.5], &[]).unwrap();
        let moved: Vec<V3> = prior
            .vertices(&[1.5], &[])
            .iter()
            .map(|v| canonical.transform(v))
            .collect();
        let (moved, faces) = subdivided(&moved, &prior.mesh().faces());
        let (low, high) = body_box(&moved, &faces, BODY_BEYOND).unwrap();
        assert!(((high - low).norm() - 1.0).abs() < 1e-12);
        assert!((low + high).norm() < 1e-9);
        let flat = prior.moved_to(vec![V3::x(); 5]).unwrap();
        assert!(flat.canonical_from_shape(&[], &[]).is_none());
    }

    #[test]
    fn modes_along_axes_are_told() {
        let linear = octahedron().at_points(8, FreeForm::Any).unwrap();
        let told: Vec<_> = linear
            .axis_styles()
            .iter()
            .map(|run| (run.axis, run.count))
            .collect();
        // One odd mode, two even ones; asymmetric ones have them the other way round.
        assert_eq!(told, [(0, 1), (1, 2), (2, 2), (0, 2), (1, 1), (2, 1)]);
        let styles = (0..3).flat_map(|axis| linear.basis()[axis * 10..][..10].to_vec());
        let moved: Vec<f64> = styles.collect();
        let axis_of = [3, 0, 1, 1, 2, 2, 0, 0, 1, 2];
        for (axis, row) in moved.chunks_exact(10).enumerate() {
            for (k, &amount) in row.iter().enumerate().skip(1) {
                assert!(
                    axis_of[k] == axis || amount == 0.0,
                    "style {k} along {axis}: {amount}"
                );
            }
        }
        // What is left out of a sum is zero.
        let style: Vec<f64> = (0..10).map(|k| f64::from(k) / 8.0 - 0.5).collect();
        let mut points = [0.0; 24];
        linear.points(&style, &mut points);
        for (row, point) in points.iter().enumerate() {
            let all: f64 = linear.basis()[row * 10..][..10]
                .iter()
                .zip(&style)
                .map(|(b, s)| b * s)
                .sum();
            assert!((linear.mean()[row] + all - point).abs() < 1e-12, "row {row}");
        }
    }

    #[test]
    fn without_style_there_is_the_mean() {
        let prior = octahedron().moved_to(half_octahedron().1).unwrap();
        let linear = prior.at_points(8, FreeForm::None).unwrap();
        assert_eq!((linear.point_count(), linear.style_len()), (8, 0));
    }

    #[test]
    fn symmetric_forms_keep_the_shape_symmetric() {
        let prior = octahedron();
        let linear = LearnedPrior::from(prior.at_points(8, FreeForm::Symmetric).unwrap());
        assert_eq!(linear.style_len(), 1 + 5);
        let points = linear.shape(&[0.5, 1.0, -2.0, 0.3, 0.7, 1.5]);
        for pair in points.chunks_exact(2) {
            assert!((mirror(&pair[0]) - pair[1]).norm() < 1e-12);
        }
    }
}
