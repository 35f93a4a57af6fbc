//! Pseudo-raytracing (Sec. 2.1): which points of X a camera sees, at most one per pixel of the image.
//!
//! The paper scatters X on an inverse-depth plane enlarged U times per axis, keeping the nearest point of each
//! cell, then max-pools U × U. Cells nest in pixels, so the nearest point of a pixel's nearest points is the
//! nearest of all that fall into the pixel: the result does not depend on U and the plane is never built.
//!
//! A point set is no surface: where the points are sparser than the pixels, the far side shows between the
//! points of the near side. A [`Cover`] (ours, not the paper's) closes these gaps.

mod cover;

pub(crate) use cover::Cover;

use crate::geometry::{Pinhole, Pose, Vector3};
use crate::surface::{Projected, pixel_of};

/// The point of X that one pixel sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VisiblePoint {
    /// The pixel (column, row).
    pub pixel: (u32, u32),
    /// The point's index in X.
    pub point: u32,
    /// The inverse depth 1 / z_cam.
    pub inverse_depth: f64,
}

/// What one camera sees of X: X_p = M(X; p).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Visibility {
    /// The visible points, in row-major order of their pixels.
    pub points: Vec<VisiblePoint>,
    /// Per point of X: whether nothing hides it. All of `points` are, and with a cover also those that share a
    /// pixel with one of them.
    pub unoccluded: Vec<bool>,
    /// Per point of X: the pixel that it falls into, counted row by row; `None` outside the image.
    pub cells: Vec<Option<u32>>,
}

/// The points (xyz after xyz, object frame) that the camera sees in an image of `size` (width, height).
///
/// Points behind the camera or outside the image are invisible, and so are those that `cover` hides; of several in one pixel the nearest is
/// visible, the lowest index on a tie. Without a cover, points hide others in their own pixel alone, as in the paper.
pub fn visible_points(
    points: &[f64],
    camera: &Pinhole,
    camera_from_object: &Pose,
    size: (usize, usize),
    cover: Option<&Cover>,
) -> Visibility {
    let projected: Vec<Option<Projected>> = points
        .chunks_exact(3)
        .map(|x| {
            Projected::new(
                &camera_from_object.transform(&Vector3::new(x[0], x[1], x[2])),
                camera,
            )
        })
        .collect();
    let cell = |p: Projected| pixel_of(p.u, p.v, size).map(|(column, row)| (row * size.0 + column) as u32);
    let cells: Vec<Option<u32>> = projected.iter().map(|point| point.and_then(cell)).collect();
    let hidden = cover.map(|cover| cover.hidden(&projected, camera, camera_from_object, size));
    let mut nearest = vec![NO_POINT; size.0 * size.1];
    // Behind the camera nothing has a pixel.
    let z = |index: u32| projected[index as usize].map_or(f64::INFINITY, |p| p.z);
    for (index, cell) in (0u32..).zip(&cells) {
        let &Some(cell) = cell else { continue };
        if hidden.as_ref().is_some_and(|hidden| hidden[index as usize]) {
            continue;
        }
        let held = &mut nearest[cell as usize];
        if *held == NO_POINT || z(index) < z(*held) {
            *held = index;
        }
    }
    let unoccluded = match hidden {
        Some(hidden) => cells
            .iter()
            .zip(hidden)
            .map(|(cell, hidden)| cell.is_some() && !hidden)
            .collect(),
        None => (0u32..)
            .zip(&cells)
            .map(|(index, cell)| cell.is_some_and(|cell| z(index) <= z(nearest[cell as usize])))
            .collect(),
    };
    let rows = (0u32..).zip(nearest.chunks_exact(size.0.max(1)));
    let visible = rows.flat_map(|(row, cells)| {
        let seen = (0u32..).zip(cells).filter(|&(_, &point)| point != NO_POINT);
        seen.map(move |(column, &point)| (column, row, point))
    });
    Visibility {
        points: visible
            .map(|(column, row, point)| VisiblePoint {
                pixel: (column, row),
                point,
                inverse_depth: 1.0 / z(point),
            })
            .collect(),
        unoccluded,
        cells,
    }
}

/// Stands in a pixel that sees no point.
const NO_POINT: u32 = u32::MAX;

