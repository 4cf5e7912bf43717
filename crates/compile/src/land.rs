//! What rules read of the ground: `ground(x, z)`, its height at a place and at the present time.
//!
//! A rigid ground is a constant. The height of soil is a field that `dlsys_surround` computes, in lock step with growth if bodies of the model press it: of the
//! time, the place, and the number of a state that holds from one tick of the ground to the next. Rules have that number in a hidden
//! parameter ([`Quantity::Ground`](dlsys_model::Quantity::Ground)).

use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_expr::{FieldPart, FieldSlot, Lookup, NodeId};
use dlsys_model::{Quantity, Scenery};

use crate::inputs::{LAYER, misplaced};
use crate::scope::{Scope, Variables};

/// The function.
pub const FUNCTION: &str = "ground";

/// The ground of a model.
#[derive(Default)]
pub enum Land {
    /// There is none.
    #[default]
    None,
    /// A floor at a height.
    Rigid(f64),
    /// Soil, with the place for its heights.
    Soil(FieldSlot, Option<Lookup>),
}

impl Land {
    /// The ground of a scene.
    pub fn new(scenery: &Scenery) -> Land {
        match (scenery.ground, &scenery.bed) {
            (Some(height), _) => Land::Rigid(height),
            (None, Some(_)) => Land::Soil(FieldSlot::default(), None),
            (None, None) => Land::None,
        }
    }

    /// True if heights may change.
    pub fn moves(&self) -> bool {
        matches!(self, Land::Soil(..))
    }

    /// The place for heights, if rules read them.
    pub fn slot(&self) -> Option<FieldSlot> {
        match self {
            Land::Soil(slot, Some(_)) => Some(slot.clone()),
            _ => None,
        }
    }
}

impl Scope {
    /// Lowers a call of the height of the ground.
    pub(super) fn ground(
        &mut self,
        span: Span,
        [x, z]: [NodeId; 2],
        variables: &Variables,
    ) -> Option<NodeId> {
        let (slot, lookup) = match &mut self.land {
            Land::Rigid(height) => return Some(self.graph.constant(*height)),
            Land::Soil(slot, lookup) => (slot, lookup),
            Land::None => {
                if self.unknown.insert(FUNCTION.into()) {
                    self.diagnostics.push(
                        Diagnostic::error("`ground` reads the height of the ground, and there is none here")
                            .at(span, "the model declares no ground")
                            .help("declare one: `ground 0` is a rigid floor, `ground sand cell 0.02 height 0.1*sin(x)` with `soil sand = sand` gives way"),
                    );
                }
                return None;
            }
        };
        let (layer, time) = (variables.names.get(LAYER).copied(), variables.names.get("t").copied());
        let (Some(layer), Some(time)) = (layer, time) else {
            let name = Quantity::Ground.name();
            let help = format!(
                "read it in a rule and pass its value on: to a function as an argument, to a drawing or a neighbour as a parameter (`solve y = {name}(x, z)`); `@G` puts the turtle on the ground"
            );
            let mut error = misplaced(Quantity::Ground, span);
            error.help = vec![help];
            self.diagnostics.push(error);
            return None;
        };
        let lookup = *lookup.get_or_insert_with(|| self.graph.add_field(slot.clone()));
        Some(self.graph.field(lookup, FieldPart::value(0), [time, x, layer, z]))
    }
}
