"""A fit as a table for a person, and as a JSON object for a program."""

from __future__ import annotations

from dataclasses import asdict
from math import isfinite
from pathlib import Path

from smadrive.cli.terminal.output import Output
from smadrive.cli.views.resistance_view import resistance_rows, resistance_sentences
from smadrive.hysteresis.certificate import MOST_TURNED, Certificate
from smadrive.identification.memory.fit import MemoryFit
from smadrive.identification.thermal_fit.fit import ThermalFit
from smadrive.identification.wire import AnyFit
from smadrive.runs.record_fit import INPUT, RecordFit

WITH_LAG = (
    "a table gives no heat balance and no resistance, and the lag of its thermocouple is not removed: the log of "
    "`smadrive excite` gives a more accurate model"
)


def print_fit(output: Output, result: RecordFit) -> None:
    """Print the errors of the fit, its certificate, its parameters and its caveats."""
    fit, thermal = result.fit, result.thermal
    rows = [
        ("RMS error", f"{fit.rms_percent:.3f} %", "of the output span"),
        ("max error", f"{fit.max_percent:.3f} %", "of the output span"),
        *([("rules", str(_rules(fit)), "")] if _rules(fit) else []),
        *_memory_rows(fit),
        *certificate_rows(fit.certificate),
    ]
    if thermal is not None:
        rows += _heat_rows(thermal)
    rows += resistance_rows(result)
    output.table(("", "value", ""), rows, notes=True)
    if thermal is None and INPUT in result.axes:
        output.say(WITH_LAG)
    for sentence in resistance_sentences(result):
        output.say(sentence)
    output.warn(result.caveats)


def fit_result(fit: AnyFit, kind: str, model_file: Path) -> dict[str, object]:
    """Return the JSON object that describes a fit and its model file."""
    return {
        "kind": kind,
        "rules": _rules(fit),
        "memory": _memory(fit),
        "rms_percent": fit.rms_percent,
        "max_percent": fit.max_percent,
        "model_file": str(model_file),
        "certificate": {**asdict(fit.certificate), "holds": fit.certificate.holds},
    }


def _rules(fit: AnyFit) -> int:
    """Return the number of rules of a fitted model. A Duhem model has none, so the number is 0."""
    return len(getattr(fit.model, "rules", ()))


def _memory(fit: AnyFit) -> dict[str, object] | None:
    """Return the sets of the last turning point and the held-out errors in %; None for a Duhem model.

    An unknown error is None.
    """
    if not isinstance(fit, MemoryFit):
        return None
    choice = fit.memory
    errors = {"held_out_with_percent": choice.with_percent, "held_out_without_percent": choice.without_percent}
    return {"sets": choice.sets, **{name: error if isfinite(error) else None for name, error in errors.items()}}


def _memory_rows(fit: AnyFit) -> list[tuple[str, str, str]]:
    if not isinstance(fit, MemoryFit):
        return []
    choice = fit.memory
    rows = [("memory", str(choice.sets) if choice.sets > 1 else "none", "sets of the last turning point")]
    if isfinite(choice.with_percent):
        rows.append(("held out, with", f"{choice.with_percent:.2f} %", "RMS on loops that the fit did not see"))
        rows.append(("held out, without", f"{choice.without_percent:.2f} %", "the same without memory"))
    return rows


def certificate_rows(certificate: Certificate) -> list[tuple[str, str, str]]:
    """Return a row of texts for each property of a certificate: its name, its value and its meaning."""
    left = 100 * certificate.loop_contraction
    decays, persists = "above 0, good: an initial error decays", "not above 0, bad: an initial error persists"
    stays = "good: the output stays in the stroke" if certificate.bounded else "bad: the output leaves the stroke"
    verdict = "may drive a feedforward" if certificate.holds else ", ".join(certificate.shortcomings)
    return [
        ("contraction", f"{certificate.contraction_rate:.3g}", decays if certificate.contracting else persists),
        ("left after a loop", "< 0.01 %" if left < 0.01 else f"{left:.2g} %", "of an initial error; less is better"),
        ("bounded", _yes(certificate.bounded), stays),
        (
            "invertible",
            f"{100 * certificate.invertible_share:.1f} %",
            "of the loop has one input for each output; best is 100 %",
        ),
        (
            "turns back",
            f"{100 * certificate.turned_share:.1f} %",
            f"of the travel, along a branch; bad above {100 * MOST_TURNED:g} %",
        ),
        ("certified", _yes(certificate.holds), verdict),
    ]


def _yes(holds: bool) -> str:
    return "yes" if holds else "no"


def _heat_rows(thermal: ThermalFit) -> list[tuple[str, str, str]]:
    """Return a row for each parameter of the heat balance: name, value, and half of its 95 % confidence interval.

    The time constant has no interval, because it follows from heat capacity and loss. The noise has none either: it is
    measured, not fitted.
    """
    balance, within = thermal.balance, {name: f"±{100 * value:.1f} %" for name, value in thermal.within.items()}
    return [
        ("heat capacity", f"{1e3 * balance.heat_capacity_j_per_k:.2f} mJ/K", within["heat_capacity_j_per_k"]),
        ("loss", f"{1e3 * balance.loss_w_per_k:.2f} mW/K", within["loss_w_per_k"]),
        ("time constant", f"{balance.time_constant_s:.2f} s", ""),
        ("latent heat", f"{balance.latent_heat_j:.3f} J", within["latent_heat_j"]),
        ("resistance", f"{balance.resistance_cold_ohm:.2f} Ω", within["resistance_cold_ohm"]),
        ("change of the resistance when hot", f"{100 * balance.resistance_change:+.1f} %", within["resistance_change"]),
        ("thermocouple lag", f"{1e3 * balance.thermocouple_lag_s:.0f} ms", within["thermocouple_lag_s"]),
        ("thermocouple noise", f"{balance.thermocouple_noise_c:.2g} K", ""),
    ]
