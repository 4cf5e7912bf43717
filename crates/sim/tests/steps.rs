//! Steps of modules that are integrated alone, or with neighbours.

use dlsys_session::Session;
use dlsys_sim::Settings;

/// x' = 1 + sin(x)/2 from 0 to 3, again and again, each time with another rate, by less than counts.
const LIVES: &str = "initial string: A(0, 0)\nA(x, n):\n  if x < 3 solve dx/dt = 1 + 0.5*sin(x) + 1e-14*n\n  if x = 3 produce A(0, n + 1)\n";

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

/// Lives that begin alike are alike: their steps are made once for each power of two of the time, also where something that no equation reads
/// tells them apart. So are those that begin elsewhere on the way of another. What reads the time, or another module, or differs in its rates, is not.
#[test]
fn lives_that_are_alike_are_integrated_once() {
    let after = |text: &str, lives: f64| {
        let session = Session::from_text("lives.dls", text, &[]).expect("a model");
        let mut simulation =
            session.simulate(Settings { log: true, ..Settings::default() }).expect("it starts");
        simulation.pass(lives * life()).expect("it runs");
        let stats = simulation.stats();
        (stats.rhs_evaluations, simulation.take_events().last().map_or(0.0, |event| event.time))
    };
    let alike = LIVES.replace(" + 1e-14*n", "");
    let further = alike.replace("A(0, n + 1)", "A(1e-12*n, n + 1)");
    let read = LIVES.replace("1e-14*n", "1e-12*sin(t)");
    let of_a_neighbour = "initial string: B(0) A(0, 0)\nB(b): solve db/dt = 1\nB(b) < A(x, n):\n  if x < 3 solve dx/dt = 1 + 0.5*sin(x) + 1e-12*sin(b)\n  if x = 3 produce A(0, n + 1)\n";
    let (first, _) = after(LIVES, 1.5);
    for (text, most) in [
        (&*alike, 16.0),
        (&further, 32.0),
        (LIVES, f64::INFINITY),
        (&read, f64::INFINITY),
        (of_a_neighbour, f64::INFINITY),
    ] {
        let (work, last) = after(text, 1000.5);
        assert!((last - 1000.0 * life()).abs() < 1e-4 * 1000.0, "{text}: {last}");
        let lives = work as f64 / first as f64;
        assert!(if most.is_finite() { lives < most } else { lives > 100.0 }, "{text}: {lives} lives");
    }
}

/// Stiff values that come to rest where a rate is a difference of large terms: what is left of their motion is rounding, and no reason
/// for short steps.
#[test]
fn rest_by_cancellation_takes_long_steps() {
    let pair = |rate: &str, then: &str| {
        format!(
            "initial string: X(0) V(0)\nX(x) > V(v):\n  solve dx/dt = v\n{then}X(x) < V(v): solve dv/dt = {rate} - 1000*v\n"
        )
    };
    let texts = [
        "initial string: X(0, 0)\nX(x, v): solve dx/dt = v, dv/dt = -1000*sin(x - 1.2) - 1000*v\n".to_owned(),
        "initial string: X(0, 0)\nX(x, v): solve dx/dt = v, dv/dt = -1000*(x^3 - 1.728) - 1000*v\n"
            .to_owned(),
        pair("-1000*sin(x - 1.2)", ""),
        pair("-1000*(x - 1.2)", ""),
        pair("-1000*(x - 1.2)", "  if x > 5 produce X(0)\n"),
        pair("-1000*(x^3 - 1.728)", "  if x > 5 produce X(0)\n"),
    ];
    for text in texts {
        let session = Session::from_text("rest.dls", &text, &[]).expect("a model");
        for tolerance in [1e-4, 1e-6, 1e-9] {
            let mut simulation = session
                .simulate(Settings { tolerance, max_events: 5000, ..Settings::default() })
                .expect("it starts");
            let mut string = Default::default();
            simulation.at(1e4, &mut string).unwrap_or_else(|e| panic!("{tolerance:e} {text}{e}"));
            let values: Vec<f64> = string.iter().flat_map(|m| m.parameters.to_vec()).collect();
            assert!(
                (values[0] - 1.2).abs() < 1e-9 && values[1].abs() < 1e-9,
                "{tolerance:e} {values:?} {text}"
            );
        }
    }
}
