// The library in a worker that can be stopped.

import type { Reply } from "./module";
import source from "given:worker";

/** The library has come to an end that it should not come to; it starts afresh. */
export class Trouble extends Error {}
/** Somebody did not want to wait. */
export class Stopped extends Error {}

export interface Answered {
  reply: Reply;
  milliseconds: number;
}
interface Waiting {
  resolve(answered: Answered): void;
  reject(error: Error): void;
}

export class Engine {
  private worker: Worker;
  private readonly waiting = new Map<number, Waiting>();
  private last = 0;

  private constructor(private readonly module: WebAssembly.Module) {
    this.worker = this.start();
  }

  /** Unpacks and compiles the module that the page holds. */
  static async load(packed: string): Promise<Engine> {
    const bytes = Uint8Array.from(atob(packed), (character) => character.charCodeAt(0));
    const plain = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Engine(await WebAssembly.compile(await new Response(plain).arrayBuffer()));
  }

  ask(question: unknown): Promise<Answered> {
    const id = ++this.last;
    return new Promise((resolve, reject) => {
      this.waiting.set(id, { resolve, reject });
      this.worker.postMessage({ id, question });
    });
  }

  /** Ends what is being worked on. */
  stop(why: Error = new Stopped()): void {
    this.worker.terminate();
    this.worker = this.start();
    for (const { reject } of this.waiting.values()) reject(why);
    this.waiting.clear();
  }

  private start(): Worker {
    const address = URL.createObjectURL(new Blob([source], { type: "text/javascript" }));
    const worker = new Worker(address);
    worker.postMessage({ module: this.module });
    worker.onmessage = ({ data }: MessageEvent<Answered & { id: number; trouble?: string }>) => {
      const waiting = this.waiting.get(data.id);
      this.waiting.delete(data.id);
      if (data.trouble === undefined) waiting?.resolve(data);
      else {
        // A panic makes the instance unusable.
        waiting?.reject(new Trouble(data.trouble));
        this.stop(new Trouble(data.trouble));
      }
    };
    return worker;
  }
}
