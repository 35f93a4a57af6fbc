//! Small opaque discs on the points of X, so that a sparse sample hides what lies behind it (ours).

use super::VisiblePoint;
use crate::geometry::{Pinhole, Rotation3, Vector3, tangent_plane};
use nabo::{KDTree, Point, simple_point::SimplePoint};

/// Neighbours that make a point's tangent plane, itself included.
const NEIGHBOURS: u32 = 8;
/// Disc radius in mean distances to these neighbours: just enough that the discs of an even sample overlap. More
/// hides faces that are seen at a grazing angle behind an edge.
const RADIUS: f64 = 0.7;
/// Depth beyond a disc, in units of its radius, from which a point counts as behind it. Less loses points of
/// curved surfaces near their outline, more lets the far side through there.
const TOLERANCE: f64 = 1.0;
/// Distance from a disc's plane, in units of its neighbours' own scatter about it, from which a point counts as
/// behind it: at edges, where no plane fits, a disc must not hide the faces that meet there.
const SCATTER_TOLERANCE: f64 = 3.0;

/// One disc per point: centre at the point, tangent to the surface, wide enough to meet its neighbours. Depends on the shape only: one serves all frames.
#[derive(Clone, Debug)]
pub struct Surfels {
    discs: Vec<Disc>,
    spacing: f64,
}

#[derive(Clone, Copy, Debug)]
struct Disc {
    /// Unit, object frame; its sign carries no meaning.
    normal: Vector3<f64>,
    /// Object units.
    radius: f64,
    /// Root mean square distance of the neighbours from the tangent plane, object units.
    scatter: f64,
}

impl Surfels {
    /// Discs for `points` (xyz after xyz, object frame).
    pub fn new(points: &[f64]) -> Self {
        let cloud: Vec<SimplePoint<3>> = points
            .chunks_exact(3)
            .map(|x| SimplePoint::from_raw(&[x[0] as f32, x[1] as f32, x[2] as f32]).unwrap_or_default())
            .collect();
        let tree = KDTree::new(&cloud);
        let mut nearest_distances = Vec::with_capacity(cloud.len());
        let discs = cloud
            .iter()
            .map(|query| {
                let neighbours = tree.knn(NEIGHBOURS, query);
                let distances: Vec<f64> = neighbours.iter().map(|n| f64::from(*n.dist2).sqrt()).collect();
                nearest_distances.extend(distances.get(1).copied());
                let mean = distances.iter().sum::<f64>() / distances.len().saturating_sub(1).max(1) as f64;
                let positions: Vec<Vector3<f64>> = neighbours
                    .iter()
                    .map(|n| Vector3::new(0, 1, 2).map(|axis| f64::from(*n.point.get(axis))))
                    .collect();
                let (normal, scatter) = tangent_plane(&positions);
                Disc {
                    normal,
                    radius: RADIUS * mean,
                    scatter,
                }
            })
            .collect();
        nearest_distances.sort_by(f64::total_cmp);
        Self {
            discs,
            spacing: nearest_distances
                .get(nearest_distances.len() / 2)
                .copied()
                .unwrap_or(0.0),
        }
    }

    /// The median distance from a point to its nearest neighbour, object units.
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Clears every pixel whose ray meets a disc well before its point. `in_camera` are all points.
    pub(super) fn remove_occluded(
        &self,
        in_camera: &[Vector3<f64>],
        camera: &Pinhole,
        camera_from_object: &Rotation3<f64>,
        (width, height): (usize, usize),
        nearest: &mut [Option<VisiblePoint>],
    ) {
        let mut hidden = vec![false; nearest.len()];
        for (disc, centre) in self.discs.iter().zip(in_camera) {
            let Some(pixel) = camera.project(centre) else {
                continue;
            };
            let normal = camera_from_object * disc.normal;
            let (reach_u, reach_v) = (
                camera.fx * disc.radius / centre.z,
                camera.fy * disc.radius / centre.z,
            );
            // Saturating casts: a disc that reaches beyond the image is cut at its edges.
            let columns = (pixel.x - reach_u).max(0.0) as usize
                ..((pixel.x + reach_u).ceil().max(0.0) as usize).min(width);
            let rows = (pixel.y - reach_v).max(0.0) as usize
                ..((pixel.y + reach_v).ceil().max(0.0) as usize).min(height);
            for cell in rows.flat_map(|row| columns.clone().map(move |column| row * width + column)) {
                let Some(point) = nearest[cell].and_then(|seen| in_camera.get(seen.point as usize)) else {
                    continue;
                };
                hidden[cell] |= disc.hides(centre, &normal, point);
            }
        }
        for (cell, hidden) in nearest.iter_mut().zip(hidden) {
            if hidden {
                *cell = None;
            }
        }
    }
}

impl Disc {
    /// Whether the ray to `point` meets the disc at `centre` clearly before the point (all in the camera frame).
    fn hides(&self, centre: &Vector3<f64>, normal: &Vector3<f64>, point: &Vector3<f64>) -> bool {
        let slope = normal.dot(point);
        // Where along the ray (1 = at the point) it meets the disc's plane; edge-on discs hide nothing.
        let along = normal.dot(centre) / slope;
        let behind = (1.0 - along) * point.norm();
        along > 0.0
            && behind > TOLERANCE * self.radius
            && normal.dot(&(point - centre)).abs() > SCATTER_TOLERANCE * self.scatter
            && (point * along - centre).norm_squared() < self.radius * self.radius
    }
}
