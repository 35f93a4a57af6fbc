use super::super::mesh::body_box;
use super::super::sample_outside;
use super::*;

/// Debian's `torcs-data` and `sweethome3d-furniture`, where they are installed.
fn installed(toml: &str) -> Option<SourceSpec> {
    let spec: SourceSpec = toml::from_str(toml).unwrap();
    if !spec.path.exists() {
        println!("skipped: {} is missing", spec.path.display());
        return None;
    }
    Some(spec)
}

#[test]
fn patterns() {
    for (pattern, name) in [("a*b*c", "a-bb-c"), ("*", ""), ("car*", "car1"), ("car1", "car1")] {
        assert!(matches(pattern, name), "{pattern} {name}");
    }
    for (pattern, name) in [("a*b", "abc"), ("car", "car1"), ("*x", "y")] {
        assert!(!matches(pattern, name), "{pattern} {name}");
    }
}

#[test]
fn unknown_keys_are_refused() {
    let error = toml::from_str::<SourceSpec>("kind = 'torcs'\npath = '.'\ninclud = []\n").unwrap_err();
    assert!(error.to_string().contains("includ"), "{error}");
}

#[test]
fn torcs_cars_are_canonical() {
    let toml = "kind = 'torcs'\npath = '/usr/share/games/torcs'\nexclude = ['buggy', 'car1-ow1']\n";
    let Some(spec) = installed(toml) else { return };
    let models = load_source(&spec).unwrap();
    assert_eq!(models.len(), 15);
    check(&models);
    let licence = |name: &str| &models.iter().find(|m| m.name == name).unwrap().licence;
    assert_eq!(
        (licence("p406").as_str(), licence("car5-trb1").as_str()),
        ("GPL-2.0-or-later", "LAL-1.3")
    );
}

#[test]
fn sweet_home_cars_are_canonical() {
    let toml = "kind = 'sweethome3d'\npath = '/usr/share/sweethome3d/furniture'\ncategory = 'Vehicles'\n\
                include = ['*sedan*', 'VW-*', 'fordFocus', 'seat_leon', 'suv', 'chevrolet', 'smart-car']\n";
    let Some(spec) = installed(toml) else { return };
    let models = load_source(&spec).unwrap();
    assert_eq!(models.len(), 10);
    check(&models);
}

#[test]
fn a_pattern_without_a_match_is_an_error() {
    let toml = "kind = 'torcs'\npath = '/usr/share/games/torcs'\nexclude = ['bugy']\n";
    let Some(spec) = installed(toml) else { return };
    let message = load_source(&spec).unwrap_err().to_string();
    assert!(
        message.contains("'bugy'") && message.contains("buggy"),
        "{message}"
    );
}

/// The body's box, by other samples than the loader's, centred with diagonal 1 and about as large as the bounding
/// box; longest along z, lower at the front third than in the middle, and level: the wheels of both axles stand at
/// one height.
fn check(models: &[NamedModel]) {
    for NamedModel { name, mesh, .. } in models {
        let (low, high) = body_box(&sample_outside(mesh, 20_000, 1).points).unwrap();
        assert!(
            ((high - low).norm() - 1.0).abs() < 0.01 && (low + high).norm() < 0.01,
            "{name}: {low} {high}"
        );
        let (low, high) = mesh.bounds().unwrap();
        let size = high - low;
        assert!(
            (1.0..1.12).contains(&size.norm()) && (low + high).norm() < 0.1,
            "{name}: {low} {high}"
        );
        assert!(size.z > size.x.max(size.y), "{name} {size}");
        let top = |from: f64, to: f64| {
            let inside =
                |v: &&nalgebra::Vector3<f64>| v.z > low.z + from * size.z && v.z < low.z + to * size.z;
            mesh.vertices
                .iter()
                .filter(inside)
                .fold(f64::MIN, |top, v| top.max(v.y))
        };
        assert!(top(0.0, 0.15) < top(0.4, 0.6), "{name}: front is not at −z");
        let ground = |half: fn(f64) -> bool| {
            let half = mesh.vertices.iter().filter(|v| half(v.z));
            half.fold(f64::MAX, |ground, v| ground.min(v.y))
        };
        let step = ground(|z| z < -0.1) - ground(|z| z > 0.1);
        assert!(
            step.abs() < 1e-3,
            "{name}: the front wheels stand {step} above the rear ones"
        );
    }
}

