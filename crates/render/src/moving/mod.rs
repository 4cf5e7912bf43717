//! Frames of SVG as one document that plays by itself in browsers (SMIL animation).
//!
//! What a module draws is one element over the frames in which it has the same form (the same attributes and commands of its path);
//! its numbers and colours move on lines between frames, and only those frames are kept that lie off these lines by more than a
//! twentieth of a pixel. From its last frame on a thing goes on as it moved, to the beginning of the next frame, as in the page of
//! `dlsys view`. What has another form in each frame, such as the shaded regions of leaves, is shown frame by frame. Elements keep the
//! order of drawing of each frame. Programs that do not know SMIL show the last frame.

mod element;
mod frame;
mod order;

use std::collections::HashMap;

use element::{Element, Timing};
use frame::{Frame, Item};

use crate::Error;

/// How files begin, by which they are told from those of others.
const MARK: &str = "<svg data-dlsys=\"animation\" ";
/// Most elements and numbers of a document: half a gigabyte.
const MOST_ELEMENTS: usize = 1_000_000;
const MOST_NUMBERS: usize = 50_000_000;

/// A document that is being made.
#[derive(Debug)]
pub struct Moving {
    /// When each frame ends, in seconds.
    ends: Vec<f64>,
    /// What stands before the elements, but for the title.
    head: Option<String>,
    /// Gradients by what they are, and their lines.
    gradients: HashMap<String, usize>,
    definitions: String,
    elements: Vec<Element>,
    /// All elements from back to front, by number.
    order: Vec<usize>,
    /// Those of the frame before, by key.
    open: HashMap<String, usize>,
    frames: usize,
    numbers: usize,
}

impl Moving {
    /// A document without frames. `ends`: when each frame ends, in seconds; ascending, from more than 0.
    pub fn new(ends: Vec<f64>) -> Moving {
        Moving {
            ends,
            head: None,
            gradients: HashMap::new(),
            definitions: String::new(),
            elements: Vec::new(),
            order: Vec::new(),
            open: HashMap::new(),
            frames: 0,
            numbers: 0,
        }
    }

    /// Whether a file that begins like this is such a document.
    pub fn begins(start: &[u8]) -> bool {
        start.starts_with(MARK.as_bytes())
    }

    /// Adds the SVG document of the next frame, as [`FrameWriter::write`](crate::FrameWriter::write) makes it.
    ///
    /// # Errors
    /// If the camera or the sky is another one than in the first frame, or the document becomes too large.
    ///
    /// # Panics
    /// If there are more frames than ends.
    pub fn add(&mut self, document: &str) -> Result<(), Error> {
        assert!(self.frames < self.ends.len(), "more frames than ends");
        let Frame { head, items } = Frame::read(document, |line| self.gradient(line));
        match &self.head {
            None => self.head = Some(head),
            Some(known) if *known == head => {}
            Some(_) => return Err(Error::AnotherView { frame: self.frames }),
        }
        let mut ranks = vec![0; self.elements.len()];
        self.order.iter().enumerate().for_each(|(rank, element)| ranks[*element] = rank);
        let known: Vec<Option<usize>> = (items.iter())
            .map(|item| {
                self.open.get(&item.key).copied().filter(|number| self.elements[*number].goes_on(item))
            })
            .collect();
        // What has changed places begins anew.
        let kept = order::ascending(known.iter().map(|known| known.map(|number| ranks[number])));
        let mut fresh: Vec<(Option<usize>, usize)> = Vec::new();
        let mut place = None;
        self.open.clear();
        for ((item, known), is_kept) in items.into_iter().zip(known).zip(kept) {
            let Item { key, .. } = &item;
            self.numbers += item.numbers();
            let number = match known.filter(|_| is_kept) {
                Some(number) => {
                    place = Some(ranks[number]);
                    self.elements[number].extend(&item);
                    number
                }
                None => {
                    self.elements.push(Element::new(self.frames, &item));
                    fresh.push((place, self.elements.len() - 1));
                    self.elements.len() - 1
                }
            };
            self.open.insert(key.clone(), number);
        }
        self.order = order::inserted(&self.order, &fresh);
        self.frames += 1;
        if self.elements.len() > MOST_ELEMENTS || self.numbers > MOST_NUMBERS {
            return Err(Error::AnimationTooLong { frame: self.frames - 1 });
        }
        Ok(())
    }

    /// The number of a gradient: those that are alike are one.
    fn gradient(&mut self, line: &str) -> usize {
        if let Some(&number) = self.gradients.get(line) {
            return number;
        }
        let number = self.gradients.len();
        self.gradients.insert(line.to_owned(), number);
        let rest = line.strip_prefix("<linearGradient").unwrap_or(line);
        self.definitions += &format!("<linearGradient id=\"g{number}\"{rest}\n");
        number
    }

