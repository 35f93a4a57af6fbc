//! The mesh's texture: what the frames show, texel by texel; where none shows it, what they show of its mirror image; else what its
//! neighbours have.

use super::colour::bilinear;
use super::surface::{UnwrappedMesh, ZBuffer};
use crate::geometry::{Pose, Vector3};
use crate::image::{Grid, Mask};
use crate::sequence::Frame;
use rayon::prelude::*;

/// Texels along each side.
const SIZE: usize = 1024;
/// Below this cosine between normal and line of sight a frame says nothing of a texel: what it shows there is smeared.
const MIN_COSINE: f64 = 0.15;
/// Frames count by this power of that cosine over the distance.
const SHARPNESS: i32 = 4;
/// The mask must hold the surroundings of a texel as wide as this, in pixels: at its edge the background shines through.
const CLEAR_OF_EDGE_PX: f64 = 1.5;
/// Rings of texels around the faces that get the nearest face's colour, for the sake of interpolation.
const GUTTER: usize = 4;
/// Rounds in which vertices without a colour take the mean of their neighbours.
const SPREADING_ROUNDS: usize = 300;

/// Where the colour of a texel comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Origin {
    Seen,
    /// The texel is seen at its mirror image alone.
    Mirrored,
    /// The colour of its neighbours.
    Filled,
    /// The texel lies on no face.
    Nothing,
}

/// An sRGB picture, its first row at the top, and where each of its texels comes from.
pub(super) struct Texture {
    pub colours: image::RgbImage,
    pub origins: Grid<Origin>,
}

impl Texture {
    /// Where texels come from, for people: seen green, mirrored yellow, filled red, black where there is no face.
    pub(super) fn origin_picture(&self) -> image::RgbImage {
        image::RgbImage::from_fn(SIZE as u32, SIZE as u32, |column, row| {
            image::Rgb(match self.origins[(column as usize, row as usize)] {
                Origin::Seen => [0, 160, 0],
                Origin::Mirrored => [255, 200, 0],
                Origin::Filled => [200, 0, 0],
                Origin::Nothing => [0; 3],
            })
        })
    }
}

/// A texel's place on the mesh.
#[derive(Clone, Copy)]
struct Texel {
    face: u32,
    /// The barycentric weights of the face's corners.
    weights: [f32; 3],
    /// In the object frame.
    point: Vector3<f32>,
    /// The surface's, of unit length.
    normal: Vector3<f32>,
}

/// Sums over frames, texel by texel.
pub(super) struct TextureGatherer<'a> {
    mesh: &'a UnwrappedMesh,
    texels: Grid<Option<Texel>>,
    /// Per texel the sums of RGB · weight and of the weight.
    sums: Vec<([f64; 3], f64)>,
}

impl<'a> TextureGatherer<'a> {
    pub(super) fn new(mesh: &'a UnwrappedMesh) -> Self {
        let mut texels = Grid::filled(SIZE, SIZE, None);
        for (face, corners) in (0u32..).zip(&mesh.texture_coordinates) {
            draw(&mut texels, corners, |weights| Texel {
                face,
                weights,
                point: mesh.at(face, weights, &mesh.vertices).cast(),
                normal: mesh.at(face, weights, &mesh.normals).normalize().cast(),
            });
        }
        Self {
            mesh,
            texels,
            sums: vec![([0.0; 3], 0.0); SIZE * SIZE],
        }
    }

    /// Adds what a frame shows. `view` is the mesh as its camera sees it; depths may differ by `tolerance`, object units. `gain` evens the
    /// frame's exposure.
    pub(super) fn add(
        &mut self,
        frame: &Frame,
        camera_from_object: &Pose,
        view: &ZBuffer,
        tolerance: f64,
        gain: [f64; 3],
    ) {
        let texels = self.texels.data();
        self.sums
            .par_iter_mut()
            .zip(texels)
            .for_each(|((sum, total), texel)| {
                let Some(texel) = texel else { return };
                let in_camera = camera_from_object.transform(&texel.point.cast());
                let normal = camera_from_object.rotation * texel.normal.cast::<f64>();
                let distance = in_camera.norm();
                let cosine = -normal.dot(&in_camera) / distance;
                if cosine < MIN_COSINE {
                    return;
                }
                let Some(pixel) = frame.camera.project(&in_camera) else {
                    return;
                };
                let Some(cell) = view.depth.pixel_at(pixel.x, pixel.y) else {
                    return;
                };
                let pixel_size = in_camera.z / frame.camera.fx.min(frame.camera.fy);
                let front = f64::from(view.depth[cell]);
                if front > 0.0 && in_camera.z > front + tolerance + pixel_size / cosine
                    || !clear_of_edge(&frame.mask, pixel.x, pixel.y)
                {
                    return;
                }
                let weight = (cosine / distance).powi(SHARPNESS);
                let colour = bilinear(&frame.image, pixel.x, pixel.y);
                for (sum, (part, gain)) in sum.iter_mut().zip(colour.into_iter().zip(gain)) {
                    *sum += weight * gain * part;
                }
                *total += weight;
            });
    }

