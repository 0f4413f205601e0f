// The diagram by keyboard and for screen readers: each kind of thing is one stop of the tab key, arrow keys go on within it.
const STEPS = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 };
const of = group => [...group.querySelectorAll("[data-kind]")];

export class DiagramKeys {
  // act(kind, subject): Enter or the space bar; look(event, kind, subject): something has the focus, or nothing
  constructor(svg, act, look) { this.svg = svg; this.act = act; this.look = look; this.roleOf = () => "img"; }

  group(group, name) { group.setAttribute("role", "group"); group.setAttribute("aria-label", name); return group; }

  add(element, kind, subject) {
    element.dataset.kind = kind; element.dataset.subject = subject;
    element.setAttribute("role", this.roleOf(kind)); element.setAttribute("tabindex", "-1");
    element.addEventListener("focus", () => { this.stop(element); const box = element.getBoundingClientRect(); this.look({ clientX: box.right, clientY: box.bottom }, kind, subject); });
    element.addEventListener("blur", event => this.look(event, "", ""));
    element.addEventListener("keydown", event => this.key(event, element, kind, subject));
  }
  key(event, element, kind, subject) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const all = of(element.closest("[role=group]")), at = all.indexOf(element);
    if (event.key === "Enter" || event.key === " ") this.act(kind, subject);
    else if (event.key in STEPS) all[(at + STEPS[event.key] + all.length) % all.length].focus();
    else if (event.key === "Home") all[0].focus();
    else if (event.key === "End") all[all.length - 1].focus();
    else if (event.key === "Escape") this.look(event, "", "");
    else return;
    event.preventDefault();
  }
  // the tab key comes back to what had the focus last
  stop(element) {
    for (const other of of(element.closest("[role=group]"))) if (other.tabIndex === 0 && other !== element) other.setAttribute("tabindex", "-1");
    element.setAttribute("tabindex", "0");
  }
  setRoles(roleOf) { this.roleOf = roleOf; for (const element of of(this.svg)) element.setAttribute("role", roleOf(element.dataset.kind)); }

  // what has the focus, before things are drawn anew; and the same afterwards
  focused() { const now = document.activeElement; return this.svg.contains(now) && now.dataset.kind ? [now.dataset.kind, now.dataset.subject] : null; }
  settle(had) {
    for (const group of this.svg.querySelectorAll("[role=group]")) {
      const all = of(group);
      if (all.length && !all.some(element => element.tabIndex === 0)) all[0].setAttribute("tabindex", "0");
    }
    if (!had || this.svg.contains(document.activeElement)) return;
    const all = of(this.svg), next = all.find(e => e.dataset.kind === had[0] && e.dataset.subject === had[1]) || all.find(e => e.dataset.kind === had[0] && e.tabIndex === 0);
    next?.focus();
  }
}

// ---- what the diagram shows, in words
const MOST = 6;
function some(names) { return names.length > MOST ? `${names.slice(0, MOST).join(", ")} and ${names.length - MOST} more` : names.join(", "); }
const STATES = { used: "heard", ageing: "ageing", impaired: "late or lossy", cut: "cut", old: "not heard", unused: "not used", apart: "in another island" };
export function linkWords(link) { return `link ${link.a} to ${link.b}, ${STATES[link.kind] || link.kind}${link.kind === "impaired" && link.text ? `: ${link.text}` : ""}`; }

export function diagramText(map, pairs, switches, inverters, islands, loads, dead) {
  if (!map) return "";
  const absent = inverters.filter(one => one.note === "no agent").map(one => one.name), open = map.switches.filter(s => !(switches[s.name] ?? s.closed)).map(s => s.alias || s.name);
  const by = kind => [...pairs.values()].filter(pair => pair.kind === kind).map(pair => `${pair.a}–${pair.b}${pair.kind === "impaired" && pair.text ? ` (${pair.text})` : ""}`);
  const links = ["cut", "impaired", "old", "ageing", "apart"].map(kind => [by(kind), kind]).filter(([names]) => names.length).map(([names, kind]) => `${names.length} ${STATES[kind]} (${some(names)})`);
  const set = Object.entries(loads).map(([name, [P, Q]]) => `${name} (${(P / 1e3).toPrecision(4) / 1} kW, ${(Q / 1e3).toPrecision(4) / 1} kvar)`);
  return [
    `${inverters.length} inverters, ${absent.length ? `without an agent: ${some(absent)}` : "all with an agent"}`,
    islands.length ? `${islands.length === 1 ? "island" : "islands"}: ${some(islands)}` : "",
    dead.length ? `de-energised: ${dead.length === 1 ? "bus" : `${dead.length} buses:`} ${some(dead.map(number => map.buses[number]?.[0]))}` : "",
    map.switches.length ? `${map.switches.length} switches, ${open.length ? `${open.length} open (${some(open)})` : "all closed"}` : "",
    `${pairs.size} links, ${links.length ? links.join("; ") : "all heard"}`,
    set.length ? `loads set: ${some(set)}` : "",
  ].filter(Boolean).map(text => `${text[0].toUpperCase()}${text.slice(1)}.`).join(" ");
}
