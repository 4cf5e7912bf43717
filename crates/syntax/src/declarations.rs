//! The table of declarations: the only definition of each declaration's word, notation and description.
//!
//! The first pass over a text, the parser's messages, `dlsys fmt`, the outline of a text, and completion, hints and help
//! of the interactive session are derived from it. To add a declaration: a row here, its rule in `grammars/dlsys.pest`, a
//! variant of [`Item`](crate::ast::Item), and how that is read and printed in `notation.rs`; then its meaning, in
//! `dlsys-compile` and `dlsys-model`.

mod traits;

use std::sync::LazyLock;

use crate::grammar::Rule;
pub(crate) use traits::Begins;
pub use traits::{Body, Category, Follow, Named, OptionWord, Repeats};

/// A kind of declaration.
#[derive(Debug)]
#[non_exhaustive]
pub struct Declaration {
    /// The word that begins it.
    pub word: &'static str,
    /// The notation after that word, for completion and help.
    pub usage: &'static str,
    /// One sentence about its meaning.
    pub summary: &'static str,
    /// The group in which help lists it.
    pub category: Category,
    /// The name that it declares, behind its word.
    pub named: Named,
    /// The declarations that conflict with it.
    pub repeats: Repeats,
    /// The syntax behind its head.
    pub body: Body,
    /// Words that it may contain.
    pub options: &'static [OptionWord],
    /// The condition under which its word begins a declaration; a name may also have this word.
    pub(crate) begins: Begins,
    /// An example as a sentence, for errors without a specific hint.
    pub(crate) written: &'static str,
    /// The entry rule of the grammar.
    pub(crate) rule: Rule,
}

/// Two declarations are equal if they have the same grammar rule: `initial string:` and `axiom:` are equal.
impl PartialEq for Declaration {
    fn eq(&self, other: &Declaration) -> bool {
        self.rule == other.rule
    }
}

impl Eq for Declaration {}

const fn option(word: &'static str, follow: Follow) -> OptionWord {
    OptionWord { word, follow }
}

const SORTS: [OptionWord; 3] =
    [option("monotone", Follow::Name), option("spline", Follow::Name), option("linear", Follow::Name)];

/// A row with the values that most declarations share.
const fn row(word: &'static str, rule: Rule) -> Declaration {
    Declaration {
        word,
        usage: "",
        summary: "",
        category: Category::Values,
        named: Named::No,
        repeats: Repeats::Once,
        body: Body::Line,
        options: &[],
        begins: Begins::Always,
        written: "",
        rule,
    }
}

