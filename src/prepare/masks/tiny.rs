//! Networks small enough to write by hand, for tests: one convolution, perhaps a sigmoid.

use std::path::Path;

/// The side of the network's input, pixels.
pub const SIDE: usize = 32;

/// A field of a protocol buffer: its length takes as many bytes as it needs.
fn field(number: u8, bytes: &[u8]) -> Vec<u8> {
    [&[number << 3 | 2][..], &length(bytes.len()), bytes].concat()
}

fn length(mut left: usize) -> Vec<u8> {
    let mut written = Vec::new();
    while left >= 128 {
        written.push(left as u8 | 128);
        left >>= 7;
    }
    written.push(left as u8);
    written
}

fn whole(number: u8, value: usize) -> Vec<u8> {
    [&[number << 3][..], &length(value)].concat()
}

/// `name`, 32-bit floats of 1 × channels × SIDE × SIDE.
fn value_info(name: &str, channels: usize) -> Vec<u8> {
    let dims = [1, channels, SIDE, SIDE]
        .map(|dim| field(1, &whole(1, dim)))
        .concat();
    let tensor_type = [whole(1, 1), field(2, &dims)].concat();
    [field(1, name.as_bytes()), field(2, &field(1, &tensor_type))].concat()
}

fn tensor(name: &str, shape: &[usize], values: &[f32]) -> Vec<u8> {
    let dims: Vec<u8> = shape.iter().flat_map(|&dim| whole(1, dim)).collect();
    let values: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    [dims, whole(2, 1), field(8, name.as_bytes()), field(9, &values)].concat()
}

/// Whole numbers, type 7 in field 20.
fn numbers(name: &str, values: &[usize]) -> Vec<u8> {
    let values: Vec<u8> = values.iter().flat_map(|&value| whole(8, value)).collect();
    let kind = [&length(20 << 3)[..], &length(7)].concat();
    field(5, &[field(1, name.as_bytes()), values, kind].concat())
}

/// Writes `name.onnx`, whose plane k at a pixel is the mean over `reach` pixels every way of (red, green, blue) · `weights[k]`, plus
/// `biases[k]`, and the TOML file that describes it.
pub fn network(
    folder: &Path,
    name: &str,
    description: &str,
    reach: usize,
    weights: &[[f32; 3]],
    biases: &[f32],
    sigmoid: bool,
) {
    let node = |kind: &str, inputs: &[&str], output: &str, attributes: &[u8]| {
        let inputs: Vec<u8> = inputs
            .iter()
            .flat_map(|input| field(1, input.as_bytes()))
            .collect();
        let names = [field(2, output.as_bytes()), field(4, kind.as_bytes())].concat();
        field(1, &[&inputs, &names, attributes].concat())
    };
    let (planes, side) = (weights.len(), 2 * reach + 1);
    let kernel: Vec<f32> = weights
        .iter()
        .flatten()
        .flat_map(|weight| vec![weight / (side * side) as f32; side * side])
        .collect();
    let attributes = [
        numbers("kernel_shape", &[side, side]),
        numbers("pads", &[reach; 4]),
    ]
    .concat();
    let result = if sigmoid { "y" } else { "z" };
    let graph = [
        node("Conv", &["x", "w", "b"], result, &attributes),
        if sigmoid {
            node("Sigmoid", &["y"], "z", &[])
        } else {
            Vec::new()
        },
        field(2, name.as_bytes()),
        field(5, &tensor("w", &[planes, 3, side, side], &kernel)),
        field(5, &tensor("b", &[planes], biases)),
        field(11, &value_info("x", 3)),
        field(12, &value_info("z", planes)),
    ]
    .concat();
    let opset = field(8, &whole(2, 11));
    let model = [whole(1, 6), field(7, &graph), opset].concat();
    std::fs::write(folder.join(name).with_extension("onnx"), model).unwrap();
    std::fs::write(folder.join(name).with_extension("toml"), description).unwrap();
}

/// What describes networks of these; `mean` and `deviation` make −1 to 1 of 0 to 255.
pub fn description(kind: &str, classes: &str) -> String {
    format!(
        "kind = \"{kind}\"\nside = {SIDE}\nmean = [127.5, 127.5, 127.5]\ndeviation = [127.5, 127.5, 127.5]\n{classes}"
    )
}

/// Three networks that take for a car what is more red than blue; that which tells classes apart wants little green too.
pub fn redness(folder: &Path) {
    network(
        folder,
        "saliency",
        &description("saliency", ""),
        0,
        &[[8.0, 0.0, -8.0]],
        &[0.0],
        true,
    );
    // Objectness, offsets, logits of the size (a quarter and 5/16 of the picture), two classes.
    let red = [0.5, 0.0, -0.5];
    network(
        folder,
        "detector",
        &description("detections", "classes = [\"person\", \"car\"]"),
        4,
        &[red, [0.0; 3], [0.0; 3], [0.0; 3], [0.0; 3], [0.0; 3], red],
        &[0.0, 0.0, 0.0, -1.0986, -0.7885, 0.0, 0.0],
        false,
    );
    network(
        folder,
        "classes",
        &description("classes", "classes = [\"background\", \"car\"]"),
        0,
        &[[0.0; 3], [4.0, -10.0, -4.0]],
        &[0.0, -6.0],
        false,
    );
}
