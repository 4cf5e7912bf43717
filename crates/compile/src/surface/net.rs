//! Meshes of sheets from Wavefront OBJ: `v`, `f` and `l`; other lines are ignored. Faces keep their corners, points their numbers.

use super::{PART_LIMIT, SIZE_LIMIT, SurfaceError, number, shown};
use std::path::Path;

use dlsys_syntax::{Files, fault_of_path};

/// A mesh of faces and cords, with the lines of the file on which they stand, from 1.
#[derive(Debug, Default)]
pub struct Net {
    pub points: Vec<[f64; 3]>,
    pub faces: Vec<Vec<usize>>,
    pub cords: Vec<[usize; 2]>,
    pub point_lines: Vec<usize>,
    pub face_lines: Vec<usize>,
    pub cord_lines: Vec<usize>,
}

/// Reads the mesh of a sheet.
pub fn read(path: &str, files: &dyn Files) -> Result<Net, SurfaceError> {
    if let Some(why) = fault_of_path(path) {
        return Err(SurfaceError::whole(why)
            .help("meshes stand in the folder of the model or below it, as in `\"meshes/net.obj\"`"));
    }
    let extension = Path::new(path).extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
    if extension.as_deref() != Some("obj") {
        return Err(SurfaceError::whole("this is no mesh of a sheet")
            .help("a sheet is a Wavefront mesh (`.obj`) with faces, or with lines for cords"));
    }
    let bytes = files.read(Path::new(path), SIZE_LIMIT).map_err(|what| {
        SurfaceError::whole(what)
            .help("put it into the folder of the model's file or below; the path begins there")
    })?;
    parse(&String::from_utf8_lossy(&bytes))
}

fn parse(text: &str) -> Result<Net, SurfaceError> {
    let mut net = Net::default();
    let mut lines = text.lines().enumerate();
    while let Some((i, first)) = lines.next() {
        let at = i + 1;
        let mut line = first.to_owned();
        // A backslash continues a line.
        while line.ends_with('\\') {
            line.pop();
            let Some((_, more)) = lines.next() else { break };
            line.push_str(more);
        }
        let mut words = line.split_whitespace().take_while(|word| !word.starts_with('#'));
        match words.next() {
            Some("v") => {
                let mut next = || match words.next() {
                    Some(word) => number(word, at),
                    None => Err(SurfaceError::at(at, "expected three numbers")),
                };
                net.points.push([next()?, next()?, next()?]);
                net.point_lines.push(at);
            }
            Some("f") => {
                let corners = words.map(|word| net.corner(word, at)).collect::<Result<Vec<_>, _>>()?;
                if corners.len() < 3 {
                    return Err(SurfaceError::at(at, "a face has three corners or more"));
                }
                net.faces.push(corners);
                net.face_lines.push(at);
            }
            Some("l") => {
                let ends = words.map(|word| net.corner(word, at)).collect::<Result<Vec<_>, _>>()?;
                if ends.len() < 2 {
                    return Err(SurfaceError::at(at, "a line has two points or more"));
                }
                net.cords.extend(ends.windows(2).map(|pair| [pair[0], pair[1]]));
                net.cord_lines.resize(net.cords.len(), at);
            }
            _ => {}
        }
        let parts = net.points.len().max(net.faces.len() + net.cords.len());
        if parts > PART_LIMIT {
            return Err(SurfaceError::at(at, format!("more than {PART_LIMIT} points, faces or lines")));
        }
    }
    if net.faces.is_empty() && net.cords.is_empty() {
        return Err(SurfaceError::whole("the file has no faces and no lines")
            .help("a cloth is made of faces such as `f 1 2 3`, a net of lines such as `l 1 2`"));
    }
    Ok(net)
}

impl Net {
    /// The point of `v`, `v/vt`, `v//vn` or `v/vt/vn`; numbers count from 1, negative ones backwards from the last.
    fn corner(&self, word: &str, line: usize) -> Result<usize, SurfaceError> {
        let part = word.split('/').next().unwrap_or_default();
        let number: Option<i64> = part.parse().ok();
        let count = self.points.len() as i64;
        let place = match number {
            Some(n) if n > 0 => n - 1,
            Some(n) if n < 0 => count + n,
            _ => -1,
        };
        if (0..count).contains(&place) {
            return Ok(place as usize);
        }
        Err(SurfaceError::at(line, format!("there is no vertex `{}` before this line", shown(part))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_keep_their_corners_and_polylines_become_cords() {
        let text =
            "o net\nv 0 0 0\nv 1 0 0 # a corner\nv 1 1 0\nv 0 1 0\nf 1/1 2//2 3/3/3 \\\n -1\nl 1 3 4 # two\n";
        let net = parse(text).expect("a net");
        assert_eq!(net.faces, [[0, 1, 2, 3]]);
        assert_eq!(net.cords, [[0, 2], [2, 3]]);
        assert_eq!((&net.face_lines[..], &net.cord_lines[..]), (&[6][..], &[8, 8][..]));
        assert_eq!(net.points[2], [1.0, 1.0, 0.0]);
    }

    #[test]
    fn errors_have_their_line() {
        let fault = |text: &str| parse(text).expect_err("a fault");
        assert_eq!(fault("v 0 0 0\nl 1 2").line, Some(2));
        assert_eq!(fault("v 0 0 0\nl 1").what, "a line has two points or more");
        assert_eq!(fault("v 0 0 0\nf 1 1").what, "a face has three corners or more");
        assert_eq!(fault("v 0 0").what, "expected three numbers");
        assert_eq!(fault("v 0 0 0\n").what, "the file has no faces and no lines");
    }
}
