//! Sequences to train on: the prior's own CAD models and random styles, under random light, from random arcs, with masks that
//! leak and bite.

use super::crop::{CHANNELS, Crop, SIDE_PX};
use crate::cad::render::{Light, LightFrame, Renderer, Viewpoint};
use crate::cad::{Mesh, orbit};
use crate::geometry::Pinhole;
use crate::image::{Grid, Mask, RgbImage};
use crate::prior::{LearnedPrior, ShapePrior};
use crate::report::Surface;
use nalgebra::Vector3;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rayon::prelude::*;

/// Side of what is rendered before it is cut out.
const RENDERED_PX: usize = 96;
/// Points of the shape that is drawn of a random style.
const STYLE_POINTS: usize = 4096;
/// Crops are kept in steps of so much; brighter than 255 of them is cut.
const STEP: f32 = 1.0 / 96.0;

/// The size of the training set and its seed.
#[derive(Clone, Debug)]
pub struct ExampleOptions {
    /// The number of sequences of CAD models, spread evenly over them; as many again show random styles.
    pub sequences: usize,
    /// The frames of each sequence.
    pub frames: usize,
    /// The seed of cameras, styles and light.
    pub seed: u64,
}

/// A CAD model (object frame) and the style that comes nearest to it.
pub struct Model<'a> {
    /// The model's triangles.
    pub mesh: &'a Mesh,
    /// The style, S entries.
    pub style: Vec<f64>,
}

/// Masked frames and the styles that they show.
pub struct Examples {
    frames: Vec<Vec<Vec<u8>>>,
    styles: Vec<Vec<f64>>,
}

impl Examples {
    /// Renders them. `done` hears of every sequence.
    pub fn render(
        prior: &LearnedPrior,
        models: &[Model],
        options: &ExampleOptions,
        done: &(dyn Fn() + Sync),
    ) -> Self {
        let renderers: Vec<Renderer> = models.iter().map(|model| Renderer::new(model.mesh, 1)).collect();
        let of_models = if models.is_empty() { 0 } else { options.sequences };
        let (frames, styles) = (0..of_models + options.sequences)
            .into_par_iter()
            .map(|index| {
                let mut random = ChaCha8Rng::seed_from_u64(options.seed);
                random.set_stream(index as u64);
                let random = &mut random;
                let arc = Arc::new(random);
                let seen = |draw: &dyn Fn(&Viewpoint, &mut ChaCha8Rng) -> (RgbImage, Mask),
                            random: &mut ChaCha8Rng| {
                    (0..options.frames)
                        .map(|frame| {
                            let view = arc.view(frame, options.frames, random);
                            let (image, mask) = draw(&view, random);
                            kept(image, &mask, random)
                        })
                        .collect()
                };
                let light = light(random);
                let example = if index < of_models {
                    let model = index % models.len();
                    let draw = |view: &Viewpoint, _: &mut ChaCha8Rng| {
                        let drawn = renderers[model].render(view, &light);
                        (drawn.image, drawn.mask)
                    };
                    (seen(&draw, random), models[model].style.clone())
                } else {
                    let style: Vec<f64> = (0..prior.style_len())
                        .map(|_| random.sample(StandardNormal))
                        .collect();
                    let mut points = prior.shape(&style);
                    points.truncate(STYLE_POINTS);
                    let painted = Painted::new(Surface::from_points(points), random);
                    (seen(&|view, _| painted.draw(view, &light), random), style)
                };
                done();
                example
            })
            .unzip();
        Self { frames, styles }
    }

    /// The number of sequences, each with the style that it shows.
    pub fn len(&self) -> usize {
        self.styles.len()
    }

    /// Whether there is no sequence.
    pub fn is_empty(&self) -> bool {
        self.styles.is_empty()
    }

    /// The style of a sequence.
    pub fn style(&self, sequence: usize) -> &[f64] {
        &self.styles[sequence]
    }

    /// The numbers of a frame's crop.
    pub fn crop(&self, sequence: usize, frame: usize) -> impl Iterator<Item = f32> {
        self.frames[sequence][frame]
            .iter()
            .map(|&value| f32::from(value) * STEP)
    }

    /// Frames of each sequence.
    pub fn frame_count(&self) -> usize {
        self.frames.first().map_or(0, Vec::len)
    }
}

/// Where a sequence's cameras stand.
struct Arc {
    azimuth_deg: [f64; 2],
    elevation_deg: f64,
    distance: f64,
}

impl Arc {
    fn new(random: &mut impl Rng) -> Self {
        let start = random.random_range(0.0..360.0);
        Self {
            azimuth_deg: [start, start + random.random_range(-60.0..60.0)],
            elevation_deg: random.random_range(0.0..35.0),
            distance: random.random_range(1.3..3.5),
        }
    }

    fn view(&self, frame: usize, frames: usize, random: &mut impl Rng) -> Viewpoint {
        let share = frame as f64 / (frames.max(2) - 1) as f64;
        let [start, end] = self.azimuth_deg;
        let mut off = |most: f64| random.random_range(-most..most);
        let azimuth = start + share * (end - start) + off(2.0);
        let camera_from_object = orbit(azimuth, self.elevation_deg + off(2.0), self.distance);
        let half = RENDERED_PX as f64 / 2.0;
        let focal = 0.85 * RENDERED_PX as f64 * self.distance;
        Viewpoint {
            camera: Pinhole {
                fx: focal,
                fy: focal,
                cx: half,
                cy: half,
            },
            camera_from_object,
            width: RENDERED_PX,
            height: RENDERED_PX,
        }
    }
}

