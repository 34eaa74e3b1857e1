/** The state of a mission under way: a snapshot, then the changes, over one stream. */

import { signal, type Signal } from "@preact/signals";
import type {
  BoatState,
  Delta,
  Lease,
  LogLine,
  MapNotice,
  SamplePoint,
  Snapshot,
  Status,
  TargetState,
  TrackPoint,
} from "../api";

/** How much of the past the charts keep [s]. */
const KEPT_S = 600;
const LOG_KEPT = 500;
/** Figures change at most this often, as fast as one can read [ms]; the boat moves with each message. */
const PULSE_MS = 250;

/** The last minutes of one boat, and its present state. */
export interface Afloat extends BoatState {
  pushes: [number, number, number][];
}

/** The boats of a snapshot; a survey by one boat gives that boat. */
function afloatOf(snapshot: Snapshot): Afloat[] {
  const boats = snapshot.boats.length ? snapshot.boats : [{ ...snapshot, boat: 1 }];
  return boats.map((boat) => ({
    ...boat,
    samples: [...boat.samples],
    track: boat.track.slice(-6000),
    pushes: [],
  }));
}

export interface Hearing {
  snapshot(snapshot: Snapshot): void;
  delta(delta: Delta): void;
}

export class Stream {
  readonly snapshot: Signal<Snapshot | null> = signal(null);
  readonly status: Signal<Status | null> = signal(null);
  readonly lease: Signal<Lease> = signal({ holder: null, since: null });
  readonly events: Signal<LogLine[]> = signal([]);
  readonly mapVersion: Signal<number> = signal(0);
  readonly connected: Signal<boolean> = signal(true);
  /** Counts up a few times a second while messages arrive; displayed figures depend on it. */
  readonly pulse: Signal<number> = signal(0);
  /** Counts the messages. */
  beat = 0;

  /** The boats by their numbers, and the selected one. */
  readonly boats = new Map<number, Afloat>();
  readonly chosen: Signal<number> = signal(1);
  readonly states = new Map<number, TargetState>();

  private source: EventSource | null = null;
  private retry = 0;
  private heard = 0;
  private watch = 0;
  private pulseDue = 0;
  private latest: Status | null = null;
  private readonly ears = new Set<Hearing>();

  constructor(private readonly url: string) {}

  /** The selected boat; null before the first snapshot. */
  get boat(): Afloat | null {
    return this.boats.get(this.chosen.value) ?? null;
  }

  get samples(): readonly SamplePoint[] {
    return this.boat?.samples ?? [];
  }

  get track(): readonly TrackPoint[] {
    return this.boat?.track ?? [];
  }

  get pushes(): readonly [number, number, number][] {
    return this.boat?.pushes ?? [];
  }

  /** Select another boat. */
  choose(boat: number): void {
    this.chosen.value = boat;
    this.heartbeat();
  }

  open(): void {
    this.connect();
    this.watch = window.setInterval(() => this.look(), 2000);
  }

  close(): void {
    this.source?.close();
    this.source = null;
    clearTimeout(this.retry);
    clearInterval(this.watch);
    clearTimeout(this.pulseDue);
  }

  hear(hearing: Hearing): () => void {
    this.ears.add(hearing);
    const snapshot = this.snapshot.peek();
    if (snapshot) hearing.snapshot(snapshot);
    return () => this.ears.delete(hearing);
  }

  private connect(): void {
    const source = new EventSource(this.url);
    this.source = source;
    const on = (name: string, act: (data: string) => void): void => {
      source.addEventListener(name, (event) => {
        this.heard = performance.now();
        this.connected.value = true;
        act((event as MessageEvent<string>).data);
      });
    };
    on("snapshot", (data) => this.onSnapshot(JSON.parse(data) as Snapshot));
    on("delta", (data) => this.onDelta(JSON.parse(data) as Delta));
    on("lease", (data) => {
      this.lease.value = JSON.parse(data) as Lease;
    });
    on("map", (data) => {
      this.mapVersion.value = (JSON.parse(data) as MapNotice).version;
    });
    source.onerror = () => {
      this.connected.value = false;
      // After a refusal the browser does not reconnect by itself.
      if (source.readyState === EventSource.CLOSED) this.again();
    };
  }

  private again(): void {
    this.source?.close();
    clearTimeout(this.retry);
    this.retry = window.setTimeout(() => this.connect(), 2000);
  }

  /** Reconnect if the stream is open but silent while the boat is under way. */
  private look(): void {
    const state = this.status.peek()?.state;
    if (state !== "running" && state !== "returning") return;
    if (this.source?.readyState === EventSource.OPEN && performance.now() - this.heard > 15_000) {
      this.connected.value = false;
      this.again();
    }
  }

  private onSnapshot(snapshot: Snapshot): void {
    this.boats.clear();
    for (const boat of afloatOf(snapshot)) this.boats.set(boat.boat, boat);
    this.states.clear();
    for (const target of snapshot.targets) this.states.set(target.seq, target.state);
    this.snapshot.value = snapshot;
    this.status.value = snapshot.status;
    this.latest = snapshot.status;
    this.lease.value = snapshot.lease;
    this.events.value = snapshot.events;
    this.mapVersion.value = snapshot.map_version;
    for (const ear of this.ears) ear.snapshot(snapshot);
    this.heartbeat();
  }

  private onDelta(delta: Delta): void {
    const boat = this.boats.get(delta.boat ?? 1);
    if (boat) take(boat, delta);
    for (const [seq, state] of delta.targets ?? []) this.states.set(seq, state);
    const status = this.latest ?? this.status.peek();
    if (delta.status && status) this.tell({ ...status, ...delta.status });
    if (delta.events?.length)
      this.events.value = [...this.events.peek(), ...delta.events].slice(-LOG_KEPT);
    this.forget(delta.t - KEPT_S);
    for (const ear of this.ears) ear.delta(delta);
    this.heartbeat();
  }

  /** Show a change of what the boat does at once; figures follow a few times a second. */
  private tell(status: Status): void {
    this.latest = status;
    const shown = this.status.peek();
    if (shown?.state !== status.state || shown.doing !== status.doing) this.status.value = status;
  }

  private heartbeat(): void {
    this.beat++;
    if (this.pulseDue) return;
    this.pulseDue = window.setTimeout(() => {
      this.pulseDue = 0;
      if (this.latest) this.status.value = this.latest;
      this.pulse.value++;
    }, PULSE_MS);
  }

  private forget(before: number): void {
    for (const { samples, track, pushes } of this.boats.values())
      for (const kept of [samples, track, pushes] as [number, ...unknown[]][][]) {
        // Drop many at once, seldom: removing one from the front of an array each time is slow.
        if ((kept[0]?.[0] ?? Infinity) > before - 60) continue;
        const first = kept.findIndex((item) => item[0] >= before);
        kept.splice(0, first < 0 ? kept.length : first);
      }
  }
}

/** Apply the changes to a boat. */
function take(boat: Afloat, delta: Delta): void {
  if (delta.estimate) boat.estimate = delta.estimate;
  if (delta.thrusts) {
    boat.thrusts = delta.thrusts;
    boat.pushes.push([delta.t, ...delta.thrusts]);
  }
  if (delta.current !== undefined) boat.current = delta.current;
  if (delta.wind !== undefined) boat.wind = delta.wind;
  if (delta.horizon) boat.horizon = delta.horizon;
  if (delta.track) boat.track.push(...delta.track);
  if (delta.samples) boat.samples.push(...delta.samples);
  if (delta.own ?? delta.status) boat.status = { ...boat.status, ...(delta.own ?? delta.status) };
}
