//! Priors of surfaces: models in correspondence through a template mesh.

use super::sources::{SourceList, licences, load_models, source_of};
use super::{Bar, Eval, Learn, Models, own_errors, print_frame_errors};
use anyhow::{Context, ensure};
use spba_ceres::cad::{NamedModel, OutsideSample, sample_outside, sample_shell};
use spba_ceres::prior::learn::{
    Correspondences, LearnError, Progress, SurfaceOptions, TrainingShape, field_scales, register_all,
    residual_covariogram, surface_prior,
};
use spba_ceres::prior::{
    self, Distortion, FieldScale, FreeForm, FreeFormInfo, LearnedPrior, MirroredMesh, PriorInfo,
    SurfacePrior, distortion,
};
use std::collections::BTreeMap;
use std::path::Path;

type V3 = nalgebra::Vector3<f64>;

/// Modes of each parity that the free form keeps: 180 symmetric coordinates.
const FORM_MODES: usize = 60;

/// Models in correspondence, and what all that is learned from them needs.
struct Surfaces {
    list: SourceList,
    models: Vec<NamedModel>,
    mesh: MirroredMesh,
    /// The template's half as its file has it.
    rest: Vec<V3>,
    /// The half's vertices on each model.
    shapes: Vec<Vec<V3>>,
    weights: Vec<f64>,
    group: Vec<usize>,
}

impl Surfaces {
    fn load(args: &Models, template: &Path) -> anyhow::Result<Self> {
        let (list, models) = load_models(&args.sources)?;
        let (mesh, rest) = load_template(template)?;
        let group = list.groups(&models)?;
        let weights: Vec<f64> = models.iter().map(|model| model.weight).collect();
        let bar = Bar::new();
        let shapes: Vec<TrainingShape> = models
            .iter()
            .enumerate()
            .map(|(index, model)| {
                bar.show(&Progress {
                    stage: "sampling",
                    done: index,
                    total: models.len(),
                });
                TrainingShape {
                    name: model.name.clone(),
                    outside: sample_shell(&model.mesh, args.samples, args.seed.wrapping_add(index as u64)),
                }
            })
            .collect();
        let shapes = register_all(&mesh, &rest, &shapes, &weights, &mut |p| bar.show(&p))?.shapes;
        bar.finish();
        Ok(Self {
            list,
            models,
            mesh,
            rest,
            shapes,
            weights,
            group,
        })
    }

    /// The covariance of what `styles` components leave of models that they have not seen.
    fn scales(&self, styles: usize) -> Vec<FieldScale> {
        field_scales(&residual_covariogram(
            &self.mesh,
            &self.shapes,
            &self.weights,
            &self.group,
            styles,
        ))
    }

    /// The prior of some of the models, and the share of their variance that its first k + 1 styles explain.
    fn prior(&self, of: &[usize], options: &SurfaceOptions) -> Result<(SurfacePrior, Vec<f64>), LearnError> {
        let shapes: Vec<&Vec<V3>> = of.iter().map(|&m| &self.shapes[m]).collect();
        let weights: Vec<f64> = of.iter().map(|&m| self.weights[m]).collect();
        surface_prior(&self.mesh, &shapes, &weights, options)
    }

    /// Samples of the models' outsides, of a seed and number as for priors of points: errors of both kinds are measured at one truth.
    fn truth(&self, args: &Models) -> Vec<OutsideSample> {
        let models = self.models.iter().enumerate();
        models
            .map(|(index, model)| {
                let seed = args.seed.wrapping_add(1 << 32).wrapping_add(index as u64);
                sample_outside(&model.mesh, 2 * args.samples, seed)
            })
            .collect()
    }

