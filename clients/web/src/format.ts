// Numbers as the page writes them: SI units from the server, mm and ms for people.

/** Metres as millimetres with one decimal. */
export function millimetres(metres: number): string {
  return `${fixed(metres * 1000, 1)} mm`;
}

/** Newtons with two decimals. */
export function newtons(force: number): string {
  return `${fixed(force, 2)} N`;
}

/** A simulated time: seconds with two decimals, minutes from 60 s on. */
export function seconds(time: number): string {
  if (time < 60) return `${time.toFixed(2)} s`;
  const minutes = Math.floor(time / 60);
  return `${minutes}:${(time - 60 * minutes).toFixed(2).padStart(5, "0")} min`;
}

/** Fixed decimals without a negative zero. */
export function fixed(value: number, decimals: number): string {
  const text = value.toFixed(decimals);
  return Number(text) === 0 ? (0).toFixed(decimals) : text;
}

/** Three significant digits, for legends and picked values. */
export function short(value: number): string {
  if (value === 0) return "0";
  const magnitude = Math.abs(value);
  if (magnitude >= 1e5 || magnitude < 1e-3) return value.toExponential(1);
  return String(Number(value.toPrecision(3)));
}

/** Bytes for people. */
export function bytes(count: number): string {
  if (count < 1024) return `${count} B`;
  if (count < 1024 * 1024) return `${(count / 1024).toFixed(0)} KiB`;
  return `${(count / 1024 / 1024).toFixed(1)} MiB`;
}