fn light(random: &mut impl Rng) -> Light {
    let ambient = random.random_range(0.3..0.8);
    Light {
        fixed_to: if random.random() {
            LightFrame::Object
        } else {
            LightFrame::Camera
        },
        direction: [
            random.random_range(-1.0..1.0),
            random.random_range(0.2..1.0),
            random.random_range(-1.0..1.0),
        ],
        ambient,
        diffuse: 1.1 - ambient,
    }
}

/// A surface in three colours, one above the other.
struct Painted {
    surface: Surface,
    colours: [[f32; 3]; 3],
    /// Where the second and the third begin.
    heights: [f64; 2],
}

impl Painted {
    fn new(surface: Surface, random: &mut impl Rng) -> Self {
        let low = surface.points().iter().map(|p| p.y).fold(f64::INFINITY, f64::min);
        let high = surface
            .points()
            .iter()
            .map(|p| p.y)
            .fold(f64::NEG_INFINITY, f64::max);
        let at = |share: f64| low + share * (high - low);
        Self {
            colours: std::array::from_fn(|_| std::array::from_fn(|_| random.random_range(15.0..240.0))),
            heights: [
                at(random.random_range(0.0..0.45)),
                at(random.random_range(0.5..1.0)),
            ],
            surface,
        }
    }

    fn draw(&self, view: &Viewpoint, light: &Light) -> (RgbImage, Mask) {
        let drawn = self
            .surface
            .render(&view.camera, &view.camera_from_object, (view.width, view.height));
        let direction = Vector3::from(light.direction);
        let towards = match light.fixed_to {
            LightFrame::Object => direction,
            LightFrame::Camera => {
                view.camera_from_object.rotation.inverse()
                    * Vector3::new(direction.x, -direction.y, -direction.z)
            }
        }
        .normalize();
        let image = Grid::from_fn(view.width, view.height, |column, row| {
            drawn.index[(column, row)].map_or([0.0; 3], |point| {
                let point = point as usize;
                let height = self.surface.points()[point].y;
                let band = self.heights.iter().filter(|&&start| height > start).count();
                let shine =
                    light.ambient + light.diffuse * self.surface.normals()[point].dot(&towards).max(0.0);
                self.colours[band].map(|value| (value * shine as f32).min(255.0))
            })
        });
        (image, drawn.mask())
    }
}

/// The crop under a disturbed mask, before a backdrop of one colour, in steps.
fn kept(mut image: RgbImage, mask: &Mask, random: &mut impl Rng) -> Vec<u8> {
    let backdrop: [f32; 3] = std::array::from_fn(|_| random.random_range(0.0..255.0));
    for (at, inside) in mask.data().iter().enumerate() {
        if !inside {
            image.data_mut()[at] = backdrop;
        }
    }
    let disturbed = disturbed(mask, random);
    let crop = Crop::of(&image, &disturbed).or_else(|| Crop::of(&image, mask));
    let nothing = || vec![0; CHANNELS * SIDE_PX * SIDE_PX];
    crop.map_or_else(nothing, |crop| {
        crop.0
            .iter()
            .map(|value| (value / STEP).round().min(255.0) as u8)
            .collect()
    })
}

/// The mask with a few discs about its border added or taken away.
fn disturbed(mask: &Mask, random: &mut impl Rng) -> Mask {
    let (width, height) = mask.size();
    let border: Vec<(usize, usize)> = (0..width * height)
        .map(|i| (i % width, i / width))
        .filter(|&(c, r)| {
            c + 1 < width
                && r + 1 < height
                && (mask[(c, r)] != mask[(c + 1, r)] || mask[(c, r)] != mask[(c, r + 1)])
        })
        .collect();
    let mut disturbed = mask.clone();
    if border.is_empty() {
        return disturbed;
    }
    for _ in 0..random.random_range(0..6) {
        let (column, row) = border[random.random_range(0..border.len())];
        let (radius, inside): (f64, bool) = (random.random_range(1.0..5.0), random.random());
        for r in 0..height {
            for c in 0..width {
                if (c as f64 - column as f64).hypot(r as f64 - row as f64) < radius {
                    disturbed[(c, r)] = inside;
                }
            }
        }
    }
    disturbed
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cad::synthetic::toy_car;
    use crate::prior;

    #[test]
    fn sequences_show_what_they_are_labelled_with() {
        let prior = prior::find("car").unwrap();
        let mesh = toy_car(0.1, 0.0, 0.4);
        let models = [Model {
            mesh: &mesh,
            style: vec![9.0; prior.style_len()],
        }];
        let options = ExampleOptions {
            sequences: 2,
            frames: 3,
            seed: 5,
        };
        let made = Examples::render(&prior, &models, &options, &|| ());
        assert_eq!((made.len(), made.frame_count()), (4, 3));
        assert_eq!(made.style(0), [9.0; 32]);
        assert!(made.style(2).iter().all(|s| s.abs() < 6.0));
        for sequence in 0..4 {
            for frame in 0..3 {
                let crop: Vec<f32> = made.crop(sequence, frame).collect();
                let covered = &crop[(CHANNELS - 1) * SIDE_PX * SIDE_PX..];
                let share = covered.iter().sum::<f32>() / (SIDE_PX * SIDE_PX) as f32;
                assert!((0.15..0.9).contains(&share), "{sequence} {frame}: {share}");
            }
        }
        let again = Examples::render(&prior, &models, &options, &|| ());
        assert!(made.crop(3, 2).eq(again.crop(3, 2)) && !made.crop(3, 2).eq(made.crop(3, 1)));
    }
}
