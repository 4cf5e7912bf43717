//! A scene as detailed as a picture shows it: triangles of what is large, and thin stems as ribbons that face the viewer.
//!
//! ```text
//! Scene ─Draft::new─▶ Draft { mesh, ribbons } ─draw─▶ Canvas of a picture or of shadows
//! ```
//!
//! Curved surfaces deviate from their shapes by less than half a pixel, tubes are as round as their width in pixels asks for, and a
//! stem of less than [`THIN`] pixels is a ribbon: two triangles, of the right width from any side. A plant of another model has drafts
//! of its own, one for each power of two of its size in the picture, which all plants of that look share.

use std::ops::Range;

use super::triangles::{Solid, Triangle, Triangles};
use super::tube::{TubeStyle, Tubes, sides_for};
use dlsys_geometry::scene::{MaterialId, Placement, Point, Scene, Texture, Vector};

/// Greatest distance of triangles from curved surfaces, in pixels. It is a bound that holds for the worst of surfaces; measured on petals
/// and leaves, the distance is a fifth of it.
const SLACK: f64 = 0.35;
/// Greatest distance of tubes from round ones, in pixels.
const ROUNDNESS: f64 = 0.1;
/// Stems of fewer pixels are ribbons.
const THIN: f64 = 2.5;
/// A cap of a ribbon, in parts of its radius: as long as it covers the area of half a disc.
const CAP: f64 = std::f64::consts::FRAC_PI_4;
/// Least cosine of a bend at which two ribbons meet in a common edge, and most that this edge is longer than they are wide.
const SHARPEST: f64 = 0.2;
const LONGEST: f64 = 1.5;
/// A mesh of more vertices is made piece by piece, each of about so many.
const LARGE: usize = 1 << 21;
const PIECE: usize = 1 << 16;
/// Sides of tubes of which there are more than numbers of their vertices.
const FEWEST_SIDES: usize = 3;
/// Most stems that tubes are made for in a drawing without depth.
const MOST_FLAT: usize = 100_000;

/// The accuracy of a picture, in scene units.
pub(super) struct Detail<'d, S> {
    /// Pixels in a scene unit at a place.
    pub(super) scale_at: S,
    /// The same for a surface within the ball with this middle and radius: its largest, or 0 if it is not seen. `None`: that at its
    /// place.
    pub(super) scale_of: Option<&'d dyn Fn(Point, f64) -> f64>,
    /// Triangles are no nearer to curved surfaces than this, in the plane of focus where a scene unit has `scale` pixels.
    pub(super) accuracy: f64,
    pub(super) scale: f64,
    /// The drawing has no depth: every stem is a tube with an outline of exact width.
    pub(super) is_flat: bool,
    /// Height of the floor, if there is one.
    pub(super) floor: Option<f64>,
}

/// A scene as triangles and ribbons.
pub(super) struct Draft<'s> {
    scene: &'s Scene,
    default_width: f64,
    pub(super) mesh: Triangles,
    /// Thin stems, by number.
    thin: Vec<u32>,
    /// By segment: the one that continues it, if both are thin.
    next: Vec<u32>,
    /// In place of a mesh that is very large.
    unmade: Option<Unmade<'s>>,
}

/// A mesh so large that it is made and dropped piece by piece.
struct Unmade<'s> {
    solid: Solid<'s>,
    /// Its items in the order of the mesh, and which of them are a piece.
    items: Vec<u32>,
    pieces: Vec<Range<usize>>,
    /// The normal of a plane that it is [pressed](Draft::flatten) into.
    plane: Option<Vector>,
}

