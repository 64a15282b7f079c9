"""The off-screen renderer of the boat's camera: pictures of a world, with labels on request."""

from paani_sim.eye.camera import BoatPose, Camera, project
from paani_sim.eye.labels import Labelled, VisibleBox
from paani_sim.eye.renderer import Eye, Picture

__all__ = ["BoatPose", "Camera", "Eye", "Labelled", "Picture", "VisibleBox", "project"]
