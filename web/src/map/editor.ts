/** Drawing and editing the sketch on the map, by pointer and by keyboard. */

import * as L from "leaflet";
import type { LonLat } from "../api";
import { t } from "../state";
import { inserted, moved, removed, type Kind, type Shape, type Sketch } from "./sketch";

export type Tool = Kind | "start" | null;

export interface Hands {
  finish(shape: Shape): void;
  start(at: LonLat): void;
  select(index: number | null): void;
  change(index: number, ring: LonLat[]): void;
  drop(index: number): void;
  leave(): void;
  /** The number of points of the shape being drawn. */
  progress(points: number): void;
}

const names: Record<Kind, "water" | "island" | "noGo"> = {
  water: "water",
  island: "island",
  noGo: "noGo",
};

/** A click this close to the first point closes the shape [pixels]. */
const CLOSE_PX = 16;

function lonLat(at: L.LatLng): LonLat {
  return [Number(at.lng.toFixed(7)), Number(at.lat.toFixed(7))];
}

function latLng([lon, lat]: LonLat): L.LatLngTuple {
  return [lat, lon];
}

export class Editor {
  private readonly group: L.LayerGroup;
  private readonly draft: L.LayerGroup;
  private tool: Tool = null;
  private points: LonLat[] = [];
  private hover: LonLat | null = null;
  private focus: { shape: number; corner: number } | null = null;

  constructor(
    private readonly map: L.Map,
    private readonly hands: Hands,
  ) {
    this.group = L.layerGroup().addTo(map);
    this.draft = L.layerGroup().addTo(map);
    map.on("click", (event) => this.clicked(event.latlng));
    map.on("mousemove", (event) => {
      if (!this.points.length) return;
      this.hover = lonLat(event.latlng);
      this.drawDraft();
    });
    map.getContainer().addEventListener("keydown", (event) => this.pressed(event));
  }

  use(tool: Tool): void {
    this.tool = tool;
    this.points = [];
    this.hover = null;
    this.hands.progress(0);
    this.map.getContainer().classList.toggle("drawing", tool !== null);
    if (tool) this.map.doubleClickZoom.disable();
    else this.map.doubleClickZoom.enable();
    this.drawDraft();
  }

  addCentre(): void {
    this.clicked(this.map.getCenter());
  }

  takeBack(): void {
    this.points = this.points.slice(0, -1);
    this.hands.progress(this.points.length);
    this.drawDraft();
  }

  finish(): void {
    if (!this.tool || this.tool === "start" || this.points.length < 3) return;
    const shape = { kind: this.tool, ring: this.points };
    this.points = [];
    this.drawDraft();
    this.hands.finish(shape);
  }

  private clicked(at: L.LatLng): void {
    if (!this.tool) {
      this.hands.select(null);
      return;
    }
    if (this.tool === "start") {
      this.hands.start(lonLat(at));
      return;
    }
    const first = this.points[0];
    const near = (point: LonLat): number =>
      this.map
        .latLngToContainerPoint(latLng(point))
        .distanceTo(this.map.latLngToContainerPoint(at));
    if (first && this.points.length >= 3 && near(first) < CLOSE_PX) {
      this.finish();
      return;
    }
    const last = this.points[this.points.length - 1];
    if (last && near(last) < 3) return; // the second click of a double click
    this.points = [...this.points, lonLat(at)];
    this.hands.progress(this.points.length);
    this.drawDraft();
  }

  private pressed(event: KeyboardEvent): void {
    if (!this.tool || event.ctrlKey || event.metaKey) return;
    const own: Record<string, () => void> = {
      Enter: () => this.addCentre(),
      f: () => this.finish(),
      F: () => this.finish(),
      Backspace: () => this.takeBack(),
      Escape: () => this.hands.leave(),
    };
    const act = own[event.key];
    if (!act || event.target !== this.map.getContainer()) return;
    event.preventDefault();
    event.stopPropagation();
    act();
  }

  private drawDraft(): void {
    this.draft.clearLayers();
    if (!this.points.length || !this.tool || this.tool === "start") return;
    const line = this.hover ? [...this.points, this.hover] : this.points;
    L.polygon(line.map(latLng), {
      className: `draft ${this.tool}`,
      interactive: false,
    }).addTo(this.draft);
    this.points.forEach((point, i) => {
      L.circleMarker(latLng(point), {
        radius: i === 0 ? 9 : 5,
        className: "draft-corner",
        interactive: false,
      }).addTo(this.draft);
    });
  }

