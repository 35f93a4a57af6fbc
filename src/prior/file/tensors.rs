//! Tensors as bytes.

use super::{METADATA_KEY, PriorError, PriorInfo};
use half::f16;
use safetensors::tensor::{Dtype, TensorView};
use safetensors::{SafeTensors, serialize};
use std::path::{Path, PathBuf};

/// A tensor's name, type, shape and bytes.
pub(super) type Tensor = (String, Dtype, Vec<usize>, Vec<u8>);

/// A whole file of these tensors, with its description.
pub(super) fn serialised(tensors: &[Tensor], info: &PriorInfo) -> Result<Vec<u8>, PriorError> {
    let invalid = |reason: String| PriorError::Tensor {
        path: PathBuf::new(),
        tensor: "basis".to_owned(),
        reason,
    };
    let views = tensors
        .iter()
        .map(|(name, dtype, shape, data)| {
            let view = TensorView::new(*dtype, shape.clone(), data).map_err(|e| invalid(e.to_string()))?;
            Ok((name, view))
        })
        .collect::<Result<Vec<_>, PriorError>>()?;
    let json = serde_json::to_string(info).map_err(|e| invalid(e.to_string()))?;
    serialize(views, Some([(METADATA_KEY.to_owned(), json)].into())).map_err(|e| invalid(e.to_string()))
}

/// The numbers' bytes as f32.
pub(super) fn single(numbers: impl Iterator<Item = f64>) -> Vec<u8> {
    numbers.flat_map(|x| (x as f32).to_le_bytes()).collect()
}

/// The numbers' bytes as f16.
pub(super) fn half(numbers: impl Iterator<Item = f64>) -> Vec<u8> {
    numbers.flat_map(|x| f16::from_f64(x).to_le_bytes()).collect()
}

/// The tensor `name` of a file at `path`, which must have this shape and type, and finite numbers.
pub(super) fn numbers(
    file: &SafeTensors,
    path: &Path,
    name: &str,
    shape: &[usize],
    dtype: Dtype,
) -> Result<Vec<f64>, PriorError> {
    let wrong = |reason: String| PriorError::Tensor {
        path: path.to_owned(),
        tensor: name.to_owned(),
        reason,
    };
    let view = file.tensor(name).map_err(|_| wrong("is missing".to_owned()))?;
    if view.shape() != shape || view.dtype() != dtype {
        let (found, found_dtype) = (view.shape(), view.dtype());
        return Err(wrong(format!(
            "is {found_dtype} {found:?}, {dtype} {shape:?} expected"
        )));
    }
    let values: Vec<f64> = match dtype {
        Dtype::F32 => chunks(view.data())
            .map(|b| f64::from(f32::from_le_bytes(b)))
            .collect(),
        Dtype::U32 => chunks(view.data())
            .map(|b| f64::from(u32::from_le_bytes(b)))
            .collect(),
        _ => chunks(view.data())
            .map(|b| f16::from_le_bytes(b).to_f64())
            .collect(),
    };
    match values.iter().position(|x| !x.is_finite()) {
        Some(index) => Err(wrong(format!("holds {} at index {index}", values[index]))),
        None => Ok(values),
    }
}

fn chunks<const B: usize>(bytes: &[u8]) -> impl Iterator<Item = [u8; B]> + '_ {
    bytes.as_chunks::<B>().0.iter().copied()
}
