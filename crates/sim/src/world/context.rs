//! The modules that a rule reads: its context, and the modules attached to its module.

use std::ops::Deref;

use smallvec::SmallVec;

use dlsys_expr::{Scratch, Value};
use dlsys_model::Rule;
use dlsys_tree::ModuleId;

/// The modules that a rule looks at: those of its context in the order of its variables, then, for each of its
/// aggregates, those attached to it that match.
#[derive(Debug, Default, PartialEq)]
pub struct Context {
    modules: SmallVec<[ModuleId; 2]>,
    /// Those behind the context; few rules have aggregates.
    attached: Option<Box<Attached>>,
}

/// The modules behind the context: those that aggregates look at.
#[derive(Clone, Debug, PartialEq)]
struct Attached {
    /// The number of modules of the context.
    context: u32,
    /// Where the children of each aggregate end.
    ends: SmallVec<[u32; 2]>,
}

impl Clone for Context {
    fn clone(&self) -> Context {
        // A copy of the memory: element by element takes several times as long, and an event copies five.
        Context { modules: SmallVec::from_slice(&self.modules), attached: self.attached.clone() }
    }
}

impl Deref for Context {
    type Target = [ModuleId];

    fn deref(&self) -> &[ModuleId] {
        &self.modules
    }
}

impl<'a> IntoIterator for &'a Context {
    type Item = &'a ModuleId;
    type IntoIter = std::slice::Iter<'a, ModuleId>;

    fn into_iter(self) -> Self::IntoIter {
        self.modules.iter()
    }
}

impl Context {
    pub fn clear(&mut self) {
        self.modules.clear();
        self.attached = None;
    }

    /// Adds a module of the context.
    pub fn push(&mut self, id: ModuleId) {
        self.modules.push(id);
    }

    /// Takes back all modules of the context but so many.
    pub fn truncate(&mut self, context: usize) {
        self.modules.truncate(context);
    }

    /// Puts a module in the place of another.
    pub fn exchange(&mut self, old: ModuleId, new: ModuleId) {
        self.modules.iter_mut().filter(|id| **id == old).for_each(|id| *id = new);
    }

    /// Turns round the first modules of the context.
    pub fn reverse(&mut self, first: usize) {
        self.modules[..first].reverse();
    }

    /// Adds the children that an aggregate looks at.
    pub fn push_children(&mut self, children: impl Iterator<Item = ModuleId>) {
        let context = self.modules.len() as u32;
        self.modules.extend(children);
        let attached =
            self.attached.get_or_insert_with(|| Box::new(Attached { context, ends: SmallVec::new() }));
        attached.ends.push(self.modules.len() as u32);
    }

    /// The context alone.
    pub fn context(&self) -> &[ModuleId] {
        &self.modules
            [..self.attached.as_ref().map_or(self.modules.len(), |attached| attached.context as usize)]
    }

    /// The children of one aggregate.
    pub fn children(&self, aggregate: usize) -> &[ModuleId] {
        let Some(Attached { context, ends }) = self.attached.as_deref() else { return &[] };
        let end = |i: usize| ends.get(i).copied().unwrap_or(*context) as usize;
        let from = aggregate.checked_sub(1).map_or(*context as usize, end);
        &self.modules[from..end(aggregate).max(from)]
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
