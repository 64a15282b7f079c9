"""Logs of drives: MCAP files. Only this package imports mcap."""
