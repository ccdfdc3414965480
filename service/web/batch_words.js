/* What a batch's counts say. */

import { count } from "./format.js";

/** Fits that came to an end of whatever kind. */
export const endedOf = ({ counts }) => counts.done + counts.failed + counts.cancelled;

/** As "12 fits, 3 failed". */
export function batchWords({ total, counts }) {
  const rest = ["failed", "cancelled"].filter((state) => counts[state]);
  return [count(total, "fit"), ...rest.map((state) => `${counts[state]} ${state}`)].join(", ");
}
