// Curves over time: one window of time for all figures of a chapter, a cursor that tells values, folded
// chapters that open where they are asked for. The curves are those of the SVG; without this they stand still.
"use strict";
const NS = "http://www.w3.org/2000/svg";
const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
const made = (parent, kind, attributes = {}) => {
  const element = parent.appendChild(document.createElementNS(NS, kind));
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  return element;
};

/** About `n` round numbers from `low` to `high`, with the text of each. */
function ticks(low, high, n) {
  const power = 10 ** Math.floor(Math.log10((high - low) / n));
  const step = [1, 2, 5, 10].find((k) => k * power * n >= high - low) * power;
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const text = (value) => (digits > 4 ? Number(value.toPrecision(4)).toExponential() : value.toFixed(digits));
  return Array.from({ length: n + 2 }, (_, k) => (Math.ceil(low / step - 1e-9) + k) * step)
    .filter((value) => value <= high + 1e-9 * step)
    .map((value) => [value, text(Math.abs(value) < 1e-9 * step ? 0 : value).replace("-", "−")]);
}

/** One axes of a figure; `told` is its box [points], the ranges of both axes, the unit and what its curves are. */
class Plot {
  constructor(group, told) {
    Object.assign(this, told, { group });
    [this.left, this.top, this.right, this.bottom] = told.box;
    this.drawn = [...group.querySelectorAll("path[clip-path]")].filter((path) => !path.closest(".tick"));
    for (const path of this.drawn) { // the clip stays where it is while the path moves
      const clip = made(path.parentNode, "g", { "clip-path": path.getAttribute("clip-path") });
      path.removeAttribute("clip-path");
      path.setAttribute("vector-effect", "non-scaling-stroke");
      clip.append(path);
    }
    group.classList.toggle("log", this.log);
    this.marks = [...group.querySelectorAll("[data-part=event]")].map((mark) => [mark, mark.getBBox().x]);
    this.own = made(group, "g");
    group.prepend(this.own);
    this.cursor = made(group, "line", { class: "cursor", y1: this.top, y2: this.bottom, visibility: "hidden" });
    this.shown = this.x;
  }

  /** Of each curve its label, path and points x0, y0, x1, ...; read when first needed: a page has many. */
  get curves() {
    const paths = [...this.group.querySelectorAll("[data-part=curve] path[style*=stroke]")];
    const points = (path) => path.getAttribute("d").match(/[-\d.]+/g).map(Number);
    return (this.read ??= paths.map((path, k) => ({ label: this.labels[k], path, points: points(path) })));
  }

  /** Where a time is in the figure [points], and back. */
  at(time, [from, to] = this.shown) { return this.left + ((time - from) / (to - from)) * (this.right - this.left); }
  time(x, [from, to] = this.shown) { return from + ((x - this.left) / (this.right - this.left)) * (to - from); }

