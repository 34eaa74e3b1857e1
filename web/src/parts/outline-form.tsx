/** How an opened file of outlines is read: its islands, and coordinates that it does not name. */

import type { JSX } from "preact";
import type { OutlineReading } from "../api";
import { t } from "../state";
import { Select } from "./plan-form";

export function OutlineForm({
  name,
  reading,
  change,
}: {
  name: string;
  reading: OutlineReading;
  change: (reading: OutlineReading) => void;
}): JSX.Element {
  return (
    <fieldset class="weather">
      <legend>{t("outlineOf", { name })}</legend>
      <Select
        label={t("polygonsWithin")}
        value={reading.islands}
        change={(islands) => change({ ...reading, islands: islands as OutlineReading["islands"] })}
      >
        <option value="named">{t("islandsNamed")}</option>
        <option value="all">{t("islandsAll")}</option>
        <option value="none">{t("islandsNone")}</option>
      </Select>
      <label class="field">
        <span>{t("crs")}</span>
        <input
          placeholder="EPSG:25832"
          value={reading.crs}
          spellcheck={false}
          onChange={(event) => change({ ...reading, crs: event.currentTarget.value.trim() })}
        />
      </label>
    </fieldset>
  );
}
