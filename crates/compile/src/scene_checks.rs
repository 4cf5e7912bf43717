//! Checks of the modules of a scene: `@G` needs a ground, `@E(NAME)` a tissue, `@S(NAME, …)` a gas, `@D` has no parameters, and what is solid is drawn.

use rustc_hash::FxHashMap;

use dlsys_diagnostic::{Diagnostic, Severity, Span};
use dlsys_model::{DETACH, ELASTIC, GROUND, Kind, KindId, Model, SOURCE, Soil, Units};
use dlsys_syntax::foreign_syntax;

/// The argument of a module that names a tissue or a gas, if it is a constant.
pub struct MaterialNumber {
    /// The module.
    pub kind: KindId,
    /// The value of the argument.
    pub value: f64,
    /// The place of the argument.
    pub span: Span,
}

/// True if a model draws a module in another way than the command of its name: by an interpretation, or by a surface or a
/// plant that it declares.
pub fn is_hidden(model: &Model, kind: &Kind) -> bool {
    kind.interpretation.is_some()
        || model.appearance.surfaces.iter().any(|shape| shape.name == kind.name)
        || model.scenery.plants.iter().any(|plant| plant.name == kind.name)
        || model.scenery.sheets.iter().any(|sheet| sheet.name == kind.name)
}

/// Reports `@G` in a model without a ground.
pub fn ground(model: &Model, places: &FxHashMap<KindId, Span>, diagnostics: &mut Vec<Diagnostic>) {
    if model.scenery.ground.is_some() || model.scenery.bed.is_some() {
        return;
    }
    let stands = |kind: &Kind| kind.name == GROUND && !is_hidden(model, kind);
    for (id, _) in model.kinds.iter().filter(|(_, kind)| stands(kind)) {
        if let Some(span) = places.get(&id) {
            diagnostics.push(
                Diagnostic::error("`@G` sets the turtle on the ground, and there is none")
                    .at(*span, "the model declares no ground")
                    .help("declare one: `ground 0`"),
            );
        }
    }
}

/// Reports `@D` with parameters.
pub fn detach(model: &Model, places: &FxHashMap<KindId, Span>, diagnostics: &mut Vec<Diagnostic>) {
    let is_wrong = |kind: &Kind| kind.base() == DETACH && kind.arity > 0 && !is_hidden(model, kind);
    for (id, kind) in model.kinds.iter().filter(|(_, kind)| is_wrong(kind)) {
        if let Some(span) = places.get(&id) {
            diagnostics.push(
                Diagnostic::error("`@D` has no parameters")
                    .at(*span, format!("{} here", crate::scope::plural(kind.arity, "parameter")))
                    .help("write `@D` alone, in front of what is let go: `produce @D Loose(k)`")
                    .help("it is let go when its module is born: the production that makes it says when")
                    .help_opt(
                        foreign_syntax::module(DETACH)
                            .map(|there| format!("in cpfg it is another command; here {there}")),
                    ),
            );
        }
    }
}

/// Reports names behind `solid` and `shelf` that are no modules of a string: a body is all that a module of the string draws.
pub fn solids(
    model: &Model,
    occurs: &FxHashMap<KindId, Span>,
    drawn: &FxHashMap<KindId, Span>,
    diagnostics: &mut Vec<Diagnostic>,
) {
    for (kind, span) in model.scenery.solids.iter().chain(&model.scenery.shelves) {
        if occurs.contains_key(kind) {
            continue;
        }
        let name = &model.kinds.get(*kind).name;
        let mut error = Diagnostic::error(format!("`{name}` never stands in a string"))
            .at(*span, "a body is all that a module of the string draws");
        if let Some(place) = drawn.get(kind) {
            error = error.at(*place, "here it is a part of a drawing");
        }
        diagnostics.push(error.help("name the module that is drawn this way, or put this one in a string"));
    }
}

