//! Floors and the ground at and beside them as a flat graph, and the sweeps of loads on it.
//!
//! While no body moves, the neighbours that a floor can have in a direction stay the same; which of these it has depends on how high its load is. So the graph is
//! made once after each move, and a sweep reads and writes arrays.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use crate::kernel::{Law, to_float, to_integer};
use crate::tile::Key;
use crate::wedge::note;
use crate::{Error, Ground};

/// Directions to neighbours: along x, then along z.
const SIDES: [(i32, i32); 4] = [(-1, 0), (1, 0), (0, -1), (0, 1)];

/// Nodes are the ground of columns, then floors. Heights are in quanta.
#[derive(Debug, Default)]
pub(crate) struct Graph {
    /// Tiles, each with its columns.
    tiles: Vec<(Key, Range<usize>)>,
    /// Columns with floors and those beside them: their indices in their tiles.
    indices: Vec<usize>,
    /// Heights of what is below and above what can slip, of each node.
    base: Vec<i64>,
    ceiling: Vec<i64>,
    /// The bodies of floors; none for the ground.
    owner: Vec<Option<u64>>,
    /// What can be beside a floor, from the lowest on: those of all directions of all floors one after the other, and where each list begins.
    near: Vec<u32>,
    starts: Vec<u32>,
}

/// Columns of some tiles, with numbers in the order of tiles and indices.
struct Columns {
    side: usize,
    /// For each tile, by index, the number of a column; none where it is not one of them.
    numbers: BTreeMap<Key, Box<[u32]>>,
}

/// Stands for no column.
const NONE: u32 = u32::MAX;

impl Columns {
    fn new(side: usize) -> Columns {
        Columns { side, numbers: BTreeMap::new() }
    }

    fn mark(&mut self, (key, index): (Key, usize)) {
        let count = self.side * self.side;
        self.numbers.entry(key).or_insert_with(|| vec![NONE; count].into())[index] = 0;
    }

    /// Numbers the columns that have been marked, and returns their indices in their tiles.
    fn number(&mut self) -> Vec<usize> {
        let mut indices = Vec::new();
        for numbers in self.numbers.values_mut() {
            for (index, number) in numbers.iter_mut().enumerate().filter(|(_, number)| **number != NONE) {
                *number = indices.len() as u32;
                indices.push(index);
            }
        }
        indices
    }

    fn get(&self, (key, index): (Key, usize)) -> Option<usize> {
        let number = self.numbers.get(&key)?[index];
        (number != NONE).then_some(number as usize)
    }

    /// The tiles, each with how many columns it has here.
    fn tiles(&self) -> impl Iterator<Item = (Key, usize)> {
        let count = |numbers: &[u32]| numbers.iter().filter(|number| **number != NONE).count();
        self.numbers.iter().map(move |(key, numbers)| (*key, count(numbers)))
    }
}

/// A flow from a node to another one.
type Flux = (u32, u32, i64);

impl Graph {
    fn is_open(&self, a: usize, b: usize) -> bool {
        self.base[a].max(self.base[b]) < self.ceiling[a].min(self.ceiling[b])
    }

    /// What is beside a floor in a direction, if its surface has a height: the highest node that is not above it, or else the lowest one.
    #[inline]
    fn beside(&self, list: usize, top: i64) -> Option<usize> {
        let all = &self.near[self.starts[list] as usize..self.starts[list + 1] as usize];
        let below = all.iter().take_while(|node| self.base[**node as usize] <= top).last();
        below.or(all.first()).map(|node| *node as usize)
    }

    /// A floor ends half a column beyond its last one, so what lies there is not steeper than from its surface down to that edge.
    fn rise_to_edge(
        &self,
        rise: i64,
        load: &[i64],
        [upper, lower]: [usize; 2],
        (floor, side): (usize, usize),
    ) -> i64 {
        if self.owner[upper].is_none() {
            return rise;
        }
        let mut most = 2 * load[upper];
        if lower != self.indices.len() + floor {
            // The slope of the floor goes on to its edge: it is that from the neighbour on the other side.
            let behind = self.beside(4 * floor + (side ^ 1), self.base[upper] + load[upper]);
            let behind = behind.filter(|behind| self.owner[*behind] == self.owner[upper]);
            most += behind.map_or(0, |behind| self.base[behind] - self.base[upper]);
        }
        let most = most.max(0);
        rise.clamp(-most, most)
    }

