// Runs the library outside the page's thread, so that the page stays responsive.

import { instance, type Reply } from "./module";

let asked: Promise<(question: unknown) => Reply> | null = null;

onmessage = async ({ data }: MessageEvent<{ module?: WebAssembly.Module; id?: number; question?: unknown }>) => {
  if (data.module) {
    asked = instance(data.module);
    return;
  }
  try {
    if (!asked) throw new Error("there is no module");
    const begun = performance.now();
    const reply = (await asked)(data.question);
    postMessage({ id: data.id, reply, milliseconds: performance.now() - begun });
  } catch (error) {
    postMessage({ id: data.id, trouble: String(error) });
  }
};
