//! Bézier patches in the format `.s` of cpfg, lpfg and stedit (University of Calgary).
//!
//! ```text
//! xmin xmax  ymin ymax  zmin zmax          the box around the control points; not needed
//! PRECISION S: 5 T: 5                      optional; not needed
//! CONTACT POINT X: 0 Y: 0 Z: 0             the position of the turtle
//! END POINT X: 0 Y: 1 Z: 0                 not needed
//! HEADING X: 0 Y: 1 Z: 0                   the turtle's axes
//! UP X: 0 Y: 0 Z: 1
//! SIZE: 1                                  the length that becomes 1
//! name                                     and then, for each patch, its name,
//! TOP COLOR: 1 DIFFUSE: 0 BOTTOM COLOR: …  not needed: the model chooses colours
//! AL: ~ A: ~ AR: ~                         its neighbours; not needed: patches that
//! L: ~ R: ~                                share an edge have the same points there
//! BL: ~ B: ~ BR: ~
//! x y z  x y z  x y z  x y z               four rows of four control points
//! ```
//!
//! A file of stedit begins with `VERSION stedit`. Line breaks between numbers have no meaning.

use super::{PART_LIMIT, SurfaceError, number, shown};
use dlsys_model::{Net, SurfaceShape};

/// The words of a file, with their lines.
struct Words<'t> {
    words: std::iter::Peekable<Box<dyn Iterator<Item = (usize, &'t str)> + 't>>,
    /// The line of the last word.
    line: usize,
}

impl<'t> Words<'t> {
    fn new(text: &'t str) -> Words<'t> {
        let words: Box<dyn Iterator<Item = (usize, &str)>> = Box::new(
            text.lines()
                .enumerate()
                .flat_map(|(i, line)| line.split_whitespace().map(move |word| (i + 1, word))),
        );
        Words { words: words.peekable(), line: 1 }
    }

    fn peek(&mut self) -> Option<&'t str> {
        self.words.peek().map(|(_, word)| *word)
    }

