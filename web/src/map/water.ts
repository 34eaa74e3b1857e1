/**
 * The layer that paints a survey: water, map, cells and track on one canvas, the boat on another.
 *
 * The large one is painted whole when the map comes to rest or the map of the water changes; a
 * cell that is reached has its own neighbourhood painted again, and a new piece of the track is
 * added. The boat's canvas is only as large as boat and horizon. While the map is dragged nothing
 * is painted: the browser moves what is there, which reaches beyond each edge of the window.
 */

import * as L from "leaflet";
import type { Area, LonLat, TargetState } from "../api";
import { drawGraticule } from "./graticule";
import type { Raster } from "./raster";

/** How far beyond the window the canvases reach, as a share of it. */
const BEYOND = 0.2;

interface Inks {
  water: string;
  shore: string;
  cell: string;
  reached: string;
  currentCell: string;
  givenUp: string;
  route: string;
  track: string;
  horizon: string;
  boat: string;
  halo: string;
  bad: string;
  graticule: string;
  graticuleText: string;
}

/** Points in the world of 256 pixels at zoom 0, x and y by turns. */
type World = Float64Array;

function world(points: readonly (readonly number[])[]): World {
  const made = new Float64Array(2 * points.length);
  points.forEach((point, i) => {
    const [x, y] = worldOf(point[0] ?? 0, point[1] ?? 0);
    made[2 * i] = x;
    made[2 * i + 1] = y;
  });
  return made;
}

function worldOf(lon: number, lat: number): [number, number] {
  const sine = Math.sin((Math.max(-85.05, Math.min(85.05, lat)) * Math.PI) / 180);
  return [
    (256 * (lon + 180)) / 360,
    256 * (0.5 - Math.log((1 + sine) / (1 - sine)) / (4 * Math.PI)),
  ];
}

export function ringsOf(area: Area | null): LonLat[][] {
  if (!area) return [];
  return area.type === "Polygon" ? area.coordinates : area.coordinates.flat();
}

export interface Boat {
  lon: number;
  lat: number;
  heading_rad: number;
}

export interface Half {
  raster: Raster | null;
  /** Share of the window's width from which on this map is shown. */
  from: number;
}

interface Box {
  x: number;
  y: number;
  width: number;
  height: number;
}

