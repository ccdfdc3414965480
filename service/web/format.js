/* Numbers, sizes and times as words. */

/** A number to so many significant digits, without needless zeros. */
export function figure(value, digits = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-4) return value.toExponential(digits - 1).replace(/\.?0*e\+?/, "e");
  return String(Number(value.toPrecision(digits)));
}

/** Value and error to the digits that the error leaves, two of its own: 0.2130 ± 0.0021. */
export function withError(value, error) {
  if (error === null || error === undefined || !(error > 0) || !Number.isFinite(error))
    return figure(value, 6);
  const digits = 1 - Number(error.toExponential(1).split("e")[1]);
  if (digits > 8 || error >= 1e5) return `${value.toExponential(3)} ± ${error.toExponential(1)}`;
  const places = Math.max(digits, 0);
  return `${value.toFixed(places)} ± ${error.toFixed(places)}`;
}

/** A middle and the ends of an interval, written to two digits of its width. */
export function interval(low, middle, high) {
  const digits = 1 - Math.floor(Math.log10(high - low || 1));
  if (digits > 8 || high >= 1e6) return [low, middle, high].map((v) => figure(v, 4));
  return [low, middle, high].map((v) => v.toFixed(Math.max(digits, 0)));
}

export const percent = (value, digits = 2) => `${figure(100 * value, digits)} %`;
export const degrees = (value) => `${figure(value, 4)}°`;
export const count = (n, one, many = `${one}s`) => `${n.toLocaleString("en")} ${n === 1 ? one : many}`;

export function bytes(n) {
  if (n < 1000) return `${n} B`;
  return n < 1e6 ? `${figure(n / 1e3)} kB` : `${figure(n / 1e6)} MB`;
}

/** Seconds as people say them. */
export function duration(seconds) {
  if (seconds === null || seconds === undefined) return "–";
  if (seconds < 9.95) return `${seconds.toFixed(1)} s`;
  if (seconds < 90) return `${Math.round(seconds)} s`;
  if (seconds < 5400) return `${Math.round(seconds / 60)} min`;
  return `${(seconds / 3600).toFixed(1)} h`;
}

const UNITS = [
  [1, "s"],
  [1e-3, "ms"],
  [1e-6, "µs"],
  [0, "ns"],
];

/** A measured time with three digits: 68.5 ms. */
export function elapsed(seconds) {
  const [size, unit] = UNITS.find(([least]) => seconds >= 0.9995 * least);
  return `${figure(seconds / (size || 1e-9))} ${unit}`;
}

/** A UTC time as the reader's clock shows it. */
export function when(text) {
  const time = new Date(text);
  const today = new Date().toDateString() === time.toDateString();
  const options = today ? { timeStyle: "short" } : { dateStyle: "medium", timeStyle: "short" };
  return (today ? "today " : "") + time.toLocaleString(undefined, options);
}