impl<'s> Unmade<'s> {
    fn new(solid: Solid<'s>) -> Unmade<'s> {
        let items = solid.by_owner();
        let pieces = solid.parts(items.iter().map(|n| *n as usize), PIECE);
        Unmade { solid, items, pieces, plane: None }
    }
}

const NONE: u32 = u32::MAX;

/// A ribbon: corners at its two ends, left and right of its direction; the direction of its left, and the one that it faces.
pub(super) struct Ribbon {
    pub(super) corners: [[Point; 2]; 2],
    pub(super) side: Vector,
    pub(super) facing: Vector,
    pub(super) material: MaterialId,
}

impl<'s> Draft<'s> {
    pub(super) fn new<S: Fn(Point) -> f64>(
        scene: &'s Scene,
        default_width: f64,
        detail: &Detail<'_, S>,
    ) -> Draft<'s> {
        let wanted = |at: Point, (middle, radius): (Point, f64)| {
            let scale = detail.scale_of.map_or_else(|| (detail.scale_at)(at), |of| of(middle, radius));
            let scale = scale.max(f64::MIN_POSITIVE);
            accuracy(scale, detail.accuracy * detail.scale)
        };
        let is_few = detail.is_flat && scene.segments.len() <= MOST_FLAT;
        let is_thin: Vec<bool> = (scene.segments.iter())
            .map(|segment| {
                let width = segment.widths.map(|width| width.resolve(default_width));
                let widest = width[0].max(width[1]);
                !is_few && widest * (detail.scale_at)(nalgebra::center(&segment.start, &segment.end)) < THIN
            })
            .collect();
        let widest = |radius: f64, at: Point| radius * (detail.scale_at)(at);
        let flat_sides = detail.is_flat.then(|| {
            let radii = scene.segments.iter().map(|s| {
                let radius = |width: dlsys_geometry::scene::Width| width.resolve(default_width) / 2.0;
                widest(s.widths.map(radius).into_iter().fold(0.0, f64::max), s.start)
            });
            flat_sides(radii.fold(0.0, f64::max))
        });
        let sides = |radius, at| flat_sides.unwrap_or_else(|| sides_for(widest(radius, at), ROUNDNESS));
        let style = TubeStyle {
            default_width,
            sides: 0,
            accuracy: SLACK / detail.scale,
            grown: !detail.is_flat,
            floor: detail.floor,
            steady: false,
        };
        let mut tubes = Tubes::of(scene, style, sides, |i| !is_thin[i]);
        if tubes.counts.contains(&u32::MAX) {
            // There are not so many numbers.
            tubes = Tubes::of(scene, style, |_, _| FEWEST_SIDES, |i| !is_thin[i]);
        }
        let solid = Solid::of(scene, tubes, scene.drafted(wanted));
        let (mesh, unmade) = if solid.counts[0] as usize <= LARGE {
            (Triangles::of(&solid, |_| true), None)
        } else {
            (Triangles::with_capacity(0, 0, 0), Some(Unmade::new(solid)))
        };
        let thin: Vec<u32> = (0..scene.segments.len() as u32).filter(|i| is_thin[*i as usize]).collect();
        let mut next = vec![NONE; if thin.is_empty() { 0 } else { scene.segments.len() }];
        for &i in &thin {
            let follows = scene.segments[i as usize].follows;
            if let Some(before) = follows.filter(|before| is_thin[*before] && next[*before] == NONE) {
                next[before] = i;
            }
        }
        Draft { scene, default_width, mesh, thin, next, unmade }
    }

    /// Presses the stems of a drawing in a plane into that plane, which has this unit normal: in perspective, ends of tubes would be ellipses, and
    /// a diagram has straight ones. What hides what stays as it was.
    pub(super) fn flatten(&mut self, normal: Vector) {
        /// The part of the depth that is left.
        const LEFT: f64 = 1e-3;
        let Some(first) = self.scene.segments.first() else { return };
        if let Some(unmade) = &mut self.unmade {
            unmade.plane = Some(normal);
        }
        let depth = normal.dot(&first.start.coords);
        for vertex in &mut self.mesh.vertices {
            *vertex -= normal * ((normal.dot(&vertex.coords) - depth) * (1.0 - LEFT));
        }
    }

    /// Passes on the draft, or, if its mesh is very large, drafts of a piece of that each, and then one of its thin stems.
    pub(super) fn each_piece(&self, work: &mut dyn FnMut(&Draft<'s>)) {
        if let Some(unmade) = &self.unmade {
            for piece in &unmade.pieces {
                let mut draft = Draft {
                    mesh: Triangles::of_items(&unmade.solid, &unmade.items[piece.clone()]),
                    thin: Vec::new(),
                    next: Vec::new(),
                    unmade: None,
                    ..*self
                };
                if let Some(normal) = unmade.plane {
                    draft.flatten(normal);
                }
                work(&draft);
            }
        }
        work(self);
    }

    /// Of a triangle of which parts are cut out: where its corners lie in the picture, and that.
    pub(super) fn cut_out(&self, face: &Triangle) -> Option<([[f64; 2]; 3], &'s Texture)> {
        let texture = self.holes(face)?;
        Some((face.corners.map(|(vertex, _)| self.mesh.places[vertex as usize]), texture))
    }

    /// The picture on a triangle, if parts of it are cut out.
    pub(super) fn holes(&self, face: &Triangle) -> Option<&'s Texture> {
        if self.mesh.places.is_empty() {
            return None;
        }
        self.scene.palette.texture(face.material).filter(|texture| texture.picture.is_cut_out())
    }

