//! Strings that are replaced and cut, and what other tests of trees need.

use super::*;
use crate::Visit;
use dlsys_model::Kinds;

/// A string of kinds without parameters, written with one letter each.
pub fn string(kinds: &mut Kinds, text: &str) -> Vec<KindId> {
    text.chars().map(|c| kinds.intern(&c.to_string(), 0)).collect()
}

pub fn show(kinds: &Kinds, tree: &Tree) -> String {
    tree.walk()
        .map(|visit| match visit {
            Visit::Open => "[".to_owned(),
            Visit::Close => "]".to_owned(),
            Visit::Module(id) => kinds.get(tree.kind(id)).name.clone(),
        })
        .collect()
}

pub fn grown(text: &str, swaps: &[(usize, &str)]) -> (Kinds, Tree) {
    let mut kinds = Kinds::default();
    let axiom = string(&mut kinds, text);
    let successors: Vec<_> = swaps.iter().map(|(at, s)| (*at, string(&mut kinds, s))).collect();
    let mut tree = Tree::new(vec![0; kinds.len()], vec![0; kinds.len()]);
    tree.append(&axiom, &[], SimTime::ZERO, Family::AXIOM, &mut Vec::new());
    for (at, successor) in successors {
        let ids: Vec<ModuleId> = tree
            .walk()
            .filter_map(|v| match v {
                Visit::Module(id) => Some(id),
                _ => None,
            })
            .collect();
        let family = tree.lineage(ids[at]).family(0);
        tree.replace(ids[at], &successor, &[], SimTime::ZERO, family, &mut Vec::new());
    }
    (kinds, tree)
}

#[test]
fn a_production_replaces_a_module_by_its_successor_in_place() {
    let (kinds, tree) = grown("AB[C[D]E]F", &[(2, "X[Y]"), (0, ""), (0, "PQ")]);
    assert_eq!(show(&kinds, &tree), "PQ[X[Y][D]E]F");
    assert_eq!(tree.len(), 7);
}

#[test]
fn slots_and_values_of_removed_modules_are_used_again() {
    let (mut kinds, mut tree) = grown("A[B[C]%D[E[F]G]H]IXYZ", &[]);
    let more = string(&mut kinds, "XY[Z]");
    let cut = kinds.find("%", 0).expect("%");
    let find = |tree: &Tree, kind| {
        let modules = tree.walk().filter_map(|v| if let Visit::Module(id) = v { Some(id) } else { None });
        { modules }.find(|id| tree.kind(*id) == kind).expect("it is there")
    };
    let cut = find(&tree, cut);
    assert_eq!(tree.following(cut).len(), 5);
    tree.cut(cut, |slot| slot as usize == cut.slot());
    assert_eq!((show(&kinds, &tree).as_str(), tree.len()), ("A[B[C]]IXYZ", 7));
    assert!(!tree.is_alive(cut));
    let mut made = Vec::new();
    for _ in 0..3 {
        let last = find(&tree, kinds.find("B", 0).expect("B"));
        let family = tree.lineage(last).family(0);
        let b = string(&mut kinds, "B[A]");
        tree.replace(last, &b, &[], SimTime::ZERO, family, &mut made);
        tree.append(&more, &[], SimTime::ZERO, Family::AXIOM, &mut made);
    }
    assert_eq!(show(&kinds, &tree), "A[B[A][A][A][C]]IXYZXY[Z]XY[Z]XY[Z]");
    assert!(made.iter().all(|id| id.slot() != cut.slot()), "its slot is kept");
}