  show(sketch: Sketch, selected: number | null): void {
    const kept = this.focus;
    this.group.clearLayers();
    sketch.shapes.forEach((shape, index) => {
      const polygon = L.polygon(shape.ring.map(latLng), {
        className: `shape ${shape.kind}${index === selected ? " selected" : ""}`,
        bubblingMouseEvents: true,
      });
      polygon.on("click", (event) => {
        if (this.tool) return;
        L.DomEvent.stopPropagation(event);
        this.hands.select(index);
      });
      polygon.addTo(this.group);
    });
    const shape = selected === null ? undefined : sketch.shapes[selected];
    if (shape && selected !== null && !this.tool) this.addHandles(shape, selected);
    if (sketch.start) this.addStart(sketch.start);
    this.focus = kept;
    if (kept) this.refocus(kept);
  }

  private addStart(at: LonLat): void {
    const icon = L.divIcon({ className: "start-mark", iconSize: [30, 30] });
    const marker = L.marker(latLng(at), { icon, draggable: true, keyboard: true, title: t("startPoint"), alt: t("startPoint") });
    marker.on("dragend", () => this.hands.start(lonLat(marker.getLatLng())));
    marker.addTo(this.group);
    this.steer(marker, (to) => this.hands.start(to));
  }

  private addHandles(shape: Shape, index: number): void {
    const named = t(names[shape.kind]);
    shape.ring.forEach((point, corner) => {
      const title = t("corner", { n: corner + 1, shape: named });
      const icon = L.divIcon({ className: `handle corner-${corner}`, iconSize: [24, 24] });
      const marker = L.marker(latLng(point), { icon, draggable: true, title, alt: title });
      marker.on("dragend", () =>
        this.hands.change(index, moved(shape.ring, corner, lonLat(marker.getLatLng()))),
      );
      marker.addTo(this.group);
      this.steer(
        marker,
        (to) => {
          this.focus = { shape: index, corner };
          this.hands.change(index, moved(shape.ring, corner, to));
        },
        () => this.hands.change(index, removed(shape.ring, corner)),
      );
      // Outlines from files have thousands of corners; only hand-drawn shapes get dots between them.
      if (shape.ring.length <= 60) this.addMiddle(shape, index, corner, named);
    });
  }

  private addMiddle(shape: Shape, index: number, corner: number, named: string): void {
    const from = shape.ring[corner];
    const to = shape.ring[(corner + 1) % shape.ring.length];
    if (!from || !to) return;
    const middle: LonLat = [(from[0] + to[0]) / 2, (from[1] + to[1]) / 2];
    const title = t("addCorner", { shape: named });
    const icon = L.divIcon({ className: "handle middle", iconSize: [16, 16] });
    const marker = L.marker(latLng(middle), { icon, draggable: true, title, alt: title });
    const add = (at: LonLat): void => this.hands.change(index, inserted(shape.ring, corner, at));
    marker.on("dragend", () => add(lonLat(marker.getLatLng())));
    marker.on("click", (event) => {
      L.DomEvent.stopPropagation(event);
      add(middle);
    });
    marker.on("keypress", () => add(middle));
    marker.addTo(this.group);
  }

  /** Arrow keys move a mark by two pixels, with Shift by twenty. */
  private steer(marker: L.Marker, move: (to: LonLat) => void, drop?: () => void): void {
    marker.getElement()?.addEventListener("keydown", (event) => {
      const step = event.shiftKey ? 20 : 2;
      const ways: Record<string, [number, number]> = {
        ArrowLeft: [-step, 0],
        ArrowRight: [step, 0],
        ArrowUp: [0, -step],
        ArrowDown: [0, step],
      };
      const way = ways[event.key];
      const drops = event.key === "Delete" || event.key === "Backspace";
      if (!way && !(drops && drop)) return;
      event.preventDefault();
      event.stopPropagation();
      if (way) {
        const at = this.map.latLngToContainerPoint(marker.getLatLng()).add(L.point(way));
        move(lonLat(this.map.containerPointToLatLng(at)));
      } else drop?.();
    });
  }

  private refocus({ corner }: { corner: number }): void {
    const handle = this.map.getContainer().querySelector<HTMLElement>(`.corner-${corner}`);
    handle?.focus({ preventScroll: true });
    this.focus = null;
  }
}
