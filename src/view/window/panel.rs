//! The panel at the side: params with sliders, productions, keys.

use eframe::egui::{self, RichText};

use super::app::Window;
use super::timeline::shown;

const KEYS: [(&str, &str); 11] = [
    ("space", "play, pause"),
    ("← →", "a frame back, on; with shift ten"),
    ("[ ]", "the production before, after"),
    ("home end", "first time, last time"),
    ("- +", "slower, faster"),
    ("L", "loop"),
    ("W A S D, Q E", "turn, size"),
    ("1 2 3, P", "front, side, top; perspective"),
    ("0", "the whole plant"),
    ("R", "all params as in the file"),
    ("I", "this panel"),
];

/// Draws it.
pub fn show(window: &mut Window, ui: &mut egui::Ui) {
    ui.set_min_width(ui.available_width());
    ui.add_space(6.0);
    parameters(window, ui);
    productions(window, ui);
    ui.add_space(6.0);
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
    for parameter in &parameters {
        // The model's own value is known only where nothing has been set; that is what the slider shows then.
        let set = window.set.iter().find(|s| s.name == parameter.name).map(|s| s.value);
        let mut value = set.unwrap_or(parameter.value);
        ui.label(RichText::new(&parameter.name).monospace());
        let changed = match parameter.range {
            Some((low, high)) => {
                ui.spacing_mut().slider_width = (ui.available_width() - 80.0).max(60.0);
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
    ui.add_space(6.0);
    ui.separator();
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
    let rows = &history.happenings;
    let now = window.player.time;
    let past = rows.partition_point(|h| h.t <= now);
    let height = ui.text_style_height(&egui::TextStyle::Body) + 2.0;
    let mut chosen = None;
    let most = (ui.available_height() - 40.0).max(120.0);
    let area = egui::ScrollArea::vertical().max_height(most).auto_shrink([false, true]);
    // Where one is stays in the middle while time goes on.
    let spacing = ui.spacing().item_spacing.y;
    let middle = (past as f32 - 0.5) * (height + spacing) - most / 2.0;
    let area = if window.player.playing { area.vertical_scroll_offset(middle.max(0.0)) } else { area };
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
            if ui.selectable_label(i + 1 == past, text).on_hover_text(hint).clicked() {
                chosen = Some(row.t);
            }
        }
    });
    if let Some(time) = chosen {
        window.player.seek(time);
    }
}
