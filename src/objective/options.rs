//! Weights and sizes of Eq. 9.

use serde::{Deserialize, Serialize};

/// What goes into the objective, and with which weight.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ObjectiveOptions {
    /// Weight of the photometric term L_ph. The paper's is 1, at which it drowns the others a thousandfold.
    pub photometric_weight: f64,
    /// Eq. 4 sums over the source frames, where Eq. 5 and 6 are means over frames. Beyond so many source frames it weighs
    /// no more than with so many; 0 means no limit, as in the paper. More frames on the same arc tell little that is new, since
    /// what is left of colour differences is light and shape that they share; without a limit, a long video has colours drown all else.
    pub photometric_frames: usize,
    /// δ1: Huber width of a pixel's colour difference, in levels of [0, 255]. The paper's is 100.
    pub photometric_huber: f64,
    /// Which frames Eq. 4 compares with which.
    pub pairs: Pairs,
    /// Leave a point out of Eq. 4 where the other frame does not see it; the paper keeps it, and compares
    /// what hides it.
    pub covisible: bool,
    /// λ1: weight of the silhouettes' Chamfer distance L_cd, of squares in the pixels of `silhouette_size`. The paper's is 0.1.
    pub silhouette_weight: f64,
    /// Cauchy scale of a silhouette correspondence, in pixels of `silhouette_size`: masks leak, and a leak must not pull for ever. 0
    /// means none, as in the paper.
    pub silhouette_cauchy: f64,
    /// How much more a point's distances outside the masks weigh where most frames agree that it is outside: masks that leak or lack a part
    /// are few. 0 treats each frame by itself, as the paper does. Chosen on epfl_04, 10 and 16 from pictures: mean IoU 0.928, 0.902, 0.942
    /// with 0; 0.928, 0.907, 0.944 with 5; 0.931, 0.917, 0.945 with 15.
    pub silhouette_agreement: f64,
    /// Distance of a silhouette correspondence, in pixels of `silhouette_size`, that counts as none; the paper's is 0. Points and
    /// pixels have a size: without it, the pairs inside the silhouette brake every motion of the shape.
    pub silhouette_tolerance: f64,
    /// Silhouettes are measured and summed in pixels of images in which the object's mean mask has this size squared as its area;
    /// 0 means pixels as they are, as in the paper. Otherwise the same video at another resolution, or a larger object
    /// in it, is another objective. The default is the size in the bundled sequence, with which weights were chosen.
    pub silhouette_size: f64,
    /// λ2: weight of the inverse-depth term L_invd. The paper's is 1000.
    pub inverse_depth_weight: f64,
    /// δ2: Huber width of an inverse-depth difference, 1 / object diagonal. The paper's 10 is never reached by an
    /// object at more than a tenth of its diagonal, and lets the outliers of semi-dense depth pull freely.
    pub inverse_depth_huber: f64,
    /// Weight of −log p(s) = ½‖s‖², of a free form's coordinates, too; 0 leaves it out, as the paper does. Neighbouring pixels err alike, so that
    /// residuals count for more than they know. With 10, epfl_16's front is taken for its rear; with 30 and more, shapes from pictures (epfl_04, 10, 16)
    /// fit worse.
    pub style_weight: f64,
    /// Standard deviation, in diagonals, of where the off-the-shelf poses and α (Eq. 13) take the object's points between two
    /// frames of a pair: the motion is held to them as closely as that. None means what the sequence says of itself; 0 holds nothing, as in the
    /// paper, for which those poses are but a start.
    pub motion_deviation: Option<f64>,
    /// Standard deviation of the logarithm of one factor for all focal lengths, which the solver then finds. None means what the
    /// sequence says of itself; 0 keeps the focal lengths as they are.
    pub focal_deviation: Option<f64>,
    /// Points project as if all had the depth of the object's origin, as in Zhu et al. There is no depth of single
    /// points then, so the inverse-depth term must have no weight. Visibility stays that of the perspective camera.
    pub weak_perspective: bool,
    /// How many of the prior's points Eq. 4 and 6 use; 0 means all.
    pub points: usize,
    /// At most this many of each silhouette's pixels are paired with points, the weight rescaled; 0 means all.
    pub silhouette_pixels: usize,
    /// Among how many of the prior's points a silhouette's pixels look for theirs; 0 means all. The denser they are, the fewer
    /// pixels inside the silhouette find none within the tolerance.
    pub silhouette_targets: usize,
    /// At most this many of the points are paired with silhouette pixels, the weight rescaled; 0 means all.
    pub silhouette_points: usize,
    /// How many points each one stands for in the sums over points.
    #[serde(skip, default = "one")]
    pub(crate) point_weight: f64,
}

/// The frames that Eq. 4 compares. However many pairs there are, the term weighs as much as the paper's star of as many
/// frames.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Pairs {
    /// The target with every other frame, as in the paper.
    Star,
    /// Every frame with those so many frames after it.
    Offsets(Vec<usize>),
}

impl Default for Pairs {
    fn default() -> Self {
        Self::Offsets(vec![1, 2, 4, 8, 16, 32, 64])
    }
}

impl Pairs {
    /// The pairs among `frames` frames.
    pub(super) fn of(&self, frames: usize, target: usize) -> Vec<(usize, usize)> {
        match self {
            Self::Star => (0..frames)
                .filter(|&l| l != target)
                .map(|l| (target, l))
                .collect(),
            Self::Offsets(offsets) => offsets
                .iter()
                .flat_map(|&offset| (offset..frames).map(move |l| (l - offset, l)))
                .collect(),
        }
    }

