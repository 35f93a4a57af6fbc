use super::*;

fn parse(text: &str) -> Result<Mesh, CadError> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.ac"), text).unwrap();
    read(&mut Archive::open(folder.path()).unwrap(), "a.ac")
}

const HEAD: &str = "AC3Db\nMATERIAL \"a b\" rgb 1 0.5 0 amb 0 0 0 emis 0 0 0 spec 0 0 0 shi 1 trans 0.25\n";

#[test]
fn a_moved_and_turned_kid_with_data_between() {
    // The quarter turn takes x to y in the row-vector convention: rows (0 1 0), (-1 0 0), (0 0 1).
    let mesh = parse(&format!(
        "{HEAD}OBJECT world\nkids 1\nOBJECT group\ndata 10\nkids 7\nxx\nloc 10 0 0\nrot 0 1 0 -1 0 0 0 0 1\nkids 1\n\
         OBJECT poly\nname \"k\"\nloc 1 0 0\ntexrep 2 1\ntexoff 0.5 0\nnumvert 4\n1 0 0\n0 1 0\n0 0 1\n1 1 1\n\
         numsurf 1\nSURF 0x20\nmat 0\nrefs 4\n0 0 0\n1 1 0\n2 1 1\n3 0 1\nkids 0\n"
    ))
    .unwrap();
    assert_eq!(mesh.triangles.len(), 2);
    // x_world = R (x + (1, 0, 0)) + (10, 0, 0), R: x → y, y → −x.
    assert!((mesh.vertices[0] - Vector3::new(10.0, 2.0, 0.0)).norm() < 1e-12);
    assert!((mesh.vertices[1] - Vector3::new(9.0, 1.0, 0.0)).norm() < 1e-12);
    assert_eq!(mesh.triangles[0].texture_coordinates[1], [2.5, 0.0]);
    assert_eq!(mesh.materials[0].diffuse, [1.0, 0.5, 0.0]);
    assert_eq!(mesh.materials[0].opacity, 0.75);
}

#[test]
fn strips_keep_one_orientation_and_lines_and_lights_are_skipped() {
    let square = "numvert 4\n0 0 0 9 9 9\n0 1 0 9 9 9\n1 0 0 9 9 9\n1 1 0 9 9 9\n";
    let refs = "mat 0\nrefs 4\n0 0 0 7 7\n1 0 1 7 7\n2 1 0 7 7\n3 1 1 7 7\n";
    let mesh = parse(&format!(
        "{HEAD}OBJECT world\nkids 2\nOBJECT poly\n{square}numsurf 2\nSURF 0x14\n{refs}SURF 0x02\n{refs}kids 0\n\
         OBJECT light\n{square}numsurf 1\nSURF 0x10\n{refs}kids 0\n"
    ))
    .unwrap();
    assert_eq!(mesh.triangles.len(), 2);
    let normals: Vec<f64> = mesh
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.vertices.map(|i| mesh.vertices[i as usize]);
            (b - a).cross(&(c - a)).z
        })
        .collect();
    assert_eq!(normals, [-1.0, -1.0]);
    assert_eq!(
        mesh.triangles[1].texture_coordinates,
        [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]
    );
}

#[test]
fn what_flightgear_s_files_do_is_read() {
    let mesh = parse(&format!(
        "{HEAD}OBJECT world\nkids 2\nOBJECT poly\nnumvert 3\n0 0 0\n1 0 0\n0 1 0\n\
         numsurf 1\nSURF 0X20\nmat 0\nrefs 3\n0 0 0\n1 0 0\n2 0 0\nkids 0\n"
    ))
    .unwrap();
    assert_eq!(mesh.triangles.len(), 1);
}

#[test]
fn damage_is_an_error_with_its_line() {
    let message = parse(&format!(
        "{HEAD}OBJECT world\nkids 1\nOBJECT poly\nnumvert 1\n0 0 0\nnumsurf 1\nSURF 0x10\nmat 0\nrefs 1\n5 0 0\nkids 0\n"
    ))
    .unwrap_err()
    .to_string();
    assert!(message.contains("line 12: refs vertex 5"), "{message}");
    assert!(parse("AC3Db\nOBJECT poly\nnumvert 3\n0 0 0\n").is_err());
    assert!(parse("solid\n").is_err());
}
