"""The estimator that `localization.ekf` names; the entry point of `paani.cores`."""

from paani.config import LocalizationConfig
from paani_services.localization.estimator import Estimator
from paani_services.localization.plain_estimator import PlainEstimator


def create_estimator(config: LocalizationConfig) -> Estimator | PlainEstimator:
    """The paper's plain filters, or those that know the errors of their sensors."""
    return PlainEstimator(config) if config.ekf == "plain" else Estimator(config)
