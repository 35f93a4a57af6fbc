use super::*;

/// One triangle under a node that is moved, turned and scaled by its matrix, with a base colour.
fn glb(indices: [u8; 3]) -> Vec<u8> {
    let mut data: Vec<u8> = [
        0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.25, 1.0, 0.0, 0.0, 0.5,
    ]
    .iter()
    .flat_map(|x| x.to_le_bytes())
    .collect();
    data.extend(indices);
    data.push(0);
    let mut json = format!(
        r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":{}}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}},{{"buffer":0,"byteOffset":36,"byteLength":24}},
        {{"buffer":0,"byteOffset":60,"byteLength":3}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}},
        {{"bufferView":1,"componentType":5126,"count":3,"type":"VEC2"}},
        {{"bufferView":2,"componentType":5121,"count":3,"type":"SCALAR"}}],
        "materials":[{{"pbrMetallicRoughness":{{"baseColorFactor":[1,0,0.5,0.5]}}}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"TEXCOORD_0":1}},"indices":2,"material":0}}]}}],
        "nodes":[{{"children":[1],"translation":[10,0,0]}},{{"mesh":0,"scale":[2,3,1]}}],
        "scenes":[{{"nodes":[0]}}],"scene":0}}"#,
        data.len()
    );
    while json.len() % 4 != 0 {
        json.push(' ');
    }
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((12 + 8 + json.len() as u32 + 8 + data.len() as u32).to_le_bytes());
    bytes.extend((json.len() as u32).to_le_bytes());
    bytes.extend(b"JSON");
    bytes.extend(json.as_bytes());
    bytes.extend((data.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(data);
    bytes
}

fn parse(bytes: &[u8]) -> Result<Mesh, CadError> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.glb"), bytes).unwrap();
    read(&mut Archive::open(folder.path()).unwrap(), "a.glb")
}

#[test]
fn nodes_place_their_meshes() {
    let mesh = parse(&glb([0, 1, 2])).unwrap();
    let at: Vec<[f64; 3]> = mesh.vertices.iter().map(|v| (*v).into()).collect();
    assert_eq!(at, [[10.0, 0.0, 0.0], [12.0, 0.0, 0.0], [10.0, 3.0, 0.0]]);
    assert_eq!(
        mesh.triangles[0].texture_coordinates,
        [[0.0, 0.75], [1.0, 1.0], [0.0, 0.5]]
    );
    let Material { diffuse, opacity, .. } = mesh.materials[0];
    assert_eq!(opacity, 1.0);
    for (given, srgb) in diffuse.iter().zip([1.0, 0.0, 0.7354]) {
        assert!((given - srgb).abs() < 1e-3, "{given}");
    }
}

#[test]
fn counts_beyond_the_buffer_are_errors() {
    let edited = |from: &str, to: &str| {
        assert_eq!(from.len(), to.len());
        let bytes = glb([0, 1, 2]);
        let at = bytes
            .windows(from.len())
            .position(|window| window == from.as_bytes())
            .unwrap();
        let message = parse(&[&bytes[..at], to.as_bytes(), &bytes[at + from.len()..]].concat())
            .unwrap_err()
            .to_string();
        assert!(message.contains("a.glb: "), "{message}");
    };
    edited(r#""count":3,"type":"VEC3""#, r#""count":9,"type":"VEC3""#);
    edited(r#""count":3,"type":"VEC3""#, r#""count":0,"type":"VEC3""#);
}

#[test]
fn indices_out_of_range_and_truncation_are_errors() {
    assert!(parse(&glb([0, 1, 7])).is_err());
    let bytes = glb([0, 1, 2]);
    for length in (0..bytes.len()).step_by(7) {
        assert!(parse(&bytes[..length]).is_err(), "{length}");
    }
}
