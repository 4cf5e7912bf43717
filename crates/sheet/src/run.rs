//! A sheet at any time, in any order.

use crate::{Error, Settings, Sheet, Solid, Solver, State, Step, Wind};

/// The motion of a sheet from a state on. Steps lie on one grid, whatever times are asked for, so results are the same bits in any order. Times
/// before the current step are computed from the first state again: who asks for them often keeps states.
pub struct Run<'a> {
    sheet: &'a Sheet,
    solids: &'a [Solid<'a>],
    wind: &'a dyn Wind,
    solver: Solver,
    start: (f64, State),
    /// The ends of the steps since the last point of the grid of longest steps, and that point.
    track: Vec<(f64, State)>,
}

impl<'a> Run<'a> {
    /// A run from a state at a time (s).
    pub fn new(
        sheet: &'a Sheet,
        solids: &'a [Solid<'a>],
        wind: &'a dyn Wind,
        settings: Settings,
        (time, state): (f64, State),
    ) -> Run<'a> {
        let start = (time, state);
        Run { sheet, solids, wind, solver: Solver::new(settings), track: vec![start.clone()], start }
    }

    /// The state at a time in s; the first state before its time.
    ///
    /// # Errors
    ///
    /// As [`Solver::advance`].
    pub fn at(&mut self, time: f64) -> Result<State, Error> {
        if self.track.first().is_none_or(|first| time < first.0) {
            self.track = vec![self.start.clone()];
        }
        while self.track.last().is_some_and(|last| last.0 < time) {
            self.go_on()?;
        }
        let next = self.track.partition_point(|(end, _)| *end < time).min(self.track.len() - 1);
        let ((from, before), (to, after)) = (&self.track[next.saturating_sub(1)], &self.track[next]);
        Ok(Step { from: *from, to: *to, before, after, pushes: &[], depths: &[] }.at(time))
    }

    /// To the next point of the grid of longest steps.
    fn go_on(&mut self) -> Result<(), Error> {
        let Some((time, mut state)) = self.track.pop() else { return Ok(()) };
        let longest = self.solver.settings.longest;
        let to = ((time / longest + 1e-6).floor() + 1.0) * longest;
        let mut track = vec![(time, state.clone())];
        let observe = |step: &Step| track.push((step.to, step.after.clone()));
        self.solver.advance(self.sheet, &mut state, time..to, self.solids, self.wind, observe)?;
        self.track = track;
        Ok(())
    }
}
