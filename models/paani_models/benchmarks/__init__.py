"""Public benchmarks: LaRS and MODS, their protocols and formats."""