    fn next(&mut self, wanted: &str) -> Result<&'t str, SurfaceError> {
        let Some((line, word)) = self.words.next() else {
            return Err(SurfaceError::at(self.line, format!("the file ends where {wanted} is expected")));
        };
        self.line = line;
        Ok(word)
    }

    /// Consumes the given words; any other word is an error.
    fn expect(&mut self, words: &str) -> Result<(), SurfaceError> {
        for wanted in words.split(' ') {
            let word = self.next(&format!("`{words}`"))?;
            if !word.eq_ignore_ascii_case(wanted) {
                return Err(SurfaceError::at(
                    self.line,
                    format!("expected `{words}`, not `{}`", shown(word)),
                ));
            }
        }
        Ok(())
    }

    fn number(&mut self) -> Result<f64, SurfaceError> {
        let word = self.next("a number")?;
        number(word, self.line)
    }

    /// `X: x Y: y Z: z` after the words.
    fn vector(&mut self, words: &str) -> Result<[f64; 3], SurfaceError> {
        self.expect(words)?;
        let mut vector = [0.0; 3];
        for (value, axis) in vector.iter_mut().zip(["X:", "Y:", "Z:"]) {
            self.expect(axis)?;
            *value = self.number()?;
        }
        Ok(vector)
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(a: [f64; 3]) -> Option<[f64; 3]> {
    let length = dot(a, a).sqrt();
    (length > 1e-9 && length.is_finite()).then(|| a.map(|c| c / length))
}

/// Reads the patches of a file, in the turtle's axes, at size 1.
pub(super) fn parse(text: &str) -> Result<SurfaceShape, SurfaceError> {
    let mut words = Words::new(text);
    let mut directed = false;
    if words.peek() == Some("VERSION") {
        words.next("")?;
        directed = words.next("the version")?.eq_ignore_ascii_case("stedit");
    }
    for _ in 0..6 {
        words.number()?;
    }
    if words.peek().is_some_and(|word| word.eq_ignore_ascii_case("precision")) {
        words.expect("PRECISION S:")?;
        words.number()?;
        words.expect("T:")?;
        words.number()?;
    }
    let contact = words.vector("CONTACT POINT")?;
    words.vector("END POINT")?;
    let heading = unit(words.vector("HEADING")?);
    let heading = heading.ok_or_else(|| SurfaceError::at(words.line, "the heading has no direction"))?;
    let up = words.vector("UP")?;
    let across = unit(cross(up, heading));
    let left = across.ok_or_else(|| SurfaceError::at(words.line, "up must not be along the heading"))?;
    let up = cross(heading, left);
    words.expect("SIZE:")?;
    let size = words.number()?;
    if size <= 0.0 {
        return Err(SurfaceError::at(words.line, "the size must be greater than 0"));
    }
    let place = |p: [f64; 3]| {
        let from = [p[0] - contact[0], p[1] - contact[1], p[2] - contact[2]];
        [heading, left, up].map(|axis| dot(from, axis) / size)
    };
    let mut patches: Vec<Net> = Vec::new();
    while words.peek().is_some() {
        if patches.len() == PART_LIMIT {
            return Err(SurfaceError::at(words.line, format!("more than {PART_LIMIT} patches")));
        }
        words.next("the name of a patch")?;
        words.expect("TOP COLOR:")?;
        words.number()?;
        words.expect("DIFFUSE:")?;
        words.number()?;
        words.expect("BOTTOM COLOR:")?;
        words.number()?;
        words.expect("DIFFUSE:")?;
        words.number()?;
        for neighbour in ["AL:", "A:", "AR:", "L:", "R:", "BL:", "B:", "BR:"] {
            words.expect(neighbour)?;
            words.next("the name of a neighbour, or `~`")?;
            if directed {
                words.next("the direction of a neighbour, or `~`")?;
            }
        }
        let mut net = [[0.0; 3]; 16];
        for point in &mut net {
            let mut coordinates = [0.0; 3];
            for c in &mut coordinates {
                *c = words.number()?;
            }
            *point = place(coordinates);
        }
        patches.push(net);
    }
    if patches.is_empty() {
        return Err(SurfaceError::at(words.line, "the file has no patches"));
    }
    Ok(SurfaceShape { patches, ..SurfaceShape::default() })
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "0 1  0 1  0 0\nCONTACT POINT X: 1 Y: 0 Z: 0\nEND POINT X: 0 Y: 1 Z: 0\n\
        HEADING X: 0 Y: 2 Z: 0\nUP X: 0 Y: 0 Z: 1\nSIZE: 2\n";
    const PATCH: &str = "petal\nTOP COLOR: 1 DIFFUSE: 0.5 BOTTOM COLOR: 2 DIFFUSE: 0\n\
        AL: ~ A: ~ AR: ~\nL: ~ R: ~\nBL: ~ B: ~ BR: ~\n";

    fn rows() -> String {
        (0..4).map(|r| (0..4).map(|c| format!("{c} {r} {} ", r * c)).collect::<String>() + "\n").collect()
    }

    #[test]
    fn patches_are_in_the_turtles_axes() {
        let shape = parse(&format!("{HEAD}{PATCH}{}{PATCH}{}", rows(), rows())).expect("a surface");
        assert_eq!(shape.patches.len(), 2);
        // Row 2, column 3: (3, 2, 6), from the contact point (2, 2, 6); heading y, left -x, up z; size 2.
        assert_eq!(shape.patches[0][11], [1.0, -1.0, 3.0]);
    }

    #[test]
    fn directions_written_by_stedit_are_accepted() {
        let patch = PATCH.replace('~', "~ ~");
        let text = format!("VERSION stedit\n{HEAD}{patch}{}", rows());
        assert_eq!(parse(&text).map(|shape| shape.patches.len()), Ok(1));
        let precise = HEAD.replace("CONTACT", "PRECISION S: 5 T: 5\nCONTACT");
        assert!(parse(&format!("{precise}{PATCH}{}", rows())).is_ok());
    }

    #[test]
    fn errors_have_their_line() {
        let fault = |text: &str| parse(text).expect_err("a fault");
        assert_eq!(fault("").what, "the file ends where a number is expected");
        assert_eq!(fault(&HEAD.replace("END", "EDN")).line, Some(3));
        assert!(fault(&HEAD.replace("Y: 2", "Y: 0")).what.contains("no direction"));
        assert!(fault(&HEAD.replace("SIZE: 2", "SIZE: 0")).what.contains("greater than 0"));
        assert_eq!(fault(HEAD).what, "the file has no patches");
        let short = fault(&format!("{HEAD}{PATCH}1 2 3"));
        assert_eq!((short.line, &*short.what), (Some(12), "the file ends where a number is expected"));
        let odd = fault(&format!("{HEAD}{PATCH}{}", rows().replace("3 3 9", "3 3 nine")));
        assert_eq!((odd.line, &*odd.what), (Some(15), "expected a number, not `nine`"));
    }
}
