use super::*;
use crate::report::fixture::{box_car, solved};
use crate::report::{ReportInput, Surface, write};
use crate::sequence::Sequence;
use crate::solver::{Solution, Termination};
use std::path::PathBuf;

struct Made {
    home: tempfile::TempDir,
    sequence: Sequence,
}

impl Made {
    /// A result of three frames, changed before it is written.
    fn of(change: impl FnOnce(&mut Solution)) -> Self {
        let surface = Surface::from_points(box_car(600));
        let (sequence, mut solution) = solved(&surface, 3);
        change(&mut solution);
        let home = tempfile::tempdir().unwrap();
        let input = ReportInput {
            sequence: &sequence,
            solution: &solution,
            surface: &surface,
            input: "data/<box> & co",
            length_m: None,
            prior: "car linear (schema 1)",
            masks_anew: &[],
            config: "[solver]\n# </script><b>\n",
            focal_deviation: 0.0,
            peak_memory_mb: None,
        };
        write(&input, &home.path().join("out")).unwrap();
        Self { home, sequence }
    }

    fn folder(&self) -> PathBuf {
        self.home.path().join("out")
    }

    fn page(&self) -> String {
        std::fs::read_to_string(self.folder().join(PAGE)).unwrap()
    }

    /// What the scripts read.
    fn data(&self) -> serde_json::Value {
        let page = self.page();
        let (_, from) = page.split_once("id=\"data\">").unwrap();
        let (data, _) = from.split_once("</script>").unwrap();
        serde_json::from_str(data).unwrap()
    }
}

#[test]
fn the_page_holds_all_of_the_result_and_fetches_nothing() {
    let made = Made::of(|_| ());
    let (page, data) = (made.page(), made.data());
    assert!(page.contains("Usable"), "no verdict");
    assert!(
        page.contains("data&#x2f;&lt;box&gt; &amp; co"),
        "the input's name is not escaped"
    );
    assert!(
        page.contains("# &lt;&#x2f;script&gt;&lt;b&gt;"),
        "the configuration is not escaped"
    );
    // Links to the folder's own files apart.
    for outside in ["src=\"", "href=\"http", "url(http", "import("] {
        let own = page.replace(LIBRARIES, "");
        assert!(!own.contains(outside), "{outside}");
    }
    let frames = data["frames"].as_array().unwrap();
    assert_eq!(frames.len(), 3);
    for frame in frames {
        assert!(
            frame["picture"]
                .as_str()
                .unwrap()
                .starts_with("data:image/jpeg;base64,")
        );
        assert!(
            frame["layers"]
                .as_str()
                .unwrap()
                .starts_with("data:image/png;base64,")
        );
    }
    assert!(frames[0]["turn_deg"].is_null());
    // The platform turns by 12 degrees about an axis that stands before the camera.
    assert!((frames[1]["turn_deg"].as_f64().unwrap() - 12.0).abs() < 1e-9);
    assert!(frames[2]["input_turn_deg"].as_f64().unwrap() < 1e-4);
    assert_eq!(data["shape"]["kind"], "points");
    assert_eq!(data["shape"]["count"], 600);
    assert!(data["input_points"].is_null());
    // Of the objective's terms the silhouette's alone is not 0.
    assert_eq!(
        data["objective"]["terms"],
        serde_json::json!([["total", [9.0]], ["silhouette", [9.0]]])
    );
    assert_eq!(data["objective"]["stages"], serde_json::json!([["level-0", 0]]));
    assert_eq!(data["style"]["entries"], serde_json::json!([0.5, -1.0]));
}

#[test]
fn made_anew_it_has_the_same_bytes() {
    let made = Made::of(|_| ());
    let first = made.page();
    let result = RunResult::load(&made.folder()).unwrap();
    let sequence = as_solved(made.sequence.clone(), &made.folder(), &result).unwrap();
    std::fs::remove_file(made.folder().join(PAGE)).unwrap();
    write_page(&made.folder(), &sequence, 0.0).unwrap();
    assert!(made.page() == first, "another page");
}

#[test]
fn another_sequence_is_refused_by_name() {
    let made = Made::of(|_| ());
    let fewer = made.sequence.clone().edited(|content| {
        content.frames.pop();
        content.truth = None;
    });
    let refused = write_page(&made.folder(), &fewer.unwrap(), 0.0)
        .unwrap_err()
        .to_string();
    assert!(
        refused.contains("result.json: its frames are not those of the sequence"),
        "{refused}"
    );
}

#[test]
fn what_cannot_be_used_is_said_first() {
    let unlikely = Made::of(|solution| solution.estimate.style = vec![3.0, 3.0]).page();
    assert!(unlikely.contains("verdict bad") && unlikely.contains("Not usable"));
    assert!(unlikely.contains("unlike any that the prior knows"));
    let interrupted = Made::of(|solution| solution.termination = Termination::Interrupted).page();
    assert!(interrupted.contains("verdict doubtful") && interrupted.contains("--init-pose RESULT"));
}

#[test]
fn the_objective_s_levels_are_told_apart_and_hypotheses_left_out() {
    let made = Made::of(|solution| {
        let row = solution.trace[0].clone();
        let of = |stage: &str| crate::solver::TraceRow {
            stage: stage.into(),
            ..row.clone()
        };
        solution.trace = ["hypothesis-1/round-0/level-2", "level-2", "level-2", "level-1"]
            .map(of)
            .into();
    });
    let data = made.data();
    assert_eq!(
        data["objective"]["stages"],
        serde_json::json!([["level-2", 0], ["level-1", 2]])
    );
}
