// The colour scale beside the view.

import { colourMap, kZoneColours, viridis, type ColourMapName, type Range } from "./colour_map";
import { byId, create, setText } from "./dom";
import { short } from "./format";

export class Legend {
  private readonly root = byId("legend");
  private readonly title = create("div", { className: "legend-title" });
  private readonly max = create("div", { className: "legend-end" });
  private readonly min = create("div", { className: "legend-end" });
  private readonly scale = create("div", { className: "legend-scale" });
  private readonly swatches = create("div", { className: "legend-swatches" });

  constructor() {
    const stops = Array.from({ length: 17 }, (_, i) => {
      const rgb = viridis(i / 16).map((c) => Math.round(255 * c));
      return `rgb(${rgb.join(" ")})`;
    });
    this.scale.style.background = `linear-gradient(to top, ${stops.join(", ")})`;
    for (const colour of kZoneColours) {
      const swatch = create("span", { className: "legend-swatch" });
      swatch.style.background = colour;
      this.swatches.append(swatch);
    }
    this.root.append(
      this.title,
      create(
        "div",
        { className: "legend-body" },
        this.scale,
        create("div", { className: "legend-ends" }, this.max, this.min),
      ),
      this.swatches,
    );
  }

  /** `known` is false when the frames do not carry the quantity. */
  update(name: ColourMapName, range: Range, locked: boolean, known: boolean): void {
    const map = colourMap(name);
    this.root.hidden = name === "none";
    this.root.classList.toggle("categorical", name === "zone");
    if (name === "zone") {
      setText(this.title, "zone, by number (grey: none)");
      return;
    }
    const note = known ? (locked ? " · locked" : "") : " · not in these frames";
    setText(this.title, `${map.label}, ${map.unit}${note}`);
    setText(this.max, short(range.max * map.scale));
    setText(this.min, short(range.min * map.scale));
  }
}