    /// Whether something that can slip stands beside a floor and higher than it: down onto a bare floor, nothing else does.
    fn is_below_loads(&self, floor: usize, top: i64, (load, film): (&[i64], i64)) -> bool {
        let all = &self.near[self.starts[4 * floor] as usize..self.starts[4 * floor + 4] as usize];
        all.iter().any(|node| {
            let node = *node as usize;
            load[node] > film && self.base[node] + load[node] > top
        })
    }

    /// Fluxes of the four triangles at each floor.
    fn fluxes(&self, law: &Law, load: &[i64]) -> Vec<Flux> {
        let film = law.film as i64;
        let (most, part) = ((law.slope * law.rest) * (law.slope * law.rest), law.tau * law.slope);
        let mut fluxes = Vec::new();
        for (floor, node) in (self.indices.len()..self.base.len()).enumerate() {
            let top = self.base[node] + load[node];
            if load[node] <= film && !self.is_below_loads(floor, top, (load, film)) {
                continue;
            }
            let (mut e, mut others) = ([0.0_f64; 4], [node; 4]);
            // The largest squares along x and along z.
            let (mut along, mut across) = (0.0_f64, 0.0_f64);
            for side in 0..4 {
                let Some(other) = self.beside(4 * floor + side, top) else { continue };
                let rise = self.base[other] + load[other] - top;
                let (upper, lower) = if rise > 0 { (other, node) } else { (node, other) };
                let rise = if self.owner[upper] == self.owner[lower] {
                    rise
                } else {
                    self.rise_to_edge(rise, load, [upper, lower], (floor, side))
                };
                let full = self.ceiling[lower] != i64::MAX
                    && self.ceiling[lower] - self.base[lower] - load[lower] <= film;
                if load[upper] > film && !full {
                    (e[side], others[side]) = (to_float(rise), other);
                    let square = e[side] * e[side];
                    (along, across) =
                        if side < 2 { (along.max(square), across) } else { (along, across.max(square)) };
                }
            }
            // None of the four triangles is steeper than these together.
            if along + across <= most {
                continue;
            }
            let weight = |x: usize, z: usize| {
                let square = e[x] * e[x] + e[z] * e[z];
                if square > most { law.tau - part / square.sqrt() } else { 0.0 }
            };
            let [a, b, c, d] = [weight(0, 2), weight(1, 2), weight(0, 3), weight(1, 3)];
            for (side, weight) in [a + c, b + d, a + b, c + d].into_iter().enumerate() {
                let flux = to_integer(weight * e[side]);
                match flux {
                    0 => {}
                    flux if flux > 0 => fluxes.push((others[side] as u32, node as u32, flux)),
                    flux => fluxes.push((node as u32, others[side] as u32, -flux)),
                }
            }
        }
        fluxes
    }

    /// What nodes gain by fluxes that are scaled down to what nodes have and can take. Sums of integers do not depend on their order.
    fn gains(&self, fluxes: &[Flux], load: &[i64]) -> Vec<i64> {
        let (mut out, mut into, mut gain) = (vec![0; load.len()], vec![0; load.len()], vec![0; load.len()]);
        for &(from, to, flux) in fluxes {
            out[from as usize] += flux;
            into[to as usize] += flux;
        }
        let scaled = |flux: i64, has: i64, wanted: i64| {
            if wanted > has {
                (i128::from(flux) * i128::from(has.max(0)) / i128::from(wanted)) as i64
            } else {
                flux
            }
        };
        for &(from, to, flux) in fluxes {
            let (from, to) = (from as usize, to as usize);
            let flux = scaled(flux, load[from], out[from]);
            let ceiling = self.ceiling[to];
            let room = if ceiling == i64::MAX { i64::MAX } else { ceiling - self.base[to] - load[to] };
            let flux = scaled(flux, room, into[to]);
            gain[from] -= flux;
            gain[to] += flux;
        }
        gain
    }
}

