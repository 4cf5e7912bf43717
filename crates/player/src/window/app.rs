//! The window: takes in what the worker tells, what hands do, and says what is to be shown next.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use eframe::egui::{self, Color32, Key, Sense, TextureHandle, TextureOptions};

use super::life::Life;
use super::look::{Space, Viewpoint};
use super::orders::STILL;
use super::player::{Player, SPEEDS};
use super::trial::{Outcome, Runner};
use super::worker::{Desk, Facts, News, Order, Shown, work};
use super::{Options, panel, timeline};
use dlsys_compile::Setting;
use dlsys_render::Page;

/// After so long without a picture, the window says that it waits.
const LONG: Duration = Duration::from_millis(400);
/// Of the panel at the side, in points.
const WIDTH: f32 = 270.0;
/// Degrees for a drag over the height of the picture.
const TURN: [f64; 2] = [250.0, 180.0];

/// What a key does.
type Action<'a> = &'a dyn Fn(&mut Window);

/// The window.
pub struct Window {
    pub(super) desk: Arc<Desk>,
    pub(super) news: Receiver<News>,
    worker: Option<JoinHandle<()>>,
    file: String,
    start: Option<f64>,
    pub(super) facts: Option<Facts>,
    /// What is wrong, as long as it is.
    pub(super) trouble: Option<String>,
    pub(super) life: Option<Life>,
    /// It is that of a model, or of params, that have changed since.
    pub(super) aged: bool,
    /// Values of params that hands have changed, or the command line.
    pub(super) set: Vec<Setting>,
    pub(super) player: Player,
    pub(super) look: Option<Viewpoint>,
    pub(super) space: Space,
    /// Somebody has turned or moved the plant.
    touched: bool,
    /// The picture, and what part of the area for the plant it covers.
    texture: Option<(TextureHandle, [f32; 4])>,
    /// What the texture shows, its modules, and how long it took to run and to draw it.
    pub(super) shown: Option<(Order, u64, [Duration; 2])>,
    /// The last order, and when it was given.
    pub(super) ordered: Option<(Order, Instant)>,
    /// How long the last quick picture took, run and drawing; more if it has not come in time.
    pub(super) quick: Duration,
    /// Everything that was asked for was on the screen, as good as it gets, and the life known, when the window was drawn last.
    pub(super) settled: bool,
    /// The time that the list of productions was scrolled to last.
    pub(super) listed: f64,
    /// Which of the sizes that moving pictures have.
    pub(super) coarse: usize,
    info: bool,
    last: Instant,
    pub(super) moved: Instant,
    trial: Runner,
}

impl Window {
    pub fn new(context: &egui::Context, options: Options, outcome: Outcome) -> Window {
        style(context);
        let desk = Arc::<Desk>::default();
        let (sender, news) = channel();
        let file = options.model.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let (set, start) = (options.set.clone(), options.at);
        let trial = Runner::new(options.trial.clone(), outcome);
        let worker = {
            let (desk, context) = (desk.clone(), context.clone());
            std::thread::spawn(move || {
                work(&desk, &options, |news| {
                    // Nobody listens any more when the window is closed.
                    let _ = sender.send(news);
                    context.request_repaint();
                });
            })
        };
        Window {
            desk,
            news,
            worker: Some(worker),
            file,
            start,
            facts: None,
            trouble: None,
            life: None,
            aged: false,
            set,
            player: Player::new([0.0, 0.0], 0.0),
            look: None,
            space: Space::default(),
            touched: false,
            texture: None,
            shown: None,
            ordered: None,
            quick: Duration::ZERO,
            settled: false,
            listed: f64::NAN,
            coarse: 0,
            info: true,
            last: Instant::now(),
            moved: Instant::now(),
            trial,
        }
    }

    /// Takes in what has become known.
    fn hear(&mut self, context: &egui::Context) {
        while let Ok(news) = self.news.try_recv() {
            self.learn(context, news);
        }
    }

