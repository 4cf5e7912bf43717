//! The calendar queue: the events of lazy modules, in order of time.
//!
//! An entry is 12 bytes: the time as a float, and the slot. Instants to all their digits are computed again for those
//! that come first (`Schedule::peek`), so entries of one float are one bundle here, and the order within it is decided there. A lazy module
//! does not change until its event, so no entry is ever taken back.

use std::collections::VecDeque;

use super::sort_by_time;

/// An entry's slot has this bit if it is the number of a run; a tree has no such slots.
const RUN: u32 = 1 << 31;
/// Children of an entry in the heap: four lie in one line of the cache.
const ARITY: usize = 4;
/// A part of the heap of this size or less is taken out, or put in, entry by entry.
const FEW: usize = 32;
/// A heap that can hold no more than this keeps its memory.
const LARGE: usize = 1 << 16;
/// Lines beside the heap.
const LINES: usize = 4;
/// Times that are remembered, so that equal ones meet.
const RECENT: usize = 16;
const NOWHERE: u32 = u32::MAX;

/// The time in halves, so that four bytes less are needed.
#[derive(Clone, Copy, Debug)]
struct CalendarEntry {
    high: u32,
    low: u32,
    slot: u32,
}

impl CalendarEntry {
    #[inline]
    fn new(time: f64, slot: u32) -> CalendarEntry {
        let bits = time.to_bits();
        CalendarEntry { high: (bits >> 32) as u32, low: bits as u32, slot }
    }

    #[inline]
    fn time(self) -> f64 {
        f64::from_bits(u64::from(self.high) << 32 | u64::from(self.low))
    }
}

/// Events in order, in which many of one time are one entry: a thousand cells that divide together cost one place in
/// the order, and one push each.
///
/// A new entry is mostly later than all before it of its kind: newborns that live as long as each other. Such events
/// wait in a few lines, first in, first out; the heap is for entries out of turn. A line is read and written in the
/// order of memory, a heap of a million events at ten places for each.
#[derive(Clone, Debug)]
pub struct CalendarQueue {
    lines: [VecDeque<CalendarEntry>; LINES],
    /// The last time of each line.
    ends: [f64; LINES],
    heap: Vec<CalendarEntry>,
    /// The first place of the heap is empty: most events are followed by a later one, which is put there.
    hole: bool,
    /// The entries of the heap are in no order: a good part of them was taken out or put in at once.
    loose: bool,
    runs: Vec<Vec<u32>>,
    free_runs: Vec<u32>,
    /// Times lately put in, by a hash, with their runs.
    recent: [(u64, u32); RECENT],
    /// The earliest entry and the line where it stands (none for the heap), once it has been found.
    first: Option<(CalendarEntry, Option<usize>)>,
}

impl Default for CalendarQueue {
    fn default() -> CalendarQueue {
        CalendarQueue {
            lines: Default::default(),
            ends: [f64::NEG_INFINITY; LINES],
            heap: Vec::new(),
            hole: false,
            loose: false,
            runs: Vec::new(),
            free_runs: Vec::new(),
            recent: [(u64::MAX, NOWHERE); RECENT],
            first: None,
        }
    }
}

fn recent_place(time: f64) -> usize {
    (time.to_bits().wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 60) as usize
}

impl CalendarQueue {
    /// Puts in an event. The time is a number.
    pub fn push(&mut self, time: f64, slot: u32) {
        let recent = &mut self.recent[recent_place(time)];
        if recent.0 != time.to_bits() {
            *recent = (time.to_bits(), NOWHERE);
            return self.push_entry(time, slot);
        }
        if recent.1 == NOWHERE {
            let run = self.free_runs.pop().unwrap_or(self.runs.len() as u32);
            if run as usize == self.runs.len() {
                self.runs.push(Vec::new());
            }
            recent.1 = run;
            self.push_entry(time, run | RUN);
        }
        let run = self.recent[recent_place(time)].1;
        self.runs[run as usize].push(slot);
    }

    /// The earliest time.
    #[inline]
    pub fn earliest(&mut self) -> Option<f64> {
        self.first().map(|(entry, _)| entry.time())
    }

    /// The slot of which the earliest event is, unless it is many.
    pub fn earliest_slot(&mut self) -> Option<u32> {
        self.first().map(|(entry, _)| entry.slot).filter(|slot| slot & RUN == 0)
    }

    #[inline]
    fn first(&mut self) -> Option<(CalendarEntry, Option<usize>)> {
        if self.first.is_none() {
            self.settle();
            self.first = self.find_first();
        }
        self.first
    }

    fn find_first(&self) -> Option<(CalendarEntry, Option<usize>)> {
        let mut first = self.first_of_heap().map(|entry| (entry, None));
        for (line, entries) in self.lines.iter().enumerate() {
            if let Some(&entry) = entries.front()
                && first.is_none_or(|(other, _)| entry.time() < other.time())
            {
                first = Some((entry, Some(line)));
            }
        }
        first
    }

