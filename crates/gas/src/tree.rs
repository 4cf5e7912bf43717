//! A tree of boxes around blobs: those that a ray passes, without a look at all others.

use crate::smoke::Puff;
use crate::{Ray, Span, Vector};

/// Blobs in a leaf at most.
const LEAF: usize = 8;

/// Boxes around spheres. A box is a leaf, or has two children behind it in the list.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tree {
    nodes: Vec<Node>,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    low: Vector,
    high: Vector,
    /// Of a leaf, the first blob; otherwise the second child. The first one is next in the list.
    first: u32,
    /// Number of blobs of a leaf; 0 for others.
    count: u32,
}

impl Tree {
    /// Sorts blobs so that each leaf has a range of them. Their spheres have a radius of `reach` standard deviations.
    pub(crate) fn new(puffs: &mut [Puff], reach: f64) -> Tree {
        let mut tree = Tree { nodes: Vec::with_capacity(puffs.len() / 2) };
        if !puffs.is_empty() {
            tree.build(puffs, 0, reach);
        }
        tree
    }

    /// Depth is at most the logarithm of the number of blobs.
    fn build(&mut self, puffs: &mut [Puff], first: usize, reach: f64) {
        let (mut low, mut high) = (Vector::repeat(f64::INFINITY), Vector::repeat(f64::NEG_INFINITY));
        let (mut least, mut most) = (low, high);
        for Puff { blob, .. } in &*puffs {
            let radius = Vector::repeat(reach * libm::sqrt(blob.variance));
            (low, high) = (low.inf(&(blob.centre - radius)), high.sup(&(blob.centre + radius)));
            (least, most) = (least.inf(&blob.centre), most.sup(&blob.centre));
        }
        let node = self.nodes.len();
        self.nodes.push(Node { low, high, first: first as u32, count: puffs.len() as u32 });
        if puffs.len() <= LEAF {
            return;
        }
        let axis = (most - least).imax();
        let middle = puffs.len() / 2;
        puffs.select_nth_unstable_by(middle, |a, b| a.blob.centre[axis].total_cmp(&b.blob.centre[axis]));
        let (before, after) = puffs.split_at_mut(middle);
        self.build(before, first, reach);
        let second = self.nodes.len() as u32;
        self.build(after, first + middle, reach);
        (self.nodes[node].first, self.nodes[node].count) = (second, 0);
    }

    /// The ranges of blobs near a span of a ray.
    pub(crate) fn along(&self, ray: &Ray, span: Span, mut visit: impl FnMut(std::ops::Range<usize>)) {
        let inverse = ray.direction.map(|value| 1.0 / value);
        let mut open = vec![0_u32];
        while let Some(index) = open.pop() {
            let Some(node) = self.nodes.get(index as usize) else { continue };
            if !node.is_met(ray, &inverse, span) {
                continue;
            }
            if node.count > 0 {
                visit(node.first as usize..(node.first + node.count) as usize);
            } else {
                open.extend([node.first, index + 1]);
            }
        }
    }
}

impl Node {
    /// The slab test; along an axis on which the ray does not move, quotients are infinite or, on a side of the box, not numbers, which count as
    /// inside.
    fn is_met(&self, ray: &Ray, inverse: &Vector, span: Span) -> bool {
        let (mut from, mut to) = (span.from, span.to);
        for axis in 0..3 {
            let a = (self.low[axis] - ray.origin[axis]) * inverse[axis];
            let b = (self.high[axis] - ray.origin[axis]) * inverse[axis];
            if a.is_nan() || b.is_nan() {
                continue;
            }
            (from, to) = (from.max(a.min(b)), to.min(a.max(b)));
        }
        from <= to
    }
}
