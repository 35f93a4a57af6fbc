//! What the solved shape looks like in a camera: points with the small facets around them, and a z-buffer.

use super::Neighbours;
use super::facets;
use crate::geometry::{Pinhole, Pose, Similarity, Vector3, tangent_plane};
use crate::image::{DepthMap, Grid, Mask};
use crate::prior::{LearnedPrior, subdivided};
use crate::solver::Solution;
use std::sync::Arc;

/// Points on a surface, each with a footprint: the facets that join it to its neighbours. Object frame and units.
///
/// Facets span the surface between the points and end with them, so that a silhouette is not inflated the way
/// discs around the points inflate it at sharp edges.
#[derive(Clone, Debug)]
pub struct Surface {
    points: Vec<Vector3<f64>>,
    normals: Vec<Vector3<f64>>,
    facets: Vec<[u32; 3]>,
    spacing: f64,
    /// Where the facets are those of one closed mesh: that mesh, before it was cut finer.
    mesh: Option<Arc<UnwrappedMesh>>,
}

/// A closed mesh with texture coordinates, object frame.
#[derive(Clone, Debug)]
pub struct UnwrappedMesh {
    pub(super) vertices: Vec<Vector3<f64>>,
    /// Unit normals, one a vertex.
    pub(super) normals: Vec<Vector3<f64>>,
    /// Counter-clockwise seen from outside.
    pub(super) faces: Vec<[u32; 3]>,
    /// Per corner of the faces: in \[0, 1\], u to the right, v up; 1 − u is the mirror image's.
    pub(super) texture_coordinates: Vec<[[f32; 2]; 3]>,
}

impl UnwrappedMesh {
    /// A face of a vertex that there is not, or without texture coordinates, is left out.
    pub fn new(
        vertices: Vec<Vector3<f64>>,
        faces: Vec<[u32; 3]>,
        texture_coordinates: Vec<[[f32; 2]; 3]>,
    ) -> Self {
        let known = |face: &[u32; 3]| face.iter().all(|&v| (v as usize) < vertices.len());
        let (faces, texture_coordinates): (Vec<_>, Vec<_>) = faces
            .into_iter()
            .zip(texture_coordinates)
            .filter(|(face, _)| known(face))
            .unzip();
        Self {
            normals: normals(&vertices, &faces),
            vertices,
            faces,
            texture_coordinates,
        }
    }

    /// The mean of a face's corners' vectors by their weights.
    pub(super) fn at(&self, face: u32, weights: [f32; 3], of: &[Vector3<f64>]) -> Vector3<f64> {
        let corners = self.faces[face as usize].iter().zip(weights);
        corners
            .map(|(&vertex, weight)| of[vertex as usize] * f64::from(weight))
            .sum()
    }
}

/// Unit normals of the vertices, weighted by area.
fn normals(vertices: &[Vector3<f64>], faces: &[[u32; 3]]) -> Vec<Vector3<f64>> {
    let mut sums = vec![Vector3::zeros(); vertices.len()];
    for face in faces {
        let [a, b, c] = face.map(|v| vertices[v as usize]);
        let twice_area = (b - a).cross(&(c - a));
        face.iter().for_each(|&v| sums[v as usize] += twice_area);
    }
    sums.into_iter()
        .map(|normal| normal.try_normalize(1e-18).unwrap_or(Vector3::y()))
        .collect()
}

/// A [`Surface`] as one camera sees it.
#[derive(Clone, Debug)]
pub struct View {
    /// z of the nearest facet where the ray through the pixel's centre meets it, object units; 0 = none.
    pub depth: DepthMap,
    /// The point whose footprint that is.
    pub index: Grid<Option<u32>>,
    /// The points that the near side does not hide, ascending.
    pub visible: Vec<u32>,
}

impl View {
    /// The silhouette: true where a footprint covers the pixel.
    pub fn mask(&self) -> Mask {
        self.depth.known()
    }
}

impl Surface {
    /// Estimates facets, normals (least-squares planes, turned away from the centroid) and spacing from the points
    /// alone (N × 3, object frame).
    pub fn from_points(points: Vec<Vector3<f64>>) -> Self {
        let tree = Neighbours::new(&points);
        let rings: Vec<_> = points
            .iter()
            .map(|point| tree.nearest(point, facets::RING + 1))
            .collect();
        let centroid = points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64;
        let normals: Vec<_> = points
            .iter()
            .zip(&rings)
            .map(|(point, ring)| {
                let around: Vec<_> = ring.iter().map(|&(i, _)| points[i]).collect();
                let (normal, _) = tangent_plane(&around);
                if normal.dot(&(point - centroid)) < 0.0 {
                    -normal
                } else {
                    normal
                }
            })
            .collect();
        Self {
            facets: facets::around_points(&points, &normals, &rings),
            spacing: median(
                rings
                    .iter()
                    .filter_map(|ring| ring.get(1))
                    .map(|&(_, distance)| distance),
            ),
            points,
            normals,
            mesh: None,
        }
    }

