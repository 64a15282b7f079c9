"""`paani models`: look at the training data, train, export, evaluate, check what is shipped.

Only the sub-commands that need PyTorch import it, so `paani models check` runs where it is not installed.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from paani.errors import UserError
from paani.idle_options import refuse_options
from paani.option_numbers import quantity, whole_number
from paani.option_paths import input_file, input_folder, output_folder
from paani_models.catalogue import OTHER_SETS, WEIGHTS, load_catalogue, verified_path
from paani_models.commands import engines as engine_command
from paani_models.commands import evaluate as evaluate_command
from paani_models.commands import prepare as prepare_command
from paani_models.commands import report as report_command
from paani_models.commands import small_obstacles as small_obstacles_command
from paani_models.commands import temperature as temperature_command
from paani_models.datasets.selection import PictureSelection, source_names
from paani_models.datasets.sources import list_pictures_without_water
from paani_models.engines.contract_check import infer_role, inspect_model
from paani_models.report.manifest_figures import measure_detector, measure_segmenter
from paani_models.report.model_card import render_model_card

DATA_VARIABLE = "PAANI_DATA"
PAIR = ("segmenter", "detector")
MAX_EPOCHS, MAX_BATCH, MAX_DRAWS = 9999, 4096, 100.0
MAX_SEED = 2**63 - 1  # PyTorch takes no more
TRAINABLE = ("segmenter", "paper-segmenter", "detector", "yolo11n", "gate")
SEGMENTERS = ("segmenter", "paper-segmenter")
OPTION_USERS = {
    "--teacher": ("paper-segmenter",),
    "--labels-from": (*SEGMENTERS, "gate"),
    "--stage": SEGMENTERS,
    "--epochs": ("detector", "yolo11n", "gate"),
    "--batch": (*SEGMENTERS, "detector"),
    "--blend": ("detector",),
    "--mean-with": ("detector",),
    "--draws": ("detector",),
    "--size": ("detector",),
    "--unchecked": ("gate",),
    "--seed": (*SEGMENTERS, "detector", "gate"),
    "--without": ("paper-segmenter",),
}  # of `train`: which networks take an option that not all of them do


def data_folder() -> Path:
    """The folder of annotated pictures: $PAANI_DATA, or shared/data beside the checkout; it may be missing.

    Raises UserError for a name that no folder can have.
    """
    beside = Path(__file__).resolve().parents[4] / "shared" / "data"
    folder = Path(os.environ.get(DATA_VARIABLE) or beside)
    try:
        folder.exists()
    except OSError as error:
        raise UserError(f"{DATA_VARIABLE} {folder}: {error.strerror}") from error
    return folder


def main(argv: list[str]) -> int:
    """Run one sub-command; 0 on success, 2 with one line on a user's mistake."""
    parser = _parser()
    arguments = parser.parse_args(argv)
    try:
        _refuse_idle_options(parser, arguments)
        if arguments.command == "check":
            return _check_file(arguments) if arguments.model else _check_weights(arguments.weights)
        if arguments.command == "card":
            others = {name: load_catalogue(folder) for name, folder in _sets_beside(arguments.weights).items()}
            sys.stdout.write(render_model_card(load_catalogue(arguments.weights), others))
            return 0
        if arguments.command == "prepare":
            if arguments.set != "own":
                return prepare_command.prepare_public(arguments)
            return prepare_command.prepare_own(_select_pictures(arguments), arguments.manifest)
        if arguments.command == "held-out":
            return _list_held_out(_select_pictures(arguments), arguments.without_water)
        if arguments.command == "pack":
            return prepare_command.make_bundle(arguments, _select_pictures(arguments))
        if arguments.command == "evaluate":
            if arguments.lars or arguments.mods:
                return evaluate_command.run_benchmark(arguments)
            return evaluate_command.run(arguments, _select_pictures(arguments))
        if arguments.command == "temperature":
            return temperature_command.run(arguments, _select_pictures(arguments))
        if arguments.command == "small-obstacles":
            return small_obstacles_command.run(arguments, _select_pictures(arguments))
        if arguments.command == "report":
            return report_command.run(arguments, _select_pictures(arguments))
        if arguments.command == "quantise":
            return _quantise(arguments)
        if arguments.command == "convert":
            return engine_command.convert(arguments)
        if arguments.command == "bench":
            return engine_command.bench(arguments)
        if arguments.command == "variant":
            return _write_variants(arguments.weights, arguments.out)
        return _train_or_export(arguments)
    except UserError as error:
        sys.stderr.write(f"paani models: {error}\n")
        return 2
    except KeyboardInterrupt:
        resumes = arguments.command == "train"
        sys.stderr.write(f"stopped{'; the same command goes on from the last finished epoch' if resumes else ''}\n")
        return 130


