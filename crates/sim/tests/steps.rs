//! Steps of modules that are integrated alone.

use dlsys_session::Session;
use dlsys_sim::Settings;

/// x' = 1 + sin(x)/2 from 0 to 3, again and again.
const LIVES: &str =
    "initial string: A(0)\nA(x):\n  if x < 3 solve dx/dt = 1 + 0.5*sin(x)\n  if x = 3 produce A(0)\n";

/// The time of one life: 2/q atan((tan(x/2) + a)/q) with a = 1/2 and q² = 1 - a², from 0 to 3.
fn life() -> f64 {
    let (a, q) = (0.5f64, 0.75f64.sqrt());
    let integral = |x: f64| 2.0 / q * (((0.5 * x).tan() + a) / q).atan();
    integral(3.0) - integral(0.0)
}

/// A life begins with the step that suited the beginning of the one before it, not with the last step of that.
#[test]
fn no_step_is_rejected_once_some_lives_are_known() {
    let session = Session::from_text("lives.dls", LIVES, &[]).expect("a model");
    for tolerance in [1e-4, 1e-6] {
        let settings = Settings { tolerance, log: true, ..Settings::default() };
        let mut simulation = session.simulate(settings).expect("it starts");
        simulation.pass(10.5 * life()).expect("it runs");
        let known = simulation.stats();
        simulation.pass(50.5 * life()).expect("it runs");
        let stats = simulation.stats();
        assert_eq!((stats.events - known.events, stats.rejected - known.rejected), (40, 0), "{tolerance:e}");
        let last = simulation.take_events().last().expect("50 events").time;
        assert!((last / 50.0 - life()).abs() <= 2.0 * tolerance, "{tolerance:e}: {last}");
    }
}
