// The packaged extension in a real VS Code: code-server in a headless Chromium.
// GCC_ROBOT_BIN names the program, GCC_ROBOT_TOOLS the folder made by editors/test/setup; pictures go to
// GCC_ROBOT_SHOTS.

import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import { copyFileSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { connect, createServer } from "node:net";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { browser, has, pixels } from "../../test/browser.mjs";

const top = join(dirname(fileURLToPath(import.meta.url)), "../../..");
const robot = process.env.GCC_ROBOT_BIN;
const tools = process.env.GCC_ROBOT_TOOLS ?? join(top, "target/editor-tools");
const shots = process.env.GCC_ROBOT_SHOTS ?? join(top, "target/test-data/editors");
const node = join(tools, "bin/node");
const entry = join(tools, "code-server/node_modules/code-server/out/node/entry.js");
const vsix = join(top, "editors/vscode/gcc-robot.vsix");

// Colours of the preview's light theme.
const FEED = [24, 92, 190];
const ARC = [15, 146, 106];
const MARK = [214, 20, 60];

const folder = mkdtempSync(join(tmpdir(), "code-"));
const workspace = join(folder, "parts");
let server;
let chrome;
let page;

const freePort = () =>
  new Promise((resolve) => {
    const probe = createServer();
    probe.listen(0, "127.0.0.1", () => {
      const { port } = probe.address();
      probe.close(() => resolve(port));
    });
  });

async function retry(what, attempt, seconds = 30) {
  const end = Date.now() + seconds * 1000;
  for (;;) {
    let problem;
    try {
      const answer = await attempt();
      if (answer) return answer;
    } catch (caught) {
      problem = caught;
    }
    if (Date.now() > end) {
      await page?.screenshot({ path: join(shots, `failed: ${what.replaceAll("/", " ")}.png`) });
      throw new Error(`waited in vain for ${what}${problem ? `: ${problem.message}` : ""}`);
    }
    await new Promise((r) => setTimeout(r, 100));
  }
}

/** Asks again every few seconds: what an editor is asked before its server has looked at the text comes to nothing. */
async function ask(what, question, answered, seconds = 60) {
  let asked = 0;
  return retry(
    what,
    async () => {
      if (Date.now() - asked > 4000) {
        await page.keyboard.press("Escape");
        await question();
        asked = Date.now();
      }
      return answered();
    },
    seconds,
  );
}

/** Starts code-server; another may take the free port first, then it ends and the next port is tried. */
async function start(options, environment) {
  const more = ["--disable-telemetry", "--disable-update-check", "--disable-workspace-trust", workspace];
  for (let tries = 0; tries < 5; tries++) {
    const port = await freePort();
    writeFileSync(join(folder, "config.yaml"), `bind-addr: 127.0.0.1:${port}\nauth: none\ncert: false\n`);
    server = spawn(node, [entry, ...options, ...more], { env: environment, stdio: "ignore", detached: true });
    let ended = false;
    server.on("exit", () => {
      ended = true;
    });
    await retry("code-server's port", async () => ended || (await answers(port)), 120);
    if (!ended) return port;
  }
  throw new Error("code-server does not start");
}

/** Whether somebody listens at a port. */
const answers = (port) =>
  new Promise((resolve) => {
    const socket = connect(port, "127.0.0.1");
    socket.on("connect", () => resolve(true));
    socket.on("error", () => resolve(false));
    socket.on("close", () => resolve(false));
    setTimeout(() => socket.destroy(), 1000);
  });

before(async () => {
  assert.ok(robot, "GCC_ROBOT_BIN names the program");
  mkdirSync(shots, { recursive: true });
  mkdirSync(workspace, { recursive: true });
  for (const name of ["flange.ngc", "mistakes.ngc", "tools.tbl"]) {
    copyFileSync(join(top, "docs/examples", name), join(workspace, name));
  }
  // Programs that are not open are looked at too: this one has no problems.
  writeFileSync(join(workspace, "BIG.NC"), "O0001\nG21 G90 G17\nG0 X5\nM30\n");
  copyFileSync(join(top, "tests/golden/unb2013/example-a_conical-hole.p21"), join(workspace, "workplan.stp"));
  writeFileSync(
    join(workspace, "bracket.stp"),
    "ISO-10303-21;\nHEADER;\nFILE_SCHEMA(('AUTOMOTIVE_DESIGN'));\nENDSEC;\n",
  );
  writeFileSync(
    join(workspace, "gcc-robot.toml"),
    'schema = 1\n\n[project]\nsources = ["flange.ngc"]\ntools = "tools.tbl"\n',
  );
  const user = join(folder, "user");
  mkdirSync(join(user, "User"), { recursive: true });
  const settings = {
    "workbench.startupEditor": "none",
    "workbench.colorTheme": "Default Light Modern",
    "window.autoDetectColorScheme": false,
    "telemetry.telemetryLevel": "off",
    "editor.minimap.enabled": false,
    "workbench.tips.enabled": false,
    "chat.disableAIFeatures": true,
    "workbench.secondarySideBar.defaultVisibility": "hidden",
  };
  writeFileSync(join(user, "User/settings.json"), JSON.stringify(settings));
  // To VS Code, code-server is a remote machine: settings of the machine are its own.
  mkdirSync(join(user, "Machine"));
  writeFileSync(join(user, "Machine/settings.json"), JSON.stringify({ "gccRobot.server.path": robot }));
  const options = ["--user-data-dir", user, "--extensions-dir", join(folder, "extensions")];
  const environment = { ...process.env, HOME: folder, VSCODE_PROXY_URI: "" };
  const said = execFileSync(node, [entry, ...options, "--install-extension", vsix, "--force"], { env: environment });
  assert.match(String(said), /successfully installed/);
  const port = await start([...options, "--config", join(folder, "config.yaml")], environment);
  chrome = await browser();
  page = await chrome.newPage({ viewport: { width: 1400, height: 860 }, colorScheme: "light" });
  await retry("code-server", () => page.goto(`http://127.0.0.1:${port}/?folder=${workspace}`), 120);
  await page.waitForSelector(".monaco-workbench .explorer-viewlet, .monaco-workbench .part.editor", { timeout: 60000 });
});

after(async () => {
  await chrome?.close();
  // The server's own children go with its process group.
  if (server) process.kill(-server.pid, "SIGKILL");
  rmSync(folder, { recursive: true, force: true });
});

async function quick(key, text, wanted) {
  await page.keyboard.press(key);
  const input = page.locator(".quick-input-widget input.input").first();
  await input.waitFor({ state: "visible" });
  await input.fill(text);
  const rows = page.locator(".quick-input-list .monaco-list-row");
  await retry(`an entry for ${text}`, async () =>
    ((await rows.first().textContent()) ?? "").toLowerCase().includes((wanted ?? text).toLowerCase()),
  );
  await page.keyboard.press("Enter");
}

const command = (name) => quick("F1", `>${name}`, name);

async function open(name) {
  await quick("Control+p", name);
  await page.waitForSelector(`.tab.active[data-resource-name="${name}"]`);
  await page.waitForSelector(".editor-group-container.active .view-lines .view-line");
}

async function place(line, column) {
  await page.keyboard.press("Control+g");
  const input = page.locator(".quick-input-widget input.input").first();
  await input.waitFor({ state: "visible" });
  await input.fill(`:${line}:${column}`);
  await page.keyboard.press("Enter");
  await retry(`the cursor in line ${line}`, async () => (await position()) === `${line},${column}`);
}

/** Cursor as the status bar tells it. */
async function position() {
  const text = (await page.locator("#status\\.editor\\.selection").textContent()) ?? "";
  const [, line, column] = text.match(/Ln (\d+), Col (\d+)/) ?? [];
  return `${line},${column}`;
}

const language = async () => (await page.locator("#status\\.editor\\.mode").textContent()) ?? "";

/** Lines of an editor that are in sight; VS Code writes spaces as no-break spaces. */
async function lines(selector) {
  const found = await page.locator(`${selector} .view-lines .view-line`).evaluateAll((rows) =>
    rows
      .map((row) => ({ top: Number.parseFloat(row.style.top), text: row.textContent ?? "" }))
      .sort((a, b) => a.top - b.top)
      .map((row) => row.text),
  );
  return found.map((text) => text.replaceAll("\u00a0", " "));
}

/** The frame of the preview and where it lies in the page. */
async function preview() {
  return retry(
    "the preview",
    async () => {
      for (const frame of page.frames()) {
        const points = await frame
          .evaluate(() => document.querySelector("gcc-robot-preview")?.statistics?.().points ?? -1)
          .catch(() => -1);
        if (points <= 0) continue;
        let [x, y] = [0, 0];
        for (let f = frame; f.parentFrame(); f = f.parentFrame()) {
          const element = await f.frameElement();
          const box = await element.evaluate((e) => {
            const r = e.getBoundingClientRect();
            return [r.left, r.top];
          });
          x += box[0];
          y += box[1];
        }
        return { frame, x, y };
      }
      return null;
    },
    60,
  );
}

async function segment(view, at) {
  const [x, y] = await view.frame.evaluate((p) => document.querySelector("gcc-robot-preview").project(...p), at);
  return [view.x + x, view.y + y];
}

async function colors(view, at, reach = 2) {
  const [x, y] = await segment(view, at);
  return (await pixels(chrome, await page.screenshot())).near(x, y, reach);
}

test("errors are underlined; hover tells what is wrong", async () => {
  await open("mistakes.ngc");
  assert.match(await language(), /G-code/);
  await page.waitForSelector(".squiggly-error", { timeout: 30000 });
  await retry("at least four errors", async () => (await page.locator(".squiggly-error").count()) >= 4);
  const problems = page.locator("#status\\.problems");
  await retry("each problem once", async () => /^\s*5/.test((await problems.textContent()) ?? ""));
  await place(7, 12);
  const hover = page.locator(".monaco-hover:visible .hover-contents, .monaco-hover:visible .hover-row");
  await ask(
    "the hover",
    () => command("Show or Focus Hover"),
    async () =>
      (await hover.allTextContents()).join(" ").replaceAll("\u00a0", " ").includes("radius 4.0000 at the start"),
  );
  const text = (await hover.allTextContents()).join(" ");
  assert.match(text, /E0203/);
  await page.screenshot({ path: join(shots, "vscode-hover.png") });
  await page.keyboard.press("Escape");
});

test("a fix is offered and applied", async () => {
  const source = readFileSync(join(workspace, "workplan.stp"), "utf8").split(/\r?\n/);
  const line = source.findIndex((l) => l.includes("CENTER_DRILL(")) + 1;
  await open("workplan.stp");
  await retry("the language", async () => /STEP-NC/.test(await language()));
  await place(line, 6);
  await retry("the warning", async () => (await page.locator(".squiggly-warning").count()) >= 1);
  const menu = page.locator(".action-widget .monaco-list-row", { hasText: "write CENTERDRILL" });
  await ask(
    "the fix in the light bulb's menu",
    () => page.keyboard.press("Control+."),
    () => menu.first().isVisible(),
  );
  await menu.first().click();
  await retry("the corrected line", async () =>
    (await lines(".editor-group-container")).some((l) => l.includes("CENTERDRILL(")),
  );
  assert.ok(!(await lines(".editor-group-container")).some((l) => l.includes("CENTER_DRILL(")));
  await page.keyboard.press("Control+s");
  await retry("the saved file", () => readFileSync(join(workspace, "workplan.stp"), "utf8").includes("CENTERDRILL("));
  await command("View: Close All Editors");
});

test("names of STEP-NC lead to their pages", async () => {
  await open("workplan.stp");
  const source = readFileSync(join(workspace, "workplan.stp"), "utf8").split(/\r?\n/);
  const line = source.findIndex((l) => l.includes("WORKPIECE("));
  await place(line + 1, source[line].indexOf("WORKPIECE") + 3);
  const tab = page.locator('.tab.active[data-resource-name="WORKPIECE.md"]');
  await ask(
    "the page's tab",
    () => command("Go to Definition"),
    () => tab.isVisible(),
  );
  await retry("the page", async () =>
    (await lines(".editor-group-container.active")).some((l) => l.includes("WORKPIECE")),
  );
  await command("View: Close All Editors");
});

test("the preview draws; cursor and picture go together", async () => {
  await open("flange.ngc");
  await command("gcc-robot: Preview Tool Path");
  const view = await preview();
  await view.frame.evaluate(() => document.querySelector("gcc-robot-preview").look("top"));
  const device = await view.frame.evaluate(() => document.querySelector("gcc-robot-preview").statistics().device);
  assert.ok(device, "WebGL draws");
  // The lower edge of the contour: X-50 … 50, Y-40, offset by the tool's radius 5 (line 24 goes there).
  await retry("the colour of the contour's lower edge", async () => has(await colors(view, [20, -45, -16.5]), FEED));
  await retry("the colour of the pocket", async () => has(await colors(view, [0, 14, -6]), ARC));

  // Cursor to picture: line 54 is the last turn in the pocket.
  const source = readFileSync(join(workspace, "flange.ngc"), "utf8").split("\n");
  const turn = source.indexOf("G3 I-14 F900") + 1;
  await page.locator(".editor-group-container .view-lines").first().click();
  await place(turn, 1);
  await retry("the marked turn", async () => has(await colors(view, [0, 14, -6]), MARK));

  // Picture to cursor: a click on the contour's lower edge.
  const edge = source.findIndex((l) => l.trim() === "G2 X50 Y-40 I-10 J0") + 2;
  const [x, y] = await segment(view, [20, -45, -16.5]);
  await page.mouse.click(x, y);
  await retry("the line that was clicked", async () => (await position()).split(",")[0] === String(edge));

  // An edit reaches the picture: one move more.
  const points = () => view.frame.evaluate(() => document.querySelector("gcc-robot-preview").statistics().points);
  const before = await points();
  await page.locator(".editor-group-container .view-lines").first().click();
  await place(turn + 1, 1);
  await page.keyboard.type("G1 X13\n");
  await retry("the picture after an edit", async () => (await points()) !== before);
  for (let i = 0; i < 20 && (await points()) !== before; i++) {
    await page.keyboard.press("Control+z");
    await page.waitForTimeout(150);
  }
  await retry("the picture as it was", async () => (await points()) === before);
  await view.frame.evaluate(() => document.querySelector("gcc-robot-preview").look("iso"));
  await place(turn, 1);
  await page.waitForTimeout(500);
  await page.screenshot({ path: join(shots, "vscode.png") });
  await command("View: Close All Editors");
});

test("the output of a target stands beside the source, line by line", async () => {
  await open("flange.ngc");
  await command("gcc-robot: Show Output beside the Source");
  const input = page.locator(".quick-input-widget input.input").first();
  await retry(
    "the list of targets",
    async () => (await page.locator(".quick-input-list .monaco-list-row").count()) > 3,
  );
  await input.fill("rs274ngc");
  await page.keyboard.press("Enter");
  const all = async () => (await lines(".part.editor")).join("\n");
  await retry(
    "the normalised program",
    async () => /G43 ?(H1|Z)/.test(await all()) && (await page.locator(".editor-group-container").count()) === 2,
    60,
  );
  await page.locator(".editor-group-container .view-lines").first().click();
  const line = readFileSync(join(workspace, "flange.ngc"), "utf8").split("\n").indexOf("T2 M6") + 1;
  await place(line, 1);
  await retry(
    "the marked lines of the output",
    async () => (await page.locator(".editor-group-container").nth(1).locator(".view-overlays .cdr").count()) > 0,
  );
  await page.screenshot({ path: join(shots, "vscode-output.png") });
  await command("View: Close All Editors");
});

test("endings in capitals count; a drawing of a product is left alone", async () => {
  await open("BIG.NC");
  assert.match(await language(), /G-code/);
  await open("bracket.stp");
  await page.waitForTimeout(500);
  assert.doesNotMatch(await language(), /STEP-NC/);
  await command("View: Close All Editors");
});
