//! Elements that stand where the turtle is: surfaces, plants, polygons, patches.

use super::super::bent::{Bent, PartKey};
use super::super::command::Command;
use super::super::error::{ErrorKind, Remark};
use super::super::free::FreePart;
use super::super::skeleton::Origin;
use super::super::{Error, Pose};
use super::{DrawnModule, Node, Outline, Walk};
use crate::scene::{
    GasSource, MaterialId, Patch, Placement, Point, Polygon, Seedling, Shape, SheetKey, SheetPlace,
    SourceKey, Surface, Vector,
};

impl Walk<'_> {
    /// Makes the position a vertex of the open polygon.
    pub(super) fn record_vertex(&mut self) {
        let position = self.seen(self.state.position);
        if let Some(open) = self.polygons.last_mut() {
            open.made += 1;
            if open.vertices.last() != Some(&position) {
                open.vertices.push(position);
            }
        }
    }

    /// Begins a patch, sets a point of it, or draws it.
    pub(super) fn patch(&mut self, command: Command, parameters: &[f64]) -> Result<(), Error> {
        let given = |i: usize| parameters.get(i).copied().unwrap_or(0.0);
        match command {
            Command::BeginPatch => self.patches.begin(given(0)).map_err(|fault| self.error(fault))?,
            Command::ControlPoint => {
                let set = self.patches.set([0, 1, 2].map(given), self.seen(self.state.position));
                set.map_err(|fault| self.error(fault))?;
            }
            _ => {
                let net = self.patches.net(given(0)).map_err(|fault| self.error(fault))?;
                let material = self.chosen().unwrap_or(MaterialId::PETAL);
                let owner = self.owner();
                // All in one place there is nothing to see, as at the birth of an organ.
                if net.iter().flatten().any(|p| *p != net[0][0]) {
                    self.scene.patches.push(Patch { net, material, owner });
                    let carrier = self.carrier();
                    if let Some(recorder) = &mut self.recorder {
                        recorder.patches.push(carrier);
                    }
                }
            }
        }
        Ok(())
    }

    /// Ends the innermost polygon, and draws it.
    pub(super) fn end_polygon(&mut self) {
        let Some(Outline { mut vertices, made, .. }) = self.polygons.pop() else {
            return self.remark(Remark::PolygonNotOpen);
        };
        // One that has yet to grow has all its vertices in one place.
        if made < 3 {
            self.remark(Remark::FewVertices(made));
        }
        while vertices.len() > 1 && vertices.first() == vertices.last() {
            vertices.pop();
        }
        let distinct = |p: &Point, among: &[Point]| among.iter().all(|q| p != q);
        let different =
            (0..vertices.len()).filter(|&i| distinct(&vertices[i], &vertices[..i])).take(3).count();
        if different == 3 {
            let material = self.chosen().unwrap_or(MaterialId::LEAF);
            let owner = self.owner();
            self.scene.polygons.push(Polygon { vertices, material, owner });
            let carrier = self.carrier();
            if let Some(recorder) = &mut self.recorder {
                recorder.polygons.push(carrier);
            }
        }
    }

    /// Puts a surface at the turtle's position: of one size (1), or of a width, a length and a height, which is
    /// the length if it is missing.
    pub(super) fn place(&mut self, shape: &Shape, sizes: &[f64]) -> Result<(), Error> {
        let [width, length, height] = match *sizes {
            [] => [1.0; 3],
            [size] => [size; 3],
            [width, length] => [width, length, length],
            [width, length, height, ..] => [width, length, height],
        };
        self.state.node = Node::Organ;
        // The axes are heading, left, up.
        let scales = [self.in_range(length)?, self.in_range(width)?, self.in_range(height)?];
        if scales.iter().all(|scale| *scale > 0.0) {
            let placement =
                Placement { origin: self.seen(self.state.position), axes: self.seen_axes(), scales };
            let (tint, owner) = (self.chosen(), self.owner());
            let Shape { mesh, patches } = shape.clone();
            self.scene.surfaces.push(Surface { mesh, patches, rest: None, placement, tint, owner });
            let carrier = self.carrier();
            if let Some(recorder) = &mut self.recorder {
                recorder.surfaces.push(carrier);
            }
        }
        Ok(())
    }

    /// Puts a plant of another model, born at the time given first, at the turtle's position. Its axes follow the turtle's.
    pub(super) fn plant(&mut self, plant: usize, parameters: &[f64]) -> Result<(), Error> {
        let birth = parameters.first().copied().unwrap_or(0.0);
        let age = self.time - birth;
        if self.state.part.is_some() {
            return Err(self.error(ErrorKind::FreePlant));
        }
        let scale = self.in_range(parameters.get(2).copied().unwrap_or(1.0))?;
        if age < 0.0 || scale <= 0.0 {
            return Ok(());
        }
        let [heading, left, up] = self.seen_axes();
        let placement = Placement::uniform(self.seen(self.state.position), [-left, heading, up], scale);
        let (seed, owner) = (parameters.get(1).copied(), self.owner());
        self.scene.seedlings.push(Seedling { plant, birth, age, seed, placement, owner });
        Ok(())
    }

    /// Notes a sheet at the turtle's position. Its axes follow the turtle's, as those of a plant do.
    pub(super) fn drape(&mut self, sheet: usize) -> Result<(), Error> {
        if self.state.part.is_some() {
            return Err(self.error(ErrorKind::FreeSheet));
        }
        // Behind `@E(0)`, too, what bends is below.
        if self.state.tissue.or(self.state.rigid).is_some() {
            return Err(self.error(ErrorKind::BentSheet));
        }
        let DrawnModule { kind, lineage } = self.drawn;
        let key = SheetKey { module: lineage.id, number: self.sheets_drawn };
        self.sheets_drawn += 1;
        let [heading, left, up] = self.seen_axes();
        let placement = Placement::uniform(self.seen(self.state.position), [-left, heading, up], 1.0);
        let origin = Origin { kind, lineage, inside: self.inside };
        let (tint, owner) = (self.chosen(), self.owner());
        self.scene.sheets.push(SheetPlace { key, origin, sheet, placement, tint, owner });
        Ok(())
    }

    /// Notes a source of gas at the turtle's position: the number of the gas, the rate, and the radius.
    pub(super) fn let_out(&mut self, parameters: &[f64]) -> Result<(), Error> {
        let mut given = parameters.iter().copied();
        let mut next = || given.next().unwrap_or(0.0);
        let (number, rate, radius) = (next().round(), next(), next());
        let key = SourceKey { module: self.drawn.lineage.id, number: self.sources_drawn };
        self.sources_drawn += 1;
        let count = self.model.scenery.gases.len();
        if !(1.0..=count as f64).contains(&number) {
            self.remark(Remark::NoGas(number, count));
            return Ok(());
        }
        /// What is nearer to 0 is the rounding of something that is 0.
        const ROUNDING: f64 = -1e-9;
        if rate < ROUNDING {
            self.remark(Remark::NegativeRate(rate));
        }
        let DrawnModule { kind, lineage } = self.drawn;
        let source = GasSource {
            key,
            origin: Origin { kind, lineage, inside: self.inside },
            gas: number as usize - 1,
            at: self.seen(self.state.position),
            rate: self.in_range(rate.max(0.0))?,
            radius: self.in_range(radius.abs())?,
        };
        self.scene.sources.push(source);
        Ok(())
    }

    /// Lets go what follows, to the end of the branch: it is seen where its flight has led it.
    pub(super) fn let_go(&mut self) {
        let DrawnModule { kind, lineage } = self.drawn;
        let key = PartKey { module: lineage.id, number: self.parts_drawn.0 };
        let rest = Pose { position: self.state.position, axes: self.state.frame.vectors() };
        if let Some(strains) = self.strains {
            match strains.flight(key) {
                Some(seen) => self.state.bent = Some(Bent::between(&rest, &seen)),
                None if self.recorder.is_none() => self.remark(Remark::HeldBack),
                None => {}
            }
        }
        let pose = self.pose();
        // The frame of a module that draws nothing before it is that of the part.
        if self.scene.notes_poses && self.owner.is_none() {
            self.start = Some(pose);
        }
        if let Some(recorder) = &mut self.recorder {
            let origin = Origin { kind, lineage, inside: self.inside };
            let (pieces, stems, points) = Default::default();
            recorder.parts.push(FreePart { key, origin, pose, pieces, stems, points });
        }
        let state = &mut self.state;
        state.part = Some(self.parts_drawn.1);
        (state.stem, state.last, state.parent) = (None, None, None);
        self.parts_drawn = (self.parts_drawn.0 + 1, self.parts_drawn.1 + 1);
    }

    /// Moves to the ground below or above, without a vertex of a polygon.
    pub(super) fn set_down(&mut self) {
        let scenery = &self.model.scenery;
        if let Some(bent) = self.state.bent {
            // Below the place where the turtle is seen, which is then also its place at rest.
            let mut there = bent.point(self.state.position);
            let Some(height) = scenery.surface(there.x, there.z) else { return };
            there.y = height;
            self.state.bent = Some(bent.put(there, there));
            (self.state.position, self.state.remainder) = (there, Vector::zeros());
        } else {
            let at = self.state.position;
            let Some(height) = scenery.surface(at.x, at.z).filter(|height| *height != at.y) else { return };
            (self.state.position.y, self.state.remainder.y) = (height, 0.0);
        }
        self.state.last = None;
    }
}
