//! The rest configuration of a tree of segments at one instant: geometry, material, and the prescribed motion.

use crate::{Error, Matrix, Vector};

/// Position of a frame relative to another, with its prescribed motion.
///
/// The other frame is the *end* frame of the parent segment, or the world for a root. All vectors are components along the axes of that
/// other frame; rates are time derivatives of those components.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// Axes of the frame as columns: heading, left, up. Must be a rotation.
    pub rotation: Matrix,
    /// Origin of the frame, in m.
    pub offset: Vector,
    /// Angular velocity relative to the other frame, in 1/s.
    pub angular_velocity: Vector,
    /// Rate of `offset`, in m/s.
    pub velocity: Vector,
    /// Rate of `angular_velocity`, in 1/s².
    pub angular_acceleration: Vector,
    /// Rate of `velocity`, in m/s².
    pub acceleration: Vector,
}

impl Joint {
    /// A joint without prescribed motion.
    pub fn fixed(rotation: Matrix, offset: Vector) -> Joint {
        let zero = Vector::zeros();
        Joint {
            rotation,
            offset,
            angular_velocity: zero,
            velocity: zero,
            angular_acceleration: zero,
            acceleration: zero,
        }
    }
}

impl Default for Joint {
    /// The straight continuation of the parent; for a root, the origin of the world with heading +x.
    fn default() -> Joint {
        Joint::fixed(Matrix::identity(), Vector::zeros())
    }
}

/// A piece of a stem: a circular arc or a helix, because its strain is the same along its length.
///
/// Its frames are (heading, left, up) with `heading × left = up`, as the turtle's. A strain is the angular velocity of that frame along the
/// arc, in 1/m, as components in the frame itself: `x` is the twist about the heading, `y` and `z` are the curvatures about left and up.
/// Material points are known by the fraction of the length at which they stand, so a length with a rate stretches uniformly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Index of the parent, smaller than the own index; `None` for a root.
    pub parent: Option<usize>,
    /// Base frame relative to the end frame of the parent, or to the world.
    pub joint: Joint,
    /// Length l in m; 0 is allowed.
    pub length: f64,
    /// Rate of the length, in m/s.
    pub length_rate: f64,
    /// Rate of `length_rate`, in m/s².
    pub length_acceleration: f64,
    /// Strain of the rest shape, in 1/m.
    pub rest: Vector,
    /// Rate of `rest`, in 1/(m s).
    pub rest_rate: Vector,
    /// Rate of `rest_rate`, in 1/(m s²).
    pub rest_acceleration: Vector,
    /// Diameter d of the circular section, in m.
    pub diameter: f64,
    /// Young's modulus E, in Pa.
    pub stiffness: f64,
    /// Mass per length, in kg/m.
    pub mass: f64,
    /// Damping time τ of the Kelvin-Voigt material, in s. A vibration of angular frequency ω has the damping ratio ωτ/2.
    pub damping: f64,
    /// Diameter of the cylinder that has the same drag, in m; 0 if air does not act on the segment.
    pub drag_diameter: f64,
    /// Whether the rest shape is the shape without weight. If not, it is the equilibrium under the weight.
    pub sag: bool,
    /// Whether the segment keeps its strain as it is: the rest shape, unless the state says otherwise. Its rate of strain does not count.
    pub rigid: bool,
}

impl Segment {
    /// A straight segment of a solid stem: mass per length from the density (kg/m³), drag on its own diameter, no prescribed motion.
    pub fn solid(parent: Option<usize>, length: f64, diameter: f64, stiffness: f64, density: f64) -> Segment {
        let zero = Vector::zeros();
        Segment {
            parent,
            joint: Joint::default(),
            length,
            length_rate: 0.0,
            length_acceleration: 0.0,
            rest: zero,
            rest_rate: zero,
            rest_acceleration: zero,
            diameter,
            stiffness,
            mass: density * std::f64::consts::PI * diameter * diameter / 4.0,
            damping: 0.0,
            drag_diameter: diameter,
            sag: true,
            rigid: false,
        }
    }

    /// Stiffness against twist, and against curvature about left and up: GJ, EI, EI in N m², with I = π d⁴/64, J = 2 I,
    /// G = E/(2(1 + ν)) and Poisson's ratio ν = 0.3.
    pub fn rigidity(&self) -> Vector {
        let squared = self.diameter * self.diameter;
        let bending = self.stiffness * std::f64::consts::PI * squared * squared / 64.0;
        Vector::new(bending / (1.0 + POISSON), bending, bending)
    }
}

impl Segment {
    /// The same segment without prescribed motion.
    pub fn held(&self) -> Segment {
        let zero = Vector::zeros();
        Segment {
            joint: Joint::fixed(self.joint.rotation, self.joint.offset),
            length_rate: 0.0,
            length_acceleration: 0.0,
            rest_rate: zero,
            rest_acceleration: zero,
            ..*self
        }
    }
}

