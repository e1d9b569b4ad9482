// Puts the page together: a shell, and in it a live session or a recording.

import "uplot/dist/uPlot.min.css";
import "./style.css";
import { blobSource, urlSource, type ByteSource } from "./byte_source";
import { create, byId, onClick, setText } from "./dom";
import { Driving } from "./driving";
import { drawAxes } from "./ground";
import { Help } from "./help";
import { installHooks, recordError } from "./hooks";
import { listenToKeys } from "./keyboard";
import { Live } from "./live";
import type { Mode } from "./mode";
import { Playback } from "./playback";
import { Scene3d } from "./scene3d";
import { Shell } from "./shell";
import { SourceMenu } from "./source_menu";
import { Theme } from "./theme";
import { Transport } from "./transport";
import { parseUrlParameters } from "./url_parameters";

const kReadoutMs = 100;
const kClickPx = 4;

const parameters = parseUrlParameters(location.search);
document.body.classList.toggle("picture", parameters.picture);
document.body.dataset.connection = "connecting";
document.body.dataset.role = "viewer";

const canvas = byId<HTMLCanvasElement>("canvas");
const scene3d = new Scene3d(canvas, byId("view"), parameters.picture ? "smooth" : "auto");
const kPlotMs = scene3d.software ? 100 : 50;
const hooks = installHooks({
  showAt: (timeS) => playback.showAt(timeS),
  pixels: () => scene3d.pixels(),
});
window.addEventListener("error", (event) => recordError(event.error ?? event.message));
window.addEventListener("unhandledrejection", (event) => recordError(event.reason));

const shell = new Shell(scene3d, hooks);
const theme = new Theme(parameters.theme, () => {
  scene3d.setBackground(
    getComputedStyle(document.documentElement).getPropertyValue("--view").trim(),
  );
  shell.plots.redraw();
});
const driving = new Driving(scene3d, canvas);
const live = new Live(shell, driving, parameters);
const playback = new Playback(shell);
const help = new Help();
let mode: Mode = live;

const transport = new Transport({
  play: () => mode.play(),
  step: () => mode.forward(),
  reset: () => mode.reset(),
  speed: (factor) => (playback.speed = factor),
});
const menu = new SourceMenu(
  live.streams,
  {
    openSession: (session) => showLive({ session }),
    openScene: (scene) => showLive({ scene }),
    openRecording: (name) => void showRecording(urlSource(recordingUrl(name)), name),
    openFile: (file) => void showRecording(blobSource(file), file.name),
  },
  () => (mode === live ? live.session.id : undefined),
);

function recordingUrl(name: string): string {
  return `/v1/recordings/${encodeURIComponent(name)}`;
}

function showLive(wanted: { session?: string; scene?: string }): void {
  playback.close();
  mode = live;
  live.setActive(true);
  void live.session.attach(wanted);
}

async function showRecording(
  source: Promise<ByteSource> | ByteSource,
  name: string,
  atS?: number,
): Promise<void> {
  if (await playback.load(source, name, atS, () => live.setActive(false))) {
    mode = playback;
  } else if (!playback.open && !live.active) {
    // The recording that the address asks for cannot be shown: a session can.
    live.setActive(true);
    if (live.connectionState === "connected") void live.session.start();
  }
}

function grab(tool?: number): void {
  if (mode === live) live.toggleGrab(tool);
}
shell.onGrab = grab;
shell.onDisplay = () => live.session.wantStrainEnergy(shell.display.colourMap === "strain-energy");

scene3d.onView = () => drawAxes(document.querySelector<SVGElement>("#axes")!, scene3d.camera);
drawAxes(document.querySelector<SVGElement>("#axes")!, scene3d.camera);
for (const button of document.querySelectorAll<HTMLElement>("[data-view]")) {
  onClick(button, () => {
    const view = button.dataset.view as "home" | "x" | "y" | "z";
    if (view === "home") scene3d.home();
    else scene3d.axisView(view);
  });
}

async function screenshot(): Promise<void> {
  const blob = await scene3d.png();
  if (!blob) return;
  const url = URL.createObjectURL(blob);
  const scene = shell.view.content?.topology.scene || "adhesim";
  create("a", { href: url, download: `${scene}-step-${hooks.step}.png` }).click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}

