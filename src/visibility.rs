//! Pseudo-raytracing (Sec. 2.1): which points of X a camera sees, at most one per pixel of the image.
//!
//! The paper scatters X on an inverse-depth plane enlarged U times per axis, keeping the nearest point of each
//! cell, then max-pools U × U. Cells nest in pixels, so the nearest point of a pixel's nearest points is the
//! nearest of all that fall into the pixel: the result does not depend on U and the plane is never built.
//!
//! A point set is no surface: where the points are sparser than the pixels, the far side shows between the
//! points of the near side. [`Surfels`] (ours, not the paper's) close these gaps.

mod surfels;

pub(crate) use surfels::{Neighbourhoods, Surfels};

use crate::geometry::{Pinhole, Pose, Vector3};

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
    /// Per point of X: whether nothing hides it. All of `points` are, and with surfels also those that share a
    /// pixel with one of them and lie no more than a sample spacing behind it.
    pub unoccluded: Vec<bool>,
    /// Per point of X: the pixel that it falls into, counted row by row; `None` outside the image.
    pub cells: Vec<Option<u32>>,
}

/// The points (xyz after xyz, object frame) that the camera sees in an image of `size` (width, height).
///
/// Points behind the camera or outside the image are invisible; of several in one pixel the nearest is
/// visible, the lowest index on a tie. With `surfels` of the same points, a point behind another's disc is
/// invisible too; without, the result is the paper's.
pub fn visible_points(
    points: &[f64],
    camera: &Pinhole,
    camera_from_object: &Pose,
    size: (usize, usize),
    surfels: Option<&Surfels>,
) -> Visibility {
    let in_camera: Vec<Vector3<f64>> = points
        .chunks_exact(3)
        .map(|x| camera_from_object.transform(&Vector3::new(x[0], x[1], x[2])))
        .collect();
    let cells: Vec<Option<u32>> = in_camera
        .iter()
        .map(|point| camera.project(point).and_then(|u| cell(u.x, u.y, size)))
        .collect();
    let inverse_depths: Vec<f64> = in_camera.iter().map(|point| 1.0 / point.z).collect();
    let mut nearest = vec![NO_POINT; size.0 * size.1];
    for (index, cell) in (0u32..).zip(&cells) {
        let &Some(cell) = cell else { continue };
        let held = &mut nearest[cell as usize];
        if *held == NO_POINT || inverse_depths[index as usize] > inverse_depths[*held as usize] {
            *held = index;
        }
    }
    if let Some(surfels) = surfels {
        surfels.remove_occluded(
            &in_camera,
            camera,
            &camera_from_object.rotation,
            size,
            &mut nearest,
        );
    }
    let tolerance = surfels.map_or(0.0, Surfels::spacing);
    let unoccluded = in_camera
        .iter()
        .zip(&cells)
        .map(|(point, cell)| {
            cell.map(|cell| nearest[cell as usize])
                .filter(|&seen| seen != NO_POINT)
                .is_some_and(|seen| point.z <= 1.0 / inverse_depths[seen as usize] + tolerance)
        })
        .collect();
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
                inverse_depth: inverse_depths[point as usize],
            })
            .collect(),
        unoccluded,
        cells,
    }
}

/// Stands in a pixel that sees no point.
const NO_POINT: u32 = u32::MAX;

/// The pixel of the image point (`u`, `v`), counted row by row; `None` outside the image.
fn cell(u: f64, v: f64, (width, height): (usize, usize)) -> Option<u32> {
    (u >= 0.0 && v >= 0.0 && u < width as f64 && v < height as f64)
        .then_some((v as usize * width + u as usize) as u32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Rotation3;
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
        let surfels = Surfels::new(&points);
        let pose = pose();
        let seen = visible_points(&points, &CAMERA, &pose, SIZE, Some(&surfels));
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
            let surfels = Surfels::new(&points);
            let seen = visible_points(&points, &CAMERA, &pose(), SIZE, Some(&surfels));
            let near = |list: &[VisiblePoint]| list.iter().filter(|p| facing(&points, p.point) > 0.0).count();
            let far = |list: &[VisiblePoint], limb: f64| {
                list.iter().filter(|p| facing(&points, p.point) < -limb).count()
            };
            assert!(far(&through.points, 0.2) > 0, "the test would show nothing");
            // The limb, where front and back are closer together than the samples, stays undecided.
            assert_eq!(far(&seen.points, surfels.spacing() / 0.4), 0, "{count} points");
            assert!(
                near(&seen.points) as f64 >= 0.95 * near(&through.points) as f64,
                "{count} points"
            );
        }
    }

    /// A stretched shape has the same discs by its own neighbours and by those that its points had before.
    #[test]
    fn neighbours_stay_when_the_shape_changes() {
        let points = sphere(3000);
        let stretched: Vec<f64> = points
            .chunks_exact(3)
            .flat_map(|x| [x[0], 1.1 * x[1], x[2]])
            .collect();
        let own = Surfels::new(&stretched);
        let kept = Surfels::among(&Neighbourhoods::of(&points), &stretched);
        assert!((own.spacing() / kept.spacing() - 1.0).abs() < 0.01);
        let seen = |surfels: &Surfels| visible_points(&stretched, &CAMERA, &pose(), SIZE, Some(surfels));
        let (own, kept) = (seen(&own), seen(&kept));
        let differing = own
            .unoccluded
            .iter()
            .zip(&kept.unoccluded)
            .filter(|(a, b)| a != b);
        assert!(differing.count() < 30, "of 3000");
    }

    #[test]
    fn few_or_coinciding_points_have_discs_too() {
        for points in [vec![], vec![0.0, 0.0, 1.0], [0.1, 0.2, 1.0].repeat(20)] {
            let surfels = Surfels::new(&points);
            let seen = visible_points(&points, &CAMERA, &Pose::identity(), SIZE, Some(&surfels));
            assert_eq!(seen.points.len(), points.len().min(1));
            assert_eq!(surfels.spacing(), 0.0);
        }
    }

    /// What discs hide, looked for disc by disc and pixel by pixel, without the shortcuts.
    #[test]
    fn shortcuts_hide_what_all_discs_hide() {
        for count in [500, 2000, 8000] {
            let points = sphere(count);
            let surfels = Surfels::new(&points);
            let through = visible_points(&points, &CAMERA, &pose(), SIZE, None);
            let seen = visible_points(&points, &CAMERA, &pose(), SIZE, Some(&surfels));
            let hidden = surfels.hidden_literally(&points, &CAMERA, &pose(), &through.points);
            let kept = through.points.iter().zip(hidden).filter(|(_, hidden)| !hidden);
            let kept: Vec<VisiblePoint> = kept.map(|(point, _)| *point).collect();
            assert_eq!(seen.points, kept, "{count} points");
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
        let surfels = Surfels::new(&points);
        let all = visible_points(&points, &CAMERA, &Pose::identity(), SIZE, None);
        let seen = visible_points(&points, &CAMERA, &Pose::identity(), SIZE, Some(&surfels));
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
        let seen = visible_points(&points, &CAMERA, &pose, SIZE, Some(&Surfels::new(&points)));
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
