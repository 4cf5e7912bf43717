//! Functions of cpfg and lpfg: files of control points (`.func`), and sets of such functions (`.fset`).
//!
//! A function is a B-spline curve in the plane, the cubic with uniform knots that begins on the first control point and
//! ends on the last; y is a function of x because the x of the control points do not decrease (function editor of the
//! Virtual Laboratory, algorithmicbotany.org). A file has a line `points: N` and then N lines of x and y. In a set, each
//! function has a line `name: …` before that. Other lines (`range`, `samples`, `flip`, `fver`) concern the editor of
//! the function and tables of its values, not the curve.

use dlsys_expr::MAX_POINTS;
use dlsys_syntax::Files;
use dlsys_syntax::suggest::did_you_mean;

use crate::table::{TableError, TableRow, shown, text_of};

const FORM: &str = "a function file has a line such as `points: 4`, and that many lines of x and y";

/// A function of a file.
#[derive(Debug, Default)]
struct Function {
    name: Option<String>,
    points: Vec<TableRow>,
}

/// The control points of a function: of the only one of a file, of that called `item`, or of that called `curve`.
pub fn read(
    path: &str,
    curve: &str,
    item: Option<&str>,
    files: &dyn Files,
) -> Result<Vec<TableRow>, TableError> {
    choose(parse(&text_of(path, files)?)?, curve, item)
}

fn choose(mut all: Vec<Function>, curve: &str, item: Option<&str>) -> Result<Vec<TableRow>, TableError> {
    let wanted = item.unwrap_or(curve);
    if let Some(found) = all.iter().position(|f| f.name.as_deref() == Some(wanted)) {
        return Ok(all.swap_remove(found).points);
    }
    if item.is_none() && all.len() == 1 {
        return Ok(all.swap_remove(0).points);
    }
    let names: Vec<&str> = all.iter().filter_map(|f| f.name.as_deref()).collect();
    let known = || {
        let known: Vec<String> = names.iter().take(12).map(|name| format!("\"{}\"", shown(name))).collect();
        match (known.is_empty(), item) {
            (true, _) => "its functions have no names: leave `item` out".to_owned(),
            (false, Some(_)) => format!("it has {}", known.join(", ")),
            (false, None) => {
                format!("name one behind the file, as in `item {}`; it has {}", known[0], known.join(", "))
            }
        }
    };
    let help = item.and_then(|item| did_you_mean(item, names.iter().copied())).unwrap_or_else(known);
    let what = format!("the file has no function \"{}\"", shown(wanted));
    Err(TableError { line: None, what, help: Some(help), of_column: item.is_some() })
}

fn parse(text: &str) -> Result<Vec<Function>, TableError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut lines =
        (text.lines().enumerate()).map(|(i, line)| (i + 1, line.trim())).filter(|(_, line)| !line.is_empty());
    let mut all: Vec<Function> = Vec::new();
    let mut name = None;
    while let Some((line, text)) = lines.next() {
        let error = |what: String, help: &str| TableError::new(Some(line), what, help);
        match text.split_once(':').map(|(key, value)| (key.trim(), value.trim())) {
            Some(("name", value)) => name = Some(value.to_owned()),
            Some(("points", value)) => {
                let count: Option<usize> = value.split_whitespace().next().and_then(|n| n.parse().ok());
                let Some(count) = count.filter(|n| *n <= MAX_POINTS) else {
                    let what = format!("expected a number of points, not `{}`", shown(value));
                    return Err(error(what, FORM));
                };
                let points = lines.by_ref().take(count).map(point).collect::<Result<Vec<_>, _>>()?;
                if points.len() < count {
                    let what = format!("{count} points are announced, and {} follow", points.len());
                    return Err(error(what, FORM));
                }
                all.push(Function { name: name.take(), points });
            }
            // Lines such as `samples: 100`, and of sets `funcgalleryver 1 1` and `fver 1 1`.
            Some(_) => {}
            None if text.starts_with("funcgalleryver") || text.starts_with("fver") => {}
            None if text.starts_with("timeEdit") => {
                let help = "save its functions in files of their own, and read each with `curve NAME from \"FILE.func\"`";
                return Err(error("a set of functions on time lines is not supported".to_owned(), help));
            }
            None => {
                let what = format!("expected `points: N`, not `{}`", shown(text));
                return Err(error(what, FORM));
            }
        }
    }
    if all.is_empty() {
        return Err(TableError::new(None, "the file has no `points: N`", FORM));
    }
    Ok(all)
}

fn point((line, text): (usize, &str)) -> Result<TableRow, TableError> {
    let numbers: Option<Vec<f64>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x, y]) if x.is_finite() && y.is_finite() => Ok(TableRow { line, point: [x, y] }),
        _ => Err(TableError::new(
            Some(line),
            format!("expected two numbers, not `{}`", shown(text)),
            "a control point is a line of x and y, as in `0.25 0.1`",
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SET: &str = "funcgalleryver 1 1\nitems: 2\nfver 1 1\nname: stem\nsamples: 100\nflip: off\npoints: 4\n\
        0 0\n0.4 0.0\n0.4 1.\n1 1.\nfver 1 1\nname: leaf\nsamples: 5\nflip: off\npoints: 4\n\
        0.000000 0.577929\n0.3 0.1\n0.6 0.9\n1 2e-1\n";

    fn of(text: &str, curve: &str, item: Option<&str>) -> Result<Vec<[f64; 2]>, TableError> {
        Ok(choose(parse(text)?, curve, item)?.iter().map(|row| row.point).collect())
    }

    #[test]
    fn a_file_has_one_function_and_a_set_several() {
        let single = "range: 0.0 1.0\r\npoints: 4\r\n0.0 0.0\r\n0.3 0.1\r\n0.6 0.9\r\n1.0 0.3\r\n";
        assert_eq!(of(single, "g", None), Ok(vec![[0.0, 0.0], [0.3, 0.1], [0.6, 0.9], [1.0, 0.3]]));
        assert_eq!(of(SET, "stem", None).map(|p| p[2]), Ok([0.4, 1.0]));
        assert_eq!(of(SET, "g", Some("leaf")).map(|p| p[3]), Ok([1.0, 0.2]));
    }

    #[test]
    fn errors_have_their_line() {
        let fault = |text: &str, item| of(text, "g", item).expect_err("a bad file");
        assert_eq!(fault("points: 4\n0 0\n1 x\n", None).line, Some(3));
        assert_eq!(fault("points: 4\n0 0\n1 1\n", None).what, "4 points are announced, and 2 follow");
        assert_eq!(fault("0 0\n1 1\n", None).line, Some(1));
        let unknown = fault(SET, Some("laef"));
        assert_eq!((unknown.of_column, unknown.help.as_deref()), (true, Some("did you mean `leaf`?")));
        assert!(fault(SET, None).help.is_some_and(|help| help.contains("`item \"stem\"`")));
        assert!(fault("timeEdit 1 2\n", None).what.contains("time lines"));
    }
}