    pub(super) fn finish(self) -> Texture {
        let own: Vec<Option<[f64; 3]>> = self
            .sums
            .iter()
            .map(|&(sum, weight)| (weight > 1e-9).then(|| sum.map(|part| part / weight)))
            .collect();
        // The template's right half is the mirror image of its left one.
        let twin = |index: usize| index / SIZE * SIZE + SIZE - 1 - index % SIZE;
        let known = |index: usize| own[index].or(own[twin(index)]);
        let of_vertices = self.spread(known);
        let mut colours: Vec<Option<[f64; 3]>> = vec![None; SIZE * SIZE];
        let mut origins = Grid::filled(SIZE, SIZE, Origin::Nothing);
        for (index, texel) in self.texels.data().iter().enumerate() {
            let Some(texel) = texel else { continue };
            origins.data_mut()[index] = match (own[index], own[twin(index)]) {
                (Some(_), _) => Origin::Seen,
                (None, Some(_)) => Origin::Mirrored,
                (None, None) => Origin::Filled,
            };
            let filled = || {
                let colour = self.mesh.at(texel.face, texel.weights, &of_vertices);
                [colour.x, colour.y, colour.z]
            };
            colours[index] = Some(known(index).unwrap_or_else(filled));
        }
        for _ in 0..GUTTER {
            widen(&mut colours);
        }
        Texture {
            colours: image::RgbImage::from_fn(SIZE as u32, SIZE as u32, |column, row| {
                let colour = colours[row as usize * SIZE + column as usize].unwrap_or([128.0; 3]);
                image::Rgb(colour.map(|part| part.round().clamp(0.0, 255.0) as u8))
            }),
            origins,
        }
    }

    /// A colour for every vertex: the mean of the known texels around it, else the mean of its neighbours', grey where there is none.
    fn spread(&self, known: impl Fn(usize) -> Option<[f64; 3]>) -> Vec<Vector3<f64>> {
        let count = self.mesh.vertices.len();
        let mut sums = vec![(Vector3::zeros(), 0.0); count];
        for (index, texel) in self.texels.data().iter().enumerate() {
            let (Some(texel), Some(colour)) = (texel, known(index)) else {
                continue;
            };
            for (&vertex, &weight) in self.mesh.faces[texel.face as usize].iter().zip(&texel.weights) {
                let (sum, total) = &mut sums[vertex as usize];
                *sum += Vector3::from(colour) * f64::from(weight);
                *total += f64::from(weight);
            }
        }
        let mut colours: Vec<Option<Vector3<f64>>> = sums
            .iter()
            .map(|&(sum, total)| (total > 1e-6).then(|| sum / total))
            .collect();
        let unknown: Vec<bool> = colours.iter().map(Option::is_none).collect();
        for _ in 0..SPREADING_ROUNDS {
            let mut around = vec![(Vector3::zeros(), 0.0); count];
            for &[a, b, c] in &self.mesh.faces {
                for [from, to] in [[a, b], [b, c], [c, a]] {
                    if let (true, Some(colour)) = (unknown[to as usize], colours[from as usize]) {
                        around[to as usize].0 += colour;
                        around[to as usize].1 += 1.0;
                    }
                }
            }
            for (colour, (sum, total)) in colours.iter_mut().zip(around) {
                if total > 0.0 {
                    *colour = Some(sum / total);
                }
            }
        }
        colours
            .into_iter()
            .map(|colour| colour.unwrap_or(Vector3::repeat(128.0)))
            .collect()
    }
}

/// Every texel whose centre lies in the face with these texture coordinates, by its barycentric weights.
fn draw(texels: &mut Grid<Option<Texel>>, corners: &[[f32; 2]; 3], texel: impl Fn([f32; 3]) -> Texel) {
    let size = SIZE as f64;
    let [a, b, c] = corners.map(|[u, v]| [f64::from(u) * size, (1.0 - f64::from(v)) * size]);
    let cross = |a: [f64; 2], b: [f64; 2], at: [f64; 2]| {
        (b[0] - a[0]) * (at[1] - a[1]) - (b[1] - a[1]) * (at[0] - a[0])
    };
    let area = cross(a, b, c);
    if area == 0.0 {
        return;
    }
    let range = |axis: usize| {
        let low = a[axis].min(b[axis]).min(c[axis]).clamp(0.0, size);
        let high = a[axis].max(b[axis]).max(c[axis]).clamp(0.0, size);
        low as usize..(high.ceil() as usize)
    };
    for row in range(1) {
        for column in range(0) {
            let at = [column as f64 + 0.5, row as f64 + 0.5];
            let weights = [cross(b, c, at), cross(c, a, at), cross(a, b, at)].map(|part| part / area);
            if weights.iter().all(|&weight| weight >= 0.0) {
                texels[(column, row)] = Some(texel(weights.map(|weight| weight as f32)));
            }
        }
    }
}

