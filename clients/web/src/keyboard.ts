// Which key does what. Keys that are typed into a field, or that work a focused control, stay with
// it.

import type { Toggle } from "./display";
import type { AxisView } from "./scene3d";

export interface KeyActions {
  play(): void;
  forward(): void;
  back(): void;
  reset(): void;
  speed(notches: number): void;
  grab(): void;
  release(): void;
  axisLock(): void;
  home(): void;
  axisView(view: AxisView): void;
  toggle(what: Toggle): void;
  nextColourMap(): void;
  body(index: number): void;
  screenshot(): void;
  help(): void;
  closeHelp(): boolean;
  panels(): void;
  /** A key that drives the tool; false when it does not. */
  drive(event: KeyboardEvent): boolean;
}

const kToggles: Record<string, Toggle> = {
  c: "contacts",
  f: "forces",
  z: "zones",
  w: "wireframe",
  t: "transparent",
};

export function listenToKeys(actions: KeyActions): void {
  let lastView: AxisView | undefined;
  const axisView = (axis: "x" | "y" | "z") => {
    lastView = lastView === axis ? `-${axis}` : axis;
    actions.axisView(lastView);
  };
  const plain: Record<string, () => void> = {
    " ": actions.play,
    ArrowRight: actions.forward,
    ArrowLeft: actions.back,
    Backspace: actions.reset,
    "+": () => actions.speed(1),
    "=": () => actions.speed(1),
    "-": () => actions.speed(-1),
    Home: actions.home,
    F1: actions.help,
    "?": actions.help,
    g: actions.grab,
    x: actions.axisLock,
    m: actions.nextColourMap,
    p: actions.screenshot,
    h: actions.panels,
    "0": () => actions.body(-1),
  };
  for (const [key, what] of Object.entries(kToggles)) plain[key] = () => actions.toggle(what);
  for (let body = 1; body <= 5; body++) plain[String(body)] = () => actions.body(body - 1);

  window.addEventListener("keydown", (event) => {
    if (event.key === "Escape") {
      if (!actions.closeHelp()) actions.release();
      return;
    }
    if (event.ctrlKey || event.metaKey || belongsToControl(event)) return;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (actions.drive(event)) {
      event.preventDefault();
    } else if (event.shiftKey && (key === "x" || key === "y" || key === "z")) {
      axisView(key);
    } else if (plain[key]) {
      event.preventDefault();
      // Time goes on by one step a press, and the tool is taken once.
      if (!event.repeat || key === "ArrowRight" || key === "ArrowLeft") plain[key]();
    }
  });
}

function belongsToControl(event: KeyboardEvent): boolean {
  const target = event.target;
  if (target instanceof HTMLSelectElement || target instanceof HTMLTextAreaElement) return true;
  if (target instanceof HTMLInputElement) {
    if (target.type === "checkbox") return event.key === " ";
    if (target.type === "range") return event.key.startsWith("Arrow") || event.key === "Home";
    return true;
  }
  return target instanceof HTMLButtonElement && (event.key === " " || event.key === "Enter");
}
