"""Types of arrays, by what they hold. Shapes stand in docstrings, such as uint8 [H, W, 3]: numpy's types carry none."""

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
F32 = NDArray[np.float32]
I64 = NDArray[np.int64]
U32 = NDArray[np.uint32]
U8 = NDArray[np.uint8]
Bools = NDArray[np.bool_]
