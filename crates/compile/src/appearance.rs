//! Colours, gradients, surfaces, contours and tropism: from the syntax tree to the model.

use std::sync::Arc;

use crate::advice;
use crate::scope::Scope;
use crate::surface;
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_model::{
    Appearance, BUILT_IN_COLORS, BUILT_IN_SURFACES, COMMAND_SURFACES, Contour, Gradient, NamedColor, Picture,
    Rgb, SurfaceShape, Texture, Tropism,
};
use dlsys_syntax::Files;
use dlsys_syntax::ast::{Document, Expression, Item, Name, Text};
use dlsys_syntax::suggest::did_you_mean;

/// Maximum number of colours, of gradients, of surfaces and of contours of one model.
const MAX_DECLARED: usize = 1000;

/// The number of the first gradient, which follows those of the colours.
pub fn first_gradient(document: &Document) -> usize {
    let colors = document.items.iter().filter(|(item, _)| matches!(item, Item::Color { .. })).count();
    BUILT_IN_COLORS + colors + 1
}

/// Builds the appearance from the declarations of a document. Errors are added to the scope.
pub fn build(document: &Document, scope: &mut Scope, files: &dyn Files) -> Appearance {
    let mut appearance = Appearance::default();
    let mut tropism: Option<Span> = None;
    for (item, span) in &document.items {
        match item {
            Item::Color { name, value } => {
                let rgb = color(value, scope).unwrap_or_default();
                appearance.colors.push(NamedColor { name: name.text.clone(), rgb });
            }
            Item::Gradient { name, stops } => {
                let stops: Vec<Rgb> =
                    stops.iter().map(|stop| color(stop, scope).unwrap_or_default()).collect();
                if let [_] = stops[..] {
                    scope.diagnostics.push(
                        Diagnostic::error("a gradient runs between two or more colours")
                            .at(*span, "there is one")
                            .help(format!("a single colour is declared `color {} = …`", name.text)),
                    );
                }
                appearance.gradients.push(Gradient { name: name.text.clone(), stops });
            }
            Item::Surface { name, file, texture } => {
                let known = &appearance.surfaces;
                let on_it = texture.as_ref().and_then(|text| picture(text, known, scope, files));
                if let Some(shape) = surface((name, file, on_it), *span, known, scope, files) {
                    appearance.surfaces.push(Arc::new(shape));
                }
            }
            Item::Contour { name, points } => {
                appearance.contours.push(Contour {
                    name: name.text.clone(),
                    points: contour(document, points, *span, scope).unwrap_or_default(),
                });
            }
            Item::Tropism { direction, strength } => {
                if let Some(before) = tropism.replace(*span) {
                    scope.diagnostics.push(
                        Diagnostic::error("the tropism is given twice")
                            .at(*span, "the second time")
                            .at(before, "the first time")
                            .help("its strength changes along a string with `@T(e)`"),
                    );
                }
                appearance.tropism = bend(document, direction, *strength, scope);
            }
            _ => {}
        }
    }
    let most = [
        appearance.colors.len(),
        appearance.gradients.len(),
        appearance.surfaces.len(),
        appearance.contours.len(),
    ];
    if most.into_iter().any(|count| count > MAX_DECLARED) {
        scope.diagnostics.push(
            Diagnostic::error(format!("more than {MAX_DECLARED} colours, gradients, surfaces or contours"))
                .help("many shades of one colour are a gradient: `;(name, v)`, v from 0 to 1"),
        );
    }
    appearance
}

/// `#rrggbb`, or `#rgb` for short.
pub fn color(text: &Text, scope: &mut Scope) -> Option<Rgb> {
    let digits = text.text.strip_prefix('#').unwrap_or_default();
    let value = u32::from_str_radix(digits, 16).ok().filter(|_| digits.bytes().all(|b| b != b'+'));
    match (value, digits.len()) {
        (Some(rgb), 6) => Some(rgb),
        (Some(short), 3) => {
            let [r, g, b] = [short >> 8, (short >> 4) & 15, short & 15].map(|digit| digit * 0x11);
            Some((r << 16) | (g << 8) | b)
        }
        _ => {
            scope.diagnostics.push(
                Diagnostic::error("this is no colour")
                    .at(text.span, "expected `#` and six hexadecimal digits")
                    .help("a colour is written \"#rrggbb\": two digits each of red, green and blue, such as \"#8b6cc9\""),
            );
            None
        }
    }
}

/// The picture on a surface, one with those of other surfaces if it is the same.
pub(crate) fn picture(
    text: &Text,
    known: &[Arc<SurfaceShape>],
    scope: &mut Scope,
    files: &dyn Files,
) -> Option<Arc<Picture>> {
    let pictures = || known.iter().filter_map(|shape| shape.texture.as_ref()).map(|texture| &texture.picture);
    if let Some(same) = pictures().find(|picture| *picture.path == *text.text) {
        return Some(same.clone());
    }
    let read = surface::read_picture(&text.text, files).and_then(|picture| {
        let mut all: Vec<&Arc<Picture>> = Vec::new();
        for picture in pictures() {
            if !all.iter().any(|known| Arc::ptr_eq(known, picture)) {
                all.push(picture);
            }
        }
        let texels: usize = all.iter().map(|picture| picture.texels().len()).sum();
        surface::within_limit(texels + picture.texels().len()).map(|()| Arc::new(picture))
    });
    read.map_err(|fault| {
        let mut diagnostic = Diagnostic::error(format!("the picture `{}` cannot be read", text.text));
        diagnostic = diagnostic.at(text.span, fault.what);
        scope.diagnostics.push(match fault.help {
            Some(help) => diagnostic.help(help),
            None => diagnostic,
        });
    })
    .ok()
}

