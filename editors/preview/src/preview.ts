// The web component `<gcc-robot-preview>`: the tool path, its time, its curves. It knows nothing of editors:
// it is given scenes and lines, and says with an event which line was chosen.

import { Camera, VIEWS } from "./camera";
import { curves, Plot } from "./curves";
import { Labels } from "./labels";
import { Listing } from "./listing";
import { type Hit, pick } from "./pick";
import { type Picture, Renderer } from "./renderer";
import { type Box, figureAt, KINDS, nothing, pointAt, pointsOf, type Scene, toolAt } from "./scene";
import style from "./style.css";
import { css, DARK, LIGHT, type Theme } from "./theme";

/** How long the camera rests before the whole path is drawn, ms. */
const REST = 150;
/** How near to a segment a click must be, pixels. */
const REACH = 8;
const SPEEDS = [1, 2, 5, 10, 50, 100, 500];

function make<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  props: Partial<HTMLElementTagNameMap[K]> = {},
): HTMLElementTagNameMap[K] {
  return Object.assign(document.createElement(tag), props);
}

function clock(seconds: number): string {
  const two = (v: number) => String(Math.floor(v)).padStart(2, "0");
  return `${Math.floor(seconds / 3600)}:${two((seconds / 60) % 60)}:${two(seconds % 60)}`;
}

const number = (v: number) => String(+v.toFixed(3));

export class Preview extends HTMLElement {
  private scene: Scene = nothing();
  private theme: Theme = LIGHT;
  private chosenTheme: "light" | "dark" | null = null;
  private readonly camera = new Camera();
  private renderer: Renderer | null = null;
  private readonly root = this.attachShadow({ mode: "open" });
  private readonly view = make("div", { className: "view" });
  private readonly canvas = make("canvas", { className: "path" });
  private readonly labels = new Labels(make("canvas", { className: "labels" }));
  private readonly facts = make("span", { className: "facts" });
  private readonly warning = make("span", { className: "warning" });
  private readonly title_ = make("b");
  private readonly legend = make("span", { className: "legend" });
  private readonly note = make("div", { className: "note" });
  private readonly slider = make("input", { type: "range", min: "0", max: "1000", value: "1000", ariaLabel: "time" });
  private readonly output = make("output");
  private readonly playing = make("button", { textContent: "▶", title: "play (space)", ariaLabel: "play" });
  private readonly speed = make("select", { title: "times real speed", ariaLabel: "speed" });
  private readonly curve = make("select", { title: "curve", ariaLabel: "curve" });
  private readonly curveBox = make("div", { className: "curve" });
  private readonly plot = new Plot(make("canvas"));
  private readonly measuring = make("button", {
    textContent: "measure",
    title: "distance between two points of the path",
  });
  private readonly listing = new Listing((line) => {
    this.line = line;
    this.chose(line);
  });
  private all: HTMLButtonElement | null = null;
  private shown = 0xff;
  private machineShown = true;
  /** Pairs of places. */
  private marked = new Float32Array();
  private markedLine = -1;
  private seconds = Number.POSITIVE_INFINITY;
  private player = 0;
  private queued = 0;
  private rest = 0;
  private points: Hit[] = [];
  private frames: number[] = [];

