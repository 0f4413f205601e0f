// The feeder's one-line diagram with its switches and inverters, and the communication links on top.
import { DiagramKeys, linkWords } from "./diagram_keys.js";
import { loadWords } from "./load_dialog.js";

const SVG = "http://www.w3.org/2000/svg";
const make = (name, attributes = {}, parent) => {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (parent) parent.append(element);
  return element;
};
const set = (element, key, value) => { if (element.getAttribute(key) !== value) element.setAttribute(key, value); };
const pairOf = (a, b) => a < b ? `${a}|${b}` : `${b}|${a}`;

export class Diagram {
  // on(kind, subject): a click; look(event, kind, subject): the pointer is above something, or above nothing
  constructor(svg, on, look) {
    this.svg = svg; this.look = look; this.map = null; this.inverters = new Map(); this.switches = new Map(); this.loads = new Map(); this.pairs = new Map();
    this.marked = []; this.over = null; this.dead = [];
    this.keys = new DiagramKeys(svg, on, look);
    new ResizeObserver(() => this.layout()).observe(svg.parentElement);
    for (const kind of ["pointermove", "pointerdown"]) svg.addEventListener(kind, event => this.point(event, this.target(event)));
    svg.addEventListener("pointerleave", event => this.point(event, null));
    // a click takes no focus, so that the keys of the time go on; the tab key does
    svg.addEventListener("mousedown", event => { event.preventDefault(); document.activeElement?.blur?.(); });
    svg.addEventListener("click", event => {
      const element = event.detail ? this.target(event) : event.target.closest("[data-kind]");  // 0: not by a pointer
      if (element) on(element.dataset.kind, element.dataset.subject);
    });
  }
  // The element that a pointer means: the mark whose centre is nearest, measured by its size, else the nearest link.
  target(event) {
    const box = this.svg.getBoundingClientRect(), x = event.clientX - box.left, y = event.clientY - box.top;
    let found = null, least = 1;
    const offer = (element, distance) => { if (distance < least) { found = element; least = distance; } };
    for (const mark of this.marked) offer(mark.g, Math.hypot(x - mark.x, y - mark.y) / mark.reach);
    if (found) return found;
    least = event.pointerType === "touch" ? 14 : 7;
    for (const { hit, way } of this.pairs.values()) for (const [px, py] of way) offer(hit, Math.hypot(x - px, y - py));
    return found;
  }
  point(event, element) {
    if (this.over !== element) { this.over?.removeAttribute("data-over"); element?.setAttribute("data-over", ""); this.over = element; set(this.svg, "class", element ? "over" : ""); }
    this.look(event, element?.dataset.kind ?? "", element?.dataset.subject ?? "");
  }
  setMap(map, colourOf) {
    this.map = map; this.colourOf = colourOf; this.layout();
    const pan = this.svg.closest(".pan"); pan.scrollLeft = (pan.scrollWidth - pan.clientWidth) / 2;
  }

