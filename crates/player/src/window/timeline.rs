//! The timeline: modules over time, productions as ticks, and where one is.

use eframe::egui::{self, Color32, Mesh, Pos2, Rect, Sense, Shape, Stroke};

use super::life::Life;
use super::player::Player;

const FILL: Color32 = Color32::from_rgb(0xe8, 0xf0, 0xdf);
const LINE: Color32 = Color32::from_rgb(0xb7, 0xcf, 0xa3);
const STEM: Color32 = Color32::from_rgb(0x41, 0x70, 0x2c);
const HEIGHT: f32 = 40.0;
/// Height of the ticks below.
const TICKS: f32 = 6.0;

/// A time, for people.
pub fn shown(time: f64) -> String {
    if time.abs() >= 1000.0 { format!("{time:.1}") } else { format!("{time:.3}") }
}

/// Draws it; a click or a drag goes to that time.
pub fn show(ui: &mut egui::Ui, player: &mut Player, life: Option<&Life>) {
    let size = egui::vec2(ui.available_width(), HEIGHT);
    let (response, painter) = ui.allocate_painter(size, Sense::click_and_drag());
    let area = response.rect.shrink2(egui::vec2(2.0, 1.0));
    let [from, to] = player.range;
    let span = if to > from { to - from } else { 1.0 };
    let x = |t: f64| area.left() + area.width() * ((t - from) / span).clamp(0.0, 1.0) as f32;
    if let Some(pointer) = response.interact_pointer_pos() {
        let part = f64::from((pointer.x - area.left()) / area.width().max(1.0)).clamp(0.0, 1.0);
        player.seek(from + part * (to - from));
    }
    let floor = area.bottom() - TICKS;
    painter.hline(area.x_range(), floor, Stroke::new(1.0, LINE));
    if let Some(life) = life {
        let most = life.counts.iter().map(|(_, modules)| *modules).max().unwrap_or(0).max(1) as f32;
        let y = |modules: u64| floor - (floor - area.top()) * modules as f32 / most;
        // One thing each: edges of many rectangles side by side would be seen as stripes.
        let (mut fill, mut outline) = (Mesh::default(), Vec::new());
        for pair in life.counts.windows(2) {
            let [(a, before), (b, after)] = [pair[0], pair[1]];
            fill.add_colored_rect(
                Rect::from_min_max(Pos2::new(x(a), y(before)), Pos2::new(x(b), floor)),
                FILL,
            );
            let corners = [(a, before), (b, before), (b, after)];
            outline.extend(corners.map(|(t, modules)| Pos2::new(x(t), y(modules).round() + 0.5)));
        }
        outline.dedup();
        painter.add(fill);
        painter.add(Shape::line(outline, Stroke::new(1.0, LINE)));
        let mut last = f32::NEG_INFINITY;
        for happening in life.history.happenings.iter().filter(|h| (from..=to).contains(&h.t)) {
            let at = x(happening.t).round();
            if at > last {
                last = at;
                painter.vline(at, floor + 1.0..=area.bottom(), Stroke::new(1.0, STEM.gamma_multiply(0.6)));
            }
        }
    }
    painter.vline(x(player.time), area.y_range(), Stroke::new(2.5, STEM));
    let described = || egui::WidgetInfo::slider(true, player.time, "Time");
    response.widget_info(described);
    response.on_hover_cursor(egui::CursorIcon::ResizeHorizontal);
}
