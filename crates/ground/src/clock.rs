//! A tick: bodies move in parts of at most half a cell, between sweeps that are the same everywhere.

use crate::{Body, Error, Ground, Pour};

/// Most parts of the way of a body in a tick.
const PARTS: f64 = 10_000.0;

impl Ground {
    /// The next tick: particles land, pours are added, bodies move, what is too steep slips, and bodies take up material and shed it. Bodies that were there in the tick before and are not in the list
    /// are gone.
    ///
    /// # Errors
    ///
    /// Pours and bodies with values out of range or beyond the edges, bodies that are not closed or too fast, and too much memory. The ground is
    /// not to be used then.
    pub fn advance(&mut self, pours: &[Pour], bodies: &[Body]) -> Result<(), Error> {
        let cell = self.cell();
        let mut parts = Vec::new();
        for body in bodies {
            body.check()?;
            let way = body.way();
            let count = (way / (0.5 * cell)).ceil().max(1.0);
            if count.is_nan() || count > PARTS {
                let most = 0.5 * PARTS * cell;
                return Err(Error::Fast { name: body.name.clone(), way, most, cell });
            }
            parts.push(count as u32);
        }
        self.falls = !pours.is_empty() || !self.particles.is_empty();
        let tick = self.setup.settings.tick;
        let span = [self.time(), (self.book.ticks + 1) as f64 * tick];
        self.keep_bodies(bodies, span)?;
        let (law, sweeps) = (self.setup.law, self.setup.sweeps);
        for body in bodies {
            self.move_body(body, 0.0)?;
        }
        self.land(bodies, span)?;
        for pour in pours {
            self.pour(pour, tick)?;
        }
        for sweep in 0..sweeps {
            for (body, count) in bodies.iter().zip(&parts) {
                // Parts of the way that begin before this sweep and after the one before.
                let number = |sweep: u32| (u64::from(sweep) * u64::from(*count)).div_ceil(u64::from(sweeps));
                for part in number(sweep)..number(sweep + 1) {
                    self.move_body(body, (part + 1) as f64 / f64::from(*count))?;
                }
            }
            self.slip(&law)?;
        }
        self.fail_banks()?;
        self.stick_and_shed(bodies, span)?;
        self.book.ticks += 1;
        Ok(())
    }
}