def _refuse_idle_options(parser: argparse.ArgumentParser, arguments: argparse.Namespace) -> None:
    """Raises UserError for an option that the sub-command, as it was called, would pass over."""
    if arguments.command == "train":
        idle = [name for name, nets in OPTION_USERS.items() if arguments.net not in nets]
        refuse_options(parser, arguments, idle, f"{arguments.net} has no use for it")
    elif arguments.command == "export" and arguments.untrained:
        refuse_options(parser, arguments, ("--looks-at", "--mean-with", "--share"), "is of a checkpoint")
    elif arguments.command == "check" and arguments.model is None:
        refuse_options(parser, arguments, ("--role", "--score"), "is of a MODEL.onnx")
    elif arguments.command == "check":
        refuse_options(parser, arguments, ("--weights",), "is not for a MODEL.onnx")
    elif arguments.command == "evaluate":
        evaluate_command.refuse_idle_options(parser, arguments)
    elif arguments.command == "prepare":
        prepare_command.refuse_idle_options(parser, arguments)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="paani models", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)

    check = commands.add_parser("check", help="compare the shipped files with their manifest, or judge a file of yours")
    check.add_argument("model", type=input_file(), nargs="?", metavar="MODEL.onnx", help="what it lacks to be run here")
    check.add_argument("--role", choices=PAIR, help="inferred from the output if not given")
    check.add_argument("--score", action="store_true", help="also its figures on the held-out pictures of --data")
    check.add_argument("--weights", type=input_folder("--weights"), default=WEIGHTS)

    model_card = commands.add_parser("card", help="print the model card of a weights folder, as Markdown")
    model_card.add_argument("--weights", type=input_folder("--weights"), default=WEIGHTS)

    held_out = commands.add_parser("held-out", help="list the held-out pictures, for `paani faults --pictures`")
    held_out.add_argument("--without-water", action="store_true", help="only those that show no water; else all others")
    check_data = commands.add_parser("prepare", help="check and count the pictures; or prepare a public set")
    prepare_command.add_prepare_arguments(check_data)
    pack = commands.add_parser("pack", help="a training bundle of bounded size, as one tar")
    prepare_command.add_pack_arguments(pack)
    train = commands.add_parser("train", help="train a net; goes on where it was stopped")
    train.add_argument("net", choices=TRAINABLE)
    train.add_argument(
        "--folder", type=output_folder("--folder"), required=True, help="checkpoints and records go here"
    )
    train.add_argument(
        "--start",
        type=input_file("--start"),
        help="checkpoint, or exported ONNX file, to begin from; for gate: an exported one",
    )
    train.add_argument(
        "--teacher", type=input_file("--teacher"), help="segmenter checkpoint that the paper-segmenter learns from"
    )
    train.add_argument(
        "--labels-from",
        type=input_file("--labels-from"),
        help="segmenter checkpoint that labels unsegmented pictures; for gate: ONNX file whose errors it learns",
    )
    train.add_argument("--stage", action="append", default=[], metavar="EPOCHSxHEIGHTxWIDTH", help="repeatable")
    train.add_argument("--epochs", type=whole_number(1, MAX_EPOCHS), help="detector, yolo11n and gate")
    train.add_argument(
        "--batch", type=whole_number(1, MAX_BATCH), help="detector and segmenters: pictures a step; 16 if not given"
    )
    train.add_argument("--peak-rate", type=quantity("a rate", high=10.0))
    train.add_argument(
        "--blend",
        type=quantity("a share", high=1.0, with_low=True),
        metavar="SHARE",
        help="detector: learn from both off-the-shelf networks too, starting with this share of YOLOX-nano's weights;"
        " the first stages stay as they are above 0, and where they are YOLOX-nano's",
    )
    train.add_argument(
        "--mean-with",
        type=input_file("--mean-with"),
        metavar="FILE",
        help="detector: start from the mean of --start's weights and these",
    )
    train.add_argument(
        "--draws",
        type=quantity("a share", high=MAX_DRAWS),
        default=1.0,
        metavar="SHARE",
        help="detector: of an epoch's pictures",
    )
    train.add_argument("--size", metavar="HEIGHTxWIDTH", help="detector: of its input; 320x416 if not given")
    train.add_argument("--unchecked", action="store_true", help="gate: also on the sequences that choose its threshold")
    train.add_argument(
        "--seed", type=whole_number(0, MAX_SEED), metavar="N", help="detector, segmenters and gate; 42 if not given"
    )
    train.add_argument(
        "--without",
        action="append",
        default=[],
        choices=("flip", "jitter", "glare"),
        help="paper-segmenter: leave this augmentation out, to see what it is worth; repeatable",
    )
    train.add_argument("--threads", type=whole_number(1, 64), default=2)
    export = commands.add_parser("export", help="checkpoint to ONNX, compared on real pictures")
    export.add_argument("net", choices=TRAINABLE)
    exported = export.add_mutually_exclusive_group(required=True)
    exported.add_argument("--checkpoint", type=input_file("--checkpoint"))
    exported.add_argument("--untrained", action="store_true", help="random weights, to measure the speed of its shape")
    export.add_argument(
        "--looks-at", metavar="HEIGHTxWIDTH", help="segmenters: the picture inside, of a training that ended smaller"
    )
    export.add_argument(
        "--mean-with",
        type=input_file("--mean-with"),
        metavar="FILE",
        help="detector, gate: the mean of the checkpoint's weights and these",
    )
    export.add_argument(
        "--share",
        type=quantity("a share", high=1.0, with_low=True),
        help="of --mean-with's weights in it; 0.5 if not given",
    )
    evaluate = commands.add_parser("evaluate", help="figures of the exported nets on held-out sequences")
    evaluate_command.add_arguments(evaluate)
    report = commands.add_parser("report", help="one page of tables, curves and pictures, outside the repository")
    report_command.add_arguments(report)
    temperature = commands.add_parser(
        "temperature", help="how far the mask's confidence is to be trusted, and a better temperature"
    )
    temperature_command.add_arguments(temperature)
    small_obstacles = commands.add_parser(
        "small-obstacles", help="how many of the small obstacles near the boat are seen"
    )
    small_obstacles_command.add_arguments(small_obstacles)
    export.add_argument("--weights", type=output_folder("--weights"), default=WEIGHTS)
    for command in (evaluate, report, temperature, small_obstacles):
        command.add_argument("--weights", type=input_folder("--weights"), default=WEIGHTS)
    variant = commands.add_parser("variant", help="the same nets, taking pictures as bytes: a little faster")
    variant.add_argument("--out", type=output_folder("--out"), required=True, help="folder for nets and manifest")
    variant.add_argument("--weights", type=input_folder("--weights"), default=WEIGHTS)
    convert = commands.add_parser("convert", help="ONNX to ncnn, compared on real pictures; needs pnnx")
    engine_command.add_convert_arguments(convert)
    bench = commands.add_parser("bench", help="which engine runs the nets faster on this machine")
    engine_command.add_bench_arguments(bench)
    bench.add_argument("--weights", type=input_folder("--weights"), default=WEIGHTS)
    quantise = commands.add_parser("quantise", help="FP32 to INT8, and whether it may take FP32's place")
    quantise.add_argument("net", choices=PAIR)
    quantise.add_argument("--recipe", choices=("paper", "equalised"), default="equalised")
    quantise.add_argument(
        "--model", type=input_file("--model"), metavar="FILE", help="FP32 ONNX file; the shipped one if not given"
    )
    quantise.add_argument("--out", type=output_folder("--out"), default="runs/int8", help="default: runs/int8")
    quantise.add_argument(
        "--calibrate",
        type=input_file("--calibrate"),
        metavar="FILE",
        help="calibrate on the training pictures it lists",
    )
    quantise.add_argument("--for-size", action="store_true", help="accept a slower net for its smaller file")
    measuring = (evaluate, report, temperature, small_obstacles, quantise, convert, bench)
    for command in (check, held_out, check_data, pack, train, export, *measuring):
        command.add_argument("--data", type=input_folder("--data"), default=data_folder())
        command.add_argument(
            "--sources", type=source_names, default=[], help="comma-separated, or `open`; all if not given"
        )
        command.add_argument("--rendered", type=input_folder("--rendered"), help="folder of rendered pictures")
    return parser


