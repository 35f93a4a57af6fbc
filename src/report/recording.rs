//! The solve as a recording for the rerun viewer.

use super::overlay;
use super::{ReportError, Surface};
use crate::files::write_whole;
use crate::geometry;
use crate::init::Estimate;
use crate::prior::LearnedPrior;
use crate::sequence::Sequence;
use crate::solver::{ObjectiveValue, Solution, TraceRow};
use image::codecs::png::PngEncoder;
use re_sdk::{AsComponents, EntityPathPart, RecordingStream, RecordingStreamBuilder};
use re_sdk_types::archetypes::{
    EncodedImage, Mesh3D, Pinhole, Scalars, SeriesLines, Transform3D, ViewCoordinates,
};
use re_sdk_types::components::TransformRelation;
use std::io::Error;
use std::path::Path;

/// Counts the iterations of the main solve and of the free form's stage, as the rows of `trace.csv` but for the short solves'.
const TIMELINE: &str = "iteration";

const OBJECTIVE: &str = "objective";
type ValueOf = fn(&ObjectiveValue) -> f64;
/// What the objective's curves are called, and what they show.
const TERMS: [(&str, ValueOf); 7] = [
    ("total", |of| of.total),
    ("photometric", |of| of.photometric),
    ("silhouette", |of| of.silhouette),
    ("inverse depth", |of| of.inverse_depth),
    ("style", |of| of.style),
    ("motion", |of| of.motion),
    ("focal length", |of| of.focal),
];

/// Writes `path` (`.rrd`) for the rerun viewer: the mesh and the cameras with their pictures after every call of the main solve and as they were
/// found, and the objective by term over the iterations. Object frame, diagonals. `sequence` has the cameras that were found. The file has the
/// clock's time in it, so that no two are equal.
///
/// # Errors
/// A file that cannot be written.
pub fn write_recording(
    sequence: &Sequence,
    prior: &LearnedPrior,
    solution: &Solution,
    surface: &Surface,
    path: &Path,
) -> Result<(), ReportError> {
    let bytes = || {
        let (stream, storage) = RecordingStreamBuilder::new("spba-ceres")
            .memory()
            .map_err(Error::other)?;
        record(sequence, prior, solution, surface, stream)?;
        storage.drain_as_bytes().map_err(Error::other)
    };
    let written = bytes().and_then(|bytes| write_whole(path, &bytes));
    written.map_err(ReportError::io(path))
}

fn record(
    sequence: &Sequence,
    prior: &LearnedPrior,
    solution: &Solution,
    surface: &Surface,
    stream: RecordingStream,
) -> Result<(), Error> {
    let recorder = Recorder {
        sequence,
        focal_factor: solution.estimate.focal_factor,
        stream,
    };
    recorder.pictures()?;
    let trace: Vec<&TraceRow> = solution
        .trace
        .iter()
        .filter(|row| !row.stage.contains("hypothesis"))
        .collect();
    for (iteration, row) in trace.iter().enumerate() {
        recorder.at(iteration);
        recorder.objective(row)?;
    }
    // A call's last row comes before the first one of the next, and is the state after it. There are no steps of the free form's stage.
    let starts_call = |next: usize| trace.get(next).is_none_or(|row| row.iteration == 0);
    let has_step = |row: usize| !trace[row].stage.contains("free-form");
    let call_ends = (0..trace.len()).filter(|&row| starts_call(row + 1) && has_step(row));
    for (step, row) in solution.steps.iter().zip(call_ends) {
        recorder.at(row);
        let (surface, estimate) = Surface::of_estimate(prior, &step.estimate);
        recorder.state(&surface, &estimate)?;
    }
    recorder.at(trace.len());
    recorder.state(surface, &solution.estimate)
}

struct Recorder<'a> {
    sequence: &'a Sequence,
    /// By which the sequence's focal lengths are multiplied already.
    focal_factor: f64,
    stream: RecordingStream,
}

