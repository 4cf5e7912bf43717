//! The commands: names, usage, and the text of `help`.

use crate::syntax::declarations::{self, Category, DECLARATIONS, Declaration};
use crate::syntax::suggest::did_you_mean;

/// The argument of a command, for completion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Argument {
    Nothing,
    File,
    /// Names of modules.
    Module,
    /// Names of `param`s.
    Parameter,
    /// Modules with their parameters: `F.x`.
    Plot,
    /// Another command.
    Command,
    /// One of a few words.
    Words(&'static [&'static str]),
}

/// A command.
#[derive(Debug)]
pub struct Command {
    pub name: &'static str,
    pub short: &'static [&'static str],
    /// What follows the name, as in `[T | +DT]`.
    pub usage: &'static str,
    pub summary: &'static str,
    /// More, for `help NAME`; then examples, each with what it does.
    pub more: &'static str,
    pub examples: &'static [(&'static str, &'static str)],
    pub argument: Argument,
}

/// All commands, in the order in which `help` lists them; an empty name begins a group.
pub const COMMANDS: &[Command] = &[
    group("The model"),
    Command {
        name: "load",
        short: &[],
        usage: "FILE",
        summary: "read a model; time begins at 0",
        more: "A model that cannot be read changes nothing. What was typed and not saved is lost; `undo` does not bring it back.",
        examples: &[("load models/leaf.dls", "the pinnate leaf of the paper")],
        argument: Argument::File,
    },
    Command {
        name: "reload",
        short: &[],
        usage: "",
        summary: "read the file again, as after a change in an editor; the time stays",
        more: "",
        examples: &[],
        argument: Argument::Nothing,
    },
    Command {
        name: "save",
        short: &[],
        usage: "[FILE]",
        summary: "write the model's text",
        more: "Without a name: to the file that it came from. A file that is there and is not this model's is left alone, unless `--force` follows.",
        examples: &[("save bush.dls", "what was typed, as a file that `dlsys render` takes")],
        argument: Argument::File,
    },
    Command {
        name: "list",
        short: &[],
        usage: "[NAME]",
        summary: "print the model's text, with the line numbers of messages",
        more: "With a name: only declarations and rules that mention it.",
        examples: &[("list", "everything"), ("list F_a", "what is said about F_a")],
        argument: Argument::Module,
    },
    Command {
        name: "set",
        short: &[],
        usage: "[NAME = VALUE]",
        summary: "change a `param`; the model is run again to the present time",
        more: "Without a value the present one is shown, without a name all of them. The text of the model does not change: type `param r = 2` for that.",
        examples: &[("set", "all params, with their ranges"), ("set r = 0.2", "another value")],
        argument: Argument::Parameter,
    },
    Command {
        name: "undo",
        short: &[],
        usage: "",
        summary: "take back the last change of the text",
        more: "",
        examples: &[],
        argument: Argument::Nothing,
    },
    Command {
        name: "new",
        short: &[],
        usage: "",
        summary: "begin an empty model",
        more: "",
        examples: &[],
        argument: Argument::Nothing,
    },
    group("Time"),
    Command {
        name: "run",
        short: &[],
        usage: "[T | +DT]",
        summary: "go to a time, forwards or backwards; without one, to the end of `frames`",
        more: "Ctrl-C stops a long run; the session goes on from where it stopped.",
        examples: &[("run 3.5", "to t = 3.5"), ("run +1", "one unit of time on")],
        argument: Argument::Nothing,
    },
    Command {
        name: "step",
        short: &["s"],
        usage: "[N | frame [N]]",
        summary: "go on to the next event, by a number of events, or by frames",
        more: "All productions of one instant are one event. A frame is a step of the model's `frames`.",
        examples: &[
            ("step", "to the next event"),
            ("step 10", "over ten events"),
            ("step frame", "to the next frame"),
        ],
        argument: Argument::Words(&["frame", "event"]),
    },
    Command {
        name: "back",
        short: &["b"],
        usage: "[N | frame [N] | to T]",
        summary: "go back by events or frames, or to an earlier time",
        more: "Nothing is lost by that: the state at a time is the same, to the last bit, from wherever it is come to.",
        examples: &[
            ("back", "to the event before"),
            ("back frame 5", "five frames back"),
            ("back to 0", "to the start"),
        ],
        argument: Argument::Words(&["frame", "event", "to"]),
    },
    Command {
        name: "time",
        short: &[],
        usage: "[COMMAND …]",
        summary: "where we are in time, and the work so far; or how long a command takes",
        more: "",
        examples: &[
            ("time", "time, counts of work, memory of going back"),
            ("time run 200", "how long that takes"),
        ],
        argument: Argument::Command,
    },
    group("Looking"),
    Command {
        name: "show",
        short: &[],
        usage: "[all | A..B | NAME]",
        summary: "print the string of modules: its beginning, all, a part, or one kind",
        more: "A part and a kind are printed as a table with numbers, ages and lineages. Numbers count modules from 1, brackets left out. A name without `_` stands for all that begin with it, as in a context.",
        examples: &[
            ("show", "the beginning"),
            ("show 10..20", "the tenth to the twentieth module"),
            ("show F", "all F, F_a, F_i …"),
        ],
        argument: Argument::Module,
    },
    Command {
        name: "inspect",
        short: &["i"],
        usage: "N | NAME [N] | LINEAGE",
        summary: "all about one module: parameters, rates, neighbours, next event",
        more: "A module is named by its number in `show`, by its name (the first, or the N-th of that name), or by its lineage: `3.1.2` is the 2nd successor of the 1st successor of the 3rd module of the initial string.",
        examples: &[
            ("inspect 12", "the twelfth module"),
            ("inspect F_a", "the first F_a"),
            ("inspect F_a 3", "the third"),
        ],
        argument: Argument::Module,
    },
    Command {
        name: "events",
        short: &[],
        usage: "[N | all] [NAME]",
        summary: "the last productions up to now, newest last",
        more: "",
        examples: &[
            ("events", "the last twenty"),
            ("events 100 F_a", "the last hundred of F_a"),
            ("events all", "all"),
        ],
        argument: Argument::Module,
    },
    Command {
        name: "plot",
        short: &[],
        usage: "[sum | mean | max | min] NAME.PARAM | count NAME | #N.PARAM  [A..B]",
        summary: "draw a parameter over time; each dot is one module",
        more: "From 0 to now, or, at t = 0, over the model's `frames`, unless A..B is given. `sum` and the like draw one line for all modules of that name; `count` their number; `#N.x` follows the N-th module as long as it lives. The present time stays.",
        examples: &[
            ("plot F_i.x", "the lengths of all internodes"),
            ("plot sum F.x 0..9", "their sum"),
            ("plot count A", "how many there are"),
            ("plot #3.x", "one module"),
        ],
        argument: Argument::Plot,
    },
    Command {
        name: "draw",
        short: &["d"],
        usage: "[front | side | top | AZ,EL] [blocks]",
        summary: "draw the plant here, in dots; with `blocks` in coloured blocks",
        more: "",
        examples: &[
            ("draw", "from the front"),
            ("draw 30,20", "from azimuth 30 and elevation 20 degrees"),
            ("draw blocks", "coarser, with surfaces filled"),
        ],
        argument: Argument::Words(&["front", "side", "top", "blocks"]),
    },
    group("Results"),
    Command {
        name: "export",
        short: &[],
        usage: "FILE.svg|png|obj|json|txt [--view V] [--perspective D] [--width N]",
        summary: "write the plant as it is now: a picture, a mesh, or its string",
        more: "The format follows from the name. A file that this session has not written is left alone, unless `--force` follows.",
        examples: &[
            ("export bush.png --view 30,20", "a picture"),
            ("export bush.json", "the string with every digit"),
        ],
        argument: Argument::File,
    },
    Command {
        name: "render",
        short: &[],
        usage: "-o DIR [flags]",
        summary: "write the frames of an animation, as `dlsys render`, with all its flags",
        more: "It draws the model in hand, saved or not, with the params that are set. `dlsys help render` lists the flags.",
        examples: &[("render -o out --format png", "a picture for each frame")],
        argument: Argument::File,
    },
    Command {
        name: "explain",
        short: &[],
        usage: "[--format text|json]",
        summary: "how much work each equation and each condition is, and why",
        more: "",
        examples: &[],
        argument: Argument::Nothing,
    },
    Command {
        name: "report",
        short: &[],
        usage: "[flags]",
        summary: "speed against error of the methods on this model, as `dlsys report`",
        more: "Without flags: a short one, tolerances 1e-3, 1e-6 and 1e-9. `dlsys help report` lists the flags.",
        examples: &[
            ("report", "a short comparison"),
            ("report --methods dopri5,auto -o out", "two methods, with a plot in out/"),
        ],
        argument: Argument::Nothing,
    },
    group("The session"),
    Command {
        name: "help",
        short: &["h", "?"],
        usage: "[COMMAND]",
        summary: "this list, or more about a command",
        more: "",
        examples: &[("help plot", "how to plot")],
        argument: Argument::Command,
    },
    Command {
        name: "quit",
        short: &["q", "exit"],
        usage: "",
        summary: "end the session (also Ctrl-D)",
        more: "",
        examples: &[],
        argument: Argument::Nothing,
    },
];

