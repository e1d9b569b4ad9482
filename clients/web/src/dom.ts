// Small helpers for the parts of the page that are plain HTML.

/** The element with this id, which index.html promises. */
export function byId<T extends HTMLElement = HTMLElement>(id: string): T {
  const element = document.getElementById(id);
  if (!element) throw new Error(`index.html has no #${id}`);
  return element as T;
}

/** A new element with properties and children. */
export function create<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  properties: Partial<HTMLElementTagNameMap[K]> = {},
  ...children: (Node | string)[]
): HTMLElementTagNameMap[K] {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

/** Sets text only when it differs: an unchanged page is not laid out again. */
export function setText(element: HTMLElement, text: string): void {
  if (element.textContent !== text) element.textContent = text;
}

/**
 * Lets keys go on working after a click: the button does not keep the focus that a mouse gave it.
 */
export function onClick(element: HTMLElement, action: () => void): void {
  element.addEventListener("click", (event) => {
    if (event.detail > 0) element.blur();
    action();
  });
}
