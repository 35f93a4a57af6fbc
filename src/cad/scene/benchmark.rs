//! A list of scenes that differ from a common one, each with several numbers of frames on the same arc.
//!
//! ```toml
//! frames = [2, 11]
//! [scene]                 # what all share, as in a scene file
//! arc = { distance = 1.7, elevation_deg = 15 }
//! [[sequence]]
//! name = "front"          # letters, digits, '-', '_' and '.'
//! [sequence.scene]        # its own keys, over the shared ones, table by table
//! seed = 1
//! arc = { azimuth_deg = [20, 50] }
//! ```

use super::super::CadError;
use super::Scene;
use crate::image::one_line;
use crate::sources;
use serde::Deserialize;
use std::hash::{DefaultHasher, Hasher};
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Scenes by name; all are in range once loaded.
#[derive(Clone, Debug)]
pub struct Benchmark {
    /// Numbers of frames to make each sequence with.
    pub frames: Vec<usize>,
    path: PathBuf,
    scenes: Vec<(String, Scene)>,
}

/// The file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct List {
    frames: Vec<usize>,
    #[serde(default)]
    scene: Table,
    sequence: Vec<Entry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: String,
    #[serde(default)]
    scene: Table,
}

/// Tells builds apart whose renderings of a scene could differ.
pub fn renderer_digest() -> u64 {
    const WITH_A_SAY: [&str; 4] = ["cad", "geometry", "image", "sequence"];
    let mut hasher = DefaultHasher::new();
    let counts = |path: &Path| WITH_A_SAY.iter().any(|folder| path.starts_with(folder));
    sources::hash_rust(counts, &mut hasher);
    hasher.finish()
}

impl Benchmark {
    /// # Errors
    /// A file that cannot be read, an unknown key, a name that is taken or no folder's, an option out of its range.
    pub fn load(path: &Path) -> Result<Self, CadError> {
        let text = std::fs::read_to_string(path).map_err(|problem| CadError::Read {
            path: path.to_owned(),
            problem,
        })?;
        let list: List = toml::from_str(&text).map_err(|error| {
            let before = error.span().map_or(0, |span| span.start);
            let line = 1 + text.bytes().take(before).filter(|&byte| byte == b'\n').count();
            CadError::malformed(path, format!("line {line}"), one_line(error.message()))
        })?;
        if list.frames.is_empty() {
            return Err(CadError::malformed(
                path,
                "frames",
                "empty; give at least one number",
            ));
        }
        let mut benchmark = Self {
            frames: list.frames,
            path: path.to_owned(),
            scenes: Vec::new(),
        };
        for entry in list.sequence {
            let scene = benchmark.parse(&entry, &list.scene)?;
            benchmark.scenes.push((entry.name, scene));
        }
        for name in benchmark.names() {
            for &frames in &benchmark.frames {
                benchmark.scene(name, frames)?;
            }
        }
        Ok(benchmark)
    }

    /// In the list's order.
    pub fn names(&self) -> Vec<&str> {
        self.scenes.iter().map(|(name, _)| name.as_str()).collect()
    }

    /// The scene of a sequence with a number of frames, which need not be one of the list's.
    ///
    /// # Errors
    /// No such sequence, or an option out of its range.
    pub fn scene(&self, name: &str, frames: usize) -> Result<Scene, CadError> {
        let Some((_, scene)) = self.scenes.iter().find(|(known, _)| known == name) else {
            let problem = format!("not in the list; give one of {}", self.names().join(", "));
            return Err(self.wrong(name, &problem));
        };
        let mut scene = scene.clone();
        scene.arc.frames = frames;
        scene
            .check()
            .map_err(|error| self.wrong(name, &error.to_string()))?;
        Ok(scene)
    }

    /// The scene with the list's first number of frames.
    fn parse(&self, entry: &Entry, shared: &Table) -> Result<Scene, CadError> {
        let wrong = |problem: &str| self.wrong(&entry.name, problem);
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        if !entry.name.starts_with(|c: char| c.is_ascii_alphanumeric()) || !entry.name.chars().all(plain) {
            return Err(wrong(
                "not a folder's name; give letters, digits, '-', '_' and '.'",
            ));
        }
        if self.names().contains(&entry.name.as_str()) {
            return Err(wrong("the name occurs twice; give every sequence its own"));
        }
        let mut scene = shared.clone();
        merge(&mut scene, &entry.scene);
        let arc = scene.get_mut("arc").and_then(Value::as_table_mut);
        let arc = arc.ok_or_else(|| wrong("arc is missing; give it as in a scene file"))?;
        if arc.contains_key("frames") {
            return Err(wrong("arc.frames comes from `frames`; leave it out"));
        }
        // One that fits i64 and usize alike; `scene` sets the one asked for.
        arc.insert("frames".to_owned(), Value::Integer(2));
        scene
            .try_into()
            .map_err(|error: toml::de::Error| wrong(&one_line(&error.to_string())))
    }

    fn wrong(&self, name: &str, problem: &str) -> CadError {
        CadError::malformed(&self.path, format!("sequence '{name}'"), problem)
    }
}

/// Puts `over` over `base`: tables key by key, all else replaced.
fn merge(base: &mut Table, over: &Table) {
    for (key, value) in over {
        match (base.get_mut(key), value) {
            (Some(Value::Table(base)), Value::Table(over)) => merge(base, over),
            _ => {
                base.insert(key.clone(), value.clone());
            }
        }
    }
}

#[cfg(test)]
#[path = "benchmark_tests.rs"]
mod tests;
