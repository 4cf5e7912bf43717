//! Scenes from strings written by hand, such as `F(2)[+(30)@L]F`.

use dlsys::model::{Kinds, Model, Successor};
use dlsys::scene::Scene;
use dlsys::structure::{Lineage, ModuleString};
use dlsys::turtle;

/// What the turtle draws for a string; the angle of a turn without a parameter is 45 degrees.
pub fn scene(text: &str) -> Scene {
    let mut model = Model {
        title: None,
        angle: 45.0,
        frames: None,
        parameters: Vec::new(),
        kinds: Kinds::default(),
        axiom: Successor::default(),
        rules: Vec::new(),
        interpretations: Vec::new(),
    };
    let string = modules(&mut model, text);
    let mut scene = Scene::default();
    turtle::draw(&model, &string, &mut scene).expect("drawable");
    scene
}

fn modules(model: &mut Model, text: &str) -> ModuleString {
    let mut string = ModuleString::default();
    let mut rest = text.trim_start();
    let mut place = 0;
    while let Some(first) = rest.chars().next() {
        let word = |c: char| c.is_alphanumeric() || c == '_';
        let length = match first {
            '@' => 1 + rest[1..].find(|c| !word(c)).unwrap_or(rest.len() - 1),
            c if c.is_alphabetic() => rest.find(|c| !word(c)).unwrap_or(rest.len()),
            c => c.len_utf8(),
        };
        let (name, after) = rest.split_at(length);
        let (arguments, after) = match after.strip_prefix('(') {
            Some(inside) => inside.split_once(')').expect("a closing parenthesis"),
            None => ("", after),
        };
        let parameters: Vec<f64> = arguments
            .split(',')
            .filter(|a| !a.is_empty())
            .map(|a| a.trim().parse().expect("a number"))
            .collect();
        let kind = model.kinds.intern(name, parameters.len());
        string.push(kind, parameters, 0.0, Lineage::of_axiom(place));
        place += usize::from(!kind.is_bracket());
        rest = after.trim_start();
    }
    string
}
