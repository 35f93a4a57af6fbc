//! Files by name out of a folder or a zip (`.zip`, `.sh3f`, `.jar`, `.whl`), and the textures among them.

use super::texture;
use super::{CadError, Texture};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use zip::ZipArchive;

/// No model or texture needs more.
const MAX_BYTES: u64 = 1 << 30;
/// Folders within folders; a link to a folder above it would go on for ever.
const DEEPEST: usize = 32;

/// A folder or a zip, opened for reading. Names are relative to its root, with forward slashes.
pub struct Archive {
    root: PathBuf,
    zip: Option<ZipArchive<BufReader<File>>>,
    textures: BTreeMap<String, Option<Arc<Texture>>>,
}

impl Archive {
    pub fn open(root: &Path) -> Result<Self, CadError> {
        let read = |problem| CadError::Read {
            path: root.to_owned(),
            problem,
        };
        let zip = if std::fs::metadata(root).map_err(read)?.is_dir() {
            None
        } else {
            let file = BufReader::new(File::open(root).map_err(read)?);
            let zip = ZipArchive::new(file)
                .map_err(|error| CadError::source(root, format!("neither a folder nor a zip ({error})")))?;
            Some(zip)
        };
        Ok(Self {
            root: root.to_owned(),
            zip,
            textures: BTreeMap::new(),
        })
    }

    /// How a member is called in messages.
    pub fn path_of(&self, name: &str) -> PathBuf {
        self.root.join(name)
    }

    /// The bytes of a member; an error of kind `NotFound` where there is none.
    pub fn read(&mut self, name: &str) -> Result<Vec<u8>, CadError> {
        let path = self.path_of(name);
        let bytes = match &mut self.zip {
            None => std::fs::read(&path),
            Some(zip) => match zip.by_name(name) {
                Ok(mut member) => {
                    let mut bytes = Vec::new();
                    let read = member.by_ref().take(MAX_BYTES).read_to_end(&mut bytes);
                    read.and_then(|length| match length as u64 {
                        // A few bytes may unpack to more than there is memory.
                        MAX_BYTES => Err(io::Error::other("it unpacks to more than a gibibyte")),
                        _ => Ok(bytes),
                    })
                }
                Err(zip::result::ZipError::FileNotFound) => Err(io::ErrorKind::NotFound.into()),
                Err(error) => Err(io::Error::other(error)),
            },
        };
        bytes.map_err(|problem| CadError::Read { path, problem })
    }

