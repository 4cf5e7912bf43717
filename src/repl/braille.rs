//! A raster of dots made of Braille characters, each with two columns and four rows of dots.

/// A raster of dots, each with or without a colour.
#[derive(Clone, Debug)]
pub struct Sheet {
    /// Size in characters.
    columns: usize,
    rows: usize,
    cells: Vec<u8>,
    /// For each character, the sum of the colours of its dots, and the number of coloured dots.
    colours: Vec<([u32; 3], u32)>,
}

/// The bit of a dot, by its row and column in the character (Unicode, block “Braille Patterns”).
const BITS: [[u8; 2]; 4] = [[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]];

impl Sheet {
    pub fn new(columns: usize, rows: usize) -> Sheet {
        let cells = columns * rows;
        Sheet { columns, rows, cells: vec![0; cells], colours: vec![([0; 3], 0); cells] }
    }

    /// Width and height in dots.
    pub fn size(&self) -> [usize; 2] {
        [2 * self.columns, 4 * self.rows]
    }

    /// Sets a dot, counted from the upper left; dots outside the sheet are ignored.
    pub fn dot(&mut self, x: usize, y: usize, colour: Option<[u8; 3]>) {
        let (column, row) = (x / 2, y / 4);
        if column >= self.columns || row >= self.rows {
            return;
        }
        let cell = row * self.columns + column;
        self.cells[cell] |= BITS[y % 4][x % 2];
        if let Some(colour) = colour {
            let (sum, count) = &mut self.colours[cell];
            sum.iter_mut().zip(colour).for_each(|(sum, c)| *sum += u32::from(c));
            *count += 1;
        }
    }

    /// Sets dots along a line.
    pub fn line(&mut self, from: [f64; 2], to: [f64; 2], colour: Option<[u8; 3]>) {
        let steps = (to[0] - from[0]).abs().max((to[1] - from[1]).abs()).ceil().clamp(1.0, 10_000.0);
        for i in 0..=steps as usize {
            let s = i as f64 / steps;
            let [x, y] = [0, 1].map(|k| (from[k] * (1.0 - s) + to[k] * s).round());
            if x >= 0.0 && y >= 0.0 {
                self.dot(x as usize, y as usize, colour);
            }
        }
    }

    /// The rows as text without trailing space, optionally with colours.
    pub fn rows(&self, coloured: bool) -> Vec<String> {
        let row = |row: usize| {
            let mut out = String::new();
            let mut ink: Option<[u8; 3]> = None;
            let range = row * self.columns..(row + 1) * self.columns;
            let last = self.cells[range.clone()].iter().rposition(|cell| *cell != 0).map_or(0, |at| at + 1);
            for cell in range.take(last) {
                let bits = self.cells[cell];
                let (sum, count) = self.colours[cell];
                let wanted = (coloured && count > 0).then(|| sum.map(|c| (c / count.max(1)) as u8));
                if bits != 0 && wanted != ink {
                    out +=
                        &wanted.map_or("\x1b[0m".to_owned(), |[r, g, b]| format!("\x1b[38;2;{r};{g};{b}m"));
                    ink = wanted;
                }
                // In some fonts the empty pattern has a different width.
                let pattern = char::from_u32(0x2800 + u32::from(bits)).unwrap_or(' ');
                out.push(if bits == 0 { ' ' } else { pattern });
            }
            if ink.is_some() {
                out += "\x1b[0m";
            }
            out
        };
        (0..self.rows).map(row).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dots_become_characters() {
        let mut sheet = Sheet::new(2, 1);
        assert_eq!(sheet.size(), [4, 4]);
        sheet.dot(0, 0, None);
        assert_eq!(sheet.rows(false), ["⠁"]);
        sheet.line([0.0, 0.0], [3.0, 3.0], None);
        assert_eq!(sheet.rows(false), ["⠑⢄"]);
        sheet.dot(0, 0, Some([10, 20, 30]));
        assert_eq!(sheet.rows(true), ["\x1b[38;2;10;20;30m⠑\x1b[0m⢄"]);
        sheet.dot(99, 99, None);
    }
}
