//! The picture on ground of soil: where each point of the surface lies in it, and how it slides with the material.

use dlsys_geometry::scene::{MaterialId, Mesh};
use dlsys_ground as ground;
use dlsys_model::Bed;

/// The materials of a ground.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Earth {
    /// That of its surface, perhaps with a picture.
    pub surface: MaterialId,
    /// That of what lies on bodies or flies: a picture would not move with it.
    pub loose: MaterialId,
}

impl From<MaterialId> for Earth {
    fn from(material: MaterialId) -> Earth {
        Earth { surface: material, loose: material }
    }
}

/// The picture that a ground has, in SI.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Picture {
    /// Its width in m.
    size: f64,
}

impl Picture {
    pub(crate) fn of(bed: &Bed, metre: f64) -> Option<Picture> {
        bed.texture.as_ref().map(|_| Picture { size: bed.texture_size * metre })
    }

    /// A mesh of these points, in m, under the picture. What is seen at the first points has slid; the others have none of that.
    pub(crate) fn put_on(self, mesh: Mesh, points: &[ground::Vector], slid: &[[f64; 2]]) -> Mesh {
        let slid = slid.iter().copied().chain(std::iter::repeat([0.0; 2]));
        // Seen from above with x to the right, z points down.
        let place = |(point, [dx, dz]): (&ground::Vector, [f64; 2])| {
            [(point.x - dx) / self.size, (dz - point.z) / self.size]
        };
        let places = points.iter().zip(slid).map(place).collect();
        mesh.under_picture(places)
    }
}

#[cfg(test)]
mod tests {
    use super::{Earth, Picture};
    use crate::spray::with_spray;
    use dlsys_geometry::scene::MaterialId;
    use dlsys_ground::{Mesh, Vector};

    /// What lies on bodies, and what flies, has the colour of the soil: a picture would stay where it is while they move.
    #[test]
    fn the_picture_is_on_the_surface_only() {
        let at = |height: f64, slid: Vec<[f64; 2]>| Mesh {
            points: [Vector::zeros(), Vector::z(), Vector::x()]
                .map(|point| point + Vector::y() * height)
                .into(),
            triangles: vec![[0, 1, 2]],
            slid,
        };
        let mut mesh = at(0.0, vec![[0.0; 2]; 3]);
        mesh.append(&at(1.0, Vec::new()));
        let earth = Earth { surface: MaterialId::LEAF, loose: MaterialId::STEM };
        let spray = Mesh::octahedron(Vector::y() * 2.0, 1e-3);
        let scene = with_spray(mesh, &spray, (1.0, Some(Picture { size: 1.0 })), earth);
        let materials: Vec<_> = scene.faces.iter().map(|face| face.material).collect();
        assert_eq!((materials.len(), materials[0]), (10, earth.surface));
        assert!(materials[1..].iter().all(|material| *material == earth.loose));
    }
}
