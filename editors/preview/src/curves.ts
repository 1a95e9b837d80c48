// Feed and joint positions over time, under the view.

import { pointAt, type Scene } from "./scene";
import { css, type Theme } from "./theme";

/** One curve: its name, its unit, a value per point. */
interface Curve {
  name: string;
  unit: string;
  value: (point: number) => number;
  limits: [number | null, number | null];
}

const MARGIN = 64;

export function curves(scene: Scene): Curve[] {
  const all: Curve[] = [{ name: "feed", unit: "mm/min", value: (i) => scene.feeds[i], limits: [null, null] }];
  const machine = scene.machine;
  if (!machine || scene.joints.length === 0) return all;
  const n = machine.joints.length;
  machine.joints.forEach((name, j) => {
    all.push({
      name,
      unit: machine.units[j],
      value: (i) => scene.joints[i * n + j],
      limits: machine.limits[j] ?? [null, null],
    });
    all.push({
      name: `${name} speed`,
      unit: `${machine.units[j]}/s`,
      value: (i) => speed(scene, i, j, n),
      limits: [null, null],
    });
  });
  return all;
}

function speed(scene: Scene, i: number, j: number, n: number): number {
  const dt = i > 0 ? scene.times[i] - scene.times[i - 1] : 0;
  return dt > 1e-6 ? (scene.joints[i * n + j] - scene.joints[(i - 1) * n + j]) / dt : Number.NaN;
}

/** Smallest and largest value per column of pixels. */
function columns(scene: Scene, curve: Curve, width: number): { low: Float64Array; high: Float64Array } {
  const low = new Float64Array(width).fill(Number.POSITIVE_INFINITY);
  const high = new Float64Array(width).fill(Number.NEGATIVE_INFINITY);
  const per = (width - 1) / Math.max(scene.times[scene.count - 1] ?? 0, 1e-6);
  for (let i = 0; i < scene.count; i++) {
    const x = Math.min(width - 1, Math.max(0, Math.round(scene.times[i] * per)));
    const v = curve.value(i);
    if (v < low[x]) low[x] = v;
    if (v > high[x]) high[x] = v;
  }
  return { low, high };
}

/** Draws one curve; the picture is made once per path and size, the cursor over it at every step. */
export class Plot {
  private picture: HTMLCanvasElement | null = null;
  private key = "";

  constructor(readonly canvas: HTMLCanvasElement) {}

  draw(scene: Scene, curve: Curve, theme: Theme, seconds: number) {
    const ratio = devicePixelRatio || 1;
    const width = Math.max(2, Math.round(this.canvas.clientWidth * ratio));
    const height = Math.max(2, Math.round(this.canvas.clientHeight * ratio));
    const key = `${curve.name} ${width} ${height} ${theme.text}`;
    if (this.key !== key || !this.picture) {
      this.picture = this.paint(scene, curve, theme, width, height, ratio);
      this.key = key;
    }
    this.canvas.width = width;
    this.canvas.height = height;
    const g = this.canvas.getContext("2d");
    if (!g) return;
    g.drawImage(this.picture, 0, 0);
    const end = Math.max(scene.times[scene.count - 1] ?? 0, 1e-6);
    const x = MARGIN * ratio + (seconds / end) * (width - (MARGIN + 8) * ratio);
    g.fillStyle = css(theme.mark);
    g.fillRect(Math.round(x), 0, ratio, height);
    const value = scene.count ? curve.value(pointAt(scene, seconds)) : Number.NaN;
    g.font = `${12 * ratio}px sans-serif`;
    g.textAlign = x > width / 2 ? "right" : "left";
    g.fillText(
      Number.isFinite(value) ? `${+value.toFixed(2)} ${curve.unit}` : "",
      x + (x > width / 2 ? -6 : 6) * ratio,
      13 * ratio,
    );
  }

  /** The path has changed. */
  forget() {
    this.picture = null;
  }

  private paint(
    scene: Scene,
    curve: Curve,
    theme: Theme,
    width: number,
    height: number,
    ratio: number,
  ): HTMLCanvasElement {
    const picture = document.createElement("canvas");
    picture.width = width;
    picture.height = height;
    const g = picture.getContext("2d");
    if (!g || scene.count === 0) return picture;
    const left = MARGIN * ratio;
    const span = Math.max(2, Math.floor(width - left - 8 * ratio));
    const { low, high } = columns(scene, curve, span);
    let [min, max] = [Number.POSITIVE_INFINITY, Number.NEGATIVE_INFINITY];
    for (let x = 0; x < span; x++) {
      if (low[x] < min) min = low[x];
      if (high[x] > max) max = high[x];
    }
    if (!(max > min)) [min, max] = Number.isFinite(min) ? [min - 1, max + 1] : [0, 1];
    const y = (v: number) => height - 6 * ratio - ((v - min) / (max - min)) * (height - 24 * ratio);
    g.fillStyle = theme.text;
    g.font = `${11 * ratio}px sans-serif`;
    g.textAlign = "right";
    g.fillText(String(+max.toPrecision(5)), left - 4 * ratio, y(max) + 4 * ratio);
    g.fillText(String(+min.toPrecision(5)), left - 4 * ratio, y(min));
    g.strokeStyle = css(theme.mark);
    g.setLineDash([4, 4]);
    for (const limit of curve.limits) {
      if (limit === null || limit < min || limit > max) continue;
      g.beginPath();
      g.moveTo(left, y(limit));
      g.lineTo(left + span, y(limit));
      g.stroke();
    }
    g.setLineDash([]);
    g.strokeStyle = css(theme.kinds[1]);
    g.lineWidth = ratio;
    g.beginPath();
    let drawing = false;
    for (let x = 0; x < span; x++) {
      if (low[x] > high[x]) continue;
      if (drawing) g.lineTo(left + x, y(low[x]));
      else g.moveTo(left + x, y(low[x]));
      g.lineTo(left + x, y(high[x]));
      drawing = true;
    }
    g.stroke();
    return picture;
  }
}
