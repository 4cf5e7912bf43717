//! Ground that gives way in pieces whose triangles stay the same while their points move, and its particles one by one, for files that animate points.

use std::sync::{Arc, PoisonError};

use dlsys_geometry::scene::{self, MaterialId, Owner, Placement, Point, Scene, Surface, Vector};
use dlsys_ground as ground;
use dlsys_tree::Lineage;

use crate::Error;
use crate::columns::from_metres;
use crate::motion::Motion;
use crate::picture::Earth;
use crate::spray::with_spray;
use crate::terrain::{TICKS, Terrain};

/// The name of ground in files.
const NAME: &str = "ground";
/// The number of productions that stands for none: the lineages of pieces are no others.
const NO_PRODUCTION: u64 = u64::MAX;
/// The same for particles.
const PARTICLE: u64 = u64::MAX - 1;

/// The pieces of a ground, with their meshes at the time at which they were made.
pub struct Quilt {
    pieces: Vec<(ground::Piece, Arc<scene::Mesh>)>,
    earth: Earth,
    /// A particle of the volume 1.
    particle: Arc<scene::Mesh>,
}

impl Quilt {
    /// The material of the ground.
    pub fn material(&self) -> MaterialId {
        self.earth.surface
    }

    /// Whether a surface is a particle: an octahedron of the volume 1, at its place and scale.
    pub fn is_particle(&self, surface: &Surface) -> bool {
        Arc::ptr_eq(&surface.mesh, &self.particle)
    }
}

impl<'m> Terrain<'m> {
    /// The times of the ticks after a time of the model, up to another one.
    pub fn ticks(&self, from: f64, to: f64) -> impl Iterator<Item = f64> {
        let place = self.works.place;
        let first = (place.seconds(from).max(0.0) * TICKS).floor() as u64 + 1;
        let times = (first..).map(move |number| place.time_at(number as f64 / TICKS));
        times.skip_while(move |time| *time <= from).take_while(move |time| *time <= to)
    }

    /// Pieces that serve for all times up to one of the model.
    ///
    /// # Errors
    /// As of [`Terrain::at`].
    pub fn quilt(
        &self,
        until: f64,
        earth: impl Into<Earth>,
        motion: Option<&Motion<'m>>,
    ) -> Result<Quilt, Error> {
        let earth = earth.into();
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let moment = self.reach(&mut state, until, motion)?;
        let metre = self.works.place.units.length;
        let with_mesh = |piece: ground::Piece| {
            let points = moment.ground.points(&piece);
            let triangles = piece.triangles.iter().map(|corners| (*corners, earth.surface));
            let mesh = scene::Mesh::of_triangles(from_metres(&points, metre), &[], triangles);
            // Where points move, their places in the picture stay: no program that plays such a file moves them.
            let mesh = match self.picture {
                Some(picture) => picture.put_on(mesh, &points, &[]),
                None => mesh,
            };
            (piece, Arc::new(mesh))
        };
        let octahedron = ground::Mesh::octahedron(ground::Vector::zeros(), 1.0);
        let particle =
            Arc::new(with_spray(ground::Mesh::default(), &octahedron, (1.0, None), earth.loose.into()));
        let pieces = moment.ground.pieces().into_iter().map(with_mesh).collect();
        Ok(Quilt { pieces, earth, particle })
    }

    /// Adds the pieces at a time of the model to a scene, what lies on bodies and sticks to them, and each particle.
    ///
    /// # Errors
    /// As of [`Terrain::at`].
    pub fn draw_quilt(
        &self,
        time: f64,
        quilt: &Quilt,
        motion: Option<&Motion<'m>>,
        scene: &mut Scene,
    ) -> Result<(), Error> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let moment = self.reach(&mut state, time, motion)?;
        drop(state);
        let metre = self.works.place.units.length;
        // What lies on bodies and sticks to them is the first owner, also where there is nothing.
        let owner = |number: usize| {
            let lineage = Lineage::of_axiom(0).child(NO_PRODUCTION, number);
            Owner { name: NAME.into(), lineage }
        };
        let owners: Vec<_> = (0..=quilt.pieces.len()).map(|number| scene.add_owner(owner(number))).collect();
        let mut add = |number: usize, mesh: Arc<scene::Mesh>, rest: Option<Arc<scene::Mesh>>| {
            let owner = owners[number];
            let axes = [Vector::x(), Vector::y(), Vector::z()];
            let placement = Placement::uniform(Point::origin(), axes, 1.0);
            scene.surfaces.push(Surface { mesh, patches: None, rest, placement, tint: None, owner });
        };
        for (number, (piece, rest)) in quilt.pieces.iter().enumerate() {
            let mesh = rest.moved(from_metres(&moment.ground.points(piece), metre));
            add(number + 1, Arc::new(mesh), Some(Arc::clone(rest)));
        }
        let mut heaps = moment.ground.heaps();
        heaps.append(&moment.ground.clods());
        if !heaps.triangles.is_empty() {
            let none = ground::Mesh::default();
            add(0, Arc::new(with_spray(heaps, &none, (metre, None), quilt.earth.loose.into())), None);
        }
        for ground::Flight { id, place, volume } in moment.ground.flights(self.works.place.seconds(time)) {
            let lineage = Lineage::of_axiom(0).child(PARTICLE, id as usize);
            let owner = scene.add_owner(Owner { name: NAME.into(), lineage });
            let axes = [Vector::x(), Vector::y(), Vector::z()];
            let placement = Placement::uniform(Point::from(place / metre), axes, volume.cbrt() / metre);
            let mesh = Arc::clone(&quilt.particle);
            scene.surfaces.push(Surface { mesh, patches: None, rest: None, placement, tint: None, owner });
        }
        Ok(())
    }
}
