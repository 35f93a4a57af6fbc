//! Points on the outside of a mesh: what cameras all around it see.

use super::super::render::{View, depth};
use super::super::{Mesh, orbit};
use crate::geometry::{Pinhole, Vector2, Vector3};
use crate::image::DepthMap;
use rayon::prelude::*;

const DIRECTIONS: usize = 60;
/// Seen from fewer directions, a point counts as inside.
const LEAST_SEEN: usize = 2;
const SIZE_PX: usize = 384;
const DISTANCE: f64 = 3.0;
/// How far behind the z-buffer a point may lie and still be on its surface: about one pixel's width.
const TOLERANCE: f64 = 0.004;
/// Cell edge of the first thinning.
const FINE: f64 = 1.0 / 320.0;

/// At most `count` points, evenly spread, on what at least two of 60 cameras on a sphere see; object frame.
pub fn outside_points(mesh: &Mesh, count: usize) -> Vec<[f32; 3]> {
    let views: Vec<View> = (0..DIRECTIONS).map(view).collect();
    let maps: Vec<DepthMap> = views.par_iter().map(|view| depth(mesh, view)).collect();
    let seen: Vec<Vector3<f64>> = views
        .iter()
        .zip(&maps)
        .flat_map(|(view, map)| back_project(view, map))
        .collect();
    let outside: Vec<Vector3<f64>> = thin(&seen, FINE)
        .into_par_iter()
        .filter(|point| {
            let sees = |(view, map): &(&View, &DepthMap)| is_seen(view, map, point);
            views.iter().zip(&maps).filter(sees).take(LEAST_SEEN).count() == LEAST_SEEN
        })
        .collect();
    // The smallest cell that leaves no more than `count`.
    let (mut too_small, mut edge) = (FINE, 1.0);
    for _ in 0..20 {
        let middle = 0.5 * (too_small + edge);
        if thin(&outside, middle).len() > count {
            too_small = middle;
        } else {
            edge = middle;
        }
    }
    let kept = thin(&outside, edge);
    kept.iter()
        .map(|point| [point.x as f32, point.y as f32, point.z as f32])
        .collect()
}

/// Directions spread evenly over the sphere (Fibonacci).
fn view(index: usize) -> View {
    let golden_deg = 180.0 * (3.0 - 5f64.sqrt());
    let height = 1.0 - (2 * index + 1) as f64 / DIRECTIONS as f64;
    let side = SIZE_PX as f64;
    View {
        camera: Pinhole {
            fx: 0.92 * DISTANCE * side,
            fy: 0.92 * DISTANCE * side,
            cx: side / 2.0,
            cy: side / 2.0,
        },
        camera_from_object: orbit(golden_deg * index as f64, height.asin().to_degrees(), DISTANCE),
        width: SIZE_PX,
        height: SIZE_PX,
    }
}

fn back_project<'a>(view: &'a View, map: &'a DepthMap) -> impl Iterator<Item = Vector3<f64>> + 'a {
    let object_from_camera = view.camera_from_object.inverse();
    map.data()
        .iter()
        .enumerate()
        .filter(|&(_, &z)| z > 0.0)
        .map(move |(i, &z)| {
            let pixel = Vector2::new((i % map.width()) as f64 + 0.5, (i / map.width()) as f64 + 0.5);
            object_from_camera.transform(&view.camera.unproject(&pixel, f64::from(z)))
        })
}

fn is_seen(view: &View, map: &DepthMap, point: &Vector3<f64>) -> bool {
    let in_camera = view.camera_from_object.transform(point);
    let pixel = view.camera.project(&in_camera);
    let cell = pixel.and_then(|pixel| map.pixel_at(pixel.x, pixel.y));
    cell.is_some_and(|cell| map[cell] > 0.0 && in_camera.z <= f64::from(map[cell]) + TOLERANCE)
}

/// The first point of each cell of a grid, in the order of the cells.
fn thin(points: &[Vector3<f64>], edge: f64) -> Vec<Vector3<f64>> {
    let cell = |point: &Vector3<f64>| point.map(|x| (x / edge).floor() as i32).into();
    let mut cells: Vec<([i32; 3], usize)> = points.par_iter().map(cell).zip(0..points.len()).collect();
    cells.par_sort_unstable();
    cells.dedup_by_key(|(cell, _)| *cell);
    cells.into_iter().map(|(_, index)| points[index]).collect()
}
