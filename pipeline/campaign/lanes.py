"""Which campaigns can be made side by side: ``python -m pipeline.campaign.lanes`` prints DVC's targets, one lane a line.

DVC runs one stage after the other, but several ``dvc repro`` may run at once as long as no two of them make the same stage.
``make reports`` starts one for each lane.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from pipeline.campaign.project import Project
from pipeline.errors import InputError


def lanes(campaigns: Sequence[str], uses: Sequence[tuple[str, str]]) -> list[list[str]]:
    """Return the campaigns in groups of which none needs the findings of another.

    Parameters
    ----------
    campaigns
        All campaigns, in the order of `params.yaml`.
    uses
        Pairs of a campaign and one whose findings it builds on.

    Returns
    -------
    list of list of str
        The largest group first, since it takes longest; each in the given order.
    """
    group_of = {name: [name] for name in campaigns}
    for user, of in uses:
        if user in group_of and of in group_of and group_of[user] is not group_of[of]:
            joined = group_of[user] + group_of[of]
            group_of.update(dict.fromkeys(joined, joined))
    groups = {id(group): sorted(group, key=campaigns.index) for group in group_of.values()}
    return sorted(groups.values(), key=len, reverse=True)


if __name__ == "__main__":
    try:
        project = Project.around(Path.cwd())
        made = lanes(project.campaigns(), project.uses())
    except InputError as wrong:
        sys.exit(str(wrong))
    for group in made:
        print(*(f"report@{name}" for name in group))
