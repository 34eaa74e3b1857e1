/** Map: each quantity with its uncertainty, at a point, along a line, or compared with another survey. */

import { useEffect, useRef, useState } from "preact/hooks";
import type { JSX } from "preact";
import * as L from "leaflet";
import type { AlignedData } from "uplot";
import { ApiError, api, type Grid, type LonLat, type MapAt, type MapLayer, type Profile, type SurveyDetail, type SurveySummary } from "../api";
import { fit, MapView, type Ground } from "../map/view";
import { paint, rangeOf } from "../map/raster";
import { Chart } from "../parts/chart";
import { Legend } from "../parts/legend";
import { Select } from "../parts/plan-form";
import { complain, inWords, reading, t, tr } from "../state";
import type { Word } from "../words";

const layers: [MapLayer, Word][] = [
  ["mean", "layerMean"],
  ["sd", "layerSd"],
  ["probability", "layerProbability"],
  ["quality", "layerQuality"],
];

export function MapScreen({ id }: { id: string }): JSX.Element {
  const ground = useRef<Ground | null>(null);
  const line = useRef<L.LayerGroup | null>(null);
  const [survey, setSurvey] = useState<SurveyDetail | null>(null);
  const [quantity, setQuantity] = useState("");
  const [layer, setLayer] = useState<MapLayer>("mean");
  const [threshold, setThreshold] = useState<number | null>(null);
  const [side, setSide] = useState("above");
  const [other, setOther] = useState("");
  const [split, setSplit] = useState(0.5);
  const [at, setAt] = useState<{ place: LonLat; read: MapAt | string } | null>(null);
  const [drawing, setDrawing] = useState(false);
  const [points, setPoints] = useState<LonLat[]>([]);
  const [profile, setProfile] = useState<Profile | null>(null);
  const about = survey?.quantities.find((item) => item.id === quantity) ?? null;

  useEffect(() => {
    void api
      .survey(id)
      .then((made) => {
        setSurvey(made);
        setQuantity((old) => old || (made.quantities[0]?.id ?? ""));
        if (!ground.current) return;
        ground.current.water.setRegion(made.region);
        fit(ground.current, made.bounds, true);
      })
      .catch(complain);
  }, [id]);
  useEffect(() => {
    setThreshold(about?.threshold ?? null);
    setSide(about?.side ?? "above");
  }, [about]);

  const first = useGrid(id, quantity, layer, threshold, side);
  const second = useGrid(other, quantity, layer, threshold, side);
  const [difference, setDifference] = useState(false);
  const change = useDifference(difference && other ? id : "", other, quantity);
  const main = change ?? first.grid;
  const range = main ? together(main, change ? null : second.grid) : null;

  useEffect(() => {
    const water = ground.current?.water;
    if (!water) return;
    if (!main || !range) {
      water.setRaster(null);
      return;
    }
    const half = second.grid && !change ? { raster: paint(second.grid, range), from: split } : null;
    water.setRaster(paint(main, range), half);
  }, [main, second.grid, change, split, range?.[0], range?.[1]]);

  // The map's handlers are set once, so they read the present values from here.
  const now = useRef({ drawing, quantity });
  now.current = { drawing, quantity };
  async function read(place: LonLat): Promise<void> {
    ground.current?.water.setMark(place);
    try {
      setAt({ place, read: await api.mapAt(id, now.current.quantity, place) });
    } catch (cause) {
      setAt({ place, read: cause instanceof ApiError && cause.status === 404 ? t("offWater") : inWords(cause) });
    }
  }
  function ready(made: Ground): void {
    ground.current = made;
    line.current = L.layerGroup().addTo(made.map);
    const act = (at: L.LatLng): void => {
      if (now.current.drawing) setPoints((old) => [...old, [at.lng, at.lat]]);
      else void read([at.lng, at.lat]);
    };
    made.map.on("click", (event) => act(event.latlng));
    made.map.getContainer().addEventListener("keydown", (event) => {
      if (event.target !== made.map.getContainer()) return;
      if (event.key === "Enter") act(made.map.getCenter());
      if (event.key.toLowerCase() === "f" || event.key === "Escape") setDrawing(false);
    });
  }
  useEffect(() => {
    if (at && quantity) void read(at.place);
  }, [quantity]);
  useEffect(() => {
    line.current?.clearLayers();
    if (!points.length || !line.current) return;
    const places = points.map(([lon, lat]): L.LatLngTuple => [lat, lon]);
    L.polyline(places, { className: "profile-line", interactive: false }).addTo(line.current);
    for (const place of places)
      L.circleMarker(place, { radius: 5, className: "draft-corner", interactive: false }).addTo(line.current);
  }, [points]);
  useEffect(() => {
    if (points.length < 2 || !quantity) {
      setProfile(null);
      return;
    }
    void api.profile(id, quantity, points).then(setProfile).catch(complain);
  }, [points, quantity, id]);

  return (
    <div class="split">
      <div class="stage">
        <div class="tools map-bar">
          <h1>{survey?.name ?? t("map")}</h1>
          <Select label={t("quantity")} value={quantity} change={setQuantity}>
            {survey?.quantities.map((item) => (
              <option key={item.id} value={item.id}>
                {tr(item.label)}
              </option>
            ))}
          </Select>
          <Select label={t("layer")} value={layer} change={(value) => setLayer(value as MapLayer)}>
            {layers.map(([name, word]) => (
              <option key={name} value={name}>
                {t(word)}
              </option>
            ))}
          </Select>
          {layer === "probability" && (
            <Threshold value={threshold} unit={about?.unit ?? ""} change={setThreshold} side={side} setSide={setSide} />
          )}
        </div>
        <MapView onReady={ready}>
          {main && range && (
            <div class="map-legend">
              <Legend
                title={difference && change ? t("difference") : (about ? tr(about.label) : "")}
                unit={main.unit}
                layer={main.layer}
                range={range}
              >
                <small>{t("fromSamples", { method: main.method, n: main.samples })}</small>
                {main.note && <small>{main.note}</small>}
              </Legend>
            </div>
          )}
          {other && second.grid && !change && (
            <label class="comparer" style={{ "--split": split }}>
              <span class="unseen">{t("compareSlider")}</span>
              <span class="comparer-line" aria-hidden="true" />
              <input
                type="range"
                min={0}
                max={1}
                step={0.005}
                value={split}
                onInput={(event) => setSplit(event.currentTarget.valueAsNumber)}
              />
            </label>
          )}
          {first.state && (
            <p class="hint" role="status">
              {first.state}
            </p>
          )}
        </MapView>
      </div>
      <aside class="panel" aria-label={t("readingAt")}>
        <Reading at={at} />
        <section class="card flat">
          <div class="card-head">
            <h2>{t("profile")}</h2>
            {points.length > 0 && !drawing ? (
              <button class="button" onClick={() => setPoints([])}>
                {t("clearLine")}
              </button>
            ) : (
              <button
                class="button"
                aria-pressed={drawing}
                onClick={() => {
                  setDrawing(!drawing);
                  if (!drawing) ground.current?.map.getContainer().focus();
                }}
              >
                {drawing ? t("finish") : t("draw")}
              </button>
            )}
          </div>
          {drawing && <p class="quiet">{t("profileHint")}</p>}
          {profile && about && <ProfileChart profile={profile} title={tr(about.label)} />}
        </section>
        <Comparison id={id} other={other} choose={setOther} difference={difference} setDifference={setDifference} />
      </aside>
    </div>
  );
}

