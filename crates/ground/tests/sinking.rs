//! Bodies that soil bears: depths at rest, rest that lasts, energy, pits, sides, loads.

use std::sync::Arc;

use dlsys_ground::study::{Ram, dropped, fall, released};
use dlsys_ground::{Bearing, Ground, Soil, Vector};

const GRAVITY: f64 = 9.806_65;

fn bearing(ground: &Ground, ram: &Ram) -> Bearing {
    let points: Vec<Vector> = ram.points.iter().map(|point| point + ram.stand.position).collect();
    ground.bearing(1, (&ram.triangles, &points), &ram.stand.position)
}

/// Soil that does not heap up beside a body, with a bearing in weights.
fn level(bearing: f64) -> Soil {
    Soil { bearing: Some(bearing), push: 0.0, ..Soil::snow() }
}

#[test]
fn depths_at_rest_are_those_of_the_equations() {
    for (rows, error) in [(dropped().expect("snow"), 5e-3), (released().expect("mud"), 5e-5)] {
        let last = rows.last().expect("a row");
        assert!(last.error < error && last.order.is_some_and(|order| order > 1.5), "{last:?}");
    }
}

#[test]
fn what_rests_does_not_creep() {
    let mut ground = fall(Soil::sand(), 0.1, 5).expect("sand");
    let mut ram = Ram::sphere(0.1, 2500.0, 2.0, 16);
    for _ in 0..240 {
        ram.tick(&mut ground, &Vector::zeros(), 2).expect("a tick");
    }
    let there = ram.stand;
    assert!(there.velocity.norm() < 1e-12, "{}", there.velocity);
    let mut impulse = Vector::zeros();
    for _ in 0..12_000 {
        impulse += ram.tick(&mut ground, &Vector::zeros(), 2).expect("a tick");
    }
    assert!((ram.stand.position - there.position).norm() < 1e-11, "{}", ram.stand.position - there.position);
    // It is borne with its weight, which is less than what the soil could hold.
    let weight = ram.mass * GRAVITY;
    assert!((impulse / 100.0 - Vector::y() * weight).norm() < 1e-9 * weight, "{impulse}");
    assert!(bearing(&ground, &ram).limit(&ram.stand.position, &-Vector::y()) > weight);
}

#[test]
fn energy_is_never_gained() {
    for soil in [Soil::sand(), Soil::mud(), Soil::snow(), Soil { cohesion: 2.0, ..Soil::earth() }] {
        let mut ground = fall(soil, 0.1, 5).expect("ground");
        let mut ram = Ram::block(0.2, 0.1, 8.0);
        ram.stand.velocity = Vector::new(1.5, -2.0, 0.7);
        let energy =
            |ram: &Ram| ram.mass * (0.5 * ram.stand.velocity.norm_squared() + GRAVITY * ram.stand.position.y);
        let mut before = energy(&ram);
        for _ in 0..90 {
            ram.tick(&mut ground, &Vector::zeros(), 2).expect("a tick");
            let now = energy(&ram);
            assert!(now <= before + 1e-12, "{soil:?}: {} J more", now - before);
            before = now;
        }
        assert!(ram.stand.velocity.norm() < 1e-12, "{soil:?}: {}", ram.stand.velocity);
    }
}

#[test]
fn equilibrium_begins_at_the_limit() {
    // Lowered by a rope that lets go slowly: the depth where the soil holds all of the weight.
    let soil = level(20.0);
    let mut ground = fall(soil, 0.1, 8).expect("ground");
    let mut ram = Ram::block(0.2, 0.3, 12.0);
    let weight = ram.mass * GRAVITY;
    // Slow enough for the way from one stop to the next not to count.
    let ticks = 6000;
    for n in 0..ticks {
        let hold = Vector::y() * (weight * (1.0 - (f64::from(n) + 1.0) / f64::from(ticks)));
        ram.tick(&mut ground, &hold, 2).expect("a tick");
    }
    let depth = 0.15 - ram.stand.position.y;
    // K γ A z + (1 - sin φ) tan φ γ 4b z²/2 = m g, tan φ = K/35.
    let friction = 20.0_f64 / 35.0;
    let (k, s) = (20.0 * 3e3 * 0.04, (1.0 - friction.atan().sin()) * friction * 3e3 * 0.8 / 2.0);
    let exact = ((k * k + 4.0 * s * weight).sqrt() - k) / (2.0 * s);
    assert!((depth / exact - 1.0).abs() < 2e-3, "{depth} for {exact}");
    // A load on it is held without a motion up to the limit, and a lift meets friction only.
    let held = bearing(&ground, &ram);
    assert!((held.limit(&ram.stand.position, &-Vector::y()) / weight - 1.0).abs() < 2e-2);
    assert!(held.limit(&ram.stand.position, &Vector::y()) < 0.1 * weight);
}

