"""How a map was made and how good it is, in sentences."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np

from grebe.core.quantity import inline
from grebe.mapping.methods.base import Model
from grebe.mapping.quantity_map import QuantityMap
from grebe.mapping.scale import LINEAR
from grebe.report.data import ReportData
from grebe.report.reasons import reason_in
from grebe.report.texts import Texts


def method_text(data: ReportData, one: QuantityMap, t: Texts) -> str:
    """Describe how a map was made and how good it is, in sentences."""
    model, check = one.model, one.validation
    words = f"method_{one.method.key}"
    said = [
        t(
            words if words in t.table else "method_other",
            label=one.method.label,
            samples=t.number(f"{one.samples:,}"),
            reason=_because(one.reason, t),
        ),
        t(
            "model",
            text=covariance_text(model, t, one.quantity.unit if one.scale == LINEAR else ""),
            nugget=_squared(model.nugget, one, t),
            sill="-" if model.sill is None else _squared(model.sill, one, t),
            reason=_because(model.reason, t),
        ),
    ]
    said += _together(data, one, t)
    lag = data.lags.get(one.quantity.key)
    if lag is not None:
        said.append(
            t("lag_corrected", delay=t.number(f"{lag.delay_s:g}"), tau=t.number(f"{lag.tau_s:g}"))
        )
    if one.scale != LINEAR:
        said.append(t("on_log_scale"))
    said += _changed(one, t)
    if check is not None:
        numbers = {"rmse": check.rmse, "nearest": check.nearest_rmse, "idw": check.idw_rmse,
                   "bias": check.bias, "msdr": check.msdr}  # fmt: skip
        said.append(
            t(
                "validation",
                left_out=t(f"left_out_{check.left_out}", pieces=check.pieces, folds=check.folds),
                samples=t.number(f"{check.samples:,}"),
                half=f"{100 * check.coverage50:.0f}",
                most=f"{100 * check.coverage95:.0f}",
                **{name: t.number(significant(value, 3)) for name, value in numbers.items()},
            )
        )
    if check is not None:
        factors = one.calibration
        said.append(
            t(
                "calibrated",
                on_way=t.number(f"{factors.on_way:.2f}"),
                off_way=t.number(f"{factors.off_way:.2f}"),
            )
        )
        if factors.unrest is not None:
            least, most = np.quantile(factors.unrest.factor(one.grid.nodes), [0.05, 0.95])
            ends = {"least": t.number(f"{least:.2f}"), "most": t.number(f"{most:.2f}")}
            said.append(t("unrest", **ends))
    return " ".join(said)


def _because(reason: str, t: Texts) -> str:
    """A reason in the form in which a sentence of the language includes it."""
    told = reason_in(reason, t)
    return t("because", reason=told) if told else ""


def _together(data: ReportData, one: QuantityMap, t: Texts) -> list[str]:
    """Sentences on the effect of other quantities' readings."""
    told = one.model.companions
    if told is None:
        return []
    names = ", ".join(
        t(
            "companion",
            name=inline(data.quantities.known(key).label_in(t.language)),
            correlation=t.number(f"{correlation:.2f}"),
        )
        for key, correlation in zip(told.names, told.correlations, strict=True)
    )
    return [t("together" if told.heeded else "not_together", names=names,
              share=t.share(told.spared))]  # fmt: skip


def _changed(one: QuantityMap, t: Texts) -> list[str]:
    """Sentences on the water's change during the survey, the sensor's lag, and their correction."""
    change, said = one.change, list[str]()
    if change.is_significant:
        by = t.number(significant(one.changed_by, 2))
        said.append(t("changed", change=by, unit=after_number(one.quantity.unit)))
    elif np.isfinite(change.unseen_sd):
        by = t.number(significant(one.in_unit(change.unseen_sd), 2))
        said.append(t("unchanged", change=by, unit=after_number(one.quantity.unit)))
    elif change.gain or change.lag_gain:
        said.append(t("change_untold"))
    if change.response is not None:
        constant_s, sd_s = change.response.constant_s, change.response.sd_s
        told = {"constant": significant(constant_s, 2), "error": significant(sd_s, 1)}
        said.append(t("slow", **{name: t.number(one) for name, one in told.items()}))
    elif change.lag_s:
        said.append(t("late", lag=t.number(f"{change.lag_s:g}")))
    if one.is_of_moment:
        moment = datetime.fromtimestamp(change.moment_s, UTC)
        name = "of_moment" if change.is_significant or change.is_late else "of_moment_alone"
        said.append(t(name, moment=f"{moment:%Y-%m-%d %H:%M} UTC"))
    elif change.is_significant or change.is_late:
        said.append(t("as_measured"))
    return said


def covariance_text(model: Model, t: Texts, unit: str) -> str:
    """Describe a covariance in a few words; `unit` is the quantity's, empty for a logarithm."""
    if model.parts:
        return t(
            "covariance_mean", parts="; ".join(covariance_text(one, t, unit) for one in model.parts)
        )
    if model.practical_range_m is None:
        return model.text
    text = t(
        "covariance",
        kind=t["kinds"].get(model.kind, model.kind),
        range=f"{model.practical_range_m:.0f}",
    )
    if model.ratio < 1:
        ratio = t.number(f"{model.ratio:.2f}")
        text += t("covariance_across", angle=f"{model.angle_deg:.0f}", ratio=ratio)
    if model.passing is not None:
        sd = t.number(f"{np.sqrt(model.passing.variance):.2g}")
        text += t(
            "covariance_passing",
            sd=sd + after_number(unit),
            minutes=t.number(_minutes(model.passing.memory_s / 60)),
        )
    return text


def _minutes(minutes: float) -> str:
    """Whole minutes, or tenths of the first one."""
    return f"{minutes:.0f}" if minutes >= 1 else f"{minutes:.1f}"


def _squared(variance: float, one: QuantityMap, t: Texts) -> str:
    """A variance with its unit; a logarithm has none."""
    unit = one.quantity.unit if one.scale == LINEAR else ""
    return t.number(significant(variance, 3)) + (f" ({unit})²" if unit else "")


def after_number(unit: str) -> str:
    """A unit as it follows a number; empty if there is none."""
    return f" {unit}" if unit else ""


def significant(value: float, digits: int = 4) -> str:
    """A number with `digits` significant figures, without an exponent for ordinary sizes."""
    if value == 0 or not np.isfinite(value):
        return f"{value:g}"
    decimals = max(0, digits - 1 - int(np.floor(np.log10(abs(value)))))
    return f"{value:.{decimals}f}" if decimals <= 8 else f"{value:.{digits - 1}e}"
