/** The boat, where it means to go, the cell under way and a mark. */

import type { LonLat } from "../api";
import type { Inks } from "./inks";
import { type Box, boxOf, type Sight, type World } from "./sight";

export interface Boat {
  lon: number;
  lat: number;
  heading_rad: number;
}

export interface Afloat {
  boat: Boat | null;
  horizon: World;
  /** The ring of the cell under way. */
  cell: World | null;
  mark: LonLat | null;
}

type Context = CanvasRenderingContext2D;

/** The piece of the canvas that they need; null where there is nothing to show. */
export function boxAfloat({ boat, horizon, cell, mark }: Afloat, sight: Sight): Box | null {
  const points = [...sight.pixels(horizon), ...(cell ? sight.pixels(cell) : [])];
  if (boat) points.push(sight.at(boat.lon, boat.lat));
  if (mark) points.push(sight.at(...mark));
  const box = boxOf(points, 24);
  if (!box) return null;
  // Zoomed in deep, they may be larger than any window.
  const x = Math.max(box.x, -sight.width);
  const y = Math.max(box.y, -sight.height);
  const width = Math.min(box.x + box.width, 2 * sight.width) - x;
  const height = Math.min(box.y + box.height, 2 * sight.height) - y;
  return width > 0 && height > 0 ? { x, y, width, height } : null;
}

export function paintAfloat(context: Context, afloat: Afloat, sight: Sight, inks: Inks): void {
  const { boat, horizon, cell, mark } = afloat;
  if (cell) {
    context.lineWidth = 3;
    context.strokeStyle = inks.currentCell;
    context.stroke(sight.path([cell]));
  }
  if (horizon.length > 2) {
    context.lineCap = "round";
    haloed(context, sight.line(horizon, 0, horizon.length / 2), inks.halo, 7, inks.horizon, 4);
  }
  if (mark) {
    const circle = new Path2D();
    circle.arc(...sight.at(...mark), 8, 0, 2 * Math.PI);
    haloed(context, circle, inks.halo, 6, inks.boat, 3);
  }
  if (boat) paintBoat(context, boat, sight, inks);
}

function haloed(
  context: Context,
  path: Path2D,
  halo: string,
  wide: number,
  ink: string,
  narrow: number,
): void {
  context.lineWidth = wide;
  context.strokeStyle = halo;
  context.stroke(path);
  context.lineWidth = narrow;
  context.strokeStyle = ink;
  context.stroke(path);
}

function paintBoat(context: Context, boat: Boat, sight: Sight, inks: Inks): void {
  context.save();
  context.translate(...sight.at(boat.lon, boat.lat));
  context.rotate(boat.heading_rad);
  const hull = new Path2D("M0 -15 L9 11 L0 6 L-9 11 Z");
  context.lineJoin = "round";
  context.lineWidth = 5;
  context.strokeStyle = inks.halo;
  context.stroke(hull);
  context.fillStyle = inks.boat;
  context.fill(hull);
  context.restore();
}
