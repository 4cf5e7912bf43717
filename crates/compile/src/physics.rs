//! Units, wind, flows and tissues: from the syntax tree to the model.

use crate::advice;
use crate::scenery::Builder;
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_expr::Program;
use dlsys_model::{Flow, Primitive, Spectrum, Tissue, Units, Wind};
use dlsys_syntax::ast::{Attribute, Expression, Name};

/// Maximum number of tissues, of gases, of soils, of pours, and of flows, of one model.
pub(crate) const MAX_DECLARED: usize = 1000;
/// Greatest seed: all whole numbers up to this one are numbers of the language.
const MAX_SEED: f64 = 9_007_199_254_740_992.0;
/// Number of times at which a speed is compared with itself one period later.
const SAMPLES: u32 = 64;
/// Relative difference up to which two speeds are equal.
const SAME_SPEED: f64 = 1e-6;

/// A value of an attribute: its bounds, and how messages name it.
pub(crate) struct Quantity {
    /// As a part of a sentence: `this is no …`.
    pub(crate) name: &'static str,
    /// The unit with a space before it; empty if it has none.
    pub(crate) unit: &'static str,
    /// True if 0 is one of its values.
    pub(crate) zero: bool,
    /// The greatest value.
    pub(crate) most: f64,
    /// The remedy if the value is none.
    pub(crate) help: &'static str,
}

/// A quantity that is greater than 0.
pub(crate) const fn positive(name: &'static str, unit: &'static str, help: &'static str) -> Quantity {
    Quantity { name, unit, zero: false, most: f64::MAX, help }
}

/// A quantity that is 0 or greater.
pub(crate) const fn not_negative(name: &'static str, unit: &'static str, help: &'static str) -> Quantity {
    Quantity { zero: true, ..positive(name, unit, help) }
}

const LENGTH: Quantity = positive(
    "unit of length",
    " m",
    "write the length of one unit in metres, which is greater than 0: `units length 0.01` for centimetres",
);
const TIME: Quantity = positive(
    "unit of time",
    " s",
    "write the duration of one unit of t in seconds, which is greater than 0: `units time 86400` for days",
);
const STIFFNESS: Quantity = Quantity {
    most: Tissue::STIFFEST,
    ..positive(
        "stiffness",
        " Pa",
        "Young's modulus is greater than 0 and at most 1e15 Pa: about `stiffness 1e10` for wood, `1e8` to `1e9` for herbaceous stems",
    )
};
const DENSITY: Quantity = positive(
    "density",
    " kg/m³",
    "a density is greater than 0: about `density 900` for fresh stems, `500` to `800` for dry wood",
);
const DAMPING: Quantity = not_negative(
    "damping",
    "",
    "a damping ratio is 0 or greater: about `damping 0.02` for wood, `0.05` to `0.2` for stems with leaves",
);
const THICKNESS: Quantity =
    positive("thickness", " m", "a thickness is greater than 0: about `thickness 0.0002` for a leaf");
const SPEED: Quantity =
    not_negative("speed", " m/s", "a speed is 0 or greater; the direction says where the wind goes");
const TURBULENCE: Quantity = not_negative(
    "turbulence",
    "",
    "it is the root mean square of the fluctuations relative to the speed, 0 or greater: `turbulence 0.2` for example",
);
const SCALE: Quantity =
    positive("scale", " m", "a scale is greater than 0: the size of the eddies in m, `scale 5` for example");
const ROUGHNESS: Quantity = positive(
    "roughness",
    " m",
    "a roughness length is greater than 0: about `roughness 0.03` for short grass, `1` for a forest",
);
const PERIOD: Quantity = positive(
    "period",
    "",
    "a period is greater than 0: the time after which the wind repeats, in units of t",
);
const DISSIPATION: Quantity = positive("rate of dissipation", " m²/s³", KOLMOGOROV);
const WAVE_NUMBER: Quantity = positive("wave number", " per metre", KOLMOGOROV);
const SPREAD: Quantity = positive("spread of frequencies", " m/s", KOLMOGOROV);
const KOLMOGOROV: &str = "all three values are greater than 0: rate of dissipation, smallest wave number, spread of frequencies, as in `spectrum kolmogorov 1, 4, 1`";
const DECAY: Quantity = positive(
    "distance",
    "",
    "a distance is greater than 0, in units of the model: the flow decays to 1/e within it; without `decay` it does not decay",
);