    pub(super) fn learn(&mut self, context: &egui::Context, news: News) {
        match news {
            News::Read(facts) => {
                let first = self.facts.is_none();
                self.player.set_range(facts.range, facts.step);
                self.set.retain(|s| facts.parameters.iter().any(|p| p.name == s.name));
                self.facts = Some(*facts);
                self.trouble = None;
                self.aged = true;
                if first {
                    self.player.time = self.player.range[0];
                    match self.start {
                        Some(time) => self.player.seek(time),
                        None => self.player.play(true),
                    }
                }
            }
            News::Trouble(message) => self.trouble = Some(message),
            News::Life(life) => {
                if self.look.is_none() || !self.touched && !self.life.as_ref().is_some_and(|l| l.whole) {
                    self.space = life.space.clone();
                    let [azimuth, elevation] = self.space.front;
                    self.look = Some(Viewpoint::at(&self.space, azimuth, elevation, true));
                }
                self.life = Some(*life);
                self.aged = false;
                self.listed = f64::NAN;
            }
            News::Picture(picture) => {
                let Shown { order, image, part, modules, spent } = *picture;
                let options = TextureOptions::LINEAR;
                match &mut self.texture {
                    Some((texture, place)) => {
                        texture.set(image, options);
                        *place = part;
                    }
                    None => self.texture = Some((context.load_texture("plant", image, options), part)),
                }
                self.trouble = None;
                if order.shot.as_ref().is_some_and(|shot| !shot.fine) {
                    self.pace(spent);
                }
                self.shown = Some((order, modules, spent));
            }
        }
    }

    /// Shows the whole plant from a side, as large as it becomes with the params that are set now.
    fn look_at(&mut self, azimuth: f64, elevation: f64) {
        if let Some(life) = &self.life {
            self.space = life.space.clone();
        }
        let perspective = self.look.as_ref().is_none_or(|look| look.perspective);
        self.look = Some(Viewpoint::at(&self.space, azimuth, elevation, perspective));
        self.touched = true;
    }

    fn toggle_perspective(&mut self) {
        if let Some(look) = &self.look {
            self.look = Some(Viewpoint::at(&self.space, look.azimuth, look.elevation, !look.perspective));
        }
    }

    /// Gives a param another value.
    pub(super) fn set(&mut self, name: &str, value: f64) {
        self.set.retain(|s| s.name != name);
        let own = self.facts.iter().flat_map(|f| &f.parameters).find(|p| p.name == name);
        if own.is_some() {
            self.set.push(Setting { name: name.to_owned(), value });
        }
    }

