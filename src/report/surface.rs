//! What the solved shape looks like in a camera: points drawn as small discs (surfels) with a z-buffer.

use super::Neighbours;
use crate::geometry::{Pinhole, Pose, Vector3};
use crate::image::{DepthMap, Grid, Mask};

/// Points on a surface, each standing for a disc around it: its footprint. Object frame and units.
#[derive(Clone, Debug)]
pub struct Surface {
    pub points: Vec<Vector3<f64>>,
    /// Unit normals, one per point. Drawing ignores their sign.
    pub normals: Vec<Vector3<f64>>,
    /// The discs' radii, one per point.
    pub radii: Vec<f64>,
}

/// A [`Surface`] as one camera sees it.
#[derive(Clone, Debug)]
pub struct View {
    /// z of the nearest disc where the pixel's centre ray meets it, object units; 0 = none.
    pub depth: DepthMap,
    /// The point whose disc that is.
    pub index: Grid<Option<u32>>,
    /// The points that the near side does not hide, ascending.
    pub visible: Vec<u32>,
}

impl View {
    /// The silhouette: true where a disc covers the pixel.
    pub fn mask(&self) -> Mask {
        Grid::from_fn(self.depth.width(), self.depth.height(), |column, row| {
            self.depth[(column, row)] > 0.0
        })
    }
}

/// Neighbours that normal and footprint of a point are estimated from.
const NEIGHBOURS: usize = 8;
/// A disc reaches this share of the way to the fourth-nearest neighbour: on a surface sampled in farthest-point
/// order or at random, the smallest one that leaves no holes (measured in the tests below).
const REACH: f64 = 1.0;
/// No disc is larger than this many median discs, so that a stray point stays small.
const LARGEST: f64 = 2.0;

impl Surface {
    /// Estimates normals (least-squares planes, turned away from the centroid) and radii (local spacing) from the
    /// points alone.
    pub fn from_points(points: Vec<Vector3<f64>>) -> Self {
        let tree = Neighbours::new(&points);
        let centroid = points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64;
        let (normals, mut radii): (Vec<_>, Vec<_>) = points
            .iter()
            .map(|point| {
                let near = tree.nearest(point, NEIGHBOURS as u32 + 1);
                let normal = plane_normal(near.iter().map(|&(i, _)| points[i]));
                let outward = if normal.dot(&(point - centroid)) < 0.0 {
                    -normal
                } else {
                    normal
                };
                let kk: usize = std::env::var("KK").map_or(4, |v| v.parse().unwrap());
 let fourth = near.get(kk).or(near.last()).map_or(0.0, |&(_, distance)| distance);
                (outward, std::env::var("REACH").map_or(REACH, |v| v.parse().unwrap()) * fourth)
            })
            .unzip();
        let median = median(&radii);
        radii
            .iter_mut()
            .for_each(|radius| *radius = radius.min(LARGEST * median));
        Self {
            points,
            normals,
            radii,
        }
    }

    /// Draws the discs into a `size` = (width, height) image. Every point in front of the camera covers at least
    /// the pixel that holds its centre; points behind the camera are skipped.
    pub fn render(&self, camera: &Pinhole, camera_from_object: &Pose, size: (usize, usize)) -> View {
        let mut canvas = Canvas {
            camera,
            depth: Grid::filled(size.0, size.1, 0.0),
            rank: Grid::filled(size.0, size.1, f64::INFINITY),
            index: Grid::filled(size.0, size.1, None),
        };
        let in_camera: Vec<_> = self
            .points
            .iter()
            .map(|point| camera_from_object.transform(point))
            .collect();
        for (i, ((centre, normal), &radius)) in
            in_camera.iter().zip(&self.normals).zip(&self.radii).enumerate()
        {
            canvas.draw(i as u32, centre, &(camera_from_object.rotation * normal), radius);
        }
        let visible = (0..in_camera.len())
            .filter(|&i| canvas.sees(&in_camera[i], self.radii[i]))
            .map(|i| i as u32)
            .collect();
        View {
            depth: canvas.depth,
            index: canvas.index,
            visible,
        }
    }
}

struct Canvas<'a> {
    camera: &'a Pinhole,
    depth: DepthMap,
    /// What decides between discs: z + distance from the disc's centre. Of discs on one surface the one whose
    /// centre is nearest wins, so that overlapping rims do not bulge toward the camera.
    rank: Grid<f64>,
    index: Grid<Option<u32>>,
}

impl Canvas<'_> {
    fn draw(&mut self, point: u32, centre: &Vector3<f64>, normal: &Vector3<f64>, radius: f64) {
        let Some(pixel) = self.camera.project(centre) else {
            return;
        };
        let camera = self.camera;
        if centre.z > radius {
            let columns = span(
                centre.x,
                centre.z,
                radius,
                camera.fx,
                camera.cx,
                self.depth.width(),
            );
            let rows = span(
                centre.y,
                centre.z,
                radius,
                camera.fy,
                camera.cy,
                self.depth.height(),
            );
            for row in rows {
                for column in columns.clone() {
                    let ray = Vector3::new(
                        (column as f64 + 0.5 - camera.cx) / camera.fx,
                        (row as f64 + 0.5 - camera.cy) / camera.fy,
                        1.0,
                    );
                    // Not finite where the disc is seen edge-on: the comparison then fails.
                    let z = normal.dot(centre) / normal.dot(&ray);
                    let off_centre = (ray * z - centre).norm();
                    if off_centre <= radius {
                        self.keep_nearest((column, row), z, z + off_centre, point);
                    }
                }
            }
        }
        if let Some(own) = self.depth.pixel_at(pixel.x, pixel.y)
            && self.index[own] != Some(point)
        {
            self.keep_nearest(own, centre.z, centre.z, point);
        }
    }

    fn keep_nearest(&mut self, pixel: (usize, usize), z: f64, rank: f64, point: u32) {
        if z > 0.0 && rank < self.rank[pixel] {
            self.depth[pixel] = z as f32;
            self.rank[pixel] = rank;
            self.index[pixel] = Some(point);
        }
    }

    /// Nothing lies in front of the point by more than its own disc and one pixel's width at its depth.
    fn sees(&self, centre: &Vector3<f64>, radius: f64) -> bool {
        let camera = self.camera;
        let tolerance = radius + centre.z / camera.fx.min(camera.fy);
        camera
            .project(centre)
            .and_then(|pixel| self.depth.pixel_at(pixel.x, pixel.y))
            .is_some_and(|pixel| centre.z <= f64::from(self.depth[pixel]) + tolerance)
    }
}

