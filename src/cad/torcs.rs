//! Cars of the racing game TORCS: a body in AC3D, and wheels assembled from the car's XML.
//!
//! AC3D frame of TORCS: x forward, y up, z right; the body's floor is at y = 0. XML frame: x forward, y left.

use super::archive::{Archive, beside};
use super::sources::{Library, NamedModel};
use super::torcs_wheel::{self, Wheel};
use super::{Axes, CadError, Mesh, ac3d};
use nalgebra::{Rotation3, Vector3};
use std::path::Path;

/// TORCS's data folder.
pub(super) struct Torcs {
    archive: Archive,
    cars: Vec<String>,
}

impl Torcs {
    pub(super) fn open(root: &Path) -> Result<Self, CadError> {
        let archive = Archive::open(root)?;
        let cars = archive
            .names()?
            .iter()
            .filter_map(|name| {
                let (car, file) = name.strip_prefix("cars/")?.split_once('/')?;
                (file.strip_suffix(".acc") == Some(car)).then(|| car.to_owned())
            })
            .collect();
        Ok(Self { archive, cars })
    }
}

impl Library for Torcs {
    fn names(&self) -> Vec<String> {
        self.cars.clone()
    }

    fn load(&mut self, index: usize) -> Result<NamedModel, CadError> {
        let name = &self.cars[index];
        Ok(NamedModel {
            name: name.clone(),
            source: "torcs-data".to_owned(),
            licence: licence(&mut self.archive, name)?,
            mesh: car(&mut self.archive, name)?,
            weight: 1.0,
        })
    }
}

/// A car with its wheels in the canonical axes, standing on level ground, not yet normalised.
fn car(archive: &mut Archive, car: &str) -> Result<Mesh, CadError> {
    let body = format!("cars/{car}/{car}.acc");
    let mut mesh = ac3d::read(archive, &body)?;
    let xml_name = beside(&body, &format!("{car}.xml"));
    let xml_path = archive.path_of(&xml_name);
    let text = String::from_utf8_lossy(&archive.read(&xml_name)?).into_owned();
    let parameters = Parameters::parse(&text, &xml_path)?;

    let directory = parameters.text("Graphic Objects", "3d wheel directory").ok();
    let mut contacts = Vec::new();
    for side in ["Front Right", "Front Left", "Rear Right", "Rear Left"] {
        let (axle, _) = side.split_once(' ').unwrap_or((side, ""));
        let section = format!("{side} Wheel");
        let number = |key: &str| parameters.number(&section, key);
        let width = number("tire width")?;
        let radius = number("rim diameter")? / 2.0 + width * number("tire height-width ratio")?;
        let wheel = Wheel {
            centre: [
                parameters.number(&format!("{axle} Axle"), "xpos")?,
                // At rest the suspension holds the floor at the ride height over the ground.
                radius - number("ride height")?,
                -number("ypos")?,
            ],
            radius,
            width,
        };
        contacts.push([wheel.centre[0], wheel.centre[1] - wheel.radius]);
        mesh.append(match directory {
            Some(directory) => {
                torcs_wheel::modelled(archive, &format!("wheels/{directory}/wheel0.acc"), &wheel)?
            }
            None => {
                let texture = parameters.text("Graphic Objects", "wheel texture")?;
                torcs_wheel::plain(archive, &beside(&body, texture), &wheel)?
            }
        });
    }
    mesh.map(Rotation3::from_axis_angle(&Vector3::z_axis(), -rake(&contacts)).matrix());
    mesh.turn(Axes::Y_UP_X_FRONT);
    Ok(mesh)
}

/// How far the front of the ground lies above its rear, radians, in the frame of a body whose wheels touch it at
/// `contacts` (forward, up): the ride heights differ between the axles, and cars of other sources stand level.
fn rake(contacts: &[[f64; 2]]) -> f64 {
    let n = contacts.len() as f64;
    let mean = |axis: usize| contacts.iter().map(|c| c[axis]).sum::<f64>() / n;
    let (x, y) = (mean(0), mean(1));
    let (along, up) = contacts.iter().fold((0.0, 0.0), |(xx, xy), c| {
        (xx + (c[0] - x).powi(2), xy + (c[0] - x) * (c[1] - y))
    });
    up.atan2(along)
}

/// As Debian's copyright file sorts the cars: those whose `readme.txt` names the Free Art License, and the rest.
fn licence(archive: &mut Archive, car: &str) -> Result<String, CadError> {
    let readme = archive.read_if_present(&format!("cars/{car}/readme.txt"))?;
    let free_art = readme.is_some_and(|text| String::from_utf8_lossy(&text).contains("Free Art"));
    Ok(if free_art { "LAL-1.3" } else { "GPL-2.0-or-later" }.to_owned())
}

/// TORCS's parameter files: `<section name><attnum name unit val/><attstr name val/></section>`.
struct Parameters<'a> {
    document: roxmltree::Document<'a>,
    path: &'a Path,
}

impl<'a> Parameters<'a> {
    fn parse(text: &'a str, path: &'a Path) -> Result<Self, CadError> {
        let options = roxmltree::ParsingOptions {
            allow_dtd: true,
            ..Default::default()
        };
        let document = roxmltree::Document::parse_with_options(text, options)
            .map_err(|error| CadError::malformed(path, "XML", error))?;
        Ok(Self { document, path })
    }

    fn attribute(&self, section: &str, key: &str) -> Result<roxmltree::Node<'_, 'a>, CadError> {
        self.document
            .descendants()
            .filter(|node| node.has_tag_name("section") && node.attribute("name") == Some(section))
            .flat_map(|node| node.children())
            .find(|node| node.attribute("name") == Some(key))
            .ok_or_else(|| CadError::malformed(self.path, section, format!("no attribute '{key}'")))
    }

    fn text(&self, section: &str, key: &str) -> Result<&str, CadError> {
        self.attribute(section, key)?
            .attribute("val")
            .ok_or_else(|| CadError::malformed(self.path, section, format!("'{key}' has no val")))
    }

    /// In metres where the attribute is a length.
    fn number(&self, section: &str, key: &str) -> Result<f64, CadError> {
        let bad = |problem: String| CadError::malformed(self.path, section, problem);
        let value: f64 = self
            .text(section, key)?
            .parse()
            .map_err(|_| bad(format!("'{key}' is not a number")))?;
        let unit = match self.attribute(section, key)?.attribute("unit") {
            None | Some("m") => 1.0,
            Some("mm") => 1e-3,
            Some("in" | "inch" | "inches") => 0.0254,
            Some(other) => return Err(bad(format!("'{key}' is in '{other}'; known are m, mm and in"))),
        };
        Ok(value * unit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Front wheels 80 mm below the floor, rear wheels 100 mm: the ground rises to the front.
    #[test]
    fn rake_is_the_slope_of_the_ground() {
        let contacts = [[1.4, -0.08], [1.4, -0.08], [-1.2, -0.1], [-1.2, -0.1]];
        assert!((rake(&contacts) - (0.02f64 / 2.6).atan()).abs() < 1e-12);
        assert_eq!(rake(&[[1.0, -0.1], [-1.0, -0.1]]), 0.0);
    }
}
