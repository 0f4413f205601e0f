// The page of a run: takes frames from the server, shows them, and sends what is clicked.
import { Diagram, pairOf } from "./diagram.js";
import { diagramText } from "./diagram_keys.js";
import { $, eventParts, make, put } from "./dom.js";
import { LoadDialog, loadWords } from "./load_dialog.js";
import { Player } from "./player.js";
import { Strips } from "./strips.js";

const silence = () => 1000 * (S.hello?.silent_s ?? 1); // ms without a word after which the numbers are old
const S = { hello: null, map: null, frame: null, links: new Map(), switches: {}, loads: {}, dead: [], events: [], inverters: new Map(), pending: new Map(), lit: "", tip: null, heard: 0, socket: null, chosen: "" };
window.gridpeersView = S;

const diagram = new Diagram($("diagram"), click, look), strips = new Strips($("canvases")), loadDialog = new LoadDialog(act);
const player = new Player(ask, () => strips.points.length ? strips.latest : -1, () => S.chosen);
window.gridpeersPlayer = player;
const number = (value, digits) => value === null || value === undefined ? "–" : value.toFixed(digits).replace(/^-(0\.?0*)$/, "$1");
const COLUMNS = [
  ["agent", "", i => i.name], ["island", "", i => i.island || "–", "text"], ["f", "Hz", i => number(i.f, 3)], ["P", "kW", i => number(i.P, 1)],
  ["P_set", "kW", i => number(i.P_set, 1)], ["P", "pu", i => number(i.P_share, 3)], ["Q", "kvar", i => number(i.Q, 1)], ["V", "pu", i => number(i.V, 4)],
  ["V_set", "pu", i => number(i.V_set, 4)], ["hears", "", i => i.hears ?? "–"],
  ["age", "s", i => { const ages = Object.values(i.ages); return ages.length ? number(Math.max(...ages), 2) : "–"; }, "age"],
  ["in", "", i => i.received ?? "–", "count"], ["out", "", i => i.sent ?? "–", "count"], ["lost", "", i => i.lost ?? "–", "count"], ["", "", i => i.note, "text note"],
];

// ---- colours: a hue for each microgrid
function colourOf(name) {
  const row = S.map?.inverters.find(one => one.name === name);
  const groups = [...new Set((S.map?.inverters || []).map(one => one.microgrid))];
  return getComputedStyle(document.documentElement).getPropertyValue(`--mg${Math.max(0, groups.indexOf(row?.microgrid)) % 6}`).trim();
}
// lines of one microgrid differ in lightness
function lineColours() {
  const count = new Map(), total = new Map();
  const group = name => S.map?.inverters.find(one => one.name === name)?.microgrid ?? "";
  for (const name of strips.names) total.set(group(name), (total.get(group(name)) || 0) + 1);
  return strips.names.map(name => {
    const mine = group(name), k = count.get(mine) || 0, n = total.get(mine);
    count.set(mine, k + 1);
    return `color-mix(in oklab, ${colourOf(name)} ${n === 1 ? 100 : Math.round(100 - 45 * k / (n - 1))}%, ${matchMedia("(prefers-color-scheme: dark)").matches ? "white" : "black"})`;
  });
}
function legend() {
  document.querySelectorAll(".key .microgrid").forEach(item => item.remove());
  const rows = (S.map?.inverters || []).filter(row => row.microgrid), named = new Map(rows.map(row => [row.microgrid, row.name]));
  for (const [microgrid, one] of named) {
    const mark = make("i", { className: "m", style: `background:${colourOf(one)}` });
    document.querySelector(".key").append(make("li", { className: "microgrid" }, mark, microgrid));
  }
}
let colours = [];
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { recolour(); legend(); render(); });
function recolour() { colours = lineColours(); if (S.map) diagram.setMap(S.map, colourOf); document.querySelectorAll(".dot").forEach(dot => { dot.style.background = colourOf(dot.dataset.name); }); }

