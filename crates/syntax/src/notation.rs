//! The notation of each declaration: from the pairs of the parser to the syntax tree, and from the tree to text.
//!
//! Reading and printing stand side by side so that they agree: the printed text parses to the same tree.

use crate::ast::{Attribute, Expression, Expressions, Item, Name, Text};
use crate::grammar::{Pair, Rule};
use crate::parse::build::{Builder, Built, is_punctuation};
use crate::print;
use dlsys_expr::Sort;

/// The sorts of a curve and of a table if the text names none.
const CURVE: Sort = Sort::Monotone;
const TABLE: Sort = Sort::Linear;

/// Reads a declaration other than the initial string, which is parsed in pieces (`parse/mod.rs`).
pub(crate) fn read(builder: &mut Builder, pair: Pair) -> Built<Item> {
    let rule = pair.as_rule();
    let pairs: Vec<Pair> = pair.into_inner().filter(|p| !is_punctuation(p.as_rule())).collect();
    let mut parts = Parts { builder, pairs: pairs.into_iter() };
    Ok(match rule {
        Rule::title_item => {
            let text = parts.pair().into_inner().next().expect("the grammar has a text here");
            Item::Title(text.as_str().to_owned())
        }
        Rule::include_item => Item::Include(parts.text()),
        Rule::const_item => parts.constant()?,
        Rule::curve_item => {
            let (sort, name) = parts.sorted_name(CURVE);
            if let Some(file) = parts.text_if_any() {
                return Ok(Item::Function { name, file, item: parts.text_if_any() });
            }
            Item::Curve { name, sort, points: parts.points()?, periodic: parts.has(Rule::periodic) }
        }
        Rule::table_item => {
            let (sort, name) = parts.sorted_name(TABLE);
            let (file, column) = (parts.text(), parts.text_if_any());
            Item::Table { name, sort, file, column, periodic: parts.has(Rule::periodic) }
        }
        Rule::param_item => {
            let (name, value) = (parts.name(), parts.expression()?);
            let range = match parts.expression_if_any()? {
                Some(from) => Some((from, parts.expression()?)),
                None => None,
            };
            Item::Param { name, value, range }
        }
        Rule::def_item => {
            let (name, formals) = (parts.name(), parts.pair());
            let parameters = parts.builder.formals(formals);
            Item::Def { name, parameters, body: parts.expression()? }
        }
        Rule::angle_item => Item::Angle(parts.expression()?),
        Rule::period_item => Item::Period(parts.expression()?),
        Rule::frames_item => {
            Item::Frames { from: parts.expression()?, to: parts.expression()?, step: parts.expression()? }
        }
        Rule::color_item => Item::Color { name: parts.name(), value: parts.text() },
        Rule::gradient_item => Item::Gradient { name: parts.name(), stops: parts.texts() },
        Rule::surface_item => {
            Item::Surface { name: parts.name(), file: parts.text(), texture: parts.text_if_any() }
        }
        Rule::contour_item => Item::Contour { name: parts.name(), points: parts.points()? },
        Rule::tropism_item => {
            Item::Tropism { direction: parts.triple()?, strength: parts.expression_if_any()? }
        }
        Rule::plant_item => {
            Item::Plant { name: parts.name(), file: parts.text(), settings: parts.assignments()? }
        }
        Rule::ground_item => match parts.name_if_any() {
            Some(soil) => {
                let file = parts.text_if_any();
                let (attributes, textures) = parts.values_and_texts()?;
                Item::Bed { soil, file, attributes, textures }
            }
            None => Item::Ground { height: parts.expression()?, color: parts.text_if_any() },
        },
        Rule::light_item => Item::Light(parts.triple()?),
        Rule::sky_item => Item::Sky([parts.text(), parts.text()]),
        Rule::camera_item => {
            Item::Camera { eye: parts.triple()?, aim: parts.triple()?, angle: parts.expression_if_any()? }
        }
        Rule::units_item => Item::Units(parts.attributes()?),
        Rule::wind_item => Item::Wind { direction: parts.triple()?, attributes: parts.attributes()? },
        Rule::flow_item => Item::Flow { kind: parts.attribute()?, attributes: parts.attributes()? },
        Rule::tissue_item => Item::Tissue { name: parts.name(), attributes: parts.attributes()? },
        Rule::gas_item => {
            let name = parts.name();
            let (attributes, colors) = parts.values_and_texts()?;
            Item::Gas { name, attributes, colors }
        }
        Rule::sheet_item => Item::Sheet {
            name: parts.name(),
            file: parts.text(),
            tissue: parts.name(),
            pinned: parts.expression()?,
        },
        Rule::solid_item => Item::Solid(parts.names()),
        Rule::shelf_item => Item::Shelf(parts.names()),
        Rule::soil_item => {
            let name = parts.name();
            let (attributes, colors) = parts.values_and_texts()?;
            Item::Soil { name, attributes, colors }
        }
        Rule::pour_item => Item::Pour { soil: parts.name(), attributes: parts.attributes()? },
        Rule::ignore_item => Item::Ignore(parts.names()),
        Rule::consider_item => Item::Consider(parts.names()),
        Rule::interpret_item => {
            let (head, string) = (parts.pair(), parts.pair());
            Item::Interpret { head: parts.builder.head_module(head), drawn: parts.builder.successor(string)? }
        }
        other => unreachable!("{other:?} is no declaration"),
    })
}

