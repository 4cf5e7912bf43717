//! Animated SVG, played at the instants of its frames, against the SVG files of these frames.

use std::collections::HashMap;
use std::fs;

use crate::cli::{bad, good};

/// An element without its id: its name, and its attributes in their order.
type Element = (String, Vec<(String, String)>);

/// The attributes of a tag's text, in their order.
fn attributes(text: &str) -> Vec<(String, String)> {
    let parts: Vec<&str> = text.split('"').collect();
    parts
        .chunks_exact(2)
        .map(|pair| (pair[0].trim().trim_end_matches('=').to_owned(), pair[1].to_owned()))
        .collect()
}

/// The lines of the elements, those of groups around them, and gradients by id.
fn lines(document: &str) -> (Vec<&str>, HashMap<String, String>) {
    let mut gradients: HashMap<String, String> = HashMap::new();
    let mut elements = Vec::new();
    let body = document.split_once("stroke-linejoin=\"round\">\n").expect("the group").1;
    for line in body.lines() {
        if let Some(gradient) = line.strip_prefix("<linearGradient id=\"") {
            let (id, rest) = gradient.split_once('"').expect("an id");
            // What it refers to stands before it.
            let known = gradients.iter().find(|(name, _)| rest.contains(&format!("\"#{name}\"")));
            let whole = known.map_or(rest.to_owned(), |(name, text)| rest.replace(&format!("#{name}"), text));
            gradients.insert(id.to_owned(), whole);
        } else if ["<g display", "<g><animate", "</g>", "<path", "<line ", "<circle"]
            .iter()
            .any(|start| line.starts_with(start))
        {
            elements.push(line);
        }
    }
    (elements, gradients)
}

fn element(text: &str, gradients: &HashMap<String, String>) -> Element {
    let inner = text.trim_start_matches('<').trim_end_matches("/>").trim_end_matches('>');
    let (name, rest) = inner.split_once(' ').expect("attributes");
    let mut all = attributes(rest);
    all.retain(|(name, _)| name != "id" && name != "display");
    for (_, value) in &mut all {
        if let Some(id) = value.strip_prefix("url(#").and_then(|rest| rest.strip_suffix(')')) {
            *value = gradients[id].clone();
        }
    }
    (name.to_owned(), all)
}

/// Numbers and the text between them.
fn numbers(value: &str) -> (Vec<f64>, String) {
    let (mut all, mut rest) = (Vec::new(), String::new());
    let value = match value.strip_prefix('#').filter(|digits| digits.len() == 6) {
        Some(digits) => {
            [0, 2, 4].map(|i| i64::from_str_radix(&digits[i..i + 2], 16).expect("hex").to_string()).join(" ")
        }
        None => value.to_owned(),
    };
    let mut number = String::new();
    for c in value.chars().chain([' ']) {
        // A second point begins another number.
        let goes_on = c.is_ascii_digit() || c == '.' && !number.contains('.');
        if !(number.is_empty() || goes_on) {
            // As in `stop-color`.
            match number.as_str() {
                "-" => rest.push('-'),
                digits => all.push(digits.parse().expect("a number")),
            }
            number.clear();
        }
        match c {
            '-' | '.' | '0'..='9' => number.push(c),
            ' ' => {}
            c => rest.push(c),
        }
    }
    (all, rest)
}

/// What an animated document shows at a part of its whole time.
fn played(document: &str, moment: f64) -> Vec<Element> {
    let (lines, gradients) = lines(document);
    let mut shown = Vec::new();
    let mut around = true;
    for line in lines {
        if line == "</g>" {
            around = true;
            continue;
        }
        let (own, animations) = line.split_once('>').expect("a tag");
        let is_group = own.starts_with("<g");
        let (name, mut all) = if is_group { Default::default() } else { element(own, &gradients) };
        let mut is_shown = !own.contains("display=\"none\"");
        for animation in animations.split("<animate ").skip(1) {
            let parts: HashMap<String, String> = attributes(animation).into_iter().collect();
            let values: Vec<&str> = parts["values"].split(';').collect();
            let moments: Vec<f64> =
                parts["keyTimes"].split(';').map(|x| x.parse().expect("a number")).collect();
            assert!(values.len() == moments.len() && moments.is_sorted() && moments[0] == 0.0, "{animation}");
            // Moments have six decimals.
            let at = moments.iter().rposition(|known| *known <= moment + 1e-6).expect("from 0 on");
            let name = &parts["attributeName"];
            if name == "display" {
                is_shown = values[at] == "inline";
                continue;
            }
            assert_eq!(moments[moments.len() - 1], 1.0, "lines have an end");
            let next = (at + 1).min(values.len() - 1);
            let part = if next > at {
                ((moment - moments[at]) / (moments[next] - moments[at])).max(0.0)
            } else {
                0.0
            };
            let ((a, text), (b, _)) = (numbers(values[at]), numbers(values[next]));
            let between: Vec<String> =
                a.iter().zip(&b).map(|(a, b)| (a + part * (b - a)).to_string()).collect();
            let value = &mut all.iter_mut().find(|(known, _)| known == name).expect("what moves is there").1;
            *value = format!("{} {text}", between.join(" "));
        }
        if is_group {
            around = is_shown;
        } else if is_shown && around {
            shown.push((name, all));
        }
    }
    shown
}

