"""Which settings may be changed on a running boat: those that judge, none that bound the work or bind the parts."""

from __future__ import annotations

import msgspec

from paani.config.advisor import AdvisorConfig, MotionConfig, PolicyConfig, RiskConfig, TrackerConfig

SECTIONS: dict[str, type[msgspec.Struct]] = {
    "policy": PolicyConfig,
    "risk": RiskConfig,
    "tracker": TrackerConfig,
    "motion": MotionConfig,
}
FIXED = frozenset({"advisor.tracker.max_tracks", "advisor.motion.max_samples"})  # more of these would slow the advice
TUNABLE = (
    frozenset(
        f"advisor.{section}.{field.name}"
        for section, kind in SECTIONS.items()
        for field in msgspec.structs.fields(kind)
    )
    - FIXED
)


def setting_text(config: AdvisorConfig, path: str) -> str:
    """The present value of a tunable setting, as one would write it. Raises KeyError for any other path."""
    if path not in TUNABLE:
        raise KeyError(path)
    _, section, field = path.split(".")
    return msgspec.json.encode(getattr(getattr(config, section), field)).decode()