#[test]
fn a_block_that_is_dragged_meets_earth_before_it_and_none_behind() {
    let soil = level(20.0);
    let mut ground = fall(soil, 0.1, 8).expect("ground");
    let mut ram = Ram::block(0.2, 0.3, 1.0);
    ram.stand.position.y = 0.05;
    let mut still = ram.clone();
    // Pressed in by 10 cm, and held there.
    still.stand.velocity = Vector::zeros();
    still.tick(&mut ground, &(Vector::y() * (still.mass * GRAVITY)), 1).expect("a tick");
    let all = bearing(&ground, &ram);
    let (weight, deep, width) = (3e3, 0.1, 0.2);
    // In front 0.37 K γ w z²/2, below tan φ K γ z A, tan φ = K/35.
    let front = 0.37 * 20.0 * weight * width * deep * deep / 2.0;
    let below = 20.0 / 35.0 * 20.0 * weight * deep * width * width;
    let exact = front + below;
    for direction in [Vector::x(), -Vector::z()] {
        let found = all.limit(&ram.stand.position, &direction);
        assert!((found / exact - 1.0).abs() < 1e-9, "{found} for {exact}");
    }
    // Dug out behind: a body that has come from there has nothing in the way back.
    ram.stand.velocity = Vector::zeros();
    for _ in 0..40 {
        let from: Arc<[Vector]> = ram.points.iter().map(|point| point + ram.stand.position).collect();
        ram.stand.position.x += 0.004;
        let to = ram.points.iter().map(|point| point + ram.stand.position).collect();
        let triangles = Arc::clone(&ram.triangles);
        let body =
            dlsys_ground::Body { id: 1, name: "a block".to_owned(), triangles, from, to, shelf: false };
        ground.advance(&[], &[body]).expect("a tick");
    }
    let all = bearing(&ground, &ram);
    let [ahead, back] = [Vector::x(), -Vector::x()].map(|way| all.limit(&ram.stand.position, &way));
    assert!(back < ahead - 0.8 * front, "{back} {ahead}");
}

#[test]
fn a_pit_is_no_depth() {
    // A small body in the pit of a large one is borne as on level ground.
    let soil = level(20.0);
    let mut ground = fall(soil, 0.4, 32).expect("ground");
    let block = Ram::block(0.5, 0.4, 1.0);
    let place = |y: f64| block.points.iter().map(|point| point + Vector::y() * y).collect::<Arc<[Vector]>>();
    let press = |from: f64, to: f64| {
        let triangles = Arc::clone(&block.triangles);
        dlsys_ground::Body {
            id: 7,
            name: "a block".to_owned(),
            triangles,
            from: place(from),
            to: place(to),
            shelf: false,
        }
    };
    ground.advance(&[], &[press(0.2, 0.1)]).expect("pressed");
    ground.advance(&[], &[]).expect("lifted");
    let mut ram = Ram::sphere(0.04, 1000.0, 0.0, 64);
    ram.stand.position.y -= 0.1;
    let [above, inside] = [0.001, -0.01].map(|more| {
        let at = ram.stand.position + Vector::y() * more;
        bearing(&ground, &ram).limit(&at, &-Vector::y())
    });
    assert_eq!(above, 0.0);
    let exact = 20.0 * 3e3 * std::f64::consts::PI * 1e-4 * (3.0 * 0.04 - 0.01) / 3.0;
    assert!((inside / exact - 1.0).abs() < 0.02, "{inside} for {exact}");
}
