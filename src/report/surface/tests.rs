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
        let (mut missing, mut leaks, mut outside, mut outline, mut area, mut error) = (0, 0, 0, 0, 0, 0.0);
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