  layout() {
    const map = this.map, W = this.svg.parentElement.clientWidth, H = this.svg.parentElement.clientHeight;
    if (!map || !W || !map.buses.length) return;
    const had = this.keys.focused();
    this.svg.setAttribute("viewBox", `0 0 ${W} ${H}`); this.svg.replaceChildren();
    const xs = map.buses.map(b => b[1]), ys = map.buses.map(b => b[2]), few = map.inverters.length <= 24;
    const [x0, x1, y0, y1] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    const px = few ? 56 : 24, py = few ? 34 : 20;
    let sx = (W - 2 * px) / (x1 - x0 || 1), sy = (H - 2 * py) / (y1 - y0 || 1);
    if (map.to_scale) sx = sy = Math.min(sx, sy);
    const ox = (W - sx * (x1 - x0)) / 2, oy = (H - sy * (y1 - y0)) / 2;
    const at = map.buses.map(([, x, y]) => [ox + sx * (x - x0), H - oy - sy * (y - y0)]);
    this.wires = make("g", {}, this.svg); this.at = at; this.marked = []; this.over = null;
    this.wire(new Set(this.dead));
    this.links = this.keys.group(make("g", { class: "links" }, this.svg), "Links");
    const marks = this.keys.group(make("g", {}, this.svg), "Switches"), small = this.keys.group(make("g", {}, this.svg), "Loads");
    this.marks = make("g", { class: "links" }, this.svg);
    this.loads.clear(); this.shownLoads = "";
    for (const load of map.loads || []) {
      const [x, y] = at[load.bus], size = few ? 3.5 : 2.5, g = make("g", { class: "load", "data-load": load.name }, small);
      make("path", { d: `M${r1(x - size)} ${r1(y + 3)}h${2 * size}l${-size} ${r1(1.7 * size)}z` }, g);
      this.mark(g, "load", load.name, x, y + 3 + .85 * size, size + 2.5); this.loads.set(load.name, { g, load });
    }
    this.switches.clear();
    for (const s of map.switches) {
      const [a, b] = [at[s.a], at[s.b]], x = (a[0] + b[0]) / 2, y = (a[1] + b[1]) / 2;
      const g = make("g", { class: "switch", "data-switch": s.name }, marks);
      make("line", { x1: a[0], y1: a[1], x2: b[0], y2: b[1] }, g);
      make("rect", { x: x - 4.5, y: y - 4.5, width: 9, height: 9, rx: 1.5 }, g);
      const text = map.switches.length <= 40 ? make("text", { x: x + 8, y: y + 13 }, g) : null;
      if (text) text.textContent = s.alias || s.name;
      this.mark(g, "switch", s.name, x, y, 11); this.switches.set(s.name, { g, x, y, text, title: s.alias ? `${s.alias} (${s.name})` : s.name });
    }
    if (map.source >= 0) { const [x, y] = at[map.source]; make("path", { class: "substation", d: `M${x} ${y - 9}l9 9l-9 9l-9-9z` }, marks); }
    const nodes = this.keys.group(make("g", {}, this.svg), "Inverters"), r = few ? 9 : map.inverters.length > 60 ? 5 : 6.5, taken = new Map();
    this.inverters.clear();
    for (const row of map.inverters) {
      let [x, y] = at[row.bus];
      const here = `${Math.round(x / 4)},${Math.round(y / 4)}`, others = taken.get(here) || 0;
      taken.set(here, others + 1); x += others * 2.4 * r;
      const g = make("g", { class: "inverter", "data-agent": row.name, transform: `translate(${r1(x)} ${r1(y)})` }, nodes);
      const fill = this.colourOf(row.name);
      make("circle", { class: "halo", r: r + 5 }, g);
      if (row.kind === "GFM") make("rect", { class: "body", x: -r, y: -r, width: 2 * r, height: 2 * r, rx: 3, style: `fill:${fill}` }, g);
      else make("circle", { class: "body", r, style: `fill:${fill}` }, g);
      this.mark(g, "agent", row.name, x, y, r + 4);
      this.inverters.set(row.name, { g, kind: row.kind, bus: row.bus, value: null, x, y });
    }
    if (few) this.label(r, W, H);
    this.pairs.clear();
    if (this.last) this.update(...this.last);
    this.keys.settle(had);
  }

