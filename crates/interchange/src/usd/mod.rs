//! Animated USD in text (`.usda`): lives once, as abstract prims with samples of their points by age; a prim for each module, which references its life with
//! the module's birth as the offset of time.
//!
//! Points between samples are interpolated linearly and turns spherically, as USD says. A prim that is not seen is invisible, and its scale is 0, too, because
//! some importers take no visibility that changes. References are not instanceable: Blender 5.0 draws wrong shapes for instances with offsets.

mod shape;
mod text;
pub(crate) mod varying;

use std::collections::HashMap;

use dlsys_geometry::scene::{Color, MaterialId, Palette, Texture};
use dlsys_render::{GENERATOR, pictures, plain_name, push_number};

use crate::gases::GasFrame;
use crate::life::Life;
use crate::mesh::Cutter;
use crate::motion::{Clock, Moved};
use crate::track::Phase;
use crate::{Growth, Options, linear};
use shape::{Form, Primitive, Samples, Tolerance};
use text::{BRACES, Identifiers, PARENTHESES, Text, entry, list, quoted, tuple, tuples};

/// Time codes in a second: frames of film, and of Blender unless it is told otherwise.
const RATE: f64 = 24.0;
/// Decimals of normals, and of turns and colours.
const OF_NORMALS: usize = 2;
const OF_TURNS: usize = 6;
const OF_COLORS: usize = 4;
const OF_PLACES: usize = 5;
/// The last decimal of points, in parts of the accuracy.
const LAST_DECIMAL: f64 = 0.05;

/// Parts of the accuracy. With those of samples (0.18) and of modules that share a life (0.25) they are less than 1 by what rounding needs.
const OF_TRIANGLES: f64 = 0.33;
const OF_TRACKS: f64 = 0.04;
const OF_SIZE: f64 = 0.02;
const OF_SHAPE: f64 = 0.15;

/// A layer that is being written.
struct Writer<'a> {
    growth: &'a Growth,
    cutter: Cutter<'a>,
    clock: Clock,
    /// Decimals of points.
    decimals: usize,
    text: Text,
    /// Names of materials; the floor has none in the palette.
    materials: HashMap<Option<MaterialId>, String>,
}

/// The text of a run.
pub(crate) fn file(growth: &Growth) -> Vec<u8> {
    let decimals = decimals(growth.options.tolerance());
    let mut writer = Writer {
        growth,
        cutter: growth.cutter(OF_TRIANGLES),
        clock: growth.clock(),
        decimals,
        text: Text::default(),
        materials: HashMap::new(),
    };
    writer.layer();
    writer.text.finish()
}

/// The part of its thickness that counts as accuracy for the points of a shape, of which the last decimal is a part; what is thinner than
/// the second part of its length is flat.
const OF_THICKNESS: f64 = 0.2;
const FLAT: f64 = 1e-6;

/// Decimals of points for an accuracy in metres.
fn decimals(tolerance: f64) -> usize {
    (-(LAST_DECIMAL * tolerance).log10()).ceil().clamp(0.0, 300.0) as usize
}

/// Decimals of points with which a shape, between two corners at each of some ages, keeps its thickness when it is largest, however small
/// that is beside the scene.
fn fine_decimals(bounds: &[[[f32; 3]; 2]]) -> usize {
    let sizes =
        bounds.iter().map(|[least, most]| [0, 1, 2].map(|i| f64::from(most[i]) - f64::from(least[i])));
    let longest = |sizes: &[f64; 3]| sizes.iter().copied().fold(0.0, f64::max);
    let Some(sizes) = sizes.max_by(|a, b| longest(a).total_cmp(&longest(b))) else { return 0 };
    let longest = longest(&sizes);
    let thinnest = sizes.into_iter().filter(|size| *size > FLAT * longest).fold(longest, f64::min);
    if thinnest > 0.0 { decimals(OF_THICKNESS * thinnest) } else { 0 }
}

