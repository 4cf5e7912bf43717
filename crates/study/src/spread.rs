//! Distributions of measures over many specimens, at each observed time.

use std::fmt::Write;

use super::table::Table;
use dlsys_sim::brief;

/// Probabilities of the quantiles in tables and plots.
pub const QUANTILES: [f64; 5] = [0.05, 0.25, 0.5, 0.75, 0.95];

/// The distribution of a measure at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Spread {
    /// Time, in the model's unit.
    pub time: f64,
    /// Number of specimens.
    pub count: usize,
    /// Arithmetic mean.
    pub mean: f64,
    /// Sample standard deviation (divided by the number of specimens less one); 0 for a single specimen.
    pub deviation: f64,
    /// Minimum.
    pub least: f64,
    /// Quantiles at [`QUANTILES`], by linear interpolation between the two nearest values (Hyndman and Fan 1996, type 7).
    pub quantiles: [f64; 5],
    /// Maximum.
    pub most: f64,
}

impl Spread {
    /// The distribution of the values of all specimens, in any order. There must be at least one.
    pub fn new(time: f64, mut values: Vec<f64>) -> Spread {
        values.sort_by(f64::total_cmp);
        let n = values.len();
        let mean = values.iter().sum::<f64>() / n as f64;
        let squares: f64 = values.iter().map(|x| (x - mean) * (x - mean)).sum();
        let deviation = if n > 1 { (squares / (n - 1) as f64).sqrt() } else { 0.0 };
        let quantiles = QUANTILES.map(|part| {
            let place = part * (n - 1) as f64;
            let (low, high) = (values[place.floor() as usize], values[place.ceil() as usize]);
            low + (high - low) * place.fract()
        });
        Spread { time, count: n, mean, deviation, least: values[0], quantiles, most: values[n - 1] }
    }
}

/// A measure over time.
#[derive(Clone, Debug)]
pub struct SpreadSeries {
    /// The measure, as written on the command line.
    pub name: String,
    /// Its distribution at each time, in the order of time.
    pub spreads: Vec<Spread>,
}

/// A table of all measures as text, with six digits.
pub fn spread_table(courses: &[SpreadSeries]) -> String {
    let mut out = String::new();
    for (i, course) in courses.iter().enumerate() {
        let specimens = course.spreads.first().map_or(0, |spread| spread.count);
        let _ = writeln!(out, "{}{}  {specimens} specimens", if i > 0 { "\n" } else { "" }, course.name);
        let mut table = Table::default();
        table.push(
            ["t", "mean", "deviation", "least", "5%", "25%", "median", "75%", "95%", "most", ""]
                .map(str::to_owned),
        );
        for s in &course.spreads {
            let [a, b, c, d, e] = s.quantiles;
            let row = [s.time, s.mean, s.deviation, s.least, a, b, c, d, e, s.most].map(|x| brief(x, 6));
            let [t, mean, deviation, least, a, b, c, d, e, most] = row;
            table.push([t, mean, deviation, least, a, b, c, d, e, most, String::new()]);
        }
        table.write("  ", &mut out);
    }
    out
}

/// All measures for programs: a line for each measure and time, numbers to all digits.
pub fn spread_csv(courses: &[SpreadSeries]) -> String {
    let mut out = "measure,t,specimens,mean,deviation,least,q05,q25,median,q75,q95,most\n".to_owned();
    for course in courses {
        let name = match course.name.contains([',', '"', '\n']) {
            true => format!("\"{}\"", course.name.replace('"', "\"\"")),
            false => course.name.clone(),
        };
        for s in &course.spreads {
            let _ = write!(out, "{name},{},{},{},{},{}", s.time, s.count, s.mean, s.deviation, s.least);
            for quantile in s.quantiles {
                let _ = write!(out, ",{quantile}");
            }
            let _ = writeln!(out, ",{}", s.most);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_and_quantiles_are_those_of_the_sample() {
        let spread = Spread::new(1.0, vec![4.0, 1.0, 3.0, 2.0, 5.0]);
        assert_eq!((spread.mean, spread.deviation), (3.0, 2.5f64.sqrt()));
        assert_eq!((spread.least, spread.most), (1.0, 5.0));
        let [a, b, c, d, e] = spread.quantiles;
        assert_eq!([b, c, d], [2.0, 3.0, 4.0]);
        assert!((a - 1.2).abs() < 1e-12 && (e - 4.8).abs() < 1e-12);
        let one = Spread::new(0.0, vec![7.0]);
        assert_eq!((one.deviation, one.quantiles), (0.0, [7.0; 5]));
    }

    #[test]
    fn a_measure_with_commas_is_quoted() {
        let course =
            SpreadSeries { name: "F(x, y): x".into(), spreads: vec![Spread::new(0.5, vec![1.0, 2.0])] };
        let text = spread_csv(&[course]);
        assert!(
            text.ends_with("\"F(x, y): x\",0.5,2,1.5,0.7071067811865476,1,1.05,1.25,1.5,1.75,1.95,2\n"),
            "{text}"
        );
    }
}
