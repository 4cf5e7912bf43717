//! Time that goes on, stands still, and begins again.

/// What the speeds of the player are called, and how many times as fast they are.
pub const SPEEDS: [f64; 7] = [0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0];
/// Seconds that a whole run takes at speed 1: as long as its frames at 30 a second, but not too short or long.
const SHORTEST: f64 = 6.0;
const LONGEST: f64 = 30.0;

/// The time that is shown.
#[derive(Clone, Debug, PartialEq)]
pub struct Player {
    /// First and last time, in the model's unit.
    pub range: [f64; 2],
    /// From frame to frame, for single steps.
    pub step: f64,
    pub time: f64,
    pub playing: bool,
    pub loops: bool,
    /// One of [`SPEEDS`].
    pub speed: f64,
}

impl Player {
    /// At the first time, standing still.
    pub fn new(range: [f64; 2], step: f64) -> Player {
        Player { range, step, time: range[0], playing: false, loops: true, speed: 1.0 }
    }

    /// Units of time in a second, at speed 1.
    fn pace(&self) -> f64 {
        let [from, to] = self.range;
        let frames = if self.step > 0.0 { (to - from) / self.step } else { 0.0 };
        (to - from) / (frames / 30.0).clamp(SHORTEST, LONGEST)
    }

    /// Lets so many seconds pass.
    pub fn pass(&mut self, seconds: f64) {
        let [from, to] = self.range;
        if !self.playing || to <= from {
            return;
        }
        // Nothing is made up for that was missed while nobody looked.
        self.time += seconds.clamp(0.0, 0.25) * self.speed * self.pace();
        if self.time >= to {
            self.playing = self.loops;
            self.time = if self.loops { from + (self.time - from) % (to - from) } else { to };
        }
    }

    /// Plays or stops; at the end it begins again.
    pub fn play(&mut self, on: bool) {
        let [from, to] = self.range;
        if on && self.time >= to {
            self.time = from;
        }
        self.playing = on && to > from;
    }

    /// Stops at a time, or as near as there is one.
    pub fn seek(&mut self, time: f64) {
        self.playing = false;
        self.time = time.clamp(self.range[0], self.range[1]);
    }

    /// Stops so many frames later, or earlier, at a frame.
    pub fn frames(&mut self, count: i32) {
        if self.step <= 0.0 {
            return;
        }
        let frame = (self.time - self.range[0]) / self.step + f64::from(count);
        let whole = if count > 0 { (frame + 1e-6).floor() } else { (frame - 1e-6).ceil() };
        self.seek(self.range[0] + whole * self.step);
    }

    /// The next speed, or the one before.
    pub fn faster(&mut self, by: i32) {
        let now = SPEEDS.iter().position(|speed| *speed == self.speed).unwrap_or(3) as i32;
        self.speed = SPEEDS[(now + by).clamp(0, SPEEDS.len() as i32 - 1) as usize];
    }

    /// Another model, or the same with other frames: the time stays what it is, as far as it is there.
    pub fn set_range(&mut self, range: [f64; 2], step: f64) {
        self.time = self.time.clamp(range[0], range[1]);
        (self.range, self.step) = (range, step);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_goes_on_stops_and_begins_again() {
        let mut player = Player::new([2.0, 8.0], 0.1);
        player.pass(1.0);
        assert_eq!(player.time, 2.0, "it stands");
        player.play(true);
        player.pass(0.1);
        assert!((player.time - 2.1).abs() < 1e-12, "six units in six seconds");
        player.pass(100.0);
        assert!((player.time - 2.35).abs() < 1e-12, "what was missed is missed");
        player.time = 7.95;
        player.pass(0.1);
        assert!((player.time - 2.05).abs() < 1e-9 && player.playing);
        (player.loops, player.time) = (false, 7.95);
        player.pass(0.1);
        assert!(player.time == 8.0 && !player.playing);
        player.play(true);
        assert_eq!(player.time, 2.0);
        player.frames(-1);
        assert!(player.time == 2.0 && !player.playing);
        player.seek(2.05);
        player.frames(1);
        assert!((player.time - 2.1).abs() < 1e-9);
        player.frames(-1);
        assert!((player.time - 2.0).abs() < 1e-9);
        player.faster(-9);
        assert_eq!(player.speed, 0.1);
        player.seek(99.0);
        player.set_range([0.0, 5.0], 1.0);
        assert_eq!(player.time, 5.0);
    }

    #[test]
    fn a_single_time_is_no_film() {
        let mut player = Player::new([3.0, 3.0], 0.0);
        player.play(true);
        player.pass(0.1);
        player.frames(1);
        assert!(player.time == 3.0 && !player.playing);
    }
}
