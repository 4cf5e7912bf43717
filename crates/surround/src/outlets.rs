//! Where gases begin, from tick to tick: what growth does to the sources of a string becomes the sources of a tick.

use std::collections::HashMap;

use dlsys_gas::{Source, Vector};
use dlsys_geometry::scene::{GasSource, Scene, SourceKey};
use dlsys_geometry::turtle::Origin;
use dlsys_sim::Event;
use dlsys_tree::ModuleString;
use dlsys_wind::Draw;

use crate::descent::Descent;
use crate::place::Place;

/// A source of gas at an instant, in SI.
#[derive(Clone, Debug)]
pub(crate) struct Outlet {
    key: SourceKey,
    pub(crate) gas: usize,
    pub(crate) origin: Origin,
    /// When its module was born.
    born: f64,
    at: Vector,
    radius: f64,
    /// Blobs in a second.
    pub(crate) rate: f64,
}

impl Outlet {
    /// Those of a scene that a string has drawn.
    pub(crate) fn of(scene: &Scene, string: &ModuleString, place: &Place) -> Vec<Outlet> {
        if scene.sources.is_empty() {
            return Vec::new();
        }
        let ages: HashMap<u64, f64> = string.iter().map(|module| (module.lineage.id, module.age)).collect();
        let outlet = |source: &GasSource| Outlet {
            key: source.key,
            gas: source.gas,
            origin: source.origin,
            born: place.seconds(string.time - ages.get(&source.key.module).copied().unwrap_or(0.0)),
            at: place.point(source.at.coords * place.units.length),
            radius: source.radius * place.units.length,
            rate: source.rate / place.units.time,
        };
        scene.sources.iter().map(outlet).collect()
    }

    fn id(&self) -> u64 {
        identity(self.key)
    }
}

/// A number for a source: that of the module, and its own.
fn identity(key: SourceKey) -> u64 {
    key.module.rotate_left(17) ^ u64::from(key.number).wrapping_mul(0x9e37_79b9_7f4a_7c15)
}

/// What happens to sources from one tick to the next.
pub(crate) struct Change<'a> {
    pub(crate) here: &'a [Outlet],
    pub(crate) next: &'a [Outlet],
    pub(crate) events: &'a [Event],
    pub(crate) descent: &'a Descent,
    /// The times of both ticks in s.
    pub(crate) ticks: [f64; 2],
    pub(crate) seed: u64,
}

impl Change<'_> {
    /// The sources of a gas during the tick, in string order.
    ///
    /// A source of a module that a production has replaced goes on in the one that has taken its place. One that is new begins with its module, or,
    /// if the module was there before, rises from nothing; likewise where it ends.
    pub(crate) fn sources(&self, gas: usize, place: &Place) -> Vec<Source> {
        let [begin, end] = self.ticks;
        let known: HashMap<SourceKey, &Outlet> =
            self.here.iter().filter(|outlet| outlet.gas == gas).map(|outlet| (outlet.key, outlet)).collect();
        let mut gone = known.clone();
        let mut sources = Vec::new();
        for outlet in self.next.iter().filter(|outlet| outlet.gas == gas) {
            let SourceKey { module, number } = outlet.key;
            let before =
                self.descent.line(module).find_map(|module| known.get(&SourceKey { module, number }));
            let phase = Draw::new(self.seed).of(outlet.id()).unit();
            let mut source =
                Source { phase, ..Source::at(outlet.id(), outlet.at, outlet.radius, outlet.rate) };
            match before {
                Some(before) => {
                    gone.remove(&before.key);
                    source.predecessor = (before.id() != source.id).then(|| before.id());
                    (source.from, source.radius[0], source.rate[0]) = (before.at, before.radius, before.rate);
                }
                None if outlet.born > begin => source.during = Some([outlet.born.min(end), end]),
                None => source.rate[0] = 0.0,
            }
            sources.push(source);
        }
        for outlet in self.here.iter().filter(|outlet| gone.contains_key(&outlet.key)) {
            let mut source = Source::at(outlet.id(), outlet.at, outlet.radius, outlet.rate);
            match self.events.iter().find(|event| event.lineage.id == outlet.key.module) {
                Some(event) => {
                    source.during = Some([begin, place.seconds(event.time).clamp(begin, end)]);
                }
                None => source.rate[1] = 0.0,
            }
            sources.push(source);
        }
        sources
    }
}