impl Ground {
    /// The graph of the floors as they are. All that has fallen is in its tiles.
    fn graph(&mut self) -> Result<Arc<Graph>, Error> {
        if let Some(graph) = self.graph.clone() {
            for (key, _) in &graph.tiles {
                self.ensure(*key)?;
            }
            return Ok(graph);
        }
        let extent = self.extent();
        let mut columns = Columns::new(self.setup.settings.side);
        for &(i, k) in self.floors.keys() {
            for (i, k) in std::iter::once((0, 0)).chain(SIDES).map(|(di, dk)| (i + di, k + dk)) {
                if extent.contains(i, k) {
                    columns.mark(self.setup.place(i, k));
                }
            }
        }
        let mut graph = Graph { indices: columns.number(), ..Graph::default() };
        let mut first = 0;
        for (key, count) in columns.tiles() {
            self.ensure(key)?;
            let roofs = self.roofs.get(&key);
            let stored = self.tiles.get(&key);
            for index in &graph.indices[first..first + count] {
                graph.base.push(stored.map_or(0, |tile| tile.base(*index)));
                graph.ceiling.push(roofs.map_or(i64::MAX, |roofs| roofs[*index]));
            }
            graph.tiles.push((key, first..first + count));
            first += count;
        }
        graph.owner = vec![None; first];
        let number = |(i, k): (i32, i32)| {
            let inside = extent.contains(i, k).then(|| columns.get(self.setup.place(i, k)));
            inside.flatten()
        };
        // The floors over each column.
        let mut over = vec![0..0; first];
        for (column, floors) in self.floors.iter() {
            let first = graph.base.len();
            graph.base.extend(floors.iter().map(|floor| floor.base));
            graph.ceiling.extend(floors.iter().map(|floor| floor.ceiling));
            graph.owner.extend(floors.iter().map(|floor| Some(floor.body)));
            if let Some(number) = number(*column) {
                over[number] = first..graph.base.len();
            }
        }
        let mut node = first;
        let mut open: Vec<u32> = Vec::new();
        for (&(i, k), floors) in self.floors.iter() {
            let beside = SIDES.map(|(di, dk)| number((i + di, k + dk)));
            for _ in floors {
                for number in beside {
                    graph.starts.push(graph.near.len() as u32);
                    let Some(number) = number else { continue };
                    let first = graph.near.len();
                    let all = std::iter::once(number).chain(over[number].clone());
                    open.clear();
                    open.extend(all.filter(|other| graph.is_open(node, *other)).map(|other| other as u32));
                    graph.near.extend(&open);
                    let base = &graph.base;
                    graph.near[first..].sort_by_key(|other| base[*other as usize]);
                }
                node += 1;
            }
        }
        graph.starts.push(graph.near.len() as u32);
        let graph = Arc::new(graph);
        self.graph = Some(graph.clone());
        Ok(graph)
    }

    /// One sweep of the loads, if they or the ground near them slip.
    pub(crate) fn sweep_loads(&mut self, law: &Law) -> Result<(), Error> {
        if self.floors.is_empty() {
            self.stirred = false;
            return Ok(());
        }
        let graph = self.graph()?;
        let near_slips = || {
            let around = |(p, q): Key| (-1..=1).flat_map(move |dq| (-1..=1).map(move |dp| (p + dp, q + dq)));
            let slips = |key: &Key| self.awake.binary_search(key).is_ok();
            graph.tiles.iter().any(|(key, _)| around(*key).any(|key| slips(&key)))
        };
        if !self.stirred && !near_slips() {
            return Ok(());
        }
        let mut load = Vec::with_capacity(graph.base.len());
        for (key, columns) in &graph.tiles {
            let tile = self.tiles.get(key);
            let indices = graph.indices[columns.clone()].iter();
            load.extend(indices.map(|index| tile.map_or(0, |tile| tile.loose[*index])));
        }
        load.extend(self.floors.values().flatten().map(|floor| floor.load));
        let fluxes = graph.fluxes(law, &load);
        let gain = graph.gains(&fluxes, &load);
        self.stirred = gain.iter().any(|gain| *gain != 0);
        if self.stirred {
            self.gain(&graph, &gain)?;
        }
        Ok(())
    }

    /// Adds gains to the nodes of a graph.
    fn gain(&mut self, graph: &Graph, gain: &[i64]) -> Result<(), Error> {
        let side = self.setup.settings.side;
        let cohesive = self.soil().cohesion > 0.0;
        for (key, columns) in &graph.tiles {
            if gain[columns.clone()].iter().all(|gain| *gain == 0) {
                continue;
            }
            let mut bits = vec![0; side];
            let tile = self.tile_mut(*key)?;
            for (gain, &index) in gain[columns.clone()].iter().zip(&graph.indices[columns.clone()]) {
                if *gain != 0 {
                    tile.loose[index] += gain;
                    bits[index / side] |= 1 << (index % side);
                }
            }
            for (row, bits) in tile.awake.iter_mut().zip(&bits) {
                *row |= bits;
            }
            if cohesive {
                note(&mut self.strained, *key, &bits);
            }
            if let Err(at) = self.awake.binary_search(key) {
                self.awake.insert(at, *key);
            }
        }
        let floors = gain[graph.indices.len()..].iter();
        for (floor, gain) in Arc::make_mut(&mut self.floors).values_mut().flatten().zip(floors) {
            floor.load += gain;
        }
        Ok(())
    }
}
