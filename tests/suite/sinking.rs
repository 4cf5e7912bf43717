//! Solids that soil bears, where rules read the force: depths against the equation of motion, rest, events, the same bits, sheets and soil together.

use std::thread;

use dlsys::session::Session;
use dlsys::sim::{BendSettings, Settings};
use dlsys::surround::Terrain;
use dlsys::tree::ModuleString;

use crate::common::repository;
use crate::sheets::with_mesh;

const GRAVITY: f64 = 9.80665;
/// Weight of the soil in N/m³, and its bearing.
const WEIGHT: f64 = 3000.0;
const BEARING: f64 = 20.0;
const FRICTION: f64 = BEARING / 35.0;
/// A side of the block, in m, and its mass in kg.
const SIDE: f64 = 0.2;
const MASS: f64 = 6.0;

/// The friction of a side in weights of the soil above: that of Jaky's pressure at rest.
fn rough() -> f64 {
    (1.0 - FRICTION.atan().sin()) * FRICTION
}

/// A cube of [`SIDE`] about the origin.
fn cube() -> String {
    let mut text = String::new();
    for n in 0..8 {
        let [x, y, z] = [0, 1, 2].map(|bit| if n >> bit & 1 == 1 { SIDE / 2.0 } else { -SIDE / 2.0 });
        text += &format!("v {x} {y} {z}\n");
    }
    text + "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n"
}

/// A block whose underside is at y. It is in soil that does not heap up, so that depths are those of the level.
fn block(rules: &str) -> Session {
    let text = format!(
        "soil firm = snow, bearing {BEARING}\nground firm cell 0.02 extent 0.6\nsurface @Cube from \"cloth.obj\"\nsolid Block\nconst m = {MASS}\n\
         const g = {GRAVITY}\n{rules}\ninterpret Block(y, v): [ f(y + {half}) @Cube(1) ]\n",
        half = SIDE / 2.0
    );
    with_mesh(&text, &cube()).unwrap_or_else(|error| panic!("{error}"))
}

const FALLS: &str = "initial string: Block(0.3, -1)\nBlock(y, v): solve dy/dt = v, dv/dt = -g + force_y/m";

fn with_tolerance(tolerance: f64) -> Settings {
    Settings { bending: BendSettings { tolerance, ..BendSettings::default() }, ..Settings::default() }
}

/// The parameters of the first module at some times, asked for in this order, each of a new run.
fn parameters(session: &Session, settings: Settings, times: &[f64]) -> Vec<Vec<f64>> {
    let at = |time: &f64| {
        let mut simulation = session.simulate(settings).unwrap_or_else(|error| panic!("{error}"));
        let mut string = ModuleString::default();
        simulation.at(*time, &mut string).unwrap_or_else(|error| panic!("{error}"));
        string.iter().last().expect("a module").parameters.to_vec()
    };
    times.iter().map(at).collect()
}

/// Depth and speed of the block at times after it touches the ground with a speed, by many small steps of the equation of motion.
fn reference(speed: f64, times: &[f64]) -> Vec<[f64; 2]> {
    let step = 1e-6;
    let accelerated = |z: f64, v: f64| {
        let below = BEARING * WEIGHT * SIDE * SIDE * z;
        let sides = rough() * WEIGHT * 4.0 * SIDE * z * z / 2.0;
        let drag = 8.0 / 3.0 * FRICTION * WEIGHT / GRAVITY * SIDE * SIDE * v * v;
        GRAVITY - (below + sides + drag) / MASS
    };
    let (mut z, mut v, mut t) = (0.0, speed, 0.0);
    let mut found = Vec::new();
    for time in times {
        while t < *time && v > 0.0 {
            let half = v + 0.5 * step * accelerated(z, v);
            let more = accelerated(z + 0.5 * step * v, half);
            (z, v, t) = (z + step * half, (v + step * more).max(0.0), t + step);
        }
        found.push([z, v]);
    }
    found
}

/// When the block touches the ground, and how fast.
fn touch() -> [f64; 2] {
    let speed = (1.0 + 2.0 * GRAVITY * 0.3_f64).sqrt();
    [(speed - 1.0) / GRAVITY, speed]
}

