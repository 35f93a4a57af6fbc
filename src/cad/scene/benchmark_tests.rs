use super::*;

const LIST: &str = "frames = [2, 5]
[scene]
model = { kind = 'torcs', path = 'cars' }
arc = { distance = 1.7, elevation_deg = 15, jitter = { angle_deg = 1, aim = 0.01 } }
[[sequence]]
name = 'front'
scene = { seed = 1, arc = { azimuth_deg = [0, 30] } }
[[sequence]]
name = 'rear'
scene = { seed = 2, arc = { azimuth_deg = [150, 180], elevation_deg = 25, jitter = { aim = 0.02 } } }
";

fn load(list: &str) -> Result<Benchmark, String> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("list.toml");
    std::fs::write(&file, list).unwrap();
    Benchmark::load(&file).map_err(|error| {
        let message = error.to_string();
        assert!(!message.contains('\n'), "{message}");
        message
            .strip_prefix(&format!("{}: ", file.display()))
            .unwrap()
            .to_owned()
    })
}

#[test]
fn a_sequence_s_own_keys_come_over_the_shared_ones() {
    let benchmark = load(LIST).unwrap();
    assert_eq!(benchmark.names(), ["front", "rear"]);
    assert_eq!(benchmark.frames, [2, 5]);
    let (front, rear) = (
        benchmark.scene("front", 5).unwrap(),
        benchmark.scene("rear", 2).unwrap(),
    );
    assert_eq!((front.seed, front.arc.frames), (1, 5));
    assert_eq!((rear.seed, rear.arc.frames), (2, 2));
    assert_eq!(
        (front.arc.elevation_deg, front.arc.jitter.aim, front.arc.distance),
        (15.0, 0.01, 1.7)
    );
    assert_eq!(
        (rear.arc.elevation_deg, rear.arc.jitter.aim, rear.arc.distance),
        (25.0, 0.02, 1.7)
    );
    assert_eq!(rear.arc.jitter.angle_deg, 1.0);
}

#[test]
fn mistakes_are_named_with_their_sequence() {
    for (from, to, expected) in [
        ("seed = 1", "sead = 1", "sequence 'front': unknown field `sead`"),
        ("seed = 2, ", "", "sequence 'rear': missing field `seed`"),
        (
            "distance = 1.7",
            "distance = 0.1",
            "sequence 'front': arc.distance: give more than 0.6",
        ),
        (
            "distance = 1.7",
            "distance = 1.7, frames = 3",
            "sequence 'front': arc.frames comes from `frames`",
        ),
        (
            "[2, 5]",
            "[2, 1]",
            "sequence 'front': arc.frames: give 2 to 10000",
        ),
        ("[2, 5]", "[]", "frames: empty"),
        ("'rear'", "'front'", "sequence 'front': the name occurs twice"),
        ("'rear'", "'../rear'", "sequence '../rear': not a folder's name"),
        ("[[sequence]]", "[[sequense]]", "line 5: unknown field `sequense`"),
    ] {
        let message = load(&LIST.replace(from, to)).unwrap_err();
        assert!(message.starts_with(expected), "{message}");
    }
    let unknown = load(LIST).unwrap().scene("side", 2).unwrap_err().to_string();
    assert!(
        unknown.ends_with("sequence 'side': not in the list; give one of front, rear"),
        "{unknown}"
    );
}

#[test]
fn the_shipped_list_has_models_apart_from_the_prior_s_on_arcs_of_30_degrees() {
    let list = concat!(env!("CARGO_MANIFEST_DIR"), "/data/benchmarks/rendered.toml");
    let benchmark = Benchmark::load(list.as_ref()).unwrap();
    assert_eq!(benchmark.frames, [2, 5, 11, 31, 91]);
    let scenes: Vec<Scene> = benchmark
        .names()
        .iter()
        .map(|name| benchmark.scene(name, 11).unwrap())
        .collect();
    let learned =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/data/priors/car.toml")).unwrap();
    let learned: Table = toml::from_str(&learned).unwrap();
    let kept_aside = learned["source"].as_array().unwrap()[0]["exclude"]
        .as_array()
        .unwrap();
    assert_eq!(scenes.len(), 4);
    for scene in &scenes {
        let [model] = scene.model.include.as_slice() else {
            panic!("{:?}", scene.model);
        };
        assert!(kept_aside.contains(&Value::from(model.as_str())), "{model}");
        let [first, last] = scene.arc.azimuth_deg;
        assert_eq!(last - first, 30.0);
    }
}