  connectedCallback() {
    if (this.renderer) return;
    const sheet = new CSSStyleSheet();
    sheet.replaceSync(style);
    this.root.adoptedStyleSheets = [sheet];
    this.build();
    try {
      this.renderer = new Renderer(this.canvas);
    } catch (problem) {
      this.warning.textContent = `${(problem as Error).message}: the tool path can't be drawn`;
    }
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.paintTheme());
    new MutationObserver(() => this.paintTheme()).observe(document.body, { attributeFilter: ["class"] });
    new ResizeObserver(() => this.resize()).observe(this.view);
    this.canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    this.canvas.addEventListener("webglcontextrestored", () => {
      this.renderer = new Renderer(this.canvas);
      this.renderer.load(this.scene);
      this.resize();
    });
    this.paintTheme();
    this.resize();
  }

  // ── what hosts call ─────────────────────────────────────────────────────────────────────────────

  /** Shows a path. The camera stays where it is when one was shown before. */
  setScene(scene: Scene) {
    const first = this.scene.count === 0;
    const whole = this.seconds >= this.end();
    this.scene = scene;
    this.points = [];
    this.pause();
    this.renderer?.load(scene);
    this.plot.forget();
    if (first) this.camera.fit(extent(scene));
    this.describe();
    this.findMarked();
    this.seconds = first || whole ? this.end() : Math.min(this.seconds, this.end());
    this.draw(false);
  }

  /** Shows the program's text beside the path. */
  setText(text: string) {
    this.listing.element.hidden = false;
    this.listing.show(text);
  }

  set heading(text: string) {
    this.title_.textContent = text;
  }

  /** Says that something is wrong; "" takes it back. */
  set problem(text: string) {
    this.warning.textContent = text;
  }

  /** The line that is marked, from 0; -1: none. */
  set line(line: number) {
    this.markedLine = line;
    this.findMarked();
    this.listing.mark(line, true);
    this.draw(false);
  }
  get line(): number {
    return this.markedLine;
  }

  /** Turns the camera: iso, top, front or right. */
  look(view: string) {
    this.camera.look(view, extent(this.scene));
    this.draw(false);
  }

  /** Turns the camera as a drag over that many pixels does. */
  orbit(dx: number, dy: number) {
    this.camera.orbit(dx, dy);
    this.draw(true);
  }

  /** Where a place of the part is, in pixels of the page. */
  project(x: number, y: number, z: number): [number, number] {
    const box = this.canvas.getBoundingClientRect();
    const [px, py] = this.camera.project(x, y, z);
    return [box.left + px, box.top + py];
  }

  /** What was drawn last, and when the latest frames came (ms). */
  statistics() {
    return {
      ...(this.renderer?.drawn ?? { segments: 0, whole: false }),
      device: this.renderer?.device ?? "",
      points: this.scene.count,
      frames: [...this.frames],
      busy: this.rest !== 0 || this.queued !== 0,
    };
  }

  // ── the page ────────────────────────────────────────────────────────────────────────────────────

  private build() {
    const bar = make("div", { className: "bar" });
    const views = make("span");
    const all = make("button", { textContent: "machine", title: "path and machine", hidden: true });
    all.onclick = () => {
      this.camera.fit(wholeExtent(this.scene));
      this.draw(false);
    };
    this.all = all;
    for (const view of Object.keys(VIEWS)) {
      const button = make("button", { textContent: view });
      button.onclick = () => this.look(view);
      views.append(button, " ");
    }
    views.append(all);
    const light = make("button", { textContent: "◐", title: "light or dark", ariaLabel: "light or dark" });
    light.onclick = () => {
      this.chosenTheme = this.theme === LIGHT ? "dark" : "light";
      this.paintTheme();
    };
    this.measuring.onclick = () => this.measure(this.measuring.ariaPressed !== "true");
    bar.append(this.title_, this.facts, views, this.measuring, light, this.legend, this.warning);
    this.view.append(this.canvas, this.labels.canvas, this.note);
    this.listing.element.hidden = true;
    const time = make("div", { className: "time" });
    for (const v of SPEEDS) this.speed.append(make("option", { value: String(v), textContent: `${v}×` }));
    this.speed.value = "10";
    time.append(this.playing, this.slider, this.output, this.speed, this.curve);
    this.curveBox.append(this.plot.canvas);
    this.curveBox.hidden = true;
    this.root.append(bar, this.view, this.listing.element, time, this.curveBox);
    this.listen();
    this.describe();
  }

  private listen() {
    this.slider.oninput = () => {
      this.pause();
      this.goto((Number(this.slider.value) / 1000) * this.end());
    };
    this.playing.onclick = () => (this.player ? this.pause() : this.play());
    this.curve.onchange = () => {
      this.curveBox.hidden = this.curve.value === "";
      this.drawCurve();
    };
    this.plot.canvas.onpointerdown = (event) => this.gotoColumn(event.offsetX);
    this.plot.canvas.onpointermove = (event) => {
      if (event.buttons) this.gotoColumn(event.offsetX);
    };
    this.tabIndex = 0;
    this.addEventListener("keydown", (event) => this.key(event));
    this.pointer();
  }

  private gotoColumn(x: number) {
    this.pause();
    this.goto(((x - 64) / (this.plot.canvas.clientWidth - 72)) * this.end());
  }

  private key(event: KeyboardEvent) {
    const target = event.composedPath()[0];
    if (target instanceof HTMLInputElement || target instanceof HTMLSelectElement) return;
    const names = Object.keys(VIEWS);
    const turns: Record<string, [number, number]> = {
      ArrowLeft: [-20, 0],
      ArrowRight: [20, 0],
      ArrowUp: [0, -20],
      ArrowDown: [0, 20],
    };
    if (event.key === " ") this.player ? this.pause() : this.play();
    else if (event.key === "Escape") this.measure(false);
    else if (turns[event.key]) this.orbit(...turns[event.key]);
    else if (names[Number(event.key) - 1]) this.look(names[Number(event.key) - 1]);
    else return;
    event.preventDefault();
  }

  private pointer() {
    let from: [number, number] | null = null;
    let moved = 0;
    const canvas = this.canvas;
    canvas.onpointerdown = (event) => {
      from = [event.clientX, event.clientY];
      moved = 0;
      canvas.setPointerCapture(event.pointerId);
    };
    canvas.onpointermove = (event) => {
      if (!from) return;
      const dx = event.clientX - from[0];
      const dy = event.clientY - from[1];
      moved += Math.abs(dx) + Math.abs(dy);
      from = [event.clientX, event.clientY];
      if (event.shiftKey || event.buttons & 6) this.camera.pan(dx, dy);
      else this.camera.orbit(dx, dy);
      this.draw(true);
    };
    canvas.onpointerup = (event) => {
      if (from && moved < 4 && event.button === 0) this.clicked(event.offsetX, event.offsetY);
      from = null;
    };
    canvas.onwheel = (event) => {
      event.preventDefault();
      const { width, height } = this.camera;
      this.camera.zoom(Math.exp(-event.deltaY * 0.0015), event.offsetX - width / 2, event.offsetY - height / 2);
      this.draw(true);
    };
    canvas.ondblclick = () => {
      this.camera.fit(extent(this.scene));
      this.draw(false);
    };
    canvas.oncontextmenu = (event) => event.preventDefault();
  }

  private clicked(x: number, y: number) {
    const hit = pick(this.scene, this.camera, x, y, REACH, this.shown, this.until());
    if (this.measuring.ariaPressed === "true") {
      if (!hit) return;
      this.points = this.points.length === 2 ? [hit] : [...this.points, hit];
      this.draw(false);
      return;
    }
    if (!hit) {
      this.line = -1;
      return;
    }
    const line = this.scene.lines[hit.point];
    this.line = line;
    this.tell(hit);
    this.chose(line);
  }

  private chose(line: number) {
    this.dispatchEvent(new CustomEvent("choose", { detail: { line } }));
  }

  private tell(hit: Hit) {
    const s = this.scene;
    const tool = toolAt(s, hit.point);
    const feed = s.feeds[hit.point];
    this.note.textContent = [
      `line ${s.lines[hit.point] + 1}: ${KINDS[s.kinds[hit.point]] ?? ""} to ${this.place(hit.point)}`,
      [feed ? `${number(feed)} mm/min` : "", clock(s.times[hit.point]), tool ? `T${tool.number}` : ""]
        .filter(Boolean)
        .join(" · "),
    ].join("\n");
  }

  private place(point: number): string {
    return [0, 1, 2].map((a) => `${"XYZ"[a]}${number(this.scene.positions[3 * point + a])}`).join(" ");
  }

  private measure(on: boolean) {
    this.measuring.ariaPressed = String(on);
    this.view.classList.toggle("measuring", on);
    this.points = [];
    this.note.textContent = on ? "click two points of the path" : "";
    this.draw(false);
  }

  private measured() {
    if (this.points.length < 2) return;
    const [a, b] = this.points.map((hit) => hit.place);
    const d = b.map((v, i) => v - a[i]);
    this.note.textContent = `${number(Math.hypot(...d))} mm\nΔX ${number(d[0])}  ΔY ${number(d[1])}  ΔZ ${number(d[2])}`;
  }

  /** Texts that change with the path. */
  private describe() {
    const s = this.scene;
    const size = s.bounds ? s.bounds[1].map((v, i) => number(v - (s.bounds?.[0][i] ?? 0))).join(" × ") : "";
    this.facts.textContent = s.count
      ? `${size} mm · ${clock(s.seconds)} h · cut ${number(s.cutLength / 1000)} m · rapid ${number(s.rapidLength / 1000)} m`
      : "no moves";
    if (s.truncated) this.warning.textContent = "the path is longer than what is shown";
    this.drawLegend();
    const chosen = this.curve.value;
    const options = curves(s).map((c) => make("option", { value: c.name, textContent: `${c.name}, ${c.unit}` }));
    this.curve.replaceChildren(make("option", { value: "", textContent: "no curve" }), ...options);
    this.curve.value = options.some((o) => o.value === chosen) ? chosen : "";
    this.curveBox.hidden = this.curve.value === "";
  }

  private drawLegend() {
    const used = new Set(this.scene.kinds);
    const boxes = KINDS.map((name, kind) => {
      if (!used.has(kind)) return "";
      const box = make("input", { type: "checkbox", checked: (this.shown & (1 << kind)) !== 0 });
      box.onchange = () => {
        this.shown ^= 1 << kind;
        this.draw(false);
      };
      const bar = make("i");
      bar.style.background = css(this.theme.kinds[kind]);
      const label = make("label");
      label.append(box, bar, name);
      return label;
    });
    this.legend.replaceChildren(...boxes, this.machineBox());
  }

  /** The machine can be hidden too. */
  private machineBox(): HTMLElement | string {
    const machine = this.scene.machine;
    if (this.all) this.all.hidden = !machine?.figure.lines.length;
    if (!machine) return "";
    const box = make("input", { type: "checkbox", checked: this.machineShown });
    box.onchange = () => {
      this.machineShown = box.checked;
      this.draw(false);
    };
    const bar = make("i");
    bar.style.background = css(this.theme.machine);
    const label = make("label", { title: [machine.title, machine.note].filter(Boolean).join("\n") });
    label.append(box, bar, machine.note ? `${machine.id} (!)` : machine.id);
    return label;
  }

  private paintTheme() {
    const body = document.body.classList;
    const dark = body.contains("vscode-dark") || body.contains("vscode-high-contrast");
    const light = body.contains("vscode-light") || body.contains("vscode-high-contrast-light");
    const system = matchMedia("(prefers-color-scheme: dark)").matches;
    const wanted = this.chosenTheme ?? (light ? "light" : dark || system ? "dark" : "light");
    this.theme = wanted === "dark" ? DARK : LIGHT;
    this.style.setProperty("--background", css(this.theme.background));
    this.style.setProperty("--text", this.theme.text);
    this.style.setProperty("--mark", css(this.theme.mark));
    this.style.setProperty("--feed", css(this.theme.kinds[1]));
    this.plot.forget();
    this.drawLegend();
    this.draw(false);
  }

  private resize() {
    const { clientWidth: width, clientHeight: height } = this.view;
    if (!width || !height) return;
    const fresh = this.camera.width === 1;
    this.camera.width = width;
    this.camera.height = height;
    if (fresh) this.camera.fit(extent(this.scene));
    const ratio = devicePixelRatio || 1;
    this.renderer?.resize(Math.round(width * ratio), Math.round(height * ratio));
    this.draw(false);
  }

  // ── time ────────────────────────────────────────────────────────────────────────────────────────

  private end(): number {
    return this.scene.count ? this.scene.times[this.scene.count - 1] : 0;
  }

  /** Points that are drawn in full colour. */
  private until(): number {
    if (this.seconds >= this.end()) return this.scene.count;
    return Math.min(this.scene.count, pointAt(this.scene, this.seconds) + 1);
  }

  private goto(seconds: number) {
    this.seconds = Math.max(0, Math.min(this.end(), seconds));
    this.draw(true);
  }

  private play() {
    if (!this.scene.count) return;
    if (this.seconds >= this.end()) this.seconds = 0;
    this.playing.textContent = "❚❚";
    let last = performance.now();
    const step = (now: number) => {
      const passed = ((now - last) / 1000) * Number(this.speed.value);
      last = now;
      this.goto(this.seconds + passed);
      this.player = this.seconds < this.end() ? requestAnimationFrame(step) : 0;
      if (!this.player) this.pause();
    };
    this.player = requestAnimationFrame(step);
  }

  private pause() {
    cancelAnimationFrame(this.player);
    this.player = 0;
    this.playing.textContent = "▶";
  }

  /** Where the tool is now: between the last point reached and the next. */
  private toolPlace(): [number, number, number] | null {
    const s = this.scene;
    if (!s.count || this.seconds >= this.end()) return null;
    const i = pointAt(s, this.seconds);
    const n = Math.min(i + 1, s.count - 1);
    const dt = s.times[n] - s.times[i];
    const share = dt > 0 ? Math.min(1, (this.seconds - s.times[i]) / dt) : 0;
    const at = (a: number) => s.positions[3 * i + a] + share * (s.positions[3 * n + a] - s.positions[3 * i + a]);
    return [at(0), at(1), at(2)];
  }

  // ── drawing ─────────────────────────────────────────────────────────────────────────────────────

  private findMarked() {
    const points = this.markedLine < 0 ? [] : pointsOf(this.scene, this.markedLine);
    this.marked = new Float32Array(6 * points.length);
    points.forEach((i, n) => {
      this.marked.set(this.scene.positions.subarray(3 * i - 3, 3 * i + 3), 6 * n);
    });
    this.note.textContent = "";
    const point = points.at(-1);
    if (point !== undefined) this.tell({ point, share: 1, place: [0, 0, 0] });
  }

  private picture(): Picture {
    const axis = this.axisLength();
    const axes = [0, 1, 2].map((a) => {
      const places = new Float32Array(6);
      places[3 + a] = axis;
      return { places, color: this.theme.axes[a] };
    });
    const extras = [...axes, ...this.machineLines()];
    if (this.scene.stock) extras.push({ places: edges(this.scene.stock), color: this.theme.stock });
    const [a, b] = this.points;
    if (b) extras.push({ places: Float32Array.from([...a.place, ...b.place]), color: this.theme.measure });
    return {
      matrix: this.camera.matrix(),
      background: this.theme.background,
      colors: this.theme.kinds,
      shown: this.shown,
      until: this.until(),
      faint: this.theme.faint,
      marked: this.marked,
      mark: this.theme.mark,
      extras,
    };
  }

  /** The machine where the tool is: at the chosen line, else at the time shown. */
  private machineLines(): Picture["extras"] {
    const machine = this.scene.machine;
    if (!machine || !this.machineShown) return [];
    const marked = this.markedLine < 0 ? [] : pointsOf(this.scene, this.markedLine);
    const resting = this.seconds >= this.end();
    const point = resting ? (marked.at(-1) ?? this.scene.count - 1) : pointAt(this.scene, this.seconds);
    const axis = 1.5 * this.axisLength();
    const frames = machine.frames.flatMap((f) =>
      f.axes.map((a, i) => ({
        places: Float32Array.from([...f.origin, ...f.origin.map((v, k) => v + axis * a[k])]),
        color: this.theme.axes[i],
      })),
    );
    return [...frames, { places: figureAt(this.scene, point), color: this.theme.machine }];
  }

  private axisLength(): number {
    const bounds = this.scene.bounds;
    return bounds ? Math.max(...bounds[1].map((v, i) => v - bounds[0][i]), 1) / 8 : 10;
  }

  /** Draws at the next frame; while something moves a reduced path first, the whole one when it rests. */
  private draw(moving: boolean) {
    clearTimeout(this.rest);
    this.rest = 0;
    this.queued ||= requestAnimationFrame((now) => {
      this.queued = 0;
      this.frames.push(now);
      if (this.frames.length > 240) this.frames.shift();
      this.paint(moving, now);
    });
  }

  private paint(moving: boolean, now: number) {
    this.drawTime();
    this.measured();
    this.labels.draw(this.scene, this.camera, this.theme, {
      axis: this.axisLength(),
      tool: this.toolPlace(),
      points: this.points.map((hit) => hit.place),
      until: this.until(),
      frames: this.machineShown,
    });
    if (!this.renderer) return;
    const whole = this.renderer.quick(this.picture(), now);
    if (whole) return;
    this.rest = window.setTimeout(
      () => {
        this.renderer?.whole(this.picture(), () => {
          this.rest = 0;
        });
      },
      moving ? REST : 0,
    );
  }

  private drawTime() {
    this.slider.value = String(this.end() ? (this.seconds / this.end()) * 1000 : 0);
    this.output.textContent = `${clock(this.seconds)} / ${clock(this.end())}`;
    this.drawCurve();
  }

  private drawCurve() {
    const chosen = curves(this.scene).find((c) => c.name === this.curve.value);
    if (chosen) this.plot.draw(this.scene, chosen, this.theme, this.seconds);
  }
}