    /// All models at the same points of the surface as `whole`.
    fn correspondences(&self, whole: &SurfacePrior, points: usize) -> anyhow::Result<Correspondences> {
        let at_points = |shape: &Vec<V3>| -> anyhow::Result<Vec<f64>> {
            let moved = whole.moved_to(shape.clone())?;
            Ok(moved.at_points(points, FreeForm::None)?.mean().to_vec())
        };
        Ok(Correspondences {
            shapes: self.shapes.iter().map(at_points).collect::<anyhow::Result<_>>()?,
            normals: whole.at_points(points, FreeForm::None)?.normals().to_vec(),
        })
    }

    fn distortions(&self) -> Vec<Distortion> {
        self.shapes
            .iter()
            .map(|shape| distortion(&self.mesh, &self.rest, shape))
            .collect()
    }
}

fn load_template(path: &Path) -> anyhow::Result<(MirroredMesh, Vec<V3>)> {
    let mesh = spba_ceres::cad::load(path)?;
    let faces = mesh.triangles.iter().map(|t| t.vertices).collect();
    let uv = mesh.triangles.iter().map(|t| t.texture_coordinates).collect();
    let half = MirroredMesh::new(mesh.vertices.len(), faces, uv)
        .with_context(|| format!("{}: not half of a closed mesh", path.display()))?;
    let off = (0..half.half_len()).find(|&v| half.on_seam(v) != (mesh.vertices[v].x.abs() < 1e-9));
    if let Some(vertex) = off {
        anyhow::bail!(
            "{}: vertex {vertex}: its boundary must be the vertices with x = 0, and no others: cut the mesh there",
            path.display()
        );
    }
    Ok((half, mesh.vertices))
}

pub fn learn(args: &Learn, template: &Path) -> anyhow::Result<()> {
    let given = args.free_form_of.as_deref().map(scales_of).transpose()?;
    let found = Surfaces::load(&args.models, template)?;
    ensure!(
        args.styles < found.models.len(),
        "--styles {}: {} models give at most {}",
        args.styles,
        found.models.len(),
        found.models.len() - 1
    );
    if let Some(folder) = &args.meshes {
        write_meshes(&found, folder)?;
    }
    let options = SurfaceOptions {
        styles: args.styles,
        points: args.points,
        modes: FORM_MODES,
        scales: given.unwrap_or_else(|| found.scales(args.styles)),
        seed: args.models.seed,
    };
    let all: Vec<usize> = (0..found.models.len()).collect();
    let (surface, explained) = found.prior(&all, &options)?;
    let asymmetry = surface.asymmetry();
    let prior = LearnedPrior::of_surface(surface)?;
    let info = PriorInfo {
        template: template
            .file_stem()
            .map(|stem| stem.to_string_lossy().into_owned())
            .filter(|name| *name != found.list.category),
        command: args.command(),
        seed: args.models.seed,
        explained_variance: explained,
        licences: licences(&found.models),
        sources: found.models.iter().map(source_of).collect(),
        free_form: Some(FreeFormInfo {
            scales: options.scales.clone(),
            asymmetry,
        }),
        ..PriorInfo::mirrored(&found.list.category, &prior)
    };
    prior::save(&args.out, &prior, &info)?;
    println!(
        "{}: {} {}, {} models, {} points, {} styles, free form {}",
        args.out.display(),
        info.category,
        info.kind,
        found.models.len(),
        args.points,
        args.styles,
        words(&options.scales)
    );
    print_distortions(&found, false);
    Ok(())
}

/// The free form's scales of a prior of surfaces.
fn scales_of(prior: &str) -> anyhow::Result<Vec<FieldScale>> {
    let (_, info) = prior::open(prior)?;
    let free_form = info
        .free_form
        .with_context(|| format!("--free-form-of {prior}: it has no free form; give a prior of surfaces"))?;
    Ok(free_form.scales)
}