    /// `mesh` with each of its faces cut into four for the sake of colours; the vertices of these are the points.
    pub fn from_mesh(mesh: UnwrappedMesh) -> Self {
        let (points, facets) = subdivided(&mesh.vertices, &mesh.faces);
        let lengths = facets.iter().flat_map(|&[a, b, c]| {
            [[a, b], [b, c], [c, a]].map(|[a, b]| (points[a as usize] - points[b as usize]).norm())
        });
        Self {
            normals: normals(&points, &facets),
            spacing: median(lengths),
            points,
            facets,
            mesh: Some(Arc::new(mesh)),
        }
    }

    /// The prior's shape of `style`, as it is: its mesh where it has one, else its points.
    pub fn of_style(prior: &LearnedPrior, style: &[f64]) -> Self {
        Self::of_shape(prior, style, &[], None)
    }

    /// The shape that was found, in the object frame.
    pub fn of(prior: &LearnedPrior, solution: &Solution) -> Self {
        let canonical = solution.canonical_from_shape.as_ref();
        Self::of_shape(prior, &solution.estimate.style, &solution.free_form, canonical)
    }

    fn of_shape(
        prior: &LearnedPrior,
        style: &[f64],
        free_form: &[f64],
        canonical_from_shape: Option<&Similarity>,
    ) -> Self {
        let moved = |points: Vec<Vector3<f64>>| -> Vec<Vector3<f64>> {
            match canonical_from_shape {
                Some(canonical) => points.iter().map(|point| canonical.transform(point)).collect(),
                None => points,
            }
        };
        match prior.surface() {
            Some(surface) => Self::from_mesh(UnwrappedMesh::new(
                moved(surface.vertices(style, free_form)),
                surface.mesh().faces(),
                surface.mesh().texture_coordinates(),
            )),
            None => Self::from_points(moved(prior.shape(style))),
        }
    }

    /// The mesh, where the shape is one.
    pub fn mesh(&self) -> Option<&UnwrappedMesh> {
        self.mesh.as_deref()
    }

    /// Triangles over the points; of a mesh, they are all of it.
    pub fn facets(&self) -> &[[u32; 3]] {
        &self.facets
    }

    /// N × 3, object frame.
    pub fn points(&self) -> &[Vector3<f64>] {
        &self.points
    }

    /// Unit normals, one per point, mostly outward.
    pub fn normals(&self) -> &[Vector3<f64>] {
        &self.normals
    }

    /// The median distance from a point to its nearest neighbour, object units.
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Draws the shape into a `size` = (width, height) image. Every point in front of the camera covers at least
    /// the pixel that holds it; points behind the camera are skipped, with the facets that touch them.
    pub fn render(&self, camera: &Pinhole, camera_from_object: &Pose, size: (usize, usize)) -> View {
        let mut canvas = Canvas {
            depth: Grid::filled(size.0, size.1, 0.0),
            index: Grid::filled(size.0, size.1, None),
        };
        let projected: Vec<Option<Projected>> = self
            .points
            .iter()
            .map(|point| {
                let in_camera = camera_from_object.transform(point);
                let pixel = camera.project(&in_camera)?;
                Some(Projected {
                    u: pixel.x,
                    v: pixel.y,
                    z: in_camera.z,
                })
            })
            .collect();
        for facet in &self.facets {
            if let [Some(a), Some(b), Some(c)] = facet.map(|i| projected[i as usize]) {
                canvas.draw_facet([a, b, c], facet);
            }
        }
        for (i, point) in projected.iter().enumerate() {
            if let Some((pixel, z)) = point.and_then(|p| Some((canvas.depth.pixel_at(p.u, p.v)?, p.z)))
                && canvas.depth[pixel] == 0.0
            {
                canvas.keep_nearest(pixel, z, i as u32);
            }
        }
        // A facet may stand out before its points by its sag, and the depth under a pixel varies.
        let tolerance = |z: f64| self.spacing + z / camera.fx.min(camera.fy);
        let visible = (0u32..)
            .zip(&projected)
            .filter_map(|(i, point)| {
                let p = (*point)?;
                let front = canvas.depth[canvas.depth.pixel_at(p.u, p.v)?];
                (p.z <= f64::from(front) + tolerance(p.z)).then_some(i)
            })
            .collect();
        View {
            depth: canvas.depth,
            index: canvas.index,
            visible,
        }
    }
}

