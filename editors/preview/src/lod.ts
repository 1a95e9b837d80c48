// Level of detail: which points are drawn while the camera moves.

import { JUMP, type Scene } from "./scene";

/** Most segments that are drawn while the camera moves. */
export const BUDGET = 100_000;
/** Coarser ones, for hardware that can't keep up with the budget. */
const LEVELS = 6;

/** The points to choose from: all of a scene, or those of a finer level. */
interface Source {
  count: number;
  at: (i: number) => number;
}

/** Picks points that are further apart than a distance; ends and, while they fit, changes of kind stay. */
function pick(scene: Scene, source: Source, distance: number, kinds: boolean, into: Uint32Array | null): number {
  const { positions: p, kinds: k } = scene;
  const { count, at } = source;
  const square = distance * distance;
  let n = 0;
  let last = 0;
  for (let s = 0; s < count; s++) {
    const i = at(s);
    const next = s + 1 < count ? at(s + 1) : -1;
    // Before a jump the strip ends, after it a new one begins.
    const end = s === 0 || next < 0 || k[i] === JUMP || k[next] === JUMP;
    if (!end && !(kinds && k[i] !== k[next])) {
      const dx = p[3 * i] - p[3 * last];
      const dy = p[3 * i + 1] - p[3 * last + 1];
      const dz = p[3 * i + 2] - p[3 * last + 2];
      if (dx * dx + dy * dy + dz * dz <= square) continue;
    }
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

/** Indices of at most `budget` points that show the whole path. */
function reduce(scene: Scene, source: Source, budget: number): Uint32Array {
  const whole = size(scene);
  for (const kinds of [true, false]) {
    // Finer and finer until it no longer fits: from a tenth to a hundred-thousandth of the part.
    let coarse = whole / 10;
    let fine = whole / 1e5;
    if (pick(scene, source, coarse, kinds, null) > budget) continue;
    for (let i = 0; i < 7; i++) {
      const middle = Math.sqrt(coarse * fine);
      if (pick(scene, source, middle, kinds, null) > budget) fine = middle;
      else coarse = middle;
    }
    const chosen = new Uint32Array(budget);
    return chosen.slice(0, pick(scene, source, coarse, kinds, chosen));
  }
  // Last resort for paths that are mostly jumps: every n-th point.
  const stride = Math.ceil(source.count / budget);
  return Uint32Array.from({ length: Math.floor(source.count / stride) }, (_, i) => source.at(i * stride));
}

/** Finest first: points to draw while the camera moves; none when the whole path fits the budget. */
export function levels(scene: Scene): Uint32Array[] {
  if (scene.count <= BUDGET) return [];
  const found = [reduce(scene, { count: scene.count, at: (i) => i }, BUDGET)];
  for (let i = 1; i < LEVELS; i++) {
    const finer = found[i - 1];
    found.push(reduce(scene, { count: finer.length, at: (s) => finer[s] }, BUDGET >> i));
  }
  return found;
}