/// One OBJ a model: the template drawn onto it.
fn write_meshes(found: &Surfaces, folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder)
        .with_context(|| format!("{}: cannot make the folder", folder.display()))?;
    let faces = found.mesh.faces();
    let mut names = BTreeMap::new();
    for (model, shape) in found.models.iter().zip(&found.shapes) {
        // Packages have models of the same name.
        let count = names.entry(&model.name).or_insert(0);
        *count += 1;
        let path = folder.join(match *count {
            1 => format!("{}.obj", model.name),
            count => format!("{}-{count}.obj", model.name),
        });
        prior::write_mesh(&path, &found.mesh.whole(shape), &faces)
            .with_context(|| format!("{}: cannot write the mesh", path.display()))?;
    }
    Ok(())
}

fn words(scales: &[FieldScale]) -> String {
    let each = scales
        .iter()
        .map(|s| format!("{:.2} % over {:.1} %", 100.0 * s.amplitude, 100.0 * s.length));
    each.collect::<Vec<_>>().join(" + ")
}

pub fn eval(args: &Eval, template: &Path) -> anyhow::Result<()> {
    let found = Surfaces::load(&args.models, template)?;
    let bar = Bar::new();
    let truth = found.truth(&args.models);
    let most = args.styles.iter().copied().max().unwrap_or(0);
    let scales = found.scales(most);
    let all: Vec<usize> = (0..found.models.len()).collect();
    let options = |styles: usize, modes: usize| SurfaceOptions {
        styles,
        points: args.points,
        modes,
        scales: scales.clone(),
        seed: args.models.seed,
    };
    // One choice of points for all, so that shapes can be compared point by point.
    let (whole, _) = found.prior(&all, &options(0, 0))?;
    let correspondences = found.correspondences(&whole, args.points)?;
    let learner = |styles: usize, form: FreeForm| -> Box<prior::Learner> {
        let (found, options, whole) = (&found, &options, &whole);
        Box::new(move |of| {
            let modes = if form == FreeForm::None { 0 } else { FORM_MODES };
            let surface = found.prior(of, &options(styles, modes))?.0.with_points_of(whole);
            Ok(LearnedPrior::from(surface.at_points(args.points, form)?))
        })
    };
    let ways: Vec<(usize, FreeForm)> = [FreeForm::None, FreeForm::Symmetric]
        .into_iter()
        .flat_map(|form| args.styles.iter().map(move |&styles| (styles, form)))
        .collect();
    let learners: Vec<_> = ways.iter().map(|&(styles, form)| learner(styles, form)).collect();
    let errors = prior::leave_one_out(
        &correspondences,
        &truth,
        &found.group,
        &learners,
        args.points,
        &args.noise,
    )?;
    bar.finish();
    println!(
        "leave-one-out over {} models, {} points, % of the diagonal; free form {}, learned from what {most} styles leave",
        found.models.len(),
        args.points,
        words(&scales)
    );
    print_errors(&ways, &args.noise, &errors);
    let own = own_errors(&correspondences, &truth, args.points);
    println!(
        "the models' own registered surfaces, the floor: {:.3}",
        100.0 * own.iter().sum::<f64>() / own.len().max(1) as f64
    );
    print_distortions(&found, args.each);
    // Those of the last number of styles, fitted with the last noise.
    let (plain, full) = errors.split_at(errors.len() / 2);
    if let (Some(plain), Some(full)) = (plain.last(), full.last()) {
        print_kinds(&found, plain, full, &own, args.each);
    }
    print_frames(
        &correspondences,
        &found,
        &|form| learner(most, form),
        args.points,
        most,
    )
}

/// The errors of a model left out, by the number of styles, the free form and the noise that samples are taken to have.
fn print_errors(ways: &[(usize, FreeForm)], noises: &[f64], errors: &[prior::FitError]) {
    println!(
        "{:>6} {:>9}  {:>17}  {:>6}  {:>10}  {:>7}  {:>7}",
        "styles", "free form", "by correspondence", "noise", "by Chamfer", "|style|", "|form|"
    );
    for (&(styles, form), rows) in ways.iter().zip(errors.chunks(noises.len())) {
        for (noise, row) in noises.iter().zip(rows) {
            let [style, rest] = mean_lengths(&row.each, styles);
            println!(
                "{styles:>6} {:>9}  {:>17.3}  {noise:>6.3}  {:>10.3}  {style:>7.2}  {rest:>7.2}",
                if form == FreeForm::None { "-" } else { "yes" },
                100.0 * row.by_correspondence,
                100.0 * row.by_chamfer,
            );
        }
    }
}