  // Each label goes where it covers least of the marks and of the labels before it: those of the inverters, then of the switches.
  label(r, W, H) {
    const covered = [...this.inverters.values()].map(({ x, y }) => [x - r - 2, y - r - 2, x + r + 2, y + r + 2]);
    for (const { x, y } of this.switches.values()) covered.push([x - 7, y - 7, x + 7, y + 7]);
    const shared = (a, b) => Math.max(0, Math.min(a[2], b[2]) - Math.max(a[0], b[0])) * Math.max(0, Math.min(a[3], b[3]) - Math.max(a[1], b[1]));
    // places: [anchor, dx, dy] of the first line, which rises so far above its base line; the best comes first
    const place = (x, y, w, h, rises, places) => {
      const choices = places.map(([anchor, dx, dy], k) => {
        const left = x + dx - (anchor === "end" ? w : anchor === "middle" ? w / 2 : 0), top = y + dy - rises, box = [left, top, left + w, top + h];
        const beyond = left < 2 || left + w > W - 2 || top < 0 || top + h > H ? 9999 : 0;
        return { anchor, dx, dy, box, cost: k + beyond + covered.reduce((sum, other) => sum + shared(box, other), 0) };
      });
      const best = choices.reduce((a, b) => b.cost < a.cost ? b : a);
      covered.push(best.box);
      return best;
    };
    const gap = r + 6, near = r + 3;
    const around = [["start", gap, -3], ["end", -gap, -3], ["middle", 0, -gap - 14], ["middle", 0, gap + 8], ["start", near, -near - 6], ["end", -near, -near - 6], ["start", near, near + 2], ["end", -near, near + 2]];
    for (const [name, drawn] of this.inverters) {
      const best = place(drawn.x, drawn.y, 50, 27, 11, around);
      make("text", { class: "name", x: best.dx, y: best.dy, "text-anchor": best.anchor }, drawn.g).textContent = name;
      drawn.value = make("text", { class: "value values", x: best.dx, y: best.dy + 13, "text-anchor": best.anchor }, drawn.g);
    }
    const corners = [["start", 8, 13], ["start", 8, -6], ["end", -8, 13], ["end", -8, -6], ["middle", 0, 19], ["middle", 0, -10], ["start", 10, 4], ["end", -10, 4]];
    for (const { x, y, text } of this.switches.values()) {
      if (!text) continue;
      const best = place(x, y, 6 * text.textContent.length, 12, 9, corners);
      text.setAttribute("x", x + best.dx); text.setAttribute("y", y + best.dy); text.setAttribute("text-anchor", best.anchor);
    }
  }

  mark(g, kind, subject, x, y, reach) { this.keys.add(g, kind, subject); this.marked.push({ g, x, y, reach }); }

  // the branches, of which those between de-energised buses look so
  wire(dead) {
    const thin = this.map.buses.length > 400 ? .6 : 1, drawn = new Map();
    for (const [a, b, phases] of this.map.branches) {
      const look = `${dead.has(a) && dead.has(b) ? "dead " : ""}branch|${phases}`;
      drawn.set(look, (drawn.get(look) || "") + `M${this.at[a].map(r1)}L${this.at[b].map(r1)}`);
    }
    this.wires.replaceChildren();
    for (const [look, d] of drawn) { const [name, phases] = look.split("|"); make("path", { d, class: name, "stroke-width": thin * [1, 1, 1.7, 2.8][phases] }, this.wires); }
  }