#[test]
fn a_drop_follows_its_equation_of_motion_and_converges() {
    let session = block(FALLS);
    let [begin, speed] = touch();
    let after = [0.01, 0.03, 0.06, 0.1, 1.0];
    let exact = reference(speed, &after);
    let times = after.map(|time| begin + time);
    let mut errors = Vec::new();
    for tolerance in [1e-2, 1e-3, 1e-4] {
        let found = parameters(&session, with_tolerance(tolerance), &times);
        let worst = found.iter().zip(&exact).map(|(found, [z, v])| {
            let [y, speed] = [found[0], -found[1]];
            assert!((speed - v).abs() < 0.3 * (tolerance / 1e-2).sqrt(), "{tolerance}: {speed} for {v}");
            (y + z).abs()
        });
        let worst = worst.fold(0.0, f64::max);
        assert!(worst < tolerance * SIDE, "{tolerance}: {worst} m");
        errors.push(worst);
    }
    assert!(errors[2] < 0.2 * errors[0], "{errors:?}");
}

#[test]
fn what_rests_stays_for_100_seconds() {
    let session = block(FALLS);
    let found = parameters(&session, Settings::default(), &[2.0, 100.0]);
    let [there, later] = [&found[0], &found[1]];
    assert!(there[1].abs() < 1e-12 && later[1].abs() < 1e-12, "{found:?}");
    assert!((there[0] - later[0]).abs() < 1e-11, "{found:?}");
}

#[test]
fn a_block_that_is_lowered_rests_where_the_soil_holds_its_weight() {
    // A damper that is far stronger than inertia.
    let session =
        block("initial string: Block(0.01, 0)\nBlock(y, v): solve dy/dt = v, dv/dt = -g + force_y/m - 60*v");
    let found = parameters(&session, Settings::default(), &[10.0])[0][0];
    let (k, s) = (BEARING * WEIGHT * SIDE * SIDE, rough() * WEIGHT * 4.0 * SIDE / 2.0);
    let exact = ((k * k + 4.0 * s * MASS * GRAVITY).sqrt() - k) / (2.0 * s);
    assert!((found + exact).abs() < 1e-3 * SIDE, "{found} for {exact}");
}

#[test]
fn events_on_forces_are_located() {
    let session = block(
        "initial string: Block(0.3, -1)\nBlock(y, v): if force_y < 160 solve dy/dt = v, dv/dt = -g + force_y/m if force_y >= 160 produce Hit(t, y)\n\
         interpret Hit(t0, y): F(0.1)",
    );
    let found = &parameters(&session, with_tolerance(1e-4), &[1.0])[0];
    // The first instant at which the resistance is 160 N: it begins with 128 N, and drag goes down as bearing goes up.
    let [begin, speed] = touch();
    let times: Vec<f64> = (0..4000).map(|n| f64::from(n) * 1e-5).collect();
    let force = |[z, v]: &[f64; 2]| {
        let sides = rough() * WEIGHT * 4.0 * SIDE * z * z / 2.0;
        BEARING * WEIGHT * SIDE * SIDE * z
            + sides
            + 8.0 / 3.0 * FRICTION * WEIGHT / GRAVITY * SIDE * SIDE * v * v
    };
    let exact =
        times.iter().zip(reference(speed, &times)).find(|(_, at)| force(at) >= 160.0).expect("a hit").0;
    assert!((found[0] - begin - exact).abs() < 1e-4, "{} for {}", found[0], begin + exact);
}

