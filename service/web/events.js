/* Server-sent events read by fetch: EventSource cannot carry a token, and hides why it failed. */

import { Problem, request } from "./api.js";

const RETRY = 1000;

/** Call `listen(type, data)` for every event of a fit or chart until it has ended; resumes after a break. */
export function follow(kind, id, listen, failed) {
  const stop = new AbortController();
  run(`${kind}/${encodeURIComponent(id)}/events`, listen, stop.signal).catch((error) => {
    if (!stop.signal.aborted) failed(error);
  });
  return () => stop.abort();
}

async function run(path, listen, signal) {
  let last = null;
  for (;;) {
    try {
      const headers = { Accept: "text/event-stream", ...(last ? { "Last-Event-ID": last } : {}) };
      const response = await request(path, { headers, signal });
      const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
      let rest = "";
      for (;;) {
        const { value, done } = await reader.read();
        if (done) break;
        const blocks = (rest + value.replaceAll("\r\n", "\n")).split("\n\n");
        rest = blocks.pop();
        for (const block of blocks) {
          const event = parse(block);
          last = event.id ?? last;
          if (event.data && listen(event.type, JSON.parse(event.data)) === "end") return;
        }
      }
    } catch (error) {
      // A refusal is final; a lost connection is not.
      if (signal.aborted || (error instanceof Problem && error.status >= 400 && error.status < 500))
        throw error;
    }
    await new Promise((done) => setTimeout(done, RETRY));
    if (signal.aborted) return;
  }
}

/** One block of an event stream; comments give an event without data. */
export function parse(block) {
  const event = { type: "message", id: null, data: "" };
  for (const line of block.split("\n")) {
    const [, name, value] = /^([^:]*):? ?(.*)$/.exec(line);
    if (name === "event") event.type = value;
    else if (name === "id") event.id = value;
    else if (name === "data") event.data += (event.data ? "\n" : "") + value;
  }
  return event;
}
