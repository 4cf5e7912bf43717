//! The panel at the side: params with sliders, productions, keys.

use eframe::egui::{self, Color32, RichText};

use super::app::Window;
use super::timeline::shown;
use dlsys_model::Parameter;

const KEYS: [(&str, &str); 13] = [
    ("space", "play, pause"),
    ("← →", "a frame back, on; shift: ten"),
    ("[ ]", "the production before, after"),
    ("home end", "first time, last time"),
    ("- +", "slower, faster"),
    ("L", "loop"),
    ("W A S D", "turn"),
    ("Q E", "smaller, larger"),
    ("1 2 3", "front, side, top"),
    ("P", "perspective"),
    ("0", "the whole plant"),
    ("R", "all params as in the file"),
    ("I", "this panel"),
];

/// Of messages, and behind them; and how much of the height they get at most.
const RED: Color32 = Color32::from_rgb(0x96, 0x1a, 0x1a);
const PALE: Color32 = Color32::from_rgb(0xfd, 0xf2, 0xee);
const MOST_TROUBLE: f32 = 240.0;
/// Of the height of the panel, params get this part at most.
const PARAMETERS: f32 = 0.6;

/// Draws it.
pub fn show(window: &mut Window, ui: &mut egui::Ui) {
    ui.set_min_width(ui.available_width());
    // First, so that a long list above leaves room for it.
    let bottom =
        egui::TopBottomPanel::bottom("keys").frame(egui::Frame::new().inner_margin(egui::vec2(0.0, 6.0)));
    bottom.show_separator_line(false).show_inside(ui, |ui| {
        egui::CollapsingHeader::new("Keys").show(ui, |ui| {
            egui::Grid::new("keys").show(ui, |ui| {
                for (key, what) in KEYS {
                    ui.monospace(key);
                    ui.label(what);
                    ui.end_row();
                }
            });
            ui.weak("Drag: turn. Right button or shift: move. Wheel: size.");
        });
    });
    egui::CentralPanel::default().frame(egui::Frame::new()).show_inside(ui, |ui| {
        ui.add_space(6.0);
        parameters(window, ui);
        productions(window, ui);
    });
}

/// Says below the plant what is wrong.
pub fn trouble(context: &egui::Context, message: &str) {
    let font = egui::TextStyle::Monospace.resolve(&context.style());
    let line = context.fonts_mut(|fonts| fonts.row_height(&font));
    let height = (message.lines().count() as f32 * line).min(MOST_TROUBLE);
    let frame = egui::Frame::new().fill(PALE).inner_margin(egui::Margin::symmetric(14, 8));
    let panel = egui::TopBottomPanel::bottom("trouble").frame(frame).exact_height(height + 16.0);
    panel.show(context, |ui| {
        egui::ScrollArea::both().auto_shrink(false).show(ui, |ui| {
            let text = RichText::new(message).monospace().color(RED);
            ui.add(egui::Label::new(text).extend().selectable(true));
        });
    });
}

fn parameters(window: &mut Window, ui: &mut egui::Ui) {
    let parameters = window.facts.as_ref().map(|facts| facts.parameters.clone()).unwrap_or_default();
    if parameters.is_empty() {
        return;
    }
    ui.horizontal(|ui| {
        ui.heading("Parameters");
        if !window.set.is_empty() && ui.small_button("as in the file").on_hover_text("R").clicked() {
            window.set.clear();
        }
    });
    let most = ui.available_height() * PARAMETERS;
    let area = egui::ScrollArea::vertical().id_salt("parameters").max_height(most).auto_shrink([false, true]);
    area.show(ui, |ui| sliders(window, ui, &parameters));
    ui.add_space(6.0);
    ui.separator();
}

fn sliders(window: &mut Window, ui: &mut egui::Ui, parameters: &[Parameter]) {
    for parameter in parameters {
        // The model's own value is known only where nothing has been set; that is what the slider shows then.
        let set = window.set.iter().find(|s| s.name == parameter.name).map(|s| s.value);
        let mut value = set.unwrap_or(parameter.value);
        ui.label(RichText::new(&parameter.name).monospace());
        let changed = match parameter.range {
            Some((low, high)) => {
                ui.spacing_mut().slider_width = (ui.available_width() - 66.0).max(60.0);
                ui.add(egui::Slider::new(&mut value, low..=high).smart_aim(true)).changed()
            }
            None => {
                let speed = (value.abs() * 0.01).max(1e-3);
                ui.add(egui::DragValue::new(&mut value).speed(speed)).changed()
            }
        };
        if changed {
            window.set(&parameter.name, value);
        }
    }
}

fn productions(window: &mut Window, ui: &mut egui::Ui) {
    let Some(life) = &window.life else { return };
    let history = &life.history;
    ui.horizontal(|ui| {
        ui.heading("Productions");
        ui.weak(history.productions.to_string());
        if !life.whole {
            ui.spinner();
        }
    });
    ui.add_space(3.0);
    let rows = &history.happenings;
    let now = window.player.time;
    let past = rows.partition_point(|h| h.t <= now);
    let height = ui.text_style_height(&egui::TextStyle::Body) + 2.0;
    let mut chosen = None;
    let most = ui.available_height().max(120.0);
    let area = egui::ScrollArea::vertical().max_height(most).auto_shrink([false, true]);
    // Where one is comes to the middle when the time has become another; else the list stays where hands have left it.
    let spacing = ui.spacing().item_spacing.y;
    let middle = (past as f32 - 0.5) * (height + spacing) - most / 2.0;
    let area = if now == window.listed { area } else { area.vertical_scroll_offset(middle.max(0.0)) };
    area.show_rows(ui, height, rows.len() + usize::from(history.left_out > 0), |ui, range| {
        ui.style_mut().wrap_mode = Some(egui::TextWrapMode::Truncate);
        ui.set_min_width(ui.available_width());
        for i in range {
            let Some(row) = rows.get(i) else {
                ui.weak(format!("… and {} more", history.left_out));
                continue;
            };
            let times = if row.times > 1 { format!("{} × ", row.times) } else { String::new() };
            let text = format!("{:>9}  {times}{}", shown(row.t), row.module);
            let text = RichText::new(text).monospace();
            let text = if i < past { text } else { text.weak() };
            let hint = format!("line {} of the model", row.line);
            // As wide as the panel.
            let justified = egui::Layout::top_down_justified(egui::Align::LEFT);
            let label = ui.with_layout(justified, |ui| ui.selectable_label(i + 1 == past, text)).inner;
            if label.on_hover_text(hint).clicked() {
                chosen = Some(row.t);
            }
        }
    });
    window.listed = now;
    if let Some(time) = chosen {
        window.player.seek(time);
        // What was clicked on stays under the pointer.
        window.listed = window.player.time;
    }
}
