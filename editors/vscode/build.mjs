// Bundles the extension into dist/; with --package also makes gcc-robot.vsix. --binary PATH puts the program into it.

import { execFileSync } from "node:child_process";
import { chmodSync, copyFileSync, mkdirSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { basename, dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const here = dirname(fileURLToPath(import.meta.url));
const arguments_ = process.argv.slice(2);

rmSync(join(here, "dist"), { recursive: true, force: true });
rmSync(join(here, "server"), { recursive: true, force: true });
await build({
  absWorkingDir: here,
  entryPoints: ["src/extension.ts"],
  bundle: true,
  minify: true,
  format: "cjs",
  platform: "node",
  target: "node20",
  external: ["vscode"],
  legalComments: "none",
  outfile: "dist/extension.js",
});
copyFileSync(join(here, "../preview/dist/preview.js"), join(here, "dist/preview.js"));

if (arguments_.includes("--package")) {
  const at = arguments_.indexOf("--binary");
  if (at >= 0) {
    const binary = arguments_[at + 1];
    mkdirSync(join(here, "server"));
    const goal = join(here, "server", basename(binary));
    copyFileSync(binary, goal);
    chmodSync(goal, 0o755);
  }
  const vsce = createRequire(import.meta.url).resolve("@vscode/vsce/vsce");
  const options = [
    "package",
    "--no-dependencies",
    "--allow-missing-repository",
    "--skip-license",
    "-o",
    "gcc-robot.vsix",
  ];
  execFileSync(process.execPath, [vsce, ...options], { cwd: here, stdio: "inherit" });
}
