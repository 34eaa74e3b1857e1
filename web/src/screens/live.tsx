/** Live: the boat, its planned path, its measurements and its commands. */

import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { useComputed } from "@preact/signals";
import type { JSX } from "preact";
import { api, type Grid, type MapLayer, type Snapshot } from "../api";
import { Stream } from "../live/stream";
import { fit, MapView, type Ground } from "../map/view";
import { paint, rangeOf } from "../map/raster";
import { Commands } from "../parts/commands";
import { Boats, LiveCharts, LiveEvents, Values } from "../parts/live-panel";
import { Legend } from "../parts/legend";
import { duration, go, number, reading, t, tr } from "../state";
import { Icon } from "../parts/icon";

/** Time between requests of the map while the boat is under way [ms]. */
const MAP_EACH_MS = 8000;

export function Live({ id }: { id: string }): JSX.Element {
  const stream = useMemo(() => new Stream(api.eventsUrl(id)), [id]);
  const ground = useRef<Ground | null>(null);
  const [quantity, setQuantity] = useState<string | null>(null);
  const [layer, setLayer] = useState<MapLayer>("mean");
  const [follow, setFollow] = useState(false);
  const following = useRef(follow);
  following.current = follow;
  useEffect(() => {
    stream.open();
    return () => stream.close();
  }, [stream]);
  const snapshot = stream.snapshot.value;
  const shown = quantity ?? snapshot?.quantities[0]?.id ?? null;
  const map = useLiveMap(id, stream, shown, layer);

  useEffect(() => {
    const water = ground.current?.water;
    if (!water) return;
    if (!map.mean) water.setRaster(null);
    else water.setRaster(paint(map.mean, rangeOf(map.mean), layer === "mean" ? map.sd : null));
  }, [map, layer]);

  function ready(made: Ground): () => void {
    ground.current = made;
    let fitted = "";
    let index = new Map<number, number>();
    const lookedAt = stream.chosen.subscribe(() => paintBoats(made, stream));
    const deaf = stream.hear({
      snapshot: (all) => {
        index = paintSnapshot(made, all);
        paintBoats(made, stream);
        if (fitted !== all.id) fit(made, all.bounds, true);
        fitted = all.id;
      },
      delta: (delta) => {
        for (const [seq, state] of delta.targets ?? []) {
          const place = index.get(seq);
          if (place !== undefined) made.water.setState(place, state);
        }
        const boat = delta.boat ?? 1;
        if (delta.track) made.water.addTrack(delta.track.map(([, lon, lat]) => [lon, lat]), boat - 1);
        if (delta.estimate || delta.horizon) paintBoats(made, stream);
        if (delta.estimate && following.current && boat === stream.chosen.peek())
          made.map.panTo([delta.estimate.lat, delta.estimate.lon], { animate: false });
      },
    });
    return () => {
      lookedAt();
      deaf();
    };
  }

  const about = snapshot?.quantities.find((item) => item.id === shown) ?? null;
  const complete = useComputed(() => stream.status.value?.state === "complete").value;
  return (
    <div class="live-screen">
      <StatusBar stream={stream} />
      <div class="live-map">
        <MapView onReady={ready}>
          <div class="map-tools">
            <button
              class="button"
              aria-label={t("wholeSurvey")}
              onClick={() => ground.current && snapshot && fit(ground.current, snapshot.bounds, true)}
            >
              <Icon name="whole" />
              <span>{t("wholeSurvey")}</span>
            </button>
            <button class="button" aria-label={t("follow")} aria-pressed={follow} onClick={() => setFollow(!follow)}>
              <Icon name="boat" />
              <span>{t("follow")}</span>
            </button>
          </div>
          <div class="map-legend">
            <div class="segments" role="group" aria-label={t("layer")}>
              {(["mean", "sd"] as const).map((item) => (
                <button key={item} aria-pressed={layer === item} onClick={() => setLayer(item)}>
                  {t(item === "mean" ? "layerMean" : "layerSd")}
                </button>
              ))}
            </div>
            {map.mean && about ? (
              <Legend title={tr(about.label)} unit={map.mean.unit} layer={layer} range={rangeOf(map.mean)}>
                <small class="wide-only">
                  {t("notSampled")}
                  {layer === "mean" && ` · ${t("paler")}`}
                </small>
              </Legend>
            ) : (
              <p class="legend quiet">{t("mapForming")}</p>
            )}
          </div>
          <Compass stream={stream} />
        </MapView>
      </div>
      <aside class="panel live-panel" aria-label={t("live")}>
        <Boats stream={stream} />
        <Values stream={stream} chosen={shown} choose={setQuantity} />
        <LiveCharts stream={stream} quantity={about} />
        <LiveEvents stream={stream} />
      </aside>
      <Commands id={id} stream={stream} />
      {complete && (
        <div class="done" role="status">
          <strong>{t("state_complete")}</strong>
          <button class="button primary" onClick={() => go("map", id)}>
            {t("openMap")}
          </button>
        </div>
      )}
    </div>
  );
}

function paintSnapshot({ water }: Ground, all: Snapshot): Map<number, number> {
  water.setRegion(all.region);
  water.setCells(
    all.targets.map((target) => target.ring),
    all.targets.map((target) => target.state),
  );
  const tracks = all.boats.length ? all.boats.map((boat) => boat.track) : [all.track];
  tracks.forEach((track, i) => water.setTrack(track.map(([, lon, lat]) => [lon, lat]), i));
  return new Map(all.targets.map((target, i) => [target.seq, i]));
}

