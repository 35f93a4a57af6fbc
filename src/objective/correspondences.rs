//! The residuals of Eq. 4 to 6 one by one, each with its weight: for hosts that build a problem of their own.

use super::matcher::Matcher;
use super::options::limit;
use super::{Footage, ObjectiveError, ObjectiveOptions, terms};
use crate::bridge::ceres::ffi;
use crate::geometry::Vector3;
use crate::image::NearestPixel;
use crate::init::Estimate;
use crate::prior::ShapePrior;
use crate::sequence::Sequence;
use nabo::simple_point::SimplePoint;
use nabo::{KDTree, Point};
use std::sync::Arc;

/// A point whose colours in two frames are compared (Eq. 4).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ComparedPoint {
    /// The point's index in the prior's order.
    pub point: u32,
    /// The index of the first frame.
    pub frame_a: u32,
    /// The index of the second frame.
    pub frame_b: u32,
    /// Its cost is weight / 2 · ρ(‖residual‖²), here and below.
    pub weight: f64,
}

/// Off-the-shelf inverse depth where a frame sees a point (Eq. 6), in the input's units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownInverseDepth {
    /// The point's index in the prior's order.
    pub point: u32,
    /// The index of the frame.
    pub frame: u32,
    /// The image point (column, row), pixels.
    pub pixel: [f64; 2],
    /// The given inverse depth 1 / z at `pixel`, per input unit.
    pub inverse_depth: f64,
    /// The change of `inverse_depth` by one pixel along the columns and along the rows.
    pub slope: [f64; 2],
    /// What it weighs against one that is exact: a factor on what [`Correspondences::inverse_depth`] says.
    pub weight: f64,
}

/// Who is nearest to whom in one frame (Eq. 5). The lists keep their lengths.
#[derive(Clone, Debug, PartialEq)]
pub struct SilhouetteMatches {
    /// Centres (column, row) of the mask's pixels in use.
    pub pixels: Vec<[f64; 2]>,
    /// The index of the point whose projection is nearest, one per pixel of `pixels`.
    pub point_of_pixel: Vec<u32>,
    /// The weight of every pixel's residual; the cost is weight / 2 · ρ(‖residual‖²).
    pub pixel_weight: f64,
    /// The nearest pixel (column, row) of the mask, one for each of the first points.
    pub pixel_of_point: Vec<[f64; 2]>,
    /// The weight of each of these residuals.
    pub point_weights: Vec<f64>,
}

/// The residuals of Eq. 4 to 6 at the estimate that they were last updated to.
pub struct Correspondences {
    sequence: Arc<Sequence>,
    matcher: Matcher,
    terms: ffi::Terms,
    /// A lookup of the nearest mask pixel, one per frame.
    lookups: Vec<NearestPixel>,
    /// The number of the prior's points that residuals name: the first ones.
    point_count: usize,
    /// The weight of a point before the frames' agreement on it, one per frame.
    point_weight: Vec<f64>,
    compared: Vec<ComparedPoint>,
    depths: Vec<KnownInverseDepth>,
    silhouettes: Vec<SilhouetteMatches>,
}

impl Correspondences {
    /// Of all frames of `sequence`, of which `target` is the paper's target frame, at `start`, whose α gives the unit in which inverse
    /// depths are weighed.
    ///
    /// # Errors
    /// As [`Objective::new`](super::Objective::new).
    pub fn new(
        sequence: Arc<Sequence>,
        prior: Arc<dyn ShapePrior>,
        options: &ObjectiveOptions,
        target: usize,
        start: &Estimate,
        threads: usize,
    ) -> Result<Self, ObjectiveError> {
        options
            .check()
            .map_err(|(name, why)| ObjectiveError::Option(name, why))?;
        let frames = sequence.frames.len();
        if target >= frames {
            return Err(ObjectiveError::Target { target, frames });
        }
        let footage = Footage::new(&sequence, 1)?;
        let matcher = Matcher::new(&footage, prior, options, target, start.alpha, threads);
        let terms = terms(&sequence, &matcher.options, target, start.alpha);
        let targets = limit(options.silhouette_targets, matcher.prior.point_count());
        let point_count = matcher.options.points.max(targets);
        let lookups = sequence.frames.iter().map(|frame| {
            NearestPixel::new(&frame.mask).ok_or_else(|| ObjectiveError::EmptyMask(frame.name.clone()))
        });
        let lookups = lookups.collect::<Result<Vec<_>, _>>()?;
        let scale = 2.0 / frames as f64 * terms.silhouette.weight;
        let silhouettes = terms.silhouette.frames.iter().zip(&sequence.frames);
        let silhouettes = silhouettes.map(|(share, frame)| {
            let width = frame.mask.width() as u32;
            let centre = |&index: &u32| [index % width, index / width].map(|x| f64::from(x) + 0.5);
            SilhouetteMatches {
                pixels: share.pixels.iter().map(centre).collect(),
                point_of_pixel: vec![0; share.pixels.len()],
                pixel_weight: scale * share.pixel_weight,
                pixel_of_point: vec![[0.0; 2]; share.points as usize],
                point_weights: vec![0.0; share.points as usize],
            }
        });
        let mut made = Self {
            silhouettes: silhouettes.collect(),
            point_weight: terms
                .silhouette
                .frames
                .iter()
                .map(|share| scale * share.point_weight)
                .collect(),
            lookups,
            point_count,
            terms,
            matcher,
            sequence,
            compared: Vec::new(),
            depths: Vec::new(),
        };
        made.update(start)?;
        Ok(made)
    }

