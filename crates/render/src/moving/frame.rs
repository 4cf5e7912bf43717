//! A frame, read from the document that our own SVG writer has made of it: one element a line.

use super::element::Attribute;

/// The group around all elements.
pub(super) const GROUP: &str = "<g stroke-linecap=\"round\" stroke-linejoin=\"round\">";

/// What a document with references has beside its own name space.
pub(super) const XLINK: &str = " xmlns:xlink=\"http://www.w3.org/1999/xlink\"";

/// What a frame shows.
pub(super) struct Frame {
    /// Everything before the elements, but for the title.
    pub(super) head: String,
    /// From back to front.
    pub(super) items: Vec<Item>,
}

/// An element of a frame.
pub(super) struct Item {
    /// Follows it from frame to frame.
    pub(super) key: String,
    /// The id of its own, if it has one.
    pub(super) id: Option<String>,
    pub(super) tag: String,
    pub(super) attributes: Vec<Attribute>,
    /// Lines that are not read further.
    pub(super) text: Option<String>,
}

impl Item {
    pub(super) fn numbers(&self) -> usize {
        self.attributes.iter().map(|attribute| attribute.numbers.len()).sum()
    }
}

impl Frame {
    /// Reads a document; `gradient` numbers gradients, by their lines without ids.
    pub(super) fn read(document: &str, mut gradient: impl FnMut(&str) -> usize) -> Frame {
        let (before, elements) = document.split_once(GROUP).unwrap_or((document, ""));
        let head: String = before
            .lines()
            .filter(|line| !line.starts_with("<title>"))
            .flat_map(|line| [line, "\n"])
            .collect();
        let head = head.replacen(XLINK, "", 1);
        let elements = elements.trim_start().trim_end().trim_end_matches("</svg>").trim_end();
        let elements = elements.strip_suffix("</g>").unwrap_or(elements);
        let mut names: Vec<(String, String)> = Vec::new();
        let mut items: Vec<Item> = Vec::new();
        let mut group: Option<(String, usize)> = None;
        for line in elements.lines() {
            if line.starts_with("<linearGradient") {
                let (name, rest) = without_id(&renamed(line, &names));
                let number = gradient(&rest);
                names.push((name.unwrap_or_default(), format!("g{number}")));
                continue;
            }
            match line {
                "" | "<defs>" | "</defs>" => continue,
                "</g>" => {
                    group = None;
                    continue;
                }
                _ => {}
            }
            let line = renamed(line, &names);
            if line.starts_with("<g ") && !line.ends_with("/>") && !line.ends_with("</g>") {
                let (name, _) = without_id(&line);
                group = Some((name.unwrap_or_default(), 0));
                continue;
            }
            let (id, rest) = without_id(&line);
            let key = match (&id, &mut group) {
                (Some(id), _) => id.clone(),
                (None, Some((name, count))) => {
                    *count += 1;
                    format!("{name} {count}")
                }
                (None, None) => format!(" {}", items.len()),
            };
            items.push(match element_of(&rest) {
                Some((tag, attributes)) => Item { key, id, tag, attributes, text: None },
                None => Item { key, id: None, tag: String::new(), attributes: Vec::new(), text: Some(line) },
            });
        }
        Frame { head, items }
    }
}

/// Scene units in a pixel, by the first line of a document.
pub(super) fn unit(head: &str) -> f64 {
    let value = |name: &str| {
        let (_, rest) = head.split_once(&format!(" {name}=\""))?;
        rest.split_once('"').map(|(value, _)| value)
    };
    let width = value("viewBox").and_then(|view| view.split(' ').nth(2)?.parse::<f64>().ok());
    let pixels = value("width").and_then(|width| width.parse::<f64>().ok());
    match (width, pixels) {
        (Some(width), Some(pixels)) if pixels > 0.0 => width / pixels,
        _ => 1.0,
    }
}

/// A line with gradients under their new names.
fn renamed(line: &str, names: &[(String, String)]) -> String {
    let mut out = String::with_capacity(line.len());
    let mut rest = line;
    while let Some(at) =
        ["url(#", "xlink:href=\"#"].iter().filter_map(|mark| Some(rest.find(mark)? + mark.len())).min()
    {
        let (before, after) = rest.split_at(at);
        let end = after.find([')', '"']).unwrap_or(after.len());
        out += before;
        out += names.iter().rev().find(|(old, _)| *old == after[..end]).map_or(&after[..end], |(_, new)| new);
        rest = &after[end..];
    }
    out + rest
}

/// The id of an element, and its line without that.
fn without_id(line: &str) -> (Option<String>, String) {
    let Some((before, rest)) = line.split_once(" id=\"") else { return (None, line.to_owned()) };
    let Some((id, after)) = rest.split_once('"') else { return (None, line.to_owned()) };
    (Some(id.to_owned()), format!("{before}{after}"))
}

/// The name and the attributes of an element without content; `None` if it has some.
fn element_of(line: &str) -> Option<(String, Vec<Attribute>)> {
    let inner = line.strip_prefix('<')?.strip_suffix("/>")?;
    let (tag, mut rest) = inner.split_once(' ').unwrap_or((inner, ""));
    let mut attributes = Vec::new();
    while let Some((name, after)) = rest.split_once("=\"") {
        let (value, after) = after.split_once('"')?;
        attributes.push(Attribute::read(name.trim(), value));
        rest = after;
    }
    (!tag.contains(['<', '>']) && rest.trim().is_empty()).then(|| (tag.to_owned(), attributes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_document_is_read_line_by_line() {
        let document = format!(
            "<svg height=\"100\" viewBox=\"-5 -5 20 10\" width=\"200\">\n<title>a</title>\n<rect fill=\"#ffffff\"/>\n{GROUP}\n<defs>\n<linearGradient id=\"s1\"></linearGradient>\n<linearGradient id=\"g1\" xlink:href=\"#s1\"/>\n</defs>\n<g id=\"A-1\">\n<path fill=\"url(#g1)\" d=\"M0 0\"/>\n<path d=\"M1 1\"/>\n</g>\n<line id=\"B-2\" x1=\"0\"/>\n</g>\n</svg>\n"
        );
        let mut gradients = Vec::new();
        let frame = Frame::read(&document, |line| {
            gradients.push(line.to_owned());
            gradients.len() + 10
        });
        assert_eq!(gradients, ["<linearGradient></linearGradient>", "<linearGradient xlink:href=\"#g11\"/>"]);
        let keys: Vec<&str> = frame.items.iter().map(|item| &*item.key).collect();
        assert_eq!(keys, ["A-1 1", "A-1 2", "B-2"]);
        assert_eq!(frame.items[2].id.as_deref(), Some("B-2"));
        assert_eq!(unit(&frame.head), 0.1);
        assert!(!frame.head.contains("title") && frame.head.contains("<rect"));
    }
}