    fn keys(&mut self, context: &egui::Context) {
        if context.wants_keyboard_input() {
            return;
        }
        let pressed = |key| context.input(|input| input.key_pressed(key));
        let many = context.input(|input| if input.modifiers.shift { 10 } else { 1 });
        let turned = |w: &mut Window, right, up| {
            w.touched = true;
            w.look.iter_mut().for_each(|look| look.orbit(right, up));
        };
        let sized = |w: &mut Window, factor| {
            w.touched = true;
            w.look.iter_mut().for_each(|look| look.magnify(factor, 0.0, 0.0, 1.0));
        };
        let actions: [(Key, Action<'_>); 24] = [
            (Key::Space, &|w| w.player.play(!w.player.playing)),
            (Key::ArrowLeft, &|w| w.player.frames(-many)),
            (Key::ArrowRight, &|w| w.player.frames(many)),
            (Key::OpenBracket, &|w| w.production(false)),
            (Key::CloseBracket, &|w| w.production(true)),
            (Key::Home, &|w| w.player.seek(w.player.range[0])),
            (Key::End, &|w| w.player.seek(w.player.range[1])),
            (Key::Minus, &|w| w.player.faster(-1)),
            (Key::Plus, &|w| w.player.faster(1)),
            (Key::Equals, &|w| w.player.faster(1)),
            (Key::L, &|w| w.player.loops = !w.player.loops),
            (Key::P, &Window::toggle_perspective),
            (Key::I, &|w| w.info = !w.info),
            (Key::A, &|w| turned(w, -5.0, 0.0)),
            (Key::D, &|w| turned(w, 5.0, 0.0)),
            (Key::W, &|w| turned(w, 0.0, 5.0)),
            (Key::S, &|w| turned(w, 0.0, -5.0)),
            (Key::Q, &|w| sized(w, 1.0 / 1.15)),
            (Key::E, &|w| sized(w, 1.15)),
            (Key::Num1, &|w| w.look_at(0.0, 0.0)),
            (Key::Num2, &|w| w.look_at(90.0, 0.0)),
            (Key::Num3, &|w| w.look_at(0.0, 90.0)),
            (Key::Num0, &Window::whole),
            (Key::R, &|w| w.set.clear()),
        ];
        for (key, action) in actions {
            if pressed(key) {
                action(self);
            }
        }
    }

    /// The whole plant, from where it is looked at.
    fn whole(&mut self) {
        if let Some(look) = &self.look {
            self.look_at(look.azimuth, look.elevation);
        }
    }

    /// To the production after now, or before.
    fn production(&mut self, after: bool) {
        let now = self.player.time;
        let times = || self.life.iter().flat_map(|life| &life.history.happenings).map(|h| h.t);
        let slack = 1e-12 * now.abs();
        let found =
            if after { times().find(|t| *t > now + slack) } else { times().rev().find(|t| *t < now - slack) };
        if let Some(time) = found {
            self.player.seek(time);
        }
    }

    fn controls(&mut self, ui: &mut egui::Ui) {
        ui.horizontal(|ui| {
            let play = if self.player.playing { "⏸ Pause" } else { "▶ Play" };
            if ui.add(egui::Button::new(play).min_size([76.0, 0.0].into())).on_hover_text("space").clicked() {
                self.player.play(!self.player.playing);
            }
            ui.toggle_value(&mut self.player.loops, "Loop").on_hover_text("L");
            ui.label("Speed");
            egui::ComboBox::from_id_salt("speed")
                .width(64.0)
                .selected_text(format!("{} ×", self.player.speed))
                .show_ui(ui, |ui| {
                    for speed in SPEEDS {
                        ui.selectable_value(&mut self.player.speed, speed, format!("{speed} ×"));
                    }
                });
            ui.strong(format!("t = {}", timeline::shown(self.player.time)));
            if let Some((_, modules, _)) = &self.shown {
                let s = if *modules == 1 { "" } else { "s" };
                ui.weak(format!("{modules} module{s}"));
            }
            if self.waits() && self.ordered.as_ref().is_some_and(|(_, since)| since.elapsed() > LONG) {
                ui.spinner();
                ui.weak("running …");
            }
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                ui.toggle_value(&mut self.info, "Info").on_hover_text("I");
                let mut perspective = self.look.as_ref().is_some_and(|look| look.perspective);
                if ui.toggle_value(&mut perspective, "Perspective").on_hover_text("P").clicked() {
                    self.toggle_perspective();
                }
                for (name, azimuth, elevation, key) in
                    [("Top", 0.0, 90.0, "3"), ("Side", 90.0, 0.0, "2"), ("Front", 0.0, 0.0, "1")]
                {
                    if ui.button(name).on_hover_text(key).clicked() {
                        self.look_at(azimuth, elevation);
                    }
                }
            });
        });
    }

    /// The plant, and the hands on it.
    fn plant(&mut self, ui: &mut egui::Ui) {
        let (response, painter) = ui.allocate_painter(ui.available_size(), Sense::click_and_drag());
        let area = response.rect;
        self.hands(ui, &response);
        let ratio = f64::from(ui.ctx().pixels_per_point());
        let most = ui.ctx().input(|input| input.max_texture_side) as f64;
        if self.order([area.width(), area.height()].map(|side| (f64::from(side) * ratio).min(most))) {
            self.wait(ui.ctx());
        }
        let asked = self.shown.as_ref().and_then(|(order, ..)| order.shot.as_ref()).map(|shot| shot.pixels);
        if let (Some((texture, [left, top, right, bottom])), Some([wide, high])) = (&self.texture, asked) {
            // Stretched as little as it may be while the window changes its size.
            let size = egui::vec2(wide as f32, high as f32);
            let scale = (area.width() / size.x).min(area.height() / size.y);
            let picture = egui::Rect::from_center_size(area.center(), size * scale);
            let part = egui::Rect::from_min_max(
                picture.lerp_inside(egui::vec2(*left, *top)),
                picture.lerp_inside(egui::vec2(*right, *bottom)),
            );
            let whole = egui::Rect::from_min_max(egui::pos2(0.0, 0.0), egui::pos2(1.0, 1.0));
            painter.image(texture.id(), part, whole, Color32::WHITE);
        }
        let title = self.facts.as_ref().map_or("", |facts| &facts.title);
        let (title, file) =
            if title.is_empty() { (self.file.as_str(), "") } else { (title, self.file.as_str()) };
        let ink = ui.visuals().text_color();
        let corner = area.min + egui::vec2(14.0, 10.0);
        let below =
            painter.text(corner, egui::Align2::LEFT_TOP, title, egui::FontId::proportional(18.0), ink);
        let faint = ui.visuals().weak_text_color();
        painter.text(
            below.left_bottom(),
            egui::Align2::LEFT_TOP,
            file,
            egui::FontId::proportional(13.0),
            faint,
        );
    }

    fn hands(&mut self, ui: &egui::Ui, response: &egui::Response) {
        let area = response.rect;
        let [width, height] = [f64::from(area.width()), f64::from(area.height().max(1.0))];
        if let Some(look) = &mut self.look {
            let drag = response.drag_delta();
            let [x, y] = [f64::from(drag.x), f64::from(drag.y)].map(|d| d / height);
            let shift = ui.input(|input| input.modifiers.shift);
            if drag != egui::Vec2::ZERO {
                self.touched = true;
                if response.dragged_by(egui::PointerButton::Primary) && !shift {
                    look.orbit(x * TURN[0], y * TURN[1]);
                } else {
                    look.pan(x, -y, width / height);
                }
            }
            if let Some(pointer) = response.hover_pos() {
                let (scroll, pinch) = ui.input(|input| (input.smooth_scroll_delta.y, input.zoom_delta()));
                let factor = f64::from((scroll * 0.004).exp() * pinch);
                if factor != 1.0 {
                    self.touched = true;
                    let at = (pointer - area.center()) / height as f32;
                    look.magnify(factor, f64::from(at.x), f64::from(-at.y), width / height);
                }
            }
        }
        if response.double_clicked() {
            self.whole();
        }
    }
}

