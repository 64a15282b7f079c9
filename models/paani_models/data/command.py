"""`paani models prepare` and `pack`: what can be done with pictures where PyTorch is not installed."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from paani.errors import UserError
from paani_models.data import inventory, mastr1325, waterscenes
from paani_models.data.leaks import Leak
from paani_models.data.manifest import SourceManifest, count_boxes, counts_table
from paani_models.data.pack import WEIGHTS_FOLDER, pack
from paani_models.sources import RENDERED, Sample, Source, choose, read_samples

SETS = ("own", "waterscenes", "mastr1325")


def add_prepare_arguments(parser: argparse.ArgumentParser) -> None:
    """Beside --data, --sources and --rendered."""
    parser.add_argument("set", nargs="?", choices=SETS, default="own", help="own: the data folder (default)")
    parser.add_argument("--raw", type=Path, help="public set: the folder in its official layout")
    parser.add_argument("--out", type=Path, help="public set: the new folder")
    parser.add_argument("--manifest", type=Path, help="own: write every picture, checksum and split to this file")
    parser.add_argument("--by", choices=("sequence", "image"), default="sequence", help="mastr1325: image as the paper")
    parser.add_argument("--strict", action="store_true", help="waterscenes: refuse official splits that share views")
    parser.add_argument("--missing-is-empty", action="store_true", help="waterscenes: no label file, no object")


def add_pack_arguments(parser: argparse.ArgumentParser) -> None:
    """Beside --data, --sources and --rendered."""
    parser.add_argument("--out", type=Path, required=True, help="the tar file")
    parser.add_argument("--max-mb", type=float, default=60.0, help="its largest size, in millions of bytes")
    parser.add_argument("--start", type=Path, action="append", default=[], help="checkpoint to add, repeatable")


def prepare(arguments: argparse.Namespace) -> int:
    """Exit 0, or raise UserError."""
    if arguments.set == "own":
        samples = _samples(arguments)
        inventory.prepare(samples, _Folders(arguments), arguments.manifest)
        return 0
    if arguments.raw is None or arguments.out is None:
        raise UserError(f"prepare {arguments.set}: needs --raw and --out")
    if arguments.set == "waterscenes":
        _tell(
            *waterscenes.prepare(
                arguments.raw,
                arguments.out,
                missing_is_empty=arguments.missing_is_empty,
                strict=arguments.strict,
            )
        )
    else:
        _tell(*mastr1325.prepare(arguments.raw, arguments.out, by=arguments.by))
    return 0


def make_bundle(arguments: argparse.Namespace) -> int:
    """Exit 0, or raise UserError."""
    weights = sorted((arguments.data / WEIGHTS_FOLDER).glob("*"))
    packed = pack(
        arguments.out,
        _samples(arguments),
        _Folders(arguments),
        max_mb=arguments.max_mb,
        weights=weights,
        start=arguments.start,
    )
    sys.stdout.write(
        f"{arguments.out}: {packed.size_bytes} bytes, {packed.pictures} pictures, JPEG quality {packed.quality}\n"
    )
    return 0


def rendered_folder(data: Path, given: Path | None) -> Path | None:
    """Rendered pictures: as given, else those of an unpacked bundle."""
    return given or (data / RENDERED if (data / RENDERED / "manifest.json").is_file() else None)


class _Folders:
    """Where a source lies."""

    def __init__(self, arguments: argparse.Namespace) -> None:
        self.data, self.rendered = arguments.data, rendered_folder(arguments.data, arguments.rendered)

    def __call__(self, source: Source) -> Path:
        return self.rendered if source.name == RENDERED and self.rendered else self.data / source.folder


def _samples(arguments: argparse.Namespace) -> list[Sample]:
    if not arguments.data.is_dir():
        raise UserError(f"{arguments.data}: no such folder; set PAANI_DATA or --data")
    names = [name for name in arguments.sources.split(",") if name]
    return read_samples(arguments.data, choose(names), rendered_folder(arguments.data, arguments.rendered))


def _tell(manifest: SourceManifest, leaks: list[Leak]) -> None:
    sys.stdout.write(counts_table(count_boxes(manifest)))
    if leaks:
        sys.stdout.write(f"{len(leaks)} pairs of different splits share a view, the first: {leaks[0]}\n")
