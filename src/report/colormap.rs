//! A perceptually even colour scale for inverse depth: dark blue over magenta and orange to bright yellow.

/// The scale's colours at even steps; lightness rises throughout.
const ANCHORS: [[u8; 3]; 10] = [
    [13, 8, 135],
    [70, 3, 159],
    [114, 1, 168],
    [156, 23, 158],
    [189, 55, 134],
    [216, 87, 107],
    [237, 121, 83],
    [251, 159, 58],
    [253, 202, 38],
    [240, 249, 33],
];

/// The colour of `value` in \[0, 1\] (clamped): brighter = larger.
pub(super) fn colour(value: f32) -> [u8; 3] {
    let position = value.clamp(0.0, 1.0) * (ANCHORS.len() - 1) as f32;
    let low = (position as usize).min(ANCHORS.len() - 2);
    let share = position - low as f32;
    std::array::from_fn(|c| {
        let (a, b) = (f32::from(ANCHORS[low][c]), f32::from(ANCHORS[low + 1][c]));
        (a + share * (b - a)).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brighter_is_larger() {
        let luma =
            |c: [u8; 3]| 0.2126 * f32::from(c[0]) + 0.7152 * f32::from(c[1]) + 0.0722 * f32::from(c[2]);
        let scale: Vec<_> = (0..=40).map(|i| luma(colour(i as f32 / 40.0))).collect();
        assert!(scale.windows(2).all(|pair| pair[0] < pair[1]), "{scale:?}");
        assert_eq!(colour(-1.0), ANCHORS[0]);
        assert_eq!(colour(2.0), ANCHORS[9]);
    }
}
