//! What a comparison compares, as TOML.

use crate::config::Config;
use crate::image::one_line;
use crate::init::InitOptions;
use crate::prior::FreeForm;
use crate::study::Method;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

const SCHEMA: u32 = 1;
const DEFAULT: &str = include_str!("../../../data/minimisers.toml");
/// Where [`DEFAULT`] stands.
const DEFAULT_PATH: &str = "data/minimisers.toml";
/// The end of every error about a key.
const MEND: &str = "`spba-ceres compare --print-config` shows a file that can be used";

/// Minimisers, and what they have in common: prior, objective and starts.
#[derive(Clone, Debug)]
pub struct MinimiserSettings {
    /// The file's text.
    pub text: String,
    /// The prior of all, as [`Config::prior`].
    pub prior: String,
    /// The initialisation of all.
    pub init: InitOptions,
    /// How far the starts are apart.
    pub perturbation: Perturbation,
    /// At least one minimiser, all of different names. The name is the label.
    pub methods: Vec<Method>,
}

/// How far the starts of seeds 1, 2, … are from that of seed 0.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Perturbation {
    /// The angle by which the target's pose is turned about a random axis through the object, degrees.
    pub rotation_deg: f64,
    /// The length by which it is moved in a random direction, as a share of the camera's distance from the object.
    pub share_of_distance: f64,
}

/// Why a file of minimisers cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SettingsError {
    /// The file cannot be read.
    #[error("{}: cannot read the minimisers: {problem}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        problem: std::io::Error,
    },
    /// The file does not say what to compare.
    #[error("{}: {message}; {MEND}", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// The key, and what is wrong with it.
        message: String,
    },
}

/// The file as it stands.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    schema: u32,
    prior: Option<String>,
    #[serde(default)]
    perturbation: Perturbation,
    #[serde(default)]
    init: Table,
    #[serde(default)]
    objective: Table,
    #[serde(default)]
    solver: Table,
    minimisers: Vec<Entry>,
}

#[derive(Deserialize)]
struct Entry {
    name: String,
    #[serde(flatten)]
    solver: Table,
}

impl Default for Perturbation {
    fn default() -> Self {
        Self {
            rotation_deg: 5.0,
            share_of_distance: 0.02,
        }
    }
}

impl Perturbation {
    fn check(&self) -> Result<(), String> {
        if !(0.0..=180.0).contains(&self.rotation_deg) {
            return Err("perturbation.rotation_deg: must be 0 to 180".to_owned());
        }
        if !(0.0..1.0).contains(&self.share_of_distance) {
            return Err("perturbation.share_of_distance: must be 0 or more, and less than 1".to_owned());
        }
        if self.rotation_deg == 0.0 && self.share_of_distance == 0.0 {
            return Err(
                "perturbation: one of rotation_deg and share_of_distance must be more than 0, or all starts are \
                 the same"
                    .to_owned(),
            );
        }
        Ok(())
    }
}

impl MinimiserSettings {
    /// Both minimisers with both strategies: `data/minimisers.toml`, which ships inside the library.
    ///
    /// # Errors
    /// None, unless that file is broken.
    pub fn shipped() -> Result<Self, SettingsError> {
        Self::parse(DEFAULT, Path::new(DEFAULT_PATH))
    }

    /// Reads a TOML file such as `data/minimisers.toml`.
    ///
    /// # Errors
    /// A file that cannot be read; an unknown key, a value of the wrong type or out of range; no minimiser, two of one name, a
    /// name that is no file name.
    pub fn load(path: &Path) -> Result<Self, SettingsError> {
        let text = crate::files::read_text(path).map_err(|problem| SettingsError::Read {
            path: path.to_owned(),
            problem,
        })?;
        Self::parse(&text, path)
    }

    /// Likewise, of a text, which `name` stands for in messages.
    ///
    /// # Errors
    /// As for [`MinimiserSettings::load`].
    pub fn parse(text: &str, name: &Path) -> Result<Self, SettingsError> {
        Self::of_text(text).map_err(|message| SettingsError::Parse {
            path: name.to_owned(),
            message,
        })
    }

    fn of_text(text: &str) -> Result<Self, String> {
        let deserializer = toml::Deserializer::parse(text).map_err(|error| one_line(error.message()))?;
        let file: File = serde_path_to_error::deserialize(deserializer).map_err(|error| {
            let message = one_line(error.inner().message());
            match error.path().to_string().as_str() {
                "." => message,
                key => format!("{key}: {message}"),
            }
        })?;
        if file.schema != SCHEMA {
            return Err(format!("schema: {SCHEMA} expected, found {}", file.schema));
        }
        file.perturbation.check()?;
        let mut common = Table::from_iter([
            ("init".to_owned(), Value::Table(file.init)),
            ("objective".to_owned(), Value::Table(file.objective)),
            ("solver".to_owned(), Value::Table(file.solver)),
        ]);
        common.extend(file.prior.map(|prior| ("prior".to_owned(), Value::String(prior))));
        let methods = methods(file.minimisers, &common)?;
        let first = methods
            .first()
            .ok_or("minimisers: there is none; give at least one")?;
        Ok(Self {
            text: text.to_owned(),
            prior: first.config.prior.clone(),
            init: first.config.init.clone(),
            perturbation: file.perturbation,
            methods,
        })
    }
}

fn methods(entries: Vec<Entry>, common: &Table) -> Result<Vec<Method>, String> {
    let mut taken = BTreeSet::new();
    let mut methods = Vec::new();
    for (index, Entry { name, solver }) in entries.into_iter().enumerate() {
        let place = format!("minimisers[{index}] `{}`", one_line(&name));
        check_name(&name).map_err(|message| format!("{place}: {message}"))?;
        if !taken.insert(name.clone()) {
            return Err(format!(
                "{place}: name: there is one of this name; give it another"
            ));
        }
        let own = Table::from_iter([("solver".to_owned(), Value::Table(solver))]);
        let config = config_of(vec![common.clone(), own]).map_err(|message| {
            // What is wrong without this minimiser, too, is wrong in the common part.
            match config_of(vec![common.clone()]) {
                Err(shared) if shared == message => shared,
                _ => format!("{place}: {}", message.replacen("solver.", "", 1)),
            }
        })?;
        methods.push(Method::new(&name, &name, config));
    }
    Ok(methods)
}

/// Names are parts of file names.
fn check_name(name: &str) -> Result<(), String> {
    let plain = |c: char| c.is_ascii_alphanumeric() || "._-".contains(c);
    match name.starts_with(|c: char| c.is_ascii_alphanumeric()) && name.chars().all(plain) {
        true => Ok(()),
        false => Err("name: must be of letters, digits, `.`, `_` and `-`".to_owned()),
    }
}

/// The configuration of layers of keys over the defaults; what is wrong with it, with the key.
fn config_of(layers: Vec<Table>) -> Result<Config, String> {
    let bends = |layer: &Table| {
        layer
            .get("solver")
            .and_then(|solver| solver.get("free_form"))
            .is_some()
    };
    if layers.iter().any(bends) {
        return Err(
            "solver.free_form: minimisers are compared up to where the free form begins; leave it out".into(),
        );
    }
    let mut config = Config::of_layers(layers).map_err(|(key, message)| format!("{key}: {message}"))?;
    config.solver.free_form = FreeForm::None;
    config
        .objective
        .check()
        .map_err(|(key, message)| format!("objective.{key}: {message}"))?;
    config
        .solver
        .check()
        .map_err(|(key, message)| format!("solver.{key}: {message}"))?;
    Ok(config)
}

#[cfg(test)]
mod tests;
