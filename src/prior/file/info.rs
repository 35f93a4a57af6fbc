//! What a prior file says of itself.

use super::{PriorError, SCHEMA, SURFACE_SCHEMA};
use crate::geometry::OBJECT_FRAME;
use crate::prior::ShapePrior;
use crate::prior::field::FieldScale;
use crate::prior::learned::LearnedPrior;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// What a prior file says of itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PriorInfo {
    /// The layout's version.
    pub schema: u32,
    /// How points depend on the style.
    pub kind: PriorKind,
    /// The category: `car`, `chair` …
    pub category: String,
    /// What its template looks like, where the category has several: `chair-foot` …
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub template: Option<String>,
    /// The object frame in words: [`OBJECT_FRAME`].
    pub frame: String,
    /// How the file's points become the prior's.
    pub symmetry: Symmetry,
    /// The number of style entries S.
    pub styles: usize,
    /// A decoder's hidden layers: how many outputs each has.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub hidden: Vec<usize>,
    /// The number of points N.
    pub points: usize,
    /// The smooth random field of a prior of surfaces.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub free_form: Option<FreeFormInfo>,
    /// The command that learned it.
    pub command: String,
    /// The seed of everything random in its making.
    pub seed: u64,
    /// Share of the training variance that the first k + 1 modes explain.
    pub explained_variance: Vec<f64>,
    /// The licences of the sources, each once.
    pub licences: Vec<String>,
    /// The models learned from.
    pub sources: Vec<PriorSource>,
}

/// One model that a prior was learned from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PriorSource {
    /// The model's name within its package.
    pub model: String,
    /// The package it comes from.
    pub package: String,
    /// The licence, as SPDX where the package gives it so, else in the package's words.
    pub licence: String,
}

/// What the free form of a prior of surfaces is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FreeFormInfo {
    /// The terms of its covariance.
    pub scales: Vec<FieldScale>,
    /// The amplitude of asymmetric modes in units of the symmetric ones'.
    pub asymmetry: f64,
}

/// What stands between the style and the output layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PriorKind {
    /// Points are linear in the style.
    Linear,
    /// A network's hidden layers stand before the linear output layer.
    Decoder,
    /// Points are linear in the style and lie on a mesh that is bent with it.
    Surface,
}

impl std::fmt::Display for PriorKind {
    fn fmt(&self, formatter: &mut std::fmt::Formatter) -> std::fmt::Result {
        formatter.write_str(match self {
            Self::Linear => "linear",
            Self::Decoder => "decoder",
            Self::Surface => "surface",
        })
    }
}

/// How the file's points become the prior's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Symmetry {
    /// The file holds all points.
    None,
    /// Point 2i + 1 is point 2i reflected in x = 0, for every style.
    MirrorX,
}

impl PriorInfo {
    /// The name and version that results give.
    pub fn name(&self) -> String {
        let name = self.template.as_ref().unwrap_or(&self.category);
        format!("{name} {} (schema {})", self.kind, self.schema)
    }

    /// The description of `prior`, mirrored, by this version in the canonical frame.
    pub fn mirrored(category: &str, prior: &LearnedPrior) -> Self {
        let hidden: Vec<usize> = prior.hidden().iter().map(|layer| layer.bias.len()).collect();
        let (schema, kind) = match (prior.surface(), hidden.is_empty()) {
            (Some(_), _) => (SURFACE_SCHEMA, PriorKind::Surface),
            (None, true) => (SCHEMA, PriorKind::Linear),
            (None, false) => (SCHEMA, PriorKind::Decoder),
        };
        Self {
            schema,
            kind,
            category: category.to_owned(),
            template: None,
            frame: OBJECT_FRAME.to_owned(),
            symmetry: Symmetry::MirrorX,
            styles: prior.style_len(),
            hidden,
            points: prior.point_count(),
            free_form: None,
            command: String::new(),
            seed: 0,
            explained_variance: Vec::new(),
            licences: Vec::new(),
            sources: Vec::new(),
        }
    }
}

/// The version is looked at before the rest, so that a newer file is called newer and not broken.
pub(super) fn info(json: Option<&String>, path: &Path) -> Result<PriorInfo, PriorError> {
    let wrong = |reason: String| PriorError::Metadata {
        path: path.to_owned(),
        reason,
    };
    let json = json.ok_or_else(|| wrong("is missing".to_owned()))?;
    let value: serde_json::Value =
        serde_json::from_str(json).map_err(|e| wrong(format!("is no JSON: {e}")))?;
    match value.get("schema").and_then(serde_json::Value::as_u64) {
        Some(found) if found == u64::from(SCHEMA) || found == u64::from(SURFACE_SCHEMA) => {}
        Some(found) => {
            return Err(PriorError::Version {
                path: path.to_owned(),
                found,
            });
        }
        None => return Err(wrong("has no schema number".to_owned())),
    }
    let info: PriorInfo = serde_json::from_value(value).map_err(|e| wrong(format!("is wrong: {e}")))?;
    if (info.kind == PriorKind::Decoder) == info.hidden.is_empty() {
        return Err(wrong(
            "must name hidden layers if and only if its kind is decoder".to_owned(),
        ));
    }
    let of_surface = info.schema == SURFACE_SCHEMA;
    if (info.kind == PriorKind::Surface) != of_surface || info.free_form.is_some() != of_surface {
        return Err(wrong(format!(
            "must be of kind surface with a free form if and only if its schema is {SURFACE_SCHEMA}"
        )));
    }
    if info.frame != OBJECT_FRAME {
        return Err(PriorError::Frame {
            path: path.to_owned(),
            found: info.frame,
        });
    }
    if info.symmetry == Symmetry::MirrorX && !info.points.is_multiple_of(2) {
        return Err(wrong(format!(
            "has symmetry mirror_x and an odd number of points, {}",
            info.points
        )));
    }
    Ok(info)
}
