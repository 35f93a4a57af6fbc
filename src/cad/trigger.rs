//! Cars of Trigger Rally: `vehicles/<car>/<car>.vehicle` names an OBJ body, a scale, and where wheels go.
//!
//! `<vehicle><genparams wheelmodel wheelscale/><part name="body" model scale><wheel pos radius/>…</part></vehicle>`;
//! x right, y forward, z up. `wheelscale` brings the wheel's model to radius 1, `scale` the body's to metres.

use super::archive::{Archive, beside, distinct_names};
use super::sources::{Library, NamedModel};
use super::{Axes, CadError, Mesh, obj};
use nalgebra::{Matrix3, Vector3};
use roxmltree::Node;
use std::path::Path;

/// `data.zip`, or the folder that it unpacks to.
pub(super) struct Trigger {
    archive: Archive,
    /// Names of the `.vehicle` files.
    files: Vec<String>,
}

impl Trigger {
    pub(super) fn open(path: &Path) -> Result<Self, CadError> {
        let archive = Archive::open(path)?;
        let mut files = archive.names()?;
        files.retain(|name| name.ends_with(".vehicle"));
        Ok(Self { archive, files })
    }
}

impl Library for Trigger {
    fn names(&self) -> Vec<String> {
        distinct_names(&self.files)
    }

    fn load(&mut self, index: usize) -> Result<NamedModel, CadError> {
        Ok(NamedModel {
            name: self.names().swap_remove(index),
            source: "trigger-rally-data".to_owned(),
            licence: "GPL-2.0-or-later".to_owned(),
            mesh: vehicle(&mut self.archive, &self.files[index])?,
            weight: 1.0,
        })
    }
}

fn vehicle(archive: &mut Archive, file: &str) -> Result<Mesh, CadError> {
    let path = archive.path_of(file);
    let text = String::from_utf8_lossy(&archive.read(file)?).into_owned();
    let document =
        roxmltree::Document::parse(&text).map_err(|error| CadError::malformed(&path, "XML", error))?;
    let element = |tag: &str| {
        let mut all = document.descendants();
        let found =
            all.find(|node| node.has_tag_name(tag) && (tag != "part" || node.attribute("model").is_some()));
        found.ok_or_else(|| CadError::malformed(&path, tag, "missing"))
    };
    let (general, body) = (element("genparams")?, element("part")?);

    let mut mesh = obj::read(archive, &beside(file, attribute(&path, body, "model")?))?;
    mesh.map(&Matrix3::from_diagonal_element(
        numbers::<1>(&path, body, "scale")?[0],
    ));
    let mut wheel = obj::read(archive, &beside(file, attribute(&path, general, "wheelmodel")?))?;
    wheel.map(&Matrix3::from_diagonal_element(
        numbers::<1>(&path, general, "wheelscale")?[0],
    ));
    for place in body.children().filter(|node| node.has_tag_name("wheel")) {
        let centre = Vector3::from(numbers::<3>(&path, place, "pos")?);
        // The outer face of the wheel is towards +x; the left side has it turned by half, not mirrored.
        let side = if centre.x < 0.0 { -1.0 } else { 1.0 };
        let radius = numbers::<1>(&path, place, "radius")?[0];
        let mut placed = wheel.clone();
        for vertex in &mut placed.vertices {
            *vertex = centre + radius * Vector3::new(side * vertex.x, side * vertex.y, vertex.z);
        }
        mesh.append(placed);
    }
    mesh.turn(Axes::Z_UP_Y_FRONT);
    Ok(mesh)
}

fn attribute<'a>(path: &Path, node: Node<'a, '_>, key: &str) -> Result<&'a str, CadError> {
    node.attribute(key)
        .ok_or_else(|| CadError::malformed(path, node.tag_name().name(), format!("no attribute '{key}'")))
}

fn numbers<const N: usize>(path: &Path, node: Node, key: &str) -> Result<[f64; N], CadError> {
    let text = attribute(path, node, key)?;
    let parsed: Option<Vec<f64>> = text.split(',').map(|word| word.trim().parse().ok()).collect();
    parsed.and_then(|values| values.try_into().ok()).ok_or_else(|| {
        CadError::malformed(
            path,
            node.tag_name().name(),
            format!("'{key}' is not {N} numbers"),
        )
    })
}
