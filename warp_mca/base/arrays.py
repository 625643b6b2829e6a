"""Owns short names for the types of arrays that most modules hand around."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int32]