/// All declarations, in the order in which messages list them.
pub static DECLARATIONS: [Declaration; 35] = [
    Declaration {
        usage: "\"…\"",
        summary: "the title of the model, shown above its pictures",
        category: Category::Text,
        written: "a title is written `title \"Anabaena\"`",
        ..row("title", Rule::title_item)
    },
    Declaration {
        usage: "\"FILE\"",
        summary: "includes the declarations and rules of another file",
        category: Category::Text,
        repeats: Repeats::PerFile,
        begins: Begins::BeforeName,
        written: "other texts are included by `include \"organs.dls\"`",
        ..row("include", Rule::include_item)
    },
    Declaration {
        usage: "NAME = VALUE, or NAME = [VALUE, …]",
        summary: "a name for a number, or for an array of numbers",
        named: Named::Word,
        repeats: Repeats::PerName("value"),
        written: "a constant is written `const k = 0.5`",
        ..row("const", Rule::const_item)
    },
    Declaration {
        usage: "NAME = VALUE in LOW .. HIGH",
        summary: "a number that can be set from outside the model, with `set` or `--set`",
        named: Named::Word,
        repeats: Repeats::PerName("value"),
        options: &[option("in", Follow::ValueEverywhere)],
        written: "a param is written `param r = 0.5`, or with a range `param r = 0.5 in 0 .. 1`",
        ..row("param", Rule::param_item)
    },
    Declaration {
        usage: "NAME(x, …) = EXPRESSION",
        summary: "a function of numbers",
        named: Named::Function,
        repeats: Repeats::PerName("value"),
        written: "a function is written `def growth(x, r) = r*x`",
        ..row("def", Rule::def_item)
    },
    Declaration {
        usage: "monotone|spline|linear NAME = (x, y) (x, y) … periodic, or NAME from \"FILE.func\"",
        summary: "a function that goes through these points, or a function file of cpfg",
        named: Named::AfterOption,
        repeats: Repeats::PerName("value"),
        options: &[
            SORTS[0],
            SORTS[1],
            SORTS[2],
            option("from", Follow::Text),
            option("item", Follow::Text),
            option("periodic", Follow::Nothing),
        ],
        begins: Begins::BeforeName,
        written: "a curve is written `curve g = (0, 0) (1, 0.3) (2, 1)`",
        ..row("curve", Rule::curve_item)
    },
    Declaration {
        usage: "NAME from \"FILE\" column \"COLUMN\"",
        summary: "a function that goes through the points of a file of comma-separated values",
        named: Named::AfterOption,
        repeats: Repeats::PerName("value"),
        options: &[
            SORTS[0],
            SORTS[1],
            SORTS[2],
            option("from", Follow::Text),
            option("column", Follow::Text),
            option("periodic", Follow::Nothing),
        ],
        begins: Begins::BeforeName,
        written: "a table is written `table g from \"file.csv\"`",
        ..row("table", Rule::table_item)
    },
    Declaration {
        usage: "DEGREES",
        summary: "the angle of turns without a parameter; 90 if it is not given",
        category: Category::Looks,
        written: "the angle is written `angle 45`, in degrees",
        ..row("angle", Rule::angle_item)
    },
    Declaration {
        usage: "DURATION",
        summary: "discrete rules apply at its multiples; 1 if it is not given",
        category: Category::Time,
        written: "the period of discrete rules is written `period 1`",
        ..row("period", Rule::period_item)
    },
    Declaration {
        usage: "FROM .. TO step STEP",
        summary: "the times of an animation, and those that `run` prints",
        category: Category::Time,
        options: &[option("step", Follow::ValueEverywhere)],
        written: "frames are written `frames 0 .. 10 step 0.1`",
        ..row("frames", Rule::frames_item)
    },
    Declaration {
        usage: "NAME = \"#rrggbb\"",
        summary: "a name for a colour, used as `;(NAME)`",
        category: Category::Looks,
        named: Named::Word,
        repeats: Repeats::PerName("color"),
        written: "a colour is written `color rose = \"#e573a5\"`",
        ..row("color", Rule::color_item)
    },
    Declaration {
        usage: "NAME = \"#rrggbb\", \"#rrggbb\", …",
        summary: "a name for a range of colours, used as `;(NAME, v)` with v from 0 to 1",
        category: Category::Looks,
        named: Named::Word,
        repeats: Repeats::PerName("color"),
        written: "a gradient is written `gradient leaf = \"#b9cf6a\", \"#4d7d38\"`",
        ..row("gradient", Rule::gradient_item)
    },
    Declaration {
        usage: "@NAME from \"FILE\" texture \"PICTURE\"",
        summary: "a surface from a file (.s or .obj), perhaps with a picture; `@NAME(s)` draws it",
        category: Category::Looks,
        named: Named::Surface,
        repeats: Repeats::PerName("surface"),
        options: &[option("from", Follow::Text), option("texture", Follow::Text)],
        written: "a surface is written `surface @P from \"petal.s\"`",
        ..row("surface", Rule::surface_item)
    },
    Declaration {
        usage: "NAME = (x, y) (x, y) …",
        summary: "a cross-section of stems, chosen by `@C(NAME)`",
        category: Category::Looks,
        named: Named::Word,
        repeats: Repeats::PerName("contour"),
        written: "a contour is written `contour leaf = (1, 0) (0, 0.3) (-1, 0) (0, -0.3)`",
        ..row("contour", Rule::contour_item)
    },
    Declaration {
        usage: "X, Y, Z strength E",
        summary: "a direction towards which all headings bend",
        category: Category::Looks,
        options: &[option("strength", Follow::Value)],
        written: "a tropism is written `tropism 0, -1, 0 strength 0.2`",
        ..row("tropism", Rule::tropism_item)
    },
    Declaration {
        usage: "@NAME from \"FILE\" with NAME = VALUE, …",
        summary: "a plant of another model, drawn by `@NAME(b)` as it is at the age t - b",
        category: Category::Scene,
        named: Named::Surface,
        repeats: Repeats::PerName("surface"),
        options: &[option("from", Follow::Text), option("with", Follow::Value)],
        begins: Begins::BeforeValue,
        written: "a plant of another model is written `plant @Grass from \"barley.dls\"`",
        ..row("plant", Rule::plant_item)
    },
    Declaration {
        usage: "HEIGHT color \"#rrggbb\", or SOIL cell D depth H height F(x, z) extent E",
        summary: "what plants stand on: a floor without end, or soil that gives way",
        category: Category::Scene,
        options: &[
            option("from", Follow::Text),
            option("cell", Follow::Value),
            option("depth", Follow::Value),
            option("height", Follow::Value),
            option("extent", Follow::Value),
            option("texture", Follow::Text),
            option("size", Follow::Value),
            option("color", Follow::Text),
        ],
        begins: Begins::BeforeValue,
        written: "a floor is written `ground 0`; ground of a soil, `ground clay cell 0.01 depth 0.3`",
        ..row("ground", Rule::ground_item)
    },
    Declaration {
        usage: "X, Y, Z",
        summary: "the direction towards the sun, which casts shadows; it may depend on t",
        category: Category::Scene,
        begins: Begins::BeforeValue,
        written: "a direction towards the sun is written `light -1, 2, 1`",
        ..row("light", Rule::light_item)
    },
    Declaration {
        usage: "\"#rrggbb\", \"#rrggbb\"",
        summary: "the colours of the zenith and of the horizon",
        category: Category::Scene,
        begins: Begins::BeforeValue,
        written: "a sky is written `sky \"#5b8fd0\", \"#e8eef5\"`: zenith, then horizon",
        ..row("sky", Rule::sky_item)
    },
    Declaration {
        usage: "at X, Y, Z towards X, Y, Z angle DEGREES",
        summary: "the eye, the point that it looks at, and the angle of view; they may depend on t",
        category: Category::Scene,
        options: &[
            option("at", Follow::Value),
            option("towards", Follow::Value),
            option("angle", Follow::Value),
        ],
        begins: Begins::BeforeValue,
        written: "a camera is written `camera at 0, 1, 5 towards 0, 1, 0 angle 40`",
        ..row("camera", Rule::camera_item)
    },
    Declaration {
        usage: "length METRES, time SECONDS",
        summary: "what a unit of length and a unit of time of the model are; 1 and 1 if they are not given",
        category: Category::Scene,
        options: &[option("length", Follow::Value), option("time", Follow::Value)],
        begins: Begins::BeforeValue,
        written: "units are written `units length 0.01, time 86400`: a unit of length in metres, a unit of t in seconds",
        ..row("units", Rule::units_item)
    },
    Declaration {
        usage: "X, Y, Z speed U turbulence I scale L",
        summary: "direction, speed in m/s, and turbulence of the wind; the speed may depend on t",
        category: Category::Scene,
        options: &[
            option("speed", Follow::Value),
            option("turbulence", Follow::Value),
            option("scale", Follow::Value),
            option("roughness", Follow::Value),
            option("period", Follow::Value),
            option("seed", Follow::Value),
            option("spectrum", Follow::Value),
            option("kolmogorov", Follow::Value),
        ],
        begins: Begins::BeforeValue,
        written: "a wind is written `wind 1, 0, 0 speed 3 turbulence 0.2 scale 5`",
        ..row("wind", Rule::wind_item)
    },
    Declaration {
        usage: "uniform U, V, W, or source|sink|vortex S at X, Y, Z axis X, Y, Z decay R",
        summary: "a further part of the wind; its values may depend on t",
        category: Category::Scene,
        repeats: Repeats::Freely,
        options: &[
            option("uniform", Follow::Value),
            option("source", Follow::Value),
            option("sink", Follow::Value),
            option("vortex", Follow::Value),
            option("at", Follow::Value),
            option("axis", Follow::Value),
            option("decay", Follow::Value),
        ],
        begins: Begins::BeforeValue,
        written: "a flow is written `flow uniform 1, 0, 0`, or `flow source 2 at 0, 1, 0 decay 3`; likewise `sink`, and `vortex` with an `axis`",
        ..row("flow", Rule::flow_item)
    },
    Declaration {
        usage: "NAME = stiffness E, density D, damping Z",
        summary: "a material of stems and surfaces, used as `@E(NAME)`: Pa, kg/m³, damping ratio at 1 Hz",
        category: Category::Scene,
        named: Named::Word,
        repeats: Repeats::PerName("value"),
        options: &[
            option("stiffness", Follow::Value),
            option("density", Follow::Value),
            option("damping", Follow::Value),
            option("thickness", Follow::Value),
            option("sag", Follow::Nothing),
        ],
        begins: Begins::BeforeValue,
        written: "a tissue is written `tissue stalk = stiffness 2e8, density 900, damping 0.05`",
        ..row("tissue", Rule::tissue_item)
    },
    Declaration {
        usage: "NAME = size S, mass M, extinction X, diffusion K, decay A, …",
        summary: "smoke, steam or pollen that the wind carries, used as `@S(NAME, rate, radius)`",
        category: Category::Scene,
        named: Named::Word,
        repeats: Repeats::PerName("value"),
        options: &[
            option("diffusion", Follow::Value),
            option("decay", Follow::Value),
            option("size", Follow::Value),
            option("mass", Follow::Value),
            option("extinction", Follow::Value),
            option("albedo", Follow::Value),
            option("glow", Follow::Value),
            option("fall", Follow::Value),
            option("color", Follow::Text),
        ],
        begins: Begins::BeforeValue,
        written: "a gas is written `gas steam = size 0.01, mass 1e-6, extinction 200, diffusion 1e-4, decay 0.5, fall -0.3`",
        ..row("gas", Rule::gas_item)
    },
    Declaration {
        usage: "@NAME from \"FILE\" of TISSUE pinned CONDITION",
        summary: "a flexible surface or net from a mesh (.obj), held where the condition on x, y and z is true",
        category: Category::Scene,
        named: Named::Surface,
        repeats: Repeats::PerName("surface"),
        options: &[
            option("from", Follow::Text),
            option("of", Follow::Value),
            option("pinned", Follow::Value),
        ],
        begins: Begins::BeforeValue,
        written: "a sheet is written `sheet @Flag from \"flag.obj\" of cloth pinned x < 0.01`",
        ..row("sheet", Rule::sheet_item)
    },
    Declaration {
        usage: "NAME …",
        summary: "modules whose drawings are solid bodies: they push the wind aside, and press into the ground",
        category: Category::Scene,
        repeats: Repeats::Freely,
        body: Body::Names,
        begins: Begins::BeforeValue,
        written: "modules that are solid are written `solid Ball Post`",
        ..row("solid", Rule::solid_item)
    },
    Declaration {
        usage: "NAME …",
        summary: "modules whose drawings carry what falls on them, and press into nothing",
        category: Category::Scene,
        repeats: Repeats::Freely,
        body: Body::Names,
        begins: Begins::BeforeValue,
        written: "modules that carry snow are written `shelf Leaf`",
        ..row("shelf", Rule::shelf_item)
    },
    Declaration {
        usage: "NAME = sand|mud|snow|soil, repose DEGREES, …",
        summary: "a granular material, for `ground` and `pour`",
        category: Category::Scene,
        named: Named::Word,
        repeats: Repeats::PerName("value"),
        options: &[
            option("sand", Follow::Nothing),
            option("mud", Follow::Nothing),
            option("snow", Follow::Nothing),
            option("soil", Follow::Nothing),
            option("repose", Follow::Value),
            option("inner", Follow::Value),
            option("push", Follow::Value),
            option("rough", Follow::Value),
            option("flow", Follow::Value),
            option("cohesion", Follow::Value),
            option("weight", Follow::Value),
            option("bearing", Follow::Value),
            option("swell", Follow::Value),
            option("stick", Follow::Value),
            option("shed", Follow::Value),
            option("hold", Follow::Value),
            option("exponent", Follow::Value),
            option("grain", Follow::Value),
            option("color", Follow::Text),
        ],
        begins: Begins::BeforeValue,
        written: "a soil is written `soil powder = snow, repose 50`",
        ..row("soil", Rule::soil_item)
    },
    Declaration {
        usage: "SOIL rate R at X, Y, Z radius R",
        summary: "material that is added: a volume for each unit of t, or a height everywhere",
        category: Category::Scene,
        repeats: Repeats::Freely,
        options: &[
            option("rate", Follow::Value),
            option("at", Follow::Value),
            option("radius", Follow::Value),
        ],
        begins: Begins::BeforeValue,
        written: "snowfall is written `pour powder rate 0.02`; sand that is poured, `pour dry rate 0.5 at 0, 2, 0 radius 0.1`",
        ..row("pour", Rule::pour_item)
    },
    Declaration {
        usage: "NAME …",
        summary: "modules that the search for context passes over",
        category: Category::Modules,
        repeats: Repeats::Freely,
        body: Body::Names,
        written: "modules that are no context are written `ignore F_x @L`",
        ..row("ignore", Rule::ignore_item)
    },
    Declaration {
        usage: "NAME …",
        summary: "the only modules that the search for context does not pass over",
        category: Category::Modules,
        repeats: Repeats::Freely,
        body: Body::Names,
        written: "the modules that are context are written `consider F A`",
        ..row("consider", Rule::consider_item)
    },
    Declaration {
        usage: "string: MODULE …",
        summary: "the modules at t = 0",
        category: Category::Modules,
        body: Body::String,
        options: &[option("string", Follow::ValueEverywhere)],
        written: "a string of modules is written `F(1) [ +(45) A(0) ] A(0)`",
        ..row("initial", Rule::modules)
    },
    Declaration {
        usage: ": MODULE …",
        summary: "another word for `initial string`",
        category: Category::Modules,
        body: Body::String,
        written: "a string of modules is written `F(1) [ +(45) A(0) ] A(0)`",
        ..row("axiom", Rule::modules)
    },
    Declaration {
        usage: "HEAD: MODULE …",
        summary: "modules that are drawn in place of one",
        category: Category::Modules,
        repeats: Repeats::PerHead,
        body: Body::Drawing,
        written: "a drawing is written `interpret A(x): !(0.1) F(x)`",
        ..row("interpret", Rule::interpret_item)
    },
];