/// Texels without a colour take the mean of those beside them.
fn widen(colours: &mut [Option<[f64; 3]>]) {
    let before = colours.to_vec();
    for index in 0..colours.len() {
        if before[index].is_some() {
            continue;
        }
        let (column, row) = (index % SIZE, index / SIZE);
        let beside = [
            (column > 0).then(|| index - 1),
            (column + 1 < SIZE).then(|| index + 1),
            (row > 0).then(|| index - SIZE),
            (row + 1 < SIZE).then(|| index + SIZE),
        ];
        let beside: Vec<[f64; 3]> = beside.into_iter().flatten().filter_map(|i| before[i]).collect();
        if !beside.is_empty() {
            let mean = |part: usize| beside.iter().map(|c| c[part]).sum::<f64>() / beside.len() as f64;
            colours[index] = Some([0, 1, 2].map(mean));
        }
    }
}

fn clear_of_edge(mask: &Mask, u: f64, v: f64) -> bool {
    [-CLEAR_OF_EDGE_PX, CLEAR_OF_EDGE_PX].iter().all(|&step| {
        [(u + step, v), (u, v + step)]
            .into_iter()
            .all(|(u, v)| mask.pixel_at(u, v).is_some_and(|at| mask[at]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pinhole;
    use crate::report::Surface;

    /// A square plate in z = 0, its right half x > 0 on the left of the picture and the other one on the right, seen from −z.
    fn plate() -> UnwrappedMesh {
        let corners = [
            (0.0, -0.4),
            (0.4, -0.4),
            (0.4, 0.4),
            (0.0, 0.4),
            (-0.4, -0.4),
            (-0.4, 0.4),
        ];
        let at = |v: usize, u: f32| [u, corners[v].1 as f32 + 0.5];
        let (seam, edge) = (0.1, 0.4);
        let half = [[0, 2, 1], [0, 3, 2]];
        let other = [[0, 4, 5], [0, 5, 3]];
        let u = |v: usize| if v == 0 || v == 3 { seam } else { edge };
        let coordinates = half
            .iter()
            .map(|face| face.map(|v| at(v, u(v))))
            .chain(other.iter().map(|face| face.map(|v| at(v, 1.0 - u(v)))))
            .collect();
        let vertices = corners.map(|(x, y)| Vector3::new(x, y, 0.0));
        let faces = half.iter().chain(&other).map(|face| face.map(|v| v as u32));
        UnwrappedMesh::new(vertices.into(), faces.collect(), coordinates)
    }

    #[test]
    fn what_is_not_seen_is_like_its_mirror_image() {
        let surface = Surface::from_mesh(plate());
        let mesh = surface.mesh().unwrap();
        assert!(mesh.normals[0].z < -0.99, "{}", mesh.normals[0]);
        let camera_from_object = Pose {
            translation: Vector3::new(0.0, 0.0, 2.0),
            ..Pose::identity()
        };
        // Red where x < 0, the mask ends there; at the top, darker.
        let frame = Frame {
            name: "a".into(),
            image: Grid::from_fn(100, 100, |_, row| {
                if row < 50 {
                    [100.0, 0.0, 0.0]
                } else {
                    [200.0, 0.0, 0.0]
                }
            })
            .into(),
            mask: Grid::from_fn(100, 100, |column, row| column < 50 && row > 30),
            camera: Pinhole {
                fx: 200.0,
                fy: 200.0,
                cx: 50.0,
                cy: 50.0,
            },
            timestamp_s: None,
            camera_from_input: None,
            depth: None,
            depth_deviation: None,
        };
        let view = surface.render(&frame.camera, &camera_from_object, (100, 100));
        let mut gatherer = TextureGatherer::new(mesh);
        gatherer.add(&frame, &camera_from_object, &view, surface.spacing(), [1.0; 3]);
        let texture = gatherer.finish();
        // x = −0.2 is u = 1 − 0.25 and x = 0.2 is u = 0.25; y = 0.2, in the image's lower half, is v = 0.7.
        let at = |u: f64, v: f64| ((u * SIZE as f64) as usize, ((1.0 - v) * SIZE as f64) as usize);
        let colour = |(column, row): (usize, usize)| texture.colours.get_pixel(column as u32, row as u32).0;
        let [seen, twin, outside] = [at(0.75, 0.7), at(0.25, 0.7), at(0.01, 0.01)];
        assert_eq!((texture.origins[seen], colour(seen)), (Origin::Seen, [200, 0, 0]));
        assert_eq!(
            (texture.origins[twin], colour(twin)),
            (Origin::Mirrored, [200, 0, 0])
        );
        assert_eq!(
            (texture.origins[outside], colour(outside)),
            (Origin::Nothing, [128; 3])
        );
        // y = −0.35 is above the mask: what its neighbours have.
        let above = at(0.75, 0.15);
        assert_eq!(texture.origins[above], Origin::Filled);
        assert!((100..=180).contains(&colour(above)[0]), "{:?}", colour(above));
    }

    #[test]
    fn without_frames_all_is_grey() {
        let mesh = plate();
        let texture = TextureGatherer::new(&mesh).finish();
        assert!(texture.colours.pixels().all(|pixel| pixel.0 == [128; 3]));
    }
}
