//! Letters of 5 × 7 pixels: just those that the contact sheet writes.

const WIDTH: usize = 5;

/// The set pixels (column, row) of `text` at one pixel a dot; unknown characters leave a gap.
pub fn dots(text: &str) -> impl Iterator<Item = (usize, usize)> + '_ {
    text.chars().enumerate().flat_map(|(place, character)| {
        rows(character)
            .into_iter()
            .enumerate()
            .flat_map(move |(row, bits)| {
                (0..WIDTH)
                    .filter(move |column| bits >> (WIDTH - 1 - column) & 1 == 1)
                    .map(move |column| (place * (WIDTH + 1) + column, row))
            })
    })
}

fn rows(character: char) -> [u8; 7] {
    match character {
        '0' => [14, 17, 19, 21, 25, 17, 14],
        '1' => [4, 12, 4, 4, 4, 4, 14],
        '2' => [14, 17, 1, 2, 4, 8, 31],
        '3' => [31, 2, 4, 2, 1, 17, 14],
        '4' => [2, 6, 10, 18, 31, 2, 2],
        '5' => [31, 16, 30, 1, 1, 17, 14],
        '6' => [6, 8, 16, 30, 17, 17, 14],
        '7' => [31, 1, 2, 4, 8, 8, 8],
        '8' => [14, 17, 17, 14, 17, 17, 14],
        '9' => [14, 17, 17, 15, 1, 2, 12],
        '+' => [0, 4, 4, 31, 4, 4, 0],
        '-' => [0, 0, 0, 31, 0, 0, 0],
        'M' => [17, 27, 21, 21, 17, 17, 17],
        'E' => [31, 16, 16, 30, 16, 16, 31],
        'A' => [14, 17, 17, 31, 17, 17, 17],
        'N' => [17, 25, 21, 19, 17, 17, 17],
        'O' => [14, 17, 17, 17, 17, 17, 14],
        'D' => [30, 17, 17, 17, 17, 17, 30],
        'S' => [15, 16, 16, 14, 1, 1, 30],
        'I' => [14, 4, 4, 4, 4, 4, 14],
        'F' => [31, 16, 16, 30, 16, 16, 16],
        'R' => [30, 17, 17, 30, 20, 18, 17],
        'G' => [14, 17, 16, 23, 17, 17, 15],
        _ => [0; 7],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_minus_in_the_second_place() {
        let found: Vec<_> = dots(" -").collect();
        assert_eq!(found, [(6, 3), (7, 3), (8, 3), (9, 3), (10, 3)]);
    }
}
