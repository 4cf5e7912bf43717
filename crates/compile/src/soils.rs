//! Soils, the ground that is made of one, and what is poured on it: from the syntax tree to the model.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::advice;
use crate::appearance::{color, picture as picture_of};
use crate::physics::{MAX_DECLARED, Quantity, not_negative, positive, shown};
use crate::scenery::Builder;
use crate::scope::Variables;
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_expr::Program;
use dlsys_model::{Appearance, Bed, HeightGrid, Pour, Relief, Soil, SoilBase, Texture};
use dlsys_syntax::ast::{Attribute, Expression, Expressions, Name, Text};
use dlsys_syntax::fault_of_path;

/// The largest file of heights, in bytes.
const MAX_FILE: u64 = 256 << 20;

/// Most values in a row, and rows, of a file of heights.
const MAX_ROWS: usize = 8192;

const REPOSE: Quantity = Quantity {
    most: 89.0,
    ..positive(
        "angle of repose",
        "°",
        "it is an angle from 0 to 89 degrees: about `repose 30` for dry sand, `45` for damp, `50` for fluffy snow",
    )
};
const INNER: Quantity = Quantity {
    most: 89.999,
    ..positive(
        "angle of repose",
        "°",
        "it is an angle from 0 to 90 degrees: the slope at which stands what a body has pressed, 45.8 for sand",
    )
};
const PUSH: Quantity = Quantity {
    most: 1.0,
    ..not_negative(
        "part",
        "",
        "it is the part of what is pressed that goes to the rim, from 0 to 1: 0.3 for sand, 0 for snow",
    )
};
const ROUGH: Quantity = Quantity {
    most: 0.5,
    ..not_negative("roughness", "", "it is a relative deviation of the slope at rest, from 0 to 0.5")
};
const FLOW: Quantity =
    positive("rate of slipping", " m²/s", "it is greater than 0; 0.05 m²/s without it, less for slow mud");
const COHESION: Quantity = not_negative(
    "cohesion",
    " kPa",
    "it is 0 or greater: 0 for dry sand, up to 20 for sandy loam, 5 to 50 for loam",
);
const WEIGHT: Quantity = positive(
    "weight",
    " kN/m³",
    "it is greater than 0: about `weight 19` for sand, `18` for loam, `1` to `3` for snow",
);
const BEARING: Quantity = Quantity {
    most: 1e4,
    ..not_negative(
        "bearing",
        "",
        "the pressure that the soil holds below a body, in weights of the soil above, is 0 to 10,000: about 16 for sand, 5 for soft mud",
    )
};
const SWELL: Quantity = Quantity {
    most: 1.0,
    ..not_negative(
        "part",
        "",
        "it is the part by which loosened soil expands, from 0 to 1: 0.1 to 0.3 for loam",
    )
};
const STICK: Quantity = Quantity {
    most: 1.0,
    ..not_negative(
        "amount that sticks",
        " m",
        "it is the volume in m³ that a square metre of a body takes up where it touches the soil, from 0 to 1: `stick 0.001` is a layer of 1 mm",
    )
};
const SHED: Quantity = Quantity {
    most: 1e6,
    ..positive(
        "time constant",
        " s",
        "it is greater than 0 and at most 1e6: after `shed 0.1` seconds a part 1/e still sticks to a body that has left the ground",
    )
};
const HOLD: Quantity = Quantity {
    most: 1e6,
    ..positive(
        "acceleration",
        " m/s²",
        "a body sheds all that is due where it is accelerated by as much or more, and less where it is accelerated less: greater than 0 and at most 1e6, as `hold 30`",
    )
};
const EXPONENT: Quantity = Quantity {
    most: 100.0,
    ..positive(
        "exponent",
        "",
        "what is shed goes with this power of the acceleration, greater than 0 and at most 100: 1 without it, and more for soil that lets go all at once",
    )
};
const GRAIN: Quantity = Quantity {
    most: 1000.0,
    ..positive(
        "diameter",
        " m",
        "the diameter of the particles that are thrown up is greater than 0 and at most 1000 m: `grain 0.003`",
    )
};
const CELL: Quantity =
    positive("cell", "", "the width of a column is greater than 0, in units of the model: `cell 0.01`");
