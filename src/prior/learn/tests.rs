use super::*;
use crate::cad::synthetic::toy_car;
use crate::prior::{LearnedPrior, LinearPrior, PriorInfo};

const POINTS: usize = 512;

fn toys() -> Vec<TrainingShape> {
    [
        (0.10, 0.0),
        (0.25, 0.0),
        (0.15, 0.15),
        (0.20, 0.15),
        (0.20, -0.05),
        (0.15, 0.05),
    ]
    .iter()
    .enumerate()
    .map(|(i, &(height, place))| {
        TrainingShape::new(&format!("toy {i}"), &toy_car(height, place, 0.4), 6000, i as u64)
    })
    .collect()
}

fn options() -> LearnOptions {
    LearnOptions {
        points: POINTS,
        coarse_points: 128,
        passes: 2,
    }
}

#[test]
fn toy_cars_are_learned() {
    let shapes = toys();
    let mut last = (0, 0);
    let found = correspond(&shapes, &options(), &mut |p| last = (p.done, p.total)).unwrap();
    assert_eq!(last.0, last.1, "the progress bar ends full");
    for (shape, toy) in found.shapes.iter().zip(&shapes) {
        assert_eq!(shape.len(), 3 * POINTS);
        let surface = tree_of(&toy.outside.points);
        let off = |p: &[f64]| surface.nearest([p[0], p[1], p[2]]).unwrap().distance;
        let mean = shape.chunks_exact(3).map(off).sum::<f64>() / POINTS as f64;
        assert!(mean < 0.012, "{}: {mean} off its surface", toy.name);
    }
    let (prior, explained) =
        LinearPrior::from_correspondences(&found.shapes, &vec![1.0; found.shapes.len()], found.normals, 4)
            .unwrap();
    assert!(explained[1] > 0.8, "two parameters made them: {explained:?}");
    let prior = LearnedPrior::from(prior);
    // Farthest-point order: a prefix of a quarter is about twice as sparse.
    let ratio = prior.sample_spacing(POINTS / 4) / prior.sample_spacing(POINTS);
    assert!((1.5..3.0).contains(&ratio), "{ratio}");
    let folder = tempfile::tempdir().unwrap();
    let info = PriorInfo::mirrored("toy", &prior);
    crate::prior::save(&folder.path().join("toy.safetensors"), &prior, &info).unwrap();
}

#[test]
fn the_same_models_give_the_same_correspondences() {
    let learn = || correspond(&toys(), &options(), &mut |_| {}).unwrap();
    assert_eq!(learn().shapes, learn().shapes);
}

#[test]
fn what_cannot_be_learned_is_refused() {
    let refusal = |shapes: &[TrainingShape], options: LearnOptions| {
        correspond(shapes, &options, &mut |_| {})
            .err()
            .map(|e| e.to_string())
            .unwrap_or_default()
    };
    let shapes = toys();
    assert!(refusal(&shapes[..2], options()).contains("2 models are too few"));
    assert!(
        refusal(
            &shapes,
            LearnOptions {
                points: 511,
                ..options()
            }
        )
        .contains("points = 511")
    );
    assert!(
        refusal(
            &shapes,
            LearnOptions {
                passes: 0,
                ..options()
            }
        )
        .contains("passes = 0")
    );
    let many = LearnOptions {
        points: 16384,
        ..options()
    };
    assert!(refusal(&shapes, many).contains("`toy 0`: only"));
}
