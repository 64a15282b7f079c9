"""What the README says of fresh seeds is what the ledger holds of the newest hundred drives of what ships."""

from __future__ import annotations

from paani_sim.trials.intervals import poisson_interval, wilson_interval
from paani_sim.trials.ledger import LedgerResult, read_ledger
from paani_sim.trials.policies import Policy
from paani_sim.trials.seed_parts import SeedPart
from tests.places import ROOT

WHOLE_RUN = 100
WORDS = ("none", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")


def newest_run() -> list[LedgerResult]:
    """Of the commit that was drawn for last of those with a whole run; each drive as it was entered last."""
    runs: dict[str, dict[tuple[str, int], LedgerResult]] = {}
    for entry in read_ledger(ROOT / "sim_host" / "trial_ledger.jsonl"):
        if isinstance(entry, LedgerResult) and (entry.part, entry.policy, entry.sets) == (
            SeedPart.FRESH,
            Policy.PAANI,
            (),
        ):
            runs.setdefault(entry.commit, {})[entry.condition, entry.seed] = entry
    return list([run for run in runs.values() if len(run) >= WHOLE_RUN][-1].values())


def test_the_readme_states_the_newest_run_on_fresh_seeds() -> None:
    run = newest_run()
    km = sum(each.distance_m for each in run) / 1000
    contacts = sum(each.collisions for each in run)
    touched = sum(each.collisions > 0 for each in run)
    free, rate = wilson_interval(len(run) - touched, len(run)), [count / km for count in poisson_interval(contacts)]
    text = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    for statement in (
        f"In {len(run)} simulated drives by camera, {km:.1f} km on seeds that the commit under test drew",
        f"{sum(each.why == 'completed' for each in run)} were completed and {WORDS[touched]} touched something",
        f"without contact {100 * (1 - touched / len(run)):.0f} % [{100 * free[0]:.1f}, {100 * free[1]:.1f}]",
        f"{contacts / km:.1f} contacts a kilometre [{rate[0]:.1f}, {rate[1]:.1f}]",
        f"of {sum(each.encounters for each in run)} encounters",
    ):
        assert statement in text
    assert ("both out of sight" in text) == (sum(each.collisions_visible for each in run) == 0)
