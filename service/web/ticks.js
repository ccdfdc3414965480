/* Round numbers for a logarithmic axis. */

// From dense to sparse, within a decade.
const STEPS = [
  [1, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.7, 1.8, 1.9, 2, 2.2, 2.5, 3, 3.5, 4, 4.5, 5, 5.5, 6, 6.5, 7, 8, 9],
  [1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 7, 8, 9],
  [1, 1.5, 2, 3, 5, 7],
  [1, 2, 5],
  [1, 3],
];

/** At most so many round numbers from low to high. */
export function logTicks(low, high, most) {
  const [first, last] = [Math.floor(Math.log10(low)), Math.ceil(Math.log10(high))];
  const decades = Array.from({ length: last - first + 1 }, (_, k) => first + k);
  const within = (ticks) => ticks.filter((t) => t >= low && t <= high);
  for (const steps of STEPS) {
    // Written out, so that 3e-2 is 0.03.
    const ticks = within(decades.flatMap((d) => steps.map((s) => Number(`${s}e${d}`))));
    if (ticks.length <= most) return ticks;
  }
  for (let every = 1; ; every += 1) {
    const ticks = within(decades.filter((d) => d % every === 0).map((d) => Number(`1e${d}`)));
    if (ticks.length <= Math.max(most, 1)) return ticks;
  }
}
