/** The drawing on the Plan screen as a value: each change makes a new one, so undo is a list. */

import type { Area, LonLat, MultiPolygon } from "../api";

export type Kind = "water" | "island" | "noGo";

export interface Shape {
  kind: Kind;
  /** Open ring: the first point is not repeated. */
  ring: LonLat[];
}

export interface Sketch {
  shapes: Shape[];
  start: LonLat | null;
}

export const emptySketch: Sketch = { shapes: [], start: null };

export function withShape(sketch: Sketch, shape: Shape): Sketch {
  return { ...sketch, shapes: [...sketch.shapes, shape] };
}

export function withoutShape(sketch: Sketch, index: number): Sketch {
  return { ...sketch, shapes: sketch.shapes.filter((_, i) => i !== index) };
}

export function withRing(sketch: Sketch, index: number, ring: LonLat[]): Sketch {
  const shapes = sketch.shapes.map((shape, i) => (i === index ? { ...shape, ring } : shape));
  return { ...sketch, shapes };
}

export function moved(ring: LonLat[], corner: number, to: LonLat): LonLat[] {
  return ring.map((point, i) => (i === corner ? to : point));
}

export function inserted(ring: LonLat[], after: number, point: LonLat): LonLat[] {
  return [...ring.slice(0, after + 1), point, ...ring.slice(after + 1)];
}

export function removed(ring: LonLat[], corner: number): LonLat[] {
  return ring.length > 3 ? ring.filter((_, i) => i !== corner) : ring;
}

function closed(ring: LonLat[]): LonLat[] {
  const first = ring[0];
  return first ? [...ring, first] : ring;
}

/** Whether the point is inside the ring, by counting how often a ray to the east crosses it. */
export function inside(ring: readonly LonLat[], [x, y]: LonLat): boolean {
  let within = false;
  for (let i = 0, j = ring.length - 1; i < ring.length; j = i++) {
    const [xi, yi] = ring[i] ?? [0, 0];
    const [xj, yj] = ring[j] ?? [0, 0];
    if (yi > y !== yj > y && x < ((xj - xi) * (y - yi)) / (yj - yi) + xi) within = !within;
  }
  return within;
}

/** The water with its islands as holes; null if no water is drawn. */
export function regionOf(sketch: Sketch): Area | null {
  const lakes = sketch.shapes.filter((shape) => shape.kind === "water");
  if (!lakes.length) return null;
  const islands = sketch.shapes.filter((shape) => shape.kind === "island");
  const polygons = lakes.map((lake) => [
    closed(lake.ring),
    ...islands
      .filter((island) => island.ring.some((point) => inside(lake.ring, point)))
      .map((island) => closed(island.ring)),
  ]);
  return polygons.length === 1
    ? { type: "Polygon", coordinates: polygons[0] ?? [] }
    : { type: "MultiPolygon", coordinates: polygons };
}

export function noGoOf(sketch: Sketch): MultiPolygon | null {
  const areas = sketch.shapes.filter((shape) => shape.kind === "noGo");
  if (!areas.length) return null;
  return { type: "MultiPolygon", coordinates: areas.map((area) => [closed(area.ring)]) };
}

function opened(ring: LonLat[]): LonLat[] {
  const first = ring[0];
  const last = ring[ring.length - 1];
  const same = first && last && first[0] === last[0] && first[1] === last[1];
  return (same ? ring.slice(0, -1) : ring).map(([lon, lat]) => [lon, lat]);
}

/** The shapes of an outline: outer rings are water, holes are islands. */
export function shapesOf(region: Area, noGo: MultiPolygon | null = null): Shape[] {
  const polygons = region.type === "Polygon" ? [region.coordinates] : region.coordinates;
  const water = polygons.flatMap((rings) =>
    rings.map((ring, i): Shape => ({ kind: i === 0 ? "water" : "island", ring: opened(ring) })),
  );
  const kept = (noGo?.coordinates ?? []).flatMap((rings) =>
    rings.slice(0, 1).map((ring): Shape => ({ kind: "noGo", ring: opened(ring) })),
  );
  return [...water, ...kept];
}

export function boundsOf(points: readonly LonLat[]): [number, number, number, number] | null {
  if (!points.length) return null;
  let [west, south, east, north] = [Infinity, Infinity, -Infinity, -Infinity];
  for (const [lon, lat] of points) {
    west = Math.min(west, lon);
    east = Math.max(east, lon);
    south = Math.min(south, lat);
    north = Math.max(north, lat);
  }
  return [west, south, east, north];
}
