// Plays a record: the time that is shown, what changes it, and the events to jump to.
import { $, eventParts, make, put } from "./dom.js";
const SPEEDS = [0.1, 0.2, 0.5, 1, 2, 5, 10], LISTED = 2000, MARKED = 300;

export class Player {
  // send(question): asks the server for a time; latest(): time of the last point that the page has; chosen(): agent whose decision is shown
  constructor(send, latest, chosen) {
    Object.assign(this, { send, latest, chosen, record: null, news: null, events: [], t: 0, speed: 1, playing: false, following: true, busy: false, due: false, decided: 0, case: "", shown: 0, wish: null });
    this.readAddress(); addEventListener("hashchange", () => { if (location.hash !== this.address) { this.readAddress(); this.resume(); } });
    const speed = $("speed");
    speed.replaceChildren(...SPEEDS.map(value => new Option(`${value}×`, value, value === 1, value === 1)));
    speed.addEventListener("change", () => { this.speed = Number(speed.value); });
    $("slider").addEventListener("input", () => this.go(this.tick(Math.round(Number($("slider").value) / this.record.T_c))));
    for (const [id, act] of Object.entries({ "to-start": () => this.go(0), back: () => this.step(-1), play: () => this.toggle(), forward: () => this.step(1), "to-end": () => this.toEnd() })) $(id).addEventListener("click", act);
    $("case").addEventListener("change", () => { this.stop(); this.case = $("case").value; this.wish = this.following ? null : this.t; this.ask(); });
    $("goto-form").addEventListener("submit", event => { event.preventDefault(); this.goTo($("goto").valueAsNumber); });
    document.addEventListener("keydown", event => this.key(event));
  }
  get end() { return this.news ? this.news.t_end : 0; }
  get grows() { return ["waiting", "recording"].includes(this.news?.growth); }

  // ---- what the server says
  open(record) {
    this.record = record; this.news = null; this.events = []; this.busy = false; this.due = false; this.playing = false;
    this.following = this.wish === null; this.t = this.wish ?? 0; this.shown = this.t;
    $("event-list").replaceChildren(); $("marks").replaceChildren();
  }
  // a connection that was lost comes back with the record anew
  keepTime() { if (this.record && !this.following) this.wish = this.t; }
  take(news) {
    const first = !this.news || this.news.case !== news.case, grown = first || news.t_end > this.news.t_end || news.growth !== this.news.growth;
    this.news = news; this.list(news.events || []);
    const cases = ["", ...news.cases], select = $("case");
    if (select.options.length !== cases.length) select.replaceChildren(...cases.map(name => new Option(name || `${news.cases.at(-1)}, the latest`, name, false, name === this.case)));
    select.parentElement.hidden = news.cases.length < 2;
    const notes = [...(news.notes || [])], holder = $("notes");
    if (holder.textContent !== notes.join("")) holder.replaceChildren(...notes.map(text => make("li", {}, text)));
    if (this.case && !news.cases.includes(this.case)) this.case = "";
    if (first || grown && this.following) this.ask();
    if (!this.case || this.case === news.case) this.wish = null;
    this.show();
  }
  answered(frame) {
    this.busy = false;
    if (this.following) this.t = frame.t;
    this.shown = frame.t; this.mark(frame.t); this.show();
    if (this.due) this.ask();
  }
  failed() { this.busy = false; }