#[cfg(test)]
mod tests {
    use super::cover::vectors;
    use super::*;
    use crate::geometry::Rotation3;
    use crate::prior::LinearPrior;
    use crate::surface::{ClosedMesh, Mesh, spacing};
    use proptest::prelude::*;

    const CAMERA: Pinhole = Pinhole {
        fx: 300.0,
        fy: 310.0,
        cx: 100.0,
        cy: 80.0,
    };
    const SIZE: (usize, usize) = (200, 160);

    fn pose() -> Pose {
        Pose {
            rotation: Rotation3::from_scaled_axis(Vector3::new(0.3, -0.8, 0.2)),
            translation: Vector3::new(0.05, -0.02, 1.6),
        }
    }

    /// A Fibonacci sphere of radius 0.4.
    fn sphere(count: usize) -> Vec<f64> {
        (0..count)
            .flat_map(|i| {
                let y = 1.0 - 2.0 * (i as f64 + 0.5) / count as f64;
                let (angle, r) = (i as f64 * 2.399963229728653, (1.0 - y * y).sqrt());
                [0.4 * r * angle.cos(), 0.4 * y, 0.4 * r * angle.sin()]
            })
            .collect()
    }

    #[test]
    fn the_nearest_point_of_a_pixel_wins_and_the_first_on_a_tie() {
        let points = [
            0.0, 0.0, 2.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0, 9.0, 0.0, 1.0,
        ];
        let seen = visible_points(&points, &CAMERA, &Pose::identity(), SIZE, None);
        assert_eq!(
            seen.points,
            [VisiblePoint {
                pixel: (100, 80),
                point: 1,
                inverse_depth: 1.0
            }]
        );
    }

    #[test]
    fn the_far_side_is_hidden_and_neighbours_in_one_pixel_are_not() {
        let points = sphere(4000);
        let cover = Cover::around(&points);
        let pose = pose();
        let seen = visible_points(&points, &CAMERA, &pose, SIZE, Some(&cover));
        let centre = pose.transform(&Vector3::zeros());
        let (mut near, mut far) = ((0, 0), (0, 0));
        for (x, &unoccluded) in points.chunks_exact(3).zip(&seen.unoccluded) {
            let normal = pose.rotation * Vector3::new(x[0], x[1], x[2]).normalize();
            let cosine = -normal.dot(&(centre + 0.4 * normal).normalize());
            let side = if cosine > 0.3 { &mut near } else { &mut far };
            if cosine.abs() > 0.3 {
                side.0 += 1;
                side.1 += usize::from(unoccluded);
            }
        }
        assert!(near.1 as f64 > 0.98 * near.0 as f64, "{near:?} of the near side");
        assert!((far.1 as f64) < 0.02 * far.0 as f64, "{far:?} of the far side");
    }

    #[test]
    fn pixels_come_in_row_major_order() {
        let seen = visible_points(&sphere(500), &CAMERA, &pose(), SIZE, None);
        let order: Vec<_> = seen.points.iter().map(|p| (p.pixel.1, p.pixel.0)).collect();
        assert!(order.len() > 300 && order.is_sorted());
    }

