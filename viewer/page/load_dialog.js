// The dialog that sets a load: times its table, or in kW and kvar.
import { $ } from "./dom.js";
const kilo = value => Number((value / 1e3).toPrecision(6));

export class LoadDialog {
  // act(action, key): send an action
  constructor(act) {
    this.dialog = $("load-dialog"); this.act = act; this.name = "";
    const send = values => { this.act({ kind: "load", subject: this.name, ...values }, `load ${this.name}`); this.dialog.close(); };
    $("load-factor-form").addEventListener("submit", event => { event.preventDefault(); send({ factor: $("load-factor").valueAsNumber }); });
    $("load-power-form").addEventListener("submit", event => { event.preventDefault(); send({ P_kW: $("load-P").valueAsNumber, Q_kvar: $("load-Q").valueAsNumber }); });
    this.dialog.addEventListener("click", event => { if (event.target === this.dialog) this.dialog.close(); });
  }
  open(load, set) {
    if (this.dialog.open) return;
    const [P, Q] = set || [load.P, load.Q];
    this.name = load.name;
    $("load-title").textContent = `Load ${load.name}`; $("load-now").textContent = loadWords(load, set);
    $("load-factor").value = load.P ? Number((P / load.P).toPrecision(6)) : 1; $("load-P").value = kilo(P); $("load-Q").value = kilo(Q);
    this.dialog.showModal(); $("load-factor").select();
  }
}

export function loadWords(load, set) {
  const table = `${kilo(load.P)} kW and ${kilo(load.Q)} kvar at nominal voltage`;
  return set ? `set to ${kilo(set[0])} kW and ${kilo(set[1])} kvar; in its table ${table}` : table;
}
