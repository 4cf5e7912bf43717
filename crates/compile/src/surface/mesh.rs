//! Triangle meshes from Wavefront OBJ: `v`, `vn` and `f`, with the colours that `mtllib` and `usemtl` name, and `vt` if there is a picture on
//! the mesh; other lines are ignored.
//!
//! The axes are those of exported OBJ files, so that an exported drawing can be used as a surface: the turtle is at the
//! origin with the heading `+Y`, up `+Z` and left `-X`. Faces with more than three corners are triangulated as a fan about
//! their first corner, which is valid for convex faces.

use std::collections::HashMap;

use super::materials::Library;
use super::{PART_LIMIT, SurfaceError, number, shown};
use dlsys_model::SurfaceShape;
use dlsys_syntax::Files;

/// A corner of a face: vertex and, perhaps, normal, and place in the picture if there is one, by number from 0.
type Corner = (u32, Option<u32>, Option<u32>);

/// The lines with numbers so far.
#[derive(Default)]
struct Lists {
    points: Vec<[f64; 3]>,
    directions: Vec<[f64; 3]>,
    /// With a picture on the mesh, places in it.
    places: Option<Vec<[f64; 2]>>,
}

/// Reads the mesh of a file, and the material libraries beside it.
pub(super) fn parse(
    text: &str,
    path: &str,
    has_picture: bool,
    files: &dyn Files,
) -> Result<SurfaceShape, SurfaceError> {
    let mut library = Library::default();
    let mut material = None;
    let mut lists = Lists { places: has_picture.then(Vec::new), ..Lists::default() };
    let mut faces: Vec<([Corner; 3], Option<u32>)> = Vec::new();
    let mut corners: Vec<Corner> = Vec::new();
    let mut lines = text.lines().enumerate();
    let mut joined = String::new();
    while let Some((i, first)) = lines.next() {
        let at = i + 1;
        // A backslash continues a line.
        let mut line = first;
        if first.ends_with('\\') {
            joined.clear();
            joined.push_str(first.trim_end_matches('\\'));
            for (_, more) in lines.by_ref() {
                joined.push_str(more.trim_end_matches('\\'));
                if !more.ends_with('\\') {
                    break;
                }
            }
            line = &joined;
        }
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => lists.points.push(turned(&mut words, at)?),
            Some("vn") => lists.directions.push(turned(&mut words, at)?),
            Some("vt") => {
                if let Some(places) = &mut lists.places {
                    let mut next = || words.next().map_or(Ok(0.0), |word| number(word, at));
                    places.push([next()?, next()?]);
                }
            }
            Some("mtllib") => words.try_for_each(|name| library.add(name, path, files))?,
            Some("usemtl") => material = words.next().and_then(|name| library.find(name)),
            Some("f") => {
                corners.clear();
                for word in words.take_while(|word| !word.starts_with('#')) {
                    corners.push(corner(word, &lists, at)?);
                }
                if corners.len() < 3 {
                    return Err(SurfaceError::at(at, "a face has three corners or more"));
                }
                for k in 2..corners.len() {
                    faces.push(([corners[0], corners[k - 1], corners[k]], material));
                }
                if faces.len() > PART_LIMIT {
                    return Err(SurfaceError::at(at, format!("more than {PART_LIMIT} triangles")));
                }
            }
            _ => {}
        }
    }
    if faces.is_empty() {
        return Err(SurfaceError::whole("the file has no faces").help("faces are lines such as `f 1 2 3`"));
    }
    let shape = build(&lists, &faces);
    Ok(SurfaceShape { materials: library.into_colors(), ..shape })
}

/// Three numbers, transformed into the turtle's axes.
fn turned<'t>(words: &mut impl Iterator<Item = &'t str>, line: usize) -> Result<[f64; 3], SurfaceError> {
    let mut next = || match words.next() {
        Some(word) => number(word, line),
        None => Err(SurfaceError::at(line, "expected three numbers")),
    };
    let (x, y, z) = (next()?, next()?, next()?);
    Ok([y, -x, z])
}

