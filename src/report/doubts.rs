//! Whether a result can be believed, by how well shape and masks agree.

use super::FrameResult;

/// Below this mean IoU of silhouettes and masks, no shape of the prior explains the masks. Right results of epfl_04, 10 and 16 from
/// pictures have 0.88 to 0.90.
const EXPLAINED_IOU: f64 = 0.75;
/// Below this, a result is to be looked at before it is used. The chair prior gets 0.75 and 0.80 from epfl_04 and 10.
const DOUBTFUL_IOU: f64 = 0.82;
/// Lengths of a style, in √S, the usual length, that few known objects need: right results of these three have 0.6 to 1.3.
const UNLIKELY_STYLE: f64 = 1.5;
/// Lengths that none needs, however well it fits: the chair prior has 3.5 and 2.4 on epfl_04 and 10 (IoU 0.82 and 0.86), 2.3 on the bundled car (0.90).
const IMPOSSIBLE_STYLE: f64 = 2.1;
/// Root mean squares of the free form's coordinates, 1 being usual where all directions are seen. What frames do not show stays at 0: right results of the
/// cars, chairs and airplanes from renderings have 0.1 to 0.6.
const UNLIKELY_FORM: f64 = 0.8;
/// Root mean squares that none has: the chair on a foot needs 1.1 for the bundled car, an armchair 1.2 for one of bars.
const IMPOSSIBLE_FORM: f64 = 1.0;
/// A focal length may differ from what was known of it by so many of its standard deviations: right results differ by less than one.
const LIKELY_FOCAL: f64 = 3.5;
/// No focal length is known better than this, whatever few features say.
const KNOWN_FOCAL: f64 = 0.02;
/// A frame whose IoU is so much lower than the median one stands alone: its mask or its pose is wrong.
const LOWER_IOU: f64 = 0.12;

/// What speaks against a result.
#[derive(Clone, Debug, PartialEq)]
pub struct Doubts {
    /// Whether a shape of the prior explains the masks, and with a likely focal length; a result that is not so is of no use.
    pub explained: bool,
    /// Sentences for people, each with what to look at.
    pub words: Vec<String>,
}

/// Judges a result by its frames, its style and its free form, of which the prior expects the entries to have variance 1, and the factor that was
/// found for the focal lengths, whose logarithm was expected to have this standard deviation (0 where they were held).
pub fn doubts(
    frames: &[FrameResult],
    (style, free_form): (&[f64], &[f64]),
    focal_factor: f64,
    focal_deviation: f64,
) -> Doubts {
    let mut sorted: Vec<f64> = frames.iter().map(|frame| frame.silhouette_iou).collect();
    sorted.sort_by(f64::total_cmp);
    let median = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    let iou = sorted.iter().sum::<f64>() / sorted.len().max(1) as f64;
    let mut words = Vec::new();
    if iou < DOUBTFUL_IOU {
        words.push(format!(
            "shape and masks agree by an IoU of {iou:.2} only: look at overlay.png; where the masks are right, the prior \
             (--prior) does not know such a shape"
        ));
    }
    let length = style_length(style);
    if length > UNLIKELY_STYLE {
        words.push(format!(
            "the shape is unlike any that the prior knows ({length:.1} times the usual distance from the mean): check --prior and the masks"
        ));
    }
    let bent = style_length(free_form);
    if bent > UNLIKELY_FORM {
        words.push(format!(
            "the shape is bent further than the prior's own ({bent:.1} times their usual free form): check --prior and the masks"
        ));
    }
    let focal_deviation = focal_deviation.max(KNOWN_FOCAL);
    let focal_is_likely = focal_factor.ln().abs() <= LIKELY_FOCAL * focal_deviation;
    if !focal_is_likely {
        words.push(format!(
            "the shape asks for {focal_factor:.2} times the focal length, which was known to {:.0} %: the shape, the masks or the poses \
             are wrong; give --focal if you know it",
            100.0 * focal_deviation
        ));
    }
    let low: Vec<&str> = frames
        .iter()
        .filter(|frame| frame.silhouette_iou < median - LOWER_IOU)
        .map(|frame| frame.name.as_str())
        .collect();
    if !low.is_empty() {
        words.push(format!(
            "in frames {} shape and mask agree far less than elsewhere: mend those masks, or leave the frames out",
            low.join(", ")
        ));
    }
    Doubts {
        explained: iou >= EXPLAINED_IOU
            && length <= IMPOSSIBLE_STYLE
            && bent <= IMPOSSIBLE_FORM
            && (iou >= DOUBTFUL_IOU || length <= UNLIKELY_STYLE)
            && focal_is_likely,
        words,
    }
}

