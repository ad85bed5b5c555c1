// Curves over time: one window of time for all figures of a chapter, and a cursor that shows values. The curves are
// those of the SVG, which show without this script too. A link opens the chapter that it leads to.
"use strict";
const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
const made = (parent, kind, attributes = {}) => {
  const element = parent.appendChild(document.createElementNS("http://www.w3.org/2000/svg", kind));
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  return element;
};

/** Up to about `n` round numbers from `low` to `high`, each with its text. */
function ticks(low, high, n) {
  const power = 10 ** Math.floor(Math.log10((high - low) / n));
  const step = [1, 2, 5, 10].find((k) => k * power * n >= high - low) * power;
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const text = (value) => (digits > 4 ? Number(value.toPrecision(4)).toExponential() : value.toFixed(digits));
  return Array.from({ length: n + 2 }, (_, k) => (Math.ceil(low / step - 1e-9) + k) * step)
    .filter((value) => value <= high + 1e-9 * step)
    .map((value) => [value, text(Math.abs(value) < 1e-9 * step ? 0 : value).replace("-", "−")]);
}

/** One axes of a figure, with its data from the page: box [points], ranges x and y, log, unit, labels of curves. */
class Plot {
  constructor(group, data) {
    Object.assign(this, data, { group, shown: data.x });
    [this.left, this.top, this.right, this.bottom] = data.box;
    this.drawn = [...group.querySelectorAll("path[clip-path]")].filter((path) => !path.closest(".tick"));
    for (const path of this.drawn) { // the clip stays where it is while the path moves
      made(path.parentNode, "g", { "clip-path": path.getAttribute("clip-path") }).append(path);
      path.removeAttribute("clip-path");
      path.setAttribute("vector-effect", "non-scaling-stroke");
    }
    this.marks = [...group.querySelectorAll("[data-part=event]")].map((mark) => [mark, mark.getBBox().x]);
    group.classList.toggle("log", this.log || !this.labels.length);
    this.own = made(group, "g");
    group.prepend(this.own);
    this.cursor = made(group, "line", { class: "cursor", y1: this.top, y2: this.bottom, visibility: "hidden" });
  }

  /** Label, path and points x0, y0, x1, ... of each curve, read when first needed: a page has many. */
  get curves() {
    const paths = [...this.group.querySelectorAll("[data-part=curve] path[style*=stroke]")];
    const points = (path) => path.getAttribute("d").match(/[-\d.]+/g).map(Number);
    return (this.read ??= paths.map((path, k) => ({ label: this.labels[k], path, points: points(path) })));
  }

  /** The place of a time in the figure [points], and the time of a place. */
  at(time, [from, to] = this.shown) { return this.left + ((time - from) / (to - from)) * (this.right - this.left); }
  time(x, [from, to] = this.shown) { return from + ((x - this.left) / (this.right - this.left)) * (to - from); }

  /** Height of a curve [points] at the place `x` of the figure as drawn; undefined without a sample there. */
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

  /** The value at a height, with the digits that the figure resolves. */
  value(y) {
    const [low, high] = this.log ? this.y.map(Math.log10) : this.y;
    const value = low + ((this.bottom - y) / (this.bottom - this.top)) * (high - low);
    const digits = clamp(Math.ceil(-Math.log10((high - low) / 5000)), 0, 15);
    if (!this.log) return (Number(value.toFixed(digits)) || 0).toFixed(digits); // zero without a sign
    return value < low ? `< ${this.y[0]}` : `${Number((10 ** value).toPrecision(3))}`;
  }

  /** Show a window of time; the heights follow what the curves take in it. */
  show(window) {
    const zoomed = window[0] > this.x[0] || window[1] < this.x[1];
    this.shown = zoomed ? window : this.x;
    const [from, to] = this.shown.map((time) => this.at(time, this.x));
    const [high, low] = zoomed && !this.log ? this.extent(from, to) : [this.top, this.bottom];
    const k = (this.right - this.left) / (to - from), q = (this.bottom - this.top) / (low - high);
    const [right, down] = [this.left - k * from, this.top - q * high];
    for (const path of this.drawn) path.setAttribute("transform", `matrix(${[k, 0, 0, q, right, down]})`);
    for (const [mark, x] of this.marks) {
      mark.setAttribute("transform", `translate(${k * x + right - x})`);
      mark.style.display = x >= from && x < to ? "" : "none";
    }
    this.group.classList.toggle("zoomed", zoomed);
    this.own.replaceChildren();
    if (!zoomed) return;
    for (const [time, text] of ticks(...window, 8)) {
      const x = this.at(time);
      this.tick("x", text, { x1: x, x2: x, y1: this.top, y2: this.bottom }, { x });
    }
    if (this.log || !this.labels.length) return; // these keep their heights
    const [least, most] = this.y, scale = (most - least) / (this.bottom - this.top);
    for (const [value, text] of ticks(most - (low - this.top) * scale, most - (high - this.top) * scale, 4)) {
      const y = ((most - value) / scale + this.top) * q + down;
      this.tick("y", text, { x1: this.left, x2: this.right, y1: y, y2: y }, { y: y + 3 });
    }
  }

