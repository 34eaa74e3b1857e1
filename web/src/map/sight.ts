/** Positions of places on a canvas, and paths through them. */

import type { Area, LonLat } from "../api";

/** Points in the world of 256 pixels at zoom 0, x and y alternating. */
export type World = Float64Array;

export function worldOf(lon: number, lat: number): [number, number] {
  const sine = Math.sin((Math.max(-85.05, Math.min(85.05, lat)) * Math.PI) / 180);
  return [
    (256 * (lon + 180)) / 360,
    256 * (0.5 - Math.log((1 + sine) / (1 - sine)) / (4 * Math.PI)),
  ];
}

export function world(points: readonly (readonly number[])[]): World {
  const made = new Float64Array(2 * points.length);
  points.forEach((point, i) => {
    const [x, y] = worldOf(point[0] ?? 0, point[1] ?? 0);
    made[2 * i] = x;
    made[2 * i + 1] = y;
  });
  return made;
}

export function ringsOf(area: Area | null): LonLat[][] {
  if (!area) return [];
  return area.type === "Polygon" ? area.coordinates : area.coordinates.flat();
}

/** A rectangle of a canvas [pixels]. */
export interface Box {
  x: number;
  y: number;
  width: number;
  height: number;
}

/** The bounding box of points with a margin; null if there are none. */
export function boxOf(points: readonly (readonly [number, number])[], margin: number): Box | null {
  if (!points.length) return null;
  let [west, east, north, south] = [Infinity, -Infinity, Infinity, -Infinity];
  for (const [x, y] of points) {
    west = Math.min(west, x);
    east = Math.max(east, x);
    north = Math.min(north, y);
    south = Math.max(south, y);
  }
  const x = Math.floor(west) - margin;
  const y = Math.floor(north) - margin;
  return { x, y, width: Math.ceil(east) + margin - x, height: Math.ceil(south) + margin - y };
}

/** The part of the world that a canvas shows: a window at a zoom, with its corner in whole pixels. */
export class Sight {
  private readonly scale: number;

  constructor(
    readonly zoom: number,
    readonly originX: number,
    readonly originY: number,
    readonly width: number,
    readonly height: number,
  ) {
    this.scale = 2 ** zoom;
  }

  x(value: number): number {
    return value * this.scale - this.originX;
  }

  y(value: number): number {
    return value * this.scale - this.originY;
  }

  at(lon: number, lat: number): [number, number] {
    const [x, y] = worldOf(lon, lat);
    return [this.x(x), this.y(y)];
  }

  get all(): Box {
    return { x: 0, y: 0, width: this.width, height: this.height };
  }

  pixels(points: World): [number, number][] {
    const made: [number, number][] = [];
    for (let i = 0; i < points.length; i += 2)
      made.push([this.x(points[i] ?? 0), this.y(points[i + 1] ?? 0)]);
    return made;
  }

  /** Whether a ring may reach into a box, that is, whether its bounding box overlaps it. */
  touches(ring: World, box: Box): boolean {
    let [west, east, north, south] = [Infinity, -Infinity, Infinity, -Infinity];
    for (let i = 0; i < ring.length; i += 2) {
      const x = ring[i] ?? 0;
      const y = ring[i + 1] ?? 0;
      if (x < west) west = x;
      if (x > east) east = x;
      if (y < north) north = y;
      if (y > south) south = y;
    }
    return (
      this.x(west) <= box.x + box.width &&
      this.x(east) >= box.x &&
      this.y(north) <= box.y + box.height &&
      this.y(south) >= box.y
    );
  }

  path(rings: readonly World[]): Path2D {
    const path = new Path2D();
    for (const ring of rings) this.addRing(path, ring);
    return path;
  }

  addRing(path: Path2D, ring: World): void {
    for (let i = 0; i < ring.length; i += 2) {
      const x = this.x(ring[i] ?? 0);
      const y = this.y(ring[i + 1] ?? 0);
      if (i === 0) path.moveTo(x, y);
      else path.lineTo(x, y);
    }
    path.closePath();
  }

  /**
   * The line through points `from` to `to`, or the pieces of it that reach into a box. Points less
   * than half a pixel from the one before are left out.
   */
  line(points: World, from: number, to: number, box: Box | null = null): Path2D {
    const path = new Path2D();
    let [beforeX, beforeY] = [this.x(points[2 * from] ?? 0), this.y(points[2 * from + 1] ?? 0)];
    let joined = false;
    for (let i = from + 1; i < to; i++) {
      const x = this.x(points[2 * i] ?? 0);
      const y = this.y(points[2 * i + 1] ?? 0);
      if (i < to - 1 && Math.abs(x - beforeX) + Math.abs(y - beforeY) < 0.5) continue;
      const near = !box || reaches(beforeX, beforeY, x, y, box);
      if (near && !joined) path.moveTo(beforeX, beforeY);
      if (near) path.lineTo(x, y);
      joined = near;
      [beforeX, beforeY] = [x, y];
    }
    return path;
  }
}

/** Whether the bounding box of a segment, widened by the line's width, overlaps a box. */
function reaches(fromX: number, fromY: number, x: number, y: number, box: Box): boolean {
  const wide = 4;
  return (
    Math.max(fromX, x) + wide >= box.x &&
    Math.min(fromX, x) - wide <= box.x + box.width &&
    Math.max(fromY, y) + wide >= box.y &&
    Math.min(fromY, y) - wide <= box.y + box.height
  );
}