    fn check(&self) -> Result<(), &'static str> {
        match self {
            Self::Offsets(offsets) if !offsets.contains(&1) => Err("offsets must hold 1"),
            Self::Offsets(offsets) if offsets.contains(&0) => Err("an offset must be 1 or more"),
            _ => Ok(()),
        }
    }
}

fn one() -> f64 {
    1.0
}

/// How much wider the silhouettes' Cauchy loss is in a hypothesis's solve, and how much heavier the style term: where that is 30 times as heavy, five of
/// twenty perturbed starts of the bundled sequence end 3 % too near.
const CAUTIOUS_CAUCHY: f64 = 4.0;
const CAUTIOUS_STYLE: f64 = 10.0;

/// Of a thinned shape, so many points for each in use are there for the silhouettes' pixels: fewer leave gaps within.
const TARGETS_A_POINT: usize = 4;

/// Weight of a mean over frames: squared distances in deviations from the off-the-shelf motion. However many pairs there are,
/// they weigh as much as the paper's star of as many frames.
pub(super) const MOTION_WEIGHT: f64 = 2500.0;
/// Cauchy scale in deviations: single off-the-shelf poses are wrong.
pub(super) const MOTION_CAUCHY: f64 = 6.0;

/// `wanted`, or all where it is 0 or more than there are.
pub(super) fn limit(wanted: usize, all: usize) -> usize {
    if wanted == 0 { all } else { wanted.min(all) }
}

impl Default for ObjectiveOptions {
    fn default() -> Self {
        Self {
            photometric_weight: 1e-4,
            photometric_frames: 10,
            photometric_huber: 20.0,
            pairs: Pairs::default(),
            covisible: true,
            silhouette_weight: 1.6,
            silhouette_cauchy: 1.0,
            silhouette_agreement: 15.0,
            silhouette_tolerance: 1.0,
            silhouette_size: 116.0,
            inverse_depth_weight: 4e4,
            inverse_depth_huber: 0.003,
            style_weight: 20.0,
            motion_deviation: None,
            focal_deviation: None,
            weak_perspective: false,
            points: 8192,
            silhouette_pixels: 2000,
            silhouette_targets: 0,
            silhouette_points: 2048,
            point_weight: one(),
        }
    }
}

impl ObjectiveOptions {
    /// The objective for a start that may be far off: silhouettes that pull from farther away, and a shape that
    /// must stay near the mean until the pose is right, lest it bends to a wrong one. Cheaper, too: at most
    /// `points` of the prior's `all` points, each standing for several, and silhouettes thinned alike.
    pub(crate) fn cautious(&self, points: usize, all: usize) -> Self {
        Self {
            silhouette_cauchy: CAUTIOUS_CAUCHY * self.silhouette_cauchy,
            silhouette_agreement: 0.0,
            style_weight: CAUTIOUS_STYLE * self.style_weight,
            ..self.thinned(points, all)
        }
    }

    /// What Eq. 4 weighs in all, of `frames` frames: it is a mean over pairs times the source frames that count.
    pub(super) fn photometric_weight_of_all(&self, frames: usize) -> f64 {
        let sources = frames.saturating_sub(1).max(1);
        self.photometric_weight * limit(self.photometric_frames, sources) as f64
    }

    fn thinned(&self, points: usize, all: usize) -> Self {
        let full = limit(self.points, all);
        let used = points.min(full);
        let ratio = full as f64 / used as f64;
        let thin = |count: usize| {
            if count == 0 {
                0
            } else {
                (count as f64 / ratio).ceil() as usize
            }
        };
        Self {
            points: used,
            point_weight: self.point_weight * ratio,
            silhouette_pixels: thin(self.silhouette_pixels),
            silhouette_targets: limit(self.silhouette_targets, all).min(TARGETS_A_POINT * used),
            silhouette_points: thin(self.silhouette_points),
            ..self.clone()
        }
    }

    /// The name of the first option that cannot be used, and why.
    pub fn check(&self) -> Result<(), (&'static str, &'static str)> {
        let weights = [
            ("photometric_weight", self.photometric_weight),
            ("silhouette_weight", self.silhouette_weight),
            ("inverse_depth_weight", self.inverse_depth_weight),
            ("style_weight", self.style_weight),
            ("motion_deviation", self.motion_deviation.unwrap_or_default()),
            ("focal_deviation", self.focal_deviation.unwrap_or_default()),
            ("silhouette_cauchy", self.silhouette_cauchy),
            ("silhouette_agreement", self.silhouette_agreement),
            ("silhouette_tolerance", self.silhouette_tolerance),
            ("silhouette_size", self.silhouette_size),
        ];
        for (name, weight) in weights {
            if !(weight.is_finite() && weight >= 0.0) {
                return Err((name, "must be 0 or more"));
            }
        }
        for (name, width) in [
            ("photometric_huber", self.photometric_huber),
            ("inverse_depth_huber", self.inverse_depth_huber),
        ] {
            if !(width.is_finite() && width > 0.0) {
                return Err((name, "must be more than 0"));
            }
        }
        self.pairs.check().map_err(|why| ("pairs", why))?;
        if self.weak_perspective && self.inverse_depth_weight > 0.0 {
            return Err(("inverse_depth_weight", "must be 0 with weak_perspective"));
        }
        Ok(())
    }
}
