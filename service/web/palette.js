/* Colours of plots, from the page's own so that light and dark both hold. */

/** The value of a CSS variable now. */
export const colour = (name) =>
  getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

export const dark = () => window.matchMedia("(prefers-color-scheme: dark)").matches;

const GROUPS = 8;
/** The colour of the k-th of groups that have no order. */
export const grouped = (k) => colour(`group-${(k % GROUPS) + 1}`);

// Stops of viridis without its faintest ends, for incidences in order.
const ORDER = {
  light: [
    [68, 30, 120],
    [49, 104, 142],
    [31, 145, 120],
    [150, 140, 20],
    [214, 106, 20],
  ],
  dark: [
    [170, 140, 250],
    [90, 160, 235],
    [60, 205, 175],
    [190, 220, 90],
    [255, 200, 80],
  ],
};

/** The k-th of n colours in order. */
export function ordered(k, n) {
  const stops = dark() ? ORDER.dark : ORDER.light;
  const place = n < 2 ? 0 : (k / (n - 1)) * (stops.length - 1);
  const low = Math.min(Math.floor(place), stops.length - 2);
  return `rgb(${mix(stops[low], stops[low + 1], place - low).join(" ")})`;
}

/** A colour of -1 (below) over 0 to 1 (above). */
export function diverging(value) {
  const end = rgb(colour(value < 0 ? "under" : "over"));
  return `rgb(${mix(rgb(colour("zero")), end, Math.min(Math.abs(value), 1) ** 0.8).join(" ")})`;
}

export function rgb(hex) {
  return [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16));
}

function mix(a, b, share) {
  return a.map((x, k) => Math.round(x + share * (b[k] - x)));
}