    /// The document.
    pub fn finish(self, title: &str) -> String {
        let head = self.head.unwrap_or_default();
        let mut out = head.replacen("<svg ", MARK, 1);
        if self.definitions.contains("xlink:href") {
            out = out.replacen('>', &format!("{}>", frame::XLINK), 1);
        }
        let title: String = title.chars().filter(|c| !c.is_control()).collect();
        let title = title.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
        // After the line of the document itself.
        let place = out.find('\n').map_or(out.len(), |end| end + 1);
        out.insert_str(place, &format!("<title>{title}</title>\n"));
        out += frame::GROUP;
        out.push('\n');
        if !self.definitions.is_empty() {
            out += &format!("<defs>\n{}</defs>\n", self.definitions);
        }
        let timing = Timing::new(&self.ends[..self.frames], frame::unit(&head));
        let mut ids = HashMap::new();
        let elements: Vec<&Element> = self.order.iter().map(|number| &self.elements[*number]).collect();
        for together in elements.chunk_by(|a, b| a.span() == b.span()) {
            Element::write(together, &timing, &mut ids, &mut out);
        }
        out += "</g>\n</svg>\n";
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn document(elements: &str) -> String {
        format!(
            "<svg height=\"100\" viewBox=\"0 0 10 10\" width=\"100\" xmlns=\"http://www.w3.org/2000/svg\">\n<title>x</title>\n{}\n{elements}</g>\n</svg>\n",
            frame::GROUP
        )
    }

    fn moving(frames: &[&str]) -> String {
        let mut moving = Moving::new((1..=frames.len()).map(|i| i as f64).collect());
        frames.iter().for_each(|frame| moving.add(&document(frame)).expect("one view"));
        moving.finish("a & b")
    }

    #[test]
    fn what_moves_evenly_has_two_values_and_what_stands_still_none() {
        let lines = [0.0, 1.0, 2.0, 3.0].map(|x| {
            format!("<line id=\"a\" stroke=\"#000000\" x1=\"{x}\" y1=\"0\" x2=\"1\" y2=\"2\"/>\n<path id=\"b\" d=\"M0 0L1 1\"/>\n")
        });
        let text = moving(&lines.each_ref().map(String::as_str));
        assert!(text.starts_with(MARK) && text.contains("<title>a &amp; b</title>"), "{text}");
        // The last frame stands still while it lasts.
        assert!(
            text.contains("attributeName=\"x1\" values=\"0;3;3\" keyTimes=\"0;0.75;1\" dur=\"4s\""),
            "{text}"
        );
        assert!(
            text.contains("<path id=\"b\" d=\"M0 0L1 1\"/>") && text.matches("<animate").count() == 1,
            "{text}"
        );
    }

    #[test]
    fn what_comes_and_goes_is_shown_for_its_frames_in_its_place() {
        let [a, b, c] = ["a", "b", "c"].map(|id| format!("<path id=\"{id}\" d=\"M0 0L1 1\"/>\n"));
        let text = moving(&[&format!("{a}{c}"), &format!("{a}{b}{c}"), &format!("{a}{c}")]);
        let place = |what: &str| text.find(what).unwrap_or_else(|| panic!("{what} in {text}"));
        assert!(place("id=\"a\"") < place("id=\"b\"") && place("id=\"b\"") < place("id=\"c\""));
        assert!(text.contains("id=\"b\" d=\"M0 0L1 1\" display=\"none\"><animate attributeName=\"display\" calcMode=\"discrete\" values=\"none;inline;none\" keyTimes=\"0;0.333333;0.666667\""), "{text}");
    }

    #[test]
    fn what_changes_places_or_form_begins_anew() {
        let [a, b] = ["a", "b"].map(|id| format!("<path id=\"{id}\" d=\"M0 0L1 1\"/>\n"));
        let text = moving(&[&format!("{a}{b}"), &format!("{b}{a}")]);
        assert_eq!(text.matches("<path").count(), 3, "{text}");
        let text = moving(&[&a, "<path id=\"a\" d=\"M0 0L1 1L2 2\"/>\n"]);
        assert!(text.contains("id=\"a\"") && text.contains("id=\"a-2\""), "{text}");
    }

    #[test]
    fn gradients_that_are_alike_are_one() {
        let frame = |name: &str, x: f64| {
            format!(
                "<defs>\n<linearGradient id=\"s\"><stop offset=\"0\" stop-color=\"#000000\"/></linearGradient>\n<linearGradient id=\"{name}\" xlink:href=\"#s\" x1=\"{x}\"/>\n</defs>\n<path fill=\"url(#{name})\" d=\"M0 0\"/>\n"
            )
        };
        let text = moving(&[&frame("g1", 0.0), &frame("g2", 0.0), &frame("g1", 1.0)]);
        assert_eq!(text.matches("<linearGradient").count(), 3, "{text}");
        assert_eq!(text.matches("<path").count(), 2, "{text}");
    }

    #[test]
    fn another_camera_is_an_error() {
        let mut moving = Moving::new(vec![1.0, 2.0]);
        moving.add(&document("")).expect("the first");
        let other = document("").replace("0 0 10 10", "1 0 10 10");
        assert!(matches!(moving.add(&other), Err(Error::AnotherView { frame: 1 })));
    }
}
