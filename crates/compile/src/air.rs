//! What rules read of the wind: `flow_x(x, y, z)`, `flow_y`, `flow_z`, as expressions.
//!
//! The mean wind, its profile over the ground, and the flows are ordinary expressions of time and place, so that formulas, derivatives, bounds and limits
//! of what reads them are found as of anything else. The turbulence is a field that [`dlsys_surround`] computes, times its amplitude. Values
//! are those of `dlsys_wind::Snapshot`, without bodies.
//!
//! [`dlsys_surround`]: https://docs.rs/dlsys-surround

use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_expr::{Binary, FieldPart, FieldSlot, Graph, Lookup, NodeId, Unary};
use dlsys_model::{Flow, Primitive, Scenery, Spectrum};

use crate::scope::{Scope, Variables};

/// The functions, by component.
pub const FUNCTIONS: [&str; 3] = ["flow_x", "flow_y", "flow_z"];
/// The time in the expressions of declarations.
const TIME: u32 = 0;
/// Radius of the core of sources and vortices, in m.
const CORE: f64 = 0.1;
/// The height at which the speed of a wind with a profile is given, in m.
const HEIGHT: f64 = 10.0;
/// Added to the square of a distance before its root is taken, so that this has a derivative at 0; it changes nothing else.
const TINY: f64 = 1e-300;

/// The wind of a model, as expressions of `t`.
pub struct Air {
    /// The mean velocity in m/s.
    mean: Option<[NodeId; 3]>,
    /// The amplitude of the turbulence.
    amplitude: Option<NodeId>,
    /// Sources and so on, with their values.
    flows: Vec<(Flow, Vec<NodeId>)>,
    roughness: Option<f64>,
    /// The height of the ground in m, and the layer over it in which flows from above turn aside.
    ground: Option<f64>,
    layer: f64,
    /// A metre and a second in units of the model.
    metre: f64,
    second: f64,
    slot: FieldSlot,
    field: Option<Lookup>,
    /// The first place that reads it.
    pub read: Option<Span>,
}

impl Air {
    /// The wind of a scene, given its speed and the values of its flows; `None` if it has none.
    pub fn new(
        scenery: &Scenery,
        speed: Option<NodeId>,
        flows: Vec<Vec<NodeId>>,
        graph: &mut Graph,
    ) -> Option<Air> {
        if scenery.wind.is_none() && scenery.flows.is_empty() {
            return None;
        }
        let (mut mean, mut amplitude) = (None, None);
        if let (Some(wind), Some(speed)) = (&scenery.wind, speed) {
            let length = wind.direction.iter().map(|c| c * c).sum::<f64>().sqrt();
            mean = Some(wind.direction.map(|part| scaled(graph, speed, part / length)));
            let magnitude = graph.unary(Unary::Abs, speed);
            let positive = graph.as_constant(speed).is_some_and(|speed| speed >= 0.0);
            amplitude = match wind.spectrum {
                _ if wind.turbulence == 0.0 && wind.spectrum == Spectrum::VonKarman => None,
                Spectrum::VonKarman => {
                    Some(scaled(graph, if positive { speed } else { magnitude }, wind.turbulence))
                }
                Spectrum::Kolmogorov(_) => (wind.turbulence > 0.0).then(|| graph.constant(1.0)),
            };
        }
        let metre = scenery.units.length;
        Some(Air {
            mean,
            amplitude,
            flows: scenery.flows.iter().cloned().zip(flows).collect(),
            roughness: scenery.wind.as_ref().and_then(|wind| wind.roughness),
            ground: scenery.ground.map(|height| height * metre),
            layer: scenery.wind.as_ref().map_or(1.0, |wind| wind.scale),
            metre,
            second: scenery.units.time,
            slot: FieldSlot::default(),
            field: None,
            read: None,
        })
    }

    /// The place for the turbulence, if rules read it.
    pub fn slot(&self) -> Option<FieldSlot> {
        self.field.map(|_| self.slot.clone())
    }