impl Recorder<'_> {
    fn at(&self, iteration: usize) {
        self.stream.set_time_sequence(TIMELINE, iteration as i64);
    }

    fn camera(&self, index: usize) -> String {
        let name = EntityPathPart::new(self.sequence.frames[index].name.as_str());
        format!("object/cameras/{}", name.escaped_string())
    }

    /// Of an estimate, pixels, for a camera of the sequence.
    fn intrinsics(&self, found: &geometry::Pinhole, estimate: &Estimate) -> geometry::Pinhole {
        let factor = estimate.focal_factor / self.focal_factor;
        geometry::Pinhole {
            fx: factor * found.fx,
            fy: factor * found.fy,
            ..*found
        }
    }

    /// What does not change: the axes, the terms' names and the frames' pictures.
    fn pictures(&self) -> Result<(), Error> {
        let log = |to: &str, what: &dyn AsComponents| self.stream.log_static(to, what).map_err(Error::other);
        log("object", &ViewCoordinates::RIGHT_HAND_Y_UP())?;
        log(
            OBJECTIVE,
            &SeriesLines::new().with_names(TERMS.map(|(name, _)| name)),
        )?;
        for (index, frame) in self.sequence.frames.iter().enumerate() {
            let mut png = Vec::new();
            overlay::picture(&frame.image)
                .write_with_encoder(PngEncoder::new(&mut png))
                .map_err(Error::other)?;
            log(&self.camera(index), &EncodedImage::from_file_contents(png))?;
        }
        Ok(())
    }

    fn objective(&self, row: &TraceRow) -> Result<(), Error> {
        let values = TERMS.map(|(_, value)| value(&row.objective));
        self.stream
            .log(OBJECTIVE, &Scalars::new(values))
            .map_err(Error::other)
    }

    fn state(&self, surface: &Surface, estimate: &Estimate) -> Result<(), Error> {
        let single = |v: &geometry::Vector3<f64>| [v.x as f32, v.y as f32, v.z as f32];
        let (vertices, normals, faces) = match surface.mesh() {
            Some(mesh) => (&mesh.vertices[..], &mesh.normals[..], &mesh.faces[..]),
            None => (surface.points(), surface.normals(), surface.facets()),
        };
        let mesh = Mesh3D::new(vertices.iter().map(single))
            .with_vertex_normals(normals.iter().map(single))
            .with_triangle_indices(faces.iter().copied());
        self.stream.log("object/mesh", &mesh).map_err(Error::other)?;
        for (index, frame) in self.sequence.frames.iter().enumerate() {
            let pose = &estimate.camera_from_object[index];
            let columns = [0, 1, 2].map(|column| single(&pose.rotation.matrix().column(column).into()));
            let camera_from_object = Transform3D::from_translation_mat3x3(single(&pose.translation), columns)
                .with_relation(TransformRelation::ChildFromParent);
            let camera = self.intrinsics(&frame.camera, estimate);
            let (width, height) = frame.image.size();
            let (fx, fy) = (camera.fx as f32, camera.fy as f32);
            let (cx, cy) = (camera.cx as f32, camera.cy as f32);
            // Column by column.
            let pinhole = Pinhole::new([[fx, 0.0, 0.0], [0.0, fy, 0.0], [cx, cy, 1.0]])
                .with_resolution([width as f32, height as f32])
                .with_image_plane_distance(0.1);
            let to = self.camera(index);
            self.stream
                .log(to.as_str(), &camera_from_object)
                .map_err(Error::other)?;
            self.stream.log(to, &pinhole).map_err(Error::other)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture;
    use crate::solver::StepState;
    use re_sdk::log::{Chunk, LogMsg};
    use std::collections::BTreeMap;

    #[test]
    fn a_recording_has_every_state_in_the_place_of_its_iteration() -> Result<(), Box<dyn std::error::Error>> {
        let prior = crate::prior::open("car")?.0;
        let style = vec![0.0; crate::prior::ShapePrior::style_len(&prior)];
        let shape = Surface::from_points(fixture::box_car(500));
        let (sequence, mut solution) = fixture::solved(&shape, 2);
        solution.estimate.style = style;
        let state = StepState {
            level: 0,
            estimate: solution.estimate.clone(),
            iterations: 2,
            evaluations: solution.evaluations,
            cpu_seconds: 0.0,
        };
        solution.steps = vec![state; 3];
        let row = solution.trace[0].clone();
        let rows = [
            ("hypothesis-0/level-1", 0),
            ("level-0", 0),
            ("level-0", 1),
            ("level-0", 0),
            ("level-0", 1),
            ("free-form/level-0", 0),
            ("again-level-0", 0),
            ("again-free-form/level-0", 0),
        ];
        solution.trace = rows
            .map(|(stage, iteration)| TraceRow {
                stage: stage.to_owned(),
                iteration,
                ..row.clone()
            })
            .to_vec();

        let (stream, storage) = RecordingStreamBuilder::new("test").memory()?;
        record(&sequence, &prior, &solution, &shape, stream)?;
        let mut iterations = BTreeMap::<String, Vec<i64>>::new();
        for message in storage.take() {
            let LogMsg::ArrowMsg(_, message) = message else {
                continue;
            };
            let chunk = Chunk::from_arrow_msg(&message)?;
            let times = chunk.timelines().get(&TIMELINE.into());
            iterations
                .entry(chunk.entity_path().to_string())
                .or_default()
                .extend(times.into_iter().flat_map(|column| column.times_raw()));
        }
        let camera = format!("/object/cameras/{}", sequence.frames[1].name);
        for (path, expected) in [
            ("/objective", &[0, 1, 2, 3, 4, 5, 6][..]),
            ("/object/mesh", &[1, 3, 5, 7]),
            // The transform and the intrinsics.
            (&camera, &[1, 1, 3, 3, 5, 5, 7, 7]),
        ] {
            let mut found = iterations.get(path).cloned().unwrap_or_default();
            found.sort_unstable();
            assert_eq!(found, expected, "{path} of {:?}", iterations.keys());
        }
        Ok(())
    }
    #[test]
    fn a_found_focal_length_counts_once() -> Result<(), Box<dyn std::error::Error>> {
        let shape = Surface::from_points(fixture::box_car(500));
        let (sequence, solution) = fixture::solved(&shape, 1);
        let recorder = Recorder {
            sequence: &sequence,
            focal_factor: 1.25,
            stream: RecordingStreamBuilder::new("test").memory()?.0,
        };
        let camera = sequence.frames[0].camera;
        let of = |focal_factor| {
            let estimate = Estimate {
                focal_factor,
                ..solution.estimate.clone()
            };
            recorder.intrinsics(&camera, &estimate)
        };
        assert_eq!(of(1.25), camera);
        assert_eq!((of(1.0).fx, of(1.0).cx), (camera.fx / 1.25, camera.cx));
        Ok(())
    }
}
