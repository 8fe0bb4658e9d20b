"""What a learned correction gains over the tuned low-pass that it corrects, and the share of it that holds."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from cylinder_friction.arrays import Array

LEAST_GAIN = 0.02
"""Smallest share of the low-pass's error that a correction must remove, or it is dropped."""


@dataclass(frozen=True)
class Gain:
    """Mean absolute errors against the label, less its session's offset, on sessions held out of training."""

    low_pass_n: float  # Of the tuned low-pass alone, mean over the recordings [N]
    corrected_n: float  # Of the low-pass with the share of the correction, mean over the recordings [N]
    share: float  # The factor, from 0 to 1, by which the correction is scaled

    @classmethod
    def of(cls, pairs: Sequence[Array]) -> Self:
        """Find the share of the corrections that comes nearest to the wanted ones.

        Recordings differ, in noise above all, so the share is best for the mean of their ratios of both errors. It is 0
        if even that mean is above ``1 - LEAST_GAIN``.

        Args:
            pairs: Correction and wanted correction [N] of each recording, of shape ``(2, rows)``.

        Example:
            >>> import numpy as np
            >>> from cylinder_friction.estimators.gain import Gain
            >>> Gain.of([np.array([[2.0, -4.0], [1.0, -2.0]])])
            Gain(low_pass_n=1.5, corrected_n=0.0, share=0.5)
        """
        shares = np.linspace(0.0, 1.0, 21)
        errors_n = np.array([[np.abs(share * own - wanted).mean() for share in shares] for own, wanted in pairs])
        ratios = (errors_n / errors_n[:, :1]).mean(axis=0)
        best = int(np.argmin(ratios))
        place = best if ratios[best] < 1.0 - LEAST_GAIN else 0
        return cls(float(errors_n[:, 0].mean()), float(errors_n[:, place].mean()), float(shares[place]))

    def in_words(self) -> str:
        """State the gain.

        Example:
            >>> from cylinder_friction.estimators.gain import Gain
            >>> Gain(9.0, 3.6, 1.0).in_words()
            'error 3.6 N, tuned low-pass 9.0 N, on sessions held out of training, less their offsets'
        """
        errors = f"error {self.corrected_n:.1f} N, tuned low-pass {self.low_pass_n:.1f} N"
        return f"{errors}, on sessions held out of training, less their offsets"
