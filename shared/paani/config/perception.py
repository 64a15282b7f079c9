"""Camera and perception settings.

Ids such as `J7` name statements of the paper (`paani claims`).
"""

from __future__ import annotations

from typing import Literal

from paani.config.section import Fraction, JpegQuality, NonNegative, Positive, Section, Size

EngineName = Literal["onnxruntime", "ncnn"]
WeightSet = Literal["full", "open", "paper"]


class CameraConfig(Section, frozen=True):
    """`source`: `sim`, `webcam`, `webcam:N`, or a picture, folder or video path.

    A single picture is a camera that always shows the same: the image-quality check calls it frozen.
    """

    source: str = "sim"
    rate_hz: Positive = 5.0  # a picture each 0.2 s: 12 cm of way at cruise
    # `fixed` plays recordings at `rate_hz`, `original` a video at its own times.
    timing: Literal["fixed", "original"] = "fixed"
    loop: bool = True  # a recording begins again at its end
    width_px: Size = 320  # A8
    height_px: Size = 240  # A8
    jpeg_quality: JpegQuality = 85  # small enough for a slow link, fine enough for the networks

    @property
    def is_recording(self) -> bool:
        """Whether the source is a path: neither the simulator nor a webcam."""
        return self.source != "sim" and self.source.partition(":")[0] != "webcam"


class ImageQualityConfig(Section, frozen=True):
    """Image-quality check: a picture beyond any of these limits is no evidence. `enabled=false` is the paper (J19).

    The limits lie between broken pictures and everything that real cameras deliver, fog, glare and night included.
    `min_fitness` is the least answer of the fitness network with which a picture is usable; 0 leaves the network out.
    With an answer below `sure_fitness` a picture is also checked upside down, and stays refused where its lines seem to
    have a wrong length.
    """

    enabled: bool = True  # J19: the paper judges every picture
    min_width_px: Size = 160  # half the networks' input; smaller pictures hide what is small
    min_height_px: Size = 120  # half of `camera.height_px`
    dark_mean: NonNegative = 3.5  # of 255
    dark_frac: Fraction = 0.96  # of pixels at most 6
    bright_frac: Fraction = 0.80  # of pixels at least 250
    flat_range: NonNegative = 11.0  # 1st to 99th percentile
    flat_frac: Fraction = 0.95  # of tiles without texture
    flat_residual: Fraction = 0.15  # of the variation is not vertical stripes
    noise_correlation: Fraction = 0.25  # of neighbouring pixels of the thumbnail
    noise_sigma: NonNegative = 30.0  # of 255, standard deviation of the noise
    noise_fineness: NonNegative = 3.6  # fine over coarse edges
    blur_fineness: NonNegative = 0.25  # fine over coarse edges; less is out of focus
    cover_frac: Fraction = 0.50  # of tiles dark and without texture, beside a bright rest
    cover_rest_mean: NonNegative = 58.0  # of 255, beside what is covered; a darker rest means dusk, no covered lens
    cover_total_frac: Fraction = 0.95  # whatever the rest
    skew: Fraction = 0.82  # lines of a wrong length, unless the network is sure; of 3,722 real pictures one has less
    frozen_frames: Size = 3  # distinct frames that show the same: two periods of 0.2 s, and 0.1 s for the verdict
    frozen_mad: NonNegative = 0.05  # mean absolute difference of the thumbnails
    model: str = ""  # path of an ONNX file; empty: the shipped model
    min_fitness: Fraction = 0.37  # `paani models train gate` says how much each refuses and lets through
    sure_fitness: Fraction = 0.97
    min_water: Fraction = 0.01  # of the mask; land that fills the picture is no boat's view
    max_endless: Fraction = 0.95  # of the mask's columns that are water to the top: seen from above, or no horizon
    min_filled: Fraction = 0.5  # of the mask's columns with an obstacle at the top, which then fills the picture
    swimmer_height: Fraction = 0.10  # of the picture: who is in the centre wins over the network's doubt; 0: nobody
    swimmer_water_confidence: Fraction = 0.80  # of the mask where it shows water, for that


class DetectorConfig(Section, frozen=True):
    """A box counts above `confidence`, or above the threshold of its own class where that is not 0."""

    confidence: Fraction = 0.40  # C6
    person_confidence: Fraction = 0.0  # 0: as `confidence`; lower finds more people, and more that are none
    vessel_confidence: Fraction = 0.0  # 0: as `confidence`
    pier_confidence: Fraction = 0.0  # 0: as `confidence`
    buoy_confidence: Fraction = 0.0  # 0: as `confidence`
    nms_input: Size = 256  # C7
    nms_iou: Fraction = 0.45  # C8
    max_boxes: Size = 24  # C9

    def threshold(self, kind: str) -> float:
        """Above which a box of a class (`person`, `vessel`, `pier`, `buoy`) counts."""
        return float(getattr(self, f"{kind}_confidence")) or self.confidence