  // ---- what people do
  tick(k) { return Math.round(k * this.record.T_c * 1e9) / 1e9; }
  go(t) { if (!this.record) return; this.following = false; this.t = Math.min(Math.max(0, t), this.end); this.ask(); this.show(); }
  goTo(t) {
    const beyond = t > this.end + 1e-9;
    $("goto-note").textContent = beyond ? `the record ends at ${this.end.toFixed(2)} s` : "";
    if (t >= 0 && !beyond) { this.stop(); this.go(t); }  // nothing was typed: NaN
  }
  step(n) {
    if (!this.record) return;
    const k = this.t / this.record.T_c;
    this.stop(); this.go(this.tick(n > 0 ? Math.floor(k + 1e-6) + n : Math.ceil(k - 1e-6) + n));
  }
  toEnd() { this.stop(); this.following = true; this.ask(); this.show(); }
  stop() { this.playing = false; this.show(); }
  toggle() {
    if (!this.record) return;
    if (this.playing) { this.stop(); return this.ask(); }
    if (this.t >= this.end - 1e-9 && !this.grows) this.t = 0;
    this.following = false; this.playing = true; this.at = performance.now(); this.show();
    requestAnimationFrame(now => this.run(now));
  }
  run(now) {
    if (!this.playing) return;
    this.t += Math.max(0, now - this.at) / 1000 * this.speed; this.at = Math.max(now, this.at);
    if (this.t >= this.end) { this.playing = false; this.following = true; this.t = this.end; }
    this.ask(); this.show();
    if (this.playing) requestAnimationFrame(next => this.run(next));
  }
  faster(by) { const at = Math.min(Math.max(0, SPEEDS.indexOf(this.speed) + by), SPEEDS.length - 1); this.speed = SPEEDS[at]; $("speed").value = String(this.speed); }
  key(event) {
    if (event.defaultPrevented) return;  // an item of the diagram has taken it
    const at = event.target, scrolls = at.classList?.contains("scroll");
    if (!this.record || event.ctrlKey || event.altKey || event.metaKey || ["SELECT", "TEXTAREA"].includes(at.tagName) || at.tagName === "INPUT" && at.type !== "range") return;
    const acts = { ArrowLeft: () => this.step(event.shiftKey ? -10 : -1), ArrowRight: () => this.step(event.shiftKey ? 10 : 1), "-": () => this.faster(-1), "+": () => this.faster(1) };
    if (!scrolls) Object.assign(acts, { Home: () => { this.stop(); this.go(0); }, End: () => this.toEnd() });
    if (!scrolls && at.tagName !== "BUTTON") acts[" "] = () => this.toggle();
    if (!acts[event.key]) return;
    event.preventDefault(); acts[event.key]();
  }

  // one question is on its way at a time: the next one asks for what is wanted by then
  ask() {
    if (this.busy) { this.due = true; return; }
    this.due = false;
    const latest = this.latest(), now = performance.now(), rests = !this.playing && !this.grows, agent = rests || now - this.decided > 500 ? this.chosen() : "";
    if (agent) this.decided = now;
    this.busy = this.send({ case: this.case, at: this.following ? null : this.t, since: !this.following && latest > this.t ? -1 : latest, agent });
  }

  // ---- what is seen
  show() {
    if (!this.record) return;
    const slider = $("slider"), text = `${this.shown.toFixed(2)} s of ${this.end.toFixed(2)} s`;
    slider.max = String(this.end); slider.value = String(this.t); slider.setAttribute("aria-valuetext", text);
    put($("at"), text); put($("play"), this.playing ? "Pause" : "Play");
    $("to-end").setAttribute("aria-pressed", String(this.following && this.grows));
    this.writeAddress();
    for (const mark of $("marks").children) mark.style.left = `${100 * mark.dataset.t / (this.end || 1)}%`;
  }
  // case and time are in the address: a page that is loaded again, or a link to it, shows the same
  readAddress() {
    const has = new URLSearchParams(location.hash.slice(1)), t = parseFloat(has.get("t"));
    this.case = has.get("case") || ""; this.wish = t >= 0 ? t : null;
  }
  resume() { if (!this.record) return; this.stop(); this.following = this.wish === null; if (!this.following) this.t = Math.min(this.wish, this.end); this.ask(); }
  writeAddress() {
    clearTimeout(this.writing);
    this.writing = setTimeout(() => {
      if (this.playing || this.wish !== null) return;
      const has = new URLSearchParams();
      if (this.case) has.set("case", this.case);
      if (!this.following) has.set("t", String(Math.round(this.t * 1e6) / 1e6));
      this.address = String(has) ? `#${has}` : "";
      if (this.address !== location.hash) history.replaceState(null, "", this.address || location.pathname + location.search);
    }, 150);
  }
  list(events) {
    const list = $("event-list"), marks = $("marks");
    for (const event of events) {
      if (this.events.push(event) > LISTED) continue;
      const button = make("button", { type: "button", className: "jump", onclick: () => { this.stop(); this.go(event.t); } }, ...eventParts(event));
      button.dataset.t = event.t; list.append(make("li", {}, button));
      if (this.events.length > MARKED) continue;
      const mark = make("i", { className: `kind-${event.kind}` }); mark.dataset.t = event.t; marks.append(mark);
    }
    if (this.events.length > LISTED && !list.querySelector(".more")) list.append(make("li", { className: "more" }, `only the first ${LISTED} events are listed`));
  }
  // events after the time that is shown have not happened yet
  mark(t) { for (const button of $("event-list").querySelectorAll(".jump")) button.classList.toggle("to-come", button.dataset.t > t + 1e-9); }
}
