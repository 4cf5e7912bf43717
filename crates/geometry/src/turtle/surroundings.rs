//! What a model declares of light, sky, camera and floor, at the time of a string.

use super::{COORDINATE_LIMIT, Error, ErrorKind};
use crate::scene::{Color, Point, Surroundings, Vector, Viewpoint};
use dlsys_diagnostic::Span;
use dlsys_expr::Program;
use dlsys_model::{Camera, Model};
use dlsys_tree::Lineage;

/// The surroundings at a time.
///
/// # Errors
/// A direction without a length, a camera that stands where it looks, an angle that is none, or a number that is none.
pub fn surroundings(model: &Model, time: f64) -> Result<Surroundings, Error> {
    let scenery = &model.scenery;
    let mut found = Surroundings {
        sky: scenery.sky.map(|colors| colors.map(Color::hex)),
        floor: scenery.ground,
        floor_color: scenery.ground_color.map(Color::hex),
        ..Surroundings::default()
    };
    if let Some((program, span)) = &scenery.light {
        let values = evaluate(program, time, ("light", *span))?;
        let direction = Vector::new(values[0], values[1], values[2]);
        if direction == Vector::zeros() {
            return Err(fault("light", *span, time, "its direction is 0, 0, 0"));
        }
        found.sun = Some(direction);
    }
    if let Some(Camera { program, span }) = &scenery.camera {
        let values = evaluate(program, time, ("camera", *span))?;
        let (eye, aim) = (Point::from_slice(&values[..3]), Point::from_slice(&values[3..6]));
        if eye == aim {
            return Err(fault("camera", *span, time, "it looks at the point where it stands"));
        }
        let angle = values.get(6).copied().unwrap_or(Camera::ANGLE);
        let [least, greatest] = Camera::ANGLES;
        if !(least..=greatest).contains(&angle) {
            let why = format!("its angle of view is {angle}, not from {least} to {greatest} degrees");
            return Err(fault("camera", *span, time, &why));
        }
        found.camera = Some(Viewpoint { eye, aim, angle });
    }
    Ok(found)
}

fn evaluate(program: &Program, time: f64, (name, span): (&str, Span)) -> Result<Vec<f64>, Error> {
    let mut values = vec![0.0; program.outputs()];
    program.eval(&[time], &mut Vec::new(), &mut values);
    match values.iter().find(|value| value.is_nan() || value.abs() > COORDINATE_LIMIT) {
        Some(value) => Err(fault(name, span, time, &format!("a number of it is {value}"))),
        None => Ok(values),
    }
}

fn fault(name: &str, span: Span, time: f64, why: &str) -> Error {
    let kind = ErrorKind::BadSurroundings { why: why.to_owned() };
    Error { kind, name: name.to_owned(), lineage: Lineage::of_axiom(0), span: Some(span), time }
}
