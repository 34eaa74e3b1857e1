/** Replay: the recorded mission, from any time, up to sixty times as fast. */

import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import type { JSX } from "preact";
import { api, type Replay as Recorded, type SurveyDetail } from "../api";
import { fit, MapView, type Ground } from "../map/view";
import { EventList } from "../parts/live-panel";
import { Select } from "../parts/plan-form";
import { complain, duration, reading, t, tr } from "../state";

const rates = [1, 2, 5, 10, 20, 60];

/** The last index of an ascending column whose value is at most `t`; -1 before the first. */
function placeOf(column: number[], t: number): number {
  let low = 0;
  let high = column.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if ((column[middle] ?? Infinity) <= t) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

export function Replay({ id }: { id: string }): JSX.Element {
  const ground = useRef<Ground | null>(null);
  const [survey, setSurvey] = useState<SurveyDetail | null>(null);
  const [recorded, setRecorded] = useState<Recorded | null>(null);
  const [at, setAt] = useState(0);
  const [rate, setRate] = useState(10);
  const [playing, setPlaying] = useState(false);
  useEffect(() => {
    void Promise.all([api.survey(id), api.replay(id)])
      .then(([made, columns]) => {
        setSurvey(made);
        setRecorded(columns);
        const water = ground.current?.water;
        if (!ground.current || !water) return;
        water.setRegion(made.region);
        water.setCells(
          made.targets.map((target) => target.ring),
          made.targets.map(() => "open" as const),
        );
        fit(ground.current, made.bounds);
      })
      .catch(complain);
  }, [id]);

  const first = recorded?.track.t[0] ?? 0;
  const last = recorded?.track.t[recorded.track.t.length - 1] ?? 0;
  useEffect(() => setAt(first), [first]);
  useEffect(() => {
    if (!playing) return;
    let before = performance.now();
    let frame = requestAnimationFrame(function step(now) {
      const passed = ((now - before) / 1000) * rate;
      before = now;
      setAt((old) => Math.min(last, old + passed));
      frame = requestAnimationFrame(step);
    });
    return () => cancelAnimationFrame(frame);
  }, [playing, rate, last]);
  useEffect(() => {
    if (playing && at >= last) setPlaying(false);
  }, [at, playing, last]);

  const shown = useRef({ track: -1, cells: -1 });
  const places = useMemo(() => new Map(survey?.targets.map((target, i) => [target.seq, i])), [survey]);
  useEffect(() => {
    if (ground.current && recorded && survey) paintAt(ground.current, recorded, survey, places, at, shown.current);
  }, [at, recorded, survey]);

  const sample = recorded ? placeOf(recorded.samples.t, at) : -1;
  const spot = recorded ? placeOf(recorded.track.t, at) : -1;
  return (
    <div class="split">
      <div class="stage">
        <MapView
          onReady={(made) => {
            ground.current = made;
          }}
        />
        <div class="scrubber">
          <button
            class="button primary"
            disabled={!recorded || last <= first}
            onClick={() => {
              if (at >= last) setAt(first);
              setPlaying(!playing);
            }}
          >
            {playing ? t("pause") : t("play")}
          </button>
          <label class="scrub">
            <span class="unseen">{t("when")}</span>
            <input
              type="range"
              min={first}
              max={last}
              step={0.1}
              value={at}
              aria-valuetext={duration(at)}
              onInput={(event) => setAt(event.currentTarget.valueAsNumber)}
            />
            <Marks recorded={recorded} first={first} last={last} />
          </label>
          <output>
            {duration(at)} / {duration(last)}
          </output>
          <Select label={t("speed")} value={String(rate)} change={(value) => setRate(Number(value))}>
            {rates.map((item) => (
              <option key={item} value={String(item)}>
                {item} ×
              </option>
            ))}
          </Select>
        </div>
      </div>
      <aside class="panel" aria-label={t("replay")}>
        <h1>
          {t("replay")} <span class="quiet">{survey?.name ?? ""}</span>
        </h1>
        {recorded && recorded.track.t.length === 0 && <p>{t("noReplay")}</p>}
        <dl class="facts">
          <div>
            <dt>{t("speed")}</dt>
            <dd>{reading(recorded?.track.surge_mps[spot])} m/s</dd>
          </div>
          {survey?.quantities.map((quantity) => (
            <div key={quantity.id}>
              <dt>{tr(quantity.label)}</dt>
              <dd>
                {reading(recorded?.samples.values[quantity.id]?.[sample])} <span class="unit">{quantity.unit}</span>
              </dd>
            </div>
          ))}
        </dl>
        <section class="events">
          <h2>{t("events")}</h2>
          {recorded && <EventList events={recorded.events} go={setAt} />}
        </section>
      </aside>
    </div>
  );
}

function Marks({ recorded, first, last }: { recorded: Recorded | null; first: number; last: number }): JSX.Element {
  const told = recorded?.events.filter((event) => event.level !== "info").slice(0, 200) ?? [];
  return (
    <span class="scrub-marks" aria-hidden="true">
      {told.map((event, i) => (
        <i key={i} class={event.level} style={{ left: `${(100 * (event.t - first)) / Math.max(1, last - first)}%` }} />
      ))}
    </span>
  );
}

function paintAt(
  { water }: Ground,
  recorded: Recorded,
  survey: SurveyDetail,
  places: Map<number, number>,
  at: number,
  shown: { track: number; cells: number },
): void {
  const { track, reached } = recorded;
  const spot = placeOf(track.t, at);
  const point = (i: number): [number, number] => [track.lon[i] ?? 0, track.lat[i] ?? 0];
  const range = (from: number, to: number): [number, number][] =>
    Array.from({ length: Math.max(0, to - from + 1) }, (_, i) => point(from + i));
  if (spot < shown.track || shown.track < 0) water.setTrack(range(0, spot));
  else if (spot > shown.track) water.addTrack(range(shown.track + 1, spot));
  shown.track = spot;
  const done = placeOf(reached.t, at);
  if (done < shown.cells)
    water.setCells(
      survey.targets.map((target) => target.ring),
      survey.targets.map(() => "open" as const),
    );
  const from = done < shown.cells ? 0 : shown.cells + 1;
  for (let i = from; i <= done; i++) {
    const place = places.get(reached.seq[i] ?? -1);
    if (place !== undefined) water.setState(place, "reached");
  }
  shown.cells = done;
  water.setBoat(
    spot < 0 ? null : { lon: track.lon[spot] ?? 0, lat: track.lat[spot] ?? 0, heading_rad: track.heading_rad[spot] ?? 0 },
    [],
  );
}
