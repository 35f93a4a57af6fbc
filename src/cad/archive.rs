//! Files by name out of a folder or a zip (`.zip`, `.sh3f`, `.jar`, `.whl`), and the textures among them.

use super::texture;
use super::{CadError, Texture};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use zip::ZipArchive;

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
                    member.read_to_end(&mut bytes).map(|_| bytes)
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
                walk(&self.root, "", &mut names)?;
                names
            }
        };
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

fn walk(folder: &Path, prefix: &str, names: &mut Vec<String>) -> Result<(), CadError> {
    let read = |problem| CadError::Read {
        path: folder.to_owned(),
        problem,
    };
    for entry in std::fs::read_dir(folder).map_err(read)? {
        let entry = entry.map_err(read)?;
        let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
        let metadata = std::fs::metadata(entry.path()).map_err(read)?;
        if metadata.is_dir() {
            walk(&entry.path(), &format!("{name}/"), names)?;
        } else {
            names.push(name);
        }
    }
    Ok(())
}