/// A declaration or rule as text, without a line break at its end.
pub(crate) fn write(expressions: &Expressions, item: &Item) -> String {
    let show = |x: &Expression| print::expression(expressions, x.root);
    match item {
        Item::Title(text) => format!("title \"{text}\""),
        Item::Include(file) => format!("include \"{}\"", file.text),
        Item::Const { name, value } => format!("const {} = {}", name.text, show(value)),
        Item::Array { name, values } => {
            let values: Vec<String> = values.iter().map(show).collect();
            format!("const {} = [{}]", name.text, values.join(", "))
        }
        Item::Curve { name, sort, points, periodic } => {
            let points = written_points(expressions, points);
            format!("curve {}{} = {points}{}", sort_word(*sort, CURVE), name.text, ending(*periodic))
        }
        Item::Function { name, file, item } => {
            let item = item.as_ref().map(|i| format!(" item \"{}\"", i.text)).unwrap_or_default();
            format!("curve {} from \"{}\"{item}", name.text, file.text)
        }
        Item::Table { name, sort, file, column, periodic } => {
            let column = column.as_ref().map(|c| format!(" column \"{}\"", c.text)).unwrap_or_default();
            let sort = sort_word(*sort, TABLE);
            format!("table {sort}{} from \"{}\"{column}{}", name.text, file.text, ending(*periodic))
        }
        Item::Param { name, value, range: None } => format!("param {} = {}", name.text, show(value)),
        Item::Param { name, value, range: Some((a, b)) } => {
            format!("param {} = {} in {} .. {}", name.text, show(value), show(a), show(b))
        }
        Item::Def { name, parameters, body } => {
            format!("def {}({}) = {}", name.text, print::names(parameters, ", "), show(body))
        }
        Item::Angle(value) => format!("angle {}", show(value)),
        Item::Period(value) => format!("period {}", show(value)),
        Item::Frames { from, to, step } => {
            format!("frames {} .. {} step {}", show(from), show(to), show(step))
        }
        Item::Color { name, value } => format!("color {} = \"{}\"", name.text, value.text),
        Item::Gradient { name, stops } => {
            let stops: Vec<String> = stops.iter().map(|stop| format!("\"{}\"", stop.text)).collect();
            format!("gradient {} = {}", name.text, stops.join(", "))
        }
        Item::Surface { name, file, texture } => {
            let texture = texture.as_ref().map(|t| format!(" texture \"{}\"", t.text)).unwrap_or_default();
            format!("surface {} from \"{}\"{texture}", name.text, file.text)
        }
        Item::Contour { name, points } => {
            format!("contour {} = {}", name.text, written_points(expressions, points))
        }
        Item::Tropism { direction, strength } => {
            let strength = strength.as_ref().map(|e| format!(" strength {}", show(e)));
            format!("tropism {}{}", triple(expressions, direction), strength.unwrap_or_default())
        }
        Item::Plant { name, file, settings } => {
            let settings: Vec<String> =
                settings.iter().map(|(name, value)| format!("{} = {}", name.text, show(value))).collect();
            let with = if settings.is_empty() { "" } else { " with " };
            format!("plant {} from \"{}\"{with}{}", name.text, file.text, settings.join(", "))
        }
        Item::Ground { height, color } => {
            let color = color.as_ref().map(|color| format!(" color \"{}\"", color.text));
            format!("ground {}{}", show(height), color.unwrap_or_default())
        }
        Item::Light(direction) => format!("light {}", triple(expressions, direction)),
        Item::Sky([zenith, horizon]) => format!("sky \"{}\", \"{}\"", zenith.text, horizon.text),
        Item::Camera { eye, aim, angle } => {
            let angle = angle.as_ref().map(|e| format!(" angle {}", show(e))).unwrap_or_default();
            format!("camera at {} towards {}{angle}", triple(expressions, eye), triple(expressions, aim))
        }
        Item::Units(attributes) => format!("units {}", written(expressions, attributes, ", ")),
        Item::Wind { direction, attributes } => {
            let gap = if attributes.is_empty() { "" } else { " " };
            let attributes = written(expressions, attributes, " ");
            format!("wind {}{gap}{attributes}", triple(expressions, direction))
        }
        Item::Flow { kind, attributes } => {
            let gap = if attributes.is_empty() { "" } else { " " };
            let attributes = written(expressions, attributes, " ");
            format!("flow {}{gap}{attributes}", attribute(expressions, kind))
        }
        Item::Tissue { name, attributes } => {
            format!("tissue {} = {}", name.text, written(expressions, attributes, ", "))
        }
        Item::Gas { name, attributes, colors } => {
            format!("gas {} = {}", name.text, colored(expressions, attributes, colors))
        }
        Item::Sheet { name, file, tissue, pinned } => {
            format!("sheet {} from \"{}\" of {} pinned {}", name.text, file.text, tissue.text, show(pinned))
        }
        Item::Solid(list) => format!("solid {}", print::names(list, " ")),
        Item::Shelf(list) => format!("shelf {}", print::names(list, " ")),
        Item::Soil { name, attributes, colors } => {
            format!("soil {} = {}", name.text, colored(expressions, attributes, colors))
        }
        Item::Bed { soil, file, attributes, textures } => {
            let from = file.as_ref().map(|file| format!("from \"{}\"", file.text));
            let rest = (!attributes.is_empty()).then(|| written(expressions, attributes, " "));
            let textures = textures.iter().map(|file| format!("texture \"{}\"", file.text));
            let parts: Vec<String> = [from, rest].into_iter().flatten().chain(textures).collect();
            format!("ground {} {}", soil.text, parts.join(" "))
        }
        Item::Pour { soil, attributes } => {
            format!("pour {} {}", soil.text, written(expressions, attributes, " "))
        }
        Item::Ignore(list) => format!("ignore {}", print::names(list, " ")),
        Item::Consider(list) => format!("consider {}", print::names(list, " ")),
        Item::Axiom(string) => format!("initial string: {}", print::modules(expressions, string)),
        Item::Interpret { head, drawn } => {
            format!("interpret {}: {}", print::head_module(head), print::modules(expressions, drawn))
        }
        Item::Rule(rule) => print::rule(expressions, rule),
    }
}

