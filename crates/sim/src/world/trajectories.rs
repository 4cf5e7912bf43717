//! How the parameters of one module move, in the room of one formula and eight bytes; the module's own step, if it is integrated alone.
//!
//! Of the parameters of most modules that read others, one at most follows a formula; the others rest, or are components of dense output,
//! the numbers of which follow one another. There are millions of such modules, so that is all that is kept of them.

use crate::trajectory::Trajectory;
use crate::world::state::Step;

/// How a parameter moves: a [`Trajectory`] as it is read.
#[derive(Clone, Copy, Debug)]
pub enum Law<'t> {
    Rest,
    /// A component of the module's own step.
    Step(u32),
    /// A component of the coupled modules.
    Coupled(u32),
    Formula(&'t Trajectory),
}

impl<'t> Law<'t> {
    #[inline]
    fn of(trajectory: &'t Trajectory) -> Law<'t> {
        match *trajectory {
            Trajectory::Rest => Law::Rest,
            Trajectory::Step(component) => Law::Step(component),
            Trajectory::Coupled(component) => Law::Coupled(component),
            _ => Law::Formula(trajectory),
        }
    }

    /// True for dense output.
    pub fn is_numeric(self) -> bool {
        matches!(self, Law::Step(_) | Law::Coupled(_))
    }

    /// The closed form; None for what rests, and for dense output.
    #[inline]
    pub fn formula(self) -> Option<&'t Trajectory> {
        match self {
            Law::Formula(formula) => Some(formula),
            _ => None,
        }
    }
}

/// How all parameters of a module move, by parameter; of none if nothing moves.
#[derive(Clone, Debug)]
pub struct Trajectories(Kept);

#[derive(Clone, Debug)]
enum Kept {
    Few(Few),
    Many(Box<[Trajectory]>),
    /// Modules that are integrated together have none, and there are more of those.
    Own(Box<Own>),
}

/// Those of a module that has made steps of its own, and the last of these.
#[derive(Clone, Debug)]
struct Own {
    all: Trajectories,
    step: Step,
}

/// So many parameters are kept without a list.
const FEW: usize = 4;

/// At most one formula, and components whose numbers are near each other.
#[derive(Clone, Debug)]
struct Few {
    /// The formula of one parameter, or `Rest`.
    formula: Trajectory,
    /// By parameter, one of the numbers below; [`NOTHING`] behind the last one.
    how: [u8; FEW],
    /// The number among the coupled components from which those of these parameters are counted.
    first: u32,
}

const NOTHING: u8 = 0;
const RESTS: u8 = 1;
const FORMULA: u8 = 2;
/// Component 0 from [`Few::first`] on, and component 0 of the own step: those after it have the numbers after these.
const COUPLED: u8 = 3;
const STEP: u8 = 128;

