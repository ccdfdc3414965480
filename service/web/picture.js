/* Pictures that the service made. */

import { h } from "./dom.js";
import { problemCard } from "./problem.js";

/** The picture that was promised, on white paper, or the problem with it; `said` describes it. */
export async function pictureOf(promised, said) {
  try {
    // Drawn on a canvas, as an address with a token would have to be public.
    const image = await createImageBitmap(await promised);
    const canvas = h("canvas", { role: "img", "aria-label": said });
    canvas.width = image.width;
    canvas.height = image.height;
    canvas.getContext("2d").drawImage(image, 0, 0);
    return h("div", { class: "paper" }, canvas);
  } catch (error) {
    return problemCard(error);
  }
}