    fn first_of_heap(&self) -> Option<CalendarEntry> {
        if !self.hole {
            return self.heap.first().copied();
        }
        let children = self.heap.get(1..self.heap.len().min(ARITY + 1))?;
        children.iter().copied().reduce(|a, b| if b.time() < a.time() { b } else { a })
    }

    /// Takes out everything of the earliest time.
    pub fn pop(&mut self, out: &mut Vec<u32>) {
        let Some(time) = self.earliest() else { return };
        while let Some((_, line)) = self.first().filter(|(entry, _)| entry.time() == time) {
            let Some(CalendarEntry { slot, .. }) = (match line {
                Some(line) => self.pop_line(line),
                None => self.pop_heap(),
            }) else {
                return;
            };
            self.first = None;
            if slot & RUN == 0 {
                out.push(slot);
                continue;
            }
            let run = self.end_run(time, slot);
            match out.is_empty() {
                true => std::mem::swap(out, run),
                false => out.append(run),
            }
        }
    }

    /// The slots of an entry that has been taken out and is many; to be emptied.
    fn end_run(&mut self, time: f64, slot: u32) -> &mut Vec<u32> {
        let number = slot & !RUN;
        let recent = &mut self.recent[recent_place(time)];
        if recent.1 == number {
            recent.1 = NOWHERE;
        }
        self.free_runs.push(number);
        &mut self.runs[number as usize]
    }

    /// Number of entries.
    pub fn len(&self) -> usize {
        self.heap.len() + self.lines.iter().map(VecDeque::len).sum::<usize>()
    }

    /// Number of events before a time, counted up to a number at least.
    pub fn count_before(&mut self, time: f64, enough: usize) -> usize {
        self.settle();
        let events = |entry: &CalendarEntry| match entry.slot & RUN {
            0 => 1,
            _ => self.runs[(entry.slot & !RUN) as usize].len(),
        };
        let is_before = |entry: &&CalendarEntry| entry.time() < time;
        let in_lines = self.lines.iter().flat_map(|line| line.iter().take_while(is_before).take(enough));
        let mut count = in_lines.map(events).sum();
        // Below an entry of the heap there is none before it.
        let mut open = vec![0];
        while let Some(at) = open.pop()
            && count < enough
        {
            if let Some(entry) = self.heap.get(at).filter(is_before) {
                count += events(entry);
                open.extend(ARITY * at + 1..=ARITY * at + ARITY);
            }
        }
        count
    }

    /// Takes out all events before a time, in any order.
    pub fn take_before(&mut self, time: f64, out: &mut Vec<(f64, u32)>) {
        self.settle();
        self.first = None;
        let mut taken = Vec::new();
        for (line, end) in self.lines.iter_mut().zip(&mut self.ends) {
            while let Some(&entry) = line.front()
                && entry.time() < time
            {
                line.pop_front();
                taken.push(entry);
            }
            if line.is_empty() {
                *end = f64::NEG_INFINITY;
            }
        }
        // One by one, as long as these are few of all.
        let few = self.heap.len() / FEW;
        for _ in 0..few {
            match self.heap.first() {
                Some(&first) if first.time() < time => taken.push(first),
                _ => break,
            }
            self.hole = true;
            self.fill_hole();
        }
        if self.heap.first().is_some_and(|first| first.time() < time) {
            let is_taken = |entry: &mut CalendarEntry| entry.time() < time;
            taken.extend(self.heap.extract_if(.., is_taken));
            self.loose = true;
        }
        for entry in taken {
            let time = entry.time();
            match entry.slot & RUN {
                0 => out.push((time, entry.slot)),
                _ => out.extend(self.end_run(time, entry.slot).drain(..).map(|slot| (time, slot))),
            }
        }
    }

    /// Puts in many events.
    pub fn push_all(&mut self, mut entries: Vec<(f64, u32)>) {
        // Where newborns are alike, their events come in this order, and wait in lines.
        sort_by_time(&mut entries, |(time, _)| *time, |a, b| a.0.total_cmp(&b.0));
        self.loose |= entries.len() > self.heap.len() / FEW;
        if self.loose {
            self.fill_hole();
            self.first = None;
        }
        for (time, slot) in entries {
            self.push(time, slot);
        }
    }

    /// Makes a heap of the entries in it (Floyd 1964), if they are not one.
    fn settle(&mut self) {
        self.fill_hole();
        if !std::mem::take(&mut self.loose) {
            return;
        }
        for at in (0..self.heap.len().div_ceil(ARITY)).rev() {
            let entry = self.heap[at];
            self.sift_down_from(at, entry);
        }
    }

