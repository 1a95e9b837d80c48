// The preview component in a headless Chromium: pages as `gcc-robot preview` writes and serves them.
// GCC_ROBOT_BIN names the program; pictures go to GCC_ROBOT_SHOTS (default: target/test-data/editors).

import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import { mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { get, request } from "node:http";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { createInterface } from "node:readline";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { browser, has, pixels, until } from "../../test/browser.mjs";

const top = join(dirname(fileURLToPath(import.meta.url)), "../../..");
const robot = process.env.GCC_ROBOT_BIN;
const shots = process.env.GCC_ROBOT_SHOTS ?? join(top, "target/test-data/editors");
const folder = mkdtempSync(join(tmpdir(), "preview-"));

// Colours of the light theme.
const RAPID = [226, 119, 38];
const FEED = [24, 92, 190];
const ARC = [15, 146, 106];
const MARK = [214, 20, 60];

let chrome;
before(async () => {
  assert.ok(robot, "GCC_ROBOT_BIN names the program");
  mkdirSync(shots, { recursive: true });
  chrome = await browser();
});
after(async () => {
  await chrome?.close();
  rmSync(folder, { recursive: true, force: true });
});

/** Writes a program, draws it, and opens the page. */
async function open(name, program, options = {}) {
  const source = join(folder, name);
  writeFileSync(source, program);
  const page = source.replace(/\.\w+$/, ".html");
  execFileSync(robot, ["preview", source, "-o", page, "-q"], { stdio: ["ignore", "ignore", "pipe"] });
  return show(`file://${page}`, options);
}

async function show(address, { theme = "light", width = 1280, height = 720 } = {}) {
  const page = await chrome.newPage({ viewport: { width, height }, colorScheme: theme });
  page.problems = [];
  page.on("pageerror", (e) => page.problems.push(String(e)));
  page.on("console", (m) => m.type() === "error" && page.problems.push(m.text()));
  const begun = Date.now();
  await page.goto(address);
  await settled(page);
  page.loaded = Date.now() - begun;
  return page;
}

const settled = (page) =>
  until(
    page,
    "the whole path",
    () => {
      const s = document.querySelector("gcc-robot-preview")?.statistics();
      return s && s.points > 0 && s.whole && !s.busy;
    },
    null,
    60000,
  );

/** Waits until something is true. */
async function waitFor(what, condition, seconds = 60) {
  const end = Date.now() + seconds * 1000;
  while (!(await condition())) {
    if (Date.now() > end) throw new Error(`waited in vain for ${what}`);
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
}

const statistics = (page) => page.evaluate(() => document.querySelector("gcc-robot-preview").statistics());
const project = (page, place) => page.evaluate((p) => document.querySelector("gcc-robot-preview").project(...p), place);
const look = async (page, view) => {
  await page.evaluate((v) => document.querySelector("gcc-robot-preview").look(v), view);
  await page.waitForTimeout(100);
  await settled(page);
};

/** Colours around a place of the part. */
async function colors(page, place, reach = 1) {
  const [x, y] = await project(page, place);
  return (await pixels(chrome, await page.screenshot())).near(x, y, reach);
}

// A square: three feed moves, an arc (centre 40 0, so it bulges to the right), a rapid home.
const SQUARE = `G21 G90 G17 F600
G0 X0 Y0 Z0
G1 X40
G3 X40 Y40 J20
G1 X0
G0 X0 Y0
T3 M6
G1 X-20
M2
`;

test("each kind has its colour where its segment lies", async () => {
  const page = await open("square.ngc", SQUARE);
  await look(page, "top");
  assert.ok(has(await colors(page, [20, 0, 0]), FEED), "line 3 is feed");
  assert.ok(has(await colors(page, [60, 20, 0], 2), ARC), "line 4 is an arc");
  assert.ok(has(await colors(page, [20, 40, 0]), FEED), "line 5 is feed");
  assert.ok(has(await colors(page, [0, 20, 0]), RAPID), "line 6 is a rapid");
  assert.ok(has(await colors(page, [20, 20, 0]), [255, 255, 255]), "the middle is empty");
  assert.deepEqual(page.problems, []);
  await page.close();
});

test("a click on a segment chooses its line, a line marks its segments", async () => {
  const page = await open("choose.ngc", SQUARE);
  await look(page, "top");
  for (const [place, line] of [
    [[20, 0, 0], 3],
    [[60, 20, 0], 4],
    [[20, 40, 0], 5],
    [[0, 20, 0], 6],
    [[-10, 0, 0], 8],
  ]) {
    const [x, y] = await project(page, place);
    await page.mouse.click(x, y);
    await settled(page);
    const chosen = await page.evaluate(() => document.querySelector("gcc-robot-preview").line);
    assert.equal(chosen + 1, line, `segment at ${place}`);
    assert.ok(has(await colors(page, place), MARK), `line ${line} is marked`);
    const row = await page.locator(".row.marked").textContent();
    assert.equal(row, `${line}${SQUARE.split("\n")[line - 1]}`);
  }
  await page.locator(".row", { hasText: "G3 X40 Y40" }).click();
  await settled(page);
  assert.ok(has(await colors(page, [60, 20, 0], 2), MARK), "a click on the text marks the arc");
  assert.ok(has(await colors(page, [20, 0, 0]), FEED), "and nothing else");
  await page.close();
});

test("time: the path is drawn as far as it has come", async () => {
  const page = await open("time.ngc", SQUARE);
  await look(page, "top");
  await page.locator('input[type="range"]').evaluate((slider) => {
    slider.value = "250";
    slider.dispatchEvent(new Event("input"));
  });
  await waitFor("faint what is still to come", async () => has(await colors(page, [0, 20, 0]), [216, 220, 228]));
  assert.ok(has(await colors(page, [20, 0, 0]), FEED), "done");
  assert.match(await page.locator("output").textContent(), /^0:00:0\d \/ 0:00:\d\d$/);
  await page.getByRole("button", { name: "play" }).click();
  const slider = page.locator('input[type="range"]');
  await waitFor("playing to move on", async () => Number(await slider.inputValue()) > 250);
  await page.close();
});

test("measuring tells the distance of two points", async () => {
  const page = await open("measure.ngc", SQUARE);
  await look(page, "top");
  await page.getByRole("button", { name: "measure" }).click();
  for (const place of [
    [10, 0, 0],
    [30, 40, 0],
  ]) {
    const [x, y] = await project(page, place);
    await page.mouse.click(x, y);
  }
  await until(page, "the distance", () =>
    document.querySelector("gcc-robot-preview").shadowRoot.querySelector(".note").textContent.includes("ΔX"),
  );
  const note = await page.locator(".note").textContent();
  const [, length, dx, dy] = note.match(/([\d.]+) mm\nΔX ([-\d.]+) {2}ΔY ([-\d.]+)/).map(Number);
  assert.ok(Math.abs(length - Math.hypot(20, 40)) < 0.3 && Math.abs(dx - 20) < 0.3 && Math.abs(dy - 40) < 0.3, note);
  await page.close();
});

test("kinds are hidden, the theme is changed, a curve is shown", async () => {
  const page = await open("hide.ngc", SQUARE);
  await look(page, "top");
  await page.getByLabel("rapid").uncheck();
  await waitFor("hidden rapids", async () => !has(await colors(page, [0, 20, 0]), RAPID));
  await page.getByRole("button", { name: "light or dark" }).click();
  await waitFor("dark", async () => has(await colors(page, [20, 20, 0]), [30, 32, 38]));
  await waitFor("feed in the dark theme", async () => has(await colors(page, [20, 0, 0]), [97, 160, 255]));
  await page.getByLabel("curve").selectOption("feed");
  assert.ok(await page.locator(".curve canvas").isVisible());
  await page.close();
});

test("the dark theme of the system is followed", async () => {
  const page = await open("dark.ngc", SQUARE, { theme: "dark" });
  await look(page, "top");
  assert.ok(has(await colors(page, [20, 0, 0]), [97, 160, 255]));
  await page.close();
});

test("the shipped part, for people to look at", async () => {
  const program = readFileSync(join(top, "docs/examples/flange.ngc"));
  const page = await open("flange.ngc", program);
  await page.screenshot({ path: join(shots, "preview-flange.png") });
  assert.match(await page.locator(".facts").textContent(), /mm · 0:\d\d:\d\d h · cut/);
  assert.deepEqual(page.problems, []);
  await page.close();
});

test("stock, joints and their limits are shown when they are known", async () => {
  await (await open("joints.ngc", SQUARE)).close();
  const path = join(folder, "joints.html");
  const page = readFileSync(path, "utf8");
  const written = page.match(/<script type="application\/json">(.*?)<\/script>/s)[1];
  const data = JSON.parse(written);
  const n = data.path.count;
  const values = new Float32Array(2 * n);
  for (let i = 0; i < n; i++) values.set([i * 10, i === 1 ? Number.NaN : -i], 2 * i);
  data.path.machine = {
    id: "test/two",
    title: "Two joints",
    joints: ["A1", "A2"],
    units: ["deg", "mm"],
    limits: [
      [-170, 15],
      [null, null],
    ],
    values: Buffer.from(values.buffer).toString("base64"),
    frames: [
      {
        name: "base",
        origin: [-20, -8, 0],
        axes: [
          [1, 0, 0],
          [0, 1, 0],
          [0, 0, 1],
        ],
      },
    ],
    // An arm of one bone at each point: from the base straight up in Y.
    figure: {
      lines: [2],
      every: 1,
      points: Buffer.from(new Float32Array(Array(n).fill([-20, -8, 0, -20, 48, 0]).flat()).buffer).toString("base64"),
    },
    note: "",
  };
  data.path.stock = [
    [-30, -10, -5],
    [70, 50, 5],
  ];
  writeFileSync(
    path,
    page.replace(written, () => JSON.stringify(data)),
  );
  const shown = await show(`file://${path}`);
  await look(shown, "top");
  assert.ok(has(await colors(shown, [70, 20, 5], 2), [150, 140, 120]), "an edge of the stock");
  assert.ok(has(await colors(shown, [-20, 35, 0], 2), [110, 118, 135]), "the arm");
  assert.ok(has(await colors(shown, [-17, -8, 0], 2), [200, 40, 40]), "the X axis of its base");
  await shown.getByLabel("test/two").uncheck();
  await shown.waitForTimeout(200);
  await settled(shown);
  assert.ok(!has(await colors(shown, [-20, 35, 0], 2), [110, 118, 135]), "the arm is hidden");
  const names = await shown.getByLabel("curve").locator("option").allTextContents();
  assert.deepEqual(names, ["no curve", "feed, mm/min", "A1, deg", "A1 speed, deg/s", "A2, mm", "A2 speed, mm/s"]);
  await shown.getByLabel("curve").selectOption("A1");
  const ink = (canvas) => {
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    let [curve, limit] = [0, 0];
    for (let i = 0; i < data.length; i += 4) {
      if (data[i + 3] < 200) continue;
      if (data[i] === 24 && data[i + 1] === 92 && data[i + 2] === 190) curve++;
      if (data[i] === 214 && data[i + 1] === 20 && data[i + 2] === 60) limit++;
    }
    return { curve, limit };
  };
  await waitFor("the curve and its limit", async () => {
    const inks = await shown.locator(".curve canvas").evaluate(ink);
    return inks.curve > 200 && inks.limit > 100;
  });
  assert.deepEqual(shown.problems, []);
  await shown.screenshot({ path: join(shots, "preview-joints.png") });
  await shown.close();
});

test("a page loads nothing and needs nothing", async () => {
  const page = await chrome.newPage();
  const asked = [];
  page.on("request", (r) => asked.push(r.url()));
  await page.goto(`file://${join(folder, "square.html")}`);
  await settled(page);
  assert.deepEqual(asked, [`file://${join(folder, "square.html")}`]);
  await page.close();
});

test("text cannot break out of the page", async () => {
  const page = await open("evil.ngc", `(</script><script>window.broken = 1</script>)\n${SQUARE}`);
  assert.equal(await page.evaluate(() => window.broken), undefined);
  assert.deepEqual(page.problems, []);
  await page.close();
});

// A million short feed moves along a spiral, every tenth row a rapid.
function million() {
  const out = ["G21 G90 G17 F3000", "G0 X0 Y0 Z1"];
  for (let i = 0; i < 1_000_000; i++) {
    const a = i / 97;
    const r = 10 + i / 9000;
    out.push(
      `${i % 1000 === 0 ? "G0" : "G1"} X${(r * Math.cos(a)).toFixed(3)} Y${(r * Math.sin(a)).toFixed(3)} Z${(-i / 40000).toFixed(3)}`,
    );
  }
  out.push("M2", "");
  return out.join("\n");
}

/** Frames per second of a page with nothing but a turning element, as large as the others. */
async function bare() {
  const blank = await chrome.newPage();
  const fps = await blank.evaluate(
    () =>
      new Promise((resolve) => {
        const canvas = Object.assign(document.createElement("canvas"), { width: 1280, height: 720 });
        document.body.append(canvas);
        const gl = canvas.getContext("webgl2");
        const begun = performance.now();
        let frames = 0;
        const step = () => {
          const ms = performance.now() - begun;
          if (ms > 1500) return resolve((1000 * frames) / ms);
          frames++;
          gl.clearColor(frames % 2, 0, 0, 1);
          gl.clear(gl.COLOR_BUFFER_BIT);
          requestAnimationFrame(step);
        };
        requestAnimationFrame(step);
      }),
  );
  await blank.close();
  return fps;
}

test("a million segments: load, orbit, rest", { timeout: 240_000 }, async () => {
  const page = await open("million.ngc", million());
  const first = await statistics(page);
  assert.ok(first.points >= 1_000_000 && first.segments >= 1_000_000, `${first.points} points`);

  // Orbit for three seconds, one step per frame; the first half second finds out what the hardware can do.
  const { frames, ms, moving } = await page.evaluate(
    () =>
      new Promise((resolve) => {
        const preview = document.querySelector("gcc-robot-preview");
        const begun = performance.now();
        let frames = 0;
        const step = () => {
          const ms = performance.now() - begun;
          if (ms > 3000) return resolve({ frames, ms: ms - 500, moving: preview.statistics() });
          if (ms > 500) frames++;
          preview.orbit(4, frames % 7 ? 1 : -6);
          requestAnimationFrame(step);
        };
        requestAnimationFrame(step);
      }),
  );
  const fps = frames / (ms / 1000);
  assert.ok(!moving.whole && moving.segments <= 100_000, `${moving.segments} segments while moving`);
  const rested = Date.now();
  await settled(page);
  const rest = Date.now() - rested;
  const still = await statistics(page);
  assert.ok(still.segments >= 1_000_000, "the whole path");

  // The colour of a segment far down the file, and its line.
  await look(page, "top");
  const line = 600_002;
  const i = line - 3;
  const mid = [0, 1].map((d) => {
    const at = (k) => (10 + k / 9000) * [Math.cos, Math.sin][d](k / 97);
    return (at(i - 1) + at(i)) / 2;
  });
  await page.evaluate((l) => {
    document.querySelector("gcc-robot-preview").line = l;
  }, line - 1);
  await settled(page);
  await waitFor("the segment of a line where it should be", async () =>
    has(await colors(page, [...mid, -i / 40000], 2), MARK),
  );
  await page.screenshot({ path: join(shots, "preview-million.png") });
  const told = `load ${page.loaded} ms; while moving ${moving.segments} segments at ${fps.toFixed(1)} frames/s; whole ${rest} ms after rest`;
  writeFileSync(join(shots, "preview-million.txt"), `${told}\n${first.device}\n`);
  console.log(`# 1 000 000 segments: ${told} (${first.device})`);
  // 15 frames per second, the whole path a second after rest. A busy machine is not the component's fault: the figures
  // stand in the file, and only a multiple of them fails, unless GCC_ROBOT_PERF=1 says that the machine is quiet. On
  // one that can't even show an empty page at 30 frames per second, half of what it can.
  const slack = process.env.GCC_ROBOT_PERF === "1" ? 1 : 10;
  const possible = await bare();
  assert.ok(fps >= Math.min(15, possible / 2) / slack, `${fps} of ${possible} frames per second`);
  assert.ok(rest <= 1000 * slack, `${rest} ms from rest to the whole path`);
  await page.close();
});

// ── served ──────────────────────────────────────────────────────────────────────────────────────────

/** Starts `gcc-robot preview --serve`; `heard` are the objects it writes. */
async function serve(t, source, options = []) {
  const child = spawn(robot, ["preview", source, "--serve", ...options], { stdio: ["pipe", "pipe", "inherit"] });
  t.after(() => child.kill());
  const heard = [];
  const lines = createInterface({ input: child.stdout });
  const first = new Promise((resolve, reject) => {
    lines.on("line", (line) => {
      heard.push(line.startsWith("{") ? JSON.parse(line) : { url: line.match(/http:\S+/)?.[0] });
      resolve(heard[0].url);
    });
    child.on("exit", () => reject(new Error("ended")));
  });
  return { child, heard, url: await first, say: (o) => child.stdin.write(`${JSON.stringify(o)}\n`) };
}

const status = (url, options = {}) =>
  new Promise((resolve, reject) => {
    const ask = options.method ? request : get;
    const r = ask(url, options, (answer) => {
      answer.resume();
      resolve(answer.statusCode);
    });
    r.on("error", reject);
    if (options.method) r.end(options.body ?? "");
  });

test("served for an editor: cursor, choice and edits go both ways", async (t) => {
  const source = join(folder, "served.ngc");
  writeFileSync(source, SQUARE);
  const server = await serve(t, source, ["--editor"]);
  const page = await show(server.url);
  await look(page, "top");
  server.say({ line: 4 });
  await until(page, "the cursor's line", () => document.querySelector("gcc-robot-preview").line === 3);
  await settled(page);
  assert.ok(has(await colors(page, [60, 20, 0], 2), MARK), "the cursor's segment is marked");

  const [x, y] = await project(page, [0, 20, 0]);
  await page.mouse.click(x, y);
  await waitFor("the chosen line", () => server.heard.some((m) => m.line === 6));

  const sent = Date.now();
  server.say({ text: SQUARE.replace("G1 X40", "G1 X40 Y0 Z-5") });
  await until(page, "the edited path", () =>
    document.querySelector("gcc-robot-preview").shadowRoot.querySelector(".facts").textContent.includes("× 5 mm"),
  );
  console.log(`# edit to picture: ${Date.now() - sent} ms`);
  await settled(page);
  assert.ok(has(await colors(page, [20, 0, 0]), FEED));
  assert.deepEqual(page.problems, []);
  await page.close();
  server.child.stdin.end();
  assert.equal(await new Promise((resolve) => server.child.on("exit", resolve)), 0, "it ends with its editor");
});

test("served: a changed file is drawn again, errors are told", async (t) => {
  const source = join(folder, "watched.ngc");
  writeFileSync(source, SQUARE);
  const server = await serve(t, source);
  const page = await show(server.url);
  await look(page, "top");
  assert.ok(!has(await colors(page, [20, 20, 0]), FEED));
  writeFileSync(source, SQUARE.replace("G1 X40", "G1 X40 Y40"));
  await waitFor("the diagonal", async () => {
    await settled(page);
    return has(await colors(page, [20, 20, 0], 2), FEED);
  });
  writeFileSync(source, SQUARE.replace("J20", "J19"));
  await until(page, "the error", () =>
    document.querySelector("gcc-robot-preview").shadowRoot.querySelector(".warning").textContent.includes("line 4"),
  );
  await page.close();
});

test("served: only with the token, only to this computer, only what belongs to it", async (t) => {
  const source = join(folder, "guarded.ngc");
  writeFileSync(source, SQUARE);
  const server = await serve(t, source);
  const url = new URL(server.url);
  assert.equal(url.hostname, "127.0.0.1");
  assert.match(url.pathname, /^\/[0-9a-f]{32,}\/$/);
  const base = `http://${url.host}`;
  assert.equal(await status(server.url), 200);
  assert.equal(await status(`${server.url}path`), 200);
  for (const path of [
    "/",
    "/path",
    "/0000/",
    `${url.pathname}../path`,
    `${url.pathname}%2e%2e/etc/passwd`,
    `${url.pathname}../../../../etc/passwd`,
    `${url.pathname}guarded.ngc`,
  ]) {
    const [status_] = await new Promise((resolve) => {
      const r = request({ host: url.hostname, port: url.port, path }, (a) => {
        a.resume();
        resolve([a.statusCode]);
      });
      r.end();
    });
    assert.ok(status_ === 404 || status_ === 403, `${path}: ${status_}`);
  }
  assert.equal(
    await status(server.url, { headers: { host: "evil.example" } }),
    403,
    "a name that leads here from elsewhere",
  );
  assert.equal(
    await status(`${server.url}choose`, { method: "POST", body: "3", headers: { origin: "http://evil.example" } }),
    403,
  );
  assert.equal(await status(`${base}${url.pathname}choose`, { method: "POST", body: "not a number" }), 400);
  assert.equal(await status(server.url, { method: "DELETE" }), 405);
});
