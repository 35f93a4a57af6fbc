//! What the targets share: a folder of their own in memory, and files made of parts.

use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// A model with the texture `a.rgb`.
pub const TEXTURED: &[u8] = b"AC3Db\nMATERIAL \"\" rgb 1 1 1 amb 0 0 0 emis 0 0 0 spec 0 0 0 shi 0 trans 0\nOBJECT poly\ntexture \"a.rgb\"\n\
numvert 3\n0 0 0\n1 0 0\n0 1 0\nnumsurf 1\nSURF 0x0\nmat 0\nrefs 3\n0 0 0\n1 1 0\n2 0 1\nkids 0\n";

/// This process's folder, with `name` in it holding `data`. It also holds a picture `images/a.png` and its mask.
pub fn folder_with(name: &str, data: &[u8]) -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let memory = Path::new("/dev/shm");
        let parent = if memory.is_dir() { memory.to_owned() } else { std::env::temp_dir() };
        let folder = parent.join(format!("spba-fuzz-{}", std::process::id()));
        for part in ["images", "masks"] {
            std::fs::create_dir_all(folder.join(part)).expect("a folder");
        }
        let mask = |x: u32, y: u32| image::Luma([if (2..6).contains(&x) && (2..5).contains(&y) { 255u8 } else { 0 }]);
        let picture = image::GrayImage::from_fn(8, 6, mask);
        picture.save(folder.join("images/a.png")).expect("a picture");
        picture.save(folder.join("masks/a.png")).expect("a mask");
        folder
    });
    std::fs::write(folder.join(name), data).expect("a file");
    folder
}

/// What stands before the first zero byte, and what stands after it.
pub fn split(data: &[u8]) -> (&[u8], &[u8]) {
    match data.iter().position(|&byte| byte == 0) {
        Some(at) => (&data[..at], &data[at + 1..]),
        None => (data, &[]),
    }
}

/// A zip of files that are stored as they are.
pub fn zip(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut writer = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for (name, data) in files {
        writer.start_file(*name, options).expect("a member");
        writer.write_all(data).expect("a member");
    }
    writer.finish().expect("a zip").into_inner()
}
