// The player: time, controls, keys and pointers.

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8];
// Seconds that a whole recording takes at speed 1: as long as its frames at 30 a second, but not too short or long.
const SHORTEST = 6;
const LONGEST = 30;

// What is drawn while something moves: how far patches may be from their surfaces (pixels), and the pixels of the canvas for each
// of the page. A slow machine gets as much as it draws in time.
const QUALITIES = [[0.35, 1], [0.7, 1], [1.2, 1], [2, 1], [3, 1], [3, 0.7], [3, 0.5]];
// Milliseconds between two pictures above which there is to be less, and below which there may be more.
const SLOW = 27;
const FAST = 18;
// Milliseconds after which what stands still is drawn as well as can be.
const STILL = 250;

class Player {
  constructor(recording) {
    this.recording = recording;
    const { times } = recording;
    [this.from, this.to] = [times[0], times[times.length - 1]];
    this.pace = (this.to - this.from) / Math.min(LONGEST, Math.max(SHORTEST, times.length / 30));
    this.time = this.from;
    this.playing = false;
    this.loops = true;
    this.speed = 1;
    this.elements = Object.fromEntries([...document.querySelectorAll("[id]")].map((element) => [element.id, element]));
    const { extent, size } = recording;
    const ground = reachOfGround(recording);
    this.camera = new Camera(
      size.map((side) => side * extent),
      outermost(recording),
      recording.floor === null ? ground : Math.max(ground, 1.5 * FAR_AWAY * extent),
    );
    if (recording.camera) this.camera.stand(recording.camera);
    this.painter = new Painter(this.elements.plant, recording, this.camera.points, ground);
    this.moments = [...new Set(recording.events.map(([time]) => time))];
    this.describe();
    this.listen();
    new ResizeObserver(() => this.resize()).observe(this.elements.plant);
    this.stale = true;
    this.quality = 0;
    // Milliseconds between pictures, and pictures since the quality has changed.
    [this.interval, this.since] = [16, 0];
    this.step = this.step.bind(this);
    requestAnimationFrame(this.step);
  }

  // ---- What does not change.

  describe() {
    const { recording, elements } = this;
    const { sky } = recording.light ?? {};
    // The title stands before the zenith.
    document.body.classList.toggle("night", Boolean(sky) && channelsOf(sky[0]).reduce((sum, c) => sum + c) < 1.4);
    const empty = recording.tracks.length === 0 && !recording.clouds;
    elements.notice.hidden = !empty;
    elements.notice.style.display = empty ? "" : "none";
    elements.notice.textContent = "Nothing is drawn in this recording: the turtle knows none of its modules, nor does an “interpret” rule say what they look like.";
    elements.origin.textContent = recording.source;
    elements.time.min = this.from;
    elements.time.max = this.to;
    const list = elements.parameters.querySelector("dl");
    for (const { name, value, range } of recording.parameters) {
      list.append(element("dt", name), element("dd", range ? `${value}  (${range[0]} to ${range[1]})` : `${value}`));
    }
    elements.parameters.hidden = recording.parameters.length === 0;
    elements.parameters.style.display = recording.parameters.length ? "" : "none";
    elements.events.querySelector("h2 span").textContent = recording.productions.toLocaleString("en");
    const events = elements.events.querySelector("ol");
    this.rows = recording.events.map(([time, module, times, line]) => {
      const row = element("button");
      row.append(element("span", shown(time)), element("span", times > 1 ? `${times} × ${module}` : module), element("span", `line ${line}`));
      row.title = `t = ${time}: ${module}, line ${line} of the model`;
      row.addEventListener("click", () => this.seek(time));
      const item = element("li");
      item.append(row);
      events.append(item);
      return row;
    });
    if (recording.leftOut) events.append(element("li", `… and ${recording.leftOut.toLocaleString("en")} more`));
    for (const speed of SPEEDS) {
      const option = element("option", `${speed} ×`);
      option.value = speed;
      option.selected = speed === 1;
      elements.speed.append(option);
    }
  }