#[test]
fn an_animated_svg_shows_each_frame() {
    // A string that is rewritten, growing cells with colours, and shaded leaves.
    for (model, range, count) in
        [("dragon", ["1", "4", "0.25"], 13), ("anabaena", ["0", "60", "5"], 13), ("leaf", ["1", "5", "1"], 5)]
    {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name).to_str().expect("UTF-8").to_owned();
        let model = format!("models/{model}.dls");
        let [from, to, step] = range;
        let render = |format: &str, out: &str| {
            good(&[
                "render", &model, "--from", from, "--to", to, "--step", step, "--format", format, "-o", out,
                "--size", "400x400",
            ])
        };
        render("svg", &at("frames"));
        let said = render("asvg", &at("a.svg"));
        assert!(said.contains(&format!("{count} frames")), "{said}");
        let film = fs::read_to_string(at("a.svg")).expect("a file");
        let (root, _) = film.split_once("\n").expect("a line");
        let root: HashMap<String, String> = attributes(root).into_iter().collect();
        let length = |name: &str| numbers(&root[name]).0;
        // Scene units in a pixel.
        let pixel = length("viewBox")[2] / length("width")[0];
        for frame in 0..count {
            let file = fs::read_to_string(folder.path().join(format!("frames/frame-{frame:04}.svg")))
                .expect("a file");
            let (mut wanted, gradients) = lines(&file);
            wanted.retain(|line| *line != "</g>");
            let shown = played(&film, f64::from(frame) / f64::from(count));
            assert_eq!(shown.len(), wanted.len(), "{model}, frame {frame}");
            for (shown, wanted) in shown.iter().zip(wanted) {
                let wanted = element(wanted, &gradients);
                assert_eq!((&shown.0, shown.1.len()), (&wanted.0, wanted.1.len()), "{model}, frame {frame}");
                for ((name, a), (other, b)) in shown.1.iter().zip(&wanted.1) {
                    let ((a, text), (b, words)) = (numbers(a), numbers(b));
                    assert_eq!(
                        (name, text.trim(), a.len()),
                        (other, words.trim(), b.len()),
                        "{model}, frame {frame}"
                    );
                    // A colour may be off by a step and a half, a place by a twentieth of a pixel.
                    let slack = if name == "fill" || name == "stroke" { 2.0 } else { 0.06 * pixel };
                    assert!(
                        a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= slack),
                        "{model}, frame {frame}: {a:?}, not {b:?}"
                    );
                }
            }
        }
    }
}

fn render<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&["render", "models/dragon.dls", "--format", "asvg"][..], more].concat()
}

#[test]
fn an_animated_svg_has_one_camera_and_no_pixels() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name).to_str().expect("UTF-8").to_owned();
    let (status, said) = bad(&render(&["-o", &at("a.svg"), "--shutter", "0.5"]));
    assert!(status == 2 && said.contains("averages pixels"), "{said}");
    let (status, said) = bad(&render(&["-o", &at("a.png")]));
    assert!(status == 2 && said.contains("a.svg"), "{said}");
    fs::write(at("mine.svg"), "<svg xmlns=\"http://www.w3.org/2000/svg\"/>").expect("written");
    let (status, said) = bad(&render(&["-o", &at("mine.svg")]));
    assert!(status == 2 && said.contains("is not an animated SVG file"), "{said}");
    let text = "initial string: F(1)\ncamera at 3 + t, 0, 9 towards 0, 0, 0 angle 30\nframes 0 .. 2 step 1\n";
    fs::write(at("turning.dls"), text).expect("written");
    let (status, said) = bad(&["render", &at("turning.dls"), "--format", "asvg", "-o", &at("b.svg")]);
    assert!(status == 1 && said.contains("another camera"), "{said}");
}
