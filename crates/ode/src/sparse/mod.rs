//! Sparse elimination without pivoting on a pattern known in advance.
//!
//! Unknowns are numbered so that a parent has a smaller number than its children. Eliminating from the last
//! unknown to the first ("from the tips to the root") then makes no fill-in: M. Hines, Int. J. Bio-Medical
//! Computing 15 (1984) 69. Patterns that are not a tree are eliminated in the same order, with the fill-in
//! found once by symbolic elimination (T. Davis, Direct Methods for Sparse Linear Systems, SIAM 2006, ch. 4).
//!
//! There is no pivoting: the matrices for which it is made, `shift I - scale A` of a stable coupled system, are close
//! to diagonally dominant. Every pivot is checked. The place of a value depends on the pattern alone, so one
//! array of real matrix values serves any number of real or complex shifts.

mod field;

pub use field::{Complex, Field, Wide};

/// No parent: the root of a tree.
const ROOT: u32 = u32::MAX;

/// Which entries of an `n` by `n` matrix are stored, and where.
///
/// The pattern is made symmetric and closed under elimination. A row `k` keeps its smaller neighbours `j <
/// k`; such a pair `q` stores two values, `(k, j)` at `n + 2 q` and `(j, k)` at `n + 2 q + 1`, after the `n`
/// diagonal values.
#[derive(Clone, Debug)]
pub struct Pattern {
    /// Pairs of row `k` are `first[k + 1] .. first[k]`: rows lie in the order of elimination.
    first: Vec<u32>,
    /// The smaller neighbour of each pair, ascending in a row.
    neighbour: Vec<u32>,
    /// One parent (or `ROOT`) for each unknown if the pattern is a forest, else empty.
    parent: Vec<u32>,
}

impl Pattern {
    /// Pattern of `n` unknowns with the given couplings (row, column), in any order; the diagonal is always
    /// stored.
    ///
    /// `None` if a coupling is out of range, or if fill-in needs more than `200 n + 10_000` entries.
    pub fn new(n: usize, couplings: &[(u32, u32)]) -> Option<Pattern> {
        let bound = n.checked_mul(200)?.checked_add(10_000)?;
        if n >= ROOT as usize || couplings.iter().any(|&(r, c)| r.max(c) as usize >= n) {
            return None;
        }
        // Smaller neighbours of each unknown as given, sorted by counting.
        let mut place = vec![0usize; n + 1];
        for &(r, c) in couplings.iter().filter(|(r, c)| r != c) {
            place[r.max(c) as usize] += 1;
        }
        let mut sum = 0;
        for p in &mut place {
            sum += *p;
            *p = sum;
        }
        let mut given = vec![0u32; sum];
        for &(r, c) in couplings.iter().filter(|(r, c)| r != c) {
            let p = &mut place[r.max(c) as usize];
            *p -= 1;
            given[*p] = r.min(c);
        }
        // Eliminating k couples all its smaller neighbours; handing them to the largest of them is enough,
        // because that one hands them on when its turn comes (elimination tree).
        let mut first = vec![0u32; n + 1];
        let mut neighbour = Vec::with_capacity(sum);
        let (mut child, mut sibling, mut mark) = (vec![ROOT; n], vec![ROOT; n], vec![ROOT; n]);
        for k in (0..n).rev() {
            let begin = neighbour.len();
            for &j in &given[place[k]..place[k + 1]] {
                if mark[j as usize] != k as u32 {
                    mark[j as usize] = k as u32;
                    neighbour.push(j);
                }
            }
            let mut c = child[k];
            while c != ROOT {
                for q in first[c as usize + 1]..first[c as usize] {
                    let j = neighbour[q as usize];
                    if j < k as u32 && mark[j as usize] != k as u32 {
                        mark[j as usize] = k as u32;
                        neighbour.push(j);
                    }
                }
                c = sibling[c as usize];
            }
            if n + 2 * neighbour.len() > bound.max(n + 2 * sum) {
                return None;
            }
            neighbour[begin..].sort_unstable();
            first[k] = u32::try_from(neighbour.len()).ok()?;
            if neighbour.len() > begin {
                let parent = neighbour[neighbour.len() - 1] as usize;
                sibling[k] = child[parent];
                child[parent] = k as u32;
            }
        }
        let mut pattern = Pattern { first, neighbour, parent: Vec::new() };
        if (0..n).all(|k| pattern.row(k).len() <= 1) {
            pattern.parent = (0..n).map(|k| pattern.row(k).first().copied().unwrap_or(ROOT)).collect();
        }
        Some(pattern)
    }

    /// Number of unknowns.
    pub fn unknowns(&self) -> usize {
        self.first.len() - 1
    }

    /// Number of stored entries: the diagonal, the couplings in both directions, and their fill-in.
    pub fn entries(&self) -> usize {
        self.unknowns() + 2 * self.neighbour.len()
    }