impl Few {
    #[inline]
    fn get(&self, parameter: usize) -> Option<Law<'_>> {
        Some(match *self.how.get(parameter)? {
            NOTHING => return None,
            RESTS => Law::Rest,
            FORMULA => Law::Formula(&self.formula),
            how @ COUPLED..STEP => Law::Coupled(self.first + u32::from(how - COUPLED)),
            how => Law::Step(u32::from(how - STEP)),
        })
    }

    /// Puts a trajectory in a place; gives it back if there is no room for it beside the others.
    #[inline]
    fn set(&mut self, place: usize, trajectory: Trajectory) -> Result<(), Trajectory> {
        if place >= FEW {
            return Err(trajectory);
        }
        if self.how[place] == FORMULA {
            self.formula = Trajectory::Rest;
        }
        // What is there counts no more, for the numbers of the others.
        self.how[place] = RESTS;
        self.how[place] = match trajectory {
            Trajectory::Rest => RESTS,
            Trajectory::Step(number) if number < u32::from(u8::MAX - STEP) => STEP + number as u8,
            Trajectory::Coupled(number) => {
                if !self.how.iter().any(|how| (COUPLED..STEP).contains(how)) {
                    self.first = number;
                }
                match number.checked_sub(self.first) {
                    Some(behind) if behind < u32::from(STEP - COUPLED) => COUPLED + behind as u8,
                    _ => return Err(trajectory),
                }
            }
            Trajectory::Step(_) => return Err(trajectory),
            formula if matches!(self.formula, Trajectory::Rest) => {
                self.formula = formula;
                FORMULA
            }
            formula => return Err(formula),
        };
        Ok(())
    }

    /// Lets so many parameters rest, and no more.
    #[inline]
    fn rest(&mut self, count: usize) {
        if !matches!(self.formula, Trajectory::Rest) {
            self.formula = Trajectory::Rest;
        }
        self.how = [NOTHING; FEW];
        self.how[..count].fill(RESTS);
    }

    /// Makes some parameters components of the coupled modules; false if others stand in the way.
    #[inline]
    fn couple(&mut self, parameters: &[usize], first: u32) -> bool {
        let mut how = self.how;
        for (&parameter, number) in parameters.iter().zip(COUPLED..) {
            match how.get_mut(parameter) {
                Some(how) if *how != FORMULA => *how = number,
                _ => return false,
            }
        }
        // The numbers of others are counted from another one.
        let is_other = |place| (COUPLED..STEP).contains(&how[place]) && !parameters.contains(&place);
        if (0..FEW).any(is_other) {
            return false;
        }
        (self.how, self.first) = (how, first);
        true
    }

    /// The trajectories one by one.
    fn into_list(mut self) -> Vec<Trajectory> {
        let mut all = Vec::with_capacity(FEW);
        while let Some(law) = self.get(all.len()) {
            all.push(match law {
                Law::Rest => Trajectory::Rest,
                Law::Step(component) => Trajectory::Step(component),
                Law::Coupled(component) => Trajectory::Coupled(component),
                Law::Formula(_) => std::mem::take(&mut self.formula),
            });
        }
        all
    }
}

impl Default for Trajectories {
    fn default() -> Trajectories {
        Trajectories(Kept::Few(Few { formula: Trajectory::Rest, how: [NOTHING; FEW], first: 0 }))
    }
}