/// The parts of a declaration in the order written. The grammar guarantees the mandatory ones.
struct Parts<'p, 'd, 'i> {
    builder: &'p mut Builder<'d>,
    pairs: std::vec::IntoIter<Pair<'i>>,
}

impl<'i> Parts<'_, '_, 'i> {
    fn pair(&mut self) -> Pair<'i> {
        self.pairs.next().expect("the grammar has a part here")
    }

    /// The next part, if it is of this kind.
    fn pair_if(&mut self, rule: Rule) -> Option<Pair<'i>> {
        let is = self.pairs.as_slice().first().is_some_and(|pair| pair.as_rule() == rule);
        if is { self.pairs.next() } else { None }
    }

    fn has(&mut self, rule: Rule) -> bool {
        self.pair_if(rule).is_some()
    }

    fn name(&mut self) -> Name {
        let pair = self.pair();
        self.builder.name(&pair)
    }

    fn name_if_any(&mut self) -> Option<Name> {
        self.pair_if(Rule::ident).map(|pair| self.builder.name(&pair))
    }

    fn names(&mut self) -> Vec<Name> {
        self.pairs.by_ref().map(|pair| self.builder.name(&pair)).collect()
    }

    fn text(&mut self) -> Text {
        let pair = self.pair();
        self.builder.text(&pair)
    }

    fn text_if_any(&mut self) -> Option<Text> {
        self.pair_if(Rule::text).map(|pair| self.builder.text(&pair))
    }

    fn texts(&mut self) -> Vec<Text> {
        self.pairs.by_ref().map(|pair| self.builder.text(&pair)).collect()
    }

    fn expression(&mut self) -> Built<Expression> {
        let pair = self.pair();
        self.builder.expression(pair)
    }

    fn expression_if_any(&mut self) -> Built<Option<Expression>> {
        self.pair_if(Rule::expr).map(|pair| self.builder.expression(pair)).transpose()
    }

    fn triple(&mut self) -> Built<[Expression; 3]> {
        Ok([self.expression()?, self.expression()?, self.expression()?])
    }

    /// A word with the values behind it.
    fn attribute(&mut self) -> Built<Attribute> {
        let pair = self.pair();
        let span = self.builder.span(&pair);
        let mut inner = pair.into_inner().peekable();
        let word = inner.next().expect("the grammar has a word here");
        let choice = inner.next_if(|pair| pair.as_rule() == Rule::kolmogorov);
        let word = self.builder.name(&word);
        let choice = choice.map(|choice| self.builder.name(&choice));
        let values = inner.map(|value| self.builder.expression(value)).collect::<Built<_>>()?;
        Ok(Attribute { word, choice, values, span })
    }

    fn attributes(&mut self) -> Built<Vec<Attribute>> {
        let mut all = Vec::new();
        while !self.pairs.as_slice().is_empty() {
            all.push(self.attribute()?);
        }
        Ok(all)
    }

    /// Attributes with values, and the texts of the others among them: colours or pictures.
    fn values_and_texts(&mut self) -> Built<(Vec<Attribute>, Vec<Text>)> {
        let (mut attributes, mut texts) = (Vec::new(), Vec::new());
        while let Some(next) = self.pairs.as_slice().first() {
            match next.clone().into_inner().find(|pair| pair.as_rule() == Rule::text) {
                Some(text) => {
                    self.pair();
                    texts.push(self.builder.text(&text));
                }
                None => attributes.push(self.attribute()?),
            }
        }
        Ok((attributes, texts))
    }

    fn assignments(&mut self) -> Built<Vec<(Name, Expression)>> {
        let mut all = Vec::new();
        while let Some(pair) = self.pair_if(Rule::assignment) {
            let mut inner = pair.into_inner().filter(|p| !is_punctuation(p.as_rule()));
            let mut next = || inner.next().expect("the grammar has a part here");
            let (name, value) = (next(), next());
            all.push((self.builder.name(&name), self.builder.expression(value)?));
        }
        Ok(all)
    }

    fn points(&mut self) -> Built<Vec<[Expression; 2]>> {
        let mut points = Vec::new();
        while let Some(pair) = self.pair_if(Rule::point) {
            points.push(self.builder.point(pair)?);
        }
        Ok(points)
    }

    /// A number, or an array of numbers.
    fn constant(&mut self) -> Built<Item> {
        let name = self.name();
        let value = self.pair();
        if value.as_rule() != Rule::array {
            return Ok(Item::Const { name, value: self.builder.expression(value)? });
        }
        let values = value.into_inner().map(|p| self.builder.expression(p)).collect::<Built<_>>()?;
        Ok(Item::Array { name, values })
    }

    /// The name of a curve, after the word for its sort if there is one.
    fn sorted_name(&mut self, default: Sort) -> (Sort, Name) {
        let sort = match self.pair_if(Rule::sort).as_ref().map(Pair::as_str) {
            Some("linear") => Sort::Linear,
            Some("spline") => Sort::Spline,
            Some(_) => Sort::Monotone,
            None => default,
        };
        (sort, self.name())
    }
}