  // links: pair key -> { a, b, kind, rate, text }; switches: name -> closed; states: name -> { absent, V, off }; loads: name -> [P, Q] of those that were set; dead: numbers of de-energised buses
  update(links, switches, states, pending, lit, loads, dead) {
    this.last = [links, switches, states, pending, lit, loads, dead];
    if (!this.links) return;
    const isDead = new Set(dead);
    if (String(dead) !== String(this.dead)) { this.dead = dead; this.wire(isDead); }
    const had = this.keys.focused(), before = this.pairs.size;
    let news = false;
    set(this.links, "class", links.size > 120 ? "links many" : "links");
    for (const [key, link] of links) {
      let drawn = this.pairs.get(key);
      const from = this.inverters.get(link.a), to = this.inverters.get(link.b);
      if (!from || !to) continue;
      if (!drawn) {
        const dx = to.x - from.x, dy = to.y - from.y, bend = .11, mx = (from.x + to.x) / 2 - bend * dy, my = (from.y + to.y) / 2 + bend * dx;
        const d = `M${r1(from.x)} ${r1(from.y)}Q${r1(mx)} ${r1(my)} ${r1(to.x)} ${r1(to.y)}`, n = Math.ceil(Math.hypot(dx, dy) / 2) + 2;
        const hit = make("path", { class: "hit", d, "data-link": key }, this.links), path = make("path", { d }, this.links);
        const on = (p, q, r, s) => (1 - s) ** 2 * p + 2 * s * (1 - s) * q + s * s * r, way = [...Array(n + 1).keys()].map(k => [on(from.x, mx, to.x, k / n), on(from.y, my, to.y, k / n)]);
        this.keys.add(hit, "link", key);
        drawn = { hit, path, way, mark: null, x: (from.x + 2 * mx + to.x) / 4, y: (from.y + 2 * my + to.y) / 4 };
        this.pairs.set(key, drawn);
        news = true;
      }
      const bright = lit && (link.a === lit || link.b === lit) ? " lit" : "";
      set(drawn.hit, "aria-label", linkWords(link));
      set(drawn.path, "class", `link ${link.kind}${pending.has(key) ? " pending" : ""}${bright}`);
      set(drawn.path, "stroke-width", String(r1(link.kind === "impaired" || link.kind === "cut" ? 2.2 : .7 + 1.9 * Math.min(1, link.rate / 50))));
      const mark = link.kind === "cut" ? "cut" : link.kind === "impaired" ? link.text : "";
      if (drawn.marked !== mark) {
        drawn.mark?.remove(); drawn.mark = null; drawn.marked = mark;
        const { x, y } = drawn;
        if (mark === "cut") drawn.mark = make("path", { class: "cross", d: `M${r1(x - 5)} ${r1(y - 5)}l10 10m0-10l-10 10` }, this.marks);
        else if (mark) { drawn.mark = make("text", { class: "badge", x: r1(x), y: r1(y + 3) }, this.marks); drawn.mark.textContent = mark; }
      }
    }
    for (const [key, drawn] of this.pairs) if (!links.has(key)) { drawn.hit.remove(); drawn.path.remove(); drawn.mark?.remove(); this.pairs.delete(key); }
    if (news) {  // in the order of the inverters, for the keyboard
      const place = new Map([...this.inverters.keys()].map((name, i) => [name, i])), at = key => key.split("|").reduce((sum, name) => sum * 1e4 + place.get(name), 0);
      for (const [, drawn] of [...this.pairs].sort(([a], [b]) => at(a) - at(b))) this.links.append(drawn.hit, drawn.path);
    }
    if (news || this.pairs.size !== before) this.keys.settle(had);
    for (const [name, drawn] of this.switches) {
      const closed = switches[name] ?? true;
      set(drawn.g, "class", `switch ${closed ? "closed" : "open"}${pending.has(name) ? " pending" : ""}`); set(drawn.g, "aria-label", `switch ${drawn.title}, ${closed ? "closed" : "open"}`);
    }
    const shown = JSON.stringify([loads, [...pending.keys()], dead]);
    if (shown !== this.shownLoads) for (const [name, { g, load }] of this.loads) {
      set(g, "class", `load${loads[name] ? " set" : ""}${pending.has(`load ${name}`) ? " pending" : ""}${isDead.has(load.bus) ? " dead" : ""}`);
      set(g, "aria-label", `load ${name}, ${loadWords(load, loads[name])}${isDead.has(load.bus) ? ", de-energised" : ""}`);
    }
    this.shownLoads = shown;
    for (const [name, drawn] of this.inverters) {
      const state = states.get(name) || { absent: true };
      const dark = isDead.has(drawn.bus), off = !!state.off && !dark;
      set(drawn.g, "class", `inverter${state.absent ? " absent" : ""}${dark ? " dead" : ""}${off ? " off-voltage" : ""}${pending.has(name) ? " pending" : ""}${name === lit ? " lit" : ""}`);
      set(drawn.g, "aria-label", `inverter ${name}, ${drawn.kind}${state.absent ? ", no agent" : ""}${dark ? ", de-energised" : ""}${off ? ", voltage beyond 0.95 to 1.05 pu" : ""}`);
      if (drawn.value) { const text = dark ? "de-energised" : state.V === null || state.V === undefined ? "" : `${state.V.toFixed(3)} pu`; if (drawn.value.textContent !== text) drawn.value.textContent = text; }
    }
  }
}

export { pairOf };
function r1(value) { return Math.round(value * 10) / 10; }