    /// About how many triangles there are.
    pub(super) fn len(&self) -> usize {
        let unmade = self.unmade.as_ref().map_or(0, |unmade| 2 * unmade.solid.counts[0] as usize);
        self.mesh.faces.len() + unmade + 2 * self.thin.len()
    }

    /// The thin stems: ends and radii, each placed.
    pub(super) fn lines<'d>(
        &'d self,
        place: Option<&'d Placement>,
    ) -> impl Iterator<Item = ([Point; 2], [f64; 2])> + 'd {
        let scale = place.map_or(1.0, |place| place.largest());
        self.thin.iter().map(move |&i| {
            let segment = &self.scene.segments[i as usize];
            let ends = [segment.start, segment.end].map(|p| place.map_or(p, |place| place.point(p)));
            (ends, segment.widths.map(|width| width.resolve(self.default_width) / 2.0 * scale))
        })
    }

    /// Number of thin stems.
    pub(super) fn thin(&self) -> usize {
        self.thin.len()
    }

    /// Some of the thin stems as ribbons, each placed, facing the viewer.
    pub(super) fn ribbons<'d>(
        &'d self,
        stems: Range<usize>,
        place: Option<&'d Placement>,
        towards: impl Fn(Point) -> Vector + 'd,
    ) -> impl Iterator<Item = Ribbon> + 'd {
        let (width, scale) = (self.default_width, place.map_or(1.0, |place| place.largest()));
        let point = move |p: Point| place.map_or(p, |place| place.point(p));
        let direction = move |v: Vector| place.map_or(v, |place| place.turned(v));
        self.thin[stems].iter().filter_map(move |&i| {
            let segment = &self.scene.segments[i as usize];
            let radii = segment.widths.map(|w| w.resolve(width) / 2.0 * scale);
            if radii[0] <= 0.0 && radii[1] <= 0.0 {
                return None;
            }
            let along = direction(segment.direction);
            let ends = [point(segment.start), point(segment.end)];
            let before = segment.follows.filter(|before| self.next[*before] == i).map(|before| before as u32);
            let after = Some(self.next[i as usize]).filter(|next| *next != NONE);
            let view = towards(ends[0]);
            let across = |along: Vector, at: Point| along.cross(&towards(at)).try_normalize(1e-9);
            let side = across(along, ends[0]).unwrap_or_else(|| {
                let aside = if view.x.abs() < 0.7 { Vector::x() } else { Vector::y() };
                view.cross(&aside).normalize()
            });
            let corners = [0, 1].map(|end| {
                let (at, radius) = (ends[end], radii[end]);
                let own = across(along, at).unwrap_or(side);
                let other = if end == 0 { before } else { after };
                let shared = other.and_then(|other| {
                    let turned = direction(self.scene.segments[other as usize].direction);
                    let other = across(turned, at).filter(|_| turned.dot(&along) > SHARPEST)?;
                    let half = (own + other).try_normalize(1e-9)?;
                    let cos = half.dot(&own);
                    (cos * LONGEST >= 1.0).then(|| half * (radius / cos))
                });
                match shared {
                    Some(reach) => [at - reach, at + reach],
                    None => {
                        let end = at + along * (radius * CAP * if end == 0 { -1.0 } else { 1.0 });
                        [end - own * radius, end + own * radius]
                    }
                }
            });
            let facing = side.cross(&along);
            let facing = facing.try_normalize(1e-9).unwrap_or(view);
            Some(Ribbon { corners, side, facing, material: segment.material })
        })
    }
}

/// The greatest distance of triangles from curved surfaces where a scene unit has so many pixels, given the least one in pixels. It is
/// one of few values, so that patches that meet have the same pieces.
pub(super) fn accuracy(scale: f64, least: f64) -> f64 {
    let accuracy = SLACK.max(least) / scale;
    2_f64.powf((2.0 * accuracy.log2()).floor() / 2.0)
}

/// Sides of tubes in a drawing without depth, of which the widest has this radius in pixels: a multiple of four, so that both edges have
/// the width that was asked for.
fn flat_sides(radius: f64) -> usize {
    let wanted = std::f64::consts::PI / (1.0 - (ROUNDNESS / radius.max(ROUNDNESS)).min(1.0)).acos();
    (wanted.ceil() as usize).next_multiple_of(4).clamp(8, 64)
}
