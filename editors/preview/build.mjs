// Bundles the component. `node build.mjs` writes dist/preview.js, which is committed, so that `cargo build`
// needs no JavaScript; `node build.mjs --check` fails when it is not what the sources give.

import { readFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const here = dirname(fileURLToPath(import.meta.url));
const outfile = join(here, "dist/preview.js");
const check = process.argv.includes("--check");
const result = await build({
  absWorkingDir: here,
  entryPoints: ["src/main.ts"],
  bundle: true,
  minify: true,
  format: "iife",
  target: "es2022",
  charset: "utf8",
  legalComments: "none",
  loader: { ".css": "text" },
  outfile,
  write: !check,
});
if (check && readFileSync(outfile, "utf8") !== result.outputFiles[0].text) {
  console.error("editors/preview/dist/preview.js is not what its sources give: run `npm run build` in editors");
  process.exit(1);
}
