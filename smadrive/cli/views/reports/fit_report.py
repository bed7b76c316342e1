"""The page of a fitted hysteresis model: loop, residuals, metrics, rules or parameters."""

from __future__ import annotations

from pathlib import Path

from smadrive.cli.views.resistance_view import resistance_sentences
from smadrive.display.number_text import count_text
from smadrive.hysteresis import TSFuzzyDuhem, TSFuzzyPreisach
from smadrive.identification.duhem import DuhemFit
from smadrive.identification.wire import AnyFit
from smadrive.runs.figures.fit_plots import loop_figure, residual_figure, resistance_figure
from smadrive.runs.record_fit import RecordFit
from smadrive.runs.report import Banner, Grid, Listing, PagePart, Plot, Tiles, write_report


def write_fit_report(path: Path, record: RecordFit, source: str) -> None:
    """Write the page of the fits to a record. `source` is the path of the record."""
    fit, axes = record.fit, record.axes
    parts: list[PagePart] = [
        _verdict(fit),
        *(Banner("warning", f"Warning: {caveat}.") for caveat in record.caveats),
        _metrics(fit),
        Plot("The loop", loop_figure(fit, axes), "Grey: the record. Colours: the model on the same input."),
        Plot(
            "Residuals",
            residual_figure(fit, axes[0]),
            "Model minus record, along the record and over the input. A pattern here is an error of the model.",
        ),
        *_resistance(record),
        *_parameters(fit),
    ]
    samples = count_text(len(fit.residual), "sample")
    write_report(path, f"Hysteresis identified from {Path(source).name}", f"{samples}.", parts)


def _verdict(fit: AnyFit) -> Banner:
    if fit.certificate.holds:
        return Banner("good", "Certified: contracting, bounded, and no branch turns back.")
    shortcomings = ", ".join(fit.certificate.shortcomings)
    return Banner("bad", f"Not certified, the model may not drive a feedforward: {shortcomings}.")


def _metrics(fit: AnyFit) -> Tiles:
    certificate = fit.certificate
    return Tiles(
        [
            (f"{fit.rms_percent:.3f} %", "RMS error, of the output span"),
            (f"{fit.max_percent:.3f} %", "largest error"),
            (f"{certificate.contraction_rate:.3g}", "contraction, per unit of input; above 0 an initial error decays"),
            (f"{100 * certificate.invertible_share:.1f} %", "of the loop has one input for each output; best is 100 %"),
        ]
    )


def _resistance(record: RecordFit) -> list[PagePart]:
    """Return the plot of the resistance, or the reason why it cannot measure the displacement."""
    if record.resistance is None:
        return [Listing("The resistance", f"cannot measure the displacement: {record.without_resistance}")]
    caption = " ".join(f"{sentence[0].upper()}{sentence[1:]}." for sentence in resistance_sentences(record))
    return [Plot("The resistance", resistance_figure(record.resistance), caption)]


def _parameters(fit: AnyFit) -> list[PagePart]:
    if isinstance(fit.model, TSFuzzyPreisach):
        return [*_rules(fit.model.local), Listing("The rules with memory", fit.model.rules_text())]
    if isinstance(fit.model, TSFuzzyDuhem):
        return _rules(fit.model)
    return _duhem_parameters(fit) if isinstance(fit, DuhemFit) else []


def _rules(model: TSFuzzyDuhem) -> list[PagePart]:
    header = ("centre", "a rising", "b rising", "a falling", "b falling")
    laws = zip(model.sets.centres, *model.heating_law, *model.cooling_law, strict=True)
    table = [tuple(f"{number + 0.0:.5g}" for number in row) for row in laws]
    return [Grid(header, table, title="Rules"), Listing("The rules as sentences", model.rules_text())]


def _duhem_parameters(fit: DuhemFit) -> list[PagePart]:
    model, errors = fit.model, fit.standard_errors
    rows = []
    for name, mixture, spread in (
        ("heating", model.heating, errors.heating),
        ("cooling", model.cooling, errors.cooling),
    ):
        for number in range(len(mixture.means)):
            values = (mixture.means, mixture.sigmas, mixture.weights)
            within = (spread.means, spread.sigmas, spread.weights)
            cells = (_with_error(v[number], e[number]) for v, e in zip(values, within, strict=True))
            rows.append((f"{name} {number + 1}", *cells))
    map_rows = [("scale", _with_error(model.scale, errors.scale)), ("offset", _with_error(model.offset, errors.offset))]
    return [
        Grid(("Gaussian", "mean", "σ", "weight"), rows, title="Parameters, with standard errors"),
        Grid(("output", "value"), map_rows, title="Output = offset + scale · state"),
    ]


def _with_error(value: float, error: float) -> str:
    return f"{value:.5g} ± {error:.2g}"
