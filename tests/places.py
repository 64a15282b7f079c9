"""Where the checkout lies, and where the annotated pictures lie beside it."""

import os
from pathlib import Path

ROOT = Path(__file__).parents[1]
DATA = Path(os.environ.get("PAANI_DATA", ROOT.parent / "shared" / "data"))
