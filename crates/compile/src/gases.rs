//! Gases: from the syntax tree to the model.

use crate::advice;
use crate::appearance::color;
use crate::physics::{MAX_DECLARED, Quantity, not_negative, positive, shown};
use crate::scenery::Builder;
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_model::Gas;
use dlsys_syntax::ast::{Attribute, Name, Text};

const DIFFUSION: Quantity = not_negative(
    "diffusion",
    " m²/s",
    "a diffusion is 0 or greater: about `diffusion 2e-5` for a gas in still air, `1e-3` where small eddies stir it",
);
const GAS_DECAY: Quantity = not_negative(
    "decay",
    " per second",
    "a decay is 0 or greater: the mass falls to a half in 0.69/decay seconds; a blob ends when a thousandth is left",
);
const BLOB_SIZE: Quantity = positive(
    "size",
    " m",
    "the standard deviation of a new blob is greater than 0: about a half of the radius in which blobs begin",
);
const BLOB_MASS: Quantity = positive(
    "mass",
    " kg",
    "the mass of a new blob is greater than 0: `mass 1e-6` is a milligram; only its product with the extinction is seen",
);
const EXTINCTION: Quantity = not_negative(
    "extinction",
    " m²/kg",
    "it is 0 or greater: the area that a kilogram hides from light; about 500 for fog, 5000 for smoke",
);
const ALBEDO: Quantity = Quantity {
    most: 1.0,
    ..not_negative(
        "albedo",
        "",
        "it is the part of light that is scattered, 0 (black) to 1 (nothing is absorbed)",
    )
};
const GLOW: Quantity =
    not_negative("glow", "", "it is 0 or greater: 1 is as bright as a surface in full light");

/// Greatest speed at which a gas sinks or rises, in m/s.
const FASTEST_FALL: f64 = 1000.0;

impl Builder<'_> {
    pub(crate) fn gas(&mut self, name: &Name, (attributes, colors): (&[Attribute], &[Text]), span: Span) {
        const WORDS: [&str; 8] =
            ["size", "mass", "extinction", "diffusion", "decay", "albedo", "glow", "fall"];
        let [size, mass, extinction, diffusion, decay, albedo, glow, fall] = self.sorted(attributes, WORDS);
        for (attribute, word, help) in [
            (size, "size", "add the standard deviation of a new blob in m: `size 0.01` for example"),
            (mass, "mass", "add the mass of a new blob in kg: `mass 1e-6` is a milligram"),
            (extinction, "extinction", "add it in m²/kg: about `extinction 500` for fog, `5000` for smoke"),
        ] {
            if attribute.is_none() {
                self.scope.diagnostics.push(
                    Diagnostic::error(format!("the gas `{}` has no {word}", name.text))
                        .at(span, format!("expected `{word}` and a value"))
                        .help(help),
                );
            }
        }
        if let [first, second, ..] = colors {
            self.scope.diagnostics.push(advice::given_twice("`color`", [first.span, second.span]));
        }
        if self.scenery.gases.len() == MAX_DECLARED {
            self.scope.diagnostics.push(advice::too_many(
                MAX_DECLARED,
                "gases",
                span,
                "one gas may have any number of sources",
            ));
        }
        // A gas with an error takes its number all the same; the model is refused then.
        let gas = Gas {
            name: name.text.clone(),
            diffusion: self.attribute(diffusion, &DIFFUSION).unwrap_or(0.0),
            decay: self.attribute(decay, &GAS_DECAY).unwrap_or(0.0),
            size: self.attribute(size, &BLOB_SIZE).unwrap_or(1.0),
            mass: self.attribute(mass, &BLOB_MASS).unwrap_or(1.0),
            extinction: self.attribute(extinction, &EXTINCTION).unwrap_or(0.0),
            albedo: self.attribute(albedo, &ALBEDO).unwrap_or(1.0),
            glow: self.attribute(glow, &GLOW).unwrap_or(0.0),
            fall: self.fall(fall).unwrap_or(0.0),
            color: colors.first().and_then(|text| color(text, self.scope)).unwrap_or(Gas::COLOR),
            span,
        };
        self.scenery.gases.push(gas);
    }

    /// The speed at which a gas sinks.
    fn fall(&mut self, fall: Option<&Attribute>) -> Option<f64> {
        let written = *fall?.values.first()?;
        let all = &self.document.expressions;
        let value = self.scope.constant_value(all, written)?;
        if value.abs() > FASTEST_FALL {
            self.scope.diagnostics.push(
                Diagnostic::error("this is no speed of fall")
                    .at(all.span(written.root), format!("it is {} m/s", shown(value)))
                    .help("it is the speed at which blobs sink in still air, at most 1000 m/s; a negative one lets them rise: `fall -0.3`"),
            );
            return None;
        }
        Some(value)
    }
}
