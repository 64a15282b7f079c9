"""Fitness network of the image-quality check: how far a picture looks like one that the segmenter can be trusted on."""

from paani.arrays import U8
from paani.config import PerceptionConfig
from paani_services.perception.engine import OnnxEngine
from paani_services.perception.image_quality import FitnessFunction
from paani_services.perception.preprocessing import lookup_tables_for, shrink_picture


def load_fitness(perception: PerceptionConfig, threads: int) -> FitnessFunction | None:
    """The network as a function; None where the check or its network is switched off, and in the open set, without one.

    Raises UserError naming a file that cannot be used.
    """
    config = perception.image_quality
    if not config.enabled or config.min_fitness == 0.0 or not (config.model or perception.weights == "full"):
        return None
    engine = OnnxEngine.load("gate", config.model, threads)
    height, width = engine.contract.size_hw
    table = lookup_tables_for(engine.contract)

    def fitness(reduced: U8) -> float:
        return float(engine.run(shrink_picture(reduced, height, width, table))[0, 0])

    return fitness
