//! The ground as a value: its columns at an instant, what they are, and how high they stand.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use crate::coat::Coats;
use crate::cover::Foot;
use crate::error::check;
use crate::graph::Graph;
use crate::kernel::Law;
use crate::load::Floors;
use crate::marks::Marks;
use crate::material::REST;
use crate::particles::Particle;
use crate::rules::Speeds;
use crate::setup::Setup;
use crate::tile::{COLUMN_BYTES, Extent, Key, QUANTA, SLID_BYTES, Tile};
use crate::wedge::note;
use crate::{Error, Relief, Rule, Soil};

/// What a ground is before anything touches it.
#[derive(Clone, Debug)]
pub struct Description {
    /// Distance of columns in m.
    pub cell: f64,
    /// The columns.
    pub extent: Extent,
    /// The material.
    pub soil: Soil,
    /// Height of the rigid bed, in m.
    pub bed: Relief,
    /// Thickness of the material on it, in m; negative ones count as 0. It is bonded if the soil has cohesion, loose otherwise.
    pub depth: Relief,
}

/// How a ground is followed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Seconds from one tick to the next.
    pub tick: f64,
    /// Columns in a row of a tile: 16 or 32. The result does not depend on it.
    pub side: usize,
    /// Number of threads. The result does not depend on it.
    pub threads: usize,
    /// Memory for columns that have been touched, in MB; more is an error.
    pub memory: usize,
    /// What moves material that is too steep.
    pub rule: Rule,
    /// How far the surface slides is followed, for pictures on it ([`Ground::slid`]).
    pub slides: bool,
}

impl Default for Settings {
    /// Ticks of 1/120 s, tiles of 32, one thread, 1024 MB, the law of this crate.
    fn default() -> Settings {
        Settings { tick: 1.0 / 120.0, side: 32, threads: 1, memory: 1024, rule: Rule::Law, slides: false }
    }
}

/// Most sweeps in a tick: more are columns too small for the mobility of the material.
const SWEEPS: f64 = 1e5;
/// Largest λδt/4Δ² of a sweep. Below 1/16, each sweep lowers the potential energy, whatever limits and walls take from the fluxes.
pub(crate) const TAU: f64 = 1.0 / 17.0;
/// Thickness, in slopes of repose (at most 1), up to which loose material counts as none.
const FILM: f64 = 1e-6;

/// Sand, mud, snow or soil at an instant. Clones share their columns until one of them changes.
#[derive(Clone, Debug)]
pub struct Ground {
    pub(crate) setup: Arc<Setup>,
    pub(crate) tiles: Arc<BTreeMap<Key, Arc<Tile>>>,
    /// Tiles with columns that slip or were changed.
    pub(crate) awake: Vec<Key>,
    /// Tiles whose columns are to be examined once, all of them.
    pub(crate) fresh: Vec<Key>,
    /// Lowest ceilings over columns: undersides of bodies.
    pub(crate) roofs: Arc<BTreeMap<Key, Arc<[i64]>>>,
    /// Columns that have changed since banks were examined, if the soil has cohesion.
    pub(crate) strained: BTreeMap<Key, Box<[u32]>>,
    /// What each body covers, by its identity.
    pub(crate) feet: Arc<BTreeMap<u64, Arc<Foot>>>,
    /// Floors on bodies, and whether what lies on them may slip.
    pub(crate) floors: Arc<Floors>,
    /// Their graph; none where it has to be made anew.
    pub(crate) graph: Option<Arc<Graph>>,
    pub(crate) stirred: bool,
    /// Speeds of slices, where the rule has any.
    pub(crate) speeds: Speeds,
    /// Whether something is poured in this tick, or in the air, which bodies far above the ground may catch.
    pub(crate) falls: bool,
    /// What sticks to bodies, by their identity, and what they have thrown up.
    pub(crate) coats: Arc<BTreeMap<u64, Arc<Coats>>>,
    pub(crate) particles: Arc<Vec<Particle>>,
    pub(crate) book: Book,
}

/// Counts and volumes of a ground, in quanta.
#[derive(Clone, Debug, Default)]
pub(crate) struct Book {
    pub ticks: u64,
    pub sweeps: u64,
    pub updates: u64,
    /// What has fallen on each column.
    pub fallen: i64,
    /// What has been poured onto some columns.
    pub poured: i128,
    /// What has been grown by swelling, in 2^-16 quanta, less what stands in columns.
    pub swollen: i128,
    /// Parts of quanta that a steady fall owes.
    pub owed: f64,
    /// Quanta that pours owe, by their number.
    pub debts: BTreeMap<u64, f64>,
    /// Largest slope down which a rule of the papers moved something in the last sweep.
    pub steepest: f64,
}

