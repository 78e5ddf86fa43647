from __future__ import annotations


def methods(findings):
    return []