    /// A component of the velocity at a time and a place of the model, in its units.
    fn velocity(&mut self, graph: &mut Graph, component: usize, time: NodeId, at: [NodeId; 3]) -> NodeId {
        let [x, y, z] = at.map(|of| scaled(graph, of, self.metre));
        let height = match self.ground {
            Some(ground) if ground != 0.0 => {
                let ground = graph.constant(ground);
                graph.binary(Binary::Sub, y, ground)
            }
            _ => y,
        };
        let mut sum = graph.constant(0.0);
        if let Some(amplitude) = self.amplitude {
            let lookup = *self.field.get_or_insert_with(|| graph.add_field(self.slot.clone()));
            let part = FieldPart::value(component as u8);
            let eddies = graph.field(lookup, part, [time, at[0], at[1], at[2]]);
            let amplitude = at_time(graph, amplitude, time);
            sum = product(graph, amplitude, eddies);
        }
        let mut rest = graph.constant(0.0);
        if let Some(mean) = self.mean {
            let mean = at_time(graph, mean[component], time);
            match component {
                1 => rest = mean,
                _ => {
                    let mean = self.profile(graph, mean, height);
                    sum = plus(graph, sum, mean);
                }
            }
        }
        for (flow, values) in &self.flows {
            let values: Vec<NodeId> = values.iter().map(|value| at_time(graph, *value, time)).collect();
            let part = self.of_flow(graph, flow, (&values, component), [x, height, z]);
            rest = plus(graph, rest, part);
        }
        if component == 1 {
            rest = self.turned(graph, rest, height);
        }
        sum = plus(graph, sum, rest);
        if self.ground.is_some() && graph.as_constant(sum) != Some(0.0) {
            let zero = graph.constant(0.0);
            let below = graph.binary(Binary::Lt, height, zero);
            sum = graph.select(below, zero, sum);
        }
        scaled(graph, sum, self.second / self.metre)
    }

    /// A horizontal component of the mean wind at a height.
    fn profile(&self, graph: &mut Graph, mean: NodeId, height: NodeId) -> NodeId {
        let Some(roughness) = self.roughness else { return mean };
        let length = graph.constant(roughness);
        let above = graph.binary(Binary::Max, height, length);
        let ratio = graph.binary(Binary::Div, above, length);
        let logarithm = graph.unary(Unary::Ln, ratio);
        let share = scaled(graph, logarithm, 1.0 / (HEIGHT / roughness).ln());
        product(graph, mean, share)
    }

    /// A vertical velocity at a height, which the ground turns aside.
    fn turned(&self, graph: &mut Graph, velocity: NodeId, height: NodeId) -> NodeId {
        if self.ground.is_none() || graph.as_constant(velocity) == Some(0.0) {
            return velocity;
        }
        // (15r - 10r³ + 3r⁵)/8, as in `dlsys_wind`.
        let [one, three, ten, fifteen] = [1.0, 3.0, 10.0, 15.0].map(|x| graph.constant(x));
        let share = scaled(graph, height, 1.0 / self.layer);
        let share = graph.binary(Binary::Min, share, one);
        let square = graph.binary(Binary::Mul, share, share);
        let inner = graph.binary(Binary::Mul, three, square);
        let inner = graph.binary(Binary::Sub, ten, inner);
        let inner = graph.binary(Binary::Mul, square, inner);
        let outer = graph.binary(Binary::Sub, fifteen, inner);
        let ramp = graph.binary(Binary::Mul, share, outer);
        let ramp = scaled(graph, ramp, 0.125);
        graph.binary(Binary::Mul, velocity, ramp)
    }