impl Ground {
    /// A ground that nothing has touched yet.
    ///
    /// # Errors
    ///
    /// A value out of range, or a relief that is not finite somewhere.
    pub fn new(description: Description, settings: Settings) -> Result<Ground, Error> {
        let Description { cell, extent, soil, .. } = &description;
        check("a size of columns (m)", *cell, (1e-6..=1e4).contains(cell), "1e-6 to 10,000")?;
        extent.check()?;
        soil.check()?;
        let Settings { tick, side, threads, memory, rule, slides: _ } = settings;
        check("a tick (s)", tick, (1e-6..=10.0).contains(&tick), "1e-6 to 10")?;
        check("a side of tiles", side as f64, side == 16 || side == 32, "16 or 32")?;
        check("a number of threads", threads as f64, (1..=1024).contains(&threads), "1 to 1024")?;
        check("a memory (MB)", memory as f64, (1..=1 << 24).contains(&memory), "1 to 2^24")?;
        // λδt/4Δ² of a whole tick.
        let whole = soil.flow * tick / (4.0 * cell * cell);
        let sweeps = rule.sweeps(tick, *cell, (whole / TAU).ceil().max(1.0));
        check("a number of sweeps in a tick (flow · tick / cell²)", sweeps, sweeps <= SWEEPS, "at most 1e5")?;
        let law = Law {
            tau: (whole / sweeps).min(TAU),
            slope: soil.slope() * QUANTA,
            rest: 1.0 + REST,
            film: FILM * soil.slope().min(1.0) * QUANTA,
        };
        let swell = (soil.swell * 65_536.0).round() as i64;
        let start = if rule == Rule::Law { soil.start() } else { 1.0 };
        let mut setup = Setup {
            side: side as i32,
            law,
            start,
            sweeps: sweeps as u32,
            swell,
            range: [0; 2],
            steep: Vec::new(),
            squares: Mutex::default(),
            description,
            settings,
        };
        setup.survey()?;
        // Banks that are too high fail from the beginning on.
        let whole = vec![u32::MAX >> (32 - side); side].into_boxed_slice();
        let strained = setup.steep.iter().filter(|_| rule.bonds(&setup.description.soil));
        let strained = strained.map(|key| (*key, whole.clone())).collect();
        Ok(Ground {
            strained,
            feet: Arc::default(),
            floors: Arc::default(),
            graph: None,
            stirred: false,
            falls: false,
            coats: Arc::default(),
            particles: Arc::default(),
            fresh: setup.steep.clone(),
            setup: Arc::new(setup),
            tiles: Arc::default(),
            awake: Vec::new(),
            speeds: Speeds::default(),
            roofs: Arc::default(),
            book: Book::default(),
        })
    }

    /// Distance of columns in m.
    pub fn cell(&self) -> f64 {
        self.setup.description.cell
    }

    /// The columns.
    pub fn extent(&self) -> Extent {
        self.setup.description.extent
    }

    /// The material.
    pub fn soil(&self) -> &Soil {
        &self.setup.description.soil
    }

    /// Seconds since the beginning.
    pub fn time(&self) -> f64 {
        self.book.ticks as f64 * self.setup.settings.tick
    }

    /// Number of sweeps so far.
    pub fn sweeps(&self) -> u64 {
        self.book.sweeps
    }

    /// Number of columns that sweeps have computed so far.
    pub fn updates(&self) -> u64 {
        self.book.updates
    }

    /// Whether nothing slips.
    pub fn is_at_rest(&self) -> bool {
        self.awake.is_empty() && self.fresh.is_empty() && !self.stirred
    }

    /// Number of columns in memory.
    pub fn stored(&self) -> usize {
        self.tiles.len() * self.setup.settings.side * self.setup.settings.side
    }

    /// Height of a column in m; of the nearest one if the ground does not extend to there.
    pub fn column(&self, i: i32, k: i32) -> f64 {
        self.top(i, k) as f64 / QUANTA * self.cell()
    }

    /// Thickness of a column's loose material in m.
    pub fn loose(&self, i: i32, k: i32) -> f64 {
        let top = self.top(i, k);
        let (i, k) = self.extent().mirrored(i, k);
        let (key, index) = self.setup.place(i, k);
        let base = match self.tiles.get(&key) {
            Some(tile) => tile.base(index),
            None => self.setup.untouched(i, k).map_or(top, |[bed, bonded, _]| bed + bonded),
        };
        (top - base) as f64 / QUANTA * self.cell()
    }