impl Trajectories {
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.get(0).is_none()
    }

    /// How a parameter moves; None if no parameter does.
    #[inline]
    pub fn get(&self, parameter: usize) -> Option<Law<'_>> {
        match &self.0 {
            Kept::Few(few) => few.get(parameter),
            Kept::Many(all) => all.get(parameter).map(Law::of),
            Kept::Own(own) => own.all.get(parameter),
        }
    }

    /// How all of them move.
    #[inline]
    pub fn iter(&self) -> impl Iterator<Item = Law<'_>> {
        (0..).map_while(|parameter| self.get(parameter))
    }

    /// Their components among those of the coupled modules.
    pub fn coupled(&self) -> impl Iterator<Item = u32> {
        self.iter().filter_map(|law| match law {
            Law::Coupled(component) => Some(component),
            _ => None,
        })
    }

    /// The module's last own step.
    #[inline]
    pub fn step(&self) -> Option<&Step> {
        match &self.0 {
            Kept::Own(own) => Some(&own.step),
            Kept::Few(_) | Kept::Many(_) => None,
        }
    }

    #[inline]
    pub fn step_mut(&mut self) -> Option<&mut Step> {
        match &mut self.0 {
            Kept::Own(own) => Some(&mut own.step),
            Kept::Few(_) | Kept::Many(_) => None,
        }
    }

    /// Keeps the first own step of a module.
    pub fn begin_steps(&mut self, step: Step) {
        let all = std::mem::take(self);
        self.0 = Kept::Own(Box::new(Own { all, step }));
    }

    /// Forgets the step.
    pub fn end_steps(&mut self) {
        if let Kept::Own(own) = &mut self.0 {
            *self = std::mem::take(&mut own.all);
        }
    }

    /// Puts others in the place of all.
    pub fn assign(&mut self, all: impl ExactSizeIterator<Item = Trajectory>) {
        // The memory of a list is used again.
        match &mut self.0 {
            Kept::Own(own) => own.all.assign(all),
            Kept::Many(kept) if kept.len() == all.len() => {
                kept.iter_mut().zip(all).for_each(|(kept, new)| *kept = new)
            }
            Kept::Few(_) | Kept::Many(_) => {
                *self = Trajectories::default();
                all.enumerate().for_each(|(parameter, trajectory)| self.set(parameter, trajectory));
            }
        }
    }

    /// Makes some of so many parameters components of the module's own step, in this order, and lets the others rest.
    pub fn follow_step(&mut self, count: usize, numeric: impl Iterator<Item = usize>) {
        match &mut self.0 {
            Kept::Few(few) if count <= FEW => few.rest(count),
            _ => self.assign((0..count).map(|_| Trajectory::Rest)),
        }
        for (parameter, component) in numeric.zip(0..) {
            self.set(parameter, Trajectory::Step(component));
        }
    }

    /// Lets all parameters rest.
    pub fn rest(&mut self) {
        match &mut self.0 {
            Kept::Few(few) => few.rest(few.how.iter().take_while(|how| **how != NOTHING).count()),
            Kept::Many(all) => all.fill_with(Trajectory::default),
            Kept::Own(own) => own.all.rest(),
        }
    }

    /// Makes some parameters components of the coupled modules, with numbers in this order from one on.
    pub fn couple(&mut self, parameters: &[usize], first: u32) {
        if let Kept::Few(few) = &mut self.0
            && few.couple(parameters, first)
        {
            return;
        }
        // Before any of them has a new number, so that all have room beside each other.
        parameters.iter().for_each(|parameter| self.set(*parameter, Trajectory::Rest));
        for (&parameter, component) in parameters.iter().zip(first..) {
            self.set(parameter, Trajectory::Coupled(component));
        }
    }

    /// Puts one in the place of another, or behind the last.
    fn set(&mut self, parameter: usize, trajectory: Trajectory) {
        let refused = match &mut self.0 {
            Kept::Few(few) => match few.set(parameter, trajectory) {
                Ok(()) => return,
                Err(refused) => refused,
            },
            Kept::Many(all) if parameter < all.len() => {
                all[parameter] = trajectory;
                return;
            }
            Kept::Many(_) => trajectory,
            Kept::Own(own) => return own.all.set(parameter, trajectory),
        };
        self.list(parameter, refused);
    }

    /// The same in a list, which is made.
    #[cold]
    fn list(&mut self, parameter: usize, trajectory: Trajectory) {
        let mut all = match std::mem::take(self).0 {
            Kept::Few(few) => few.into_list(),
            Kept::Many(all) => all.into_vec(),
            Kept::Own(_) => unreachable!("the trajectories beside a step are set themselves"),
        };
        all.resize_with(all.len().max(parameter + 1), Trajectory::default);
        all[parameter] = trajectory;
        self.0 = Kept::Many(all.into_boxed_slice());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::state::Control;
    use dlsys_ode::Dense;
    use dlsys_tree::SimTime;

    /// The same as trajectories, formulas by their first coefficient.
    fn read(all: &Trajectories) -> Vec<(char, f64)> {
        let of = |law| match law {
            Law::Rest => ('r', 0.0),
            Law::Step(component) => ('s', f64::from(component)),
            Law::Coupled(component) => ('c', f64::from(component)),
            Law::Formula(formula) => ('f', formula.rate(0.0)),
        };
        all.iter().map(of).collect()
    }

    fn formula(rate: f64) -> Trajectory {
        Trajectory::Polynomial([rate, 0.0, 0.0, 0.0])
    }

    #[test]
    fn they_are_what_was_put_in_with_room_for_all_and_without() {
        use Trajectory::{Coupled, Rest, Step};
        assert_eq!(size_of::<Trajectories>(), 48);
        type Case<'c> = (Vec<Trajectory>, &'c [(char, f64)], bool);
        let cases: [Case; 9] = [
            (vec![], &[], true),
            (vec![formula(2.0), Coupled(7)], &[('f', 2.0), ('c', 7.0)], true),
            (
                vec![Rest, Coupled(70_000), formula(3.0), Coupled(70_001)],
                &[('r', 0.0), ('c', 7e4), ('f', 3.0), ('c', 70_001.0)],
                true,
            ),
            (vec![Step(1), Rest, Step(0)], &[('s', 1.0), ('r', 0.0), ('s', 0.0)], true),
            (vec![Coupled(9), Coupled(8)], &[('c', 9.0), ('c', 8.0)], false),
            (vec![Coupled(8), Coupled(8_000)], &[('c', 8.0), ('c', 8e3)], false),
            (vec![Step(300)], &[('s', 300.0)], false),
            (vec![formula(1.0), Rest, formula(2.0)], &[('f', 1.0), ('r', 0.0), ('f', 2.0)], false),
            (
                vec![Step(0), Step(1), Step(2), formula(5.0), Step(3)],
                &[('s', 0.0), ('s', 1.0), ('s', 2.0), ('f', 5.0), ('s', 3.0)],
                false,
            ),
        ];
        for (given, wanted, few) in cases {
            let mut all = Trajectories::default();
            for _ in 0..2 {
                all.assign(given.clone().into_iter());
                assert_eq!(read(&all), wanted);
                assert_eq!((all.is_empty(), matches!(all.0, Kept::Few(_))), (wanted.is_empty(), few));
            }
            assert_eq!(read(&all.clone()), wanted);
            all.rest();
            assert_eq!(read(&all), vec![('r', 0.0); wanted.len()]);
            all.assign([formula(4.0)].into_iter());
            assert_eq!(read(&all), [('f', 4.0)]);
        }
    }

    #[test]
    fn a_step_stands_beside_any_of_them() {
        let step = |number| Step {
            dense: Dense::new(SimTime::ZERO, None, 1.0, 0, vec![1.0]),
            control: Control::default(),
            solve: 0,
            begun: SimTime::ZERO,
            first: 0.0,
            number,
            hurdle: None,
            live: true,
            mark: SimTime::ZERO,
            since_mark: 0,
        };
        let mut all = Trajectories::default();
        all.follow_step(3, [2, 0].into_iter());
        let wanted = [('s', 1.0), ('r', 0.0), ('s', 0.0)];
        assert!(read(&all) == wanted && all.step().is_none());
        all.begin_steps(step(7));
        all.step_mut().expect("it has one").number += 1;
        assert_eq!((&read(&all)[..], all.step().map(|step| step.number)), (&wanted[..], Some(8)));
        all.assign([formula(1.0), formula(2.0)].into_iter());
        all.couple(&[0], 5);
        all.assign([Trajectory::Rest, formula(3.0)].into_iter());
        assert!(all.step().is_some());
        all.end_steps();
        all.end_steps();
        assert!(read(&all) == [('r', 0.0), ('f', 3.0)] && all.step().is_none());
    }

    #[test]
    fn components_get_new_numbers() {
        let mut all = Trajectories::default();
        all.assign([Trajectory::Step(1), formula(2.0), Trajectory::Step(0)].into_iter());
        for first in [500, 3, 4] {
            all.couple(&[2, 0], first);
            let of = f64::from(first);
            assert_eq!(read(&all), [('c', of + 1.0), ('f', 2.0), ('c', of)]);
            assert_eq!(all.coupled().collect::<Vec<_>>(), [first + 1, first]);
            assert!(matches!(all.0, Kept::Few(_)));
        }
        // A formula gives its room to another.
        all.couple(&[1], 6);
        all.set(0, formula(1.0));
        assert_eq!(read(&all), [('f', 1.0), ('c', 6.0), ('c', 4.0)]);
        all.assign([formula(1.0), formula(2.0)].into_iter());
        all.couple(&[1], 8);
        assert_eq!(read(&all), [('f', 1.0), ('c', 8.0)]);
    }
}