    /// Like [`Archive::read`], `None` where there is no such member.
    pub fn read_if_present(&mut self, name: &str) -> Result<Option<Vec<u8>>, CadError> {
        match self.read(name) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(CadError::Read { problem, .. }) if problem.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// All file names, sorted.
    pub fn names(&self) -> Result<Vec<String>, CadError> {
        let mut names = match &self.zip {
            Some(zip) => zip
                .file_names()
                .filter(|n| !n.ends_with('/'))
                .map(str::to_owned)
                .collect(),
            None => {
                let mut names = Vec::new();
                walk(&self.root, "", DEEPEST, &mut names)?;
                names
            }
        };
        // Hidden files, and what macOS adds to zips, are none.
        names.retain(|name| {
            !name
                .split('/')
                .any(|part| part.starts_with('.') || part == "__MACOSX")
        });
        names.sort();
        Ok(names)
    }

    /// A texture by file name, decoded once; `None` where the file is missing (liveries often are).
    pub fn texture(&mut self, name: &str) -> Result<Option<Arc<Texture>>, CadError> {
        if let Some(known) = self.textures.get(name) {
            return Ok(known.clone());
        }
        let decoded = match self.read_if_present(name)? {
            Some(bytes) => Some(Arc::new(texture::decode(&bytes, &self.path_of(name))?)),
            None => {
                tracing::warn!("{}: texture missing", self.path_of(name).display());
                None
            }
        };
        self.textures.insert(name.to_owned(), decoded.clone());
        Ok(decoded)
    }
}

/// `file` beside `name`: "cars/a/a.acc" and "a.rgb" give "cars/a/a.rgb".
pub fn beside(name: &str, file: &str) -> String {
    let file = file.replace('\\', "/");
    match name.rfind('/') {
        Some(slash) => format!("{}/{}", &name[..slash], file),
        None => file,
    }
}

/// The last component of a name, without its extension.
pub fn stem(name: &str) -> &str {
    let file = name.rsplit('/').next().unwrap_or(name);
    file.rsplit_once('.').map_or(file, |(stem, _)| stem)
}

/// What models are called: by their file's stem, and where that is another's too by their whole path without its extension; with it,
/// where they differ in nothing else.
pub fn distinct_names(files: &[String]) -> Vec<String> {
    let whole: Vec<&str> = files.iter().map(String::as_str).collect();
    let without_extension: Vec<&str> = files
        .iter()
        .map(|file| &file[..file.rfind('/').map_or(0, |slash| slash + 1) + stem(file).len()])
        .collect();
    let stems: Vec<&str> = files.iter().map(|file| stem(file)).collect();
    let once = |names: &[&str], name: &str| names.iter().filter(|other| **other == name).count() == 1;
    (0..files.len())
        .map(|i| {
            let choices = [stems[i], without_extension[i]];
            let lists = [&stems, &without_extension];
            let distinct = choices.iter().zip(lists).find(|(name, names)| once(names, name));
            (*distinct.map_or(&whole[i], |(name, _)| name)).to_owned()
        })
        .collect()
}

fn walk(folder: &Path, prefix: &str, deeper: usize, names: &mut Vec<String>) -> Result<(), CadError> {
    let read = |problem| CadError::Read {
        path: folder.to_owned(),
        problem,
    };
    if deeper == 0 {
        let problem = format!("folders nest deeper than {DEEPEST}; is one a link to a folder above it?");
        return Err(CadError::source(folder, problem));
    }
    for entry in std::fs::read_dir(folder).map_err(read)? {
        let entry = entry.map_err(read)?;
        let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
        match std::fs::metadata(entry.path()) {
            Ok(metadata) if metadata.is_dir() => walk(&entry.path(), &format!("{name}/"), deeper - 1, names)?,
            Ok(_) => names.push(name),
            // A link to nowhere.
            Err(problem) => tracing::warn!("{}: left out ({problem})", entry.path().display()),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_are_called_by_what_tells_them_apart() {
        let names =
            |files: &[&str]| distinct_names(&files.iter().map(|&file| file.to_owned()).collect::<Vec<_>>());
        assert_eq!(names(&["a/x.obj", "b/y.obj", "z.glb"]), ["x", "y", "z"]);
        assert_eq!(
            names(&["1/m/model.obj", "2/m/model.obj", "other.obj"]),
            ["1/m/model", "2/m/model", "other"]
        );
        assert_eq!(
            names(&["a/x.obj", "a/x.glb", "b/x.obj"]),
            ["a/x.obj", "a/x.glb", "b/x"]
        );
    }

    #[test]
    fn hidden_files_and_links_to_nowhere_are_left_out_and_loops_end() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["c10.obj", "c9.obj", "._c9.obj", "__MACOSX/c9.obj", ".git/c.obj"] {
            let file = folder.path().join(name);
            std::fs::create_dir_all(file.parent().unwrap()).unwrap();
            std::fs::write(file, "").unwrap();
        }
        std::os::unix::fs::symlink("nowhere", folder.path().join("lost.obj")).unwrap();
        let names = || Archive::open(folder.path()).unwrap().names();
        assert_eq!(names().unwrap(), ["c10.obj", "c9.obj"]);
        std::os::unix::fs::symlink(".", folder.path().join("loop")).unwrap();
        assert!(names().unwrap_err().to_string().contains("nest deeper"));
    }

    #[test]
    fn what_unpacks_to_more_than_there_is_memory_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.zip");
        let mut writer = zip::ZipWriter::new(File::create(&file).unwrap());
        let options = zip::write::SimpleFileOptions::default();
        writer.start_file("a.obj", options).unwrap();
        let zeros = vec![0; 1 << 20];
        for _ in 0..1025 {
            io::Write::write_all(&mut writer, &zeros).unwrap();
        }
        writer.finish().unwrap();
        let message = Archive::open(&file)
            .unwrap()
            .read("a.obj")
            .unwrap_err()
            .to_string();
        assert!(
            message.contains("a.obj: cannot read: it unpacks to more"),
            "{message}"
        );
    }
}
