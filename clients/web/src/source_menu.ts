// The menu of what can be shown: sessions, scenes, recordings of the server, files of this machine.

import { byId, create, onClick } from "./dom";
import { bytes } from "./format";
import type { Streams } from "./streams";

export interface SourceActions {
  openSession(session: string): void;
  openScene(scene: string): void;
  openRecording(name: string): void;
  openFile(file: File): void;
}

export class SourceMenu {
  private readonly root = byId("source-menu");
  private readonly button = byId("source");
  private readonly file = byId<HTMLInputElement>("file");

  constructor(
    private readonly streams: Streams,
    private readonly actions: SourceActions,
    private readonly current: () => string | undefined,
  ) {
    onClick(this.button, () => this.toggle());
    this.file.addEventListener("change", () => {
      const file = this.file.files?.[0];
      this.file.value = "";
      if (file) this.choose(() => actions.openFile(file));
    });
    document.addEventListener("pointerdown", (event) => {
      const inside =
        event.target instanceof Node &&
        (this.root.contains(event.target) || this.button.contains(event.target));
      if (!inside) this.toggle(false);
    });
    for (const kind of ["dragenter", "dragover"]) {
      window.addEventListener(kind, (event) => {
        event.preventDefault();
        document.body.classList.add("dropping");
      });
    }
    window.addEventListener("dragleave", (event) => {
      if (!event.relatedTarget) document.body.classList.remove("dropping");
    });
    window.addEventListener("drop", (event) => {
      event.preventDefault();
      document.body.classList.remove("dropping");
      const file = event.dataTransfer?.files[0];
      if (file) actions.openFile(file);
    });
  }

  get open(): boolean {
    return !this.root.hidden;
  }

  toggle(on = !this.open): void {
    if (on === this.open) return;
    this.root.hidden = !on;
    this.button.ariaExpanded = String(on);
    if (on) void this.refresh();
  }

  // Each list stands alone: a server may have no recordings and still have scenes.
  private async refresh(): Promise<void> {
    const lists = byId("source-lists");
    const [sessions, scenes, recordings] = await Promise.all([
      this.list("Sessions", async () =>
        (await this.streams.call("listSessions", {})).sessions.map(({ session, scene, viewers }) =>
          this.entry(
            scene,
            `${session} · ${viewers} viewer${viewers === 1 ? "" : "s"}`,
            session === this.current(),
            () => this.actions.openSession(session),
          ),
        ),
      ),
      this.list("New session of", async () =>
        (await this.streams.call("listScenes", {})).scenes.map(({ name, description }) =>
          this.entry(name, description, false, () => this.actions.openScene(name)),
        ),
      ),
      this.list("Recordings", async () =>
        (await this.streams.call("listRecordings", {})).recordings.map(
          ({ name, bytes: size, open }) =>
            this.entry(name, bytes(Number(size)) + (open ? " · under way" : ""), false, () =>
              this.actions.openRecording(name),
            ),
        ),
      ),
    ]);
    lists.replaceChildren(sessions, scenes, recordings);
  }

  private async list(title: string, entries: () => Promise<HTMLElement[]>): Promise<HTMLElement> {
    let rows: HTMLElement[];
    try {
      rows = await entries();
      if (rows.length === 0) rows = [create("p", { className: "muted" }, "none")];
    } catch (error) {
      rows = [create("p", { className: "muted" }, (error as Error).message)];
    }
    return create("section", {}, create("h2", {}, title), ...rows);
  }

  private entry(title: string, note: string, current: boolean, action: () => void): HTMLElement {
    const button = create(
      "button",
      { type: "button", className: current ? "entry current" : "entry" },
      create("span", {}, title),
      create("small", {}, note),
    );
    onClick(button, () => this.choose(action));
    return button;
  }

  private choose(action: () => void): void {
    this.toggle(false);
    action();
  }
}
