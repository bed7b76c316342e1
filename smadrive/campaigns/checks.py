"""The checks of a campaign before its first run: columns of the report, settings, files, faults."""

from __future__ import annotations

from smadrive.campaigns.experiments.simulated_rig import check_disturbance
from smadrive.campaigns.plan.plan import CampaignPlan
from smadrive.campaigns.results.summary import check_report


def check_plan(plan: CampaignPlan) -> None:
    """Raise ConfigError if the settings of a run are wrong, a file is missing, or a fault or column is unknown."""
    check_report(plan)
    checked: set[str] = set()
    for run in plan.sample():
        if run.settings.experiment != "fit" and run.disturbance and run.settings.disturbance not in checked:
            check_disturbance(run)
            checked.add(run.settings.disturbance)
    assert plan.fingerprint
