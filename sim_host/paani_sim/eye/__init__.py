"""The rendered camera: what the boat's camera sees in a world, with labels where wanted."""

from paani_sim.eye.camera import BoatPose, Camera, project
from paani_sim.eye.labels import Labelled, VisibleBox
from paani_sim.eye.renderer import Eye, Picture

__all__ = ["BoatPose", "Camera", "Eye", "Labelled", "Picture", "VisibleBox", "project"]