/** The box around path and raw part. */
function extent(scene: Scene): Box | null {
  const { bounds, stock } = scene;
  if (!bounds || !stock) return bounds ?? stock;
  const join = (of: (...v: number[]) => number, i: 0 | 1) => bounds[i].map((v, a) => of(v, stock[i][a])) as Box[0];
  return [join(Math.min, 0), join(Math.max, 1)];
}

/** The same with the machine, at the beginning, and its frames. */
function wholeExtent(scene: Scene): Box | null {
  const all = extent(scene);
  const figure = figureAt(scene, 0);
  const places = (scene.machine?.frames ?? []).map((f) => [...f.origin]);
  for (let i = 0; i < figure.length; i += 3) places.push([...figure.subarray(i, i + 3)]);
  places.push(...(all ?? []));
  if (!places.length) return null;
  const of = (join: (...v: number[]) => number) => [0, 1, 2].map((a) => join(...places.map((p) => p[a]))) as Box[0];
  return [of(Math.min), of(Math.max)];
}

/** The twelve edges of a box. */
function edges([low, high]: [number[], number[]]): Float32Array<ArrayBuffer> {
  const corner = (i: number) => [0, 1, 2].map((a) => ((i >> a) & 1 ? high[a] : low[a]));
  const out: number[] = [];
  for (let i = 0; i < 8; i++) {
    for (let a = 0; a < 3; a++) {
      if (!((i >> a) & 1)) out.push(...corner(i), ...corner(i | (1 << a)));
    }
  }
  return Float32Array.from(out);
}
