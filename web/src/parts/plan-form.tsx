/** The settings of a plan, and the figures of the resulting plan. */

import type { ComponentChildren, JSX } from "preact";
import type { PlanPreview, PlanSettings, Problem } from "../api";
import { area, distance, duration, number, options, reading, t, tr } from "../state";
import type { Word } from "../words";

type Change = (settings: PlanSettings) => void;

export function PlanForm({
  settings,
  change,
  problems,
}: {
  settings: PlanSettings;
  change: Change;
  problems: Problem[];
}): JSX.Element {
  const set = <K extends keyof PlanSettings>(key: K, value: PlanSettings[K]): void =>
    change({ ...settings, [key]: value });
  const has = (key: string): boolean => problems.some((problem) => problem.setting === key);
  const numeric = (key: "cell_m" | "speed_min_mps" | "speed_max_mps" | "shore_margin_m", word: Word): JSX.Element => (
    <NumberField
      label={t(word)}
      unit={options.value?.settings[key]?.unit ?? ""}
      value={settings[key]}
      min={options.value?.settings[key]?.min ?? 0}
      max={options.value?.settings[key]?.max ?? 1e6}
      step={key === "cell_m" || key === "shore_margin_m" ? 1 : 0.1}
      bad={has(key)}
      change={(value) => set(key, value)}
    />
  );
  return (
    <form class="fields" onSubmit={(event) => event.preventDefault()}>
      {numeric("cell_m", "cellSize")}
      {numeric("shore_margin_m", "shoreMargin")}
      {numeric("speed_min_mps", "speedMin")}
      {numeric("speed_max_mps", "speedMax")}
      <Select label={t("boat")} value={settings.vessel} change={(value) => set("vessel", value)}>
        {options.value?.vessels.map((vessel) => (
          <option key={vessel.id} value={vessel.id}>
            {tr(vessel.label)}
          </option>
        ))}
      </Select>
      <Select label={t("pattern")} value={settings.pattern} change={(value) => set("pattern", value)}>
        {options.value?.patterns.map((pattern) => (
          <option key={pattern.id} value={pattern.id}>
            {tr(pattern.label)}
          </option>
        ))}
      </Select>
      <OptionalNumber
        label={t("minutes")}
        unit="min"
        value={settings.minutes}
        change={(value) => set("minutes", value)}
      />
      <Weather settings={settings} change={change} />
    </form>
  );
}

function Weather({ settings, change }: { settings: PlanSettings; change: Change }): JSX.Element {
  const current = settings.current ?? { speed_mps: 0, towards_deg: 0 };
  const wind = settings.wind ?? { force_n: 0, from_deg: 0 };
  const setCurrent = (next: typeof current): void =>
    change({ ...settings, current: next.speed_mps > 0 || next.towards_deg ? next : null });
  const setWind = (next: typeof wind): void =>
    change({ ...settings, wind: next.force_n > 0 || next.from_deg ? next : null });
  return (
    <fieldset class="weather">
      <legend>{t("weather")}</legend>
      <NumberField label={t("currentSpeed")} unit="m/s" value={current.speed_mps} min={0} max={3} step={0.05}
        change={(speed_mps) => setCurrent({ ...current, speed_mps })} />
      <NumberField label={t("currentTowards")} unit="°" value={current.towards_deg} min={0} max={360} step={5}
        change={(towards_deg) => setCurrent({ ...current, towards_deg })} />
      <NumberField label={t("windSpeed")} unit="N" value={wind.force_n} min={0} max={200} step={0.5}
        change={(force_n) => setWind({ ...wind, force_n })} />
      <NumberField label={t("windFrom")} unit="°" value={wind.from_deg} min={0} max={360} step={5}
        change={(from_deg) => setWind({ ...wind, from_deg })} />
    </fieldset>
  );
}