/// The first lines of a layer, for a run between two times; codes in a second, and the last code.
fn header(text: &mut Text, title: &str, [first, last]: [f64; 2], options: &Options, (rate, end): (f64, f64)) {
    text.line("#usda 1.0");
    text.block("", PARENTHESES, |text| {
        text.line("defaultPrim = \"Plant\"");
        text.line(&format!("doc = {}", quoted(&format!("{title}, by {GENERATOR}"))));
        text.block("customLayerData = ", BRACES, |text| {
            text.line(&entry("double", "first_time", first));
            text.line(&entry("double", "last_time", last));
            text.line(&entry("double", "metres_per_unit", options.metres));
            text.line(&entry("double", "seconds_per_unit", options.seconds));
            text.line(&entry("string", "title", quoted(title)));
        });
        text.line("metersPerUnit = 1");
        text.line("upAxis = \"Y\"");
        text.line(&format!("timeCodesPerSecond = {rate}"));
        text.line(&format!("framesPerSecond = {rate}"));
        if end > 0.0 {
            text.line("startTimeCode = 0");
            text.long("endTimeCode = ", |out| push_number(out, end, 5));
        }
    });
    text.line("");
}

impl Writer<'_> {
    /// The time code of an instant of the animation in seconds.
    fn code(seconds: f32) -> f64 {
        f64::from(seconds) * RATE
    }

    fn layer(&mut self) {
        let growth = self.growth;
        let of_shape = growth.options.tolerance();
        let tolerance = Tolerance { size: OF_SIZE * of_shape, shape: OF_SHAPE * of_shape };
        let form =
            |life: &Life| shape::form(life, &growth.tracks.phases[life.model], &self.cutter, tolerance);
        let lives: Vec<Form> = growth.lives.lives.iter().map(form).collect();
        let end = Writer::code(self.clock.end());
        let span = [growth.first, growth.last];
        header(&mut self.text, &growth.title, span, &growth.options, (RATE, end));
        let mut text = std::mem::take(&mut self.text);
        text.prim(
            "def Xform \"Plant\"",
            |text| {
                text.line(&format!("displayName = {}", quoted(&growth.title)));
                text.line("kind = \"component\"");
            },
            |text| {
                self.palette(text, &lives);
                text.block("class \"Lives\" ", BRACES, |text| {
                    for (i, form) in lives.iter().enumerate() {
                        self.life(text, i, form);
                    }
                });
                self.modules(text);
                self.floor(text);
                self.gases(text);
            },
        );
        self.text = text;
    }

    /// The materials that are used, in the order of the palette.
    fn palette(&mut self, text: &mut Text, lives: &[Form]) {
        let primitives = lives.iter().flat_map(|form| &form.primitives);
        let mut used: Vec<MaterialId> = primitives.map(|primitive| primitive.material).collect();
        used.sort_by_key(|id| id.index());
        used.dedup();
        let floor = self.growth.options.floor.map(|_| self.growth.floor_color);
        self.materials = materials(text, &self.growth.palette, &used, floor);
    }

    /// A life: its samples are at ages, in time codes.
    fn life(&self, text: &mut Text, number: usize, form: &Form) {
        text.block(&format!("def Xform \"Life_{number}\" "), BRACES, |text| {
            let mut names = Identifiers::default();
            for primitive in &form.primitives {
                let material = self.materials.get(&Some(primitive.material));
                let name = names.choose(material.map_or("Mesh", String::as_str));
                self.mesh(text, &name, Some(primitive.material), (primitive, form.size.as_ref()));
            }
        });
    }

    fn mesh(
        &self,
        text: &mut Text,
        name: &str,
        id: Option<MaterialId>,
        (primitive, size): (&Primitive, Option<&Samples<f64>>),
    ) {
        let color = match id {
            Some(id) => self.growth.palette.materials().get(id.index()).map(|material| material.color),
            None => Some(self.growth.floor_color),
        };
        let Primitive { triangles, pinned, points, normals, .. } = primitive;
        text.prim(
            &format!("def Mesh \"{name}\""),
            |text| text.line("prepend apiSchemas = [\"MaterialBindingAPI\"]"),
            |text| {
                text.line("uniform bool doubleSided = 1");
                let bounds: Vec<_> = points.values.iter().map(|points| bounds(points)).collect();
                let decimals = self.decimals.max(fine_decimals(&bounds));
                let extent = Samples { ages: points.ages.clone(), values: bounds };
                self.attribute(text, "float3[] extent", &extent, |out, corners| {
                    tuples(out, corners, decimals);
                });
                text.long("int[] faceVertexCounts = ", |out| {
                    list(out, &vec![3_u32; triangles.len() / 3], |out, n| push_number(out, n.into(), 0));
                });
                text.long("int[] faceVertexIndices = ", |out| {
                    list(out, triangles, |out, n| push_number(out, n.into(), 0));
                });
                if let Some(material) = self.materials.get(&id) {
                    text.line(&format!("rel material:binding = </Plant/Materials/{material}>"));
                }
                text.block("normal3f[] normals ", PARENTHESES, |text| {
                    text.line("interpolation = \"vertex\"")
                });
                self.attribute(text, "normal3f[] normals", normals, |out, all| tuples(out, all, OF_NORMALS));
                self.attribute(text, "point3f[] points", points, |out, all| tuples(out, all, decimals));
                if let Some(color) = color {
                    text.long("color3f[] primvars:displayColor = ", |out| {
                        list(out, &[rgb(color)], |out, rgb| tuple(out, rgb, OF_COLORS));
                    });
                }
                if !pinned.is_empty() {
                    text.block("texCoord2f[] primvars:st ", PARENTHESES, |text| {
                        text.line("interpolation = \"vertex\"")
                    });
                    text.long("texCoord2f[] primvars:st = ", |out| {
                        list(out, pinned, |out, place| tuple(out, place.map(f64::from), OF_PLACES));
                    });
                }
                text.line("uniform token subdivisionScheme = \"none\"");
                if let Some(size) = size {
                    let decimals = self.decimals + 1;
                    self.attribute(text, "float3 xformOp:scale", size, |out, size| {
                        tuple(out, [*size; 3], decimals);
                    });
                    text.line("uniform token[] xformOpOrder = [\"xformOp:scale\"]");
                }
            },
        );
    }

    /// An attribute with samples at ages, or with one value.
    fn attribute<T>(
        &self,
        text: &mut Text,
        name: &str,
        samples: &Samples<T>,
        write: impl Fn(&mut String, &T),
    ) {
        let codes = self.growth.options.seconds * RATE;
        match (&samples.values[..], samples.ages.is_empty()) {
            ([], _) => {}
            ([.., last], true) => text.long(&format!("{name} = "), |out| write(out, last)),
            (all, false) => text.samples(name, samples.ages.iter().map(|age| age * codes).zip(all), write),
        }
    }

    /// A prim for each module.
    fn modules(&self, text: &mut Text) {
        let growth = self.growth;
        let mut names = Identifiers::default();
        for taken in ["Materials", "Lives", "ground"] {
            names.choose(taken);
        }
        for (i, &number) in growth.lives.of_phase.iter().enumerate() {
            let phase = &growth.tracks.phases[i];
            let life = &growth.lives.lives[number];
            let moved =
                Moved { phase, life, clock: &self.clock, tolerance: OF_TRACKS * growth.options.tolerance() };
            let Some(lifetime) = moved.lifetime() else { continue };
            let usual = format!("{}_{}", plain_name(&phase.kind), phase.lineage.name());
            let name = names.choose(&match phase.number {
                0 => usual,
                again => format!("{usual}_{}", again + 1),
            });
            text.prim(
                &format!("def Xform \"{name}\""),
                |text| {
                    self.custom_data(text, phase);
                    let offset = (phase.birth - self.clock.first) * growth.options.seconds * RATE;
                    text.long(&format!("prepend references = </Plant/Lives/Life_{number}>"), |out| {
                        if offset != 0.0 {
                            out.push_str(" (offset = ");
                            push_number(out, offset, 6);
                            out.push(')');
                        }
                    });
                },
                |text| {
                    self.motion(text, &moved);
                    let sight = moved.sight(lifetime).into_iter();
                    let sight: Vec<(f64, bool)> =
                        sight.map(|(time, seen)| (Writer::code(time), seen)).collect();
                    let has_scale = !sight.is_empty();
                    if has_scale {
                        let visible = visibility(&sight, lifetime[0].is_some());
                        text.samples("token visibility", visible, |out, seen| {
                            out.push_str(if seen { "\"inherited\"" } else { "\"invisible\"" });
                        });
                        text.samples("float3 xformOp:scale", sight, |out, seen| {
                            out.push_str(if seen { "(1,1,1)" } else { "(0,0,0)" });
                        });
                    }
                    text.line(&format!(
                        "uniform token[] xformOpOrder = [\"xformOp:translate\", \"xformOp:orient\"{}]",
                        if has_scale { ", \"xformOp:scale\"" } else { "" }
                    ));
                },
            );
        }
    }

    fn custom_data(&self, text: &mut Text, phase: &Phase) {
        text.block("customData = ", BRACES, |text| {
            text.line(&entry("double", "birth", phase.birth));
            if let Some(ending) = phase.ending {
                text.line(&entry("double", "death", ending.time));
            }
            text.line(&entry("string", "kind", quoted(&phase.kind)));
            text.line(&entry("string", "lineage", quoted(&phase.lineage.to_string())));
            if let Some(rule) = phase.ending.and_then(|ending| self.growth.rules.get(ending.rule)) {
                text.line(&entry("string", "rule", quoted(rule)));
            }
        });
    }

    fn motion(&self, text: &mut Text, moved: &Moved<'_>) {
        let path = moved.path();
        let place =
            |out: &mut String, i: usize| tuple(out, path.frames[i].origin.coords.into(), self.decimals);
        // Of the two signs of a turn any: USD interpolates the shorter way.
        let turn = |out: &mut String, i: usize| {
            let turn = &path.frames[i].turn;
            tuple(out, [turn.w, turn.i, turn.j, turn.k], OF_TURNS);
        };
        let last = path.frames.len() - 1;
        let is_still = path.is_still() || self.clock.is_still();
        let moves = !is_still && path.frames.iter().any(|frame| frame.origin != path.frames[0].origin);
        let turns = !is_still && path.frames.iter().any(|frame| frame.turn != path.frames[0].turn);
        let keys = || path.keys.iter().enumerate().map(|(i, key)| (Writer::code(*key), i));
        match turns {
            true => text.samples("quatf xformOp:orient", keys(), turn),
            false => text.long("quatf xformOp:orient = ", |out| turn(out, last)),
        }
        match moves {
            true => text.samples("double3 xformOp:translate", keys(), place),
            false => text.long("double3 xformOp:translate = ", |out| place(out, last)),
        }
    }

    /// The floor that the model declares, as a large square.
    fn floor(&self, text: &mut Text) {
        let Some((positions, triangles)) = self.growth.floor() else { return };
        let normals = Samples::still(vec![[0.0, 1.0, 0.0]; positions.len()]);
        let (material, points) = (MaterialId::LEAF, Samples::still(positions));
        let primitive = Primitive { material, triangles, pinned: Vec::new(), points, normals };
        self.mesh(text, "ground", None, (&primitive, None));
    }

    /// Gases and particles as points with widths, at the frames. Their number changes, so programs show each frame until the next.
    fn gases(&self, text: &mut Text) {
        let mut names = Identifiers::default();
        for gas in &self.growth.gases {
            let name = names.choose(&gas.name.replace('.', "_"));
            text.block(&format!("def Points \"{name}\" "), BRACES, |text| {
                let frames = || gas.frames.iter().map(|frame| (frame.seconds * RATE, frame));
                text.samples("float3[] extent", frames(), |out, frame| {
                    tuples(out, &bounds_of(frame), self.decimals);
                });
                text.samples("point3f[] points", frames(), |out, frame| {
                    tuples(out, &frame.points, self.decimals);
                });
                text.samples("float[] widths", frames(), |out, frame| {
                    list(out, &frame.widths, |out, width| push_number(out, f64::from(width), self.decimals));
                });
                text.long("color3f[] primvars:displayColor = [", |out| {
                    tuple(out, rgb(gas.color), OF_COLORS);
                    out.push(']');
                });
            });
        }
    }
}

