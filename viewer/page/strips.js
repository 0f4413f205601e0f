// The last 30 s of f, P, Q, V, MPSI and MQSI on canvases, with the events on the same axis.
import { make } from "./dom.js";
const LENGTH = 30, LEFT = 44, RIGHT = 8, AXIS = 18;
const QUANTITIES = [
  { key: "f", label: "f", unit: "Hz", digits: 3, least: 0.02 },
  { key: "P", label: "P", unit: "pu", digits: 3, least: 0.05 },
  { key: "Q", label: "Q", unit: "pu", digits: 3, least: 0.02 },
  { key: "V", label: "V", unit: "pu", digits: 4, least: 0.01 },
  { key: "MPSI", label: "MPSI, all inverters", unit: "", digits: 3, least: 0.02, zero: true },
  { key: "MQSI", label: "MQSI, all inverters", unit: "", digits: 3, least: 0.02, zero: true },
];

export class Strips {
  constructor(holder) {
    this.points = []; this.names = []; this.lit = ""; this.ranges = {}; this.end = null; this.length = LENGTH; this.holder = holder;
    this.setShared([]);
  }
  // shared: [name, unit] of what the law shares, a value of each inverter behind the others of a point
  setShared(shared) {
    const quantities = [...QUANTITIES, ...shared.map(([label, unit]) => ({ key: `shared ${label}`, label, unit, digits: 4, least: 0 }))];
    this.holder.replaceChildren();
    this.charts = quantities.map((quantity, i) => {
      const canvas = make("canvas", { role: "img", ariaLabel: `${quantity.label}, last ${LENGTH} s; the table of agents has the present values` }), now = make("span");
      this.holder.append(make("figure", {}, make("figcaption", {}, quantity.label + (quantity.unit ? ` (${quantity.unit})` : ""), now), canvas));
      return { quantity, canvas, now, axis: i === quantities.length - 1 };
    });
  }
  clear() { this.points = []; this.ranges = {}; }
  // points: [t, values, beyond]; beyond: of a column, its extremes since the point before, where they lie outside of both
  add(points) {
    this.points.push(...points);
    const end = this.latest - LENGTH;
    let gone = 0;
    while (gone < this.points.length && this.points[gone][0] < end) gone++;
    if (gone) this.points.splice(0, gone);
  }
  get latest() { return this.points.length ? this.points[this.points.length - 1][0] : 0; }