    /// Place of an entry in an array of values, `None` if it is not stored. Places of fill-in must hold 0.
    pub fn entry(&self, row: usize, column: usize) -> Option<usize> {
        let (k, j) = (row.max(column), row.min(column));
        if k >= self.unknowns() {
            return None;
        }
        if k == j {
            return Some(k);
        }
        let q = self.first[k + 1] as usize + self.row(k).binary_search(&(j as u32)).ok()?;
        Some(self.unknowns() + 2 * q + usize::from(row < column))
    }

    /// Smaller neighbours of `k`, ascending.
    #[inline(always)]
    fn row(&self, k: usize) -> &[u32] {
        &self.neighbour[self.first[k + 1] as usize..self.first[k] as usize]
    }

    /// For each unknown its parent, and the place of its entry in the parent's column, which is followed by that of the parent's
    /// entry in the unknown's column; None for a root. None if the pattern is no forest.
    pub fn forest(&self) -> Option<impl Iterator<Item = Option<(usize, usize)>>> {
        let n = self.unknowns();
        let above = move |(k, parent): (usize, &u32)| {
            (*parent != ROOT).then(|| (*parent as usize, n + 2 * self.first[k + 1] as usize))
        };
        (n == self.parent.len()).then(|| self.parent.iter().enumerate().map(above))
    }

    /// True if no entry of the diagonal is less far below 0 than the other entries of its row are large, together: then the elimination
    /// of `shift I - scale A` lets no entry grow to more than twice the largest, for all shifts to the right of 0 and scales above 0.
    pub fn is_dominant(&self, values: &[f64]) -> bool {
        let n = self.unknowns();
        let mut rest: Vec<f64> = values.iter().take(n).map(|d| -d).collect();
        for k in 0..n {
            for (q, &j) in (self.first[k + 1] as usize..).zip(self.row(k)) {
                let Some(&[low, up]) =
                    values.get(n + 2 * q..n + 2 * q + 2).and_then(|pair| pair.first_chunk())
                else {
                    return false;
                };
                rest[k] -= low.abs();
                rest[j as usize] -= up.abs();
            }
        }
        // Sums of entries that cancel are rounded.
        rest.iter().zip(values).all(|(rest, d)| *rest >= 4.0 * f64::EPSILON * d)
    }

    /// Number of whole numbers in the factors.
    fn factor_length<F: Field>(&self) -> usize {
        if self.parent.is_empty() {
            self.entries()
        } else {
            self.unknowns() + (2 * self.neighbour.len()).div_ceil(F::REALS)
        }
    }

    /// Factors `shift I - scale A` into `out` (to be read by [`Pattern::solve`] only).
    ///
    /// False, with useless factors, if a pivot is 0 or not finite or if `values` has the wrong length.
    pub fn factor<F: Field>(&self, values: &[f64], shift: F, scale: f64, out: &mut Vec<F>) -> bool {
        out.resize(self.factor_length::<F>(), F::zero());
        if values.len() != self.entries() {
            return false;
        }
        let n = self.unknowns();
        let (diagonal, pairs) = values.split_at(n);
        for (o, &d) in out[..n].iter_mut().zip(diagonal) {
            *o = shift.sub(F::from_f64(scale * d));
        }
        if self.parent.is_empty() {
            for (o, &v) in out[n..].iter_mut().zip(pairs) {
                *o = F::from_f64(-scale * v);
            }
            self.factor_general(out)
        } else {
            self.factor_forest(pairs, scale, out)
        }
    }

    /// In a forest couplings stay real and unchanged: only the diagonal is eliminated.
    fn factor_forest<F: Field>(&self, pairs: &[f64], scale: f64, out: &mut [F]) -> bool {
        let (pivots, couplings) = out.split_at_mut(self.unknowns());
        for (i, &v) in pairs.iter().enumerate() {
            F::put(couplings, i, -scale * v);
        }
        let mut pairs = pairs.chunks_exact(2);
        let mut good = true;
        for (k, &parent) in self.parent.iter().enumerate().rev() {
            let inverse = pivots[k].reciprocal();
            good &= inverse.usable();
            pivots[k] = inverse;
            if parent != ROOT
                && let Some(pair) = pairs.next()
            {
                let above = &mut pivots[parent as usize];
                *above = above.sub(inverse.scale((scale * pair[0]) * (scale * pair[1])));
            }
        }
        good
    }

    /// Any pattern: subtracts the outer product of column and row `k` from the rows of its smaller
    /// neighbours.
    fn factor_general<F: Field>(&self, out: &mut [F]) -> bool {
        let n = self.unknowns();
        for k in (0..n).rev() {
            let inverse = out[k].reciprocal();
            if !inverse.usable() {
                return false;
            }
            out[k] = inverse;
            let (row, begin) = (self.row(k), self.first[k + 1] as usize);
            for (a, &i) in row.iter().enumerate() {
                let at = n + 2 * (begin + a);
                let (low, up) = (out[at], out[at + 1].mul(inverse));
                out[at + 1] = up;
                out[i as usize] = out[i as usize].sub(up.mul(low));
                // The smaller neighbours of k below i are among those of i: walk both ascending lists
                // together.
                let target = self.row(i as usize);
                let (mut t, base) = (0, self.first[i as usize + 1] as usize);
                for (b, &j) in row[..a].iter().enumerate() {
                    while target[t] != j {
                        t += 1;
                    }
                    let (from, to) = (n + 2 * (begin + b), n + 2 * (base + t));
                    let (row_value, multiplier) = (out[from], out[from + 1]);
                    out[to] = out[to].sub(up.mul(row_value));
                    out[to + 1] = out[to + 1].sub(multiplier.mul(low));
                }
            }
        }
        true
    }

