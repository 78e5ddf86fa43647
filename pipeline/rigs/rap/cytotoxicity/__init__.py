"""Cells in the fluid that went round the device, beside a control (rap.md, T9, 3.12)."""
