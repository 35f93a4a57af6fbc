//! What a solve found.

use super::{CSimilarity, free, guarded, of_frame, reference, reference_mut, sized};
use spba_ceres::solver::Termination;
use spba_host::fault::Fault;
use spba_host::frames::CPose;
use spba_host::solve::Solved;

#[repr(C)]
struct CSummary {
    struct_size: u32,
    status: i32,
    frame_count: u32,
    style_count: u32,
    free_form_count: u32,
    point_count: u32,
    face_count: u32,
    iterations: u32,
    objective_start: f64,
    objective_end: f64,
    alpha: f64,
    focal_factor: f64,
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_solution_free(solution: *mut Solved) {
    // SAFETY: as of the module above.
    unsafe { free(solution) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_solution_summary(solution: *const Solved, summary: *mut CSummary) -> i32 {
    guarded(|| {
        // SAFETY: as of the module above, here and below; a CSummary starts with its size.
        let solved = unsafe { reference(solution, "solution") }?;
        unsafe { sized(summary.cast_const(), "summary") }?;
        let found = &solved.solution;
        let count = |count: usize| count as u32;
        *unsafe { reference_mut(summary, "summary") }? = CSummary {
            struct_size: size_of::<CSummary>() as u32,
            status: match found.termination {
                Termination::BelowThreshold => 0,
                Termination::Converged => 1,
                Termination::StepLimit => 2,
                Termination::Interrupted => 3,
            },
            frame_count: count(found.estimate.frame_count()),
            style_count: count(found.estimate.style.len()),
            free_form_count: count(found.free_form.len()),
            point_count: count(solved.points.len() / 3),
            face_count: count(solved.faces.len() / 3),
            iterations: count(found.iterations),
            objective_start: found.objective_start.total,
            objective_end: found.objective_end.total,
            alpha: found.estimate.alpha,
            focal_factor: found.estimate.focal_factor,
        };
        Ok(())
    })
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_solution_cam_from_object(
    solution: *const Solved,
    frame: u32,
    cam_from_object: *mut CPose,
) -> i32 {
    guarded(|| {
        // SAFETY: as of the module above, here and below.
        let estimate = &unsafe { reference(solution, "solution") }?.solution.estimate;
        let pose = of_frame(&estimate.camera_from_object, frame)?;
        *unsafe { reference_mut(cam_from_object, "cam_from_object") }? = pose.into();
        Ok(())
    })
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_solution_silhouette_iou(solution: *const Solved, frame: u32, iou: *mut f64) -> i32 {
    guarded(|| {
        // SAFETY: as of the module above, here and below.
        let solved = unsafe { reference(solution, "solution") }?;
        *unsafe { reference_mut(iou, "iou") }? = *of_frame(&solved.silhouette_iou, frame)?;
        Ok(())
    })
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_solution_object_from_world(
    solution: *const Solved,
    object_from_world: *mut CSimilarity,
) -> i32 {
    guarded(|| {
        // SAFETY: as of the module above, here and below.
        let found = unsafe { reference(solution, "solution") }?.object_from_world;
        let found = found.ok_or(Fault::NotThere("object_from_world"))?;
        *unsafe { reference_mut(object_from_world, "object_from_world") }? = CSimilarity::from(&found);
        Ok(())
    })
}

/// # Safety
/// As of the module above.
unsafe fn array<T>(solution: *const Solved, of: impl FnOnce(&Solved) -> &[T]) -> *const T {
    // SAFETY: as of the module above.
    unsafe { solution.as_ref() }.map_or(std::ptr::null(), |solved| of(solved).as_ptr())
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_solution_style(solution: *const Solved) -> *const f64 {
    // SAFETY: as of the module above.
    unsafe { array(solution, |solved| &solved.solution.estimate.style) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_solution_free_form(solution: *const Solved) -> *const f64 {
    // SAFETY: as of the module above.
    unsafe { array(solution, |solved| &solved.solution.free_form) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_solution_points(solution: *const Solved) -> *const f64 {
    // SAFETY: as of the module above.
    unsafe { array(solution, |solved| &solved.points) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_solution_normals(solution: *const Solved) -> *const f64 {
    // SAFETY: as of the module above.
    unsafe { array(solution, |solved| &solved.normals) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_solution_faces(solution: *const Solved) -> *const u32 {
    // SAFETY: as of the module above.
    unsafe { array(solution, |solved| &solved.faces) }
}
