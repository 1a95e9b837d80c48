// What the tests in a browser share: a headless Chromium whose lines are drawn by the processor, and the colours of
// what it shows.

import { existsSync } from "node:fs";
import { chromium } from "playwright-core";

const places = [process.env.CHROMIUM, "/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"];

/** A browser. */
export async function browser() {
  const executablePath = places.find((p) => p && existsSync(p));
  if (!executablePath) throw new Error("no Chromium: apt-get install chromium, or name it in CHROMIUM");
  return chromium.launch({
    executablePath,
    headless: true,
    args: [
      "--no-sandbox",
      "--disable-dev-shm-usage",
      "--proxy-server=direct://",
      "--use-angle=swiftshader",
      "--enable-unsafe-swiftshader",
    ],
  });
}

/** Colours of a picture: `at(x, y)` gives [red, green, blue], `count(color, box)` how many pixels are of a colour. */
export async function pixels(any, png) {
  const blank = await any.newPage();
  const { width, data } = await blank.evaluate(async (text) => {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const bitmap = await createImageBitmap(new Blob([bytes], { type: "image/png" }));
    const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
    const g = canvas.getContext("2d");
    g.drawImage(bitmap, 0, 0);
    const { data } = g.getImageData(0, 0, bitmap.width, bitmap.height);
    let binary = "";
    for (let i = 0; i < data.length; i += 8192) binary += String.fromCharCode(...data.subarray(i, i + 8192));
    return { width: bitmap.width, data: btoa(binary) };
  }, png.toString("base64"));
  await blank.close();
  const bytes = Buffer.from(data, "base64");
  const at = (x, y) => [...bytes.subarray(4 * (y * width + x), 4 * (y * width + x) + 3)];
  return {
    at,
    /** The colours within `reach` pixels of a place. */
    near(x, y, reach) {
      const found = [];
      for (let dy = -reach; dy <= reach; dy++) {
        for (let dx = -reach; dx <= reach; dx++) found.push(at(Math.round(x) + dx, Math.round(y) + dy));
      }
      return found;
    },
  };
}

/** Whether one of the colours is the wanted one, up to rounding. */
export function has(colors, wanted, tolerance = 3) {
  return colors.some((c) => c.every((v, i) => Math.abs(v - wanted[i]) <= tolerance));
}

/** Waits until a condition of the page holds. */
export async function until(page, what, condition, argument, timeout = 60000) {
  try {
    await page.waitForFunction(condition, argument, { timeout, polling: 50 });
  } catch (problem) {
    throw new Error(`waited in vain for ${what}: ${problem.message}`);
  }
}