/// Reports `@E(…)` in a model without a tissue, and arguments that are the number of none.
pub fn tissues(
    model: &Model,
    places: &FxHashMap<KindId, Span>,
    numbers: &[MaterialNumber],
    diagnostics: &mut Vec<Diagnostic>,
) {
    let is_command = |kind: &Kind| kind.base() == ELASTIC && !is_hidden(model, kind);
    let tissues = &model.scenery.tissues;
    if tissues.is_empty() {
        for (id, kind) in model.kinds.iter() {
            if let Some(span) = places.get(&id).filter(|_| is_command(kind) && kind.arity > 0) {
                diagnostics.push(
                    Diagnostic::error("stems behind `@E` are made of a tissue, and there is none")
                        .at(*span, "the model declares no tissue")
                        .help("declare one: `tissue stalk = stiffness 2e8, density 900, damping 0.05`; then `@E(stalk)`"),
                );
            }
        }
        return;
    }
    // A name that is declared twice has the number of another declaration.
    if diagnostics.iter().any(|said| said.severity == Severity::Error) {
        return;
    }
    for number in numbers.iter().filter(|number| is_command(model.kinds.get(number.kind))) {
        let is_one = number.value.fract() == 0.0 && (0.0..=tissues.len() as f64).contains(&number.value);
        if is_one {
            continue;
        }
        let known: Vec<String> =
            tissues.iter().take(8).map(|tissue| format!("`@E({})`", tissue.name)).collect();
        let more = if tissues.len() > 8 { ", …" } else { "" };
        diagnostics.push(
            Diagnostic::error("this is no tissue").at(number.span, format!("it is {}", number.value)).help(
                format!(
                    "write the name of a tissue: {}{more}; or `@E(0)`: rigid from here",
                    known.join(", ")
                ),
            ),
        );
    }
}

/// Reports `@S(…)` in a model without a gas, and arguments that are the number of none.
pub fn gases(
    model: &Model,
    places: &FxHashMap<KindId, Span>,
    numbers: &[MaterialNumber],
    diagnostics: &mut Vec<Diagnostic>,
) {
    let is_command = |kind: &Kind| kind.base() == SOURCE && !is_hidden(model, kind);
    let gases = &model.scenery.gases;
    if gases.is_empty() {
        for (id, kind) in model.kinds.iter() {
            if let Some(span) = places.get(&id).filter(|_| is_command(kind) && kind.arity > 0) {
                diagnostics.push(
                    Diagnostic::error("`@S` lets out a gas, and there is none")
                        .at(*span, "the model declares no gas")
                        .help("declare one: `gas steam = size 0.01, mass 1e-6, extinction 200, fall -0.3`; then `@S(steam, 100, 0.02)`")
                        .help_opt(
                            foreign_syntax::module(SOURCE)
                                .map(|there| format!("in cpfg it is another command; here {there}")),
                        ),
                );
            }
        }
        return;
    }
    if diagnostics.iter().any(|said| said.severity == Severity::Error) {
        return;
    }
    for number in numbers.iter().filter(|number| is_command(model.kinds.get(number.kind))) {
        let is_one = number.value.fract() == 0.0 && (1.0..=gases.len() as f64).contains(&number.value);
        if is_one {
            continue;
        }
        let known: Vec<String> = gases.iter().take(8).map(|gas| format!("`{}`", gas.name)).collect();
        let more = if gases.len() > 8 { ", …" } else { "" };
        diagnostics.push(
            Diagnostic::error("this is no gas")
                .at(number.span, format!("it is {}", number.value))
                .help(format!("write the name of a gas: {}{more}", known.join(", "))),
        );
    }
}

/// Warns of plants of other models that let out a gas: it is followed for the model of the scene only.
pub fn gases_of_plants(model: &Model, diagnostics: &mut Vec<Diagnostic>) {
    for plant in &model.scenery.plants {
        let mut inner = vec![&plant.model];
        while let Some(within) = inner.pop() {
            inner.extend(within.scenery.plants.iter().map(|plant| &plant.model));
            if let Some(gas) = within.scenery.gases.first() {
                diagnostics.push(
                    Diagnostic::warning(format!(
                        "the gas `{}` of the plant `{}` is not drawn",
                        gas.name, plant.name
                    ))
                    .at(plant.span, "a gas in the model of a plant is left out here")
                    .help("declare the gas in this model, and write `@S` beside the plant"),
                );
                break;
            }
        }
    }
}