const DEPTH: Quantity = positive(
    "depth",
    "",
    "the height of the soil above what does not give way is greater than 0: `depth 0.3`",
);
const EXTENT: Quantity =
    positive("extent", "", "the ground goes from -E to E in x and z, and E is greater than 0: `extent 5`");
const SIZE: Quantity = positive(
    "size",
    "",
    "the width of the picture on the ground is greater than 0, in units of the model: `size 0.3`",
);
const RATE: Quantity =
    not_negative("rate", "", "it is 0 or greater: a volume for each unit of t, or without `at` a height");
const RADIUS: Quantity = positive("radius", "", "the radius of the disc on which it falls is greater than 0");

impl Builder<'_> {
    pub(crate) fn soil(&mut self, name: &Name, (attributes, colors): (&[Attribute], &[Text]), span: Span) {
        const BASES: [(&str, SoilBase); 4] = [
            ("sand", SoilBase::Sand),
            ("mud", SoilBase::Mud),
            ("snow", SoilBase::Snow),
            ("soil", SoilBase::Soil),
        ];
        const WORDS: [&str; 14] = [
            "repose", "inner", "push", "rough", "flow", "cohesion", "weight", "bearing", "swell", "stick",
            "shed", "hold", "exponent", "grain",
        ];
        if let Some(before) = self.scenery.soils.iter().find(|soil| soil.name == name.text) {
            let twice = Diagnostic::error(format!("the soil `{}` is declared twice", name.text))
                .at(name.span, "the second time")
                .at(before.span, "the first time")
                .help("keep one of them, or give one another name");
            self.scope.diagnostics.push(twice);
        }
        if self.scenery.soils.len() == MAX_DECLARED {
            self.scope.diagnostics.push(advice::too_many(
                MAX_DECLARED,
                "soils",
                span,
                "remove those that are not used",
            ));
        }
        let bases: Vec<(&Attribute, SoilBase)> = (attributes.iter())
            .filter_map(|part| {
                let base = BASES.iter().find(|(word, _)| *part.word.text == **word)?;
                Some((part, base.1))
            })
            .collect();
        if let [(first, _), (second, _), ..] = bases[..] {
            self.scope.diagnostics.push(
                Diagnostic::error("a soil begins from one material")
                    .at(second.span, "the second one")
                    .at(first.span, "the first one")
                    .help("keep one of them, and add values that differ: `soil wet = sand, repose 45`"),
            );
        }
        let [
            repose,
            inner,
            push,
            rough,
            flow,
            cohesion,
            weight,
            bearing,
            swell,
            stick,
            shed,
            hold,
            exponent,
            grain,
        ] = self.sorted(attributes, WORDS);
        if let Some(exponent) = exponent.filter(|_| hold.is_none()) {
            self.scope.diagnostics.push(
                Diagnostic::error("`exponent` stands here without `hold`")
                    .at(exponent.span, "it is the power of an acceleration relative to `hold`")
                    .help("add that acceleration in m/s², `hold 30`, or remove `exponent`"),
            );
        }
        if let [first, second, ..] = colors {
            self.scope.diagnostics.push(advice::given_twice("`color`", [first.span, second.span]));
        }
        let base = bases.first().map_or(SoilBase::default(), |(_, base)| *base);
        let angles = [repose, inner].map(|part| part.map(|part| part.span));
        let [repose, inner] = [self.attribute(repose, &REPOSE), self.attribute(inner, &INNER)];
        if let (Some(least), Some(greatest)) = (repose, inner)
            && greatest < least
        {
            let places = angles.map(|place| place.unwrap_or(span));
            self.scope.diagnostics.push(
                Diagnostic::error("pressed soil is less steep than loose soil")
                    .at(places[1], format!("{} degrees where it is pressed", shown(greatest)))
                    .at(places[0], format!("{} degrees where it is loose", shown(least)))
                    .help("`inner` is the angle of repose of what a body has pressed: no less than `repose`"),
            );
        }
        // A soil with an error takes its name all the same; the model is refused then.
        let soil = Soil {
            name: name.text.clone(),
            base,
            repose,
            inner,
            push: self.attribute(push, &PUSH),
            rough: self.attribute(rough, &ROUGH),
            flow: self.attribute(flow, &FLOW),
            cohesion: self.attribute(cohesion, &COHESION),
            weight: self.attribute(weight, &WEIGHT),
            bearing: self.attribute(bearing, &BEARING),
            swell: self.attribute(swell, &SWELL),
            stick: self.attribute(stick, &STICK),
            shed: self.attribute(shed, &SHED),
            hold: self.attribute(hold, &HOLD),
            exponent: self.attribute(exponent, &EXPONENT),
            grain: self.attribute(grain, &GRAIN),
            color: colors.first().and_then(|text| color(text, self.scope)).unwrap_or(base.color()),
            span,
        };
        self.scenery.soils.push(soil);
    }

    /// The number of a soil by its name.
    fn soil_number(&mut self, name: &Name) -> Option<usize> {
        let soils = &self.scenery.soils;
        let found = soils.iter().position(|soil| soil.name == name.text);
        if found.is_none() {
            let error = Diagnostic::error(format!("there is no soil `{}`", name.text));
            self.scope.diagnostics.push(match soils.first() {
                Some(known) => error
                    .at(name.span, "no soil has this name")
                    .help(format!("the first soil of this model is `{}`", known.name)),
                None => error
                    .at(name.span, "the model declares no soil")
                    .help(format!("declare it: `soil {} = sand`, or `mud`, `snow`, `soil`", name.text)),
            });
        }
        found
    }

    pub(crate) fn bed(
        &mut self,
        (soil, file): (&Name, Option<&Text>),
        (attributes, textures): (&[Attribute], &[Text]),
        appearance: &Appearance,
        span: Span,
    ) {
        let number = self.soil_number(soil);
        let [cell, depth, height, extent, size] =
            self.sorted(attributes, ["cell", "depth", "height", "extent", "size"]);
        if let [first, second, ..] = textures {
            self.scope.diagnostics.push(advice::given_twice("`texture`", [first.span, second.span]));
        }
        if let Some(size) = size.filter(|_| textures.is_empty()) {
            self.scope.diagnostics.push(
                Diagnostic::error("this ground has no picture")
                    .at(size.span, "`size` is the width of one")
                    .help("declare it, `texture \"sand.png\"`, or remove `size`"),
            );
        }
        let picture = textures.first();
        let picture = picture.and_then(|text| picture_of(text, &appearance.surfaces, self.scope, self.files));
        if cell.is_none() {
            self.scope.diagnostics.push(
                Diagnostic::error("this ground has no cells")
                    .at(span, "expected `cell` and the width of a column")
                    .help(format!("write `ground {} cell 0.01`, in units of the model", soil.text)),
            );
        }
        let width = self.attribute(cell, &CELL);
        let below = self.attribute(depth, &DEPTH);
        let reach = self.attribute(extent, &EXTENT);
        let across = self.attribute(size, &SIZE);
        let relief = match (file, height) {
            (Some(file), Some(height)) => {
                self.scope.diagnostics.push(
                    Diagnostic::error("this ground has two heights")
                        .at(height.span, "a function of x and z")
                        .at(file.span, "and a file")
                        .help("keep one of them, and remove the other"),
                );
                None
            }
            (Some(file), None) => self.height_grid(file).map(Relief::Grid),
            (None, Some(height)) => self.relief(height.values.first().copied()).map(Relief::Function),
            (None, None) => self.relief(None).map(Relief::Function),
        };
        let (Some(number), Some(width), Some(relief)) = (number, width, relief) else { return };
        let reach = reach.unwrap_or(Bed::CELLS * width);
        let count = 2.0 * reach / width;
        if !(2.0..=Bed::MOST_CELLS).contains(&count.round()) {
            let what = format!("{} cells on a side", shown(count.round()));
            let most = Bed::MOST_CELLS;
            self.scope.diagnostics.push(
                Diagnostic::error("ground with this extent and this cell cannot be computed")
                    .at(extent.or(cell).map_or(span, |part| part.span), what)
                    .help(format!(
                        "it has from 2 to {most} cells on a side: twice the extent by the width of a cell"
                    )),
            );
            return;
        }
        let texture = picture.map(|picture| Texture { picture, repeats: true });
        self.scenery.bed = Some(Bed {
            soil: number,
            cell: width,
            depth: below,
            height: relief,
            extent: reach,
            texture,
            texture_size: across.unwrap_or(Bed::TEXTURE_CELLS * width),
            span,
        });
    }

    /// A program over `x` and `z`; 0 without an expression.
    fn relief(&mut self, expression: Option<Expression>) -> Option<Program> {
        let root = match expression {
            None => self.scope.graph.constant(0.0),
            Some(expression) => {
                let no_time = "the ground has this height at the beginning: it depends on `x` and `z`";
                let mut variables = Variables { no_time: Some(no_time), ..Variables::default() };
                for (number, name) in (0..).zip(["x", "z"]) {
                    let variable = self.scope.graph.var(number);
                    variables.names.insert(name.into(), variable);
                }
                let all: &Expressions = &self.document.expressions;
                let root = self.scope.number(all, expression, &variables)?;
                if let Some(value) = self.scope.graph.as_constant(root).filter(|value| !value.is_finite()) {
                    self.scope.diagnostics.push(
                        Diagnostic::error("this has no finite value")
                            .at(all.span(expression.root), format!("it is {value}"))
                            .help(crate::advice::not_finite(value)),
                    );
                    return None;
                }
                root
            }
        };
        Some(Program::compile(&self.scope.graph, &[root], 2))
    }

    /// The heights of a file: a line for each row, from the least z on, and in it numbers from the least x on.
    fn height_grid(&mut self, file: &Text) -> Option<HeightGrid> {
        let read = match fault_of_path(&file.text) {
            None => {
                let path: PathBuf = Path::new(&file.text).components().collect();
                self.files.read(&path, MAX_FILE)
            }
            Some(why) => Err(why.to_owned()),
        };
        let grid = read.and_then(|bytes| {
            let text = String::from_utf8(bytes).map_err(|_| "it is no text".to_owned())?;
            parse_heights(&text)
        });
        grid.map_err(|why| {
            self.scope.diagnostics.push(
                Diagnostic::error(format!("the heights in `{}` cannot be read", file.text))
                    .at(file.span, why)
                    .help("it has a line for each row, and in each the same number of values, separated by commas"),
            );
        })
        .ok()
    }

    pub(crate) fn pour(&mut self, soil: &Name, attributes: &[Attribute], span: Span) {
        let number = self.soil_number(soil);
        let [rate, place, radius] = self.sorted(attributes, ["rate", "at", "radius"]);
        let Some(rate) = rate else {
            self.scope.diagnostics.push(
                Diagnostic::error("what is poured has no rate")
                    .at(span, "expected `rate` and a value")
                    .help(format!(
                        "write `pour {0} rate 0.02` for snowfall, or `pour {0} rate 0.5 at 0, 2, 0 radius 0.1`",
                        soil.text
                    )),
            );
            return;
        };
        let amount = self.varying(rate, &RATE);
        let wide = self.attribute(radius, &RADIUS);
        let lone = match (place, radius) {
            (Some(place), None) => Some((place, "radius", "of the disc on which it falls")),
            (None, Some(radius)) => Some((radius, "at", "of the middle of the disc")),
            _ => None,
        };
        if let Some((part, missing, what)) = lone {
            self.scope.diagnostics.push(
                Diagnostic::error(format!("`{}` stands here without `{missing}`", part.word.text))
                    .at(part.span, format!("expected also the `{missing}` {what}"))
                    .help("at a place it is written `pour dry rate 0.5 at 0, 2, 0 radius 0.1`; without both it falls everywhere"),
            );
        }
        let spot = place.and_then(|place| self.of_time(&place.values)).zip(wide);
        let (Some(soil), Some(rate)) = (number, amount) else { return };
        if self.scenery.pours.len() == MAX_DECLARED {
            let help = "a rate and a place may depend on t";
            self.scope.diagnostics.push(advice::too_many(MAX_DECLARED, "times `pour`", span, help));
        }
        self.scenery.pours.push(Pour { soil, rate, place: spot, span });
    }

    /// Reports soils that nothing is made of, and `pour` and `shelf` without a ground that gives way.
    pub(crate) fn end_soils(&mut self) {
        let (bed, pours) = (&self.scenery.bed, &self.scenery.pours);
        let unused: Vec<&Soil> = (self.scenery.soils.iter().enumerate())
            .filter(|(n, _)| bed.as_ref().is_none_or(|bed| bed.soil != *n))
            .filter(|(n, _)| pours.iter().all(|pour| pour.soil != *n))
            .map(|(_, soil)| soil)
            .collect();
        let has_error = !self.scope.diagnostics.is_empty();
        if !has_error {
            for soil in unused {
                self.scope.diagnostics.push(
                    Diagnostic::warning(format!("the soil `{}` is not used", soil.name))
                        .at(soil.span, "declared here")
                        .help(format!(
                            "make the ground of it: `ground {} cell 0.01`, or remove this line",
                            soil.name
                        )),
                );
            }
        }
        let Some(bed) = bed else {
            if let Some(pour) = pours.first().filter(|_| !has_error) {
                self.scope.diagnostics.push(
                    Diagnostic::error("what is poured falls on ground of a soil, and there is none")
                        .at(pour.span, "the model declares no `ground` with cells")
                        .help("declare one: `ground NAME cell 0.01`"),
                );
            }
            return;
        };
        if let Some(pour) = pours.iter().find(|pour| pour.soil != bed.soil) {
            let names = [pour.soil, bed.soil].map(|n| self.scenery.soils[n].name.clone());
            self.scope.diagnostics.push(
                Diagnostic::error(format!("`{}` is poured on ground of `{}`", names[0], names[1]))
                    .at(pour.span, "another soil")
                    .at(bed.span, "the ground")
                    .help("the ground of a scene is of one soil, and so is what falls on it"),
            );
        }
    }
}

