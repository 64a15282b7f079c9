"""A result to make others from."""

from paani.statistics.dithering import Dithering
from paani_sim.trials.drive_states import DriveOutcome
from paani_sim.trials.policies import Policy
from paani_sim.trials.result import Closeness, Encounter, Latency, StopTotals, TrialResult
from paani_sim.trials.seed_parts import SeedPart

RESULT = TrialResult(
    scenario="random:lake:1",
    seed=1,
    part=SeedPart.DEVELOPMENT,
    policy=Policy.PAANI,
    profile="paani",
    hfov_deg=70.0,
    world="lake",
    why=DriveOutcome.COMPLETED,
    completed=True,
    error="",
    goal_m=40.0,
    progress_m=40.0,
    distance_m=50.0,
    seconds=100.0,
    limit_s=200.0,
    collisions=0,
    collisions_visible=0,
    collisions_bank=0,
    near_misses=1,
    near_misses_bank=0,
    min_clearance_m=0.4,
    min_bank_clearance_m=3.0,
    off_route_rms_m=1.0,
    off_route_max_m=2.0,
    energy_j=500.0,
    frames=500,
    unusable=5,
    encounters=(
        Encounter(what="a", kind="buoy", at_s=9.0, clearance_m=0.4, closeness=Closeness.TIGHT, x_m=0.0, y_m=0.0),
    ),
    contacts=(),
    stops=(StopTotals(reason="NO_SAFE_SIDE", count=2, seconds=4.0),),
    reactions=(),
    latency=Latency(p50_s=0.1, p95_s=0.2, max_s=0.3, samples=9),
    dithering=Dithering(seconds=100.0, changes=5),
    track=((0.0, 0.0, 0.0),),
    state_hash="",
)