#[derive(Clone, Copy)]
struct Projected {
    u: f64,
    v: f64,
    z: f64,
}

struct Canvas {
    depth: DepthMap,
    index: Grid<Option<u32>>,
}

impl Canvas {
    /// Fills the pixels whose centres lie in the triangle; 1 / z is linear across it.
    fn draw_facet(&mut self, corners: [Projected; 3], points: &[u32; 3]) {
        let [a, b, c] = corners;
        let area = cross(a, b, c.u, c.v);
        let columns = pixels(corners.map(|p| p.u), self.depth.width());
        if columns.is_empty() {
            return;
        }
        for row in pixels(corners.map(|p| p.v), self.depth.height()) {
            for column in columns.clone() {
                let (u, v) = (column as f64 + 0.5, row as f64 + 0.5);
                let parts = [cross(b, c, u, v), cross(c, a, u, v), cross(a, b, u, v)];
                // Nothing is inside a facet that is seen edge-on.
                if parts.iter().all(|part| part * area >= 0.0) && area != 0.0 {
                    let weights = parts.map(|part| part / area);
                    let inverse_depth = weights[0] / a.z + weights[1] / b.z + weights[2] / c.z;
                    let nearest_corner =
                        (0..3).fold(0, |best, i| if weights[i] > weights[best] { i } else { best });
                    self.keep_nearest((column, row), 1.0 / inverse_depth, points[nearest_corner]);
                }
            }
        }
    }

    fn keep_nearest(&mut self, pixel: (usize, usize), z: f64, point: u32) {
        let z = z as f32;
        if self.depth[pixel] == 0.0 || z < self.depth[pixel] {
            self.depth[pixel] = z;
            self.index[pixel] = Some(point);
        }
    }
}

/// Twice the signed area of (a, b, (u, v)).
fn cross(a: Projected, b: Projected, u: f64, v: f64) -> f64 {
    (b.u - a.u) * (v - a.v) - (b.v - a.v) * (u - a.u)
}