/// Warns of plants of other models whose lengths or times are other units than those of the scene: numbers are taken as they are.
pub fn units_of_plants(model: &Model, diagnostics: &mut Vec<Diagnostic>) {
    let Units { length, time } = model.scenery.units;
    for plant in &model.scenery.plants {
        let own = plant.model.scenery.units;
        if own == Units::default() || own == model.scenery.units {
            continue;
        }
        diagnostics.push(
            Diagnostic::warning(format!("the plant `{}` has other units than the scene", plant.name))
                .at(
                    plant.span,
                    format!(
                        "there a length of 1 is {} m and a time of 1 is {} s, here {length} m and {time} s",
                        own.length, own.time
                    ),
                )
                .help(format!(
                    "its numbers are taken for lengths and times of the scene: write `units length {}, time {}` here, too",
                    own.length, own.time
                )),
        );
    }
}

/// Warns of bodies that are plants of other models, or hold one: these are no bodies.
pub fn plants_as_bodies(model: &Model, diagnostics: &mut Vec<Diagnostic>) {
    let scenery = &model.scenery;
    let is_plant = |kind: &Kind| scenery.plants.iter().any(|plant| plant.name == kind.name);
    let bodies = scenery.solids.iter().map(|body| ("solid", body));
    for (word, (kind, span)) in bodies.chain(scenery.shelves.iter().map(|shelf| ("shelf", shelf))) {
        let mut known = vec![*kind];
        let mut next = 0;
        while let Some(kind) = known.get(next).copied() {
            next += 1;
            let drawn =
                model.kinds.get(kind).interpretation.map(|number| &model.interpretations[number].drawn);
            let inner: Vec<KindId> = drawn.into_iter().flat_map(|string| string.kinds()).collect();
            known.extend(inner.into_iter().filter(|kind| !known.contains(kind)).collect::<Vec<_>>());
        }
        if let Some(plant) = known.iter().map(|kind| model.kinds.get(*kind)).find(|kind| is_plant(kind)) {
            let name = &model.kinds.get(*kind).name;
            diagnostics.push(
                Diagnostic::warning(format!("`{}` is a plant of another model, and no body", plant.name))
                    .at(*span, format!("`{word} {name}` leaves it out"))
                    .help("draw the body with modules of this model: `@O(0.2)`, a stem with a width, or a `surface`"),
            );
        }
    }
}

/// Warns of soil that is to be shed and does not stick, of gas that ground of soil does not stop, and of shelves without a ground whose material they could carry.
pub fn soil(model: &Model, diagnostics: &mut Vec<Diagnostic>) {
    let scenery = &model.scenery;
    let named = |soil: &Soil| {
        let all = [("shed", soil.shed), ("hold", soil.hold), ("grain", soil.grain)];
        all.into_iter().find(|(_, value)| value.is_some()).map(|(word, _)| word)
    };
    let idle = scenery.soils.iter().filter(|soil| soil.stick.unwrap_or(0.0) == 0.0);
    for (soil, word) in idle.filter_map(|soil| named(soil).map(|word| (soil, word))) {
        diagnostics.push(
            Diagnostic::warning(format!("`{word}` does nothing here"))
                .at(soil.span, "nothing of this soil sticks to bodies")
                .help("let some stick: `stick 0.001` is a layer of 1 mm"),
        );
    }
    match (&scenery.bed, scenery.shelves.first()) {
        (Some(bed), _) if scenery.gases.iter().any(|gas| gas.fall >= 0.0) => diagnostics.push(
            Diagnostic::warning("gas goes through ground of soil")
                .at(bed.span, "blobs that sink are not held up here")
                .help("`ground H` alone holds them up; or let the gas rise: `fall -0.1`"),
        ),
        (None, Some((_, span))) => diagnostics.push(
            Diagnostic::warning("`shelf` does nothing here")
                .at(*span, "there is no ground of soil whose material it could carry")
                .help("declare one, and what falls: `soil powder = snow`, `ground powder cell 0.01 depth 0.3`, `pour powder rate 0.02`"),
        ),
        _ => (),
    }
}