/// Poisson's ratio of all tissues.
const POISSON: f64 = 0.3;

/// A rigid body fixed to a section of a segment: a leaf, a flower, a fruit, or a whole rigid subtree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// Section that carries the body, as a fraction of the length from 0 (base) to 1 (end).
    pub at: f64,
    /// Mass in kg.
    pub mass: f64,
    /// Centre of mass relative to the section, along the axes of its frame, in m.
    pub centre: Vector,
    /// Moment of inertia about the centre of mass, along the axes of the section's frame, in kg m².
    pub inertia: Matrix,
}

impl Load {
    /// A mass point in the section itself.
    pub fn point(at: f64, mass: f64) -> Load {
        Load { at, mass, centre: Vector::zeros(), inertia: Matrix::zeros() }
    }

    /// Root of the mean square of the distance of its masses from the section, in m.
    pub fn spread(&self) -> f64 {
        let own = if self.mass > 0.0 { 0.5 * self.inertia.trace() / self.mass } else { 0.0 };
        (self.centre.norm_squared() + own.max(0.0)).sqrt()
    }

    /// This body and another one of the same section as one; None for other sections, and for masses that are none.
    fn with(&self, other: &Load) -> Option<Load> {
        let mass = self.mass + other.mass;
        if self.at != other.at || !(self.mass >= 0.0 && other.mass >= 0.0 && mass.is_finite()) {
            return None;
        }
        let part = if mass > 0.0 { other.mass / mass } else { 0.0 };
        let arm = other.centre - self.centre;
        // The theorem of parallel axes, with the reduced mass.
        let apart = Matrix::identity() * arm.norm_squared() - arm * arm.transpose();
        let inertia = self.inertia + other.inertia + apart * (self.mass * part);
        Some(Load { at: self.at, mass, centre: self.centre + arm * part, inertia })
    }
}

/// A flat surface fixed to a section of a segment, which air pushes: the blade of a leaf.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plate {
    /// Section that carries the plate, as a fraction of the length from 0 (base) to 1 (end).
    pub at: f64,
    /// Centre relative to the section, along the axes of its frame, in m.
    pub centre: Vector,
    /// Unit normal, along the axes of the section's frame.
    pub normal: Vector,
    /// Area of one side, in m².
    pub area: f64,
}

/// The segments of a tree, or of several, with all that they carry.
///
/// ```
/// use dlsys_sway::{Load, Segment, Skeleton};
///
/// let mut skeleton = Skeleton::new();
/// let mut parent = None;
/// for _ in 0..10 {
///     parent = Some(skeleton.push(Segment::solid(parent, 0.05, 0.004, 1e9, 900.0)));
/// }
/// skeleton.load(Load::point(1.0, 0.002));     // carried by the segment pushed last
/// assert!(skeleton.check().is_ok());
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skeleton {
    segments: Vec<Segment>,
    loads: Vec<Load>,
    plates: Vec<Plate>,
    /// End of each segment's range in `loads`; it begins at the previous segment's.
    load_ends: Vec<u32>,
    /// End of each segment's range in `plates`.
    plate_ends: Vec<u32>,
}

impl Skeleton {
    /// A skeleton without segments.
    pub fn new() -> Skeleton {
        Skeleton::default()
    }

    /// Removes all segments, loads and plates; keeps the memory.
    pub fn clear(&mut self) {
        self.segments.clear();
        self.loads.clear();
        self.plates.clear();
        self.load_ends.clear();
        self.plate_ends.clear();
    }

    /// Appends a segment and returns its index.
    pub fn push(&mut self, segment: Segment) -> usize {
        self.segments.push(segment);
        self.load_ends.push(self.loads.len() as u32);
        self.plate_ends.push(self.plates.len() as u32);
        self.segments.len() - 1
    }

    /// Adds a load to the segment pushed last. Without a segment, nothing happens. Loads of one section that follow each other become one: they are
    /// one rigid body.
    pub fn load(&mut self, load: Load) {
        let Some((end, before)) = self.load_ends.split_last_mut() else { return };
        let first = before.last().map_or(0, |end| *end as usize);
        match self.loads[first..].last_mut().and_then(|known| Some((known.with(&load)?, known))) {
            Some((both, known)) => *known = both,
            None => self.loads.push(load),
        }
        *end = self.loads.len() as u32;
    }

    /// Adds a plate to the segment pushed last. Without a segment, nothing happens.
    pub fn plate(&mut self, plate: Plate) {
        if let Some(end) = self.plate_ends.last_mut() {
            self.plates.push(plate);
            *end = self.plates.len() as u32;
        }
    }

    /// Number of segments.
    pub fn len(&self) -> usize {
        self.segments.len()
    }

    /// Whether there are no segments.
    pub fn is_empty(&self) -> bool {
        self.segments.is_empty()
    }