/// Opposite corners of the box around the blobs of a frame.
fn bounds_of(frame: &GasFrame) -> [[f32; 3]; 2] {
    let mut blobs = frame.points.iter().zip(&frame.widths);
    let reach = |(point, width): (&[f32; 3], &f32), sign: f32| point.map(|x| x + sign * width / 2.0);
    let Some(first) = blobs.next() else { return [[0.0; 3]; 2] };
    blobs.fold([reach(first, -1.0), reach(first, 1.0)], |[low, high], blob| {
        let (l, h) = (reach(blob, -1.0), reach(blob, 1.0));
        [0, 1].map(|end| [0, 1, 2].map(|k| if end == 0 { low[k].min(l[k]) } else { high[k].max(h[k]) }))
    })
}

/// Writes materials, and that of the floor, if there is one. Returns their names.
fn materials(
    text: &mut Text,
    palette: &Palette,
    used: &[MaterialId],
    floor: Option<Color>,
) -> HashMap<Option<MaterialId>, String> {
    let mut all: Vec<(Option<MaterialId>, &str, Color, Option<&Texture>)> = Vec::new();
    for id in used {
        if let Some(material) = palette.materials().get(id.index()) {
            all.push((Some(*id), &material.name, material.color, material.texture.as_ref()));
        }
    }
    all.extend(floor.map(|color| (None, "ground", color, None)));
    let pictures = pictures(palette);
    let mut names = Identifiers::default();
    let mut chosen = HashMap::new();
    text.block("def Scope \"Materials\" ", BRACES, |text| {
        for (id, name, color, texture) in all {
            let name = names.choose(name);
            let path = format!("/Plant/Materials/{name}");
            text.block(&format!("def Material \"{name}\" "), BRACES, |text| {
                text.line(&format!("token outputs:surface.connect = <{path}/Shader.outputs:surface>"));
                text.block("def Shader \"Shader\" ", BRACES, |text| {
                    text.line("uniform token info:id = \"UsdPreviewSurface\"");
                    match texture {
                        Some(texture) => colors_of(text, &path, texture),
                        None => text.long("color3f inputs:diffuseColor = ", |out| {
                            tuple(out, rgb(color), OF_COLORS);
                        }),
                    }
                    text.line("float inputs:metallic = 0");
                    text.line("float inputs:roughness = 0.8");
                    text.line("token outputs:surface");
                });
                for (_, file) in pictures.iter().filter(|(p, _)| texture.is_some_and(|t| t.picture == *p)) {
                    readers(text, &path, file, texture.is_some_and(|texture| texture.repeats));
                }
            });
            chosen.insert(id, name);
        }
    });
    chosen
}

