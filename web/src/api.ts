/**
 * The contract between the page and the server: every request, answer and message, with types.
 *
 * Positions are [longitude, latitude] in degrees (WGS 84), GeoJSON order; angles in radians,
 * clockwise from north; times are ISO 8601 in UTC; `t` and `*_s` are seconds. An unknown value is
 * null, never NaN.
 */

export type LonLat = [number, number];
export interface Label {
  en: string;
  fr: string;
}

export type SurveyState =
  | "planned" // never run
  | "running"
  | "paused"
  | "returning"
  | "stopped" // by its operator: can be resumed
  | "interrupted" // ended early for another reason: can be resumed
  | "complete"
  | "imported"; // samples without a plan

/** GET /api/surveys, and POST /api/surveys, /api/demo, /api/plan answer with one of these. */
export interface SurveySummary {
  id: string;
  name: string;
  created: string;
  state: SurveyState;
  cells: number;
  reached: number;
  samples: number;
  area_m2: number;
}

export interface Quantity {
  id: string;
  label: Label;
  unit: string;
  /** Threshold of concern, if there is a customary one, and the side of it that is of concern. */
  threshold: number | null;
  side: "above" | "below";
}

export interface Choice {
  id: string;
  label: Label;
}

export interface NumberSetting {
  unit: string;
  default: number;
  min: number;
  max: number;
}

/** A user's tiles, served by the server itself: GET /api/background/{z}/{x}/{y} -> image. */
export interface Background {
  name: string;
  min_zoom: number;
  max_zoom: number;
  bounds: [number, number, number, number] | null; // west, south, east, north
  attribution: string;
}

/** GET /api/options */
export interface Options {
  version: string;
  vessels: (Choice & { speed_max_mps: number })[];
  patterns: Choice[];
  rules: Choice[];
  quantities: Quantity[];
  settings: Record<string, NumberSetting>; // cell_m, speed_min_mps, speed_max_mps, rate, …
  background: Background | null;
}

export interface Polygon {
  type: "Polygon";
  coordinates: LonLat[][]; // outer ring, then holes: islands
}
export interface MultiPolygon {
  type: "MultiPolygon";
  coordinates: LonLat[][][];
}
export interface LineString {
  type: "LineString";
  coordinates: LonLat[];
}
export type Area = Polygon | MultiPolygon;

export interface Feature<G, P> {
  type: "Feature";
  geometry: G;
  properties: P;
}
export interface FeatureCollection<G, P> {
  type: "FeatureCollection";
  features: Feature<G, P>[];
}

export interface PlanSettings {
  cell_m: number;
  pattern: string;
  speed_min_mps: number;
  speed_max_mps: number;
  vessel: string;
  start: LonLat | null;
  shore_margin_m: number;
  /** Water that the boat keeps out of, in addition to the islands of the region. */
  no_go: MultiPolygon | null;
  /** The direction that the water flows towards. */
  current: { speed_mps: number; towards_deg: number } | null;
  /** The direction that the wind blows from, and its force on the boat. */
  wind: { force_n: number; from_deg: number } | null;
  minutes: number | null;
}

/** POST /api/plan/preview and, with `name`, POST /api/plan */
export interface PlanRequest {
  region: Area;
  settings: PlanSettings;
  name?: string;
}

export interface Problem {
  setting: string;
  message: string;
}

/** Answer of POST /api/plan/preview. If there is no plan, `problems` says why and `targets` is empty. */
export interface PlanPreview {
  targets: FeatureCollection<Polygon, { seq: number }>;
  route: LineString;
  length_m: number;
  time_s: number;
  energy_wh: number | null;
  samples: number;
  area_m2: number;
  expected_sd: Record<string, number> | null; // by quantity
  uncovered: Area | null;
  uncovered_m2: number;
  outside_m: number; // length of the route outside the region
  problems: Problem[];
}

/** GET /api/surveys/{id} */
export interface SurveyDetail extends SurveySummary {
  region: Area;
  targets: Target[];
  route: LineString | null;
  settings: PlanSettings | null;
  quantities: Quantity[];
  link: string | null; // of the last run
  bounds: [number, number, number, number];
}

/** GET /api/surveys/{id}/preflight?link= */
export interface PreflightLine {
  line: Label;
  ok: boolean | null; // null: neither good nor bad
  detail: string;
  advice: string;
}

/** POST /api/surveys/{id}/run */
export interface RunRequest {
  link: string; // "simulated", or as grebe run --link
  rule?: string;
  weather?: { current: PlanSettings["current"]; wind: PlanSettings["wind"] };
  rate: number; // how many times faster than real time, simulated; 1 on a real boat
  resume?: boolean; // continue where the survey was left
  force?: boolean; // begin anew, and delete the measurements
  confirm?: boolean; // required for a real boat
}

export type Command = "pause" | "continue" | "return" | "stop";

export type TargetState = "open" | "current" | "reached" | "given_up";

export interface Target {
  seq: number;
  ring: LonLat[];
  state: TargetState;
}

