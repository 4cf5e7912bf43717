//! What the runners are told: how long, from which seed.

/// `--seconds S`, `--count N` and `--seed N`.
pub struct Options {
    pub seconds: f64,
    pub most: u64,
    pub seed: u64,
}

impl Options {
    /// Takes those of the command line; `other` takes any other argument, and may ask for the value behind it.
    pub fn read(mut other: impl FnMut(&str, &mut dyn FnMut() -> String)) -> Options {
        let mut arguments = std::env::args().skip(1);
        let mut options = Options { seconds: 60.0, most: u64::MAX, seed: 1 };
        while let Some(argument) = arguments.next() {
            let mut value = || arguments.next().unwrap_or_default();
            match argument.as_str() {
                "--seconds" => options.seconds = value().parse().expect("--seconds S"),
                "--count" => {
                    (options.most, options.seconds) = (value().parse().expect("--count N"), f64::INFINITY);
                }
                "--seed" => options.seed = value().parse().expect("--seed N"),
                argument => other(argument, &mut value),
            }
        }
        options
    }
}