// A press that does not move is a click: on a tool it selects, on tissue it asks for numbers.
let pressed: { x: number; y: number } | undefined;
canvas.addEventListener(
  "pointerdown",
  (event) => (pressed = { x: event.offsetX, y: event.offsetY }),
);
canvas.addEventListener("pointerup", (event) => {
  const moved = pressed && Math.hypot(event.offsetX - pressed.x, event.offsetY - pressed.y);
  if (event.button !== 0 || moved === undefined || moved > kClickPx || driving.driving) return;
  const picked = pickAt(event);
  if (picked && "tool" in picked) shell.selectTool(picked.tool);
  else {
    shell.pick.particle = picked?.particle;
    shell.pick.write(shell.view);
  }
});
canvas.addEventListener("dblclick", (event) => {
  const picked = pickAt(event);
  if (picked && "tool" in picked) grab(picked.tool);
});

function pickAt(event: MouseEvent): ReturnType<typeof shell.view.pick> {
  return shell.view.pick(
    (2 * event.offsetX) / canvas.clientWidth - 1,
    1 - (2 * event.offsetY) / canvas.clientHeight,
  );
}

listenToKeys({
  play: () => mode.play(),
  forward: () => mode.forward(),
  back: () => mode.back(),
  reset: () => mode.reset(),
  speed: (notches) => transport.changeSpeed(notches),
  grab: () => grab(),
  release: () => live.release(),
  axisLock: () => (driving.axisLock = !driving.axisLock),
  home: () => scene3d.home(),
  axisView: (view) => scene3d.axisView(view),
  toggle: (what) => shell.panel.flip(what),
  nextColourMap: () => shell.panel.nextColourMap(),
  body: (index) => shell.tree.toggleBody(index),
  screenshot: () => void screenshot(),
  help: () => help.toggle(),
  closeHelp: () => {
    const open = help.open || menu.open;
    help.toggle(false);
    menu.toggle(false);
    return open;
  },
  panels: () => void document.body.classList.toggle("no-panels"),
  drive: (event) => driving.key(event),
});
onClick(byId("theme"), () => theme.flip());
onClick(byId("screenshot"), () => void screenshot());

function writeReadouts(): void {
  const state = mode.transport();
  transport.write(state);
  shell.write();
  document.body.dataset.role = live.role;
  document.body.classList.toggle("driving", driving.driving);
  // What is seen is left from a session that is gone: no numbers of now.
  const stale = state.mode === "live" && !live.session.watching;
  document.body.classList.toggle("no-session", stale);
  const held = driving.driving;
  if (mode === playback) shell.toolPanel.offer("Recording", false);
  else if (held) shell.toolPanel.offer("Release (G)", true);
  else shell.toolPanel.offer(live.role === "spectator" ? "Taken" : "Grab (G)", live.mayControl);
  setText(byId("roster"), roster());
  setText(byId("session-id"), sessionName());
  setText(byId("fps"), `${hooks.fps.toFixed(0)} fps`);
  setText(byId("axis-lock"), held && driving.axisLock ? "locked to the shaft (X)" : "");
  setText(byId("errors"), hooks.errors.length > 0 ? `${hooks.errors.length} errors` : "");
  byId("errors").title = hooks.errors.slice(-3).join("\n");
}

function sessionName(): string {
  if (mode === playback) return "recording";
  return live.session.watching ? (live.session.id ?? "") : "";
}

function roster(): string {
  if (mode === playback) return playback.name;
  if (live.connectionState !== "connected") return live.connectionState;
  if (!live.session.watching) return "no session";
  const viewers = `${live.viewers} viewer${live.viewers === 1 ? "" : "s"}`;
  const others =
    live.role === "spectator" ? `, ${live.operatedTools.join(", ")} driven by someone else` : "";
  return `${live.role} · ${viewers}${others}`;
}

let readoutAt = 0;
let plotAt = 0;
function animate(nowMs: number): void {
  requestAnimationFrame(animate);
  try {
    mode.tick(nowMs);
    shell.draw(nowMs);
    if (nowMs >= readoutAt) {
      readoutAt = nowMs + kReadoutMs;
      writeReadouts();
    }
    if (nowMs >= plotAt && !parameters.picture) {
      plotAt = nowMs + kPlotMs;
      shell.plots.draw();
    }
  } catch (error) {
    recordError(error);
  }
}

for (const name of parameters.hide) shell.panel.hide(name);
if (parameters.colour) shell.panel.setColourMap(parameters.colour);
if (parameters.recording) {
  const name = decodeURIComponent(parameters.recording.split("/").at(-1) ?? parameters.recording);
  live.setActive(false);
  void showRecording(urlSource(parameters.recording), name, parameters.atS);
}
live.open();
requestAnimationFrame(animate);
