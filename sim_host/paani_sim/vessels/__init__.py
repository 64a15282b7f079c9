"""Vessels: the coefficients of a hull, each with its source, in one TOML file per vessel."""

from paani_sim.vessels.vessel import VESSELS, Vessel, load_vessel

__all__ = ["VESSELS", "Vessel", "load_vessel"]
