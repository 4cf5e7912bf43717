//! Properties of sheets: mistakes in meshes, bits, momentum of springs, any times in any order.

use dlsys_sheet::{
    Air, Error, Grip, Mesh, Place, Rejection, Run, Settings, Shape, Sheet, Solid, Solver, State, Still,
    Tissue, Vector,
};

fn tissue() -> Tissue {
    Tissue::new(1e6, 300.0, 5e-4)
}

fn square(parts: usize) -> Mesh {
    Mesh::rectangle(Vector::zeros(), [Vector::x(), Vector::z()], [parts, parts])
}

fn message(mesh: &Mesh, tissue: &Tissue) -> String {
    Sheet::new(mesh, tissue, |_| false).map(|_| String::new()).unwrap_or_else(|error| error.to_string())
}

#[test]
fn mistakes_in_a_mesh_have_a_cause() {
    let mut mesh = square(1);
    mesh.points.push(Vector::y());
    assert_eq!(message(&mesh, &tissue()), "point 4 belongs to no face and to no cord, so it has no mass");
    mesh.points.push(-Vector::y());
    mesh.faces.extend([vec![0, 1, 4], vec![1, 0, 5]]);
    assert_eq!(
        message(&mesh, &tissue()),
        "the mesh is not manifold: 3 faces share the edge between points 0 and 1"
    );
    let with = |face: Vec<usize>| Mesh { faces: vec![face], ..square(1) };
    assert_eq!(message(&with(vec![0, 1]), &tissue()), "face 0 is not valid: it has fewer than three points");
    assert!(message(&with(vec![0, 1, 7]), &tissue()).contains("a point that the mesh does not have"));
    assert!(message(&with(vec![0, 1, 1]), &tissue()).contains("a point twice"));
    let flat = Mesh { points: vec![Vector::zeros(), Vector::x(), Vector::x() * 2.0], ..with(vec![0, 1, 2]) };
    assert!(message(&flat, &tissue()).contains("on a line"));
    let cord = Mesh { cords: vec![[0, 1]], ..Mesh::cord(Vector::x(), Vector::x(), 1) };
    assert_eq!(message(&cord, &tissue()), "cord 0 is not valid: its length is 0");
    assert!(matches!(
        Sheet::new(&Mesh::default(), &tissue(), |_| true),
        Err(Error::Points { points: 0, .. })
    ));
    let light = Tissue { density: 0.0, ..tissue() };
    assert_eq!(message(&square(1), &light), "a density (kg/m³) of 0 is out of range: expected more than 0");
}

#[test]
fn masses_are_those_of_area_and_section() -> Result<(), Error> {
    let mut mesh = square(3);
    mesh.cords.push([0, 15]);
    let sheet = Sheet::new(&mesh, &tissue(), |_| false)?;
    let cord = 300.0 * std::f64::consts::FRAC_PI_4 * 5e-4 * 5e-4 * 2.0_f64.sqrt();
    assert!((sheet.masses().iter().sum::<f64>() - 0.15 - cord).abs() < 1e-14);
    // A point within belongs to four quads.
    assert!((sheet.masses()[5] - 0.15 / 9.0).abs() < 1e-14);
    Ok(())
}

/// A crumpled free sheet with cords keeps both momenta, and loses energy only.
#[test]
fn springs_keep_momentum() -> Result<(), Error> {
    let mut mesh = square(5);
    mesh.cords.extend([[0, 1], [1, 2], [2, 9]]);
    let sheet = Sheet::new(&mesh, &Tissue { damping: 0.3, ..tissue() }, |_| false)?;
    let mut state = State::at_rest(&sheet);
    for (k, point) in state.positions.iter_mut().enumerate() {
        let turn = 2.4 * k as f64;
        *point += Vector::new(turn.cos(), (1.7 * turn).sin(), turn.sin()) * 0.02;
        state.velocities[k] = Vector::new(0.0, point.z, -point.y) + Vector::new(1.0, 0.5, 0.2);
    }
    let momenta = |state: &State| {
        let mut sums = [Vector::zeros(); 2];
        for k in 0..sheet.len() {
            let push = state.velocities[k] * sheet.masses()[k];
            sums[0] += push;
            sums[1] += state.positions[k].cross(&push);
        }
        sums
    };
    let settings = Settings { air: Air::none(), tolerance: 1e-4, ..Settings::default() };
    let mut solver = Solver::new(settings);
    let (before, energy) = (momenta(&state), solver.energy(&sheet, &state, 0.0, &[]).total());
    solver.advance(&sheet, &mut state, 0.0..0.5, &[], &Still, |_| ())?;
    let after = momenta(&state);
    assert!((after[0] - before[0]).norm() < 1e-9 * before[0].norm(), "{before:?} {after:?}");
    assert!((after[1] - before[1]).norm() < 1e-2 * before[1].norm(), "{before:?} {after:?}");
    assert!(solver.energy(&sheet, &state, 0.5, &[]).total() < energy);
    Ok(())
}