// ---- the connection
function connect() {
  const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/frames`);
  S.socket = socket;
  socket.onmessage = event => { S.heard = performance.now(); take(JSON.parse(event.data)); };
  socket.onclose = event => { if (event.code === 4403) { location.reload(); return; } render(); setTimeout(connect, 1000); };
}
function take(message) {
  if (message.hello) {
    S.hello = message.hello; player.keepTime(); entitle("", "", S.hello.run);
    $("control").hidden = $("tools").hidden = !S.hello.control; $("player").hidden = $("decision").hidden = !S.hello.record; strips.end = null; strips.length = 30; put($("strips-title"), "Last 30 s");
    $("rights").textContent = S.hello.record ? `record ${S.hello.where}, read-only` : S.hello.control ? "" : "read-only; start the view with --control to act";
    document.body.classList.toggle("can-act", S.hello.control); document.body.classList.toggle("record", !!S.hello.record); heads();
    diagram.keys.setRoles(kind => S.hello.control || S.hello.record && kind === "agent" ? "button" : "img");
    clear();
  } else if (message.record) { takeRecord(message.record); }
  else if (message.news) { player.take(message.news); if (S.frame) render(); }
  else if (message.decision) { takeDecision(message.decision); }
  else if (message.problem) { player.failed(); put($("live-text"), message.problem); }
  else if (message.map) {
    S.map = message.map; if (!S.hello.record) entitle(S.map.scenario, S.map.case, S.hello.run);
    recolour(); legend(); fill($("switch"), S.map.switches.map(s => [s.name, s.alias ? `${s.alias} (${s.name})` : s.name]));
    fill($("load"), (S.map.loads || []).map(load => [load.name, load.name])); $("load-choice").hidden = !S.map.loads?.length;
  } else if (message.done) { done(message.done); }
  else if (message.frame) { takeFrame(message.frame); }
}
// what runs, in the head of the page and in the tab: a run of several is known by its name as well
function entitle(scenario, name, run = "") {
  const text = [scenario + (name ? `, case ${name}` : ""), run && (scenario ? `run ${run}` : run)].filter(Boolean).join(" · ");
  put($("run"), text); document.title = `${text} – gridpeers view`;
}
function clear() { S.links.clear(); S.pairs = null; strips.clear(); if (!S.hello.record) { S.events = []; $("event-list").replaceChildren(); } }
function takeFrame(frame) {
  if (frame.reset) clear();
  S.frame = frame;
  if (frame.names && String(frame.names) !== String(strips.names)) { strips.clear(); strips.names = frame.names; colours = lineColours(); for (const id of ["link-a", "link-b"]) fill($(id), frame.names.map(name => [name, name])); $("link-b").selectedIndex = Math.min(1, frame.names.length - 1); }
  if (frame.points) strips.add(frame.points);
  if (frame.links) { for (const [dst, links] of Object.entries(frame.links)) S.links.set(dst, links); S.pairs = pairs(); }
  if (frame.switches) { S.switches = frame.switches; for (const name of Object.keys(frame.switches)) S.pending.delete(name); }
  if (frame.loads) { S.loads = frame.loads; for (const key of [...S.pending.keys()]) if (key.startsWith("load ")) S.pending.delete(key); }
  if (frame.dead) S.dead = frame.dead;
  S.inverters = new Map(frame.inverters.map(one => [one.name, one]));
  for (const event of frame.events || []) {
    S.events.push(event);
    $("event-list").prepend(make("li", {}, ...eventParts(event)));
  }
  while (!S.hello.record && S.events.length > 200) { S.events.shift(); $("event-list").lastChild.remove(); }
  if (S.hello.record) { strips.length = Math.min(30, Math.max(1, frame.t)); strips.end = Math.max(frame.t, strips.length); put($("strips-title"), frame.t < 30 ? "From the start" : "30 s up to then"); player.answered(frame); }
  render();
}

// ---- links in pairs: the worse direction gives the look
const RANK = { cut: 6, impaired: 5, old: 4, unused: 3, apart: 2, ageing: 1, used: 0 };
function pairs() {
  const found = new Map();
  for (const [dst, links] of S.links) for (const link of links) {
    const kind = link.cut ? "cut" : link.holds ? "impaired" : link.ageing ? "ageing" : link.state, key = pairOf(link.src, dst);
    const pair = found.get(key) || { a: key.split("|")[0], b: key.split("|")[1], kind, rate: 0, text: "", ways: [] };
    if (RANK[kind] >= RANK[pair.kind]) pair.kind = kind;
    if (link.holds) pair.text = link.holds.join(", ");
    pair.rate = Math.max(pair.rate, link.rate || 0); pair.ways.push({ ...link, dst }); found.set(key, pair);
  }
  return found;
}

// ---- showing
let due = false;
function render() { if (!due) { due = true; requestAnimationFrame(() => { due = false; draw(); }); } }
function draw() {
  const frame = S.frame, lost = S.heard && (performance.now() - S.heard > silence() || S.socket.readyState !== 1);
  const live = lost ? "lost" : frame ? S.hello.record ? player.grows ? "recording" : "record" : frame.live.word : "waiting", current = ["live", "record", "recording"].includes(live);
  if (document.body.dataset.live !== live) document.body.dataset.live = live;
  put($("live-text"), lost ? "the server of this page does not answer: these numbers are old" : !frame ? "connecting" : S.hello.record ? ["record", player.news?.text, frame.live.text === "record" ? "" : frame.live.text].filter(Boolean).join(". ") : frame.live.text);
  if (!frame) return;
  put($("time"), frame.t === null ? "" : `t = ${frame.t.toFixed(2)} s`); put($("pace"), current ? frame.pace : "");
  const inverters = frame.inverters.map(one => current ? one : stale(one));
  const islands = [...new Set(inverters.map(one => one.island).filter(Boolean))];
  put($("islands"), islands.length ? `islands: ${islands.join(", ")}` : "");
  S.pairs ||= pairs();
  const states = new Map(inverters.map(one => [one.name, { absent: one.note === "no agent", V: one.V, off: one.off_voltage }]));
  for (const [key, kind] of S.pending) if (kind === "stop" && states.get(key)?.absent || kind === "start" && states.get(key)?.absent === false) S.pending.delete(key);
  diagram.update(S.pairs, S.switches, states, S.pending, S.lit, S.loads, S.dead);
  put($("diagram-text"), `${current ? "" : "Last known state, not the present one. "}${diagramText(S.map, S.pairs, S.switches, frame.inverters, islands, S.loads, S.dead)}`);
  const silent = frame.live.since || (lost ? (performance.now() - S.heard) / 1000 : 0);
  // most frames have statuses alone: the strips, which take most of the time, stay as they are
  const now = [strips.latest, strips.end, strips.points.length, S.lit, current ? 0 : silent.toFixed(1), S.events.length, innerWidth, devicePixelRatio, colours.join()].join("|");
  if (now !== S.drawn) { S.drawn = now; strips.lit = S.lit; strips.draw(current ? 0 : Math.min(25, silent * (frame.speed ?? 1)), (S.hello.record ? player.events : S.events).map(event => [event.t, event.kind]), colours); }
  rows(inverters);
  if (S.tip) showTip();
}
const acts = () => S.hello.control || S.hello.record;
const stale = one => ({ ...one, f: null, P: null, P_set: null, P_share: null, Q: null, V: null, V_set: null, ages: {}, hears: null, late: false, off_voltage: false, received: null, sent: null, lost: null, island: "" });
function heads() {
  const head = document.querySelector("thead tr"); head.replaceChildren(); document.querySelector("tbody").replaceChildren();
  for (const [title, unit, , kind] of [COLUMNS[0], ...(acts() ? [["", "", null, ""]] : []), ...COLUMNS.slice(1)]) {
    head.append(make("th", { scope: "col", className: `${title === "agent" ? "text " : ""}${kind || ""}`.trim() }, title, ...(unit ? [make("small", {}, unit)] : [])));
  }
}
const tableRows = new Map();
function rows(inverters) {
  const body = document.querySelector("tbody");
  if (!body.children.length) tableRows.clear();
  for (const one of inverters) {
    let row = tableRows.get(one.name);
    if (!row) {
      const cells = COLUMNS.map(([, , , kind], c) => make(c ? "td" : "th", { className: `${c ? "" : "text "}${kind || ""}`.trim() }));
      const dot = make("span", { className: "dot", style: `background:${colourOf(one.name)}` }), text = make("span");
      dot.dataset.name = one.name; cells[0].scope = "row"; cells[0].append(dot, text);
      const button = acts() ? make("button", { type: "button", onclick: () => click("agent", one.name) }) : null;
      const line = make("tr", { onpointerenter: () => light(one.name), onpointerleave: () => light("") }, cells[0], ...(button ? [make("td", { className: "act" }, button)] : []), ...cells.slice(1));
      body.append(line);
      row = { line, cells, text, button }; tableRows.set(one.name, row);
    }
    COLUMNS.forEach(([, , value], c) => put(c ? row.cells[c] : row.text, String(value(one))));
    row.cells[10].classList.toggle("warn", one.late); row.cells[13].classList.toggle("warn", one.lost > 0);
    row.line.classList.toggle("lit", S.lit === one.name);
    if (row.button && S.hello.record) { put(row.button, "Why"); row.button.setAttribute("aria-label", `Show how ${one.name} decided`); row.button.setAttribute("aria-pressed", String(S.chosen === one.name)); }
    else if (row.button) { const absent = one.note === "no agent"; put(row.button, absent ? "Start" : "Stop"); row.button.setAttribute("aria-label", `${absent ? "Start" : "Stop"} the agent of ${one.name}`); row.button.disabled = S.pending.has(one.name); }
  }
  for (const [name, row] of tableRows) if (!inverters.some(one => one.name === name)) { row.line.remove(); tableRows.delete(name); }
}
function light(name) { if (S.lit !== name) { S.lit = name; render(); } }
function fill(select, options) { select.replaceChildren(...options.map(([value, text]) => new Option(text, value))); }

// ---- a record
function ask(question) { if (S.socket?.readyState !== 1) return false; S.socket.send(JSON.stringify(question)); return true; }
function takeRecord(record) {
  clear(); S.frame = null; strips.names = []; strips.setShared(record.shared); player.open(record);
  entitle(record.scenario, record.case);
  if (!record.agents.includes(S.chosen)) choose("");
}
function choose(name) {
  S.chosen = name; put($("decision-of"), name ? `of ${name}` : ""); $("decision-text").hidden = $("decision-command").hidden = $("decision-close").hidden = !name; $("decision-hint").hidden = !!name;
  if (name) { put($("decision-text"), "..."); put($("decision-command"), ""); S.reveal = true; reveal(); player.decided = 0; player.ask(); }
  render();
}
function reveal() { $("decision").scrollIntoView({ block: "nearest" }); }
function takeDecision(decision) {
  if (decision.agent !== S.chosen) return;
  put($("decision-text"), decision.text); put($("decision-command"), decision.command); $("decision-text").classList.toggle("bad", !decision.ok);
  if (S.reveal) { S.reveal = false; reveal(); }
}
$("decision-close").addEventListener("click", () => choose(""));

// ---- what the pointer is above
function look(event, kind, subject) { S.tip = kind ? { x: event.clientX, y: event.clientY, kind, subject } : null; light(kind === "agent" ? subject : ""); showTip(); }
function showTip() {
  const tip = $("tip"), text = S.tip ? tipText(S.tip.kind, S.tip.subject) : "";
  tip.hidden = !text; if (!text) return;
  put(tip, text); const box = tip.getBoundingClientRect();
  tip.style.left = `${Math.min(S.tip.x + 14, innerWidth - box.width - 8)}px`; tip.style.top = `${Math.min(S.tip.y + 14, innerHeight - box.height - 8)}px`;
}
function tipText(kind, subject) {
  const does = deed => S.hello?.control || S.hello?.record && deed === "show how it decided" ? `\nclick: ${deed}` : "";
  if (kind === "switch") return `switch ${subject}: ${S.switches[subject] ?? true ? "closed" : "open"}${does(S.switches[subject] ?? true ? "open it" : "close it")}`;
  if (kind === "load") { const load = loadOf(subject); return load ? `load ${subject}: ${loadWords(load, S.loads[subject])}${does("set it")}` : ""; }
  if (kind === "agent") {
    const one = S.inverters.get(subject);
    if (!one) return subject;
    return `${one.name}${one.note ? `: ${one.note}` : ""}\nP ${number(one.P_share, 3)} pu, Q ${number(one.Q, 1)} kvar\nV ${number(one.V, 4)} pu, f ${number(one.f, 3)} Hz${does(S.hello?.record ? "show how it decided" : one.note === "no agent" ? "start its agent" : "stop its agent")}`;
  }
  const pair = S.pairs?.get(subject);
  if (!pair) return "";
  const lines = pair.ways.map(way => `${way.src} → ${way.dst}: ${way.holds ? way.holds.join(", ") : way.state}, ${way.age < 0 ? "never heard" : `age ${(S.inverters.get(way.dst)?.ages[way.src] ?? way.age).toFixed(2)} s`}, ${way.rate || 0} msg/s${way.lost ? `, lost ${Math.round(100 * way.lost)} %` : ""}`);
  const tool = document.querySelector("input[name=tool]:checked").value;
  return lines.join("\n") + (tool === "look" ? "" : does(tool === "cut" ? (pair.kind === "cut" || pair.kind === "impaired" ? "heal it" : "cut it") : tool === "delay" ? `delay it by ${$("delay").value} s` : `lose ${100 * $("loss").value} %`));
}

// ---- what is clicked
function loadOf(name) { return S.map?.loads?.find(load => load.name === name); }
function click(kind, subject) {
  if (S.hello?.record && kind === "agent") choose(S.chosen === subject ? "" : subject);
  if (!S.hello?.control || S.pending.has(subject)) return;
  if (kind === "load") { loadDialog.open(loadOf(subject), S.loads[subject]); return; }
  if (kind === "switch") act({ kind: S.switches[subject] ?? true ? "open" : "close", subject }, subject);
  else if (kind === "agent") act({ kind: S.inverters.get(subject)?.note === "no agent" ? "start" : "stop", subject }, subject);
  else {
    const [a, b] = subject.split("|"), tool = document.querySelector("input[name=tool]:checked").value, hurt = ["cut", "impaired"].includes(S.pairs.get(subject)?.kind);
    if (tool !== "look") act(tool === "cut" ? { kind: hurt ? "heal" : "cut", subject: a, other: b } : { kind: tool, subject: a, other: b, value: Number($(tool).value) }, subject);
  }
}
const waiting = [];
function act(action, key) { S.socket.send(JSON.stringify(action)); waiting.push(key); S.pending.set(key, action.kind); setTimeout(() => { S.pending.delete(key); render(); }, 8000); render(); }
function done(result) {
  const key = result.command ? waiting.shift() : null, kind = S.pending.get(key);
  if (key && !(result.ok && (kind === "stop" || kind === "start"))) S.pending.delete(key);
  const line = make("li", { className: result.ok ? "" : "bad" }, ...(result.command ? [make("code", {}, result.command)] : []), make("span", {}, result.text));
  if (result.scenario) line.append(make("details", {}, make("summary", {}, "in a scenario"), make("pre", {}, result.scenario)));
  $("command-list").prepend(line);
  while ($("command-list").children.length > 100) $("command-list").lastChild.remove();
  render();
}
$("link-form").addEventListener("submit", event => {
  event.preventDefault(); const kind = event.submitter.value, a = $("link-a").value, b = $("link-b").value;
  act(kind === "heal all" ? { kind } : { kind, subject: a, other: b, value: Number($(kind)?.value || 0) }, kind === "heal all" ? "heal all" : pairOf(a, b));
});
$("switch-form").addEventListener("submit", event => { event.preventDefault(); act({ kind: event.submitter.value, subject: $("switch").value }, $("switch").value); });
$("load-choice").addEventListener("submit", event => { event.preventDefault(); click("load", $("load").value); });

setInterval(() => { if (performance.now() - S.heard > silence()) render(); }, 250);
connect();
