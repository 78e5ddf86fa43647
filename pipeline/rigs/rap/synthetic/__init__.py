"""The synthetic device on its bench, whose truth is known (rap.md, section 6)."""