#[test]
fn any_times_in_any_order_give_the_same_bits() -> Result<(), Error> {
    let sheet = Sheet::new(&square(6), &tissue(), |point| point.x == 0.0)?;
    let shape = Shape::ball(0.1)?;
    let solids = [Solid::free_ball(&shape, 0.05)];
    let wind = |point: Vector, time: f64| Vector::new(2.0, 0.0, (5.0 * time + point.x).sin());
    let start = State::at_rest(&sheet).with(vec![Place::at(Vector::new(0.5, 0.12, 0.5))]);
    let run = || Run::new(&sheet, &solids, &wind, Settings::default(), (0.0, start.clone()));
    let mut forward = run();
    let times = [0.01, 0.05, 0.1, 0.1001, 0.2, 0.31];
    let states = times.map(|time| forward.at(time).unwrap());
    let mut backward = run();
    for (time, state) in times.into_iter().zip(&states).rev() {
        assert_eq!(backward.at(time)?, *state, "{time}");
        assert_eq!(run().at(time)?, *state, "{time}");
    }
    let threads: Vec<_> = std::thread::scope(|scope| {
        let handles = [0, 1].map(|_| scope.spawn(|| run_alone(&sheet, start.clone())));
        handles.map(|handle| handle.join().unwrap()).into()
    });
    assert_eq!(threads[0], threads[1]);
    Ok(())
}

fn run_alone(sheet: &Sheet, mut state: State) -> State {
    let shape = Shape::ball(0.1).unwrap();
    let solids = [Solid::free_ball(&shape, 0.05)];
    Solver::new(Settings::default()).advance(sheet, &mut state, 0.0..0.2, &solids, &Still, |_| ()).unwrap();
    state
}

/// What a sheet does to a free ball is what the ball gains.
#[test]
fn pushes_are_changes_of_momentum() -> Result<(), Error> {
    let sheet = Sheet::new(&square(6), &tissue(), |point| point.x == 0.0 || point.x == 1.0)?;
    let shape = Shape::ball(0.1)?;
    let grip = Grip { friction: 0.8, ..Grip::default() };
    let solids = [Solid::free_ball(&shape, 0.2).with(grip)];
    let mut ball = Place::at(Vector::new(0.45, 0.13, 0.5)).moving(Vector::new(0.5, -1.0, 0.0));
    ball.spin = Vector::new(0.0, 0.0, 20.0);
    let mut state = State::at_rest(&sheet).with(vec![ball]);
    let mut solver = Solver::new(Settings::default());
    let pushes = solver.advance(&sheet, &mut state, 0.0..0.3, &solids, &Still, |_| ())?;
    let gravity = Vector::new(0.0, -9.81, 0.0);
    let gained = (state.bodies[0].velocity - ball.velocity - gravity * 0.3) * 0.2;
    let turned = (state.bodies[0].spin - ball.spin) * (0.4 * 0.2 * 0.1 * 0.1);
    assert!(pushes[0].impulse.norm() > 0.1, "{pushes:?}");
    assert!((gained - pushes[0].impulse).norm() < 1e-8 * gained.norm(), "{gained} {pushes:?}");
    assert!((turned - pushes[0].moment).norm() < 1e-8 * gained.norm(), "{turned} {pushes:?}");
    Ok(())
}

/// A sheet between two solids that close is an error that says so, not a solid that went through.
#[test]
fn what_is_squeezed_is_an_error() -> Result<(), Error> {
    let sheet = Sheet::new(&square(6), &tissue(), |point| point.x == 0.0 || point.x == 1.0)?;
    let shape = Shape::ball(0.1)?;
    let above = |time: f64| Place::at(Vector::new(0.5, 0.15 - time, 0.5)).moving(-Vector::y());
    let below = |_: f64| Place::at(Vector::new(0.5, -0.15, 0.5));
    let solids = [Solid::guided(&shape, &above), Solid::guided(&shape, &below)];
    let mut state = State::at_rest(&sheet);
    let mut solver = Solver::new(Settings { most: 100, ..Settings::default() });
    let error = solver.advance(&sheet, &mut state, 0.0..0.25, &solids, &Still, |_| ());
    let is_deep = |cause: &Rejection| matches!(cause, Rejection::Deep { .. } | Rejection::Error { .. });
    assert!(
        matches!(&error, Err(Error::Step { cause, .. } | Error::Steps { cause, .. }) if is_deep(cause)),
        "{error:?}"
    );
    Ok(())
}