/// `v`, `v/vt`, `v//vn` or `v/vt/vn`; numbers count from 1, negative ones backwards from the last.
fn corner(word: &str, lists: &Lists, line: usize) -> Result<Corner, SurfaceError> {
    let index = |part: &str, count: usize, what: &str| {
        let number: Option<i64> = part.parse().ok();
        let place = match number {
            Some(n) if n > 0 => Some(n - 1),
            Some(n) if n < 0 => Some(count as i64 + n),
            _ => None,
        };
        match place {
            Some(place) if (0..count as i64).contains(&place) => Ok(place as u32),
            _ => {
                Err(SurfaceError::at(line, format!("there is no {what} `{}` before this face", shown(part))))
            }
        }
    };
    let mut parts = word.split('/');
    let vertex = index(parts.next().unwrap_or_default(), lists.points.len(), "vertex")?;
    let (of_picture, of_normal) = (parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
    let place = match &lists.places {
        None => None,
        Some(places) if places.is_empty() || of_picture.is_empty() => return Err(unplaced(places, line)),
        Some(places) => Some(index(of_picture, places.len(), "texture coordinate")?),
    };
    let normal = match of_normal {
        "" => None,
        part => Some(index(part, lists.directions.len(), "normal")?),
    };
    Ok((vertex, normal, place))
}

/// A face of a mesh with a picture does not say where it lies in that.
fn unplaced(places: &[[f64; 2]], line: usize) -> SurfaceError {
    let what = match places {
        [] => "there are no texture coordinates (`vt`) before this face",
        _ => "this corner has no texture coordinate: `v/vt` or `v/vt/vn`",
    };
    SurfaceError::at(line, what).help(
        "export the mesh with its texture coordinates (UV), or leave out `texture`; Bézier patches (`.s`) need none",
    )
}

/// One vertex for each pair of point and normal in the faces, and place in a picture.
fn build(lists: &Lists, faces: &[([Corner; 3], Option<u32>)]) -> SurfaceShape {
    let is_smooth = faces.iter().flat_map(|(face, _)| face).any(|(_, normal, _)| normal.is_none());
    // A vertex with several places in the picture must not show where the picture is cut.
    let smooth = (is_smooth && lists.places.is_some()).then(|| smooth_normals(&lists.points, faces));
    let mut numbers: HashMap<Corner, u32> = HashMap::new();
    let mut shape = SurfaceShape::default();
    for (face, material) in faces {
        let triangle = face.map(|(vertex, normal, place)| {
            // If a corner has no normal, all normals are computed from the faces.
            let normal = normal.filter(|_| !is_smooth);
            *numbers.entry((vertex, normal, place)).or_insert_with(|| {
                shape.vertices.push(lists.points[vertex as usize]);
                match (normal, &smooth) {
                    (Some(normal), _) => shape.normals.push(lists.directions[normal as usize]),
                    (None, Some(smooth)) => shape.normals.push(smooth[vertex as usize]),
                    (None, None) => {}
                }
                if let Some((places, place)) = lists.places.as_ref().zip(place) {
                    shape.places.push(places[place as usize]);
                }
                shape.vertices.len() as u32 - 1
            })
        });
        if triangle[0] != triangle[1] && triangle[1] != triangle[2] && triangle[2] != triangle[0] {
            shape.triangles.push(triangle);
            shape.painted.push(*material);
        }
    }
    shape
}

/// For each point the sum of the normals of its triangles, by their areas.
fn smooth_normals(points: &[[f64; 3]], faces: &[([Corner; 3], Option<u32>)]) -> Vec<[f64; 3]> {
    let mut normals = vec![[0.0; 3]; points.len()];
    for (face, _) in faces {
        let [p, q, r] = face.map(|(vertex, ..)| points[vertex as usize]);
        let [a, b] = [q, r].map(|to| [0, 1, 2].map(|k| to[k] - p[k]));
        let area = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        for (vertex, ..) in face {
            (0..3).for_each(|k| normals[*vertex as usize][k] += area[k]);
        }
    }
    normals
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use dlsys_syntax::NoFiles;

    fn parse(text: &str) -> Result<SurfaceShape, SurfaceError> {
        super::parse(text, "mesh.obj", false, &NoFiles)
    }

    /// A folder with one file in it.
    struct Beside(&'static str, &'static str);

    impl Files for Beside {
        fn read(&self, path: &Path, _: u64) -> Result<Vec<u8>, String> {
            if path == Path::new(self.0) { Ok(self.1.into()) } else { Err("not there".to_owned()) }
        }
    }

    #[test]
    fn faces_have_the_colours_of_the_material_library() {
        let text = "mtllib lost.mtl colours.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n\
                    usemtl red\nf 1 2 3\nusemtl none\nf 1 2 3\nusemtl green\nf 1 2 3\n";
        let library = "newmtl red\nKa 0 0 0\nKd 1 0 0\nnewmtl green\nKd 0 0.5 0\n";
        let shape = super::parse(text, "organs/mesh.obj", false, &Beside("organs/colours.mtl", library))
            .expect("a mesh");
        assert_eq!(shape.painted, [None, Some(0), None, Some(1)]);
        assert_eq!(shape.materials.iter().map(|m| m.rgb).collect::<Vec<_>>(), [0xff0000, 0x008000]);
        assert_eq!(parse(text).expect("a mesh without colours").materials, []);
    }

    #[test]
    fn polygons_become_triangles_and_negative_indices_count_backwards() {
        let text = "# a square\no x\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1 \\\n -1/1\n";
        let shape = parse(text).expect("a mesh");
        assert_eq!(shape.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(shape.vertices[1], [0.0, -1.0, 0.0], "right is against the turtle's left");
        assert!(shape.normals.is_empty());
    }

    #[test]
    fn vertices_with_different_normals_are_separate() {
        let text =
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 0 0 1\nvn 0 1 0\nf 1//1 2//1 3//1\nf 1//2 4//2 2//2\n";
        let shape = parse(text).expect("a mesh");
        assert_eq!((shape.vertices.len(), shape.normals.len()), (6, 6));
        assert_eq!(shape.normals[0], [0.0, 0.0, 1.0]);
        assert_eq!(shape.normals[3], [1.0, 0.0, 0.0]);
    }

    #[test]
    fn errors_have_their_line() {
        let fault = |text: &str| parse(text).expect_err("a fault");
        assert_eq!(fault("v 0 0 0\nf 1 2 3").line, Some(2));
        assert_eq!(fault("v 0 0").what, "expected three numbers");
        assert_eq!(fault("v 0 0 x").what, "expected a number, not `x`");
        assert_eq!(fault("v 0 0 inf").line, Some(1));
        assert_eq!(fault("v 0 0 0\nf 1 1").what, "a face has three corners or more");
        assert_eq!(fault("v 0 0 0\n").what, "the file has no faces");
        assert_eq!(fault("v 0 0 0\nf 1//1 1 1").what, "there is no normal `1` before this face");
    }

    /// Where a picture is cut, a vertex has two places in it and one normal; without a picture, nothing of that is read.
    #[test]
    fn with_a_picture_vertices_have_their_places_in_it() {
        let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 1\nvt 0 0\nvt 1 0 0\nvt 1 1\nvt 0.5 0.25\n\
                    f 1/1 2/2 3/3\nf 1/4 3/3 4/-1\n";
        let with = super::parse(text, "mesh.obj", true, &NoFiles).expect("a mesh");
        assert_eq!(with.places, [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.5, 0.25], [0.5, 0.25]]);
        assert_eq!(with.triangles, [[0, 1, 2], [3, 2, 4]]);
        assert_eq!((with.normals[0], with.vertices[0]), (with.normals[3], with.vertices[3]));
        let without = parse(text).expect("a mesh");
        assert_eq!((without.vertices.len(), without.places.len(), without.normals.len()), (4, 0, 0));
    }

    #[test]
    fn a_picture_needs_places() {
        let fault = |text: &str| super::parse(text, "mesh.obj", true, &NoFiles).expect_err("a fault");
        let corners = "v 0 0 0\nv 1 0 0\nv 1 1 0\n";
        let none = fault(&format!("{corners}f 1 2 3"));
        assert_eq!(
            (none.line, &*none.what),
            (Some(4), "there are no texture coordinates (`vt`) before this face")
        );
        let some = fault(&format!("{corners}vt 0 0\nf 1/1 2/1 3"));
        assert_eq!(some.what, "this corner has no texture coordinate: `v/vt` or `v/vt/vn`");
        let far = fault(&format!("{corners}vt 0 0\nf 1/1 2/2 3/1"));
        assert_eq!(far.what, "there is no texture coordinate `2` before this face");
        assert_eq!(fault("vt 0 x").line, Some(1));
    }
}