const fn group(title: &'static str) -> Command {
    Command {
        name: "",
        short: &[],
        usage: "",
        summary: title,
        more: "",
        examples: &[],
        argument: Argument::Nothing,
    }
}

/// The command of a name, full or short.
pub fn find(name: &str) -> Option<&'static Command> {
    COMMANDS.iter().find(|c| !c.name.is_empty() && (c.name == name || c.short.contains(&name)))
}

/// All full names.
pub fn names() -> impl Iterator<Item = &'static str> {
    COMMANDS.iter().map(|command| command.name).filter(|name| !name.is_empty())
}

/// The text of `help`.
///
/// # Errors
/// If there is no such command.
pub fn help(name: &str) -> Result<String, String> {
    if name.is_empty() {
        return Ok(overview());
    }
    let Some(command) = find(name) else {
        if let Some(Declaration { word, usage, summary, .. }) = Declaration::of_word(name) {
            return Ok(format!("{word} {usage}\n{}", wrapped(summary, 2, 88)));
        }
        let known = names().chain(declarations::words());
        let hint = did_you_mean(name, known).map(|hint| format!("; {hint}")).unwrap_or_default();
        return Err(format!("there is no command `{name}`{hint}; `help` lists them all"));
    };
    let mut text = format!("{} {}\n  {}\n", command.name, command.usage, command.summary);
    if !command.more.is_empty() {
        text += &wrapped(command.more, 2, 78);
    }
    if !command.short.is_empty() {
        text += &format!("  short: {}\n", command.short.join(", "));
    }
    let width = command.examples.iter().map(|(line, _)| line.chars().count()).max().unwrap_or(0);
    for (line, does) in command.examples {
        text += &format!("    {line:width$}   {does}\n");
    }
    Ok(text)
}