  // Module counts over time, and productions as ticks.
  graph() {
    const { graph } = this.elements;
    const ratio = devicePixelRatio || 1;
    const [width, height] = [graph.clientWidth, graph.clientHeight];
    graph.width = width * ratio;
    graph.height = height * ratio;
    const pen = graph.getContext("2d");
    pen.scale(ratio, ratio);
    const { times, modules } = this.recording;
    const x = (time) => (this.to > this.from ? ((time - this.from) / (this.to - this.from)) * (width - 3) + 1.5 : 1.5);
    const ticks = 6;
    pen.fillStyle = "#e8f0df";
    pen.strokeStyle = "#b7cfa3";
    const most = Math.max(1, ...[0, 1].map((i) => modules.reduce((a, b) => Math.max(a, b), i)));
    const y = (count) => height - ticks - (count / most) * (height - ticks - 2);
    pen.beginPath();
    pen.moveTo(x(times[0]), y(0));
    times.forEach((time, i) => {
      if (i) pen.lineTo(x(time), y(modules[i - 1]));
      pen.lineTo(x(time), y(modules[i]));
    });
    pen.lineTo(x(times[times.length - 1]), y(0));
    pen.fill();
    pen.stroke();
    pen.fillStyle = "#41702c";
    let last = -1;
    for (const moment of this.moments) {
      const place = Math.round(x(moment));
      if (place === last || moment < this.from) continue;
      last = place;
      pen.globalAlpha = 0.55;
      pen.fillRect(place, height - ticks + 1, 1, ticks - 1);
    }
  }

  // ---- Time.

  // Goes to a time.
  seek(time) {
    this.time = Math.max(this.from, Math.min(this.to, time));
    this.stale = true;
  }

  play(on = true) {
    if (on && this.time >= this.to) this.time = this.from;
    this.playing = on && this.to > this.from;
    this.last = undefined;
    this.elements.play.classList.toggle("playing", this.playing);
    this.elements.play.setAttribute("aria-label", this.playing ? "Pause" : "Play");
  }

  frames(count) {
    const { times } = this.recording;
    const frame = frameOf(times, this.time) + count;
    const whole = count > 0 ? Math.floor(frame + 1e-6) : Math.ceil(frame - 1e-6);
    this.play(false);
    this.seek(times[Math.max(0, Math.min(times.length - 1, whole))]);
  }

  // To the production before (-1) or after (1).
  production(direction) {
    const beyond = this.moments.filter((moment) => (moment - this.time) * direction > 1e-12 * Math.abs(this.time));
    this.play(false);
    if (beyond.length) this.seek(direction > 0 ? beyond[0] : beyond[beyond.length - 1]);
  }

  setSpeed(speed) {
    this.speed = speed;
    this.elements.speed.value = speed;
  }

  toggle(name) {
    const { elements } = this;
    const on = elements[name].getAttribute("aria-pressed") !== "true";
    elements[name].setAttribute("aria-pressed", on);
    if (name === "loop") this.loops = on;
    if (name === "perspective") this.camera.perspective = on;
    if (name === "info") elements.panel.hidden = !on;
    this.stale = true;
  }

  look(azimuth, elevation) {
    this.camera.look(azimuth, elevation);
    this.stale = true;
  }

  // Looks through the declared camera, if there is one.
  stand() {
    if (this.recording.camera) this.camera.stand(this.recording.camera);
    this.stale = true;
  }

  // Once for every picture of the screen.
  step(now) {
    requestAnimationFrame(this.step);
    if (this.playing) {
      // After a pause, as in a hidden tab, nothing is made up for.
      const seconds = this.last === undefined ? 0 : Math.min(0.25, (now - this.last) / 1000);
      this.last = now;
      let time = this.time + seconds * this.speed * this.pace;
      if (time >= this.to) {
        time = this.loops ? this.from + ((time - this.from) % (this.to - this.from)) : this.to;
        if (!this.loops) this.play(false);
      }
      this.seek(time);
    }
    if (this.stale) {
      this.measure(now);
      this.moved = now;
      this.stale = this.sharp = false;
      this.paint();
    } else if (!this.sharp && now - this.moved > STILL) {
      this.sharp = true;
      this.paint();
    }
  }

