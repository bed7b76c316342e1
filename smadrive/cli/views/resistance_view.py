"""The identified resistance as rows of a table, as sentences and as a JSON object."""

from __future__ import annotations

from dataclasses import asdict

from smadrive.runs.record_fit import RecordFit
from smadrive.wire.observability import TOO_COARSE, lead_text, lost_text, resolution_text, sense_text
from smadrive.wire.wire_model import WireModel


def resistance_rows(record: RecordFit) -> list[tuple[str, str, str]]:
    """Return a row for each property of the resistance: name, value, half of its 95 % interval or an explanation."""
    if record.resistance is None:
        return [("by resistance", "no", "the resistance cannot measure the displacement")] if record.thermal else []
    fit, resistance = record.resistance, record.resistance.resistance
    per_k, within_k = (1e3 * value for value in (resistance.martensite_ohm_per_k, fit.within["martensite_ohm_per_k"]))
    at = f"martensite at {resistance.reference_c:.0f} °C"
    return [
        (at, f"{resistance.martensite_ohm:.3f} Ω", f"±{1e3 * fit.within['martensite_ohm']:.1f} mΩ"),
        ("its temperature slope", f"{per_k:.2f} mΩ/K", f"±{within_k:.2f} mΩ/K"),
        (
            "change over the stroke",
            f"{100 * fit.change:+.2f} %",
            f"±{100 * fit.within['change']:.2f} %, at one temperature",
        ),
        ("noise of a sample", f"{100 * fit.noise_phase:.2f} %", "of the stroke, at the median current of the record"),
    ]


def resistance_sentences(record: RecordFit) -> tuple[str, ...]:
    """Return sentences on the limits of the displacement by resistance; empty for a fit without a heat balance.

    If the resistance cannot measure the displacement, the only sentence gives the reason.
    """
    if record.thermal is None:
        return ()
    if record.resistance is None:
        return (f"the resistance cannot measure the displacement: {record.without_resistance}",)
    resistance = record.resistance.resistance
    wire = WireModel(record.fit.model, record.thermal.balance)
    return (
        *_resolution_texts(record.resistance.resolution),
        sense_text(wire, resistance),
        lead_text(wire, resistance),
        *lost_text(wire, resistance),
    )


def _resolution_texts(error: float) -> tuple[str, ...]:
    """Return a sentence if the resolution of current and voltage limits the displacement by the resistance."""
    texts = resolution_text("current and voltage", error)
    return (f"{texts[0]}, so these meters allow no run by resistance",) if error > TOO_COARSE else texts


def resistance_result(record: RecordFit) -> dict[str, object] | None:
    """Return the resistance with its intervals as a JSON object; None if it cannot measure the displacement."""
    if record.resistance is None:
        return None
    fit = record.resistance
    numbers = {"change": fit.change, "noise_phase": fit.noise_phase, "resolution": fit.resolution}
    return {**asdict(fit.resistance), **numbers, "rms_ohm": fit.rms_ohm, "within": fit.within}