impl eframe::App for Window {
    fn update(&mut self, context: &egui::Context, _: &mut eframe::Frame) {
        let mut trial = std::mem::take(&mut self.trial);
        trial.step(self, context);
        self.trial = trial;
        self.hear(context);
        let now = Instant::now();
        self.player.pass((now - self.last).as_secs_f64());
        self.last = now;
        self.keys(context);
        if self.info {
            egui::SidePanel::right("info")
                .default_width(WIDTH)
                .width_range(WIDTH..=2.0 * WIDTH)
                .show(context, |ui| panel::show(self, ui));
        }
        egui::TopBottomPanel::bottom("controls").show(context, |ui| {
            ui.add_space(4.0);
            timeline::show(ui, &mut self.player, self.life.as_ref());
            self.controls(ui);
            ui.add_space(4.0);
        });
        if let Some(trouble) = &self.trouble {
            panel::trouble(context, trouble.trim_end());
        }
        egui::CentralPanel::default().frame(egui::Frame::new()).show(context, |ui| self.plant(ui));
        self.settled = self.is_settled();
        if self.player.playing {
            context.request_repaint();
        } else if !self.settled {
            context.request_repaint_after(STILL / 2);
        }
    }

    /// What is behind the plant: filling a rectangle with it costs as much as the picture where there is no graphics processor.
    fn clear_color(&self, _: &egui::Visuals) -> [f32; 4] {
        background().to_normalized_gamma_f32()
    }

    fn on_exit(&mut self, _: Option<&eframe::glow::Context>) {
        self.desk.close();
        // A worker that has failed has said so.
        let _ = self.worker.take().map(JoinHandle::join);
    }
}

fn background() -> Color32 {
    let dlsys_geometry::scene::Color { red, green, blue } = Page::BACKGROUND;
    Color32::from_rgb(red, green, blue)
}

fn style(context: &egui::Context) {
    let mut visuals = egui::Visuals::light();
    visuals.panel_fill = Color32::from_rgb(0xff, 0xfe, 0xfb);
    visuals.override_text_color = Some(Color32::from_rgb(0x2c, 0x33, 0x26));
    visuals.selection.bg_fill = Color32::from_rgb(0xcf, 0xe3, 0xbf);
    visuals.selection.stroke.color = Color32::from_rgb(0x2c, 0x33, 0x26);
    visuals.slider_trailing_fill = true;
    context.set_visuals_of(egui::Theme::Light, visuals);
    context.set_theme(egui::Theme::Light);
}
