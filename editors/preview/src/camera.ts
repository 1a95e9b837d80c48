// An orbiting camera without perspective, so that lengths on the screen are true.

import type { Box } from "./scene";

export type Vector = [number, number, number];

export const VIEWS: Record<string, [number, number]> = {
  iso: [-Math.PI / 4, 0.6155],
  top: [0, Math.PI / 2],
  front: [0, 0],
  right: [Math.PI / 2, 0],
};

export class Camera {
  turn = VIEWS.iso[0];
  tilt = VIEWS.iso[1];
  /** What is in the middle of the view, mm. */
  target: Vector = [0, 0, 0];
  /** Pixels per mm. */
  scale = 4;
  width = 1;
  height = 1;
  private radius = 100;

  /** Unit vectors of the screen in the part: right, up, towards the viewer. */
  basis(): [Vector, Vector, Vector] {
    const [c, s, a, b] = [Math.cos(this.turn), Math.sin(this.turn), Math.sin(this.tilt), Math.cos(this.tilt)];
    return [
      [c, s, 0],
      [-s * a, c * a, b],
      [s * b, -c * b, a],
    ];
  }

  /** Shows a box whole. */
  fit(box: Box | null) {
    const [low, high] = box ?? [
      [-50, -50, -50],
      [50, 50, 50],
    ];
    this.target = [0, 1, 2].map((i) => (low[i] + high[i]) / 2) as Vector;
    const size = [0, 1, 2].map((i) => high[i] - low[i]);
    this.radius = Math.max(Math.hypot(...size) / 2, 1e-3);
    const [right, up] = this.basis();
    const extent = (v: Vector) =>
      Math.max(
        v.reduce((sum, x, i) => sum + Math.abs(x) * size[i], 0),
        this.radius / 50,
      );
    this.scale = 0.86 * Math.min(this.width / extent(right), this.height / extent(up));
  }

  look(view: string, box: Box | null) {
    [this.turn, this.tilt] = VIEWS[view] ?? VIEWS.iso;
    this.fit(box);
  }

  orbit(dx: number, dy: number) {
    this.turn -= dx * 0.008;
    this.tilt = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, this.tilt + dy * 0.008));
  }

  pan(dx: number, dy: number) {
    const [right, up] = this.basis();
    for (let i = 0; i < 3; i++) this.target[i] += (-dx * right[i] + dy * up[i]) / this.scale;
  }

  /** Zooms about a place on the screen, in pixels from its middle. */
  zoom(factor: number, x: number, y: number) {
    const before = this.scale;
    const smallest = (0.02 * Math.min(this.width, this.height)) / this.radius;
    this.scale = Math.max(smallest, Math.min(1e5, before * factor));
    const f = this.scale / before;
    this.pan(x - x * f, y - y * f);
  }

  /** Place on the screen in pixels from the upper left corner, and depth (larger is nearer). */
  project(x: number, y: number, z: number): Vector {
    const [right, up, to] = this.basis();
    const d = [x - this.target[0], y - this.target[1], z - this.target[2]];
    const dot = (v: Vector) => v[0] * d[0] + v[1] * d[1] + v[2] * d[2];
    return [this.width / 2 + this.scale * dot(right), this.height / 2 - this.scale * dot(up), dot(to)];
  }

  /** Column-major matrix from mm to clip space. */
  matrix(): Float32Array {
    const [right, up, to] = this.basis();
    const reach = 4 * this.radius + Math.hypot(...this.target);
    const rows = [
      right.map((v) => (v * 2 * this.scale) / this.width),
      up.map((v) => (v * 2 * this.scale) / this.height),
      to.map((v) => -v / reach),
    ];
    const m = new Float32Array(16);
    rows.forEach((row, r) => {
      for (let c = 0; c < 3; c++) m[4 * c + r] = row[c];
      m[12 + r] = -row.reduce((sum, v, c) => sum + v * this.target[c], 0);
    });
    m[15] = 1;
    return m;
  }
}
