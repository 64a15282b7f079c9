"""Fitness network of the image-quality check: how far a picture looks like one that the segmenter can be trusted on."""

from paani.arrays import U8
from paani.config import PerceptionConfig
from paani_services.perception.engine import OnnxEngine
from paani_services.perception.image_quality import FitnessFunction
from paani_services.perception.preprocessing import lookup_tables_for, shrink_picture


def uses_fitness(perception: PerceptionConfig) -> bool:
    """Whether the check asks the network: not where either is switched off, nor in a set that has none."""
    quality = perception.image_quality
    return quality.enabled and quality.min_fitness > 0.0 and bool(quality.model or perception.weights == "full")


def load_fitness(perception: PerceptionConfig, threads: int) -> FitnessFunction | None:
    """The network as a function; None where it is not used. Raises UserError naming a file that cannot be used."""
    if not uses_fitness(perception):
        return None
    engine = OnnxEngine.load("gate", perception.image_quality.model, threads)
    height, width = engine.contract.size_hw
    table = lookup_tables_for(engine.contract)

    def fitness(reduced: U8) -> float:
        return float(engine.run(shrink_picture(reduced, height, width, table))[0, 0])

    return fitness
