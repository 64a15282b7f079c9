"""Where the checkout and its packages lie, and where the annotated pictures lie beside it."""

import os
from pathlib import Path

ROOT = Path(__file__).parents[1]
PRODUCT = ("shared", "services", "sim_host", "models")  # folders of packages, in what a user installs
DATA = Path(os.environ.get("PAANI_DATA", ROOT.parent / "shared" / "data"))
