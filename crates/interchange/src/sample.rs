//! A scene as modules, each with its frame and with its parts in numbers.

use std::sync::Arc;

use dlsys_geometry::scene::{MaterialId, Owner, OwnerId, Point, Scene, Segment, Vector};
use dlsys_render::{Neck, necks};
use dlsys_tree::Lineage;

use crate::part::{Frame, Number, Part, Source};
use crate::stand::Planted;

/// Everything that is drawn at one instant.
#[derive(Debug)]
pub(crate) struct Sample<N = f32> {
    pub(crate) time: f64,
    /// In string order.
    pub(crate) modules: Vec<Module>,
    parts: Vec<Part>,
    materials: Vec<Option<MaterialId>>,
    numbers: Vec<N>,
    /// Surfaces that the parts name.
    pub(crate) sources: Vec<(usize, Source)>,
    /// Plants of other models.
    pub(crate) planted: Vec<Planted>,
}

/// A module that draws something.
#[derive(Clone, Debug)]
pub(crate) struct Module {
    pub(crate) lineage: Lineage,
    pub(crate) kind: Arc<str>,
    pub(crate) frame: Frame,
    /// Where its parts and its numbers begin.
    part: u32,
    number: u32,
}

impl<N> Default for Sample<N> {
    fn default() -> Sample<N> {
        let (modules, parts, materials) = (Vec::new(), Vec::new(), Vec::new());
        let (numbers, sources, planted) = (Vec::new(), Vec::new(), Vec::new());
        Sample { time: 0.0, modules, parts, materials, numbers, sources, planted }
    }
}

impl<N> Sample<N> {
    /// The parts of a module, by its number.
    pub(crate) fn parts(&self, i: usize) -> &[Part] {
        &self.parts[self.range(i, self.parts.len(), |m| m.part)]
    }

    /// Roughly, how many numbers it holds.
    pub(crate) fn size(&self) -> usize {
        self.numbers.len() + 30 * self.modules.len()
    }

    /// The materials of its parts.
    pub(crate) fn materials(&self, i: usize) -> &[Option<MaterialId>] {
        &self.materials[self.range(i, self.parts.len(), |m| m.part)]
    }

    /// The numbers of its parts, in its frame.
    pub(crate) fn numbers(&self, i: usize) -> &[N] {
        &self.numbers[self.range(i, self.numbers.len(), |m| m.number)]
    }

    fn range(&self, i: usize, end: usize, of: impl Fn(&Module) -> u32) -> std::ops::Range<usize> {
        let next = self.modules.get(i + 1).map_or(end, |next| of(next) as usize);
        of(&self.modules[i]) as usize..next
    }
}

/// An element of a scene, by kind and number.
#[derive(Clone, Copy)]
enum Element {
    Segment(usize),
    Polygon(usize),
    Surface(usize),
    Patch(usize),
}

/// Makes samples of scenes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sampler {
    /// Width of a line of default width, in units of the model.
    pub(crate) default_width: f64,
    /// Metres in a unit of the model.
    pub(crate) metres: f64,
    /// Whether stems go on into shoots at their ends.
    pub(crate) grown: bool,
}

impl Sampler {
    /// The elements of a scene, by module.
    fn elements(&self, scene: &Scene) -> Vec<(OwnerId, Element)> {
        let mut elements: Vec<(OwnerId, Element)> = Vec::new();
        let visible = |segment: &Segment| segment.widths.iter().any(|w| w.resolve(self.default_width) > 0.0);
        let segments = scene.segments.iter().enumerate().filter(|(_, segment)| visible(segment));
        elements.extend(segments.map(|(i, e)| (e.owner, Element::Segment(i))));
        elements.extend(scene.polygons.iter().enumerate().map(|(i, e)| (e.owner, Element::Polygon(i))));
        elements.extend(scene.surfaces.iter().enumerate().map(|(i, e)| (e.owner, Element::Surface(i))));
        elements.extend(scene.patches.iter().enumerate().map(|(i, e)| (e.owner, Element::Patch(i))));
        // Stable: elements of a module stay in order.
        elements.sort_by_key(|(owner, _)| *owner);
        elements
    }

    fn necks(&self, scene: &Scene) -> Vec<Option<Neck>> {
        if self.grown { necks(scene, self.default_width) } else { Vec::new() }
    }

    /// All of a scene as one module, in the coordinates of the scene; no module if it has nothing.
    pub(crate) fn whole<N: Number>(&self, scene: &Scene) -> Sample<N> {
        let mut sample = Sample::default();
        let elements = self.elements(scene);
        let Some((first, _)) = elements.first() else { return sample };
        let Owner { name, lineage } = scene.owner(*first);
        let frame = Frame::new(Point::origin(), Vector::y(), -Vector::x());
        sample.modules.push(Module { lineage: *lineage, kind: name.clone(), frame, part: 0, number: 0 });
        let necks = self.necks(scene);
        elements.iter().for_each(|(_, element)| self.add(scene, (*element, &necks), &frame, &mut sample));
        sample
    }