    /// How far what is seen of a column has slid along x and z, in m: 0 where that is not followed ([`Settings::slides`]). Neighbours differ by half
    /// a cell along each axis at most, so that a picture on the surface is not stretched more.
    pub fn slid(&self, i: i32, k: i32) -> [f64; 2] {
        let (i, k) = self.extent().mirrored(i, k);
        let (key, index) = self.setup.place(i, k);
        let slid = self.tiles.get(&key).and_then(|tile| tile.slid.as_ref()).map(|slid| slid[index]);
        slid.unwrap_or_default().map(|cells| cells * self.cell())
    }

    /// Height of a column in quanta.
    pub(crate) fn top(&self, i: i32, k: i32) -> i64 {
        let (i, k) = self.extent().mirrored(i, k);
        let (key, index) = self.setup.place(i, k);
        match self.tiles.get(&key) {
            Some(tile) => tile.top(index) + (self.book.fallen - tile.fallen),
            // The survey has evaluated the reliefs everywhere, so there is a height.
            None => {
                let layers = self.setup.untouched(i, k).unwrap_or_default();
                layers.iter().sum::<i64>() + self.book.fallen
            }
        }
    }

    /// Height of the surface at a place, in m: bilinear between columns, level beyond the edges.
    pub fn height(&self, x: f64, z: f64) -> f64 {
        let extent = self.extent();
        let split = |at: f64, [from, to]: [i32; 2]| {
            let at = (at / self.cell()).clamp(f64::from(from), f64::from(to));
            let low = at.floor().min(f64::from(to - 1)).max(f64::from(from));
            (low as i32, at - low)
        };
        let ((i, u), (k, v)) = (split(x, extent.x), split(z, extent.z));
        let row = |k: i32| {
            let (low, high) = (self.column(i, k), self.column(i + 1, k));
            low + u * (high - low)
        };
        let (low, high) = (row(k), row(k + 1));
        low + v * (high - low)
    }

    /// Bounds of [`height`](Self::height) over a rectangle, in m: tight where the ground has been touched.
    pub fn bounds(&self, x: [f64; 2], z: [f64; 2]) -> [f64; 2] {
        let extent = self.extent();
        let columns = |[low, high]: [f64; 2], [from, to]: [i32; 2]| {
            let (from, to) = (f64::from(from), f64::from(to));
            let low = (low / self.cell()).floor().clamp(from, to) as i32;
            [low, (high / self.cell()).ceil().clamp(from, to) as i32]
        };
        let (x, z) = (columns(x, extent.x), columns(z, extent.z));
        let side = self.setup.side;
        let tiles = |[from, to]: [i32; 2]| [from.div_euclid(side), to.div_euclid(side)];
        let ([p0, p1], [q0, q1]) = (tiles(x), tiles(z));
        let mut seen = 0_i64;
        let [mut low, mut high] = [i64::MAX, i64::MIN];
        for p in p0..=p1 {
            for (key, tile) in self.tiles.range((p, q0)..=(p, q1)) {
                seen += 1;
                let risen = self.book.fallen - tile.fallen;
                for k in z[0].max(key.1 * side)..=z[1].min(key.1 * side + side - 1) {
                    for i in x[0].max(p * side)..=x[1].min(p * side + side - 1) {
                        let top = tile.top(self.setup.place(i, k).1) + risen;
                        (low, high) = (low.min(top), high.max(top));
                    }
                }
            }
        }
        if seen < i64::from(p1 - p0 + 1) * i64::from(q1 - q0 + 1) {
            let [lowest, highest] = self.setup.range.map(|height| height + self.book.fallen);
            (low, high) = (low.min(lowest), high.max(highest));
        }
        [low, high].map(|height| height as f64 / QUANTA * self.cell())
    }

    /// Columns of the tiles that differ from those of another state of the same ground, as boxes.
    pub fn changed_since(&self, other: &Ground) -> Vec<Extent> {
        let same = |key: &Key, tile: &Arc<Tile>| {
            let before = other.tiles.get(key);
            before.is_some_and(|before| {
                Arc::ptr_eq(tile, before)
                    || (tile.bed == before.bed && tile.bonded == before.bonded && tile.loose == before.loose)
            })
        };
        let side = self.setup.side;
        let changed = self.tiles.iter().filter(|(key, tile)| !same(key, tile));
        changed
            .map(|((p, q), _)| Extent {
                x: [p * side, p * side + side - 1],
                z: [q * side, q * side + side - 1],
            })
            .collect()
    }