    fn push_entry(&mut self, time: f64, slot: u32) {
        let entry = CalendarEntry::new(time, slot);
        // The line that it fits best: the others stay free for earlier entries.
        let mut line = None;
        for (i, end) in self.ends.iter().enumerate() {
            if *end <= time && line.is_none_or(|other: usize| *end > self.ends[other]) {
                line = Some(i);
            }
        }
        if self.first.is_some_and(|(first, _)| time < first.time()) {
            self.first = Some((entry, line));
        }
        if let Some(line) = line {
            self.ends[line] = time;
            return self.lines[line].push_back(entry);
        }
        if self.loose {
            return self.heap.push(entry);
        }
        if self.hole {
            self.hole = false;
            return self.sift_down(entry);
        }
        let mut at = self.heap.len();
        self.heap.push(entry);
        while at > 0 {
            let above = (at - 1) / ARITY;
            if self.heap[above].time() <= time {
                break;
            }
            self.heap[at] = self.heap[above];
            at = above;
        }
        self.heap[at] = entry;
    }

    fn pop_line(&mut self, line: usize) -> Option<CalendarEntry> {
        let entry = self.lines[line].pop_front();
        if self.lines[line].is_empty() {
            self.ends[line] = f64::NEG_INFINITY;
        }
        entry
    }

    fn pop_heap(&mut self) -> Option<CalendarEntry> {
        self.fill_hole();
        self.hole = !self.heap.is_empty();
        self.heap.first().copied()
    }

    fn fill_hole(&mut self) {
        if std::mem::take(&mut self.hole)
            && let Some(last) = self.heap.pop()
            && !self.heap.is_empty()
        {
            self.sift_down(last);
        }
        // Entries that go from the heap into lines are not paid for twice.
        if self.heap.capacity() > LARGE && self.heap.len() < self.heap.capacity() / 2 {
            self.heap.shrink_to(self.heap.len() + self.heap.len() / 4);
        }
    }

    /// Puts an entry into the first place, and sets the heap in order.
    fn sift_down(&mut self, entry: CalendarEntry) {
        self.sift_down_from(0, entry);
    }

    /// Puts an entry into a place below which all is in order.
    #[inline]
    fn sift_down_from(&mut self, mut at: usize, entry: CalendarEntry) {
        let heap = &mut self.heap[..];
        let wanted = entry.time();
        loop {
            let first = ARITY * at + 1;
            let Some(children) = heap.get(first..(first + ARITY).min(heap.len())) else { break };
            let mut least = 0;
            let Some(mut time) = children.first().map(|child| child.time()) else { break };
            for (i, child) in children.iter().enumerate().skip(1) {
                let its = child.time();
                if its < time {
                    (least, time) = (i, its);
                }
            }
            if time >= wanted {
                break;
            }
            heap[at] = children[least];
            at = first + least;
        }
        heap[at] = entry;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Against a sorted list; few different times, so that many meet.
        #[test]
        fn bundles_come_in_order(steps in proptest::collection::vec((0..7u8, 0..40u32), 0..300)) {
            let mut queue = CalendarQueue::default();
            let mut list: Vec<(u32, u32)> = Vec::new();
            for (slot, (what, time)) in (0..).zip(steps) {
                if what == 5 {
                    let before = |e: &(u32, u32)| e.0 < time;
                    let mut wanted: Vec<(f64, u32)> =
                        list.iter().filter(|e| before(e)).map(|e| (f64::from(e.0), e.1)).collect();
                    let enough = 3;
                    let count = queue.count_before(f64::from(time), enough);
                    prop_assert!(count == wanted.len() || count >= enough && wanted.len() >= enough);
                    let mut found = Vec::new();
                    queue.take_before(f64::from(time), &mut found);
                    found.sort_unstable_by(|a, b| a.partial_cmp(b).expect("numbers"));
                    wanted.sort_unstable_by(|a, b| a.partial_cmp(b).expect("numbers"));
                    prop_assert_eq!(found, wanted);
                    list.retain(|e| !before(e));
                } else if what == 0 {
                    let mut out = Vec::new();
                    queue.pop(&mut out);
                    let mut found = out;
                    found.sort_unstable();
                    let first = list.iter().map(|e| e.0).min();
                    let mut wanted: Vec<u32> = list.iter().filter(|e| Some(e.0) == first).map(|e| e.1).collect();
                    wanted.sort_unstable();
                    prop_assert_eq!(found, wanted);
                    list.retain(|e| Some(e.0) != first);
                } else if what == 6 {
                    // In no order, and some at one time.
                    let new: Vec<(u32, u32)> = (0..time).map(|k| ((7 * k + time) % 23 + k % 2, slot + 1000 * k)).collect();
                    queue.push_all(new.iter().map(|(time, slot)| (f64::from(*time), *slot)).collect());
                    list.extend(new);
                } else {
                    queue.push(f64::from(time), slot);
                    list.push((time, slot));
                }
                // Not always: looking for the first puts the heap in order.
                if slot.is_multiple_of(3) {
                    continue;
                }
                prop_assert_eq!(queue.earliest(), list.iter().map(|e| f64::from(e.0)).reduce(f64::min));
            }
        }
    }
}
