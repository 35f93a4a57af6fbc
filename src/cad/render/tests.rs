use super::super::{Material, Texture, Triangle};
use super::*;
use std::sync::Arc;

const FLAT: Light = Light {
    fixed_to: LightFrame::Object,
    direction: [0.0, 1.0, 0.0],
    ambient: 1.0,
    diffuse: 0.0,
};

fn view(width: usize, height: usize) -> Viewpoint {
    Viewpoint {
        camera: Pinhole {
            fx: 100.0,
            fy: 100.0,
            cx: width as f64 / 2.0,
            cy: height as f64 / 2.0,
        },
        camera_from_object: Pose::identity(),
        width,
        height,
    }
}

/// A square in the camera's own frame: corners (left, up), (right, up), (right, down), (left, down), with z each.
fn square(half: f64, z: [f64; 4], texture: Option<Texture>) -> Mesh {
    let at = |x: f64, y: f64, z: f64| Vector3::new(x, y, z);
    let uv = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];
    let triangle = |v: [usize; 3]| Triangle {
        vertices: v.map(|i| i as u32),
        texture_coordinates: v.map(|i| uv[i]),
        material: 0,
    };
    Mesh {
        vertices: vec![
            at(-half, -half, z[0]),
            at(half, -half, z[1]),
            at(half, half, z[2]),
            at(-half, half, z[3]),
        ],
        triangles: vec![triangle([0, 1, 2]), triangle([0, 3, 2])],
        materials: vec![Material {
            diffuse: [1.0; 3],
            opacity: 1.0,
            texture: texture.map(Arc::new),
        }],
    }
}

#[test]
fn edges_fall_where_the_camera_projects_them() {
    // At z = 2 the square covers pixels (u − cx) ∈ [−10, 10]: columns 10..30 of 40, half covered at no edge.
    let mesh = square(0.2, [2.0; 4], None);
    let rendering = Renderer::new(&mesh, 3).render(&view(40, 30), &FLAT);
    for row in 0..30 {
        for column in 0..40 {
            let inside = (10..30).contains(&column) && (5..25).contains(&row);
            assert_eq!(rendering.mask[(column, row)], inside, "{column} {row}");
            assert_eq!(rendering.depth[(column, row)], if inside { 2.0 } else { 0.0 });
            assert_eq!(rendering.coverage[(column, row)], if inside { 1.0 } else { 0.0 });
        }
    }
}

#[test]
fn partly_covered_pixels_are_blended_and_masked_by_their_centre() {
    // Edges at 20 ± 10.5 px: half of columns 9 and 30.
    let mesh = square(0.21, [2.0; 4], None);
    let mut view = view(40, 40);
    view.camera.cx += 0.1;
    let rendering = Renderer::new(&mesh, 9).render(&view, &FLAT);
    // Left edge at 9.6, right edge at 30.6.
    assert!(!rendering.mask[(9, 20)] && rendering.mask[(30, 20)]);
    assert!((rendering.coverage[(9, 20)] - 0.4).abs() < 0.06);
    assert!((rendering.coverage[(30, 20)] - 0.6).abs() < 0.06);
    assert!((rendering.image[(9, 20)][0] - 255.0 * rendering.coverage[(9, 20)]).abs() < 0.1);
}

#[test]
fn depth_is_exact_at_pixel_centres_of_a_slanted_plane() {
    // The plane z = 2 + x.
    let mesh = square(0.5, [1.5, 2.5, 2.5, 1.5], None);
    let view = view(40, 30);
    let rendering = Renderer::new(&mesh, 3).render(&view, &FLAT);
    for column in 0..40 {
        let ray = (column as f64 + 0.5 - view.camera.cx) / view.camera.fx;
        let expected = 2.0 / (1.0 - ray);
        assert!(
            (f64::from(rendering.depth[(column, 15)]) - expected).abs() < 1e-6,
            "{column}"
        );
    }
}

#[test]
fn textures_are_upright_unmirrored_and_perspective_correct() {
    // Columns of the texture are told apart by red, rows by green.
    let size = 64;
    let texture = Texture {
        image: Grid::from_fn(size, size, |c, r| [c as f32 * 4.0, r as f32 * 4.0, 0.0]),
        alpha: None,
    };
    let mesh = square(0.5, [1.5, 2.5, 2.5, 1.5], Some(texture));
    let view = view(40, 30);
    let rendering = Renderer::new(&mesh, 1).render(&view, &FLAT);
    for (column, row) in [(10, 8), (20, 15), (30, 20)] {
        let z = f64::from(rendering.depth[(column, row)]);
        let pixel = nalgebra::Vector2::new(column as f64 + 0.5, row as f64 + 0.5);
        let point = view.camera.unproject(&pixel, z);
        let [red, green, _] = rendering.image[(column, row)];
        let expected = |x: f64| ((x + 0.5) * size as f64 - 0.5) * 4.0;
        assert!(
            (f64::from(red) - expected(point.x)).abs() < 0.01,
            "{column}: {red}"
        );
        assert!(
            (f64::from(green) - expected(point.y)).abs() < 0.01,
            "{row}: {green}"
        );
    }
}

#[test]
fn the_nearer_surface_hides_and_transparent_texels_do_not() {
    let near = |alpha: f32| {
        square(
            0.2,
            [1.0; 4],
            Some(Texture {
                image: Grid::filled(2, 2, [10.0; 3]),
                alpha: Some(vec![alpha; 4]),
            }),
        )
    };
    for (alpha, expected) in [(1.0, 1.0), (0.0, 2.0)] {
        let mut mesh = square(0.4, [2.0; 4], None);
        mesh.append(near(alpha));
        assert_eq!(
            Renderer::new(&mesh, 1).render(&view(20, 20), &FLAT).depth[(10, 10)],
            expected
        );
    }
}

#[test]
fn surfaces_across_the_near_plane_are_clipped() {
    // The plane y = 0.5 (a floor) from behind the camera to z = 4.
    let mut mesh = square(1.0, [-1.0, -1.0, 4.0, 4.0], None);
    for vertex in &mut mesh.vertices {
        vertex.x *= 4.0;
        vertex.y = 0.5;
    }
    let map = Renderer::new(&mesh, 1).render(&view(40, 60), &FLAT).depth;
    assert_eq!(map[(20, 20)], 0.0);
    // Row 55.5 − 30 = 25.5 px down: z = 0.5 · 100 / 25.5.
    assert!((f64::from(map[(20, 55)]) - 50.0 / 25.5).abs() < 1e-6);
}

#[test]
fn a_light_fixed_to_the_object_turns_with_it_and_one_fixed_to_the_camera_does_not() {
    let mesh = square(0.4, [0.0; 4], None);
    let quarter = nalgebra::Rotation3::from_axis_angle(&Vector3::y_axis(), 0.8);
    let seen = |fixed_to, rotation| {
        let light = Light {
            fixed_to,
            direction: [0.0, 0.0, -1.0],
            ambient: 0.0,
            diffuse: 1.0,
        };
        let mut view = view(20, 20);
        view.camera_from_object = Pose {
            rotation,
            translation: Vector3::new(0.0, 0.0, 2.0),
        };
        Renderer::new(&mesh, 1).render(&view, &light).image[(10, 10)][0]
    };
    let straight = nalgebra::Rotation3::identity();
    assert!((seen(LightFrame::Object, straight) - 255.0).abs() < 0.1);
    assert!((seen(LightFrame::Object, quarter) - 255.0).abs() < 0.1);
    assert!((seen(LightFrame::Camera, quarter) - 255.0 * 0.8f32.cos()).abs() < 0.1);
}
