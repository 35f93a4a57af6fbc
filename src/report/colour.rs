//! Colours of the shape's points, gathered from the frames in which they are visible.

use super::{Surface, ZBuffer};
use crate::geometry::{Pose, Vector3};
use crate::image::RgbImage;
use crate::sequence::Frame;
use crate::surface::Neighbours;

/// A twin counts if it lies within this many sample spacings of the mirrored point.
const TWIN_SPACINGS: f64 = 3.0;

/// Weighted sums of what the frames show at each point.
pub(super) struct ColourGatherer {
    /// Per point the sums of RGB · weight and of the weight.
    sums: Vec<([f64; 3], f64)>,
}

/// The shape's colours and where they come from.
pub(super) struct Colours {
    pub rgb: Vec<[u8; 3]>,
    /// Points seen in a frame.
    pub seen: usize,
    /// Unseen points coloured like their left–right mirror twin.
    pub mirrored: usize,
}

impl ColourGatherer {
    pub(super) fn new(point_count: usize) -> Self {
        Self {
            sums: vec![([0.0; 3], 0.0); point_count],
        }
    }

    /// Adds the visible points that project into the frame's mask, weighted by the squared cosine between normal
    /// and line of sight: a point seen head-on is sharpest and least likely to show its neighbour. `gain` evens the frame's exposure.
    pub(super) fn add(
        &mut self,
        frame: &Frame,
        camera_from_object: &Pose,
        surface: &Surface,
        view: &ZBuffer,
        gain: [f64; 3],
    ) {
        for &point in &view.visible {
            let i = point as usize;
            let in_camera = camera_from_object.transform(&surface.points()[i]);
            let Some(pixel) = frame.camera.project(&in_camera) else {
                continue;
            };
            let on_object = frame
                .mask
                .pixel_at(pixel.x, pixel.y)
                .is_some_and(|at| frame.mask[at]);
            if !on_object {
                continue;
            }
            let normal = camera_from_object.rotation * surface.normals()[i];
            let weight = (normal.dot(&in_camera) / in_camera.norm()).powi(2);
            let colour = bilinear(&frame.image, pixel.x, pixel.y);
            let (sum, total) = &mut self.sums[i];
            for (sum, (part, gain)) in sum.iter_mut().zip(colour.into_iter().zip(gain)) {
                *sum += weight * gain * part;
            }
            *total += weight;
        }
    }

    /// Means; an unseen point takes its mirror twin's colour (x → −x) if that was seen, else the mean colour.
    pub(super) fn finish(&self, surface: &Surface) -> Colours {
        let own: Vec<Option<[f64; 3]>> = self
            .sums
            .iter()
            .map(|&(sum, weight)| (weight > 1e-9).then(|| sum.map(|part| part / weight)))
            .collect();
        let seen = own.iter().flatten().count();
        let mean = own.iter().flatten().fold([0.0; 3], |mean, colour| {
            std::array::from_fn(|c| mean[c] + colour[c] / seen as f64)
        });
        let mean = if seen == 0 { [128.0; 3] } else { mean };
        let tree = Neighbours::new(surface.points());
        let mut mirrored = 0;
        let rgb = own
            .iter()
            .zip(surface.points())
            .map(|(colour, point)| {
                let twin = || {
                    let (i, distance) = *tree
                        .nearest(&Vector3::new(-point.x, point.y, point.z), 1)
                        .first()?;
                    let colour = own[i].filter(|_| distance <= TWIN_SPACINGS * surface.spacing())?;
                    mirrored += 1;
                    Some(colour)
                };
                colour
                    .or_else(twin)
                    .unwrap_or(mean)
                    .map(|part| part.round().clamp(0.0, 255.0) as u8)
            })
            .collect();
        Colours { rgb, seen, mirrored }
    }
}

/// The image between pixel centres; the border's colour beyond them.
pub(super) fn bilinear(image: &RgbImage, u: f64, v: f64) -> [f64; 3] {
    let axis = |position: f64, size: usize| {
        let position = (position - 0.5).clamp(0.0, size as f64 - 1.0);
        let low = position as usize;
        (low, (low + 1).min(size - 1), position - low as f64)
    };
    let (left, right, x) = axis(u, image.width());
    let (top, bottom, y) = axis(v, image.height());
    let (a, b) = (image[(left, top)], image[(right, top)]);
    let (c, d) = (image[(left, bottom)], image[(right, bottom)]);
    std::array::from_fn(|i| {
        let [a, b, c, d] = [a[i], b[i], c[i], d[i]].map(f64::from);
        (1.0 - y) * ((1.0 - x) * a + x * b) + y * ((1.0 - x) * c + x * d)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pinhole;
    use crate::image::Grid;

    #[test]
    fn pixel_centres_hold_the_pixel_and_halfway_the_mean() {
        let image = Grid::from_fn(3, 2, |column, row| [column as f32 * 10.0, row as f32, 0.0]);
        assert_eq!(bilinear(&image, 1.5, 0.5), [10.0, 0.0, 0.0]);
        assert_eq!(bilinear(&image, 2.0, 1.0), [15.0, 0.5, 0.0]);
        assert_eq!(bilinear(&image, 0.0, 2.0), [0.0, 1.0, 0.0]);
    }

    #[test]
    fn unseen_points_take_their_twin_or_the_mean() {
        // Red in the image's left half, blue in the right; the camera looks along +z at the origin from z = −2.
        let camera_from_object = Pose {
            translation: Vector3::new(0.0, 0.0, 2.0),
            ..Pose::identity()
        };
        let image = Grid::from_fn(40, 40, |column, _| {
            if column < 20 {
                [200.0, 0.0, 0.0]
            } else {
                [0.0, 0.0, 100.0]
            }
        });
        let frame = Frame {
            name: "a".into(),
            image: image.into(),
            // The object's right edge is masked away.
            mask: Grid::from_fn(40, 40, |column, _| column < 26),
            camera: Pinhole {
                fx: 40.0,
                fy: 40.0,
                cx: 20.0,
                cy: 20.0,
            },
            timestamp_s: None,
            camera_from_input: None,
            depth: None,
            depth_deviation: None,
        };
        // A plate that faces the camera, and another that hides behind it.
        let plate = |z: f64| {
            (0..23 * 11).map(move |i| {
                let (column, row) = (i % 23, i / 23);
                Vector3::new(
                    0.04 * (f64::from(column) - 11.0),
                    0.03 * (f64::from(row) - 5.0),
                    z,
                )
            })
        };
        let surface = Surface::from_points(plate(0.0).chain(plate(0.5)).collect());
        let view = surface.render(&frame.camera, &camera_from_object, frame.image.size());
        let mut gatherer = ColourGatherer::new(surface.points().len());
        gatherer.add(&frame, &camera_from_object, &surface, &view, [1.0; 3]);
        let colours = gatherer.finish(&surface);
        // 19 of 23 columns project left of pixel 26: u = 20 + 20 x, x up to 0.28.
        assert_eq!((colours.seen, colours.mirrored), (19 * 11, 4 * 11));
        // Far left, its masked twin, right of the middle; then the hidden plate.
        let middle_row = 5 * 23;
        assert_eq!(colours.rgb[middle_row], [200, 0, 0]);
        assert_eq!(colours.rgb[middle_row + 22], [200, 0, 0]);
        assert_eq!(colours.rgb[middle_row + 14], [0, 0, 100]);
        let hidden = colours.rgb[23 * 11 + middle_row];
        assert!(hidden[0] > 100 && hidden[2] > 20, "{hidden:?} is not the mean");
    }
}
