/**
 * The layer that paints a survey: water, map, cells, way and boat on canvases of its own.
 *
 * Three canvases, by how often they change: the ground (water, map, cells) on a change of the map
 * or of a cell; the track, to which new pieces are added; and the boat, at each message. While
 * the map is dragged nothing is painted at all: the browser moves what is there, which reaches a
 * part of the window beyond each edge.
 */

import * as L from "leaflet";
import type { Area, LonLat, TargetState } from "../api";
import { drawGraticule } from "./graticule";
import type { Raster } from "./raster";

/** How far beyond the window the canvases reach, as a share of it. */
const BEYOND = 0.25;

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
  private zoom = 0;
  private originX = 0;
  private originY = 0;
  private width = 0;
  private height = 0;
  private readonly stale = [false, false, false];
  private frame = 0;

  // What may be told.

  setRegion(area: Area | null): void {
    this.region = ringsOf(area).map(world);
    this.soon(0);
  }

  setNoGo(area: Area | null): void {
    this.noGo = ringsOf(area).map(world);
    this.soon(0);
  }

  setUncovered(area: Area | null): void {
    this.uncovered = ringsOf(area).map(world);
    this.soon(0);
  }

  setCells(rings: readonly (readonly LonLat[])[], states: TargetState[]): void {
    this.cells = rings.map(world);
    this.states = states;
    this.soon(0);
  }

  setState(index: number, state: TargetState): void {
    this.states[index] = state;
    this.soon(0);
  }

  showCells(shown: boolean): void {
    this.cellsShown = shown;
    this.soon(0);
  }

  setWay(points: readonly LonLat[]): void {
    this.way = world(points);
    this.soon(0);
  }

  setRaster(raster: Raster | null, second: Half | null = null): void {
    this.raster = raster;
    this.second = second;
    this.soon(0);
  }

  setTrack(points: readonly (readonly [number, number])[]): void {
    this.trackLength = 0;
    this.addTrack(points);
    this.trackDrawn = 0;
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
    this.soon(1);
  }

  setBoat(boat: Boat | null, horizon: readonly LonLat[]): void {
    this.boat = boat;
    this.horizon = world(horizon);
    this.soon(2);
  }

  setMark(at: LonLat | null): void {
    this.mark = at;
    this.soon(2);
  }

  /** The theme has changed: all inks are read again. */
  repaint(): void {
    this.inks = null;
    this.whole();
  }

  // A layer of Leaflet.

  override onAdd(map: L.Map): this {
    for (let i = 0; i < 3; i++) {
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
      moveend: () => this.whole(),
      resize: () => this.whole(),
      zoomanim: (event) => this.zooming(event as L.ZoomAnimEvent),
    };
  }

  private zooming(event: L.ZoomAnimEvent): void {
    if (!this.topLeft) return;
    const scale = this._map.getZoomScale(event.zoom, this.zoom);
    const offset = (this._map as unknown as Privates)._latLngToNewLayerPoint(
      this.topLeft,
      event.zoom,
      event.center,
    );
    for (const canvas of this.canvases) L.DomUtil.setTransform(canvas, offset, scale);
  }

  private soon(which: number): void {
    this.stale[which] = true;
    if (!this.frame && this._map) this.frame = requestAnimationFrame(() => this.draw());
  }

  private whole(): void {
    if (!this._map || !this.canvases.length) return;
    this.trackDrawn = 0;
    this.place();
    this.stale.fill(true);
    cancelAnimationFrame(this.frame);
    this.draw();
  }

  /** Put the canvases around the window, where the map has come to rest. */
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
    const dense = Math.min(devicePixelRatio || 1, 2);
    for (const canvas of this.canvases) {
      const width = Math.round(this.width * dense);
      const height = Math.round(this.height * dense);
      if (canvas.width !== width || canvas.height !== height) {
        canvas.width = width;
        canvas.height = height;
        canvas.style.width = `${this.width}px`;
        canvas.style.height = `${this.height}px`;
      }
      L.DomUtil.setTransform(canvas, corner, 1);
    }
  }

  private draw(): void {
    this.frame = 0;
    if (!this._map || !this.topLeft) return;
    this.inks ??= readInks();
    const inks = this.inks;
    const painters = [this.drawGround, this.drawTrack, this.drawBoat];
    painters.forEach((painter, i) => {
      if (!this.stale[i]) return;
      this.stale[i] = false;
      const canvas = this.canvases[i];
      const context = canvas?.getContext("2d");
      if (!canvas || !context) return;
      const dense = canvas.width / this.width;
      context.setTransform(dense, 0, 0, dense, 0, 0);
      painter.call(this, context, inks);
    });
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

  private drawGround(context: CanvasRenderingContext2D, inks: Inks): void {
    context.clearRect(0, 0, this.width, this.height);
    drawGraticule(context, this._map, [this.originX, this.originY], [this.width, this.height], {
      line: inks.graticule,
      text: this.region.length ? null : inks.graticuleText,
    });
    const water = this.path(this.region);
    context.fillStyle = inks.water;
    context.fill(water, "evenodd");
    this.drawRasters(context, water);
    this.drawCells(context, inks);
    context.setLineDash([]);
    context.strokeStyle = inks.shore;
    context.lineWidth = 2;
    context.stroke(water);
    this.hatch(context, this.path(this.noGo), inks.bad, 9, 1);
    this.hatch(context, this.path(this.uncovered), inks.bad, 6, -1);
    if (this.way.length) {
      context.setLineDash([6, 5]);
      context.strokeStyle = inks.route;
      context.lineWidth = 1.5;
      context.stroke(this.line(this.way, 0, this.way.length / 2));
      context.setLineDash([]);
    }
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

  private drawCells(context: CanvasRenderingContext2D, inks: Inks): void {
    if (!this.cells.length || !this.cellsShown) return;
    const paths: Record<TargetState, Path2D> = {
      open: new Path2D(),
      current: new Path2D(),
      reached: new Path2D(),
      given_up: new Path2D(),
    };
    this.cells.forEach((ring, i) => this.addRing(paths[this.states[i] ?? "open"], ring));
    context.setLineDash([]);
    if (!this.raster && !this.second) {
      context.fillStyle = inks.reached;
      context.fill(paths.reached);
    }
    context.lineWidth = 1;
    context.strokeStyle = inks.cell;
    context.stroke(paths.open);
    context.fillStyle = inks.givenUp;
    context.fill(paths.given_up);
    context.lineWidth = 3;
    context.strokeStyle = inks.currentCell;
    context.stroke(paths.current);
  }

  private drawTrack(context: CanvasRenderingContext2D, inks: Inks): void {
    if (this.trackDrawn === 0) context.clearRect(0, 0, this.width, this.height);
    const from = Math.max(0, this.trackDrawn - 1);
    if (this.trackLength - from < 2) return;
    context.lineJoin = "round";
    context.lineWidth = 2;
    context.strokeStyle = inks.track;
    context.stroke(this.line(this.track, from, this.trackLength));
    this.trackDrawn = this.trackLength;
  }

  private drawBoat(context: CanvasRenderingContext2D, inks: Inks): void {
    context.clearRect(0, 0, this.width, this.height);
    if (this.horizon.length > 2) {
      const ahead = this.line(this.horizon, 0, this.horizon.length / 2);
      context.lineCap = "round";
      for (const [width, ink] of [[7, inks.halo], [4, inks.horizon]] as const) {
        context.lineWidth = width;
        context.strokeStyle = ink;
        context.stroke(ahead);
      }
    }
    if (this.mark) this.drawMark(context, inks, this.mark);
    if (!this.boat) return;
    const [x, y] = worldOf(this.boat.lon, this.boat.lat);
    context.save();
    context.translate(this.x(x), this.y(y));
    context.rotate(this.boat.heading_rad);
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
    area: Path2D,
    ink: string,
    gap: number,
    slope: 1 | -1,
  ): void {
    if (!this.noGo.length && !this.uncovered.length) return;
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