/** One range for both maps of a comparison, so that a colour means the same on both sides. */
function together(grid: Grid, second: Grid | null): [number, number] {
  const [low, high] = rangeOf(grid);
  if (grid.layer === "difference") {
    const most = Math.max(Math.abs(low), Math.abs(high));
    return [-most, most];
  }
  if (!second) return [low, high];
  const more = rangeOf(second);
  return [Math.min(low, more[0]), Math.max(high, more[1])];
}

function useGrid(id: string, quantity: string, layer: MapLayer, threshold: number | null, side: string): { grid: Grid | null; state: string } {
  const [grid, setGrid] = useState<Grid | null>(null);
  const [state, setState] = useState("");
  const level = layer === "probability" ? threshold : null;
  useEffect(() => {
    if (!id || !quantity || (layer === "probability" && level === null)) {
      setGrid(null);
      setState("");
      return;
    }
    const stopper = new AbortController();
    let stale = false;
    setState(t("mapping"));
    void api
      .map(id, quantity, layer, level, side, stopper.signal)
      .then((made) => {
        if (stale) return;
        setGrid(made);
        setState("");
      })
      .catch((cause: unknown) => {
        if (stale) return;
        setGrid(null);
        setState(inWords(cause));
      });
    return () => {
      stale = true;
      stopper.abort();
    };
  }, [id, quantity, layer, level, side]);
  return { grid, state };
}

