//! What a wind is made of, as its author says it, and the checks of that.

use std::fmt;

use nalgebra::Vector3;

use crate::obstacle::{Ground, Obstacle};
use crate::primitives::Flow;
use crate::{Error, Spectrum};

/// A number that may depend on time.
pub enum Signal {
    /// The same at all times.
    Constant(f64),
    /// A function of the time in seconds. It must be pure: equal times give equal values.
    Function(Box<dyn Fn(f64) -> f64 + Send + Sync>),
}

impl Signal {
    /// A function of the time in seconds.
    pub fn function(f: impl Fn(f64) -> f64 + Send + Sync + 'static) -> Signal {
        Signal::Function(Box::new(f))
    }

    /// The value at `time` seconds.
    pub fn at(&self, time: f64) -> f64 {
        match self {
            Signal::Constant(value) => *value,
            Signal::Function(f) => f(time),
        }
    }

    /// The value at `time` seconds, or an error under this name if it is not finite.
    pub(crate) fn finite_at(&self, time: f64, name: impl FnOnce() -> String) -> Result<f64, Error> {
        let value = self.at(time);
        if value.is_finite() { Ok(value) } else { Err(Error::NotFinite { name: name(), time, value }) }
    }

    /// An error if the signal differs after a period: it is compared at 64 times, within 1e-9 of its largest magnitude there.
    pub(crate) fn check_period(&self, period: f64, name: impl Fn() -> String) -> Result<(), Error> {
        let Signal::Function(f) = self else { return Ok(()) };
        // The golden ratio spreads the times: no two differ by a simple fraction of the period.
        let times = (0..64).map(|i| period * (f64::from(i) * 0.618_033_988_749_894_9).fract());
        let pairs: Vec<_> = times.map(|t| (t, f(t), f(t + period))).collect();
        let size = pairs.iter().fold(0.0f64, |size, (_, a, b)| size.max(a.abs()).max(b.abs()));
        for (time, first, second) in pairs {
            if !first.is_finite() {
                return Err(Error::NotFinite { name: name(), time, value: first });
            }
            // Written so that a value that is not a number fails as well.
            let same = (second - first).abs() <= 1e-9 * size;
            if !same {
                return Err(Error::NotPeriodic { name: name(), period, time, first, second });
            }
        }
        Ok(())
    }
}

impl From<f64> for Signal {
    fn from(value: f64) -> Signal {
        Signal::Constant(value)
    }
}

impl fmt::Debug for Signal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Signal::Constant(value) => write!(f, "Constant({value})"),
            Signal::Function(_) => f.write_str("Function"),
        }
    }
}

/// A wind as its author describes it; [`Field::new`](crate::Field::new) checks it. Lengths are in metres, times in seconds.
#[derive(Debug)]
pub struct Description {
    /// The direction in which the air moves; of any length but 0.
    pub direction: Vector3<f64>,
    /// The mean speed U in m/s; a negative one reverses the direction. With a [roughness](Description::roughness) it is the
    /// speed at a height of 10 m.
    pub speed: Signal,
    /// The intensity I of the turbulence: the standard deviation of each component relative to |U|, at least 0. The spectrum of
    /// Kolmogorov has an amplitude of its own, and only 0 matters for it: no turbulence.
    pub turbulence: f64,
    /// The longitudinal integral scale in metres, greater than 0: the integral of the correlation of u between points that lie
    /// along u. It is 0.747 of von Kármán's length L. The spectrum of Kolmogorov does not use it.
    pub scale: f64,
    /// The roughness length z₀ in metres, between 0 and 10: the mean speed is U ln(h/z₀)/ln(10 m/z₀) at a height h above the
    /// ground (y = 0 without a [ground](Description::ground)), and 0 below z₀. It acts on the horizontal part of the mean wind.
    /// Eddies travel with the speed U at all heights, because a speed that depends on the height would destroy their freedom from
    /// divergence.
    pub roughness: Option<f64>,
    /// The period in seconds after which the wind repeats exactly. The speed and the flows must have it as well.
    pub period: Option<f64>,
    /// The seed of the turbulence.
    pub seed: u64,
    /// Turbulence is averaged over a Gaussian of this standard deviation in metres, as a body or a cloud of that size feels it: the same eddies, of
    /// which small ones are weaker. 0 leaves it as it is.
    pub smoothing: f64,
    /// The energy spectrum of the turbulence.
    pub spectrum: Spectrum,
    /// Further parts of the large-scale wind, which are added up.
    pub flows: Vec<Flow>,
    /// The ground, which the wind follows.
    pub ground: Option<Ground>,
    /// Bodies that push the wind aside.
    pub obstacles: Vec<Box<dyn Obstacle>>,
}

