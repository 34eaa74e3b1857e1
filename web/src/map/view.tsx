/** The map that screens are built on: Leaflet with the layer of the survey, a scale and a legend. */

import { useEffect, useRef } from "preact/hooks";
import type { ComponentChildren, JSX } from "preact";
import * as L from "leaflet";
import { options, painted, t } from "../state";
import { Water } from "./water";

export interface Ground {
  map: L.Map;
  water: Water;
  /** Whether the screen was left; late answers must then not move the map. */
  gone: boolean;
}

type Bounds = [number, number, number, number];

/** Show all of the bounds; `over` if panels cover much of the map. */
export function fit(ground: Ground, [west, south, east, north]: Bounds, over = false): void {
  if (ground.gone) return;
  const { x: width } = ground.map.getSize();
  const narrow = over && width < 560;
  ground.map.fitBounds(
    [
      [south, west],
      [north, east],
    ],
    // Keep the survey clear of the panels over the map, in a narrow window too.
    narrow
      ? { paddingTopLeft: [14, 122], paddingBottomRight: [14, 66], animate: false }
      : {
          paddingTopLeft: [36, over ? 72 : 36],
          paddingBottomRight: [over && width > 800 ? 280 : 36, 36],
          animate: false,
        },
  );
}

function make(box: HTMLElement): Ground {
  const map = L.map(box, {
    zoomSnap: 0.25,
    zoomDelta: 0.5,
    wheelPxPerZoomLevel: 100,
    maxZoom: 23,
    minZoom: 3,
    zoomControl: false,
    attributionControl: false,
    worldCopyJump: false,
    fadeAnimation: false,
    inertia: true,
  });
  const [lat, lon, zoom] = lastPlace();
  map.setView([lat, lon], zoom);
  map.on("moveend", () => {
    const { lat: y, lng: x } = map.getCenter();
    localStorage.setItem("grebe-place", JSON.stringify([y, x, map.getZoom()]));
  });
  L.control
    .zoom({ position: "topleft", zoomInTitle: t("zoomIn"), zoomOutTitle: t("zoomOut") })
    .addTo(map);
  L.control.scale({ position: "bottomleft", imperial: false, maxWidth: 120 }).addTo(map);
  addBackground(map);
  const water = new Water().addTo(map);
  return { map, water, gone: false };
}

/** The place that was shown last, because a new plan is probably near it. */
function lastPlace(): [number, number, number] {
  try {
    const kept: unknown = JSON.parse(localStorage.getItem("grebe-place") ?? "");
    if (Array.isArray(kept) && kept.length === 3 && kept.every((item) => Number.isFinite(item)))
      return kept as [number, number, number];
  } catch {
    // Nothing is stored, or it is unreadable: the middle of a lake in the Alps will do.
  }
  return [46.45, 6.55, 15];
}

function addBackground(map: L.Map): void {
  const background = options.value?.background;
  if (!background) return;
  const layer = L.tileLayer("/api/background/{z}/{x}/{y}", {
    minNativeZoom: background.min_zoom,
    maxNativeZoom: background.max_zoom,
    maxZoom: 23,
  });
  if (background.bounds) {
    const [west, south, east, north] = background.bounds;
    layer.options.bounds = [
      [south, west],
      [north, east],
    ];
  }
  layer.addTo(map);
  L.control.attribution({ prefix: false }).addAttribution(escaped(background.attribution)).addTo(map);
}

function escaped(text: string): string {
  const box = document.createElement("span");
  box.textContent = text;
  return box.innerHTML;
}

export function MapView({
  onReady,
  crosshair = false,
  children,
}: {
  onReady: (ground: Ground) => void | (() => void);
  crosshair?: boolean;
  children?: ComponentChildren;
}): JSX.Element {
  const box = useRef<HTMLDivElement>(null);
  const held = useRef<Ground | null>(null);
  useEffect(() => {
    if (!box.current) return;
    const ground = make(box.current);
    held.current = ground;
    const watcher = new ResizeObserver(() => ground.map.invalidateSize({ animate: false }));
    watcher.observe(box.current);
    const undo = onReady(ground);
    return () => {
      undo?.();
      watcher.disconnect();
      held.current = null;
      ground.gone = true;
      ground.map.remove();
    };
  }, []);
  const coat = painted.value;
  useEffect(() => held.current?.water.repaint(), [coat]);
  return (
    <div class="map-box">
      <div ref={box} class="map" role="application" aria-label={t("mapView")} tabIndex={0} />
      {crosshair && <div class="crosshair" aria-hidden="true" />}
      {children}
    </div>
  );
}