/// The inputs of a surface that come from its picture.
fn colors_of(text: &mut Text, path: &str, texture: &Texture) {
    text.line(&format!("color3f inputs:diffuseColor.connect = <{path}/Picture.outputs:rgb>"));
    if texture.picture.is_cut_out() {
        text.line(&format!("float inputs:opacity.connect = <{path}/Picture.outputs:a>"));
        text.line("float inputs:opacityThreshold = 0.5");
    }
}

/// The reader of a picture that stands beside the layer, and that of the places of corners in it.
fn readers(text: &mut Text, path: &str, file: &str, repeats: bool) {
    let wrap = if repeats { "repeat" } else { "clamp" };
    text.block("def Shader \"Picture\" ", BRACES, |text| {
        text.line("uniform token info:id = \"UsdUVTexture\"");
        text.line(&format!("asset inputs:file = @./{file}@"));
        text.line("token inputs:sourceColorSpace = \"sRGB\"");
        text.line(&format!("float2 inputs:st.connect = <{path}/Places.outputs:result>"));
        text.line(&format!("token inputs:wrapS = \"{wrap}\""));
        text.line(&format!("token inputs:wrapT = \"{wrap}\""));
        text.line("float outputs:a");
        text.line("float3 outputs:rgb");
    });
    text.block("def Shader \"Places\" ", BRACES, |text| {
        text.line("uniform token info:id = \"UsdPrimvarReader_float2\"");
        text.line("string inputs:varname = \"st\"");
        text.line("float2 outputs:result");
    });
}