def _list_held_out(pictures: PictureSelection, without_water: bool) -> int:
    """without_water: also pictures that show no water and belong to no source."""
    if without_water:
        trained = {sample.picture for sample in pictures.training_samples()}
        listed = {pictures.data / name for name in list_pictures_without_water()}
        held = {picture for picture in listed - trained if picture.is_file()}
    else:
        held = {sample.picture for sample in pictures.samples if sample.held_out and not sample.without_water}
    sys.stdout.write("".join(f"{path.relative_to(pictures.data).as_posix()}\n" for path in sorted(held)))
    return 0


def _check_weights(weights: Path) -> int:
    """The set of a folder, and with the shipped one the sets beside it."""
    for kind, folder in {"": weights, **{f"{name} ": folder for name, folder in _sets_beside(weights).items()}}.items():
        for name, model in load_catalogue(folder).items():
            verified_path(name, folder)
            size = f"{model.size_bytes} bytes, {model.parameters} parameters"
            sys.stdout.write(f"{kind}{name}: {model.file} {size}, ok\n")
    return 0


def _sets_beside(weights: Path) -> dict[str, Path]:
    """Folders of the sets beside the shipped one; none beside another."""
    return OTHER_SETS if weights == WEIGHTS else {}


def _check_file(arguments: argparse.Namespace) -> int:
    """0 where the model can be used, 1 where it cannot."""
    role = infer_role(arguments.model, arguments.role)
    findings = inspect_model(arguments.model, role)
    for finding in findings:
        sys.stdout.write(f"{finding.level:8} {finding.text}\n")
    usable = all(finding.level != "error" for finding in findings)
    if usable and arguments.score:
        pictures = _select_pictures(arguments)
        if role == "segmenter":
            figures = measure_segmenter(arguments.model, pictures.segmented_samples(held_out=True))
        else:
            figures = measure_detector(arguments.model, pictures.boxed_samples(held_out=True))
        for figure in figures:
            sys.stdout.write(f"{'score':8} {figure.metric} on {figure.source}: {figure.value:.3f} (n {figure.n})\n")
    use = f"paani up --set perception.{role}={arguments.model}"
    sys.stdout.write(f"{arguments.model}: {f'can be used: {use}' if usable else 'cannot be used as it is'}\n")
    return 0 if usable else 1