  /** Height of a curve [points] where the unzoomed figure has `x`; none where it has no sample. */
  height(points, x) {
    let [low, high] = [0, points.length / 2 - 1];
    if (!(points[0] <= x && x <= points[2 * high])) return undefined;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (points[2 * middle] <= x) low = middle; else high = middle;
    }
    const [x0, y0, x1, y1] = points.slice(2 * low, 2 * low + 4);
    return x1 > x0 ? y0 + ((y1 - y0) * (x - x0)) / (x1 - x0) : y1;
  }

  /** What a height stands for, with the digits that the figure resolves. */
  value(y) {
    const [low, high] = this.log ? this.y.map(Math.log10) : this.y;
    const share = (this.bottom - y) / (this.bottom - this.top);
    if (this.log) return share < 0 ? `< ${this.y[0]}` : Number((10 ** (low + share * (high - low))).toPrecision(3)).toString();
    return (low + share * (high - low)).toFixed(clamp(Math.ceil(-Math.log10((high - low) / 5000)), 0, 15));
  }

  show(window) {
    const zoomed = window[0] > this.x[0] || window[1] < this.x[1];
    this.shown = zoomed ? window : this.x;
    const [from, to] = [this.at(window[0], this.x), this.at(window[1], this.x)];
    const k = (this.right - this.left) / (to - from);
    const [high, low] = zoomed && !this.log ? this.extent(from, to) : [this.top, this.bottom];
    const q = (this.bottom - this.top) / (low - high);
    const matrix = [k, 0, 0, q, this.left - k * from, this.top - q * high];
    for (const path of this.drawn) path.setAttribute("transform", `matrix(${matrix})`);
    for (const [mark, x] of this.marks) {
      const moved = k * x + matrix[4];
      mark.setAttribute("transform", `translate(${moved - x})`);
      mark.style.display = moved >= this.left && moved < this.right ? "" : "none";
    }
    this.group.classList.toggle("zoomed", zoomed);
    this.own.replaceChildren();
    if (!zoomed) return;
    const [a, b] = this.y, scale = (b - a) / (this.bottom - this.top);
    for (const [time, text] of ticks(...window, 8)) {
      const x = this.at(time);
      this.tick("x", text, { x1: x, x2: x, y1: this.top, y2: this.bottom }, { x });
    }
    if (this.log) return; // whose height is not touched
    for (const [value, text] of ticks(b - (low - this.top) * scale, b - (high - this.top) * scale, 4)) {
      const y = this.top + ((b - value) / scale + this.top - high) * q;
      this.tick("y", text, { x1: this.left, x2: this.right, y1: y, y2: y }, { y: y + 3 });
    }
  }

  /** The range of heights that the curves take between two places, with a margin. */
  extent(from, to) {
    let [high, low] = [Infinity, -Infinity];
    for (const { points } of this.curves) {
      const heights = [from, to].map((x) => this.height(points, x)).filter((y) => y !== undefined);
      for (let i = 0; i < points.length; i += 2) if (points[i] >= from && points[i] <= to) heights.push(points[i + 1]);
      for (const y of heights) [high, low] = [Math.min(high, y), Math.max(low, y)];
    }
    if (high > low) return [this.top, this.bottom];
    const least = (this.bottom - this.top) / 400, margin = Math.max(0.06 * (low - high), least);
    return [high - margin, low + margin];
  }

  /** A grid line and, where the axis has texts, one like them. */
  tick(axis, text, line, place) {
    const first = this.group.querySelector(`[data-part=${axis}] .tick`);
    made(this.own, "line", line).style.cssText = first.querySelector("path").style.cssText;
    const model = this.group.querySelector(`[data-part=${axis}] .tick text`);
    if (!model) return;
    const label = this.own.appendChild(model.cloneNode());
    label.removeAttribute("transform");
    for (const [name, value] of Object.entries(place)) label.setAttribute(name, value);
    label.textContent = text;
  }
}

/** Figures that share a window of time. */
class Chapter {
  constructor(drawings) {
    this.plots = drawings.flatMap((svg) => {
      const told = JSON.parse(svg.dataset.plots);
      svg.plots = told.map((each, k) => new Plot(svg.querySelector(`[data-part=axes${k}]`), each));
      return svg.plots;
    });
    this.home = [Math.min(...this.plots.map((plot) => plot.x[0])), Math.max(...this.plots.map((plot) => plot.x[1]))];
    this.window = this.home;
    for (const svg of drawings) this.listen(svg);
    const hint = document.createElement("p");
    hint.className = "note hint";
    hint.textContent = "Drag over a curve to enlarge that time in all figures of the chapter; Ctrl and wheel, two fingers " +
      "or + and − zoom too, arrows move the cursor. A double click, or Esc, shows everything.";
    drawings[0].closest(".figures").before(hint);
  }

  show(from, to) {
    const [low, high] = this.home, width = clamp(to - from, (high - low) / 2000, high - low);
    const start = clamp(from, low, high - width);
    this.window = [start, start + width];
    cancelAnimationFrame(this.frame);
    this.frame = requestAnimationFrame(() => this.plots.forEach((plot) => plot.show(this.window)));
  }

  zoom(time, factor) {
    this.show(...this.window.map((end) => time + (end - time) * factor));
  }

  point(time, plot, svg) {
    for (const each of this.plots) {
      const inside = time >= each.shown[0] && time <= each.shown[1];
      const x = each.at(time);
      each.cursor.setAttribute("visibility", inside ? "visible" : "hidden");
      if (inside) for (const end of ["x1", "x2"]) each.cursor.setAttribute(end, x);
    }
    this.time = time;
    const rows = new Map(); // of one colour and value: plants that agree have one row
    for (const { label, path, points } of plot.curves) {
      const y = plot.height(points, plot.at(time, plot.x)), { stroke } = getComputedStyle(path);
      if (y === undefined) continue;
      const text = `${plot.value(y)} ${plot.unit}`, key = stroke + text;
      rows.set(key, [stroke, rows.has(key) ? label.slice(0, label.lastIndexOf(",")) : label, text]);
    }
    tell(`${time.toFixed(3)} s`, rows.values(), svg, plot, time);
  }

  leave() {
    for (const plot of this.plots) plot.cursor.setAttribute("visibility", "hidden");
    values.hidden = true;
  }

