/** Lines of longitude and latitude, for orientation on an otherwise empty map. */

import type * as L from "leaflet";

/** Least distance between lines [pixels]. */
const APART_PX = 150;

function step(degreesPerPixel: number): number {
  const least = degreesPerPixel * APART_PX;
  const power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((factor) => factor * power).find((size) => size >= least) ?? least;
}

function text(degrees: number, size: number, [plus, minus]: [string, string]): string {
  const digits = Math.max(0, Math.ceil(-Math.log10(size) - 1e-9));
  return `${Math.abs(degrees).toFixed(digits)}° ${degrees < 0 ? minus : plus}`;
}

/** Paint the lines on a canvas whose corner is at `origin` in world pixels. */
export function drawGraticule(
  context: CanvasRenderingContext2D,
  map: L.Map,
  origin: [number, number],
  size: [number, number],
  inks: { line: string; text: string | null },
): void {
  const zoom = map.getZoom();
  const place = (x: number, y: number): L.LatLng =>
    map.unproject([origin[0] + x, origin[1] + y], zoom);
  const from = place(0, size[1]);
  const to = place(size[0], 0);
  const gap = step((to.lng - from.lng) / size[0]);
  context.setLineDash([]);
  context.lineWidth = 1;
  context.strokeStyle = inks.line;
  context.fillStyle = inks.text ?? "transparent";
  context.font = "12px system-ui, sans-serif";
  const pixel = (lat: number, lng: number): [number, number] => {
    const at = map.project([lat, lng], zoom);
    return [Math.round(at.x - origin[0]) + 0.5, Math.round(at.y - origin[1]) + 0.5];
  };
  const lines = new Path2D();
  for (let k = Math.ceil(from.lng / gap); k * gap <= to.lng; k++) {
    const [x] = pixel(to.lat, k * gap);
    lines.moveTo(x, 0);
    lines.lineTo(x, size[1]);
    for (let j = Math.ceil(from.lat / gap); inks.text && j * gap <= to.lat; j++) {
      const [, y] = pixel(j * gap, k * gap);
      const named = `${text(j * gap, gap, ["N", "S"])}, ${text(k * gap, gap, ["E", "W"])}`;
      context.fillText(named, x + 5, y - 5);
    }
  }
  for (let j = Math.ceil(from.lat / gap); j * gap <= to.lat; j++) {
    const [, y] = pixel(j * gap, from.lng);
    lines.moveTo(0, y);
    lines.lineTo(size[0], y);
  }
  context.stroke(lines);
}
