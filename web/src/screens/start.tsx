/** Start: the existing surveys, and how to make a new one. */

import { useEffect, useRef, useState } from "preact/hooks";
import type { JSX } from "preact";
import { api, type SurveyState, type SurveySummary } from "../api";
import { Icon, type IconName } from "../parts/icon";
import { Wishes } from "../parts/wishes";
import { area, chosen, complain, go, language, number, say, t, type Screen } from "../state";

const next: Record<SurveyState, Screen> = {
  planned: "preflight",
  running: "live",
  paused: "live",
  returning: "live",
  stopped: "live",
  interrupted: "live",
  complete: "map",
  imported: "map",
};

export function Start(): JSX.Element {
  const [surveys, setSurveys] = useState<SurveySummary[] | null>(null);
  const [over, setOver] = useState(false);
  const [busy, setBusy] = useState(false);
  const load = (): Promise<void> => api.surveys().then(setSurveys).catch(complain);
  useEffect(() => {
    void load();
    const timer = setInterval(() => void load(), 10_000);
    return () => clearInterval(timer);
  }, []);

  async function open(asked: Promise<SurveySummary>, screen?: Screen): Promise<void> {
    setBusy(true);
    try {
      const survey = await asked;
      choose(survey, screen);
    } catch (cause) {
      complain(cause);
    } finally {
      setBusy(false);
    }
  }

  function drop(event: DragEvent): void {
    event.preventDefault();
    setOver(false);
    const file = event.dataTransfer?.files[0];
    if (file) void open(api.upload(file));
  }

  return (
    <div
      class={`page start-page${over ? " over" : ""}`}
      onDragOver={(event) => {
        event.preventDefault();
        setOver(true);
      }}
      onDragLeave={() => setOver(false)}
      onDrop={drop}
    >
      <header>
        <h1>{t("welcome")}</h1>
        <p class="lead">{t("welcomeText")}</p>
      </header>
      <div class="ways" aria-busy={busy}>
        <Way icon="draw" title={t("newPlan")} text={t("newPlanText")} primary act={() => go("plan")} />
        <Way
          icon="boat"
          title={t("demo")}
          text={t("demoText")}
          act={() => void open(api.demo(), "preflight")}
        />
        <FileWay act={(file) => void open(api.upload(file))} />
      </div>
      <h2>{t("recent")}</h2>
      {surveys === null ? (
        <p role="status">{t("loading")}</p>
      ) : surveys.length === 0 ? (
        <p class="empty">{t("noSurveys")}</p>
      ) : (
        <ul class="surveys">
          {surveys.map((survey) => (
            <Row key={survey.id} survey={survey} changed={load} />
          ))}
        </ul>
      )}
      <Wishes />
    </div>
  );
}

function choose(survey: SurveySummary, screen?: Screen): void {
  chosen.value = { id: survey.id, name: survey.name };
  go(screen ?? next[survey.state], survey.id);
}

function Way(props: {
  icon: IconName;
  title: string;
  text: string;
  primary?: boolean;
  act: () => void;
}): JSX.Element {
  return (
    <button class={`way${props.primary ? " primary" : ""}`} onClick={props.act}>
      <Icon name={props.icon} />
      <span>
        <strong>{props.title}</strong>
        <small>{props.text}</small>
      </span>
    </button>
  );
}

function FileWay({ act }: { act: (file: File) => void }): JSX.Element {
  const input = useRef<HTMLInputElement>(null);
  return (
    <>
      <Way icon="file" title={t("openFile")} text={t("openFileText")} act={() => input.current?.click()} />
      <input
        ref={input}
        type="file"
        class="unseen"
        aria-label={t("openFile")}
        tabIndex={-1}
        onChange={(event) => {
          const file = event.currentTarget.files?.[0];
          event.currentTarget.value = "";
          if (file) act(file);
        }}
      />
    </>
  );
}

function Row({ survey, changed }: { survey: SurveySummary; changed: () => Promise<void> }): JSX.Element {
  const [sure, setSure] = useState(false);
  const share = survey.cells ? survey.reached / survey.cells : 0;
  async function remove(): Promise<void> {
    if (!sure) {
      setSure(true);
      setTimeout(() => setSure(false), 4000);
      return;
    }
    try {
      await api.remove(survey.id);
      if (chosen.value?.id === survey.id) chosen.value = null;
      say("info", t("removed", { name: survey.name }));
      await changed();
    } catch (cause) {
      complain(cause);
    }
  }
  const made = new Date(survey.created);
  return (
    <li class="survey">
      <button class="survey-open" onClick={() => choose(survey)}>
        <span class="survey-name">{survey.name}</span>
        <span class={`badge ${survey.state}`}>{t(`state_${survey.state}`)}</span>
        <span class="survey-facts">
          {survey.area_m2 > 0 && `${area(survey.area_m2)} · `}
          {survey.cells > 0 &&
            `${number.value(survey.reached)} / ${number.value(survey.cells)} ${t("cells")} · `}
          {number.value(survey.samples)} {t("samples")}
          {Number.isFinite(made.getTime()) &&
            ` · ${made.toLocaleDateString(language.value === "fr" ? "fr-FR" : "en-GB", { dateStyle: "medium" })}`}
        </span>
        {survey.cells > 0 && <span class="bar" style={{ "--share": share }} />}
      </button>
      <div class="survey-acts">
        <a class="button small" href={api.fileUrl(survey.id)} download aria-label={`${t("download")}: ${survey.name}`}>
          {t("download")}
        </a>
        <button class={`button small${sure ? " danger" : ""}`} onClick={() => void remove()} aria-label={`${sure ? t("removeSure") : t("remove")}: ${survey.name}`}>
          {sure ? t("removeSure") : t("remove")}
        </button>
      </div>
    </li>
  );
}
