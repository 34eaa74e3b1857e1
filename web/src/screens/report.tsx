/** Report: made on demand, shown here or in a tab of its own. */

import { useEffect, useState } from "preact/hooks";
import type { JSX } from "preact";
import { api } from "../api";
import { chosen, complain, language, say, t } from "../state";

export function Report({ id }: { id: string }): JSX.Element {
  const [made, setMade] = useState("");
  const [busy, setBusy] = useState(false);
  useEffect(() => {
    // Show an existing report at once.
    void fetch(api.reportUrl(id), { method: "HEAD" })
      .then((answer) => answer.ok && setMade("before"))
      .catch(() => undefined);
  }, [id]);
  async function make(): Promise<void> {
    setBusy(true);
    try {
      const { made: when } = await api.makeReport(id, language.value);
      setMade(when);
      say("info", t("reportReady"));
    } catch (cause) {
      complain(cause);
    } finally {
      setBusy(false);
    }
  }
  const url = `${api.reportUrl(id)}?made=${encodeURIComponent(made)}`;
  return (
    <div class="report-screen">
      <header class="report-bar">
        <div>
          <h1>
            {t("report")} <span class="quiet">{chosen.value?.name ?? ""}</span>
          </h1>
          <p class="quiet">{t("reportText")}</p>
        </div>
        <button class="button primary" disabled={busy} onClick={() => void make()}>
          {busy ? t("makingReport") : t("makeReport")}
        </button>
        {made && (
          <a class="button" href={url} target="_blank" rel="noopener">
            {t("openTab")}
          </a>
        )}
      </header>
      {busy && (
        <p class="waiting" role="status">
          {t("makingReport")}
        </p>
      )}
      {made && !busy && <iframe title={t("report")} src={url} />}
    </div>
  );
}