/// The word for a sort of curve with a space behind it; empty for the default.
fn sort_word(sort: Sort, default: Sort) -> &'static str {
    match sort {
        sort if sort == default => "",
        Sort::Linear => "linear ",
        Sort::Monotone => "monotone ",
        Sort::Spline => "spline ",
    }
}

fn triple(expressions: &Expressions, [x, y, z]: &[Expression; 3]) -> String {
    let show = |x: &Expression| print::expression(expressions, x.root);
    format!("{}, {}, {}", show(x), show(y), show(z))
}

fn attribute(expressions: &Expressions, Attribute { word, choice, values, .. }: &Attribute) -> String {
    let words = std::iter::once(word).chain(choice).map(|word| word.text.to_string());
    let values: Vec<String> = values.iter().map(|x| print::expression(expressions, x.root)).collect();
    let values = (!values.is_empty()).then(|| values.join(", "));
    words.chain(values).collect::<Vec<_>>().join(" ")
}

/// Values, and the colours behind them.
fn colored(expressions: &Expressions, attributes: &[Attribute], colors: &[Text]) -> String {
    let values = attributes.iter().map(|one| attribute(expressions, one));
    let colors = colors.iter().map(|color| format!("color \"{}\"", color.text));
    values.chain(colors).collect::<Vec<_>>().join(", ")
}

fn written(expressions: &Expressions, attributes: &[Attribute], separator: &str) -> String {
    let all: Vec<String> = attributes.iter().map(|one| attribute(expressions, one)).collect();
    all.join(separator)
}

fn ending(periodic: bool) -> &'static str {
    if periodic { " periodic" } else { "" }
}

fn written_points(expressions: &Expressions, points: &[[Expression; 2]]) -> String {
    let show = |x: &Expression| print::expression(expressions, x.root);
    let points: Vec<String> = points.iter().map(|[x, y]| format!("({}, {})", show(x), show(y))).collect();
    points.join(" ")
}