  listen(svg) {
    const fingers = new Map();
    let start;
    const place = (event) => {
      const { x, y } = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
      const near = (plot) => Math.abs(y - (plot.top + plot.bottom) / 2);
      const plot = svg.plots.reduce((a, b) => (near(b) < near(a) ? b : a));
      return { plot, time: clamp(plot.time(x), ...plot.shown) };
    };
    const on = (kinds, act) => kinds.split(" ").forEach((kind) => svg.addEventListener(kind, act, { passive: false }));
    on("pointerdown", (event) => {
      const { time, plot } = place(event);
      fingers.set(event.pointerId, time);
      if (event.pointerType === "mouse" && event.button === 0) {
        svg.setPointerCapture(event.pointerId);
        start = { time, x: event.clientX, box: made(plot.group, "rect", { class: "chosen", y: plot.top, height: plot.bottom - plot.top }) };
      }
    });
    on("pointermove", (event) => {
      const { time, plot } = place(event);
      if (fingers.size === 2 && fingers.has(event.pointerId)) { // both stay over their times
        const [other] = [...fingers].filter(([id]) => id !== event.pointerId);
        const before = fingers.get(event.pointerId) - other[1], now = time - other[1];
        if (before * now > 0) this.zoom(other[1], clamp(before / now, 0.5, 2));
        return;
      }
      if (start) {
        const [a, b] = [start.time, time].map((each) => plot.at(each)).sort((p, q) => p - q);
        start.box.setAttribute("x", a);
        start.box.setAttribute("width", b - a);
      }
      this.point(time, plot, svg);
    });
    on("pointerup pointercancel", (event) => {
      fingers.delete(event.pointerId);
      if (start && event.type === "pointerup" && Math.abs(event.clientX - start.x) > 4) {
        this.show(...[start.time, place(event).time].sort((a, b) => a - b));
        this.leave();
      }
      start?.box.remove();
      start = undefined;
    });
    on("pointerleave blur", () => this.leave());
    on("dblclick", () => this.show(...this.home));
    on("wheel", (event) => {
      if (!event.ctrlKey && !event.metaKey) return; // which scrolls the page
      event.preventDefault();
      this.leave();
      this.zoom(place(event).time, Math.exp(clamp(event.deltaY, -200, 200) / 300));
    });
    svg.setAttribute("tabindex", 0);
    on("keydown", (event) => {
      const [from, to] = this.window, time = clamp(this.time ?? (from + to) / 2, from, to);
      const step = ((to - from) / 200) * (event.shiftKey ? 10 : 1);
      const acts = {
        "+": () => this.zoom(time, 0.5), "-": () => this.zoom(time, 2), Escape: () => this.show(...this.home),
        ArrowLeft: () => this.point(clamp(time - step, from, to), svg.plots[0], svg),
        ArrowRight: () => this.point(clamp(time + step, from, to), svg.plots[0], svg),
      };
      if (!acts[event.key] || event.ctrlKey || event.metaKey) return;
      event.preventDefault();
      acts[event.key]();
    });
  }
}

const values = document.body.appendChild(document.createElement("div"));
values.id = "values";
values.hidden = true;

/** The values at a time, beside the cursor. */
function tell(title, rows, svg, plot, time) {
  const table = document.createElement("table");
  for (const [colour, ...texts] of rows) {
    const row = table.insertRow();
    row.insertCell().innerHTML = "<b>▬</b>";
    row.firstChild.style.color = colour;
    for (const text of texts) row.insertCell().textContent = text;
  }
  values.replaceChildren(title, table);
  values.hidden = false;
  const { x, y } = new DOMPoint(plot.at(time), plot.top).matrixTransform(svg.getScreenCTM());
  const beside = x + 14 + values.offsetWidth < innerWidth ? x + 14 : x - 14 - values.offsetWidth;
  values.style.left = `${Math.max(4, beside)}px`;
  values.style.top = `${clamp(y, 4, Math.max(4, innerHeight - values.offsetHeight - 4))}px`;
}

for (const section of document.querySelectorAll("section")) {
  const drawings = [...section.querySelectorAll("svg[data-plots]")];
  if (drawings.length) new Chapter(drawings);
}

const entries = new Map([...document.querySelectorAll("nav a")].map((link) => [link.hash.slice(1), link]));
const opened = () => document.getElementById(location.hash.slice(1))?.querySelector("details")?.setAttribute("open", "");
addEventListener("hashchange", opened);
opened();
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((each) => (each.open = true)));
addEventListener("scroll", () => {
  const passed = [...entries.keys()].filter((id) => document.getElementById(id).getBoundingClientRect().top < innerHeight / 3);
  const current = passed.at(-1) ?? entries.keys().next().value;
  for (const [id, link] of entries) id === current ? link.setAttribute("aria-current", "true") : link.removeAttribute("aria-current");
}, { passive: true });
