"""Figures: equal data give equal bytes, and a notebook shows friction over time."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from cylinder_friction.reporting.figures import plot
from cylinder_friction.reporting.print_figure import svg_text


def test_a_plot_shows_label_truth_estimate_and_bounds(strokes):
    recording = strokes[0]
    label_n = recording.column("friction_n")
    bounded = SimpleNamespace(friction_n=label_n + 1.0, lower_n=label_n - 20.0, upper_n=label_n + 20.0)
    (axis,) = plot(recording, bounded, truth_n=label_n - 1.0).axes
    assert [text.get_text() for text in axis.get_legend().get_texts()] == [
        "bounds",
        "label",
        "true friction",
        "estimate",
    ]
    assert axis.get_ylabel() == "friction [N]"
    drawn = {line.get_label(): np.asarray(line.get_ydata()) for line in axis.get_lines()}
    assert np.isnan(drawn["label"][:10]).all()  # the first ten rows are not usable
    assert drawn["estimate"] == pytest.approx(label_n + 1.0)


def test_an_estimate_alone_is_drawn_and_shown_in_a_notebook(strokes):
    figure = plot(strokes[0], strokes[0].column("friction_n").tolist())
    assert figure._repr_png_().startswith(b"\x89PNG")


def test_an_estimate_of_another_recording_is_refused(strokes):
    with pytest.raises(
        ValueError, match=r"estimate: got shape \(5,\), expected \(2000,\), one value per sample of rec"
    ):
        plot(strokes[0], np.zeros(5))


def test_an_svg_has_identifiers_of_its_own_and_a_name_for_screen_readers(strokes):
    figure = plot(strokes[0])
    one, other = (svg_text(figure, name, 'friction < "0"') for name in ("one", "two"))
    assert one.startswith('<svg role="img" aria-label="friction &lt; &quot;0&quot;"')
    assert "viewBox" in one
    assert 'pt"' not in one[:200]
    assert one.replace("one-", "") == other.replace("two-", "")
    assert "http" not in one