export interface Estimate {
  lon: number;
  lat: number;
  heading_rad: number;
  surge_mps: number;
  sway_mps: number;
  yaw_rate_radps: number;
}

export interface Status {
  state: SurveyState;
  /** What the boat does now, in the mission loop's words: surveying, holding, returning, … */
  doing: string;
  t: number; // seconds of the boat's time since the mission began
  time: string | null;
  link: string | null;
  link_age_s: number | null;
  battery: { volt: number | null; fraction: number | null } | null;
  solve_ms: number | null;
  fix: string | null;
  eta_s: number | null;
  coverage: number; // 0..1
  reached: number;
  targets: number;
  samples: number;
  rate: number;
}

export interface LogLine {
  t: number;
  time: string;
  level: "info" | "warning" | "error";
  code: string;
  message: string;
}

/** [t, lon, lat, surge_mps] */
export type TrackPoint = [number, number, number, number];
/** [t, lon, lat, values in the order of `quantities`] */
export type SamplePoint = [number, number, number, (number | null)[]];
/** [t, north_mps, east_mps] : the direction that it flows or blows towards */
export interface Flow {
  north_mps: number;
  east_mps: number;
}

export interface Lease {
  /** Who steers: "you", "other" or nobody. */
  holder: "you" | "other" | null;
  since: string | null;
}

/** The state of one boat of a fleet, by its number. */
export interface BoatState {
  boat: number;
  estimate: Estimate | null;
  thrusts: [number, number] | null;
  horizon: LonLat[];
  current: Flow | null;
  wind: Flow | null;
  track: TrackPoint[];
  samples: SamplePoint[];
  /** Its own status, for its part of the survey; empty until the boat is heard. */
  status: Partial<Status>;
}

/** First event of GET /api/surveys/{id}/events (SSE), `event: snapshot`. */
export interface Snapshot {
  id: string;
  name: string;
  region: Area;
  bounds: [number, number, number, number];
  targets: Target[];
  route: LineString | null;
  quantities: Quantity[];
  speed_window: [number, number];
  thrust_limit_n: [number, number];
  track: TrackPoint[]; // decimated
  samples: SamplePoint[]; // of the last ten minutes at most
  estimate: Estimate | null;
  thrusts: [number, number] | null;
  horizon: LonLat[];
  current: Flow | null;
  wind: Flow | null;
  status: Status;
  /** The boats of a fleet, whose own entries beside this one are then empty; [] for one boat. */
  boats: BoatState[];
  events: LogLine[];
  lease: Lease;
  map_version: number;
}

/** `event: delta`, at most 10 Hz: only what changed. */
export interface Delta {
  t: number;
  /** When the oldest of this was heard from the boat, unix seconds of the mission's computer. */
  heard: number;
  estimate?: Estimate;
  thrusts?: [number, number];
  horizon?: LonLat[];
  targets?: [number, TargetState][];
  track?: TrackPoint[];
  samples?: SamplePoint[];
  current?: Flow | null;
  wind?: Flow | null;
  status?: Partial<Status>;
  events?: LogLine[];
  /** For a fleet: the boat of this delta, and its own status; `status` is then the fleet's. */
  boat?: number;
  own?: Partial<Status>;
}

/** `event: map`: the map of a quantity has a new version; fetch it when it is shown. */
export interface MapNotice {
  quantity: string;
  version: number;
}
/** `event: lease` carries a Lease; comments (`: keep`) arrive at least every 5 s. */

export type MapLayer = "mean" | "sd" | "probability" | "quality";

/**
 * GET /api/surveys/{id}/map?quantity=&layer=&threshold=&side=above|below
 * and GET /api/surveys/{id}/map/diff?other=ID&quantity=
 *
 * A grid in a metric frame, given by its corners: `values` is base64 of little-endian float32,
 * row by row from the south-west corner, NaN off the water.
 */
export interface Grid {
  quantity: string;
  layer: MapLayer | "difference";
  nx: number;
  ny: number;
  /** Corners of the grid's outer edges: south-west, south-east, north-east, north-west. */
  corners: [LonLat, LonLat, LonLat, LonLat];
  values: string;
  range: [number, number] | null;
  levels: number[];
  unit: string;
  version: number;
  method: string;
  samples: number;
  /** A sentence about the state of the map, such as that it is still forming. */
  note: string | null;
}

/** GET /api/surveys/{id}/map/at?quantity=&lon=&lat= ; 404 off the water */
export interface MapAt {
  mean: number;
  sd: number;
  low: number; // 95 % interval
  high: number;
  unit: string;
}

/** GET /api/surveys/{id}/map/profile?quantity=&line=lon,lat;lon,lat;… */
export interface Profile {
  distance_m: number[];
  mean: (number | null)[];
  low: (number | null)[];
  high: (number | null)[];
  unit: string;
}

/** POST /api/outline?name=&islands=&crs= : how a file of outlines is to be read */
export interface OutlineReading {
  islands: "named" | "all" | "none";
  crs: string;
}