/// The heights of a text, or what is wrong with it.
fn parse_heights(text: &str) -> Result<HeightGrid, String> {
    let mut values: Vec<f64> = Vec::new();
    let (mut columns, mut rows) = (0, 0);
    for (number, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let before = values.len();
        for cell in line.split([',', ';', '\t']) {
            let value: f64 = cell.trim().parse().map_err(|_| {
                let short: String = cell.trim().chars().take(20).collect();
                format!("line {}: `{short}` is no number", number + 1)
            })?;
            if !value.is_finite() {
                return Err(format!("line {}: {value} is no height", number + 1));
            }
            values.push(value);
        }
        let count = values.len() - before;
        if rows == 0 {
            columns = count;
        } else if count != columns {
            return Err(format!("line {} has {count} values, those before have {columns}", number + 1));
        }
        rows += 1;
        if rows > MAX_ROWS || columns > MAX_ROWS {
            return Err(format!("it has more than {MAX_ROWS} rows or columns"));
        }
    }
    if rows < 2 || columns < 2 {
        return Err("it has fewer than two rows or columns".to_owned());
    }
    Ok(HeightGrid { columns, values: Arc::from(values) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_are_bilinear_between_the_values_of_a_file() {
        let grid = parse_heights("# a ramp\n0, 1, 2\n\n10; 11; 12\n").expect("a grid");
        let relief = Relief::Grid(grid);
        for (x, z, height) in
            [(-4.0, -4.0, 0.0), (4.0, 4.0, 12.0), (0.0, 0.0, 6.0), (2.0, -4.0, 1.5), (9.0, 9.0, 12.0)]
        {
            assert_eq!(relief.at(x, z, 4.0), height, "at {x}, {z}");
        }
    }

    #[test]
    fn a_file_that_has_no_heights_says_where() {
        for (text, why) in [
            ("", "it has fewer than two rows or columns"),
            ("1, 2\n3", "line 2 has 1 values, those before have 2"),
            ("1, 2\n3, x", "line 2: `x` is no number"),
            ("1, 2\n3, inf", "line 2: inf is no height"),
        ] {
            assert_eq!(parse_heights(text).err().as_deref(), Some(why));
        }
    }
}
