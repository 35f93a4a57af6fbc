use super::super::tiny;
use super::*;

fn rectangle([left, top, right, bottom]: [usize; 4]) -> Mask {
    Grid::from_fn(192, 128, |column, row| {
        (left..right).contains(&column) && (top..bottom).contains(&row)
    })
}

/// A red box that moves to the right before blue; in one frame a yellow post stands below it.
fn photos(post: Option<usize>) -> (Vec<Photo>, Vec<Mask>) {
    (0..7)
        .map(|frame| {
            let mask = rectangle([60 + 2 * frame, 40, 108 + 2 * frame, 80]);
            let below = rectangle([60 + 2 * frame, 80, 80 + 2 * frame, 104]);
            let image = Grid::from_fn(192, 128, |column, row| {
                let speckle = 8.0 * (((column + 12 - 2 * frame) / 6 + row / 6) % 2) as f32;
                match (mask[(column, row)], post == Some(frame) && below[(column, row)]) {
                    (true, _) => [220.0, 40.0 + speckle, 30.0],
                    (_, true) => [200.0, 250.0, 30.0],
                    _ => [20.0, 30.0, 160.0],
                }
            });
            let photo = Photo {
                name: frame.to_string(),
                image,
                seconds: None,
                focal_px: None,
                scale: 1.0,
                origin: crate::prepare::photos::Origin::Video,
            };
            (photo, mask)
        })
        .unzip()
}

fn followed(photos: &[Photo], category: Option<&str>, object_box: Option<&str>) -> Followed {
    let folder = tempfile::tempdir().unwrap();
    tiny::redness(folder.path());
    let networks = Networks::read(folder.path(), category).unwrap();
    let object_box = object_box.map(|text| text.parse().unwrap());
    masks(
        photos,
        &networks,
        object_box.as_ref(),
        &Cache::none(),
        Key::of("photos"),
        &|steps| steps == 2 * photos.len(),
    )
    .unwrap()
}

fn worst(found: &Followed, truth: &[Mask]) -> f64 {
    let agreements = found.masks.iter().zip(truth).map(|(a, b)| agreement(a, b));
    agreements.fold(1.0, f64::min)
}

#[test]
fn an_object_is_followed_and_looked_at_in_every_second_frame() {
    let (photos, truth) = photos(None);
    for (category, object_box, how) in [
        (Some("car"), None, "know the category"),
        (Some("car"), Some("66,40,48,40"), "know the category"),
        (None, None, "saliency network alone"),
        (None, Some("66,40,48,40"), "saliency network alone"),
    ] {
        let found = followed(&photos, category, object_box);
        assert!(worst(&found, &truth) > 0.9, "{}", worst(&found, &truth));
        let words = format!("{how}, looked at 4 of 7, 0 decided anew");
        assert!(found.words.contains(&words), "{}", found.words);
    }
}

#[test]
fn what_stands_out_in_one_frame_alone_is_cut_off() {
    let (photos, truth) = photos(Some(2));
    for category in [Some("car"), None] {
        let found = followed(&photos, category, None);
        assert!(
            worst(&found, &truth) > 0.8,
            "{category:?} {} {}",
            worst(&found, &truth),
            found.words
        );
        assert!(found.words.contains("1 decided anew"), "{}", found.words);
    }
}

#[test]
fn where_nothing_is_there_is_no_mask() {
    let (mut photos, _) = photos(None);
    for photo in &mut photos {
        photo.image = Grid::filled(192, 128, [20.0, 30.0, 160.0]);
    }
    let found = followed(&photos, Some("car"), None);
    assert!(found.masks.iter().all(|mask| mask.share() == 0.0));
    assert_eq!(found.words, "nothing stands out");
}

#[test]
fn a_category_that_is_not_detected_is_said_to_be_missing() {
    let (photos, _) = photos(None);
    let folder = tempfile::tempdir().unwrap();
    tiny::redness(folder.path());
    tiny::network(
        folder.path(),
        "detector",
        &tiny::description("detections", "classes = [\"car\"]"),
        0,
        &[[0.0; 3]; 6],
        &[0.0; 6],
        false,
    );
    let networks = Networks::read(folder.path(), Some("car")).unwrap();
    let found = masks(&photos, &networks, None, &Cache::none(), Key::of(""), &|_| true);
    let words = found.unwrap().words;
    assert!(words.contains("NOTHING OF THE CATEGORY"), "{words}");
}

#[test]
fn an_interruption_ends_it() {
    let (photos, _) = photos(None);
    let folder = tempfile::tempdir().unwrap();
    tiny::redness(folder.path());
    let networks = Networks::read(folder.path(), None).unwrap();
    let found = masks(&photos, &networks, None, &Cache::none(), Key::of(""), &|_| false);
    assert!(matches!(found, Err(PrepareError::Interrupted)));
}

#[test]
fn parts_that_differ_are_decided_by_the_class() {
    let own = rectangle([20, 20, 60, 40]);
    let other = rectangle([30, 20, 70, 40]);
    let class = certain(&rectangle([0, 0, 30, 128]));
    // What is left of the middle stays, what is right of it does not come.
    assert!(agreement(&settled(&own, &other, &class).unwrap(), &own) > 0.98);
    let elsewhere = certain(&rectangle([30, 0, 192, 128]));
    let settled = settled(&own, &other, &elsewhere).unwrap();
    assert!(agreement(&settled, &rectangle([30, 20, 70, 40])) > 0.98);
}

#[test]
fn the_last_frame_is_looked_at_too() {
    assert_eq!(key_frames(5), [0, 2, 4]);
    assert_eq!(key_frames(6), [0, 2, 4, 5]);
    assert_eq!(key_frames(1), [0]);
    assert!(key_frames(0).is_empty());
}

/// Of two tracks the one of less score, about what the class network sees.
#[test]
fn what_is_of_the_class_beats_a_larger_box_that_stays() {
    let (photos, _) = photos(None);
    let folder = tempfile::tempdir().unwrap();
    tiny::redness(folder.path());
    let networks = Networks::read(folder.path(), Some("car")).unwrap();
    let segmenter = Segmenter {
        photos: &photos,
        networks: &networks,
        cache: &Cache::none(),
        key: Key::of("photos"),
    };
    let track = |score: f64, sides: &dyn Fn(f64) -> [f64; 4]| Track {
        boxes: (0..7)
            .map(|frame| Some(Sides(sides(2.0 * f64::from(frame)))))
            .collect(),
        score,
    };
    let platform = track(10.0, &|_| [10.0, 20.0, 180.0, 120.0]);
    let object = track(9.0, &|x| [60.0 + x, 40.0, 108.0 + x, 80.0]);
    let part = track(9.5, &|x| [70.0 + x, 50.0, 90.0 + x, 65.0]);
    let tracks = vec![platform.clone(), part, object.clone()];
    assert_eq!(segmenter.likeliest(tracks).unwrap(), Some(object));
    // Alone, it is what was detected.
    assert_eq!(
        segmenter.likeliest(vec![platform.clone()]).unwrap(),
        Some(platform)
    );
    assert_eq!(segmenter.likeliest(Vec::new()).unwrap(), None);
}
