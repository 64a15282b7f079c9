"""`paani models prepare` and `pack`: check, prepare and bundle pictures; neither needs PyTorch."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from paani.errors import UserError
from paani.idle_options import refuse_options
from paani.option_numbers import quantity
from paani.option_paths import input_file, input_folder, output_file, output_folder, require_apart
from paani_models.datasets import inventory, mastr1325, waterscenes
from paani_models.datasets.manifest import count_boxes, format_counts_table
from paani_models.datasets.pack import WEIGHTS_FOLDER, pack_bundle
from paani_models.datasets.selection import PictureSelection

SETS = ("own", "waterscenes", "mastr1325")


def add_prepare_arguments(parser: argparse.ArgumentParser) -> None:
    """Beside --data, --sources and --rendered."""
    parser.add_argument("set", nargs="?", choices=SETS, default="own", help="own: the data folder (default)")
    parser.add_argument("--raw", type=input_folder("--raw"), help="public set: the folder in its official layout")
    parser.add_argument("--out", type=output_folder("--out"), help="public set: the new folder")
    parser.add_argument(
        "--manifest", type=output_file("--manifest"), help="own: write every picture, checksum and split to this file"
    )
    parser.add_argument("--by", choices=("sequence", "image"), default="sequence", help="mastr1325: image as the paper")
    parser.add_argument("--strict", action="store_true", help="waterscenes: refuse official splits that share views")
    parser.add_argument("--missing-is-empty", action="store_true", help="waterscenes: no label file, no object")


def add_pack_arguments(parser: argparse.ArgumentParser) -> None:
    """Beside --data, --sources and --rendered."""
    parser.add_argument("--out", type=output_file("--out"), required=True, help="the tar file")
    size_mb = quantity("MB", high=1e6)
    parser.add_argument("--max-mb", type=size_mb, default=60.0, help="its largest size, in millions of bytes")
    parser.add_argument(
        "--start", type=input_file("--start"), action="append", default=[], help="checkpoint to add, repeatable"
    )


def refuse_idle_options(parser: argparse.ArgumentParser, arguments: argparse.Namespace) -> None:
    """Raises UserError for an option of another set."""
    idle = {
        "own": ("--raw", "--out", "--by", "--strict", "--missing-is-empty"),
        "waterscenes": ("--manifest", "--by"),
        "mastr1325": ("--manifest", "--strict", "--missing-is-empty"),
    }
    refuse_options(parser, arguments, idle[arguments.set], f"is not for the set `{arguments.set}`")


def prepare_own(pictures: PictureSelection, manifest: Path | None) -> int:
    """Exit 0, or raise UserError."""
    inventory.check_own_pictures(pictures.samples, pictures.source_folder, manifest)
    return 0


def prepare_public(arguments: argparse.Namespace) -> int:
    """Exit 0, or raise UserError."""
    if arguments.raw is None or arguments.out is None:
        raise UserError(f"prepare {arguments.set}: needs --raw and --out")
    if arguments.set == "waterscenes":
        manifest, leaks = waterscenes.prepare_waterscenes(
            arguments.raw, arguments.out, missing_is_empty=arguments.missing_is_empty, strict=arguments.strict
        )
    else:
        manifest, leaks = mastr1325.prepare_mastr1325(arguments.raw, arguments.out, by=arguments.by)
    sys.stdout.write(format_counts_table(count_boxes(manifest)))
    if leaks:
        sys.stdout.write(f"{len(leaks)} pairs of different splits share a view, the first: {leaks[0]}\n")
    return 0


def make_bundle(arguments: argparse.Namespace, pictures: PictureSelection) -> int:
    """Exit 0, or raise UserError."""
    require_apart({"--out": arguments.out}, arguments.start)
    packed = pack_bundle(
        arguments.out,
        pictures.samples,
        pictures.source_folder,
        max_mb=arguments.max_mb,
        weights=sorted((pictures.data / WEIGHTS_FOLDER).glob("*")),
        start=arguments.start,
    )
    sys.stdout.write(
        f"{arguments.out}: {packed.size_bytes} bytes, {packed.pictures} pictures, JPEG quality {packed.quality}\n"
    )
    return 0
