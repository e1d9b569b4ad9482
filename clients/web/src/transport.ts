// The bar on top: play, step, reset, and how the session keeps its time.

import { byId, onClick, setText } from "./dom";
import { fixed, seconds } from "./format";
import type { FidelityState } from "./gen/adhesim/v1/frame_pb";

export interface TransportActions {
  play(): void;
  step(): void;
  reset(): void;
  speed(factor: number): void;
}

/** What the bar shows. */
export interface TransportState {
  mode: "live" | "history" | "recording";
  running: boolean;
  /** False: someone else is in control. */
  enabled: boolean;
  timeS: number;
  /** Simulated seconds per second. */
  realTime: number;
  stepS: number;
  budgetS: number;
  misses: number;
  /** What steps did without; undefined: the scene can do without nothing. */
  fidelity?: FidelityState;
  skipped: number;
}

export class Transport {
  private readonly play = byId<HTMLButtonElement>("play");
  private readonly step = byId<HTMLButtonElement>("step");
  private readonly reset = byId<HTMLButtonElement>("reset");
  private readonly speed = byId<HTMLSelectElement>("speed");
  private readonly bar = byId("budget-bar");

  constructor(actions: TransportActions) {
    onClick(this.play, actions.play);
    onClick(this.step, actions.step);
    onClick(this.reset, actions.reset);
    this.speed.addEventListener("change", () => {
      this.speed.blur();
      actions.speed(Number(this.speed.value));
    });
  }

  /** One notch faster or slower, as the keys do. */
  changeSpeed(notches: number): void {
    const index = this.speed.selectedIndex + notches;
    if (index < 0 || index >= this.speed.options.length) return;
    this.speed.selectedIndex = index;
    this.speed.dispatchEvent(new Event("change"));
  }

  write(state: TransportState): void {
    const recording = state.mode === "recording";
    this.play.classList.toggle("running", state.running);
    this.play.title = this.play.ariaLabel = state.running ? "Pause (Space)" : "Play (Space)";
    this.step.title = this.step.ariaLabel = recording ? "Next frame (→)" : "One step (→)";
    this.reset.title = this.reset.ariaLabel = recording
      ? "To the beginning (Backspace)"
      : "Reset (Backspace)";
    for (const button of [this.play, this.step, this.reset]) button.disabled = !state.enabled;
    this.speed.hidden = !recording;
    setText(byId("time"), seconds(state.timeS));
    setText(byId("real-time"), `${fixed(state.realTime, 2)}×`);
    const used = state.budgetS > 0 ? state.stepS / state.budgetS : 0;
    setText(
      byId("step-time"),
      `${fixed(state.stepS * 1e3, 2)} / ${fixed(state.budgetS * 1e3, 2)} ms`,
    );
    this.bar.style.transform = `scaleX(${Math.min(1, used).toFixed(3)})`;
    this.bar.dataset.level = used > 1 ? "over" : used > 0.8 ? "near" : "under";
    setText(
      byId("misses"),
      `${state.misses} late${state.skipped > 0 ? `, ${state.skipped} skipped` : ""}`,
    );
    byId("misses").classList.toggle("alert", state.misses > 0);
    this.showFidelity(state.fidelity);
  }

  private showFidelity(fidelity: FidelityState | undefined): void {
    const entry = byId("fidelity-entry");
    entry.hidden = !fidelity;
    if (!fidelity) return;
    const lowered = fidelity.rungs > 0;
    const value = byId("fidelity");
    setText(value, lowered ? `without ${fidelity.lowered.join(", ")}` : "full");
    value.classList.toggle("alert", lowered);
    const error =
      `expected error: ${fixed(fidelity.expectedForceError * 100, 1)} % of the peak force ` +
      (fidelity.measured ? "(measured on this scene)" : "(bound)");
    entry.title = lowered
      ? `Given up so that steps end in time; ${error}`
      : `What steps do without so that they end in time; ${fidelity.changes} changes so far`;
  }
}
