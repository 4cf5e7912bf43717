//! Plants of other models at one instant: what each look draws, once, and where plants of it stand.

use std::collections::HashMap;
use std::sync::Arc;

use dlsys_geometry::scene::{Owner, Placement, Plant, Scene};
use dlsys_tree::Lineage;

use crate::part::{Catalogue, Form, Frame, Paint};
use crate::sample::Sampler;

/// A plant, and the module that placed it.
#[derive(Clone, Debug)]
pub(crate) struct Planted {
    pub(crate) kind: Arc<str>,
    pub(crate) lineage: Lineage,
    pub(crate) plant: Plant,
}

/// What plants of one look draw, in the coordinates of their model, in metres.
#[derive(Debug)]
pub(crate) struct Look {
    /// The kind of the module that placed the first of them.
    pub(crate) kind: Arc<str>,
    pub(crate) form: Form,
    pub(crate) paint: Paint,
    pub(crate) numbers: Vec<f32>,
}

/// A plant in its place.
#[derive(Debug)]
pub(crate) struct Stand {
    /// Number of its look.
    pub(crate) look: usize,
    pub(crate) kind: Arc<str>,
    pub(crate) lineage: Lineage,
    pub(crate) frame: Frame,
    pub(crate) scales: [f64; 3],
}

/// All plants of an instant.
#[derive(Debug, Default)]
pub(crate) struct Stands {
    pub(crate) looks: Vec<Look>,
    pub(crate) stands: Vec<Stand>,
    /// Looks by the place of their scene in memory; `None` for those that draw nothing.
    known: HashMap<*const Scene, Option<usize>>,
}

impl Planted {
    /// The plants of a scene.
    pub(crate) fn all(scene: &Scene) -> Vec<Planted> {
        let planted = |plant: &Plant| {
            let Owner { name, lineage } = scene.owner(plant.owner);
            Planted { kind: name.clone(), lineage: *lineage, plant: plant.clone() }
        };
        scene.plants.iter().map(planted).collect()
    }
}

impl Stands {
    /// These plants, and those in them. Surfaces go into the catalogue.
    pub(crate) fn new(planted: &[Planted], metres: f64, catalogue: &mut Catalogue) -> Stands {
        let mut stands = Stands::default();
        planted.iter().for_each(|planted| stands.add(planted, None, metres, catalogue));
        stands
    }

    /// Roughly, how many numbers they hold.
    pub(crate) fn size(&self) -> usize {
        self.looks.iter().map(|look| look.numbers.len()).sum::<usize>() + 30 * self.stands.len()
    }

    /// Adds a plant, and those in it. Recursion is bounded by the depth of plants in plants.
    fn add(&mut self, planted: &Planted, outer: Option<&Placement>, metres: f64, catalogue: &mut Catalogue) {
        let Planted { kind, lineage, plant } = planted;
        let place = match outer {
            None => plant.placement,
            Some(outer) => plant.placement.within(outer),
        };
        let scene = &raw const *plant.scene;
        let look = match self.known.get(&scene) {
            Some(known) => *known,
            None => {
                let look = look(planted, metres, catalogue);
                let number = look.map(|look| {
                    self.looks.push(look);
                    self.looks.len() - 1
                });
                self.known.insert(scene, number);
                number
            }
        };
        if let Some(look) = look {
            let frame = Frame::of_axes(place.origin * metres, place.axes);
            let (kind, lineage, scales) = (kind.clone(), *lineage, place.scales);
            self.stands.push(Stand { look, kind, lineage, frame, scales });
        }
        for inner in Planted::all(&plant.scene) {
            self.add(&inner, Some(&place), metres, catalogue);
        }
    }
}

/// What a plant draws, without the plants in it; `None` if that is nothing.
fn look(planted: &Planted, metres: f64, catalogue: &mut Catalogue) -> Option<Look> {
    let plant = &planted.plant;
    let sample =
        Sampler { default_width: plant.default_width(), metres, grown: true }.whole::<f32>(&plant.scene);
    if sample.modules.is_empty() {
        return None;
    }
    for (place, source) in &sample.sources {
        catalogue.surfaces.entry(*place).or_insert_with(|| source.clone());
    }
    Some(Look {
        kind: planted.kind.clone(),
        form: catalogue.form(sample.parts(0)),
        paint: catalogue.paint(sample.materials(0)),
        numbers: sample.numbers(0).to_vec(),
    })
}
