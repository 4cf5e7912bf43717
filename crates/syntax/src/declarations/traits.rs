//! The properties of declarations: category, name, repetition, body, and the words that they contain.

/// The subject of a declaration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Category {
    /// The text itself.
    Text,
    /// Numbers and functions.
    Values,
    /// Times at which something happens.
    Time,
    /// The appearance of modules.
    Looks,
    /// The surroundings of a plant.
    Scene,
    /// Strings of modules.
    Modules,
}

impl Category {
    /// All categories, in the order in which help lists them.
    pub const ALL: [Category; 6] = [
        Category::Text,
        Category::Values,
        Category::Time,
        Category::Looks,
        Category::Scene,
        Category::Modules,
    ];

    /// A heading for its declarations.
    pub fn title(self) -> &'static str {
        match self {
            Category::Text => "text",
            Category::Values => "values",
            Category::Time => "time",
            Category::Looks => "looks",
            Category::Scene => "scene",
            Category::Modules => "modules",
        }
    }
}

/// The position of the name that a declaration introduces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Named {
    /// It introduces no name.
    No,
    /// A word: `const k = …`.
    Word,
    /// A word, optionally after one of the options: `curve linear g = …`.
    AfterOption,
    /// The name of a function: `def f(x) = …`.
    Function,
    /// A name with its mark: `surface @P from …`.
    Surface,
}

impl Named {
    /// True if the name is a word of letters, digits and `_`.
    pub fn is_word(self) -> bool {
        matches!(self, Named::Word | Named::AfterOption | Named::Function)
    }
}

/// The rule by which a declaration replaces another in the interactive session. In one text, two such declarations are an
/// error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Repeats {
    /// One for each text.
    Once,
    /// One for each name. Declarations with the same word here share their names.
    PerName(&'static str),
    /// One for each head of a module.
    PerHead,
    /// One for each file.
    PerFile,
    /// Any number.
    Freely,
}

/// The syntax behind the head of a declaration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Body {
    /// Expressions and texts; a line break ends it.
    Line,
    /// Names of modules.
    Names,
    /// A `:` and a string of modules, in which line breaks have no meaning.
    String,
    /// The head of a module, a `:` and a string of modules.
    Drawing,
}

/// The condition under which the word of a declaration begins one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Begins {
    /// Wherever a declaration may begin: no module has this name.
    Always,
    /// Where a word or a text follows, unless a `:` makes the line the head of a rule. For words added after models had begun
    /// to use them as names of modules.
    BeforeName,
    /// As `BeforeName`, and also where a number, a negative number or the mark of a name follows.
    BeforeValue,
}

/// A keyword inside a declaration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OptionWord {
    /// The word as it is written.
    pub word: &'static str,
    /// The syntax that must follow it.
    pub follow: Follow,
}

/// The syntax that follows an option.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Follow {
    /// The name that is declared, on the same line.
    Name,
    /// A text in quotes, on the same line.
    Text,
    /// An expression; a line break before that ends nothing.
    Value,
    /// As `Value`, in every declaration and rule.
    ValueEverywhere,
    /// Nothing: the option ends the declaration.
    Nothing,
}
