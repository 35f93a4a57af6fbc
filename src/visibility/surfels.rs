//! Small opaque discs on the points of X, so that a sparse sample hides what lies behind it (ours).

use super::NO_POINT;
use crate::geometry::{Pinhole, Rotation3, Vector3, tangent_plane};
use nabo::{KDTree, Point, simple_point::SimplePoint};

/// Neighbours that make a point's tangent plane, itself included.
const NEIGHBOURS: usize = 8;
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
    /// The radius of each disc, object units.
    radius: f64,
    /// Root mean square distance of the neighbours from the tangent plane, object units.
    scatter: f64,
}

/// Every point's nearest points. Those of a prior's mean shape serve all its shapes: a style moves neighbours together.
#[derive(Clone, Debug)]
pub struct Neighbourhoods {
    /// Per point: itself and its nearest points, as many for each.
    indices: Vec<u32>,
    /// How many that is: fewer than [`NEIGHBOURS`] where there are fewer points.
    count: usize,
}

impl Neighbourhoods {
    /// The neighbourhoods of `points` (xyz after xyz, object frame).
    pub fn of(points: &[f64]) -> Self {
        let cloud: Vec<SimplePoint<3>> = points
            .chunks_exact(3)
            .map(|x| SimplePoint::from_raw(&[x[0] as f32, x[1] as f32, x[2] as f32]).unwrap_or_default())
            .collect();
        let tree = KDTree::new(&cloud);
        let count = NEIGHBOURS.min(cloud.len());
        let around = |(index, query): (u32, &SimplePoint<3>)| {
            let others = tree.knn(count as u32, query).into_iter().map(|n| n.index);
            // Of points that coincide, the tree may give any before the point itself.
            let others = others.filter(move |&other| other != index);
            std::iter::once(index).chain(others).take(count)
        };
        Self {
            indices: (0u32..).zip(&cloud).flat_map(around).collect(),
            count,
        }
    }
}

impl Surfels {
    /// Discs for `points` (xyz after xyz, object frame).
    pub fn new(points: &[f64]) -> Self {
        Self::among(&Neighbourhoods::of(points), points)
    }

    /// Discs for `points`, each through the neighbours that it has in `neighbourhoods`, which are as many points'.
    pub fn among(neighbourhoods: &Neighbourhoods, points: &[f64]) -> Self {
        let points: Vec<Vector3<f64>> = points.chunks_exact(3).map(Vector3::from_column_slice).collect();
        let mut nearest_distances = Vec::with_capacity(points.len());
        let mut positions = [Vector3::zeros(); NEIGHBOURS];
        let discs = neighbourhoods
            .indices
            .chunks_exact(neighbourhoods.count.max(1))
            .map(|indices| {
                let positions = &mut positions[..indices.len()];
                for (position, &index) in positions.iter_mut().zip(indices) {
                    *position = points[index as usize];
                }
                let others = positions.iter().skip(1);
                let distances = others.map(|other| (other - positions[0]).norm());
                let (sum, nearest) = distances.fold((0.0, f64::INFINITY), |(sum, nearest), distance| {
                    (sum + distance, distance.min(nearest))
                });
                nearest_distances.extend(nearest.is_finite().then_some(nearest));
                let (normal, scatter) = tangent_plane(positions);
                Disc {
                    normal,
                    radius: RADIUS * sum / indices.len().saturating_sub(1).max(1) as f64,
                    scatter,
                }
            })
            .collect();
        let middle = nearest_distances.len() / 2;
        let spacing = if nearest_distances.is_empty() {
            0.0
        } else {
            *nearest_distances.select_nth_unstable_by(middle, f64::total_cmp).1
        };
        Self { discs, spacing }
    }