fn surface(
    (name, file, picture): (&Name, &Text, Option<Arc<Picture>>),
    span: Span,
    known: &[Arc<SurfaceShape>],
    scope: &mut Scope,
    files: &dyn Files,
) -> Option<SurfaceShape> {
    if COMMAND_SURFACES.iter().any(|(command, _)| *command == &*name.text) {
        scope.diagnostics.push(
            Diagnostic::error(format!("`{}` cannot be a surface", name.text))
                .at(name.span, "this name is a command of the turtle")
                .help("choose another name"),
        );
        return None;
    }
    if let Some(before) = known.iter().find(|shape| shape.name == *name.text) {
        scope.diagnostics.push(
            Diagnostic::error(format!("the surface `{}` is declared twice", name.text))
                .at(name.span, "the second time")
                .at(before.span, "the first time")
                .help(advice::twice(&name.text)),
        );
        return None;
    }
    match surface::read(&file.text, picture.is_some(), files) {
        Ok(shape) => {
            let repeats = shape.places.iter().flatten().any(|x| !(0.0..=1.0).contains(x));
            let texture = picture.map(|picture| Texture { picture, repeats });
            Some(SurfaceShape { name: name.text.to_string(), span, texture, ..shape })
        }
        Err(fault) => {
            let place = match fault.line {
                Some(line) => format!("{}, line {line}: {}", file.text, fault.what),
                None => fault.what,
            };
            let message = format!("the surface `{}` cannot be read", name.text);
            scope.diagnostics.push(
                Diagnostic::error(message).at(file.span, place).help(fault.help.unwrap_or_else(|| {
                    "export the file again, or mend the line in a text editor".to_owned()
                })),
            );
            // The name counts as declared in spite of the error.
            Some(SurfaceShape { name: name.text.to_string(), span, ..SurfaceShape::default() })
        }
    }
}

fn contour(
    document: &Document,
    points: &[[Expression; 2]],
    span: Span,
    scope: &mut Scope,
) -> Option<Vec<[f64; 2]>> {
    const MOST: usize = 100;
    let all = &document.expressions;
    let mut values = Vec::with_capacity(points.len());
    for [x, y] in points {
        values.push([scope.constant_value(all, *x)?, scope.constant_value(all, *y)?]);
    }
    let area: f64 = (0..values.len())
        .map(|i| {
            let ([ax, ay], [bx, by]) = (values[i], values[(i + 1) % values.len()]);
            ax * by - ay * bx
        })
        .sum();
    let (fault, help) = if values.len() < 3 {
        (
            "a closed curve has three points or more",
            "add points: `(1, 0) (0, 1) (-1, 0) (0, -1)` is a round stem".to_owned(),
        )
    } else if values.len() > MOST {
        (
            "this has more than 100 points",
            "leave some out: the points are joined by a smooth curve".to_owned(),
        )
    } else if values.iter().flatten().any(|x| x.abs() > 1e6) {
        (
            "coordinates are in parts of the stem's radius, at most 1e6",
            "a point on a round stem is `(1, 0)`".to_owned(),
        )
    } else if area < 0.0 {
        let turned: Vec<String> = values.iter().rev().take(12).map(|[x, y]| format!("({x}, {y})")).collect();
        let more = if values.len() > 12 { " …" } else { "" };
        let help = format!("write them the other way round: `{}{more}`", turned.join(" "));
        ("its points must go round the origin counter-clockwise", help)
    } else if area == 0.0 || area.is_nan() {
        (
            "its points enclose nothing",
            "spread them round the origin: `(1, 0) (0, 1) (-1, 0) (0, -1)`".to_owned(),
        )
    } else {
        return Some(values);
    };
    scope.diagnostics.push(Diagnostic::error("this contour is invalid").at(span, fault).help(help));
    None
}

fn bend(
    document: &Document,
    direction: &[Expression; 3],
    strength: Option<Expression>,
    scope: &mut Scope,
) -> Option<Tropism> {
    let all = &document.expressions;
    let [x, y, z] = direction.map(|e| scope.constant_value(all, e));
    let strength = strength.map_or(Some(0.0), |e| scope.constant_value(all, e));
    let direction_is = [x?, y?, z?];
    let largest = direction_is.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
    if largest == 0.0 {
        let at = all.span(direction[0].root).to(all.span(direction[2].root));
        scope.diagnostics.push(
            Diagnostic::error("this is no direction")
                .at(at, "all three are 0")
                .help("downwards is `tropism 0, -1, 0 strength 0.2`"),
        );
        return None;
    }
    // Scaled first: the square of 1e200 overflows.
    let scaled = direction_is.map(|c| c / largest);
    let length = scaled.iter().map(|c| c * c).sum::<f64>().sqrt();
    Some(Tropism { direction: scaled.map(|c| c / length), strength: strength? })
}

/// Warns of surfaces that no string contains.
pub fn unused_surfaces(appearance: &Appearance, is_used: impl Fn(&str) -> bool, scope: &mut Scope) {
    for shape in appearance.surfaces.iter().filter(|shape| !is_used(&shape.name)) {
        scope.diagnostics.push(
            Diagnostic::warning(format!("the surface `{}` is not used", shape.name))
                .at(shape.span, "declared here")
                .help(format!("draw it: `{}` in a string, or remove this line", shape.name)),
        );
    }
}

/// Help for an unknown surface.
pub fn surface_hint(name: &str, appearance: &Appearance) -> Option<String> {
    let declared = appearance.surfaces.iter().map(|shape| shape.name.as_str());
    let large = name.to_uppercase();
    if BUILT_IN_SURFACES.contains(&large.as_str()) {
        return Some(format!("did you mean `{large}`?"));
    }
    did_you_mean(name, declared).or_else(|| Some(format!("declare it: `surface {name} from \"file.s\"`")))
}
