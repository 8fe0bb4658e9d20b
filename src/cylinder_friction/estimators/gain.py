"""What a learned correction gains over the tuned low-pass that it corrects, and the share of it that holds."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from cylinder_friction.arrays import Array

LEAST_GAIN = 0.02
"""Smallest share of the low-pass's error that a correction must remove; else it is dropped."""


@dataclass(frozen=True)
class Gain:
    """Mean absolute errors against the label, less its session's offset, on sessions held out of training."""

    low_pass_n: float  # Of the tuned low-pass alone [N]
    corrected_n: float  # Of the low-pass with the share of the correction [N]
    share: float  # The factor, from 0 to 1, by which the correction is scaled

    @classmethod
    def of(cls, pairs: Sequence[Array]) -> Self:
        """Find the share of corrections that comes nearest to the wanted ones, by mean absolute error.

        It is 0 if even that removes less than ``LEAST_GAIN`` of the low-pass's error.

        Args:
            pairs: Corrections and wanted corrections [N], each of shape ``(2, rows)``.

        Example:
            >>> import numpy as np
            >>> from cylinder_friction.estimators.gain import Gain
            >>> Gain.of([np.array([[2.0, -4.0], [1.0, -2.0]])])
            Gain(low_pass_n=1.5, corrected_n=0.0, share=0.5)
        """
        corrections_n, wanted_n = np.concatenate(pairs, axis=1)
        errors_n = {share: np.abs(share * corrections_n - wanted_n).mean() for share in np.linspace(0.0, 1.0, 21)}
        best = min(errors_n, key=lambda each: errors_n[each])
        share = best if errors_n[best] < (1.0 - LEAST_GAIN) * errors_n[0.0] else 0.0
        return cls(float(errors_n[0.0]), float(errors_n[share]), float(share))

    def in_words(self) -> str:
        """State the gain.

        Example:
            >>> from cylinder_friction.estimators.gain import Gain
            >>> Gain(9.0, 3.6, 1.0).in_words()
            'error 3.6 N, tuned low-pass 9.0 N, on sessions held out of training, less their offsets'
        """
        errors = f"error {self.corrected_n:.1f} N, tuned low-pass {self.low_pass_n:.1f} N"
        return f"{errors}, on sessions held out of training, less their offsets"
