/**
 * The layer that shows a survey: water, map, cells and track on one canvas, the boat on another.
 *
 * The large one extends beyond each edge of the window, so the browser only moves it while the map
 * is dragged. When the map is dragged further, its pixels are shifted and only the part that comes
 * into view is painted. A change of zoom, theme or map of the water repaints it completely. When a
 * cell is reached, only its spot is repainted; new pieces of the track are added. The boat's canvas
 * is only as large as boat and horizon.
 */

import * as L from "leaflet";
import type { Area, LonLat, TargetState } from "../api";
import { type Afloat, type Boat, boxAfloat, paintAfloat } from "./boat";
import { type Ground, type Half, paintGround, paintTrack, type Track } from "./ground";
import { type Inks, readInks } from "./inks";
import type { Raster } from "./raster";
import { type Box, boxOf, ringsOf, Sight, type World, world, worldOf } from "./sight";

/** How far the large canvas extends beyond the window, as a share of the window. */
const BEYOND = 0.2;

/** Size a canvas in pixels of the page, at the density of the screen, up to twice. */
function sized(canvas: HTMLCanvasElement, width: number, height: number): void {
  const dense = density();
  const [columns, rows] = [Math.round(width * dense), Math.round(height * dense)];
  if (canvas.width === columns && canvas.height === rows) return;
  canvas.width = columns;
  canvas.height = rows;
  canvas.style.width = `${width}px`;
  canvas.style.height = `${height}px`;
}

function density(): number {
  return Math.min(devicePixelRatio || 1, 2);
}

interface Privates {
  _latLngToNewLayerPoint(at: L.LatLng, zoom: number, center: L.LatLng): L.Point;
}

export class Water extends L.Layer {
  private readonly canvases: HTMLCanvasElement[] = [];
  private inks: Inks | null = null;
  private readonly ground: Ground = {
    region: [],
    cells: [],
    states: [],
    uncovered: [],
    noGo: [],
    way: new Float64Array(),
    tracks: [],
    raster: null,
    second: null,
    cellsShown: true,
  };
  private horizon: World = new Float64Array();
  private boats: Boat[] = [];
  private mark: LonLat | null = null;

  private sight = new Sight(0, 0, 0, 0, 0);
  private topLeft: L.LatLng | null = null;
  private boatCorner: L.LatLng | null = null;
  private readonly stale = { ground: false, boat: false };
  /** Cells that changed since the ground was painted last. */
  private readonly changed = new Set<number>();
  private frame = 0;

  // The contents.

  setRegion(area: Area | null): void {
    this.ground.region = ringsOf(area).map(world);
    this.soon("ground");
  }

  setNoGo(area: Area | null): void {
    this.ground.noGo = ringsOf(area).map(world);
    this.soon("ground");
  }

  setUncovered(area: Area | null): void {
    this.ground.uncovered = ringsOf(area).map(world);
    this.soon("ground");
  }

  setCells(rings: readonly (readonly LonLat[])[], states: TargetState[]): void {
    this.ground.cells = rings.map(world);
    this.ground.states = states;
    this.soon("ground");
  }

  setState(index: number, state: TargetState): void {
    this.ground.states[index] = state;
    this.changed.add(index);
    this.soon(null);
  }

  showCells(shown: boolean): void {
    this.ground.cellsShown = shown;
    this.soon("ground");
  }

  setWay(points: readonly LonLat[]): void {
    this.ground.way = world(points);
    this.soon("ground");
  }

  setRaster(raster: Raster | null, second: Half | null = null): void {
    this.ground.raster = raster;
    this.ground.second = second;
    this.soon("ground");
  }

  /** Set the track of a boat, by the boat's index. */
  setTrack(points: readonly (readonly [number, number])[], which = 0): void {
    this.trackOf(which).length = 0;
    this.addTrack(points, which);
    this.soon("ground");
  }

  addTrack(points: readonly (readonly [number, number])[], which = 0): void {
    const track = this.trackOf(which);
    const needed = 2 * (track.length + points.length);
    if (needed > track.points.length) {
      const larger = new Float64Array(2 * needed);
      larger.set(track.points);
      track.points = larger;
    }
    for (const [lon, lat] of points) {
      const [x, y] = worldOf(lon, lat);
      track.points[2 * track.length] = x;
      track.points[2 * track.length + 1] = y;
      track.length++;
    }
    this.soon(null);
  }

  private trackOf(which: number): Track {
    return (this.ground.tracks[which] ??= { points: new Float64Array(8192), length: 0, drawn: 0 });
  }

  setBoat(boat: Boat | null, horizon: readonly LonLat[]): void {
    this.setBoats(boat ? [boat] : [], horizon);
  }

  /** Set all boats, and the planned path of the selected one. */
  setBoats(boats: readonly Boat[], horizon: readonly LonLat[]): void {
    this.boats = [...boats];
    this.horizon = world(horizon);
    this.soon("boat");
  }

  setMark(at: LonLat | null): void {
    this.mark = at;
    this.soon("boat");
  }

  /** Read all inks again and repaint, after a change of theme. */
  repaint(): void {
    this.inks = null;
    this.whole();
  }