/** The box of points [pixels] with a margin; null where there are none. */
function boxOf(points: readonly (readonly [number, number])[], margin: number): Box | null {
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

/** Give a canvas its size in pixels of the page, as fine as the screen is, up to twice. */
function sized(canvas: HTMLCanvasElement, width: number, height: number): void {
  const dense = Math.min(devicePixelRatio || 1, 2);
  const [columns, rows] = [Math.round(width * dense), Math.round(height * dense)];
  if (canvas.width === columns && canvas.height === rows) return;
  canvas.width = columns;
  canvas.height = rows;
  canvas.style.width = `${width}px`;
  canvas.style.height = `${height}px`;
}

interface Privates {
  _latLngToNewLayerPoint(at: L.LatLng, zoom: number, center: L.LatLng): L.Point;
}

export class Water extends L.Layer {
  private readonly canvases: HTMLCanvasElement[] = [];
  private inks: Inks | null = null;
  private region: World[] = [];
  private cells: World[] = [];
  private states: TargetState[] = [];
  private uncovered: World[] = [];
  private noGo: World[] = [];
  private way: World = new Float64Array();
  private track: Float64Array = new Float64Array(8192);
  private trackLength = 0;
  private trackDrawn = 0;
  private horizon: World = new Float64Array();
  private boat: Boat | null = null;
  private mark: LonLat | null = null;
  private raster: Raster | null = null;
  private second: Half | null = null;
  private cellsShown = true;

  private topLeft: L.LatLng | null = null;
  private boatCorner: L.LatLng | null = null;
  private zoom = 0;
  private originX = 0;
  private originY = 0;
  private width = 0;
  private height = 0;
  private readonly stale = { ground: false, boat: false };
  /** Cells that changed since the ground was painted. */
  private readonly changed = new Set<number>();
  private frame = 0;

  // What may be told.

  setRegion(area: Area | null): void {
    this.region = ringsOf(area).map(world);
    this.soon("ground");
  }

  setNoGo(area: Area | null): void {
    this.noGo = ringsOf(area).map(world);
    this.soon("ground");
  }

  setUncovered(area: Area | null): void {
    this.uncovered = ringsOf(area).map(world);
    this.soon("ground");
  }

  setCells(rings: readonly (readonly LonLat[])[], states: TargetState[]): void {
    this.cells = rings.map(world);
    this.states = states;
    this.soon("ground");
  }

  setState(index: number, state: TargetState): void {
    this.states[index] = state;
    this.changed.add(index);
    this.soon(null);
  }

  showCells(shown: boolean): void {
    this.cellsShown = shown;
    this.soon("ground");
  }

  setWay(points: readonly LonLat[]): void {
    this.way = world(points);
    this.soon("ground");
  }

  setRaster(raster: Raster | null, second: Half | null = null): void {
    this.raster = raster;
    this.second = second;
    this.soon("ground");
  }

  setTrack(points: readonly (readonly [number, number])[]): void {
    this.trackLength = 0;
    this.addTrack(points);
    this.soon("ground");
  }

  addTrack(points: readonly (readonly [number, number])[]): void {
    const needed = 2 * (this.trackLength + points.length);
    if (needed > this.track.length) {
      const larger = new Float64Array(2 * needed);
      larger.set(this.track);
      this.track = larger;
    }
    for (const [lon, lat] of points) {
      const [x, y] = worldOf(lon, lat);
      this.track[2 * this.trackLength] = x;
      this.track[2 * this.trackLength + 1] = y;
      this.trackLength++;
    }
    this.soon(null);
  }

  setBoat(boat: Boat | null, horizon: readonly LonLat[]): void {
    this.boat = boat;
    this.horizon = world(horizon);
    this.soon("boat");
  }

  setMark(at: LonLat | null): void {
    this.mark = at;
    this.soon("boat");
  }

  /** The theme has changed: all inks are read again. */
  repaint(): void {
    this.inks = null;
    this.whole();
  }

  // A layer of Leaflet.

  override onAdd(map: L.Map): this {
    for (let i = 0; i < 2; i++) {
      const canvas = L.DomUtil.create("canvas", "water-canvas leaflet-zoom-animated");
      canvas.setAttribute("aria-hidden", "true");
      map.getPanes().overlayPane.appendChild(canvas);
      this.canvases.push(canvas);
    }
    this.whole();
    return this;
  }

  override onRemove(): this {
    cancelAnimationFrame(this.frame);
    this.frame = 0;
    for (const canvas of this.canvases.splice(0)) canvas.remove();
    return this;
  }

  override getEvents(): Record<string, L.LeafletEventHandlerFn> {
    return {
      move: () => this.moved(),
      moveend: () => this.whole(),
      resize: () => this.whole(),
      zoomanim: (event) => this.zooming(event as L.ZoomAnimEvent),
    };
  }

  private zooming(event: L.ZoomAnimEvent): void {
    const scale = this._map.getZoomScale(event.zoom, this.zoom);
    for (const [canvas, corner] of [
      [this.canvases[0], this.topLeft],
      [this.canvases[1], this.boatCorner],
    ] as const) {
      if (!canvas || !corner) continue;
      const offset = (this._map as unknown as Privates)._latLngToNewLayerPoint(
        corner,
        event.zoom,
        event.center,
      );
      L.DomUtil.setTransform(canvas, offset, scale);
    }
  }

  /** Dragged so far that what was painted beyond the edge is used up: paint on the way. */
  private moved(): void {
    if (!this.topLeft || this._map.getZoom() !== this.zoom) return;
    const size = this._map.getSize();
    const at = this._map.latLngToContainerPoint(this.topLeft);
    if (at.x > 0 || at.y > 0 || at.x + this.width < size.x || at.y + this.height < size.y)
      this.whole();
  }

  private soon(which: "ground" | "boat" | null): void {
    if (which) this.stale[which] = true;
    if (!this.frame && this._map) this.frame = requestAnimationFrame(() => this.draw());
  }

  private whole(): void {
    if (!this._map || !this.canvases.length) return;
    this.place();
    this.stale.ground = true;
    this.stale.boat = true;
    cancelAnimationFrame(this.frame);
    this.draw();
  }

  /** Put the large canvas around the window, where the map has come to rest. */
  private place(): void {
    const size = this._map.getSize();
    const margin = size.multiplyBy(BEYOND).round();
    const corner = this._map.containerPointToLayerPoint(margin.multiplyBy(-1)).round();
    this.width = size.x + 2 * margin.x;
    this.height = size.y + 2 * margin.y;
    this.zoom = this._map.getZoom();
    this.topLeft = this._map.layerPointToLatLng(corner);
    const origin = this._map.getPixelOrigin();
    this.originX = origin.x + corner.x;
    this.originY = origin.y + corner.y;
    const canvas = this.canvases[0];
    if (!canvas) return;
    sized(canvas, this.width, this.height);
    L.DomUtil.setTransform(canvas, corner, 1);
  }

  private draw(): void {
    this.frame = 0;
    const [ground, top] = this.canvases;
    if (!this._map || !this.topLeft || !ground || !top) return;
    this.inks ??= readInks();
    const inks = this.inks;
    const context = ground.getContext("2d");
    if (context) {
      const dense = ground.width / this.width;
      context.setTransform(dense, 0, 0, dense, 0, 0);
      if (this.stale.ground) this.drawGround(context, inks, null);
      else {
        const spot = this.spotOf(this.changed);
        if (spot) this.drawGround(context, inks, spot);
        this.drawNewTrack(context, inks);
      }
    }
    if (this.stale.boat || this.changed.size) this.drawTop(top, inks);
    this.stale.ground = false;
    this.stale.boat = false;
    this.changed.clear();
  }

  // Painting.

  private get scale(): number {
    return 2 ** this.zoom;
  }

  private x(value: number): number {
    return value * this.scale - this.originX;
  }

  private y(value: number): number {
    return value * this.scale - this.originY;
  }

  /** The box of some cells with a margin, in pixels of the canvas. */
  private spotOf(indices: Iterable<number>): Box | null {
    const points: [number, number][] = [];
    for (const index of indices) {
      const ring = this.cells[index] ?? [];
      for (let i = 0; i < ring.length; i += 2)
        points.push([this.x(ring[i] ?? 0), this.y(ring[i + 1] ?? 0)]);
    }
    return boxOf(points, 4);
  }

  private drawGround(context: CanvasRenderingContext2D, inks: Inks, spot: Box | null): void {
    context.save();
    if (spot) {
      context.beginPath();
      context.rect(spot.x, spot.y, spot.width, spot.height);
      context.clip();
    }
    context.clearRect(0, 0, this.width, this.height);
    drawGraticule(context, this._map, [this.originX, this.originY], [this.width, this.height], {
      line: inks.graticule,
      text: this.region.length ? null : inks.graticuleText,
    });
    const water = this.path(this.region);
    context.fillStyle = inks.water;
    context.fill(water, "evenodd");
    this.drawRasters(context, water);
    this.drawCells(context, inks, spot);
    context.setLineDash([]);
    context.strokeStyle = inks.shore;
    context.lineWidth = 2;
    context.stroke(water);
    this.hatch(context, this.noGo, inks.bad, 9, 1);
    this.hatch(context, this.uncovered, inks.bad, 6, -1);
    if (this.way.length) {
      context.setLineDash([6, 5]);
      context.strokeStyle = inks.route;
      context.lineWidth = 1.5;
      context.stroke(this.line(this.way, 0, this.way.length / 2));
      context.setLineDash([]);
    }
    this.drawTrack(context, inks, 0, spot);
    context.restore();
  }

  private drawRasters(context: CanvasRenderingContext2D, water: Path2D): void {
    if (!this.raster && !this.second?.raster) return;
    context.save();
    if (this.region.length) context.clip(water, "evenodd");
    context.imageSmoothingEnabled = false;
    const split = this.second ? this.splitAt(this.second.from) : this.width;
    if (this.raster) this.drawRaster(context, this.raster, 0, split);
    if (this.second?.raster) this.drawRaster(context, this.second.raster, split, this.width);
    context.restore();
  }

  private splitAt(share: number): number {
    return BEYOND * this._map.getSize().x + share * this._map.getSize().x;
  }

  private drawRaster(
    context: CanvasRenderingContext2D,
    raster: Raster,
    from: number,
    to: number,
  ): void {
    const [sw, se, nw] = raster.corners.map(([lon, lat]) => worldOf(lon, lat));
    if (!sw || !se || !nw || to <= from) return;
    const { width, height } = raster.image;
    context.save();
    context.beginPath();
    context.rect(from, 0, to - from, this.height);
    context.clip();
    const k = this.scale;
    context.transform(
      ((se[0] - sw[0]) * k) / width,
      ((se[1] - sw[1]) * k) / width,
      ((sw[0] - nw[0]) * k) / height,
      ((sw[1] - nw[1]) * k) / height,
      this.x(nw[0]),
      this.y(nw[1]),
    );
    context.drawImage(raster.image, 0, 0);
    context.restore();
  }

  private drawCells(context: CanvasRenderingContext2D, inks: Inks, spot: Box | null): void {
    if (!this.cells.length || !this.cellsShown) return;
    const [open, reached, givenUp] = [new Path2D(), new Path2D(), new Path2D()];
    const paths = { open, current: open, reached, given_up: givenUp };
    const within = spot ?? { x: 0, y: 0, width: this.width, height: this.height };
    const plain = !this.raster && !this.second;
    this.cells.forEach((ring, i) => {
      const state = this.states[i] ?? "open";
      if (state === "reached" && !plain) return;
      if (this.touches(ring, within)) this.addRing(paths[state], ring);
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

  /** Whether a ring may reach into a box: whether their boxes overlap. */
  private touches(ring: World, box: Box): boolean {
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

  private drawNewTrack(context: CanvasRenderingContext2D, inks: Inks): void {
    if (this.trackDrawn < this.trackLength)
      this.drawTrack(context, inks, Math.max(0, this.trackDrawn - 1), null);
  }

  private drawTrack(
    context: CanvasRenderingContext2D,
    inks: Inks,
    from: number,
    spot: Box | null,
  ): void {
    // What is painted again in one spot leaves the new pieces elsewhere to be painted still.
    if (!spot) this.trackDrawn = this.trackLength;
    if (this.trackLength - from < 2) return;
    context.setLineDash([]);
    context.lineJoin = "bevel";
    context.lineWidth = 2;
    context.strokeStyle = inks.track;
    context.stroke(
      spot ? this.lineIn(spot) : this.line(this.track, from, this.trackLength),
    );
  }

  /** The pieces of the track that come near a box. */
  private lineIn(box: Box): Path2D {
    const path = new Path2D();
    const k = this.scale;
    const west = (box.x - 60 + this.originX) / k;
    const east = (box.x + box.width + 60 + this.originX) / k;
    const north = (box.y - 60 + this.originY) / k;
    const south = (box.y + box.height + 60 + this.originY) / k;
    let before = -2;
    for (let i = 0; i < this.trackLength; i++) {
      const x = this.track[2 * i] ?? 0;
      const y = this.track[2 * i + 1] ?? 0;
      if (x < west || x > east || y < north || y > south) continue;
      if (before !== i - 1) {
        const from = Math.max(0, i - 1);
        path.moveTo(this.x(this.track[2 * from] ?? 0), this.y(this.track[2 * from + 1] ?? 0));
      }
      path.lineTo(this.x(x), this.y(y));
      before = i;
    }
    return path;
  }

  /** Boat, horizon, the cell under way and a mark, on a canvas no larger than they need. */
  private drawTop(canvas: HTMLCanvasElement, inks: Inks): void {
    const current = this.states.indexOf("current");
    const box = this.topBox(current);
    canvas.hidden = box === null;
    if (!box) return;
    sized(canvas, box.width, box.height);
    const corner = L.point(box.x + this.originX, box.y + this.originY).subtract(
      this._map.getPixelOrigin(),
    );
    this.boatCorner = this._map.layerPointToLatLng(corner);
    L.DomUtil.setTransform(canvas, corner, 1);
    const context = canvas.getContext("2d");
    if (!context) return;
    const dense = canvas.width / box.width;
    context.setTransform(dense, 0, 0, dense, -dense * box.x, -dense * box.y);
    context.clearRect(box.x, box.y, box.width, box.height);
    const ring = this.cells[current];
    if (ring) {
      context.lineWidth = 3;
      context.strokeStyle = inks.currentCell;
      context.stroke(this.path([ring]));
    }
    this.drawHorizon(context, inks);
    if (this.mark) this.drawMark(context, inks, this.mark);
    if (this.boat) this.drawBoat(context, inks, this.boat);
  }

  private topBox(current: number): Box | null {
    const points: [number, number][] = [];
    for (let i = 0; i < this.horizon.length; i += 2)
      points.push([this.x(this.horizon[i] ?? 0), this.y(this.horizon[i + 1] ?? 0)]);
    for (const place of [this.boat && ([this.boat.lon, this.boat.lat] as const), this.mark]) {
      if (!place) continue;
      const [x, y] = worldOf(place[0], place[1]);
      points.push([this.x(x), this.y(y)]);
    }
    const cell = this.spotOf([current]);
    if (cell) points.push([cell.x, cell.y], [cell.x + cell.width, cell.y + cell.height]);
    const box = boxOf(points, 24);
    if (!box) return null;
    // Zoomed in deep, they may be larger than any window.
    const x = Math.max(box.x, -this.width);
    const y = Math.max(box.y, -this.height);
    const width = Math.min(box.x + box.width, 2 * this.width) - x;
    const height = Math.min(box.y + box.height, 2 * this.height) - y;
    return width > 0 && height > 0 ? { x, y, width, height } : null;
  }

  private drawHorizon(context: CanvasRenderingContext2D, inks: Inks): void {
    if (this.horizon.length <= 2) return;
    const ahead = this.line(this.horizon, 0, this.horizon.length / 2);
    context.lineCap = "round";
    for (const [width, ink] of [
      [7, inks.halo],
      [4, inks.horizon],
    ] as const) {
      context.lineWidth = width;
      context.strokeStyle = ink;
      context.stroke(ahead);
    }
  }

  private drawBoat(context: CanvasRenderingContext2D, inks: Inks, boat: Boat): void {
    const [x, y] = worldOf(boat.lon, boat.lat);
    context.save();
    context.translate(this.x(x), this.y(y));
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

  private drawMark(context: CanvasRenderingContext2D, inks: Inks, at: LonLat): void {
    const [x, y] = worldOf(...at);
    const circle = new Path2D();
    circle.arc(this.x(x), this.y(y), 8, 0, 2 * Math.PI);
    for (const [width, ink] of [[6, inks.halo], [3, inks.boat]] as const) {
      context.lineWidth = width;
      context.strokeStyle = ink;
      context.stroke(circle);
    }
  }

  private hatch(
    context: CanvasRenderingContext2D,
    rings: World[],
    ink: string,
    gap: number,
    slope: 1 | -1,
  ): void {
    if (!rings.length) return;
    const area = this.path(rings);
    context.save();
    context.clip(area, "evenodd");
    context.strokeStyle = ink;
    context.lineWidth = 1.5;
    context.beginPath();
    for (let at = -this.height; at < this.width + this.height; at += gap) {
      context.moveTo(at, slope > 0 ? 0 : this.height);
      context.lineTo(at + this.height, slope > 0 ? this.height : 0);
    }
    context.stroke();
    context.restore();
    context.strokeStyle = ink;
    context.lineWidth = 1.5;
    context.stroke(area);
  }

  private path(rings: World[]): Path2D {
    const path = new Path2D();
    for (const ring of rings) this.addRing(path, ring);
    return path;
  }

  private addRing(path: Path2D, ring: World): void {
    for (let i = 0; i < ring.length; i += 2) {
      const x = this.x(ring[i] ?? 0);
      const y = this.y(ring[i + 1] ?? 0);
      if (i === 0) path.moveTo(x, y);
      else path.lineTo(x, y);
    }
    path.closePath();
  }

  /** The line through points `from` to `to`; points nearer than half a pixel are left out. */
  private line(points: World, from: number, to: number): Path2D {
    const path = new Path2D();
    let lastX = Infinity;
    let lastY = Infinity;
    for (let i = from; i < to; i++) {
      const x = this.x(points[2 * i] ?? 0);
      const y = this.y(points[2 * i + 1] ?? 0);
      if (i === from) path.moveTo(x, y);
      else if (i < to - 1 && Math.abs(x - lastX) + Math.abs(y - lastY) < 0.5) continue;
      else path.lineTo(x, y);
      lastX = x;
      lastY = y;
    }
    return path;
  }
}

function readInks(): Inks {
  const style = getComputedStyle(document.documentElement);
  const ink = (name: string): string => style.getPropertyValue(`--ink-${name}`).trim() || "#000";
  return {
    water: ink("water"),
    shore: ink("shore"),
    cell: ink("cell"),
    reached: ink("reached"),
    currentCell: ink("current"),
    givenUp: ink("given-up"),
    route: ink("route"),
    track: ink("track"),
    horizon: ink("horizon"),
    boat: ink("boat"),
    halo: ink("halo"),
    bad: ink("bad"),
    graticule: ink("graticule"),
    graticuleText: ink("graticule-text"),
  };
}