/// The pixels along one axis that a ball around (`x`, `z`) can reach; needs z > radius.
fn span(x: f64, z: f64, radius: f64, focal: f64, centre: f64, size: usize) -> std::ops::Range<usize> {
    let edge = |x: f64, toward: f64| {
        let z = if x * toward > 0.0 { z - radius } else { z + radius };
        focal * x / z + centre
    };
    let low = edge(x - radius, -1.0).floor().clamp(0.0, size as f64) as usize;
    let high = edge(x + radius, 1.0).ceil().clamp(0.0, size as f64) as usize;
    low..high.max(low)
}

/// The direction in which the points vary least; any unit vector if they do not span a plane.
fn plane_normal(points: impl Iterator<Item = Vector3<f64>> + Clone) -> Vector3<f64> {
    let mean = points.clone().sum::<Vector3<f64>>() / points.clone().count().max(1) as f64;
    let scatter = points
        .map(|point| (point - mean) * (point - mean).transpose())
        .sum::<nalgebra::Matrix3<f64>>();
    let eigen = scatter.symmetric_eigen();
    eigen.eigenvectors.column(eigen.eigenvalues.imin()).normalize()
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture::{CAR_BOXES, box_car, looking_at, sphere};

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
            let spacing = median(&surface.radii);
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
                "{name}: radius {spacing_px:.2} px, outline +{inflation:.2} −{:.2}, holes {holes}, depth error {error:.5}",
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
        let surface = Surface::from_points(sphere(8192, 0.4, 11));
        let view = surface.render(&CAMERA, &pose, SIZE);
        // Seen from 1.6, the limb of a sphere of radius 0.4 lies 0.1 toward the camera.
        let faces = |i: u32, margin: f64| surface.points[i as usize].z < -0.1 + margin;
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
            let ray = CAMERA.unproject(&nalgebra::Vector2::new(column as f64 + 0.5, row as f64 + 0.5), 1.0);
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
    fn a_car_with_sharp_edges() {
        for (name, points) in [("random", box_car(8192)), ("even", farthest_first(&box_car(60_000), 8192)), ("coarse", farthest_first(&box_car(20_000), 2048))] {
            let surface = Surface::from_points(points);
            let (mut holes, mut leaks, mut outside, mut perimeter, mut area, mut error) = (0, 0, 0, 0, 0, 0.0);
            for azimuth in 0..24 {
                let pose = looking_at(15.0 * azimuth as f64 + 3.0, 12.0, 1.7);
                let (truth, view) = (analytic_car(&pose), surface.render(&CAMERA, &pose, SIZE));
                for row in 1..SIZE.1 - 1 {
                    for column in 1..SIZE.0 - 1 {
                        let (z, expected) = (view.depth[(column, row)], truth[(column, row)]);
                        let around = [(column - 1, row), (column + 1, row), (column, row - 1), (column, row + 1)];
                        let edge = around.iter().any(|&at| truth[at] == 0.0 || (truth[at] - expected).abs() > 0.05);
                        if expected > 0.0 {
                            area += 1;
                            perimeter += usize::from(around.iter().any(|&at| truth[at] == 0.0));
                            holes += usize::from(z == 0.0);
                            leaks += usize::from(z > expected + 0.05 && !edge);
                            if z > 0.0 { error += f64::from((z - expected).abs()); }
                        } else {
                            outside += usize::from(z > 0.0);
                        }
                    }
                }
            }
            println!("{name}: median radius {:.4}, holes {:.4}%, leaks {:.4}%, inflation {:.3} px, error {:.5}", median(&surface.radii), 100.0 * holes as f64 / area as f64,
                100.0 * leaks as f64 / area as f64, outside as f64 / perimeter as f64, error / area as f64);
        }
    }

    #[test]
    fn points_behind_the_camera_or_tiny_ones() {
        let surface = Surface {
            points: vec![Vector3::new(0.0, 0.0, -1.0), Vector3::new(0.011, 0.0, 1.0)],
            normals: vec![Vector3::z(); 2],
            radii: vec![0.1, 1e-6],
        };
        let view = surface.render(&CAMERA, &Pose::identity(), SIZE);
        assert_eq!(view.visible, [1]);
        let drawn: Vec<_> = view.index.data().iter().flatten().collect();
        assert_eq!(drawn, [&1]);
        // u = 160 + 4.4: column 164.
        assert_eq!(view.index[(164, 120)], Some(1));
        assert_eq!(view.depth[(164, 120)], 1.0);
    }

    #[test]
    fn drawing_ignores_the_normals_sign() {
        let surface = Surface::from_points(sphere(500, 0.4, 1));
        let turned = Surface {
            normals: surface.normals.iter().map(|n| -n).collect(),
            ..surface.clone()
        };
        let pose = looking_at(30.0, 20.0, 2.0);
        assert_eq!(
            surface.render(&CAMERA, &pose, SIZE).depth,
            turned.render(&CAMERA, &pose, SIZE).depth
        );
    }
}
