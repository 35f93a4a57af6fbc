//! Measures of a mask that tell a clean segmentation from a broken one.

use super::Mask;

impl Mask {
    /// Object pixels over all pixels, in \[0, 1\].
    pub fn share(&self) -> f64 {
        let object = self.data().iter().filter(|&&inside| inside).count();
        object as f64 / self.data().len().max(1) as f64
    }

    /// Object pixels in the outermost rows and columns: above 0, the object may be cut off.
    pub fn border_count(&self) -> usize {
        let (width, height) = self.size();
        let at_border = |i: usize| {
            let (column, row) = (i % width, i / width);
            column == 0 || row == 0 || column + 1 == width || row + 1 == height
        };
        self.data()
            .iter()
            .enumerate()
            .filter(|&(i, &inside)| inside && at_border(i))
            .count()
    }

    /// Those over all pixels of the outermost rows and columns, in \[0, 1\].
    pub fn border_share(&self) -> f64 {
        let (width, height) = self.size();
        let all = width * height - width.saturating_sub(2) * height.saturating_sub(2);
        self.border_count() as f64 / all.max(1) as f64
    }

    /// Columns and rows that hold the object: \[left, top, right, bottom\], the last two exclusive. `None` of an empty mask.
    pub fn bounds(&self) -> Option<[usize; 4]> {
        let width = self.width();
        let inside = self.data().iter().enumerate().filter(|(_, inside)| **inside);
        inside.fold(None, |bounds: Option<[usize; 4]>, (i, _)| {
            let (column, row) = (i % width, i / width);
            let [left, top, right, bottom] = bounds.unwrap_or([column, row, column, row]);
            Some([
                left.min(column),
                top.min(row),
                right.max(column + 1),
                bottom.max(row + 1),
            ])
        })
    }

    /// Number of 8-connected object parts.
    pub fn part_count(&self) -> usize {
        let (width, height) = self.size();
        let mut open = self.data().to_vec();
        let mut stack = Vec::new();
        let mut parts = 0;
        for seed in 0..open.len() {
            if !open[seed] {
                continue;
            }
            parts += 1;
            open[seed] = false;
            stack.push(seed);
            while let Some(i) = stack.pop() {
                let (column, row) = (i % width, i / width);
                for r in row.saturating_sub(1)..(row + 2).min(height) {
                    for c in column.saturating_sub(1)..(column + 2).min(width) {
                        let neighbour = r * width + c;
                        if open[neighbour] {
                            open[neighbour] = false;
                            stack.push(neighbour);
                        }
                    }
                }
            }
        }
        parts
    }
}

#[cfg(test)]
mod tests {
    use super::super::Grid;

    #[test]
    fn measures_of_a_known_mask() {
        let picture = ["#....", ".#...", "....#", "..#.#"];
        let mask = Grid::from_fn(5, 4, |column, row| picture[row].as_bytes()[column] == b'#');
        assert_eq!(mask.share(), 5.0 / 20.0);
        // All but (1, 1): the corner, two at the right edge, one at the bottom.
        assert_eq!(mask.border_count(), 4);
        assert_eq!(mask.border_share(), 4.0 / 14.0);
        // The diagonal pair is one part; (4, 2)–(4, 3) another; (2, 3) a third.
        assert_eq!(mask.part_count(), 3);
        assert_eq!(Grid::filled(3, 2, false).part_count(), 0);
    }
}
