/** Preflight: the checks before a mission, and its settings. */

import { useEffect, useState } from "preact/hooks";
import type { JSX } from "preact";
import { api, type PreflightLine, type SurveyDetail } from "../api";
import { NumberField, Select } from "../parts/plan-form";
import { chosen, complain, go, options, t, tr } from "../state";

export function Preflight({ id }: { id: string }): JSX.Element {
  const [survey, setSurvey] = useState<SurveyDetail | null>(null);
  const [real, setReal] = useState(false);
  const [address, setAddress] = useState("mavlink:udp:0.0.0.0:14550");
  const [rule, setRule] = useState(options.value?.rules[0]?.id ?? "");
  const [rate, setRate] = useState(options.value?.settings["rate"]?.default ?? 10);
  const [sure, setSure] = useState(false);
  const [lines, setLines] = useState<PreflightLine[] | null>(null);
  const [busy, setBusy] = useState(false);
  const [forgets, setForgets] = useState(false);
  const link = real ? address : "simulated";

  useEffect(() => void api.survey(id).then(setSurvey).catch(complain), [id]);
  const check = async (): Promise<void> => {
    setLines(null);
    try {
      setLines(await api.preflight(id, link));
    } catch (cause) {
      complain(cause);
      setLines([]);
    }
  };
  useEffect(() => {
    setSure(false);
    if (!real) void check();
    else setLines([]);
  }, [id, real]);

  async function run(resume: boolean): Promise<void> {
    setBusy(true);
    try {
      await api.run(id, { link, rate: real ? 1 : rate, resume, force: !resume && recorded, confirm: real ? sure : true, ...(rule ? { rule } : {}) });
      go("live", id);
    } catch (cause) {
      complain(cause);
      setBusy(false);
    }
  }

  /** Begin the mission; deleting earlier measurements needs a second press. */
  function begin(): void {
    if (recorded && !forgets) {
      setForgets(true);
      setTimeout(() => setForgets(false), 4000);
    } else void run(false);
  }

  const again = survey?.state === "stopped" || survey?.state === "interrupted";
  const recorded = again || survey?.state === "complete";
  const bad = lines?.filter((line) => line.ok === false).length ?? 0;
  return (
    <div class="page preflight-page">
      <h1>
        {t("preflight")} <span class="quiet">{survey?.name ?? chosen.value?.name ?? ""}</span>
      </h1>
      <section class="card">
        <fieldset class="choice">
          <legend>{t("link")}</legend>
          <label>
            <input type="radio" name="link" checked={!real} onChange={() => setReal(false)} />
            {t("simulated")}
          </label>
          <label>
            <input type="radio" name="link" checked={real} onChange={() => setReal(true)} />
            {t("realBoat")}
          </label>
        </fieldset>
        <div class="fields">
          {real ? (
            <label class="field wide">
              <span>{t("address")}</span>
              <input value={address} spellcheck={false} onInput={(event) => setAddress(event.currentTarget.value)} />
            </label>
          ) : (
            <NumberField
              label={t("rate")}
              unit="×"
              value={rate}
              min={options.value?.settings["rate"]?.min ?? 1}
              max={options.value?.settings["rate"]?.max ?? 100}
              step={1}
              change={setRate}
            />
          )}
          <Select label={t("rule")} value={rule} change={setRule}>
            {options.value?.rules.map((item) => (
              <option key={item.id} value={item.id}>
                {tr(item.label)}
              </option>
            ))}
          </Select>
        </div>
      </section>
      <section class="card" aria-live="polite" aria-busy={lines === null}>
        <div class="card-head">
          <h2>{lines === null ? t("checking") : lines.length === 0 ? t("preflight") : bad ? t("notGood", { n: bad }) : t("allGood")}</h2>
          <button class="button" disabled={lines === null} onClick={() => void check()}>
            {t("check")}
          </button>
        </div>
        <ul class="lines">
          {lines?.map((line) => (
            <li key={line.line.en} class={line.ok === null ? "note" : line.ok ? "good" : "bad"}>
              <span class="mark">{line.ok === null ? t("note") : line.ok ? t("good") : t("bad")}</span>
              <span class="line-text">
                <strong>{tr(line.line)}</strong> <span>{line.detail}</span>
                {line.advice && <small>{line.advice}</small>}
              </span>
            </li>
          ))}
        </ul>
      </section>
      {real && (
        <label class="sure">
          <input type="checkbox" checked={sure} onChange={(event) => setSure(event.currentTarget.checked)} />
          {t("confirmReal")}
        </label>
      )}
      <div class="acts">
        {again && (
          <button class="button primary tall" disabled={busy || (real && !sure)} onClick={() => void run(true)}>
            {t("resume")}
          </button>
        )}
        <button
          class={`button tall${recorded ? (forgets ? " danger" : "") : " primary"}`}
          disabled={busy || !survey || (real && !sure)}
          onClick={begin}
        >
          {forgets ? t("restartSure") : recorded ? t("restart") : t("launch")}
        </button>
      </div>
    </div>
  );
}