/// The pixels along one axis whose centres lie between the least and the greatest coordinate.
fn pixels(coordinates: [f64; 3], size: usize) -> std::ops::Range<usize> {
    let [a, b, c] = coordinates;
    let clamp = |pixel: f64| pixel.clamp(0.0, size as f64);
    let least = clamp(a.min(b).min(c) - 0.5);
    // `least.ceil()` without the function call that it is on processors of no particular kind: there are millions of facets.
    let low = least as usize + usize::from(least > (least as usize) as f64);
    low..(clamp(a.max(b).max(c) + 0.5) as usize).max(low)
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<_> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cad::orbit;
    use crate::report::fixture::{CAR_BOXES, box_car, sphere};

    const CAMERA: Pinhole = Pinhole {
        fx: 400.0,
        fy: 400.0,
        cx: 160.0,
        cy: 120.0,
    };
    const SIZE: (usize, usize) = (320, 240);

    /// As a shape prior stores them: each point farthest from those before it.
    fn farthest_first(points: &[Vector3<f64>], count: usize) -> Vec<Vector3<f64>> {
        let mut gaps = vec![f64::INFINITY; points.len()];
        let mut next = 0;
        (0..count)
            .map(|_| {
                let chosen = points[next];
                for (gap, point) in gaps.iter_mut().zip(points) {
                    *gap = gap.min((point - chosen).norm_squared());
                }
                next = (0..points.len())
                    .max_by(|&a, &b| gaps[a].total_cmp(&gaps[b]))
                    .unwrap();
                chosen
            })
            .collect()
    }

    /// z of the nearest point of a sphere (centre on the optical axis at `distance`) on each pixel's ray.
    fn analytic_sphere(radius: f64, distance: f64) -> DepthMap {
        Grid::from_fn(SIZE.0, SIZE.1, |column, row| {
            let ray = Vector3::new(
                (column as f64 + 0.5 - CAMERA.cx) / CAMERA.fx,
                (row as f64 + 0.5 - CAMERA.cy) / CAMERA.fy,
                1.0,
            );
            let (a, b) = (ray.norm_squared(), distance);
            let discriminant = b * b - a * (distance * distance - radius * radius);
            if discriminant < 0.0 {
                0.0
            } else {
                ((b - discriminant.sqrt()) / a) as f32
            }
        })
    }

    #[test]
    fn a_mesh_is_drawn_as_it_is() {
        // A tetrahedron that the camera looks at along +z.
        let vertices = vec![
            Vector3::new(0.0, 0.0, -0.3),
            Vector3::new(0.4, 0.0, 0.2),
            Vector3::new(-0.2, 0.35, 0.2),
            Vector3::new(-0.2, -0.35, 0.2),
        ];
        let faces = vec![[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]];
        let flat = vec![[[0.0; 2]; 3]; 4];
        let surface = Surface::from_mesh(UnwrappedMesh::new(vertices, faces, flat.clone()));
        assert_eq!((surface.points().len(), surface.facets().len()), (4 + 6, 16));
        assert!(surface.normals()[0].z < -0.99, "{}", surface.normals()[0]);
        let pose = Pose {
            translation: Vector3::new(0.0, 0.0, 2.0),
            ..Pose::identity()
        };
        let view = surface.render(&CAMERA, &pose, SIZE);
        assert!((view.depth[(160, 120)] - 1.7).abs() < 0.01);
        assert!(view.visible.contains(&0));
        let area = view.mask().data().iter().filter(|&&inside| inside).count() as f64;
        let expected = 0.5 * 0.6 * 0.7 * (CAMERA.fx / 2.2).powi(2);
        assert!((area / expected - 1.0).abs() < 0.02, "{area} {expected}");
        let none = Surface::from_mesh(UnwrappedMesh::new(vec![Vector3::x()], vec![[0, 1, 2]], flat));
        assert_eq!((none.spacing(), none.points().len()), (0.0, 1));
        assert!(none.mesh().is_some_and(|mesh| mesh.faces.is_empty()));
    }

    #[test]
    fn a_sphere_fills_its_analytic_silhouette() {
        let (radius, distance) = (0.4, 1.6);
        let pose = Pose {
            translation: Vector3::new(0.0, 0.0, distance),
            ..Pose::identity()
        };
        let truth = analytic_sphere(radius, distance);
        let even = farthest_first(&sphere(30_000, radius, 3), 2000);
        for (name, points) in [("even", even), ("random", sphere(8192, radius, 5))] {
            let surface = Surface::from_points(points);
            let spacing = surface.spacing();
            let view = surface.render(&CAMERA, &pose, SIZE);
            let outline = CAMERA.fx * radius / (distance * distance - radius * radius).sqrt();
            let (mut inner, mut outer, mut holes, mut error, mut area) = (outline, 0f64, 0, 0.0, 0);
            for row in 0..SIZE.1 {
                for column in 0..SIZE.0 {
                    let from_centre = ((column as f64 + 0.5 - CAMERA.cx).powi(2)
                        + (row as f64 + 0.5 - CAMERA.cy).powi(2))
                    .sqrt();
                    let (z, expected) = (view.depth[(column, row)], truth[(column, row)]);
                    if z > 0.0 {
                        outer = outer.max(from_centre);
                    } else {
                        inner = inner.min(from_centre);
                        holes += usize::from(from_centre < outline - 2.0);
                    }
                    if z > 0.0 && expected > 0.0 {
                        error += f64::from((z - expected).abs());
                        area += 1;
                    }
                }
            }
            let error = error / area as f64;
            let inflation = outer - outline;
            let spacing_px = spacing * CAMERA.fx / distance;
            println!(
                "{name}: spacing {spacing_px:.2} px, outline +{inflation:.2} −{:.2}, holes {holes}, depth error {error:.5}",
                outline - inner
            );
            assert_eq!(holes, 0, "{name}");
            assert!(inflation < 0.5 + 0.5 * spacing_px, "{name}: {inflation}");
            assert!(outline - inner < 2.0, "{name}");
            assert!(error < 0.002, "{name}: {error}");
        }
    }

    #[test]
    fn the_near_side_hides_the_far_side() {
        let pose = Pose {
            translation: Vector3::new(0.0, 0.0, 1.6),
            ..Pose::identity()
        };
        let surface = Surface::from_points(farthest_first(&sphere(40_000, 0.4, 11), 8192));
        let view = surface.render(&CAMERA, &pose, SIZE);
        // Seen from 1.6, the limb of a sphere of radius 0.4 lies 0.1 toward the camera.
        let faces = |i: u32, margin: f64| surface.points()[i as usize].z < -0.1 + margin;
        let wrong = view.visible.iter().filter(|&&i| !faces(i, 0.06)).count();
        let expected = (0..8192u32).filter(|&i| faces(i, -0.04)).count();
        let found = view.visible.iter().filter(|&&i| faces(i, -0.04)).count();
        assert_eq!(wrong, 0, "{} visible", view.visible.len());
        assert!(found as f64 > 0.98 * expected as f64, "{found} of {expected}");
    }

    /// z of the nearest of the car's two boxes on each pixel's ray.
    fn analytic_car(camera_from_object: &Pose) -> DepthMap {
        let object_from_camera = camera_from_object.inverse();
        Grid::from_fn(SIZE.0, SIZE.1, |column, row| {
            let ray = CAMERA.unproject(
                &nalgebra::Vector2::new(column as f64 + 0.5, row as f64 + 0.5),
                1.0,
            );
            let (from, along) = (object_from_camera.translation, object_from_camera.rotation * ray);
            let hits = CAR_BOXES.iter().filter_map(|(centre, size)| {
                let slab = |i: usize, side: f64| (centre[i] + side * 0.5 * size[i] - from[i]) / along[i];
                let (enter, leave) = (0..3).fold((0.0, f64::INFINITY), |(enter, leave): (f64, f64), i| {
                    let (a, b) = (slab(i, -1.0), slab(i, 1.0));
                    (enter.max(a.min(b)), leave.min(a.max(b)))
                });
                (enter < leave).then_some(enter)
            });
            let z = hits.fold(f64::INFINITY, f64::min);
            if z.is_finite() { z as f32 } else { 0.0 }
        })
    }

    #[test]
    fn a_car_keeps_its_outline_at_sharp_edges() {
        for (count, points) in [
            (8192, farthest_first(&box_car(40_000), 8192)),
            (2048, farthest_first(&box_car(20_000), 2048)),
        ] {
            let surface = Surface::from_points(points);
            let (mut missing, mut leaks, mut outside, mut outline, mut area, mut error) =
                (0, 0, 0, 0, 0, 0.0);
            for azimuth in 0..8 {
                let pose = orbit(45.0 * f64::from(azimuth) + 3.0, 12.0, 1.7);
                let (truth, view) = (analytic_car(&pose), surface.render(&CAMERA, &pose, SIZE));
                for (row, column) in (1..SIZE.1 - 1).flat_map(|row| (1..SIZE.0 - 1).map(move |c| (row, c))) {
                    let (z, expected) = (view.depth[(column, row)], truth[(column, row)]);
                    let around = [
                        (column - 1, row),
                        (column + 1, row),
                        (column, row - 1),
                        (column, row + 1),
                    ];
                    if expected == 0.0 {
                        outside += i32::from(z > 0.0);
                        continue;
                    }
                    area += 1;
                    outline += i32::from(around.iter().any(|&at| truth[at] == 0.0));
                    missing += i32::from(z == 0.0);
                    if z > 0.0 {
                        let step = around.iter().any(|&at| (truth[at] - expected).abs() > 0.05);
                        leaks += i32::from(!step && z > expected + 0.05);
                        error += f64::from((z - expected).abs());
                    }
                }
            }
            let inflation_px = f64::from(outside - missing) / f64::from(outline);
            let (spacing_px, error) = (surface.spacing() * CAMERA.fx / 1.7, error / f64::from(area));
            println!(
                "{count} points: outline {inflation_px:+.2} px (+{outside} −{missing} of {area}), spacing \
                 {spacing_px:.2} px, {leaks} leaks, depth error {error:.5}"
            );
            assert!(leaks < area / 10_000, "{leaks} of {area}");
            assert!(inflation_px.abs() < 0.5 + 0.5 * spacing_px, "{inflation_px}");
            assert!(error < 0.003, "{error}");
        }
    }

    #[test]
    fn points_behind_the_camera_or_tiny_ones() {
        let surface = Surface::from_points(vec![Vector3::new(0.0, 0.0, -1.0), Vector3::new(0.011, 0.0, 1.0)]);
        let view = surface.render(&CAMERA, &Pose::identity(), SIZE);
        assert_eq!(view.visible, [1]);
        let drawn: Vec<_> = view.index.data().iter().flatten().collect();
        assert_eq!(drawn, [&1]);
        // u = 160 + 4.4: column 164.
        assert_eq!(view.index[(164, 120)], Some(1));
        assert_eq!(view.depth[(164, 120)], 1.0);
    }
}