    /// Solves with factors of this pattern, in place. Does nothing if the lengths do not agree.
    pub fn solve<F: Field>(&self, factors: &[F], rhs: &mut [F]) {
        let n = self.unknowns();
        if factors.len() != self.factor_length::<F>() || rhs.len() != n {
            return;
        }
        if !self.parent.is_empty() {
            return self.solve_forest(factors, rhs);
        }
        for k in (0..n).rev() {
            let x = rhs[k];
            for (q, &i) in (self.first[k + 1] as usize..).zip(self.row(k)) {
                rhs[i as usize] = rhs[i as usize].sub(factors[n + 2 * q + 1].mul(x));
            }
        }
        for k in 0..n {
            let mut x = rhs[k];
            for (q, &j) in (self.first[k + 1] as usize..).zip(self.row(k)) {
                x = x.sub(factors[n + 2 * q].mul(rhs[j as usize]));
            }
            rhs[k] = x.mul(factors[k]);
        }
    }

    /// From the tips to the root and back.
    fn solve_forest<F: Field>(&self, factors: &[F], rhs: &mut [F]) {
        let (pivots, couplings) = factors.split_at(self.unknowns());
        let mut q = 0;
        for (k, (&parent, &inverse)) in self.parent.iter().zip(pivots).enumerate().rev() {
            let x = rhs[k].mul(inverse);
            rhs[k] = x;
            if parent != ROOT {
                let above = &mut rhs[parent as usize];
                *above = above.sub(x.scale(F::get(couplings, 2 * q + 1)));
                q += 1;
            }
        }
        for (k, (&parent, &inverse)) in self.parent.iter().zip(pivots).enumerate() {
            if parent != ROOT {
                q -= 1;
                let above = rhs[parent as usize].scale(F::get(couplings, 2 * q));
                rhs[k] = rhs[k].sub(above.mul(inverse));
            }
        }
    }

    /// Solves several real systems side by side, those of the first lane, with factors of this pattern for a shift that is real there. Does
    /// nothing if the lengths do not agree.
    pub fn solve_real<const N: usize, const R: usize>(&self, factors: &[Wide<N>], rhs: &mut [[f64; R]]) {
        let n = self.unknowns();
        if factors.len() != self.factor_length::<Wide<N>>() || rhs.len() != n {
            return;
        }
        // x - factor y, for each of the right-hand sides.
        let minus = |x: &mut [f64; R], factor: f64, y: [f64; R]| {
            x.iter_mut().zip(y).for_each(|(x, y)| *x -= factor * y);
        };
        if self.parent.is_empty() {
            for k in (0..n).rev() {
                for (q, &i) in (self.first[k + 1] as usize..).zip(self.row(k)) {
                    let x = rhs[k];
                    minus(&mut rhs[i as usize], factors[n + 2 * q + 1].re[0], x);
                }
            }
            for k in 0..n {
                for (q, &j) in (self.first[k + 1] as usize..).zip(self.row(k)) {
                    let above = rhs[j as usize];
                    minus(&mut rhs[k], factors[n + 2 * q].re[0], above);
                }
                rhs[k] = rhs[k].map(|x| x * factors[k].re[0]);
            }
            return;
        }
        let (pivots, couplings) = factors.split_at(n);
        let mut q = 0;
        for (k, (&parent, inverse)) in self.parent.iter().zip(pivots).enumerate().rev() {
            let x = rhs[k].map(|x| x * inverse.re[0]);
            rhs[k] = x;
            if parent != ROOT {
                minus(&mut rhs[parent as usize], Wide::get(couplings, 2 * q + 1), x);
                q += 1;
            }
        }
        for (k, (&parent, inverse)) in self.parent.iter().zip(pivots).enumerate() {
            if parent != ROOT {
                q -= 1;
                let above = rhs[parent as usize];
                minus(&mut rhs[k], inverse.re[0] * Wide::get(couplings, 2 * q), above);
            }
        }
    }

    /// `out = A x`. Does nothing if the lengths do not agree.
    pub fn multiply(&self, values: &[f64], x: &[f64], out: &mut [f64]) {
        let n = self.unknowns();
        if values.len() != self.entries() || x.len() != n || out.len() != n {
            return;
        }
        for k in 0..n {
            out[k] = values[k] * x[k];
        }
        for k in (0..n).rev() {
            for (q, &j) in (self.first[k + 1] as usize..).zip(self.row(k)) {
                out[k] += values[n + 2 * q] * x[j as usize];
                out[j as usize] += values[n + 2 * q + 1] * x[k];
            }
        }
    }
}

#[cfg(test)]
mod tests;