/// A number in a message; very large and very small ones with an exponent.
pub(crate) fn shown(value: f64) -> String {
    match value.abs() {
        0.0 | 1e-4..1e6 => value.to_string(),
        _ => format!("{value:e}"),
    }
}

/// A computed number in a message: four digits.
fn rounded(value: f64) -> String {
    let short: f64 = format!("{value:.3e}").parse().unwrap_or(value);
    shown(short)
}

impl Builder<'_> {
    /// The attributes with these words, in this order. One that is written twice is an error.
    pub(crate) fn sorted<'a, const N: usize>(
        &mut self,
        attributes: &'a [Attribute],
        words: [&str; N],
    ) -> [Option<&'a Attribute>; N] {
        words.map(|word| {
            let mut all = attributes.iter().filter(|attribute| *attribute.word.text == *word);
            let first = all.next()?;
            if let Some(second) = all.next() {
                let places = [first.span, second.span];
                self.scope.diagnostics.push(advice::given_twice(&format!("`{word}`"), places));
            }
            Some(first)
        })
    }

    /// The value of an expression of constants within the bounds of a quantity.
    fn quantity(&mut self, expression: Expression, quantity: &Quantity) -> Option<f64> {
        let all = &self.document.expressions;
        let value = self.scope.constant_value(all, expression)?;
        self.is_within(value, expression, quantity).then_some(value)
    }

    /// Reports a value that is none of a quantity; true if it is one.
    fn is_within(&mut self, value: f64, expression: Expression, quantity: &Quantity) -> bool {
        let Quantity { name, unit, zero, most, help } = quantity;
        let good = (value > 0.0 || *zero && value == 0.0) && value <= *most;
        if !good {
            self.scope.diagnostics.push(
                Diagnostic::error(format!("this is no {name}"))
                    .at(
                        self.document.expressions.span(expression.root),
                        format!("it is {}{unit}", shown(value)),
                    )
                    .help(*help),
            );
        }
        good
    }

    /// The value of an attribute; None without it, or if it has an error.
    pub(crate) fn attribute(&mut self, attribute: Option<&Attribute>, quantity: &Quantity) -> Option<f64> {
        self.quantity(*attribute?.values.first()?, quantity)
    }

    pub(crate) fn units(&mut self, attributes: &[Attribute]) {
        let [length, time] = self.sorted(attributes, ["length", "time"]);
        let Units { length: metre, time: second } = Units::default();
        self.scenery.units = Units {
            length: self.attribute(length, &LENGTH).unwrap_or(metre),
            time: self.attribute(time, &TIME).unwrap_or(second),
        };
    }

    /// Three constants that are a direction; `example` is the remedy if all are 0. Squares of the result are numbers, however long or short it was.
    fn direction(&mut self, written: &[Expression], example: &str) -> Option<[f64; 3]> {
        let all = &self.document.expressions;
        let &[x, y, z] = written else { return None };
        let values = [x, y, z].map(|c| self.scope.constant_value(all, c));
        let [Some(x), Some(y), Some(z)] = values else { return None };
        let largest = x.abs().max(y.abs()).max(z.abs());
        let scale = if (1e-100..1e100).contains(&largest) { 1.0 } else { largest };
        let is = self.is_direction(&[x, y, z], written, example);
        is.then(|| [x, y, z].map(|part| part / scale))
    }

    /// Reports three values that are all 0; true if they are a direction.
    fn is_direction(&mut self, values: &[f64], written: &[Expression], example: &str) -> bool {
        let is = values.iter().any(|value| *value != 0.0);
        if let ([first, .., last], false) = (written, is) {
            let all = &self.document.expressions;
            self.scope.diagnostics.push(
                Diagnostic::error("this is no direction")
                    .at(all.span(first.root).to(all.span(last.root)), "all three are 0")
                    .help(example),
            );
        }
        is
    }

    /// The height of the ground.
    pub(crate) fn height(&mut self, height: Expression) -> Option<f64> {
        /// What drawings may reach, too.
        const FURTHEST: f64 = 1e100;
        let all = &self.document.expressions;
        let value = self.scope.constant_value(all, height)?;
        if value.abs() <= FURTHEST {
            return Some(value);
        }
        self.scope.diagnostics.push(
            Diagnostic::error("the ground is beyond the greatest coordinate")
                .at(
                    all.span(height.root),
                    format!("it is {}, and coordinates go up to {FURTHEST:e}", shown(value)),
                )
                .help("the height of the ground is in units of the model: `ground 0` is where plants begin"),
        );
        None
    }

    pub(crate) fn wind(&mut self, direction: &[Expression; 3], attributes: &[Attribute], span: Span) {
        const WORDS: [&str; 7] = ["speed", "turbulence", "scale", "roughness", "period", "seed", "spectrum"];
        let [speed, turbulence, scale, roughness, period, seed, spectrum] = self.sorted(attributes, WORDS);
        let direction = self.direction(direction, "a wind towards positive x is `wind 1, 0, 0 speed 3`");
        let program = self.speed(speed, span);
        if let (Some(speed), true) = (speed, program.is_some()) {
            self.speed = self.nodes_of_time(&speed.values).and_then(|nodes| nodes.first().copied());
        }
        let intensity = self.attribute(turbulence, &TURBULENCE);
        let size = self.attribute(scale, &SCALE);
        let z0 = self.attribute(roughness, &ROUGHNESS);
        let repeat = self.attribute(period, &PERIOD);
        let kolmogorov = spectrum.map(|spectrum| self.kolmogorov(spectrum));
        if let (Some(turbulence), Some(_), None, None) =
            (turbulence, intensity.filter(|value| *value > 0.0), scale, kolmogorov)
        {
            self.scope.diagnostics.push(
                Diagnostic::error("the turbulence of this wind has no scale")
                    .at(turbulence.span, "expected `scale` and the size of its eddies")
                    .help("add the integral scale in m, `scale 5` for example; among plants it is about their height"),
            );
        }
        if let (Some(spectrum), Some(unused)) = (spectrum, turbulence.or(scale)) {
            let word = &unused.word.text;
            self.scope.diagnostics.push(
                Diagnostic::warning(format!("`{word}` has no effect in this wind"))
                    .at(unused.span, "Kolmogorov's spectrum does not depend on it")
                    .at(spectrum.span, "its values determine strength and size of the eddies")
                    .help(format!(
                        "remove `{word}`; or remove `spectrum` for von Kármán's, which it belongs to"
                    )),
            );
        }
        if let (Some(program), Some(speed), Some(period), Some(repeat)) = (&program, speed, period, repeat) {
            self.speed_repeats(program, (speed, period), repeat);
        }
        let seed = seed.and_then(|seed| self.seed(seed)).unwrap_or(0);
        let (Some(direction), Some(program)) = (direction, program) else { return };
        self.scenery.wind = Some(Wind {
            direction,
            speed: program,
            // Kolmogorov's spectrum has an amplitude of its own.
            turbulence: intensity.unwrap_or(if spectrum.is_some() { 1.0 } else { 0.0 }),
            // Without turbulence the scale has no effect.
            scale: size.unwrap_or(1.0),
            roughness: z0,
            period: repeat,
            seed,
            spectrum: kolmogorov.flatten().map_or(Spectrum::VonKarman, Spectrum::Kolmogorov),
            span,
        });
    }

    /// The speed of a wind, which may read `t`.
    fn speed(&mut self, speed: Option<&Attribute>, wind: Span) -> Option<Program> {
        let Some(speed) = speed else {
            self.scope.diagnostics.push(
                Diagnostic::error("this wind has no speed")
                    .at(wind, "expected `speed` and a value")
                    .help("add its mean speed in m/s: `wind 1, 0, 0 speed 3`"),
            );
            return None;
        };
        self.varying(speed, &SPEED)
    }

    /// The value of an attribute that may depend on `t`, within the bounds of a quantity if it is a constant.
    pub(crate) fn varying(&mut self, attribute: &Attribute, quantity: &Quantity) -> Option<Program> {
        let program = self.of_time(&attribute.values)?;
        if let (Some(&[value]), Some(&written)) = (program.constants(), attribute.values.first()) {
            return self.is_within(value, written, quantity).then_some(program);
        }
        Some(program)
    }

    /// Reports a speed that does not have the period of its wind.
    fn speed_repeats(&mut self, program: &Program, (speed, period): (&Attribute, &Attribute), repeat: f64) {
        if program.reads().is_empty() {
            return;
        }
        let pairs = (0..SAMPLES).map(|i| {
            // Multiples of the golden ratio are spread evenly and have no period.
            let time = repeat * (f64::from(i) * 0.618_033_988_749_895).fract();
            (time, program.eval_one(&[time]), program.eval_one(&[time + repeat]))
        });
        let largest = pairs.clone().fold(0.0, |most: f64, (_, a, b)| most.max(a.abs()).max(b.abs()));
        let different = |&(_, a, b): &(f64, f64, f64)| (a - b).abs() > SAME_SPEED * largest;
        let Some((time, now, later)) = pairs.clone().find(different) else { return };
        self.scope.diagnostics.push(
            Diagnostic::error("the speed does not repeat with the period of the wind")
                .at(
                    speed.span,
                    format!(
                        "at t = {} it is {}, one period later it is {}",
                        rounded(time),
                        rounded(now),
                        rounded(later)
                    ),
                )
                .at(period.span, "the period, in units of t")
                .help(format!(
                    "a speed with this period is `speed 3 + sin(2*pi*t/{})`; without `period` any speed is possible",
                    shown(repeat)
                )),
        );
    }

    fn seed(&mut self, seed: &Attribute) -> Option<u64> {
        let written = *seed.values.first()?;
        let all = &self.document.expressions;
        let value = self.scope.constant_value(all, written)?;
        if !(0.0..=MAX_SEED).contains(&value) || value.fract() != 0.0 {
            self.scope.diagnostics.push(
                Diagnostic::error("this is no seed")
                    .at(all.span(written.root), format!("it is {}", shown(value)))
                    .help("a seed is a whole number from 0 to 2^53: `seed 7`"),
            );
            return None;
        }
        Some(value as u64)
    }

    /// The three values of Kolmogorov's spectrum.
    fn kolmogorov(&mut self, spectrum: &Attribute) -> Option<[f64; 3]> {
        let &[rate, wave_number, spread] = &spectrum.values[..] else { return None };
        let rate = self.quantity(rate, &DISSIPATION);
        let wave_number = self.quantity(wave_number, &WAVE_NUMBER);
        let spread = self.quantity(spread, &SPREAD);
        Some([rate?, wave_number?, spread?])
    }

    pub(crate) fn flow(&mut self, kind: &Attribute, attributes: &[Attribute], span: Span) {
        let primitive = match &*kind.word.text {
            "uniform" => Primitive::Uniform,
            "source" => Primitive::Source,
            "sink" => Primitive::Sink,
            _ => Primitive::Vortex,
        };
        let [place, axis, decay] = self.sorted(attributes, ["at", "axis", "decay"]);
        if !self.has_parts(primitive, kind, [place, axis, decay]) {
            return;
        }
        let distance = self.attribute(decay, &DECAY);
        let mut written = kind.values.clone();
        written.extend(place.iter().chain(&axis).flat_map(|attribute| &attribute.values));
        let Some(nodes) = self.nodes_of_time(&written) else { return };
        let program = Program::compile(&self.scope.graph, &nodes, 1);
        if let (Some(axis), Some([_, _, _, _, turns @ ..])) = (axis, program.constants()) {
            self.is_direction(turns, &axis.values, "a vortex around the vertical has `axis 0, 1, 0`");
        }
        if self.scenery.flows.len() == MAX_DECLARED {
            self.scope.diagnostics.push(advice::too_many(
                MAX_DECLARED,
                "flows",
                span,
                "turbulence is a part of `wind`: `wind 1, 0, 0 speed 3 turbulence 0.2 scale 5`",
            ));
        }
        self.flows.push(nodes);
        self.scenery.flows.push(Flow { primitive, program, decay: distance, span });
    }

    /// Reports a flow that has not the parts of its kind; true if it has them.
    fn has_parts(
        &mut self,
        primitive: Primitive,
        kind: &Attribute,
        [place, axis, decay]: [Option<&Attribute>; 3],
    ) -> bool {
        let word = &kind.word.text;
        let is_uniform = primitive == Primitive::Uniform;
        let is_vortex = primitive == Primitive::Vortex;
        let example = match primitive {
            Primitive::Uniform => "`flow uniform 1, 0, 0`: its velocity in m/s",
            Primitive::Source => "`flow source 2 at 0, 1, 0 decay 3`: strength, place, distance of decay",
            Primitive::Sink => "`flow sink 2 at 0, 1, 0 decay 3`: strength, place, distance of decay",
            Primitive::Vortex => {
                "`flow vortex 2 at 0, 1, 0 axis 0, 1, 0 decay 3`: strength, place, axis, distance of decay"
            }
        };
        let foreign = if is_uniform { place.or(axis).or(decay) } else { axis.filter(|_| !is_vortex) };
        if let Some(foreign) = foreign {
            let part = &foreign.word.text;
            let why = if is_uniform { "it is the same everywhere" } else { "it has no direction" };
            self.scope.diagnostics.push(
                Diagnostic::error(format!("a `{word}` has no `{part}`"))
                    .at(foreign.span, why)
                    .help(format!("write {example}")),
            );
            return false;
        }
        let missing = match (place, axis) {
            (None, _) if !is_uniform => "at",
            (_, None) if is_vortex => "axis",
            _ => return true,
        };
        self.scope.diagnostics.push(
            Diagnostic::error(match missing {
                "at" => format!("this {word} has no place"),
                _ => format!("this {word} has no axis"),
            })
            .at(kind.span, format!("expected `{missing} X, Y, Z` behind it"))
            .help(format!("write {example}")),
        );
        false
    }

    pub(crate) fn tissue(&mut self, name: &Name, attributes: &[Attribute], span: Span) {
        const WORDS: [&str; 5] = ["stiffness", "density", "damping", "thickness", "sag"];
        let [stiffness, density, damping, thickness, sag] = self.sorted(attributes, WORDS);
        for (attribute, word, help) in [
            (
                stiffness,
                "stiffness",
                "add Young's modulus in Pa: `stiffness 1e10` for wood, `1e8` to `1e9` for herbaceous stems",
            ),
            (
                density,
                "density",
                "add it in kg/m³: `density 900` for fresh stems, `500` to `800` for dry wood",
            ),
            (
                damping,
                "damping",
                "add the damping ratio at 1 Hz: `damping 0.02` for wood, `0.05` to `0.2` for stems with leaves",
            ),
        ] {
            if attribute.is_none() {
                self.scope.diagnostics.push(
                    Diagnostic::error(format!("the tissue `{}` has no {word}", name.text))
                        .at(span, format!("expected `{word}` and a value"))
                        .help(help),
                );
            }
        }
        if self.scenery.tissues.len() == MAX_DECLARED {
            self.scope.diagnostics.push(advice::too_many(
                MAX_DECLARED,
                "tissues",
                span,
                "stems of one tissue may have any width and length",
            ));
        }
        // A tissue with an error takes its number all the same; the model is refused then.
        let modulus = stiffness.and_then(|stiffness| self.varying(stiffness, &STIFFNESS));
        let tissue = Tissue {
            name: name.text.clone(),
            stiffness: modulus.unwrap_or_else(|| {
                let one = self.scope.graph.constant(1.0);
                Program::compile(&self.scope.graph, &[one], 1)
            }),
            density: self.attribute(density, &DENSITY).unwrap_or(1.0),
            damping: self.attribute(damping, &DAMPING).unwrap_or(0.0),
            thickness: self.attribute(thickness, &THICKNESS).unwrap_or(Tissue::THICKNESS),
            sag: sag.is_some(),
            span,
        };
        self.scenery.tissues.push(tissue);
    }
}