  // The methods of a Leaflet layer.

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
      move: () => this.moved(false),
      moveend: () => this.moved(true),
      // When the map jumps, Leaflet changes the origin of its pixels.
      viewreset: () => this.whole(),
      resize: () => this.whole(),
      zoomanim: (event) => this.zooming(event as L.ZoomAnimEvent),
    };
  }

  private zooming(event: L.ZoomAnimEvent): void {
    const scale = this._map.getZoomScale(event.zoom, this.sight.zoom);
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

  /** Paint just enough to keep the window covered, and with a margin once the map rests. */
  private moved(rests: boolean): void {
    if (!this.topLeft) return;
    const zoomed = this._map.getZoom() !== this.sight.zoom;
    // The border between two maps is fixed to the window, so it moves over the water.
    const split = this.ground.second !== null;
    if (zoomed || split) {
      if (rests || (split && !this.covers(0))) this.whole();
    } else if (!this.covers(rests ? BEYOND / 2 : 0)) this.follow();
  }

  /** Whether the painted area extends beyond each edge of the window by a share of it. */
  private covers(share: number): boolean {
    if (!this.topLeft) return false;
    const size = this._map.getSize();
    const at = this._map.latLngToContainerPoint(this.topLeft);
    const [x, y] = [share * size.x, share * size.y];
    const { width, height } = this.sight;
    return at.x <= -x && at.y <= -y && at.x + width >= size.x + x && at.y + height >= size.y + y;
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

  /** Centre the large canvas on the window. */
  private place(): void {
    const size = this._map.getSize();
    const margin = size.multiplyBy(BEYOND).round();
    const corner = this._map.containerPointToLayerPoint(margin.multiplyBy(-1)).round();
    const [width, height] = [size.x + 2 * margin.x, size.y + 2 * margin.y];
    this.topLeft = this._map.layerPointToLatLng(corner);
    const origin = this._map.getPixelOrigin().add(corner);
    this.sight = new Sight(this._map.getZoom(), origin.x, origin.y, width, height);
    const canvas = this.canvases[0];
    if (!canvas) return;
    sized(canvas, width, height);
    L.DomUtil.setTransform(canvas, corner, 1);
  }

  /** Centre the large canvas on the window, and paint only the part that has come into view. */
  private follow(): void {
    const before = this.sight;
    this.place();
    const { width, height, originX, originY } = this.sight;
    const [right, down] = [before.originX - originX, before.originY - originY];
    const [canvas] = this.canvases;
    const context = canvas?.getContext("2d");
    const kept = width === before.width && Math.abs(right) < width && Math.abs(down) < height;
    // Shifting blurs unless a pixel of the page is a whole number of the screen's.
    if (!canvas || !context || !kept || !Number.isInteger(density()) || this.stale.ground)
      return this.whole();
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.globalCompositeOperation = "copy";
    context.drawImage(canvas, right * density(), down * density());
    context.globalCompositeOperation = "source-over";
    this.scaled(context);
    const besides = { x: right > 0 ? 0 : width + right, y: 0, width: Math.abs(right), height };
    const below = { x: 0, y: down > 0 ? 0 : height + down, width, height: Math.abs(down) };
    for (const strip of [besides, below])
      if (strip.width && strip.height) this.drawGround(context, strip);
    this.stale.boat = true;
    cancelAnimationFrame(this.frame);
    this.draw();
  }

  private scaled(context: CanvasRenderingContext2D): void {
    const dense = context.canvas.width / this.sight.width;
    context.setTransform(dense, 0, 0, dense, 0, 0);
  }

  private draw(): void {
    this.frame = 0;
    const [ground, top] = this.canvases;
    if (!this._map || !this.topLeft || !ground || !top) return;
    const context = ground.getContext("2d");
    if (context) {
      this.scaled(context);
      this.drawChanges(context);
    }
    if (this.stale.boat || this.changed.size) this.drawTop(top);
    this.stale.ground = false;
    this.stale.boat = false;
    this.changed.clear();
  }

  private drawChanges(context: CanvasRenderingContext2D): void {
    const { ground, sight } = this;
    const { tracks } = ground;
    const spot = this.spotOf(this.changed);
    if (this.stale.ground) this.drawGround(context, null);
    else {
      if (spot) this.drawGround(context, spot);
      // Repainting a spot leaves out the new pieces of the tracks elsewhere.
      for (const track of tracks)
        if (track.drawn < track.length)
          paintTrack(context, track, sight, this.coat, Math.max(0, track.drawn - 1));
    }
    for (const track of tracks) track.drawn = track.length;
  }

  private drawGround(context: CanvasRenderingContext2D, spot: Box | null): void {
    const { x } = this._map.getSize();
    const splitX = (BEYOND + (this.ground.second?.from ?? 0)) * x;
    paintGround(context, this.ground, this.sight, this.coat, { map: this._map, splitX, spot });
  }

  private get coat(): Inks {
    return (this.inks ??= readInks());
  }

  /** The bounding box of some cells with a margin. */
  private spotOf(indices: Iterable<number>): Box | null {
    const points: [number, number][] = [];
    for (const index of indices)
      points.push(...this.sight.pixels(this.ground.cells[index] ?? new Float64Array()));
    return boxOf(points, 4);
  }

  /** Paint boats, horizon, cells under way and mark on a canvas no larger than they need. */
  private drawTop(canvas: HTMLCanvasElement): void {
    const { sight, ground, boats, horizon, mark } = this;
    const cells = ground.cells.filter((_, i) => ground.states[i] === "current");
    const afloat: Afloat = { boats, horizon, cells, mark };
    const box = boxAfloat(afloat, sight);
    canvas.hidden = box === null;
    if (!box) return;
    sized(canvas, box.width, box.height);
    const corner = L.point(box.x + sight.originX, box.y + sight.originY).subtract(
      this._map.getPixelOrigin(),
    );
    this.boatCorner = this._map.layerPointToLatLng(corner);
    L.DomUtil.setTransform(canvas, corner, 1);
    const context = canvas.getContext("2d");
    if (!context) return;
    const dense = canvas.width / box.width;
    context.setTransform(dense, 0, 0, dense, -dense * box.x, -dense * box.y);
    context.clearRect(box.x, box.y, box.width, box.height);
    paintAfloat(context, afloat, sight, this.coat);
  }
}
