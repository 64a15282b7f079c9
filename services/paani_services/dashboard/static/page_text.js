// @ts-check
// Puts the words of the page where its files name them: `data-text` at an element's end, `data-before` at its beginning,
// and `data-label`, `data-title` and `data-placeholder` as the attribute of that kind.

import { PAGE_TEXTS } from "./text.js";

const ATTRIBUTES = { label: "aria-label", title: "title", placeholder: "placeholder" };

for (const element of /** @type {NodeListOf<HTMLElement | SVGElement>} */ (document.querySelectorAll("*"))) {
  const { text, before } = element.dataset;
  if (before) element.prepend(`${PAGE_TEXTS[before]} `);
  if (text) element.append(element.children.length ? ` ${PAGE_TEXTS[text]}` : PAGE_TEXTS[text]);
  for (const [name, attribute] of Object.entries(ATTRIBUTES)) {
    const key = element.dataset[name];
    if (key) element.setAttribute(attribute, PAGE_TEXTS[key]);
  }
}
document.body.dataset.worded = "";
