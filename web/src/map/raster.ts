/** A grid of values as a picture, with its position. */

import type { Grid, LonLat } from "../api";
import { coloursOf, scaleOf } from "./colours";

export interface Raster {
  image: HTMLCanvasElement;
  /** South-west, south-east, north-west: three corners determine its position. */
  corners: [LonLat, LonLat, LonLat];
  grid: Grid;
  range: [number, number];
}

export function valuesOf(grid: Grid): Float32Array {
  const text = atob(grid.values);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return new Float32Array(bytes.buffer);
}

export function rangeOf(grid: Grid): [number, number] {
  if (grid.range && grid.range[0] < grid.range[1]) return grid.range;
  let low = Infinity;
  let high = -Infinity;
  for (const value of valuesOf(grid)) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  if (!Number.isFinite(low)) return [0, 1];
  return low < high ? [low, high] : [low - 0.5, low + 0.5];
}

/**
 * Paint a grid, with its first row at the bottom. If `doubt` is given, a second grid of the same
 * shape, the picture becomes paler where doubt is large compared with its maximum.
 */
export function paint(grid: Grid, range: [number, number], doubt: Grid | null = null): Raster {
  const image = document.createElement("canvas");
  image.width = grid.nx;
  image.height = grid.ny;
  const context = image.getContext("2d");
  if (!context) throw new Error("This browser cannot draw on a canvas.");
  const pixels = context.createImageData(grid.nx, grid.ny);
  const values = valuesOf(grid);
  const colours = coloursOf(scaleOf(grid.layer));
  const doubts =
    doubt && doubt.nx === grid.nx && doubt.ny === grid.ny ? valuesOf(doubt) : null;
  const most = doubts && doubt ? rangeOf(doubt)[1] : 1;
  const span = range[1] - range[0];
  for (let row = 0; row < grid.ny; row++) {
    for (let column = 0; column < grid.nx; column++) {
      const from = row * grid.nx + column;
      const value = values[from] ?? Number.NaN;
      if (Number.isNaN(value)) continue;
      const to = 4 * ((grid.ny - 1 - row) * grid.nx + column);
      const share = Math.min(1, Math.max(0, (value - range[0]) / span));
      const colour = 3 * Math.round(255 * share);
      pixels.data[to] = colours[colour] ?? 0;
      pixels.data[to + 1] = colours[colour + 1] ?? 0;
      pixels.data[to + 2] = colours[colour + 2] ?? 0;
      pixels.data[to + 3] = doubts ? 255 - 185 * Math.min(1, (doubts[from] ?? 0) / most) ** 2 : 255;
    }
  }
  context.putImageData(pixels, 0, 0);
  return { image, corners: [grid.corners[0], grid.corners[1], grid.corners[3]], grid, range };
}