impl Description {
    /// A wind of a direction and a speed in m/s, without turbulence, in empty space. The integral scale is 1 m, the seed 0, and nothing is averaged.
    pub fn new(direction: Vector3<f64>, speed: impl Into<Signal>) -> Description {
        Description {
            direction,
            speed: speed.into(),
            turbulence: 0.0,
            scale: 1.0,
            roughness: None,
            period: None,
            seed: 0,
            smoothing: 0.0,
            spectrum: Spectrum::VonKarman,
            flows: Vec::new(),
            ground: None,
            obstacles: Vec::new(),
        }
    }

    /// The direction as a vector of length 1, however long or short it is.
    pub(crate) fn heading(&self) -> Result<Vector3<f64>, Error> {
        let (direction, largest) = (self.direction, self.direction.amax());
        if !(direction.iter().all(|part| part.is_finite()) && largest > 0.0) {
            return Err(Error::Direction(direction.into()));
        }
        // Squares of others are too small or too large for numbers.
        let is_common = (1e-100..1e100).contains(&largest);
        Ok(if is_common { direction.normalize() } else { (direction / largest).normalize() })
    }

    /// All that can be said about the values without an instant.
    pub(crate) fn check(&self) -> Result<(), Error> {
        self.heading()?;
        if let Signal::Constant(_) = self.speed {
            self.speed.finite_at(0.0, || "the speed of the wind".to_owned())?;
        }
        not_negative("the turbulence intensity", self.turbulence)?;
        positive("the integral scale of the turbulence", self.scale)?;
        not_negative("the smoothing of the turbulence", self.smoothing)?;
        if let Some(roughness) = self.roughness
            && !(roughness > 0.0 && roughness < 10.0)
        {
            return Err(Error::Roughness(roughness));
        }
        if let Spectrum::Kolmogorov { dissipation, inertial, sigma } = self.spectrum {
            not_negative("the rate of dissipation ε", dissipation)?;
            positive("the inertial frequency k", inertial)?;
            not_negative("the deviation σ of the temporal spectrum", sigma)?;
        }
        if let Some(period) = self.period {
            positive("the period of the wind", period)?;
            self.speed.check_period(period, || "the speed of the wind".to_owned())?;
        }
        if let Some(Ground::Uneven { fading, .. }) = self.ground
            && (fading.is_nan() || fading <= 0.0)
        {
            let name = "the height over which the wind forgets the ground";
            return Err(Error::NotPositive { name, value: fading });
        }
        for obstacle in &self.obstacles {
            positive("the thickness of the layer around an obstacle", obstacle.layer())?;
        }
        self.flows.iter().enumerate().try_for_each(|(i, flow)| flow.check(i, self.period))
    }
}

/// An error unless a number is finite and greater than 0.
pub(crate) fn positive(name: &'static str, value: f64) -> Result<(), Error> {
    if value.is_finite() && value > 0.0 { Ok(()) } else { Err(Error::NotPositive { name, value }) }
}

/// An error unless a number is finite and at least 0.
pub(crate) fn not_negative(name: &'static str, value: f64) -> Result<(), Error> {
    if value.is_finite() && value >= 0.0 { Ok(()) } else { Err(Error::Negative { name, value }) }
}