    /// The median distance from a point to its nearest neighbour, object units.
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Clears every pixel whose ray meets a disc well before its point. `in_camera` are all points; `nearest` holds each
    /// pixel's point or [`NO_POINT`].
    pub(super) fn remove_occluded(
        &self,
        in_camera: &[Vector3<f64>],
        camera: &Pinhole,
        camera_from_object: &Rotation3<f64>,
        (width, height): (usize, usize),
        nearest: &mut [u32],
    ) {
        let distances: Vec<f64> = in_camera.iter().map(|point| point.norm()).collect();
        // From the camera to each pixel's point; nothing hides a pixel without one, or one that is hidden already.
        let mut far = vec![f64::NEG_INFINITY; nearest.len()];
        for (far, &seen) in far.iter_mut().zip(&*nearest) {
            if seen != NO_POINT {
                *far = distances[seen as usize];
            }
        }
        for ((disc, centre), &distance) in self.discs.iter().zip(in_camera).zip(&distances) {
            let Some(pixel) = camera.project(centre) else {
                continue;
            };
            // No part of the disc is nearer than its centre by more than its radius.
            let hides_from = distance + (TOLERANCE - 1.0) * disc.radius;
            let normal = camera_from_object * disc.normal;
            let inverse_depth = 1.0 / centre.z;
            let reach_u = camera.fx * disc.radius * inverse_depth;
            let reach_v = camera.fy * disc.radius * inverse_depth;
            // Saturating casts: a disc that reaches beyond the image is cut at its edges.
            let left = (pixel.x - reach_u).max(0.0) as usize;
            let right = rounded_up(pixel.x + reach_u).min(width);
            let rows = (pixel.y - reach_v).max(0.0) as usize..rounded_up(pixel.y + reach_v).min(height);
            if left >= right {
                continue;
            }
            for first in rows.map(|row| row * width) {
                let row = first + left..first + right;
                for (far, seen) in far[row.clone()].iter_mut().zip(&mut nearest[row]) {
                    if *far > hides_from && disc.hides(centre, &normal, &in_camera[*seen as usize]) {
                        *far = f64::NEG_INFINITY;
                        *seen = NO_POINT;
                    }
                }
            }
        }
    }
}

/// `f64::ceil`, at least 0: without the function call that it is on processors of no particular kind.
fn rounded_up(x: f64) -> usize {
    let below = x as usize;
    below.saturating_add(usize::from(x > below as f64))
}

impl Disc {
    /// Whether the ray to `point` meets the disc at `centre` clearly before the point (all in the camera frame).
    fn hides(&self, centre: &Vector3<f64>, normal: &Vector3<f64>, point: &Vector3<f64>) -> bool {
        if normal.dot(&(point - centre)).abs() <= SCATTER_TOLERANCE * self.scatter {
            return false;
        }
        // Where along the ray (1 = at the point) it meets the disc's plane; edge-on discs hide nothing.
        let along = normal.dot(centre) / normal.dot(point);
        let behind = (1.0 - along) * point.norm();
        along > 0.0
            && behind > TOLERANCE * self.radius
            && (point * along - centre).norm_squared() < self.radius * self.radius
    }
}

#[cfg(test)]
impl Surfels {
    /// Per visible point: whether any disc whose square holds its pixel hides it.
    pub(super) fn hidden_literally(
        &self,
        points: &[f64],
        camera: &Pinhole,
        camera_from_object: &crate::geometry::Pose,
        visible: &[super::VisiblePoint],
    ) -> Vec<bool> {
        let in_camera = |point: usize| {
            camera_from_object.transform(&Vector3::from_column_slice(&points[3 * point..][..3]))
        };
        let hides = |disc: usize, seen: &super::VisiblePoint| {
            let (centre, disc) = (in_camera(disc), &self.discs[disc]);
            let Some(middle) = camera.project(&centre) else {
                return false;
            };
            let reach = |focal: f64| focal * disc.radius / centre.z;
            let within = |pixel: u32, middle: f64, reach: f64| {
                f64::from(pixel) + 1.0 > middle - reach && f64::from(pixel) < middle + reach
            };
            within(seen.pixel.0, middle.x, reach(camera.fx))
                && within(seen.pixel.1, middle.y, reach(camera.fy))
                && disc.hides(
                    &centre,
                    &(camera_from_object.rotation * disc.normal),
                    &in_camera(seen.point as usize),
                )
        };
        let hidden = |seen| (0..self.discs.len()).any(|disc| hides(disc, seen));
        visible.iter().map(hidden).collect()
    }
}