  /** The range of heights of the curves between two places, with a margin. */
  extent(from, to) {
    let [high, low] = [Infinity, -Infinity];
    for (const { points } of this.curves) {
      const heights = [from, to].map((x) => this.height(points, x)).filter((y) => y !== undefined);
      for (let i = 0; i < points.length; i += 2) if (points[i] >= from && points[i] <= to) heights.push(points[i + 1]);
      for (const y of heights) [high, low] = [Math.min(high, y), Math.max(low, y)];
    }
    const margin = Math.max(0.06 * (low - high), (this.bottom - this.top) / 400);
    return high > low ? [this.top, this.bottom] : [high - margin, low + margin];
  }

  /** A grid line and, where the axis has texts, one like them. */
  tick(axis, text, line, place) {
    const part = `[data-part=${axis}] .tick`, model = this.group.querySelector(`${part} text`);
    made(this.own, "line", line).style.cssText = this.group.querySelector(`${part} path`).style.cssText;
    if (!model) return;
    const label = this.own.appendChild(model.cloneNode());
    label.removeAttribute("transform");
    for (const [name, value] of Object.entries(place)) label.setAttribute(name, value);
    label.textContent = text;
  }
}

/** Figures that share a window of time and a cursor. */
class Chapter {
  constructor(drawings) {
    for (const svg of drawings) {
      const plot = (data, k) => new Plot(svg.querySelector(`[data-part=axes${k}]`), data);
      svg.plots = JSON.parse(svg.dataset.plots).map(plot);
      this.listen(svg);
    }
    this.plots = drawings.flatMap((svg) => svg.plots);
    this.home = [Math.min(...this.plots.map(({ x }) => x[0])), Math.max(...this.plots.map(({ x }) => x[1]))];
    this.window = this.home;
    const hint = Object.assign(document.createElement("p"), { className: "note hint" });
    hint.textContent = "Drag over a curve to enlarge that time in all figures of the chapter; Ctrl and wheel, two fingers, "
      + "+ and − do so too, arrows move the cursor. A double click or Esc shows everything.";
    drawings[0].closest(".figures").before(hint);
  }

  show(from, to) {
    const [low, high] = this.home, width = clamp(to - from, (high - low) / 2000, high - low);
    const start = clamp(from, low, high - width);
    this.window = [start, start + width];
    this.leave();
    cancelAnimationFrame(this.frame);
    this.frame = requestAnimationFrame(() => this.plots.forEach((plot) => plot.show(this.window)));
  }

  zoom(time, factor) { this.show(...this.window.map((end) => time + (end - time) * factor)); }

  /** The cursor at a time, and beside it the values of a plot. */
  point(time, plot, svg) {
    this.time = time;
    for (const each of this.plots) {
      const x = each.at(time), inside = x >= each.left && x <= each.right;
      for (const end of ["x1", "x2"]) each.cursor.setAttribute(end, x);
      each.cursor.setAttribute("visibility", inside ? "visible" : "hidden");
    }
    const rows = new Map(); // by colour and value: plants that agree have one row
    for (const { label, path, points } of plot.curves) {
      const y = plot.height(points, plot.at(time, plot.x)), { stroke } = getComputedStyle(path);
      if (y === undefined) continue;
      const text = `${plot.value(y)} ${plot.unit}`, key = stroke + text;
      rows.set(key, [stroke, rows.has(key) ? label.slice(0, label.lastIndexOf(",")) : label, text]);
    }
    const table = document.createElement("table");
    for (const [colour, ...texts] of rows.values()) {
      const row = table.insertRow();
      Object.assign(row.insertCell(), { textContent: "▬" }).style.color = colour;
      for (const text of texts) row.insertCell().textContent = text;
    }
    values.replaceChildren(`${time.toFixed(3)} s`, table);
    values.hidden = false;
    const { x, y } = new DOMPoint(plot.at(time), plot.top).matrixTransform(svg.getScreenCTM());
    const left = x + 14 + values.offsetWidth < innerWidth ? x + 14 : x - 14 - values.offsetWidth;
    values.style.left = `${Math.max(4, left)}px`;
    values.style.top = `${clamp(y, 4, Math.max(4, innerHeight - values.offsetHeight - 4))}px`;
  }

