//! The signs and the switches of a module, together in 16 bytes: most modules have few of both, and there are millions of modules.

use super::state::{Signs, Switches};
use dlsys_expr::Sign;

/// So many stand in place.
const FEW: usize = 13;

/// The signs of a rule's atoms, and on which sides conditions inside its active equations are.
#[derive(Clone, Debug)]
pub struct Marks(Kept);

#[derive(Clone, Debug)]
enum Kept {
    /// A switch that is on is `Plus`, another one `Minus`; they stand behind the signs.
    Few {
        signs: u8,
        switches: u8,
        marks: [Sign; FEW],
    },
    Many(Box<(Vec<Sign>, Vec<bool>)>),
}

impl Default for Marks {
    fn default() -> Marks {
        Marks(Kept::Few { signs: 0, switches: 0, marks: [Sign::Undefined; FEW] })
    }
}

impl Marks {
    #[inline]
    pub fn signs(&self) -> &[Sign] {
        match &self.0 {
            Kept::Few { signs, marks, .. } => &marks[..usize::from(*signs)],
            Kept::Many(all) => &all.0,
        }
    }

    #[inline]
    pub fn signs_mut(&mut self) -> &mut [Sign] {
        match &mut self.0 {
            Kept::Few { signs, marks, .. } => &mut marks[..usize::from(*signs)],
            Kept::Many(all) => &mut all.0,
        }
    }

    #[inline]
    pub fn switches(&self) -> Switches {
        match &self.0 {
            Kept::Few { switches: 0, .. } => Switches::new(),
            Kept::Few { signs, switches, marks } => {
                let switches = &marks[usize::from(*signs)..usize::from(*signs + *switches)];
                switches.iter().map(|mark| *mark == Sign::Plus).collect()
            }
            Kept::Many(all) => all.1.iter().copied().collect(),
        }
    }

    /// The same as numbers: 1 for one that is on, 0 for one that is not.
    #[inline]
    pub fn switch_values(&self) -> impl Iterator<Item = f64> {
        let (few, many) = match &self.0 {
            Kept::Few { signs, switches, marks } => {
                (&marks[usize::from(*signs)..usize::from(*signs + *switches)], &[][..])
            }
            Kept::Many(all) => (&[][..], &all.1[..]),
        };
        let few = few.iter().map(|mark| *mark == Sign::Plus);
        few.chain(many.iter().copied()).map(|on| f64::from(u8::from(on)))
    }

    /// Puts signs in the place of those that are there, and leaves the switches.
    #[inline]
    pub fn set_signs(&mut self, new: &[Sign]) {
        match &mut self.0 {
            Kept::Few { signs, switches, marks } if *switches == 0 && new.len() <= FEW => {
                *signs = new.len() as u8;
                marks[..new.len()].copy_from_slice(new);
            }
            _ => self.set(new, &self.switches()),
        }
    }

    /// Puts switches in the place of those that are there, and leaves the signs.
    #[inline]
    pub fn set_switches(&mut self, new: &[bool]) {
        match &mut self.0 {
            Kept::Few { switches, .. } if new.is_empty() => *switches = 0,
            _ => {
                let signs = Signs::from(self.signs());
                self.set(&signs, new);
            }
        }
    }

    fn set(&mut self, new: &[Sign], on: &[bool]) {
        let count = new.len() + on.len();
        if count > FEW {
            self.0 = Kept::Many(Box::new((new.to_vec(), on.to_vec())));
            return;
        }
        let mut marks = [Sign::Undefined; FEW];
        let of = |on: &bool| if *on { Sign::Plus } else { Sign::Minus };
        let all = new.iter().copied().chain(on.iter().map(of));
        marks.iter_mut().zip(all).for_each(|(mark, new)| *mark = new);
        self.0 = Kept::Few { signs: new.len() as u8, switches: on.len() as u8, marks };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_and_switches_are_what_was_put_in_however_many_there_are() {
        assert_eq!(size_of::<Marks>(), 16);
        let counts = [0, 1, 3, FEW - 3, FEW, FEW + 1, 40];
        let mut marks = Marks::default();
        for (signs, switches) in counts.iter().flat_map(|a| counts.iter().map(move |b| (*a, *b))) {
            let kinds = [Sign::Minus, Sign::Zero, Sign::Plus, Sign::Any];
            let signs: Vec<Sign> = (0..signs).map(|i| kinds[i % kinds.len()]).collect();
            let switches: Vec<bool> = (0..switches).map(|i| i % 3 == 0).collect();
            marks.set_signs(&signs);
            assert_eq!(marks.signs(), signs);
            marks.set_switches(&switches);
            assert_eq!((marks.signs(), &marks.switches()[..]), (&signs[..], &switches[..]));
            assert!(marks.switch_values().eq(switches.iter().map(|on| f64::from(u8::from(*on)))));
            if let Some(last) = marks.signs_mut().last_mut() {
                *last = Sign::Undefined;
            }
            let copy = marks.clone();
            marks.set_signs(&signs);
            assert_eq!((marks.signs(), &marks.switches()[..]), (&signs[..], &switches[..]));
            assert_eq!(copy.signs().last().copied(), signs.last().map(|_| Sign::Undefined));
        }
    }
}
