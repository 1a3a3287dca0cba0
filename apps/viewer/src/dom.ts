// SPDX-License-Identifier: Apache-2.0
// Elements by function calls. Texts are set as text, never as HTML: names in files may hold anything.

type Child = Node | string | null | undefined;
type Properties = Record<string, string | number | boolean | ((event: any) => void)>;

function fill(element: Element, properties: Properties, children: Child[]) {
  for (const [name, value] of Object.entries(properties)) {
    if (typeof value === "function") element.addEventListener(name, value as EventListener);
    else if (typeof value === "boolean") element.toggleAttribute(name, value);
    else if (name === "style") (element as HTMLElement).style.cssText = String(value);  // as the content policy allows
    else element.setAttribute(name, String(value));
  }
  for (const child of children) if (child !== null && child !== undefined) element.append(child);
}

export function h<K extends keyof HTMLElementTagNameMap>(tag: K, properties: Properties = {}, ...children: Child[]) {
  const element = document.createElement(tag);
  fill(element, properties, children);
  return element;
}

export function svg(tag: string, properties: Properties = {}, ...children: Child[]): SVGElement {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag) as SVGElement;
  fill(element, properties, children);
  return element;
}

export function slider(label: string, least: number, most: number, step: number, value: number, change: (value: number) => void,
                       unit = ""): HTMLElement {
  const shown = h("output", {}, `${value}${unit}`);
  const input = h("input", { type: "range", min: least, max: most, step, value, input: () => {
    shown.textContent = `${input.valueAsNumber}${unit}`;
    change(input.valueAsNumber);
  } });
  return h("label", { class: "row" }, h("span", {}, label), input, shown);
}

export function choice(label: string, names: [string, string][], value: string, change: (value: string) => void): HTMLElement {
  const select = h("select", { change: () => change(select.value) },
    ...names.map(([key, text]) => h("option", { value: key, selected: key === value }, text)));
  return h("label", { class: "row" }, h("span", {}, label), select);
}

export function toggle(label: string, value: boolean, change: (value: boolean) => void): HTMLElement {
  const input = h("input", { type: "checkbox", checked: value, change: () => change(input.checked) });
  return h("label", { class: "row check" }, input, h("span", {}, label));
}

export const number = (value: number | undefined, digits = 2): string =>
  value === undefined || !Number.isFinite(value) ? "–" : value.toFixed(digits);