impl Declaration {
    /// The declaration that a word begins.
    pub fn of_word(word: &str) -> Option<&'static Declaration> {
        DECLARATIONS.iter().find(|declaration| declaration.word == word)
    }

    /// The declaration of a grammar rule.
    pub(crate) fn of_rule(rule: Rule) -> Option<&'static Declaration> {
        DECLARATIONS.iter().find(|declaration| declaration.rule == rule)
    }

    /// True if it ends with a string of modules.
    pub fn has_string(&self) -> bool {
        matches!(self.body, Body::String | Body::Drawing)
    }

    /// True if this word may stand before the name that is declared.
    pub(crate) fn has_before_name(&self, word: &str) -> bool {
        self.options.iter().any(|option| option.word == word && option.follow == Follow::Name)
    }
}

/// All options of all declarations; a word is listed once for each declaration that has it.
pub fn options() -> impl Iterator<Item = &'static OptionWord> {
    DECLARATIONS.iter().flat_map(|declaration| declaration.options)
}

/// True if a value follows an option wherever it is a word of the language, also outside of its declaration.
pub fn is_before_value_everywhere(word: &str) -> bool {
    static WORDS: LazyLock<Vec<&str>> = LazyLock::new(|| {
        let everywhere = options().filter(|option| option.follow == Follow::ValueEverywhere);
        everywhere.map(|option| option.word).collect()
    });
    WORDS.contains(&word)
}

/// The words that begin a declaration.
pub fn words() -> impl Iterator<Item = &'static str> + Clone {
    DECLARATIONS.iter().map(|declaration| declaration.word)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_declaration_is_described() {
        for Declaration { word, usage, summary, written, .. } in &DECLARATIONS {
            assert!(!usage.is_empty() && !summary.is_empty() && written.contains('`'), "{word}");
        }
    }

    #[test]
    fn words_are_unique_and_belong_to_a_category() {
        let mut all: Vec<&str> = words().collect();
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), DECLARATIONS.len());
        let listed = Category::ALL.iter().map(|c| DECLARATIONS.iter().filter(|d| d.category == *c).count());
        assert_eq!(listed.sum::<usize>(), DECLARATIONS.len());
    }
}