/** Paint all boats; those of a fleet with their numbers, and the selected one in its own colour. */
function paintBoats({ water }: Ground, stream: Stream): void {
  const chosen = stream.chosen.peek();
  const several = stream.boats.size > 1;
  const boats = [...stream.boats.values()].flatMap(({ boat, estimate }) =>
    estimate ? [{ ...estimate, ...(several ? { number: boat, aside: boat !== chosen } : {}) }] : [],
  );
  water.setBoats(boats, stream.boats.get(chosen)?.horizon ?? []);
}

interface LiveMap {
  mean: Grid | null;
  sd: Grid | null;
}

/** The map as it forms: requested when the server announces a new one, and from time to time anyway. */
function useLiveMap(id: string, stream: Stream, quantity: string | null, layer: MapLayer): LiveMap {
  const [map, setMap] = useState<LiveMap>({ mean: null, sd: null });
  const version = stream.mapVersion.value;
  const [turn, setTurn] = useState(0);
  useEffect(() => {
    const timer = setInterval(() => {
      const state = stream.status.peek()?.state;
      if (state === "running" || state === "returning") setTurn((old) => old + 1);
    }, MAP_EACH_MS);
    return () => clearInterval(timer);
  }, [stream]);
  // A browser opens six connections to a server: request one map at a time, and abort a request
  // when another map is wanted or the screen is left.
  const asked = useRef<AbortController | null>(null);
  useEffect(
    () => () => {
      asked.current?.abort();
      asked.current = null;
    },
    [id, quantity, layer],
  );
  useEffect(() => {
    if (!quantity || !stream.snapshot.peek() || asked.current) return;
    const stopper = new AbortController();
    asked.current = stopper;
    void load(id, quantity, layer, stopper.signal).then((loaded) => {
      if (asked.current === stopper) asked.current = null;
      if (loaded && !stopper.signal.aborted) setMap(loaded);
    });
  }, [id, quantity, layer, version, turn]);
  return map;
}

async function load(
  id: string,
  quantity: string,
  layer: MapLayer,
  signal: AbortSignal,
): Promise<LiveMap | null> {
  try {
    const mean = await api.map(id, quantity, layer, null, "above", signal);
    const sd = layer === "mean" ? await api.map(id, quantity, "sd", null, "above", signal) : null;
    return { mean, sd };
  } catch {
    return null; // there is no map yet, or no answer: keep the one on the screen
  }
}

function StatusBar({ stream }: { stream: Stream }): JSX.Element {
  const snapshot = stream.snapshot.value;
  const status = stream.status.value;
  void stream.pulse.value;
  const boat = stream.boat;
  // For a fleet, show the status of the selected boat, as far as it is known.
  const own = status && { ...status, ...boat?.status };
  const [low, high] = snapshot?.speed_window ?? [0, 0];
  const age = own?.link_age_s ?? null;
  const link = !stream.connected.value
    ? { word: t("noLink"), kind: "bad" }
    : age === null
      ? { word: t("noLink"), kind: "faint" }
      : age > 3
        ? { word: t("linkOld", { s: duration(age) }), kind: "bad" }
        : { word: t("linkLive"), kind: "good" };
  const battery = own?.battery;
  const chips: [string, string][] = [
    [t("mode"), own ? own.doing || t(`state_${own.state}`) : "–"],
    [t("speed"), `${reading(boat?.estimate?.surge_mps)} m/s · ${t("window")} ${number.value(low, 1)}–${number.value(high, 1)}`],
    [t("thrusts"), boat?.thrusts ? `${boat.thrusts.map((push) => number.value(push, 1)).join(" / ")} N` : "–"],
    [t("solve"), own?.solve_ms != null ? `${number.value(own.solve_ms)} ms` : "–"],
    [
      t("battery"),
      battery
        ? [battery.volt !== null ? `${number.value(battery.volt, 1)} V` : "", battery.fraction !== null ? `${number.value(100 * battery.fraction)} %` : ""].filter(Boolean).join(" · ") || "–"
        : "–",
    ],
    [t("gnss"), own?.fix ?? "–"],
  ];
  return (
    <header class="status-bar">
      <h1>{snapshot?.name ?? t("live")}</h1>
      <span class={`link-chip ${link.kind}`}>
        <span class="dot" aria-hidden="true" />
        {link.word}
      </span>
      {/* It scrolls in a narrow window, by keyboard too. */}
      <dl tabIndex={0}>
        {chips.map(([name, value]) => (
          <div key={name}>
            <dt>{name}</dt>
            <dd>{value}</dd>
          </div>
        ))}
      </dl>
      {!stream.connected.value && (
        <p class="banner" role="alert">
          {t("reconnecting")}
        </p>
      )}
    </header>
  );
}

function Compass({ stream }: { stream: Stream }): JSX.Element {
  void stream.pulse.value;
  const flows = [
    ["current", stream.boat?.current ?? null],
    ["wind", stream.boat?.wind ?? null],
  ] as const;
  return (
    <div class="flows">
      {flows.map(([name, flow]) => {
        if (name === "wind" && !flow) return null;
        const speed = flow ? Math.hypot(flow.north_mps, flow.east_mps) : null;
        const towards = flow ? (Math.atan2(flow.east_mps, flow.north_mps) * 180) / Math.PI : 0;
        return (
          <div key={name} class="flow">
            <svg viewBox="-12 -12 24 24" aria-hidden="true">
              {speed !== null && speed >= 0.01 && <path d="M0 9V-9M-5 -3 0 -9 5 -3" transform={`rotate(${towards.toFixed(0)})`} />}
            </svg>
            <span>
              {t(name)} <strong>{speed === null ? "–" : `${number.value(speed, 2)} m/s`}</strong>
            </span>
          </div>
        );
      })}
    </div>
  );
}
