// The strip of plots: force, depth, step time.

import uPlot from "uplot";
import { byId } from "./dom";
import { axialForceN, forceN } from "./driving";
import { fixed } from "./format";
import type { Frame } from "./gen/adhesim/v1/frame_pb";
import { Series } from "./series";

// 30 s at 20 Hz, and the quarter that makes room.
const kRows = 800;
const kWindowS = 30;
// A recording's plots: several rows for each pixel of a wide screen.
export const kRecordingRows = 6000;

interface Line {
  label: string;
  colour: string;
}

interface Spec {
  id: string;
  title: string;
  unit: string;
  decimals: number;
  lines: Line[];
}

const kSpecs: Spec[] = [
  {
    id: "plot-force",
    title: "tool force, N",
    unit: "N",
    decimals: 2,
    lines: [
      { label: "magnitude", colour: "--plot-1" },
      { label: "axial", colour: "--plot-2" },
    ],
  },
  {
    id: "plot-depth",
    title: "depth, mm",
    unit: "mm",
    decimals: 1,
    lines: [{ label: "depth", colour: "--plot-3" }],
  },
  {
    id: "plot-step",
    title: "step time, µs",
    unit: "µs",
    decimals: 0,
    lines: [
      { label: "step", colour: "--plot-1" },
      { label: "budget", colour: "--plot-4" },
    ],
  },
];

export class Plots {
  private live = Plots.empty(kRows);
  private shown = this.live;
  private recording = false;
  private changed = false;
  private readonly plots: uPlot[];
  private cursorS = 0;

  constructor() {
    this.plots = kSpecs.map((spec) => this.plot(spec));
    const resizing = new ResizeObserver(() => this.resize());
    for (const { id } of kSpecs) resizing.observe(byId(id));
  }

  /** An empty set of rows: time, force, axial force, depth, step time, budget. */
  static empty(rows: number): Series {
    return new Series(6, rows);
  }

  static row(
    series: Series,
    timeS: number,
    frame: Pick<Frame, "tools" | "stepDurationS">,
    tool: number,
    budgetS: number,
  ): void {
    const state = frame.tools[tool];
    series.push(
      timeS,
      state ? forceN(state) : 0,
      state ? axialForceN(state) : 0,
      (state?.depthM ?? 0) * 1000,
      frame.stepDurationS * 1e6,
      budgetS * 1e6,
    );
  }

  add(timeS: number, frame: Frame, tool: number, budgetS: number): void {
    Plots.row(this.live, timeS, frame, tool, budgetS);
    this.changed ||= !this.recording;
  }

  clear(): void {
    this.live.clear();
    this.changed = true;
  }

  /** Shows a recording's rows, or the live ones again. */
  show(recording: Series | undefined): void {
    this.recording = recording !== undefined;
    this.shown = recording ?? this.live;
    this.changed = true;
  }

  /** The moment that is shown of a recording. */
  setCursor(timeS: number): void {
    this.changed ||= this.cursorS !== timeS;
    this.cursorS = timeS;
  }

  /** Draws what changed since the last time. */
  draw(): void {
    if (!this.changed) return;
    this.changed = false;
    const [time, force, axial, depth, step, budget] = this.shown.columns();
    const data = [
      [time, force, axial],
      [time, depth],
      [time, step, budget],
    ];
    for (const [i, plot] of this.plots.entries())
      plot.setData(data[i] as unknown as uPlot.AlignedData);
  }

  /** The colours of the theme have changed. */
  redraw(): void {
    for (const plot of this.plots) plot.redraw(false, true);
  }

  private resize(): void {
    for (const plot of this.plots) {
      const parent = plot.root.parentElement!;
      plot.setSize(plotSize(parent));
    }
  }

  private plot(spec: Spec): uPlot {
    const root = byId(spec.id);
    const muted = () => themeColour("--muted");
    const axis: uPlot.Axis = {
      stroke: muted,
      font: "11px system-ui, sans-serif",
      grid: { stroke: () => themeColour("--line"), width: 1 },
      ticks: { show: false },
    };
    const options: uPlot.Options = {
      ...plotSize(root),
      title: spec.title,
      legend: { show: true, live: true },
      cursor: { drag: { x: false, y: false } },
      scales: {
        x: { time: false, range: (_, min, max) => this.timeRange(min, max) },
        y: { range: (_, min, max) => valueRange(min, max) },
      },
      axes: [
        {
          ...axis,
          size: 20,
          gap: 2,
          space: 70,
          values: (_, ticks) => ticks.map((t) => `${Number(t.toFixed(3))}`),
        },
        { ...axis, size: 44, gap: 3, space: 22 },
      ],
      series: [
        { label: "s", value: (_, value) => (value === null ? "" : value.toFixed(2)) },
        ...spec.lines.map(({ label, colour }) => ({
          label,
          stroke: () => themeColour(colour),
          width: 1.25,
          points: { show: false },
          value: (_: uPlot, value: number | null) =>
            value === null ? "" : fixed(value, spec.decimals),
        })),
      ],
      hooks: { draw: [(plot) => this.drawCursor(plot)] },
    };
    return new uPlot(options, [[], ...spec.lines.map(() => [])], root);
  }

  private timeRange(min: number | null, max: number | null): [number, number] {
    if (min === null || max === null) return [0, kWindowS];
    if (this.recording) return [min, Math.max(max, min + 0.1)];
    return [Math.max(0, max - kWindowS), Math.max(max, kWindowS)];
  }

  private drawCursor(plot: uPlot): void {
    if (!this.recording) return;
    const x = plot.valToPos(this.cursorS, "x", true);
    const { ctx, bbox } = plot;
    if (x < bbox.left || x > bbox.left + bbox.width) return;
    ctx.save();
    ctx.strokeStyle = themeColour("--accent");
    ctx.lineWidth = window.devicePixelRatio;
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
    ctx.restore();
  }
}

// Zero stays in view, so that heights can be compared; flat lines have some air.
function valueRange(min: number | null, max: number | null): [number, number] {
  const low = Math.min(0, min ?? 0);
  const high = Math.max(0, max ?? 0);
  const air = Math.max(0.08 * (high - low), 1e-6);
  return high - low < 1e-9 ? [-0.1, 1] : [low - (low < 0 ? air : 0), high + air];
}

function plotSize(parent: HTMLElement): { width: number; height: number } {
  // The title and the legend share the plot's first line.
  return {
    width: Math.max(60, parent.clientWidth),
    height: Math.max(60, parent.clientHeight - 20),
  };
}

const kStyle = getComputedStyle(document.documentElement);

function themeColour(name: string): string {
  return kStyle.getPropertyValue(name).trim();
}
