// Texts and small marks over the lines: axes, tool changes, the tool, measured points, the scale.

import type { Camera } from "./camera";
import type { Scene } from "./scene";
import { css, type Theme } from "./theme";

/** Most tool changes that are named; the rest is in the outline of the editor. */
const MOST_TOOLS = 60;

export interface Marks {
  axis: number;
  tool: [number, number, number] | null;
  points: [number, number, number][];
  until: number;
  /** Frames of the machine are named. */
  frames: boolean;
}

/** 1, 2 or 5 times a power of ten, not smaller than `v`. */
function nice(v: number): number {
  const power = 10 ** Math.floor(Math.log10(v));
  return [1, 2, 5, 10].map((f) => f * power).find((x) => x >= v * 0.999) ?? 10 * power;
}

export class Labels {
  constructor(readonly canvas: HTMLCanvasElement) {}

  draw(scene: Scene, camera: Camera, theme: Theme, marks: Marks) {
    const ratio = devicePixelRatio || 1;
    const { width, height } = camera;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    const g = this.canvas.getContext("2d");
    if (!g) return;
    g.scale(ratio, ratio);
    g.font = "bold 12px sans-serif";
    g.textAlign = "center";
    g.textBaseline = "middle";
    for (const axis of [0, 1, 2]) {
      const end: [number, number, number] = [0, 0, 0];
      end[axis] = marks.axis * 1.12;
      const [x, y] = camera.project(...end);
      g.fillStyle = css(theme.axes[axis]);
      g.fillText("XYZ"[axis], x, y);
    }
    if (marks.frames) this.frames(g, scene, camera, theme);
    this.tools(g, scene, camera, theme, marks.until);
    for (const place of marks.points) this.ring(g, camera.project(...place), css(theme.measure), 5);
    if (marks.tool) this.cone(g, camera.project(...marks.tool), css(theme.mark));
    this.scale(g, camera, theme);
  }

  /** Names of base, table and part, beside their origins. */
  private frames(g: CanvasRenderingContext2D, scene: Scene, camera: Camera, theme: Theme) {
    g.font = "11px sans-serif";
    g.textAlign = "left";
    g.fillStyle = theme.text;
    for (const frame of scene.machine?.frames ?? []) {
      const [x, y] = camera.project(...frame.origin);
      g.fillText(frame.name, x + 8, y + 10);
    }
  }

  private tools(g: CanvasRenderingContext2D, scene: Scene, camera: Camera, theme: Theme, until: number) {
    g.font = "11px sans-serif";
    g.textAlign = "left";
    for (const tool of scene.tools.slice(0, MOST_TOOLS)) {
      if (tool.point >= scene.count || tool.point >= until) continue;
      const at = [0, 1, 2].map((a) => scene.positions[3 * tool.point + a]) as [number, number, number];
      const [x, y] = camera.project(...at);
      g.fillStyle = css(theme.tool);
      g.beginPath();
      g.moveTo(x, y - 5);
      g.lineTo(x + 4, y);
      g.lineTo(x, y + 5);
      g.lineTo(x - 4, y);
      g.fill();
      const diameter = tool.diameter ? ` ⌀${+tool.diameter.toFixed(3)}` : "";
      g.fillText(`T${tool.number}${diameter}`, x + 8, y - 8);
    }
  }

  private ring(g: CanvasRenderingContext2D, [x, y]: number[], color: string, radius: number) {
    g.strokeStyle = color;
    g.lineWidth = 2;
    g.beginPath();
    g.arc(x, y, radius, 0, 2 * Math.PI);
    g.stroke();
  }

  private cone(g: CanvasRenderingContext2D, [x, y]: number[], color: string) {
    g.fillStyle = color;
    g.beginPath();
    g.moveTo(x, y);
    g.lineTo(x - 6, y - 16);
    g.lineTo(x + 6, y - 16);
    g.fill();
  }

  private scale(g: CanvasRenderingContext2D, camera: Camera, theme: Theme) {
    const length = nice(80 / camera.scale);
    const right = camera.width - 16;
    const y = camera.height - 14;
    g.strokeStyle = g.fillStyle = theme.text;
    g.lineWidth = 2;
    g.beginPath();
    g.moveTo(right - length * camera.scale, y);
    g.lineTo(right, y);
    g.stroke();
    g.textAlign = "right";
    g.fillText(`${+length.toPrecision(6)} mm`, right, y - 10);
  }
}