function useDifference(id: string, other: string, quantity: string): Grid | null {
  const [grid, setGrid] = useState<Grid | null>(null);
  useEffect(() => {
    setGrid(null);
    if (!id || !other || !quantity) return;
    let stale = false;
    void api
      .difference(id, other, quantity)
      .then((made) => !stale && setGrid(made))
      .catch((cause: unknown) => !stale && complain(cause));
    return () => {
      stale = true;
    };
  }, [id, other, quantity]);
  return grid;
}

function Threshold(props: {
  value: number | null;
  unit: string;
  change: (value: number | null) => void;
  side: string;
  setSide: (side: string) => void;
}): JSX.Element {
  return (
    <>
      <Select label={t("layerProbability")} value={props.side} change={props.setSide}>
        <option value="above">{t("above")}</option>
        <option value="below">{t("below")}</option>
      </Select>
      <label class="field">
        <span>
          {t("threshold")} <span class="unit">{props.unit}</span>
        </span>
        <input
          type="number"
          step="any"
          value={props.value ?? ""}
          onChange={(event) => {
            const value = event.currentTarget.valueAsNumber;
            props.change(Number.isFinite(value) ? value : null);
          }}
        />
      </label>
    </>
  );
}

function Reading({ at }: { at: { place: LonLat; read: MapAt | string } | null }): JSX.Element {
  return (
    <section class="card flat reading" aria-live="polite">
      <h2>{t("readingAt")}</h2>
      {!at ? (
        <p class="quiet">{t("readMap")}</p>
      ) : typeof at.read === "string" ? (
        <p>{at.read}</p>
      ) : (
        <>
          <p class="big">
            {reading(at.read.mean)} <span class="unit">{at.read.unit}</span>
          </p>
          <p>
            {t("interval")}: {reading(at.read.low)} – {reading(at.read.high)} {at.read.unit}
          </p>
          <p class="quiet">± {reading(at.read.sd)} (1 sd)</p>
        </>
      )}
      {at && (
        <p class="quiet">
          {at.place[1].toFixed(6)}° N, {at.place[0].toFixed(6)}° E
        </p>
      )}
    </section>
  );
}

function ProfileChart({ profile, title }: { profile: Profile; title: string }): JSX.Element {
  const data: AlignedData = [profile.distance_m, profile.low, profile.high, profile.mean];
  return (
    <>
      <Chart
        title={title}
        unit={`${profile.unit} · ${t("interval")}`}
        data={data}
        height={190}
        band={[1, 2]}
        xLabel={(metres) => String(metres)}
        curves={[
          { label: "low", ink: "--band-edge", width: 1 },
          { label: "high", ink: "--band-edge", width: 1 },
          { label: title, ink: "--curve-1" },
        ]}
      />
      <p class="quiet axis-name">{t("along")}</p>
    </>
  );
}

function Comparison(props: {
  id: string;
  other: string;
  choose: (id: string) => void;
  difference: boolean;
  setDifference: (on: boolean) => void;
}): JSX.Element {
  const [surveys, setSurveys] = useState<SurveySummary[]>([]);
  useEffect(() => void api.surveys().then(setSurveys).catch(complain), []);
  const others = surveys.filter((survey) => survey.id !== props.id && survey.samples > 0);
  return (
    <section class="card flat">
      <Select label={t("compare")} value={props.other} change={props.choose}>
        <option value="">{t("compareNone")}</option>
        {others.map((survey) => (
          <option key={survey.id} value={survey.id}>
            {survey.name}
          </option>
        ))}
      </Select>
      {props.other && (
        <label class="sure">
          <input type="checkbox" checked={props.difference} onChange={(event) => props.setDifference(event.currentTarget.checked)} />
          {t("difference")}
        </label>
      )}
    </section>
  );
}
