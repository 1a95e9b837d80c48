// Level of detail: which points are drawn while the camera moves.

import { JUMP, type Scene } from "./scene";

/** Most segments that are drawn while the camera moves. */
export const BUDGET = 100_000;

/** Picks points that are further apart than a distance; jumps and changes of kind stay while they can. */
function pick(scene: Scene, distance: number, kinds: boolean, into: Uint32Array | null): number {
  const { positions: p, kinds: k, count } = scene;
  const square = distance * distance;
  let n = 0;
  let last = 0;
  for (let i = 0; i < count; i++) {
    const near = () => {
      const dx = p[3 * i] - p[3 * last];
      const dy = p[3 * i + 1] - p[3 * last + 1];
      const dz = p[3 * i + 2] - p[3 * last + 2];
      return dx * dx + dy * dy + dz * dz <= square;
    };
    // Before a jump the strip ends, after it a new one begins.
    const kept =
      i === 0 || i + 1 === count || k[i] === JUMP || k[i + 1] === JUMP || (kinds && k[i] !== k[i + 1]) || !near();
    if (!kept) continue;
    if (into) {
      if (n === into.length) return n + 1;
      into[n] = i;
    }
    n++;
    last = i;
  }
  return n;
}

function size(scene: Scene): number {
  if (!scene.bounds) return 1;
  const [low, high] = scene.bounds;
  return Math.max(...high.map((h, i) => h - low[i]), 1e-3);
}

/** Indices of at most `budget` points that show the whole path; null: all points fit. */
export function reduce(scene: Scene, budget = BUDGET): Uint32Array | null {
  if (scene.count <= budget) return null;
  const whole = size(scene);
  // Finer and finer until it no longer fits: distances from a tenth to a hundred-thousandth of the part.
  for (const kinds of [true, false]) {
    let coarse = whole / 10;
    let fine = whole / 1e5;
    if (pick(scene, coarse, kinds, null) > budget) continue;
    for (let i = 0; i < 8; i++) {
      const middle = Math.sqrt(coarse * fine);
      if (pick(scene, middle, kinds, null) > budget) fine = middle;
      else coarse = middle;
    }
    const chosen = new Uint32Array(budget);
    const n = pick(scene, coarse, kinds, chosen);
    return chosen.slice(0, n);
  }
  return evenly(scene, budget);
}

/** Last resort for paths that are mostly jumps: every n-th point. */
function evenly(scene: Scene, budget: number): Uint32Array {
  const stride = Math.ceil(scene.count / budget);
  const chosen = new Uint32Array(Math.floor(scene.count / stride));
  for (let i = 0; i < chosen.length; i++) chosen[i] = i * stride;
  return chosen;
}