/// ‖s‖ / √S: 1 is the usual length of a style, or of a free form, of which the prior expects the entries to have variance 1.
pub(super) fn style_length(style: &[f64]) -> f64 {
    style.iter().map(|entry| entry * entry).sum::<f64>().sqrt() / (style.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pose;

    fn of(ious: &[f64], style: f64) -> Doubts {
        let frames: Vec<FrameResult> = ious
            .iter()
            .enumerate()
            .map(|(k, &iou)| FrameResult::new(&format!("{k:03}"), &Pose::identity(), iou, 1.0))
            .collect();
        doubts(&frames, (&[style; 4], &[]), 1.0, 0.0)
    }

    #[test]
    fn a_good_result_raises_no_doubts() {
        let found = of(&[0.9, 0.88, 0.92], 1.2);
        assert!(found.explained && found.words.is_empty(), "{found:?}");
    }

    #[test]
    fn a_single_bad_frame_is_named() {
        let found = of(&[0.95, 0.94, 0.7, 0.96], 1.0);
        assert!(found.explained);
        assert_eq!(found.words.len(), 1);
        assert!(found.words[0].contains("frames 002"), "{found:?}");
    }

    #[test]
    fn what_no_shape_explains_is_of_no_use() {
        let found = of(&[0.66, 0.68, 0.67], 1.0);
        assert!(!found.explained);
        assert!(found.words[0].contains("0.67"), "{found:?}");
    }

    #[test]
    fn an_unlikely_shape_is_named_and_refused_where_it_does_not_even_fit_or_is_impossible() {
        let fits = of(&[0.9, 0.9], 1.9);
        assert!(fits.explained);
        assert!(
            fits.words[0].contains("unlike any") && fits.words[0].contains("1.9"),
            "{fits:?}"
        );
        assert!(!of(&[0.8, 0.8], 1.9).explained);
        assert!(!of(&[0.9, 0.9], 2.2).explained);
        assert!(of(&[0.8, 0.8], 1.2).explained);
    }

    #[test]
    fn a_shape_bent_as_none_is_refused_however_well_it_fits() {
        let frames = [FrameResult::new("a", &Pose::identity(), 0.95, 1.0)];
        let bent = |form: f64| doubts(&frames, (&[1.0; 4], &[form; 9]), 1.0, 0.0);
        assert!(bent(0.6).explained && bent(0.6).words.is_empty());
        assert!(bent(0.9).explained && bent(0.9).words[0].contains("0.9 times"));
        assert!(!bent(1.1).explained);
    }

    #[test]
    fn a_focal_length_that_contradicts_what_was_known_makes_a_result_useless() {
        let frames = [FrameResult::new("a", &Pose::identity(), 0.9, 1.0)];
        for (factor, deviation, believed) in [(1.05, 0.06, true), (0.3, 0.18, false), (3.0, 0.18, false)] {
            let found = doubts(&frames, (&[1.0; 4], &[0.5; 9]), factor, deviation);
            assert_eq!(
                (found.explained, found.words.is_empty()),
                (believed, believed),
                "{factor}"
            );
        }
    }
}
