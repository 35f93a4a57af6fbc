//! Sweet Home 3D's libraries: a catalogue, and after a zero byte the OBJ that it names `a.obj`. Of a text that starts with `PK` the
//! bytes are the zip itself.
#![no_main]

use spba_ceres::cad::{SourceSpec, fuzz};

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let zip = if data.starts_with(b"PK") {
        data.to_vec()
    } else {
        let (catalogue, obj) = spba_ceres_fuzz::split(data);
        spba_ceres_fuzz::zip(&[("PluginFurnitureCatalog.properties", catalogue), ("a.obj", obj)])
    };
    let file = spba_ceres_fuzz::folder_with("a.sh3f", &zip).join("a.sh3f");
    let spec = format!("kind = 'sweethome3d'\npath = '{}'", file.display());
    let spec: SourceSpec = toml::from_str(&spec).expect("a source");
    fuzz(&spec);
});
