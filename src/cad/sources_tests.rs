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

/// Unit diagonal, centred, longer than wide than high, and lower at the front third than in the middle.
fn check(models: &[NamedModel]) {
    for NamedModel { name, mesh, .. } in models {
        let (low, high) = mesh.bounds().unwrap();
        let size = high - low;
        assert!(
            (size.norm() - 1.0).abs() < 1e-9 && (low + high).norm() < 1e-9,
            "{name}"
        );
        assert!(size.z > size.x && size.x > size.y, "{name} {size}");
        let top = |from: f64, to: f64| {
            let inside =
                |v: &&nalgebra::Vector3<f64>| v.z > low.z + from * size.z && v.z < low.z + to * size.z;
            mesh.vertices
                .iter()
                .filter(inside)
                .fold(f64::MIN, |top, v| top.max(v.y))
        };
        assert!(top(0.0, 0.15) < top(0.4, 0.6), "{name}: front is not at −z");
    }
}