  // Learns how fast this machine is.
  measure(now) {
    const passed = now - this.moved;
    // The first picture after a rest says nothing.
    if (!(passed < STILL) || this.sharp) return;
    this.interval += (passed - this.interval) * 0.25;
    this.since++;
    if (this.interval > SLOW && this.since > 5 && this.quality < QUALITIES.length - 1) {
      this.quality++;
      this.since = 0;
    } else if (this.interval < FAST && this.since > 90 && this.quality > 0) {
      this.quality--;
      this.since = 0;
    }
  }

  // Gives the canvas the pixels that it is to have; returns how far patches may be from their surfaces, in pixels.
  prepare() {
    const { plant } = this.elements;
    const screen = Math.min(2, devicePixelRatio || 1);
    let [slack, ratio] = [QUALITIES[0][0], this.painter.software ? 2 : 1];
    if (!this.sharp) [slack, ratio] = QUALITIES[this.quality];
    const sides = [plant.clientWidth, plant.clientHeight].map((side) => Math.max(1, Math.round(side * screen * ratio)));
    // Setting them empties the canvas.
    if (plant.width !== sides[0]) plant.width = sides[0];
    if (plant.height !== sides[1]) plant.height = sides[1];
    return slack;
  }

  paint() {
    const { recording, elements, time } = this;
    const frame = frameOf(recording.times, time);
    const slack = this.prepare();
    const { width, height } = elements.plant;
    const detail = height / (2 * this.camera.reach(width / height)) / slack;
    if (frame !== this.staged || detail !== this.detail) {
      this.painter.stage(frame, detail);
      [this.staged, this.detail] = [frame, detail];
    }
    this.painter.paint(this.camera, width, height, this.sharp);
    elements.time.value = time;
    elements.clock.textContent = `t = ${shown(time)}`;
    const count = recording.modules[Math.floor(frame)];
    elements.count.textContent = `${count.toLocaleString("en")} module${count === 1 ? "" : "s"}`;
    if (!elements.panel.hidden) this.showEvents();
  }

  showEvents() {
    const { events } = this.recording;
    let past = 0;
    while (past < events.length && events[past][0] <= this.time) past++;
    if (past === this.past) return;
    const before = this.past ?? 0;
    for (let i = Math.min(before, past); i < Math.max(before, past); i++) this.rows[i].classList.toggle("past", i < past);
    this.rows[before - 1]?.classList.remove("now");
    this.rows[past - 1]?.classList.add("now");
    const row = this.rows[Math.max(0, past - 1)];
    if (row) {
      const list = this.elements.events.querySelector("ol");
      list.scrollTop = row.offsetTop - list.offsetTop - list.clientHeight / 2;
    }
    this.past = past;
  }

  resize() {
    this.graph();
    this.stale = true;
  }

  // ---- Hands.

  listen() {
    const { elements } = this;
    elements.play.addEventListener("click", () => this.play(!this.playing));
    for (const name of ["loop", "perspective", "info"]) elements[name].addEventListener("click", () => this.toggle(name));
    elements.front.addEventListener("click", () => this.look(0, 0));
    elements.side.addEventListener("click", () => this.look(90, 0));
    elements.top.addEventListener("click", () => this.look(0, 90));
    elements.speed.addEventListener("change", () => this.setSpeed(Number(elements.speed.value)));
    elements.time.addEventListener("input", () => {
      this.play(false);
      this.seek(Number(elements.time.value));
    });
    document.addEventListener("keydown", (event) => this.key(event));
    this.pointers = new Map();
    const { plant } = elements;
    plant.addEventListener("pointerdown", (event) => {
      plant.setPointerCapture(event.pointerId);
      plant.classList.add("held");
      this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    plant.addEventListener("pointermove", (event) => this.drag(event));
    for (const name of ["pointerup", "pointercancel"]) {
      plant.addEventListener(name, (event) => {
        this.pointers.delete(event.pointerId);
        if (!this.pointers.size) plant.classList.remove("held");
      });
    }
    plant.addEventListener("contextmenu", (event) => event.preventDefault());
    plant.addEventListener("dblclick", () => this.look(this.camera.azimuth, this.camera.elevation));
    plant.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        const lines = event.deltaMode === 1 ? 16 : 1;
        this.magnify(Math.exp(-event.deltaY * lines * 0.0015), event.clientX, event.clientY);
      },
      { passive: false },
    );
  }

