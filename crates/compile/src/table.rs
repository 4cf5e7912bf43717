//! Tables from text files: numbers in columns, as spreadsheets write them (CSV).
//!
//! Columns are separated by commas, semicolons or tabs, or else by spaces. A first line that does not consist of numbers
//! contains the names of the columns. Empty lines and lines that begin with `#` are ignored.

use std::path::Path;

use dlsys_expr::MAX_POINTS;
use dlsys_syntax::{Files, fault_of_path};

/// Maximum size of a file, in bytes.
const SIZE_LIMIT: u64 = 64 << 20;

/// A row of a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TableRow {
    /// The line of the file, from 1.
    pub line: usize,
    pub point: [f64; 2],
}

/// An error in a table.
#[derive(Clone, Debug, PartialEq)]
pub struct TableError {
    /// The line with the error, from 1; None if it concerns the whole file.
    pub line: Option<usize>,
    pub what: String,
    pub help: Option<String>,
    /// True if the file has no column with the name in the declaration.
    pub of_column: bool,
}

impl TableError {
    pub fn new(line: Option<usize>, what: impl Into<String>, help: impl Into<String>) -> TableError {
        TableError { line, what: what.into(), help: Some(help.into()), of_column: false }
    }
}

/// Reads the first column of a file, and the second or a named one.
pub fn read(path: &str, column: Option<&str>, files: &dyn Files) -> Result<Vec<TableRow>, TableError> {
    parse(&text_of(path, files)?, column)
}

/// The text of a file of numbers in the folder of the model.
pub fn text_of(path: &str, files: &dyn Files) -> Result<String, TableError> {
    if let Some(why) = fault_of_path(path) {
        return Err(TableError::new(
            None,
            why,
            "files of numbers stand in the folder of the model or below it, as in `\"data/temperature.csv\"`",
        ));
    }
    let bytes = files.read(Path::new(path), SIZE_LIMIT).map_err(|why| {
        TableError::new(
            None,
            why,
            "paths begin at the folder of the model; other folders are searched with `--include-path DIR`",
        )
    })?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

fn parse(text: &str, column: Option<&str>) -> Result<Vec<TableRow>, TableError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut lines = (text.lines().enumerate())
        .map(|(i, line)| (i + 1, line.trim()))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
        .peekable();
    let Some(&(first, head)) = lines.peek() else {
        return Err(TableError::new(None, "the file has no rows", "a row is two numbers, as in `0.5, 12.3`"));
    };
    let separator = [',', ';', '\t'].into_iter().find(|c| head.contains(*c));
    let cells = |line: &'_ str| -> Vec<String> {
        let clean = |cell: &str| cell.trim().trim_matches('"').trim().to_owned();
        match separator {
            Some(separator) => line.split(separator).map(clean).collect(),
            None => line.split_whitespace().map(clean).collect(),
        }
    };
    let names = cells(head);
    let titled = names.iter().all(|name| name.parse::<f64>().is_err());
    let which = match column {
        None => 1,
        Some(wanted) => column_of(wanted, &names, titled, first)?,
    };
    let mut rows = Vec::new();
    for (line, text) in lines.skip(usize::from(titled)) {
        let cells = cells(text);
        let number = |i: usize| -> Result<f64, TableError> {
            let Some(cell) = cells.get(i) else {
                let what = format!("there is no column {}", i + 1);
                return Err(TableError::new(Some(line), what, "every row has the columns of the first one"));
            };
            let value: Option<f64> = cell.parse().ok();
            value.filter(|x| x.is_finite()).ok_or_else(|| {
                let help = if separator == Some(';') && cell.contains(',') {
                    "the decimal sign is a point: `0.5`"
                } else {
                    "a cell is a number such as `12.3` or `1e-3`; leave out rows without one"
                };
                TableError::new(Some(line), format!("expected a number, not `{}`", shown(cell)), help)
            })
        };
        rows.push(TableRow { line, point: [number(0)?, number(which)?] });
        if rows.len() > MAX_POINTS {
            return Err(TableError::new(
                Some(line),
                format!("more than {MAX_POINTS} rows"),
                "leave out every second row",
            ));
        }
    }
    if rows.is_empty() {
        return Err(TableError::new(
            None,
            "the file has no rows of numbers",
            "a row is two numbers, as in `0.5, 12.3`",
        ));
    }
    Ok(rows)
}

/// The index of a column by its name. `titled` is true if the line `first` contains names.
fn column_of(wanted: &str, names: &[String], titled: bool, first: usize) -> Result<usize, TableError> {
    let found = names.iter().position(|name| name == wanted).filter(|_| titled);
    found.ok_or_else(|| {
        let mut fault = if titled {
            let near = dlsys_syntax::suggest::did_you_mean(wanted, names.iter().map(String::as_str));
            let known = || {
                let known: Vec<String> =
                    names.iter().take(12).map(|name| format!("\"{}\"", shown(name))).collect();
                format!("it has {}", known.join(", "))
            };
            let what = format!("the file has no column \"{}\"", shown(wanted));
            TableError::new(None, what, near.unwrap_or_else(known))
        } else {
            TableError::new(
                Some(first),
                "its columns have no names",
                "without `column …` the second column is taken; names stand in the first line",
            )
        };
        fault.of_column = true;
        fault
    })
}

/// The beginning of a cell, for a message.
pub fn shown(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).take(40).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(text: &str, column: Option<&str>) -> Vec<[f64; 2]> {
        parse(text, column).expect("a good table").iter().map(|row| row.point).collect()
    }

    #[test]
    fn tables_are_read_in_the_formats_of_spreadsheets() {
        let wanted = [[0.0, 1.5], [1.0, 2.0]];
        assert_eq!(points("0,1.5\n1,2\n", None), wanted);
        assert_eq!(points("\u{feff}day;mass\r\n0; 1.5\r\n1;2\r\n", None), wanted);
        assert_eq!(points("# measured\n\"day\"\t\"a\"\t\"b\"\n0\t9\t1.5\n\n1\t9\t2\n", Some("b")), wanted);
        assert_eq!(points("  0   1.5\n  1   2", None), wanted);
    }

    #[test]
    fn errors_have_their_place() {
        let fault = |text: &str, column| parse(text, column).expect_err("a bad table");
        assert_eq!(fault("", None).what, "the file has no rows");
        assert_eq!(fault("0,1\n1,x\n", None).line, Some(2));
        assert_eq!(fault("0;1\n1;2,5\n", None).help.as_deref(), Some("the decimal sign is a point: `0.5`"));
        assert_eq!(fault("0\n", None).what, "there is no column 2");
        let unknown = fault("day,mass\n0,1\n", Some("mas"));
        assert_eq!((unknown.of_column, unknown.help.as_deref()), (true, Some("did you mean `mass`?")));
        assert!(fault("0,1\n", Some("mass")).of_column);
    }
}