    /// Volume that columns, loads, what sticks to bodies and what is in the air have gained less what was added, in 2^-16 quanta of a column: always 0.
    pub fn imbalance(&self) -> i128 {
        let side = self.setup.side;
        let extent = self.extent();
        let growth = 65_536 + i128::from(self.setup.swell);
        let value = |bonded: i64, other: i64| i128::from(bonded) * growth + (i128::from(other) << 16);
        let mut gained = 0;
        for (&(p, q), tile) in self.tiles.iter() {
            for k in (q * side).max(extent.z[0])..=(q * side + side - 1).min(extent.z[1]) {
                for i in (p * side).max(extent.x[0])..=(p * side + side - 1).min(extent.x[1]) {
                    let (_, index) = self.setup.place(i, k);
                    let [_, bonded, loose] = self.setup.untouched(i, k).unwrap_or_default();
                    gained += value(tile.bonded[index], tile.loose[index] + tile.packed[index] - tile.fallen);
                    gained -= value(bonded, loose);
                }
            }
        }
        let carried: i128 = self.floors.values().flatten().map(|floor| i128::from(floor.load)).sum();
        let apart = carried + self.sticking_quanta() + self.airborne_quanta();
        gained + (apart << 16) + self.book.swollen - (self.book.poured << 16)
    }

    /// The tile of a key, made if it is not in memory, with all that has fallen.
    pub(crate) fn ensure(&mut self, key: Key) -> Result<(), Error> {
        let (setup, fallen) = (&self.setup, self.book.fallen);
        match self.tiles.get(&key) {
            Some(tile) if tile.fallen == fallen => Ok(()),
            Some(_) => {
                let extent = self.setup.description.extent;
                let (setup, tile) = (self.setup.clone(), self.tile_mut(key)?);
                for (index, loose) in tile.loose.iter_mut().enumerate() {
                    let (i, k) = setup.column(key, index);
                    if extent.contains(i, k) {
                        *loose += fallen - tile.fallen;
                    }
                }
                tile.fallen = fallen;
                Ok(())
            }
            None => {
                let columns = setup.settings.side * setup.settings.side;
                let most = setup.settings.memory;
                let bytes = if setup.settings.slides { COLUMN_BYTES + SLID_BYTES } else { COLUMN_BYTES };
                if (self.tiles.len() + 1) * columns * bytes > most << 20 {
                    let (i, k) = setup.column(key, 0);
                    let at = [i, k].map(|at| f64::from(at) * setup.description.cell);
                    return Err(Error::Memory { most, at });
                }
                let tile = setup.tile(key, fallen)?;
                Arc::make_mut(&mut self.tiles).insert(key, Arc::new(tile));
                Ok(())
            }
        }
    }

    /// A tile to change.
    pub(crate) fn tile_mut(&mut self, key: Key) -> Result<&mut Tile, Error> {
        if !self.tiles.contains_key(&key) {
            self.ensure(key)?;
        }
        let tiles = Arc::make_mut(&mut self.tiles);
        match tiles.get_mut(&key) {
            Some(tile) => Ok(Arc::make_mut(tile)),
            None => unreachable!("the tile was made above"),
        }
    }

    /// Marks columns as changed; those beyond the edges are left out.
    pub(crate) fn wake_all(&mut self, columns: impl IntoIterator<Item = (i32, i32)>) -> Result<(), Error> {
        let mut marks = Marks::new(self.setup.side);
        columns.into_iter().for_each(|column| marks.add(column));
        self.wake_marked(marks)
    }

    /// Marks columns as changed; those beyond the edges are left out.
    pub(crate) fn wake_marked(&mut self, marks: Marks) -> Result<(), Error> {
        let cohesive = self.setup.settings.rule.bonds(self.soil());
        for (key, bits) in marks.within(self.extent()) {
            self.ensure(key)?;
            for (row, bits) in self.tile_mut(key)?.awake.iter_mut().zip(&bits) {
                *row |= bits;
            }
            if cohesive {
                note(&mut self.strained, key, &bits[..self.setup.settings.side]);
            }
            if let Err(at) = self.awake.binary_search(&key) {
                self.awake.insert(at, key);
            }
        }
        Ok(())
    }

    /// Marks a column as changed, if it is not beyond the edges.
    pub(crate) fn wake(&mut self, i: i32, k: i32) -> Result<(), Error> {
        if !self.extent().contains(i, k) {
            return Ok(());
        }
        let (key, index) = self.setup.place(i, k);
        let side = self.setup.settings.side;
        self.ensure(key)?;
        self.tile_mut(key)?.awake[index / side] |= 1 << (index % side);
        if self.setup.settings.rule.bonds(self.soil()) {
            let mut bits = vec![0; side];
            bits[index / side] |= 1 << (index % side);
            note(&mut self.strained, key, &bits);
        }
        if let Err(at) = self.awake.binary_search(&key) {
            self.awake.insert(at, key);
        }
        Ok(())
    }
}