def _select_pictures(arguments: argparse.Namespace) -> PictureSelection:
    strict = arguments.command == "prepare"
    return PictureSelection(arguments.data, arguments.sources, arguments.rendered, strict=strict)


def _write_variants(weights: Path, out: Path) -> int:
    try:
        from paani_models.engines.runtime_variant import write_variant  # noqa: PLC0415 - onnx is not on the board
    except ModuleNotFoundError as error:
        raise UserError(f"{error.name} is not installed; install the extra paani[train]") from error
    for name in PAIR:
        model = write_variant(name, load_catalogue(weights)[name], verified_path(name, weights), out)
        sys.stdout.write(f"--set perception.{name}={out / model.file}\n")
    return 0


def _quantise(arguments: argparse.Namespace) -> int:
    try:
        from paani_models.commands import quantise as quantise_command  # noqa: PLC0415 - onnx is not on the board
    except ModuleNotFoundError as error:
        raise UserError(f"{error.name} is not installed; install the extra paani[train]") from error
    return quantise_command.run(arguments, _select_pictures(arguments))


def _train_or_export(arguments: argparse.Namespace) -> int:
    try:
        from paani_models.recipes import train_and_export  # noqa: PLC0415 - PyTorch is not on the board
    except ModuleNotFoundError as error:
        raise UserError(f"{error.name} is not installed; install the extra paani[train]") from error
    if arguments.command == "export" and arguments.untrained:
        return train_and_export.export_untrained_network(arguments.net, arguments.weights)
    pictures = _select_pictures(arguments)
    if arguments.command == "train":
        options = train_and_export.TrainingOptions(
            folder=arguments.folder,
            start=arguments.start,
            teacher=arguments.teacher,
            labels_from=arguments.labels_from,
            stages=tuple(arguments.stage),
            epochs=arguments.epochs,
            peak_rate=arguments.peak_rate,
            unchecked=arguments.unchecked,
            blend=arguments.blend,
            mean_with=arguments.mean_with,
            draws_frac=arguments.draws,
            size=arguments.size,
            batch=arguments.batch,
            seed=arguments.seed,
            without=tuple(arguments.without),
        )
        train_and_export.train_network(arguments.net, pictures, options, arguments.threads)
    else:
        train_and_export.export_checkpoint(
            arguments.net,
            arguments.checkpoint,
            arguments.weights,
            pictures,
            looks_at=arguments.looks_at,
            mean_with=arguments.mean_with,
            share=arguments.share,
        )
    return 0
