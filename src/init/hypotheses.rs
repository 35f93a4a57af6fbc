//! Pose hypotheses for the target frame: the K best distinct templates (Sec. 2.4, p0), each with its mirror.
//!
//! The paper keeps the template with the highest IoU. A car's silhouette is nearly the same from the front left
//! and the rear right, so several are kept, front/rear partners among them, and the objective chooses.

use super::placement::{Evidence, Placement, Shape, Shown};
use super::templates::{Template, TemplateGrid};
use crate::geometry::Pose;
use rayon::prelude::*;

/// A template is placed by all frames and all points unless so many better ones, as placed by the target's mask and few
/// points, are closer to it than two hypotheses may be. Chosen on the bundled car and EPFL cars 4, 10 and 16, where about
/// one template in ten is left and the two best hypotheses are those of placing all; 4 and 8 may leave fewer than K.
const BETTER_NEARBY: usize = 12;
/// The share of the points that place all templates.
const FEW_POINTS: f64 = 0.25;

/// How many hypotheses, and from where.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HypothesisOptions {
    /// The templates that are tried.
    pub grid: TemplateGrid,
    /// K: hypotheses kept, of which each gets a short solve with the default weights. The paper keeps the one of best IoU.
    pub count: usize,
    /// Two hypotheses differ by at least this rotation, degrees.
    pub distinct_deg: f64,
}

impl Default for HypothesisOptions {
    fn default() -> Self {
        Self {
            grid: TemplateGrid::default(),
            count: 8,
            distinct_deg: 30.0,
        }
    }
}

/// A candidate for p0. The angles (degrees, conventions as in [`TemplateGrid`]) are those of the ray to the object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseHypothesis {
    /// The object's pose in the camera of the target frame, p0 of Eq. 2; lengths in diagonals.
    pub target_from_object: Pose,
    /// The direction from which the camera sees the object: 0 sees its front, 90 its right side.
    pub azimuth_deg: f64,
    /// The camera's height above the object's horizontal plane.
    pub elevation_deg: f64,
    /// The camera's roll about its line of sight; positive turns the image clockwise.
    pub roll_deg: f64,
    /// Silhouette IoU in the target frame.
    pub iou: f64,
}

/// A template in its place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    template: Template,
    pub placement: Placement,
}

impl Template {
    pub fn hypothesis(&self, target_from_object: Pose, iou: f64) -> PoseHypothesis {
        PoseHypothesis {
            target_from_object,
            azimuth_deg: self.azimuth_deg,
            elevation_deg: self.elevation_deg,
            roll_deg: self.roll_deg,
            iou,
        }
    }
}

impl Candidate {
    pub fn hypothesis(&self) -> PoseHypothesis {
        self.template
            .hypothesis(self.placement.target_from_object, self.placement.target_iou)
    }

    fn angle_to(&self, other: &Self) -> f64 {
        let (a, b) = (
            &self.placement.target_from_object,
            &other.placement.target_from_object,
        );
        a.rotation.angle_to(&b.rotation).to_degrees()
    }
}

/// The K best distinct candidates by mean IoU, best first; The points of `shape` sample the prior's mean
/// shape, and so does any first part of them, as farthest points do. Once `go_on` says no,
/// what is left is not looked at.
pub(super) fn search(
    evidence: &Evidence,
    shape: &Shape,
    options: &HypothesisOptions,
    go_on: &(dyn Fn() -> bool + Sync),
) -> Vec<Candidate> {
    let Some(centroid) = evidence.target.centroid_px(&evidence.target.mask) else {
        return Vec::new();
    };
    let ray = evidence.target.camera.unproject(&centroid, 1.0);
    let coarse = shape.first(FEW_POINTS);
    let by_target =
        |shape: &Shape, template: &Template| evidence.place_by_target(shape, &template.rotation(&ray));
    let placed = |template: Template| {
        if !go_on() {
            return None;
        }
        let placement = evidence.place_by_all(shape, by_target(shape, &template)?);
        Some(Candidate { template, placement })
    };
    let roughly_placed = |template: Template| {
        if !go_on() {
            return None;
        }
        let Shown { placement, .. } = by_target(&coarse, &template)?;
        Some(Candidate { template, placement })
    };
    let templates = options.grid.templates();
    let mut rough: Vec<Candidate> = templates.into_par_iter().filter_map(roughly_placed).collect();
    sort_by_score(&mut rough);
    let promising = |&index: &usize| {
        let better = rough[..index].iter();
        let mut nearby = better.filter(|better| better.angle_to(&rough[index]) < options.distinct_deg);
        nearby.nth(BETTER_NEARBY).is_none()
    };
    let mut candidates: Vec<Candidate> = (0..rough.len())
        .into_par_iter()
        .filter(promising)
        .filter_map(|index| placed(rough[index].template))
        .collect();
    sort_by_score(&mut candidates);

    let mut chosen: Vec<Candidate> = Vec::new();
    let distinct = |candidate: &Candidate, chosen: &[Candidate]| {
        chosen
            .iter()
            .all(|other| candidate.angle_to(other) >= options.distinct_deg)
    };
    for candidate in candidates {
        if chosen.len() >= options.count {
            break;
        }
        if !distinct(&candidate, &chosen) {
            continue;
        }
        let step_deg = options.grid.azimuth_step_deg;
        for start in [Some(candidate), placed(candidate.template.mirrored())]
            .into_iter()
            .flatten()
        {
            let refined = refine(start, step_deg, placed);
            if chosen.len() < options.count && distinct(&refined, &chosen) {
                chosen.push(refined);
            }
        }
    }
    sort_by_score(&mut chosen);
    chosen
}