    /// The segments, parents before children.
    pub fn segments(&self) -> &[Segment] {
        &self.segments
    }

    /// The segments, for changes of their values. Parents must stay before children.
    pub fn segments_mut(&mut self) -> &mut [Segment] {
        &mut self.segments
    }

    /// The loads of a segment.
    pub fn loads(&self, segment: usize) -> &[Load] {
        range(&self.loads, &self.load_ends, segment)
    }

    /// The plates of a segment.
    pub fn plates(&self, segment: usize) -> &[Plate] {
        range(&self.plates, &self.plate_ends, segment)
    }

    /// Index of a segment's first plate among all plates.
    pub(crate) fn first_plate(&self, segment: usize) -> usize {
        segment.checked_sub(1).map_or(0, |before| self.plate_ends[before] as usize)
    }

    /// Number of plates of all segments.
    pub(crate) fn plate_count(&self) -> usize {
        self.plates.len()
    }

    /// Largest length of a path from a root along segments and offsets, in m: the scale of errors.
    pub fn extent(&self) -> f64 {
        let mut reach: Vec<f64> = Vec::with_capacity(self.len());
        let mut extent = 0.0_f64;
        for segment in &self.segments {
            let before = segment.parent.map_or(0.0, |parent| reach[parent] + segment.joint.offset.norm());
            reach.push(before + segment.length);
            extent = extent.max(before + segment.length);
        }
        extent
    }

    /// The segment `root` and all that it carries, as a skeleton of its own whose root is clamped where `base` says (world coordinates), with
    /// the indices of its segments in this skeleton.
    pub fn subtree(&self, root: usize, base: Joint) -> (Skeleton, Vec<usize>) {
        let mut part = Skeleton::new();
        let mut members = Vec::new();
        let mut places = vec![None; self.len()];
        for (index, segment) in self.segments.iter().enumerate().skip(root) {
            let parent = segment.parent.and_then(|parent| places[parent]);
            let joint = if index == root { base } else { segment.joint };
            if index != root && parent.is_none() {
                continue;
            }
            places[index] = Some(part.push(Segment { parent, joint, ..*segment }));
            members.push(index);
            self.loads(index).iter().for_each(|load| part.load(*load));
            self.plates(index).iter().for_each(|plate| part.plate(*plate));
        }
        (part, members)
    }

    /// The same skeleton without prescribed motion.
    pub fn held(&self) -> Skeleton {
        let mut held = self.clone();
        for segment in &mut held.segments {
            *segment = segment.held();
        }
        held
    }

    /// Checks that parents come before children and that every value is finite and in its range.
    ///
    /// # Errors
    ///
    /// [`Error::Value`] names the first segment and the value that is out of range.
    pub fn check(&self) -> Result<(), Error> {
        for (index, segment) in self.segments.iter().enumerate() {
            let fail = |what| Err(Error::Value { segment: index, what });
            if segment.parent.is_some_and(|parent| parent >= index) {
                return fail("its parent does not come before it");
            }
            for (value, what) in [
                (segment.length, "its length is negative or not finite"),
                (segment.diameter, "its diameter is negative or not finite"),
                (segment.stiffness, "its stiffness is negative or not finite"),
                (segment.mass, "its mass is negative or not finite"),
                (segment.damping, "its damping time is negative or not finite"),
                (segment.drag_diameter, "its drag diameter is negative or not finite"),
            ] {
                if !(value >= 0.0 && value.is_finite()) {
                    return fail(what);
                }
            }
            let joint = &segment.joint;
            let turned = joint.rotation.transpose() * joint.rotation - Matrix::identity();
            if turned.norm().is_nan() || turned.norm() >= 1e-6 {
                return fail("the rotation of its joint is not a rotation");
            }
            let motion = [
                joint.offset,
                joint.angular_velocity,
                joint.velocity,
                joint.angular_acceleration,
                joint.acceleration,
                segment.rest,
                segment.rest_rate,
                segment.rest_acceleration,
                Vector::new(segment.length_rate, segment.length_acceleration, 0.0),
            ];
            if !motion.iter().all(|vector| vector.iter().all(|value| value.is_finite())) {
                return fail("its motion is not finite");
            }
            for load in self.loads(index) {
                if !(load.mass >= 0.0 && load.mass.is_finite() && (0.0..=1.0).contains(&load.at)) {
                    return fail("the mass or the place of a load is out of range");
                }
            }
            for plate in self.plates(index) {
                if !(plate.area >= 0.0 && plate.area.is_finite() && (0.0..=1.0).contains(&plate.at)) {
                    return fail("the area or the place of a plate is out of range");
                }
            }
        }
        Ok(())
    }
}

fn range<'a, T>(all: &'a [T], ends: &[u32], segment: usize) -> &'a [T] {
    let start = segment.checked_sub(1).map_or(0, |before| ends[before] as usize);
    &all[start..ends[segment] as usize]
}