    /// A component of a flow in m/s at a place in m.
    fn of_flow(
        &self,
        graph: &mut Graph,
        flow: &Flow,
        (values, component): (&[NodeId], usize),
        place: [NodeId; 3],
    ) -> NodeId {
        use std::f64::consts::PI;
        if flow.primitive == Primitive::Uniform {
            return values[component];
        }
        let way: [NodeId; 3] = std::array::from_fn(|i| {
            let centre = scaled(graph, values[i + 1], self.metre);
            graph.binary(Binary::Sub, place[i], centre)
        });
        let (vector, over, factor) = match flow.primitive {
            Primitive::Vortex => {
                let axis: [NodeId; 3] = std::array::from_fn(|i| values[i + 4]);
                let length = square(graph, axis);
                let length = graph.unary(Unary::Sqrt, length);
                let axis = axis.map(|part| graph.binary(Binary::Div, part, length));
                (cross(graph, axis, way), false, 1.0 / (2.0 * PI))
            }
            Primitive::Sink => (way, true, -1.0 / (4.0 * PI)),
            _ => (way, true, 1.0 / (4.0 * PI)),
        };
        let distance = square(graph, vector);
        let core = graph.constant(CORE * CORE);
        let mut divisor = graph.binary(Binary::Add, distance, core);
        let mut strength = scaled(graph, values[0], factor);
        if over || flow.decay.is_some() {
            let tiny = graph.constant(TINY);
            let length = graph.binary(Binary::Add, distance, tiny);
            let length = graph.unary(Unary::Sqrt, length);
            if over {
                divisor = graph.binary(Binary::Mul, length, divisor);
            }
            if let Some(decay) = flow.decay {
                let exponent = scaled(graph, length, -1.0 / (decay * self.metre));
                let decay = graph.unary(Unary::Exp, exponent);
                strength = graph.binary(Binary::Mul, strength, decay);
            }
        }
        let factor = graph.binary(Binary::Div, strength, divisor);
        product(graph, factor, vector[component])
    }
}

impl Scope {
    /// Lowers a call of a component of the wind.
    pub(super) fn flow(
        &mut self,
        component: usize,
        span: Span,
        at: [NodeId; 3],
        variables: &Variables,
    ) -> Option<NodeId> {
        let name = FUNCTIONS[component];
        let time = variables.names.get("t").copied().filter(|_| variables.no_time.is_none());
        let Some(time) = time else {
            self.diagnostics.push(
                Diagnostic::error(format!("`{name}` has no meaning here"))
                    .at(span, "the wind is read in rules and drawings, which have a time")
                    .help(format!("read it there and pass its value on: to a function as an argument, as in `G({name}(x, y, z))`")),
            );
            return None;
        };
        let Some(air) = &mut self.air else {
            if self.unknown.insert(name.into()) {
                self.diagnostics.push(
                    Diagnostic::error(format!("`{name}` reads the wind, and there is none here"))
                        .at(span, "the model declares no wind and no flow")
                        .help("declare one, as in `wind 1, 0, 0 speed 3` or `flow uniform 1, 0, 0`; its speed is in m/s, and what rules read in units of the model"),
                );
            }
            return None;
        };
        air.read.get_or_insert(span);
        Some(air.velocity(&mut self.graph, component, time, at))
    }
}

/// An expression of a declaration at the time of a rule.
fn at_time(graph: &mut Graph, root: NodeId, time: NodeId) -> NodeId {
    let now = graph.var(TIME);
    graph.rewrite(&[root], |_, id, _| (id == now).then_some(time))[0]
}

fn scaled(graph: &mut Graph, of: NodeId, factor: f64) -> NodeId {
    let factor = graph.constant(factor);
    product(graph, of, factor)
}

/// A product in which 0 is no flow at all.
fn product(graph: &mut Graph, a: NodeId, b: NodeId) -> NodeId {
    match [a, b].iter().any(|of| graph.as_constant(*of) == Some(0.0)) {
        true => graph.constant(0.0),
        false => graph.binary(Binary::Mul, a, b),
    }
}

fn plus(graph: &mut Graph, a: NodeId, b: NodeId) -> NodeId {
    match [a, b].map(|of| graph.as_constant(of) == Some(0.0)) {
        [true, _] => b,
        [_, true] => a,
        _ => graph.binary(Binary::Add, a, b),
    }
}

fn square(graph: &mut Graph, [x, y, z]: [NodeId; 3]) -> NodeId {
    let [x, y, z] = [x, y, z].map(|of| graph.binary(Binary::Mul, of, of));
    let sum = graph.binary(Binary::Add, x, y);
    graph.binary(Binary::Add, sum, z)
}

fn cross(graph: &mut Graph, a: [NodeId; 3], b: [NodeId; 3]) -> [NodeId; 3] {
    std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let (first, second) = (product(graph, a[j], b[k]), product(graph, a[k], b[j]));
        match graph.as_constant(second) {
            Some(0.0) => first,
            _ => graph.binary(Binary::Sub, first, second),
        }
    })
}