#[test]
fn bits_do_not_depend_on_times_orders_or_threads() {
    let text = "soil dry = sand, flow 0.1\nground dry cell 0.02 extent 1\nsolid Ball\nconst m = 4\ninitial string: Ball(0, 0.2, 1.5, -1)\n\
        Ball(x, y, u, v): solve dx/dt = u, dy/dt = v, du/dt = force_x/m, dv/dt = -9.8 + force_y/m\n\
        interpret Ball(x, y, u, v): [ f(y) -(90) f(x) @O(0.2) ]\n";
    let session = Session::from_text("sand.dls", text, &[]).unwrap_or_else(|error| panic!("{error}"));
    let times = [0.05, 0.1, 0.2503, 0.6];
    let bits = |found: Vec<Vec<f64>>| -> Vec<Vec<u64>> {
        found.iter().map(|all| all.iter().map(|value| value.to_bits()).collect()).collect()
    };
    let alone = bits(parameters(&session, Settings::default(), &times));
    // All in one run, with others in between, and back again.
    let mut simulation = session.simulate(Settings::default()).expect("it begins");
    let copy = simulation.clone();
    let mut string = ModuleString::default();
    for (n, time) in times.iter().enumerate() {
        simulation.at(time - 0.0123, &mut string).expect("it goes on");
        simulation.at(*time, &mut string).expect("it goes on");
        let found: Vec<u64> =
            string.iter().next().expect("a ball").parameters.iter().map(|value| value.to_bits()).collect();
        assert_eq!(found, alone[n]);
    }
    let heights = |threads: usize| {
        let made = Terrain::new(&session.model, Settings::default(), threads);
        let terrain = made.unwrap_or_else(|error| panic!("{error}")).expect("soil");
        [0.6, 0.1].map(|time| terrain.height(time, [0.1, 0.02], None).expect("a height").to_bits())
    };
    thread::scope(|scope| {
        let other = scope.spawn(|| {
            let mut copy = copy;
            let mut string = ModuleString::default();
            copy.at(times[3], &mut string).expect("it goes on");
            string
                .iter()
                .next()
                .expect("a ball")
                .parameters
                .iter()
                .map(|value| value.to_bits())
                .collect::<Vec<_>>()
        });
        assert_eq!(heights(1), heights(3));
        assert_eq!(other.join().expect("a run"), alone[3]);
    });
    // The ground that is drawn lies below the ball.
    let rest = &parameters(&session, Settings::default(), &[1.5])[0];
    let terrain = Terrain::new(&session.model, Settings::default(), 1).expect("ground").expect("soil");
    let height = terrain.height(1.5, [rest[0], 0.0], None).expect("a height");
    assert!((height - (rest[1] - 0.1)).abs() < 0.005, "{height} {rest:?}");
    assert!(height < -0.01 && rest[2].abs() < 1e-9, "{height} {rest:?}");
}

#[test]
fn a_net_and_sand_push_one_ball() {
    let text = std::fs::read_to_string(repository("models/scenes/swish.dls")).expect("read");
    let folder = repository("models/scenes");
    let open = |text: &str| {
        let path = folder.join(format!("sinking-{}.dls", std::process::id()));
        std::fs::write(&path, text).expect("written");
        let opened = Session::open_with(&path, &[], &[]);
        std::fs::remove_file(&path).expect("removed");
        opened.unwrap_or_else(|error| panic!("{:?}", error.diagnostics))
    };
    let with_sand = open(&format!("{text}\nsoil dry = sand\nground dry cell 0.03 extent 1.2\n"));
    let times = [0.45, 0.6, 1.6];
    let settings = Settings::default();
    let both = parameters(&with_sand, settings, &times);
    let net = parameters(&open(&text), settings, &times[..2]);
    // In the net as without sand, to what parts of other lengths change.
    for (both, net) in both.iter().zip(&net) {
        assert!((both[1] - net[1]).abs() < 2e-3 && (both[3] - net[3]).abs() < 0.05, "{both:?} {net:?}");
    }
    // It rests on the sand.
    assert!(both[2][3].abs() < 1e-9 && (0.06..0.12).contains(&both[2][1]), "{:?}", both[2]);
}

#[test]
fn what_cannot_be_is_said() {
    let told = |rules: &str| {
        let text = format!(
            "soil dry = sand\nground dry cell 0.02 extent 0.6\nsolid Ball\n{rules}\ninterpret Ball(y, v): [ f(y) @O(0.2) ]\n"
        );
        let session = match Session::from_text("sand.dls", &text, &[]) {
            Ok(session) => session,
            Err(error) => return error.diagnostics.iter().map(|d| d.render(&error.source, false)).collect(),
        };
        let run = session.simulate(Settings::default()).and_then(|mut run| {
            let mut string = ModuleString::default();
            run.at(0.5, &mut string)
        });
        run.map_or_else(|error| error.diagnostic().render(&session.source, false), |()| String::new())
    };
    let falls = |rate: &str| {
        format!("initial string: Ball(0.2, -2)\nBall(y, v): solve dy/dt = v, dv/dt = -9.8 + {rate}")
    };
    assert_eq!(told(&falls("force_y/4")), "");
    let nothing = told(&falls("force_y/0"));
    assert!(nothing.contains("the rate of v of Ball") && nothing.contains("not finite"), "{nothing}");
    let against = told(&falls("-force_y/4"));
    assert!(against.contains("do not answer a force as a mass does") && against.contains("-->"), "{against}");
    let both = told(&falls("force_y/4 + ground(0, 0)"));
    assert!(
        both.contains("rules read both `ground` and `force_y`") && both.contains("what sheets and soil do"),
        "{both}"
    );
    // What is as light as air ends, too.
    assert_eq!(told(&falls("force_y/1e-7")), "");
}