  aspect() {
    const { plant } = this.elements;
    return plant.clientWidth / Math.max(1, plant.clientHeight);
  }

  magnify(factor, clientX, clientY) {
    const { left, top, width, height } = this.elements.plant.getBoundingClientRect();
    const [x, y] = [(clientX - left - width / 2) / height, (top + height / 2 - clientY) / height];
    this.camera.magnify(factor, x, y, this.aspect());
    this.stale = true;
  }

  drag(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY];
    this.pointers.set(event.pointerId, now);
    const [x, y] = [now[0] - before[0], now[1] - before[1]];
    const height = this.elements.plant.clientHeight;
    if (this.pointers.size === 2) {
      // Two fingers: size by their distance, place by their middle.
      const other = [...this.pointers].find(([id]) => id !== event.pointerId)[1];
      const distance = ([a, b]) => Math.hypot(a - other[0], b - other[1]) || 1;
      this.camera.pan(x / 2 / height, -y / 2 / height, this.aspect());
      this.magnify(distance(now) / distance(before), (now[0] + other[0]) / 2, (now[1] + other[1]) / 2);
    } else if (event.shiftKey || event.buttons & 6) {
      this.camera.pan(x / height, -y / height, this.aspect());
    } else {
      this.camera.orbit((x * 250) / height, (y * 180) / height);
    }
    this.stale = true;
  }

  key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const { target } = event;
    const chooses = target.tagName === "SELECT";
    const middle = () => {
      const { left, top, width, height } = this.elements.plant.getBoundingClientRect();
      return [left + width / 2, top + height / 2];
    };
    const speeds = SPEEDS;
    const faster = (by) => this.setSpeed(speeds[Math.max(0, Math.min(speeds.length - 1, speeds.indexOf(this.speed) + by))]);
    const turn = (right, up) => {
      this.camera.orbit(right, up);
      this.stale = true;
    };
    const actions = {
      " ": () => this.play(!this.playing),
      ArrowLeft: () => this.frames(event.shiftKey ? -10 : -1),
      ArrowRight: () => this.frames(event.shiftKey ? 10 : 1),
      "[": () => this.production(-1),
      "]": () => this.production(1),
      Home: () => this.seek(this.from),
      End: () => this.seek(this.to),
      "-": () => faster(-1),
      "+": () => faster(1),
      "=": () => faster(1),
      l: () => this.toggle("loop"),
      p: () => this.toggle("perspective"),
      i: () => this.toggle("info"),
      "?": () => this.toggle("info"),
      a: () => turn(-5, 0),
      d: () => turn(5, 0),
      w: () => turn(0, 5),
      s: () => turn(0, -5),
      q: () => this.magnify(1 / 1.15, ...middle()),
      e: () => this.magnify(1.15, ...middle()),
      1: () => this.look(0, 0),
      2: () => this.look(90, 0),
      3: () => this.look(0, 90),
      0: () => this.look(this.camera.azimuth, this.camera.elevation),
      c: () => this.stand(),
    };
    const action = actions[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    // A list of choices has its own keys, and so has a button that was reached by the keyboard.
    if (!action || chooses || (event.key === " " && target.tagName === "BUTTON")) return;
    event.preventDefault();
    action();
  }
}

function element(name, text) {
  const made = document.createElement(name);
  if (text !== undefined) made.textContent = text;
  return made;
}

// A time, for people.
function shown(time) {
  return Math.abs(time) >= 1000 ? time.toFixed(1) : time.toFixed(3);
}

(async () => {
  const part = (id) => document.getElementById(id).textContent;
  try {
    const recording = JSON.parse(part("description"));
    recording.tracks = decodeTracks(await inflated(part("tracks")), recording.unit);
    if (recording.clouds) recording.clouds = new Clouds(await inflated(recording.clouds), recording.times.length, recording.puffUnit);
    // For whoever wants to steer it from outside: dlsys.seek(2), dlsys.play(), dlsys.look(30, 20).
    const player = new Player(recording);
    await player.painter.unpack();
    player.stale = true;
    window.dlsys = player;
    player.play();
  } catch (error) {
    document.getElementById("notice").textContent = `The plant cannot be shown: ${error.message}.`;
    console.error(error);
  }
})();
