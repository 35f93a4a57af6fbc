//! Where a solve starts: the priors that are tried, their styles and poses.

use super::progress;
use anyhow::Context;
use spba_ceres::config::Config;
use spba_ceres::init::{self, Initialisation};
use spba_ceres::objective::Footage;
use spba_ceres::prior::{LearnedPrior, PriorInfo, ShapePrior};
use spba_ceres::report::{FrameResult, RunResult};
use spba_ceres::sequence::{Frame, Sequence};
use spba_ceres::{regressor, solver};
use std::path::Path;
use std::sync::Arc;

/// A prior, one of those that a category's templates are, and where it starts.
pub struct Template {
    pub prior: Arc<LearnedPrior>,
    pub info: PriorInfo,
    pub starts: Vec<Initialisation>,
}

/// Every prior with its starts; of those of several templates, an earlier result's alone where the style is to be its.
pub fn templates(
    sequence: &Sequence,
    mut priors: Vec<(LearnedPrior, PriorInfo)>,
    target: usize,
    config: &Config,
) -> anyhow::Result<Vec<Template>> {
    let earlier = RunResult::load(Path::new(&config.start.style)).map(|result| result.prior);
    if let Ok(name) = earlier
        && priors.iter().any(|(_, info)| info.name() == name)
    {
        priors.retain(|(_, info)| info.name() == name);
    }
    let template = |(prior, info): (LearnedPrior, PriorInfo)| {
        let style = start_style(sequence, &prior, &info, &config.start.style)?;
        let starts = starts(sequence, &prior, &style, target, config)?;
        Ok(Template {
            prior: Arc::new(prior),
            info,
            starts,
        })
    };
    priors.into_iter().map(template).collect()
}

/// The one whose prior fits best.
pub fn best(
    sequence: &Sequence,
    mut templates: Vec<Template>,
    target: usize,
    config: &Config,
) -> anyhow::Result<Template> {
    if templates.len() == 1 {
        return Ok(templates.remove(0));
    }
    let progress = progress::SolveProgress::start()?;
    let priors: Vec<Arc<dyn ShapePrior>> = templates
        .iter()
        .map(|template| template.prior.clone() as Arc<dyn ShapePrior>)
        .collect();
    let competing: Vec<solver::Candidate> = templates
        .iter()
        .zip(&priors)
        .map(|(Template { starts, .. }, prior)| solver::Candidate { prior, starts })
        .collect();
    let objectives = solver::compete(
        &Footage::new(sequence, config.solver.levels)?,
        &competing,
        target,
        &config.objective,
        &config.solver,
        &|row| progress.see(row),
    )?;
    progress.finish();
    let lowest = (0..objectives.len())
        .min_by(|&a, &b| objectives[a].total_cmp(&objectives[b]))
        .unwrap_or(0);
    let words = templates.iter().zip(&objectives).map(|(template, objective)| {
        let info = &template.info;
        format!(
            "{} {objective:.0}",
            info.template.as_ref().unwrap_or(&info.category)
        )
    });
    println!(
        "{:16} {}; the lowest objective decides",
        "template",
        words.collect::<Vec<_>>().join(", ")
    );
    Ok(templates.swap_remove(lowest))
}

/// The style that `--init-style` names.
fn start_style(
    sequence: &Sequence,
    prior: &LearnedPrior,
    prior_info: &PriorInfo,
    from: &str,
) -> anyhow::Result<Vec<f64>> {
    match from {
        "mean" => Ok(vec![0.0; prior.style_len()]),
        "regressor" => Ok(regressor::bundled(&prior_info.category)?.style(sequence, prior_info)?),
        file if file.ends_with(".safetensors") => {
            Ok(regressor::load(Path::new(file))?.style(sequence, prior_info)?)
        }
        folder => {
            let result = RunResult::load(Path::new(folder)).context("--init-style")?;
            anyhow::ensure!(
                result.prior == prior_info.name(),
                "--init-style {folder}: its prior is `{}`, this one `{}`: give a result of the same prior",
                result.prior,
                prior_info.name()
            );
            Ok(result.style)
        }
    }
}

/// What the solver starts from.
fn starts(
    sequence: &Sequence,
    prior: &LearnedPrior,
    style: &[f64],
    target: usize,
    config: &Config,
) -> anyhow::Result<Vec<Initialisation>> {
    let pose = &config.start.pose;
    if pose == "templates" {
        return Ok(init::initialise(sequence, prior, style, target, &config.init)?);
    }
    let result = RunResult::load(Path::new(pose)).context("--init-pose")?;
    let of_frame = |frame: &Frame| {
        let known = result.frames.iter().find(|known| known.name == frame.name);
        let found = known.and_then(FrameResult::camera_from_object);
        found.with_context(|| {
            format!(
                "--init-pose {pose}: no frame `{}`: give a result of all frames in use",
                frame.name
            )
        })
    };
    let cameras = sequence
        .frames
        .iter()
        .map(of_frame)
        .collect::<anyhow::Result<Vec<_>>>()?;
    let alpha = result.alpha.unwrap_or(1.0);
    let free_form = if config.start.style == *pose {
        &result.free_form[..]
    } else {
        &[]
    };
    let shape = (style, free_form);
    let mut start = init::initialise_at(sequence, prior, shape, target, &cameras, alpha, &config.init)?;
    if config
        .objective
        .focal_deviation
        .is_some_and(|deviation| deviation > 0.0)
    {
        start.estimate.focal_factor = result.focal_factor;
    }
    Ok(vec![start])
}
