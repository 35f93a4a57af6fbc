//! Lists of models.

use anyhow::Context;
use serde::Deserialize;
use spba_ceres::cad::{NamedModel, SourceSpec, load_source, matches};
use spba_ceres::prior::PriorSource;
use std::collections::BTreeMap;
use std::path::Path;

/// The file behind `--sources`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SourceList {
    pub category: String,
    /// Sets of models so alike that `eval` holds them out together.
    #[serde(default)]
    near_duplicates: Vec<Vec<String>>,
    /// Names for tables, each with the models that it stands for, `*` standing for any run of characters.
    #[serde(default)]
    kinds: BTreeMap<String, Vec<String>>,
    pub source: Vec<SourceSpec>,
}

impl SourceList {
    /// What the list calls such a model.
    pub fn kind_of(&self, model: &str) -> &str {
        let kind = self
            .kinds
            .iter()
            .find(|(_, patterns)| patterns.iter().any(|pattern| matches(pattern, model)));
        kind.map_or("other", |(name, _)| name)
    }

    /// A number per model, shared by near-duplicates.
    pub fn groups(&self, models: &[NamedModel]) -> anyhow::Result<Vec<usize>> {
        let place = |name: &String| {
            models
                .iter()
                .position(|m| m.name == *name)
                .with_context(|| format!("near_duplicates: no model is called `{name}`: correct or drop it"))
        };
        let mut groups: Vec<usize> = (0..models.len()).collect();
        for set in &self.near_duplicates {
            let places = set.iter().map(place).collect::<anyhow::Result<Vec<_>>>()?;
            if let Some(&first) = places.first() {
                places.iter().for_each(|&p| groups[p] = first);
            }
        }
        Ok(groups)
    }
}

/// The list behind `--sources`, and its models.
pub fn load_models(sources: &Path) -> anyhow::Result<(SourceList, Vec<NamedModel>)> {
    let text = std::fs::read_to_string(sources)
        .with_context(|| format!("{}: cannot read the list of sources", sources.display()))?;
    let list: SourceList =
        toml::from_str(&text).with_context(|| format!("{}: not a list of sources", sources.display()))?;
    let mut models = Vec::new();
    for source in &list.source {
        models.extend(load_source(source)?);
    }
    Ok((list, models))
}

/// The models' licences, each once.
pub fn licences(models: &[NamedModel]) -> Vec<String> {
    let mut licences: Vec<String> = models.iter().map(|m| m.licence.clone()).collect();
    licences.sort();
    licences.dedup();
    licences
}

/// What a prior's file says of a model.
pub fn source_of(model: &NamedModel) -> PriorSource {
    PriorSource {
        model: model.name.clone(),
        package: model.source.clone(),
        licence: model.licence.clone(),
    }
}
