use super::*;
use burn::module::Module;

#[derive(Module, Debug)]
struct Line {
    line: Linear,
}

fn device() -> Device {
    Device::flex().autodiff()
}

fn start(device: &Device) -> Line {
    Line {
        line: linear(1, 1, true, device, |_, _| 0.5),
    }
}

fn plan(of: &str, checkpoint: Option<PathBuf>) -> Plan {
    Plan {
        steps: 600,
        learning_rate: [0.1, 0.01],
        checkpoint,
        of: of.to_owned(),
    }
}

/// The mean squared distance from y = 3 x − 1.
fn loss(device: &Device) -> impl FnMut(&Line, usize) -> Tensor<1> {
    let x = tensor(&DMatrix::from_fn(8, 1, |i, _| i as f64 / 4.0 - 1.0), device);
    move |model, _| {
        let goal = x.clone() * 3.0 - 1.0;
        (model.line.forward(x.clone()) - goal).square().mean()
    }
}

#[test]
fn a_line_is_learned() {
    let device = device();
    let model = train(
        start(&device),
        &plan("a line", None),
        loss(&device),
        &mut |_, _| true,
    )
    .unwrap();
    assert!((weight(&model.line)[(0, 0)] - 3.0).abs() < 1e-2);
    assert!((bias(&model.line)[0] + 1.0).abs() < 1e-2);
}

#[test]
fn weights_are_read_as_they_were_written() {
    let device = device();
    let layer = linear(3, 2, false, &device, |i, j| (10 * i + j) as f64);
    let expected = DMatrix::from_row_slice(2, 3, &[0.0, 10.0, 20.0, 1.0, 11.0, 21.0]);
    assert_eq!(weight(&layer), expected);
    assert!(bias(&layer).is_empty());
    let x = DMatrix::from_row_slice(1, 3, &[1.0, 2.0, 3.0]);
    let y = numbers(layer.forward(tensor(&x, &device)));
    assert_eq!(y, (&expected * x.transpose()).as_slice());
}

#[test]
fn checkpoints_of_something_else_or_in_pieces_are_refused() {
    let device = device();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("state");
    let run = |of: &str, until: usize| {
        let plan = plan(of, Some(path.clone()));
        train(start(&device), &plan, loss(&device), &mut |step, _| step < until).map(|_| ())
    };
    let message = |result: Result<(), TrainingError>| result.unwrap_err().to_string();
    assert!(message(run("a line", 100)).contains("interrupted at step 100"));
    assert!(message(run("a curve", 700)).contains("another training (a line), this one is a curve"));
    let whole = std::fs::read(&path).unwrap();
    std::fs::write(&path, &whole[..whole.len() / 2]).unwrap();
    assert!(message(run("a line", 700)).contains("not a whole checkpoint"));
    std::fs::write(&path, &whole).unwrap();
    run("a line", 700).unwrap();
    assert!(!path.exists());
}

#[test]
fn a_loss_that_is_no_number_ends_training() {
    let device = device();
    let loss = |model: &Line, _| {
        model
            .line
            .forward(Tensor::<2>::ones([1, 1], &device))
            .sum()
            .sqrt()
            - f32::NAN
    };
    let found = train(start(&device), &plan("nothing", None), loss, &mut |_, _| true);
    assert!(matches!(found, Err(TrainingError::NotFinite(0))));
}
