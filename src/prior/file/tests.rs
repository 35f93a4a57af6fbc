use super::*;
use crate::prior::learned::tests::small_decoder;
use ::half::f16;
use safetensors::serialize;
use safetensors::tensor::TensorView;

/// Two mirrored pairs, two modes.
fn mirrored() -> LearnedPrior {
    let mirror = |half: &[f64], columns: usize| -> Vec<f64> {
        half.chunks_exact(3 * columns)
            .flat_map(|p| {
                let image: Vec<f64> = p
                    .iter()
                    .enumerate()
                    .map(|(i, x)| if i < columns { -x } else { *x })
                    .collect();
                [p.to_vec(), image].concat()
            })
            .collect()
    };
    let mean = mirror(&[0.25, 0.25, -0.25, 0.375, -0.25, 0.25], 1);
    let basis = mirror(&(0..12).map(|i| f64::from(i) / 16.0).collect::<Vec<_>>(), 2);
    let normals = vec![[0.0, 1.0, 0.0]; 4];
    LinearPrior::new(mean, basis, 2, normals).unwrap().into()
}

fn describe() -> PriorInfo {
    PriorInfo {
        command: "test".to_owned(),
        licences: vec!["CC0".to_owned()],
        ..PriorInfo::mirrored("car", &mirrored())
    }
}

fn bytes() -> Vec<u8> {
    to_bytes(&mirrored(), &describe()).unwrap()
}

fn refusal(bytes: &[u8]) -> String {
    let message = parse(bytes, Path::new("a.safetensors")).unwrap_err().to_string();
    assert!(
        message.starts_with("a.safetensors: ") && !message.contains('\n'),
        "{message}"
    );
    message
}

/// The same file with the description's JSON edited.
fn with_metadata(edit: impl Fn(&mut serde_json::Value)) -> Vec<u8> {
    let bytes = bytes();
    let file = SafeTensors::deserialize(&bytes).unwrap();
    let mut value = serde_json::to_value(describe()).unwrap();
    edit(&mut value);
    serialize(
        file.tensors(),
        Some([(METADATA_KEY.to_owned(), value.to_string())].into()),
    )
    .unwrap()
}

#[test]
fn a_written_prior_is_read_back() {
    let (prior, info) = parse(&bytes(), Path::new("a")).unwrap();
    assert_eq!(prior, mirrored());
    assert_eq!(info, describe());
}

#[test]
fn a_decoder_is_read_back() {
    let info = PriorInfo::mirrored("car", &small_decoder());
    assert_eq!((info.kind, &info.hidden[..]), (PriorKind::Decoder, &[3, 2][..]));
    let bytes = to_bytes(&small_decoder(), &info).unwrap();
    assert_eq!(parse(&bytes, Path::new("a")).unwrap(), (small_decoder(), info));
}

#[test]
fn without_symmetry_all_points_are_stored() {
    let info = PriorInfo {
        symmetry: Symmetry::None,
        ..describe()
    };
    let stored = to_bytes(&mirrored(), &info).unwrap();
    assert!(stored.len() > bytes().len());
    assert_eq!(parse(&stored, Path::new("a")).unwrap().0, mirrored());
}

#[test]
fn the_same_prior_gives_the_same_bytes_and_a_file() {
    assert_eq!(bytes(), bytes());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.safetensors");
    save(&path, &mirrored(), &describe()).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), bytes());
    assert_eq!(load(&path).unwrap(), mirrored());
    assert_eq!(find(path.to_str().unwrap()).unwrap(), mirrored());
}

#[test]
fn an_asymmetric_prior_is_not_written_as_symmetric() {
    let prior = mirrored();
    let output = prior.output();
    let mut mean = output.mean().to_vec();
    mean[10] += 0.01;
    let prior = LinearPrior::new(mean, output.basis().to_vec(), 2, output.normals().to_vec()).unwrap();
    assert!(matches!(
        to_bytes(&prior.into(), &describe()),
        Err(PriorError::NotSymmetric(3))
    ));
}

#[test]
fn shapes_in_another_unit_or_elsewhere_are_refused() {
    let info = describe();
    let with = |scale: f64, up: f64, modes: f64| {
        let output = mirrored().output().clone();
        let mean = output
            .mean()
            .iter()
            .enumerate()
            .map(|(i, x)| scale * x + if i % 3 == 1 { up } else { 0.0 });
        let basis = output.basis().iter().map(|x| modes * x).collect();
        let prior = LinearPrior::new(mean.collect(), basis, 2, output.normals().to_vec()).unwrap();
        to_bytes(&prior.into(), &info).unwrap()
    };
    assert!(parse(&with(1.0, 0.0, 1.0), Path::new("a")).is_ok());
    // Metres; millimetres; tenths.
    for (scale, diagonal) in [(4.5, "4.638"), (1000.0, "1030.776"), (0.1, "0.103")] {
        let message = refusal(&with(scale, 0.0, 1.0));
        assert!(
            message.contains(&format!("diagonal is {diagonal}, 0.9 to 1.12 expected")),
            "{message}"
        );
    }
    assert!(refusal(&with(1.0, 0.25, 1.0)).contains("centre's distance from the origin is 0.250"));
    assert!(refusal(&with(1.0, 0.0, 4.5)).contains("by one standard deviation of a style is 3.09"));
}

