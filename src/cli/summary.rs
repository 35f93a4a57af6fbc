//! What `spba-ceres solve` prints at its end.

use spba_ceres::report::{RunResult, Written};
use spba_ceres::solver::{Solution, Termination};

/// What `solve` found, how long it took, and where it lies.
pub fn summarise(solution: &Solution, written: &Written, is_mesh: bool) {
    let result = &written.result;
    let how = match solution.termination {
        Termination::BelowThreshold => "below the threshold",
        Termination::Converged => "converged",
        Termination::StepLimit => "stopped at the step limit",
        Termination::Interrupted => "interrupted; this is the best state so far",
    };
    println!(
        "objective        {:.1} -> {:.1}, {how} after {} iterations, {} evaluations",
        solution.objective_start.total,
        solution.objective_end.total,
        solution.iterations,
        solution.evaluations.residual + solution.evaluations.jacobian,
    );
    if result.focal_factor != 1.0 {
        println!("focal length     times {:.3}", result.focal_factor);
    }
    println!("silhouette IoU   {:.3}", result.silhouette_iou_mean);
    println!("density          {:.3}", result.density_mean);
    print_deviations(result);
    let seconds: Vec<String> = solution
        .seconds
        .iter()
        .map(|(stage, seconds)| format!("{stage} {seconds:.1} s"))
        .collect();
    println!("time             {}", seconds.join(", "));
    let folder = written.folder.display();
    println!("shape            {folder}/shape.ply");
    if is_mesh {
        println!("mesh             {folder}/mesh.glb, {folder}/mesh.ply");
    }
    println!("cameras          {folder}/cameras.txt (TUM), {folder}/colmap/ (COLMAP), {folder}/result.json");
    println!(
        "report           {} (first: open it in a browser)",
        written.page.display()
    );
    println!(
        "pictures         {}, {folder}/overlay/",
        written.contact_sheet.display()
    );
}

/// How sure the cameras are, on average, and the shape, where that is known.
fn print_deviations(result: &RunResult) {
    let Some(cameras) = result.mean_camera_deviation() else {
        return;
    };
    let shape = result.shape_deviation_median.map_or_else(String::new, |shape| {
        format!("; shape {:.2} % (median)", 100.0 * shape)
    });
    println!(
        "deviation        cameras {:.2} deg, {:.2} % of the diagonal{shape}",
        cameras.rotation_deg,
        100.0 * cameras.location,
    );
}
