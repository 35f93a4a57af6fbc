//! The input's own reconstruction, its depth put back into space, to be compared with the shape.

use crate::geometry::{Similarity, Vector2, Vector3};
use crate::report::RunResult;
use crate::sequence::Sequence;

/// As many points as a viewer shows without delay and a page holds in half a megabyte.
const MOST: usize = 24_000;

/// Points in the object frame with the colours of their pixels.
pub(super) struct Points {
    pub positions: Vec<[f32; 3]>,
    pub colours: Vec<[u8; 3]>,
}

/// Every so many-th pixel with depth inside a mask. Frames with a pose of the input are placed by it, as a whole
/// (`object_from_input`), and those without by the pose that was found.
/// `None` where no pixel has depth.
pub(super) fn of(sequence: &Sequence, result: &RunResult) -> Option<Points> {
    let known = |frame: usize| {
        let frame = &sequence.frames[frame];
        let depth = frame.depth.as_ref();
        depth.into_iter().flat_map(|depth| {
            let inside = depth.data().iter().zip(frame.mask.data()).enumerate();
            inside.filter_map(|(pixel, (&z, &on))| (on && z > 0.0).then_some((pixel, z)))
        })
    };
    let count: usize = (0..sequence.frames.len()).map(|frame| known(frame).count()).sum();
    let every = count.div_ceil(MOST).max(1);
    let mut points = Points {
        positions: Vec::new(),
        colours: Vec::new(),
    };
    let mut seen = 0;
    for (index, frame) in sequence.frames.iter().enumerate() {
        let Some(object_from_camera) = object_from_camera(index, sequence, result) else {
            continue;
        };
        for (pixel, z) in known(index) {
            seen += 1;
            if seen % every != 0 {
                continue;
            }
            let at = (pixel % frame.image.width(), pixel / frame.image.width());
            let centre = Vector2::new(at.0 as f64 + 0.5, at.1 as f64 + 0.5);
            let in_camera = frame.camera.unproject(&centre, f64::from(z));
            let point: Vector3<f64> = object_from_camera.transform(&in_camera);
            points.positions.push(point.map(|x| x as f32).into());
            let colour = frame.image[at].map(|part| part.round().clamp(0.0, 255.0) as u8);
            points.colours.push(colour);
        }
    }
    (!points.positions.is_empty()).then_some(points)
}

/// From the camera frame in the input's units to the object frame.
fn object_from_camera(index: usize, sequence: &Sequence, result: &RunResult) -> Option<Similarity> {
    let input = sequence.frames[index].camera_from_input;
    if let (Some(record), Some(camera_from_input)) = (&result.object_from_input, input) {
        let object_from_input = Similarity::from(record);
        let input_from_camera = camera_from_input.inverse();
        return Some(Similarity {
            scale: object_from_input.scale,
            rotation: object_from_input.rotation * input_from_camera.rotation,
            translation: object_from_input.transform(&input_from_camera.translation),
        });
    }
    let object_from_camera = result.frames[index].camera_from_object()?.inverse();
    Some(Similarity {
        scale: result.alpha.unwrap_or(1.0),
        rotation: object_from_camera.rotation,
        translation: object_from_camera.translation,
    })
}
