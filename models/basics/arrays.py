"""Arrays of numbers by their names: `FloatArray`, `ComplexArray`, `BoolArray`, `IndexArray`."""

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
BoolArray = npt.NDArray[np.bool_]
IndexArray = npt.NDArray[np.intp]
