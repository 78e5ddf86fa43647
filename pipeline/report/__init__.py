"""Findings and declared sections -> one self-contained HTML file a campaign, and the index over them."""
