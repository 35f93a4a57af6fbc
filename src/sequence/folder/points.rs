//! Point clouds as binary little-endian PLY with `float x y z`.

use crate::geometry::OBJECT_FRAME;
use crate::image::one_line;
use crate::sequence::SequenceError;
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{DefaultElement, Encoding, PropertyType, ScalarType};
use std::path::Path;

const MEND: &str = "write it as binary little-endian PLY whose vertices are float x y z";

pub(super) fn read(file: &Path) -> Result<Vec<[f32; 3]>, SequenceError> {
    let bytes = std::fs::read(file).map_err(|source| SequenceError::read(file, source))?;
    decode(&bytes).map_err(|problem| SequenceError::invalid(file, "truth.shape", problem, MEND))
}

pub(super) fn encode(points: &[[f32; 3]]) -> Vec<u8> {
    let header = format!(
        "ply\nformat binary_little_endian 1.0\ncomment object frame: {OBJECT_FRAME}\n\
         element vertex {}\nproperty float x\nproperty float y\nproperty float z\nend_header\n",
        points.len()
    );
    let mut bytes = header.into_bytes();
    bytes.extend(points.iter().flatten().flat_map(|value| value.to_le_bytes()));
    bytes
}

fn decode(bytes: &[u8]) -> Result<Vec<[f32; 3]>, String> {
    let mut reader = Reader::new(bytes);
    let header = Parser::<DefaultElement>::new()
        .read_header(&mut reader)
        .map_err(|error| one_line(&error.to_string()))?;
    let payload = reader.into_inner();
    if !matches!(header.encoding, Encoding::BinaryLittleEndian) {
        return Err("not binary little-endian".into());
    }
    let vertex = match header.elements.iter().next() {
        Some((name, vertex)) if name == "vertex" => vertex,
        _ => return Err("its first element is not `vertex`".into()),
    };
    let names: Vec<&str> = vertex.properties.keys().map(String::as_str).collect();
    let all_floats = vertex
        .properties
        .values()
        .all(|property| matches!(property.data_type, PropertyType::Scalar(ScalarType::Float)));
    if names != ["x", "y", "z"] || !all_floats {
        return Err(format!("vertex properties are {}", names.join(" ")));
    }
    let needed = vertex
        .count
        .checked_mul(12)
        .filter(|&needed| needed <= payload.len());
    let Some(payload) = needed.and_then(|needed| payload.get(..needed)) else {
        return Err(format!(
            "truncated: {} vertices announced, {} there",
            vertex.count,
            payload.len() / 12
        ));
    };
    let value = |bytes: &[u8]| bytes.try_into().map_or(0.0, f32::from_le_bytes);
    Ok(payload
        .chunks_exact(12)
        .map(|point| [value(&point[0..4]), value(&point[4..8]), value(&point[8..12])])
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_survive_and_truncations_do_not() {
        let points = [[1.0, -2.5, 3e-8], [f32::MIN_POSITIVE, 0.0, -0.25]];
        let bytes = encode(&points);
        assert_eq!(decode(&bytes).unwrap(), points);
        for length in 0..bytes.len() {
            assert!(decode(&bytes[..length]).is_err(), "{length}");
        }
    }

    #[test]
    fn a_count_beyond_the_file_allocates_nothing() {
        let text = String::from_utf8(encode(&[]))
            .unwrap()
            .replace("vertex 0", "vertex 18446744073709551615");
        assert!(decode(text.as_bytes()).is_err());
    }
}
