//! What a model says about looks, as materials and meshes: made once, and kept in the scene from frame to
//! frame.

use std::sync::Arc;

use crate::scene::{Color, MaterialId, Mesh, Palette, PatchFace, Point, Scene, Shape, Vector};
use dlsys_model::{Appearance, Model, Rgb, SurfaceShape};

/// Gives the scene the model's colours and surfaces, unless it has them.
pub(super) fn prepare(model: &Model, scene: &mut Scene) {
    let appearance = &model.appearance;
    if scene.prepared_for.as_ref().is_some_and(|known| Arc::ptr_eq(known, appearance)) {
        return;
    }
    dress(appearance, &Palette::default(), &[], scene);
}

/// Scenes without elements for a model and, in the order of their declarations, for its plants, the plants of these behind each.
/// They share materials and contours: what a plant draws can stand in the scene of the model as it is.
pub(super) fn prepare_all(model: &Model) -> Vec<Scene> {
    let mut scenes: Vec<Scene> = Vec::new();
    prepare_below(model, &mut scenes);
    if let Some(last) = scenes.last().cloned() {
        for scene in &mut scenes {
            scene.palette = scene.palette.completed(&last.palette);
            scene.contours = last.contours.clone();
        }
    }
    scenes
}

/// Recursion is bounded by the depth of plants in plants.
fn prepare_below(model: &Model, scenes: &mut Vec<Scene>) {
    let mut scene = Scene::default();
    let (palette, contours) =
        scenes.last().map_or_else(Default::default, |last| (last.palette.clone(), last.contours.clone()));
    dress(&model.appearance, &palette, &contours, &mut scene);
    scenes.push(scene);
    for plant in &model.scenery.plants {
        prepare_below(&plant.model, scenes);
    }
}

/// Gives a scene a model's colours, surfaces and contours, behind those that are known already.
fn dress(appearance: &Arc<Appearance>, known: &Palette, contours: &[Vec<[f64; 2]>], scene: &mut Scene) {
    let mut palette = palette(appearance, known);
    scene.shapes = appearance.surfaces.iter().map(|surface| shape(surface, &mut palette)).collect();
    scene.palette = palette;
    scene.first_contour = contours.len() as u32;
    let own = appearance.contours.iter().map(|contour| &contour.points);
    scene.contours = contours.iter().chain(own).cloned().collect();
    scene.prepared_for = Some(appearance.clone());
}

fn palette(appearance: &Appearance, known: &Palette) -> Palette {
    let color = |rgb: &Rgb| Color::hex(*rgb);
    known.beside(
        appearance.colors.iter().map(|c| (&*c.name, color(&c.rgb))),
        appearance.gradients.iter().map(|g| (&*g.name, g.stops.iter().map(color).collect())),
    )
}

/// Surfaces from files are in the colours that they bring with them, or in that of leaves, unless another is chosen. A picture on a surface stands in place of all of these.
fn shape(surface: &SurfaceShape, palette: &mut Palette) -> Shape {
    let point = |p: &[f64; 3]| Point::new(p[0], p[1], p[2]);
    let pictured = surface.texture.as_ref().map(|texture| {
        let name = surface.name.trim_start_matches('@');
        palette.add_textured(name, texture)
    });
    if surface.patches.is_empty() {
        let vertices = surface.vertices.iter().map(point).collect();
        let normals: Vec<Vector> = surface.normals.iter().map(|n| point(n).coords).collect();
        let materials = if pictured.is_none() { &surface.materials[..] } else { &[] };
        let own: Vec<MaterialId> =
            materials.iter().map(|m| palette.add(&m.name, Color::hex(m.rgb))).collect();
        let painted = |i: usize| surface.painted.get(i).copied().flatten();
        let material = |i: usize| painted(i).and_then(|n| own.get(n as usize)).copied();
        let triangles = (surface.triangles.iter().enumerate())
            .map(|(i, corners)| (*corners, pictured.or_else(|| material(i)).unwrap_or(MaterialId::LEAF)));
        let mesh = Mesh::of_triangles(vertices, &normals, triangles);
        return Shape::of_mesh(match pictured {
            Some(_) => mesh.under_picture(surface.places.clone()),
            None => mesh,
        });
    }
    let face = |net: &[[f64; 3]; 16]| PatchFace {
        net: [0, 4, 8, 12].map(|row| [0, 1, 2, 3].map(|column| point(&net[row + column]))),
        material: pictured.unwrap_or(MaterialId::LEAF),
        takes_tint: pictured.is_none(),
        has_picture: pictured.is_some(),
    };
    Shape::of_patches(surface.patches.iter().map(face).collect())
}
