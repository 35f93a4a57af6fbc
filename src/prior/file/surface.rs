//! Schema 2: a prior of surfaces. With H vertices, F faces and P points on the half x ≥ 0: `mean` \[H, 3\] f32, `components`
//! \[S, H, 3\] f16, `faces` \[F, 3\] u32, `texture_coordinates` \[F, 3, 2\] f16 per corner, `field.even` and `field.odd` \[modes, H\] f16,
//! `points.face` \[P\] u32 and `points.weights` \[P, 2\] f32 of each face's second and third corner.
//!
//! Vertices on the boundary of the half have x = 0 and are their own mirror images; the whole is the half with the mirror images of
//! the others. Coordinates of the free form come three a mode k, along x, y and z: `field.odd`_k, `field.even`_k, `field.even`_k; then,
//! times the description's `asymmetry`, `field.even`_k, `field.odd`_k, `field.odd`_k.

use super::{InvalidPrior, LearnedPrior, PriorError, PriorInfo, Tensor, half, numbers, serialised, single};
use crate::prior::field::FieldModes;
use crate::prior::mesh::MirroredMesh;
use crate::prior::surface::{SurfacePoint, SurfacePrior};
use nalgebra::{DMatrix, Vector3};
use safetensors::SafeTensors;
use safetensors::tensor::Dtype;
use std::path::Path;

type V3 = Vector3<f64>;

pub(super) fn to_bytes(prior: &SurfacePrior, info: &PriorInfo) -> Result<Vec<u8>, PriorError> {
    let mesh = prior.mesh();
    let (vertices, faces) = (mesh.half_len(), mesh.half_faces().len());
    let points = prior.half_points();
    let coordinates = |vectors: &[V3]| {
        vectors
            .iter()
            .flat_map(|v| <[f64; 3]>::from(*v))
            .collect::<Vec<_>>()
    };
    let whole = |numbers: Vec<u32>| numbers.into_iter().flat_map(u32::to_le_bytes).collect();
    let uv = mesh.half_texture_coordinates().iter().flatten().flatten();
    let modes = |name: &str, modes: &DMatrix<f64>| -> Tensor {
        let shape = vec![modes.ncols(), vertices];
        (name.to_owned(), Dtype::F16, shape, half(modes.iter().copied()))
    };
    let named = |name: &str, dtype, shape, bytes| -> Tensor { (name.to_owned(), dtype, shape, bytes) };
    let tensors = [
        named(
            "mean",
            Dtype::F32,
            vec![vertices, 3],
            single(coordinates(prior.mean()).into_iter()),
        ),
        named(
            "components",
            Dtype::F16,
            vec![prior.style_len(), vertices, 3],
            half(coordinates(prior.components()).into_iter()),
        ),
        named(
            "faces",
            Dtype::U32,
            vec![faces, 3],
            whole(mesh.half_faces().iter().flatten().copied().collect()),
        ),
        named(
            "texture_coordinates",
            Dtype::F16,
            vec![faces, 3, 2],
            half(uv.map(|&x| f64::from(x))),
        ),
        modes("field.even", &prior.field().even),
        modes("field.odd", &prior.field().odd),
        named(
            "points.face",
            Dtype::U32,
            vec![points.len()],
            whole(points.iter().map(|p| p.face).collect()),
        ),
        named(
            "points.weights",
            Dtype::F32,
            vec![points.len(), 2],
            single(points.iter().flat_map(|p| p.weights).map(f64::from)),
        ),
    ];
    serialised(&tensors, info)
}

pub(super) fn parse(file: &SafeTensors, info: &PriorInfo, path: &Path) -> Result<LearnedPrior, PriorError> {
    let first_of = |name: &str| {
        file.tensor(name)
            .map_or(0, |view| view.shape().first().copied().unwrap_or(0))
    };
    let (vertices, faces, points) = (first_of("mean"), first_of("faces"), info.points / 2);
    let tensor = |name: &str, shape: &[usize], dtype| numbers(file, path, name, shape, dtype);
    let mean = vectors(&tensor("mean", &[vertices, 3], Dtype::F32)?);
    let components = vectors(&tensor("components", &[info.styles, vertices, 3], Dtype::F16)?);
    let corners = tensor("faces", &[faces, 3], Dtype::U32)?;
    let uv = tensor("texture_coordinates", &[faces, 3, 2], Dtype::F16)?;
    let modes = |name: &str| -> Result<DMatrix<f64>, PriorError> {
        let count = first_of(name);
        Ok(DMatrix::from_vec(
            vertices,
            count,
            tensor(name, &[count, vertices], Dtype::F16)?,
        ))
    };
    let field = FieldModes {
        even: modes("field.even")?,
        odd: modes("field.odd")?,
    };
    let face_of_point = tensor("points.face", &[points], Dtype::U32)?;
    let weights = tensor("points.weights", &[points, 2], Dtype::F32)?;
    let corners = corners
        .chunks_exact(3)
        .map(|f| [f[0] as u32, f[1] as u32, f[2] as u32]);
    let uv = uv
        .chunks_exact(6)
        .map(|c| [0, 2, 4].map(|k| [c[k] as f32, c[k + 1] as f32]));
    let points = face_of_point
        .iter()
        .zip(weights.chunks_exact(2))
        .map(|(face, w)| SurfacePoint {
            face: *face as u32,
            weights: [w[0] as f32, w[1] as f32],
        });
    let asymmetry = info.free_form.as_ref().map_or(0.0, |form| form.asymmetry);
    MirroredMesh::new(vertices, corners.collect(), uv.collect())
        .map_err(InvalidPrior::from)
        .and_then(|mesh| SurfacePrior::new(mesh, mean, components, field, asymmetry, points.collect()))
        .and_then(LearnedPrior::of_surface)
        .map_err(|problem| PriorError::Invalid {
            path: path.to_owned(),
            problem,
        })
}

fn vectors(numbers: &[f64]) -> Vec<V3> {
    numbers.chunks_exact(3).map(V3::from_column_slice).collect()
}

#[cfg(test)]
mod tests {
    use super::super::{FreeFormInfo, parse};
    use super::*;
    use crate::prior::surface::tests::octahedron;

    #[test]
    fn a_written_surface_is_read_back() {
        let prior = LearnedPrior::of_surface(octahedron()).unwrap();
        let info = PriorInfo {
            free_form: Some(FreeFormInfo {
                scales: Vec::new(),
                asymmetry: 0.5,
            }),
            ..PriorInfo::mirrored("car", &prior)
        };
        let bytes = to_bytes(&octahedron(), &info).unwrap();
        let (found, read) = parse(&bytes, Path::new("a")).unwrap();
        assert_eq!(found.surface(), Some(&octahedron()));
        assert_eq!((read.schema, read.points, read.styles), (2, 8, 1));
        let none = PriorInfo {
            free_form: None,
            ..info
        };
        let message = parse(&to_bytes(&octahedron(), &none).unwrap(), Path::new("a"))
            .unwrap_err()
            .to_string();
        assert!(message.contains("free form"), "{message}");
    }
}