  leave() {
    for (const { cursor } of this.plots) cursor.setAttribute("visibility", "hidden");
    values.hidden = true;
  }

  listen(svg) {
    const on = (kinds, act) => kinds.split(" ").forEach((kind) => svg.addEventListener(kind, act, { passive: false }));
    const fingers = new Map(); // times under them
    let start; // of a drag
    const place = (event) => {
      const { x, y } = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
      const away = (plot) => Math.abs(y - (plot.top + plot.bottom) / 2);
      const plot = svg.plots.reduce((a, b) => (away(b) < away(a) ? b : a));
      return [clamp(plot.time(x), ...plot.shown), plot];
    };
    on("pointerdown", (event) => {
      const [time, plot] = place(event);
      fingers.set(event.pointerId, time);
      if (event.pointerType !== "mouse" || event.button !== 0) return;
      svg.setPointerCapture(event.pointerId);
      start = { time, x: event.clientX, box: made(plot.group, "rect", { class: "chosen", y: plot.top, height: plot.bottom - plot.top }) };
    });
    on("pointermove", (event) => {
      const [time, plot] = place(event);
      const [still] = [...fingers].filter(([id]) => id !== event.pointerId).map(([, other]) => other);
      if (still !== undefined && fingers.has(event.pointerId)) { // both stay over their times
        const ratio = (fingers.get(event.pointerId) - still) / (time - still);
        return void (ratio > 0 && this.zoom(still, clamp(ratio, 0.5, 2)));
      }
      if (start) {
        const [a, b] = [start.time, time].map((each) => plot.at(each));
        start.box.setAttribute("x", Math.min(a, b));
        start.box.setAttribute("width", Math.abs(b - a));
      }
      this.point(time, plot, svg);
    });
    on("pointerup pointercancel", (event) => {
      fingers.delete(event.pointerId);
      start?.box.remove();
      if (start && event.type === "pointerup" && Math.abs(event.clientX - start.x) > 4) {
        this.show(...[start.time, place(event)[0]].sort((a, b) => a - b));
      }
      start = undefined;
    });
    on("pointerleave blur", () => this.leave());
    on("dblclick", () => this.show(...this.home));
    on("wheel", (event) => {
      if (!event.ctrlKey && !event.metaKey) return; // which scrolls the page
      event.preventDefault();
      this.zoom(place(event)[0], Math.exp(clamp(event.deltaY, -200, 200) / 300));
    });
    svg.setAttribute("tabindex", 0);
    on("keydown", (event) => {
      const [from, to] = this.window, time = clamp(this.time ?? (from + to) / 2, from, to);
      const move = (steps) => this.point(clamp(time + (steps * (to - from)) / 200, from, to), svg.plots[0], svg);
      const acts = {
        "+": () => this.zoom(time, 0.5), "-": () => this.zoom(time, 2), Escape: () => this.show(...this.home),
        ArrowLeft: () => move(event.shiftKey ? -10 : -1), ArrowRight: () => move(event.shiftKey ? 10 : 1),
      };
      if (!acts[event.key] || event.ctrlKey || event.metaKey) return;
      event.preventDefault();
      acts[event.key]();
    });
  }
}

const values = document.body.appendChild(Object.assign(document.createElement("div"), { id: "values", hidden: true }));
for (const section of document.querySelectorAll("section")) {
  const drawings = [...section.querySelectorAll("svg[data-plots]")];
  if (drawings.length) new Chapter(drawings);
}

const links = [...document.querySelectorAll("nav a")], part = (link) => document.getElementById(link.hash.slice(1));
for (const link of links) link.addEventListener("click", () => (part(link).querySelector("details").open = true));
// What is wider than its place can be reached, and scrolled, by keys.
const reached = new ResizeObserver((entries) => entries.forEach(({ target: box }) => {
  if (box.scrollWidth > box.clientWidth) box.tabIndex = 0; else box.removeAttribute("tabindex");
}));
document.querySelectorAll(".scrolled, .alone").forEach((box) => reached.observe(box));
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((each) => (each.open = true)));
addEventListener("scroll", () => {
  const current = links.findLast((link) => part(link).getBoundingClientRect().top < innerHeight / 3) ?? links[0];
  for (const link of links) link.ariaCurrent = link === current ? "true" : null;
}, { passive: true });