export function NumberField(props: {
  label: string;
  unit: string;
  value: number;
  min: number;
  max: number;
  step: number;
  bad?: boolean;
  change: (value: number) => void;
}): JSX.Element {
  return (
    <label class={`field${props.bad ? " bad" : ""}`}>
      <span>
        {props.label} <span class="unit">{props.unit}</span>
      </span>
      <input
        type="number"
        inputMode="decimal"
        value={props.value}
        min={props.min}
        max={props.max}
        step={props.step}
        aria-invalid={props.bad}
        onInput={(event) => {
          const value = event.currentTarget.valueAsNumber;
          if (Number.isFinite(value)) props.change(value);
        }}
      />
    </label>
  );
}

function OptionalNumber(props: {
  label: string;
  unit: string;
  value: number | null;
  change: (value: number | null) => void;
}): JSX.Element {
  return (
    <label class="field">
      <span>
        {props.label} <span class="unit">{props.unit}</span>
      </span>
      <input
        type="number"
        inputMode="numeric"
        min={1}
        value={props.value ?? ""}
        placeholder="–"
        onInput={(event) => {
          const value = event.currentTarget.valueAsNumber;
          props.change(Number.isFinite(value) && value > 0 ? value : null);
        }}
      />
    </label>
  );
}

export function Select(props: {
  label: string;
  value: string;
  change: (value: string) => void;
  children: ComponentChildren;
}): JSX.Element {
  return (
    <label class="field">
      <span>{props.label}</span>
      <select value={props.value} onChange={(event) => props.change(event.currentTarget.value)}>
        {props.children}
      </select>
    </label>
  );
}

export function PlanFacts({
  plan,
  busy,
  failure,
}: {
  plan: PlanPreview | null;
  busy: boolean;
  failure: string;
}): JSX.Element {
  const facts: [Word, string, boolean][] = plan
    ? [
        ["time", duration(plan.time_s), false],
        ["length", distance(plan.length_m), false],
        ["energy", plan.energy_wh === null ? "–" : `${reading(plan.energy_wh)} Wh`, false],
        ["cells", number.value(plan.targets.features.length), false],
        ["samples", number.value(plan.samples), false],
        ["water_area", area(plan.area_m2), false],
        ["outside", `${number.value(plan.outside_m)} m`, plan.outside_m > 0.5],
        ["notCovered", plan.uncovered_m2 < 1 ? "0 m²" : area(plan.uncovered_m2), plan.uncovered_m2 > 0.02 * plan.area_m2],
      ]
    : [];
  return (
    <section class={`facts-box${busy ? " busy" : ""}`} aria-label={t("preview")} aria-busy={busy}>
      {busy && (
        <p class="quiet" role="status">
          {t("planning")}
        </p>
      )}
      {failure && (
        <p class="bad-text" role="alert">
          {failure}
        </p>
      )}
      {plan && plan.problems.length > 0 && (
        <div role="alert" class="bad-text">
          <strong>{t("problems")}</strong>
          <ul>
            {plan.problems.map((problem) => (
              <li key={problem.message}>{problem.message}</li>
            ))}
          </ul>
        </div>
      )}
      {plan && plan.targets.features.length > 0 && (
        <dl class="facts">
          {facts.map(([word, value, warn]) => (
            <div key={word} class={warn ? "warn" : ""}>
              <dt>{t(word)}</dt>
              <dd>{value}</dd>
            </div>
          ))}
        </dl>
      )}
      {plan?.expected_sd && Object.keys(plan.expected_sd).length > 0 && <Expected sds={plan.expected_sd} />}
    </section>
  );
}

function Expected({ sds }: { sds: Record<string, number> }): JSX.Element {
  return (
    <details>
      <summary>{t("expected")}</summary>
      <dl class="facts">
        {Object.entries(sds).map(([id, sd]) => {
          const quantity = options.value?.quantities.find((item) => item.id === id);
          return (
            <div key={id}>
              <dt>{quantity ? tr(quantity.label) : id}</dt>
              <dd>
                ± {reading(sd)} {quantity?.unit ?? ""}
              </dd>
            </div>
          );
        })}
      </dl>
    </details>
  );
}
