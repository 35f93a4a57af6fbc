//! Single keys of the configuration from a command line, and how they are laid over a file and the defaults.

use super::{Config, ConfigError};
use crate::image::one_line;
use serde::Serialize;
use serde_path_to_error::{Path as KeyPath, Segment};
use std::str::FromStr;
use toml::{Table, Value};

/// What opens a TOML value that is no bare word.
const OPENING: [char; 4] = ['[', '{', '"', '\''];

/// One key of the configuration with its value.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// The key's dotted path, such as `objective.pairs.offsets`.
    key: String,
    value: Value,
    /// What was given on the command line; error messages show it.
    given: String,
}

impl Setting {
    /// What a flag says about a key.
    ///
    /// # Errors
    /// The value has no form in TOML, such as a path that is not UTF-8.
    pub fn of_flag(flag: &str, key: &str, value: &impl Serialize) -> Result<Self, ConfigError> {
        let value = Value::try_from(value).map_err(|error| ConfigError::Setting {
            given: flag.to_owned(),
            message: one_line(&error.to_string()),
        })?;
        Ok(Self {
            key: key.to_owned(),
            value,
            given: flag.to_owned(),
        })
    }

    /// The table that holds this key alone.
    fn table(&self) -> Table {
        let mut names = self.key.rsplit('.');
        let last = names.next().unwrap_or_default().to_owned();
        let innermost = Table::from_iter([(last, self.value.clone())]);
        names.fold(innermost, |inner, name| {
            Table::from_iter([(name.to_owned(), Value::Table(inner))])
        })
    }

    /// The key is `path`, above it or below it.
    fn touches(&self, path: &str) -> bool {
        let below = |inner: &str, outer: &str| {
            inner
                .strip_prefix(outer)
                .is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
        };
        below(&self.key, path) || below(path, &self.key)
    }
}

/// Reads `KEY=VALUE`. The value is TOML; a bare word that is no TOML value is a string.
impl FromStr for Setting {
    type Err = ConfigError;

    fn from_str(text: &str) -> Result<Self, ConfigError> {
        let given = format!("--set {}", one_line(text));
        let wrong = |message: String| ConfigError::Setting {
            given: given.clone(),
            message,
        };
        let (key, value) = text
            .split_once('=')
            .ok_or_else(|| wrong("no `=`; give KEY=VALUE, such as objective.style_weight=3".to_owned()))?;
        let (key, value) = (key.trim(), value.trim());
        if key.split('.').any(str::is_empty) {
            return Err(wrong(
                "a part of the key is empty; give KEY=VALUE, such as objective.style_weight=3".to_owned(),
            ));
        }
        if value.is_empty() {
            return Err(wrong(
                "no value after `=`; give one, or '' for the empty string".to_owned(),
            ));
        }
        let value = match value.parse() {
            Ok(value) => value,
            Err(_) if !value.starts_with(OPENING) => Value::String(value.to_owned()),
            Err(error) => {
                let error: toml::de::Error = error;
                let message = one_line(error.message());
                return Err(wrong(format!("the value is no TOML: {message}")));
            }
        };
        Ok(Self {
            key: key.to_owned(),
            value,
            given,
        })
    }
}

/// Lays the keys of `upper` over those of `lower`.
///
/// Alternatives do not mix: `objective.pairs` replaces what is below it, and another method of `solver.minimiser` starts
/// from that method's own defaults.
pub(super) fn lay(lower: &mut Table, upper: Table) {
    fn of<'a>(table: &'a Table, section: &str, key: &str) -> Option<&'a Value> {
        table.get(section)?.get(key)
    }
    fn forget(table: &mut Table, section: &str, key: &str) {
        if let Some(Value::Table(section)) = table.get_mut(section) {
            section.remove(key);
        }
    }
    let method = |table| of(table, "solver", "minimiser").and_then(|minimiser| minimiser.get("method"));
    if method(&upper).is_some() && method(&upper) != method(lower) {
        forget(lower, "solver", "minimiser");
    }
    if of(&upper, "objective", "pairs").is_some() {
        forget(lower, "objective", "pairs");
    }
    merge(lower, upper);
}

/// Settings as one table; of two for the same key the later counts.
pub(super) fn table_of(settings: &[Setting]) -> Table {
    settings.iter().fold(Table::new(), |mut table, setting| {
        merge(&mut table, setting.table());
        table
    })
}

fn merge(lower: &mut Table, upper: Table) {
    for (key, value) in upper {
        match (lower.get_mut(&key), value) {
            (Some(Value::Table(inner)), Value::Table(value)) => merge(inner, value),
            (_, value) => {
                lower.insert(key, value);
            }
        }
    }
}

/// Why a table is no configuration: the key, and what is wrong with it.
pub(super) struct Fault {
    pub key: String,
    pub message: String,
}

impl Fault {
    /// The settings that touch the key, as given; the key where none does.
    pub fn given(&self, settings: &[Setting]) -> String {
        let given: Vec<&str> = settings
            .iter()
            .filter(|setting| setting.touches(&self.key))
            .map(|setting| setting.given.as_str())
            .collect();
        if given.is_empty() {
            self.key.clone()
        } else {
            given.join(", ")
        }
    }
}

pub(super) fn config_of(table: Table) -> Result<Config, Fault> {
    serde_path_to_error::deserialize(table).map_err(|error| Fault {
        key: key_of(error.path()),
        message: one_line(error.inner().message()),
    })
}

/// The dotted key of a path; an array's entries have none of their own.
fn key_of(path: &KeyPath) -> String {
    let name = |segment: &Segment| match segment {
        Segment::Map { key } => Some(key.clone()),
        Segment::Enum { variant } => Some(variant.clone()),
        Segment::Seq { .. } | Segment::Unknown => None,
    };
    path.iter().map_while(name).collect::<Vec<_>>().join(".")
}
