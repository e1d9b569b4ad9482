// What the view shows and how: the settings, and the panel that changes them.

import GUI, { type Controller } from "lil-gui";
import { colourMap, kColourMaps, type ColourMapName } from "./colour_map";

export interface Display {
  colourMap: ColourMapName;
  /** Keeps the legend's range, in its units. */
  lockRange: boolean;
  rangeMin: number;
  rangeMax: number;
  contacts: boolean;
  zones: boolean;
  forces: boolean;
  wireframe: boolean;
  transparent: boolean;
  ground: boolean;
  /** Length of force arrows, mm a newton. */
  arrowMmPerN: number;
  /** Forces below this are not drawn, N. */
  arrowThresholdN: number;
}

/** End of the scale of arrows, mm a newton. */
export const kLongestMmPerN = 1000;

export function defaultDisplay(): Display {
  return {
    colourMap: "none",
    lockRange: false,
    rangeMin: 0,
    rangeMax: 1,
    contacts: true,
    zones: true,
    forces: true,
    wireframe: false,
    transparent: false,
    ground: true,
    arrowMmPerN: 30,
    arrowThresholdN: 0.001,
  };
}

const kToggles = ["contacts", "zones", "forces", "wireframe", "transparent", "ground"] as const;
export type Toggle = (typeof kToggles)[number];

export class DisplayPanel {
  private readonly gui: GUI;
  private readonly controllers = new Map<keyof Display, Controller>();

  constructor(
    container: HTMLElement,
    private readonly display: Display,
    private readonly onChange: () => void,
  ) {
    this.gui = new GUI({ container, title: "Display" });
    dropIconFont();
    const names = kColourMaps.map((map) => map.name);
    const map = this.add("colourMap", this.gui.add(display, "colourMap", names), "Colour");
    labelSelect(map, "colour-map");
    this.add("lockRange", this.gui.add(display, "lockRange"), "Lock range");
    this.add("rangeMin", this.gui.add(display, "rangeMin").decimals(4), "Range from");
    this.add("rangeMax", this.gui.add(display, "rangeMax").decimals(4), "Range to");
    this.toggle("contacts", "Contacts (C)");
    this.toggle("zones", "Zones (Z)");
    this.toggle("forces", "Forces (F)");
    this.add("arrowMmPerN", this.gui.add(display, "arrowMmPerN", 1, kLongestMmPerN, 1), "mm per N");
    this.add("arrowThresholdN", this.gui.add(display, "arrowThresholdN", 0, 0.5, 0.001), "From N");
    this.toggle("wireframe", "Wireframe (W)");
    this.toggle("transparent", "Transparent (T)");
    this.toggle("ground", "Floor");
    this.gui.onChange(() => this.changed());
    this.gui.domElement.addEventListener("change", (event) => {
      // A chosen entry does not keep the focus: keys belong to the view again.
      if (event.target instanceof HTMLSelectElement) event.target.blur();
    });
    this.refresh();
  }

  flip(toggle: Toggle): void {
    this.display[toggle] = !this.display[toggle];
    this.changed();
  }

  /** Switches a toggle off; other names mean nothing. */
  hide(name: string): void {
    const toggle = kToggles.find((known) => known === name);
    if (toggle && this.display[toggle]) this.flip(toggle);
  }

  nextColourMap(): void {
    const at = kColourMaps.findIndex((map) => map.name === this.display.colourMap);
    this.setColourMap(kColourMaps[(at + 1) % kColourMaps.length].name);
  }

  setColourMap(name: string): void {
    this.display.colourMap = colourMap(name).name;
    this.changed();
  }

  /** Shows values that something else than this panel changed. */
  refresh(): void {
    for (const controller of this.controllers.values()) controller.updateDisplay();
    const scalar = !["none", "zone"].includes(this.display.colourMap);
    this.controllers.get("lockRange")!.show(scalar);
    for (const limit of ["rangeMin", "rangeMax"] as const) {
      this.controllers.get(limit)!.show(scalar && this.display.lockRange);
    }
  }

  private changed(): void {
    this.refresh();
    this.onChange();
  }

  private toggle(name: Toggle, label: string): void {
    this.add(name, this.gui.add(this.display, name), label);
  }

  private add(name: keyof Display, controller: Controller, label: string): Controller {
    this.controllers.set(name, controller.name(label));
    return controller;
  }
}

// lil-gui brings a font for its arrows and ticks as a data: address, which the server's content
// security policy refuses, and rightly says so in the console. The system's fonts have the same
// characters.
function dropIconFont(): void {
  for (const sheet of document.styleSheets) {
    // Without an address: a style element of this page's scripts.
    if (sheet.href !== null) continue;
    for (let rule = sheet.cssRules.length - 1; rule >= 0; rule--) {
      if (sheet.cssRules[rule] instanceof CSSFontFaceRule) sheet.deleteRule(rule);
    }
  }
}

// Entries are known by the name of their map and read by its label.
function labelSelect(controller: Controller, id: string): void {
  const select = controller.domElement.querySelector("select")!;
  select.id = id;
  for (const option of select.options) {
    option.value = option.textContent ?? "";
    option.textContent = colourMap(option.value).label;
  }
  const shown = controller.domElement.querySelector(".lil-display");
  const update = controller.updateDisplay.bind(controller);
  controller.updateDisplay = () => {
    update();
    if (shown) shown.textContent = colourMap(select.value).label;
    return controller;
  };
}
