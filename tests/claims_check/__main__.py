"""`python -m tests.claims_check`: whether the tests of the paper's statements fail when the product does otherwise.

Each proved row of `tests/claims.toml` has mutants: small changes of the product, which its tests must catch. Each is
applied in a copy of the checkout, where the row's tests run alone.
"""

from __future__ import annotations

import argparse
import random
import sys
from collections import Counter
from pathlib import Path

from tqdm import tqdm

from paani.errors import UserError
from tests.claims_check.table import Row, find_faults, read_table
from tests.claims_check.tree import copied_tree, digest_of
from tests.claims_check.trial import Record, Verdict, try_rows
from tests.places import ROOT

TENTH = 10


def main(argv: list[str], root: Path = ROOT) -> int:
    """0: every mutant was killed; 1: one survived, or a test failed or skipped unbroken; 2: the table is wrong."""
    parser = argparse.ArgumentParser(prog="python -m tests.claims_check", description=__doc__.partition("\n")[0])
    parser.add_argument("--rows", nargs="+", metavar="ID", help="only these rows")
    parser.add_argument("--tiers", nargs="+", metavar="TIER", help="only rows whose tests all lie in these folders")
    parser.add_argument("--tenth", metavar="SEED", help="a tenth of the rows, drawn by this seed")
    parser.add_argument("--shard", metavar="I/N", help="part I of N, counted from 1")
    parser.add_argument("--record", type=Path, metavar="FILE", help="verdicts (default: runs/claims-check.jsonl)")
    options = parser.parse_args(argv)
    try:
        table = read_table(root)
        faults = find_faults(table, root)
        chosen = choose_rows(table, options.rows, options.tiers, options.tenth, options.shard)
    except UserError as error:
        faults, table, chosen = [str(error)], {}, {}
    if faults:
        print("\n".join(faults), file=sys.stderr)
        return 2
    verdicts = check_rows(chosen, root, options.record or root / "runs" / "claims-check.jsonl")
    print(summary(chosen, verdicts))
    return 0 if all(verdict.state == "killed" for verdict in verdicts) else 1


def choose_rows(
    table: dict[str, Row], names: list[str] | None, tiers: list[str] | None, tenth: str | None, shard: str | None
) -> dict[str, Row]:
    """Rows with mutants, narrowed one choice after the other. Raises UserError for a row or a part that is not."""
    for name in names or ():
        if name not in table:
            raise UserError(f"--rows: {name}: no such row")
        if not table[name].mutant:
            raise UserError(f"--rows: {name}: has no mutant")
    chosen = [name for name, row in table.items() if row.mutant and (not names or name in names)]
    if tiers:
        chosen = [name for name in chosen if all(test.split("/")[1] in tiers for test in table[name].test)]
    if tenth is not None:
        drawn = random.Random(tenth).sample(chosen, -(-len(chosen) // TENTH))
        chosen = [name for name in chosen if name in drawn]
    if shard is not None:
        part, _, parts = shard.partition("/")
        if not (part.isdecimal() and parts.isdecimal() and 1 <= int(part) <= int(parts)):
            raise UserError(f"--shard: {shard}: is not I/N with 1 <= I <= N")
        chosen = chosen[int(part) - 1 :: int(parts)]
    return {name: table[name] for name in chosen}


def check_rows(rows: dict[str, Row], root: Path, record: Path) -> list[Verdict]:
    """Try every mutant of these rows in a copy of `root`, with a line for each that is not killed."""
    verdicts = []
    with copied_tree(root) as tree:
        trials = try_rows(rows, tree, digest_of(tree.root), Record(record))
        total = sum(len(row.mutant) for row in rows.values())
        for verdict in tqdm(trials, total=total, unit="mutant", disable=None):
            verdicts.append(verdict)
            if verdict.state != "killed":
                tqdm.write(f"{verdict.row}: {verdict.state}: {verdict.mutant} ({verdict.why})")
    return verdicts


def summary(rows: dict[str, Row], verdicts: list[Verdict]) -> str:
    """A line of counts."""
    counts = Counter(verdict.state for verdict in verdicts)
    return (
        f"{len(rows)} rows, {len(verdicts)} mutants: {counts['killed']} killed, {counts['survived']} survived, "
        f"{counts['error']} errors"
    )


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
