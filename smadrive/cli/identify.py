"""`smadrive identify`: fit a model to recorded data."""

from __future__ import annotations

from dataclasses import asdict
from enum import StrEnum
from math import isfinite
from pathlib import Path
from typing import Annotated

import typer

from smadrive.cli.output import AsJson, Output
from smadrive.cli.views.reports.fit_report import write_fit_report
from smadrive.cli.views.resistance_view import resistance_result, resistance_rows, resistance_sentences
from smadrive.errors import ConfigError
from smadrive.files.atomic import check_output
from smadrive.files.kinds import MODEL, PAGE
from smadrive.hysteresis.certificate import MOST_TURNED, Certificate
from smadrive.identification.memory.fit import MemoryFit, check_memory
from smadrive.identification.thermal import ThermalFit
from smadrive.identification.wire import DUHEM_COMPONENTS, FUZZY_SETS, MOST_FITTED_COMPONENTS, AnyFit, FitSettings
from smadrive.runs.record_fit import INPUT, OUTPUT, RecordFit, fit_file


class Kind(StrEnum):
    """The kind of model to fit."""

    tsfuzzy = "tsfuzzy"
    duhem = "duhem"


def main(
    data: Annotated[Path, typer.Argument(help="CSV, or the log (.h5) of `smadrive excite`.")],
    model_file: Annotated[Path, typer.Option("--model-file", "-o", help="Model file (JSON) to write.")],
    kind: Annotated[Kind, typer.Option(help="T-S fuzzy Duhem model, or Duhem model.")] = Kind.tsfuzzy,
    sets: Annotated[
        int | None,
        typer.Option(
            min=3, max=99, help=f"Number of fuzzy sets (--kind tsfuzzy), two rules each; by default {FUZZY_SETS}."
        ),
    ] = None,
    components: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=MOST_FITTED_COMPONENTS,
            help=f"Gaussians per branch of a Duhem model (--kind duhem); by default {DUHEM_COMPONENTS}.",
        ),
    ] = None,
    memory: Annotated[
        int | None,
        typer.Option(
            help="Sets of the last turning point (--kind tsfuzzy), 4 to 40, or 1 for no memory; by default held-out "
            "loops decide.",
        ),
    ] = None,
    input_column: Annotated[str, typer.Option("--input", help="Column of the input (CSV).")] = INPUT,
    output_column: Annotated[str, typer.Option("--output", help="Column of the output (CSV).")] = OUTPUT,
    plot: Annotated[Path | None, typer.Option(help="Page (HTML) to write, with loop, residuals and rules.")] = None,
    as_json: AsJson = False,
) -> None:
    """Fit a hysteresis model to DATA. For a log, also fit the heat balance and remove the lag of the thermocouple."""
    output = Output(as_json)
    if components is not None and kind is not Kind.duhem:
        raise ConfigError(
            "only a Duhem model has Gaussians", where="--components", cure="add --kind duhem, or use --sets"
        )
    if sets is not None and kind is not Kind.tsfuzzy:
        cure = "leave it out, or use --components"
        raise ConfigError("only a T-S fuzzy model has fuzzy sets", where="--sets", value=sets, cure=cure)
    if memory is not None and kind is not Kind.tsfuzzy:
        cure = "leave it out, or use --kind tsfuzzy"
        raise ConfigError("only a T-S fuzzy model can have memory", where="--memory", value=memory, cure=cure)
    if memory is not None:
        check_memory(memory, ConfigError, "--memory")
    check_output(model_file, MODEL, data)
    if plot is not None:
        check_output(plot, PAGE, data)
    with output.progress(f"fitting {data.name}"):
        settings = FitSettings(kind.value, sets or FUZZY_SETS, memory, components or DUHEM_COMPONENTS)
        result = fit_file(data, (input_column, output_column), settings)
    fit, thermal = result.fit, result.thermal
    replaced = model_file.exists()
    result.wire(str(data)).save(model_file)
    if plot is not None:
        write_fit_report(plot, result, str(data))
    _print_fit(output, result)
    output.say(f"model: {model_file}{' (replaced)' if replaced else ''}")
    output.result(
        {
            **fit_result(fit, kind.value, model_file),
            "caveats": result.caveats,
            **({} if plot is None else {"plot_file": str(plot)}),
            **({} if thermal is None else {"heat_balance": asdict(thermal.balance), "within": thermal.within}),
            "resistance": resistance_result(result),
        }
    )


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


def _print_fit(output: Output, result: RecordFit) -> None:
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
    for sentence in resistance_sentences(result):
        output.say(sentence)
    output.warn(result.caveats)


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
    """Return a row for each parameter of the heat balance: name, value, and half of its 95 % confidence interval."""
    balance, within = thermal.balance, {name: f"±{100 * value:.1f} %" for name, value in thermal.within.items()}
    return [
        ("heat capacity", f"{1e3 * balance.heat_capacity_j_per_k:.2f} mJ/K", within["heat_capacity_j_per_k"]),
        ("loss", f"{1e3 * balance.loss_w_per_k:.2f} mW/K", within["loss_w_per_k"]),
        ("time constant", f"{balance.time_constant_s:.2f} s", ""),
        ("latent heat", f"{balance.latent_heat_j:.3f} J", within["latent_heat_j"]),
        ("resistance", f"{balance.resistance_cold_ohm:.2f} Ω", within["resistance_cold_ohm"]),
        ("resistance when hot", f"{100 * balance.resistance_change:+.1f} %", within["resistance_change"]),
        ("thermocouple lag", f"{1e3 * balance.thermocouple_lag_s:.0f} ms", within["thermocouple_lag_s"]),
    ]
