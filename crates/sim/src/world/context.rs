//! The modules that a rule reads: its context, and the modules attached to its module.

use std::ops::Deref;

use smallvec::SmallVec;

use dlsys_expr::{Scratch, Value};
use dlsys_model::Rule;
use dlsys_tree::ModuleId;

/// The modules that a rule looks at: those of its context in the order of its variables, then, for each of its
/// aggregates, those attached to it that match.
#[derive(Clone, Debug, Default)]
pub struct Context(Kept);

/// Most modules look at no more than two others, and there are millions of them: these stand in place.
const FEW: usize = 2;

#[derive(Clone, Debug)]
enum Kept {
    Few { count: u8, modules: [ModuleId; FEW] },
    Many(Box<Many>),
}

impl Default for Kept {
    fn default() -> Kept {
        Kept::Few { count: 0, modules: [ModuleId::default(); FEW] }
    }
}

/// Any number of modules.
#[derive(Clone, Debug)]
struct Many {
    modules: Vec<ModuleId>,
    /// Those behind the context; few rules have aggregates.
    attached: Option<Attached>,
}

/// The modules behind the context: those that aggregates look at.
#[derive(Clone, Debug, PartialEq)]
struct Attached {
    /// The number of modules of the context.
    context: u32,
    /// Where the children of each aggregate end.
    ends: SmallVec<[u32; 2]>,
}

impl Deref for Context {
    type Target = [ModuleId];

    #[inline]
    fn deref(&self) -> &[ModuleId] {
        match &self.0 {
            Kept::Few { count, modules } => &modules[..usize::from(*count)],
            Kept::Many(many) => &many.modules,
        }
    }
}

impl<'a> IntoIterator for &'a Context {
    type Item = &'a ModuleId;
    type IntoIter = std::slice::Iter<'a, ModuleId>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl PartialEq for Context {
    fn eq(&self, other: &Context) -> bool {
        self[..] == other[..] && self.attached() == other.attached()
    }
}

impl Context {
    /// The same modules, to be changed.
    fn modules_mut(&mut self) -> &mut [ModuleId] {
        match &mut self.0 {
            Kept::Few { count, modules } => &mut modules[..usize::from(*count)],
            Kept::Many(many) => &mut many.modules,
        }
    }

    fn attached(&self) -> Option<&Attached> {
        match &self.0 {
            Kept::Many(many) => many.attached.as_ref(),
            _ => None,
        }
    }

    /// The same modules with room for any number of them.
    fn many(&mut self) -> &mut Many {
        if !matches!(self.0, Kept::Many(_)) {
            self.0 = Kept::Many(Box::new(Many { modules: self.to_vec(), attached: None }));
        }
        match &mut self.0 {
            Kept::Many(many) => many,
            _ => unreachable!("it has just been made"),
        }
    }

    #[inline]
    pub fn clear(&mut self) {
        self.0 = Kept::default();
    }

    /// Adds a module of the context.
    #[inline]
    pub fn push(&mut self, id: ModuleId) {
        match &mut self.0 {
            Kept::Few { count, modules } if usize::from(*count) < FEW => {
                modules[usize::from(*count)] = id;
                *count += 1;
            }
            Kept::Few { .. } | Kept::Many(_) => self.many().modules.push(id),
        }
    }

    /// Takes back all modules of the context but so many.
    pub fn truncate(&mut self, context: usize) {
        match &mut self.0 {
            Kept::Few { count, .. } if usize::from(*count) > context => *count = context as u8,
            Kept::Few { .. } => {}
            Kept::Many(many) => many.modules.truncate(context),
        }
    }

    /// Puts a module in the place of another.
    pub fn exchange(&mut self, old: ModuleId, new: ModuleId) {
        self.modules_mut().iter_mut().filter(|id| **id == old).for_each(|id| *id = new);
    }

    /// Turns round the first modules of the context.
    pub fn reverse(&mut self, first: usize) {
        self.modules_mut()[..first].reverse();
    }

    /// Adds the children that an aggregate looks at.
    pub fn push_children(&mut self, children: impl Iterator<Item = ModuleId>) {
        let Many { modules, attached } = self.many();
        let context = modules.len() as u32;
        modules.extend(children);
        let attached = attached.get_or_insert_with(|| Attached { context, ends: SmallVec::new() });
        attached.ends.push(modules.len() as u32);
    }

    /// The context alone.
    pub fn context(&self) -> &[ModuleId] {
        match self.attached() {
            Some(attached) => &self[..attached.context as usize],
            None => self,
        }
    }

    /// The children of one aggregate.
    pub fn children(&self, aggregate: usize) -> &[ModuleId] {
        let Some(Attached { context, ends }) = self.attached() else { return &[] };
        let end = |i: usize| ends.get(i).copied().unwrap_or(*context) as usize;
        let from = aggregate.checked_sub(1).map_or(*context as usize, end);
        &self[from..end(aggregate).max(from)]
    }
}

/// Appends the values of a rule's aggregates, `t` and `age` to the variables of module and context. `values` appends
/// the parameters of a child.
pub fn gather<T: Value>(
    rule: &Rule,
    around: &Context,
    time: [T; 2],
    variables: &mut Vec<T>,
    scratch: &mut Scratch<T>,
    wanted: impl Fn(usize) -> bool,
    mut values: impl FnMut(ModuleId, &mut Vec<T>),
) {
    variables.resize(rule.variables - 2, T::constant(0.0));
    variables.extend(time);
    for (i, aggregate) in rule.aggregates.iter().enumerate() {
        if !wanted(rule.first_aggregate + i) {
            continue;
        }
        let mut children = around.children(i).iter();
        let next = |variables: &mut Vec<T>| match children.next() {
            Some(&child) => {
                values(child, variables);
                true
            }
            None => false,
        };
        let value = aggregate.evaluate(variables, next, scratch);
        variables[rule.first_aggregate + i] = value;
    }
}
