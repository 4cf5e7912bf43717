//! Pouring: material that is added, on a disc or everywhere, to the quantum.

use std::sync::Arc;

use crate::error::check;
use crate::kernel::to_float;
use crate::relief::quanta;
use crate::tile::{COLUMN_BYTES, HIGHEST, QUANTA};
use crate::{Error, Ground};

/// Material that is added.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pour {
    /// Its identity: what is left over in a tick is poured in the next.
    pub id: u64,
    /// Where.
    pub place: Place,
    /// Volume in m³/s; height in m/s everywhere.
    pub rate: f64,
}

/// Where material is added.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    /// On columns within a distance of a centre, equally thick; on the nearest one if there is none.
    Disc {
        /// Centre: x and z, in m.
        centre: [f64; 2],
        /// Radius in m.
        radius: f64,
    },
    /// On all columns, as snow falls.
    Everywhere,
}

impl Ground {
    /// Adds what a pour gives in some seconds.
    ///
    /// # Errors
    ///
    /// A negative or too large amount, a place without ground, or too much memory.
    pub fn pour(&mut self, pour: &Pour, seconds: f64) -> Result<(), Error> {
        check("a rate of a pour", pour.rate, pour.rate >= 0.0, "0 or more")?;
        check("a time of a pour (s)", seconds, seconds >= 0.0, "0 or more")?;
        match pour.place {
            Place::Everywhere => self.fall(pour.rate * seconds),
            Place::Disc { centre, radius } => self.pour_disc(pour, centre, radius, seconds),
        }
    }

    fn fall(&mut self, height: f64) -> Result<(), Error> {
        let cell = self.cell();
        let wanted = height / cell * QUANTA + self.book.owed;
        let highest = self.setup.range[1].max(0) + self.book.fallen;
        if wanted.is_nan() || wanted + highest as f64 >= HIGHEST as f64 {
            let most = HIGHEST as f64 / QUANTA * cell;
            return Err(Error::Height { name: "what falls everywhere", value: height, at: [0.0; 2], most });
        }
        let added = wanted.floor();
        self.book.owed = wanted - added;
        if added > 0.0 {
            // What was bare may slip now.
            let film = self.setup.law.film;
            let bare = |loose: &i64| to_float(*loose) <= film;
            let thin = self.tiles.iter().filter(|(_, tile)| tile.loose.iter().any(bare)).map(|(key, _)| *key);
            self.fresh.extend(thin);
            if self.book.fallen == 0 {
                self.fresh.extend(&self.setup.steep);
            }
            self.fresh.sort_unstable();
            self.fresh.dedup();
            self.book.fallen += added as i64;
            self.catch_fall(added as i64)?;
        }
        Ok(())
    }

    /// Puts what has fallen on each column onto the highest floors over columns instead.
    fn catch_fall(&mut self, added: i64) -> Result<(), Error> {
        let extent = self.extent();
        let columns: Vec<_> = self.floors.keys().copied().filter(|(i, k)| extent.contains(*i, *k)).collect();
        self.stirred |= !columns.is_empty();
        for (i, k) in columns {
            let (key, index) = self.setup.place(i, k);
            self.ensure(key)?;
            self.tile_mut(key)?.loose[index] -= added;
            if let Some(floor) =
                Arc::make_mut(&mut self.floors).get_mut(&(i, k)).and_then(|all| all.last_mut())
            {
                floor.load += added;
            }
        }
        Ok(())
    }

    fn pour_disc(&mut self, pour: &Pour, centre: [f64; 2], radius: f64, seconds: f64) -> Result<(), Error> {
        check("a coordinate of a pour (m)", centre[0], true, "a finite number")?;
        check("a coordinate of a pour (m)", centre[1], true, "a finite number")?;
        check("a radius of a pour (m)", radius, radius >= 0.0, "0 or more")?;
        let columns = self.disc(centre, radius)?;
        let cell = self.cell();
        let Some(&(first, _)) = columns.first() else {
            return Err(Error::Outside { name: "a pour".to_owned(), at: centre });
        };
        let debt = self.book.debts.get(&pour.id).copied().unwrap_or(0.0);
        let wanted = pour.rate * seconds / (cell * cell * cell) * QUANTA + debt;
        let share = (wanted / columns.len() as f64).floor();
        let thickness = pour.rate * seconds / (cell * cell) / columns.len() as f64;
        let most = HIGHEST as f64 / QUANTA * cell;
        if share.is_nan() || share >= HIGHEST as f64 || quanta(thickness, cell).is_none() {
            let at = [f64::from(first) * cell, centre[1]];
            return Err(Error::Height { name: "what is poured", value: thickness, at, most });
        }
        self.book.debts.insert(pour.id, wanted - share * columns.len() as f64);
        let share = share as i64;
        if share == 0 {
            return Ok(());
        }
        for (i, k) in columns {
            self.book.poured += i128::from(share);
            if let Some(floor) =
                Arc::make_mut(&mut self.floors).get_mut(&(i, k)).and_then(|all| all.last_mut())
            {
                floor.load += share;
                self.stirred = true;
                continue;
            }
            self.wake(i, k)?;
            let (key, index) = self.setup.place(i, k);
            let tile = self.tile_mut(key)?;
            tile.loose[index] += share;
            if tile.top(index) > HIGHEST {
                let at = [i, k].map(|at| f64::from(at) * cell);
                let value = tile.top(index) as f64 / QUANTA * cell;
                return Err(Error::Height { name: "the ground", value, at, most });
            }
        }
        Ok(())
    }

    /// The columns within a distance of a centre, or the nearest one; none if that is beyond the edges.
    ///
    /// # Errors
    ///
    /// They need more memory than allowed.
    fn disc(&self, centre: [f64; 2], radius: f64) -> Result<Vec<(i32, i32)>, Error> {
        let (extent, cell) = (self.extent(), self.cell());
        let [x, z] = centre.map(|at| at / cell);
        let radius = radius / cell;
        let range = |at: f64, [from, to]: [i32; 2]| {
            let low = (at - radius).ceil().max(f64::from(from));
            let high = (at + radius).floor().min(f64::from(to));
            (low, high)
        };
        let ((i0, i1), (k0, k1)) = (range(x, extent.x), range(z, extent.z));
        let mut all = Vec::new();
        if i0 <= i1 && k0 <= k1 {
            let wide = |k: f64| {
                let half = (radius * radius - (k - z).powi(2)).max(0.0).sqrt();
                ((x + half).min(i1) - (x - half).max(i0)).max(0.0)
            };
            let count: f64 = (k0 as i32..=k1 as i32).map(|k| wide(f64::from(k))).sum();
            let most = self.setup.settings.memory;
            if count * COLUMN_BYTES as f64 > (most as f64) * 1_048_576.0 {
                return Err(Error::Memory { most, at: centre });
            }
            for k in k0 as i32..=k1 as i32 {
                for i in i0 as i32..=i1 as i32 {
                    let (u, v) = (f64::from(i) - x, f64::from(k) - z);
                    if u * u + v * v <= radius * radius {
                        all.push((i, k));
                    }
                }
            }
        }
        let nearest = (x.round(), z.round());
        let near = |at: f64, [from, to]: [i32; 2]| (f64::from(from)..=f64::from(to)).contains(&at);
        if all.is_empty() && near(nearest.0, extent.x) && near(nearest.1, extent.z) {
            all.push((nearest.0 as i32, nearest.1 as i32));
        }
        Ok(all)
    }
}