#[test]
fn trigger_cars_are_canonical() {
    let toml = "kind = 'trigger'\npath = '/usr/share/games/trigger-rally/data.zip'\n";
    let Some(spec) = installed(toml) else { return };
    let models = load_source(&spec).unwrap();
    assert_eq!(models.len(), 9);
    check(&models);
}

#[test]
fn plain_folders_take_their_axes_from_the_spec() {
    let folder = tempfile::tempdir().unwrap();
    // z up, x front, y left: the vertex farthest along +x must land at −Z, the one along +y at −X.
    let obj = "v 4 0 0\nv -4 0 0\nv 0 1 0\nv 0 -1 0\nv 0 0 2\nf 1 3 5\nf 2 4 5\n";
    std::fs::write(folder.path().join("a.obj"), obj).unwrap();
    let spec = |axes: &str| -> SourceSpec {
        let path = folder.path().display();
        toml::from_str(&format!("kind = 'plain'\npath = '{path}'\n{axes}")).unwrap()
    };
    let models = load_source(&spec("up = '+z'\nfront = '+x'\nlicence = 'CC0-1.0'\n")).unwrap();
    let [
        NamedModel {
            name, licence, mesh, ..
        },
    ] = models.as_slice()
    else {
        panic!("{} models", models.len())
    };
    assert_eq!((name.as_str(), licence.as_str()), ("a", "CC0-1.0"));
    let from_front = |i: usize| (mesh.vertices[i] - mesh.vertices[0]).normalize();
    let direction = |x: f64, y: f64, z: f64| nalgebra::Vector3::new(x, y, z).normalize();
    assert!((from_front(2) - direction(-1.0, 0.0, 4.0)).norm() < 1e-12);
    assert!((from_front(4) - direction(0.0, 2.0, 4.0)).norm() < 1e-12);
    assert!(load_source(&spec("up = '+z'\nfront = '-z'\nlicence = 'x'\n")).is_err());
    assert!(
        load_source(&spec(""))
            .unwrap_err()
            .to_string()
            .contains("needs up, front and licence")
    );
}

#[test]
fn files_of_one_name_in_different_folders_are_different_models() {
    let folder = tempfile::tempdir().unwrap();
    for (model, height) in [("a1", 1), ("a2", 2), ("a3", 3)] {
        let file = folder.path().join(model).join("models/model_normalized.obj");
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        let obj = format!("v 4 0 0\nv -4 0 0\nv 0 1 0\nv 0 -1 0\nv 0 0 {height}\nf 1 3 5\nf 2 4 5\n");
        std::fs::write(file, obj).unwrap();
    }
    let path = folder.path().display();
    let spec = format!("kind = 'plain'\npath = '{path}'\nup = '+z'\nfront = '+x'\nlicence = 'CC0-1.0'\n");
    let models = load_source(&toml::from_str(&spec).unwrap()).unwrap();
    let names: Vec<_> = models.iter().map(|model| model.name.as_str()).collect();
    assert_eq!(
        names,
        [
            "a1/models/model_normalized",
            "a2/models/model_normalized",
            "a3/models/model_normalized"
        ]
    );
    let tallness = |model: &NamedModel| {
        let (low, high) = model.mesh.bounds().unwrap();
        (high - low).y / (high - low).z
    };
    assert!(
        models
            .windows(2)
            .all(|pair| tallness(&pair[1]) > 1.4 * tallness(&pair[0]))
    );

    let broken = folder.path().join("a2/models/model_normalized.obj");
    std::fs::write(
        &broken,
        "v 0 0 0\nv 1e30 0 0\nv 0 1 0\nv 1 1 0\nv 1 0 0\nf 1 2 3 4 5\n",
    )
    .unwrap();
    let message = load_source(&toml::from_str(&spec).unwrap())
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("a2/models/model_normalized: vertex 2 is ") && message.contains("exclude it"),
        "{message}"
    );
}