class CandidateConfig(Section, frozen=True):
    """What may be a person although no box says so, and what is none; `use=false` passes on detections as they are, as
    the paper does.
    """

    use: bool = True  # C6: what is below the threshold is nothing
    person_confidence: Fraction = 0.15  # of a box that is not sure of a person; below `detections.confidence`
    water_share: Fraction = 0.80  # of the mask beside and below such a box, which then stands in water
    min_cells: Size = 4  # of the mask: 4 of its 5,120 are 0.1 m seen from 2 m
    max_count: Size = 12  # handed on: unsure boxes first, each kind by falling confidence
    # A box of a person in which the mask shows water alone is a reflection if it is at least that high and less sure.
    # Of 1,425 boxes on people that are so high, 637 of photographs (157 held out) and 788 rendered, none is; 4 surer
    # ones are. It counts by the full set's networks alone: of 588 boxes on people by the open ones, one is.
    reflection_height: Fraction = 0.10  # of the picture; the mask misses a fifth of those of 0.04 to 0.08
    reflection_confidence: Fraction = 0.70  # the least of the four that the mask misses has 0.71


class CorridorConfig(Section, frozen=True):
    """Where the boat may go in the picture: normalised x ranges (they overlap) below normalised height `top`."""

    top: Fraction = 0.30  # E2
    left: tuple[Fraction, Fraction] = (0.03, 0.39)  # E3
    center: tuple[Fraction, Fraction] = (0.31, 0.69)  # E3
    right: tuple[Fraction, Fraction] = (0.61, 0.97)  # E3
    clear_column: Fraction = 0.60  # E6
    open_water: bool = True  # says how wide the connected water from the bow is in each; J5: it is not asked
    min_depth: Fraction = 0.06  # of the picture: columns with less of it are no way

    def __post_init__(self) -> None:
        """A corridor has a width, and something lies below its top."""
        for name, (start, end) in (("left", self.left), ("center", self.center), ("right", self.right)):
            if start >= end:
                raise ValueError(f"{name}: {start} is not left of {end}")
        if self.top > 0.95:
            raise ValueError(f"top: {self.top} leaves no picture below it")


class PerceptionConfig(Section, frozen=True):
    """`weights`: the set of the networks that have no path of their own: `full` has learnt from every source and is for
    research; `open` has learnt from few that anyone may use; `paper` has the paper's own networks by its recipes. The
    last two see worse, and limit the speed as an uncalibrated camera does.

    `ego_polygon`: normalised corners of the own hull in the picture; what lies inside is no evidence.

    `engine` runs detector and segmenter; `ncnn` needs the files that `paani models convert` makes, and is chosen by
    `paani models bench` on the machine itself. The fitness network always runs by onnxruntime.
    """

    rate_hz: Positive = 5.0  # as often as the camera gives pictures
    max_frame_age_s: Positive = 0.8  # J16, judged at inference start
    concurrent: bool = True  # both networks at once on two cores; B4: one after the other
    engine: EngineName = "onnxruntime"
    intra_op_threads: Size = 1  # of each network; two networks with one each use two cores best
    weights: WeightSet = "full"
    segmenter: str = ""  # path of an ONNX file; empty: the shipped model; "none": the fallback alone (F1)
    detector: str = ""  # path of an ONNX file; empty: the shipped model
    temperature: Positive = 1.0  # of the softmax of the mask; above 1 it is less sure of itself
    ego_polygon: tuple[tuple[Fraction, Fraction], ...] = ()
    follow_roll: bool = True  # corridors stay level while the boat rolls
    max_roll_rad: NonNegative = 0.35  # 20 degrees; corridors are not turned further
    max_roll_age_s: Positive = 0.3  # older odometry says nothing about the roll in the picture
    journal_max_mib: NonNegative = 8.0  # P2: of the observations kept on disk, half an hour at 5 Hz; 0: none
    corridors: CorridorConfig = CorridorConfig()
    image_quality: ImageQualityConfig = ImageQualityConfig()
    detections: DetectorConfig = DetectorConfig()
    candidates: CandidateConfig = CandidateConfig()

    def __post_init__(self) -> None:
        """A hull has an area."""
        if 0 < len(self.ego_polygon) < 3:
            raise ValueError(f"ego_polygon: {len(self.ego_polygon)} corners enclose nothing")
