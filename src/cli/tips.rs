//! Tips for command lines that are not understood, where what was meant is clear and is not the word with the most letters in common.

use clap::Error;
use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue, ErrorKind};

/// Flags of other programs, and what stands in their place.
const FLAGS: [(&str, &str); 8] = [
    ("--height", SIZE),
    ("--resolution", SIZE),
    ("--frames", TIMES),
    ("--time", TIMES),
    ("--output", "the folder or the file is named by `-o`, `--out`"),
    ("--sun", "the direction towards the sun is `--light 1,2,1`"),
    ("--elevation", VIEW),
    ("--azimuth", VIEW),
];

const SIZE: &str =
    "the size of pictures in pixels is `--size 500x300`, or `--width 500` with a height that fits";
const TIMES: &str = "times are `--at T`, `--at T1,T2,…`, or `--from A --to B --step S`";
const VIEW: &str = "the direction of view is `--view AZIMUTH,ELEVATION` in degrees, such as `--view 30,20`";

/// The same error, with a tip of its own if there is one.
pub fn improved(mut error: Error) -> Error {
    let word = |kind| match error.get(kind) {
        Some(ContextValue::String(word)) => word.clone(),
        _ => String::new(),
    };
    let tip = match error.kind() {
        ErrorKind::UnknownArgument => {
            let flag = word(ContextKind::InvalidArg);
            FLAGS.iter().find(|(known, _)| *known == flag).map(|(_, tip)| (*tip).to_owned())
        }
        ErrorKind::InvalidSubcommand => {
            let file = word(ContextKind::InvalidSubcommand);
            file.strip_suffix(".dls").map(|name| {
                format!("a command stands before the model: `dlsys render {file} -o {name}` draws it, `dlsys view {file}` shows it growing")
            })
        }
        _ => None,
    };
    if let Some(tip) = tip {
        let _ = error.remove(ContextKind::SuggestedArg);
        let _ = error.remove(ContextKind::SuggestedSubcommand);
        let _ = error.remove(ContextKind::Usage);
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![StyledStr::from(tip)]));
    }
    error
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::args::Command;
    use clap::Parser;

    #[test]
    fn what_was_meant_is_said() {
        let said =
            |line: &[&str]| improved(Command::try_parse_from(line).expect_err("no such thing")).to_string();
        let height = said(&["dlsys", "render", "a.dls", "-o", "x", "--height", "300"]);
        assert!(height.contains("`--size 500x300`") && !height.contains("row-height"), "{height}");
        let bare = said(&["dlsys", "bush.dls"]);
        assert!(bare.contains("`dlsys render bush.dls -o bush`"), "{bare}");
        // Others keep the tip that they have.
        let other = said(&["dlsys", "render", "a.dls", "-o", "x", "--widht", "300"]);
        assert!(other.contains("'--width'"), "{other}");
    }
}
