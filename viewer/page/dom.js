// Elements of the page: found, made, and given a text.
export const $ = id => document.getElementById(id);
export const put = (element, text) => { if (element.textContent !== text) element.textContent = text; };
export function make(tag, properties = {}, ...children) { const made = Object.assign(document.createElement(tag), properties); made.append(...children); return made; }
// the time and the words of an event
export const eventParts = event => [make("span", { className: "time" }, `${event.t.toFixed(2)} s`), make("span", { className: `kind-${event.kind}` }, event.text.replace(/, at t = [0-9.e+]+ s$/, ""))];