    /// The paper's words: rounded scatter on a U-fold plane, then max-pooling U × U.
    fn literally(points: &[f64], enlargement: usize) -> Vec<(usize, f64)> {
        let (width, height) = (SIZE.0 * enlargement, SIZE.1 * enlargement);
        let mut plane = vec![0.0f64; width * height];
        for x in points.chunks_exact(3) {
            let point = pose().transform(&Vector3::new(x[0], x[1], x[2]));
            let pixel = CAMERA.project(&point).unwrap() * enlargement as f64;
            if pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x < width as f64 && pixel.y < height as f64 {
                // Cell centres are at +0.5: the nearest one is found by rounding down.
                let cell = &mut plane[pixel.y as usize * width + pixel.x as usize];
                *cell = cell.max(1.0 / point.z);
            }
        }
        (0..SIZE.0 * SIZE.1)
            .map(|i| {
                let (column, row) = (i % SIZE.0 * enlargement, i / SIZE.0 * enlargement);
                let block = (0..enlargement * enlargement)
                    .map(|k| plane[(row + k / enlargement) * width + column + k % enlargement]);
                (i, block.fold(0.0, f64::max))
            })
            .filter(|&(_, inverse_depth)| inverse_depth > 0.0)
            .collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]
        #[test]
        fn the_enlarged_plane_changes_nothing(enlargement in 1usize..6, count in 100usize..20000) {
            let points = sphere(count);
            let seen = visible_points(&points, &CAMERA, &pose(), SIZE, None);
            let ours: Vec<_> = seen.points.iter()
                .map(|p| (p.pixel.1 as usize * SIZE.0 + p.pixel.0 as usize, p.inverse_depth))
                .collect();
            prop_assert_eq!(ours, literally(&points, enlargement));
        }
    }

    /// Cosine between the outward normal and the direction to the camera.
    fn facing(points: &[f64], index: u32) -> f64 {
        let x = &points[3 * index as usize..][..3];
        let normal = Vector3::new(x[0], x[1], x[2]) / 0.4;
        let to_camera = pose().center() - 0.4 * normal;
        normal.dot(&to_camera.normalize())
    }

    #[test]
    fn a_sparse_sphere_hides_its_far_side() {
        for count in [500, 2000, 8000] {
            let points = sphere(count);
            let through = visible_points(&points, &CAMERA, &pose(), SIZE, None);
            let cover = Cover::around(&points);
            let seen = visible_points(&points, &CAMERA, &pose(), SIZE, Some(&cover));
            let near = |list: &[VisiblePoint]| list.iter().filter(|p| facing(&points, p.point) > 0.0).count();
            let far = |list: &[VisiblePoint], limb: f64| {
                list.iter().filter(|p| facing(&points, p.point) < -limb).count()
            };
            assert!(far(&through.points, 0.2) > 0, "the test would show nothing");
            // The limb, where front and back are closer together than the samples, stays undecided.
            assert_eq!(
                far(&seen.points, spacing(&vectors(&points)) / 0.4),
                0,
                "{count} points"
            );
            assert!(
                near(&seen.points) as f64 >= 0.95 * near(&through.points) as f64,
                "{count} points"
            );
        }
    }

    /// A stretched shape has the same triangles by its own neighbours and by those that its points had before.
    #[test]
    fn neighbours_stay_when_the_shape_changes() {
        let points = sphere(3000);
        let stretched: Vec<f64> = points
            .chunks_exact(3)
            .flat_map(|x| [x[0], 1.1 * x[1], x[2]])
            .collect();
        let own = Cover::around(&stretched);
        let prior = LinearPrior::new(points.clone(), vec![], 0, vec![[0.0, 0.0, -1.0]; 3000]).unwrap();
        let kept = Cover::of(&prior, &[], &points).at(&prior, &[], &stretched);
        let seen = |cover: &Cover| visible_points(&stretched, &CAMERA, &pose(), SIZE, Some(cover));
        let (own, kept) = (seen(&own), seen(&kept));
        let differing = own
            .unoccluded
            .iter()
            .zip(&kept.unoccluded)
            .filter(|(a, b)| a != b);
        assert!(differing.count() < 30, "of 3000");
    }

    #[test]
    fn few_or_coinciding_points_have_a_cover_too() {
        for points in [vec![], vec![0.0, 0.0, 1.0], [0.1, 0.2, 1.0].repeat(20)] {
            let cover = Cover::around(&points);
            let seen = visible_points(&points, &CAMERA, &Pose::identity(), SIZE, Some(&cover));
            assert_eq!(seen.points.len(), points.len().min(1));
        }
    }

    /// A mesh hides what is behind it wherever the image's pixels lie, and nothing of itself.
    #[test]
    fn a_mesh_hides_what_lies_behind_it_and_not_itself() {
        let corner = |x: f64, y: f64| Vector3::new(x, y, 2.0 + x);
        let mesh = Mesh {
            vertices: vec![corner(-0.3, -0.3), corner(0.3, -0.3), corner(0.0, 0.4)],
            // The camera, from which y points down, sees it counter-clockwise.
            faces: vec![[0, 2, 1]],
        };
        let weights = |i: usize| {
            let (a, b) = ((i % 20) as f64 / 20.0, (i / 20) as f64 / 20.0);
            (a + b <= 1.0).then_some([1.0 - a - b, a, b])
        };
        let on: Vec<Vector3<f64>> = (0..400)
            .filter_map(weights)
            .map(|w| mesh.vertices[0] * w[0] + mesh.vertices[1] * w[1] + mesh.vertices[2] * w[2])
            .collect();
        let at = |scale: f64| on.iter().flat_map(move |x| <[f64; 3]>::from(x * scale));
        // On the same rays: nearer, on the mesh, behind it, and behind the camera.
        let points: Vec<f64> = at(0.9).chain(at(1.0)).chain(at(1.1)).chain(at(-1.0)).collect();
        for size in [SIZE, (9, 7)] {
            let scale = size.0 as f64 / SIZE.0 as f64;
            let camera = Pinhole {
                fx: CAMERA.fx * scale,
                fy: CAMERA.fy * scale,
                cx: CAMERA.cx * scale,
                cy: CAMERA.cy * scale,
            };
            let cover = Cover::Mesh(ClosedMesh::new(mesh.clone()));
            let seen = visible_points(&points, &camera, &Pose::identity(), size, Some(&cover));
            let unoccluded = |block: usize| &seen.unoccluded[block * on.len()..(block + 1) * on.len()];
            assert!(unoccluded(0).iter().all(|&seen| seen));
            assert!(unoccluded(1).iter().all(|&seen| seen));
            // But on the mesh's own outline, where rounding decides.
            let hidden = unoccluded(2).iter().filter(|&&seen| !seen).count();
            assert!(hidden >= on.len() - 60, "{hidden} of {}", on.len());
            assert!(!unoccluded(3).iter().any(|&seen| seen));
        }
    }

    /// A slanted plane in front of another: nothing of the front one is lost, everything behind it is.
    #[test]
    fn slanted_planes_do_not_hide_themselves() {
        let plane = |offset: f64| {
            (0..1600).flat_map(move |i| {
                let (a, b) = ((i % 40) as f64 / 40.0 - 0.5, (i / 40) as f64 / 40.0 - 0.5);
                [0.25 * a, 0.6 * b, 2.0 + a + offset]
            })
        };
        let points: Vec<f64> = plane(0.0).chain(plane(0.5)).collect();
        let cover = Cover::around(&points);
        let all = visible_points(&points, &CAMERA, &Pose::identity(), SIZE, None);
        let seen = visible_points(&points, &CAMERA, &Pose::identity(), SIZE, Some(&cover));
        let front = |list: &Visibility| list.points.iter().filter(|p| p.point < 1600).count();
        assert_eq!(front(&seen), front(&all));
        assert!(front(&all) > 1000);
        let behind = seen.points.iter().filter(|p| {
            let (a, b) = (
                (p.point % 40) as f64 / 40.0 - 0.5,
                (p.point / 40 % 40) as f64 / 40.0 - 0.5,
            );
            p.point >= 1600 && a.abs() < 0.3 && b.abs() < 0.3
        });
        assert_eq!(behind.count(), 0);
    }

    /// Edges, where no tangent plane fits, hide little of the faces that meet there.
    #[test]
    fn a_cube_keeps_its_near_faces() {
        let side = 24;
        let share = |i: usize| i as f64 / (side - 1) as f64 * 0.6 - 0.3;
        let points: Vec<f64> = (0..side * side * side)
            .map(|i| [i % side, i / side % side, i / side / side])
            .filter(|cell| cell.iter().any(|&c| c == 0 || c == side - 1))
            .flat_map(|cell| cell.map(share))
            .collect();
        // Looks at the faces −x, −y and −z from about the same angle each.
        let eye = Vector3::new(-1.3, -1.1, -1.5);
        let pose = Pose {
            rotation: Rotation3::look_at_lh(&-eye, &Vector3::y()),
            translation: Vector3::new(0.0, 0.0, eye.norm()),
        };
        let near = |p: &&VisiblePoint| points[3 * p.point as usize..][..3].iter().any(|&x| x < -0.299);
        let count = |seen: &Visibility| seen.points.iter().filter(near).count();
        let all = visible_points(&points, &CAMERA, &pose, SIZE, None);
        let seen = visible_points(&points, &CAMERA, &pose, SIZE, Some(&Cover::around(&points)));
        assert!(
            all.points.len() - count(&all) > 500,
            "the test would show nothing"
        );
        assert!(
            count(&seen) as f64 > 0.97 * count(&all) as f64,
            "{} of {}",
            count(&seen),
            count(&all)
        );
        let far = seen.points.len() - count(&seen);
        assert!(far < 40, "{far}, more than the outline's");
    }
}
