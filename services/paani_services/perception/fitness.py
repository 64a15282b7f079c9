"""The gate's net: how far a picture looks like one that the segmenter can be trusted on."""

from paani.arrays import U8
from paani.config import GateConfig
from paani_services.perception.engine import OnnxEngine
from paani_services.perception.gate import Fitness
from paani_services.perception.preprocess import shrunk, tables_for


def load_fitness(config: GateConfig, threads: int) -> Fitness | None:
    """The net as a function; None where the gate or its net is switched off. Raises UserError naming a bad file."""
    if not config.enabled or config.min_fitness == 0.0:
        return None
    engine = OnnxEngine.load("gate", config.model, threads)
    height, width = engine.contract.size_hw
    table = tables_for(engine.contract)

    def fitness(middle: U8) -> float:
        return float(engine.run(shrunk(middle, height, width, table))[0, 0])

    return fitness
