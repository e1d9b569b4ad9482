// Light and dark: as the system says, until the user says otherwise.

const kKey = "adhesim-theme";

export class Theme {
  private readonly query = matchMedia("(prefers-color-scheme: dark)");

  constructor(
    wanted: string | undefined,
    private readonly onChange: () => void,
  ) {
    this.query.addEventListener("change", () => this.apply());
    if (wanted === "light" || wanted === "dark") this.chosen = wanted;
    this.apply();
  }

  private chosen: string | null = stored();

  flip(): void {
    this.chosen = this.dark ? "light" : "dark";
    try {
      localStorage.setItem(kKey, this.chosen);
    } catch {
      // Without storage the choice lasts as long as the page.
    }
    this.apply();
  }

  get dark(): boolean {
    return this.chosen ? this.chosen === "dark" : this.query.matches;
  }

  /** Colour behind the 3-D scene. */
  get background(): string {
    return getComputedStyle(document.documentElement).getPropertyValue("--view").trim();
  }

  private apply(): void {
    document.documentElement.dataset.theme = this.dark ? "dark" : "light";
    this.onChange();
  }
}

function stored(): string | null {
  try {
    return localStorage.getItem(kKey);
  } catch {
    return null;
  }
}
