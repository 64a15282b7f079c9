"""The host side: MuJoCo plant, worlds, rendered eye."""