#[test]
fn broken_files_are_named_for_what_they_are() {
    let whole = bytes();
    assert!(refusal(b"solid car").contains("not a whole safetensors file"));
    assert!(refusal(&whole[..whole.len() - 5]).contains("not a whole safetensors file"));
    assert!(refusal(&[]).contains("not a whole safetensors file"));
    assert!(
        refusal(&with_metadata(|v| v["schema"] = 3.into()))
            .contains("prior schema 3, this build reads 1 and 2")
    );
    assert!(refusal(&with_metadata(|v| v["schema"] = 2.into())).contains("must be of kind surface"));
    assert!(refusal(&with_metadata(|v| v["schema"] = "x".into())).contains("no schema number"));
    assert!(refusal(&with_metadata(|v| v["points"] = 6.into())).contains("tensor `mean` is F32 [2, 3]"));
    assert!(refusal(&with_metadata(|v| v["points"] = 5.into())).contains("odd number of points"));
    assert!(refusal(&with_metadata(|v| v["styles"] = 3.into())).contains("tensor `basis`"));
    assert!(refusal(&with_metadata(|v| v["kind"] = "decoder".into())).contains("hidden layers"));
    assert!(refusal(&with_metadata(|v| v["hidden"] = [3].into())).contains("hidden layers"));
    assert!(
        refusal(&with_metadata(|v| v["kind"] = "magic".into()))
            .contains("expected one of `linear`, `decoder`, `surface`")
    );
    let as_decoder = |v: &mut serde_json::Value| {
        v["kind"] = "decoder".into();
        v["hidden"] = [3].into();
    };
    assert!(refusal(&with_metadata(as_decoder)).contains("tensor `hidden.0.weight` is missing"));
    assert!(
        refusal(&with_metadata(|v| v["frame"] = "+Z up".into()))
            .contains("object frame `+Z up`, this build's")
    );
    let unnamed = serialize(SafeTensors::deserialize(&whole).unwrap().tensors(), None).unwrap();
    assert!(refusal(&unnamed).contains("metadata `spba_prior` is missing"));
}

#[test]
fn a_missing_tensor_and_a_nan_are_refused() {
    let whole = bytes();
    let file = SafeTensors::deserialize(&whole).unwrap();
    let metadata = Some(
        [(
            METADATA_KEY.to_owned(),
            serde_json::to_string(&describe()).unwrap(),
        )]
        .into(),
    );
    let fewer = file.tensors().into_iter().filter(|(name, _)| name != "normals");
    assert!(refusal(&serialize(fewer, metadata.clone()).unwrap()).contains("tensor `normals` is missing"));
    let mut data = file.tensor("basis").unwrap().data().to_vec();
    data[2..4].copy_from_slice(&f16::NAN.to_le_bytes());
    let poisoned = file.tensors().into_iter().map(|(name, view)| {
        let basis = TensorView::new(view.dtype(), view.shape().to_vec(), &data);
        if name == "basis" {
            (name, basis.unwrap())
        } else {
            (name, view)
        }
    });
    assert!(refusal(&serialize(poisoned, metadata).unwrap()).contains("holds NaN at index 1"));
}

#[test]
fn names_are_resolved() {
    let unknown = find("boat").unwrap_err().to_string();
    assert!(
        unknown.contains("`boat` is neither bundled (car, chair, airplane) nor a file"),
        "{unknown}"
    );
    assert!(
        find("no/such.safetensors")
            .unwrap_err()
            .to_string()
            .contains("cannot read the prior")
    );
}

#[test]
fn a_category_with_several_templates_is_several_priors() {
    let names = |given: &str| -> Vec<String> {
        let priors = open_all(given).unwrap();
        priors.iter().map(|(_, info)| info.name()).collect()
    };
    let chairs =
        ["chair-legs", "chair-armchair", "chair-foot"].map(|name| format!("{name} surface (schema 2)"));
    assert_eq!(names("chair"), chairs);
    assert_eq!(
        names("chair-foot,chair-legs"),
        [chairs[2].clone(), chairs[0].clone()]
    );
    assert_eq!(open("chair").unwrap().1.name(), chairs[0]);
    assert_eq!(names("car"), ["car surface (schema 2)"]);
    let mixed = open_all("car,chair").unwrap_err().to_string();
    assert!(mixed.contains("priors of car and chair"), "{mixed}");
    assert!(open_all("chair,boat").unwrap_err().to_string().contains("`boat`"));
    assert!(
        open_all("chair,")
            .unwrap_err()
            .to_string()
            .contains("prior `` is neither")
    );
    // A comma in a path is no list.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a,b.safetensors");
    std::fs::write(&path, BUNDLED[0].1).unwrap();
    assert_eq!(names(path.to_str().unwrap()), ["car surface (schema 2)"]);
}

#[test]
fn the_bundled_car_is_usable() {
    let (prior, info) = open("car").unwrap();
    assert_eq!(info.category, "car");
    assert!(prior.style_len() >= 16 && prior.point_count() >= 8192);
    assert!(!info.sources.is_empty() && !info.licences.is_empty());
    let points = prior.shape(&vec![0.0; prior.style_len()]);
    let (low, high) = points
        .iter()
        .fold((points[0], points[0]), |(l, h), p| (l.inf(p), h.sup(p)));
    assert!(((high - low).norm() - 1.0).abs() < 0.05, "the diagonal is 1");
    let size = high - low;
    assert!(
        size.z > size.x && size.x > size.y,
        "longest along z, lowest along y: {size}"
    );
    for normal in prior
        .normals()
        .iter()
        .zip(&points)
        .filter(|(_, p)| p.y > high.y - 0.01)
        .map(|(n, _)| n)
    {
        assert!(normal[1] > 0.5, "the roof faces up");
    }
}
