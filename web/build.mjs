// Builds the playground: one HTML file with the library, the examples, the style and the scripts inside.
//
//   npm run build [-- MODULE.wasm]
//
// Without a module, it is built with cargo (the target wasm32-unknown-unknown has to be installed).

import { execFileSync } from "node:child_process";
import { existsSync, mkdirSync, readFileSync, readdirSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { gzipAsync } from "@gfx/zopfli";
import { build } from "esbuild";
import { chapters } from "./tutorial.mjs";

const here = dirname(fileURLToPath(import.meta.url));
const root = join(here, "..");
const source = join(here, "src");

let file = process.argv[2];
if (!file) {
  execFileSync("cargo", ["build", "--profile", "web", "--target", "wasm32-unknown-unknown", "-p", "elbowroom-web"], { cwd: root, stdio: "inherit" });
  file = join(process.env.CARGO_TARGET_DIR ?? join(root, "target"), "wasm32-unknown-unknown/web/elbowroom_web.wasm");
}
const plain = readFileSync(file);
// Browsers decompress gzip natively; Zopfli compresses better in the same format.
const module = await gzipAsync(plain, { numiterations: 15, blocksplittingmax: 0 });

// The examples are the cases that the library is tested with.
const examples = readdirSync(join(root, "cases")).sort().map((name) => {
  const text = (part) => {
    const path = join(root, "cases", name, part);
    return existsSync(path) ? readFileSync(path, "utf8") : "";
  };
  return { name, domain: text("domain.pddl"), problem: text("problem.pddl"), plan: text("plan.plan"), world: text("world.toml"), likelihoods: text("likelihoods.toml") };
});

// Modules that only exist in the build.
const given = (name, contents) => ({
  name,
  setup(bundler) {
    bundler.onResolve({ filter: new RegExp(`^given:${name}$`) }, () => ({ path: name, namespace: name }));
    bundler.onLoad({ filter: /.*/, namespace: name }, () => ({ contents, loader: "js" }));
  },
});
const bundle = async (entry, plugins = []) => {
  const { outputFiles } = await build({
    entryPoints: [join(source, entry)], bundle: true, minify: true, write: false, format: "iife", target: "es2022", charset: "ascii", plugins,
  });
  return outputFiles[0].text;
};
const worker = await bundle("worker.ts");
const script = await bundle("main.ts", [
  given("worker", `export default ${JSON.stringify(worker)};`),
  given("tutorial", `export default ${JSON.stringify(chapters(root))};`),
  given("examples", `export default ${JSON.stringify(examples)};`),
]);

const parts = {
  "{style}": readFileSync(join(source, "page.css"), "utf8"),
  "{script}": script,
  "{module}": Buffer.from(module).toString("base64"),
};
// Inserted texts are not searched for placeholders, because they may contain any text.
const page = readFileSync(join(source, "index.html"), "utf8").split(/(\{style\}|\{script\}|\{module\})/).map((part) => parts[part] ?? part).join("");
mkdirSync(join(here, "dist"), { recursive: true });
writeFileSync(join(here, "dist", "index.html"), page);
writeFileSync(join(here, "dist", "elbowroom_web.wasm.gz"), module);
const size = (bytes) => `${(bytes / 1e6).toFixed(2)} MB`;
console.log(`dist/index.html: ${size(page.length)}, of which the module ${size(plain.length)} (${size(module.length)} compressed)`);
