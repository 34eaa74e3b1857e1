/** Everything below the boat: water, map, cells, route and track, painted completely or in one spot. */

import type * as L from "leaflet";
import type { TargetState } from "../api";
import { drawGraticule } from "./graticule";
import type { Inks } from "./inks";
import type { Raster } from "./raster";
import { type Box, type Sight, type World, worldOf } from "./sight";

export interface Half {
  raster: Raster | null;
  /** Where this map begins, as a share of the window's width. */
  from: number;
}

export interface Ground {
  region: World[];
  cells: World[];
  states: TargetState[];
  uncovered: World[];
  noGo: World[];
  way: World;
  /** One track for each boat. */
  tracks: Track[];
  raster: Raster | null;
  second: Half | null;
  cellsShown: boolean;
}

/** Where a boat has been; the space after `length` points is reserved. */
export interface Track {
  points: World;
  length: number;
  /** The number of points that are painted. */
  drawn: number;
}

type Context = CanvasRenderingContext2D;

/** Paint all of it, or the part within `spot`; the second map begins at `splitX`. */
export function paintGround(
  context: Context,
  ground: Ground,
  sight: Sight,
  inks: Inks,
  { map, splitX, spot }: { map: L.Map; splitX: number; spot: Box | null },
): void {
  const { x, y, width, height } = spot ?? sight.all;
  context.save();
  context.beginPath();
  context.rect(x, y, width, height);
  context.clip();
  context.clearRect(x, y, width, height);
  drawGraticule(context, map, [sight.originX, sight.originY], [sight.width, sight.height], {
    line: inks.graticule,
    text: ground.region.length ? null : inks.graticuleText,
  });
  const water = sight.path(ground.region);
  context.fillStyle = inks.water;
  context.fill(water, "evenodd");
  paintRasters(context, ground, sight, water, splitX);
  paintCells(context, ground, sight, inks, spot ?? sight.all);
  context.setLineDash([]);
  context.strokeStyle = inks.shore;
  context.lineWidth = 2;
  context.stroke(water);
  hatch(context, ground.noGo, sight, inks.bad, 9, 1);
  hatch(context, ground.uncovered, sight, inks.bad, 6, -1);
  if (ground.way.length) {
    context.setLineDash([6, 5]);
    context.strokeStyle = inks.route;
    context.lineWidth = 1.5;
    context.stroke(sight.line(ground.way, 0, ground.way.length / 2));
  }
  for (const track of ground.tracks) paintTrack(context, track, sight, inks, 0, spot);
  context.restore();
}

/** Paint a track from one of its points to the end. */
export function paintTrack(
  context: Context,
  { points, length }: Track,
  sight: Sight,
  inks: Inks,
  from: number,
  spot: Box | null = null,
): void {
  if (length - from < 2) return;
  context.setLineDash([]);
  context.lineJoin = "bevel";
  context.lineWidth = 2;
  context.strokeStyle = inks.track;
  context.stroke(sight.line(points, from, length, spot));
}

function paintRasters(
  context: Context,
  { raster, second, region }: Ground,
  sight: Sight,
  water: Path2D,
  splitX: number,
): void {
  if (!raster && !second?.raster) return;
  context.save();
  if (region.length) context.clip(water, "evenodd");
  context.imageSmoothingEnabled = false;
  const split = second ? splitX : sight.width;
  if (raster) paintRaster(context, raster, sight, 0, split);
  if (second?.raster) paintRaster(context, second.raster, sight, split, sight.width);
  context.restore();
}

function paintRaster(
  context: Context,
  raster: Raster,
  sight: Sight,
  from: number,
  to: number,
): void {
  const [sw, se, nw] = raster.corners.map(([lon, lat]) => worldOf(lon, lat));
  if (!sw || !se || !nw || to <= from) return;
  const { width, height } = raster.image;
  context.save();
  context.beginPath();
  context.rect(from, 0, to - from, sight.height);
  context.clip();
  const k = 2 ** sight.zoom;
  context.transform(
    ((se[0] - sw[0]) * k) / width,
    ((se[1] - sw[1]) * k) / width,
    ((sw[0] - nw[0]) * k) / height,
    ((sw[1] - nw[1]) * k) / height,
    sight.x(nw[0]),
    sight.y(nw[1]),
  );
  context.drawImage(raster.image, 0, 0);
  context.restore();
}

function paintCells(
  context: Context,
  { cells, states, cellsShown, raster, second }: Ground,
  sight: Sight,
  inks: Inks,
  within: Box,
): void {
  if (!cells.length || !cellsShown) return;
  const [open, reached, givenUp] = [new Path2D(), new Path2D(), new Path2D()];
  const paths = { open, current: open, reached, given_up: givenUp };
  // A map matters more than the marks of reached cells, which would cover it.
  const plain = !raster && !second;
  cells.forEach((ring, i) => {
    const state = states[i] ?? "open";
    if (state === "reached" && !plain) return;
    if (sight.touches(ring, within)) sight.addRing(paths[state], ring);
  });
  context.setLineDash([]);
  if (plain) {
    context.fillStyle = inks.reached;
    context.fill(reached);
  }
  context.lineWidth = 1;
  context.strokeStyle = inks.cell;
  context.stroke(open);
  context.fillStyle = inks.givenUp;
  context.fill(givenUp);
}

/** Hatch an area; the lines are fixed to the world, so an area painted in pieces has no seams. */
function hatch(
  context: Context,
  rings: World[],
  sight: Sight,
  ink: string,
  gap: number,
  slope: 1 | -1,
): void {
  if (!rings.length) return;
  const { width, height, originX, originY } = sight;
  const area = sight.path(rings);
  context.save();
  context.clip(area, "evenodd");
  context.strokeStyle = ink;
  context.lineWidth = 1.5;
  context.beginPath();
  // Where a line crosses the upper edge of the canvas; a multiple of the gap in world pixels.
  const tilt = slope > 0 ? height : 0;
  const hang = originX - slope * originY;
  for (let k = Math.ceil((hang - tilt) / gap); k * gap <= hang + width + height - tilt; k++) {
    const at = k * gap - hang;
    context.moveTo(at, 0);
    context.lineTo(at + slope * height, height);
  }
  context.stroke();
  context.restore();
  context.strokeStyle = ink;
  context.lineWidth = 1.5;
  context.stroke(area);
}
