//! Widths along an axis: stems that taper, and steps that can be seen.

use super::super::error::{self, Remark};
use super::{Node, Scene, Walk};
use crate::scene::{MaterialId, Width};
use dlsys_model::KindId;

impl Walk<'_> {
    /// Lets the segments drawn since the last width run evenly from that width to this one. The
    /// default width is not known before the whole animation is, and stays.
    pub(super) fn taper(&mut self, to: Width) {
        let (Width::Set(from), Width::Set(to)) = (self.state.width, to) else { return };
        let chain = |scene: &Scene, last: Option<usize>| {
            let mut next = last;
            let mut found = Vec::new();
            for _ in 0..self.state.run {
                let Some(i) = next else { break };
                found.push((i, (scene.segments[i].end - scene.segments[i].start).norm()));
                next = scene.segments[i].follows;
            }
            found
        };
        let run = chain(self.scene, self.state.last);
        let whole: f64 = run.iter().map(|(_, length)| length).sum();
        let mut rest = 0.0;
        for (i, length) in run {
            let width = |behind: f64| Width::Set(to + (from - to) * (behind / whole).min(1.0));
            self.scene.segments[i].widths = [width(rest + length), width(rest)];
            rest += length;
        }
    }

    /// Notes the width of a segment if none before was as wide.
    pub(super) fn note_width(&mut self) {
        if let Width::Set(width) = self.state.width
            && self.widest.is_none_or(|(widest, _)| width > widest)
            && let Some(set_by) = self.state.set_by
        {
            self.widest = Some((width, set_by));
        }
    }

    /// Warns if a stem of the default width is drawn by what should press into soil or carry what falls.
    pub(super) fn check_body(&mut self) {
        let scenery = &self.model.scenery;
        let is_body =
            |kind: KindId| scenery.solids.iter().chain(&scenery.shelves).any(|(own, _)| *own == kind);
        if scenery.bed.is_some()
            && matches!(self.state.width, Width::Default(_))
            && self.recorder.is_none()
            && is_body(self.drawn.kind)
        {
            self.remark(Remark::NoWidthBody);
        }
    }

    /// Warns if the segment that begins here continues one of another width, and if that can be seen. Behind a branch
    /// a stem may be a little narrower, as plants are, and an organ on the axis hides the step.
    pub(super) fn check_step(&mut self, before: usize, material: MaterialId, node: Node) {
        /// Ratio of widths, and step in units of the accuracy (two pixels of a thousand), from which a step is noticed.
        const RATIO: f64 = 1.15;
        const RATIO_AT_BRANCH: f64 = 1.3;
        const VISIBLE: f64 = 4.0;
        let segment = &self.scene.segments[before];
        let (Width::Set(from), Width::Set(to)) = (segment.widths[1], self.state.width) else { return };
        let (thin, thick) = (from.min(to), from.max(to));
        let accuracy = self.scene.accuracy;
        let ratio = match node {
            Node::Bare => RATIO,
            Node::Branch => RATIO_AT_BRANCH,
            Node::Organ => return,
        };
        let is_step = thin > 0.0 && thick > ratio * thin && segment.material == material;
        let seen = is_step && accuracy > 0.0 && thick - thin > VISIBLE * accuracy;
        self.scene.lacked_accuracy |= is_step && accuracy <= 0.0 && self.state.set_by.is_some();
        // A drawing that sets the width more than once is a shape with steps.
        let shaped = |inside: Option<(usize, KindId)>| {
            let Some((index, _)) = inside else { return false };
            let sets = |kind: &KindId| self.model.kinds.get(*kind).base() == "!";
            self.model.interpretations[index].drawn.kinds().filter(sets).count() > 1
        };
        if let Some((inside, drawn)) = self.state.set_by.filter(|_| seen)
            && !shaped(inside)
            && self.remarks.steps_are_new(inside, drawn.kind)
        {
            let span = error::place(self.model, drawn.kind, drawn.lineage, inside);
            let remark = Remark::Step(from, to);
            self.scene.warnings.extend(self.remarks.add(remark, self.model, span, self.time));
        }
    }
}
