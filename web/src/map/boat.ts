/** Painting of the boats, the planned path of one, the cells under way and a mark. */

import type { LonLat } from "../api";
import type { Inks } from "./inks";
import { type Box, boxOf, type Sight, type World } from "./sight";

export interface Boat {
  lon: number;
  lat: number;
  heading_rad: number;
  /** Its number in a fleet, and whether another boat is the selected one. */
  number?: number;
  aside?: boolean;
}

export interface Afloat {
  boats: readonly Boat[];
  horizon: World;
  /** The rings of the cells under way. */
  cells: readonly World[];
  mark: LonLat | null;
}

type Context = CanvasRenderingContext2D;

/** The box of the canvas that they need; null if there is nothing to show. */
export function boxAfloat({ boats, horizon, cells, mark }: Afloat, sight: Sight): Box | null {
  const points = [...sight.pixels(horizon), ...cells.flatMap((cell) => sight.pixels(cell))];
  for (const boat of boats) points.push(sight.at(boat.lon, boat.lat));
  if (mark) points.push(sight.at(...mark));
  const box = boxOf(points, 32);
  if (!box) return null;
  // At a deep zoom they may be larger than any window.
  const x = Math.max(box.x, -sight.width);
  const y = Math.max(box.y, -sight.height);
  const width = Math.min(box.x + box.width, 2 * sight.width) - x;
  const height = Math.min(box.y + box.height, 2 * sight.height) - y;
  return width > 0 && height > 0 ? { x, y, width, height } : null;
}

export function paintAfloat(context: Context, afloat: Afloat, sight: Sight, inks: Inks): void {
  const { boats, horizon, cells, mark } = afloat;
  if (cells.length) {
    context.lineWidth = 3;
    context.strokeStyle = inks.currentCell;
    context.stroke(sight.path(cells));
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
  // The selected boat is painted last, on top.
  for (const boat of boats) if (boat.aside) paintBoat(context, boat, sight, inks);
  for (const boat of boats) if (!boat.aside) paintBoat(context, boat, sight, inks);
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
  // A boat that is not selected is an outline.
  context.fillStyle = boat.aside ? inks.halo : inks.boat;
  context.fill(hull);
  if (boat.aside) {
    context.lineWidth = 2;
    context.strokeStyle = inks.boat;
    context.stroke(hull);
  }
  context.rotate(-boat.heading_rad);
  if (boat.number !== undefined) paintNumber(context, boat.number, inks);
  context.restore();
}

/** Paint a boat's number beside it. */
function paintNumber(context: Context, number: number, inks: Inks): void {
  context.font = "600 14px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.lineWidth = 4;
  context.strokeStyle = inks.halo;
  context.strokeText(String(number), 17, -15);
  context.fillStyle = inks.boat;
  context.fillText(String(number), 17, -15);
}