  // silent: how long (s of run time) nothing has come; events: [t, kind]; colours: of each name
  draw(silent, events, colours) {
    const style = getComputedStyle(document.body), ink = style.getPropertyValue("--ink"), soft = style.getPropertyValue("--soft");
    const grid = style.getPropertyValue("--grid"), shade = style.getPropertyValue("--shade");
    const end = this.end ?? Math.max(this.latest + silent, 0), start = end - this.length, n = this.names.length, second = nice(this.length / 6);
    this.charts.forEach(({ quantity, canvas, now, axis }, q) => {
      const ratio = devicePixelRatio || 1, w = canvas.clientWidth, h = canvas.clientHeight;
      if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio)) { canvas.width = Math.round(w * ratio); canvas.height = Math.round(h * ratio); }
      const g = canvas.getContext("2d"); g.setTransform(ratio, 0, 0, ratio, 0, 0); g.clearRect(0, 0, w, h);
      const each = q < 4 || q > 5, first = q < 4 ? q * n : q > 5 ? 4 * n + 2 + (q - 6) * n : 4 * n + q - 4;
      const columns = each ? [...Array(n).keys()].map(i => first + i) : [first];
      const [low, high] = this.range(quantity, columns);
      const top = 20, bottom = h - (axis ? AXIS : 4), x = t => LEFT + (w - LEFT - RIGHT) * (t - start) / this.length;
      const y = v => bottom - (bottom - top) * (v - low) / (high - low);
      g.font = "10.5px system-ui, 'DejaVu Sans', sans-serif"; g.lineWidth = 1; g.textBaseline = "middle"; g.textAlign = "right";
      const step = nice((high - low) / 3);
      for (let v = Math.ceil(low / step) * step; v <= high + step * 1e-6; v += step) {
        g.strokeStyle = grid; g.beginPath(); g.moveTo(LEFT, y(v)); g.lineTo(w - RIGHT, y(v)); g.stroke();
        g.fillStyle = soft; g.fillText(v.toFixed(Math.max(0, -Math.floor(Math.log10(step) + 1e-9))), LEFT - 6, y(v));
      }
      if (axis) {
        g.textAlign = "center"; g.textBaseline = "alphabetic";
        for (let t = Math.max(0, Math.ceil(start / second) * second); t <= end + 1e-9; t += second) { g.fillStyle = soft; g.fillText(`${Math.round(t * 100) / 100} s`, Math.min(x(t), w - 14), h - 4); }
      }
      g.save(); g.beginPath(); g.rect(LEFT, 0, w - LEFT - RIGHT, bottom + 2); g.clip();
      for (const [t, kind] of events) {
        if (t < start) continue;
        g.strokeStyle = soft; g.globalAlpha = kind === "switch" ? .9 : .35; g.setLineDash([2, 3]);
        g.beginPath(); g.moveTo(x(t), top - 6); g.lineTo(x(t), bottom); g.stroke();
      }
      g.setLineDash([]); g.globalAlpha = 1; g.lineJoin = "round";
      const many = columns.length > 20;
      const order = columns.map((_, i) => i).sort((a, b) => (this.names[a] === this.lit) - (this.names[b] === this.lit));
      for (const i of order) {
        const column = columns[i], lit = this.names[i] === this.lit && each;
        g.strokeStyle = each ? colours[i] : ink; g.lineWidth = lit ? 3 : many ? .8 : 1.5;
        g.globalAlpha = this.lit && each && !lit ? .18 : many ? .55 : .95;
        g.beginPath();
        let pen = false;
        for (const [t, values, beyond] of this.points) {
          const v = values[column], extremes = beyond[column];
          if (extremes) { pen ? g.lineTo(x(t), y(extremes[0])) : g.moveTo(x(t), y(extremes[0])); g.lineTo(x(t), y(extremes[1])); pen = true; }
          if (v === null || v === undefined) { pen = false; continue; }
          pen ? g.lineTo(x(t), y(v)) : g.moveTo(x(t), y(v)); pen = true;
        }
        g.stroke();
      }
      g.globalAlpha = 1;
      if (silent > 0) {
        const from = x(this.latest);
        g.fillStyle = shade; g.fillRect(from, 0, w - RIGHT - from, bottom + 2);
        if (w - RIGHT - from > 60) { g.fillStyle = soft; g.textAlign = "center"; g.textBaseline = "middle"; g.fillText("nothing heard", (from + w - RIGHT) / 2, (top + bottom) / 2); }
      }
      g.restore();
      now.textContent = silent > 0 ? "" : this.present(quantity, columns);
    });
  }
  present(quantity, columns) {
    if (!this.points.length) return "";
    const last = this.points[this.points.length - 1][1], values = columns.map(c => last[c]).filter(v => v !== null && v !== undefined);
    if (!values.length) return "–";
    const low = Math.min(...values).toFixed(quantity.digits), high = Math.max(...values).toFixed(quantity.digits);
    return low === high ? low : `${low} … ${high}`;
  }
  // Scales grow at once, and shrink only when the lines fill less than half: else they would never rest.
  range(quantity, columns) {
    let low = Infinity, high = -Infinity;
    const take = v => { if (v !== null && v !== undefined) { if (v < low) low = v; if (v > high) high = v; } };
    for (const [, values, beyond] of this.points) for (const c of columns) { take(values[c]); beyond[c]?.forEach(take); }
    if (!(low <= high)) return this.ranges[quantity.key] || [0, 1];
    if (quantity.zero) low = 0;
    const pad = Math.max((high - low) * .12, (quantity.least || 1e-3 * Math.max(Math.abs(low), Math.abs(high), 1e-6)) / 2), before = this.ranges[quantity.key];
    if (before && before[0] <= low && before[1] >= high && (before[1] - before[0]) < 2.2 * (high - low + 2 * pad)) return before;
    return this.ranges[quantity.key] = [quantity.zero ? 0 : low - pad, high + pad];
  }
}

function nice(x) {
  const ten = 10 ** Math.floor(Math.log10(x)), m = x / ten;
  return (m < 1.5 ? 1 : m < 3.5 ? 2 : m < 7.5 ? 5 : 10) * ten;
}