fn overview() -> String {
    let mut text = String::from(
        "Type declarations and rules as in a model file; what is typed again replaces what\nwas there. A rule of several lines ends with an empty line. Commands:\n",
    );
    for command in COMMANDS {
        if command.name.is_empty() {
            text += &format!("\n{}\n", command.summary);
            continue;
        }
        let lines = wrapped(command.summary, 11, 80);
        text += &format!("  {:8} {}", command.name, lines.trim_start());
    }
    text += "\nDeclarations, which `help NAME` explains, too:\n";
    for category in Category::ALL {
        let words = DECLARATIONS.iter().filter(|d| d.category == category).map(|d| d.word);
        let line = words.collect::<Vec<_>>().join(", ");
        text += &format!("  {:8} {}", category.title(), wrapped(&line, 11, 80).trim_start());
    }
    text += "\n`help COMMAND` gives usage and examples. Tab completes, the right arrow takes a hint,\nCtrl-R searches the history. `:COMMAND` is always a command, never a rule.\n";
    text
}

/// Wraps and indents a text.
pub fn wrapped(text: &str, indent: usize, columns: usize) -> String {
    let mut out = String::new();
    let mut line = String::new();
    for word in text.split_whitespace() {
        let long = indent + line.chars().count() + 1 + word.chars().count() > columns;
        if long && !line.is_empty() {
            out += &format!("{:indent$}{line}\n", "");
            line.clear();
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line += word;
    }
    if !line.is_empty() {
        out += &format!("{:indent$}{line}\n", "");
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::syntax::words;

    #[test]
    fn no_command_is_a_word_of_the_language() {
        for word in words::declarations().chain(words::CLAUSES) {
            assert!(find(word).is_none(), "{word}");
        }
    }

    #[test]
    fn help_fits_on_a_screen() {
        let long = |text: &str| text.lines().find(|line| line.chars().count() > 92).map(str::to_owned);
        assert_eq!(long(&help("").expect("the list")), None);
        for name in names().chain(declarations::words()) {
            assert_eq!(long(&help(name).expect("help")), None, "{name}");
        }
        assert!(help("plto").unwrap_err().contains("did you mean `plot`"));
    }
}