fn sort_by_score(candidates: &mut [Candidate]) {
    // Stable, so that ties keep the grid's order.
    candidates.sort_by(|a, b| b.placement.mean_iou.total_cmp(&a.placement.mean_iou));
}

/// Climbs to the best template within one grid step or so, by halving steps along each angle.
fn refine(
    start: Candidate,
    grid_step_deg: f64,
    placed: impl Fn(Template) -> Option<Candidate> + Sync,
) -> Candidate {
    let mut best = start;
    for step_deg in [grid_step_deg / 2.0, grid_step_deg / 4.0] {
        // Two moves per step size: more would leave the neighbourhood that the grid gave.
        for _ in 0..2 {
            let neighbours = best.template.neighbours(step_deg);
            let moved: Vec<Candidate> = neighbours.into_par_iter().filter_map(&placed).collect();
            let Some(better) = moved
                .into_iter()
                .max_by(|a, b| a.placement.mean_iou.total_cmp(&b.placement.mean_iou))
                .filter(|c| c.placement.mean_iou > best.placement.mean_iou)
            else {
                break;
            };
            best = better;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Pinhole, Vector3};
    use crate::image::Mask;
    use crate::init::silhouette::Observation;
    use crate::init::testing::{BoxCar, CAMERA, sequence};
    use crate::prior::ShapePrior;
    use crate::visibility::Cover;

    /// What [`search`] finds from one frame's mask alone; nothing where it is empty.
    fn pose_hypotheses(
        points: &[f64],
        mask: &Mask,
        camera: &Pinhole,
        options: &HypothesisOptions,
    ) -> Vec<PoseHypothesis> {
        let Some(target) = Observation::new(mask, *camera) else {
            return Vec::new();
        };
        let evidence = Evidence {
            target,
            reconstruction: None,
        };
        let found = search(
            &evidence,
            &Shape::new(points, Some(Cover::around(points))),
            options,
            &|| true,
        );
        found
            .into_iter()
            .map(|candidate| candidate.hypothesis())
            .collect()
    }

    fn template(azimuth_deg: f64, elevation_deg: f64, roll_deg: f64) -> Template {
        Template {
            azimuth_deg,
            elevation_deg,
            roll_deg,
        }
    }

    fn car() -> Vec<f64> {
        let car = BoxCar::new(1500);
        let mut points = vec![0.0; 3 * car.point_count()];
        car.points(&[0.0], &mut points);
        points
    }

    /// One mask, poses off the grid and off the image's centre: the truth is among the hypotheses, and close.
    #[test]
    fn the_truth_is_among_the_hypotheses() {
        let points = car();
        for (azimuth, elevation, roll, translation) in [
            (0.0, 10.0, 0.0, Vector3::new(0.0, 0.1, 1.6)),
            (33.0, 14.0, 3.0, Vector3::new(0.2, 0.1, 1.5)),
            (95.0, 5.0, -2.0, Vector3::new(-0.1, 0.05, 1.7)),
            (214.0, 24.0, 0.0, Vector3::new(0.3, -0.1, 2.2)),
            (277.0, 8.0, 4.0, Vector3::new(-0.3, 0.2, 2.0)),
        ] {
            let truth = Pose {
                rotation: template(azimuth, elevation, roll).rotation(&translation.normalize()),
                translation,
            };
            let mask = &sequence(&[truth], 1.0).frames[0].mask;
            let found = pose_hypotheses(&points, mask, &CAMERA, &HypothesisOptions::default());
            assert_eq!(found.len(), 8);
            assert!(found.is_sorted_by(|a, b| a.iou >= b.iou));
            let angle = |h: &PoseHypothesis| {
                h.target_from_object
                    .rotation
                    .angle_to(&truth.rotation)
                    .to_degrees()
            };
            let best = found.iter().min_by(|a, b| angle(a).total_cmp(&angle(b))).unwrap();
            let offset = (best.target_from_object.translation - translation).norm();
            // Seen from the side, a little from above and a little from below look the same: 17° here.
            assert!(angle(best) < 20.0, "azimuth {azimuth}: {:.1}°", angle(best));
            assert!(offset < 0.06 * translation.norm(), "azimuth {azimuth}: {offset}");
            for (i, a) in found.iter().enumerate() {
                for b in &found[..i] {
                    let between = a
                        .target_from_object
                        .rotation
                        .angle_to(&b.target_from_object.rotation);
                    assert!(between.to_degrees() > 29.99);
                }
            }
        }
    }

    /// The best hypothesis has its front/rear partner beside it.
    #[test]
    fn the_mirror_partner_is_kept() {
        let points = car();
        let translation = Vector3::new(0.0, 0.0, 1.8);
        let truth = Pose {
            rotation: template(30.0, 10.0, 0.0).rotation(&translation.normalize()),
            translation,
        };
        let mask = &sequence(&[truth], 1.0).frames[0].mask;
        let found = pose_hypotheses(&points, mask, &CAMERA, &HypothesisOptions::default());
        let azimuth_gap = |a: f64, b: f64| ((a - b + 540.0).rem_euclid(360.0) - 180.0).abs();
        let partner = found[0].azimuth_deg + 180.0;
        assert!(
            found.iter().any(|h| azimuth_gap(h.azimuth_deg, partner) < 25.0),
            "{found:?}"
        );
    }

    #[test]
    fn an_empty_mask_has_no_hypotheses() {
        let points = car();
        let mask = Mask::filled(30, 20, false);
        assert!(pose_hypotheses(&points, &mask, &CAMERA, &HypothesisOptions::default()).is_empty());
    }
}
