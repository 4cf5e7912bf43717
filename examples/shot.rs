use dlsys::render::*;
use dlsys::scene::*;
use std::sync::Arc;
fn num(name: &str) -> Option<Vec<f64>> { std::env::var(name).ok().map(|s| s.split(',').map(|x| x.parse().unwrap()).collect()) }
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let (model, time, out) = (&args[1], args[2].parse::<f64>().unwrap(), &args[3]);
    let session = dlsys::session::Session::open(std::path::Path::new(model), &[]).unwrap();
    let mut scene = dlsys::turtle::blank(&session.model);
    let mut simulation = session.simulate(Default::default()).unwrap();
    let mut string = Default::default();
    simulation.at(time, &mut string).unwrap();
    dlsys::turtle::draw(&session.model, &string, &mut scene).unwrap();
    if let Some(n) = num("MEADOW") {
        let plant = Arc::new(scene);
        let mut whole = Scene::default();
        let owner = whole.add_owner(Owner { name: "@P".into(), lineage: dlsys::tree::Lineage::of_axiom(0) });
        let size = Bounds::of(&plant).extent();
        for i in 0..n[0] as usize {
            let r = size * 0.35 * (i as f64).sqrt(); let a = 2.399963 * i as f64;
            let (s, c) = (a * 3.0).sin_cos();
            whole.plants.push(Plant { scene: plant.clone(), owner, placement: Placement { origin: Point::new(r * a.cos(), 0.0, r * a.sin()), axes: [Vector::new(c, 0.0, -s), Vector::y(), Vector::new(s, 0.0, c)], scale: 1.0 + 0.3 * (i as f64).sin() } });
        }
        scene = whole;
    }
    if let Some(f) = num("FLOOR") { scene.surroundings.floor = Some(f[0]); }
    if let Some(s) = num("SUN") { scene.surroundings.sun = Some(Vector::new(s[0], s[1], s[2])); }
    if std::env::var("SKY").is_ok() { scene.surroundings.sky = Some([Color::hex(0x6fa3e0), Color::hex(0xe8f0f8)]); }
    if let Some(c) = num("CAMERA") { scene.surroundings.camera = Some(Viewpoint { eye: Point::new(c[0], c[1], c[2]), aim: Point::new(c[3], c[4], c[5]), angle: 40.0 }); }
    let view: View = std::env::var("VIEW").unwrap_or("front".into()).parse().unwrap();
    let mut survey = Survey::new(view);
    if let Some(p) = num("PERSP") { survey = survey.with_perspective(p[0]); }
    let t = std::time::Instant::now();
    survey.add(&scene);
    let fit = survey.fit();
    eprintln!("survey {:?}", t.elapsed());
    let format = if out.ends_with("png") { Format::PNG } else if out.ends_with("svg") { Format::SVG } else { Format::OBJ };
    let mut writer = FrameWriter::new(format, fit);
    if let Some(s) = num("SIZE") { writer.page = Page::new(writer.fit.picture, Size::Exact(s[0] as u32, s[1] as u32), Some(Page::BACKGROUND)).unwrap(); }
    let t = std::time::Instant::now();
    std::fs::write(out, writer.write(&scene, "x")).unwrap();
    eprintln!("write {:?}", t.elapsed());
}
