// The overlay that lists keys and mouse.

import { byId, create, onClick } from "./dom";

const kSections: [string, [string, string][]][] = [
  [
    "Time",
    [
      ["Space", "play, pause; back to now"],
      ["→", "one step, or the next frame"],
      ["←", "back through the last frames"],
      ["Backspace", "reset, or to the beginning"],
      ["+ −", "speed of a recording"],
    ],
  ],
  [
    "View",
    [
      ["drag", "orbit; right button: pan; wheel: zoom"],
      ["Home", "whole scene"],
      ["Shift+X Y Z", "look along an axis; again: from the other side"],
      ["1 – 5, 0", "show or hide a body, all bodies"],
      ["click", "numbers of a particle, or select a tool"],
      ["H", "side panels and plots"],
    ],
  ],
  [
    "Show",
    [
      ["M", "next colour map"],
      ["C F Z", "contacts, forces, zones"],
      ["W T", "wireframe, transparent"],
      ["P", "save the picture as PNG"],
    ],
  ],
  [
    "Drive a tool",
    [
      ["G, double-click", "take a tool, give it back (also Esc)"],
      ["move", "the target, parallel to the screen"],
      ["wheel", "along the shaft, away from you: in; 1 mm a notch, Alt: 0.2 mm"],
      ["right-drag", "turn about the tip; in contact about the place of entry"],
      ["X", "lock to the shaft"],
      ["arrows, PgUp, PgDn", "the same by keys, 1 mm; Alt: 0.2 mm"],
    ],
  ],
];

export class Help {
  private readonly root = byId<HTMLDialogElement>("help");

  constructor() {
    const sections = kSections.map(([title, rows]) =>
      create(
        "section",
        {},
        create("h3", {}, title),
        create(
          "dl",
          {},
          ...rows.flatMap(([keys, text]) => [create("dt", {}, keys), create("dd", {}, text)]),
        ),
      ),
    );
    byId("help-sections").append(...sections);
    onClick(byId("help-button"), () => this.toggle());
    onClick(byId("help-close"), () => this.toggle(false));
  }

  get open(): boolean {
    return !this.root.hidden;
  }

  toggle(on = !this.open): void {
    this.root.hidden = !on;
  }
}
