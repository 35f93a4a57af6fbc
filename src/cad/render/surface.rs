//! The colour of a point on a triangle.

use super::super::{Mesh, Texture, Triangle};
use super::fragment::Hit;
use super::light::ObjectLight;
use nalgebra::{Vector2, Vector3};

/// Less opaque than this is a hole; the rest is drawn opaque, tinted windows too, so that depth, mask and colour
/// belong to one surface.
pub(in crate::cad) const HOLE: f32 = 0.1;
/// Grey level of a triangle without a material.
pub(in crate::cad) const UNPAINTED: f32 = 204.0;

/// Whether the surface is left out at this point of the triangle.
pub(in crate::cad) fn is_hole(mesh: &Mesh, triangle: &Triangle, weights: &Vector3<f64>) -> bool {
    let Some(material) = mesh.materials.get(triangle.material as usize) else {
        return false;
    };
    if material.opacity < HOLE {
        return true;
    }
    let Some(texture) = &material.texture else {
        return false;
    };
    let Some(alpha) = &texture.alpha else { return false };
    let taps = taps(texture, &coordinates(triangle, weights));
    let mean: f32 = taps.iter().map(|&(i, weight)| alpha[i] * weight).sum();
    material.opacity * mean < HOLE
}

/// RGB in \[0, 255\]. `normals` are the triangle's corner normals, `eye` the camera's centre, object frame.
pub(super) fn colour(
    mesh: &Mesh,
    normals: &[Vector3<f64>; 3],
    hit: &Hit,
    light: &ObjectLight,
    eye: &Vector3<f64>,
) -> [f32; 3] {
    let triangle = &mesh.triangles[hit.triangle];
    let base = match mesh.materials.get(triangle.material as usize) {
        None => [UNPAINTED; 3],
        Some(material) => {
            let tint = material.diffuse;
            match &material.texture {
                None => tint.map(|value| 255.0 * value),
                Some(texture) => {
                    let taps = taps(texture, &coordinates(triangle, &hit.weights));
                    let pixels = texture.image.data();
                    std::array::from_fn(|c| {
                        tint[c] * taps.iter().map(|&(i, weight)| pixels[i][c] * weight).sum::<f32>()
                    })
                }
            }
        }
    };
    let [a, b, c] = triangle.vertices.map(|i| mesh.vertices[i as usize]);
    // All corner normals lie on one side of the face, so the face decides which side is seen.
    let towards_eye = (b - a).cross(&(c - a)).dot(&(eye - a)).signum();
    let blended: Vector3<f64> = (0..3).map(|i| normals[i] * hit.weights[i]).sum();
    let normal = blended.try_normalize(0.0).unwrap_or_default() * towards_eye;
    let intensity = light.intensity(&normal) as f32;
    base.map(|value| (value * intensity).min(255.0))
}

fn coordinates(triangle: &Triangle, weights: &Vector3<f64>) -> Vector2<f64> {
    (0..3)
        .map(|i| Vector2::from(triangle.texture_coordinates[i].map(f64::from)) * weights[i])
        .sum()
}

/// Bilinear: four pixels (index, weight). Texture coordinates have v up and repeat; rows go down.
fn taps(texture: &Texture, uv: &Vector2<f64>) -> [(usize, f32); 4] {
    let (width, height) = texture.image.size();
    let x = uv.x * width as f64 - 0.5;
    let y = (1.0 - uv.y) * height as f64 - 0.5;
    let wrap = |value: f64, size: usize| value.rem_euclid(size as f64) as usize % size;
    let (left, top) = (wrap(x.floor(), width), wrap(y.floor(), height));
    let (right, bottom) = ((left + 1) % width, (top + 1) % height);
    let (fx, fy) = ((x - x.floor()) as f32, (y - y.floor()) as f32);
    [
        (top * width + left, (1.0 - fx) * (1.0 - fy)),
        (top * width + right, fx * (1.0 - fy)),
        (bottom * width + left, (1.0 - fx) * fy),
        (bottom * width + right, fx * fy),
    ]
}