/// How far off the canonical frame of a model left out is.
fn print_frames<'a>(
    correspondences: &Correspondences,
    found: &Surfaces,
    learner: &dyn Fn(FreeForm) -> Box<prior::Learner<'a>>,
    points: usize,
    styles: usize,
) -> anyhow::Result<()> {
    println!("\nthe canonical frame of a model left out, {styles} styles");
    for (form, with) in [
        (FreeForm::None, "style alone"),
        (FreeForm::Symmetric, "with free form"),
    ] {
        for (known, words) in [
            (prior::Known::All, "all its points known"),
            (prior::Known::FromFrontRight, "those seen from its front right"),
        ] {
            let errors = prior::frame_errors(correspondences, &found.group, &learner(form), points, known)?;
            print_frame_errors(&errors, &format!("{with}, {words}"));
        }
    }
    Ok(())
}

/// Means of ‖s‖ and ‖g‖.
fn mean_lengths(fits: &[prior::Fit], styles: usize) -> [f64; 2] {
    let length = |numbers: &[f64]| numbers.iter().map(|x| x * x).sum::<f64>().sqrt();
    let split = fits
        .iter()
        .map(|fit| fit.style.split_at(styles.min(fit.style.len())));
    let [style, form] = split.fold([0.0; 2], |sums, (s, g)| {
        [sums[0] + length(s), sums[1] + length(g)]
    });
    [style, form].map(|sum| sum / fits.len().max(1) as f64)
}

fn print_distortions(found: &Surfaces, each: bool) {
    let all = found.distortions();
    let mean = |of: fn(&Distortion) -> f64| all.iter().map(of).sum::<f64>() / all.len().max(1) as f64;
    println!(
        "template of {} faces on the models: {:.2} % folded, {:.1} % stretched by more than 3, areas spread {:.1} times",
        2 * found.mesh.half_faces().len(),
        100.0 * mean(|d| d.folded),
        100.0 * mean(|d| d.stretched),
        mean(|d| d.area_spread)
    );
    if each {
        for (model, d) in found.models.iter().zip(&all) {
            println!(
                "  {:<32} {:>6.2} % folded {:>5.1} % stretched {:>6.1} times",
                model.name,
                100.0 * d.folded,
                100.0 * d.stretched,
                d.area_spread
            );
        }
    }
}

/// Means over the models of each kind that the list names, and over the others.
fn print_kinds(found: &Surfaces, plain: &prior::FitError, full: &prior::FitError, own: &[f64], each: bool) {
    let kinds: Vec<&str> = found
        .models
        .iter()
        .map(|model| found.list.kind_of(&model.name))
        .collect();
    let mut names = kinds.clone();
    names.sort_unstable();
    names.dedup();
    println!(
        "\n{:<32} {:>6} {:>11} {:>14} {:>10}",
        "kind", "models", "style alone", "with free form", "floor"
    );
    let row = |name: &str, of: &[usize]| {
        let mean = |value: &dyn Fn(usize) -> f64| {
            100.0 * of.iter().map(|&m| value(m)).sum::<f64>() / of.len().max(1) as f64
        };
        println!(
            "{name:<32} {:>6} {:>11.3} {:>14.3} {:>10.3}",
            of.len(),
            mean(&|m| plain.each[m].chamfer),
            mean(&|m| full.each[m].chamfer),
            mean(&|m| own[m])
        );
    };
    for name in names {
        let of: Vec<usize> = (0..kinds.len()).filter(|&m| kinds[m] == name).collect();
        row(name, &of);
        if each {
            of.iter()
                .for_each(|&m| row(&format!("  {}", found.models[m].name), &[m]));
        }
    }
}
