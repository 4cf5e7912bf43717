//! Orders of methods: what the books say, and what a study shows.

use dlsys_sim::Method;

/// The order of a method: on a smooth solution the error of a step of length h is O(h^(order + 1)). None for
/// `auto`, which is whatever it chooses. The scheduler `local`, whose neighbours stand still for a slice of time, is a
/// method of order 1 in the length of the slice.
///
/// Sources: forward Euler (paper, section 8); classical Runge-Kutta and DOPRI5 (Hairer, Nørsett and Wanner,
/// Solving Ordinary Differential Equations I, 2nd ed. 1993, II.1 and II.5), DOP853 (II.10), Radau IIA with
/// five stages (Hairer and Wanner, Solving ODEs II, IV.5: 2s - 1).
pub fn nominal_order(method: &str) -> Option<u32> {
    if method == "local" {
        return Some(1);
    }
    Method::NAMED.iter().find(|(name, _)| *name == method).and_then(|(_, method)| method.order())
}

/// Errors above this say nothing about the order yet.
const LARGEST_ERROR: f64 = 0.1;
/// Errors below so many roundings say nothing about it any more.
const ROUNDINGS: f64 = 100.0;

/// The exponent p in error = C work^-p, by least squares in logarithms, over the points with an error between
/// `floor` (or a hundred roundings) and 0.1. `points` are pairs of work and error, by increasing work; for a
/// method with a fixed step, work is 1/h. The last points do not count as long as the slope between them is
/// less than half the `nominal` order: more work only adds rounding there. None if there are fewer than three
/// points left, or all have the same work.
pub fn observed_order(points: &[(f64, f64)], nominal: Option<u32>, floor: f64) -> Option<f64> {
    let least = floor.max(ROUNDINGS * f64::EPSILON);
    let mut used: Vec<(f64, f64)> = points
        .iter()
        .filter(|(work, error)| *work > 0.0 && (least..=LARGEST_ERROR).contains(error))
        .map(|(work, error)| (work.ln(), error.ln()))
        .collect();
    let steepness = nominal.map_or(1.0, f64::from) / 2.0;
    while let [.., a, b] = used[..]
        && a.1 - b.1 < steepness * (b.0 - a.0)
    {
        used.pop();
    }
    let n = used.len() as f64;
    if used.len() < 3 {
        return None;
    }
    let mean = |of: fn(&(f64, f64)) -> f64| used.iter().map(of).sum::<f64>() / n;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let spread: f64 = used.iter().map(|p| (p.0 - x).powi(2)).sum();
    let slope = used.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>() / spread;
    // A hundredth of a factor e between the cheapest and the dearest: all the same.
    (spread > 1e-4 * n && slope.is_finite()).then_some(-slope)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_law_is_read_back() {
        let law = |p: f64| -> Vec<(f64, f64)> {
            (0..20).map(|i| 2f64.powi(i)).map(|work| (work, 3.0 * work.powf(-p))).collect()
        };
        for p in [1.0, 4.0, 8.0] {
            let mut points = law(p);
            // What lies outside the range does not count, whatever it is.
            points.iter_mut().filter(|p| p.1 < 1e-12).for_each(|p| p.1 = 1e-13);
            let found = observed_order(&points, None, 1e-12).expect("enough points");
            assert!((found - p).abs() < 1e-9, "{p}: {found}");
            // Nor do the last ones, if they no longer improve.
            let mut points = law(p);
            let least = points[5].1;
            points.iter_mut().skip(6).for_each(|p| p.1 = 1.1 * least);
            let found = observed_order(&points, Some(p as u32), 0.0);
            assert!(found.is_none_or(|found| (found - p).abs() < 1e-9), "{p}: {found:?}");
            assert!(found.is_some() || p == 1.0, "{p}: enough points below 0.1");
        }
        assert_eq!(observed_order(&law(4.0)[..3], Some(4), 0.0), None, "too few below 0.1");
        assert_eq!(
            observed_order(&[(5.0, 1e-3), (5.0, 1e-4), (5.0, 1e-5)], None, 0.0),
            None,
            "all the same work"
        );
    }

    #[test]
    fn every_method_but_auto_has_an_order() {
        for (name, method) in Method::NAMED {
            assert_eq!(nominal_order(name).is_none(), method == Method::Auto, "{name}");
        }
    }
}
