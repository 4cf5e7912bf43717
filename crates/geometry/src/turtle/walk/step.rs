//! Steps: ways along the heading, straight or bent, in the shape at rest and as they are seen.

use super::super::bend::Bend;
use super::super::bent::{self, Bent, StemKey};
use super::super::error::ErrorKind;
use super::super::free::Passive;
use super::super::skeleton::{Carrier, Origin, Stem};
use super::super::{Error, SMALLEST_LENGTH};
use super::{DrawnModule, State, Walk};
use crate::scene::{MaterialId, Point, Segment, Vector, Width};

impl Walk<'_> {
    /// A step that is not drawn and makes no vertex: open polygons are put aside.
    pub(super) fn hop(&mut self, length: f64) -> Result<(), Error> {
        let open = std::mem::take(&mut self.polygons);
        let done = self.step(length, false);
        self.polygons = open;
        done
    }

    /// A step along the heading, drawn if `draw` and if no polygon is open; along an arc where there is a
    /// tropism.
    pub(super) fn step(&mut self, length: f64, draw: bool) -> Result<(), Error> {
        let [heading, left, _] = self.state.frame.vectors_by(&mut self.turns);
        let length = self.in_range(length)?;
        let has_mass = draw && self.polygons.is_empty() && length != 0.0;
        if self.state.part.is_some() && has_mass && matches!(self.state.width, Width::Default(_)) {
            return Err(self.error(ErrorKind::NoWidthFree));
        }
        let strain = match self.state.tissue {
            Some(_) if draw && self.polygons.is_empty() && length >= 0.0 => self.giving()?,
            _ => None,
        };
        let bend = Bend::new(heading, self.target, self.state.strength).filter(|_| length != 0.0);
        let is_curved = bend.is_some() || strain.is_some_and(|strain| strain != Vector::zeros());
        self.scene.lacked_accuracy |= is_curved && self.scene.accuracy <= 0.0;
        if let Some(bend) = bend {
            let mut pieces = bend.pieces(length, self.scene.accuracy);
            if let Some(strain) = strain {
                pieces = pieces.max(bent::pieces(strain, length, self.scene.accuracy));
            }
            let mut before = Vector::zeros();
            for i in 1..=pieces {
                let displacement = bend.displacement(length * i as f64 / pieces as f64);
                let way = displacement - before;
                before = displacement;
                if let Some(direction) = way.try_normalize(0.0) {
                    let turn = strain.map(|strain| {
                        let mut frame = self.state.frame;
                        frame.bend(bend.towards(), bend.turn(length * (i as f64 - 0.5) / pieces as f64));
                        in_scene(frame.vectors(), strain) * (length / pieces as f64)
                    });
                    self.go(way, (direction, left), turn, draw)?;
                }
                self.record_vertex();
            }
            self.state.frame.bend(bend.towards(), bend.turn(length));
        } else if length != 0.0 {
            let direction = heading * length.signum();
            match strain {
                Some(strain) => {
                    let pieces = bent::pieces(strain, length, self.scene.accuracy);
                    let part = length / pieces as f64;
                    let turn = in_scene(self.state.frame.vectors(), strain) * part;
                    for _ in 0..pieces {
                        self.go(heading * part, (direction, left), Some(turn), draw)?;
                    }
                }
                None => self.go(heading * length, (direction, left), None, draw)?,
            }
            self.record_vertex();
        } else {
            self.record_vertex();
        }
        if strain.is_some() {
            self.end_stem(length);
        }
        Ok(())
    }

    /// Begins a stem that gives way: its strain, in the turtle's axes.
    fn giving(&mut self) -> Result<Option<Vector>, Error> {
        let Some(tissue) = self.state.tissue else { return Ok(None) };
        let Width::Set(width) = self.state.width else {
            return Err(self.error(ErrorKind::NoWidth));
        };
        let DrawnModule { kind, lineage } = self.drawn;
        let key = StemKey::of(lineage, self.stems_drawn);
        self.stems_drawn += 1;
        if let Some(recorder) = &mut self.recorder {
            let (start, axes) = (self.state.position, self.state.frame.vectors());
            let stem = Stem {
                key,
                origin: Origin { kind, lineage, inside: self.inside },
                parent: self.state.stem,
                depth: self.depth,
                start,
                axes,
                end: start,
                end_axes: axes,
                length: 0.0,
                width,
                tissue,
            };
            match self.state.part {
                Some(part) => recorder.parts[part].stems.push(stem),
                None => {
                    recorder.stems.push(stem);
                    self.state.stem = Some(recorder.stems.len() - 1);
                }
            }
        }
        Ok(Some(self.strains.map_or_else(Vector::zeros, |strains| strains.strain(key, width))))
    }

    /// Notes where the stem that has been drawn ends.
    fn end_stem(&mut self, length: f64) {
        if let (Some(recorder), Some(stem)) = (&mut self.recorder, self.state.stem) {
            let stem = &mut recorder.stems[stem];
            stem.length = length;
            (stem.end, stem.end_axes) = (self.state.position, self.state.frame.vectors());
        }
    }

    /// Moves straight, by a displacement with its direction, and draws a segment if `draw`. `turn` is the turn of the frame on the way
    /// by which the shape that is seen differs from the one at rest, in the scene's axes.
    fn go(
        &mut self,
        way: Vector,
        (direction, across): (Vector, Vector),
        turn: Option<Vector>,
        draw: bool,
    ) -> Result<(), Error> {
        let from = self.state.position;
        let start = self.seen(from);
        self.advance(way)?;
        let mut direction = direction;
        let mut across = across;
        if let Some(bent) = self.state.bent {
            (direction, across) = (bent.vector(direction), bent.vector(across));
        }
        if let Some(turn) = turn.filter(|turn| *turn != Vector::zeros()) {
            let before = self.state.bent.unwrap_or_else(|| Bent::at(from));
            let (after, displacement) = before.along(from, way, turn);
            direction = displacement.try_normalize(0.0).unwrap_or(direction);
            // At a right angle to the chord, as the turtle's left is to a straight way.
            across -= direction * direction.dot(&across);
            across = across.try_normalize(1e-300).unwrap_or(across);
            self.state.bent = Some(after);
        }
        if self.state.position == from {
            return Ok(());
        }
        let end = self.seen(self.state.position);
        let (follows, grows_from) = (self.state.last.take(), self.state.parent.take());
        let node = std::mem::take(&mut self.state.node);
        if draw && self.polygons.is_empty() {
            self.check_body();
            let material = self.chosen().unwrap_or(MaterialId::STEM);
            if let Some(before) = follows {
                self.check_step(before, material, node);
            }
            self.note_width();
            let segment = Segment {
                start,
                end,
                direction,
                across,
                widths: [self.state.width; 2],
                contour: self.state.contour,
                material,
                owner: self.owner(),
                follows,
                grows_from,
            };
            self.state.run = if follows.is_some() { self.state.run + 1 } else { 1 };
            self.state.last = Some(self.scene.segments.len());
            self.scene.segments.push(segment);
            let is_load = self.state.tissue.is_none() || self.state.part.is_some();
            let carrier = match is_load {
                true => self.carrier(),
                false => {
                    self.note_passive(Passive::Bends);
                    Carrier::default()
                }
            };
            if let Some(recorder) = &mut self.recorder {
                recorder.segments.push(carrier);
            }
        }
        Ok(())
    }

    /// Where a point of the shape at rest is seen.
    pub(super) fn seen(&self, p: Point) -> Point {
        self.state.bent.map_or(p, |bent| bent.point(p))
    }

    /// Directions of the shape at rest as they are seen.
    pub(super) fn seen_axes(&mut self) -> [Vector; 3] {
        let axes = self.state.frame.vectors_by(&mut self.turns);
        self.state.bent.map_or(axes, |bent| axes.map(|axis| bent.vector(axis)))
    }

    /// What carries that which is drawn here.
    pub(super) fn carrier(&mut self) -> Carrier {
        let State { stem, part, tissue, rigid, .. } = self.state;
        if part.is_some() {
            self.note_passive(Passive::Falls);
        } else if stem.is_some() {
            self.note_passive(Passive::Bends);
        }
        Carrier { stem: stem.filter(|_| part.is_none()), part, solid: self.solid, tissue: tissue.or(rigid) }
    }

    /// Moves, with compensated summation (Neumaier 1974).
    fn advance(&mut self, by: Vector) -> Result<(), Error> {
        // A direction that is nearly an axis has parts far shorter than the whole.
        let by = by.map(|x| if x.abs() < SMALLEST_LENGTH { 0.0 } else { x });
        for i in 0..3 {
            let (old, step) = (self.state.position[i], by[i] + self.state.remainder[i]);
            let new = old + step;
            self.in_range(new)?;
            self.state.remainder[i] =
                if old.abs() >= step.abs() { (old - new) + step } else { (step - new) + old };
            self.state.position[i] = new;
        }
        Ok(())
    }
}

/// A strain about heading, left and up in the scene's axes.
fn in_scene([heading, left, up]: [Vector; 3], strain: Vector) -> Vector {
    heading * strain.x + left * strain.y + up * strain.z
}