    /// The modules of a scene, in the order of its owners.
    pub(crate) fn sample<N: Number>(&self, time: f64, scene: &Scene) -> Sample<N> {
        let elements = self.elements(scene);
        let necks = self.necks(scene);
        let mut sample = Sample { time, ..Sample::default() };
        for group in elements.chunk_by(|a, b| a.0 == b.0) {
            let frame = self.frame(scene, group);
            let Owner { name, lineage } = scene.owner(group[0].0);
            let (part, number) = (sample.parts.len() as u32, sample.numbers.len() as u32);
            sample.modules.push(Module { lineage: *lineage, kind: name.clone(), frame, part, number });
            for (_, element) in group {
                self.add(scene, (*element, &necks), &frame, &mut sample);
            }
        }
        sample
    }

    /// The frame of a module: that of a single stem or surface, so that its shape is a matter of sizes only; else that of the turtle at the beginning of the
    /// module.
    fn frame(&self, scene: &Scene, group: &[(OwnerId, Element)]) -> Frame {
        let at = |p: Point| p * self.metres;
        match group {
            [(_, Element::Segment(i))] => {
                let segment = &scene.segments[*i];
                Frame::new(at(segment.start), segment.direction, segment.across)
            }
            [(_, Element::Surface(i))] => {
                let place = &scene.surfaces[*i].placement;
                Frame::new(at(place.origin), place.axes[0], place.axes[1])
            }
            _ => {
                let pose = group.first().and_then(|(owner, _)| scene.poses.get(owner.index()));
                let place = |pose: &dlsys_geometry::turtle::Pose| {
                    Frame::new(at(pose.position), pose.axes[0], pose.axes[1])
                };
                let origin = || Frame::new(Point::origin(), Vector::y(), -Vector::x());
                pose.map_or_else(origin, place)
            }
        }
    }

    fn add<N: Number>(
        &self,
        scene: &Scene,
        (element, necks): (Element, &[Option<Neck>]),
        frame: &Frame,
        sample: &mut Sample<N>,
    ) {
        let metres = self.metres;
        let numbers = &mut sample.numbers;
        let mut put = |v: Vector| numbers.extend(v.iter().map(|x| N::of(*x)));
        let point = |p: Point| frame.local(p * metres - frame.origin);
        let (part, material) = match element {
            Element::Segment(i) => {
                let segment = &scene.segments[i];
                let radii = segment.widths.map(|w| w.resolve(self.default_width) / 2.0 * metres);
                let neck = necks.get(i).copied().flatten();
                let start = neck.map_or(radii[0], |neck| neck.radius * metres);
                let [along, across] = [segment.direction, segment.across].map(|axis| frame.local(axis));
                let axes = [across, along.cross(&across), along];
                put(point(segment.start));
                put(point(segment.end));
                axes.iter().for_each(|axis| put(axis * start));
                axes.iter().for_each(|axis| put(axis * radii[1]));
                let part = match neck {
                    Some(neck) => {
                        let length = (segment.end - segment.start).norm();
                        let part = if length > 0.0 { neck.length / length } else { 0.0 };
                        put(point(segment.start + segment.direction * neck.length));
                        axes.iter().for_each(|axis| put(axis * (radii[0] + (radii[1] - radii[0]) * part)));
                        Part::Shoot(segment.contour)
                    }
                    None => Part::Stem(segment.contour),
                };
                (part, Some(segment.material))
            }
            Element::Polygon(i) => {
                let polygon = &scene.polygons[i];
                polygon.vertices.iter().for_each(|p| put(point(*p)));
                (Part::Polygon(polygon.vertices.len() as u32), Some(polygon.material))
            }
            Element::Surface(i) => {
                let surface = &scene.surfaces[i];
                let source = Source::of(surface);
                let place = source.place();
                let part = if surface.rest.is_some() {
                    let vertices = &surface.mesh.vertices;
                    vertices.iter().for_each(|p| put(point(surface.placement.point(*p))));
                    Part::Net(place, vertices.len() as u32)
                } else {
                    put(point(surface.placement.origin));
                    for ((axis, scale), limit) in
                        surface.placement.axes.iter().zip(surface.placement.scales).zip(source.limits())
                    {
                        put(frame.local(*axis) * (scale * limit * metres));
                    }
                    Part::Surface(place)
                };
                if sample.sources.iter().all(|known| known.0 != place) {
                    sample.sources.push((place, source));
                }
                (part, surface.tint)
            }
            Element::Patch(i) => {
                let patch = &scene.patches[i];
                patch.net.iter().flatten().for_each(|p| put(point(*p)));
                (Part::Patch, Some(patch.material))
            }
        };
        sample.parts.push(part);
        sample.materials.push(material);
    }
}
