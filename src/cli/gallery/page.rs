//! The page that shows the whole gallery.

use std::fmt::Write;

use super::figures::Picture;

/// The mark by which such a page is recognised.
pub const MARK: &str = "<title>dlsys gallery</title>";

/// The text of `index.html`: the pictures, with their files, in the given order.
pub fn page(drawn: &[(&Picture, String)]) -> String {
    let mut out = format!("<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n{MARK}\n<style>\n");
    out.push_str(
        "\
         body { font: 15px/1.5 sans-serif; margin: 2em auto; max-width: 75em; padding: 0 1em; background: #fbfaf5; }\n\
         figure { margin: 0 0 3em; }\n\
         img { display: block; max-width: 100%; max-height: 45em; }\n\
         code { font-size: 13px; color: #555; }\n</style>\n\
         <h1>Animation of Plant Development</h1>\n\
         <p>The figures of the paper that show development, each from its model.</p>\n",
    );
    for (picture, file) in drawn {
        let Picture { figure, name, model, caption, .. } = picture;
        // Writing to a string does not fail.
        let _ = write!(
            out,
            "<figure>\n<a href=\"{name}/{file}\"><img src=\"{name}/{file}\" alt=\"{alt}\"></a>\n\
             <figcaption><b>Figure {figure}.</b> {alt}. <a href=\"{model}\">Model</a><br><code>{line}</code></figcaption>\n\
             </figure>\n",
            alt = escaped(caption),
            line = escaped(&picture.line()),
        );
    }
    out + "</html>\n"
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