    /// Finds anew what is visible, and all matches: as Algorithm 1 does before each of its steps.
    ///
    /// # Errors
    /// An estimate that does not fit the sequence and the prior.
    pub fn update(&mut self, estimate: &Estimate) -> Result<(), ObjectiveError> {
        self.check(estimate)?;
        let found = self.matcher.find(&self.sequence.frames, estimate, 0);
        let weight = self.terms.photometric.weight;
        self.compared = found
            .comparisons
            .iter()
            .map(|item| {
                let pair = &found.pairs[item.pair as usize];
                ComparedPoint {
                    point: item.point,
                    frame_a: pair.a,
                    frame_b: pair.b,
                    weight: weight * pair.weight * f64::from(item.directions),
                }
            })
            .collect();
        let unit = self.matcher.input_unit;
        self.depths = found
            .depths
            .iter()
            .map(|seen| KnownInverseDepth {
                point: seen.point,
                frame: seen.frame,
                pixel: [seen.column, seen.row],
                inverse_depth: seen.inverse_depth * unit,
                slope: [seen.by_column * unit, seen.by_row * unit],
                weight: seen.weight,
            })
            .collect();
        for (matches, weight) in self.silhouettes.iter_mut().zip(&self.point_weight) {
            for (j, point_weight) in matches.point_weights.iter_mut().enumerate() {
                *point_weight = weight * found.silhouette_weights.get(j).unwrap_or(&1.0);
            }
        }
        self.rematch(estimate)
    }

    /// Finds anew who is nearest to whom in the silhouettes, and nothing else: as the objective does in every evaluation.
    ///
    /// # Errors
    /// As [`Correspondences::update`].
    pub fn rematch(&mut self, estimate: &Estimate) -> Result<(), ObjectiveError> {
        self.check(estimate)?;
        let mut points = vec![0.0; 3 * self.point_count];
        self.matcher.prior.points(&estimate.style, &mut points);
        for (l, matches) in self.silhouettes.iter_mut().enumerate() {
            let frame = &self.sequence.frames[l];
            let (camera, pose) = (estimate.camera(&frame.camera), &estimate.camera_from_object[l]);
            let projected: Vec<Option<[f64; 2]>> = points
                .chunks_exact(3)
                .map(|x| {
                    let at = camera.project(&pose.transform(&Vector3::from_column_slice(x)))?;
                    Some([at.x, at.y])
                })
                .collect();
            for (pixel, at) in matches.pixel_of_point.iter_mut().zip(&projected) {
                if let Some(at) = at {
                    *pixel = self.lookups[l].nearest(at[0], at[1]).into();
                }
            }
            let indices: Vec<u32> = (0u32..)
                .zip(&projected)
                .filter_map(|(j, at)| at.is_some().then_some(j))
                .collect();
            let tree: KDTree<f32, _> = KDTree::new(&projected.iter().flatten().map(key).collect::<Vec<_>>());
            for (point, pixel) in matches.point_of_pixel.iter_mut().zip(&matches.pixels) {
                if let Some(found) = tree.knn(1, &key(pixel)).first() {
                    *point = indices[found.index as usize];
                }
            }
        }
        Ok(())
    }

    fn check(&self, estimate: &Estimate) -> Result<(), ObjectiveError> {
        let (frames, styles) = (self.sequence.frames.len(), self.matcher.style_len());
        if estimate.frame_count() != frames || estimate.style.len() != styles {
            return Err(ObjectiveError::Shape {
                estimate: estimate.frame_count(),
                style: estimate.style.len(),
                frames,
                styles,
            });
        }
        Ok(())
    }

    /// How many of the prior's points may be named: the first so many.
    pub fn point_count(&self) -> usize {
        self.point_count
    }

    /// The number of style entries S.
    pub fn style_count(&self) -> usize {
        self.matcher.style_len()
    }

    /// The pairs of colours that the photometric term compares (Eq. 4).
    pub fn compared(&self) -> &[ComparedPoint] {
        &self.compared
    }

    /// The given inverse depths that the points are compared with (Eq. 6).
    pub fn depths(&self) -> &[KnownInverseDepth] {
        &self.depths
    }

    /// The silhouette correspondences of every frame, in order.
    pub fn silhouettes(&self) -> &[SilhouetteMatches] {
        &self.silhouettes
    }

    /// Huber width of a colour difference, in levels.
    pub fn photometric_huber(&self) -> f64 {
        self.terms.photometric.huber_width
    }

    /// Cauchy width of a silhouette's distance, in pixels; 0 = none.
    pub fn silhouette_cauchy(&self) -> f64 {
        self.terms.silhouette.cauchy_width
    }

    /// The distance of a silhouette correspondence that counts as none, pixels.
    pub fn silhouette_tolerance(&self) -> f64 {
        self.terms.silhouette.tolerance
    }

    /// What each inverse depth weighs, and its Huber width, in the input's inverse units.
    pub fn inverse_depth(&self) -> (f64, f64) {
        let (term, unit) = (&self.terms.inverse_depth, self.matcher.input_unit);
        let weight = term.weight / self.sequence.frames.len() as f64;
        (weight / (unit * unit), term.huber_width * unit)
    }

    /// The weight of ‖s‖² in the objective: the cost is weight / 2 · ‖s‖².
    pub fn style_weight(&self) -> f64 {
        self.terms.style.weight
    }
}

fn key(at: &[f64; 2]) -> SimplePoint<2> {
    SimplePoint::from_raw(&at.map(|x| x as f32)).unwrap_or_default()
}