/// When it is visible; each value holds from its time on. The scale begins to be more than 0, or has become 0, at these times.
fn visibility(sight: &[(f64, bool)], is_born: bool) -> Vec<(f64, bool)> {
    let (Some((first, _)), Some((last, seen))) = (sight.first(), sight.last()) else { return Vec::new() };
    let mut all = Vec::new();
    if *first > 0.0 || !is_born {
        all.push((0.0, !is_born));
    }
    if is_born {
        all.push((*first, true));
    }
    if !seen {
        all.push((*last, false));
    }
    all
}

/// The channels of a colour as USD takes them.
fn rgb(color: Color) -> [f64; 3] {
    let [r, g, b, _] = linear(color).map(f64::from);
    [r, g, b]
}

fn bounds(points: &[[f32; 3]]) -> [[f32; 3]; 2] {
    let extreme = |pick: fn(f32, f32) -> f32| {
        [0, 1, 2].map(|k| points.iter().map(|p| p[k]).reduce(pick).unwrap_or(0.0))
    };
    [extreme(f32::min), extreme(f32::max)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_visible_has_a_size() {
        assert_eq!(visibility(&[(1.0, false), (2.0, true)], true), [(0.0, false), (1.0, true)]);
        assert_eq!(visibility(&[(3.0, true), (4.0, false)], false), [(0.0, true), (4.0, false)]);
        assert_eq!(visibility(&[(4.0, false)], false), [(0.0, true), (4.0, false)]);
        let both = [(0.0, false), (1.0, true), (2.0, true), (3.0, false)];
        assert_eq!(visibility(&both, true), [(0.0, true), (3.0, false)]);
        assert_eq!(visibility(&[], false), []);
    }
}
