// Which segment is under the pointer. Done on the processor: a million segments take some hundredths of a second.

import type { Camera } from "./camera";
import { JUMP, type Scene } from "./scene";

/** What was found. */
export interface Hit {
  /** End point of the segment. */
  point: number;
  /** Share of the segment, 0 … 1. */
  share: number;
  /** mm. */
  place: [number, number, number];
}

/** The nearest segment within `reach` pixels; of those equally near (to half a pixel) the one in front. */
export function pick(
  scene: Scene,
  camera: Camera,
  x: number,
  y: number,
  reach: number,
  shown: number,
  until: number,
): Hit | null {
  const { positions: p, kinds: k } = scene;
  const [right, up, to] = camera.basis();
  const [tx, ty, tz] = camera.target;
  const s = camera.scale;
  const cx = x - camera.width / 2;
  const cy = camera.height / 2 - y;
  let best: Hit | null = null;
  let nearest = reach * reach;
  let front = Number.NEGATIVE_INFINITY;
  let [ax, ay, az] = [0, 0, 0];
  const end = Math.min(scene.count, until);
  for (let i = 0; i < end; i++) {
    const dx = p[3 * i] - tx;
    const dy = p[3 * i + 1] - ty;
    const dz = p[3 * i + 2] - tz;
    const bx = s * (right[0] * dx + right[1] * dy + right[2] * dz) - cx;
    const by = s * (up[0] * dx + up[1] * dy + up[2] * dz) - cy;
    const bz = to[0] * dx + to[1] * dy + to[2] * dz;
    if (i > 0 && k[i] !== JUMP && shown & (1 << k[i])) {
      const vx = bx - ax;
      const vy = by - ay;
      const length = vx * vx + vy * vy;
      const share = length > 0 ? Math.max(0, Math.min(1, -(ax * vx + ay * vy) / length)) : 0;
      const mx = ax + share * vx;
      const my = ay + share * vy;
      const distance = mx * mx + my * my;
      const depth = az + share * (bz - az);
      if (distance < nearest - 0.25 || (distance < nearest + 0.25 && depth > front)) {
        nearest = Math.min(nearest, distance);
        front = depth;
        const at = (a: number) => p[3 * (i - 1) + a] + share * (p[3 * i + a] - p[3 * (i - 1) + a]);
        best = { point: i, share, place: [at(0), at(1), at(2)] };
      }
    }
    ax = bx;
    ay = by;
    az = bz;
  }
  return best;
}
