"""Picture of one case: the frame, and the model's lines at the pose found."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from experiments.chart import OURS, PEER
from experiments.perception.milestones_cases import Case, Site
from experiments.perception.milestones_trials import certify
from knowledge_sources.methods.features.picture import read_picture
from knowledge_sources.methods.verification.line_check import check_lines
from world_models.entries.percepts import PoseFix, Segments
from world_models.entries.task import Certificate


def draw_case(site: Site, case: Case, path: Path) -> None:
    """Draw matched lines in blue and the others in orange (PNG)."""
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure

    view = certify(site, case)
    certificate, fix, segments = view.latest(Certificate), view.latest(PoseFix), view.latest(Segments)
    assert certificate is not None and fix is not None and segments is not None
    lines = np.array(case.milestone.expected, float).reshape(-1, 2, 3)
    agreed = check_lines(site.robot, lines, segments.value.segments_px, fix.value.world_from_robot)
    figure = Figure(figsize=(6.0, 6.4), dpi=110, layout="constrained")
    axes = figure.add_subplot()
    axes.imshow(read_picture(case.jpeg).color)
    found = np.nan_to_num(agreed.agreement.coverage) >= 0.5
    for some, colour in ((found, OURS), (~found, PEER)):
        shown = agreed.projected_px[some]
        axes.add_collection(LineCollection(list(shown[np.isfinite(shown).all(axis=(1, 2))]), colors=colour))
    c = certificate.value
    axes.set_title(f"{case.kind}: {c.verdict}, p_false {c.p_false:.2g}", fontsize=10)
    axes.set_axis_off()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, format="png")