/** GET /api/surveys/{id}/replay : columns of equal length */
export interface Replay {
  track: { t: number[]; lon: number[]; lat: number[]; heading_rad: number[]; surge_mps: number[] };
  samples: { t: number[]; lon: number[]; lat: number[]; values: Record<string, (number | null)[]> };
  reached: { t: number[]; seq: number[] };
  events: LogLine[];
}

export interface ErrorBody {
  error: { code: string; message: string; setting?: string };
}

export class ApiError extends Error {
  constructor(
    readonly status: number,
    readonly code: string,
    message: string,
    readonly setting: string | null,
  ) {
    super(message);
  }
}

/** The name of this tab, by which the lease knows it; a reload keeps it. */
function tabName(): string {
  const kept = sessionStorage.getItem("grebe-tab");
  if (kept) return kept;
  const made = Array.from(crypto.getRandomValues(new Uint32Array(4)), (n) => n.toString(36)).join("");
  sessionStorage.setItem("grebe-tab", made);
  return made;
}

const tab = tabName();

async function ask<T>(path: string, init: RequestInit = {}): Promise<T> {
  let answer: Response;
  const headers = { ...init.headers, "X-Grebe-Tab": tab };
  try {
    answer = await fetch(`/api${path}`, { credentials: "same-origin", ...init, headers });
  } catch (cause) {
    if (cause instanceof DOMException && cause.name === "AbortError") throw cause;
    throw new ApiError(0, "unreachable", "unreachable", null);
  }
  if (answer.status === 204) return undefined as T;
  const body: unknown = await answer.json().catch(() => null);
  if (!answer.ok) {
    const error = (body as ErrorBody | null)?.error;
    throw new ApiError(
      answer.status,
      error?.code ?? String(answer.status),
      error?.message ?? answer.statusText,
      error?.setting ?? null,
    );
  }
  return body as T;
}

function post<T>(path: string, body: unknown, signal?: AbortSignal): Promise<T> {
  return ask<T>(path, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(body),
    ...(signal ? { signal } : {}),
  });
}

function query(values: Record<string, string | number | null | undefined>): string {
  const pairs = Object.entries(values).filter(([, value]) => value !== null && value !== undefined);
  return new URLSearchParams(pairs.map(([key, value]) => [key, String(value)])).toString();
}

const at = (id: string): string => `/surveys/${encodeURIComponent(id)}`;

export const api = {
  options: () => ask<Options>("/options"),
  surveys: () => ask<SurveySummary[]>("/surveys"),
  survey: (id: string) => ask<SurveyDetail>(at(id)),
  upload: (file: File) =>
    ask<SurveySummary>(`/surveys?${query({ name: file.name })}`, {
      method: "POST",
      headers: { "Content-Type": "application/octet-stream" },
      body: file,
    }),
  /** Convert an outline in any format that Grebe reads to GeoJSON, for the plan. */
  outline: (file: File, reading: OutlineReading) =>
    ask<{ region: Area; name: string; notes: string[] }>(
      `/outline?${query({ name: file.name, ...reading })}`,
      {
        method: "POST",
        headers: { "Content-Type": "application/octet-stream" },
        body: file,
      },
    ),
  demo: () => post<SurveySummary>("/demo", {}),
  remove: (id: string) => ask<void>(at(id), { method: "DELETE" }),
  fileUrl: (id: string) => `/api${at(id)}/file`,
  preview: (request: PlanRequest, signal: AbortSignal) =>
    post<PlanPreview>("/plan/preview", request, signal),
  plan: (request: PlanRequest) => post<SurveySummary>("/plan", request),
  preflight: (id: string, link: string) =>
    ask<PreflightLine[]>(`${at(id)}/preflight?${query({ link })}`),
  run: (id: string, request: RunRequest) => post<Status>(`${at(id)}/run`, request),
  command: (id: string, command: Command) => post<Status>(`${at(id)}/${command}`, {}),
  lease: (take: boolean) => post<Lease>("/lease", { take }),
  eventsUrl: (id: string) => `/api${at(id)}/events?${query({ tab })}`,
  map: (
    id: string,
    quantity: string,
    layer: MapLayer,
    threshold: number | null,
    side: string,
    signal: AbortSignal,
  ) => ask<Grid>(`${at(id)}/map?${query({ quantity, layer, threshold, side })}`, { signal }),
  mapAt: (id: string, quantity: string, [lon, lat]: LonLat) =>
    ask<MapAt>(`${at(id)}/map/at?${query({ quantity, lon, lat })}`),
  profile: (id: string, quantity: string, line: LonLat[]) =>
    ask<Profile>(
      `${at(id)}/map/profile?${query({ quantity, line: line.map((p) => p.join(",")).join(";") })}`,
    ),
  difference: (id: string, other: string, quantity: string) =>
    ask<Grid>(`${at(id)}/map/diff?${query({ other, quantity })}`),
  replay: (id: string) => ask<Replay>(`${at(id)}/replay`),
  makeReport: (id: string, language: string) => post<{ made: string }>(`${at(id)}/report`, { language }),
  reportUrl: (id: string) => `/api${at(id)}/report`,
};
